"""phexfab in build123d: objects for builders and for algebra. Lengths are in mm.

``PhexShell`` is a whole shell, or chosen parts of one, as a labelled and coloured tree with a joint
at every node; ``PhexPart`` is a single panel, beam or hub with joints on it. ``phex_build`` makes
the build from a wire or face; ``locations`` are places on nodes, panels and beams.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from phexfab.cad.build123d import locations, to_build123d
from phexfab.cad.doctor import require
from phexfab.cad.tags import Tags, beams_below, face_tags, plain_tag
from phexfab.cad.tree import Part, families, parts_of
from phexfab.errors import PartError
from phexfab.fabrication.marks import node_marks
from phexfab.fabrication.parts import Beam, Node
from phexfab.pipeline import Build
from phexfab.scripting import build_on as phex_build

if TYPE_CHECKING:
    import build123d as b3d
    from build123d.topology import Shape
else:
    b3d = require("build123d")

__all__ = ["PhexPart", "PhexShell", "locations", "phex_build"]

Align = b3d.Align | tuple[b3d.Align, b3d.Align, b3d.Align] | None


class PhexShell(b3d.BasePartObject):
    """Part Object: a shell of planar hexagons.

    Parameters
    ----------
    source : a build, or its ``Parts``
    names : str or sequence of str, optional
        Marks or families (``panels``, ``beams``, ``nodes``); all parts by default.
    rotation : RotationLike
        Angles about the axes, degrees.
    align : Align or three of them, optional
        The shell stays where the build has it by default.
    mode : Mode
        How a ``BuildPart`` takes it up. Touching solids fuse there into one part; the tree stays
        as it is in the object, and is all there is with ``Mode.PRIVATE``.

    Attributes
    ----------
    children
        Compounds ``panels``, ``beams``, ``nodes`` of solids labelled by their marks.
    joints
        A ``RigidJoint`` at every node of a build, by the node's mark: z along the node axis, away
        from the beams.

    Raises
    ------
    PartError
        If there is no such part.
    """

    def __init__(
        self,
        source: Any,
        names: Sequence[str] | str | None = None,
        rotation: b3d.RotationLike = (0, 0, 0),
        align: Align = None,
        mode: b3d.Mode = b3d.Mode.ADD,
    ) -> None:
        parts, name = parts_of(source), "shell"
        at: dict[str, b3d.Location] = {}
        if isinstance(source, Build):
            name, at = source.design.name, locations(source, "nodes")
        _set_up(self, to_build123d(parts, name, names), at, rotation, align, mode)
        below = beams_below(parts)
        self._tags = {
            part.mark: face_tags(part, below) for family in families(parts) for part in family.parts
        }

    def part(self, mark: str) -> b3d.Solid:
        """Return the solid of a part by its mark, where it stands now.

        Raises
        ------
        PartError
            If the shell has no such part.
        """
        leaf = next((leaf for leaf in self.leaves if leaf.label == mark), None)
        if leaf is None:
            raise PartError(f"there is no part {mark!r} in {self.label}")
        return _placed(leaf, leaf.global_location)

    def tagged(self, mark: str, tag: str) -> b3d.ShapeList[b3d.Face]:
        """Return the faces of a part that carry a tag, such as ``top`` or ``side_1``.

        See ``phexfab.cad.tags.face_tags`` for the tags.
        """
        return _with_tag(self.part(mark), self._tags[mark], tag)


class PhexPart(b3d.BasePartObject):
    """Part Object: one panel, beam or hub of a build, at the origin.

    Its frame is that of ``locations``: the origin on the middle of a panel's or beam's top, z out
    of it, x along the panel's longest direction or along the beam; a hub's is that of its node.

    Parameters
    ----------
    source : a build
    mark : str
    rotation, align, mode
        As for ``PhexShell``.

    Attributes
    ----------
    place : Location
        Where it stands in the shell: ``part.place * part``.
    metadata : dict
        What the parts list says of it.
    joints
        A ``RigidJoint`` at every node that it touches, by the node's mark.

    Raises
    ------
    PartError
        If there is no such part.
    """

    def __init__(
        self,
        source: Build,
        mark: str,
        rotation: b3d.RotationLike = (0, 0, 0),
        align: Align = None,
        mode: b3d.Mode = b3d.Mode.ADD,
    ) -> None:
        parts = parts_of(source)
        own = {part.mark: part for family in families(parts) for part in family.parts}
        if mark not in own:
            raise PartError(f"there is no part {mark!r}; marks run from {min(own)} to {max(own)}")
        leaf = to_build123d(parts, names=mark).leaves[0]
        self.place = locations(source, mark)[mark]
        self.metadata = leaf.metadata
        self._tags = face_tags(own[mark], beams_below(parts))
        back = self.place.inverse()
        around = locations(source, _nodes_at(source, own[mark]))
        at = {node: back * location for node, location in around.items()}
        colour = leaf.color
        _set_up(self, _placed(leaf, back), at, rotation, align, mode)
        self.color = colour

    def tagged(self, tag: str) -> b3d.ShapeList[b3d.Face]:
        """Return the faces that carry a tag, such as ``top``; see ``PhexShell.tagged``."""
        return _with_tag(self, self._tags, tag)


def _set_up(
    made: b3d.BasePartObject,
    shape: Shape,
    joints: dict[str, b3d.Location],
    rotation: b3d.RotationLike,
    align: Align,
    mode: b3d.Mode,
) -> None:
    """Make an object of a shape with joints; turned and aligned as a whole, children and all.

    ``BasePartObject`` turns its own topology only, and loses that when it takes the children.
    """
    turn = b3d.Rotation(*rotation) if isinstance(rotation, tuple) else rotation
    place = b3d.Location(turn)
    if align is not None:
        sides = align if isinstance(align, tuple) else (align,) * 3
        place = place * b3d.Location(shape.bounding_box().to_align_offset(sides))
    b3d.BasePartObject.__init__(made, part=shape, mode=mode)
    made.rotation = turn
    for label, location in joints.items():
        b3d.RigidJoint(label, made, location)
    made.location = place * made.location


def _placed(leaf: b3d.Solid, location: b3d.Location) -> b3d.Solid:
    """Return a solid of its own at a location, without the tree that a copy would take along."""
    from OCP.TopoDS import TopoDS

    shape = b3d.Solid(TopoDS.Solid(leaf.wrapped.Located(location.wrapped)))
    shape.label, shape.color, shape.metadata = leaf.label, leaf.color, leaf.metadata
    return shape


def _with_tag(shape: Shape, tags: Tags, tag: str) -> b3d.ShapeList[b3d.Face]:
    own, wanted = zip(shape.faces(), tags, strict=True), plain_tag(tag)
    return b3d.ShapeList(face for face, names in own if wanted in names)


def _nodes_at(source: Build, part: Part) -> list[str]:
    """Return the marks of the nodes that a part touches."""
    if isinstance(part, Node):
        return [part.mark]
    if isinstance(part, Beam):
        return list(part.nodes)
    mesh = source.shell.mesh
    marks = node_marks(source.shell)
    return [marks[v] for v in mesh.corners[mesh.starts[part.face] : mesh.starts[part.face + 1]]]

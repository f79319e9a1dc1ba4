"""CadQuery objects: solids, an ``Assembly``, tags of faces and edges, locations.

Only CadQuery's own types come out, so that its editor, exporters and selectors take them.
``phexfab.cadquery`` adds what is here to ``Workplane`` and ``Assembly``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

from phexfab.cad.brep import to_shapes
from phexfab.cad.doctor import require
from phexfab.cad.tags import beams_below, face_tags, frames
from phexfab.cad.tree import Part, chosen, families, material, metadata, parts_of
from phexfab.fabrication.parts import Parts

if TYPE_CHECKING:
    from cadquery import Assembly, Location, Shape, Solid, Workplane
    from OCP.TopoDS import TopoDS_Shape, TopoDS_Solid

Names = Sequence[str] | str | None
CAPS = ("top", "bottom")

_SHAPES: WeakKeyDictionary[Parts, dict[str, TopoDS_Solid]] = WeakKeyDictionary()
_KNOWN: WeakKeyDictionary[Parts, dict[Any, Known]] = WeakKeyDictionary()


@dataclass(frozen=True, eq=False)
class Known:
    """What a solid, face or edge was made as: mark and family of its part, its tags; faces that
    meet at an edge."""

    mark: str
    family: str
    tags: tuple[str, ...] = ()
    faces: tuple[Any, ...] = ()


def to_cadquery(parts: Parts, name: str = "shell", names: Names = None) -> Assembly:
    """Return the parts as a CadQuery assembly, in mm.

    Parameters
    ----------
    parts : Parts
    name : str
        Name of the root. Its children are ``panels``, ``beams``, ``nodes``, and theirs the parts,
        named by their marks. ``assembly.objects["panels/P017"]`` has the part's ``material`` and
        ``metadata``, and its ``obj`` is a ``Workplane`` with one ``Solid`` whose faces and edges
        are tagged: ``.obj.faces(tag="top")``, ``assembly.constrain("panels/P017?top", …)``.
    names : str or sequence of str, optional
        Marks or families to take; all by default.

    Raises
    ------
    PartError
        If a part cannot be a solid, marks are not unique, or there is no such part.
    MissingLibraryError
        If CadQuery is missing or broken; the message says how to repair it.
    """
    cq = require("cadquery")
    shapes, wanted = shapes_of(parts), set(chosen(parts, names))
    plane, below = cq.Plane.XY(), beams_below(parts)
    root = cq.Assembly(name=name)
    for family in families(parts):
        own = [part for part in family.parts if part.mark in wanted]
        if not own:
            continue
        made = material(own[0])
        stuff = cq.Material(made.name, density=made.density / 1000.0, densityUnit="g/cm^3")
        colour = cq.Color(*family.colour)
        branch = cq.Assembly(name=family.name)
        for part in own:
            solid = _solid(part.mark, shapes)
            stack = cq.Workplane(plane, obj=solid)
            _tag(stack, solid, part, below)
            branch.add(stack, name=part.mark, color=colour, material=stuff, metadata=metadata(part))
        root.add(branch, name=family.name)
    return root


def solids(source: Any, names: Names = None) -> list[Solid]:
    """Return chosen parts as ``cadquery.Solid`` objects, their marks as labels.

    Parameters
    ----------
    source : Parts, or anything with a ``parts`` attribute, such as a build
    names : str or sequence of str, optional
        A part mark, a family (``panels``, ``beams``, ``nodes``) or several of these; all parts by
        default.

    Raises
    ------
    PartError
        If a name is neither a mark nor a family.
    """
    parts = parts_of(source)
    require("cadquery")
    shapes = shapes_of(parts)
    return [_solid(mark, shapes) for mark in chosen(parts, names)]


def stack_of(workplane: Workplane, source: Any, names: Names = None) -> Workplane:
    """Return a workplane with parts on its stack where they stand in the shell, all tagged.

    Tags are the marks and families of the parts, ``.solids(tag="P017")``, and over all parts on
    the stack those of their faces and edges, ``.faces(tag="top")``.
    """
    parts = parts_of(source)
    found = solids(parts, names)
    stack: Workplane = workplane.newObject(found)
    by_mark = {part.mark: (f.name, part) for f in families(parts) for part in f.parts}
    below = beams_below(parts)
    for solid in found:
        family, part = by_mark[solid.label]
        _hold(stack, family, solid)
        _hold(stack, part.mark, solid)
        _tag(stack, solid, part, below)
    remember(stack, parts)
    return stack


def remember(stack: Workplane, parts: Parts) -> None:
    """Keep parts with a stack: selectors know them as long as somebody has them."""
    context: Any = stack.ctx
    context.phexfab = parts


def locations(source: Any, names: Sequence[str] | str = "nodes") -> list[Location]:
    """Return the locations of nodes, panels or beams of a build; see ``phexfab.cad.tags.frames``.

    z points out of the shell on the side away from the beams; x is along a panel's longest
    direction, along a beam, or along the first beam at a node.
    """
    cq = require("cadquery")
    return [
        cq.Location(cq.Plane(frame.origin.tolist(), xDir=frame.x.tolist(), normal=frame.z.tolist()))
        for frame in frames(source, names)
    ]


def known_as(shape: Shape) -> Known | None:
    """Return as what a solid, face or edge was made here, wherever it has been moved; else None.

    A part that has been cut since is known by the faces that were left alone, and a face that has
    been cut by its edges, where these belong to no other face together.
    """
    return _recognise(shape.wrapped, [_index(parts) for parts in list(_SHAPES)])


def _recognise(shape: TopoDS_Shape, indices: list[dict[Any, Known]]) -> Known | None:
    from OCP.TopAbs import TopAbs_ShapeEnum

    def found(piece: TopoDS_Shape) -> Known | None:
        key = piece.TShape()
        return next((index[key] for index in indices if key in index), None)

    known = found(shape)
    if known is None and shape.ShapeType() == TopAbs_ShapeEnum.TopAbs_FACE:
        edges = [edge for edge in map(found, _inside(shape, "EDGE")) if edge]
        common = set.intersection(*(set(edge.faces) for edge in edges)) if edges else set()
        if len(common) == 1:
            key = common.pop()
            return next(index[key] for index in indices if key in index)
    if known is None and shape.ShapeType() == TopAbs_ShapeEnum.TopAbs_SOLID:
        face = next(filter(None, map(found, _inside(shape, "FACE"))), None)
        return Known(face.mark, face.family) if face else None
    return known


def shapes_of(parts: Parts) -> dict[str, TopoDS_Solid]:
    """Return the kernel's solids of all parts by mark; made once, and known from then on."""
    if parts not in _SHAPES:
        members = [member for family in families(parts) for member in family.members]
        marks = [mark for mark, _ in members]
        made = to_shapes([geometry for _, geometry in members], marks)
        _SHAPES[parts] = dict(zip(marks, made, strict=True))
    return _SHAPES[parts]


def _solid(mark: str, shapes: dict[str, TopoDS_Solid]) -> Solid:
    """Return a solid of its own on the shared shape: to move one leaves the others alone."""
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS

    solid = require("cadquery").Solid(TopoDS.Solid(shapes[mark].Located(TopLoc_Location())))
    solid.label = mark
    return solid


def _inside(shape: TopoDS_Shape, kind: str) -> Iterator[TopoDS_Shape]:
    """Yield the faces or edges of a kernel's shape; an edge once for each face that it bounds."""
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    one = TopoDS.Face if kind == "FACE" else TopoDS.Edge
    explorer = TopExp_Explorer(shape, getattr(TopAbs_ShapeEnum, f"TopAbs_{kind}"))
    while explorer.More():
        yield one(explorer.Current())
        explorer.Next()


def _pieces(shape: TopoDS_Shape, part: Part, below: bool) -> Iterator[tuple[Any, Known]]:
    """Yield the faces of a part's shape, then its edges, each with what it is known as.

    An edge between the top or bottom and a side carries both names, such as ``top_side_1``.
    """
    family = metadata(part)["family"]
    edges: dict[Any, tuple[Any, dict[Any, str]]] = {}
    for face, tags in zip(_inside(shape, "FACE"), face_tags(part, below), strict=True):
        yield face, Known(part.mark, family, tags)
        for edge in _inside(face, "EDGE"):
            edges.setdefault(edge.TShape(), (edge, {}))[1][face.TShape()] = tags[0]
    for edge, beside in edges.values():
        caps = [name for name in beside.values() if name in CAPS]
        sides = [name for name in beside.values() if name not in CAPS]
        tags = tuple(f"{cap}_{side}" for cap in caps for side in sides)
        yield edge, Known(part.mark, family, tags, tuple(beside))


def _tag(stack: Workplane, solid: Solid, part: Part, below: bool) -> None:
    """Tag the faces and edges of a solid; what a tag of a stack holds already stays in it."""
    cq = require("cadquery")
    for piece, known in _pieces(solid.wrapped, part, below):
        shape = cq.Edge(piece) if known.faces else cq.Face(piece)
        for tag in known.tags:
            _hold(stack, tag, shape)


def _hold(stack: Workplane, tag: str, shape: Shape) -> None:
    """Put a shape into a tag of a stack, as ``Workplane.tag`` would a stack of its own."""
    if tag in stack.ctx.tags:
        stack.ctx.tags[tag].objects.append(shape)
        return
    held = type(stack)(stack.plane, obj=shape)
    held.parent, held.ctx = stack, stack.ctx
    held.tag(tag)
    held.tag(tag.replace("_", "-"))


def _index(parts: Parts) -> dict[Any, Known]:
    """Return what all solids, faces and edges of parts are known as, by the kernel's identity."""
    if parts not in _KNOWN:
        index: dict[Any, Known] = {}
        below = beams_below(parts)
        for family in families(parts):
            for part in family.parts:
                shape = shapes_of(parts)[part.mark]
                index[shape.TShape()] = Known(part.mark, family.name)
                index |= {p.TShape(): known for p, known in _pieces(shape, part, below)}
        _KNOWN[parts] = index
    return _KNOWN[parts]

"""CadQuery objects: an ``Assembly`` of the parts, and parts on the stack of a ``Workplane``.

Only CadQuery's own types come out, so that its editor, exporters and selectors take them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from phexfab.cad.brep import to_shapes
from phexfab.cad.doctor import require
from phexfab.cad.tree import families
from phexfab.errors import PartError
from phexfab.fabrication.parts import Parts

if TYPE_CHECKING:
    from cadquery import Assembly, Solid, Workplane


def to_cadquery(parts: Parts, name: str = "shell") -> Assembly:
    """Return the parts as a CadQuery assembly, in mm.

    Parameters
    ----------
    parts : Parts
    name : str
        Name of the root. Its children are ``panels``, ``beams``, ``nodes``, and theirs the parts,
        named by their marks; ``assembly.objects["panels/P017"].obj`` is a ``cadquery.Solid``.

    Raises
    ------
    PartError
        If a part cannot be a solid, or marks are not unique.
    MissingLibraryError
        If CadQuery is missing or broken; the message says how to repair it.
    """
    tree = families(parts)
    cq = require("cadquery")
    root = cq.Assembly(name=name)
    for family in tree:
        marks = [mark for mark, _ in family.members]
        colour = cq.Color(*family.colour)
        branch = cq.Assembly(name=family.name)
        for mark, shape in zip(
            marks, to_shapes([g for _, g in family.members], marks), strict=True
        ):
            branch.add(cq.Solid(shape), name=mark, color=colour)
        root.add(branch, name=family.name)
    return root


def solids(source: Parts | object, marks: Sequence[str] | str | None = None) -> list[Solid]:
    """Return chosen parts as ``cadquery.Solid`` objects.

    Parameters
    ----------
    source : Parts, or anything with a ``parts`` attribute, such as a build
    marks : str or sequence of str, optional
        A part mark, a family (``panels``, ``beams``, ``nodes``) or several of these; all parts by
        default.

    Raises
    ------
    PartError
        If a name is neither a mark nor a family.
    """
    parts = source if isinstance(source, Parts) else getattr(source, "parts", None)
    if not isinstance(parts, Parts):
        raise PartError(f"{type(source).__name__} holds no parts; give a build or its parts")
    tree = families(parts)
    cq = require("cadquery")
    wanted = (marks,) if isinstance(marks, str) else marks
    known = {mark: geometry for family in tree for mark, geometry in family.members}
    groups = {family.name: [mark for mark, _ in family.members] for family in tree}
    chosen: dict[str, None] = {}
    for name in groups if wanted is None else wanted:
        if name not in groups and name not in known:
            raise PartError(
                f"there is no part {name!r}; marks run from {next(iter(known))} to "
                f"{next(reversed(known))}, families are {', '.join(groups)}"
            )
        chosen.update(dict.fromkeys(groups.get(name, [name])))
    names = list(chosen)
    return [cq.Solid(s) for s in to_shapes([known[n] for n in names], names)]


def phex_parts(
    source: Parts | object, marks: Sequence[str] | str | None = None
) -> Callable[[Workplane], Workplane]:
    """Return a function for ``Workplane.invoke`` that puts parts on the stack.

    ``cq.Workplane().invoke(phex_parts(build, "P017")).faces(">Z")`` and so on; the parts keep their
    place in the shell. For parts at the points of a stack see ``phexfab.cad.cadquery_plugin``.
    """

    def place(workplane: Workplane) -> Workplane:
        result: Workplane = workplane.newObject(solids(source, marks))
        return result

    return place

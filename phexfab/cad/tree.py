"""The tree that every model shows: ``panels``, ``beams``, ``nodes``, and below them the parts.

One colour a family: exchange files grow with the number of colours, and readers group by them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from phexfab.errors import PartError
from phexfab.fabrication.parts import (
    FAMILY_COLOURS,
    Beam,
    Cylinder,
    Material,
    Node,
    Panel,
    Parts,
    Solid,
)

Geometry = Solid | Cylinder
Part = Panel | Beam | Node

_FORBIDDEN = frozenset("/@?")


@dataclass(frozen=True)
class Family:
    """One family of parts: its name, colour, the mark and geometry of every member, the parts."""

    name: str
    colour: tuple[float, float, float]
    members: tuple[tuple[str, Geometry], ...]
    parts: tuple[Part, ...]


def families(parts: Parts) -> tuple[Family, ...]:
    """Return the families that have members, in the order panels, beams, nodes.

    Parameters
    ----------
    parts : Parts

    Raises
    ------
    PartError
        If there is no part, two parts share a mark, or a mark is empty, equal to a family's name
        or holds one of ``/ @ ?``, which separate names in CadQuery's queries.
    """
    members: dict[str, tuple[Part, ...]] = {
        "panels": parts.panels,
        "beams": parts.beams,
        "nodes": parts.nodes,
    }
    seen = set(members)
    for family in members.values():
        for mark in (part.mark for part in family):
            if not mark or mark in seen:
                raise PartError(f"mark {mark!r} is taken or empty; give every part its own mark")
            if _FORBIDDEN.intersection(mark):
                raise PartError(f"mark {mark!r} holds one of / @ ?; rename the part")
            seen.add(mark)
    if len(seen) == len(members):
        raise PartError("there is no part to export; the shell has neither panels nor beams")
    return tuple(
        Family(name, FAMILY_COLOURS[name], tuple((p.mark, geometry(p)) for p in own), own)
        for name, own in members.items()
        if own
    )


def chosen(parts: Parts, names: Sequence[str] | str | None = None) -> list[str]:
    """Return the marks of the parts that names stand for, in the order in which they are named.

    Parameters
    ----------
    parts : Parts
    names : str or sequence of str, optional
        Marks, families, or both; all parts by default.

    Raises
    ------
    PartError
        If a name is neither a mark nor a family.
    """
    groups = {f.name: [mark for mark, _ in f.members] for f in families(parts)}
    known = {mark: None for marks in groups.values() for mark in marks}
    wanted = groups if names is None else (names,) if isinstance(names, str) else names
    found: dict[str, None] = {}
    for name in wanted:
        if name not in groups and name not in known:
            raise PartError(
                f"there is no part {name!r}; marks run from {next(iter(known))} to "
                f"{next(reversed(known))}, families are {', '.join(groups)}"
            )
        found.update(dict.fromkeys(groups.get(name, [name])))
    return list(found)


def parts_of(source: Any) -> Parts:
    """Return the parts of a build, or the ``Parts`` themselves."""
    parts = source if isinstance(source, Parts) else getattr(source, "parts", None)
    if not isinstance(parts, Parts):
        raise PartError(f"{type(source).__name__} holds no parts; give a build or its parts")
    return parts


def geometry(part: Part) -> Geometry:
    """Return the polyhedron or cylinder of a part."""
    return part.cylinder if isinstance(part, Node) else part.solid


def material(part: Part) -> Material:
    """Return what a part is made of."""
    return part.material if isinstance(part, Node) else part.flat.material


def metadata(part: Part) -> dict[str, Any]:
    """Return what a parts list says of a part: plain values in mm, mm², mm³, kg, kg/m³, degrees.

    All have ``mark family material density volume mass neighbours``; panels also ``thickness
    area``, beams ``length width nodes mitres slopes``, nodes ``length radius``.
    """
    made = material(part)
    own: dict[str, Any]
    if isinstance(part, Panel):
        facing = tuple(edge.neighbour for edge in part.flat.edges)
        own = {"thickness": part.flat.thickness, "area": part.area}
    elif isinstance(part, Beam):
        facing = part.neighbours
        own = {
            "length": part.length,
            "width": part.flat.thickness,
            "nodes": part.nodes,
            "mitres": part.mitres,
            "slopes": part.slopes,
        }
    else:
        facing = part.neighbours
        own = {"length": part.cylinder.length, "radius": part.cylinder.radius}
    return {
        "mark": part.mark,
        "family": f"{type(part).__name__.lower()}s",
        "material": made.name,
        "density": made.density,
        "volume": part.volume,
        "mass": part.mass,
        "neighbours": tuple(dict.fromkeys(mark for mark in facing if mark)),
        **own,
    }

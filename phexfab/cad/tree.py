"""The tree that every model shows: ``panels``, ``beams``, ``nodes``, and below them the parts.

One colour a family: exchange files grow with the number of colours, and readers group by them.
"""

from __future__ import annotations

from dataclasses import dataclass

from phexfab.errors import PartError
from phexfab.fabrication.parts import FAMILY_COLOURS, Cylinder, Parts, Solid

Geometry = Solid | Cylinder

_FORBIDDEN = frozenset("/@?")


@dataclass(frozen=True)
class Family:
    """One family of parts: its name, colour, and the mark and geometry of every member."""

    name: str
    colour: tuple[float, float, float]
    members: tuple[tuple[str, Geometry], ...]


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
    members: dict[str, tuple[tuple[str, Geometry], ...]] = {
        "panels": tuple((p.mark, p.solid) for p in parts.panels),
        "beams": tuple((b.mark, b.solid) for b in parts.beams),
        "nodes": tuple((n.mark, n.cylinder) for n in parts.nodes),
    }
    seen = set(members)
    for family in members.values():
        for mark, _ in family:
            if not mark or mark in seen:
                raise PartError(f"mark {mark!r} is taken or empty; give every part its own mark")
            if _FORBIDDEN.intersection(mark):
                raise PartError(f"mark {mark!r} holds one of / @ ?; rename the part")
            seen.add(mark)
    if len(seen) == len(members):
        raise PartError("there is no part to export; the shell has neither panels nor beams")
    return tuple(Family(n, FAMILY_COLOURS[n], m) for n, m in members.items() if m)

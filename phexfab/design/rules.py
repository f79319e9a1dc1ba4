"""Rules that hold between the keys of a design file.

A rule is a function of the tables it compares and yields what is wrong; ``broken_rules`` runs
those whose tables are known, so that a mistake in one table hides no rule about the others.
Everything here follows from the numbers in the file alone, before any geometry: what needs the
finished shell is a check (``phexfab.fabrication``).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from phexfab.triangular import ASYMPTOTIC_MARGIN, EQUILATERAL, asymptotic_gap, mean_distance

if TYPE_CHECKING:
    from phexfab.design import model as m


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong: at which key, what, and what to do about it."""

    key: str
    text: str
    remedy: str


class RuleBreach(ValueError):
    """Carries the problems through pydantic; ``load`` turns it into a ``DesignError``."""

    def __init__(self, problems: list[Problem]) -> None:
        super().__init__("; ".join(f"{p.key}: {p.text}; {p.remedy}" for p in problems))
        self.problems = problems


@dataclass(frozen=True)
class MedianPanel:
    """The hexagon of a design's median panel, before any gap, in mm.

    Attributes
    ----------
    width, length : float
        Of the rectangle that its four outer corners span.
    short_edge : float
        Of the four edges that meet in the two reflex corners.
    widest_gap : float
        Gap at which the panel falls apart at its waist, or vanishes.
    """

    width: float
    length: float
    short_edge: float
    widest_gap: float


def median_panel(lattice: m.Lattice) -> MedianPanel:
    """Return the panel of median size, to second order in the size of panels.

    Where the tangent planes of a lattice of step a and row ratio r meet on a minimal surface, the
    hexagon has corners (±a/2, ±a(r/2 + 1/8r)) and (0, ±a(r/2 − 1/8r)), the latter reflex: it is
    dual to the lattice with respect to the Dupin indicatrix y² − x² = 1 (thesis §5.1.3).
    """
    r = lattice.row_ratio
    step = lattice.panel_size / mean_distance(r)
    waist = step * (r - 0.25 / r)
    return MedianPanel(
        width=step,
        length=step * (r + 0.25 / r),
        short_edge=step * math.hypot(0.5, 0.25 / r),
        widest_gap=min(step, waist / math.hypot(1.0, 0.5 / r)),
    )


def lattice_directions(lattice: m.Lattice) -> Iterator[Problem]:
    """No lattice direction may be asymptotic (thesis §5.1.3): there, panel edges vanish."""
    slant = math.degrees(math.atan(2 * lattice.row_ratio))
    near, _ = asymptotic_gap(lattice.row_ratio, lattice.turn)
    if near < ASYMPTOTIC_MARGIN:
        key = "lattice.turn" if lattice.turn else "lattice.row_ratio"
        room = abs(slant - 45) - ASYMPTOTIC_MARGIN
        remedy = f"keep turn within ±{room:.1f}°" if room > 0 else "take 0.54 or more"
        yield Problem(
            key,
            f"a row of panels runs {near:.1f}° from an asymptotic direction, where edges vanish",
            remedy,
        )


def closing(surface: m.Surface, lattice: m.Lattice) -> Iterator[Problem]:
    """A lattice that closes around the surface cannot be turned, nor close in both ways."""
    closed = [way for way in ("u", "v") if getattr(surface, way) == "closed"]
    if len(closed) == 2:
        yield Problem(
            "surface.v",
            "the surface cannot close along u and along v",
            "write [from, to] for one of them",
        )
    elif closed and lattice.turn:
        yield Problem(
            "lattice.turn",
            f'a ring (surface.{closed[0]} = "closed") closes only along a principal direction',
            "take turn = 0",
        )


def one_surface(surface: m.Surface) -> Iterator[Problem]:
    """A surface is named, or given by its Weierstrass data."""
    own = surface.g is not None or surface.height_differential is not None
    if surface.name is not None and own:
        yield Problem(
            "surface.name",
            "a surface of the catalog and a surface of one's own are both given",
            "leave out name, or g and height_differential",
        )
    elif own and (surface.g is None or surface.height_differential is None):
        missing = "g" if surface.g is None else "height_differential"
        yield Problem(
            f"surface.{missing}",
            "a surface of one's own needs both g and height_differential",
            f'add {missing}, for example {missing} = "z"',
        )
    elif surface.name is None and not own:
        yield Problem(
            "surface.name",
            "no surface is given",
            'add name = "catenoid" (phexfab surfaces lists them), or g and height_differential',
        )
    elif own:
        for option in ("order", "ends"):
            if getattr(surface, option) is not None:
                yield Problem(
                    f"surface.{option}",
                    "is an option of the catalog's surfaces",
                    "leave it out and write it into g and height_differential",
                )


def packing_lattice(offset: m.Offset, lattice: m.Lattice) -> Iterator[Problem]:
    """Circle packings know only the equilateral lattice."""
    if offset.type == "edge" and lattice.row_ratio != EQUILATERAL:
        yield Problem(
            "lattice.row_ratio",
            'offset.type = "edge" rests on a circle packing, which is equilateral',
            'leave row_ratio out, or take offset.type = "face" or "vertex"',
        )


def gap_and_panel(panels: m.Panels, lattice: m.Lattice) -> Iterator[Problem]:
    """The gap leaves something of the panel, at its waist between the two reflex corners too."""
    widest = median_panel(lattice).widest_gap
    if panels.gap >= widest:
        yield Problem(
            "panels.gap",
            f"nothing is left of panels of {lattice.panel_size:g} mm: at {widest:.0f} mm of gap "
            "half of them fall apart at the waist",
            "take a smaller gap or a larger lattice.panel_size",
        )


def stock_room(sheets: m.Sheets) -> Iterator[Problem]:
    """A stock sheet has room inside its margins."""
    for family in ("panels", "beams"):
        stock = getattr(sheets, family)
        if 2 * stock.margin >= min(stock.length, stock.width):
            yield Problem(
                f"sheets.{family}.margin",
                f"nothing is left of a sheet {stock.length:g} × {stock.width:g} mm",
                "take a smaller margin or a larger sheet",
            )


def panel_and_sheet(panels: m.Panels, lattice: m.Lattice, sheets: m.Sheets) -> Iterator[Problem]:
    """A median panel fits the sheet; the check ``panel fits the sheet`` then sees to every one."""
    stock = sheets.panels
    room = min(stock.length, stock.width) - 2 * stock.margin
    width = median_panel(lattice).width - panels.gap
    if 0 < room < width:
        yield Problem(
            "lattice.panel_size",
            f"half the panels are wider than {width:.0f} mm, but sheets.panels "
            f"({stock.length:g} × {stock.width:g} mm) has room for {room:.0f} mm",
            "take smaller panels or larger sheets",
        )


def beam_and_sheet(beams: m.Beams, sheets: m.Sheets) -> Iterator[Problem]:
    """A beam fits across the sheet it is cut from."""
    stock = sheets.beams
    room = min(stock.length, stock.width) - 2 * stock.margin
    if beams.kind == "flat" and 0 < room < beams.height:
        yield Problem(
            "beams.height",
            f"sheets.beams ({stock.length:g} × {stock.width:g} mm) has room for {room:.0f} mm",
            "take lower beams or larger sheets",
        )


def beam_and_edge(beams: m.Beams, lattice: m.Lattice) -> Iterator[Problem]:
    """A beam is longer than wide."""
    edge = median_panel(lattice).short_edge
    if beams.kind == "flat" and beams.width >= edge:
        yield Problem(
            "beams.width",
            f"beams are wider than long: short edges measure some {edge:.0f} mm",
            "take slimmer beams or a larger lattice.panel_size",
        )


def beams_and_hubs(beams: m.Beams, nodes: m.Nodes, lattice: m.Lattice) -> Iterator[Problem]:
    """Beams that stop before a hub need one, a hub needs beams that stop, and room between."""
    hubs = nodes.kind == "hub"
    edge = median_panel(lattice).short_edge
    if beams.kind == "flat" and beams.ends == "hub" and not hubs:
        yield Problem(
            "beams.ends",
            'there is no hub: nodes.kind = "none"',
            'take nodes.kind = "hub", or beams.ends = "mitred"',
        )
    elif beams.kind == "flat" and beams.ends == "mitred" and hubs:
        yield Problem(
            "nodes.kind",
            "mitred beams meet in the node axis and would run through the hub",
            'take beams.ends = "hub", or nodes.kind = "none"',
        )
    elif hubs and 2 * (nodes.radius + nodes.clearance) >= edge:
        yield Problem(
            "nodes.radius",
            f"nothing is left of the short beams: their edges measure some {edge:.0f} mm",
            "take a smaller radius or clearance, or a larger lattice.panel_size",
        )


Rule = Callable[..., Iterator[Problem]]
RULES: tuple[tuple[tuple[str, ...], Rule], ...] = (
    (("surface",), one_surface),
    (("lattice",), lattice_directions),
    (("surface", "lattice"), closing),
    (("offset", "lattice"), packing_lattice),
    (("panels", "lattice"), gap_and_panel),
    (("sheets",), stock_room),
    (("panels", "lattice", "sheets"), panel_and_sheet),
    (("beams", "sheets"), beam_and_sheet),
    (("beams", "lattice"), beam_and_edge),
    (("beams", "nodes", "lattice"), beams_and_hubs),
)


def broken_rules(sections: Mapping[str, Any]) -> list[Problem]:
    """Return what the rules about the given tables find wrong, in the order of ``RULES``."""
    return [
        problem
        for names, rule in RULES
        if all(name in sections for name in names)
        for problem in rule(*(sections[name] for name in names))
    ]

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

from phexfab.design.mesh_rules import free_form
from phexfab.design.problem import Problem
from phexfab.triangular import ASYMPTOTIC_MARGIN, EQUILATERAL, asymptotic_gap, mean_distance

if TYPE_CHECKING:
    from phexfab.design import model as m


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


def lattice_directions(lattice: m.Lattice, mesh: m.Mesh) -> Iterator[Problem]:
    """No lattice direction may be asymptotic (thesis §5.1.3): there, panel edges vanish."""
    if mesh.method is not None:  # where they are depends on the surface
        return
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


SOURCES = ("name", "g", "height_differential", "rim", "mesh", "periodic", "step")
BELONGS = {  # keys of [surface] that mean something with one kind of film only
    "catalog": {"order", "ends"},
    "formula": {"base"},
    "named": {"bonnet_angle", "u", "v", "radius", "centre"},
    "rim": {"layer", "smooth_corners", "smooth_inward", "free"},
    "periodic": {"cells"},
    "step": {"face"},
}
NAMES = {
    "catalog": "a surface of the catalog (name)",
    "formula": "a surface of one's own (g and height_differential)",
    "named": "name, or g and height_differential",
    "rim": "rim",
    "periodic": "periodic",
    "step": "step",
}


def one_surface(surface: m.Surface) -> Iterator[Problem]:
    """A film has one source, and no keys of another."""
    given = [key for key in SOURCES if getattr(surface, key) is not None]
    own = [key for key in given if key in ("g", "height_differential")]
    if not given:
        yield Problem(
            "surface.name",
            "no surface is given",
            'add name = "catenoid" (phexfab surfaces lists them), g and height_differential, '
            'rim = "rim.csv", mesh = "film.obj" or periodic = "schwarz-p"',
        )
        return
    if len(given) - max(0, len(own) - 1) > 1:
        yield Problem(
            f"surface.{given[0]}",
            f"several surfaces are given: {', '.join(given)}",
            f"leave out {given[0]}, or {' and '.join(given[1:])}",
        )
        return
    if len(own) == 1:
        missing = "g" if own[0] != "g" else "height_differential"
        yield Problem(
            f"surface.{missing}",
            "a surface of one's own needs both g and height_differential",
            f'add {missing}, for example {missing} = "z"',
        )
    fields = type(surface).model_fields
    changed = {key for key in fields if getattr(surface, key) != fields[key].default}
    kinds = {surface.source}
    if surface.source == "named":
        kinds |= {"formula" if own else "catalog"}
    for kind, keys in BELONGS.items():
        if kind not in kinds:
            for key in sorted(keys & changed):
                yield Problem(
                    f"surface.{key}", f"belongs to {NAMES[kind]}", "leave it out, or change that"
                )
    if "scale" in changed and surface.source in ("rim", "mesh", "step"):
        yield Problem(
            "surface.scale", f"a {surface.source} has its own size", 'leave it out; see unit = "m"'
        )
    if "unit" in changed and surface.source not in ("rim", "mesh"):
        yield Problem("surface.unit", "belongs to rim or mesh", "leave it out")
    if surface.radius is not None:
        for key in ("u", "v"):
            if getattr(surface, key) is not None:
                yield Problem(
                    f"surface.{key}", "the piece is given by radius already", "leave one out"
                )
    if min(surface.cells) < 1:
        yield Problem("surface.cells", "there is at least one cell each way", "write [1, 1, 1]")


def grown_lattice(surface: m.Surface, lattice: m.Lattice, mesh: m.Mesh) -> Iterator[Problem]:
    """A lattice that closes up around umbilics follows the principal directions."""
    film = surface.source != "named" or surface.radius is not None
    if lattice.turn and film and mesh.method is None:
        yield Problem(
            "lattice.turn",
            "rows on a film close up around its umbilics, along the principal directions",
            "take turn = 0",
        )


def packing_lattice(offset: m.Offset, lattice: m.Lattice, mesh: m.Mesh) -> Iterator[Problem]:
    """Circle packings know only the equilateral lattice."""
    if mesh.method is None and offset.type == "edge" and lattice.row_ratio != EQUILATERAL:
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
    (("surface", "mesh", "offset", "lattice", "border"), free_form),
    (("lattice", "mesh"), lattice_directions),
    (("surface", "lattice"), closing),
    (("surface", "lattice", "mesh"), grown_lattice),
    (("offset", "lattice", "mesh"), packing_lattice),
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

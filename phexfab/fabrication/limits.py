"""What is checked, against which limit, and what helps when a check fails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import DesignError
from phexfab.fabrication.parts import CheckResult

FloatArray = NDArray[np.float64]
Origin = Literal["lattice", "given", "covered"]
"""What a shell's panels come from: a lattice on a minimal surface, a mesh that was given, or a
method that covers a free-form surface."""


@dataclass(frozen=True)
class Limits:
    """The limit of every check, named like the check; a design file sets them in ``[checks]``.

    Attributes
    ----------
    planarity : float, ratio
        Largest distance of a corner to its face's least-squares plane, over the mean edge.
    planarity_mm : float, mm
        The same distance itself.
    parallelism : float, ratio
        Largest sine of the angle between an edge of M and its edge of S.
    minimality : float, ratio
        Largest ``|area(M_f, S_f)| / √(|area M_f|·|area S_f|)``, which is |H|/√|K|.
    offset_constancy : float, unit length of S
        Largest miss of S: of heights, edge distances or vertex distances from 1.
    offset_spread : float, ratio
        Largest miss of the distance between M and M + d·S, over d.
    offset_interval : float, ratio
        Largest share of the offset distance at which the first edge vanishes.
    node_axis_torsion : float, deg
        Largest angle between a node axis and the mid-plane of a beam that ends there.
    simple_faces : float, count
        Most faces of M that cross or touch themselves, or lie inside out.
    shortest_edge : float, mm
        Shortest edge of M.
    beam_angle : float, deg
        Smallest angle between two beams of a node, seen along its axis.
    surface_distance : float, mm
        Largest distance of a vertex of M from the smooth surface.
    rim_distance : float, mm
        Largest distance between the given rim and the border of M, measured both ways.
    sharpest_corner : float, deg
        Smallest interior angle of a panel's cut contour.
    mitre_angle : float, deg
        Largest cut of a beam's end against a square one.
    rim_corner, rim_beam_angle, rim_mitre : float, deg
        The same three, and ``beam_angle``, where a rim cuts the shell: the rows of panels meet a
        rim at any angle, so that corners there are as sharp as they happen to be.
    panel_fits_sheet, beam_fits_sheet : float, mm
        Most by which the blank of a panel or beam may exceed the usable stock sheet.
    panel_mass : float, kg
        Heaviest panel.
    panel_clearance : float, mm
        Least distance between neighbouring panels.
    interpenetration : float, ratio
        Largest overlap of two solids, over the volume of the smaller one.

    Examples
    --------
    >>> import phexfab as px
    >>> px.Limits(shortest_edge=40, panel_mass=25).shortest_edge
    40
    """

    planarity: float = 1e-12
    planarity_mm: float = 1e-6
    parallelism: float = 1e-10
    minimality: float = 1e-10
    offset_constancy: float = 1e-11
    offset_spread: float = 1e-9
    offset_interval: float = 0.9
    node_axis_torsion: float = 1e-6
    simple_faces: float = 0.0
    shortest_edge: float = 20.0
    beam_angle: float = 30.0
    surface_distance: float = 25.0
    rim_distance: float = 25.0
    sharpest_corner: float = 30.0
    mitre_angle: float = 75.0
    rim_corner: float = 10.0
    rim_beam_angle: float = 10.0
    rim_mitre: float = 85.0
    panel_fits_sheet: float = 0.0
    beam_fits_sheet: float = 0.0
    panel_mass: float = 60.0
    panel_clearance: float = 1.0
    interpenetration: float = 1e-6

    def __post_init__(self) -> None:
        for name in KINDS:
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= 0):
                raise DesignError(
                    f"checks.{name} = {value}: a limit is a number from 0 up, in "
                    f"{KINDS[name].unit if KINDS[name].unit != '1' else 'no unit'}"
                )


@dataclass(frozen=True)
class CheckKind:
    """What one check measures, in which unit and sense, and the remedy when it fails.

    ``of_given`` is the remedy for a mesh that somebody gave, and ``of_covered`` for hexagons that
    cover a free-form surface, where what helps a lattice on a minimal surface does not exist.
    """

    unit: str
    sense: str
    measured: str
    remedy: str
    of_given: str = ""
    of_covered: str = ""

    def remedy_for(self, origin: Origin) -> str:
        """Return what helps a shell whose panels come from there."""
        own = {"lattice": "", "given": self.of_given, "covered": self.of_covered}[origin]
        return own or self.remedy


_LATTICE = (
    "choose larger panels, another row ratio, or a rectangle farther from strong curvature",
    "draw the mesh near the part named with edges of even length that meet at about 120°, or leave "
    'its outermost panels out (mesh.border = "drop")',
    "choose larger panels, rows another way (mesh.toward), or another mesh.method",
)
_HUBS = tuple(f'{text}, or use hubs (nodes.kind and beams.ends = "hub")' for text in _LATTICE)
_RIM = (
    "turn the rows (lattice.rows_along), change the panel size a little so that the rim meets "
    "other edges, or choose border.direction",
)
_SOLVER = (
    "the solve did not reach rounding: coarsen the lattice or shrink the rectangle of parameters",
    "rounding is too large at the part named: where neighbouring panels lie nearly in one plane, "
    "join them or give the mesh more curvature; free vertices (mesh.fixed)",
    "rounding is too large at the part named, where neighbouring panels lie nearly in one plane: "
    "choose larger panels, or another mesh.method",
)
_SIZE = "split the panel in the mesh"

KINDS: dict[str, CheckKind] = {
    "planarity": CheckKind(
        "1", "<=", "corners off their face's plane, over the mean edge", *_SOLVER
    ),
    "planarity_mm": CheckKind("mm", "<=", "corners off their face's plane", *_SOLVER),
    "parallelism": CheckKind("1", "<=", "sine between edges of M and S", *_SOLVER),
    "minimality": CheckKind("1", "<=", "|H|/√|K| from the mixed areas", _SOLVER[0]),
    "offset_constancy": CheckKind("1", "<=", "Gauss image off the unit sphere", *_SOLVER),
    "offset_spread": CheckKind(
        "1", "<=", "distance of the offset off constant, relative", *_SOLVER
    ),
    "offset_interval": CheckKind(
        "1",
        "<=",
        "share of the offset at which an edge vanishes",
        "make the offset smaller, put it on the other side, or make the panels larger",
        "make the offset smaller, put it on the other side, or draw short edges of the mesh longer",
    ),
    "node_axis_torsion": CheckKind("deg", "<=", "node axis off a beam's mid-plane", *_SOLVER),
    "simple_faces": CheckKind(
        "1", "<=", "faces that cross themselves or lie inside out", *_LATTICE
    ),
    "shortest_edge": CheckKind(
        "mm",
        ">=",
        "shortest edge",
        _LATTICE[0],
        "draw the edge longer in the mesh, or leave it out and move its panels apart",
        _LATTICE[2],
    ),
    "beam_angle": CheckKind("deg", ">=", "angle between beams at a node", *_LATTICE),
    "surface_distance": CheckKind(
        "mm",
        "<=",
        "vertices off the smooth surface",
        "choose smaller panels",
        "give a mesh that is more nearly planar, or raise mesh.closeness where there is a "
        "mesh.reference",
    ),
    "rim_distance": CheckKind(
        "mm",
        "<=",
        "border off the given rim",
        "choose smaller panels, a smaller border.sagitta, or a smaller border.sliver",
    ),
    "sharpest_corner": CheckKind("deg", ">=", "sharpest corner of a cut contour", *_LATTICE),
    "mitre_angle": CheckKind("deg", "<=", "cut of a beam's end against square", *_HUBS),
    "rim_corner": CheckKind("deg", ">=", "sharpest corner that the rim cuts", *_RIM),
    "rim_beam_angle": CheckKind("deg", ">=", "angle between beams at the rim", *_RIM),
    "rim_mitre": CheckKind(
        "deg", "<=", "cut of a beam's end at the rim against square", _RIM[0] + ", or use hubs"
    ),
    "panel_fits_sheet": CheckKind(
        "mm",
        "<=",
        "largest blank beyond the usable sheet",
        "choose smaller panels, a larger stock sheet or a smaller margin",
        f"{_SIZE}, or choose a larger stock sheet or a smaller margin",
    ),
    "beam_fits_sheet": CheckKind(
        "mm",
        "<=",
        "largest beam beyond the usable sheet",
        "choose smaller panels, lower beams, a larger stock sheet or a smaller margin",
        "draw the edge shorter in the mesh, or choose lower beams, a larger stock sheet or a "
        "smaller margin",
    ),
    "panel_mass": CheckKind(
        "kg",
        "<=",
        "heaviest panel",
        "choose smaller or thinner panels, or a lighter material",
        f"{_SIZE}, or choose thinner panels or a lighter material",
    ),
    "panel_clearance": CheckKind(
        "mm",
        ">=",
        "distance between neighbouring panels",
        "widen the gap, mitre the edges, or put the panels on the other side",
    ),
    "interpenetration": CheckKind(
        "1",
        "<=",
        "overlap of two solids, over the smaller one",
        "widen the gap, mitre the edges, lower the beams' seat or make hubs and beams slimmer",
    ),
}


def verdict(
    name: str,
    limits: Limits,
    values: FloatArray,
    marks: Sequence[str],
    detail: str = "",
    origin: Origin = "lattice",
) -> CheckResult:
    """Return the result of a check for its worst value; a value that is not a number is the worst.

    The note of a check that fails ends with the remedy.

    Parameters
    ----------
    name : str
        A field of ``Limits``.
    limits : Limits
    values : (n,) array, n > 0
    marks : sequence of n strings
        The part that each value belongs to.
    detail : str
        Put behind what was measured.
    origin : ``"lattice"``, ``"given"`` or ``"covered"``
        What the panels come from; the remedy is what helps there.
    """
    kind = KINDS[name]
    worst = int(np.argmax(values) if kind.sense == "<=" else np.argmin(values))
    value, limit = float(values[worst]), float(getattr(limits, name))
    note = f"{kind.measured}; {detail}" if detail else kind.measured
    result = CheckResult(name, value, limit, kind.unit, kind.sense, marks[worst], note)
    if result.ok:
        return result
    return replace(result, note=f"{note}. Remedy: {kind.remedy_for(origin)}")

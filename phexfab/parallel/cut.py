"""Cutting a shell along given borders: the result is a shell whose border planes are rim planes.

The planes of a fence (``phexfab.parallel.fence``) replace the shell's own border planes. A cut
vertex is where two panels meet a rim plane, or one panel meets two; so panels stay planar, and with
rim planes that pass through the origin in the Gauss image (height 0) the cut shell and its image
are parallel again: offsets move rim vertices within the rim planes, nodes are free of torsion.

References
----------
Thesis §4.1 (meshes as planes), ch. 8 (from a boundary curve to a P-Hex mesh); Pottmann et al. 2007.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import MeshError
from phexfab.mesh.measures import signed_areas
from phexfab.parallel.border import Border
from phexfab.parallel.rounds import Attempt, Cutting, cut_folding, cut_stepping
from phexfab.parallel.shell import Shell
from phexfab.parallel.stations import place_stations
from phexfab.parallel.walk import Ground, refuse_crossed
from phexfab.parallel.within import border_distance

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class CutReport:
    """What a cut did.

    Attributes
    ----------
    panels : int
        Panels of the cut shell.
    cut : int
        Pieces of panels that the borders cut off, before any was merged or dropped.
    merged : int
        Small pieces that a neighbour was extended over.
    dropped : int
        Thin pieces that were left out.
    kept : int
        Small pieces that are neither: no neighbour can be extended over them.
    planes : int
        Rim planes.
    rim_distance : float, mm
        Largest distance between the given borders and the built one, either way.
    ruling_angle : float, degrees
        Largest angle between the cut (its planes, and the node axes at stations) and the film's
        normals.
    shortest_edge : float, mm
        Shortest edge of a panel that a border cuts.
    ways : tuple of str
        For each border how its planes were found: ``"fitted"`` (each turned about its chord so that
        axes come near the normals), ``"apex"`` (through one point), ``"direction"`` (parallel to
        the given direction), ``"flat"`` (one plane for a side) or ``"folded"`` (a plane that folds
        a little, away from vertices).
    """

    panels: int
    cut: int
    merged: int
    dropped: int
    kept: int
    planes: int
    rim_distance: float
    ruling_angle: float
    shortest_edge: float
    ways: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class CutShell:
    """A shell that was cut along borders.

    Attributes
    ----------
    shell : Shell
        With ``whole`` and ``parents``: the shell it was cut from, and the face there of each face.
    report : CutReport
    """

    shell: Shell
    report: CutReport

    @property
    def parent(self) -> IntArray:
        """(F,) face of the whole shell that each face comes from; −1 for rim planes."""
        return self.shell.parents


def cut_shell(
    whole: Shell,
    borders: Sequence[Border],
    *,
    sliver_share: float = 0.05,
    sliver_width: float | None = None,
    shortest_edge: float | None = None,
    depth: float | tuple[float, float] = 0.0,
    sagitta: float | None = None,
    direction: ArrayLike | None = None,
) -> CutShell:
    """Cut a shell along borders; what lies to their left stays.

    Parameters
    ----------
    whole : Shell
        Reaches beyond the borders.
    borders : sequence of Border
        All of them: for a ring an outer one and an inner one.
    sliver_share : float
        Pieces below this share of the median panel's area are merged into a neighbour where one can
        be extended over them.
    sliver_width : float, mm, optional
        Pieces that reach less far in from the border likewise, and where no neighbour can be
        extended over them they are left out; by default 0.08 of the median panel's size (the root
        of its area).
    shortest_edge : float, mm, optional
        Stations step aside where cut panels would have shorter edges, as far as that helps; by
        default 0.04 of the median panel's size.
    depth : float or (below, above), mm
        How deep the structure is, to either side of the normals. Edges of cut panels that would
        vanish in an offset by as much count as too short, too.
    sagitta : float, mm, optional
        Chords of the border stay within this distance of it; by default 0.04 of the median panel's
        size. Stations without which chords change by less than a tenth of it are left out.
    direction : (3,), optional
        Cut along this direction, such as (0, 0, 1) for a plumb cut; by default as nearly at right
        angles to the film as planes that meet in node axes can be.

    Raises
    ------
    MeshError
        If the shell ends before a border, a border crosses itself, is too small, or the cut would
        lean more than 60° from the film's normal; the message names the place and the remedy.

    References
    ----------
    Thesis §4.1, §4.2; see ``phexfab.parallel.fence``.

    Examples
    --------
    >>> import numpy as np
    >>> import phexfab as px
    >>> film = px.minimal_surface("enneper").scaled(5000.0)  # mm
    >>> whole = px.minimal_shell(film, px.lattice_on(film, panel_size=500.0))
    >>> z = film.parameter(0.4 * np.exp(2j * np.pi * np.arange(400) / 400))
    >>> made = px.cut_shell(whole, [px.Border(film.point(z), film.normal(z), [])])
    >>> made.report.panels == made.shell.mesh.n_faces, made.report.rim_distance < 40  # mm
    (True, True)
    """
    if not borders:
        raise MeshError("there is no border to cut along; give one at least")
    along = None
    if direction is not None:
        along = np.asarray(direction, float)
        length = float(np.linalg.norm(along)) if along.shape == (3,) else 0.0
        if not (np.isfinite(length) and length > 0):
            raise MeshError(f"direction = {direction}: give three numbers, not all of them 0")
        along = along / length
    below, above = depth if isinstance(depth, tuple) else (depth, depth)
    deep = (float(below), float(above))
    for name, value in (
        ("sliver_share", sliver_share),
        ("sliver_width", sliver_width),
        ("shortest_edge", shortest_edge),
        ("depth", min(deep)),
        ("depth", max(deep)),
    ):
        if value is not None and not (np.isfinite(value) and value >= 0):
            raise MeshError(f"{name} = {value}: give 0 or more")
    if sagitta is not None and not (np.isfinite(sagitta) and sagitta > 0):
        raise MeshError(f"sagitta = {sagitta} mm: give more than 0 mm")
    if not whole.mesh.n_faces:
        raise MeshError("the shell has no panel to cut")

    ground = Ground.of(whole)
    area = float(np.median(signed_areas(whole.mesh, ground.normals)))
    size = float(np.sqrt(area))
    sag = 0.04 * size if sagitta is None else sagitta
    limits = (
        sliver_share * area,
        0.08 * size if sliver_width is None else sliver_width,
        0.04 * size if shortest_edge is None else shortest_edge,
        deep,
    )
    start = [place_stations(ground.finder, one, sag, size, limits[2], along) for one in borders]
    cutting = Cutting(whole, ground, borders, limits, sag, size, along)
    try:
        best, failure = cut_stepping(cutting, start)
    except MeshError:
        refuse_crossed(ground, borders, whole.kind)
        raise
    if best is None or best.cost:
        other, lost = cut_folding(cutting, start)
        failure = failure or lost
        if other is not None and (best is None or other.cost < best.cost):
            best = other
    if best is None:
        refuse_crossed(ground, borders, whole.kind)
        raise MeshError(
            f"{failure}; no cut beside it is valid either: move the lattice or the border a "
            "little, or change the panel size"
        )
    if best.rim.shortest < 1e-4 * size:
        raise MeshError(
            f"the cut leaves an edge of {best.rim.shortest:.1e} mm: the border meets a vertex of "
            "the shell where it cannot step aside; move the lattice or the border a little, or "
            "change the panel size"
        )
    return CutShell(best.shell, _report(best, borders, size))


def _report(made: Attempt, borders: Sequence[Border], size: float) -> CutReport:
    shell = made.shell
    return CutReport(
        panels=len(shell.panels),
        cut=made.cut,
        merged=made.merged,
        dropped=made.tidied.dropped,
        kept=made.tidied.kept,
        planes=int(np.count_nonzero(shell.parents[np.unique(shell.rings[3])] < 0)),
        rim_distance=border_distance(shell, borders, size / 16),
        ruling_angle=max(fence.angle for fence in made.fences),
        shortest_edge=made.rim.shortest,
        ways=tuple(fence.way for fence in made.fences),
    )

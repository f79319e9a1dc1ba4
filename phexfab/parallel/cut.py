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
from phexfab.parallel.aside import RimEdges, rim_edges, step_aside
from phexfab.parallel.border import Border, distance_to_segments, samples_of
from phexfab.parallel.fence import Fence, build_fence
from phexfab.parallel.shell import Shell
from phexfab.parallel.slivers import Patchwork, Tidied, tidy
from phexfab.parallel.split import split
from phexfab.parallel.stations import place_stations
from phexfab.parallel.walk import Ground, LostWayError, walk

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

ROUNDS = 6
"""How often stations may step aside, to avoid vertices and short edges."""


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
        the given direction) or ``"flat"`` (one plane).
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


@dataclass(frozen=True, eq=False)
class _Attempt:
    shell: Shell
    fences: list[Fence]
    tidied: Tidied
    merged: int
    cut: int
    rim: RimEdges

    @property
    def cost(self) -> float:
        """Pieces that are too thin, and edges that are too short, very short ones more."""
        return len(self.tidied.deepest) + self.rim.lack


def cut_shell(
    whole: Shell,
    borders: Sequence[Border],
    *,
    sliver_share: float = 0.05,
    sliver_width: float | None = None,
    shortest_edge: float | None = None,
    depth: float = 0.0,
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
    depth : float, mm
        How deep the structure is. Edges of cut panels that would vanish in an offset by this much,
        to either side, count as too short, too.
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
    for name, value in (
        ("sliver_share", sliver_share),
        ("sliver_width", sliver_width),
        ("shortest_edge", shortest_edge),
        ("depth", depth),
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
        depth,
    )
    stations = [place_stations(ground.finder, one, sag, size, limits[2], along) for one in borders]
    best: _Attempt | None = None
    failure: MeshError | None = None
    deepest = np.zeros((0, 3))
    idle = 0
    for k in range(ROUNDS):
        measured: RimEdges | None = None
        fences = [
            build_fence(one, at, size / 12, along)
            for one, at in zip(borders, stations, strict=True)
        ]
        push = 1e-7 * size * (-1.0 if k % 2 == 0 else 1.0)
        try:
            made = _attempt(whole, ground, fences, push, limits)
        except LostWayError as error:
            failure = failure or error
        else:
            idle = idle + 1 if best is not None and made.cost > 0.98 * best.cost else 0
            if best is None or made.cost < best.cost:
                best = made
            if not made.cost or idle == 2:
                break
            deepest, measured = made.tidied.deepest, made.rim
        margin = max(limits[2], 1e-3 * size)
        stations = [
            step_aside(ground, fence, margin, limits[1], sag, deepest, measured, k)
            for fence in fences
        ]
    if best is None:
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


def _attempt(
    whole: Shell,
    ground: Ground,
    fences: list[Fence],
    push: float,
    limits: tuple[float, float, float, float],
) -> _Attempt:
    walks, first = [], 0
    for fence in fences:
        walks.append(walk(ground, fence, push, first))
        first += len(fence.normals)
    pieces = split(whole, ground, walks)
    rim = int(np.count_nonzero(pieces.parent >= 0))
    old = pieces.parent[:rim]
    plane_normals = np.concatenate([fence.normals for fence in fences])
    normals = np.concatenate([whole.normals[old], plane_normals])
    plane_heights = np.concatenate([fence.heights for fence in fences])
    heights = np.concatenate([whole.heights[old], plane_heights])
    try:
        patch = Patchwork(normals, heights, pieces.triangles, rim)
    except ValueError as error:
        raise LostWayError(f"a border touches a panel twice: {error}") from error
    tidied = tidy(patch, pieces.cut.tolist(), limits[0], limits[1])
    shell = _shell(whole, patch, old, fences)
    measured = rim_edges(shell, limits[2], limits[3])
    return _Attempt(
        shell,
        fences,
        tidied,
        tidied.merged + pieces.filled,
        len(pieces.cut) + pieces.filled,
        measured,
    )


def _shell(whole: Shell, patch: Patchwork, old: IntArray, fences: list[Fence]) -> Shell:
    """Return the patchwork as a shell: panels in the order of the whole shell, then rim planes."""
    triangles = patch.triangles()
    rim = patch.rim
    plane_of = np.concatenate([np.arange(len(patch.heights) - len(patch.copies)), patch.copies])
    plane_of = plane_of.astype(np.int64)
    centres = [np.zeros((0, 3))]
    for fence in fences:
        ends = np.roll(fence.points, -1, axis=0)
        single = fence.border.points[:1]
        centres.append((fence.points + ends) / 2 if len(fence.points) else single)
    middle = np.concatenate(centres)

    normals, heights = patch.normals, patch.heights
    lids = [int(f) for f in _closed(patch)]
    for lid in lids:
        # A plane all around a hole has a closed ring, like a panel. A triangle of two further
        # planes that nothing is built from opens it.
        x = np.cross(normals[lid], np.eye(3)[np.abs(normals[lid]).argmin()])
        x /= np.linalg.norm(x)
        spare = np.stack([x, np.cross(normals[lid], x)])
        n = len(normals)
        triangles = np.vstack([triangles, [[lid, n, n + 1]]])
        normals = np.vstack([normals, spare])
        point = middle[plane_of[lid] - rim]
        heights = np.append(heights, spare @ point)
        plane_of = np.append(plane_of, [plane_of[lid]] * 2)

    used = np.unique(triangles)
    parent = np.full(len(normals), -1)
    parent[:rim] = old
    order = used[np.lexsort((used, np.where(parent[used] < 0, len(whole.normals), parent[used])))]
    number = np.full(len(normals), -1)
    number[order] = np.arange(len(order))
    mine = parent[order]
    own = mine >= 0
    plane = plane_of[order] - rim
    points = np.where(own[:, None], whole.points[mine], middle[np.maximum(plane, 0)])
    gauss = np.where(own, whole.gauss_heights[mine], 0.0)
    table = number[triangles]
    parameters = whole.parameters
    if len(parameters):
        parameters = np.where(own, parameters[mine], 0.0)
        # A rim plane has the parameter of a panel beside it.
        rows, columns = np.nonzero(~own[table])
        beside = table[rows, (columns + 1) % 3]
        beside = np.where(own[beside], beside, table[rows, (columns + 2) % 3])
        good = own[beside]
        parameters[table[rows, columns][good]] = parameters[beside[good]]
    first = np.lexsort((table.max(axis=1), table.min(axis=1)))
    return Shell(
        normals[order],
        heights[order],
        gauss,
        table[first],
        whole.kind,
        points,
        whole.step,
        parameters,
        whole,
        mine,
    )


def _closed(patch: Patchwork) -> list[int]:
    """Return the rim planes with a closed ring."""
    planes = list(range(patch.rim, len(patch.heights)))
    return [f for f, ring in patch.rings(planes).items() if ring]


def _report(made: _Attempt, borders: Sequence[Border], size: float) -> CutReport:
    shell = made.shell
    border = shell.edges[shell.edges[:, 3] < 0]
    begin, end = shell.mesh.vertices[border[:, 0]], shell.mesh.vertices[border[:, 1]]
    given = np.concatenate([one.points for one in borders])
    onward = np.concatenate([np.roll(one.points, -1, axis=0) for one in borders])
    spacing = size / 16
    there = distance_to_segments(samples_of(begin, end, spacing), given, onward)
    back = distance_to_segments(samples_of(given, onward, spacing), begin, end)
    return CutReport(
        panels=len(shell.panels),
        cut=made.cut,
        merged=made.merged,
        dropped=made.tidied.dropped,
        kept=made.tidied.kept,
        planes=int(np.count_nonzero(shell.parents[np.unique(shell.rings[3])] < 0)),
        rim_distance=float(max(there.max(), back.max())),
        ruling_angle=max(fence.angle for fence in made.fences),
        shortest_edge=made.rim.shortest,
        ways=tuple(fence.way for fence in made.fences),
    )

"""Flat sides of a border, folded a little where they would pass close by a vertex of the mesh.

A side in one plane cannot step aside. But it may be folded: along lines in that plane, those in
which the film's normals are projected to it, so that node axes there stand as upright as the plane
allows. A fold adds ``s·ℓ(x)`` to the height of all planes that follow, ℓ the distance from its
line; the sizes s are free, so the side can follow any sequence of small displacements.

Which ones is decided by dynamic programming along the side: at every station the displacement is
one of several levels, a vertex that is too near to the plane costs much, leaving the plane little.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.parallel.aside import RimEdges
from phexfab.parallel.border import Border
from phexfab.parallel.fence import Fence, Stations
from phexfab.parallel.shell import Shell
from phexfab.parallel.stations import deviation, middles_of_arcs
from phexfab.parallel.walk import Ground

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

LEVELS = 24
"""Displacements on either side of the plane that are tried."""

TOO_NEAR = 50.0
"""Cost of a vertex in the plane, against 1 for a chord that is displaced by as much as may be."""

FLAT_FOLD = 0.01
"""Folds below this many radians are left out: planes would meet in no certain line."""

STRAIGHT = 1e-7
"""Share of a border by which a straight side may leave its chord."""


@dataclass(frozen=True)
class Wanted:
    """What planes are to keep from vertices.

    Attributes
    ----------
    least : float, mm
        Distance.
    depth : (below, above), mm
        In all offsets from −below to above.
    size : float, mm
        Of a panel.
    held : bool
        Sides do not turn next to corners, where planes that lean meet in axes that lean more.
    """

    least: float
    depth: tuple[float, float]
    size: float
    held: bool = False


@dataclass(frozen=True, eq=False)
class FlatSide:
    """A side of a border, between two corners, in one plane.

    Attributes
    ----------
    start, length : float, mm
        Along the border.
    plane : (4,)
        Normal and height.
    places : (n,) mm
        Where it may fold, from the start on, ascending.
    wanted : Wanted
        What its planes are to keep from vertices.
    """

    start: float
    length: float
    plane: FloatArray
    places: FloatArray
    wanted: Wanted

    def along(self, border: Border, stop: FloatArray, slack: float) -> BoolArray:
        """Say which places (n,), mm along the border, are on the side or that near to its ends."""
        on = (stop - self.start + slack) % border.length
        return np.asarray(on <= self.length + 2 * slack)


@dataclass(frozen=True, eq=False)
class _Near:
    """Vertices near a flat side: mm along it, and the displacements (low, high) that are bad."""

    along: FloatArray
    low: FloatArray
    high: FloatArray


def flat_sides(
    ground: Ground, border: Border, stations: Stations, wanted: Wanted
) -> list[FlatSide]:
    """Return the sides that lie in one plane; they may fold in the middle of their panels."""
    m = len(stations.along)
    if m < 2:
        return []
    after = np.roll(np.arange(m), -1)
    found = []
    for k in np.flatnonzero(
        np.isfinite(stations.planes[:, 3]) & stations.fixed & stations.fixed[after]
    ).tolist():
        start, end = float(stations.along[k]), float(stations.along[after[k]])
        middle = middles_of_arcs(ground.finder, border, start, end, wanted.size, 2.5 * wanted.least)
        places = np.array(middle) - start
        length = (end - start) % border.length
        found.append(FlatSide(start, length, stations.planes[k].copy(), places, wanted))
    return found


def straight_planes(border: Border, stations: Stations, fence: Fence) -> Stations:
    """Return stations at which straight sides have the planes that a fence found for them.

    A straight side lies in many planes, so none is its own; but one plane is all that it can have,
    for any two would meet in the side itself. Given to it, that plane may fold.

    Parameters
    ----------
    border : Border
    stations : Stations
        Of the border.
    fence : Fence
        For these stations.
    """
    along = stations.along
    if len(along) < 2:
        return stations
    ends = np.append(along[1:], along[0] + border.length)
    free = ~np.isfinite(stations.planes[:, 3]) & stations.fixed & np.roll(stations.fixed, -1)
    planes = stations.planes.copy()
    for k in np.flatnonzero(free).tolist():
        off = deviation(border, along[k], ends[k], (ends[k] - along[k]) / 8)
        if off <= STRAIGHT * border.length:
            planes[k] = np.append(fence.normals[k], fence.heights[k])
    return replace(stations, planes=planes)


def shifted(sides: list[FlatSide], fence: Fence, rim: RimEdges) -> list[FlatSide]:
    """Return sides whose folds leave the ends of their panels' arcs, or are left out there.

    Parameters
    ----------
    sides : list of FlatSide
    fence : Fence
        That was cut along.
    rim : RimEdges
        Of that cut.
    """
    if not len(rim.stations) or not sides:
        return sides
    lack = rim.wanted - rim.lengths
    which = cKDTree(fence.points).query(rim.stations)[1]
    made = []
    for side in sides:
        places, keep = side.places.copy(), np.ones(len(side.places), bool)
        for row in np.flatnonzero((lack > 0).any(axis=1)).tolist():
            at = (fence.stations.along[which[row]] - side.start) % fence.border.length
            near = np.flatnonzero(np.abs(side.places - at) < 1e-6 * side.wanted.size)
            if not len(near):
                continue
            before, after = lack[row].tolist()
            if before + after < 0:
                room = -(before + after) / 4
                places[near] += before + room if before > 0 else -(after + room)
            else:
                keep[near] = False
        made.append(replace(side, places=np.sort(places[keep])))
    return made


def fold(
    whole: Shell,
    ground: Ground,
    border: Border,
    stations: Stations,
    sides: list[FlatSide],
) -> Stations:
    """Return stations with those at which flat sides fold; earlier folds are forgotten.

    Parameters
    ----------
    whole : Shell
        That is to be cut.
    ground : Ground
        Of that shell.
    border : Border
    stations : Stations
        Of the border.
    sides : list of FlatSide
    """
    given = np.isfinite(stations.planes[:, 3])
    keep = stations.fixed | ~(given & np.roll(given, 1))
    along, planes = stations.along[keep], stations.planes[keep]
    aside, fixed = stations.aside[keep], stations.fixed[keep]
    for side in sides:
        at, folded = _folded(whole, ground, border, side)
        corner = int(np.abs(along - side.start).argmin())
        planes[corner] = folded[0]
        along = np.concatenate([along, (side.start + at) % border.length])
        planes = np.concatenate([planes, folded[1:]])
        aside = np.concatenate([aside, np.zeros((len(at), 3))])
        fixed = np.concatenate([fixed, np.zeros(len(at), bool)])
    order = np.argsort(along, kind="stable")
    made = Stations(along[order], aside[order], fixed[order], planes[order])
    return replace(made, aside=_on_planes(border, made))


def _folded(
    whole: Shell, ground: Ground, border: Border, side: FlatSide
) -> tuple[FloatArray, FloatArray]:
    """Return mm along the side of folds, and the (n + 1, 4) planes before and after them."""
    wanted = side.wanted
    most = 2.0 * wanted.least + max(wanted.depth)
    at = np.concatenate([[0.0], side.places, [side.length]])
    near = _vertices_near(whole, ground, border, side, most)
    off = _displacements(at, near, most, wanted.held)
    keep = _kept(at, off)
    at, off = at[keep], off[keep]
    if not off.any():
        return np.zeros(0), side.plane[None]
    points, normals = border.at(side.start + at)
    return at[1:-1], _planes(side.plane, points, normals, off)


def _vertices_near(
    whole: Shell,
    ground: Ground,
    border: Border,
    side: FlatSide,
    most: float,
) -> _Near:
    wanted, plane = side.wanted, side.plane
    (below, above), least = wanted.depth, wanted.least
    stops = np.linspace(0.0, side.length, max(3, int(np.ceil(24 * side.length / wanted.size))))
    points, _ = border.at(side.start + stops)
    reach = 2.0 * (most + least + max(below, above))
    found = ground.vertices.query_ball_point(points, reach)
    vertex = np.unique(np.concatenate([np.asarray(row, np.int64) for row in found]))
    spots, images = ground.mesh.vertices[vertex], whole.gauss.vertices[vertex]
    away = np.linalg.norm(spots[:, None] - points, axis=2)
    n = plane[:3]
    high = spots @ n - plane[3]
    # An offset by t moves a vertex by t times its image; the plane stays.
    slide = images @ n
    low = high + np.minimum(np.minimum(-below * slide, above * slide), 0.0) - least
    top = high + np.maximum(np.maximum(-below * slide, above * slide), 0.0) + least
    keep = (low < most) & (top > -most)
    return _Near(stops[away.argmin(axis=1)][keep], low[keep], top[keep])


def _displacements(at: FloatArray, near: _Near, most: float, held: bool) -> FloatArray:
    """Return (n,) the displacement at every station that keeps away from vertices best.

    The first two are the same, and the last two, where the ends are to be held.
    """
    levels = most * np.arange(-LEVELS, LEVELS + 1) / LEVELS
    mean = np.abs(levels[:, None] + levels) / (2 * most)
    mean = mean + 3 * mean**2
    turned = np.where(np.eye(len(levels)), 0.0, np.inf)
    total, came = np.zeros(len(levels)), []
    segment = np.clip(np.searchsorted(at, near.along, side="right") - 1, 0, len(at) - 2)
    for k in range(len(at) - 1):
        span = at[k + 1] - at[k]
        cost = mean + (levels[:, None] - levels) ** 2 / (most * span)
        rows = np.flatnonzero(segment == k)
        share = ((near.along[rows] - at[k]) / span)[:, None, None]
        here = (1 - share) * levels[:, None] + share * levels
        low, high = near.low[rows][:, None, None], near.high[rows][:, None, None]
        deep = np.minimum(here - low, high - here) / (high - low)
        cost = cost + TOO_NEAR * (np.maximum(deep, 0.0) + 0.1 * (deep > 0)).sum(axis=0)
        if held and k in (0, len(at) - 2):
            cost = cost + turned
        whole = total[:, None] + cost
        came.append(whole.argmin(axis=0))
        total = whole.min(axis=0)
    at_level = [int(total.argmin())]
    for back in reversed(came):
        at_level.append(int(back[at_level[-1]]))
    return np.asarray(levels[at_level[::-1]])


def _kept(at: FloatArray, off: FloatArray) -> IntArray:
    """Return the stations at which the displacements bend, and the ends."""
    keep = list(range(len(at)))
    while len(keep) > 2:
        slope = np.diff(off[keep]) / np.diff(at[keep])
        fold = np.abs(np.diff(slope))
        if fold.min() >= FLAT_FOLD:
            break
        del keep[int(fold.argmin()) + 1]
    return np.array(keep)


def _planes(
    plane: FloatArray, points: FloatArray, normals: FloatArray, off: FloatArray
) -> FloatArray:
    """Return the (n − 1, 4) planes through displaced points that meet in the folds' lines."""
    n = plane[:3]
    chord = np.diff(points, axis=0)
    length = np.linalg.norm(chord, axis=1)
    ahead = chord / length[:, None]
    upright = np.cross(n, ahead)
    slope = np.diff(off) / length
    line = normals - (normals @ n)[:, None] * n
    line = line[1:-1] / np.linalg.norm(line[1:-1], axis=1, keepdims=True)
    # Gradients slope·ahead + t·upright of neighbouring planes agree along their line: a recursion
    # t[k + 1] = a·t[k] + b; the first t is the one that leaves the smallest of them all.
    by, of = np.ones(len(chord)), np.zeros(len(chord))
    for k in range(len(chord) - 1):
        r = line[k]
        below = upright[k + 1] @ r
        a = (upright[k] @ r) / below
        b = (slope[k] * (ahead[k] @ r) - slope[k + 1] * (ahead[k + 1] @ r)) / below
        by[k + 1], of[k + 1] = a * by[k], a * of[k] + b
    t = of - by * (by @ of) / (by @ by)
    gradient = slope[:, None] * ahead + t[:, None] * upright
    tilted = n - gradient
    height = plane[3] + off[:-1] - np.einsum("ij,ij->i", gradient, points[:-1])
    size = np.linalg.norm(tilted, axis=1)
    return np.column_stack([tilted / size[:, None], height / size])


def _on_planes(border: Border, stations: Stations) -> FloatArray:
    """Return (m, 3) by how much stations between given planes stand beside the border: in both
    planes, and in the film."""
    points, normals = border.at(stations.along)
    before = np.roll(stations.planes, 1, axis=0)
    both = np.isfinite(stations.planes[:, 3]) & np.isfinite(before[:, 3])
    aside = stations.aside.copy()
    rows = np.flatnonzero(both)
    matrix = np.stack([before[rows, :3], stations.planes[rows, :3], normals[rows]], axis=1)
    high = np.stack([before[rows, 3], stations.planes[rows, 3]], axis=1)
    lack = high - np.einsum("kij,kj->ki", matrix[:, :2], points[rows])
    right = np.column_stack([lack, np.zeros(len(rows))])
    aside[rows] = np.linalg.solve(matrix, right[..., None])[..., 0]
    return aside

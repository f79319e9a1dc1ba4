"""Where the chords of a border begin and end: one station for each panel that it crosses."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.errors import MeshError
from phexfab.mesh.measures import face_normals
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.border import Border
from phexfab.parallel.fence import Stations, flat_plane

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

STRAIGHT = 0.1
"""A station is left out where that moves the chord by less than this share of the sagitta."""

SHORT_ARC = 0.35
"""Arcs shorter than this share of the median arc in a panel get no station of their own."""


class PanelFinder:
    """Finds the panel of a mesh that lies above or below a point of the film.

    Parameters
    ----------
    mesh : PolyMesh
    """

    def __init__(self, mesh: PolyMesh) -> None:
        points = mesh.vertices[mesh.corners]
        self.normals = face_normals(mesh)
        self.middle = np.add.reduceat(points, mesh.starts[:-1]) / mesh.sides[:, None]
        self.tree = cKDTree(self.middle)
        widest = int(mesh.sides.max())
        place = np.minimum(np.arange(widest), mesh.sides[:, None] - 1)
        self.rings = points[mesh.starts[:-1, None] + place]  # the last corner repeats

    def find(self, points: FloatArray, normals: FloatArray) -> IntArray:
        """Return (n,) the panel that the line through each point along its normal meets; or −1."""
        count = min(10, len(self.middle))
        found = np.full(len(points), -1)
        for part in np.array_split(np.arange(len(points)), 1 + len(points) // 4000):
            if not len(part):
                continue
            near = self.tree.query(points[part], k=count)[1].reshape(len(part), -1)
            p, n = points[part][:, None], normals[part][:, None]
            panel = self.normals[near]
            slope = np.einsum("pki,pki->pk", panel, np.broadcast_to(n, panel.shape))
            rise = np.einsum("pki,pki->pk", panel, self.middle[near] - p)
            rise = np.where(np.abs(slope) > 0.1, rise / np.where(slope == 0, 1.0, slope), np.inf)
            # Seen along the sample's normal: two axes across it.
            x = np.cross(normals[part], np.eye(3)[np.abs(normals[part]).argmin(axis=1)])
            x /= np.linalg.norm(x, axis=1, keepdims=True)
            y = np.cross(normals[part], x)
            ring = self.rings[near] - p[:, :, None]
            u = np.einsum("pksi,pi->pks", ring, x)
            v = np.einsum("pksi,pi->pks", ring, y)
            u1, v1 = np.roll(u, -1, axis=2), np.roll(v, -1, axis=2)
            crosses = (v > 0) != (v1 > 0)
            at = u - v * (u1 - u) / np.where(crosses, v1 - v, 1.0)
            inside = (crosses & (at > 0)).sum(axis=2) % 2 == 1
            height = np.where(inside & np.isfinite(rise), np.abs(rise), np.inf)
            best = height.argmin(axis=1)
            rows = np.arange(len(part))
            found[part] = np.where(np.isfinite(height[rows, best]), near[rows, best], -1)
        return found


def place_stations(
    finder: PanelFinder,
    border: Border,
    sagitta: float,
    size: float,
    shortest: float,
    direction: FloatArray | None = None,
) -> Stations:
    """Return the stations of a border on a mesh.

    Parameters
    ----------
    finder : PanelFinder
        Of the mesh that is to be cut.
    border : Border
    sagitta : float, mm
        Chords stay within this distance of the border.
    size : float, mm
        Of a panel.
    shortest : float, mm
        Edge that is wanted: panels with an arc of less than about two of them get no station.
    direction : (3,), optional
        Of all rulings: planar sides that do not contain it get chords.

    Raises
    ------
    MeshError
        If the border is so small that it has no three chords.
    """
    corners = border.stops[border.corners]
    sides = list(zip(corners, np.roll(corners, -1), strict=True)) if len(corners) else [(0.0, 0.0)]
    planes = [flat_plane(border, a, b) for a, b in sides]
    if direction is not None:
        planes = [p if p is None or abs(p[:3] @ direction) < 1e-9 else None for p in planes]
    if all(p is not None for p in planes) and all(_same(planes[0], p, border) for p in planes):
        nothing = np.zeros(0)
        return Stations(nothing, np.zeros((0, 3)), np.zeros(0, bool), np.array([planes[0]]))
    along: list[float] = []
    fixed: list[bool] = []
    given: list[FloatArray] = []
    free = np.full(4, np.nan)
    for k, ((a, b), plane) in enumerate(zip(sides, planes, strict=True)):
        inner: list[float] = []
        if plane is None:
            inner = _side_stations(finder, border, a, b, sagitta, size, shortest, len(corners) > 0)
        elif _same(planes[k - 1], plane, border):
            continue  # the corner lies in the middle of one plane: nothing turns there
        if len(corners):
            along, fixed = [*along, a], [*fixed, True]
            given.append(free if plane is None else plane)
        along, fixed = along + inner, fixed + [False] * len(inner)
        given += [free] * len(inner)
    s = np.array(along)
    order = np.argsort(s % border.length, kind="stable")
    if len(s) < 2 or (len(s) < 3 and not np.isfinite(np.array(given)).any()):
        raise MeshError(
            f"a border of {border.length:.0f} mm is too small for panels of {size:.0f} mm; make "
            "the panels smaller or leave this border out"
        )
    return Stations(
        (s % border.length)[order],
        np.zeros((len(s), 3)),
        np.array(fixed)[order],
        np.array(given)[order],
    )


def _same(one: FloatArray | None, two: FloatArray | None, border: Border) -> bool:
    if one is None or two is None:
        return False
    near = abs(one[3] - two[3]) < 1e-5 * border.length
    return bool(one[:3] @ two[:3] > 1 - 1e-10) and near


def _side_stations(
    finder: PanelFinder,
    border: Border,
    start: float,
    end: float,
    sagitta: float,
    size: float,
    shortest: float,
    open_side: bool,
) -> list[float]:
    """Return mm along the border of the stations strictly inside a side."""
    length = (end - start) % border.length or border.length
    middle = middles_of_arcs(finder, border, start, end, size, 2.5 * shortest, open_side)
    ends = [start, start + length] if open_side else []
    least = 0 if open_side else 3
    if len(middle) < least:
        middle = (start + length * (np.arange(least) + 0.5) / least).tolist()
    wanted = _thin(border, middle, ends, STRAIGHT * sagitta, size, least)
    return _refine(border, wanted, ends, sagitta, size)


def middles_of_arcs(
    finder: PanelFinder,
    border: Border,
    start: float,
    end: float,
    size: float,
    least: float,
    open_side: bool = True,
) -> list[float]:
    """Return mm along the border of the middles of its arcs in panels, those of a side's ends not.

    Arcs shorter than ``least``, or than a share of the median arc, are left out.
    """
    stops = border.between(start, end, min(size / 24, border.length / 48))
    if not open_side:
        stops = stops[:-1]
    panels = finder.find(*border.at(stops))
    change = np.flatnonzero(panels[1:] != panels[:-1]) + 1
    bounds = np.concatenate([[0], change, [len(stops)]])
    length = (end - start) % border.length or border.length
    edges = np.append(stops, start + length)[bounds]
    first, last, of = edges[:-1], edges[1:], panels[bounds[:-1]]
    if not open_side and len(of) > 1 and of[0] == of[-1]:  # the arc around the seam is one
        first, last = first[1:].copy(), last[1:].copy()
        last[-1], of = first[0] + length, of[1:]
    keep = of >= 0
    if open_side:
        keep[[0, -1]] = False  # the corners are stations of their panels
    span = last - first
    keep &= span >= max(SHORT_ARC * np.median(span), least)
    return [float(s) for s in ((first + last) / 2)[keep]]


def deviation(border: Border, a: float, b: float, size: float) -> float:
    """Return the largest distance of the border between two stations from their chord."""
    points, _ = border.at(border.between(a, b, min((b - a) / 8, size / 6)))
    chord = points[-1] - points[0]
    square = float(chord @ chord)
    if not square:
        return np.inf
    off = points - points[0]
    off = off - np.outer(np.clip(off @ chord / square, 0, 1), chord)
    return float(np.linalg.norm(off, axis=1).max())


def _thin(
    border: Border, inner: list[float], ends: list[float], limit: float, size: float, least: int
) -> list[float]:
    """Leave out stations where the border is straight."""
    if not inner:
        return []
    kept: list[float] = []
    before = ends[0] if ends else inner[0]
    candidates = inner if ends else inner[1:]
    last = ends[1] if ends else inner[0] + border.length
    spare = len(inner) - least
    for k, s in enumerate(candidates):
        after = candidates[k + 1] if k + 1 < len(candidates) else last
        if spare > 0 and deviation(border, before, after, size) <= limit:
            spare -= 1
            continue
        kept.append(s)
        before = s
    return kept if ends else [inner[0], *kept]


def _refine(
    border: Border, inner: list[float], ends: list[float], limit: float, size: float
) -> list[float]:
    """Add stations until every chord is within the limit."""
    loop = [ends[0], *inner, ends[1]] if ends else [*inner, inner[0] + border.length]
    made: list[float] = []
    shortest = 0.02 * size
    for a, b in pairwise(loop):
        pieces = [(a, b)]
        while pieces:
            low, high = pieces.pop()
            if high - low > shortest and deviation(border, low, high, size) > limit:
                pieces += [((low + high) / 2, high), (low, (low + high) / 2)]
            else:
                made.append(low)
    return made[1:] if ends else made


def moved(stations: Stations, along: FloatArray, aside: FloatArray) -> Stations:
    """Return stations moved along the border, where they are no corners, and beside it."""
    return replace(
        stations, along=stations.along + np.where(stations.fixed, 0.0, along), aside=aside
    )


def without(stations: Stations, gone: BoolArray) -> Stations:
    """Return stations without some of those that are not fixed."""
    keep = ~gone | stations.fixed
    return Stations(
        stations.along[keep], stations.aside[keep], stations.fixed[keep], stations.planes[keep]
    )

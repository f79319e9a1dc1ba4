"""The closed curves in which a periodic minimal surface meets its box."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from phexfab.surface.periodic.closed_forms import PeriodicSurface
from phexfab.surface.periodic.cut import (
    Tiles,
    clip,
    normals_at,
    on_planes,
    outer_edges,
    plane,
    touching,
)

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

_DENSE = 4
"""Points of a border per edge of a triangle."""

_CLOSE = 0.25
"""Points of a border nearer to each other than this part of the mean step are thinned out."""


@dataclass(frozen=True, eq=False)
class BoxBorder:
    """A closed curve in which a film meets the faces of its box.

    Attributes
    ----------
    points : (n, 3) float
        In order, the first not repeated, in mm. The film inside the box is on the left, seen from
        the tips of the normals.
    normals : (n, 3) float
        Unit normals of the film.
    corners : (c,) int
        Where the curve turns from one face of the box to the next; empty if it stays in one. The
        curve begins at the first corner.
    faces : (max(c, 1),) int
        The face of the box in which the curve runs on from each corner: 0 … 5 for x low, x high,
        y low, y high, z low, z high.
    """

    points: FloatArray
    normals: FloatArray
    corners: IntArray
    faces: IntArray


@dataclass(frozen=True, eq=False)
class Cut:
    """A film cut at the faces of its box.

    Attributes
    ----------
    points, normals : (n, 3) float
        Vertices in mm, on the surface and in the box, and unit normals.
    triangles : (m, 3) int
        Oriented as in the film; thin ones occur along the cut.
    borders : tuple of BoxBorder
    """

    points: FloatArray
    normals: FloatArray
    triangles: IntArray
    borders: tuple[BoxBorder, ...]

    @property
    def area(self) -> float:
        """Area of the triangles, in mm²."""
        a, b, c = np.moveaxis(self.points[self.triangles], 1, 0)
        return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def cut_at_box(surface: PeriodicSurface, tiles: Tiles, size: FloatArray, cell: float) -> Cut:
    """Cut a mesh that covers the box from the origin to ``size`` (in cells); see `Cut`, in mm.

    Raises
    ------
    SurfaceError
        If the surface touches a face or an edge of the box without crossing it.
    """
    for face in range(6):
        tiles = clip(surface, tiles, face, size)
    used, index = np.unique(tiles.triangles, return_inverse=True)
    tiles = replace(
        tiles,
        points=tiles.points[used],
        normals=tiles.normals[used],
        on=tiles.on[used],
        triangles=index.reshape(-1, 3),
    )
    borders = _borders(surface, tiles, size, cell)
    return Cut(cell * tiles.points, tiles.normals, tiles.triangles, borders)


def _borders(
    surface: PeriodicSurface, tiles: Tiles, size: FloatArray, cell: float
) -> tuple[BoxBorder, ...]:
    """Return the closed curves of outer edges, with points of the surface between their ends."""
    rows, sides = outer_edges(tiles.triangles)
    starts, ends = tiles.triangles[rows, sides], tiles.triangles[rows, (sides + 1) % 3]
    common = tiles.on[starts] & tiles.on[ends]
    twice = np.flatnonzero(np.bincount(starts, minlength=len(tiles.points)) > 1)
    loose = starts[common == 0]
    if len(twice) or len(loose):
        raise touching(surface, tiles.points[twice[0] if len(twice) else loose[0]])
    face = np.array([int(c).bit_length() - 1 for c in common], np.int64)
    # The curve between the ends of each edge: by Newton on the surface, in the face of the box.
    t = np.arange(_DENSE) / _DENSE
    h0, h1 = tiles.parameters[rows, sides], tiles.parameters[rows, (sides + 1) % 3]
    h = h0[:, None] + t * (h1 - h0)[:, None]
    points = np.empty((*h.shape, 3))
    for k in np.unique(face):
        axis, place, _ = plane(int(k), size)
        on = np.flatnonzero(face == k)
        images = (
            np.repeat(tiles.octants[rows[on], None], _DENSE, 1),
            np.repeat(tiles.shifts[rows[on], None], _DENSE, 1),
        )
        h[on] = on_planes(surface, images, h[on], [(axis, place)])
        points[on] = surface.place(*images, h[on])
        points[on, :, axis] = place
    normals = normals_at(surface, np.repeat(tiles.octants[rows, None], _DENSE, 1), h)
    points[:, 0], normals[:, 0] = tiles.points[starts], tiles.normals[starts]

    edge_at = np.full(len(tiles.points), -1)
    edge_at[starts] = np.arange(len(starts))
    following = edge_at[ends]
    borders, seen = [], np.zeros(len(starts), bool)
    for begin in range(len(starts)):
        if seen[begin]:
            continue
        loop = [begin]
        while following[loop[-1]] != begin:
            loop.append(int(following[loop[-1]]))
        seen[loop] = True
        run = np.array(loop)
        turns = np.flatnonzero(face[run] != np.roll(face[run], 1))
        if len(turns):
            run = np.roll(run, -turns[0])
            turns = turns - turns[0]
        corners = _DENSE * turns
        curve, across = points[run].reshape(-1, 3), normals[run].reshape(-1, 3)
        kept = _thinned(curve, corners)
        curve, across, side = curve[kept], across[kept], np.repeat(face[run], _DENSE)[kept]
        corners = np.searchsorted(np.flatnonzero(kept), corners)
        _check_side(surface, curve, across, side)
        faces = side[corners] if len(corners) else side[:1]
        borders.append(BoxBorder(cell * curve, across, corners, faces))
    return tuple(borders)


def _thinned(curve: FloatArray, corners: IntArray) -> BoolArray:
    """Return which points of a closed curve to keep so that none are very near to each other."""
    steps = np.linalg.norm(np.roll(curve, -1, axis=0) - curve, axis=1)
    least = _CLOSE * float(steps.mean())
    keep = np.ones(len(curve), bool)
    fixed = set(corners.tolist()) | {0}
    last = 0
    for i in range(1, len(curve)):
        if i not in fixed and np.linalg.norm(curve[i] - curve[last]) < least:
            keep[i] = False
            continue
        # A fixed point drives out those before it that are too near.
        while last not in fixed and np.linalg.norm(curve[i] - curve[last]) < least:
            keep[last] = False
            last = int(np.flatnonzero(keep[:last])[-1])
        last = i
    while last not in fixed and np.linalg.norm(curve[0] - curve[last]) < least:
        keep[last] = False
        last = int(np.flatnonzero(keep[:last])[-1])
    return keep


def _check_side(
    surface: PeriodicSurface, curve: FloatArray, normals: FloatArray, face: IntArray
) -> None:
    """Refuse curves that have the film on the wrong side: pieces of two branches that cross."""
    following = np.roll(curve, -1, axis=0)
    left = np.cross(normals + np.roll(normals, -1, axis=0), following - curve)
    inward = left[np.arange(len(face)), face // 2] * np.where(face % 2, -1.0, 1.0)
    if (inward <= 0).any():
        raise touching(surface, curve[int(inward.argmin())])

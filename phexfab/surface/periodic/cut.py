"""Meshes of periodic minimal surfaces clipped at the faces of a box.

New vertices are not on the triangles' edges but on the surface: they are found in the parameter h
of the patch.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import SurfaceError
from phexfab.surface.holomorphic import ComplexArray
from phexfab.surface.periodic.closed_forms import PeriodicSurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Images = tuple[IntArray, FloatArray]

_ON = 1e-11
"""Distance, in cells, below which a vertex is on a face of the box; rounding is 1e-15."""

_WIDE = 0.1
"""Longest step in h; a patch is 0.7 wide."""


@dataclass(frozen=True, eq=False)
class Tiles:
    """A mesh on images of the patch, in cells, with the corner of the box at the origin.

    Attributes
    ----------
    points, normals : (n, 3) float
    on : (n,) int
        Bits of the faces of the box that a vertex is on.
    triangles : (m, 3) int
    octants, shifts, parameters : (m,) int, (m, 3) float, (m, 3) complex
        Which image of the patch a triangle is on, and h of its corners there.
    """

    points: FloatArray
    normals: FloatArray
    on: IntArray
    triangles: IntArray
    octants: IntArray
    shifts: FloatArray
    parameters: ComplexArray


def outer_edges(triangles: IntArray) -> tuple[IntArray, IntArray]:
    """Return (triangle, side) of the sides without a neighbour; side k runs from corner k on."""
    starts, ends = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    base = int(triangles.max(initial=0)) + 1
    lonely = ~np.isin(starts * base + ends, ends * base + starts)
    rows, sides = np.divmod(np.flatnonzero(lonely), 3)
    return rows, sides


def plane(face: int, size: FloatArray) -> tuple[int, float, float]:
    """Return axis and place of a face, and the sign of the outward direction."""
    axis, high = divmod(face, 2)
    return axis, float(size[axis]) if high else 0.0, 1.0 if high else -1.0


def clip(surface: PeriodicSurface, tiles: Tiles, face: int, size: FloatArray) -> Tiles:
    """Return the part of a mesh on the inner side of one face of the box, 0 … 5.

    Raises
    ------
    SurfaceError
        If the surface nearly touches the face or one of its edges.
    """
    axis, place, outward = plane(face, size)
    depth = outward * (place - tiles.points[:, axis])
    touching = np.abs(depth) < _ON
    depth[touching] = 0.0
    points, on = tiles.points.copy(), tiles.on | (touching << face)
    points[touching, axis] = place
    tiles = replace(tiles, points=points, on=on)
    signs = np.sign(depth).astype(np.int64)[tiles.triangles]
    some, none = (signs > 0).any(1), (signs >= 0).all(1)
    whole, split = some & none, np.flatnonzero(some & ~none)

    three, h = tiles.triangles[split], tiles.parameters[split]
    octants, shifts = tiles.octants[split], tiles.shifts[split]
    row, side = np.nonzero(signs[split] * np.roll(signs[split], -1, axis=1) < 0)
    following = (side + 1) % 3
    pair = np.sort(np.column_stack([three[row, side], three[row, following]]), axis=1)
    pair, first, index, count = np.unique(
        pair, axis=0, return_index=True, return_inverse=True, return_counts=True
    )
    index = index.ravel()
    # The first triangle of an edge says where its new vertex is.
    lead, h0, h1 = row[first], h[row, side][first], h[row, following][first]
    images = octants[lead], shifts[lead]
    common = np.where(count == 1, on[pair[:, 0]] & on[pair[:, 1]], 0)
    found = _new_vertices(surface, images, (h0, h1), points[pair], depth[pair], common, face, size)
    fresh, new_on = surface.place(*images, found), common | 1 << face
    normals = normals_at(surface, images[0], found)
    for other in range(face + 1):
        fresh[(new_on >> other & 1) > 0, other // 2] = plane(other, size)[1]

    # h of the new vertices in each triangle: the same, or through the normal on another patch.
    ratio = np.abs(found - h0) / np.abs(h1 - h0)
    forward = three[row, side] == three[lead, side[first]][index]
    ratio = np.where(forward, ratio[index], 1 - ratio[index])
    guess = h[row, side] + ratio * (h[row, following] - h[row, side])
    same = (octants[row] == images[0][index]) & (shifts[row] == images[1][index]).all(1)
    other_h = surface.parameter(octants[row], normals[index], guess)
    h_new = np.where(same, found[index], other_h)

    # Corners and new vertices in turn; what is kept has three or four corners.
    ids, places = np.full((len(split), 6), -1), np.zeros((len(split), 6), complex)
    ids[:, ::2], places[:, ::2] = np.where(signs[split] < 0, -1, three), h
    ids[row, 2 * side + 1], places[row, 2 * side + 1] = len(points) + index, h_new
    order = np.argsort(ids < 0, axis=1, kind="stable")[:, :4]
    ids, places = np.take_along_axis(ids, order, 1), np.take_along_axis(places, order, 1)
    points = np.concatenate([points, fresh])
    four = ids[:, 3] >= 0
    spans = [np.linalg.norm(points[ids[:, k]] - points[ids[:, k + 2]], axis=1) for k in (0, 1)]
    across = four & (spans[1] < spans[0])
    picks = [(~across, [0, 1, 2]), (four & ~across, [0, 2, 3])]
    picks += [(across, [0, 1, 3]), (across, [1, 2, 3])]
    return Tiles(
        points=points,
        normals=np.concatenate([tiles.normals, normals]),
        on=np.concatenate([on, new_on]),
        triangles=np.concatenate([tiles.triangles[whole], *(ids[m][:, c] for m, c in picks)]),
        octants=np.concatenate([tiles.octants[whole], *(octants[m] for m, _ in picks)]),
        shifts=np.concatenate([tiles.shifts[whole], *(shifts[m] for m, _ in picks)]),
        parameters=np.concatenate([tiles.parameters[whole], *(places[m][:, c] for m, c in picks)]),
    )


def _new_vertices(
    surface: PeriodicSurface,
    images: Images,
    ends: tuple[ComplexArray, ComplexArray],
    points: FloatArray,
    depth: FloatArray,
    common: IntArray,
    face: int,
    size: FloatArray,
) -> ComplexArray:
    """Return h where edges from (k, 2, 3) points cross a face; ``common``: faces they lie in."""
    here = plane(face, size)[:2]
    h0, h1 = ends
    h = h0 + _crossing(surface, images, h0, h1, *here) * (h1 - h0)
    # An edge in a face that was cut before: the new vertex is on that face too.
    for other in range(face):
        rows = np.flatnonzero(common >> other & 1)
        planes = [here, plane(other, size)[:2]]
        h[rows] = on_planes(surface, (images[0][rows], images[1][rows]), h[rows], planes)
    # An edge may bulge out of a face cut before, where its ends are near to it: then the place
    # along that axis is the straight edge's.
    share = (depth[:, 0] / (depth[:, 0] - depth[:, 1]))[:, None]
    chord = points[:, 0] + share * (points[:, 1] - points[:, 0])
    for other in range(face):
        axis, place, outward = plane(other, size)
        out = outward * (surface.place(*images, h)[:, axis] - place) > 0
        rows = np.flatnonzero(out & (common >> other & 1 == 0))
        tilted = [here, (axis, chord[rows, axis])]
        h[rows] = on_planes(surface, (images[0][rows], images[1][rows]), h[rows], tilted)
    return h


def normals_at(surface: PeriodicSurface, octants: IntArray, h: ComplexArray) -> FloatArray:
    return np.einsum("...ij,...j->...i", surface.turns[octants], surface.patch.normal(h))


def _slope(surface: PeriodicSurface, octants: IntArray, h: ComplexArray, axis: int) -> ComplexArray:
    """Return dx/dh of the holomorphic function whose real part is a coordinate."""
    return np.einsum(
        "...j,...j->...", surface.turns[octants][..., axis, :], surface.patch.tangent(h)
    )


def _crossing(
    surface: PeriodicSurface,
    images: Images,
    h0: ComplexArray,
    h1: ComplexArray,
    axis: int,
    place: float,
) -> FloatArray:
    """Return t in (0, 1) where a coordinate is ``place`` on h0 + t (h1 − h0)."""
    low, high = np.zeros(len(h0)), np.ones(len(h0))
    rising = surface.place(*images, h0)[:, axis] < place
    t = np.full(len(h0), 0.5)
    for _ in range(60):
        h = h0 + t * (h1 - h0)
        gap = surface.place(*images, h)[:, axis] - place
        before = (gap < 0) == rising
        low, high = np.where(before, t, low), np.where(before, high, t)
        slope = (_slope(surface, images[0], h, axis) * (h1 - h0)).real
        with np.errstate(all="ignore"):
            newton = t - gap / slope
        inside = (newton > low) & (newton < high)
        step = np.where(inside, newton, 0.5 * (low + high)) - t
        t = t + step
        if np.abs(step).max(initial=0.0) < 1e-15:
            break
    return t


def on_planes(
    surface: PeriodicSurface,
    images: Images,
    h: ComplexArray,
    planes: Sequence[tuple[int, float | FloatArray]],
) -> ComplexArray:
    """Return h moved to where one or two coordinates have given values, by Newton.

    Raises
    ------
    SurfaceError
        If that is nowhere near: the surface nearly touches the planes.
    """
    for _ in range(12):
        x = surface.place(*images, h)
        gaps = [x[..., axis] - place for axis, place in planes]
        if max(float(np.abs(gap).max(initial=0.0)) for gap in gaps) < 1e-15:
            return h
        slopes = [_slope(surface, images[0], h, axis) for axis, _ in planes]
        with np.errstate(all="ignore"):
            if len(planes) == 1:
                step = gaps[0] * np.conj(slopes[0]) / np.abs(slopes[0]) ** 2
            else:
                a, b = slopes
                # Re(a s) = gap₀ and Re(b s) = gap₁.
                step = 1j * (gaps[1] * np.conj(a) - gaps[0] * np.conj(b)) / (a * np.conj(b)).imag
            wide = ~(np.abs(step) < _WIDE)
            step[wide] *= _WIDE / np.abs(step[wide])
        h = h - np.nan_to_num(step)
        h = np.where(np.abs(h) < 0.8, h, 0.8 * h / np.maximum(np.abs(h), 0.1))
    x = surface.place(*images, h)
    miss = np.max([np.abs(x[..., axis] - place) for axis, place in planes], axis=0)
    if miss.max(initial=0.0) > _ON:
        raise touching(surface, x[miss > _ON][0])
    return h


def touching(surface: PeriodicSurface, x: FloatArray) -> SurfaceError:
    """Return the error that the surface touches the box at x, in cells."""
    return SurfaceError(
        f"{surface.name}: the surface touches the box at ({x[0]:.6g}, {x[1]:.6g}, {x[2]:.6g}) "
        "cells, or nearly so, without crossing it there; choose another corner of the box, or "
        "shorter edges"
    )

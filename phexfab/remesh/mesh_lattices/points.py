"""Lattice points on a mesh with seamless coordinates, and the directions that leave them.

Lattice coordinates are whole multiples of a binary fraction, so on which side of an edge a point
lies is decided in whole numbers, and alike from both sides of a seam: every point inside, on an
edge or at a vertex appears once.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.remesh.mesh_lattices.poisson import lattice_basis
from phexfab.remesh.mesh_lattices.seamless import Seamless

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

#: The six neighbours of a lattice point, counter-clockwise from the one along the row.
DIRECTIONS = np.array([[1, 0], [0, 1], [-1, 1], [-1, 0], [0, -1], [1, -1]])


@dataclass(frozen=True, eq=False)
class LatticePoints:
    """Lattice points, and every triangle in whose closure they lie ("hits")."""

    face: IntArray  # (h,) triangles of all hits
    at: IntArray  # (h, 2) lattice coordinates in the triangle's own frame
    own: IntArray  # (h,) the point that a hit belongs to
    corner: IntArray  # (h,) corner of the triangle that the point is, −1
    edge: IntArray  # (h,) half-edge of the triangle on which the point lies, −1
    weight: FloatArray  # (h, 3) barycentric coordinates
    first: IntArray  # (F,) hit by which each point is known


def cross(a: IntArray, b: IntArray) -> IntArray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


def lattice_points(on: Seamless) -> LatticePoints:
    """Return all preimages of lattice points."""
    x, unit = on.corners, on.unit
    low = -((-x.min(axis=1)) // unit)
    high = x.max(axis=1) // unit
    wide = np.maximum(high - low + 1, 0)
    count = wide[:, 0] * wide[:, 1]
    face = np.repeat(np.arange(len(x)), count)
    inside = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    at = low[face] + np.column_stack([inside // wide[face, 1], inside % wide[face, 1]])
    rel = x[face] - at[:, None] * unit  # corners as seen from the point
    side = np.stack([cross(rel[:, i], rel[:, (i + 1) % 3]) for i in range(3)], axis=1)
    keep = (side >= 0).all(axis=1)
    face, at, side = face[keep], at[keep], side[keep]
    weight = side[:, [1, 2, 0]] / side.sum(axis=1)[:, None]
    zero = side == 0
    on_corner = zero.sum(axis=1) == 2
    on_edge = zero.sum(axis=1) == 1
    # A point on half-edges i and i + 1 is their common corner i + 1.
    corner = np.where(on_corner, (np.argmin(zero, axis=1) + 2) % 3, -1)
    edge = np.where(on_edge, 3 * face + np.argmax(zero, axis=1), -1)
    half = on.field.half
    name = np.arange(len(face)) + len(on.field.points) + len(half.ends)
    place = on.field.triangles[face, np.maximum(corner, 0)]
    name = np.where(on_corner, place, name)
    # An edge may hold several points: tell them apart by the place along the edge.
    spot = np.zeros(len(face), np.int64)
    held = np.flatnonzero(on_edge)
    if len(held):
        e = edge[held]
        name[held] = len(on.field.points) + half.edge[e]
        start = x.reshape(-1, 2)[e]
        end = x.reshape(-1, 2)[e // 3 * 3 + (e + 1) % 3]
        base = np.where((half.along[e] > 0)[:, None], start, end)
        spot[held] = np.abs(at[held] * unit - base).sum(axis=1)
    order = np.lexsort((face, spot, name))
    new = np.ones(len(order), bool)
    new[1:] = (name[order][1:] != name[order][:-1]) | (spot[order][1:] != spot[order][:-1])
    own = np.empty(len(order), np.int64)
    own[order] = np.cumsum(new) - 1
    return LatticePoints(face, at, own, corner, edge, weight, order[new])


@dataclass(frozen=True, eq=False)
class Slots:
    """Directions in which neighbours lie, counter-clockwise around every point."""

    own: IntArray  # (s,) point
    hit: IntArray  # (s,) hit from whose triangle the direction leaves
    direction: IntArray  # (s,) index into DIRECTIONS in that triangle's frame
    joined: NDArray[np.bool_]  # (s,) whether the next slot is the next direction of the point
    following: IntArray  # (s,) the next slot around the point


def _fan(on: Seamless, found: LatticePoints) -> IntArray:
    """Return (h,) the place of each hit's triangle around its point, counter-clockwise."""
    half = on.field.half
    rank = np.zeros(len(found.face), np.int64)
    # On an edge: the triangle by which the point is known, then the one beyond.
    held = found.edge >= 0
    rank[held] = (np.arange(len(held)) != found.first[found.own])[held]
    hits = np.flatnonzero(found.corner >= 0)
    if not len(hits):
        return rank
    # At a vertex: turn through the half-edges that leave it. The one that enters the corner,
    # seen from beyond, leaves it too.
    hit_of: dict[int, int] = {}
    by_point: dict[int, list[int]] = {}
    for h in hits.tolist():
        leaving = int(3 * found.face[h] + found.corner[h])
        hit_of[leaving] = h
        by_point.setdefault(int(found.own[h]), []).append(leaving)
    for edges in by_point.values():
        begin = min((e for e in edges if half.twin[e] < 0), default=min(edges))
        e, place = begin, 0
        while True:
            rank[hit_of[e]] = place
            place += 1
            e = int(half.twin[e // 3 * 3 + (e + 2) % 3])
            if e < 0 or e == begin:
                break
    return rank


def slots_of(on: Seamless, found: LatticePoints) -> Slots:
    """Return the directions that leave each point into each of its triangles."""
    x, unit = on.corners, on.unit
    rel = x[found.face] - found.at[:, None] * unit
    row = np.arange(len(found.face))
    middle = (found.corner < 0) & (found.edge < 0)
    # Wedge of each hit: from e1 on, up to but without e2, counter-clockwise.
    i = np.where(found.corner >= 0, found.corner, np.where(found.edge >= 0, found.edge % 3, 0))
    e1 = rel[row, (i + 1) % 3]
    e2 = np.where((found.corner >= 0)[:, None], rel[row, (i + 2) % 3], -e1)
    hit, direction = (a.ravel() for a in np.meshgrid(row, np.arange(6), indexing="ij"))
    d = DIRECTIONS[direction]
    after = cross(e1[hit], d)
    ahead = (e1[hit] * d).sum(axis=1) > 0
    within = (after > 0) | ((after == 0) & ahead)
    within &= (found.corner[hit] < 0) | (cross(d, e2[hit]) > 0)
    within |= middle[hit]
    hit, direction = hit[within], direction[within]
    basis = lattice_basis(on.step, on.row_ratio, on.rows_along)
    phase = np.angle((DIRECTIONS @ basis)[direction] * np.conj((e1 @ basis)[hit]))
    angle = np.where(phase < -1e-9, phase + 2 * np.pi, np.maximum(phase, 0.0))
    angle = np.where(middle[hit], direction, angle)
    fan = _fan(on, found)
    own = found.own[hit]
    order = np.lexsort((angle, fan[hit], own))
    hit, direction, own = hit[order], direction[order], own[order]
    begin = np.ones(len(own), bool)
    begin[1:] = own[1:] != own[:-1]
    start = np.flatnonzero(begin)
    size = np.diff(np.r_[start, len(own)])
    following = np.arange(len(own)) + 1
    last = start + size - 1
    following[last] = start
    half = on.field.half
    open_hit = (found.edge >= 0) & (half.twin[np.maximum(found.edge, 0)] < 0)
    open_hit |= (found.corner >= 0) & on.field.on_border[
        on.field.triangles[found.face, np.maximum(found.corner, 0)]
    ]
    open_point = np.zeros(len(found.first), bool)
    open_point[found.own[open_hit]] = True
    joined = np.ones(len(own), bool)
    joined[last] = ~open_point[own[last]]
    return Slots(own, hit, direction, joined, following)

"""Straight walks on a mesh with seamless coordinates, one lattice step long.

All walkers go at once, a triangle a turn. Sides are decided in whole numbers; a way through a
vertex runs as if it lay a trifle further left.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.remesh.mesh_lattices.line_field import chart_hopf, triangle_frames
from phexfab.remesh.mesh_lattices.points import DIRECTIONS, LatticePoints, Slots, cross
from phexfab.remesh.mesh_lattices.seamless import Seamless

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]


def walk(on: Seamless, found: LatticePoints, slots: Slots) -> tuple[IntArray, ComplexArray]:
    """Walk one lattice step along every slot.

    Returns
    -------
    neighbour : (s,) int
        Point there, −1 where the walk leaves the mesh.
    square : (s,) complex
        ∫ Q dz² along the way, Q as given: twice the angle between the way and the u-line.
    """
    x, unit, half = on.corners, on.unit, on.field.half
    form, back = _hopf_of_steps(on)
    face = found.face[slots.hit].copy()
    p = found.at[slots.hit] * unit
    d = DIRECTIONS[slots.direction] * unit
    gone = np.zeros(len(face))
    square = np.zeros(len(face), complex)
    neighbour = np.full(len(face), -1)
    # Hits by triangle and place, for those who arrive.
    reach = int(np.abs(found.at).max(initial=0)) + 2
    wide = 2 * reach + 1

    def key(t: IntArray, at: IntArray) -> IntArray:
        clipped = np.clip(at, -reach, reach) + reach
        return (t * wide + clipped[:, 0]) * wide + clipped[:, 1]

    keys = key(found.face, found.at)
    order = np.argsort(keys)
    alive = np.arange(len(face))
    for _ in range(4 * len(x) + 4):
        if not len(alive):
            break
        t, start, along = face[alive], p[alive], d[alive]
        rel = x[t] - start[:, None]
        # Left of the way strictly, else right: as if the way ran a trifle further left.
        left = cross(along[:, None], rel) > 0
        onward = left[:, [1, 2, 0]]
        exit_edge = np.argmax(~left & onward, axis=1)
        row = np.arange(len(alive))
        a, b = rel[row, exit_edge], rel[row, (exit_edge + 1) % 3]
        ahead = cross(b - a, along - a)
        span = cross(along, b - a)
        reached = ahead >= 0
        until = np.where(
            reached, 1.0, np.clip(cross(a, b - a) / np.where(span == 0, 1, span), 0, 1)
        )
        way = np.einsum("kj,kj->k", back[t], along)
        square[alive] += np.maximum(until - gone[alive], 0.0) * form[t] * way**2
        gone[alive] = until
        done = alive[reached]
        wanted = key(t[reached], (start + along)[reached] // unit)
        slot = np.minimum(np.searchsorted(keys, wanted, sorter=order), len(order) - 1)
        hit = order[slot]
        neighbour[done] = np.where(keys[hit] == wanted, found.own[hit], -1)
        h = 3 * t + exit_edge
        go = ~reached & (half.twin[h] >= 0)
        alive, h = alive[go], h[go]
        flip = on.flip[h]
        p[alive] = flip[:, None] * start[go] + on.shift[h]
        d[alive] = flip[:, None] * along[go]
        face[alive] = half.twin[h] // 3
    return neighbour, square


def _hopf_of_steps(on: Seamless) -> tuple[ComplexArray, ComplexArray]:
    """Return (m,) mean Q as given in a triangle's own frame, and (m, 2) what lattice coordinates
    are there: a step x of them is the complex number ``back @ x``.
    """
    given, field = on.given, on.field
    frame = triangle_frames(given)
    hopf = np.stack([chart_hopf(given, given.triangles[:, k], *frame) for k in range(3)], axis=1)
    share = field.corners.mean(axis=1)
    form = (share * hopf[field.parents]).sum(axis=1)
    first, second = (axis[field.parents] for axis in frame)
    sides = field.points[field.triangles[:, 1:]] - field.points[field.triangles[:, :1]]
    flat = np.einsum("tkj,tj->tk", sides, first) + 1j * np.einsum("tkj,tj->tk", sides, second)
    x = np.swapaxes(on.corners[:, 1:] - on.corners[:, :1], 1, 2).astype(float)
    return form, np.asarray(np.einsum("tk,tkj->tj", flat, np.linalg.inv(x)))

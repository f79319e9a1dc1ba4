"""Circle packings and patterns that are immersed in the sphere: any topology, any covering.

Where a Gauss image covers the whole sphere, or its surface has handles, no layout in one plane
exists. But a packing is no more than this: for every two neighbours one equation,

    (n·m − cos ρ cos σ) / (sin ρ sin σ) = −cos φ

for circles of centres n, m and spherical radii ρ, σ that cross at φ (0 where they touch); the
left side is the product of two unit vectors in Lorentz space. On a surface with border there are
fewer equations than unknowns, E = 3F − 3χ − b against 3F for F circles, b of them on the border.
So the smooth Gauss map's circles, which miss by the second order of their size, are moved by the
least there is: Newton's method, each step the shortest that solves the linear equations. Closing
around holes and handles comes by itself, for every circle is there once.

References
----------
Cecil 2008, *Lie Sphere Geometry*, ch. 2 (circles as vectors); Bobenko, Hoffmann, Springborn 2006,
"Minimal surfaces from circle patterns".
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import SolveError
from phexfab.linalg import factorise
from phexfab.minimal.circles import CircleLaw

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

ROUNDS = 40
CLOSED = 1e-13
"""Largest miss of an equation at which circles count as closed; its parts are about 1."""
ENOUGH = 1e-11
"""What is accepted where rounding does not let it become smaller."""


def immersed_circles(
    law: CircleLaw, normals: FloatArray, radii: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return centres (F, 3) and heights (F,) cos ρ of circles on the sphere that meet by a law.

    Parameters
    ----------
    law : CircleLaw
        A packing or a pattern; the surface has a border.
    normals : (F, 3) unit
        Where the circles' centres should be, about.
    radii : (F,) float
        How large they should be, about: spherical radii, radians.

    Raises
    ------
    SolveError
        If Newton does not converge.
    """
    tail, head, cosine = _pairs(law, len(normals))
    n, logs = np.array(normals, float), np.log(np.tan(np.clip(radii, 1e-9, 1.5) / 2))
    miss = _miss(n, logs, tail, head, cosine)
    for _ in range(ROUNDS):
        size = float(np.abs(miss).max())
        if size < CLOSED:
            break
        first, second = _frames(n)
        slope = _slope(n, logs, first, second, tail, head)
        move = slope.T @ factorise(slope @ slope.T).solve(-miss, 1)
        across, grow = move[: 2 * len(n)].reshape(-1, 2), move[2 * len(n) :]
        # No circle moves, or grows, by more than half its radius at a time.
        share = min(1.0, 0.5 / max(float(np.abs(move).max()), 1e-300))
        while True:
            sine = np.sin(2 * np.arctan(np.exp(logs)))[:, None]
            step = share * sine * (across[:, :1] * first + across[:, 1:] * second)
            there = n + step
            there /= np.linalg.norm(there, axis=1, keepdims=True)
            trial = logs + share * grow
            after = _miss(there, trial, tail, head, cosine)
            if np.linalg.norm(after) < np.linalg.norm(miss) or share < 1e-3:
                break
            share /= 2
        if not np.linalg.norm(after) < np.linalg.norm(miss):
            break
        n, logs, miss = there, trial, after
    worst = int(np.abs(miss).argmax())
    if not np.abs(miss[worst]) < ENOUGH:
        raise SolveError(
            f"the circles do not close up on the sphere: at faces {tail[worst]} and {head[worst]} "
            f"they miss by {abs(miss[worst]):.1e} of a radius; choose a finer lattice, or use "
            'offset.type = "face", which needs no circle packing'
        )
    return n, np.cos(2 * np.arctan(np.exp(logs)))


def _pairs(law: CircleLaw, n: int) -> tuple[IntArray, IntArray, FloatArray]:
    """Return every edge once: its faces, and the cosine of the angle at which circles cross."""
    tri = law.triangles
    tail, head = tri.ravel(), tri[:, [1, 2, 0]].ravel()
    cosine = np.ones(len(tail)) if law.crossing is None else np.cos(law.crossing).ravel()
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    _, rows = np.unique(low * n + high, return_index=True)
    return tail[rows], head[rows], cosine[rows]


def _frames(n: FloatArray) -> tuple[FloatArray, FloatArray]:
    first = np.cross(n, np.eye(3)[np.abs(n).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return first, np.cross(n, first)


def _miss(
    n: FloatArray, logs: FloatArray, tail: IntArray, head: IntArray, cosine: FloatArray
) -> FloatArray:
    """Return (E,) what the products of neighbours miss, without loss where circles are small.

    With d the distance of the centres, n·m − cos ρ cos σ = cos(ρ − σ) − cos ρ cos σ − d²/2 +
    2 sin²((ρ − σ)/2), so the miss is 1 + cos φ − (d²/2 − 2 sin²((ρ − σ)/2))/(sin ρ sin σ).
    """
    radius = 2 * np.arctan(np.exp(logs))
    square = np.sum((n[tail] - n[head]) ** 2, axis=1)
    apart = 2 * np.sin((radius[tail] - radius[head]) / 2)
    sines = np.sin(radius[tail]) * np.sin(radius[head])
    return np.asarray(1 + cosine - (square - apart**2) / (2 * sines), float)


def _slope(
    n: FloatArray,
    logs: FloatArray,
    first: FloatArray,
    second: FloatArray,
    tail: IntArray,
    head: IntArray,
) -> sp.csr_matrix:
    """Return (E, 3F) derivatives: by moves in units of the radius, two each, and by log tan ρ/2."""
    count = len(n)
    radius = 2 * np.arctan(np.exp(logs))
    sine, half = np.sin(radius), np.sin(radius / 2)
    rows = np.arange(len(tail))
    parts, lines, columns = [], [], []
    for here, there in ((tail, head), (head, tail)):
        away = n[there] - n[here]
        for k, axis in enumerate((first, second)):
            parts.append(np.einsum("ij,ij->i", away, axis[here]) / sine[there])
            columns.append(2 * here + k)
        # (cos σ − n·m cos ρ)/(sin ρ sin σ), the small differences taken first.
        square = np.sum(away**2, axis=1)
        cosine = 1 - 2 * half[here] ** 2
        top = 2 * half[here] ** 2 - 2 * half[there] ** 2 + cosine * square / 2
        parts.append(top / (sine[here] * sine[there]))
        columns.append(2 * count + here)
        lines += [rows] * 3
    return sp.csr_matrix(
        (np.concatenate(parts), (np.concatenate(lines), np.concatenate(columns))),
        shape=(len(tail), 3 * count),
    )

"""Circle packings and hexagonal circle patterns with given border radii, by Newton.

One circle per face of the shell, combinatorics the dual triangulation. In a *packing* neighbours
touch; in a *pattern* neighbours cross at given angles and the three circles of a triangle meet in
a point. In both, interior circles must see an angle sum of 2π; in log-radii that is the gradient
of a convex functional, so Newton finds the one solution.

References
----------
Bobenko, Springborn 2004, "Variational principles for circle patterns and Koebe's theorem";
Bobenko, Hoffmann, Springborn 2006, "Minimal surfaces from circle patterns".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import SolveError
from phexfab.linalg import factorise
from phexfab.parallel.rings import face_rings
from phexfab.parallel.tree import spanning_tree, sum_to_root

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class CircleLaw:
    """How neighbouring circles meet.

    Attributes
    ----------
    triangles : (V, 3) int
    crossing : (V, 3) float or None
        Crossing angle of the edge from corner k to k + 1 of each triangle, radians; the three sum
        to π. None for a packing (neighbours touch).
    """

    triangles: IntArray
    crossing: FloatArray | None = None

    def angles(self, logs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return corner angles (V, 3) and, per edge k→k+1, the weight ∂angle/∂(log r_other)."""
        r = np.exp(logs)[self.triangles]
        a, b, c = r, r[:, [1, 2, 0]], r[:, [2, 0, 1]]
        if self.crossing is None:
            angle = 2 * np.arctan(np.sqrt(b * c / (a * (a + b + c))))
            inradius = np.sqrt(a[:, :1] * b[:, :1] * c[:, :1] / (a + b + c)[:, :1])
            return angle, inradius / (a + b)
        # The kite over edge k→k+1 gives a half-angle at both its centres.
        sine, cosine = np.sin(self.crossing), np.cos(self.crossing)
        at_tail = np.arctan2(b * sine, a + b * cosine)
        at_head = np.arctan2(a * sine, b + a * cosine)
        weight = a * b * sine / (a * a + b * b + 2 * a * b * cosine)
        return at_tail + at_head[:, [2, 0, 1]], weight

    def lengths(self, logs: FloatArray) -> FloatArray:
        """Return (V, 3) distances of the centres of the edge k→k+1."""
        r = np.exp(logs)[self.triangles]
        a, b = r, r[:, [1, 2, 0]]
        if self.crossing is None:
            return a + b
        return np.sqrt(a * a + b * b + 2 * a * b * np.cos(self.crossing))


def solve_radii(
    law: CircleLaw, logs: FloatArray, *, holes: tuple[IntArray, ...] = (), tolerance: float = 3e-14
) -> FloatArray:
    """Return log-radii whose angle sums are 2π around every interior circle.

    Parameters
    ----------
    law : CircleLaw
    logs : (F,) start; circles whose ring does not close keep their value
    holes : tuple of index arrays
        Each a closed border around a hole. Its radii may grow by one common factor, chosen so
        that the layout closes around the hole.
    tolerance : float
        On the angle sums, radians.

    Raises
    ------
    SolveError
        If Newton does not converge.
    """
    n = len(logs)
    tri = law.triangles
    panels = face_rings(tri, n)[0]
    # Unknowns: one per panel, one per hole.
    column = np.full(n, -1)
    column[panels] = np.arange(len(panels))
    target = np.full(len(panels) + len(holes), 2 * np.pi)
    for k, hole in enumerate(holes):
        column[hole] = len(panels) + k
        target[len(panels) + k] = (len(hole) + 2) * np.pi
    moving = column >= 0
    size = len(target)
    x = np.array(logs, float)
    tail, head = tri.ravel(), tri[:, [1, 2, 0]].ravel()
    ct, ch = column[tail], column[head]
    cf = column[tri.ravel()]
    both = (ct >= 0) & (ch >= 0)

    def residual(at: FloatArray) -> tuple[FloatArray, FloatArray]:
        angle, weight = law.angles(at)
        flat = angle.ravel()
        sums = np.bincount(cf[cf >= 0], weights=flat[cf >= 0], minlength=size)
        return target - sums, weight.ravel()

    def size_of(values: FloatArray) -> float:  # relative: a hole's target is a long sum
        return float(np.abs(values * (2 * np.pi / target)).max(initial=0.0))

    miss, weight = residual(x)
    for _ in range(60):
        worst = size_of(miss)
        if worst <= tolerance:
            break
        rows = np.concatenate([ct[both], ch[both], ct[ct >= 0], ch[ch >= 0]])
        cols = np.concatenate([ch[both], ct[both], ct[ct >= 0], ch[ch >= 0]])
        data = np.concatenate([-weight[both], -weight[both], weight[ct >= 0], weight[ch >= 0]])
        hessian = sp.csc_matrix((data, (rows, cols)), shape=(size, size))
        move = factorise(hessian).solve(-miss)
        step = 1.0
        while True:
            trial = x.copy()
            trial[moving] += step * move[column[moving]]
            miss_trial, weight_trial = residual(trial)
            # Convex: the slope along the step must not have turned past the minimum by much.
            slope, before = float(miss_trial @ move), float(miss @ move)
            if step < 1e-6 or (np.isfinite(slope) and slope <= 0.5 * abs(before)):
                break
            step /= 2
        if worst < 1e-9 and size_of(miss_trial) >= worst / 2:
            break  # rounding is reached
        x, miss, weight = trial, miss_trial, weight_trial
    else:
        raise SolveError(
            f"the circle pattern did not converge (angle sums are {worst:.1e} off); choose a "
            "finer lattice or a smaller rectangle of parameters"
        )
    return x


def lay_out(law: CircleLaw, logs: FloatArray) -> tuple[ComplexArray, float]:
    """Return centres in the plane, and how far the layout misses closing, relative to a radius.

    Directions are summed along a tree of triangles, then positions along a tree of circles, so
    rounding grows with the depth only; placing each circle from two others would double errors
    at every step.

    Raises
    ------
    SolveError
        If the triangulation is not connected.
    """
    tri = law.triangles
    n, n_tri = len(logs), len(tri)
    angle, _ = law.angles(logs)
    length = law.lengths(logs)
    # Direction of edge k→k+1 in its triangle, the first edge pointing along the x-axis.
    relative = np.zeros((n_tri, 3))
    relative[:, 1] = np.pi - angle[:, 1]
    relative[:, 2] = relative[:, 1] + np.pi - angle[:, 2]

    tail, head = tri.ravel(), tri[:, [1, 2, 0]].ravel()
    key = tail * n + head
    order = np.argsort(key)
    slot = np.minimum(np.searchsorted(key[order], head * n + tail), len(key) - 1)
    twin = np.where(key[order[slot]] == head * n + tail, order[slot], -1)
    edge = np.flatnonzero(twin >= 0)
    across = sp.csr_matrix(
        (edge + 1, (edge // 3, twin[edge] // 3)), shape=(n_tri, n_tri), dtype=np.int64
    )
    root = n_tri // 2
    parent = spanning_tree(across, root)
    child = np.flatnonzero(parent != np.arange(n_tri))
    via = np.asarray(across[parent[child], child]).ravel() - 1
    increment = np.zeros(n_tri)
    flat = relative.ravel()
    increment[child] = flat[via] + np.pi - flat[twin[via]]
    direction = (sum_to_root(increment, parent)[:, None] + relative).ravel()

    vector = length.ravel() * np.exp(1j * direction)
    spokes = sp.csr_matrix((np.arange(1, len(key) + 1), (tail, head)), shape=(n, n), dtype=np.int64)
    parent = spanning_tree(spokes, int(tri[root, 0]))
    child = np.flatnonzero(parent != np.arange(n))
    out = np.asarray(spokes[parent[child], child]).ravel() - 1
    back = np.asarray(spokes[child, parent[child]]).ravel() - 1
    steps = np.zeros(n, complex)
    steps[child] = np.where(out >= 0, vector[out], -vector[back])
    centre = sum_to_root(steps, parent)
    gap = np.abs(np.abs(centre[head] - centre[tail]) - length.ravel()) / length.ravel()
    return centre, float(gap.max(initial=0.0))

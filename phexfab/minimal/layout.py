"""Circles laid out in the plane: from radii to directions of edges, to centres.

Around a branch circle the layout winds several times; that needs no care here, because positions
are sums of edge vectors and nothing asks where sheets overlap.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.minimal.circles import CircleLaw
from phexfab.parallel.tree import spanning_tree, sum_to_root

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Development:
    """A triangulation's trees, along which its triangles are developed into the plane.

    Directions are summed along a tree of triangles, then positions along a tree of circles, so
    rounding grows with the depth only; placing each circle from two others would double errors
    at every step.

    Attributes
    ----------
    triangles : (V, 3) int
    n : int
        Number of circles.
    twin : (3V,) int
        The half-edge 3t + k, from corner k to k + 1 of triangle t, as its neighbour sees it; −1
        on the border.
    parent, via : (V,), (V−1,) int
        Tree of triangles, and the half-edge through which each child is entered.
    """

    triangles: IntArray
    n: int
    twin: IntArray
    parent: IntArray
    via: IntArray

    @classmethod
    def of(cls, triangles: IntArray, n: int) -> Development:
        """Build the trees.

        Raises
        ------
        MeshError
            If the triangulation is not connected.
        """
        n_tri = len(triangles)
        twin = half_edge_twins(triangles, n)
        edge = np.flatnonzero(twin >= 0)
        across = sp.csr_matrix(
            (edge + 1, (edge // 3, twin[edge] // 3)), shape=(n_tri, n_tri), dtype=np.int64
        )
        parent = spanning_tree(across, n_tri // 2)
        child = np.flatnonzero(parent != np.arange(n_tri))
        via = np.asarray(across[parent[child], child]).ravel() - 1
        return cls(triangles, n, twin, parent, via)

    def vectors(self, law: CircleLaw, logs: FloatArray) -> ComplexArray:
        """Return (3V,) vectors of all half-edges in the plane."""
        angle, _ = law.angles(logs)
        n_tri = len(self.triangles)
        # Direction of edge k→k+1 in its triangle, the first edge pointing along the x-axis.
        relative = np.zeros((n_tri, 3))
        relative[:, 1] = np.pi - angle[:, 1]
        relative[:, 2] = relative[:, 1] + np.pi - angle[:, 2]
        child = np.flatnonzero(self.parent != np.arange(n_tri))
        increment = np.zeros(n_tri)
        flat = relative.ravel()
        increment[child] = flat[self.via] + np.pi - flat[self.twin[self.via]]
        direction = (sum_to_root(increment, self.parent)[:, None] + relative).ravel()
        return np.asarray(law.lengths(logs).ravel() * np.exp(1j * direction))

    def centres(self, vectors: ComplexArray) -> ComplexArray:
        """Return (F,) centres of the circles."""
        tri, n = self.triangles, self.n
        tail, head = tri.ravel(), tri[:, [1, 2, 0]].ravel()
        spokes = sp.csr_matrix(
            (np.arange(1, len(tail) + 1), (tail, head)), shape=(n, n), dtype=np.int64
        )
        parent = spanning_tree(spokes, int(tri[len(tri) // 2, 0]))
        child = np.flatnonzero(parent != np.arange(n))
        out = np.asarray(spokes[parent[child], child]).ravel() - 1
        back = np.asarray(spokes[child, parent[child]]).ravel() - 1
        steps = np.zeros(n, complex)
        steps[child] = np.where(out >= 0, vectors[out], -vectors[back])
        return np.asarray(sum_to_root(steps, parent))


def half_edge_twins(triangles: IntArray, n: int) -> IntArray:
    """Return (3V,) the opposite of half-edge 3t + k in the next triangle, or −1."""
    tail, head = triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
    key, back = tail * n + head, head * n + tail
    order = np.argsort(key)
    slot = np.minimum(np.searchsorted(key[order], back), len(key) - 1)
    return np.asarray(np.where(key[order[slot]] == back, order[slot], -1))


def border_cycles(triangles: IntArray, n: int) -> list[IntArray]:
    """Return the closed borders as half-edges 3t + k in order, the surface to their left.

    A disc has one, a ring two. Their tails are the border's faces; a face where two sheets of the
    border touch occurs once for each.
    """
    twin = half_edge_twins(triangles, n)
    border = np.flatnonzero(twin < 0)
    # From the head of each border edge around the fan of triangles, until the border is met again.
    onward = 3 * (border // 3) + (border + 1) % 3
    inner = np.flatnonzero(twin[onward] >= 0)
    while len(inner):
        far = twin[onward[inner]]
        onward[inner] = 3 * (far // 3) + (far + 1) % 3
        inner = inner[twin[onward[inner]] >= 0]
    following = dict(zip(border.tolist(), onward.tolist(), strict=True))
    cycles = []
    while following:
        first = next(iter(following))
        cycle, now = [first], following.pop(first)
        while now != first:
            cycle.append(now)
            now = following.pop(now)
        cycles.append(np.array(cycle))
    return cycles


def lay_out(law: CircleLaw, logs: FloatArray) -> tuple[ComplexArray, float]:
    """Return centres in the plane, and how far the layout misses closing, relative to a radius.

    Raises
    ------
    MeshError
        If the triangulation is not connected.
    """
    development = Development.of(law.triangles, len(logs))
    centre = development.centres(development.vectors(law, logs))
    tail, head = law.triangles.ravel(), law.triangles[:, [1, 2, 0]].ravel()
    length = law.lengths(logs).ravel()
    gap = np.abs(np.abs(centre[head] - centre[tail]) - length) / length
    return centre, float(gap.max(initial=0.0))

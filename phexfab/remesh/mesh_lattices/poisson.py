"""The Poisson problem behind seamless coordinates, and its roundings.

w̃ on a mesh cut open is the real solution plus its response to the whole unknowns, so the energy is
a quadratic form in these and rounding them is a nearest-point problem in its metric.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from phexfab.linalg import factorise
from phexfab.remesh.mesh_lattices.cut_graph import Cut
from phexfab.remesh.mesh_lattices.line_field import LineField
from phexfab.remesh.mesh_lattices.umbilics import edge_graph
from phexfab.remesh.seamless.integers import nearest_points, reduced_basis

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]

STEPS = np.exp(np.linspace(-0.14, 0.14, 57))
"""Factors tried on the lattice step, 15 % either way."""

_WISH = 0.1  # what (ln of the change)² costs against the mean square strain
_NEAR = 3.0  # lattice steps around an umbilic within which w̃ is held to w


def lattice_basis(step: float, row_ratio: float, rows_along: str) -> ComplexArray:
    """Return the two lattice vectors in w̃, the first along a row."""
    turn = 1j if rows_along == "v" else 1.0
    return np.array([1.0, 0.5 + 1j * row_ratio]) * turn * step


def umbilic_weights(field: LineField, step: float) -> FloatArray:
    """Return (m,) weights ω that hold w̃ to w at umbilics, see `mesh_seamless`."""
    if not len(field.cones):
        return np.ones(len(field.triangles))
    graph = edge_graph(field, np.abs(field.edge_steps))
    distance = dijkstra(graph, indices=field.cones, min_only=True)
    middle = distance[field.triangles].mean(axis=1)
    return np.asarray(1 + np.minimum((_NEAR * step / np.maximum(middle, 1e-300)) ** 2, 1e4))


class SeamSystem:
    """The Poisson problem on a cut mesh, its translations still open."""

    def __init__(self, field: LineField, cut: Cut, weights: FloatArray) -> None:
        m, n = len(field.triangles), len(field.points)
        self.field, self.cut, self.weights = field, cut, weights
        free = ~cut.fixed
        if cut.pinned:
            free[0] = False
        number = np.cumsum(free) - 1
        vertex = field.triangles.ravel()
        row = np.flatnonzero(free[vertex])
        self.local = sp.csr_matrix(
            (cut.sign[row].astype(float), (row, number[vertex[row]])),
            shape=(3 * m, int(free.sum())),
        )
        self.free, self.number, self.n = free, number, n
        corner = np.arange(3 * m)
        following = corner // 3 * 3 + (corner + 1) % 3
        ones = np.ones(3 * m)
        difference = sp.csr_matrix(
            (np.r_[ones, -ones], (np.r_[corner, corner], np.r_[following, corner])),
            shape=(3 * m, 3 * m),
        )
        # ½ cot·|difference|² adds up to area·|gradient|²/2 in a triangle.
        stiff = sp.diags((field.cotangents * weights[:, None]).ravel())
        self.steps = (field.steps * cut.signs[:, None]).ravel()
        wanted = np.column_stack([self.steps.real, self.steps.imag])
        d_local = (difference @ self.local).tocsr()
        self.whole = cut.whole.astype(float)
        d_whole = (difference @ self.whole).tocsr()
        left = (d_local.T @ stiff).tocsr()
        self.factor = factorise((left @ d_local).tocsc())
        both = np.column_stack([left @ wanted, -(left @ d_whole).toarray()])
        solved = self.factor.solve(both)
        self.base, self.response = solved[:, :2], solved[:, 2:]
        on_whole = (d_whole.T @ stiff).tocsr()
        gram = (on_whole @ d_whole).toarray() + (on_whole @ d_local) @ self.response
        self.gram = (gram + gram.T) / 2
        self.pull = on_whole @ (wanted - d_local @ self.base)
        rest = wanted - d_local @ self.base
        self.energy = float((rest * (stiff @ rest)).sum())
        self.scale = float((wanted * (stiff @ wanted)).sum())

    def corners(self, shifts: ComplexArray) -> ComplexArray:
        """Return (m, 3) w̃ for complex values of the whole unknowns."""
        base = self.base[:, 0] + 1j * self.base[:, 1] + self.response @ shifts
        values = self.local @ base + self.whole @ shifts
        return np.asarray(values.reshape(-1, 3))


def roundings(
    system: SeamSystem, step: float, row_ratio: float, ratios: FloatArray, rows_along: str
) -> list[tuple[float, float, float, IntArray]]:
    """Return (cost, step, row ratio, (k, 2) whole unknowns), the best first."""
    k = len(system.gram)
    if not k:
        return [(0.0, step, row_ratio, np.zeros((0, 2), np.int64))]
    change = reduced_basis(system.gram)
    low = np.linalg.cholesky(change.T @ system.gram @ change).T
    best = np.linalg.solve(system.gram, system.pull)
    goal = low @ np.linalg.solve(change.astype(float), best)
    target = goal.T.ravel()  # u, then v
    floor = system.energy - float((goal**2).sum())
    found: dict[tuple[int, ...], tuple[float, float, float, IntArray]] = {}

    def cost(whole: IntArray, a: float, r: float) -> float:
        pair = lattice_basis(a, r, rows_along)
        at = whole @ np.column_stack([pair.real, pair.imag])
        gap = low @ at - goal
        strain = (floor + float((gap**2).sum())) / system.scale
        return strain + _WISH * (np.log(a / step) ** 2 + np.log(r / row_ratio) ** 2)

    for r in map(float, ratios):
        one = lattice_basis(1.0, r, rows_along)
        vectors = np.vstack([np.kron(low, one.real), np.kron(low, one.imag)])
        sizes = step * STEPS
        rounded = nearest_points(vectors, target[:, None] / sizes)
        for a, x in zip(sizes.tolist(), rounded.T, strict=True):
            whole = x.reshape(k, 2)
            key = tuple(x.tolist())
            # The step that suits these numbers best, the ratio kept.
            image = vectors @ x
            square = float(image @ image)
            fit = float(image @ target) / square if square > 0 else step
            fit = float(np.clip(fit, sizes[0], sizes[-1]))
            options = [(cost(whole, size, r), size, r, whole) for size in (a, fit)]
            option = min(options, key=lambda o: o[0])
            if key not in found or option[0] < found[key][0]:
                found[key] = option
    ordered = sorted(found.values(), key=lambda o: (o[0], o[1], o[2]))
    return [(c, a, r, change @ whole) for c, a, r, whole in ordered]

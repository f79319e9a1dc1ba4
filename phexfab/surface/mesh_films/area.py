"""The area of a triangle mesh: value, gradient and exact Hessian along given lines, and K.

For a triangle with corners x_i, opposite edges e_i, unit normal N and area A

    ∂A/∂x_i = ½ N × e_i,
    ∂²A (δ, δ) = Σ_ij (e_i·e_j)(N·δ_i)(N·δ_j)/(4A) + N·(δ_0×δ_1 + δ_1×δ_2 + δ_2×δ_0),

of which the first sum is the stiffness matrix K of the Dirichlet energy when all N·δ_i are 1.

References
----------
Pinkall, Polthier, "Computing discrete minimal surfaces and their conjugates", Experimental
Mathematics 2 (1993); Brakke, "The Surface Evolver", Experimental Mathematics 1 (1992).
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def _opposite_edges(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, FloatArray]:
    """Return e_i, (m, 3, 3), and the doubled area vectors, (m, 3)."""
    corner = points[triangles]
    edges = corner[:, [2, 0, 1]] - corner[:, [1, 2, 0]]
    return edges, np.cross(edges[:, 0], edges[:, 1])


def triangle_areas(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (m,) areas of triangles, mm²."""
    return 0.5 * np.linalg.norm(_opposite_edges(points, triangles)[1], axis=1)


def total_area(points: FloatArray, triangles: IntArray) -> float:
    """Return the area of a triangle mesh, mm²."""
    return float(triangle_areas(points, triangles).sum())


def gather(values: FloatArray, triangles: IntArray, n: int) -> FloatArray:
    """Return the sums at vertices, (n, …), of values at the corners of triangles, (m, 3, …)."""
    index, flat = triangles.ravel(), values.reshape(triangles.size, -1)
    sums = [np.bincount(index, flat[:, k], n) for k in range(flat.shape[1])]
    return np.stack(sums, axis=1).astype(float).reshape(n, *values.shape[2:])


def area_gradient(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Return ∂A/∂x, (n, 3), mm: minus the mean curvature vector's integral over a vertex cell."""
    edges, double = _opposite_edges(points, triangles)
    unit = double / np.linalg.norm(double, axis=1, keepdims=True)
    return gather(0.5 * np.cross(unit[:, None], edges), triangles, len(points))


def area_hessian(points: FloatArray, triangles: IntArray, lines: FloatArray) -> Any:
    """Return the Hessian of the area when vertex i moves along ``lines[i]``, sparse (n, n).

    Parameters
    ----------
    points : (n, 3) float, in mm
    triangles : (m, 3) int
    lines : (n, 3) float
    """
    edges, double = _opposite_edges(points, triangles)
    size = np.linalg.norm(double, axis=1)
    unit = double / size[:, None]
    along = lines[triangles]
    rise = np.einsum("mik,mk->mi", along, unit)
    block = np.einsum("mik,mjk->mij", edges, edges) / (2 * size)[:, None, None]
    block *= rise[:, :, None] * rise[:, None, :]
    for i, j in ((0, 1), (1, 2), (2, 0)):
        skew = 0.5 * np.einsum("mk,mk->m", unit, np.cross(along[:, i], along[:, j]))
        block[:, i, j] += skew
        block[:, j, i] += skew
    return _assembled(block, triangles, len(points))


def stiffness(points: FloatArray, triangles: IntArray) -> Any:
    """Return K of the Dirichlet energy ½ xᵀKx on the mesh (cotangent weights), sparse (n, n)."""
    edges, double = _opposite_edges(points, triangles)
    size = np.linalg.norm(double, axis=1)
    block = np.einsum("mik,mjk->mij", edges, edges) / (2 * size)[:, None, None]
    return _assembled(block, triangles, len(points))


def _assembled(block: FloatArray, triangles: IntArray, n: int) -> Any:
    rows = np.repeat(triangles, 3, axis=1).ravel()
    columns = np.tile(triangles, (1, 3)).ravel()
    return sp.csc_array((block.ravel(), (rows, columns)), shape=(n, n))


def smallest_angle(points: FloatArray, triangles: IntArray) -> float:
    """Return the smallest angle of all triangles, in degrees."""
    edges, double = _opposite_edges(points, triangles)
    size = np.linalg.norm(double, axis=1)
    inner = -np.einsum("mik,mik->mi", edges[:, [1, 2, 0]], edges[:, [2, 0, 1]])
    return float(np.degrees(np.arctan2(size[:, None], inner)).min())

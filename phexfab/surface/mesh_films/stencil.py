"""The vertices around each vertex of a triangle mesh that a local surface is fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import SurfaceError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

NEED = 15
"""Fewest points of a stencil, its vertex not counted; a chart has ten unknowns."""

MOST = 28
"""Most points of a stencil."""


@dataclass(frozen=True, eq=False)
class Stencils:
    """The points that each chart is fitted to: first its own vertex, then the nearest around it.

    Attributes
    ----------
    points : (n, k) int
        Row v starts with v. Rows are padded with v itself.
    weights : (n, k) float
        Roots of the weights of the squared distances; 0 on the vertex itself and on padding.
    size : (n,) float
        Mean distance of the vertex to its edge neighbours, mm.
    """

    points: IntArray
    weights: FloatArray
    size: FloatArray


def stencils(points: FloatArray, triangles: IntArray, count: int | None = None) -> Stencils:
    """Return the stencils of the first ``count`` vertices: two rings, at borders as many as needed.

    Raises
    ------
    SurfaceError
        If a part of the mesh has too few vertices, or a vertex belongs to no triangle.
    """
    n = len(points)
    count = n if count is None else count
    i, j = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    rows, columns = np.concatenate([i, j]), np.concatenate([j, i])
    edges = sp.csr_array((np.ones(len(rows), np.int8), (rows, columns)), shape=(n, n))
    edges.data[:] = 1
    loose = np.flatnonzero(np.diff(edges.indptr)[:count] == 0)
    if len(loose):
        raise SurfaceError(f"vertex {loose[0]} belongs to no triangle; weld or clean the mesh")
    degree = np.diff(edges.indptr)
    owner = np.repeat(np.arange(n), degree)
    distance = np.linalg.norm(points[owner] - points[edges.indices], axis=1)
    size = (np.bincount(owner, distance, n) / np.maximum(degree, 1))[:count]
    if not (size > 0).all():
        raise SurfaceError(f"vertex {int(size.argmin())} lies on all its neighbours; weld the mesh")
    step = (edges + sp.eye_array(n, dtype=np.int8, format="csr")).astype(np.int32)
    reach = (step[:count] @ step).tocsr()
    pairs_row, pairs_column = [], []
    todo = np.arange(count)
    for _ in range(8):
        held = np.diff(reach.indptr) - 1
        full = held >= NEED
        entries = reach.tocoo()
        keep = full[entries.row]
        pairs_row.append(todo[entries.row[keep]])
        pairs_column.append(entries.col[keep])
        todo, reach = todo[~full], reach[np.flatnonzero(~full)]
        if not len(todo):
            break
        reach.data[:] = 1
        reach = (reach @ step).tocsr()
    else:
        raise SurfaceError(
            f"the part of the mesh about vertex {todo[0]} has {int(held.min()) + 1} vertices; a "
            f"minimal surface cannot be told from fewer than {NEED + 1}: refine the mesh"
        )
    row, column = np.concatenate(pairs_row), np.concatenate(pairs_column).astype(np.int64)
    away = np.linalg.norm(points[row] - points[column], axis=1)
    away[row == column] = -1.0  # the vertex itself comes first, whatever coincides with it
    order = np.lexsort((column, away, row))
    row, column, away = row[order], column[order], away[order]
    starts = np.searchsorted(row, np.arange(count + 1))
    rank = np.arange(len(row)) - starts[row]
    keep = rank <= MOST
    row, column, away, rank = row[keep], column[keep], away[keep], rank[keep]
    width = int(rank.max()) + 1
    table = np.repeat(np.arange(count)[:, None], width, axis=1)
    weights = np.zeros((count, width))
    table[row, rank] = column
    weights[row, rank] = np.exp(-0.125 * (away / size[row]) ** 2)
    weights[:, 0] = 0.0
    return Stencils(table, weights, size)


def vertex_normals(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (n, 3) unit normals of vertices, by the areas of the triangles around them."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    area = np.cross(b - a, c - a)
    total = np.stack(
        [np.bincount(triangles.ravel(), np.repeat(area[:, k], 3), len(points)) for k in range(3)],
        axis=1,
    )
    length = np.linalg.norm(total, axis=1, keepdims=True)
    return total / np.where(length > 0, length, 1.0)

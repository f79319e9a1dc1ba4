"""Conformal hexagon meshes in space, and their Christoffel dual in closed form.

Of every hexagon two opposite edges, those not at the diagonal z₀z₃, have coefficient 2 in the dual
and the other four −1. Around each face the dual edges close because both quads on the diagonal
have cross-ratio −1/2, in space as in the plane. The dual of a mesh on the unit sphere is a discrete
minimal surface.

References
----------
Thesis §5.3.3; Müller 2011, "Conformal hexagonal meshes", Geom. Dedicata 154.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from phexfab.errors import MeshError
from phexfab.mesh.measures import edges
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.tree import spanning_tree, sum_to_root
from phexfab.remesh.conformal.hexagons import spatial_cross_ratio

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def face_cross_ratios(mesh: PolyMesh, twice: BoolArray) -> ComplexArray:
    """Return (F, 2) the cross-ratios of the quads z₀z₁z₂z₃ and z₀z₅z₄z₃ of every hexagon.

    Parameters
    ----------
    mesh : PolyMesh
        Of hexagons, in the plane or in space.
    twice : (E,) bool
        The edges of ``phexfab.mesh.measures.edges(mesh)`` that are z₁z₂ or z₄z₅.

    Returns
    -------
    Imaginary parts not negative; all −1/2 on a conformal mesh.

    Raises
    ------
    MeshError
        If a face is no hexagon, or does not have exactly two opposite edges in ``twice``.
    """
    odd = np.flatnonzero(mesh.sides != 6)
    if len(odd):
        raise MeshError(f"face {odd[0]} has {mesh.sides[odd[0]]} sides; conformal faces have 6")
    pairs, n = edges(mesh), len(mesh.vertices)
    ends = np.sort(np.column_stack([mesh.corners, mesh.corners[mesh.next_corner]]), axis=1)
    slot = np.searchsorted(pairs[:, 0] * n + pairs[:, 1], ends[:, 0] * n + ends[:, 1])
    marked = np.asarray(twice, bool)[slot].reshape(-1, 6)
    wrong = np.flatnonzero((marked.sum(axis=1) != 2) | (marked[:, :3] != marked[:, 3:]).any(axis=1))
    if len(wrong):
        raise MeshError(
            f"face {wrong[0]} has {int(marked[wrong[0]].sum())} edges with coefficient 2; two "
            "opposite ones are needed"
        )
    begin = (np.argmax(marked, axis=1) + 5) % 6  # z₀ is one corner before the marked edge
    around = (begin[:, None] + np.arange(6)) % 6
    z = mesh.vertices[np.take_along_axis(mesh.corners.reshape(-1, 6), around, axis=1)]
    return spatial_cross_ratio(np.stack([z[:, [0, 1, 2, 3]], z[:, [0, 5, 4, 3]]], axis=1))


def conformality(mesh: PolyMesh, twice: BoolArray) -> FloatArray:
    """Return (F,) the larger |cross-ratio + 1/2| of each hexagon; see ``face_cross_ratios``."""
    return np.asarray(np.abs(face_cross_ratios(mesh, twice) + 0.5).max(axis=1))


def christoffel_dual(mesh: PolyMesh, twice: BoolArray, tolerance: float = 1e-8) -> PolyMesh:
    """Return the Christoffel dual of a conformal hexagon mesh: parallel edges, mixed areas 0.

    Parameters
    ----------
    mesh : PolyMesh
        In the plane or in space.
    twice : (E,) bool
        The edges of ``phexfab.mesh.measures.edges(mesh)`` with coefficient 2.
    tolerance : float
        For the gap where a path closes, relative to the longest dual edge.

    Raises
    ------
    MeshError
        If the dual edges do not close: around a face that is not conformal, or around a ring.

    References
    ----------
    Thesis §5.3.3.
    """
    points = dual_points(mesh.vertices, edges(mesh), twice, tolerance)
    return PolyMesh(points, mesh.corners, mesh.starts)


def dual_points(
    vertices: FloatArray, pairs: IntArray, twice: BoolArray, tolerance: float = 1e-8
) -> FloatArray:
    """Return the (V, 3) vertices with edges 2e/|e|² where ``twice`` and −e/|e|² elsewhere.

    Parameters
    ----------
    vertices : (V, 3)
    pairs : (E, 2) edges, each once, in either direction
    twice : (E,) bool

    Raises
    ------
    MeshError
        If they do not close.
    """
    i, j = pairs[:, 0], pairs[:, 1]
    e = vertices[j] - vertices[i]
    dual = np.where(twice, 2.0, -1.0)[:, None] * e / np.sum(e * e, axis=1, keepdims=True)
    n = len(vertices)
    index = csr_matrix((np.arange(1, len(i) + 1), (i, j)), shape=(n, n), dtype=np.int64)
    parent = spanning_tree(index, 0)
    child = np.flatnonzero(parent != np.arange(n))
    out = np.asarray(index[parent[child], child]).ravel()
    back = np.asarray(index[child, parent[child]]).ravel()
    steps = np.zeros((n, 3))
    steps[child] = np.where((out > 0)[:, None], dual[out - 1], -dual[back - 1])
    points = sum_to_root(steps, parent)
    gap = np.abs(points[j] - points[i] - dual).max(axis=1) / np.abs(dual).max()
    if not gap.max() < tolerance:
        worst = int(np.argmax(gap))
        raise MeshError(
            f"the dual does not close (by {gap[worst]:.1e} at edge {i[worst]}-{j[worst]}): the "
            "mesh is not conformal"
        )
    return np.asarray(points)

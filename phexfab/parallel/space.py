"""The linear space P(M) of all meshes parallel to a polygon mesh: dimension and basis.

For simple meshes the basis is local and exact: face heights and border runs. For any other mesh
(quads, triangles, mixed, coplanar neighbours) it is the null space of "every edge keeps its
direction", by inverse iteration with a block that grows until it holds the whole space: the
factorisation stays sparse, only the basis is dense.

References
----------
Thesis §4.1; Pottmann et al. 2007, "Geometry of multi-layer freeform structures", sec. 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import MeshError, SolveError
from phexfab.linalg import factorise
from phexfab.mesh.measures import edges
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.simple import simple_basis

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ParallelSpace:
    """P(M): every mesh of the same faces whose edges are parallel to those of M.

    Attributes
    ----------
    mesh : PolyMesh
        M itself, a member.
    basis : (3V, k) sparse matrix
        Vertex displacements x, y, z, x, … of k linearly independent fields. Translations are
        among their combinations (3 for each connected piece), and so is scaling about any point.
    method : str
        ``"heights"``: column f moves face f's plane by 1 along its normal, further columns move
        runs of border edges outwards. ``"directions"``: an orthonormal basis.
    gap : (float, float)
        For ``"directions"`` the largest singular value taken as zero and the smallest that was
        not (infinite if there is none): how surely the dimension is known. (0, ∞) for heights.
    """

    mesh: PolyMesh
    basis: Any
    method: str
    gap: tuple[float, float]

    @property
    def dimension(self) -> int:
        """Dimension of P(M), translations included."""
        return int(self.basis.shape[1])

    @property
    def fields(self) -> FloatArray:
        """(k, V, 3) the basis as dense vertex fields."""
        return np.asarray(self.basis.toarray()).T.reshape(self.dimension, -1, 3)

    def displacement(self, coordinates: FloatArray) -> FloatArray:
        """Return the (V, 3) field with the given (k,) coordinates."""
        return np.asarray(self.basis @ np.asarray(coordinates, float)).reshape(-1, 3)

    def member(self, coordinates: FloatArray) -> PolyMesh:
        """Return the mesh M + Σ cᵢ fieldᵢ."""
        points = self.mesh.vertices + self.displacement(coordinates)
        return PolyMesh(points, self.mesh.corners, self.mesh.starts)

    @cached_property
    def edge_vertices(self) -> IntArray:
        """(E, 2) edges in the order of ``phexfab.mesh.measures.edges``."""
        return edges(self.mesh)

    @cached_property
    def edge_differences(self) -> Any:
        """(3E, 3V) sparse matrix from vertices to edge vectors."""
        return difference_matrix(self.edge_vertices, len(self.mesh.vertices))

    @cached_property
    def ratio_matrix(self) -> Any:
        """(E, k) sparse matrix from coordinates to the change of every edge's ratio.

        The member with coordinates c has the ratios ``1 + ratio_matrix @ c``.
        """
        pairs = self.edge_vertices
        along = self.mesh.vertices[pairs[:, 1]] - self.mesh.vertices[pairs[:, 0]]
        along = along / np.einsum("ij,ij->i", along, along)[:, None]
        return (row_products(along) @ (self.edge_differences @ self.basis)).tocsr()


def row_products(vectors: FloatArray) -> Any:
    """Return the (n, 3n) sparse matrix whose row i takes the scalar product with vector i."""
    n = len(vectors)
    return sp.csr_matrix(
        (vectors.ravel(), np.arange(3 * n), np.arange(0, 3 * n + 1, 3)), shape=(n, 3 * n)
    )


def difference_matrix(pairs: IntArray, n_vertices: int) -> Any:
    """Return the (3n, 3V) sparse matrix of the differences second minus first vertex."""
    n = len(pairs)
    row = np.arange(3 * n).reshape(n, 3)
    column = 3 * pairs[:, :, None] + np.arange(3)
    values = np.concatenate([np.full(3 * n, -1.0), np.ones(3 * n)])
    rows = np.concatenate([row.ravel(), row.ravel()])
    columns = np.concatenate([column[:, 0].ravel(), column[:, 1].ravel()])
    return sp.csr_matrix((values, (rows, columns)), shape=(3 * n, 3 * n_vertices))


def parallel_space(
    mesh: PolyMesh, *, method: str = "auto", tolerance: float = 1e-8
) -> ParallelSpace:
    """Return P(M) of any polygon mesh with planar faces.

    Parameters
    ----------
    mesh : PolyMesh
        Every vertex must belong to a face, every edge have a length.
    method : ``"auto"``, ``"heights"`` or ``"directions"``
        ``"heights"`` needs a simple mesh (three edges at every vertex) without coplanar
        neighbours and takes any number of faces; ``"directions"`` takes any mesh of up to a few
        thousand vertices. ``"auto"`` takes heights where it can.
    tolerance : float
        For ``"directions"``: singular values (of unit edges) below it count as zero. Raise it to
        some times the relative planarity of a mesh with printed digits.

    Raises
    ------
    MeshError
        If the mesh has unused vertices or edges without length, or heights do not apply.
    SolveError
        If the null space does not settle.

    References
    ----------
    Thesis §4.1.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> space = px.parallel_space(shell.mesh)
    >>> space.dimension, space.method
    (50, 'heights')
    """
    if method not in ("auto", "heights", "directions"):
        raise MeshError(f'method = "{method}"; use "auto", "heights" or "directions"')
    used = np.zeros(len(mesh.vertices), bool)
    used[mesh.corners] = True
    if not mesh.n_faces or not used.all():
        raise MeshError(
            f"{int((~used).sum())} of {len(used)} vertices belong to no face; drop them with weld"
        )
    pairs = edges(mesh)
    along = mesh.vertices[pairs[:, 1]] - mesh.vertices[pairs[:, 0]]
    length = np.linalg.norm(along, axis=1)
    if not length.min() > 0:
        i, j = pairs[int(np.argmin(length))]
        raise MeshError(f"edge {i}-{j} has no length, so no direction; weld the mesh first")
    if method != "directions":
        basis = simple_basis(mesh)
        if basis is not None:
            return ParallelSpace(mesh, basis, "heights", (0.0, np.inf))
        if method == "heights":
            raise MeshError(
                "heights are no coordinates of this mesh: it is not simple, or neighbouring faces "
                'are coplanar; use method="directions"'
            )
    null, gap = _null_space(pairs, along / length[:, None], len(mesh.vertices), tolerance)
    return ParallelSpace(mesh, sp.csr_matrix(null), "directions", gap)


def _null_space(
    pairs: IntArray, unit: FloatArray, n_vertices: int, tolerance: float
) -> tuple[FloatArray, tuple[float, float]]:
    """Return an orthonormal basis (3V, k) of the fields that turn no edge, and the gap."""
    across = np.eye(3) - unit[:, :, None] * unit[:, None, :]
    across = sp.block_diag(list(across), format="csr")
    turning = (across @ difference_matrix(pairs, n_vertices)).tocsr()
    size = 3 * n_vertices
    shift = 1e-12
    factor = factorise((turning.T @ turning + shift * sp.eye(size)).tocsc())
    random = np.random.default_rng(0)  # any block in general position; the span does not depend
    # On a simple mesh two of three edges close the faces and the rest are free: begin there.
    n_faces = len(pairs) - n_vertices + 2
    guess = max(len(pairs) - 2 * n_faces + 3, 0) + 16
    block = random.standard_normal((size, min(guess, size)))
    values = np.zeros(0)
    for _ in range(40):
        before = values
        block, _ = np.linalg.qr(block)
        block, _ = np.linalg.qr(factor.solve(block))
        # Rayleigh–Ritz on the singular values, which reach far below those of the normal matrix.
        _, values, right = np.linalg.svd(turning @ block, full_matrices=False)
        block, values = block @ right[::-1].T, values[::-1]
        inside = values < tolerance
        settled = len(before) == len(values) and np.array_equal(inside, before < tolerance)
        if inside.all() and len(values) < size:
            extra = min(max(16, len(values)), size - len(values))
            block = np.hstack([block, random.standard_normal((size, extra))])
        elif settled and values[inside].max(initial=0.0) < max(1e-13 * size, 0.3 * tolerance):
            break
    else:
        raise SolveError(
            f"the space of parallel meshes has no clear dimension at tolerance {tolerance:.0e}: "
            f"singular values {values[inside][-3:]} and {values[~inside][:3]}; change the tolerance"
        )
    k = int(inside.sum())
    gap = (float(values[:k].max(initial=0.0)), float(values[k]) if k < len(values) else np.inf)
    return np.ascontiguousarray(block[:, :k]), gap

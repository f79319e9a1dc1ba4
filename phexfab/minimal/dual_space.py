"""All discrete minimal surfaces with a given Gauss image: the Christoffel dual as a linear solve.

S is a mesh with planar faces and three faces at every interior vertex. A mesh parallel to S is
fixed by the heights of its faces and, on the border, by the heights of the border edges in their
faces; border edges that meet in a vertex of two faces move together. H_f = 0 is one linear equation
for each face. What stays free is one height for each border plane, that is, for each run of
border edges between corners that belong to a single face: so many dimensions has the space,
translations included. With heights given there, the dual is one sparse solve.

References
----------
Thesis §7.1.2, §7.2.2 (where it is called minimising a quadratic function).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU, splu

from phexfab.errors import MeshError, SolveError
from phexfab.mesh.measures import face_normals, relative_planarity
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.curvature import pair_mixed_areas
from phexfab.parallel.edge_curvature import edge_vectors, twin_corners
from phexfab.parallel.shell import plane_vertices

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class DualSpace:
    """The discrete minimal surfaces with one Gauss image; keeps the factorised system.

    Attributes
    ----------
    gauss : PolyMesh
        S.
    normals : (F + B, 3) unit vectors
        Normals of the faces, then, for each border edge, the normal of the edge in its face's
        plane, pointing outwards.
    triples : (V, 3) int
        The rows of ``normals`` whose planes meet in each vertex.
    borders : (R,) int
        Rows of ``normals``: the first border edge of every border plane, counter-clockwise.
        Their heights are free.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> space = px.DualSpace.of(shell.gauss)
    >>> space.dimension  # one height for each border plane
    23
    >>> again = space.mesh(space.border_heights(shell.mesh))
    >>> bool(abs(again.vertices - shell.mesh.vertices).max() < 1e-6)
    True
    """

    gauss: PolyMesh
    normals: FloatArray
    triples: IntArray
    borders: IntArray
    _others: IntArray
    _ties: tuple[IntArray, IntArray]
    _coupling: sp.csc_matrix
    _factor: SuperLU

    @classmethod
    def of(cls, gauss: PolyMesh, planarity: float = 1e-3) -> DualSpace:
        """Factorise the system of a Gauss image.

        Parameters
        ----------
        gauss : PolyMesh
        planarity : float
            How far faces may be from planar, over the mean edge.

        Raises
        ------
        MeshError
            If an interior vertex does not have three faces, a vertex has two borders, a face is
            not planar, or a vertex belongs to no face.
        SolveError
            If the system is singular.
        """
        _check_planar(gauss, planarity)
        normals, triples, corners, ties = _planes(gauss)
        n_faces, n_all = gauss.n_faces, len(normals)
        single = np.bincount(gauss.corners, minlength=len(gauss.vertices)) == 1
        free = n_faces + np.flatnonzero(single[gauss.corners[corners]])
        others = np.setdiff1d(np.arange(n_all), free)
        # Vertices from heights, then mixed areas and ties from vertices.
        count = len(triples)
        inverse = np.linalg.inv(normals[triples])
        rows = np.repeat(np.arange(3 * count), 3)
        columns = np.repeat(triples, 3, axis=0).ravel()
        place = sp.csr_matrix((inverse.ravel(), (rows, columns)), shape=(3 * count, n_all))
        s = gauss.vertices[gauss.corners]
        gap = s[gauss.next_corner] - s[gauss.previous_corner]
        weight = np.cross(gap, normals[gauss.face_of_corner]) / 4
        mixed = _rows_of_points(weight, gauss.face_of_corner, gauss.corners, n_faces, count)
        edge, vertex = ties
        tie = _rows_of_points(normals[edge], np.arange(len(edge)), vertex, len(edge), count) @ place
        tie = tie - sp.csr_matrix(
            (np.ones(len(edge)), (np.arange(len(edge)), edge)), shape=(len(edge), n_all)
        )
        system = sp.vstack([mixed @ place, tie]).tocsc()
        try:
            factor = splu(system[:, others])
        except RuntimeError as error:
            raise SolveError(
                f"the minimal system of this Gauss image is singular ({error}): a border loop "
                "without a corner of its own, or a region at the limit of stability"
            ) from error
        return cls(gauss, normals, triples, free, others, ties, system[:, free], factor)

    @property
    def dimension(self) -> int:
        """Dimension of the space, the three translations included: the number of border planes."""
        return len(self.borders)

    def _mesh(self, heights: FloatArray) -> PolyMesh:
        points = plane_vertices(self.normals, heights, self.triples)
        return PolyMesh(points, self.gauss.corners, self.gauss.starts)

    def heights(self, border: FloatArray) -> FloatArray:
        """Return (F + B,) heights of all planes from the (R,) heights of the border planes, mm.

        Raises
        ------
        SolveError
            If the system is singular to rounding.
        """
        given = np.asarray(border, float)
        if given.shape != (self.dimension,):
            raise MeshError(f"{given.shape} border heights; the space has {self.dimension}")
        x = np.zeros(len(self.normals))
        x[self.borders] = given
        x[self._others] = -self._factor.solve(self._coupling @ given)
        about = self.normals[: self.gauss.n_faces]
        edge, vertex = self._ties
        for _ in range(2):  # refine with areas that do not know where the origin is
            mesh = self._mesh(x)
            left = np.einsum("ij,ij->i", self.normals[edge], mesh.vertices[vertex]) - x[edge]
            residual = np.r_[pair_mixed_areas(mesh, self.gauss, about), left]
            x[self._others] -= self._factor.solve(residual)
        if not np.all(np.isfinite(x)):
            raise SolveError("the minimal system of this Gauss image is singular to rounding")
        return x

    def mesh(self, border: FloatArray) -> PolyMesh:
        """Return the discrete minimal surface with these (R,) heights of its border planes, mm."""
        return self._mesh(self.heights(border))

    def member(self, k: int) -> PolyMesh:
        """Return basis member k: border plane k at height 1, all others at 0."""
        return self.mesh(np.eye(1, self.dimension, k)[0])

    def border_heights(self, mesh: PolyMesh) -> FloatArray:
        """Return the (R,) border heights of a mesh with the same faces, mm.

        For a member of the space ``mesh`` gives it back.
        """
        corner = np.flatnonzero(twin_corners(self.gauss) < 0)[self.borders - self.gauss.n_faces]
        ends = mesh.corners[corner], mesh.corners[mesh.next_corner[corner]]
        middle = (mesh.vertices[ends[0]] + mesh.vertices[ends[1]]) / 2
        return np.asarray(np.einsum("ij,ij->i", self.normals[self.borders], middle))

    def nearest(self, mesh: PolyMesh) -> PolyMesh:
        """Return the member whose vertices are nearest to a mesh's in the mean square.

        Dense in the dimension: meant for up to some thousand faces.

        Raises
        ------
        MeshError
            If the mesh does not have the same vertices.
        """
        if mesh.vertices.shape != self.gauss.vertices.shape:
            raise MeshError(
                f"the mesh has {len(mesh.vertices)} vertices, S {len(self.gauss.vertices)}"
            )
        border = self.border_heights(mesh)
        right = self.mesh(border).vertices.ravel()
        basis = np.column_stack([self.member(k).vertices.ravel() for k in range(self.dimension)])
        step = np.linalg.lstsq(basis, mesh.vertices.ravel() - right, rcond=None)[0]
        return self.mesh(border + step)


def _check_planar(gauss: PolyMesh, tolerance: float) -> None:
    if not gauss.n_faces:
        raise MeshError("the Gauss image has no face")
    off = relative_planarity(gauss)
    worst = int(np.argmax(off))
    if not off[worst] <= tolerance:
        raise MeshError(
            f"face {worst} of the Gauss image is off its plane by {off[worst]:.1e} of an edge, "
            f"more than {tolerance:.1e}: planarise it first"
        )


def _planes(
    mesh: PolyMesh,
) -> tuple[FloatArray, IntArray, IntArray, tuple[IntArray, IntArray]]:
    """Return normals, triples, the corners that own border edges, and ties (edge, vertex).

    A tie says that the border edge arriving at a vertex of two faces passes through the point
    which these faces and the border edge that leaves it define.
    """
    twin = twin_corners(mesh)
    about = face_normals(mesh)
    n, owner = len(mesh.vertices), mesh.face_of_corner
    border = np.flatnonzero(twin < 0)
    outward = np.cross(edge_vectors(mesh)[border], about[owner[border]])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    valence = np.bincount(mesh.corners, minlength=n)
    tail, head = mesh.corners[border], mesh.corners[mesh.next_corner[border]]
    leaves = np.bincount(tail, minlength=n)
    wrong = np.flatnonzero((leaves > 1) | (valence + leaves < 2) | (valence == 0))
    if len(wrong):
        raise MeshError(
            f"vertex {wrong[0]} belongs to {valence[wrong[0]]} faces and {leaves[wrong[0]]} "
            "borders: weld the mesh and drop vertices without a face"
        )
    wrong = np.flatnonzero(np.where(leaves == 1, valence > 2, valence != 3))
    if len(wrong):
        raise MeshError(
            f"vertex {wrong[0]} has {valence[wrong[0]]} faces: the solve needs three at every "
            "interior vertex and one or two on the border; quad meshes have split_dual"
        )
    # Fill the three places: faces in the order of corners, then the leaving, the arriving edge.
    triples = np.full((n, 3), -1)
    order = np.argsort(mesh.corners, kind="stable")
    rank = np.arange(len(order)) - (np.cumsum(valence) - valence)[mesh.corners[order]]
    triples[mesh.corners[order], rank] = owner[order]
    edge = mesh.n_faces + np.arange(len(border))
    triples[tail, valence[tail]] = edge
    one = valence[head] == 1
    triples[head[one], 2] = edge[one]
    return np.vstack([about, outward]), triples, border, (edge[~one], head[~one])


def _rows_of_points(
    weight: FloatArray, row: IntArray, vertex: IntArray, n_rows: int, n_vertices: int
) -> sp.csr_matrix:
    """Return the matrix that adds weight·point of each vertex to a row; points are flat (3V,)."""
    columns = 3 * vertex[:, None] + np.arange(3)
    return sp.csr_matrix(
        (weight.ravel(), (np.repeat(row, 3), columns.ravel())), shape=(n_rows, 3 * n_vertices)
    )

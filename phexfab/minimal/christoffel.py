"""Discrete minimal by definition, and the Christoffel dual by splitting hexagons into quads.

A pair (M, S) of parallel meshes is discrete minimal where the mixed areas of corresponding faces
vanish. Two parallel quads have vanishing mixed area exactly where their non-corresponding
diagonals are parallel, so every planar quad has such a dual, unique up to scale. A hexagon cut by a
main diagonal into two quads has one too: the two quads' duals, scaled to share the diagonal. The
duals of all faces fit together only on special meshes (conformal hexagons, Koenigs nets): how far
they do not is the compatibility residual. The exact dual of any mesh is in ``dual_space``.

References
----------
Thesis §7.1.2, §7.2.2; Müller, Wallner 2010, "Oriented mixed area and discrete minimal surfaces",
Discrete Comput. Geom. 43.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import breadth_first_order

from phexfab.errors import MeshError
from phexfab.linalg import factorise
from phexfab.mesh.measures import face_normals
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.curvature import pair_curvatures
from phexfab.parallel.edge_curvature import edge_vectors, twin_corners
from phexfab.parallel.pairs import parallelism

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class MinimalTest:
    """Whether a pair is discrete minimal; true or false in a condition.

    Attributes
    ----------
    minimal : bool
        The edges are parallel and all defects are below the tolerance.
    worst : float
        Largest defect, |area(M_f, S_f)|/√|area(M_f)·area(S_f)| = |H|/√|K|.
    face : int
        The face that has it.
    sine : float
        Largest sine between an edge of M and its own of S.
    defects : (F,) array
    """

    minimal: bool
    worst: float
    face: int
    sine: float
    defects: FloatArray

    def __bool__(self) -> bool:
        return self.minimal


def is_discrete_minimal(
    mesh: PolyMesh, gauss: PolyMesh, tolerance: float = 1e-10, *, parallel: float = 1e-6
) -> MinimalTest:
    """Tell whether a mesh is discrete minimal with respect to a Gauss image.

    Parameters
    ----------
    mesh, gauss : PolyMesh
        With the same faces; in mm, and of unit size.
    tolerance : float
        For the normalised mixed area of every face.
    parallel : float
        For the sine between corresponding edges; a larger one is no parallel pair, whatever its
        mixed areas.

    Raises
    ------
    MeshError
        If the meshes do not have the same faces, or none.

    References
    ----------
    Thesis §7.1.2.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> test = px.is_discrete_minimal(shell.mesh, shell.gauss)
    >>> bool(test), test.worst < 1e-12
    (True, True)
    >>> bool(px.is_discrete_minimal(shell.gauss, shell.gauss))  # a polyhedron about a sphere
    False
    """
    if not mesh.n_faces:
        raise MeshError("the mesh has no face, so nothing can be minimal")
    defects = pair_curvatures(mesh, gauss).minimality
    face = int(np.argmax(defects))  # the first that is not a number, if there is one
    sine = float(parallelism(mesh, gauss).max())
    worst = float(defects[face])
    return MinimalTest(worst <= tolerance and sine <= parallel, worst, face, sine, defects)


def quad_dual_coefficients(corners: FloatArray, normals: FloatArray) -> FloatArray:
    """Return (N, 4) factors c for which the edges c_k (p_{k+1} − p_k) close to the quads' duals.

    Parameters
    ----------
    corners : (N, 4, 3) planar quads p₀ p₁ p₂ p₃, convex or not
    normals : (N, 3) their unit normals

    Returns
    -------
    Factors up to one scale for each quad; not finite where three corners lie on a line. The
    diagonals of the dual are parallel to the other diagonals of the quad.

    References
    ----------
    Thesis §7.2.2; Bobenko, Suris 2009, "Discrete Koenigs nets and discrete isothermic surfaces".
    """

    def triangle(i: int, j: int, k: int) -> FloatArray:
        cross = np.cross(corners[:, j] - corners[:, i], corners[:, k] - corners[:, i])
        return np.asarray(np.einsum("ij,ij->i", cross, normals))

    # Signed places of the corners along the two diagonals, measured from where these cross.
    a0, a2 = triangle(1, 3, 0), triangle(1, 3, 2)
    b1, b3 = triangle(0, 2, 1), triangle(0, 2, 3)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = np.column_stack([1 / (a0 * b1), 1 / (a2 * b1), 1 / (a2 * b3), 1 / (a0 * b3)])
        return np.asarray(found / np.abs(found).max(axis=1, keepdims=True))


def edge_classes(mesh: PolyMesh) -> IntArray:
    """Return (C,) the class, 0, 1 or 2, of the edge that leaves each corner of a hexagon mesh.

    Opposite edges of a hexagon have the same class, as the three edge directions of the regular
    mesh. Edge 0 of face 0 has class 0.

    Raises
    ------
    MeshError
        If a face is no hexagon, the mesh falls into pieces, or the classes do not fit together
        (an interior vertex without three faces, or a ring that shifts them).
    """
    odd = np.flatnonzero(mesh.sides != 6)
    if len(odd):
        raise MeshError(f"face {odd[0]} has {mesh.sides[odd[0]]} sides: only hexagons have classes")
    twin = twin_corners(mesh)
    inner = np.flatnonzero(twin >= 0)
    here, there = mesh.face_of_corner[inner], mesh.face_of_corner[twin[inner]]
    order, parent = _face_tree(mesh.n_faces, here, there)
    through = sp.csr_matrix((inner + 1, (here, there)), shape=(mesh.n_faces, mesh.n_faces))
    place = np.arange(len(mesh.corners)) - mesh.starts[mesh.face_of_corner]
    shift = np.zeros(mesh.n_faces, np.int64)
    for g in order[1:]:
        c = int(through[parent[g], g]) - 1
        shift[g] = (shift[parent[g]] + place[c] - place[twin[c]]) % 3
    classes = (shift[mesh.face_of_corner] + place) % 3
    clash = inner[classes[inner] != classes[twin[inner]]]
    if len(clash):
        raise MeshError(
            f"the edge classes clash between faces {mesh.face_of_corner[clash[0]]} and "
            f"{mesh.face_of_corner[twin[clash[0]]]}: the mesh is not a piece of the regular one"
        )
    return np.asarray(classes, np.int64)


def split_coefficients(mesh: PolyMesh, cut: int | None = None) -> FloatArray:
    """Return (C,) factors c of every face's edges that close to a dual face of mixed area 0.

    Quads are dual as they are; hexagons are cut by the main diagonal opposite to the edges of one
    class, and their dual is made of two quads'.

    Parameters
    ----------
    mesh : PolyMesh
        Planar quads or planar hexagons.
    cut : {0, 1, 2}, optional
        The class (see ``edge_classes``) to which the cutting diagonals run most nearly parallel;
        needed for hexagons.

    Returns
    -------
    Up to one scale for each face.

    Raises
    ------
    MeshError
        If a face has neither 4 nor 6 corners, or three corners of a quad lie on a line.

    References
    ----------
    Thesis §7.2.2.
    """
    normals = face_normals(mesh)
    points = mesh.vertices[mesh.corners]
    if mesh.n_faces and np.all(mesh.sides == 4):
        found = quad_dual_coefficients(points.reshape(-1, 4, 3), normals).ravel()
    elif cut is None:
        raise MeshError("hexagons are cut in two: name the class of edges, cut = 0, 1 or 2")
    else:
        classes = edge_classes(mesh).reshape(-1, 6)
        # The diagonal beside edge k runs from corner k − 1 to corner k + 2.
        first = (np.argmax(classes == cut % 3, axis=1) - 1) % 6
        ring = (first[:, None] + np.arange(6)) % 6
        hexagon = np.take_along_axis(points.reshape(-1, 6, 3), ring[:, :, None], axis=1)
        one = quad_dual_coefficients(hexagon[:, [0, 1, 2, 3]], normals)
        two = quad_dual_coefficients(hexagon[:, [3, 4, 5, 0]], normals)
        with np.errstate(divide="ignore", invalid="ignore"):
            two = two * (one[:, 3:] / two[:, 3:])
        both = np.empty((mesh.n_faces, 6))
        np.put_along_axis(both, ring, np.hstack([one[:, :3], two[:, :3]]), axis=1)
        found = both.ravel()
    bad = np.flatnonzero(~np.isfinite(found) | (found == 0))
    if len(bad):
        raise MeshError(
            f"face {mesh.face_of_corner[bad[0]]} has three corners of a quad on a line, so it has "
            "no dual; cut along another diagonal"
        )
    return found


@dataclass(frozen=True, eq=False)
class SplitDual:
    """The dual that the faces' own duals make together.

    Attributes
    ----------
    mesh : PolyMesh
        Vertices fitted to the edges of all dual faces, in the scale of the given mesh.
    residuals : (C,) array
        |log| of the ratio of the two lengths that the faces beside an edge want for it (0 on the
        border, at least π where they want opposite directions).
    openings : (C,) array
        How far the fitted edges are from those of the dual faces, over the mean edge; on a ring
        also large where the residuals vanish but the dual does not close around it.
    cut : int or None
        The class of edges beside which hexagons were cut.
    """

    mesh: PolyMesh
    residuals: FloatArray
    openings: FloatArray
    cut: int | None

    @property
    def residual(self) -> float:
        """The largest residual or opening; 0 where the dual is an exact Christoffel dual."""
        return float(max(self.residuals.max(initial=0.0), self.openings.max(initial=0.0)))


def split_dual(mesh: PolyMesh, cut: int | None = None) -> SplitDual:
    """Return the Christoffel dual of a mesh of planar quads or hexagons by splitting into quads.

    The scales of the faces fit best in logarithms. On a conformal hexagon mesh the dual is exact
    and equals the closed form; on another Gauss image it is a guess whose error is the residual.

    Parameters
    ----------
    mesh : PolyMesh
        The Gauss image S, or any mesh to be dualised.
    cut : {0, 1, 2}, optional
        See ``split_coefficients``; left out, the best of the three is taken.

    Raises
    ------
    MeshError
        As ``split_coefficients`` and ``edge_classes``.

    References
    ----------
    Thesis §7.2.2; Müller, Wallner 2010.

    Examples
    --------
    >>> import phexfab as px
    >>> from phexfab.minimal.conformal import conformal_gauss_image, ring_tilt
    >>> ring = conformal_gauss_image(12, 4, tilt=ring_tilt(12), closed=True)[0]
    >>> px.split_dual(ring.gauss).residual < 1e-9  # conformal hexagons: the dual is exact
    True
    """
    if mesh.n_faces and cut is None and not np.all(mesh.sides == 4):
        edge_classes(mesh)  # refuses what has none
        tries: list[SplitDual] = []
        reasons: list[MeshError] = []
        for one in range(3):
            try:
                tries.append(split_dual(mesh, one))
            except MeshError as error:
                reasons.append(error)
        if not tries:
            raise reasons[0]
        best = min(found.residual for found in tries)
        # Rounding must not decide between cuts that are all exact: the first good one.
        return next(found for found in tries if found.residual <= 1.01 * best + 1e-9)
    factors = split_coefficients(mesh, cut)
    twin = twin_corners(mesh)
    owner = mesh.face_of_corner
    left = np.flatnonzero(twin > np.arange(len(twin)))
    right = twin[left]
    f, g = owner[left], owner[right]
    # Flip each face so that signs agree along a tree of faces, beginning with face 0.
    order, parent = _face_tree(mesh.n_faces, np.r_[f, g], np.r_[g, f])
    relation = sp.csr_matrix(
        (np.tile(np.sign(factors[left] * factors[right]), 2), (np.r_[f, g], np.r_[g, f])),
        shape=(mesh.n_faces, mesh.n_faces),
    )
    up = np.sign(np.asarray(relation[parent[order[1:]], order[1:]]).ravel())
    sign = np.ones(mesh.n_faces)
    for k, face in enumerate(order[1:]):
        sign[face] = sign[parent[face]] * (up[k] or 1.0)
    if cut is not None and sign[0] * factors[np.argmax(edge_classes(mesh) == cut % 3)] < 0:
        sign = -sign
    # Least squares for the log scales, one of which is free.
    gap = np.log(np.abs(factors[left])) - np.log(np.abs(factors[right]))
    rows = np.arange(len(left))
    difference = sp.csr_matrix(
        (np.r_[np.ones(len(left)), -np.ones(len(left))], (np.r_[rows, rows], np.r_[f, g])),
        shape=(len(left), mesh.n_faces),
    )
    logs = _pinned(difference, -gap)
    residuals = np.zeros(len(factors))
    against = np.pi * (sign[f] * sign[g] * factors[left] * factors[right] < 0)
    residuals[left] = residuals[right] = np.hypot(np.abs(logs[f] - logs[g] + gap), against)
    edges = (factors * (sign * np.exp(logs))[owner])[:, None] * edge_vectors(mesh)
    edges *= (
        np.linalg.norm(edge_vectors(mesh), axis=1).mean() / np.linalg.norm(edges, axis=1).mean()
    )
    used, place = np.unique(mesh.corners, return_inverse=True)
    tail, head = place, place[mesh.next_corner]
    rows = np.arange(len(tail))
    gradient = sp.csr_matrix(
        (np.r_[np.ones(len(tail)), -np.ones(len(tail))], (np.r_[rows, rows], np.r_[head, tail])),
        shape=(len(tail), len(used)),
    )
    points = np.zeros_like(mesh.vertices)
    points[used] = np.column_stack([_pinned(gradient, edges[:, k]) for k in range(3)])
    dual = PolyMesh(points, mesh.corners, mesh.starts)
    size = np.linalg.norm(edges, axis=1).mean()
    openings = np.linalg.norm(edge_vectors(dual) - edges, axis=1) / size
    return SplitDual(dual, residuals, openings, cut)


def _pinned(difference: sp.csr_matrix, right: FloatArray) -> FloatArray:
    """Return the x of mean 0 that fits ``difference @ x = right`` best."""
    n = difference.shape[1]
    x = np.zeros(n)
    if n > 1:
        inner = difference[:, 1:]
        x[1:] = factorise(inner.T @ inner).solve(inner.T @ right)
    return x - x.mean()


def _face_tree(n_faces: int, here: IntArray, there: IntArray) -> tuple[IntArray, IntArray]:
    """Return a breadth-first order of the faces and the parent of each; -9999 at the root."""
    graph = sp.csr_matrix((np.ones(len(here)), (here, there)), shape=(n_faces, n_faces))
    order, parent = breadth_first_order(graph, 0, directed=False)
    if len(order) < n_faces:
        missing = int(np.setdiff1d(np.arange(n_faces), order)[0])
        raise MeshError(f"the mesh falls into pieces: face {missing} does not hang on face 0")
    return order.astype(np.int64), parent.astype(np.int64)

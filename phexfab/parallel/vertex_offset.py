"""Constant vertex distance: the alternating angles of a mesh, and its parallel in the sphere.

A chord of the unit sphere with direction u is mirrored into itself by the plane through the
centre orthogonal to u. So the vertices of an inscribed mesh with given edge directions follow
from one of them by reflections, and that one is the only freedom.

References
----------
Thesis §6.1; Wang, Liu, Yan, Chan, Ling, Sun 2008, "Hexagonal meshes with planar faces".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from phexfab.errors import MeshError
from phexfab.linalg import factorise
from phexfab.mesh.measures import corner_angles, edges
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.support import vertex_normals
from phexfab.parallel.tree import spanning_tree

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Inscribed:
    """A parallel mesh with its vertices on the unit sphere, and how well it closes.

    Attributes
    ----------
    mesh : PolyMesh
        Vertices of unit length (those that no face uses lie at the origin); its corners are those
        of the mesh it belongs to.
    freedom : int
        Dimension of all choices of the first vertex: 2 where every one closes, 1 and 0 where only
        those on a great circle or one pair do, −1 where none does.
    spreads : (3,) float
        Root mean square gap over the edges for the best, second and third direction of the first
        vertex, unit length; ``freedom`` counts those below the tolerance.
    gaps : (E,) float
        How far each edge (in the order of ``mesh.measures.edges``) misses its reflected end.
    """

    mesh: PolyMesh
    freedom: int
    spreads: FloatArray
    gaps: FloatArray


def alternating_angles(mesh: PolyMesh, normals: FloatArray | None = None) -> FloatArray:
    """Return (F,) degrees: α0 + α2 + α4 − (α1 + α3 + α5) of every face, reflex angles included.

    A face with an even number of sides is parallel to a polygon in a circle exactly when this
    vanishes modulo 360°, so it is given between −180 and 180. For faces with an odd number of
    sides it is not a number: such a polygon always exists, and fixes its own first vertex.

    For a whole mesh this is necessary; it is sufficient if the mesh is simply connected. On a
    ring the reflections around the hole need not bring a vertex back (see
    ``inscribed_parallel``).

    Parameters
    ----------
    mesh : PolyMesh
        With planar faces.
    normals : (F, 3) unit vectors, optional
        The side from which faces are seen counter-clockwise; their own normals otherwise.

    References
    ----------
    Thesis §6.1.
    """
    angles = corner_angles(mesh, normals)
    place = np.arange(len(mesh.corners)) - mesh.starts[:-1][mesh.face_of_corner]
    total = np.add.reduceat(np.where(place % 2, -angles, angles), mesh.starts[:-1])
    return np.where(mesh.sides % 2, np.nan, (total + 180.0) % 360.0 - 180.0)


def inscribed_parallel(
    mesh: PolyMesh,
    start: FloatArray | None = None,
    *,
    tolerance: float = 1e-9,
    refine: bool = False,
) -> Inscribed:
    """Return the parallel mesh inscribed in the unit sphere: the Gauss image of a vertex offset.

    Parameters
    ----------
    mesh : PolyMesh
        Connected, with planar faces.
    start : (3,) float, optional
        Wanted direction of the first vertex that a face uses; the nearest one that closes is
        taken. Without it the vertices are brought as near as possible to the vertex normals
        of ``mesh``, in the mean.
    tolerance : float
        Gap per edge, unit length, below which a first vertex counts as closing.
    refine : bool
        Share the gaps among all edges by least squares. For meshes read from files, whose printed
        digits add up along the walk from the first vertex; an exact mesh does not change.

    Returns
    -------
    Inscribed
        Even where nothing closes (``freedom`` −1): then ``gaps`` show where it opens.

    Raises
    ------
    MeshError
        If the mesh is in several pieces, has an edge of no length, or ``start`` no direction
        that closes.

    References
    ----------
    Thesis §4.4.1, §6.1.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0), "vertex")
    >>> found = px.inscribed_parallel(shell.mesh)
    >>> found.freedom  # any first vertex closes
    2
    >>> bool(found.gaps.max() < 1e-9)
    True
    """
    pairs = edges(mesh)
    used = np.unique(mesh.corners)
    _one_piece(pairs, used)
    along = _unit_edges(mesh, pairs)
    turned = _reflections_from_root(mesh, pairs, used)
    # Both ends as linear functions of the first vertex; an edge closes where they agree.
    tail, head = turned[pairs[:, 0]], turned[pairs[:, 1]]
    reflected = tail - 2 * along[:, :, None] * np.einsum("ei,eij->ej", along, tail)[:, None]
    misfit = head - reflected
    axes = np.linalg.eigh(np.einsum("eij,eik->jk", misfit, misfit))[1]
    # Not the roots of the eigenvalues: those of rounding's squares would be 1e-8.
    spreads = np.array([np.sqrt(np.mean(np.sum((misfit @ a) ** 2, axis=1))) for a in axes.T])
    freedom = int(np.count_nonzero(spreads <= tolerance)) - 1
    closing = axes[:, : max(freedom + 1, 1)]
    if start is None:
        wish = np.einsum("vij,vi->j", turned[used], vertex_normals(mesh)[used])
    else:
        wish = np.asarray(start, float)
    first = closing @ (closing.T @ wish)
    if np.linalg.norm(first) <= 1e-9 * np.linalg.norm(wish):
        if start is not None:
            raise MeshError(
                f"start = {wish.tolist()} is orthogonal to every first vertex that closes; "
                "choose another, or leave it out"
            )
        first = closing[:, 0]
    first = first / np.linalg.norm(first)
    points = turned @ first
    points = points / np.maximum(np.linalg.norm(points, axis=1, keepdims=True), 0.5)
    if refine:
        points[used] = _share_gaps(points[used], np.searchsorted(used, pairs), along)
    one, two = points[pairs[:, 0]], points[pairs[:, 1]]
    mirrored = one - 2 * np.einsum("ij,ij->i", one, along)[:, None] * along
    gaps = np.linalg.norm(two - mirrored, axis=1)
    return Inscribed(PolyMesh(points, mesh.corners, mesh.starts), freedom, spreads, gaps)


def _share_gaps(points: FloatArray, ends: IntArray, along: FloatArray) -> FloatArray:
    """Return the points moved by Gauss–Newton so that edges are parallel, on the unit sphere."""
    m, n = len(ends), len(points)
    across = np.eye(3) - along[:, :, None] * along[:, None, :]
    rows = np.arange(m)
    edge = sp.csr_matrix(
        (np.repeat([-1.0, 1.0], m), (np.tile(rows, 2), ends.T.ravel())), shape=(m, n)
    )
    parallel = sp.bsr_matrix((across, rows, np.arange(m + 1))) @ sp.kron(edge, sp.identity(3))
    vertex = np.arange(n)
    for _ in range(3):
        radial = sp.bsr_matrix((points[:, None, :], vertex, np.arange(n + 1)), shape=(n, 3 * n))
        right = parallel.T @ (parallel @ points.ravel())
        right = right + radial.T @ ((np.sum(points**2, axis=1) - 1) / 2)
        # The freedom of the first vertex costs nothing: hold it where it is.
        normal = parallel.T @ parallel + radial.T @ radial + 1e-9 * sp.identity(3 * n)
        points = points - factorise(normal).solve(right).reshape(n, 3)
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def _one_piece(pairs: IntArray, used: IntArray) -> None:
    if not len(used):
        raise MeshError("the mesh has no face; there is nothing to inscribe")
    n = int(used[-1]) + 1
    graph = sp.csr_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    label = connected_components(graph, directed=False)[1][used]
    if np.any(label != label[0]):
        other = int(used[np.flatnonzero(label != label[0])[0]])
        raise MeshError(
            f"the mesh is in several pieces (vertex {other} is not joined to vertex "
            f"{int(used[0])}); inscribe each piece by itself"
        )


def _unit_edges(mesh: PolyMesh, pairs: IntArray) -> FloatArray:
    along = mesh.vertices[pairs[:, 1]] - mesh.vertices[pairs[:, 0]]
    length = np.linalg.norm(along, axis=1, keepdims=True)
    if not np.all(length > 0):
        i, j = pairs[int(np.argmin(length))].tolist()
        raise MeshError(f"the edge {i}-{j} has no length and so no direction; remove it first")
    return along / length


def _reflections_from_root(mesh: PolyMesh, pairs: IntArray, used: IntArray) -> FloatArray:
    """Return (V, 3, 3): each vertex as a linear function of the first used one; 0 if unused."""
    slot = np.full(len(mesh.vertices), -1)
    slot[used] = np.arange(len(used))
    ends = slot[pairs]
    graph = sp.csr_matrix((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(len(used),) * 2)
    up = spanning_tree(graph, 0)
    along = mesh.vertices[used] - mesh.vertices[used[up]]
    along[0] = 1.0
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    product = np.eye(3) - 2 * along[:, :, None] * along[:, None, :]
    product[0] = np.eye(3)
    while np.any(up != up[up]):  # pointer doubling: every round doubles the length of the walk
        product = product @ product[up]
        up = up[up]
    product = product @ product[up]
    turned = np.zeros((len(mesh.vertices), 3, 3))
    turned[used] = product
    return turned

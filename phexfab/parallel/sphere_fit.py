"""The member of P(M) that touches the unit sphere best: with its vertices, edges or faces.

Gauss–Newton with damping in the coordinates of P(M), from the vertex normals.

References
----------
Thesis §4.4, ch. 6; Pottmann et al. 2007, sec. 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import breadth_first_order, connected_components

from phexfab.errors import MeshError
from phexfab.linalg import factorise
from phexfab.mesh.measures import edges, face_normals
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.nearest import nearest_field
from phexfab.parallel.pairs import KINDS
from phexfab.parallel.space import ParallelSpace

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def vertex_normals(mesh: PolyMesh) -> FloatArray:
    """Return (V, 3) unit sums of the normals of the faces at each vertex."""
    normals = face_normals(mesh)[mesh.face_of_corner]
    total = np.column_stack(
        [np.bincount(mesh.corners, normals[:, k], len(mesh.vertices)) for k in range(3)]
    )
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-300)


def sphere_miss(gauss: PolyMesh, kind: str, normals: FloatArray | None = None) -> FloatArray:
    """Return how far the vertices (V,), edge lines (E,) or face planes (F,) miss the unit sphere.

    Parameters
    ----------
    gauss : PolyMesh
    kind : ``"vertex"``, ``"edge"`` or ``"face"``
    normals : (F, 3) unit normals, optional
        Of the faces of M, for the face type; the largest miss of a face's corners is returned.
        Without them S's own normals.

    Returns
    -------
    Distance from the origin minus 1, absolute.

    References
    ----------
    Thesis §4.4.
    """
    _known(kind)
    s = gauss.vertices
    if kind == "vertex":
        return np.abs(np.linalg.norm(s, axis=1) - 1)
    if kind == "edge":
        pairs = edges(gauss)
        foot, _ = _feet(s, pairs, _unit(s[pairs[:, 1]] - s[pairs[:, 0]]))
        return np.abs(np.linalg.norm(foot, axis=1) - 1)
    about = face_normals(gauss) if normals is None else normals
    height = np.einsum("ij,ij->i", s[gauss.corners], about[gauss.face_of_corner])
    if normals is None:  # a Gauss image may be turned over, as on every saddle
        height = np.abs(height)
    return np.maximum.reduceat(np.abs(height - 1), gauss.starts[:-1])


def _known(kind: str) -> None:
    if kind not in KINDS:
        raise MeshError(f'kind = "{kind}"; use "vertex", "edge" or "face"')


def _unit(vectors: FloatArray) -> FloatArray:
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.asarray(np.divide(vectors, length, out=np.zeros_like(vectors), where=length > 0))


def _feet(s: FloatArray, pairs: IntArray, along: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the feet of the origin on the edges' lines, and the middles' places along them."""
    middle = s[pairs].mean(axis=1)
    place = np.einsum("ij,ij->i", middle, along)
    return middle - place[:, None] * along, place


@dataclass(frozen=True, eq=False)
class SphereFit:
    """The member S of P(M) that touches the unit sphere best in one way.

    Attributes
    ----------
    kind : str
        ``"vertex"``, ``"edge"`` or ``"face"``.
    gauss : PolyMesh
        S.
    worst, mean : float
        Largest and root mean square miss of the sphere, of radius 1.
    steps : int
        Gauss–Newton steps taken.
    """

    kind: str
    gauss: PolyMesh
    worst: float
    mean: float
    steps: int


def fit_to_sphere(
    space: ParallelSpace,
    kind: str,
    start: PolyMesh | None = None,
    steps: int = 60,
    *,
    minimal: float = 0.0,
) -> SphereFit:
    """Return the member of P(M) nearest to having vertices on, edges or faces tangent to, S².

    Parameters
    ----------
    space : ParallelSpace
    kind : ``"vertex"``, ``"edge"`` or ``"face"``
    start : PolyMesh, optional
        Where to begin; otherwise the member nearest to the vertex normals. A vertex type has a
        family of Gauss images with two parameters: the nearest to the start is found.
    steps : int
        Most Gauss–Newton steps.
    minimal : float
        Weight of the normalised mixed areas with M's faces. A little of it (1e-2) picks, among
        Gauss images that touch the sphere equally well, the one to which M is most nearly minimal.

    References
    ----------
    Thesis §4.4, 6.1–6.3; Pottmann et al. 2007, sec. 3.
    """
    _known(kind)
    normals = vertex_normals(space.mesh)
    if start is not None:
        starts = [start.vertices]
    elif kind == "vertex":
        starts = [reflected(space.mesh, normals), normals]
    else:
        starts = [normals]
    fits = [_descend(space, kind, nearest_field(space, wish), steps, minimal) for wish in starts]
    return min(fits, key=lambda fit: fit.mean)


def _descend(
    space: ParallelSpace, kind: str, s: FloatArray, steps: int, minimal: float
) -> SphereFit:
    mesh, basis = space.mesh, space.basis
    areas = minimal * _mixed_area_rows(mesh, s) if minimal else None

    def misses(at: FloatArray) -> tuple[FloatArray, Any]:
        value, rows = _misses(mesh, kind, at)
        if areas is None:
            return value, rows
        return np.concatenate([value, areas @ at.ravel()]), sp.vstack([rows, areas]).tocsr()

    # A face of a simple mesh carries a field of size 1/angle: damp by the fields' own size.
    inertia = (basis.T @ basis).tocsc()
    inertia = inertia + sp.diags(1e-14 * inertia.diagonal() + 1e-300)
    miss, jacobian = misses(s)
    cost, damping, taken = float(miss @ miss), 1e-3, 0
    for _ in range(steps):
        if cost < 1e-30 * len(miss) or damping > 1e6:
            break
        derivative = (jacobian @ basis).tocsr()
        slope = derivative.T @ miss
        normal = derivative.T @ derivative
        change = np.asarray(basis @ factorise((normal + damping * inertia).tocsc()).solve(-slope))
        ahead = s + change.reshape(-1, 3)
        ahead_miss, ahead_jacobian = misses(ahead)
        gain = cost - float(ahead_miss @ ahead_miss)
        if gain <= 0:
            damping *= 100
            continue
        s, miss, jacobian, cost = ahead, ahead_miss, ahead_jacobian, cost - gain
        taken += 1
        damping = max(damping / 10, 1e-9)
        if gain < 1e-10 * cost and damping <= 1e-6:
            break
    gauss = PolyMesh(s, mesh.corners, mesh.starts)
    off = sphere_miss(gauss, kind, face_normals(mesh))
    return SphereFit(kind, gauss, float(off.max()), float(np.sqrt((off**2).mean())), taken)


def reflected(mesh: PolyMesh, wish: FloatArray) -> FloatArray:
    """Return points of the unit sphere joined by chords parallel to the edges of a tree in M.

    The far end of a chord is the mirror image of the near one, so one point gives all others by
    products of reflections, and the best first point is in closed form. Where every face is
    quasi-circular the mesh closes and the chords over the other edges are parallel, too.

    Parameters
    ----------
    mesh : PolyMesh
    wish : (V, 3) points to come near to
    """
    n = len(mesh.vertices)
    pairs = edges(mesh)
    graph = sp.coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n)).tocsr()
    count, piece = connected_components(graph, directed=False)
    turned = np.zeros((n, 3, 3))
    for root in np.unique(piece, return_index=True)[1]:
        order, parent = breadth_first_order(graph, root, directed=False)
        level = np.zeros(n, np.int64)
        for v in order[1:]:
            level[v] = level[parent[v]] + 1
        turned[root] = np.eye(3)
        for k in range(1, int(level[order].max(initial=0)) + 1):
            now = order[level[order] == k]
            along = _unit(mesh.vertices[now] - mesh.vertices[parent[now]])
            before = turned[parent[now]]
            turned[now] = before - 2 * along[:, :, None] * (along[:, None, :] @ before)
    points = np.empty((n, 3))
    for k in range(count):
        own = piece == k
        first = np.einsum("vij,vi->j", turned[own], wish[own])
        points[own] = turned[own] @ (first / np.linalg.norm(first))
    return points


def _misses(mesh: PolyMesh, kind: str, s: FloatArray) -> tuple[FloatArray, Any]:
    """Return the residuals of a type, to first order distances, and their derivative (n, 3V)."""
    n = len(s)
    if kind == "face":
        normals = face_normals(mesh)[mesh.face_of_corner]
        value = np.einsum("ij,ij->i", s[mesh.corners], normals) - 1
        return value, _rows(normals, mesh.corners, n)
    if kind == "vertex":
        return (np.einsum("ij,ij->i", s, s) - 1) / 2, _rows(s, np.arange(n), n)
    pairs = edges(mesh)
    # Directions are those of M, which S shares: the residual is then as smooth as |foot|².
    along = _unit(mesh.vertices[pairs[:, 1]] - mesh.vertices[pairs[:, 0]])
    foot, _ = _feet(s, pairs, along)
    rows = _rows(foot / 2, pairs[:, 0], n) + _rows(foot / 2, pairs[:, 1], n)
    return (np.einsum("ij,ij->i", foot, foot) - 1) / 2, rows


def _mixed_area_rows(mesh: PolyMesh, s: FloatArray) -> Any:
    """Return the (F, 3V) matrix of area(M_f, ·)/√(|area M_f|·|area s_f|), linear in S.

    Corner k of S counts with ¼ (p_{k+1} − p_{k−1}) × n, as Leibniz' sector formula says.
    """
    normals = face_normals(mesh)[mesh.face_of_corner]
    tail, head = mesh.corners[mesh.previous_corner], mesh.corners[mesh.next_corner]

    def areas(points: FloatArray) -> FloatArray:
        around = np.cross(points[head] - points[tail], normals) / 4
        return np.add.reduceat(
            np.einsum("ij,ij->i", around, points[mesh.corners]), mesh.starts[:-1]
        )

    size = np.sqrt(np.abs(areas(mesh.vertices) * areas(s)))
    weight = 1 / np.maximum(size, 1e-300)[mesh.face_of_corner]
    around = np.cross(mesh.vertices[head] - mesh.vertices[tail], normals) * weight[:, None] / 4
    corner = _rows(around, mesh.corners, len(mesh.vertices))
    gather = sp.csr_matrix(
        (np.ones(len(mesh.corners)), (mesh.face_of_corner, np.arange(len(mesh.corners)))),
        shape=(mesh.n_faces, len(mesh.corners)),
    )
    return (gather @ corner).tocsr()


def _rows(vectors: FloatArray, vertices: IntArray, n_vertices: int) -> Any:
    columns = (3 * vertices[:, None] + np.arange(3)).ravel()
    count = len(vectors)
    return sp.csr_matrix(
        (vectors.ravel(), columns, np.arange(0, 3 * count + 1, 3)), shape=(count, 3 * n_vertices)
    )

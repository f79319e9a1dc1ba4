"""Simple meshes, three edges at every vertex, as planes: heights are the coordinates of P(M).

A vertex inside is the meet of three face planes. On the border a vertex lies on one or two faces,
and the lines of its border edges, which keep their direction too, supply the missing planes. Border
edges that follow each other over vertices of two faces move together, so a *run* of them has one
coordinate: a simple disc has as many dimensions as faces and runs (border vertices with one face).

References
----------
Thesis §4.1; Pottmann et al. 2007, sec. 2.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import MeshError
from phexfab.mesh.measures import face_normals
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.pairs import require_same_faces
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Border:
    """The border of an oriented mesh, and how many faces meet at each vertex.

    Attributes
    ----------
    corner : (B,) int
        Corner at the tail of each border edge, in corner order.
    before : (B,) int
        The border edge that ends where this one begins.
    after : (B,) int
        The border edge that begins where this one ends.
    valence : (V,) int
        Number of faces at each vertex.
    """

    corner: IntArray
    before: IntArray
    after: IntArray
    valence: IntArray


def border_of(mesh: PolyMesh) -> Border | None:
    """Return the border, or None where the mesh is not an oriented manifold with border."""
    n = len(mesh.vertices)
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    key, back = tail * n + head, head * n + tail
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    if np.any(ordered[1:] == ordered[:-1]):
        return None
    slot = np.minimum(np.searchsorted(ordered, back), max(len(ordered) - 1, 0))
    corner = np.flatnonzero(ordered[slot] != back)
    leaving = np.full(n, -1)
    leaving[tail[corner]] = np.arange(len(corner))
    if len(np.unique(tail[corner])) < len(corner) or len(np.unique(head[corner])) < len(corner):
        return None
    after = leaving[head[corner]]
    before = np.full(len(corner), -1)
    before[after] = np.arange(len(corner))
    return Border(corner, before, after, np.bincount(tail, minlength=n))


def is_simple(mesh: PolyMesh) -> bool:
    """Return whether three edges meet at every vertex (two or three on the border)."""
    border = border_of(mesh)
    return border is not None and _is_simple(mesh, border)


def _is_simple(mesh: PolyMesh, border: Border) -> bool:
    on_border = np.zeros(len(mesh.vertices), bool)
    on_border[mesh.corners[border.corner]] = True
    valence = border.valence
    return bool(
        (valence[~on_border] == 3).all()
        and np.isin(valence[on_border], (1, 2)).all()
        and mesh.n_faces
    )


def border_runs(mesh: PolyMesh, border: Border) -> tuple[IntArray, IntArray] | None:
    """Return run and place in it of every border edge; None if a border has no run's end."""
    valence = border.valence[mesh.corners[border.corner]]
    first = np.flatnonzero(valence == 1)
    run = np.full(len(border.corner), -1)
    place = np.zeros(len(border.corner), np.int64)
    now, number, step = first, np.arange(len(first)), 0
    while len(now):
        run[now], place[now] = number, step
        onward = border.after[now]
        same = valence[onward] != 1
        now, number, step = onward[same], number[same], step + 1
    return None if (run < 0).any() else (run, place)


def _inverses(rows: FloatArray) -> FloatArray | None:
    """Return refined inverses of (n, 3, 3) matrices of unit rows; None if one is singular."""
    if len(rows) and np.abs(np.linalg.det(rows)).min() < 1e-9:
        return None
    inverse = np.linalg.inv(rows)
    # Planes of a fine mesh are nearly parallel: one step keeps the products with the rows exact.
    return np.asarray(inverse + inverse @ (np.eye(3) - rows @ inverse))


def simple_basis(mesh: PolyMesh) -> Any | None:
    """Return a sparse, local basis of P(M) of a simple mesh, or None where it has none.

    Parameters
    ----------
    mesh : PolyMesh
        Planar faces; what they are off their planes is idealised away.

    Returns
    -------
    (3V, F + R) CSR matrix or None
        Column f < F moves face f's plane by 1 along its normal; column F + r moves run r of the
        border by 1 outwards in its first face. None if the mesh is not simple, neighbouring faces
        are coplanar, or a border has no vertex with one face: see ``parallel_space``.
    """
    border = border_of(mesh)
    if border is None or not _is_simple(mesh, border):
        return None
    found = border_runs(mesh, border)
    if found is None:
        return None
    run, place = found
    n_v, n_f, n_b = len(mesh.vertices), mesh.n_faces, len(border.corner)
    normals = face_normals(mesh)
    tail = mesh.corners[border.corner]
    along = mesh.vertices[mesh.corners[mesh.next_corner[border.corner]]] - mesh.vertices[tail]
    face = mesh.face_of_corner[border.corner]
    outward = np.cross(along, normals[face])  # counter-clockwise corners: the face is on the left
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    planes = np.vstack([normals, outward])  # plane f is a face, plane F + b a border edge's

    # Three planes for every vertex, faces first, then the border edge before it, then after it.
    order = np.argsort(mesh.corners, kind="stable")
    rank = np.arange(len(order)) - np.repeat(
        np.concatenate([[0], np.cumsum(border.valence)[:-1]]), border.valence
    )
    three = np.full((n_v, 3), -1)
    three[mesh.corners[order], rank] = mesh.face_of_corner[order]
    two_faces = border.valence[tail] == 2
    edge = np.arange(n_b)
    three[tail[two_faces], 2] = n_f + border.before[edge[two_faces]]
    three[tail[~two_faces], 1] = n_f + border.before[edge[~two_faces]]
    three[tail[~two_faces], 2] = n_f + edge[~two_faces]
    meet = _inverses(planes[three])
    if meet is None or not np.isfinite(meet).all():
        return None

    # A border edge behind a vertex of two faces passes through the meet of the three planes there.
    n_r = int(run.max(initial=-1)) + 1
    shape = (n_b, n_f + n_r)
    first = np.flatnonzero(place == 0)
    lines = sp.csr_matrix((np.ones(len(first)), (first, n_f + run[first])), shape=shape)
    for step in range(1, int(place.max(initial=0)) + 1):
        b = np.flatnonzero(place == step)
        share = np.einsum("bi,bij->bj", outward[b], meet[tail[b]])
        pick = sp.csr_matrix((np.ones(len(b)), (b, np.arange(len(b)))), shape=(n_b, len(b)))
        heights = sp.csr_matrix(
            (share[:, :2].ravel(), (np.repeat(b, 2), three[tail[b], :2].ravel())), shape=shape
        )
        lines = lines + heights + pick @ sp.diags(share[:, 2]) @ lines[border.before[b]]
    parameters = sp.vstack([sp.eye(n_f, n_f + n_r, format="csr"), lines], format="csr")
    rows = np.repeat(np.arange(3 * n_v), 3)
    columns = np.repeat(three, 3, axis=0).ravel()
    solve = sp.csr_matrix((meet.ravel(), (rows, columns)), shape=(3 * n_v, n_f + n_b))
    basis = (solve @ parameters).tocsr()
    basis.sort_indices()
    return basis


def shell_of_mesh(
    mesh: PolyMesh, gauss: PolyMesh | None = None, *, kind: str = "face", border: str = "planes"
) -> Shell:
    """Return a simple mesh with planar faces as planes: normals, heights, dual triangles.

    Parameters
    ----------
    mesh : PolyMesh
        M, mm; three edges at every vertex inside.
    gauss : PolyMesh, optional
        S, parallel to M. Without it the face type: every face plane at distance 1.
    kind : str
        Offset type of S.
    border : ``"planes"`` or ``"panels"``
        ``"planes"``: all faces stay panels (in their order) and every run of border edges gets a
        border plane; the edges of a run must be coplanar. ``"panels"``: the faces at the border
        become border planes themselves, and only those with a closed ring of faces stay panels.

    Raises
    ------
    MeshError
        If the mesh is not simple, the meshes do not correspond, or a run is not planar.

    References
    ----------
    Thesis §4.1.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> again = px.shell_of_mesh(shell.mesh, shell.gauss)
    >>> bool(abs(again.mesh.vertices - shell.mesh.vertices).max() < 1e-9)
    True
    """
    if border not in ("planes", "panels"):
        raise MeshError(f'border = "{border}"; use "planes" or "panels"')
    edge = border_of(mesh)
    if edge is None or not _is_simple(mesh, edge):
        raise MeshError(
            "the mesh is not simple: three edges must meet at every vertex; use parallel_space, "
            "which takes any polygon mesh"
        )
    if gauss is not None:
        require_same_faces(mesh, gauss)
    n_f = mesh.n_faces
    normals = face_normals(mesh)
    points = np.add.reduceat(mesh.vertices[mesh.corners], mesh.starts[:-1]) / mesh.sides[:, None]
    inside = edge.valence == 3
    triangles = _face_triangles(mesh, inside)
    heights = _heights(mesh, normals)
    s_heights = np.ones(n_f) if gauss is None else _heights(gauss, normals)
    if border == "panels":
        return Shell(normals, heights, s_heights, triangles, kind, points)

    found = border_runs(mesh, edge)
    if found is None:
        raise MeshError('a border has no vertex with one face; use border="panels"')
    run, _ = found
    tail = mesh.corners[edge.corner]
    head = mesh.corners[mesh.next_corner[edge.corner]]
    panel = mesh.face_of_corner[edge.corner]
    extra, off = _run_normals(mesh.vertices[head] - mesh.vertices[tail], normals[panel], run)
    if len(off) and off.max() > 1e-6:
        raise MeshError(
            f"border run {int(off.argmax())} at vertex {tail[int(np.argmax(run == off.argmax()))]} "
            f'is not planar (sine {off.max():.1e}): no single plane trims it; use border="panels"'
        )
    count = np.bincount(run)

    def run_heights(vertices: FloatArray) -> FloatArray:
        value = np.einsum("ij,ij->i", extra[run], (vertices[tail] + vertices[head]) / 2)
        return np.bincount(run, value) / count

    # Counter-clockwise at a border vertex: along the border edge onward the panel is on the left.
    ends = edge.valence[tail] == 1
    b = np.flatnonzero(ends)
    one = np.column_stack([panel[b], n_f + run[edge.before[b]], n_f + run[b]])
    b = np.flatnonzero(~ends)
    two = np.column_stack([panel[b], panel[edge.before[b]], n_f + run[b]])
    rows = np.zeros((len(mesh.vertices), 3), np.int64)
    rows[inside] = triangles
    rows[tail[ends]], rows[tail[~ends]] = one, two
    if gauss is None:
        basis = simple_basis(mesh)
        if basis is None:
            raise MeshError("neighbouring faces are coplanar; the face type has no Gauss image")
        s_runs = np.ones(len(extra))  # the border planes, too, touch the sphere
    else:
        s_runs = run_heights(gauss.vertices)
    middle = (mesh.vertices[tail] + mesh.vertices[head]) / 2
    run_points = np.column_stack([np.bincount(run, middle[:, k]) / count for k in range(3)])
    return Shell(
        np.vstack([normals, extra]),
        np.concatenate([heights, run_heights(mesh.vertices)]),
        np.concatenate([s_heights, s_runs]),
        rows,
        kind,
        np.vstack([points, run_points]),
    )


def _heights(mesh: PolyMesh, normals: FloatArray) -> FloatArray:
    value = np.einsum("ij,ij->i", mesh.vertices[mesh.corners], normals[mesh.face_of_corner])
    return np.asarray(np.add.reduceat(value, mesh.starts[:-1]) / mesh.sides)


def _face_triangles(mesh: PolyMesh, inside: NDArray[np.bool_]) -> IntArray:
    """Return the faces around each inner vertex, counter-clockwise, in vertex order."""
    n = len(mesh.vertices)
    corner = np.flatnonzero(inside[mesh.corners])
    vertex, face = mesh.corners[corner], mesh.face_of_corner[corner]
    onward = mesh.corners[mesh.next_corner[corner]]
    back = mesh.corners[mesh.previous_corner[corner]]
    # Counter-clockwise about v the next face has, as its onward edge, this face's edge back.
    key = vertex * n + onward
    order = np.argsort(key, kind="stable")
    following = order[np.searchsorted(key[order], vertex * n + back)]
    first = np.unique(vertex, return_index=True)[1]
    second = following[first]
    return np.column_stack([face[first], face[second], face[following[second]]])


def _run_normals(
    along: FloatArray, panel_normals: FloatArray, run: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return the unit normal of each run's plane and the largest sine of an edge against it."""
    unit = along / np.linalg.norm(along, axis=1, keepdims=True)
    n = int(run.max(initial=-1)) + 1
    outer = (unit[:, :, None] * unit[:, None, :]).reshape(-1, 9)
    spread = np.column_stack([np.bincount(run, outer[:, k], n) for k in range(9)])
    values, vectors = np.linalg.eigh(spread.reshape(-1, 3, 3))
    normal = vectors[:, :, 0]
    first = np.unique(run, return_index=True)[1]
    # A straight run lies in many planes, like a single edge.
    single = values[:, 1] < 1e-12 * values[:, 2]
    upright = np.cross(unit[first], panel_normals[first])
    normal = np.where(single[:, None], upright, normal)
    mean = np.column_stack([np.bincount(run, panel_normals[:, k], n) for k in range(3)])
    flip = ~single & (np.einsum("ij,ij->i", normal, mean) < 0)
    normal = np.where(flip[:, None], -normal, normal)
    off = np.zeros(n)
    np.maximum.at(off, run, np.abs(np.einsum("ij,ij->i", unit, normal[run])))
    return normal, off

"""Measures of polygon meshes, for all faces at once; faces may have any number of sides.

Nothing here takes faces to be convex: on a saddle every hexagon has two reflex corners. Lengths
are in the unit of the vertices (mm), angles in degrees.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import MeshError
from phexfab.mesh.polymesh import PolyMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

# What rounding can do to a corner, or to the area of three, in a face that is scaled to size 1.
_TOUCH = 64 * np.finfo(float).eps


def area_vectors(mesh: PolyMesh) -> FloatArray:
    """Return the (F, 3) area vectors: half the sum of cross products around each face.

    Their length is the area of the face seen along them, reflex corners included.
    """
    points = mesh.vertices[mesh.corners]
    # Around the face's own first corner, so that a face far from the origin loses no digits.
    points = points - points[mesh.starts[:-1]][mesh.face_of_corner]
    return np.add.reduceat(np.cross(points, points[mesh.next_corner]), mesh.starts[:-1]) / 2


def face_normals(mesh: PolyMesh) -> FloatArray:
    """Return (F, 3) unit normals, about which the corners run counter-clockwise.

    A face whose area vanishes (a symmetric bow tie) has no normal: its row is not a number.
    """
    vectors = area_vectors(mesh)
    lengths = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.divide(vectors, lengths, out=np.full_like(vectors, np.nan), where=lengths > 0)


def signed_areas(mesh: PolyMesh, normals: FloatArray | None = None) -> FloatArray:
    """Return (F,) areas, negative where the corners run clockwise about the given normal.

    Parameters
    ----------
    mesh : PolyMesh
    normals : (F, 3) unit vectors, optional
        Without them every face is measured about its own normal and no area is negative.
    """
    vectors = area_vectors(mesh)
    if normals is None:
        return np.asarray(np.linalg.norm(vectors, axis=1))
    return np.asarray(np.einsum("ij,ij->i", vectors, normals))


def face_centroids(mesh: PolyMesh) -> FloatArray:
    """Return (F, 3) centroids of area; the mean corner where a face has no area."""
    starts, owner = mesh.starts[:-1], mesh.face_of_corner
    points = mesh.vertices[mesh.corners]
    origin = points[starts]
    local = points - origin[owner]
    normals = np.nan_to_num(face_normals(mesh))
    following = local[mesh.next_corner]
    weight = np.einsum("ij,ij->i", np.cross(local, following), normals[owner])
    total = np.add.reduceat(weight, starts)[:, None]
    moment = np.add.reduceat(weight[:, None] * (local + following), starts)
    mean = np.add.reduceat(local, starts) / mesh.sides[:, None]
    return origin + np.divide(moment, 3 * total, out=mean, where=total > 0)


def edges(mesh: PolyMesh) -> IntArray:
    """Return the (E, 2) edges as vertex pairs, each once, the lower index first, sorted."""
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    # One number for each pair sorts ten times faster than rows do.
    base = int(high.max(initial=0)) + 1
    return np.column_stack(np.divmod(np.unique(low * base + high), base))


def edge_lengths(mesh: PolyMesh) -> FloatArray:
    """Return (E,) lengths in the order of ``edges``."""
    pairs = edges(mesh)
    ends = mesh.vertices[pairs]
    return np.asarray(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))


def mean_edge(mesh: PolyMesh) -> float:
    """Return the mean length of the edges, each counted once.

    Raises
    ------
    MeshError
        If the mesh has no edge.
    """
    return float(_some_lengths(mesh).mean())


def shortest_edge(mesh: PolyMesh) -> float:
    """Return the length of the shortest edge.

    Raises
    ------
    MeshError
        If the mesh has no edge.
    """
    return float(_some_lengths(mesh).min())


def _some_lengths(mesh: PolyMesh) -> FloatArray:
    if not mesh.n_faces:
        raise MeshError("the mesh has no face, so no edge has a length")
    return edge_lengths(mesh)


def corner_angles(mesh: PolyMesh, normals: FloatArray | None = None) -> FloatArray:
    """Return (C,) interior angles in degrees, between 0 and 360: reflex ones exceed 180.

    Parameters
    ----------
    mesh : PolyMesh
    normals : (F, 3) unit vectors, optional
        The side from which each face is seen counter-clockwise; its own normal without them.
    """
    about = face_normals(mesh) if normals is None else normals
    points = mesh.vertices[mesh.corners]
    onward = points[mesh.next_corner] - points
    back = points[mesh.previous_corner] - points
    sine = np.einsum("ij,ij->i", np.cross(onward, back), about[mesh.face_of_corner])
    cosine = np.einsum("ij,ij->i", onward, back)
    return np.degrees(np.arctan2(sine, cosine)) % 360.0


def _by_sides(mesh: PolyMesh) -> Iterator[tuple[IntArray, FloatArray]]:
    """Yield the faces (f,) of each number of corners n, and these about their mean, (3, n, f).

    Faces come last, so that all operations run over long rows of numbers.
    """
    across = np.ascontiguousarray(mesh.vertices.T)
    for n in np.unique(mesh.sides):
        faces = np.flatnonzero(mesh.sides == n)
        points = across.take(mesh.corners[mesh.starts[faces] + np.arange(n)[:, None]], axis=1)
        points -= points[:, :1].copy()
        points -= points.mean(axis=1, keepdims=True)
        yield faces, points


def _in_plane(points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return coordinates (2, n, f) in, and (n, f) off, the least-squares planes of (3, n, f)."""
    spread = np.einsum("inf,jnf->fij", points, points)
    # Corners that are not numbers stay so in what is returned; only LAPACK must not see them.
    axes = np.linalg.eigh(np.where(np.isfinite(spread), spread, 0.0))[1]
    frame = np.ascontiguousarray(axes.transpose(2, 1, 0)[::-1])
    local = np.einsum("inf,jif->jnf", points, frame)
    x, y, off = local
    # The eigenvectors are good to rounding times the faces' aspect ratio squared; one linear fit
    # in their frame takes that factor away again. A face on a line leaves y free: skip it there.
    xx, xy, xz = np.einsum("nf,jnf->jf", x, local)
    yy, yz = np.einsum("nf,jnf->jf", y, local[1:])
    det = xx * yy - xy * xy
    det = np.where(det > 1e-24 * xx * xx, det, np.inf)
    a = (xz * yy - yz * xy) / det
    b = (yz * xx - xz * xy) / det
    return local[:2], (off - a * x - b * y) / np.sqrt(1 + a * a + b * b)


def planarity(mesh: PolyMesh) -> FloatArray:
    """Return (F,) the largest distance of a face's corners to its least-squares plane, mm."""
    size = np.zeros(mesh.n_faces)
    for faces, points in _by_sides(mesh):
        size[faces] = np.abs(_in_plane(points)[1]).max(axis=0)
    return size


def relative_planarity(mesh: PolyMesh) -> FloatArray:
    """Return (F,) ``planarity`` divided by the mean edge of the mesh."""
    return planarity(mesh) / mean_edge(mesh)


def libhedra_planarity(mesh: PolyMesh) -> FloatArray:
    """Return (F,) planarity in per cent as the library libhedra defines it.

    For four consecutive corners it is the distance of the two diagonals' lines over the mean
    diagonal; a face has the root mean square over its consecutive fours, in per cent, so that a
    quadrilateral has that of its diagonals. Triangles have 0.

    References
    ----------
    libhedra, ``include/hedra/planarity.h``.
    """
    first = mesh.vertices[mesh.corners]
    second = first[mesh.next_corner]
    third = second[mesh.next_corner]
    fourth = third[mesh.next_corner]
    one, two = third - first, fourth - second
    cross = np.cross(one, two)
    mean = (np.linalg.norm(one, axis=1) + np.linalg.norm(two, axis=1)) / 2
    below = np.linalg.norm(cross, axis=1) * mean
    ratio = np.divide(
        np.einsum("ij,ij->i", cross, second - first),
        below,
        out=np.zeros(len(below)),
        where=below > 0,
    )
    squares = np.add.reduceat(ratio * ratio, mesh.starts[:-1]) / mesh.sides
    return 100 * np.sqrt(np.where(mesh.sides > 3, squares, 0.0))


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> IntArray:
    """Return the sign of the turn a→b→c, (2, …); 0 where rounding cannot tell it from straight."""
    det = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
    return np.where(np.abs(det) > _TOUCH, np.sign(det), 0).astype(np.int8)


def _beside(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> BoolArray:
    """True where one of the segments ab and cd, (2, …), is on one side of the other's line."""
    return (_turn(a, b, c) * _turn(a, b, d) > 0) | (_turn(c, d, a) * _turn(c, d, b) > 0)


def simple_faces(mesh: PolyMesh) -> BoolArray:
    """Return (F,) True where a face is a simple polygon in its least-squares plane.

    Edges that cross, touch, fold back on their neighbour or have no length make a face not
    simple; so does what rounding cannot tell from touching. Either orientation is simple.
    """
    return planarity_and_simple(mesh)[1]


def planarity_and_simple(mesh: PolyMesh) -> tuple[FloatArray, BoolArray]:
    """Return what ``planarity`` and ``simple_faces`` do, in less time than both."""
    size, simple = np.zeros(mesh.n_faces), np.ones(mesh.n_faces, bool)
    for faces, points in _by_sides(mesh):
        flat, off = _in_plane(points)
        size[faces], simple[faces] = np.abs(off).max(axis=0), _simple(flat)
    return size, simple


def _simple(flat: FloatArray) -> BoolArray:
    """Return (f,) True where corners (2, n, f) in their plane are a simple polygon."""
    n, f = flat.shape[1:]
    reach = np.abs(flat).max(axis=(0, 1))
    flat = flat / np.where(reach > 0, reach, 1.0)
    following, beyond = (flat[:, (np.arange(n) + k) % n] for k in (1, 2))
    back = np.einsum("knf,knf->nf", following - flat, beyond - following) <= 0
    good = ~(back & (_turn(flat, following, beyond) == 0)).any(axis=0)
    i, j = np.triu_indices(n, 2)
    keep = (j - i) % n != n - 1  # the first and the last edge are neighbours
    i, j = i[keep], j[keep]
    low, high = np.minimum(flat, following), np.maximum(flat, following)
    # Bounded memory: a face of n sides has about n²/2 pairs of edges.
    for part in np.array_split(np.arange(len(i)), 1 + f * len(i) // 1_000_000):
        first, second = i[part], j[part]
        apart = low[:, second] - high[:, first] > _TOUCH
        apart |= low[:, first] - high[:, second] > _TOUCH
        pair, face = np.nonzero(~apart.any(axis=0))  # boxes do not tell
        first, second = first[pair], second[pair]
        ends = (flat[:, first, face], following[:, first, face])
        beside = _beside(*ends, flat[:, second, face], following[:, second, face])
        good[face[~beside]] = False
    return good

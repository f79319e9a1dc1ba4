"""Measures of polygon meshes, for all faces at once; faces may have any number of sides.

Nothing here takes faces to be convex: on a saddle every hexagon has two reflex corners. Lengths
are in the unit of the vertices (mm), angles in degrees.
"""

from __future__ import annotations

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


def _in_plane(mesh: PolyMesh) -> tuple[FloatArray, FloatArray]:
    """Return corner coordinates (C, 2) in, and (C,) off, the least-squares plane of each face."""
    starts, owner = mesh.starts[:-1], mesh.face_of_corner
    points = mesh.vertices[mesh.corners]
    points = points - points[starts][owner]
    points = points - (np.add.reduceat(points, starts) / mesh.sides[:, None])[owner]
    spread = np.add.reduceat(points[:, :, None] * points[:, None, :], starts)
    # Corners that are not numbers stay so in what is returned; only LAPACK must not see them.
    axes = np.linalg.eigh(np.where(np.isfinite(spread), spread, 0.0))[1]
    local = np.einsum("ci,cij->cj", points, axes[owner])
    off, y, x = local.T
    # The eigenvectors are good to rounding times the faces' aspect ratio squared; one linear fit
    # in their frame takes that factor away again. A face on a line leaves y free: skip it there.
    xx, xy, yy, xz, yz = (
        np.add.reduceat(t, starts) for t in (x * x, x * y, y * y, x * off, y * off)
    )
    det = xx * yy - xy * xy
    solid = det > 1e-24 * xx * xx
    safe = np.where(solid, det, 1.0)
    a = np.where(solid, (xz * yy - yz * xy) / safe, 0.0)[owner]
    b = np.where(solid, (yz * xx - xz * xy) / safe, 0.0)[owner]
    return np.column_stack([x, y]), (off - a * x - b * y) / np.sqrt(1 + a * a + b * b)


def planarity(mesh: PolyMesh) -> FloatArray:
    """Return (F,) the largest distance of a face's corners to its least-squares plane, mm."""
    return np.maximum.reduceat(np.abs(_in_plane(mesh)[1]), mesh.starts[:-1])


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
    """Return the sign of the turn a→b→c; 0 where rounding cannot tell it from straight."""
    left = (b[..., 0] - a[..., 0]) * (c[..., 1] - a[..., 1])
    right = (b[..., 1] - a[..., 1]) * (c[..., 0] - a[..., 0])
    det = left - right
    return np.where(np.abs(det) > _TOUCH, np.sign(det), 0).astype(np.int64)


def _apart(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> BoolArray:
    """True where segments ab and cd of the plane have certainly no point in common."""
    after = np.minimum(c, d) - np.maximum(a, b) > _TOUCH
    before = np.minimum(a, b) - np.maximum(c, d) > _TOUCH
    beside_ab = _turn(a, b, c) * _turn(a, b, d) > 0
    beside_cd = _turn(c, d, a) * _turn(c, d, b) > 0
    return np.asarray(np.any(after | before, axis=-1) | beside_ab | beside_cd)


def simple_faces(mesh: PolyMesh) -> BoolArray:
    """Return (F,) True where a face is a simple polygon in its least-squares plane.

    Edges that cross, touch, fold back on their neighbour or have no length make a face not
    simple; so does what rounding cannot tell from touching. Either orientation is simple.
    """
    return _simple(mesh, _in_plane(mesh)[0])


def planarity_and_simple(mesh: PolyMesh) -> tuple[FloatArray, BoolArray]:
    """Return what ``planarity`` and ``simple_faces`` do, in less time than both."""
    flat, off = _in_plane(mesh)
    return np.maximum.reduceat(np.abs(off), mesh.starts[:-1]), _simple(mesh, flat)


def _simple(mesh: PolyMesh, flat: FloatArray) -> BoolArray:
    """Return (F,) True where a face with corners (C, 2) in its plane is a simple polygon."""
    reach = np.maximum.reduceat(np.abs(flat).max(axis=1), mesh.starts[:-1])
    flat = flat / np.where(reach > 0, reach, 1.0)[mesh.face_of_corner][:, None]
    simple = np.ones(mesh.n_faces, bool)
    for n in np.unique(mesh.sides):
        faces = np.flatnonzero(mesh.sides == n)
        i, j = np.triu_indices(n, 2)
        keep = (j - i) % n != n - 1  # the first and the last edge are neighbours
        i, j = i[keep], j[keep]
        # Bounded memory: a face of n sides has about n²/2 pairs of edges.
        for part in np.array_split(faces, 1 + len(faces) * max(len(i), 1) // 1_000_000):
            polygon = flat[mesh.starts[part][:, None] + np.arange(n)]
            following = np.roll(polygon, -1, axis=1)
            beyond = np.roll(polygon, -2, axis=1)
            along, onward = following - polygon, beyond - following
            straight = _turn(polygon, following, beyond) == 0
            folded = straight & (np.einsum("fnk,fnk->fn", along, onward) <= 0)
            good = ~folded.any(axis=1)
            if len(i):
                apart = _apart(polygon[:, i], following[:, i], polygon[:, j], following[:, j])
                good &= apart.all(axis=1)
            simple[part] = good
    return simple

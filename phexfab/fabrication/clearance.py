"""The exact distance between solids, for given pairs.

Between polyhedra that do not meet, the least distance is that of two edges or of a corner and a
face. Boxes around edges and faces leave a few dozen candidates of some hundreds per pair.

References
----------
Ericson 2005, "Real-time collision detection", sec. 5.1.9.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from phexfab.fabrication.convex import Faces, by_topology, face_planes, solid_edges
from phexfab.fabrication.parts import Solid

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

CHUNK = 600_000  # pairs of edges held at once


def clearances(solids: Sequence[Solid], pairs: IntArray) -> FloatArray:
    """Return the (n,) least distances in mm between the surfaces of two solids; 0 where they cross.

    Parameters
    ----------
    solids : sequence of Solid
        Non-convex faces are taken as they are.
    pairs : (n, 2) int
        Which solids; what lies inside another one altogether is a matter for ``clashes``.
    """
    pairs = np.asarray(pairs, np.int64).reshape(-1, 2)
    groups = by_topology(solids)
    kind, row = np.zeros(len(solids), np.int64), np.zeros(len(solids), np.int64)
    for k, (index, _, _) in enumerate(groups):
        kind[index], row[index] = k, np.arange(len(index))
    least = np.zeros(len(pairs))
    both = kind[pairs]
    for k, m in np.unique(both, axis=0).tolist():
        chosen = np.flatnonzero((both[:, 0] == k) & (both[:, 1] == m))
        (_, first, faces), (_, second, others) = groups[k], groups[m]
        size = len(solid_edges(faces)) * len(solid_edges(others))
        for part in np.array_split(chosen, 1 + len(chosen) * size // CHUNK):
            a, b = first[row[pairs[part, 0]]], second[row[pairs[part, 1]]]
            # Near the origin, so that a shell far away loses no digits.
            middle = a.mean(axis=1, keepdims=True)
            least[part] = _distances(a - middle, faces, b - middle, others)
    return least


def segment_distances(p: FloatArray, q: FloatArray, r: FloatArray, s: FloatArray) -> FloatArray:
    """Return the (n,) distances between segments pq and rs in space, parallel ones too."""
    d, e, between = q - p, s - r, p - r
    dd, ee, de = (_dot(x, y) for x, y in ((d, d), (e, e), (d, e)))
    db, eb = _dot(d, between), _dot(e, between)
    det = dd * ee - de * de
    t = np.clip(_ratio(de * eb - db * ee, det), 0.0, 1.0)
    u = np.clip(_ratio(de * t + eb, ee), 0.0, 1.0)
    t = np.clip(_ratio(de * u - db, dd), 0.0, 1.0)
    return np.asarray(np.linalg.norm(between + t[:, None] * d - u[:, None] * e, axis=1))


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(np.einsum("ij,ij->i", a, b))


def _ratio(above: FloatArray, below: FloatArray) -> FloatArray:
    """Return the quotient; 0 where nothing stands below (parallel lines, a segment of a point)."""
    return np.divide(above, below, out=np.zeros_like(above), where=below > 0)


def _distances(a: FloatArray, faces: Faces, b: FloatArray, others: Faces) -> FloatArray:
    """Return (n,) distances between n solids of one topology and n of another."""
    one, two = solid_edges(faces), solid_edges(others)
    bound = np.sqrt(((a[:, :, None] - b[:, None]) ** 2).sum(axis=3).min(axis=(1, 2)))
    gap = _box_gaps(a[:, one], b[:, two])
    n, i, j = np.nonzero(gap <= (bound * bound)[:, None, None])
    p, q = a[n, one[i, 0]], a[n, one[i, 1]]
    r, s = b[n, two[j, 0]], b[n, two[j, 1]]
    np.minimum.at(bound, n, segment_distances(p, q, r, s))
    for points, edges, solid, sides in ((a, one, b, others), (b, two, a, faces)):
        _approach_faces(bound, points, edges, solid, sides)
    return bound


def _box_gaps(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the (n, i, j) squared distances between the boxes of (n, i, k, 3) and (n, j, k, 3)."""
    total = np.zeros((len(a), a.shape[1], b.shape[1]))
    for axis in range(3):
        low_a, high_a = a[..., axis].min(axis=2), a[..., axis].max(axis=2)
        low_b, high_b = b[..., axis].min(axis=2), b[..., axis].max(axis=2)
        gap = np.maximum(low_a[:, :, None] - high_b[:, None], low_b[:, None] - high_a[:, :, None])
        np.maximum(gap, 0.0, out=gap)
        total += gap * gap
    return total


def _approach_faces(
    bound: FloatArray, points: FloatArray, edges: IntArray, solid: FloatArray, faces: Faces
) -> None:
    """Lower the bounds where a corner stands over a face, and to 0 where an edge pierces one."""
    normals = face_planes(solid, faces)
    for k, face in enumerate(faces):
        ring, normal = solid[:, list(face)], normals[:, k]
        height = np.einsum("nvi,ni->nv", points - ring[:, :1], normal)
        near = np.abs(height) < bound[:, None]
        n, v = np.nonzero(near)
        over = _in_polygon(points[n, v], ring[n], normal[n])
        np.minimum.at(bound, n[over], np.abs(height[n[over], v[over]]))

        tail, head = height[:, edges[:, 0]], height[:, edges[:, 1]]
        n, e = np.nonzero(tail * head < 0)
        share = (tail[n, e] / (tail[n, e] - head[n, e]))[:, None]
        start, end = points[n, edges[e, 0]], points[n, edges[e, 1]]
        through = _in_polygon(start + share * (end - start), ring[n], normal[n])
        bound[n[through]] = 0.0


def _in_polygon(points: FloatArray, rings: FloatArray, normals: FloatArray) -> BoolArray:
    """Return (n,) True where a point, seen along the normal, lies in the polygon (n, k, 3)."""
    if not len(points):
        return np.zeros(0, bool)
    drop = np.abs(normals).argmax(axis=1)
    axes = np.array([[1, 2], [2, 0], [0, 1]])[drop]
    rows = np.arange(len(points))
    # Along the normal first: dropping an axis alone would look at the polygon from aslant.
    lift = np.einsum("ni,ni->n", points - rings[:, 0], normals)
    points = points - lift[:, None] * normals
    x, y = points[rows, axes[:, 0], None], points[rows, axes[:, 1], None]
    u, v = rings[rows, :, axes[:, 0]], rings[rows, :, axes[:, 1]]
    u_next, v_next = np.roll(u, -1, axis=1), np.roll(v, -1, axis=1)
    crosses = (v > y) != (v_next > y)
    rise = np.where(crosses, v_next - v, 1.0)
    right = x < u + (y - v) * (u_next - u) / rise
    return np.asarray((crosses & right).sum(axis=1) % 2 == 1)

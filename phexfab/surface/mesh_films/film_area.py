"""The area of the smooth film that a mesh stands for, and its distance from rims."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.surface.mesh_films.atlas import Atlas
from phexfab.surface.mesh_films.triangulated import edges_of
from phexfab.surface.rims.rim import Rim

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

# Dunavant's rule of degree 4 on the triangle: barycentric points and weights.
_A, _B = 0.445948490915965, 0.091576213509771
_NODES = np.array(
    [
        (_A, _A, 1 - 2 * _A),
        (_A, 1 - 2 * _A, _A),
        (1 - 2 * _A, _A, _A),
        (_B, _B, 1 - 2 * _B),
        (_B, 1 - 2 * _B, _B),
        (1 - 2 * _B, _B, _B),
    ]
)
_WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3)


def smooth_area(
    points: FloatArray,
    triangles: IntArray,
    atlas: Atlas,
    rims: tuple[Rim, ...] = (),
    rim_of: IntArray | None = None,
    parameter: FloatArray | None = None,
) -> float:
    """Return the area of the film, mm², from triangles curved to second degree.

    Middles of edges come from the normals at their ends, on rims from the rims; the error falls
    with the fourth power of the mesh width. A border without a rim is taken as straight, seen
    along the normal, between its vertices.
    """
    normals = atlas.surface.normal(atlas.parameter_of_vertex(np.arange(len(points))))
    edges = edges_of(triangles)
    a, b = edges.ends.T
    chord = points[b] - points[a]
    # The cubic with the chord's tangential parts as its ends' tangents.
    high, low = (chord * normals[b]).sum(1), (chord * normals[a]).sum(1)
    middle = 0.5 * (points[a] + points[b])
    middle += 0.125 * (high[:, None] * normals[b] - low[:, None] * normals[a])
    if rim_of is not None and parameter is not None:
        on = edges.border & (rim_of[a] >= 0) & (rim_of[a] == rim_of[b])
        for k, rim in enumerate(rims):
            mine = np.flatnonzero(on & (rim_of[a] == k))
            t0, t1 = parameter[a[mine]], parameter[b[mine]]
            turn = (t1 - t0 + 0.5) % 1.0 - 0.5
            middle[mine] = rim.point(t0 + 0.5 * turn)
    index = np.full(triangles.shape, -1, np.int64)
    for side in (0, 1):
        has = edges.sides[:, side] >= 0
        owner, tip = edges.sides[has, side], edges.tips[has, side]
        corner = (triangles[owner] == tip[:, None]).argmax(axis=1)
        index[owner, corner] = np.flatnonzero(has)  # the edge that faces a corner
    x, m = points[triangles], middle[index]
    total = np.zeros(len(triangles))
    for (p, q, r), weight in zip(_NODES, _WEIGHTS, strict=True):
        # Derivatives of the six shape functions by p and q, with r = 1 − p − q.
        along_p = (4 * p - 1) * x[:, 0] - (4 * r - 1) * x[:, 2]
        along_p += 4 * (q * m[:, 2] + (r - p) * m[:, 1] - q * m[:, 0])
        along_q = (4 * q - 1) * x[:, 1] - (4 * r - 1) * x[:, 2]
        along_q += 4 * (p * m[:, 2] + (r - q) * m[:, 0] - p * m[:, 1])
        total += 0.5 * weight * np.linalg.norm(np.cross(along_p, along_q), axis=1)
    return float(total.sum())


def heights_over(atlas: Atlas, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the signed heights (n,) of points over the film, mm, and the normals (n, 3) there.

    Each point is taken to the chart of the nearest vertex; beyond the border the film goes on by
    its charts.
    """
    _, vertex = cKDTree(atlas.charts.origin).query(points)
    z = atlas.parameter_near(points, vertex)
    normals = atlas.surface.normal(z)
    return ((points - atlas.surface.point(z)) * normals).sum(1), normals

"""Catmull–Clark subdivision: every face into quads, smooth in the limit.

References
----------
Catmull and Clark 1978, "Recursively generated B-spline surfaces on arbitrary topological meshes";
the border is subdivided as a cubic B-spline, corners of one face stay.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.mesh.measures import edges
from phexfab.mesh.polymesh import PolyMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def subdivided(mesh: PolyMesh) -> PolyMesh:
    """Return the mesh with a quad for every corner.

    Vertices come first, then those of edges in the order of ``edges``, then those of faces.
    """
    x, n = mesh.vertices, len(mesh.vertices)
    pairs = edges(mesh)
    owner = mesh.face_of_corner
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    key = pairs[:, 0] * n + pairs[:, 1]
    edge = np.searchsorted(key, np.minimum(tail, head) * n + np.maximum(tail, head))
    middle = np.add.reduceat(x[mesh.corners], mesh.starts[:-1]) / mesh.sides[:, None]
    share = np.bincount(edge, minlength=len(pairs))
    border = share == 1
    half = (x[pairs[:, 0]] + x[pairs[:, 1]]) / 2
    sides = _summed(edge, middle[owner], len(pairs)) / share[:, None]
    new_edges = np.where(border[:, None], half, (half + sides) / 2)

    valence = np.bincount(tail, minlength=n)
    around = np.maximum(valence, 1)[:, None]
    faces = _summed(tail, middle[owner], n) / around
    ends = pairs.ravel()
    degree = np.maximum(np.bincount(ends, minlength=n), 1)[:, None]
    halves = _summed(ends, np.repeat(half, 2, axis=0), n) / degree
    inside = (faces + 2 * halves + (around - 3) * x) / around
    # Along the border 1/8, 6/8, 1/8 of the neighbours there and the vertex.
    rim = pairs[border].ravel()
    on_rim = _summed(rim, np.repeat(half[border], 2, axis=0), n)
    along = (on_rim + 2 * x) / 4
    at_border = np.bincount(rim, minlength=n) > 0
    corner = at_border & (valence == 1)
    new = np.where(at_border[:, None], along, inside)
    new = np.where((corner | (valence == 0))[:, None], x, new)

    places = np.concatenate([new, new_edges, middle])
    quad = np.stack(
        [tail, n + edge, n + len(pairs) + owner, n + edge[mesh.previous_corner]], axis=1
    )
    return PolyMesh(places, quad.ravel(), np.arange(0, quad.size + 1, 4))


def _summed(index: IntArray, values: FloatArray, size: int) -> FloatArray:
    return np.stack([np.bincount(index, values[:, k], size) for k in range(3)], axis=1)

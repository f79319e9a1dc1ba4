"""Which face lies beyond each edge: the corners of a mesh as half-edges."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.mesh.polymesh import PolyMesh

IntArray = NDArray[np.int64]


def twins(mesh: PolyMesh) -> IntArray:
    """Return (C,) the corner whose edge runs back along the edge that leaves each corner.

    The edge of corner c runs from its vertex to that of ``mesh.next_corner[c]``. −1 on the border.
    Of an oriented manifold; where two faces have an edge in the same sense, either may be named.
    """
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    n = len(mesh.vertices)
    key, back = tail * n + head, head * n + tail
    order = np.argsort(key, kind="stable")
    if not len(order):
        return order
    found = order[np.minimum(np.searchsorted(key[order], back), len(order) - 1)]
    return np.where(key[found] == back, found, -1)


def border_loops(mesh: PolyMesh) -> list[IntArray]:
    """Return the vertices of every border, in the order of its faces' own corners.

    Of an oriented manifold: each border vertex has one border edge that leaves it.
    """
    start = np.flatnonzero(twins(mesh) < 0)
    onward = np.full(len(mesh.vertices), -1, np.int64)
    onward[mesh.corners[start]] = mesh.corners[mesh.next_corner[start]]
    unseen = onward >= 0
    following = onward.tolist()
    loops = []
    for first in mesh.corners[start].tolist():
        if not unseen[first]:
            continue
        loop = []
        now = first
        while now >= 0 and unseen[now]:
            unseen[now] = False
            loop.append(now)
            now = following[now]
        loops.append(np.array(loop, np.int64))
    return loops

"""From the stars of neighbours around points to triangles, and which of them to keep."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

IntArray = NDArray[np.int64]


def star_triangles(
    start: IntArray, goal: IntArray, sector: IntArray, valence: IntArray, n: int
) -> IntArray:
    """Return the triangles that all three of their corners see, their first edge along a row.

    Parameters
    ----------
    start, goal : (k,) int
        Points and neighbours of theirs.
    sector : (k,) int
        Which neighbour it is, counter-clockwise; 0, 3, 6 … lie in the point's row.
    valence : (n,) int
        How many neighbours each point has in the whole plane or cone.
    n : int
        Number of points.
    """
    begin = np.cumsum(valence) - valence
    near = np.full(int(valence.sum()), -1)
    near[begin[start] + sector] = goal
    point = np.repeat(np.arange(n), valence)
    place = np.arange(len(near)) - begin[point]
    following = begin[point] + (place + 1) % valence[point]
    there = (near >= 0) & (near[following] >= 0)
    p, q, r, kind = point[there], near[there], near[following[there]], place[there] % 3
    corners = np.stack([p, q, r], 1)
    # q lies in p's row, r and q share a row, or r lies in p's row.
    turn = np.array([[0, 1, 2], [1, 2, 0], [2, 0, 1]])[kind]
    corners = np.take_along_axis(corners, turn, 1)
    found, seen = np.unique(corners, axis=0, return_counts=True)
    return np.asarray(found[seen == 3])


def around_panels(triangles: IntArray, valence: IntArray, trim: bool = True) -> IntArray:
    """Return the triangles that touch a panel of the largest connected group of panels.

    Parameters
    ----------
    triangles : (t, 3) int
    valence : (n,) int
        How many triangles close the ring around each point: six but at apices.
    trim : bool
        Leave out panels beside an apex whose own panel the border cuts off: its wide plane trims
        them askew. What is cut along a rim later keeps them, to reach beyond it.
    """
    n = len(valence)
    panel = np.bincount(triangles.ravel(), minlength=n) == valence
    if trim:
        cut_off = (valence != 6) & ~panel
        panel[triangles[cut_off[triangles].any(1)]] = False
    a, b = triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
    both = panel[a] & panel[b]
    graph = sp.coo_matrix((np.ones(int(both.sum())), (a[both], b[both])), shape=(n, n))
    _, group = connected_components(graph, directed=False)
    if panel.any():
        panel &= group == np.bincount(group[panel]).argmax()
    return np.asarray(triangles[panel[triangles].any(1)])

"""Triangle meshes under work: borders, Delaunay flips, and vertices evened out in the surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import MeshError
from phexfab.surface.mesh_films.area import gather

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Edges:
    """The edges of an oriented triangle mesh.

    Attributes
    ----------
    ends : (e, 2) int
        In the direction of the first triangle.
    sides : (e, 2) int
        The triangle that runs along the edge and the one that runs against it; -1 at a border.
    tips : (e, 2) int
        The corners of those triangles that are not on the edge; -1 at a border.
    """

    ends: IntArray
    sides: IntArray
    tips: IntArray

    @property
    def border(self) -> BoolArray:
        """(e,) True at border edges."""
        return self.sides[:, 1] < 0


def edges_of(triangles: IntArray, points: FloatArray | None = None) -> Edges:
    """Return the edges of a triangle mesh.

    Parameters
    ----------
    triangles : (m, 3) int
    points : (n, 3) float, optional
        Only for the message.

    Raises
    ------
    MeshError
        If more than two triangles meet at an edge or two run along it in the same direction; the
        message counts the edges and names the first.
    """
    m = len(triangles)
    tail = triangles.ravel()
    head = triangles[:, [1, 2, 0]].ravel()
    tip = triangles[:, [2, 0, 1]].ravel()
    owner = np.repeat(np.arange(m), 3)
    n = int(triangles.max(initial=0)) + 1
    key = tail * n + head
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    twice = np.flatnonzero(ordered[1:] == ordered[:-1])
    if len(twice):
        first = order[twice[0]]
        where = "" if points is None else f" at {points[tail[first]].round(3).tolist()}"
        raise MeshError(
            f"{len(twice)} edges have two triangles on the same side, first the edge of vertices "
            f"{tail[first]} and {head[first]}{where}: three sheets meet there or neighbours are "
            "oriented against each other; make the mesh a manifold and orient it"
        )
    place = np.searchsorted(ordered, head * n + tail)
    place = np.minimum(place, len(ordered) - 1)
    twin = np.where(ordered[place] == head * n + tail, order[place], -1)
    keep = (twin < 0) | (tail < head)
    other = twin[keep]
    return Edges(
        np.column_stack([tail[keep], head[keep]]),
        np.column_stack([owner[keep], np.where(other >= 0, owner[other], -1)]),
        np.column_stack([tip[keep], np.where(other >= 0, tip[other], -1)]),
    )


def border_loops(triangles: IntArray, points: FloatArray | None = None) -> list[IntArray]:
    """Return the closed border curves as vertex indices, in the direction of their triangles.

    Raises
    ------
    MeshError
        If two border curves touch at a vertex.
    """
    edges = edges_of(triangles, points)
    ends = edges.ends[edges.border]
    tails, counts = np.unique(ends[:, 0], return_counts=True)
    if len(tails) and counts.max() > 1:
        v = tails[counts.argmax()]
        where = "" if points is None else f" at {points[v].round(3).tolist()}"
        raise MeshError(f"the border touches itself at vertex {v}{where}; part the mesh there")
    following = dict(zip(ends[:, 0].tolist(), ends[:, 1].tolist(), strict=True))
    loops = []
    while following:
        start, now = following.popitem()
        loop = [start]
        while now != start:
            loop.append(now)
            now = following.pop(now)
        low = loop.index(min(loop))
        loops.append(np.array(loop[low:] + loop[:low], np.int64))
    return sorted(loops, key=lambda loop: int(loop[0]))


def flip_to_delaunay(points: FloatArray, triangles: IntArray, rounds: int = 40) -> IntArray:
    """Return triangles after flips of the edges whose opposite angles add up to more than 180°.

    A flip that would fold the surface by more than a right angle, or double an edge, is left out.
    """
    triangles = triangles.copy()
    for _ in range(rounds):
        edges = edges_of(triangles)
        inner = np.flatnonzero(~edges.border)
        a, b = edges.ends[inner].T
        c, d = edges.tips[inner].T
        pa, pb, pc, pd = points[a], points[b], points[c], points[d]
        angle = _angle(pa - pc, pb - pc) + _angle(pa - pd, pb - pd)
        wish = angle > np.pi + 1e-9
        if not wish.any():
            break
        # The new triangles (c, a, d) and (d, b, c) must look the way of the old ones.
        old = np.cross(pb - pa, pc - pa) + np.cross(pa - pb, pd - pb)
        one, two = np.cross(pa - pc, pd - pc), np.cross(pb - pd, pc - pd)
        wish &= ((one * old).sum(1) > 0) & ((two * old).sum(1) > 0) & ((one * two).sum(1) > 0)
        n = len(points)
        known = np.sort(np.minimum(*edges.ends.T) * n + np.maximum(*edges.ends.T))
        fresh = np.minimum(c, d) * n + np.maximum(c, d)
        at = np.minimum(np.searchsorted(known, fresh), len(known) - 1)
        wish &= known[at] != fresh
        pick = np.flatnonzero(wish)
        if not len(pick):
            break
        pick = pick[np.argsort(-angle[pick], kind="stable")]
        rank = np.full(len(triangles), len(pick))
        owner = edges.sides[inner[pick]]
        np.minimum.at(rank, owner, np.arange(len(pick))[:, None])
        # Independent flips only: an edge goes when it is the worst of both its triangles, and of
        # the new edge too, which two flips might otherwise make at once.
        free = (rank[owner] == np.arange(len(pick))[:, None]).all(axis=1)
        _, first = np.unique(fresh[pick], return_index=True)
        once = np.zeros(len(pick), bool)
        once[first] = True
        go = pick[free & once]
        left, right = edges.sides[inner[go]].T
        triangles[left] = np.column_stack([c[go], a[go], d[go]])
        triangles[right] = np.column_stack([d[go], b[go], c[go]])
    return triangles


def _angle(u: FloatArray, v: FloatArray) -> FloatArray:
    return np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), (u * v).sum(1))


def evened(points: FloatArray, triangles: IntArray, normals: FloatArray) -> FloatArray:
    """Return points moved in their tangent planes to the centroids of their triangles.

    Each triangle counts by its area, which evens out sizes too.
    """
    corner = points[triangles]
    area = np.linalg.norm(
        np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1
    )
    pull = corner.mean(axis=1) * area[:, None]
    n = len(points)
    total = gather(np.repeat(pull[:, None], 3, axis=1), triangles, n)
    heft = gather(np.repeat(area[:, None], 3, axis=1), triangles, n)
    step = total / np.where(heft > 0, heft, 1.0)[:, None] - points
    return points + step - normals * (normals * step).sum(1, keepdims=True)

"""Curvature lines on a triangle mesh: the square root of the Hopf differential, edge by edge.

Every vertex carries ``Q = κ·conj(d)²``, d the u-line's direction as a complex number. Along an
edge Q is taken linear and its root integrated in closed form, so each triangle knows the three
differences of w = u + iv = ∫√Q, up to one common sign; ``|dw| = √κ ds``, in √mm.

References
----------
Ray, Vallet, Li, Lévy 2008, "N-symmetry direction field design" (indices from edge rotations).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import MeshError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]

NEXT = np.array([1, 2, 0])


@dataclass(frozen=True, eq=False)
class HalfEdges:
    """Half-edges of an oriented mesh; number 3t + i runs from corner i of triangle t to i + 1.

    Attributes
    ----------
    tail, head : (3m,) int
        Vertices.
    twin : (3m,) int
        The half-edge on the other side, −1 on the border.
    edge : (3m,) int
        Undirected edge, and ``along`` (3m,) ±1: whether it runs from its lower vertex.
    ends : (e, 2) int
        Vertices of the edges, the lower first.
    """

    tail: IntArray
    head: IntArray
    twin: IntArray
    edge: IntArray
    along: IntArray
    ends: IntArray


def half_edges(triangles: IntArray, n_points: int) -> HalfEdges:
    """Return the half-edges of an oriented manifold mesh.

    Raises
    ------
    MeshError
        If two triangles share a directed edge.
    """
    tail, head = triangles.ravel(), triangles[:, NEXT].ravel()
    key = tail * n_points + head
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    same = np.flatnonzero(ordered[1:] == ordered[:-1])
    if len(same):
        a, b = divmod(int(ordered[same[0]]), n_points)
        raise MeshError(
            f"two triangles run along the edge from vertex {a} to {b}: the mesh is not an "
            "oriented manifold; orient its triangles alike and remove doubled ones"
        )
    back = head * n_points + tail
    slot = np.minimum(np.searchsorted(ordered, back), len(ordered) - 1)
    twin = np.where(ordered[slot] == back, order[slot], -1)
    lower, upper = np.minimum(tail, head), np.maximum(tail, head)
    keys, edge = np.unique(lower * n_points + upper, return_inverse=True)
    ends = np.column_stack(np.divmod(keys, n_points))
    return HalfEdges(tail, head, twin, edge.reshape(-1), np.where(tail < head, 1, -1), ends)


@dataclass(frozen=True, eq=False)
class LineField:
    """Principal directions and curvature on a triangle mesh.

    Attributes
    ----------
    points : (n, 3), mm
    triangles : (m, 3) int
        Counter-clockwise about the normals.
    normals : (n, 3)
        Unit vectors.
    directions : (n, 3)
        Unit tangents of the u-line (curvature −κ); their sign does not matter.
    curvatures : (n,)
        κ >= 0, 1/mm.
    cones : (c,) int
        Vertices that are umbilics, and ``orders`` (c,), the orders of Q's zeros there.
    parents : (m,) int
        Triangle of the mesh given of which this one is a part, and ``corners`` (m, 3, 3): the
        barycentric coordinates there of its three corners.
    moved : (m,) int
        Vertex of the triangle that was moved onto an umbilic, −1: then the triangle's points lie
        in one of those that the vertex had (see `patchwork.located`).
    """

    points: FloatArray
    triangles: IntArray
    normals: FloatArray
    directions: FloatArray
    curvatures: FloatArray
    cones: IntArray
    orders: IntArray
    parents: IntArray
    corners: FloatArray
    moved: IntArray

    @cached_property
    def half(self) -> HalfEdges:
        return half_edges(self.triangles, len(self.points))

    @cached_property
    def cone_order(self) -> IntArray:
        """(n,) order of the umbilic at each vertex, 0 where there is none."""
        order = np.zeros(len(self.points), np.int64)
        order[self.cones] = self.orders
        return order

    @cached_property
    def is_cone(self) -> NDArray[np.bool_]:
        flag = np.zeros(len(self.points), bool)
        flag[self.cones] = True
        return flag

    @cached_property
    def on_border(self) -> NDArray[np.bool_]:
        """(n,) vertices on the border."""
        flag = np.zeros(len(self.points), bool)
        flag[self.half.tail[self.half.twin < 0]] = True
        return flag

    @cached_property
    def lengths(self) -> FloatArray:
        """(e,) lengths of the edges, mm."""
        a, b = self.half.ends.T
        return np.asarray(np.linalg.norm(self.points[b] - self.points[a], axis=1))

    @cached_property
    def cotangents(self) -> FloatArray:
        """(m, 3) cotangents of the angles opposite to the half-edges."""
        side = self.points[self.triangles[:, NEXT]] - self.points[self.triangles]
        before, after = np.roll(side, -1, axis=1), np.roll(side, 1, axis=1)
        cross = np.linalg.norm(np.cross(before, after), axis=2)
        return -np.einsum("tik,tik->ti", before, after) / np.maximum(cross, 1e-300)

    @cached_property
    def areas(self) -> FloatArray:
        """(m,) areas of the triangles, mm²."""
        a, b, c = (self.points[self.triangles[:, k]] for k in range(3))
        return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)

    @cached_property
    def phases(self) -> ComplexArray:
        """(2, e) phase of Q at both ends of every edge, measured from the edge's direction."""
        a, b = self.half.ends.T
        along = self.points[b] - self.points[a]
        found = []
        for v in (a, b):
            n, d = self.normals[v], self.directions[v]
            flat = along - np.einsum("ij,ij->i", along, n)[:, None] * n
            sine = np.einsum("ij,ij->i", n, np.cross(flat, d))
            turned = np.einsum("ij,ij->i", flat, d) - 1j * sine
            found.append((turned / np.maximum(np.abs(turned), 1e-300)) ** 2)
        return np.stack(found)

    @cached_property
    def rotation(self) -> FloatArray:
        """(e,) angle in (−π, π] by which Q turns along every edge."""
        return np.asarray(np.angle(self.phases[1] * self.phases[0].conj()))

    @cached_property
    def roots(self) -> ComplexArray:
        """(2, e) √Q at both ends of every edge, the same branch; 0 at an umbilic."""
        start, end = self.curvatures[self.half.ends.T]
        first = np.sqrt(self.phases[0])
        cone = self.is_cone[self.half.ends.T]
        return np.stack(
            [
                np.where(cone[0], 0.0, np.sqrt(start)) * first,
                np.where(cone[1], 0.0, np.sqrt(end))
                * np.where(cone[0], np.sqrt(self.phases[1]), first * np.exp(0.5j * self.rotation)),
            ]
        )

    @cached_property
    def turns(self) -> FloatArray:
        """(m, 3) angle from the edge that enters each corner to the one that leaves it."""
        side = self.points[self.triangles[:, NEXT]] - self.points[self.triangles]
        enter, n = np.roll(side, 1, axis=1), self.normals[self.triangles]
        enter, leave = (s - np.einsum("tik,tik->ti", s, n)[..., None] * n for s in (enter, side))
        sine = np.einsum("tik,tik->ti", n, np.cross(enter, leave))
        return np.asarray(np.arctan2(sine, np.einsum("tik,tik->ti", enter, leave)))

    @cached_property
    def indices(self) -> IntArray:
        """(m,) how often Q winds around zero inside each triangle."""
        half = self.half
        around = (self.rotation[half.edge] * half.along).reshape(-1, 3).sum(axis=1)
        winds = (around + 2 * self.turns.sum(axis=1)) / (2 * np.pi) - 2
        return np.rint(winds).astype(np.int64)

    @cached_property
    def edge_steps(self) -> ComplexArray:
        """(e,) differences ∫√Q along the edges, each up to its sign."""
        root, onward = self.roots
        total = root + onward
        mean = (2 / 3) * np.divide(
            root**2 + root * onward + onward**2,
            total,
            out=np.zeros_like(total),
            where=np.abs(total) > 0,
        )
        # Along an edge that leaves an umbilic Q grows with a power of the distance.
        for v, other in zip(self.half.ends.T, (onward, root), strict=True):
            mean = np.where(self.is_cone[v], 2 / (self.cone_order[v] + 2) * other, mean)
        return np.asarray(mean * self.lengths)

    @cached_property
    def signs(self) -> IntArray:
        """(3m,) sign of every half-edge's step within its triangle, its edge's direction aside."""
        half = self.half
        root, onward = self.roots
        ahead = half.along > 0
        tail = (np.where(ahead, root[half.edge], onward[half.edge]) * half.along).reshape(-1, 3)
        head = (np.where(ahead, onward[half.edge], root[half.edge]) * half.along).reshape(-1, 3)
        # Begin at the umbilic where there is one: roots are compared at the other two corners.
        cone = self.is_cone[self.triangles]
        first = np.where(cone.any(axis=1), cone.argmax(axis=1), 0)
        row = np.arange(len(first))
        signs = np.ones((len(first), 3), np.int64)
        for k in range(2):
            here, there = (first + k) % 3, (first + k + 1) % 3
            turned = head[row, here] * np.exp(1j * self.turns[row, there])
            same = (tail[row, there] * turned.conj()).real >= 0
            signs[row, there] = signs[row, here] * np.where(same, 1, -1)
        return signs.ravel()

    @cached_property
    def steps(self) -> ComplexArray:
        """(m, 3) differences of w along each triangle's half-edges; they add up to zero."""
        half = self.half
        raw = (self.signs * half.along * self.edge_steps[half.edge]).reshape(-1, 3)
        return np.asarray(raw - raw.mean(axis=1, keepdims=True))


def line_field(
    points: ArrayLike,
    triangles: ArrayLike,
    normals: ArrayLike,
    directions: ArrayLike,
    curvatures: ArrayLike,
) -> LineField:
    """Return the line field of a mesh, its umbilics not yet looked for.

    Parameters
    ----------
    points : (n, 3), mm
    triangles : (m, 3) int
        Counter-clockwise about the normals, connected.
    normals, directions : (n, 3)
        Unit normals; tangents of the u-line, of any sign.
    curvatures : (n,)
        κ >= 0 in 1/mm.

    Raises
    ------
    MeshError
        If arrays do not fit each other, are not finite, or triangles and normals disagree.
    """
    x, n = np.array(points, float), np.array(normals, float)
    d, kappa = np.array(directions, float), np.array(curvatures, float)
    tri = np.array(triangles, np.int64)
    if x.ndim != 2 or x.shape[1] != 3 or n.shape != x.shape or d.shape != x.shape:
        raise MeshError(
            f"points {x.shape}, normals {n.shape} and directions {d.shape} must all be (n, 3)"
        )
    if kappa.shape != (len(x),) or tri.ndim != 2 or tri.shape[1] != 3 or not len(tri):
        raise MeshError(
            f"{len(x)} points ask for as many curvatures and (m, 3) triangles, not for "
            f"{kappa.shape} and {tri.shape}"
        )
    if tri.min() < 0 or tri.max() >= len(x):
        raise MeshError(f"triangles name vertices up to {tri.max()}, the mesh has {len(x)}")
    broken = ~(np.isfinite(x).all(1) & np.isfinite(n).all(1) & np.isfinite(kappa) & (kappa >= 0))
    if broken.any():
        raise MeshError(
            f"vertex {int(broken.argmax())} has a point, normal or curvature that is not a number "
            "(curvatures are >= 0)"
        )
    n /= np.maximum(np.linalg.norm(n, axis=1), 1e-300)[:, None]
    d = tangent(np.where(np.isfinite(d), d, 0.0), n)
    a, b, c = (x[tri[:, k]] for k in range(3))
    facing = np.einsum("ij,ij->i", np.cross(b - a, c - a), n[tri].sum(axis=1))
    if not (facing > 0).all():
        bad = int(facing.argmin())
        raise MeshError(
            f"triangle {bad} at {np.round(a[bad], 1).tolist()} has no area or is turned against "
            "the normals: reverse the triangles or the normals, or mend the mesh there"
        )
    none = np.zeros(0, np.int64)
    corners = np.broadcast_to(np.eye(3), (len(tri), 3, 3))
    return LineField(
        x, tri, n, d, kappa, none, none, np.arange(len(tri)), corners, np.full(len(tri), -1)
    )


def tangent(vectors: FloatArray, normals: FloatArray) -> FloatArray:
    """Return (n, 3) unit vectors: the parts across the normals; any tangent where there is none."""
    flat = vectors - np.einsum("ij,ij->i", vectors, normals)[:, None] * normals
    size = np.linalg.norm(flat, axis=1)
    lost = size < 1e-9
    if lost.any():
        axis = np.eye(3)[np.abs(normals[lost]).argmin(axis=1)]
        flat[lost] = np.cross(normals[lost], axis)
        size[lost] = np.linalg.norm(flat[lost], axis=1)
    return np.asarray(flat / size[:, None])


def triangle_frames(
    field: LineField, rows: IntArray | slice = slice(None)
) -> tuple[FloatArray, FloatArray]:
    """Return two (k, 3) arrays: unit vectors along each triangle's first side and across it."""
    a, b, c = (field.points[field.triangles[rows, k]] for k in range(3))
    normal = np.cross(b - a, c - a)
    first = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
    return first, np.cross(normal / np.linalg.norm(normal, axis=1)[:, None], first)


def chart_hopf(
    field: LineField, vertices: IntArray, first: FloatArray, second: FloatArray
) -> ComplexArray:
    """Return Q at vertices in the frame (first, second), the directions projected onto it."""
    d = field.directions[vertices]
    flat = (d * first).sum(-1) - 1j * (d * second).sum(-1)
    return np.asarray(field.curvatures[vertices] * (flat / np.abs(flat)) ** 2)

"""A mesh that is changed around umbilics, every piece knowing where it came from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from phexfab.remesh.mesh_lattices.line_field import LineField, tangent
from phexfab.remesh.mesh_lattices.local_hopf import LocalHopf

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_WEDGE = np.radians(100)  # angle in w that a triangle at an umbilic may have there
_ROUNDS = 5  # of halving such triangles


class Patchwork:
    """Moves vertices onto umbilics and splits triangles there."""

    def __init__(self, field: LineField) -> None:
        self.given = field
        self.points = list(field.points)
        self.normals = list(field.normals)
        self.directions = list(field.directions)
        self.curvatures = list(field.curvatures)
        self.triangles: list[list[int]] = field.triangles.tolist()
        # Parent, corners in it, vertex that was moved in it (−1: none).
        self.pieces: list[tuple[int, FloatArray, int]] = [
            (int(p), c, int(v))
            for p, c, v in zip(field.parents, field.corners, field.moved, strict=True)
        ]
        self.orders: dict[int, int] = {}
        self.around: dict[int, set[int]] = {v: set() for v in range(len(self.points))}
        for t, triangle in enumerate(self.triangles):
            for v in triangle:
                self.around[v].add(t)

    def replace(self, local: LocalHopf) -> None:
        """Put the fitted Q in place of the one given."""
        lines = tangent(local.lines(local.hopf), self.given.normals[local.vertices])
        for v, line, size in zip(local.vertices.tolist(), lines, np.abs(local.hopf), strict=True):
            self.directions[v], self.curvatures[v] = line, float(size)

    def insert(self, local: LocalHopf) -> None:
        """Make an umbilic a vertex: move one onto it, or where none can be, split its triangle."""
        place = local.place
        t, weight = self._locate(place, local.vertices[:12].tolist())
        cone = -1
        for k in np.argsort(-weight, kind="stable").tolist():
            if self._move(self.triangles[t][k], place, t, weight):
                cone = self.triangles[t][k]
                break
        if cone < 0:
            weight = np.clip(weight, 0.05, None)
            cone = self._split(t, weight / weight.sum())
        self.orders[cone] = local.order
        for _ in range(_ROUNDS):
            if not self._open_up(cone, local):
                break

    def _locate(self, place: FloatArray, vertices: list[int]) -> tuple[int, FloatArray]:
        """Return the triangle at some of these vertices that holds a place, and where in it."""
        near = sorted({t for v in vertices for t in self.around[v]})
        corners = np.array([[self.points[v] for v in self.triangles[t]] for t in near])
        weight = nearest_weights(corners, place)
        best = int(weight.min(axis=1).argmax())
        clipped = np.clip(weight[best], 0.0, None)
        return near[best], clipped / clipped.sum()

    def _move(self, v: int, place: FloatArray, t: int, weight: FloatArray) -> bool:
        """Move a vertex to a place in triangle t; tell whether it may be moved there."""
        if v in self.orders or v >= len(self.given.points) or self.given.on_border[v]:
            return False
        sides = []
        for s in self.around[v]:
            triangle = self.triangles[s]
            k = triangle.index(v)
            a, b = (self.points[triangle[(k + j) % 3]] for j in (1, 2))
            normal = np.cross(a - self.points[v], b - self.points[v])
            area = float(np.cross(a - place, b - place) @ normal) / float(normal @ normal)
            sides.append(area)
        if min(sides) < 0.1:
            return False
        ring = self.triangles[t]
        self.points[v] = weight @ np.array([self.points[u] for u in ring])
        normal = weight @ np.array([self.normals[u] for u in ring])
        self.normals[v] = normal / np.linalg.norm(normal)
        self.curvatures[v] = 0.0
        self.directions[v] = tangent(self.directions[v][None], self.normals[v][None])[0]
        for s in self.around[v]:
            parent, corners, _ = self.pieces[s]
            self.pieces[s] = parent, corners, v
        return True

    def _add(self, place: FloatArray, normal: FloatArray) -> int:
        unit = normal / np.linalg.norm(normal)
        self.points.append(place)
        self.normals.append(unit)
        self.directions.append(tangent(np.zeros((1, 3)), unit[None])[0])
        self.curvatures.append(0.0)
        self.around[len(self.points) - 1] = set()
        return len(self.points) - 1

    def _put(self, t: int, triangle: list[int], piece: tuple[int, FloatArray, int]) -> None:
        if t < len(self.triangles):
            for v in self.triangles[t]:
                self.around[v].discard(t)
            self.triangles[t], self.pieces[t] = triangle, piece
        else:
            self.triangles.append(triangle)
            self.pieces.append(piece)
        for v in triangle:
            self.around[v].add(t)

    def _split(self, t: int, weight: FloatArray) -> int:
        triangle, (parent, corners, moved) = self.triangles[t], self.pieces[t]
        place = weight @ np.array([self.points[v] for v in triangle])
        new = self._add(place, weight @ np.array([self.normals[v] for v in triangle]))
        middle = weight @ corners
        for k in range(3):
            j = (k + 1) % 3
            piece = parent, np.stack([middle, corners[k], corners[j]]), moved
            at = t if k == 0 else len(self.triangles)
            self._put(at, [new, triangle[k], triangle[j]], piece)
        return new

    def _open_up(self, cone: int, local: LocalHopf) -> bool:
        """Halve the triangles at an umbilic across which w turns too far; tell if any was."""
        split = False
        for t in sorted(self.around[cone]):
            triangle = self.triangles[t]
            k = triangle.index(cone)
            a, b = triangle[(k + 1) % 3], triangle[(k + 2) % 3]
            p, q = (self.points[v] - self.points[cone] for v in (a, b))
            angle = float(np.arctan2(np.linalg.norm(np.cross(p, q)), p @ q))
            if (local.order + 2) / 2 * angle <= _WEDGE:
                continue
            split = True
            middle = (self.points[a] + self.points[b]) / 2
            new = self._add(middle, self.normals[a] + self.normals[b])
            hopf = local.value(middle[None])
            self.curvatures[new] = float(np.abs(hopf[0]))
            self.directions[new] = tangent(local.lines(hopf), self.normals[new][None])[0]
            for old in sorted(self.around[a] & self.around[b]):
                ring, (parent, corners, moved) = self.triangles[old], self.pieces[old]
                i = next(i for i in range(3) if ring[i] not in (a, b))
                x, y, z = (ring[(i + j) % 3] for j in range(3))
                cx, cy, cz = (corners[(i + j) % 3] for j in range(3))
                mean = (cy + cz) / 2
                self._put(old, [x, y, new], (parent, np.stack([cx, cy, mean]), moved))
                piece = parent, np.stack([cx, mean, cz]), moved
                self._put(len(self.triangles), [x, new, z], piece)
        return split

    def field(self) -> LineField:
        """Return the line field on the mesh as it is now."""
        cones = sorted(self.orders)
        return replace(
            self.given,
            points=np.array(self.points),
            triangles=np.array(self.triangles, np.int64),
            normals=np.array(self.normals),
            directions=np.array(self.directions),
            curvatures=np.array(self.curvatures),
            cones=np.array(cones, np.int64),
            orders=np.array([self.orders[v] for v in cones], np.int64),
            parents=np.array([piece[0] for piece in self.pieces], np.int64),
            corners=np.array([piece[1] for piece in self.pieces]),
            moved=np.array([piece[2] for piece in self.pieces], np.int64),
        )


def nearest_weights(corners: FloatArray, place: FloatArray) -> FloatArray:
    """Return (k, 3) barycentric coordinates of a point's foot in the planes of k triangles.

    Parameters
    ----------
    corners : (k, 3, 3)
    place : (3,)
    """
    a, along, across = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    off = place - a
    normal = np.cross(along, across)
    square = np.einsum("ki,ki->k", normal, normal)
    second = np.einsum("ki,ki->k", np.cross(off, across), normal) / square
    third = np.einsum("ki,ki->k", np.cross(along, off), normal) / square
    return np.stack([1 - second - third, second, third], axis=1)


def located(
    field: LineField, given: LineField, face: IntArray, weight: FloatArray
) -> tuple[IntArray, FloatArray]:
    """Return triangles and barycentric coordinates in the mesh given of points on the changed one.

    Parameters
    ----------
    field, given : LineField
        The changed mesh, and the one it was made from.
    face : (k,) int
        Triangles of the changed mesh, and ``weight`` (k, 3), where in them the points lie.
    """
    parent = field.parents[face]
    bary = np.einsum("fk,fkj->fj", weight, field.corners[face])
    moved = field.moved[face]
    for k in np.flatnonzero(moved >= 0).tolist():
        star = np.flatnonzero((given.triangles == moved[k]).any(axis=1))
        place = weight[k] @ field.points[field.triangles[face[k]]]
        inside = nearest_weights(given.points[given.triangles[star]], place)
        best = int(inside.min(axis=1).argmax())
        clipped = np.clip(inside[best], 0.0, None)
        parent[k], bary[k] = star[best], clipped / clipped.sum()
    return parent, bary

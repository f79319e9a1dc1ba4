"""Nearest points on what a mesh is to stay close to: minimal or free-form, or another mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, cast, runtime_checkable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.errors import MeshError
from phexfab.mesh.measures import area_vectors
from phexfab.mesh.polymesh import PolyMesh
from phexfab.surface.freeform.surface import FreeformSurface
from phexfab.surface.weierstrass import MinimalSurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_GRID = 65  # samples a side from which feet on a smooth surface are sought
_FEW = 8  # triangles looked at first


@runtime_checkable
class Reference(Protocol):
    """Anything that knows its nearest points."""

    def nearest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the points (n, 3) nearest to points (n, 3), mm, and the unit normals there."""
        ...


def as_reference(
    surface: Reference | PolyMesh | MinimalSurface | FreeformSurface,
) -> Reference:
    """Return a surface or mesh as something with nearest points.

    Raises
    ------
    MeshError
        If it is none of them, or a mesh without faces.
    """
    if isinstance(surface, PolyMesh):
        return MeshReference(surface)
    if isinstance(surface, MinimalSurface):
        return SurfaceReference(surface)
    # A free-form surface, too, has ``nearest``; but it gives parameters.
    if all(hasattr(surface, name) for name in ("nearest", "point", "normal", "bending")):
        return FreeformReference(cast(FreeformSurface, surface))
    if isinstance(surface, Reference):
        return surface
    raise MeshError(
        f"reference = {type(surface).__name__}: a mesh, a smooth surface, or something with "
        "nearest(points) -> (points, normals) is needed"
    )


class SurfaceReference:
    """A smooth minimal surface; feet are sought from the nearest sample of its rectangle."""

    def __init__(self, surface: MinimalSurface) -> None:
        u0, u1, v0, v1 = surface.rectangle
        u, v = np.meshgrid(np.linspace(u0, u1, _GRID), np.linspace(v0, v1, _GRID))
        self._surface = surface
        self._z = surface.parameter((u + 1j * v).ravel())
        self._tree = cKDTree(surface.point(self._z))

    def nearest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return feet (n, 3), mm, and normals."""
        guess = self._z[self._tree.query(points)[1]]
        z = self._surface.closest_parameter(points, guess)
        return self._surface.point(z), self._surface.normal(z)


@dataclass(frozen=True, eq=False)
class FreeformReference:
    """A free-form surface: parametric, NURBS, implicit or through a mesh."""

    surface: FreeformSurface

    def nearest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return feet (n, 3), mm, and normals."""
        u = self.surface.nearest(points)
        return self.surface.point(u), self.surface.normal(u)


@dataclass(frozen=True, eq=False)
class _Triangles:
    corners: FloatArray  # (m, 3, 3)
    normals: FloatArray  # (m, 3)


class MeshReference:
    """A mesh; faces of more than three corners count as fans about their mean corner."""

    def __init__(self, mesh: PolyMesh) -> None:
        if not mesh.n_faces:
            raise MeshError("the reference mesh has no face")
        points = mesh.vertices[mesh.corners]
        middle = np.add.reduceat(points, mesh.starts[:-1]) / mesh.sides[:, None]
        fan = np.stack([points, points[mesh.next_corner], middle[mesh.face_of_corner]], 1)
        three = mesh.sides[mesh.face_of_corner] == 3
        first = mesh.starts[:-1][mesh.sides == 3][:, None] + np.arange(3)
        corners = np.concatenate([fan[~three], points[first]])
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        area = area_vectors(mesh)
        owner = np.concatenate([mesh.face_of_corner[~three], np.flatnonzero(mesh.sides == 3)])
        # A fan's triangles may be degenerate: they have their face's normal then.
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        normal = np.where(size > 1e-12 * size.max(), normal, area[owner])
        size = np.linalg.norm(normal, axis=1, keepdims=True)
        keep = size[:, 0] > 0
        self._triangles = _Triangles(corners[keep], normal[keep] / size[keep])
        centres = corners[keep].mean(axis=1)
        self._tree = cKDTree(centres)
        self._reach = float(np.linalg.norm(corners[keep] - centres[:, None], axis=2).max())

    def nearest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return feet (n, 3), mm, and normals of their triangles."""
        n, count = len(points), len(self._triangles.corners)
        feet, best = np.zeros((n, 3)), np.full(n, np.inf)
        which = np.zeros(n, np.int64)
        todo, few = np.arange(n), min(_FEW, count)
        while len(todo):
            away, index = self._tree.query(points[todo], few)
            away, index = away.reshape(len(todo), few), index.reshape(len(todo), few)
            foot = _feet(points[todo][:, None], self._triangles.corners[index])
            gap = np.linalg.norm(foot - points[todo][:, None], axis=2)
            pick = gap.argmin(axis=1)
            row = np.arange(len(todo))
            feet[todo], best[todo] = foot[row, pick], gap[row, pick]
            which[todo] = index[row, pick]
            # Nothing nearer is left once the next centre is farther than a triangle reaches.
            todo = todo[away[:, -1] - self._reach < best[todo]] if few < count else todo[:0]
            few = min(4 * few, count)
        return feet, self._triangles.normals[which]


def _feet(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return the nearest points of triangles (…, 3, 3) to points (…, 3)."""
    a, b, c = (corners[..., k, :] for k in range(3))
    normal = np.cross(b - a, c - a)
    square = np.einsum("...i,...i->...", normal, normal)
    off = np.einsum("...i,...i->...", points - a, normal)
    share = np.divide(off, square, out=np.zeros(off.shape), where=square > 0)
    best = points - share[..., None] * normal
    inside = square > 0
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("...i,...i->...", np.cross(q - p, best - p), normal) >= 0
    gap = np.where(inside, np.linalg.norm(best - points, axis=-1), np.inf)
    for p, q in ((a, b), (b, c), (c, a)):
        edge = q - p
        length = np.einsum("...i,...i->...", edge, edge)
        along = np.einsum("...i,...i->...", points - p, edge)
        t = np.clip(np.divide(along, length, out=np.zeros(along.shape), where=length > 0), 0, 1)
        foot = p + t[..., None] * edge
        away = np.linalg.norm(foot - points, axis=-1)
        nearer = away < gap
        best = np.where(nearer[..., None], foot, best)
        gap = np.where(nearer, away, gap)
    return best

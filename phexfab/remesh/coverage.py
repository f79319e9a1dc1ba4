"""How much of a surface a mesh covers, and where the largest gaps are."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from phexfab.mesh.measures import face_centroids, face_normals
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.fewer_panels import reach
from phexfab.surface.freeform.surface import FreeformSurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

_NEAR = 12  # faces looked at for each sample, by their centroids


@dataclass(frozen=True, eq=False)
class Gap:
    """A connected part of a surface without faces.

    Attributes
    ----------
    place : (3,) float
        Its point farthest from faces, mm.
    depth : float
        How far that is from the nearest covered sample, mm.
    share : float
        Its area over the surface's.
    """

    place: FloatArray
    depth: float
    share: float

    def __str__(self) -> str:
        return (
            f"{100 * self.share:.3g} % about {self.place.round(1).tolist()}, up to "
            f"{self.depth:.4g} mm from the nearest face"
        )


@dataclass(frozen=True, eq=False)
class Coverage:
    """What of a surface lies under faces.

    Attributes
    ----------
    share : float
        Covered area over the surface's, by samples.
    gaps : tuple of Gap
        The deepest first; the strip that whole faces leave along a border is one, too.
    samples, covered : (n, 3) float, (n,) bool
    """

    share: float
    gaps: tuple[Gap, ...]
    samples: FloatArray
    covered: BoolArray


def coverage(
    surface: FreeformSurface,
    mesh: PolyMesh,
    samples: int = 4000,
    *,
    holds: Callable[[FloatArray], BoolArray] | None = None,
) -> Coverage:
    """Return how much of a surface the faces of a mesh near it cover, by samples of its area.

    A sample is covered where the line along the normal meets a face, seen along the face's normal,
    no farther than the face reaches.

    Parameters
    ----------
    surface : FreeformSurface
    mesh : PolyMesh
    samples : int
        About how many; the share is good to about one over the root of that, gaps to the distance
        between samples.
    holds : callable, optional
        Which parameters belong to the surface, where it has an outline other than its domain's.
    """
    u = surface.seeds(samples)
    if holds is not None:
        u = u[holds(u)]
    points = surface.point(u)
    away, near = cKDTree(points).query(points, min(9, len(points)))
    weight = _areas(surface, u, away.reshape(len(points), -1)[:, -1])
    covered = under(mesh, points)
    total = float(weight.sum())
    return Coverage(
        float(weight[covered].sum()) / total,
        _gaps(points, weight / total, covered, near.reshape(len(points), -1)),
        points,
        covered,
    )


def _areas(surface: FreeformSurface, u: FloatArray, near: FloatArray) -> FloatArray:
    """Return the area (n,) that each sample stands for, up to a factor."""
    if surface.domain is None:
        return near**2
    first = surface.derivatives(u)[0]
    return np.asarray(np.linalg.norm(np.cross(first[:, 0], first[:, 1]), axis=1))


def under(mesh: PolyMesh, points: FloatArray) -> BoolArray:
    """Return (n,) whether points lie over or under a face, as near as the face is wide."""
    centre, normal = face_centroids(mesh), np.nan_to_num(face_normals(mesh))
    index = cKDTree(centre).query(points, min(_NEAR, mesh.n_faces))[1].reshape(len(points), -1)
    far = reach(mesh, centre)
    found = np.zeros(len(points), bool)
    for column in index.T:
        for n in np.unique(mesh.sides[column]):
            todo = np.flatnonzero(~found & (mesh.sides[column] == n))
            f = column[todo]
            corner = mesh.vertices[mesh.corners[mesh.starts[f][:, None] + np.arange(n)]]
            gap = points[todo] - centre[f]
            height = np.einsum("ij,ij->i", gap, normal[f])
            near = (np.abs(height) < far[f]) & (np.linalg.norm(gap, axis=1) < 1.5 * far[f])
            found[todo] |= near & _inside(corner - points[todo][:, None], normal[f])
    return found


def _inside(corner: FloatArray, normal: FloatArray) -> BoolArray:
    """Return (k,) whether the origin lies within polygons (k, n, 3), seen along normals."""
    axis = np.eye(3)[np.abs(normal).argmin(axis=1)]
    e = np.cross(normal, axis)
    g = np.cross(normal, e)
    x, y = np.einsum("kni,ki->kn", corner, e), np.einsum("kni,ki->kn", corner, g)
    xn, yn = np.roll(x, -1, axis=1), np.roll(y, -1, axis=1)
    spans = (y > 0) != (yn > 0)
    slope = np.divide(xn - x, yn - y, out=np.zeros_like(x), where=spans)
    return np.asarray((spans & (x - y * slope > 0)).sum(axis=1) % 2 == 1)


def _gaps(
    points: FloatArray, share: FloatArray, covered: BoolArray, near: IntArray
) -> tuple[Gap, ...]:
    bare = np.flatnonzero(~covered)
    if not len(bare):
        return ()
    one, two = np.repeat(np.arange(len(points)), near.shape[1]), near.ravel()
    both = ~(covered[one] | covered[two])
    link = coo_array((np.ones(both.sum()), (one[both], two[both])), shape=(len(points),) * 2)
    label = connected_components(link, directed=False)[1][bare]
    depth = np.full(len(bare), np.inf)
    if covered.any():
        depth = cKDTree(points[covered]).query(points[bare])[0]
    order = np.lexsort((-depth, label))
    first = order[np.unique(label[order], return_index=True)[1]]
    area = np.bincount(label, share[bare])
    gaps = [Gap(points[bare[k]], float(depth[k]), float(area[label[k]])) for k in first]
    return tuple(sorted(gaps, key=lambda gap: -gap.depth))

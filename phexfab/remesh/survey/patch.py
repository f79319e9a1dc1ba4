"""A free-form patch sampled by triangles, and what the surveyed methods ask of it.

The methods that go through tangent planes (projective duality, the support function, parallel
meshes) all need a patch without parabolic points, where the tangent planes would come back on
themselves, and none of them can promise faces that do not cross themselves. Both are checked here.

References
----------
Thesis ch. 5, "Projective duality", "Gaussian sphere", "Parallel meshes"; Wang, Liu 2008, "A note on
planar hexagonal meshes".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import LatticeError, SurfaceError
from phexfab.mesh.measures import simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.shell import Shell
from phexfab.surface.freeform.bending import Bending, Domain, FreeformSurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SAMPLES = 41
PARABOLIC = 1e-7
"""|K| over its mean below which a point counts as parabolic."""


@dataclass(frozen=True, eq=False)
class Patch:
    """Samples of a surface, joined by triangles.

    Attributes
    ----------
    surface : FreeformSurface
    u : (N, 2) or (N, 3) parameters
    triangles : (T, 3) int
    points : (N, 3) mm
    bending : Bending
        At the samples.
    """

    surface: FreeformSurface
    u: FloatArray
    triangles: IntArray
    points: FloatArray
    bending: Bending


def sample_patch(
    surface: FreeformSurface, *, samples: int = SAMPLES, mesh: PolyMesh | None = None
) -> Patch:
    """Return a triangulated sampling of a surface.

    Parameters
    ----------
    surface : FreeformSurface
    samples : int
        Per direction of the domain of a parametric surface. A periodic one is cut open there.
    mesh : PolyMesh, optional
        Of triangles, its vertices near the surface: the patch of a surface whose parameters are
        points in space (an implicit one, a triangle mesh).

    Raises
    ------
    SurfaceError
        If the surface has no rectangle of parameters and no mesh of triangles is given.
    """
    if surface.domain is not None and mesh is None:
        u0, u1, v0, v1 = surface.domain
        grid = np.meshgrid(np.linspace(u0, u1, samples), np.linspace(v0, v1, samples))
        u = np.column_stack([grid[0].ravel(), grid[1].ravel()])
        cell = np.add.outer(samples * np.arange(samples - 1), np.arange(samples - 1)).ravel()
        right, above = cell + 1, cell + samples
        triangles = np.concatenate(
            [
                np.column_stack([cell, right, right + samples]),
                np.column_stack([cell, right + samples, above]),
            ]
        )
    elif mesh is not None and mesh.n_faces and np.all(mesh.sides == 3):
        u = surface.nearest(mesh.vertices)
        triangles = mesh.corners.reshape(-1, 3)
    else:
        raise SurfaceError(
            f"{surface.name}: its parameters are points in space; give a mesh of triangles on it "
            "as the patch to be covered"
        )
    points = surface.point(u)
    bending = surface.bending(u)
    corner = points[triangles]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    if np.sum(cross * bending.normals[triangles[:, 0]]) < 0:
        triangles = triangles[:, ::-1]
    return Patch(surface, u, np.ascontiguousarray(triangles, np.int64), points, bending)


def require_no_parabolic_point(patch: Patch, method: str) -> int:
    """Return the sign of the Gaussian curvature K of a patch, the same everywhere.

    Between samples of one sign the smallest |K| of a parametric surface is searched for, so that
    a single flat point is found, too.

    Raises
    ------
    SurfaceError
        If K changes its sign or vanishes; the message names a place.
    """
    k = patch.bending.gauss
    size = float(np.abs(k).mean())
    if not size * patch.surface.size**2 > 1e-12:
        raise SurfaceError(
            f"{patch.surface.name}: K vanishes everywhere, so its tangent planes are a curve of "
            f"planes only; {method} needs K > 0 or K < 0"
        )
    sign = 1 if k.sum() > 0 else -1
    least = sign * k
    at = int(np.argmin(least))
    place, value = patch.points[at], float(least[at])
    if value > 0 and patch.surface.domain is not None:
        place, value = _least_curvature(patch, patch.surface.domain, at, sign)
    if not value > PARABOLIC * size:
        how = "changes its sign" if value < -PARABOLIC * size else "vanishes"
        raise SurfaceError(
            f"{patch.surface.name}: K {how} near {(place.round(1) + 0.0).tolist()} mm; {method} "
            "cannot cross parabolic points: take a part of the surface with K > 0 or K < 0 "
            'throughout, or a method that crosses them, "dupin" or "conjugate"'
        )
    return sign


def _least_curvature(patch: Patch, domain: Domain, at: int, sign: int) -> tuple[FloatArray, float]:
    """Search the least sign·K around a sample, by grids of half the size each."""
    surface = patch.surface
    u0, u1, v0, v1 = domain
    low, high = np.array([u0, v0]), np.array([u1, v1])
    reach = (high - low) / (np.sqrt(len(patch.u)) - 1)
    steps = np.stack(np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 5)), -1).reshape(-1, 2)
    best, value = patch.u[at], np.inf
    for _ in range(30):
        near = np.clip(best + reach * steps, low, high)
        found = sign * surface.bending(near).gauss
        k = int(np.argmin(found))
        best, value = near[k], float(found[k])
        reach = reach * 0.5
    return surface.point(best), value


def require_simple(shell: Shell, name: str, method: str, remedy: str) -> None:
    """Refuse faces that cross themselves.

    Raises
    ------
    LatticeError
        The message names the first of them, its place and how many there are.
    """
    bad = np.flatnonzero(~simple_faces(shell.mesh))
    if len(bad):
        place = shell.points[shell.panels[bad[0]]].round(3).tolist()
        raise LatticeError(
            f"{name}: {len(bad)} of {shell.mesh.n_faces} faces cross themselves, the first is "
            f"{bad[0]} at {place} mm; {method} does not promise valid faces: {remedy}"
        )

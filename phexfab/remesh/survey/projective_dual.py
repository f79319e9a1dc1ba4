"""Hexagons by projective duality: a regular triangulation of the dual surface.

Duality takes the plane ax + by + cz + 1 = 0 to the point (a, b, c), so the tangent planes of a
surface to the points of its dual surface, and a triangle in dual space to the point where the
planes of its corners meet. A regular triangulation of the dual surface becomes a mesh of planar
hexagons that touch the surface. Parabolic points are singular points of the dual surface, tangent
planes through the origin lie at infinity, and the distances of both surfaces differ much unless the
origin is well chosen; faces may cross themselves even on convex surfaces.

References
----------
Thesis ch. 5, "Projective duality"; Wang, Liu 2008, "A note on planar hexagonal meshes".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import LatticeError, SurfaceError
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.shell import Shell
from phexfab.remesh.conformal.chart import aligned_chart
from phexfab.remesh.conformal.chart_lattice import chart_lattice
from phexfab.remesh.survey.patch import (
    Patch,
    require_no_parabolic_point,
    require_simple,
    sample_patch,
)
from phexfab.remesh.survey.support_function import tangent_shell
from phexfab.surface.freeform.bending import FreeformSurface
from phexfab.triangular import EQUILATERAL

FloatArray = NDArray[np.float64]


def dual_points(points: ArrayLike, normals: ArrayLike, centre: ArrayLike = 0.0) -> FloatArray:
    """Return the points (..., 3), in 1/mm, dual to tangent planes at points with unit normals.

    The plane n·(x − p) = 0 is ax + by + cz + 1 = 0 with (a, b, c) = −n/(n·(p − centre)), when the
    centre is the origin. Applied to the dual surface it gives the surface back.

    Raises
    ------
    SurfaceError
        If a tangent plane passes through the centre: its dual point is at infinity.
    """
    p, n = np.asarray(points, float) - np.asarray(centre, float), np.asarray(normals, float)
    height = np.sum(n * p, axis=-1)
    size = np.linalg.norm(p, axis=-1)
    low = np.abs(height) <= 1e-12 * size
    if low.any():
        place = np.asarray(points, float).reshape(-1, 3)[int(np.argmax(low))]
        raise SurfaceError(
            f"the tangent plane at {place.round(3).tolist()} mm passes through the centre, so its "
            "dual point is at infinity; choose another centre"
        )
    return np.asarray(-n / height[..., None])


def best_centre(patch: Patch) -> FloatArray:
    """Return the (3,) centre of duality with the least distortion among a few candidates, mm.

    For each of eight distances the centre is sought from which all tangent planes come nearest to
    having that distance (for a sphere its middle, when the radius is among them); the one with the
    least ratio of largest to smallest distance is taken.

    Raises
    ------
    SurfaceError
        If from each of them some tangent plane is passed through.
    """
    n = patch.bending.normals
    height = np.einsum("ij,ij->i", n, patch.points)
    bent = np.abs(patch.bending.kappa).mean()
    lengths = [1 / bent, 0.5 * patch.surface.size, patch.surface.size, 2 * patch.surface.size]
    best, least = np.zeros(3), np.inf
    for length in lengths:
        for distance in (length, -length):
            # A little pull to the middle keeps normals in a plane from sending it away.
            rows = np.vstack([n, 1e-6 * np.eye(3)])
            right = np.concatenate([height - distance, 1e-6 * patch.points.mean(axis=0)])
            centre = np.linalg.lstsq(rows, right, rcond=None)[0]
            seen = height - n @ centre
            if seen.min() * seen.max() > 0:
                ratio = max(seen.max() / seen.min(), seen.min() / seen.max())
                if ratio < least:
                    best, least = centre, ratio
    if not np.isfinite(least):
        raise SurfaceError(
            f"{patch.surface.name}: no centre was found that lies on no tangent plane; take a "
            "smaller part of the surface, or give a centre"
        )
    return best


@dataclass(frozen=True, eq=False)
class DualMesh:
    """The outcome of projective duality.

    Attributes
    ----------
    shell : Shell
        Of the face type; the outermost lattice points are its border planes.
    centre : (3,) mm
        The origin of the duality.
    dual : PolyMesh
        The triangulation of the dual surface, 1/mm, around the centre.
    distortion : float
        Largest over smallest ratio of lengths on the surface to lengths on the dual surface.
    """

    shell: Shell
    centre: FloatArray
    dual: PolyMesh
    distortion: float


def projective_dual_mesh(
    surface: FreeformSurface,
    panel_size: float,
    *,
    centre: ArrayLike | None = None,
    turn: float = 0.0,
    row_ratio: float = EQUILATERAL,
    mesh: PolyMesh | None = None,
    crossing: bool = False,
    distortion_limit: float = 10.0,
) -> DualMesh:
    """Return planar hexagons from a regular triangulation of the dual surface.

    Parameters
    ----------
    surface : FreeformSurface
        With K > 0 or K < 0 throughout.
    panel_size : float
        Mean distance of neighbouring panels, mm.
    centre : (3,), optional
        Origin of the duality, on no tangent plane; without it ``best_centre``.
    turn, row_ratio : float
        See ``phexfab.remesh.survey.support_function.support_function_mesh``; on the dual surface.
    mesh : PolyMesh, optional
        See ``phexfab.remesh.survey.patch.sample_patch``.
    crossing : bool
        Let faces that cross themselves pass.
    distortion_limit : float
        Largest ``DualMesh.distortion`` that is let pass.

    Raises
    ------
    SurfaceError
        If the patch has parabolic points, or a tangent plane passes through the centre.
    LatticeError
        If the distortion exceeds its limit, the panels are too large for the patch, or faces cross
        themselves.

    References
    ----------
    Thesis ch. 5.
    """
    patch = sample_patch(surface, mesh=mesh)
    require_no_parabolic_point(patch, "projective duality")
    origin = best_centre(patch) if centre is None else np.asarray(centre, float)
    image = dual_points(patch.points, patch.bending.normals, origin)
    height = np.einsum("ij,ij->i", patch.bending.normals, patch.points - origin)
    if height.min() < 0 < height.max():
        place = patch.points[int(np.argmin(np.abs(height)))].round(3).tolist()
        raise SurfaceError(
            f"{surface.name}: a tangent plane near {place} mm passes through the centre "
            f"{origin.round(3).tolist()}: the dual surface goes through infinity; choose another"
        )
    chart = aligned_chart(patch, image * surface.size)
    found = chart_lattice(patch, chart, panel_size, turn=turn, row_ratio=row_ratio)
    if found.distortion > distortion_limit:
        raise LatticeError(
            f"{surface.name}: duality distorts lengths by 1 : {found.distortion:.1f} from place to "
            f"place, above distortion_limit = {distortion_limit:g}; choose another centre or "
            "a smaller part of the surface"
        )
    shell = tangent_shell(surface, found)
    if not crossing:
        require_simple(
            shell,
            surface.name,
            "projective duality",
            "take a smaller part, smaller panels, another turn or centre, or Dupin duality",
        )
    corners = found.triangles.ravel()
    dual = PolyMesh(
        dual_points(shell.points, shell.normals, origin), corners, np.arange(0, len(corners) + 1, 3)
    )
    return DualMesh(shell, origin, dual, found.distortion)

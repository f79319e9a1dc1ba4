"""Hexagons from the support function over the Gaussian sphere.

The support function h(n) of a surface gives each unit normal n the height of its tangent plane. Its
values at the vertices of a triangulation of the Gauss image, taken as linear on each triangle (on
the cone over it), are the support function of a polyhedral surface: the triangles become vertices,
where three tangent planes meet. A regular triangulation gives hexagons, with planar faces that
touch the surface. The Gauss image must be one to one, so parabolic points are refused; faces may
still cross themselves.

References
----------
Thesis ch. 5, "Gaussian sphere"; Almegaard, Bagger, Gravesen, Jüttler, Šír 2007, "Surfaces with
piecewise linear support functions over spherical triangulations".
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from phexfab.errors import SurfaceError
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.shell import Shell
from phexfab.remesh.conformal.chart import aligned_chart
from phexfab.remesh.conformal.chart_lattice import ChartLattice, chart_lattice
from phexfab.remesh.survey.patch import (
    Patch,
    require_no_parabolic_point,
    require_simple,
    sample_patch,
)
from phexfab.surface.freeform.bending import FreeformSurface
from phexfab.triangular import EQUILATERAL

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

_STEPS = 60


def support_function_mesh(
    surface: FreeformSurface,
    panel_size: float,
    *,
    turn: float = 0.0,
    row_ratio: float = EQUILATERAL,
    mesh: PolyMesh | None = None,
    crossing: bool = False,
) -> Shell:
    """Return planar hexagons from the support function over a regular mesh of the Gauss image.

    Parameters
    ----------
    surface : FreeformSurface
        With K > 0 or K < 0 throughout.
    panel_size : float
        Mean distance of neighbouring panels, mm.
    turn : float
        Degrees by which the rows on the sphere are turned off the image of the principal direction
        with the larger |κ| (averaged over the patch). At 0 hexagons are valid while that direction
        does not turn much.
    row_ratio : float
        Row distance / step on the sphere.
    mesh : PolyMesh, optional
        See ``phexfab.remesh.survey.patch.sample_patch``.
    crossing : bool
        Let faces that cross themselves pass.

    Returns
    -------
    Shell of the face type; the outermost lattice points are its border planes.

    Raises
    ------
    SurfaceError
        If the patch has parabolic points.
    LatticeError
        If the panels are too large for the patch, or faces cross themselves.

    References
    ----------
    Thesis ch. 5.
    """
    patch = sample_patch(surface, mesh=mesh)
    require_no_parabolic_point(patch, "the support function over the Gaussian sphere")
    chart = aligned_chart(patch, patch.bending.normals)
    found = chart_lattice(patch, chart, panel_size, turn=turn, row_ratio=row_ratio)
    shell = tangent_shell(surface, found)
    if not crossing:
        require_simple(
            shell,
            surface.name,
            "the support function",
            "take a smaller part, smaller panels, another turn or row_ratio, or Dupin duality",
        )
    return shell


def tangent_shell(surface: FreeformSurface, found: ChartLattice) -> Shell:
    """Return the tangent planes at lattice points as a shell of the face type."""
    points, normals = surface.point(found.u), surface.normal(found.u)
    heights = np.einsum("ij,ij->i", points, normals)
    return Shell(normals, heights, np.ones(len(heights)), found.triangles, "face", points)


@dataclass(frozen=True, eq=False)
class SupportFunction:
    """h(n), the height of the tangent plane with unit normal n, of a patch of a surface.

    Calling it with (F, 3) normals gives (F,) heights in mm, so it may be handed to
    ``phexfab.parallel.edge_offset.touch_surface``.

    Attributes
    ----------
    patch : Patch
        Without parabolic points.
    """

    patch: Patch

    @classmethod
    def of(
        cls,
        surface: FreeformSurface,
        *,
        mesh: PolyMesh | None = None,
        method: str = "the support function",
    ) -> SupportFunction:
        """Return the support function of a surface with K > 0 or K < 0.

        ``method`` is what messages say that needs it.

        Raises
        ------
        SurfaceError
            If the patch has parabolic points, where h has several branches.
        """
        patch = sample_patch(surface, mesh=mesh)
        require_no_parabolic_point(patch, method)
        return cls(patch)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.patch.bending.normals)

    def find(self, normals: ArrayLike) -> tuple[FloatArray, BoolArray]:
        """Return parameters (F, 2) or (F, 3) of the points with the normals, and which exist.

        Newton's method on the Gauss map, from the sample with the nearest normal.
        """
        n = np.asarray(normals, float).reshape(-1, 3)
        surface = self.patch.surface
        u = self.patch.u[self._tree.query(n)[1]].copy()
        miss = np.full(len(n), np.inf)
        todo = np.arange(len(n))
        # Short steps, so that none leaves the neighbourhood of the patch.
        reach = 0.1 * surface.size
        for _ in range(_STEPS):
            bend = surface.bending(u[todo])
            gap = n[todo] - bend.normals
            miss[todo] = np.linalg.norm(gap, axis=1)
            # Weingarten: a step along eₖ changes the normal by −κₖ.
            ahead = np.einsum("ij,ij->i", n[todo], bend.normals)
            lead = np.where(ahead > 0.1, 1 / np.maximum(ahead, 0.1), 1.0)[:, None]
            part = -bend.flat(n[todo] * lead) / bend.kappa
            length = np.linalg.norm(part, axis=1, keepdims=True)
            move = bend.lifted(part * np.minimum(1.0, reach / np.maximum(length, 1e-300)))
            active = (miss[todo] > 4e-16) & (length[:, 0] > 1e-14 * surface.size)
            if not active.any():
                break
            todo, move = todo[active], move[active]
            u[todo] = self._moved(u[todo], move)
        inside = self._within(u)
        return u, (miss <= 1e-9) & inside

    def _moved(self, u: FloatArray, move: FloatArray) -> FloatArray:
        surface = self.patch.surface
        if surface.domain is None:
            return surface.nearest(surface.point(u) + move, guess=u)
        first = surface.derivatives(u)[0]
        gram = np.einsum("kij,klj->kil", first, first)
        right = np.einsum("kij,kj->ki", first, move)[..., None]
        ahead = u + np.linalg.solve(gram, right)[..., 0]
        u0, u1, v0, v1 = surface.domain
        loose = np.array(surface.periodic)
        return np.where(loose, ahead, np.clip(ahead, [u0, v0], [u1, v1]))

    def _within(self, u: FloatArray) -> BoolArray:
        """True inside the domain, its border included."""
        if self.patch.surface.domain is None:
            return self.patch.surface.inside(u)
        return np.ones(len(u), bool)  # clamped on the way: a miss there is a miss of the normal

    def parameters(self, normals: ArrayLike) -> FloatArray:
        """Return the parameters of the points of contact.

        Raises
        ------
        SurfaceError
            If the surface has no tangent plane with one of the normals.
        """
        u, exists = self.find(normals)
        if not exists.all():
            first = int(np.argmin(exists))
            direction = np.asarray(normals, float).reshape(-1, 3)[first].round(4).tolist()
            raise SurfaceError(
                f"{self.patch.surface.name}: {int((~exists).sum())} of {len(exists)} normals are "
                f"not in its Gauss image, the first is {first}, {direction}; take a larger part "
                "of the surface or a mesh of a smaller Gauss image"
            )
        return u

    def __call__(self, normals: ArrayLike) -> FloatArray:
        """Return the (F,) heights of the tangent planes, mm."""
        points = self.points(normals)
        return np.asarray(np.einsum("ij,ij->i", points, np.asarray(normals, float)))

    def points(self, normals: ArrayLike) -> FloatArray:
        """Return the (F, 3) points of contact, mm."""
        return self.patch.surface.point(self.parameters(normals))

"""Constant edge distance: a Koebe polyhedron's planes, moved to touch a surface.

Moving the face planes of a Koebe polyhedron S parallel to themselves gives a mesh M of the edge
offset type whatever the heights are. Tangent planes of a surface give M its shape, but cannot
promise faces that do not cross themselves: see ``phexfab.parallel.repair``.

References
----------
Thesis §6.2; Pottmann, Liu, Wallner, Bobenko, Wang 2007, sec. 4.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from phexfab.errors import MeshError, SurfaceError
from phexfab.mesh.measures import signed_areas, simple_faces
from phexfab.parallel.offset import offset_defect
from phexfab.parallel.repair import Repair, repair_crossings
from phexfab.parallel.shell import Shell
from phexfab.surface.weierstrass import MinimalSurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Support = MinimalSurface | Callable[[FloatArray], ArrayLike]


@dataclass(frozen=True)
class Ellipsoid:
    """Support function of x²/a² + y²/b² + z²/c² = 1, half axes in mm."""

    a: float
    b: float
    c: float

    def __call__(self, normals: FloatArray) -> FloatArray:
        """Return the (F,) heights of the tangent planes with these unit normals, mm."""
        return np.linalg.norm(normals * np.array([self.a, self.b, self.c]), axis=1)

    def points(self, normals: FloatArray) -> FloatArray:
        """Return the (F, 3) points of contact, mm."""
        return normals * np.array([self.a, self.b, self.c]) ** 2 / self(normals)[:, None]


@dataclass(frozen=True)
class Paraboloid:
    """Support function of z = −x²/2a − y²/2b with upward normals; a·b < 0 makes a saddle.

    ``a`` and ``b`` are the radii of curvature at the top, mm.
    """

    a: float
    b: float

    def __call__(self, normals: FloatArray) -> FloatArray:
        """Return the (F,) heights of the tangent planes with these unit normals, mm.

        Raises
        ------
        SurfaceError
            If a normal does not point upwards.
        """
        x, y, z = normals.T
        if not np.all(z > 0):
            f = int(np.argmin(z))
            raise SurfaceError(
                f"normal {f} = {normals[f].round(6).tolist()} does not point upwards, but all "
                "of a paraboloid's do; turn the polyhedron, or take a smaller part of it"
            )
        return (self.a * x * x + self.b * y * y) / (2 * z)

    def points(self, normals: FloatArray) -> FloatArray:
        """Return the (F, 3) points of contact, mm."""
        slope = normals[:, :2] / normals[:, 2:]
        x, y = self.a * slope[:, 0], self.b * slope[:, 1]
        return np.column_stack([x, y, -x * x / (2 * self.a) - y * y / (2 * self.b)])


def touch_surface(koebe: Shell, support: Support) -> Shell:
    """Return the shell whose face planes touch a surface, parallel to those of ``koebe``.

    Parameters
    ----------
    koebe : Shell
        Of any kind; its normals and Gauss heights stay.
    support : MinimalSurface, or callable
        A callable takes (F, 3) unit normals and returns (F,) heights in mm of the tangent planes
        with these normals (``Ellipsoid``, ``Paraboloid``, or a function of your own). If it has a
        method ``points`` of the normals, that gives the points of contact. On a minimal surface
        the search begins at the shell's parameters if it has any, else at the nearest normal in
        the surface's rectangle.

    Raises
    ------
    SurfaceError
        If the surface has no tangent plane with one of the normals.
    """
    n = koebe.normals
    if isinstance(support, MinimalSurface):
        z = support.parameter_of_normal(n, _first_guess(koebe, support))
        points = support.point(z)
        heights = np.einsum("ij,ij->i", points, n)
        return replace(koebe, heights=heights, points=points, parameters=z)
    heights = np.asarray(support(n), float)
    if heights.shape != (len(n),) or not np.isfinite(heights).all():
        raise SurfaceError(
            f"the support function gave an array of shape {heights.shape} or values that are not "
            f"finite for {len(n)} normals; it must return one finite height in mm for each"
        )
    contact = getattr(support, "points", None)
    points = heights[:, None] * n if contact is None else np.asarray(contact(n), float)
    return replace(koebe, heights=heights, points=points, parameters=np.zeros(0, complex))


def edge_offset_mesh(
    koebe: Shell, support: Support, *, fraction: float = 0.2, repair: bool = True
) -> Repair:
    """Return the edge-offset mesh near a surface: planes of a Koebe polyhedron that touch it.

    The corners of the result run counter-clockwise about the normals, whatever the sign of the
    surface's curvature. Faces that cross themselves are found, and repaired by
    ``repair_crossings``.

    Parameters
    ----------
    koebe : Shell
        Of kind ``"edge"``: the edges of its Gauss image touch the unit sphere.
    support : MinimalSurface, or callable
        See ``touch_surface``.
    fraction : float
        See ``repair_crossings``.
    repair : bool
        Only report the crossings if false.

    Raises
    ------
    MeshError
        If the shell's edges do not touch the unit sphere.
    SurfaceError
        If the surface has no tangent plane with one of the normals.

    References
    ----------
    Thesis §6.2.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0), "edge")
    >>> from phexfab.parallel.edge_offset import Ellipsoid
    >>> dome = px.edge_offset_mesh(shell, Ellipsoid(2600.0, 2000.0, 1600.0))  # half axes, mm
    >>> dome.shell.kind, len(dome.left)  # no panel crosses itself
    ('edge', 0)
    """
    miss = offset_defect(replace(koebe, kind="edge"))
    if not miss.max(initial=0.0) <= 1e-9:
        worst = int(np.argmax(miss))
        raise MeshError(
            f"edge {worst} misses the unit sphere by {miss[worst]:.1e}: this is no Koebe "
            'polyhedron; make one with gauss_image(..., "edge")'
        )
    touching = touch_surface(replace(koebe, kind="edge"), support)
    # S runs against M where K < 0; the polyhedron may have been made for the other sign.
    if signed_areas(touching.mesh, touching.normals[touching.panels]).sum() < 0:
        touching = replace(touching, triangles=touching.triangles[:, ::-1])
    if repair:
        return repair_crossings(touching, fraction=fraction)
    bad = np.flatnonzero(~simple_faces(touching.mesh))
    none = np.zeros(0, np.int64)
    return Repair(touching, bad, none, none, np.zeros(0), bad)


def _first_guess(koebe: Shell, surface: MinimalSurface) -> NDArray[np.complex128]:
    if len(koebe.parameters) == len(koebe.normals):
        return koebe.parameters
    u0, u1, v0, v1 = surface.rectangle
    u, v = np.meshgrid(np.linspace(u0, u1, 65), np.linspace(v0, v1, 65))
    z = surface.parameter((u + 1j * v).ravel())
    return np.asarray(z[cKDTree(surface.normal(z)).query(koebe.normals)[1]], complex)

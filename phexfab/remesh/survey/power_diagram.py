"""Hexagons on an ellipsoid: a power diagram of the plane, projected stereographically.

A weighted point (centre c, weight r²) is a circle of the plane; stereographic projection takes it
to a circle of the unit sphere, and the plane of that circle carries a face. The power line of two
circles is seen from the pole as the line where their planes meet, so the power diagram of the plane
is the picture of a convex polyhedral surface, and an affine map takes the sphere to any ellipsoid.
Weight 0 (a Voronoi diagram) gives planes that touch it. Cells with six sides give hexagons. Only
ellipsoids can be reached.

References
----------
Thesis ch. 5, "Stereographic projection"; Aurenhammer 1987, "Power diagrams: properties, algorithms
and applications", SIAM J. Comput. 16; Wang, Liu 2008, "A note on planar hexagonal meshes".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import ConvexHull, QhullError, cKDTree

from phexfab.errors import LatticeError, MeshError, SurfaceError
from phexfab.parallel.rings import face_rings
from phexfab.parallel.shell import Shell
from phexfab.remesh.conformal.chart_lattice import chart_lattice
from phexfab.remesh.survey.patch import sample_patch
from phexfab.surface.freeform.bending import FreeformSurface
from phexfab.triangular import EQUILATERAL

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
ComplexArray = NDArray[np.complex128]


HOLE = 0.5
"""Distance from a part of the unit sphere at which a point serves as centre of projection."""


@dataclass(frozen=True, eq=False)
class EllipsoidFrame:
    """An ellipsoid as an affine image of the unit sphere.

    Attributes
    ----------
    centre : (3,) mm
    axes : (3, 3) mm
        Columns are the half axes: x = centre + axes @ (point of the unit sphere).
    """

    centre: FloatArray
    axes: FloatArray

    @classmethod
    def of(cls, a: float, b: float, c: float) -> EllipsoidFrame:
        """Return x²/a² + y²/b² + z²/c² = 1, half axes in mm."""
        if not min(a, b, c) > 0:
            raise SurfaceError(f"half axes {a}, {b}, {c}: all must be positive, in mm")
        return cls(np.zeros(3), np.diag([float(a), float(b), float(c)]))

    def turned(self, pole: ArrayLike) -> EllipsoidFrame:
        """Return the same ellipsoid, the sphere's south pole at a point in a direction from it.

        Parameters
        ----------
        pole : (3,) a direction from the centre
        """
        on_sphere = np.linalg.solve(self.axes, np.asarray(pole, float))
        size = np.linalg.norm(on_sphere)
        if not size > 0:
            raise SurfaceError("the direction of the middle has no length")
        down = -on_sphere / size
        # Any rotation with this third column; the one nearest to the coordinate axes.
        side = np.eye(3)[int(np.argmin(np.abs(down)))]
        first = side - (side @ down) * down
        first = first / np.linalg.norm(first)
        return EllipsoidFrame(
            self.centre, self.axes @ np.column_stack([first, np.cross(down, first), down])
        )

    def on_sphere(self, points: ArrayLike) -> FloatArray:
        """Return points (..., 3) of the ellipsoid as points of the unit sphere."""
        moved = np.asarray(points, float) - self.centre
        return np.asarray(np.linalg.solve(self.axes, moved[..., None])[..., 0])


def power_cells(sites: ArrayLike, weights: ArrayLike | None = None) -> IntArray:
    """Return the triangles (T, 3), counter-clockwise, of sites whose power cells meet in a point.

    Parameters
    ----------
    sites : (F,) complex
    weights : (F,), optional
        Cell i is where |x − cᵢ|² − wᵢ is least; without weights the Voronoi diagram.

    Raises
    ------
    MeshError
        If a site has no cell, or all sites lie on a line.

    References
    ----------
    Aurenhammer 1987.
    """
    z = np.asarray(sites, complex)
    w = np.zeros(len(z)) if weights is None else np.asarray(weights, float)
    if w.shape != z.shape or len(z) < 4 or not (np.isfinite(z) & np.isfinite(w)).all():
        raise MeshError(
            f"{len(z)} sites and weights of shape {w.shape}: at least 4 finite sites are needed, "
            "and a weight for each"
        )
    middle = z - z.mean()
    size = np.abs(middle).max()
    x, y = middle.real / size, middle.imag / size
    # The lower hull of (x, y, x² + y² − w) is dual to the power diagram.
    try:
        hull = ConvexHull(np.column_stack([x, y, x * x + y * y - w / size**2]), qhull_options="Qt")
    except (QhullError, ZeroDivisionError) as error:
        raise MeshError(f"the sites span no area: {str(error).splitlines()[0]}") from error
    triangles = hull.simplices[hull.equations[:, 2] < -1e-12].astype(np.int64)
    missing = np.setdiff1d(np.arange(len(z)), triangles)
    if len(missing):
        raise MeshError(
            f"{len(missing)} of {len(z)} sites have no power cell, the first is {missing[0]} with "
            f"weight {w[missing[0]]:.6g}; raise its weight, or leave it out"
        )
    a, b, c = z[triangles].T
    clockwise = ((b - a).conj() * (c - a)).imag < 0
    triangles[clockwise] = triangles[clockwise][:, ::-1]
    return np.asarray(triangles[np.lexsort(triangles.T[::-1])])


def power_planes(
    sites: ArrayLike, weights: ArrayLike | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return normals (F, 3), outwards, and heights (F,) of the planes of circles on the sphere.

    Parameters
    ----------
    sites, weights
        See ``power_cells``. The circle has the radius √w; weight 0 gives the tangent plane,
        negative weights planes that miss the sphere.
    """
    z = np.asarray(sites, complex)
    power = np.abs(z) ** 2 - (0.0 if weights is None else np.asarray(weights, float))
    normal = np.column_stack([2 * z.real, 2 * z.imag, power - 1])
    size = np.linalg.norm(normal, axis=1)
    return normal / size[:, None], (power + 1) / size


def power_diagram_mesh(
    frame: EllipsoidFrame,
    sites: ArrayLike,
    weights: ArrayLike | None = None,
    *,
    panels: ArrayLike | None = None,
    hexagons: bool = True,
) -> Shell:
    """Return the polyhedral surface on an ellipsoid whose stereographic picture is a power diagram.

    Parameters
    ----------
    frame : EllipsoidFrame
        The sphere's north pole (its third axis) is the centre of projection.
    sites : (F,) complex
        In the plane of the equator: 0 goes to the south pole, |z| = 1 to the equator.
    weights : (F,), optional
        See ``power_planes``.
    panels : (F,) bool, optional
        The sites whose cells are wanted as faces; without it those whose cells lie in the convex
        hull of all sites. Their neighbours become border planes.
    hexagons : bool
        Refuse panels with other than six sides.

    Returns
    -------
    Shell of the face type, outward normals; sites beside no panel are left
    out, the others in their order.

    Raises
    ------
    MeshError
        If a site has no cell, a panel's cell is unbounded or does not have six sides.

    References
    ----------
    Thesis ch. 5.
    """
    z = np.asarray(sites, complex)
    triangles = power_cells(z, weights)
    closed = np.zeros(len(z), bool)
    closed[face_rings(triangles, len(z))[0]] = True
    if panels is None:
        wanted = closed & _inside_hull(z, triangles, weights)
    else:
        wanted = np.asarray(panels, bool)
        loose = np.flatnonzero(wanted & ~closed)
        if len(loose):
            raise MeshError(
                f"the cell of site {loose[0]} at {z[loose[0]]:.6g} is unbounded; it cannot be a "
                "panel: add sites around it"
            )
    if not wanted.any():
        raise MeshError("no site has a bounded cell within the others, so there is no face")
    sides = np.bincount(triangles.ravel(), minlength=len(z))
    odd = np.flatnonzero(wanted & (sides != 6))
    if hexagons and len(odd):
        raise MeshError(
            f"{len(odd)} of {int(wanted.sum())} cells are no hexagons, the first is that of site "
            f"{odd[0]} at {z[odd[0]]:.6g} with {sides[odd[0]]} sides; begin with a triangular "
            "lattice (hexagon_sites), or allow them with hexagons = False"
        )
    triangles = triangles[wanted[triangles].any(axis=1)]
    used, inverse = np.unique(triangles, return_inverse=True)
    normals, heights = power_planes(z, weights)
    normals, heights = normals[used], heights[used]
    points = (heights[:, None] * normals) @ frame.axes.T + frame.centre
    # A plane n·y = h of the sphere's space is (A⁻ᵀ n)·(x − centre) = h in the ellipsoid's.
    normals = np.asarray(np.linalg.solve(frame.axes.T, normals.T).T, float)
    length = np.linalg.norm(normals, axis=1)
    normals = normals / length[:, None]
    heights = heights / length + normals @ frame.centre
    # Seen from outside, the picture in the plane is mirrored, unless the frame is, too.
    triangles = inverse.reshape(-1, 3)
    if np.linalg.det(frame.axes) > 0:
        triangles = triangles[:, ::-1]
    return Shell(normals, heights, np.ones(len(heights)), triangles, "face", points)


def _inside_hull(z: ComplexArray, triangles: IntArray, weights: ArrayLike | None) -> BoolArray:
    """Return (F,) whether all corners of a site's cell lie in the convex hull of the sites."""
    w = np.zeros(len(z)) if weights is None else np.asarray(weights, float)
    a, b, c = z[triangles].T
    power = np.abs(z) ** 2 - w
    pa, pb, pc = power[triangles].T
    # 2 x·(b − a) = power_b − power_a and the same for c.
    det = ((b - a).conj() * (c - a)).imag
    corner = 1j * ((pb - pa) * (c - a) - (pc - pa) * (b - a)) / (-2 * det)
    hull = ConvexHull(np.column_stack([z.real, z.imag]))
    place = np.column_stack([corner.real, corner.imag, np.ones(len(corner))])
    outside = (place @ hull.equations.T).max(axis=1) > 1e-9 * np.abs(z - z.mean()).max()
    inside = np.ones(len(z), bool)
    inside[triangles[outside]] = False
    return inside


def hexagon_sites(radius: float, step: float) -> tuple[ComplexArray, BoolArray]:
    """Return the triangular lattice (F,) complex of a step within a disc about 0, and its panels.

    Returns
    -------
    sites : (F,) complex
    panels : (F,) bool
        Those whose six neighbours are all there.
    """
    if not 0 < 2 * step <= radius:
        raise LatticeError(f"radius = {radius:g}: it must be twice the step = {step:g} at least")
    reach = int(radius / (step * EQUILATERAL)) + 2
    s, t = np.meshgrid(np.arange(-2 * reach, 2 * reach + 1), np.arange(-reach, reach + 1))
    z = step * (s + t / 2 + 1j * EQUILATERAL * t).ravel()
    z = z[np.abs(z) <= radius * (1 + 1e-12)]
    points = np.column_stack([z.real, z.imag])
    near = cKDTree(points).query_ball_point(points, 1.01 * step, return_length=True)
    return np.asarray(z, complex), np.asarray(near == 7)


def ellipsoid_of(surface: FreeformSurface, tolerance: float = 1e-8) -> EllipsoidFrame:
    """Return the ellipsoid that a surface is a part of.

    Parameters
    ----------
    surface : FreeformSurface
        Parametric: it is sampled over its domain.
    tolerance : float
        Largest distance from the quadric of best fit, relative to the surface's size.

    Raises
    ------
    SurfaceError
        If the surface is no part of an ellipsoid: the method reaches nothing else.
    """
    if surface.domain is None:
        raise SurfaceError(
            f"{surface.name}: a mesh or an implicit surface is no ellipsoid to rounding, which the "
            "power diagram method needs; give a parametric surface, or the EllipsoidFrame itself"
        )
    points = sample_patch(surface).points
    middle = points.mean(axis=0)
    x, y, z = ((points - middle) / surface.size).T
    rows = np.column_stack(
        [x * x, y * y, z * z, 2 * y * z, 2 * x * z, 2 * x * y, x, y, z, np.ones(len(x))]
    )
    q = np.linalg.svd(rows, full_matrices=False)[2][-1]
    form = np.array([[q[0], q[5], q[4]], [q[5], q[1], q[3]], [q[4], q[3], q[2]]])
    gradient = 2 * np.column_stack([x, y, z]) @ form + q[6:9]
    # To first order; the root mean square gradient, which does not vanish at a centre.
    slope = float(np.sqrt(np.mean(np.sum(gradient * gradient, axis=1))))
    miss = float(np.abs(rows @ q).max()) / max(slope, 1e-300)
    if not miss <= tolerance:
        raise SurfaceError(
            f"{surface.name} is no quadric (off by about {miss:.1e} of its size): the power "
            "diagram method reaches ellipsoids only; use another method"
        )
    values, vectors = np.linalg.eigh(form)
    largest = float(np.abs(values).max())
    if not (values * np.sign(values.sum())).min() > 1e-9 * largest:
        raise SurfaceError(
            f"{surface.name} is a quadric but no ellipsoid (its form has eigenvalues "
            f"{(values / max(largest, 1e-300)).round(4).tolist()}): the power diagram method "
            "reaches ellipsoids only; use another method"
        )
    centre = -0.5 * np.linalg.solve(form, q[6:9])
    level = -(q[9] + 0.5 * q[6:9] @ centre)
    squares = level / values
    if not squares.min() > 0:
        raise SurfaceError(f"{surface.name}: the quadric of best fit has no real points")
    return EllipsoidFrame(middle + surface.size * centre, surface.size * vectors * np.sqrt(squares))


def _farthest(frame: EllipsoidFrame, points: FloatArray, middle: FloatArray) -> FloatArray:
    """Return the direction of the part's middle; of a belt, away from the widest hole."""
    sphere = cKDTree(frame.on_sphere(points))
    pole = -frame.on_sphere(frame.centre + middle)
    pole = pole / max(float(np.linalg.norm(pole)), 1e-300)
    if sphere.query(pole)[0] > HOLE:
        return middle
    k = np.arange(2000) + 0.5
    height, angle = 1 - k / 1000, np.pi * (1 + np.sqrt(5)) * k
    ring = np.sqrt(1 - height**2)
    poles = np.column_stack([ring * np.cos(angle), ring * np.sin(angle), height])
    away = sphere.query(poles)[0]
    best = int(away.argmax())
    if away[best] < HOLE:
        raise SurfaceError(
            "the surface leaves no hole on its ellipsoid to project it from; take a part of it"
        )
    return np.asarray(-frame.axes @ poles[best])


def stereographic(points: FloatArray) -> ComplexArray:
    """Return (x + iy)/(1 − z) of points (..., 3) of the unit sphere."""
    return np.asarray((points[..., 0] + 1j * points[..., 1]) / (1 - points[..., 2]), complex)


def power_diagram_on(surface: FreeformSurface, panel_size: float) -> Shell:
    """Return hexagons that touch a part of an ellipsoid: the lifted triangular lattice of sites.

    Stereographic projection is from the point opposite to the middle of the part, so that panels
    are alike; lattice points outside the part are left out.

    Parameters
    ----------
    surface : FreeformSurface
        Part of an ellipsoid, parametric.
    panel_size : float
        Mean distance of neighbouring panels, mm.

    Raises
    ------
    SurfaceError
        If the surface is no part of an ellipsoid.
    LatticeError
        If no panel has all its neighbours on the surface.

    References
    ----------
    Thesis ch. 5.
    """
    frame = ellipsoid_of(surface)
    patch = sample_patch(surface)
    corner = patch.points[patch.triangles]
    areas = np.linalg.norm(
        np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1
    )
    middle = (areas[:, None] * corner.mean(axis=1)).sum(axis=0) / areas.sum()
    frame = frame.turned(_farthest(frame, patch.points, middle - frame.centre))
    w = stereographic(frame.on_sphere(patch.points))
    a, b, c = w[patch.triangles].T
    mirrored = bool(np.sum(((b - a).conj() * (c - a)).imag) < 0)
    found = chart_lattice(patch, w.conj() if mirrored else w, panel_size)
    sites = found.places.conj() if mirrored else found.places
    panels = np.bincount(found.triangles.ravel(), minlength=len(sites)) == 6
    return power_diagram_mesh(frame, sites, panels=panels)

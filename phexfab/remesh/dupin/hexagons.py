"""Hexagons dual to a triangulation of a surface: tangent duality, Dupin centres, planar faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import LatticeError, SolveError
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.dupin.duality import dupin_centre
from phexfab.remesh.triangulations.valid import Triangulation

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

PARABOLIC = 0.05
"""Below this |κ| over the greatest |κ| at a corner a triangle counts as parabolic."""


def parabolic_triangles(triangulation: Triangulation, share: float = PARABOLIC) -> BoolArray:
    """Return (m,) True for triangles in a parabolic region.

    There the lesser |κ| of a corner is below ``share`` of the greater, or the sign of the Gaussian
    curvature changes between the corners.
    """
    bending = triangulation.surface.bending(triangulation.parameters)
    kappa = np.abs(bending.kappa)
    ratio = kappa.min(-1) / np.maximum(kappa.max(-1), 1e-300)
    low = (ratio[triangulation.triangles] < share).any(axis=1)
    sign = np.sign(bending.gauss)[triangulation.triangles]
    return np.asarray(low | (sign.min(axis=1) != sign.max(axis=1)))


def dupin_centres(
    triangulation: Triangulation, *, parabolic: float = PARABOLIC, rule: str = "flat"
) -> FloatArray:
    """Return the Dupin centres (m, 3) of the triangles, the mean of those of the three corners.

    At each corner the other two are projected to the tangent plane there, and the centre of the
    Dupin conic through the three is taken.

    Parameters
    ----------
    triangulation : Triangulation
    parabolic : float
        See ``parabolic_triangles``.
    rule : "centroid" or "flat"
        What is taken in a parabolic region: the triangle's centroid, as the thesis has it, or the
        centroid moved to the Dupin centre across the flat direction only, by a regularised solve.

    References
    ----------
    Thesis §5.1.4.
    """
    if rule not in ("centroid", "flat"):
        raise LatticeError(f'rule = "{rule}": "centroid" or "flat"')
    corner = triangulation.points[triangulation.triangles]
    bending = triangulation.surface.bending(triangulation.parameters)
    region = parabolic_triangles(triangulation, parabolic)
    centroid = corner.mean(axis=1)
    total = np.zeros((len(corner), 3))
    for k in range(3):
        at = triangulation.triangles[:, k]
        axes, kappa = bending.directions[at], bending.kappa[at]
        gap = np.roll(corner, -k, axis=1) - corner[:, k][:, None]
        flat = np.einsum("mij,mkj->mki", axes, gap)
        centre = dupin_centre(flat, kappa)
        middle = flat.mean(axis=1)
        if rule == "flat":
            # κ²/(κ² + ε²) lets go of the flat direction as its curvature fades.
            size = np.abs(kappa).max(-1, keepdims=True)
            trust = kappa**2 / (kappa**2 + (parabolic * size) ** 2 + 1e-300)
            with np.errstate(all="ignore"):
                moved = np.where(trust > 0, (centre - middle) * trust, 0.0)
            # None leaves its triangle by more than its size.
            reach = np.linalg.norm(flat - middle[:, None], axis=2).max(axis=1)
            length = np.linalg.norm(moved, axis=1)
            short = np.minimum(1.0, reach / np.maximum(length, 1e-300))[:, None]
            centre = middle + np.where(region[:, None], short, 1.0) * moved
        lifted = np.einsum("mi,mij->mj", centre, axes) + corner[:, k]
        total += np.where(np.isfinite(lifted), lifted, centroid)
    mean = total / 3
    if rule == "centroid":
        mean = np.where(region[:, None], centroid, mean)
    return np.asarray(mean)


def tangent_points(triangulation: Triangulation) -> FloatArray:
    """Return the points (m, 3) where the tangent planes at the corners of triangles meet.

    Raises
    ------
    SolveError
        If three of the planes are parallel to a line to rounding, as on developable pieces.
    """
    normals = triangulation.surface.normal(triangulation.parameters)[triangulation.triangles]
    corner = triangulation.points[triangulation.triangles]
    centroid = corner.mean(axis=1)
    height = (normals * (corner - centroid[:, None])).sum(-1)
    det = np.abs(np.linalg.det(normals))
    if det.min(initial=1.0) < 1e-13:
        bad = int(det.argmin())
        raise SolveError(
            f"{triangulation.surface.name}: the tangent planes of triangle {bad} at "
            f"{centroid[bad].round(3).tolist()} do not meet (a parabolic place); use dupin_hexagons"
        )
    return np.asarray(centroid + np.linalg.solve(normals, height[..., None])[..., 0])


def dual_polygons(triangulation: Triangulation, places: FloatArray) -> tuple[PolyMesh, IntArray]:
    """Return the dual mesh with a vertex in each triangle, and the points (f,) of its faces.

    Every point inside has a face, counter-clockwise about the surface's normal. ``places`` (m, 3)
    are the vertices; those of triangles without a face are left out.

    Raises
    ------
    LatticeError
        If no point has a closed star of triangles.
    """
    triangles = triangulation.triangles
    n = len(triangulation.points)
    owner = triangles.ravel()
    first = np.roll(triangles, -1, axis=1).ravel()
    second = np.roll(triangles, -2, axis=1).ravel()
    # Around a point, the triangle (p, a, b) is followed by (p, b, c).
    key = owner * n + first
    order = np.argsort(key, kind="stable")
    wanted = owner * n + second
    slot = np.minimum(np.searchsorted(key[order], wanted), len(order) - 1)
    found = key[order][slot] == wanted
    following = np.where(found, order[slot], -1)
    valence = np.bincount(owner, minlength=n)
    whole = valence > 2
    whole[owner[~found]] = False
    centres = np.flatnonzero(whole)
    if not len(centres):
        raise LatticeError(
            f"{triangulation.surface.name}: no point has triangles all around; take a smaller step"
        )
    begin = np.full(n, -1)
    begin[owner[::-1]] = np.arange(len(owner))[::-1]
    rings = []
    for p in centres.tolist():
        ring = [int(begin[p])]
        while len(ring) < valence[p]:
            ring.append(int(following[ring[-1]]))
        rings.append(np.array(ring) // 3)
    used, slots = np.unique(np.concatenate(rings), return_inverse=True)
    starts = np.concatenate([[0], np.cumsum(valence[centres])])
    mesh = PolyMesh(places[used], slots.astype(np.int64), starts.astype(np.int64))
    return mesh, centres


def tangent_hexagons(triangulation: Triangulation) -> tuple[PolyMesh, IntArray]:
    """Return the tangent-dual mesh, its faces in tangent planes, and the points of its faces.

    Planar as it stands; whether faces cross themselves is ``simple_faces``' to say.

    Raises
    ------
    SolveError
        If tangent planes do not meet; see ``tangent_points``.

    References
    ----------
    Thesis §5.1.1.
    """
    return dual_polygons(triangulation, tangent_points(triangulation))


def crossing_message(triangulation: Triangulation, points: IntArray, crossing: IntArray) -> str:
    """Name the first crossing face, its place, its curvatures, and the remedy."""
    at = int(points[crossing[0]])
    surface = triangulation.surface
    kappa = surface.bending(triangulation.parameters[at]).kappa
    place = triangulation.points[at].round(3).tolist()
    radii = ", ".join("flat" if abs(k) < 1e-12 else f"{1 / k:.4g} mm" for k in kappa.tolist())
    return (
        f"{surface.name}: {len(crossing)} of {len(points)} faces cross themselves or are flung "
        f"out, first face {int(crossing[0])} about {place} (radii of curvature {radii}): rows must "
        "run near the flatter principal direction across parabolic curves and stay off asymptotic "
        "directions; "
        "pass another row field, a smaller step or a part of the surface, or leave such faces out "
        'with crossing="drop"'
    )

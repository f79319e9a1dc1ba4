"""Dupin duality in one tangent plane: conics through triangles, their centres, stars of triangles.

Everything is in coordinates along the principal directions: a surface with principal curvatures κ₁,
κ₂ has the Dupin indicatrix κ₁x² + κ₂y² = ±1, and a Dupin conic is a conic homothetic to it. The
centre of the Dupin conic through three points is where the tangent planes at those points meet, to
the order at which the surface is its osculating paraboloid.

References
----------
Wang, Liu, Yan, Chan, Ling and Sun 2008, "Hexagonal meshes with planar faces"; thesis §5.1.2–5.1.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import LatticeError
from phexfab.mesh.measures import simple_faces
from phexfab.mesh.polymesh import PolyMesh

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class DupinConic:
    """Conics κ₁(x − cx)² + κ₂(y − cy)² = level.

    Attributes
    ----------
    centre : (..., 2) float
    level : (...) float
        Homothetic to the indicatrix of that sign; 0 for a pair of asymptotic lines.
    kappa : (..., 2) float
    """

    centre: FloatArray
    level: FloatArray
    kappa: FloatArray

    def value(self, points: ArrayLike) -> FloatArray:
        """Return (...) how far points (..., 2) are off the conic: 0 on it."""
        gap = np.asarray(points, float) - self.centre
        return np.asarray((self.kappa * gap**2).sum(-1) - self.level)


def dupin_indicatrix(kappa: ArrayLike, count: int = 181) -> list[FloatArray]:
    """Return the Dupin indicatrix as polylines (k, 2), in units where curvatures are 1/length.

    Parameters
    ----------
    kappa : (2,)
        Principal curvatures.
    count : int
        Points of each polyline.

    Returns
    -------
    list of (count, 2) arrays
        An ellipse; four branches of the two hyperbolas; or, at a parabolic point, two lines. Open
        branches end at 4 times their vertex' distance.

    Raises
    ------
    LatticeError
        At a planar point, where no indicatrix exists.
    """
    k = np.asarray(kappa, float)
    if not np.abs(k).max() > 0:
        raise LatticeError(
            "both principal curvatures are 0: a planar point has no Dupin indicatrix"
        )
    reach = 1 / np.sqrt(np.where(k == 0, np.inf, np.abs(k)))
    if k[0] * k[1] > 0:
        t = np.linspace(0.0, 2 * np.pi, count)
        return [np.stack([np.cos(t), np.sin(t)], 1) / np.sqrt(np.abs(k))]
    if k[0] * k[1] == 0:
        line = np.linspace(-4.0, 4.0, count) * reach.max()
        flat = int(k[1] == 0)  # the coordinate along the lines
        out = []
        for sign in (1.0, -1.0):
            points = np.empty((count, 2))
            points[:, flat], points[:, 1 - flat] = line, sign * reach[1 - flat]
            out.append(points)
        return out
    t = np.linspace(-np.arccosh(4.0), np.arccosh(4.0), count)
    one = np.stack([np.cosh(t), np.sinh(t)], 1) / np.sqrt(np.abs(k))
    other = np.stack([np.sinh(t), np.cosh(t)], 1) / np.sqrt(np.abs(k))
    return [one, -one, other, -other]


def dupin_centre(triangles: ArrayLike, kappa: ArrayLike) -> FloatArray:
    """Return the Dupin centres (..., 2) of triangles (..., 3, 2).

    Not finite where κ₁κ₂ = 0 (no centre) or a triangle has no area.
    """
    corner = np.asarray(triangles, float)
    k = np.asarray(kappa, float)
    origin = corner[..., 0, :]
    one, two = corner[..., 1, :] - origin, corner[..., 2, :] - origin
    # κ·(p_i − p_0)∘(c − p_0) = ½ κ·(p_i − p_0)², two linear equations for κ∘(c − p_0).
    q1, q2 = 0.5 * (k * one**2).sum(-1), 0.5 * (k * two**2).sum(-1)
    with np.errstate(all="ignore"):
        det = one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0]
        mx = (q1 * two[..., 1] - q2 * one[..., 1]) / det
        my = (one[..., 0] * q2 - two[..., 0] * q1) / det
        return np.asarray(origin + np.stack([mx, my], axis=-1) / k)


def dupin_conic(triangles: ArrayLike, kappa: ArrayLike) -> DupinConic:
    """Return the unique Dupin conic through each triangle (..., 3, 2).

    Parameters
    ----------
    triangles : (..., 3, 2)
        Corners along the principal directions.
    kappa : (..., 2)
        Principal curvatures, neither 0.
    """
    corner = np.asarray(triangles, float)
    k = np.broadcast_to(np.asarray(kappa, float), (*corner.shape[:-2], 2))
    centre = dupin_centre(corner, k)
    level = (k[..., None, :] * (corner - centre[..., None, :]) ** 2).sum(-1).mean(-1)
    return DupinConic(centre, level, k)


def star_hexagon(triangles: ArrayLike, kappa: ArrayLike) -> FloatArray:
    """Return the Dupin hexagons (..., 6, 2) of the triangle stars of fundamental triangles.

    The star of (o, a, b) has its centre in the first corner o and the six neighbours a, b, b − a,
    −a, −b, a − b about it; its triangles are copies of the fundamental one, so that the six centres
    are c, b − c, c − a and their mirror images in o.
    """
    corner = np.asarray(triangles, float)
    o = corner[..., 0, :]
    a, b = corner[..., 1, :] - o, corner[..., 2, :] - o
    c = dupin_centre(corner, kappa) - o
    half = np.stack([c, b - c, c - a], axis=-2)
    return np.asarray(o[..., None, :] + np.concatenate([half, -half], axis=-2))


def star_is_valid(triangles: ArrayLike, kappa: ArrayLike) -> BoolArray:
    """Return (...) whether the Dupin hexagon of each triangle star is a simple polygon.

    The first of the equivalent conditions, for either sign of κ₁κ₂, by the polygon itself.
    """
    hexagons = star_hexagon(triangles, kappa)
    shape = hexagons.shape[:-2]
    flat = hexagons.reshape(-1, 6, 2)
    n = len(flat)
    solid = np.concatenate([flat, np.zeros((n, 6, 1))], axis=2).reshape(-1, 3)
    good = np.isfinite(flat).all(axis=(1, 2))
    mesh = PolyMesh(np.nan_to_num(solid), np.arange(6 * n), 6 * np.arange(n + 1))
    return np.asarray((simple_faces(mesh) & good).reshape(shape))


def centre_is_inside(triangles: ArrayLike, kappa: ArrayLike) -> BoolArray:
    """Return (...) whether the Dupin centre lies inside its triangle: validity for κ₁κ₂ > 0."""
    corner = np.asarray(triangles, float)
    centre = dupin_centre(corner, kappa)[..., None, :]
    one, two = corner - centre, np.roll(corner, -1, axis=-2) - centre
    areas = one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0]
    return np.asarray((areas > 0).all(-1) | (areas < 0).all(-1))


def free_of_conjugate_pairs(triangles: ArrayLike, kappa: ArrayLike) -> BoolArray:
    """Return (...) whether no pair of conjugate directions encloses all three edge directions.

    Validity for κ₁κ₂ > 0. If any pair does, so does one that begins at an edge direction: each edge
    is paired with its conjugate, and the other two are enclosed if they lie in the same of the two
    double wedges between the pair.
    """
    edge = _edges(triangles)
    k = np.asarray(kappa, float)[..., None, :]
    enclosed = np.zeros(edge.shape[:-2], bool)
    for i in range(3):
        begin = edge[..., i : i + 1, :]
        # conjugate to e: κ₁ e_x f_x + κ₂ e_y f_y = 0
        partner = np.stack([-(k * begin)[..., 1], (k * begin)[..., 0]], axis=-1)
        others = np.delete(edge, i, axis=-2)
        wedge = np.sign(_cross(begin, others) * _cross(others, partner))
        enclosed |= (wedge[..., 0] == wedge[..., 1]) | (wedge == 0).any(-1)
    return ~enclosed


def corners_on_both_branches(triangles: ArrayLike, kappa: ArrayLike) -> BoolArray:
    """Return (...) whether the corners lie on different branches of their Dupin hyperbola.

    Validity for κ₁κ₂ < 0: two corners on one branch, the third on the other.
    """
    corner = np.asarray(triangles, float)
    conic = dupin_conic(corner, kappa)
    # The axis that the hyperbola meets is the one whose curvature has the level's sign.
    axis = (conic.kappa[..., 1] * conic.level > 0).astype(int)
    gap = corner - conic.centre[..., None, :]
    along = np.take_along_axis(gap, axis[..., None, None], axis=-1)[..., 0]
    return np.asarray((along > 0).any(-1) & (along < 0).any(-1))


def directions_in_both_ranges(triangles: ArrayLike, kappa: ArrayLike) -> BoolArray:
    """Return (...) whether the edges are not all in one range between the asymptotic directions.

    Validity for κ₁κ₂ < 0: the normal curvatures of the three edges have both signs.
    """
    bend = (np.asarray(kappa, float)[..., None, :] * _edges(triangles) ** 2).sum(-1)
    return np.asarray((bend > 0).any(-1) & (bend < 0).any(-1))


def validity(triangles: ArrayLike, kappa: ArrayLike) -> FloatArray:
    """Return (...) a margin that is positive just for valid triangles, 1 for ideal ones.

    It is homogeneous and the same function for both signs: with the edges' normal curvature terms
    s_i = II(e_i, e_i), one corner's pair product is e_j·e_k = (s_i − s_j − s_k)/2, and the
    barycentric weights of the centre are s_i · (s_j + s_k − s_i). For κ₁κ₂ > 0 the margin is three
    times the least weight, over their sum. For κ₁κ₂ < 0 it is the distance of the s_i from having
    one sign: two thirds the lesser of −min s and max s, over the mean of |s|, where ideal ones have
    s = (1, −½, −½) up to scale and sign.
    """
    k = np.asarray(kappa, float)
    s = (k[..., None, :] * _edges(triangles) ** 2).sum(-1)
    weight = s * (s.sum(-1, keepdims=True) - 2 * s)
    with np.errstate(all="ignore"):
        elliptic = 3 * weight.min(-1) / weight.sum(-1)
        hyperbolic = (4 / 3) * np.minimum(s.max(-1), -s.min(-1)) / np.abs(s).mean(-1)
    return np.where(k.prod(-1) > 0, elliptic, hyperbolic)


def _edges(triangles: ArrayLike) -> FloatArray:
    corner = np.asarray(triangles, float)
    return np.asarray(np.roll(corner, -1, axis=-2) - corner)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])

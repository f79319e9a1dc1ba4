"""NURBS surfaces: rational tensor-product splines with exact derivatives."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import NdBSpline

from phexfab.errors import SurfaceError
from phexfab.surface.freeform.bending import Domain, FloatArray
from phexfab.surface.freeform.parametric import ParametricSurface


def nurbs(
    control: ArrayLike,
    knots: tuple[ArrayLike, ArrayLike],
    degrees: tuple[int, int],
    *,
    weights: ArrayLike | None = None,
    domain: Domain | None = None,
    periodic: tuple[bool, bool] = (False, False),
    flipped: bool = False,
    name: str = "NURBS surface",
) -> ParametricSurface:
    """Return a NURBS surface.

    Parameters
    ----------
    control : (n, m, 3) array_like
        Control points in mm.
    knots : two array_like
        n + p + 1 and m + q + 1 knots, multiplicities written out.
    degrees : (p, q)
    weights : (n, m) array_like, optional
        Positive; all 1 without it.
    domain : (u0, u1, v0, v1), optional
        A part of the parameter rectangle; the whole of it otherwise.
    periodic : (bool, bool)
        Whether the surface closes up smoothly in u or v.
    flipped : bool
        Whether the normal is −X_u × X_v.
    name : str

    Raises
    ------
    SurfaceError
        If the counts do not fit, a weight is not positive, or knots decrease.

    References
    ----------
    Piegl and Tiller 1997, "The NURBS Book", ch. 4.
    """
    poles = np.asarray(control, float)
    if poles.ndim != 3 or poles.shape[2] != 3:
        raise SurfaceError(f"{name}: control points have shape {poles.shape}, not (n, m, 3)")
    knot = [np.asarray(k, float).ravel() for k in knots]
    for side, (k, degree, count) in enumerate(zip(knot, degrees, poles.shape[:2], strict=True)):
        if len(k) != count + degree + 1 or count <= degree or (np.diff(k) < 0).any():
            raise SurfaceError(
                f"{name}: {count} control points of degree {degree} in {'uv'[side]} need "
                f"{count + degree + 1} knots that do not decrease; there are {len(k)}"
            )
    heft = np.ones(poles.shape[:2]) if weights is None else np.asarray(weights, float)
    if heft.shape != poles.shape[:2] or not (heft > 0).all():
        raise SurfaceError(f"{name}: weights must be positive and as many as control points")
    whole = tuple(
        float(k[i]) for k, d in zip(knot, degrees, strict=True) for i in (d, len(k) - d - 1)
    )
    box = whole if domain is None else tuple(float(bound) for bound in domain)
    if not (whole[0] <= box[0] < box[1] <= whole[1] and whole[2] <= box[2] < box[3] <= whole[3]):
        raise SurfaceError(f"{name}: domain {box} is not within the knots' {whole}")
    middle = poles.mean(axis=(0, 1))  # about the centre no digits are lost far from the origin
    raised = np.concatenate([(poles - middle) * heft[..., None], heft[..., None]], axis=2)
    spline = NdBSpline(tuple(knot), raised, tuple(degrees))

    def parts(u: FloatArray, i: int, j: int) -> FloatArray:
        if i > degrees[0] or j > degrees[1]:
            return np.zeros((len(u), 4))
        return np.asarray(spline(u, nu=(i, j), extrapolate=True))

    def value(u: FloatArray) -> FloatArray:
        a = parts(u, 0, 0)
        return np.asarray(middle + a[:, :3] / a[:, 3:])

    def jet(u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        a = parts(u, 0, 0)
        w = a[:, 3:]
        local = a[:, :3] / w
        au, av = parts(u, 1, 0), parts(u, 0, 1)
        xu, xv = ((d[:, :3] - d[:, 3:] * local) / w for d in (au, av))
        auu, auv, avv = parts(u, 2, 0), parts(u, 1, 1), parts(u, 0, 2)
        xuu = (auu[:, :3] - 2 * au[:, 3:] * xu - auu[:, 3:] * local) / w
        xvv = (avv[:, :3] - 2 * av[:, 3:] * xv - avv[:, 3:] * local) / w
        xuv = (auv[:, :3] - au[:, 3:] * xv - av[:, 3:] * xu - auv[:, 3:] * local) / w
        return middle + local, np.stack([xu, xv], axis=1), np.stack([xuu, xuv, xvv], axis=1)

    side = -1 if flipped else 1
    return ParametricSurface(name, value, jet, (box[0], box[1], box[2], box[3]), periodic, side)

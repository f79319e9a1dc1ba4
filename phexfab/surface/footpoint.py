"""Inverse problems on a minimal surface: the foot point of a point, the place of a normal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from phexfab.errors import SurfaceError
from phexfab.surface.holomorphic import ComplexArray, show

if TYPE_CHECKING:
    from phexfab.surface.weierstrass import MinimalSurface

STEPS = 60


def foot_parameter(surface: MinimalSurface, points: ArrayLike, guess_z: ArrayLike) -> ComplexArray:
    """Return the parameters of the foot points of ``points`` on the surface.

    Newton on the squared distance: the Gauss–Newton step in the tangent plane, corrected by
    ``d`` times the second form, which makes it quadratic at any distance below the radius of
    curvature.

    Parameters
    ----------
    surface : MinimalSurface
    points : (..., 3) float, in mm
    guess_z : (...) complex

    Raises
    ------
    SurfaceError
        If an iteration does not settle; the message names the guess.
    """
    target = np.asarray(points, float)
    z = np.array(np.broadcast_to(np.asarray(guess_z, complex), target.shape[:-1]))
    target, shape, z = target.reshape(-1, 3), z.shape, z.ravel()
    guess = z.copy()
    todo = np.arange(len(z))
    gap = target - surface.point(z)
    for _ in range(STEPS):
        now = z[todo]
        phi = surface.scale * surface.tangent(now)
        first = 0.5 * (phi.real**2 + phi.imag**2).sum(-1)
        height = (gap[todo] * surface.normal(now)).sum(-1)
        slope = (phi * gap[todo]).sum(-1).conj()  # <gap, X_u> + i <gap, X_v>
        # Hessian λ² - <gap, X_ij>; its normal part is h·II = -h Re(Q dz²), so that the step d
        # solves λ² d + B conj(d) = slope with B = h conj(Q): along the principal directions the
        # factors are λ² ± |B|, kept away from zero beyond the centre of curvature.
        turning = surface.scale * surface.hopf(now).conj()
        bend = turning * height
        axis = np.exp(0.5j * np.angle(bend))
        along = slope * axis.conj()
        with np.errstate(all="ignore"):
            stiff, soft = first + np.abs(bend), np.maximum(first - np.abs(bend), 0.1 * first)
            step = axis * (along.real / stiff + 1j * along.imag / soft)
            # No step turns the normal by more than about a radian: beyond, the model is worthless.
            step /= np.maximum(1.0, np.abs(step * turning) / np.sqrt(first))
        lost = ~np.isfinite(step)
        if lost.any():
            todo = todo[lost]
            break
        # Backtrack where the distance would grow by more than rounding.
        best = (gap[todo] ** 2).sum(-1)
        share, open_ = np.ones(len(todo)), np.arange(len(todo))
        fresh, fresh_gap = now + step, np.empty((len(todo), 3))
        for _ in range(20):
            fresh[open_] = now[open_] + share[open_] * step[open_]
            fresh_gap[open_] = target[todo[open_]] - surface.point(fresh[open_])
            grown = (fresh_gap[open_] ** 2).sum(-1) > best[open_] * (1 + 1e-12) + 1e-300
            small = np.abs(step[open_]) <= 1e-12 * (1 + np.abs(now[open_]))
            open_ = open_[grown & ~small]
            if not len(open_):
                break
            share[open_] *= 0.5
        z[todo], gap[todo] = fresh, fresh_gap
        todo = todo[np.abs(fresh - now) > 1e-12 * (1 + np.abs(now))]
        if not len(todo):
            return z.reshape(shape)
    raise SurfaceError(
        f"{surface.name}: no foot point was found from z = {show(guess[todo[0]])} for the point "
        f"{target[todo[0]].round(6).tolist()}; give a closer guess"
    )


def normal_parameter(
    surface: MinimalSurface, normals: ArrayLike, guess_z: ArrayLike
) -> ComplexArray:
    """Return the parameters near ``guess_z`` where the surface has the given unit normals.

    Newton on the Gauss map after a rotation of the sphere (a Möbius map in SU(2)) that takes the
    wanted normal to the south pole, where the rotated Gauss map is zero; the pole of g does no
    harm.

    Parameters
    ----------
    surface : MinimalSurface
    normals : (..., 3) float
    guess_z : (...) complex

    Raises
    ------
    SurfaceError
        If an iteration does not settle, or g is stationary; the message names both.
    """
    n = np.asarray(normals, float)
    z = np.array(np.broadcast_to(np.asarray(guess_z, complex), n.shape[:-1]))
    n, shape, z = n.reshape(-1, 3), z.shape, z.ravel()
    guess = z.copy()
    # The spinor (p, q) with p/q = g(n), of unit length, from the better conditioned side.
    along = n[:, 0] + 1j * n[:, 1]
    south = n[:, 2] <= 0
    p = np.where(south, along, 1 + n[:, 2])
    q = np.where(south, 1 - n[:, 2], along.conj())
    length = np.sqrt(np.abs(p) ** 2 + np.abs(q) ** 2)
    p, q = p / length, q / length
    todo = np.arange(len(z))
    for _ in range(STEPS):
        now, a, b = z[todo], p[todo], q[todo]
        g, slope, side = surface._chart(now)
        with np.errstate(all="ignore"):
            # In the chart 1/g numerator and denominator are both multiplied by it.
            top = np.where(side < 0, b * g - a, b - a * g)
            bottom = np.where(side < 0, a.conj() * g + b.conj(), a.conj() + b.conj() * g)
            step = side * top * bottom / slope
            # Far from the target Newton overshoots: there the angle is what shrinks.
            far = np.abs(top) > 0.7 * np.abs(bottom)
            step = np.where(far, step / (1 + np.abs(top / bottom) ** 2), step)
        if not np.isfinite(step).all():
            break
        z[todo] = now + step
        todo = todo[np.abs(step) > 1e-14 * (1 + np.abs(now))]
        if not len(todo):
            return z.reshape(shape)
    i = int(todo[0])
    raise SurfaceError(
        f"{surface.name}: no parameter near z = {show(guess[i])} has the normal "
        f"{n[i].round(6).tolist()}; give a closer guess, or the normal is beyond an umbilic"
    )

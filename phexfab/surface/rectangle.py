"""Is a rectangle of curvature-line coordinates free of umbilics, branch points and ends?

The rectangle is covered by discs. On each one z(w) must be a single step of the continuation
(Q keeps within half of its value, so it has no zero or pole there), and the null curve's
derivative φ dz/dw must be analytic: its Laurent coefficients of negative order vanish. The second
test finds ends that the coordinates do not feel. Discs that fail are cut into four, until they
are so small that a singular point is in them for certain. Last, the places that the continuation
from w = 0 gives at the corners of every disc must agree with the disc's own, or the sheet is torn
by a singular point between w = 0 and the rectangle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import SurfaceError
from phexfab.surface.continuation import Germ, describe, hop
from phexfab.surface.holomorphic import CIRCLE, ComplexArray, show
from phexfab.surface.weierstrass import MinimalSurface

LEVELS = 9
COARSE = 4  # discs along the shorter side, to begin with
CORNERS = np.array([1 + 1j, -1 + 1j, -1 - 1j, 1 - 1j])


def check_rectangle(
    surface: MinimalSurface, u: tuple[float, float], v: tuple[float, float]
) -> None:
    """Refuse a closed rectangle in w that contains an umbilic, a branch point or an end.

    Parameters
    ----------
    surface : MinimalSurface
    u, v : (float, float)
        The sides, in curvature-line coordinates.

    Raises
    ------
    SurfaceError
        If a side is empty, or the rectangle meets a singular point or is torn by one; the message
        says what it is and where, in z and in w.
    """
    (u0, u1), (v0, v1) = u, v
    if not (np.isfinite([u0, u1, v0, v1]).all() and u0 < u1 and v0 < v1):
        raise SurfaceError(
            f"{surface.name}: the rectangle u = [{u0}, {u1}], v = [{v0}, {v1}] is empty; "
            "give each side from smaller to larger"
        )
    unit = min(u1 - u0, v1 - v0) / COARSE
    nu, nv = round((u1 - u0) / unit), round((v1 - v0) / unit)
    half = complex((u1 - u0) / nu, (v1 - v0) / nv) / 2
    columns, rows = np.meshgrid(np.arange(nu), np.arange(nv), indexing="ij")
    centres = (
        complex(u0, v0)
        + half.real * (2 * columns.ravel() + 1)
        + 1j * half.imag * (2 * rows.ravel() + 1)
    )
    where = f"{surface.name}: the rectangle u = [{u0:g}, {u1:g}], v = [{v0:g}, {v1:g}]"
    for level in range(LEVELS):
        germs, good = _analytic_discs(surface, centres, abs(half))
        _check_sheet(surface, germs[good], half, where)
        if good.all():
            return
        if level < LEVELS - 1:
            half = half / 2
            shifts = half.real * CORNERS.real + 1j * half.imag * CORNERS.imag
            centres = (centres[~good, None] + shifts).ravel()
    i = int(np.flatnonzero(~good)[0])
    what, z, w = describe(surface.hopf, germs.z[i], germs.w[i], germs.root[i])
    kind = _kind(surface, z)
    raise SurfaceError(
        f"{where} contains {kind} at z = {show(z)}, w = {show(w)} ({what}); "
        "choose a rectangle that avoids it"
    )


def _analytic_discs(
    surface: MinimalSurface, centres: ComplexArray, radius: float
) -> tuple[Germ, NDArray[np.bool_]]:
    """Return the germs at the centres of discs, and on which of them the surface is regular."""
    z = surface.parameter(centres)
    q = surface.hopf(z)
    with np.errstate(all="ignore"):
        germs = Germ(centres, z, q, np.sqrt(q))
    n, k = len(centres), len(CIRCLE)
    # Of the two roots the right one is unknown when z(w) is a closed form, and immaterial here:
    # the other one turns the disc by half a turn.
    spread = germs[np.repeat(np.arange(n), k)]
    rim, sure = hop(surface.hopf, spread, spread.w + np.tile(1.05 * radius * CIRCLE, n))
    good = sure.reshape(n, k).all(1)
    tangents = np.zeros((n, k, 3), complex)
    some = np.flatnonzero(np.repeat(good, k))
    with np.errstate(all="ignore"):
        tangents.reshape(-1, 3)[some] = surface._phi(rim.z[some]) / rim.root[some, None]
        series = np.abs(np.fft.fft(tangents, axis=1))
        # From order -8 on a negative order is also the alias of a large positive one.
        good &= series[:, -8:].max((1, 2)) <= 1e-3 * series.max((1, 2))
    return germs, good


def _check_sheet(surface: MinimalSurface, germs: Germ, half: complex, where: str) -> None:
    """Refuse when the continuation from w = 0 and a disc disagree at a corner of the disc."""
    if not len(germs.w):
        return
    shifts = half.real * CORNERS.real + 1j * half.imag * CORNERS.imag
    spread = germs[np.repeat(np.arange(len(germs.w)), 4)]
    shift = np.tile(shifts, len(germs.w))
    size = abs(half) / np.abs(spread.root)
    corners = surface.parameter(spread.w + shift)
    ahead = hop(surface.hopf, spread, spread.w + shift)[0].z
    behind = hop(surface.hopf, spread, spread.w - shift)[0].z
    gap = np.minimum(np.abs(corners - ahead), np.abs(corners - behind))
    torn = np.flatnonzero(~(gap <= 1e-3 * size))
    if len(torn):
        w = spread.w[torn[0]]
        raise SurfaceError(
            f"{where} is torn near w = {show(w)}: a singular point lies between w = 0 and the "
            "rectangle, whose parts are reached on different sides of it; choose a rectangle "
            "nearer to w = 0, or another base"
        )


def _kind(surface: MinimalSurface, z: complex) -> str:
    """Say what the surface does at a singular point: from the growth of ds near it."""
    with np.errstate(all="ignore"):
        near, nearer = (np.abs(surface._phi(z + r * CIRCLE)).max(1).mean() for r in (1e-3, 1e-4))
    if not np.isfinite(z) or abs(z) > 1e4:
        return "a point that the parameter z does not reach"
    if not np.isfinite(nearer) or nearer > 2 * near:
        return "an end"
    return "a branch point" if nearer < 0.5 * near else "an umbilic"

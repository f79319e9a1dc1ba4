"""Is a rectangle of curvature-line coordinates free of umbilics, branch points and ends?

The rectangle is covered by discs. On each one z(w) must be a single step of the continuation
(Q keeps within half of its value, so it has no zero or pole there), and the null curve's
derivative φ dz/dw must be analytic: its Laurent coefficients of negative order vanish. The second
test finds ends that the coordinates do not feel. Discs that fail are cut into four, until a zero
or pole of Q is found in one, or they are so small that a singular point is near for certain. Last,
the places that the continuation from w = 0 gives at the corners of every disc must agree with the
disc's own, or the sheet is torn by a singular point between w = 0 and the rectangle.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import SurfaceError
from phexfab.surface.continuation import (
    INFINITY,
    ZERO_OR_POLE,
    Germ,
    continue_from_base,
    describe,
    hop,
    march,
)
from phexfab.surface.holomorphic import CIRCLE, ComplexArray, show
from phexfab.surface.weierstrass import MinimalSurface, Rectangle

LEVELS = 9
MOST = 3000  # failed discs; with more of them the rectangle spans too many scales to be a shell
LOOKED_AT = 12  # failed discs per level in which a zero or pole is looked for
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
    covered: list[tuple[Germ, complex]] = []
    parents: Germ | None = None
    try:
        for level in range(LEVELS):
            germs = _germs(surface, centres, parents, 1e-3 * abs(half))
            good = _analytic_discs(surface, germs, abs(half))
            covered.append((germs[good], half))
            if good.all():
                break
            failed = germs[~good]
            last = level == LEVELS - 1 or len(failed.w) > MOST
            found = _singularity(surface, failed, half, (u0, u1, v0, v1), last)
            if found:
                raise SurfaceError(f"{where} {found}; choose a rectangle that avoids it")
            half = half / 2
            parents = failed[np.repeat(np.arange(len(failed.w)), 4)]
            centres = parents.w + np.tile(_corners(half), len(failed.w))
        # Without closed forms a regular rectangle about w = 0 cannot be torn.
        if surface.from_curvature is not None or not (u0 <= 0 <= u1 and v0 <= 0 <= v1):
            for germs, half in covered:
                _check_sheet(surface, germs, half, where)
    except SurfaceError as error:
        if str(error).startswith(where):
            raise
        raise SurfaceError(f"{where} cannot be reached: {error}") from error


def _corners(half: complex) -> ComplexArray:
    return half.real * CORNERS.real + 1j * half.imag * CORNERS.imag


def _germs(surface: MinimalSurface, w: ComplexArray, parents: Germ | None, ahead: float) -> Germ:
    """Return the germs at ``w``; with a closed form the root is read off the step to w + ahead."""
    if surface.from_curvature is None:
        if parents is None:
            return continue_from_base(surface.hopf, surface.base, w)
        return march(surface.hopf, parents, w)[0]
    z, beyond = surface.parameter(w), surface.parameter(w + ahead)
    q = surface.hopf(z)
    with np.errstate(all="ignore"):
        root = np.sqrt(q)
        return Germ(w, z, q, np.where(((beyond - z) * root).real < 0, -root, root))


def _analytic_discs(surface: MinimalSurface, germs: Germ, radius: float) -> NDArray[np.bool_]:
    """Return on which of the discs about the germs the surface is regular."""
    n, k = len(germs.w), len(CIRCLE)
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
    return good


def _singularity(
    surface: MinimalSurface, failed: Germ, half: complex, box: Rectangle, last: bool
) -> str:
    """Say what makes discs fail, if it is certain already; at the ``last`` level say it anyway."""
    u0, u1, v0, v1 = box
    slack = 1e-9 * max(u1 - u0, v1 - v0)
    n = len(failed.w)
    best = ""
    for i in np.linspace(0, n - 1, min(n, LOOKED_AT)).astype(int):
        what, z, w = describe(surface.hopf, failed.z[i], failed.w[i], failed.root[i])
        inside = u0 - slack <= w.real <= u1 + slack and v0 - slack <= w.imag <= v1 + slack
        verb = "contains" if inside else "comes too close to"
        at = f"z = {show(z)}, w = {show(w)}"
        text = f"{verb} {_kind(surface, what, z)} at {at} ({what})"
        if what.startswith((*ZERO_OR_POLE, INFINITY)):
            if inside and abs(w - failed.w[i]) <= 4 * abs(half):
                return text
            best = text
        best = best or text
    return best if last else ""


def _check_sheet(surface: MinimalSurface, germs: Germ, half: complex, where: str) -> None:
    """Refuse when the continuation from w = 0 and a disc disagree at a corner of the disc."""
    spread = germs[np.repeat(np.arange(len(germs.w)), 4)]
    # A little beyond the corners, so that a tear along the border of two discs is seen too.
    corners = spread.w + np.tile(1.02 * _corners(half), len(germs.w))
    gap = np.abs(surface.parameter(corners) - hop(surface.hopf, spread, corners)[0].z)
    torn = np.flatnonzero(~(gap * np.abs(spread.root) <= 1e-3 * abs(half)))
    if len(torn):
        w = spread.w[torn[0]]
        raise SurfaceError(
            f"{where} is torn near w = {show(w)}: a singular point lies between w = 0 and the "
            "rectangle, whose parts are reached on different sides of it; choose a rectangle "
            "nearer to w = 0, or another base"
        )


def _kind(surface: MinimalSurface, what: str, z: complex) -> str:
    """Say what the surface does at a singular point: from the growth of ds near it."""
    if what == INFINITY:
        return "a point that the parameter z does not reach"
    with np.errstate(all="ignore"):
        near, nearer = (np.abs(surface._phi(z + r * CIRCLE)).max(1).mean() for r in (1e-3, 1e-4))
    if not np.isfinite(nearer) or nearer > 2 * near:
        return "an end"
    return "a branch point" if nearer < 0.5 * near else "an umbilic"

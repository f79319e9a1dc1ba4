"""Spacing of a rectangle's rows and columns that makes panels more even in size.

A panel on curvature-line coordinates w measures ``step/√κ``, so sizes vary with the curvature.
Spacing functions ``u = U(p)``, ``v = V(q)`` of a regular lattice in (p, q) keep both families of
curvature lines and change a panel to ``step·√(U'V'/κ)``; the least-squares ones are averages of
log κ along the other family. They also change the ratio of row distance to step, by ``V'/U'``,
which is held inside ``RATIOS`` (the lattice's own ratio gives way if need be): at ½ edges vanish
(thesis §5.1.3), far above panels are slender.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline, CubicSpline

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Even = tuple[FloatArray, FloatArray]
RATIOS = (0.6, 1.6)
"""Least and largest local row ratio of a graded lattice."""
_SHARES = np.linspace(0.0, 1.0, 21)


@dataclass(frozen=True, eq=False)
class Grading:
    """Spacing functions of a rectangle, tabled.

    Attributes
    ----------
    u, v : (n,) float
        Places on the rectangle's sides, rising.
    p, q : (n,) float
        The even coordinates of these places; they have the same ends.
    du, dv : (n,) float
        The derivatives U'(p) and V'(q) there.
    row_ratio : float
        Of the lattice in (p, q).
    """

    u: FloatArray
    v: FloatArray
    p: FloatArray
    q: FloatArray
    du: FloatArray
    dv: FloatArray
    row_ratio: float

    def place(self, points: ComplexArray) -> ComplexArray:
        """Return U(p) + iV(q) of points p + iq; beyond the rectangle the spacing stays even."""
        return _through(self.p, self.u, self.du, points.real) + 1j * _through(
            self.q, self.v, self.dv, points.imag
        )

    def sizes(self, stretch: FloatArray, rows_along: str) -> FloatArray:
        """Return mean distances of panel centres for step 1, at every (v, u) of ``stretch``."""
        along, across = self.du[None, :], self.dv[:, None]
        if rows_along == "v":
            along, across = across, along
        slant = np.hypot(along / 2, self.row_ratio * across)
        return np.asarray(stretch * (along + 2 * slant) / 3)


def grading(
    u: FloatArray,
    v: FloatArray,
    stretch: FloatArray,
    evenness: float,
    *,
    row_ratio: float,
    rows_along: str = "u",
    closed: str | None = None,
) -> Grading:
    """Return the spacing functions that make panels most even in size, or a share of them.

    Parameters
    ----------
    u, v : (n,), (m,) float
        Evenly spaced samples of the rectangle's sides.
    stretch : (m, n) float
        mm per unit of w, ``1/√κ``.
    evenness : float
        0 for even spacing in w, 1 for the most even sizes that ``RATIOS`` allow.
    row_ratio, rows_along
        Of the lattice, see ``lattice``.
    closed : ``"u"`` or ``"v"``, optional
        Coordinate that closes around a ring: it stays evenly spaced.
    """
    goal = -2 * np.log(stretch)
    along_u = np.zeros(len(u)) if closed == "u" else goal.mean(axis=0)
    along_v = np.zeros(len(v)) if closed == "v" else goal.mean(axis=1)

    def make(even_u: Even, even_v: Even) -> Grading | None:
        (p, du), (q, dv) = even_u, even_v
        ratio = dv[:, None] / du[None, :]
        low, high = (1 / ratio.max(), 1 / ratio.min()) if rows_along == "v" else _ends(ratio)
        low, high = row_ratio * low, row_ratio * high
        least, most = min(RATIOS[0], row_ratio), max(RATIOS[1], row_ratio)
        if high / low > most / least * (1 + 1e-12):
            return None
        shift = least / low if low < least else min(1.0, most / high)
        return Grading(u, v, p, q, du, dv, row_ratio * shift)

    evens_u = [_even(u, share * along_u) for share in _SHARES]
    evens_v = [_even(v, share * along_v) for share in _SHARES]
    best, least_spread = (0, 0), np.inf
    for i, even_u in enumerate(evens_u):
        for j, even_v in enumerate(evens_v):
            made = make(even_u, even_v)
            if made is None:
                continue
            # Most panels alike, and no extremes.
            sizes = np.log(made.sizes(stretch, rows_along))
            spread = float(sizes.std() + np.ptp(sizes) / 4)
            if spread < least_spread - 1e-12:
                best, least_spread = (i, j), spread
    share_u, share_v = evenness * _SHARES[list(best)]
    found = make(_even(u, share_u * along_u), _even(v, share_v * along_v))
    # A share of an admissible grading is admissible: the range of its ratios is narrower.
    return found if found is not None else Grading(u, v, u, v, 0 * u + 1, 0 * v + 1, row_ratio)


def _ends(values: FloatArray) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _even(x: FloatArray, log_spacing: FloatArray) -> Even:
    """Return the even coordinates of x, with the same ends, and dx/d(even)."""
    density = np.exp(log_spacing.mean() - log_spacing)
    total = _integral(x, density)
    share = (x[-1] - x[0]) / total[-1]
    even = x[0] + share * total
    even[-1] = x[-1]
    return even, 1 / (share * density)


def _integral(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the running integral of samples by a cubic spline through them."""
    return np.asarray(CubicSpline(x, y).antiderivative()(x), float)


def _through(even: FloatArray, x: FloatArray, slope: FloatArray, at: FloatArray) -> FloatArray:
    """Return x at even coordinates, by Hermite interpolation, straight on beyond the ends."""
    held = np.clip(at, even[0], even[-1])
    beyond = (at - held) * np.where(at > held, slope[-1], slope[0])
    return np.asarray(CubicHermiteSpline(even, x, slope)(held) + beyond, float)

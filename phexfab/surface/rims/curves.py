"""Exact curves of drawings and CAD models as pieces of a rim: conics, rational splines."""

from __future__ import annotations

from itertools import pairwise
from math import comb

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline

from phexfab.surface.rims.pieces import Piece, line, spline

FloatArray = NDArray[np.float64]


def ellipse_arc(
    centre: ArrayLike, first_axis: ArrayLike, second_axis: ArrayLike, start: float, end: float
) -> Piece:
    """Return centre + cos φ · first_axis + sin φ · second_axis for φ from start to end (radians).

    The axes (3,) are the half-axes in mm; a circle has two of equal length.
    """
    c, u, v = (np.asarray(value, dtype=float) for value in (centre, first_axis, second_axis))
    width = end - start

    def values(s: FloatArray, order: int) -> FloatArray:
        # Each derivative turns by a quarter.
        phi = start + s * width + 0.5 * np.pi * order
        out = np.cos(phi)[:, None] * u + np.sin(phi)[:, None] * v
        return c + out if order == 0 else out * width**order

    return Piece(values)


def nurbs(
    degree: int,
    knots: ArrayLike,
    controls: ArrayLike,
    weights: ArrayLike | None = None,
    first: float | None = None,
    last: float | None = None,
) -> list[Piece]:
    """Return the pieces of a spline curve, cut at knots where it may have a kink.

    Parameters
    ----------
    degree, knots, controls
        (n + degree + 1,) knots, clamped or not, and (n, 3) control points in mm.
    weights
        (n,) of a rational spline.
    first, last
        The stretch of the parameter; by default all of the spline's domain.
    """
    t, net = np.asarray(knots, dtype=float), np.asarray(controls, dtype=float)
    low = float(t[degree]) if first is None else first
    high = float(t[len(net)]) if last is None else last
    near = 1e-9 * (high - low)  # files write parameters with rounding
    within = t[(t > low + near) & (t < high - near)]
    if degree == 1:
        polyline = BSpline(t, net, 1)  # weights only change the speed along a chord
        ends = np.unique(np.concatenate([[low, high], within]))
        corners = polyline(ends)
        return [line(a, b) for a, b in pairwise(corners)]
    inner, multiplicity = np.unique(within, return_counts=True)
    ends = np.concatenate([[low], inner[multiplicity >= degree], [high]])
    w = None if weights is None else np.asarray(weights, dtype=float)
    if w is None or np.ptp(w) <= 1e-15 * np.abs(w).max():
        curve = BSpline(t, net, degree)
        return [spline(curve, a, b) for a, b in pairwise(ends.tolist())]
    raised = BSpline(t, np.column_stack([net * w[:, None], w]), degree)
    return [_rational(spline(raised, a, b)) for a, b in pairwise(ends.tolist())]


def _rational(raised: Piece) -> Piece:
    """The quotient of the first three coordinates of a piece in (n, 4) by the fourth."""

    def values(s: FloatArray, order: int) -> FloatArray:
        above = [raised.values(s, k) for k in range(order + 1)]
        found: list[FloatArray] = []
        for k in range(order + 1):  # Leibniz: (w C)' = w' C + w C', and so on
            rest = above[k][:, :3].copy()
            for i in range(1, k + 1):
                rest -= comb(k, i) * above[i][:, 3:] * found[k - i]
            found.append(rest / above[0][:, 3:])
        return found[order]

    return Piece(values, knots=raised.knots)

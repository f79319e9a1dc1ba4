"""Complex analysis by samples on small circles: derivatives, removable points, poles.

The trapezoid rule on a circle is spectrally accurate for analytic functions, so that Laurent
coefficients, derivatives and the value at a removable 0/0 come out to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

ComplexArray = NDArray[np.complex128]
ComplexMap = Callable[[ComplexArray], Any]

NODES = 32
CIRCLE: ComplexArray = np.exp(2j * np.pi * np.arange(NODES) / NODES)
RADII = (0.05, 0.0125, 0.003, 0.0008)


def show(z: complex) -> str:
    """Return a complex number as text for a message, like ``0.5+1i``."""
    z = complex(z)
    speck = 1e-12 * max(1.0, abs(z))
    real, imag = (0.0 if abs(x) < speck else x for x in (z.real, z.imag))
    return f"{real:.6g}{imag:+.6g}i" if imag else f"{real:.6g}"


def evaluate(function: ComplexMap, z: ArrayLike) -> ComplexArray:
    """Return ``function(z)`` as a new complex array of the shape of ``z``, without warnings.

    A constant function may return a scalar; values that overflow or divide by zero come back
    as they are, not finite.
    """
    points = np.asarray(z, complex)
    with np.errstate(all="ignore"):
        values = np.array(function(points), complex)
    return values if values.shape == points.shape else np.broadcast_to(values, points.shape).copy()


def laurent(function: ComplexMap, z: ComplexArray, radius: float) -> ComplexArray:
    """Return the Laurent coefficients ``c_k radius^k`` about each of ``z``.

    Parameters
    ----------
    function : callable
        Maps (n, NODES) parameters to (n, NODES) or (n, NODES, c) values.
    z : (n,) complex
    radius : float
        Radius of the circle that is sampled.

    Returns
    -------
    (n, NODES) or (n, NODES, c) complex
        Index ``k`` for ``k >= 0`` and ``-k`` for the principal part, as in an FFT.
    """
    with np.errstate(all="ignore"):
        return np.fft.fft(function(z[:, None] + radius * CIRCLE), axis=1) / NODES


def _is_analytic(coefficients: ComplexArray, tolerance: float) -> NDArray[np.bool_]:
    """Return per row whether the principal part and the high tail are negligible."""
    rows = np.abs(coefficients.reshape(len(coefficients), NODES, math.prod(coefficients.shape[2:])))
    with np.errstate(invalid="ignore"):
        return rows[:, NODES // 4 :].max((1, 2)) <= tolerance * rows.max((1, 2))


def limit(function: ComplexMap, z: ComplexArray) -> ComplexArray:
    """Return the value of ``function`` at removable points, ``inf`` where there is a pole.

    Parameters
    ----------
    function : callable
        As in `laurent`.
    z : (n,) complex
    """
    coefficients = laurent(function, z, RADII[0])
    values = np.full((len(z), *coefficients.shape[2:]), complex(np.inf, 0.0))
    todo = np.arange(len(z))
    for radius in RADII:
        coefficients = laurent(function, z[todo], radius)
        good = _is_analytic(coefficients, 1e-9)
        values[todo[good]] = coefficients[good, 0]
        todo = todo[~good]
        if not len(todo):
            break
    return values


def filled(function: ComplexMap) -> ComplexMap:
    """Return ``function`` with removable points filled in and poles made ``inf + 0i``."""

    def with_limits(z: ComplexArray) -> ComplexArray:
        values = evaluate(function, z)
        bad = ~np.isfinite(values)
        if bad.any():
            values[bad] = limit(lambda s: evaluate(function, s), np.asarray(z, complex)[bad])
        return values

    return with_limits


def derivative(function: ComplexMap, radius: float = RADII[0]) -> ComplexMap:
    """Return the derivative of an analytic function by Cauchy's integral on a small circle.

    Parameters
    ----------
    function : callable
    radius : float
        Radius of the circle. It is reduced at points whose circle reaches a singularity.

    Returns
    -------
    callable
        Accurate to about ``1e-16 |function| / radius``; ``inf`` at a pole.
    """
    radii = [radius * r / RADII[0] for r in RADII]

    def differentiated(z: ComplexArray) -> ComplexArray:
        points = np.asarray(z, complex)
        flat = points.ravel()
        values = np.full(flat.shape, complex(np.inf, 0.0))
        todo = np.arange(len(flat))
        for r in radii:
            coefficients = laurent(lambda s: evaluate(function, s), flat[todo], r)
            good = _is_analytic(coefficients, 1e-12)
            if r == radii[-1]:
                good = _is_analytic(coefficients, 1e-6)
            values[todo[good]] = coefficients[good, 1] / r
            todo = todo[~good]
            if not len(todo):
                break
        return values.reshape(points.shape)

    return differentiated

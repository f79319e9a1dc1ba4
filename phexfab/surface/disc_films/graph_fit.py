"""Gauss maps fitted to a film's boundary: polynomials, and poles beyond the domain.

A polynomial has one scale, that of the whole domain: its growth from the rim to the border bounds
the degree. Where a rim turns inwards and the film bends sharply, poles on a curve around the
domain, as far apart as they are off, resolve what a polynomial cannot. Both are fits of least
squares, with as little curvature as possible on the border, which makes them stable however near
to each other the poles are.

References
----------
P. D. Brubeck, Y. Nakatsukasa, L. N. Trefethen, "Vandermonde with Arnoldi", SIAM Review 63 (2021);
G. Fairweather, A. Karageorghis, "The method of fundamental solutions for elliptic boundary value
problems", Advances in Computational Mathematics 9 (1998); A. Gopal, L. N. Trefethen, "Solving
Laplace problems with corner singularities via rational functions", SIAM J. Numer. Anal. 57 (2019).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.surface.domain import Disc
from phexfab.surface.holomorphic import ComplexArray

FloatArray = NDArray[np.float64]
Quantity = Callable[[ComplexArray], ComplexArray]

RAYS = 1024  # places of the border at which curvature is measured
GROWTH = 1e6  # of polynomials from the rim to the border: of higher ones rounding shows
OFF = 0.5  # distance of the poles from the border, in margins
SPACING = 0.5  # of the poles, in distances from the border
NEAR = 0.7  # of that distance: poles nearer to another part of the border are left out
MOST_POLES = 600
SMOOTH_DEGREE = 12  # of the polynomial beside the poles
ROUNDING = 1e-13  # of the largest singular value: what is smaller is not solved for


@dataclass(frozen=True, eq=False)
class BoundaryValues:
    """Values (N,) of g at places (N,) of the film's boundary, with the steps between them."""

    places: ComplexArray
    steps: ComplexArray
    values: ComplexArray
    centre: complex


class _Polynomials:
    """Polynomials orthonormal on weighted places, and their values elsewhere."""

    def __init__(self, places: ComplexArray, weights: FloatArray, degree: int) -> None:
        basis = np.empty((len(places), degree + 1), complex)
        self.rule = np.zeros((degree + 1, degree), complex)
        self.first = 1 / np.linalg.norm(weights)
        basis[:, 0] = weights * self.first
        for k in range(degree):
            column = places * basis[:, k]
            for _ in range(2):  # twice is enough
                share = basis[:, : k + 1].conj().T @ column
                column -= basis[:, : k + 1] @ share
                self.rule[: k + 1, k] += share
            self.rule[k + 1, k] = np.linalg.norm(column)
            basis[:, k + 1] = column / self.rule[k + 1, k].real

    def at(self, z: ComplexArray, order: int = 0) -> ComplexArray:
        """Return a derivative of all polynomials at places (n,), (n, degree + 1)."""
        degree = self.rule.shape[1]
        table = np.zeros((order + 1, degree + 1, len(z)), complex)
        table[0, 0] = self.first
        for k in range(degree):
            for d in range(order + 1):
                fresh = z * table[d, k] - self.rule[: k + 1, k] @ table[d, : k + 1]
                table[d, k + 1] = (fresh + d * table[d - 1, k]) / self.rule[k + 1, k]
        return table[order].T


def polynomial_fit(given: BoundaryValues, domain: Disc, degree: int, stiff: float) -> Quantity:
    """Return the polynomial g nearest to the film's, with little g'' on the domain's border.

    Parameters
    ----------
    given : BoundaryValues
    domain : Disc
    degree : int
        Less where the polynomials grow too much towards the border.
    stiff : float
        Weight of g''.
    """
    weights = np.sqrt(np.abs(given.steps))
    border = domain.borders(RAYS)[0]
    system = _Polynomials(given.places - given.centre, weights, degree)
    growth = np.abs(system.at(border - given.centre)).max(0) / system.first
    if growth[-1] > GROWTH:
        degree = int(np.argmax(growth > GROWTH)) - 1
        system = _Polynomials(given.places - given.centre, weights, degree)

    def basis(z: ComplexArray, order: int = 0) -> ComplexArray:
        return system.at(z - given.centre, order)

    return _least_squares(given, border, basis, stiff)


def pole_fit(given: BoundaryValues, domain: Disc, margin: float, stiff: float) -> Quantity:
    """Return the sum of poles around the domain, and a polynomial, that is nearest to the film's g.

    Parameters
    ----------
    given : BoundaryValues
    domain : Disc
    margin : float
        By which the domain is wider than the film.
    stiff : float
        Weight of g'' on the domain's border.
    """
    border = domain.borders(RAYS)[0]
    poles, off = _poles(domain, border, OFF * margin)
    system = _Polynomials(given.places - given.centre, np.sqrt(np.abs(given.steps)), SMOOTH_DEGREE)

    def basis(z: ComplexArray, order: int = 0) -> ComplexArray:
        arm = off / (z[:, None] - poles)
        factor = (1.0, 1.0, 2.0)[order] * (-1.0 / off) ** order
        smooth = system.at(z - given.centre, order)
        return np.concatenate([smooth, factor * arm ** (order + 1)], axis=1)

    return _least_squares(given, border, basis, stiff)


def _poles(domain: Disc, border: ComplexArray, off: float) -> tuple[ComplexArray, float]:
    """Return places off the border, outside, and how far off: less dense than ``MOST_POLES``."""
    ring = np.append(border, border[0])
    length = np.append(0.0, np.cumsum(np.abs(np.diff(ring))))
    off = max(off, length[-1] / (SPACING * MOST_POLES))
    count = int(np.ceil(length[-1] / (SPACING * off)))
    even = np.arange(count) * length[-1] / count
    along = np.interp(even + 0.25 * off, length, ring, period=length[-1])
    back = np.interp(even - 0.25 * off, length, ring, period=length[-1])
    outward = -1j * (along - back) / np.abs(along - back)
    poles = np.interp(even, length, ring) + off * outward
    away = np.abs(poles[:, None] - border).min(axis=1)
    return poles[~domain.contains(poles) & (away > NEAR * off)], off


def _least_squares(
    given: BoundaryValues,
    border: ComplexArray,
    basis: Callable[..., ComplexArray],
    stiff: float,
) -> Quantity:
    weights = np.sqrt(np.abs(given.steps))
    along = np.sqrt(np.abs(np.roll(border, -1) - border))
    rows = np.concatenate(
        [weights[:, None] * basis(given.places), stiff * along[:, None] * basis(border, 2)]
    )
    size = np.linalg.norm(rows, axis=0)
    right = np.concatenate([weights * given.values, np.zeros(len(border))])
    found = np.linalg.lstsq(rows / size, right, rcond=ROUNDING)[0] / size
    return lambda z: np.asarray(basis(z) @ found)

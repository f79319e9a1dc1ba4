"""The holomorphic correction h of the curvature-line coordinate, dw̃ = √Q e^h dz.

Re h changes the lattice's density, Im h turns its rows off the principal direction. Both are
harmonic, so the largest turn lies on the border of the domain, and the best h for a wish is a
convex least-squares problem with linear bounds.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import nnls

from phexfab.surface.domain import Disc
from phexfab.surface.holomorphic import ComplexArray

FloatArray = NDArray[np.float64]

DEGREE = 24  # of the polynomial
HOLE_DEGREE = 10  # of the principal part at each hole


def n_terms(domain: Disc) -> int:
    """Return how many complex numbers h has."""
    return DEGREE + 1 + HOLE_DEGREE * len(domain.holes)


def basis(domain: Disc, z: ArrayLike) -> ComplexArray:
    """Return the (..., n_terms) functions of which h is a sum: powers, for holes negative ones."""
    points = np.asarray(z, complex)
    arms = [((points - domain.centre) / domain.radius, DEGREE)]
    arms += [(r / (points - c), HOLE_DEGREE) for c, r in domain.holes]
    columns = [np.ones(points.shape, complex)]
    for arm, degree in arms:
        power = columns[0]
        for _ in range(degree):
            power = power * arm
            columns.append(power)
    return np.stack(columns, -1)


def stiffness(domain: Disc) -> FloatArray:
    """Return the (n_terms,) square roots of the norm's weights: rough corrections cost more."""
    orders = [np.arange(DEGREE + 1)] + [np.arange(1, HOLE_DEGREE + 1)] * len(domain.holes)
    return np.sqrt(1.0 + np.concatenate(orders).astype(float) ** 2)


@dataclass(frozen=True, eq=False)
class Correction:
    """The function h; ``coefficients`` (n_terms,) in the order of ``basis``."""

    domain: Disc
    coefficients: ComplexArray

    def __call__(self, z: ArrayLike) -> ComplexArray:
        """Return h(z)."""
        points = np.asarray(z, complex)
        polynomial, rest = self.coefficients[: DEGREE + 1], self.coefficients[DEGREE + 1 :]
        value = _horner(polynomial, (points - self.domain.centre) / self.domain.radius)
        for c, r in self.domain.holes:
            part, rest = rest[:HOLE_DEGREE], rest[HOLE_DEGREE:]
            arm = r / (points - c)
            value = value + arm * _horner(part, arm)
        return value


def _horner(coefficients: ComplexArray, x: ComplexArray) -> ComplexArray:
    used = np.flatnonzero(coefficients)
    value = np.zeros(x.shape, complex)
    for c in coefficients[: used[-1] + 1 if len(used) else 0][::-1]:
        value = value * x + c
    return value


def real_rows(rows: ComplexArray) -> tuple[FloatArray, FloatArray]:
    """Return real and imaginary part of ``rows @ x`` as matrices on (Re x, Im x)."""
    return np.hstack([rows.real, -rows.imag]), np.hstack([rows.imag, rows.real])


def least_distance(rows: FloatArray, bound: FloatArray) -> FloatArray | None:
    """Return the shortest y with ``rows @ y <= bound``, None where there is none.

    References
    ----------
    Lawson, Hanson, *Solving Least Squares Problems* (1974), ch. 23.
    """
    if np.all(bound >= 0):
        return np.zeros(rows.shape[1])
    matrix = -np.vstack([rows.T, bound])
    right = np.zeros(len(matrix))
    right[-1] = 1.0
    try:
        u, _ = nnls(matrix, right)
    except RuntimeError:  # too many exchanges of the active set
        return None
    residual = matrix @ u - right
    if -residual[-1] < 1e-9:
        return None
    y = -residual[:-1] / residual[-1]
    return y if np.all(rows @ y <= bound + 1e-7 * np.abs(bound).max()) else None


def even_out(
    domain: Disc, z: ComplexArray, wish: FloatArray, weight: FloatArray, turn: float
) -> ComplexArray:
    """Return the h whose real part comes nearest to a wish while ``|Im h| <= turn``.

    Parameters
    ----------
    domain : Disc
    z, wish, weight : (n,) arrays
        Where the wish is known, up to one constant for all, and how much it counts.
    turn : float
        Radians.

    Returns
    -------
    (n_terms,) complex
        With a real part of 0 on average over the weights.
    """
    rows, _ = real_rows(basis(domain, z))
    share = weight / weight.sum()
    rows = rows - share @ rows  # the mean is free
    gap = wish - share @ wish
    soft = 1e-3 * np.tile(stiffness(domain), 2) ** 2
    hessian = (rows.T * share) @ rows + np.diag(soft)
    lower = np.linalg.cholesky(hessian)
    free = np.linalg.solve(hessian, rows.T @ (share * gap))
    _, sideways = real_rows(basis(domain, domain.borders(192).ravel()))
    bounds = np.vstack([sideways, -sideways])
    # x = free + L⁻ᵀ y, the shortest y that keeps the bounds.
    whitened = np.linalg.solve(lower, bounds.T).T
    y = least_distance(whitened, turn - bounds @ free)
    x = free + np.linalg.solve(lower.T, y) if y is not None else np.zeros(len(free))
    half = len(x) // 2
    found = x[:half] + 1j * x[half:]
    found[0] -= float(share @ (basis(domain, z) @ found).real)
    return np.asarray(found, complex)

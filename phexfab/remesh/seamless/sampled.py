"""An analytic function of a domain as a series: sampled once on the borders, cheap ever after."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from phexfab.surface.domain import Disc
from phexfab.surface.holomorphic import ComplexArray

Quantity = Callable[[ComplexArray], ComplexArray]

FEWEST, MOST = 128, 4096  # samples of a circle
RESOLVED = 2e-15  # size of the last coefficients, relative to the largest
BLOCK = 32  # powers kept at once
CHUNK = 8192  # places evaluated at once


def sampled(quantity: Quantity, domain: Disc) -> Quantity:
    """Return the function as its Laurent series in a domain.

    Parameters
    ----------
    quantity : callable
        Analytic in the domain and a little beyond.
    domain : Disc

    Returns
    -------
    callable
        Equal to rounding of the largest value on the borders; ``quantity`` itself where a series
        of reasonable length does not resolve it.

    Notes
    -----
    Powers that are not negative come from the outer circle, negative ones from the holes' circles:
    each part is analytic where the other's circle is filled.
    """
    outer = _coefficients(quantity, domain.centre, domain.radius, True)
    inner = [_coefficients(quantity, c, r, False) for c, r in domain.holes]
    if outer is None or any(part is None for part in inner):
        return quantity

    def series(z: ComplexArray) -> ComplexArray:
        points = np.asarray(z, complex)
        value = _power_sum(outer, (points - domain.centre) / domain.radius)
        for part, (c, r) in zip(inner, domain.holes, strict=True):
            assert part is not None
            arm = r / (points - c)
            value = value + arm * _power_sum(part, arm)
        return value

    return series


def _coefficients(
    quantity: Quantity, centre: complex, radius: float, positive: bool
) -> ComplexArray | None:
    """Return the coefficients of powers 0, 1, 2 … or -1, -2, … on a circle, None if unresolved."""
    n = FEWEST
    while n <= MOST:
        with np.errstate(all="ignore"):
            values = quantity(centre + radius * np.exp(2j * np.pi * np.arange(n) / n))
        every = np.fft.fft(values) / n
        size = float(np.abs(every).max())
        if not np.isfinite(size):
            return None
        middle = np.abs(every[3 * n // 8 : 5 * n // 8])
        if middle.max() <= 20 * RESOLVED * size:
            found = every[: n // 2] if positive else every[: n // 2 : -1]
            kept = np.flatnonzero(np.abs(found) > 0.1 * RESOLVED * size)
            return np.asarray(found[: kept[-1] + 1 if len(kept) else 0])
        n *= 2
    return None


def _power_sum(coefficients: ComplexArray, x: ComplexArray) -> ComplexArray:
    """Return Σ c_k x^k, by Horner's rule on blocks of powers."""
    blocks = max(1, -(-len(coefficients) // BLOCK))
    flat_table = np.zeros(blocks * BLOCK, complex)
    flat_table[: len(coefficients)] = coefficients
    table = flat_table.reshape(blocks, BLOCK).T
    flat = x.ravel()
    value = np.empty(flat.shape, complex)
    for at in range(0, len(flat), CHUNK):
        part = flat[at : at + CHUNK]
        powers = np.ones((len(part), BLOCK), complex)
        powers[:, 1:] = np.cumprod(np.broadcast_to(part[:, None], (len(part), BLOCK - 1)), axis=1)
        sums = powers @ table
        step = powers[:, -1] * part
        total = sums[:, -1]
        for k in range(blocks - 2, -1, -1):
            total = total * step + sums[:, k]
        value[at : at + CHUNK] = total
    return value.reshape(x.shape)

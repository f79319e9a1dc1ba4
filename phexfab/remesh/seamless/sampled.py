"""An analytic function of a domain as a series: sampled once on the borders, cheap ever after."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from phexfab.surface.domain import Disc
from phexfab.surface.holomorphic import ComplexArray

Quantity = Callable[[ComplexArray], ComplexArray]

FEWEST, MOST = 128, 4096  # samples of a circle
RESOLVED = 2e-15  # size of the last coefficients, relative to the largest
AROUND = 64  # samples of a circle about a removable place
RADII = 0.25 * 0.6 ** np.arange(16)  # of such circles, in radii of the domain
SMOOTH = 1e-12  # size of the last coefficients there
POLE, OFF = 8, 1e-4  # powers of a pole that may be left there, and their size
BLOCK = 32  # powers kept at once
CHUNK = 8192  # places evaluated at once


def sampled(quantity: Quantity, domain: Disc, removable: ComplexArray) -> Quantity:
    """Return the function as its Laurent series in a domain.

    Parameters
    ----------
    quantity : callable
        Analytic in the domain and a little beyond.
    domain : Disc
    removable : (n,) complex
        Places at which it is computed as 0/0.

    Returns
    -------
    callable
        Equal to rounding of the largest value on the borders. Where a series of reasonable length
        does not resolve the function, or the domain is not round, ``quantity`` itself but for
        Taylor series about the removable places.

    Notes
    -----
    Powers that are not negative come from the outer circle, negative ones from the holes' circles:
    each part is analytic where the other's circle is filled.
    """
    if not domain.is_round:
        return _mended(quantity, domain, removable)
    outer = _coefficients(quantity, domain.centre, domain.radius, True)
    inner = [_coefficients(quantity, c, r, False) for c, r in domain.holes]
    if outer is None or any(part is None for part in inner):
        return _mended(quantity, domain, removable)

    def series(z: ComplexArray) -> ComplexArray:
        points = np.asarray(z, complex)
        value = _power_sum(outer, (points - domain.centre) / domain.radius)
        for part, (c, r) in zip(inner, domain.holes, strict=True):
            assert part is not None
            arm = r / (points - c)
            value = value + arm * _power_sum(part, arm)
        return value

    return series


def _mended(quantity: Quantity, domain: Disc, removable: ComplexArray) -> Quantity:
    """Return the function with Taylor series about places where it loses digits.

    What a zero of the numerator that is off its place leaves of a pole there is taken away.
    """
    circle = np.exp(2j * np.pi * np.arange(AROUND) / AROUND)
    known: list[tuple[complex, float, ComplexArray, ComplexArray]] = []
    for place in removable:
        if any(abs(place - c) < 0.3 * r for c, r, *_ in known):
            continue
        away = np.abs(removable - place)
        for radius in domain.radius * RADII:
            if np.any((away > 0.3 * radius) & (away < 1.7 * radius)):
                continue  # digits are lost on the circle
            with np.errstate(all="ignore"):
                taylor = np.fft.fft(quantity(place + radius * circle)) / AROUND
            size = np.abs(taylor)
            rough, pole = size[AROUND // 2 : -POLE].max(), taylor[: -POLE - 1 : -1]
            if rough <= SMOOTH * size.max() and np.abs(pole).max() <= OFF * size.max():
                known.append((complex(place), float(radius), taylor[: AROUND // 2], pole))
                break

    def mended(z: ComplexArray) -> ComplexArray:
        points = np.asarray(z, complex)
        with np.errstate(all="ignore"):
            value = np.asarray(quantity(points), complex)
        arms = [(points - place) / radius for place, radius, *_ in known]
        close = [np.abs(arm) < 0.5 for arm in arms]
        for arm, near, (*_, pole) in zip(arms, close, known, strict=True):
            back = np.asarray(1 / np.where(near, 1.0, arm), complex)
            value -= np.where(near, 0.0, back * _power_sum(pole, back))
        for k, (arm, near, (_, _, taylor, _)) in enumerate(zip(arms, close, known, strict=True)):
            if near.any():
                value[near] = _power_sum(taylor, arm[near])
                for j, (other, (*_, pole)) in enumerate(zip(arms, known, strict=True)):
                    if j != k:
                        value[near] -= _power_sum(pole, 1 / other[near]) / other[near]
        return value

    return mended if known else quantity


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

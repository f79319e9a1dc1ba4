"""Zeros of an analytic function that lie together in a circle, from its Taylor coefficients."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from phexfab.surface.holomorphic import ComplexArray

Quantity = Callable[[ComplexArray], ComplexArray]

SAMPLES = 64
CIRCLE = np.exp(2j * np.pi * np.arange(SAMPLES) / SAMPLES)


def middle_of_zeros(quantity: Quantity, z: complex, radius: float, order: int) -> complex:
    """Return the middle of so many zeros near ``z``: where the derivative before vanishes."""
    taylor = np.fft.fft(quantity(z + radius * CIRCLE)) / SAMPLES
    shift = -complex(taylor[order - 1] / (order * taylor[order])) * radius
    return z + shift if abs(shift) < radius else z


def single_zero(
    quantity: Quantity, z: complex, radius: float, blur: float, noisy: bool
) -> tuple[complex, int] | None:
    """Return place and order of the only zero in a circle, or None where it holds several.

    Parameters
    ----------
    quantity : callable
    z, radius : complex, float
        The circle.
    blur : float
        Relative error of the function, see ``hopf_zeros``.
    noisy : bool
        The circle is so small that rounding of the function shows.

    Notes
    -----
    Taylor coefficients below the order must be rounding; what rounding is, the coefficients at
    the end of the series tell.
    """
    place, wide = z, radius
    for _ in range(12):
        with np.errstate(all="ignore"):
            q = quantity(place + radius * CIRCLE)
            ratio = np.roll(q, -1) / q
        if not np.all(np.abs(ratio - 1) <= 1.5):
            return None
        order = round(float(np.angle(ratio).sum()) / (2 * np.pi))
        taylor = np.fft.fft(q) / SAMPLES
        if not 1 <= order < SAMPLES // 4:
            return None
        shift = -complex(taylor[order - 1] / (order * taylor[order])) * radius
        if abs(shift) > radius:
            return None
        place += shift
        if abs(shift) <= 1e-3 * radius:
            break
    else:
        return None
    # The zero lies in the middle: now a last sharp look, Newton on the last vanishing derivative,
    # on a circle small enough for the series to end in rounding.
    noise, least, sharp, smaller = np.inf, np.inf, 0, True
    for _ in range(20):
        with np.errstate(all="ignore"):
            q = quantity(place + radius * CIRCLE)
        taylor = np.fft.fft(q) / SAMPLES
        noise = float(np.abs(taylor[SAMPLES // 2 :]).max())
        rounding = np.finfo(float).eps * float(np.abs(q).max())
        place -= complex(taylor[order - 1] / (order * taylor[order])) * radius
        share = noise / float(np.abs(taylor[order]))
        if not min(share, least) <= (1e-3 if noisy else 1e-6):
            return None  # not analytic so far out, or other zeros too near
        if smaller and noise > 1e3 * rounding and share < 0.5 * least:
            least = share
            radius *= 0.6
        elif smaller and share >= 0.5 * least:
            smaller = False  # what is left is rounding of larger numbers: back to the circle before
            radius /= 0.6
        else:
            sharp += 1
        noise = max(noise, rounding)
        if sharp == 4:
            break
    low = np.abs(taylor[:order])
    # As on the first circle.
    blurred = blur * np.abs(taylor[order]) * (wide / radius) ** (order - np.arange(order))
    return (place, order) if np.all(low <= np.maximum(64 * noise, blurred)) else None

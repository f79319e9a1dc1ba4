"""Facts of the triangular lattice that both design files and lattices are held to."""

from __future__ import annotations

import math

EQUILATERAL = math.sqrt(3) / 2
"""Row distance over step of the equilateral lattice."""

ASYMPTOTIC_MARGIN = 2.0
"""Degrees that lattice directions keep from the asymptotic ones."""


def mean_distance(row_ratio: float) -> float:
    """Return the mean distance of lattice neighbours for step 1 (1 where equilateral)."""
    return (1 + 2 * math.hypot(0.5, row_ratio)) / 3


def asymptotic_gap(row_ratio: float, turn: float) -> tuple[float, int]:
    """Return how near a lattice comes to an asymptotic direction, and how it lies between them.

    Parameters
    ----------
    row_ratio : float
        Row distance / step.
    turn : float
        Degrees between rows and the first principal direction.

    Returns
    -------
    gap : float
        Degrees between the nearest lattice direction and the asymptotic directions, at ±45°.
    inside : int
        How many of the three lattice directions lie within 45° of the first principal direction.
        The dual hexagons are valid for one or two.

    References
    ----------
    Thesis §5.1.3.
    """
    slant = math.degrees(math.atan(2 * row_ratio))
    folded = [abs((angle + 90) % 180 - 90) for angle in (turn, turn + slant, turn - slant)]
    return min(abs(angle - 45) for angle in folded), sum(angle < 45 for angle in folded)

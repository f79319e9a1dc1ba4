"""A start for Plateau's problem: the energy of piecewise linear boundary values, minimised.

With chords ΔX of the rim over arcs of the circle, X is linear on each arc, and the energy of its
harmonic extension is the closed sum

    E = 1/(2π) Σ_ab V_a·V_b G(θ_a − θ_b),    G'' = log|2 sin(x/2)|,

V the jumps of the slopes ΔX/Δθ. It is never below the film's area, and grows without bound when an
arc shrinks, so that the descent over the arcs' lengths cannot lose a part of the rim, however long
and thin the rim is.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.special import bernoulli

FloatArray = NDArray[np.float64]

TERMS = 24
STEPS = 200
LEAST = 1e-4  # share of the circle kept for arcs that would vanish: rounding grows as they shrink
_N = np.arange(1, TERMS + 1)
# log(2 sin(x/2)/x) = −Σ |B_2n| x^2n / (2n (2n)!), integrated twice.
_SERIES = np.abs(bernoulli(2 * TERMS)[2::2]) / [
    2.0 * n * math.factorial(2 * n) for n in range(1, TERMS + 1)
]
_SECOND = _SERIES / ((2 * _N + 1) * (2 * _N + 2))
_FIRST = _SERIES / (2 * _N + 1)


def twice_integrated_log(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return G and G' for x in [−2π, 2π], G(0) = 0."""
    x = x - 2 * np.pi * np.rint(x / (2 * np.pi))
    square = x * x
    second, first = np.zeros_like(x), np.zeros_like(x)
    for a, b in zip(_SECOND[::-1], _FIRST[::-1], strict=True):
        second, first = second * square + a, first * square + b
    with np.errstate(divide="ignore", invalid="ignore"):
        log = np.where(square > 0, 0.5 * np.log(square), 0.0)
    return (
        square * (0.5 * log - 0.75 - square * second),
        x * (log - 1 - square * first),
    )


def chord_energy(chords: FloatArray, arcs: FloatArray) -> tuple[float, FloatArray]:
    """Return the energy and its derivative by the arcs.

    Parameters
    ----------
    chords : (n, 3)
        Of a closed polygon.
    arcs : (n,)
        Positive, of sum 2π.
    """
    theta = np.cumsum(arcs) - arcs
    slope = chords / arcs[:, None]
    jump = np.roll(slope, 1, axis=0) - slope
    second, first = twice_integrated_log(theta[:, None] - theta[None, :])
    field = second @ jump
    energy = float((jump * field).sum()) / (2 * np.pi)
    by_theta = (first * (jump @ jump.T)).sum(1) / np.pi
    by_slope = (np.roll(field, -1, axis=0) - field) / np.pi
    by_arc = -(by_slope * slope).sum(1) / arcs
    # θ_a is the sum of the arcs before it.
    later = np.cumsum(by_theta[::-1])[::-1]
    return energy, by_arc + np.append(later[1:], 0.0)


def start_arcs(points: FloatArray) -> FloatArray:
    """Return the arcs (n,) of the circle that belong to the sides of a closed polygon (n, 3)."""
    chords = np.roll(points, -1, axis=0) - points

    def arcs_of(logs: FloatArray) -> FloatArray:
        wide = np.exp(logs - logs.max())
        return 2 * np.pi * ((1 - LEAST) * wide / wide.sum() + LEAST / len(wide))

    def cost(logs: FloatArray) -> tuple[float, FloatArray]:
        arcs = arcs_of(logs)
        energy, by_arc = chord_energy(chords, arcs)
        change = arcs - 2 * np.pi * LEAST / len(arcs)
        return energy, change * (by_arc - (by_arc @ change) / change.sum())

    start = np.log(np.linalg.norm(chords, axis=1))
    found = minimize(cost, start, jac=True, method="L-BFGS-B", options={"maxiter": STEPS})
    return arcs_of(found.x)

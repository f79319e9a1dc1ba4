"""An atlas of a lattice coordinate w̃ = ∫ √(quantity) dz: power series that cover a domain.

Every zero of the quantity has a chart about itself, and the rest is covered by squares of a
quadtree, each so small that w̃ is one-to-one on it and its Taylor series has converged. About a
zero of order m, ``w̃ = τ^p`` with p = (m+2)/2 and ``τ = t S(t)`` analytic and one-to-one in
t = z - centre; elsewhere p = 1. So both directions, w̃(z) and z(w̃), cost a short series.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.surface.domain import Disc
from phexfab.surface.holomorphic import ComplexArray
from phexfab.surface.quadtree import Quadtree, cover

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Quantity = Callable[[ComplexArray], ComplexArray]

SAMPLES = 64
TERMS = 32
CIRCLE = np.exp(2j * np.pi * np.arange(SAMPLES) / SAMPLES)
CIRCLE_BY_CELL = 1.6  # radius of the sampled circle, in half diagonals of the square
TRUST = 1 / 1.28  # of the circle's radius: there the series has converged to rounding
TAIL = 1e-11  # size of the last terms on the circle
SPECK = 1e-12  # of the domain: radius of a chart that does not hold
BLURRED = 1e-8  # what they may be where the quantity is not known any better
UNIVALENT = 0.7  # |dτ/dt - 1| on the circle: w̃ is one-to-one inside


@dataclass(frozen=True, eq=False)
class Atlas:
    """Charts of w̃ and the squares of the quadtree that they own.

    Attributes
    ----------
    centre : (C,) complex
    power : (C,) float
        p.
    series : (C, TERMS) complex
        Coefficients of S in ``t / trust``.
    trust : (C,) float
        Radius within which the series holds.
    half : (C,) float
        Half the side of the square that the chart owns; infinite for charts of several squares.
    squares : Quadtree
        They belong to charts.
    """

    centre: ComplexArray
    power: FloatArray
    series: ComplexArray
    trust: FloatArray
    half: FloatArray
    squares: Quadtree

    def chart_at(self, z: ComplexArray) -> IntArray:
        """Return the chart that owns each of ``z``; -1 where nothing is covered."""
        return self.squares.owner_at(z)

    def tau(self, chart: IntArray, z: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return τ and dτ/dz at places in charts."""
        x = (z - self.centre[chart]) / self.trust[chart]
        value, slope = np.zeros(x.shape, complex), np.zeros(x.shape, complex)
        table = self.series[chart].T
        for k in range(TERMS - 1, -1, -1):
            slope = slope * x + value
            value = value * x + table[k]
        return value * x * self.trust[chart], value + slope * x

    def coordinate(self, chart: IntArray, z: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return w̃ and dw̃/dz at places in charts, on one of the roots."""
        tau, slope = self.tau(chart, z)
        p = self.power[chart]
        bent = p != 1.0
        w, factor = tau.copy(), np.ones(tau.shape, complex)
        w[bent] = tau[bent] ** p[bent]
        with np.errstate(all="ignore"):
            factor[bent] = p[bent] * w[bent] / tau[bent]
        return w, factor * slope

    def place(self, chart: IntArray, tau: ComplexArray) -> tuple[ComplexArray, BoolArray]:
        """Return the z in each chart with a given τ, and whether it lies where the chart holds."""
        trust, lead = self.trust[chart], self.series[chart, 0]
        t = tau / lead
        far = np.abs(t) > 8 * trust
        t = np.where(far, 0.0, t * np.minimum(1, trust / np.maximum(np.abs(t), 1e-300)))
        todo = np.flatnonzero(~far)
        for step in range(40):
            own = chart[todo]
            value, slope = self.tau(own, self.centre[own] + t[todo])
            # dτ/dt stays near its middle value: these steps contract; Newton ends them.
            change = (tau[todo] - value) / (lead[todo] if step < 2 else slope)
            moved = t[todo] + change
            size = np.abs(moved)
            t[todo] = moved * np.minimum(1, 1.25 * trust[todo] / np.maximum(size, 1e-300))
            alive = np.abs(change) > 1e-9 * trust[todo]
            todo = todo[alive]
            if not len(todo):
                break
        lost = far
        lost[todo] = True
        own_t = np.where(lost, 0.0, t)
        value, slope = self.tau(chart, self.centre[chart] + own_t)
        own_t = own_t + np.where(lost, 0.0, (tau - value) / slope)
        return self.centre[chart] + own_t, ~lost & (np.abs(own_t) <= trust)


def build_atlas(quantity: Quantity, domain: Disc, places: ComplexArray, orders: IntArray) -> Atlas:
    """Return charts that cover a domain.

    Parameters
    ----------
    quantity : callable
        The square of dw̃/dz.
    domain : Disc
        Squares that rounding cannot resolve, beside a zero just outside, stay uncovered.
    places, orders : (n,) complex, (n,) int
        Its zeros in the domain.
    """
    with np.errstate(all="ignore"):
        scale = float(np.abs(quantity(domain.grid(24))).max())
    centre, power, series, trust = _zero_charts(quantity, domain, places, orders, scale)
    half_of = [np.full(len(centre), np.inf)]
    parts = [(centre, power, series, trust)]

    def owners(middle: ComplexArray, half: float) -> IntArray:
        diagonal = half * np.sqrt(2)
        mine = np.full(len(middle), -1)
        wait = np.zeros(len(middle), bool)
        for k in range(len(centre)):
            away = np.abs(middle - centre[k])
            mine[away + diagonal <= 0.8 * trust[k]] = k
            wait |= away <= CIRCLE_BY_CELL * diagonal  # a square that holds a zero
        free = np.flatnonzero((mine < 0) & ~wait)
        plain = np.zeros(len(free), np.int64)
        made, good = _series(quantity, middle[free], CIRCLE_BY_CELL * diagonal, plain, scale)
        new = free[good]
        mine[new] = sum(len(part[0]) for part in parts) + np.arange(len(new))
        radius = np.full(len(new), CIRCLE_BY_CELL * diagonal * TRUST)
        parts.append((middle[new], np.ones(len(new)), made[good], radius))
        half_of.append(np.full(len(new), half))
        return mine

    squares = cover(domain, owners)
    return Atlas(
        np.concatenate([p[0] for p in parts]),
        np.concatenate([p[1] for p in parts]),
        np.concatenate([p[2] for p in parts]),
        np.concatenate([p[3] for p in parts]),
        np.concatenate(half_of),
        squares,
    )


def _zero_charts(
    quantity: Quantity, domain: Disc, centre: ComplexArray, orders: IntArray, scale: float
) -> tuple[ComplexArray, FloatArray, ComplexArray, FloatArray]:
    # A chart that holds nowhere, as beside noise, is its centre only: a speck on which τ = t.
    series = np.zeros((len(centre), TERMS), complex)
    series[:, 0] = 1.0
    trust = np.full(len(centre), SPECK * domain.radius)
    for k in range(len(centre)):
        others = np.abs(np.delete(centre, k) - centre[k])
        radius = min(2.2 * domain.radius, 0.9 * others.min(initial=np.inf))
        for _ in range(60):
            made, good = _series(quantity, centre[k : k + 1], radius, orders[k : k + 1], scale)
            if good[0]:
                series[k], trust[k] = made[0], radius * TRUST
                break
            radius *= 0.85
    return centre, np.asarray(0.5 * orders + 1, float), series, trust


def _series(
    quantity: Quantity, centre: ComplexArray, radius: float, orders: IntArray, scale: float
) -> tuple[ComplexArray, BoolArray]:
    """Return S of each chart, in t/trust, and which of them hold."""
    if not len(centre):
        return np.zeros((0, TERMS), complex), np.zeros(0, bool)
    t = radius * CIRCLE
    with np.errstate(all="ignore"):
        values = quantity(centre[:, None] + t)
        noise = 40 * np.finfo(float).eps * scale / np.abs(values).min(1)
        values = values / t ** orders[:, None]
        good = np.isfinite(values).all(1) & (np.abs(values).min(1) > 0)
        values = np.where(good[:, None], values, 1.0)
        ratio = np.roll(values, -1, axis=1) / values
        turns = np.angle(ratio)
        good &= (np.abs(turns).max(1) < 1.5) & (np.abs(turns.sum(1)) < 1.0)
        # The root, continuous around the circle: Q = t^m q(t), √q = Σ r_k t^k.
        phase = np.angle(values[:, :1]) + np.cumsum(turns, axis=1) - turns
        root = np.sqrt(np.abs(values)) * np.exp(0.5j * phase)
        r = np.fft.fft(root, axis=1) / SAMPLES
        size = np.abs(r) / np.abs(r[:, :1])
        # An analytic function has no negative powers: what they hold is noise, or the seam between
        # two formulas that agree no better. No smaller square would have less of it.
        noise = np.maximum(noise, 4 * size[:, -SAMPLES // 4 :].max(1))
        allowed = np.maximum(TAIL, np.minimum(noise, BLURRED))
        good &= size[:, TERMS:].max(1) <= allowed
        # w̃ = t^p Σ r_k t^k / (k + p) = (t S)^p
        p = 0.5 * (orders + 2.0)[:, None]
        k = np.arange(TERMS)
        scaled = np.zeros_like(r)
        scaled[:, :TERMS] = r[:, :TERMS] / (k + p)
        whole = np.fft.ifft(scaled, axis=1) * SAMPLES
        s = scaled[:, :1] ** (1 / p) * (whole / scaled[:, :1]) ** (1 / p)
        coefficients = np.fft.fft(s, axis=1) / SAMPLES
        slope = (
            np.fft.ifft(
                np.where(np.arange(SAMPLES) < TERMS, coefficients * (np.arange(SAMPLES) + 1), 0),
                axis=1,
            )
            * SAMPLES
        )
        good &= np.abs(slope / coefficients[:, :1] - 1).max(1) <= UNIVALENT
        good &= np.abs(np.angle(whole / scaled[:, :1])).max(1) < 1.2
        tail = np.abs(coefficients[:, TERMS:]).max(1) / np.abs(coefficients[:, 0])
        good &= tail <= allowed
    return np.nan_to_num(coefficients[:, :TERMS]) * TRUST**k, good

"""Holomorphic null curves of the unit disc, Φ with Φ'·Φ' = 0, as minimal surfaces X = Re Φ.

Where the boundary is smooth, Φ is its Taylor polynomial. Where the boundary has corners, or leaves
much of the rim to a tiny arc of the circle, Φ is the rational function that takes given values at
given points ζ_j of the circle, the quotient of two Cauchy sums [1]_,

    Φ(z) = Σ w_j Φ_j/(ζ_j − z) / Σ w_j/(ζ_j − z),    w_j = (dζ/dσ)_j,

as accurate up to the circle as the trapezoid rule in σ. With φ = Φ',

    f = φ₁ − iφ₂ = −φ₃²/(φ₁ + iφ₂),   g = φ₃/(φ₁ − iφ₂) = −(φ₁ + iφ₂)/φ₃,

of which the second form is taken about the poles of g, so that they do no harm.

References
----------
.. [1] N. I. Ioakimidis, K. E. Papadakis, E. A. Perdios, "Numerical evaluation of analytic functions
   by Cauchy's theorem", BIT 31 (1991), 276-285.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from phexfab.surface.holomorphic import ComplexArray
from phexfab.surface.weierstrass import MinimalSurface

FloatArray = NDArray[np.float64]

STEEPEST = 10.0  # of |g|, up to which one formula is used
BLOCK = 16  # powers of z kept at once
CHUNK = 4096  # points evaluated at once
NOISE = 4e-16  # share of the largest coefficient below which coefficients are cut off
PAIRS = 1 << 15  # of points and samples at once: they stay in the processor's cache
VANISHED = 1e-4 * 2 * np.pi  # sum of weights, 2π inside, below which rounding shows
BESIDE = 1e-9  # where a point hits a sample, values are taken that far beside it


class NullCurve(Protocol):
    """Φ and its derivatives of order 0, 1, 2 at parameters (n,), (n, 3) each."""

    def derivatives(self, z: ComplexArray, orders: tuple[int, ...]) -> list[ComplexArray]: ...


@dataclass(frozen=True, eq=False)
class NullSeries:
    """Φ = Σ c_k z^k.

    Attributes
    ----------
    coefficients : (K, 3) complex
    """

    coefficients: ComplexArray

    @classmethod
    def from_samples(cls, values: ComplexArray) -> NullSeries:
        """Return the polynomial through values (N, 3) of Φ at the N-th roots of unity."""
        count = len(values)
        coefficients = np.fft.fft(values, axis=0)[: count // 2] / count
        size = np.abs(coefficients).max(axis=1)
        kept = np.flatnonzero(size > NOISE * size[1:].max())
        return cls(coefficients[: int(kept.max()) + 1])

    def derivatives(self, z: ComplexArray, orders: tuple[int, ...]) -> list[ComplexArray]:
        """Return derivatives of the given orders, each (n, 3)."""
        columns = []
        for order in orders:
            c = self.coefficients
            for _ in range(order):
                c = c[1:] * np.arange(1, len(c))[:, None]
            columns.append(np.vstack([c, np.zeros((len(self.coefficients) - len(c), 3))]))
        table = np.concatenate(columns, axis=1)
        blocks = -(-len(table) // BLOCK)
        table = np.vstack([table, np.zeros((blocks * BLOCK - len(table), table.shape[1]))])
        stacked = table.reshape(blocks, BLOCK, -1).transpose(1, 0, 2).reshape(BLOCK, -1)
        out = np.empty((len(z), table.shape[1]), complex)
        for at in range(0, len(z), CHUNK):
            part = z[at : at + CHUNK, None]
            powers = np.cumprod(np.broadcast_to(part, (len(part), BLOCK)), axis=1)
            step = powers[:, -1:]
            powers = np.hstack([np.ones_like(part), powers[:, :-1]])
            found = (powers @ stacked).reshape(len(part), blocks, -1)
            value = found[:, -1]
            for k in range(blocks - 2, -1, -1):
                value = value * step + found[:, k]
            out[at : at + CHUNK] = value
        return np.split(out, len(orders), axis=1)

    def stretched(self, radius: float) -> NullSeries:
        """Return Φ(radius · z)."""
        return NullSeries(self.coefficients * radius ** np.arange(len(self.coefficients))[:, None])


@dataclass(frozen=True, eq=False)
class NullBoundary:
    """Φ from samples on the circle.

    Attributes
    ----------
    nodes, steps : (N,) complex
        ζ and dζ/dσ.
    values, slopes : (N, 3) complex
        Φ and Φ' there.
    """

    nodes: ComplexArray
    steps: ComplexArray
    values: ComplexArray
    slopes: ComplexArray

    def derivatives(self, z: ComplexArray, orders: tuple[int, ...]) -> list[ComplexArray]:
        """Return derivatives of the given orders, each (n, 3)."""
        given = (self.values, self.slopes)
        weighted = [np.column_stack([rows, np.ones(len(rows))]) for rows in given]
        tables = [self.steps[:, None] * rows for rows in weighted]
        out = [np.empty((len(z), 3), complex) for _ in orders]
        width = max(1, PAIRS // len(self.nodes))
        for at in range(0, len(z), width):
            part = z[at : at + width]
            close = np.flatnonzero(np.abs(np.abs(part) - 1) < 1e-12)  # nodes are on the circle
            if len(close):
                hit = close[np.abs(self.nodes - part[close, None]).min(axis=1) < 1e-13]
                part = part.copy()
                part[hit] *= 1 - BESIDE
            near = _reciprocal(self.nodes, part)
            sums = {min(order, 1): near @ tables[min(order, 1)] for order in orders}
            if 2 in orders:
                near *= near
                twice = near @ tables[1]
            # Beyond the circle both sums fall to nothing within a few samples' distance.
            total = next(iter(sums.values()))[:, 3]
            lost = np.flatnonzero(np.abs(total) < VANISHED)
            for k, order in enumerate(orders):
                found = sums[min(order, 1)]
                value = found[:, :3] / found[:, 3:]
                if order == 2:
                    value = (twice[:, :3] - twice[:, 3:] * value) / found[:, 3:]
                out[k][at : at + len(part)] = value
            if len(lost):
                for k, value in enumerate(self._beyond(part[lost], orders)):
                    out[k][at + lost] = value
        return out

    def _beyond(self, z: ComplexArray, orders: tuple[int, ...]) -> list[ComplexArray]:
        """Return derivatives outside the circle by the parabola at its nearest point."""
        foot = z / np.abs(z)
        d = (z - foot)[:, None]
        value, slope, bend = self.derivatives(foot, (0, 1, 2))
        found = value + d * slope + 0.5 * d**2 * bend, slope + d * bend, bend
        return [found[order] for order in orders]


def _reciprocal(nodes: ComplexArray, z: ComplexArray) -> ComplexArray:
    """Return 1 / (nodes - z), (n, N), in real arithmetic: several times faster."""
    x = nodes.real - z.real[:, None]
    y = z.imag[:, None] - nodes.imag
    square = x * x
    square += y * y
    found = np.empty(square.shape, complex)
    np.divide(x, square, out=found.real)
    np.divide(y, square, out=found.imag)
    return found


def _is_lower(south: ComplexArray, north: ComplexArray) -> NDArray[np.bool_]:
    """Return where quotients are formed with φ₁ − iφ₂, rather than with φ₁ + iφ₂.

    On a curve that is null up to an error only, the two differ by it: a seam, which is put where
    normals point well up, out of the way of all that lies over a plan or overhangs a little.
    """
    return np.abs(south) >= np.abs(north) / STEEPEST**2


def null_curve_surface(
    curve: NullCurve, name: str, size: float, middle: FloatArray
) -> MinimalSurface:
    """Return X = middle + size · Re Φ as a minimal surface with ``size`` (mm) as its scale.

    Parameters
    ----------
    curve : NullCurve
        In units of ``size``.
    middle : (3,)
        In mm.
    """

    recent: list[tuple[ComplexArray, list[ComplexArray]]] = []

    def at(z: ComplexArray, *orders: int) -> list[ComplexArray]:
        points = np.asarray(z, complex)
        flat = points.ravel()
        if orders == (0,):
            found = curve.derivatives(flat, orders)
        else:
            # g, g' and f are asked for at the same places, one after the other: Φ' and Φ'' do for
            # all three.
            last = recent[0] if recent else None
            if last is None or not np.array_equal(last[0], flat):
                last = flat.copy(), curve.derivatives(flat, (1, 2))
                recent[:] = [last]
            found = [last[1][order - 1] for order in orders]
        return [values.reshape(*points.shape, 3) for values in found]

    def split(phi: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray]:
        return phi[..., 0] - 1j * phi[..., 1], phi[..., 0] + 1j * phi[..., 1], phi[..., 2]

    def gauss_map(z: ComplexArray) -> ComplexArray:
        south, north, third = split(at(z, 1)[0])
        lower = _is_lower(south, north)
        top: ComplexArray = np.where(lower, third, -north)
        return top / np.where(lower, south, third)

    def gauss_map_derivative(z: ComplexArray) -> ComplexArray:
        phi, change = at(z, 1, 2)
        (south, north, third), (by_south, by_north, by_third) = split(phi), split(change)
        lower = _is_lower(south, north)
        side, by_side = np.where(lower, south, north), np.where(lower, by_south, by_north)
        return (by_third * side - third * by_side) / np.where(lower, south, third) ** 2

    def form(z: ComplexArray) -> ComplexArray:
        south, north, third = split(at(z, 1)[0])
        lower = _is_lower(south, north)
        turned: ComplexArray = -(third**2) / np.where(lower, 1.0, north)
        return np.where(lower, south, turned)

    shift = np.asarray(middle, float) / size
    return MinimalSurface(
        name=name,
        gauss_map=gauss_map,
        gauss_map_derivative=gauss_map_derivative,
        form=form,
        null_curve=lambda z: at(z, 0)[0] + shift,
        scale=size,
    )

"""A minimal surface over the plane of u, given by its Gauss map alone, as patches of power series.

With f = 2 the null curve is Φ = ∫ (1 − g², i(1 + g²), 2g) du: regular wherever g is, exactly null,
and u = (Φ₁ − iΦ₂)/2. Squares of a quadtree hold Taylor series of g and of its two integrals, so
that all evaluations cost the same few terms however high the degree of g.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import breadth_first_order, minimum_spanning_tree

from phexfab.surface.domain import Disc
from phexfab.surface.holomorphic import ComplexArray
from phexfab.surface.quadtree import Quadtree, cover

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

TERMS, SAMPLES = 28, 64
CIRCLE = np.exp(2j * np.pi * np.arange(SAMPLES) / SAMPLES)
WIDE = 1.6  # radius of the sampled circle in half diagonals of the square
TAIL = 1e-13  # of the terms left out, on the circle: 1e-5 of that in the square
ROUNDED = 1e-10  # what they may be where g is not known any better
STEEPEST = 1.0  # |g| that counts: on circles far beyond the domain it may be much more
DEEPEST = 10  # patches are half as wide that often at most
BLOCK = 1 << 14  # places evaluated at once


@dataclass(frozen=True, eq=False)
class GraphCurve:
    """Φ over a domain of u.

    Attributes
    ----------
    domain : Disc
        Beyond it, the series of the nearest patch hold a little further.
    squares : Quadtree
    centre, radius : (P,)
        Of the patches; series are in ``(u − centre) / radius``.
    series : (P, TERMS, 3) complex
        Of g, ∫g du and ∫g² du, without the integrals' constants.
    start : (P, 2) complex
        Those constants.
    frame : (3, 3)
        Rows: the directions in space of the curve's three components.
    """

    domain: Disc
    squares: Quadtree
    centre: ComplexArray
    radius: FloatArray
    series: ComplexArray
    start: ComplexArray
    frame: FloatArray

    def derivatives(self, z: ComplexArray, orders: tuple[int, ...]) -> list[ComplexArray]:
        """Return derivatives of Φ of orders 0, 1, 2 at parameters (n,), each (n, 3)."""
        parts = [self._block(z[at : at + BLOCK], orders) for at in range(0, max(len(z), 1), BLOCK)]
        return [
            np.asarray(np.concatenate(part) @ self.frame, complex)
            for part in zip(*parts, strict=True)
        ]

    def _block(self, z: ComplexArray, orders: tuple[int, ...]) -> list[ComplexArray]:
        patch = self.patch_of(z)
        x = (z - self.centre[patch]) / self.radius[patch]
        columns = slice(0, 3) if 0 in orders else slice(0, 1)
        table = self.series[patch, :, columns].transpose(1, 2, 0)
        value = np.zeros(table.shape[1:], complex)
        slope = np.zeros(len(x), complex)
        for row in table[::-1]:
            if 2 in orders:
                slope *= x
                slope += value[0]
            value *= x
            value += row
        g = value[0]
        found = []
        for order in orders:
            if order == 0:
                scale, start = self.radius[patch] * x, self.start[patch]
                whole, square = scale * value[1] + start[:, 0], scale * value[2] + start[:, 1]
                found.append(np.stack([z - square, 1j * (z + square), 2 * whole], -1))
            elif order == 1:
                found.append(np.stack([1 - g * g, 1j * (1 + g * g), 2 * g], -1))
            else:
                bend = 2 * slope / self.radius[patch]
                found.append(np.stack([-g * bend, 1j * g * bend, bend], -1))
        return found

    def patch_of(self, z: ComplexArray) -> IntArray:
        """Return the patch of each place, beyond the domain that of the nearest border."""
        patch = self.squares.owner_at(z)
        beyond = np.flatnonzero(patch < 0)
        if len(beyond):
            patch[beyond] = self.squares.owner_at(self.domain.clipped(z[beyond]))
        return patch


def graph_curve(
    gauss_map: Callable[[ComplexArray], ComplexArray], domain: Disc, frame: FloatArray
) -> GraphCurve | None:
    """Return the null curve of a Gauss map over a domain, None where it is too rough.

    Parameters
    ----------
    gauss_map : callable
        g of complex arrays (n,), analytic in the domain and a little beyond.
    domain : Disc
        Without holes.
    frame : (3, 3)
        See `GraphCurve`.
    """
    wide = domain.widened(1e-3)
    centres, radii, tables = [np.zeros(0, complex)], [np.zeros(0)], []
    count, last = 0, 0

    def owners(middle: ComplexArray, half: float) -> IntArray:
        nonlocal count, last
        radius = WIDE * half * np.sqrt(2)
        g = gauss_map((middle[:, None] + radius * CIRCLE).ravel()).reshape(-1, SAMPLES)
        both = np.fft.fft(np.stack([g, g * g], -1), axis=1) / SAMPLES
        size = np.abs(both)
        # Negative powers, which g has not, tell its rounding: no smaller square has less of it.
        noise = 4 * size[:, -SAMPLES // 4 :].max((1, 2))
        most = np.clip(size.max((1, 2)), 1e-6, STEEPEST)
        allowed = np.maximum(TAIL * most, np.minimum(noise, ROUNDED * most))
        good = (size[:, TERMS:].max((1, 2)) <= allowed) & np.isfinite(g).all(1)
        integrals = both[good, :TERMS] / np.arange(1, TERMS + 1)[:, None]
        tables.append(np.concatenate([both[good, :TERMS, :1], integrals], -1))
        mine = np.full(len(middle), -1)
        mine[good] = count + np.arange(good.sum())
        centres.append(middle[good])
        radii.append(np.full(good.sum(), radius))
        count += int(good.sum())
        last = int((~good).sum())
        return mine

    squares = cover(wide, owners, DEEPEST)
    if last:
        return None
    found = GraphCurve(
        wide,
        squares,
        np.concatenate(centres),
        np.concatenate(radii),
        np.concatenate(tables),
        np.zeros((count, 2), complex),
        frame,
    )
    return _joined(found)


def _joined(curve: GraphCurve) -> GraphCurve:
    """Return the curve with constants such that its integrals agree where patches meet."""
    one, two, at = curve.squares.contacts(curve.domain)
    # Squares that reach into the domain at a tip only meet others outside: they are joined there.
    everywhere = Disc(curve.domain.centre, 2 * curve.domain.radius)
    others = curve.squares.contacts(everywhere)
    count = len(curve.centre)
    pair = np.minimum(one, two) * count + np.maximum(one, two)
    fresh = ~np.isin(np.minimum(*others[:2]) * count + np.maximum(*others[:2]), pair)
    weight = np.repeat([1.0, 2.0], [len(one), int(fresh.sum())])
    one, two, at = (
        np.concatenate([a, b[fresh]]) for a, b in zip((one, two, at), others, strict=True)
    )

    def integrals(patch: IntArray) -> ComplexArray:
        x = (at - curve.centre[patch]) / curve.radius[patch]
        table = curve.series[patch, :, 1:]
        value = np.zeros((len(at), 2), complex)
        for k in range(TERMS - 1, -1, -1):
            value = value * x[:, None] + table[:, k]
        return np.asarray(value * (x * curve.radius[patch])[:, None])

    step = integrals(one) - integrals(two)  # start of two − start of one
    edge = np.arange(1, len(at) + 1)
    graph = coo_matrix((edge, (one, two)), shape=(count, count)).tocsr()
    cost = coo_matrix((weight, (one, two)), shape=(count, count))
    order, parent = breadth_first_order(minimum_spanning_tree(cost), 0, directed=False)
    start = np.zeros((count, 2), complex)
    both = (graph - graph.T).tocsr()
    for patch in order[1:]:
        number = int(both[parent[patch], patch])
        sign = 1.0 if number > 0 else -1.0
        start[patch] = start[parent[patch]] + sign * step[abs(number) - 1]
    return GraphCurve(
        curve.domain, curve.squares, curve.centre, curve.radius, curve.series, start, curve.frame
    )

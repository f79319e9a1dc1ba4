"""Pieces of a rim: curves s ∈ [0, 1] → space with derivatives, as values."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.polynomial.legendre import leggauss
from numpy.typing import NDArray
from scipy.interpolate import BSpline

FloatArray = NDArray[np.float64]
Values = Callable[[FloatArray, int], FloatArray]
Function = Callable[[FloatArray], FloatArray]

PANELS = 32  # Gauss panels per piece for arc length
NODES, WEIGHTS = leggauss(12)


@dataclass(frozen=True, eq=False)
class Piece:
    """One smooth arc of a rim.

    Attributes
    ----------
    values
        ``values(s, order)``: points (order 0) or derivatives by s, (n,) → (n, 3), mm; at s = 0
        and s = 1 the one-sided values of this piece.
    straight
        True for a straight line run through at constant speed.
    knots
        Parameters inside (0, 1), ascending, where only finitely many derivatives are continuous;
        quadrature is cut there.
    """

    values: Values
    straight: bool = False
    knots: tuple[float, ...] = ()

    def reversed(self) -> Piece:
        """The same arc run through from its end to its start."""
        values = self.values
        knots = tuple(1.0 - knot for knot in self.knots[::-1])
        return Piece(lambda s, k: (-1.0) ** k * values(1.0 - s, k), self.straight, knots)

    def part(self, first: float, last: float) -> Piece:
        """Return the stretch from s = first to s = last."""
        if first == 0.0 and last == 1.0:
            return self
        values, width = self.values, last - first
        knots = tuple((k - first) / width for k in self.knots if first < k < last)
        return Piece(lambda s, k: values(first + s * width, k) * width**k, self.straight, knots)

    def pulled(self, at_start: FloatArray, at_end: FloatArray) -> Piece:
        """Return the piece with its ends moved by small vectors (3,), linearly in between."""
        values, drift = self.values, at_end - at_start

        def moved(s: FloatArray, order: int) -> FloatArray:
            if order == 0:
                return values(s, 0) + at_start + s[:, None] * drift
            return values(s, order) + (drift if order == 1 else 0.0)

        return Piece(moved, self.straight, self.knots)

    @cached_property
    def ends(self) -> FloatArray:
        """Start and end (2, 3), mm."""
        return self.values(np.array([0.0, 1.0]), 0)

    @cached_property
    def tangents(self) -> FloatArray:
        """Unit tangents (2, 3) at start and end."""
        found = self.values(np.array([0.0, 1.0]), 1)
        return found / np.linalg.norm(found, axis=1)[:, None]

    @cached_property
    def length(self) -> float:
        """Arc length, mm."""
        panels = panels_of(self)
        return float(length_between(self, panels[:-1], panels[1:]).sum())

    def transformed(self, linear: FloatArray, shift: FloatArray) -> Piece:
        """Return the image under x ↦ linear @ x + shift."""
        values = self.values
        return Piece(
            lambda s, k: values(s, k) @ linear.T + (shift if k == 0 else 0.0),
            self.straight,
            self.knots,
        )


def line(start: FloatArray, end: FloatArray) -> Piece:
    """Return the straight piece between two points (3,)."""
    start, end = np.asarray(start, dtype=float), np.asarray(end, dtype=float)
    step = end - start

    def values(s: FloatArray, order: int) -> FloatArray:
        if order == 0:  # exact at both ends
            return (1.0 - s)[:, None] * start + s[:, None] * end
        return np.broadcast_to(step if order == 1 else 0.0 * step, (len(s), 3)).copy()

    return Piece(values, straight=True)


def spline(curve: BSpline, first: float, last: float) -> Piece:
    """Return the stretch of a scipy spline between two of its parameters, first < last."""
    width = last - first
    # At its end a derivative belongs to this stretch, not to the one beyond the knot.
    inside = float(np.nextafter(last, first))

    def values(s: FloatArray, order: int) -> FloatArray:
        if order > curve.k:
            return np.zeros((len(s), curve.c.shape[1]))
        where = np.clip(first + s * width, first, last if order == 0 else inside)
        return np.asarray(curve(where, nu=order)) * width**order

    near = 1e-9 * width
    inner = np.unique(curve.t[(curve.t > first + near) & (curve.t < last - near)])
    return Piece(values, knots=tuple(((inner - first) / width).tolist()))


def function_piece(functions: Sequence[Function], first: float, last: float) -> Piece:
    """Return the stretch of exact callables (value, first derivative, ...) between parameters.

    Derivatives of higher order than given come from eighth-order differences of the last one
    given, which keeps about nine digits for a function that is smooth on the stretch.
    """
    width = last - first
    # Derivatives at the end belong to this stretch, not to the one that begins there.
    inside = np.nextafter(last, first)

    def values(s: FloatArray, order: int) -> FloatArray:
        t = first + s * width
        if order == 0:
            return _shaped(functions[0](t), len(s))
        given = len(functions) - 1
        t = np.minimum(t, inside)
        if order <= given:
            return _shaped(functions[order](t), len(s)) * width**order
        found = _differences(functions[given], t, order - given, first, float(inside))
        return found * width**order

    return Piece(values)


def _shaped(values: FloatArray, count: int) -> FloatArray:
    return np.broadcast_to(np.asarray(values, dtype=float), (count, 3))


def _differences(
    function: Function, t: FloatArray, order: int, first: float, last: float
) -> FloatArray:
    """Return derivatives from the polynomial through nine Chebyshev points near each t."""
    reach = min(0.02 * order, 0.5 * (last - first))
    middle = np.clip(t, first + reach, last - reach)
    nodes = np.cos(np.pi * (np.arange(9) + 0.5) / 9)
    places = np.clip(middle[:, None] + reach * nodes, first, last)
    samples = _shaped(function(places.ravel()), places.size).reshape(len(t), 9, 3)
    basis = np.polynomial.chebyshev.chebvander(nodes, 8)
    coefficients = np.einsum("jk,nkc->jnc", np.linalg.inv(basis), samples)
    derived = np.polynomial.chebyshev.chebder(coefficients, order) / reach**order
    at = np.polynomial.chebyshev.chebvander((t - middle) / reach, derived.shape[0] - 1)
    return np.einsum("nj,jnc->nc", at, derived)


def panels_of(piece: Piece) -> FloatArray:
    """Return the ends (p + 1,) of the quadrature panels of a piece, knots included."""
    if piece.straight:
        return np.array([0.0, 1.0])
    knots = np.array(piece.knots)
    even = np.linspace(0.0, 1.0, PANELS + 1)
    # A knot replaces the even end beside it, or a panel of rounding's width would stay.
    near = np.isclose(even[1:-1, None], knots, rtol=0.0, atol=1e-6).any(axis=1)
    return np.unique(np.concatenate([even[:1], even[1:-1][~near], knots, even[-1:]]))


def length_between(piece: Piece, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return arc lengths (n,) by Gauss quadrature; no knot may lie between low and high (n,)."""
    half = 0.5 * (high - low)
    s = 0.5 * (low + high)[:, None] + half[:, None] * NODES
    speed = np.linalg.norm(piece.values(s.ravel(), 1), axis=1).reshape(s.shape)
    return half * (speed @ WEIGHTS)

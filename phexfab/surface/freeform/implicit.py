"""Implicit surfaces: the zeros of a function in space; parameters are points near the surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from phexfab.errors import SurfaceError
from phexfab.surface.freeform.bending import (
    Bending,
    BoolArray,
    Domain,
    FloatArray,
    bending_in_frame,
)

Scalar = Callable[[FloatArray], FloatArray]
STEPS = 60


@dataclass(frozen=True, eq=False)
class ImplicitSurface:
    """The zeros of a function of points in space, within a box.

    A parameter is a point (..., 3); the surface's point for it is found by projection along the
    gradient. The normal is the unit gradient.

    Attributes
    ----------
    name : str
    function, gradient, hessian : callable
        (k, 3) points in mm to (k,), (k, 3), (k, 3, 3).
    low, high : (3,) float
        The box, mm.
    within : callable or None
        (k, 3) points of the surface to (k,) bool, True away from a border.
    start : callable or None
        (k, 3) points to (k, 3) first guesses of their nearest points.
    sites : (n, 3) float or None
        Points that cover the surface.
    side : 1 or -1
        The normal is ``side`` times the unit gradient.
    jet : callable or None
        (k, 3) points and 1 or 2 to the function, gradient and, to order 2, Hessian at once, where
        that costs less.
    """

    name: str
    function: Scalar
    gradient: Scalar
    hessian: Scalar
    low: FloatArray
    high: FloatArray
    within: Callable[[FloatArray], BoolArray] | None = None
    start: Scalar | None = None
    sites: FloatArray | None = None
    side: int = 1
    jet: Callable[[FloatArray, int], tuple[FloatArray, ...]] | None = None

    @property
    def domain(self) -> Domain | None:
        """None: parameters are points."""
        return None

    @property
    def periodic(self) -> tuple[bool, bool]:
        """No parameter closes up."""
        return (False, False)

    @cached_property
    def size(self) -> float:
        """Diagonal of its box, mm."""
        return float(np.linalg.norm(self.high - self.low))

    def point(self, u: ArrayLike) -> FloatArray:
        """Return the points (..., 3) of the surface reached from ``u`` along the gradient.

        Raises
        ------
        SurfaceError
            If the projection does not settle; the message names the point.
        """
        array = np.asarray(u, float)
        x = array.reshape(-1, 3).copy()
        todo = np.arange(len(x))
        for _ in range(STEPS):
            step = self._drop(x[todo])
            length = np.linalg.norm(step, axis=1)
            step *= np.minimum(1.0, 0.1 * self.size / np.maximum(length, 1e-300))[:, None]
            x[todo] += step
            todo = todo[~(length <= 1e-13 * self.size)]
            if not len(todo):
                return x.reshape(array.shape)
        raise SurfaceError(
            f"{self.name}: from {array.reshape(-1, 3)[todo[0]].round(3).tolist()} no point of the "
            "surface is reached along the gradient; start nearer"
        )

    def _jet(self, x: FloatArray, order: int) -> tuple[FloatArray, ...]:
        if self.jet is not None:
            return self.jet(x, order)
        return (self.function(x), self.gradient(x), *([self.hessian(x)] if order == 2 else []))

    def _drop(self, x: FloatArray) -> FloatArray:
        f, g = self._jet(x, 1)
        square = (g**2).sum(1)
        with np.errstate(all="ignore"):
            return np.asarray(-(f / square)[:, None] * g)

    def normal(self, u: ArrayLike) -> FloatArray:
        """Return the unit normals (..., 3) at ``point(u)``."""
        x = self.point(u)
        return self._normal(x, self.gradient(x.reshape(-1, 3)).reshape(x.shape))

    def _normal(self, x: FloatArray, gradient: FloatArray) -> FloatArray:
        g = self.side * gradient
        length = np.linalg.norm(g, axis=-1, keepdims=True)
        if not (length > 0).all():
            bad = x.reshape(-1, 3)[(length <= 0).ravel()][0]
            raise SurfaceError(
                f"{self.name}: the gradient vanishes at {bad.round(3).tolist()} (a singular point)"
            )
        return np.asarray(g / length)

    def bending(self, u: ArrayLike) -> Bending:
        """Return normals, principal curvatures (1/mm) and directions at ``point(u)``.

        With F(x + t + z n) = 0 the height over the tangent plane is −t·H·t / (2 |∇F|).
        """
        x = self.point(u)
        _, slope, second = self._jet(x.reshape(-1, 3), 2)
        gradient, hessian = slope.reshape(x.shape), second.reshape(*x.shape[:-1], 3, 3)
        normals = self._normal(x, gradient)
        scale = -self.side / np.linalg.norm(gradient, axis=-1)
        e1, e2 = frame(normals)
        he1 = np.einsum("...ij,...j->...i", hessian, e1)
        he2 = np.einsum("...ij,...j->...i", hessian, e2)
        a, b, c = ((e1 * he1).sum(-1), (e1 * he2).sum(-1), (e2 * he2).sum(-1))
        return bending_in_frame(scale * a, scale * b, scale * c, e1, e2, normals)

    def derivatives(self, u: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return derivatives in the chart that projects to the tangent plane, at its centre.

        The first are the two principal directions, the second the curvatures times the normal.
        """
        bending = self.bending(u)
        second = np.zeros((*bending.normals.shape[:-1], 3, 3))
        second[..., [0, 2], :] = bending.kappa[..., None] * bending.normals[..., None, :]
        return bending.directions, second

    def inside(self, u: ArrayLike) -> BoolArray:
        """Return (...) True strictly within the box, and off the border of a mesh."""
        array = np.asarray(u, float)
        margin = 1e-12 * self.size
        held = ((array > self.low + margin) & (array < self.high - margin)).all(axis=-1)
        if self.within is not None:
            held = held & self.within(array.reshape(-1, 3)).reshape(held.shape)
        return np.asarray(held)

    def seeds(self, count: int) -> FloatArray:
        """Return about ``count`` points of the surface, where a grid of its box changes sign.

        Raises
        ------
        SurfaceError
            If the function has one sign all over the grid.
        """
        if self.sites is not None:
            step = max(len(self.sites) // count, 1)
            points = self.point(self.sites[::step])
            return points[self.inside(points)]
        n = max(int(np.sqrt(count / 3)), 8)
        axes = [np.linspace(a, b, n + 1) for a, b in zip(self.low, self.high, strict=True)]
        grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
        value = self.function(grid.reshape(-1, 3)).reshape(grid.shape[:-1])
        found = []
        for axis in range(3):
            here, there = (np.take(value, range(k, n + k), axis=axis) for k in (0, 1))
            begin, end = (np.take(grid, range(k, n + k), axis=axis) for k in (0, 1))
            turn = here * there < 0
            share = here[turn] / (here[turn] - there[turn])
            found.append(begin[turn] + share[:, None] * (end[turn] - begin[turn]))
        points = np.concatenate(found)
        if not len(points):
            raise SurfaceError(f"{self.name}: has no point in its box; check the box and the unit")
        points = self.point(points)
        points = points[self.inside(points)]
        return np.asarray(points[:: max(len(points) // count, 1)])

    def nearest(self, points: ArrayLike, guess: ArrayLike | None = None) -> FloatArray:
        """Return the nearest points (..., 3) of the surface.

        Newton on the Lagrange system of ½|x − p|² and F(x) = 0, from ``guess`` (or the points
        themselves), with the Gauss–Newton step where the system is not that of a minimum.

        Raises
        ------
        SurfaceError
            If an iteration does not settle; the message names the point.
        """
        array = np.asarray(points, float)
        target = array.reshape(-1, 3)
        if guess is not None:
            begin = np.broadcast_to(np.asarray(guess, float), array.shape).reshape(-1, 3)
        else:
            begin = target if self.start is None else self.start(target)
        x = self.point(begin)
        todo = np.arange(len(x))
        for _ in range(STEPS):
            step = self._step(target[todo], x[todo])
            length = np.linalg.norm(step, axis=1)
            step *= np.minimum(1.0, 0.1 * self.size / np.maximum(length, 1e-300))[:, None]
            x[todo] += step
            todo = todo[~(length <= 1e-12 * self.size)]
            if not len(todo):
                return self.point(x).reshape(array.shape)
        raise SurfaceError(
            f"{self.name}: the nearest point to {target[todo[0]].round(3).tolist()} was not found "
            f"in {STEPS} steps; it may lie near a centre of curvature"
        )

    def _step(self, target: FloatArray, x: FloatArray) -> FloatArray:
        f, g, hessian = self._jet(x, 2)
        square = (g**2).sum(1)
        normal = g / np.sqrt(square)[:, None]
        gap = x - target
        multiplier = -(gap * g).sum(1) / square
        e1, e2 = frame(normal)
        basis = np.stack([e1, e2], axis=1)
        bend = np.einsum("kai,kij,kbj->kab", basis, hessian, basis)
        matrix = np.eye(2) + multiplier[:, None, None] * bend
        good = (matrix[:, 0, 0] > 0) & (np.linalg.det(matrix) > 1e-2)
        matrix = np.where(good[:, None, None], matrix, np.eye(2))
        slope = np.einsum("kai,ki->ka", basis, gap)
        along = -np.linalg.solve(matrix, slope[..., None])[..., 0]
        return np.asarray(np.einsum("ka,kai->ki", along, basis) - (f / square)[:, None] * g)


def frame(normals: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors (..., 3) each that are right-handed with unit normals."""
    least = np.abs(normals).argmin(axis=-1)
    e1 = np.cross(np.eye(3)[least], normals)
    e1 = e1 / np.linalg.norm(e1, axis=-1, keepdims=True)
    return e1, np.cross(normals, e1)


def implicit(
    function: Scalar,
    gradient: Scalar,
    hessian: Scalar,
    box: tuple[ArrayLike, ArrayLike],
    *,
    flipped: bool = False,
    name: str = "implicit surface",
) -> ImplicitSurface:
    """Return the surface where a function of space vanishes.

    Parameters
    ----------
    function, gradient, hessian : callable
        Points (k, 3) in mm to (k,), (k, 3), (k, 3, 3).
    box : (low (3,), high (3,))
        Where the surface ends, mm.
    flipped : bool
        Whether the normal is minus the unit gradient.
    name : str

    Raises
    ------
    SurfaceError
        If the box is empty.
    """
    low, high = (np.asarray(bound, float).reshape(3) for bound in box)
    if not (low < high).all():
        raise SurfaceError(f"{name}: the box {low.tolist()} to {high.tolist()} is empty")
    return ImplicitSurface(name, function, gradient, hessian, low, high, side=-1 if flipped else 1)

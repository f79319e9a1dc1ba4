"""Parametric surfaces: any callable, its derivatives given or by differences of high order."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from phexfab.errors import SurfaceError
from phexfab.surface.freeform.bending import Bending, BoolArray, Domain, FloatArray, bending_of

Derivatives = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
IntArray = NDArray[np.int64]

STEPS = 50
GRID = 65
REACH = 4  # differences use 2 · REACH + 1 places a side
WIDTH = 1 / 250  # distance of neighbouring places, over the width of the domain


@dataclass(frozen=True, eq=False)
class ParametricSurface:
    """A surface given by a function of two parameters on a rectangle.

    Attributes
    ----------
    name : str
    value : callable
        (k, 2) parameters to (k, 3) points in mm.
    jet : callable
        (k, 2) parameters to points (k, 3), first (k, 2, 3) and second (k, 3, 3) derivatives.
    domain : (u0, u1, v0, v1)
    periodic : (bool, bool)
    side : 1 or -1
        The normal is ``side`` times X_u × X_v.
    """

    name: str
    value: Callable[[FloatArray], FloatArray]
    jet: Derivatives
    domain: Domain
    periodic: tuple[bool, bool] = (False, False)
    side: int = 1

    @cached_property
    def low(self) -> FloatArray:
        """(2,) u0, v0."""
        return np.array([self.domain[0], self.domain[2]], float)

    @cached_property
    def width(self) -> FloatArray:
        """(2,) widths of the domain."""
        return np.array([self.domain[1] - self.domain[0], self.domain[3] - self.domain[2]], float)

    @cached_property
    def _samples(self) -> tuple[FloatArray, FloatArray, cKDTree]:
        one = np.linspace(0.0, 1.0, GRID)
        u = self.low + self.width * np.stack(np.meshgrid(one, one, indexing="ij"), -1)
        u = u.reshape(-1, 2)
        points = self.value(u)
        if not np.isfinite(points).all():
            bad = u[~np.isfinite(points).all(axis=1)][0]
            raise SurfaceError(
                f"{self.name}: the point at u, v = {bad[0]:.6g}, {bad[1]:.6g} is not finite; "
                "choose a smaller domain"
            )
        return u, points, cKDTree(points)

    @cached_property
    def size(self) -> float:
        """Diagonal of its box, mm."""
        return float(np.linalg.norm(np.ptp(self._samples[1], axis=0)))

    def point(self, u: ArrayLike) -> FloatArray:
        """Return the points (..., 3) in mm of parameters (..., 2)."""
        flat, shape = _flat(u, 2)
        return self.value(flat).reshape(*shape, 3)

    def derivatives(self, u: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the first (..., 2, 3) and second (..., 3, 3: uu, uv, vv) derivatives."""
        flat, shape = _flat(u, 2)
        _, first, second = self.jet(flat)
        return first.reshape(*shape, 2, 3), second.reshape(*shape, 3, 3)

    def normal(self, u: ArrayLike) -> FloatArray:
        """Return the unit normals (..., 3).

        Raises
        ------
        SurfaceError
            Where X_u and X_v are parallel (a pole).
        """
        return self._normal(np.asarray(u, float), self.derivatives(u)[0])

    def _normal(self, u: FloatArray, first: FloatArray) -> FloatArray:
        cross = self.side * np.cross(first[..., 0, :], first[..., 1, :])
        length = np.linalg.norm(cross, axis=-1, keepdims=True)
        sides = np.linalg.norm(first, axis=-1)
        flawed = ~(length[..., 0] > 1e-9 * sides.max(-1, initial=0.0) ** 2)
        if flawed.any():
            bad = np.broadcast_to(u, (*flawed.shape, 2))[flawed][0]
            raise SurfaceError(
                f"{self.name}: no normal at u, v = {bad[0]:.6g}, {bad[1]:.6g}, the parameter lines "
                "touch there (a pole); choose a domain without it"
            )
        return np.asarray(cross / length)

    def bending(self, u: ArrayLike) -> Bending:
        """Return normals, principal curvatures (1/mm) and principal directions.

        Raises
        ------
        SurfaceError
            Where X_u and X_v are parallel (a pole).
        """
        first, second = self.derivatives(u)
        return bending_of(first, second, self._normal(np.asarray(u, float), first))

    def inside(self, u: ArrayLike) -> BoolArray:
        """Return (...) True strictly inside the domain; a periodic parameter has no border."""
        t = (np.asarray(u, float) - self.low) / self.width
        within = (t > 1e-12) & (t < 1 - 1e-12)
        return np.asarray((within | np.array(self.periodic)).all(axis=-1))

    def seeds(self, count: int) -> FloatArray:
        """Return about ``count`` parameters: midpoints of a grid's cells."""
        sides = np.linalg.norm(np.diff(self._samples[1].reshape(GRID, GRID, 3), axis=0), axis=-1)
        across = np.linalg.norm(np.diff(self._samples[1].reshape(GRID, GRID, 3), axis=1), axis=-1)
        aspect = sides.sum(axis=0).mean() / across.sum(axis=1).mean()
        n = np.maximum(np.round(np.sqrt([count * aspect, count / aspect])), 2).astype(int)
        s, t = ((np.arange(k) + 0.5) / k for k in n)
        grid = np.stack(np.meshgrid(s, t, indexing="ij"), -1).reshape(-1, 2)
        return np.asarray(self.low + self.width * grid)

    def wrapped(self, u: ArrayLike) -> FloatArray:
        """Return parameters brought into the domain: wrapped where periodic, else clamped."""
        t = (np.asarray(u, float) - self.low) / self.width
        t = np.where(np.array(self.periodic), t % 1.0, np.clip(t, 0.0, 1.0))
        return np.asarray(self.low + self.width * t)

    def nearest(self, points: ArrayLike, guess: ArrayLike | None = None) -> FloatArray:
        """Return the parameters (..., 2) of the nearest points, on the border where it must be.

        Newton on the squared distance with halved steps, from the nearest of 65 × 65 samples or
        from ``guess``.

        Raises
        ------
        SurfaceError
            If an iteration does not settle; the message names the point.
        """
        target, shape = _flat(points, 3)
        if guess is None:
            u = self._samples[0][self._samples[2].query(target)[1]].copy()
        else:
            u = np.array(np.broadcast_to(np.asarray(guess, float), (*shape, 2))).reshape(-1, 2)
            u = self.wrapped(u)
        todo = np.arange(len(u))
        for _ in range(STEPS):
            u[todo], moved = self._step(target[todo], u[todo])
            todo = todo[moved]
            if not len(todo):
                return u.reshape(*shape, 2)
        raise SurfaceError(
            f"{self.name}: the nearest point to {target[todo[0]].round(3).tolist()} was not found "
            f"in {STEPS} steps; it may lie near a centre of curvature"
        )

    def _step(self, target: FloatArray, u: FloatArray) -> tuple[FloatArray, BoolArray]:
        """One damped Newton step; also whether it moved by more than rounding."""
        points, first, second = self.jet(u)
        # In units of the domain, so that no parameter outweighs the other.
        first = first * self.width[:, None]
        second = second * (self.width[[0, 0, 1]] * self.width[[0, 1, 1]])[:, None]
        gap = points - target
        slope = np.einsum("kij,kj->ki", first, gap)
        gram = np.einsum("kij,klj->kil", first, first)
        curve = np.einsum("kij,kj->ki", second, gap)
        full = gram + curve[:, [[0, 1], [1, 2]]]
        good = (full[:, 0, 0] > 0) & (np.linalg.det(full) > 1e-3 * np.linalg.det(gram))
        matrix = np.where(good[:, None, None], full, gram)
        t = (u - self.low) / self.width
        loose = np.array(self.periodic)
        held = ~loose & (((t <= 0) & (slope > 0)) | ((t >= 1) & (slope < 0)))
        matrix = np.where(held[:, :, None] | held[:, None, :], 0.0, matrix)
        trace = np.einsum("kii->k", gram) + 1e-300
        matrix[:, [0, 1], [0, 1]] += np.where(held, 1.0, 1e-14 * trace[:, None])
        slope = np.where(held, 0.0, slope)
        step = -np.linalg.solve(matrix, slope[..., None])[..., 0]
        step /= np.maximum(1.0, np.abs(step).max(axis=1) / 0.1)[:, None]
        now = (gap**2).sum(1)
        best = u
        left = np.arange(len(u))
        for _ in range(12):
            trial = self.wrapped(u[left] + step[left] * self.width)
            away = ((self.value(trial) - target[left]) ** 2).sum(1)
            better = away <= now[left] * (1 + 1e-12) + 1e-28 * self.size**2
            if best is u:
                best = u.copy()
            best[left[better]] = trial[better]
            left = left[~better]
            if not len(left):
                break
            step[left] *= 0.5
        moved = np.linalg.norm(np.einsum("ki,kij->kj", step, first), axis=1)
        return best, moved > 1e-11 * self.size


def parametric(
    function: Callable[..., ArrayLike],
    domain: Domain,
    *,
    derivatives: Derivatives | None = None,
    periodic: tuple[bool, bool] = (False, False),
    flipped: bool = False,
    name: str = "surface",
) -> ParametricSurface:
    """Return the surface of a function of two parameters.

    Parameters
    ----------
    function : callable
        ``function(u, v)`` with arrays of one shape (k,) returns x, y, z as three arrays, or one
        array (k, 3), in mm.
    domain : (u0, u1, v0, v1)
    derivatives : callable, optional
        ``derivatives(u)`` with (k, 2) parameters returns points (k, 3), first (k, 2, 3) and second
        (k, 3, 3: uu, uv, vv) derivatives. Without it, differences of eighth order within the
        domain, good to about 1e-9 relative for a function smooth over a fortieth of its domain.
    periodic : (bool, bool)
        Whether u or v closes up.
    flipped : bool
        Whether the normal is −X_u × X_v.
    name : str
        What messages call it.

    Raises
    ------
    SurfaceError
        If the domain is empty or the function does not return points.
    """
    u0, u1, v0, v1 = (float(bound) for bound in domain)
    if not (u0 < u1 and v0 < v1 and np.isfinite([u0, u1, v0, v1]).all()):
        raise SurfaceError(f"{name}: domain {domain} must have u0 < u1 and v0 < v1")

    def value(u: FloatArray) -> FloatArray:
        with np.errstate(all="ignore"):
            out = function(u[:, 0], u[:, 1])
        if isinstance(out, tuple | list):
            parts = [np.broadcast_to(np.asarray(part, float), (len(u),)) for part in out]
            points = np.stack(parts, axis=-1)
        else:
            points = np.asarray(out, float)
        if points.shape != (len(u), 3):
            raise SurfaceError(
                f"{name}: the function returned shape {points.shape} for {len(u)} parameters; it "
                "must return x, y, z or an array (k, 3)"
            )
        return points

    box = (u0, u1, v0, v1)
    jet = derivatives or difference_jet(value, box, periodic)
    return ParametricSurface(name, value, jet, box, periodic, -1 if flipped else 1)


def flipped(surface: ParametricSurface) -> ParametricSurface:
    """Return the same surface with its normal on the other side."""
    return replace(surface, side=-surface.side)


def difference_jet(
    value: Callable[[FloatArray], FloatArray], domain: Domain, periodic: tuple[bool, bool]
) -> Derivatives:
    """Return a function for points, first and second derivatives by differences in the domain.

    Nine places a side; near the border the block of places moves inwards, so that the function is
    never asked beyond its domain. The polynomial through the block is differentiated where it is
    wanted (Fornberg's weights, written with Lagrange's basis).
    """
    low = np.array([domain[0], domain[2]])
    width = np.array([domain[1] - domain[0], domain[3] - domain[2]])
    h = WIDTH * width
    offsets = np.arange(-REACH, REACH + 1.0)
    powers = np.linalg.inv(np.vander(offsets, increasing=True))  # row k: coefficient of x^k

    def jet(u: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        margin = REACH * h
        centre = np.where(np.array(periodic), u, np.clip(u, low + margin, low + width - margin))
        at = (u - centre) / h  # (k, 2), within ±REACH
        places = centre[:, None, None, :] + np.stack(
            np.meshgrid(h[0] * offsets, h[1] * offsets, indexing="ij"), -1
        )
        block = value(places.reshape(-1, 2)).reshape(len(u), 9, 9, 3)
        middle = block[:, REACH, REACH]
        local = block - middle[:, None, None]
        order = np.arange(9.0)
        weights = []
        for d in range(3):
            factor = np.prod([order - i for i in range(d)], axis=0) if d else np.ones(9)
            raised = np.where(order >= d, at[..., None] ** np.maximum(order - d, 0), 0.0)
            weights.append((factor * raised) @ powers)  # (k, 2, 9)
        part = {
            (i, j): np.einsum("ka,kb,kabc->kc", weights[i][:, 0], weights[j][:, 1], local)
            / (h[0] ** i * h[1] ** j)
            for i, j in ((1, 0), (0, 1), (2, 0), (1, 1), (0, 2))
        }
        first = np.stack([part[1, 0], part[0, 1]], axis=1)
        second = np.stack([part[2, 0], part[1, 1], part[0, 2]], axis=1)
        return value(u), first, second

    return jet


def _flat(values: ArrayLike, size: int) -> tuple[FloatArray, tuple[int, ...]]:
    array = np.asarray(values, float)
    if array.shape[-1:] != (size,):
        raise SurfaceError(f"values of shape {array.shape} must have {size} in the last place")
    return array.reshape(-1, size), array.shape[:-1]

"""Minimal surfaces as values: Weierstrass data, and everything that follows from them.

With a meromorphic g (the Gauss map) and a holomorphic f,

    X = scale · Re ∫ φ dz,   φ = (f(1-g²)/2, i f(1+g²)/2, f g),
    N = (2 Re g, 2 Im g, |g|²-1) / (|g|²+1),   Q = f g'.

Then ``II = -scale · Re(Q dz²)``, so that in ``w = u + iv = ∫ √Q dz`` the u-lines and v-lines are
the curvature lines, with curvatures -κ along u and +κ along v, and ``ds² = scale² |dw|²/κ`` with
κ taken on the unscaled surface.

References
----------
Thesis ch. 2; Dierkes, Hildebrandt, Sauvigny, Minimal Surfaces (2010), sec. 3.3.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import SurfaceError
from phexfab.surface.continuation import continue_from_base, start_germ
from phexfab.surface.footpoint import foot_parameter, normal_parameter
from phexfab.surface.holomorphic import ComplexArray, evaluate, filled, limit, show
from phexfab.surface.quadrature import integrate, integrate_root

FloatArray = NDArray[np.float64]
Rectangle = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class MinimalSurface:
    """A minimal surface given by Weierstrass data; parameters are complex arrays of any shape.

    Attributes
    ----------
    name : str
    gauss_map, gauss_map_derivative, form : callable
        g(z), g'(z) and f(z) of complex arrays. They may be 0/0 at removable points and have poles
        where the surface itself is regular.
    null_curve : callable or None
        Closed antiderivative Φ(z) of φ, (..., 3) complex, unscaled; its constant places the
        surface. Without it X is integrated along the straight segment from ``base``, X(base) = 0.
    base : complex
        The parameter where w = 0.
    to_curvature, from_curvature : callable or None
        Closed forms of w(z), with w(base) = 0, and of z(w). Without them w is integrated along
        the straight segment from ``base``, and z continued along the straight segment from w = 0.
    period : complex or None
        In w; the surface closes exactly under w -> w + period.
    rectangle : (u0, u1, v0, v1)
        A good rectangle in w.
    singular : tuple of complex
        Known zeros and poles of Q in z: umbilics, branch points, ends.
    scale : float
        Length of the unit, in mm. It multiplies X and nothing else: z and w are dimensionless.

    Examples
    --------
    >>> import phexfab as px
    >>> film = px.minimal_surface("catenoid").scaled(1000.0)  # the neck's radius in mm
    >>> z = film.parameter(0.5)  # of w = u + iv, the curvature-line coordinates
    >>> print(film.point(z).round(1)[2], film.normal(z).round(3)[2])
    500.0 0.462
    >>> print(film.principal_curvatures(z).round(6))  # 1/mm
    [-0.000786  0.000786]
    """

    name: str
    gauss_map: Callable[[ComplexArray], Any]
    gauss_map_derivative: Callable[[ComplexArray], Any]
    form: Callable[[ComplexArray], Any]
    null_curve: Callable[[ComplexArray], Any] | None = None
    base: complex = 0.0
    to_curvature: Callable[[ComplexArray], Any] | None = None
    from_curvature: Callable[[ComplexArray], Any] | None = None
    period: complex | None = None
    rectangle: Rectangle = (-0.5, 0.5, -0.5, 0.5)
    singular: tuple[complex, ...] = field(default=())
    scale: float = 1.0

    def __post_init__(self) -> None:
        u0, u1, v0, v1 = self.rectangle
        object.__setattr__(self, "rectangle", (float(u0), float(u1), float(v0), float(v1)))

    def scaled(self, factor: float) -> MinimalSurface:
        """Return the surface ``factor`` times as large.

        Raises
        ------
        SurfaceError
            If the factor is not positive and finite.
        """
        if not 0 < factor < np.inf:
            raise SurfaceError(f"{self.name}: the scale must be positive, not {factor}")
        return replace(self, scale=self.scale * float(factor))

    # -- Weierstrass data, with removable points filled in ---------------------------------------

    def hopf(self, z: ArrayLike) -> ComplexArray:
        """Return Q = f g' of the unscaled surface; ``inf`` at a pole."""
        return filled(lambda s: evaluate(self.form, s) * evaluate(self.gauss_map_derivative, s))(
            np.asarray(z, complex)
        )

    def tangent(self, z: ArrayLike) -> ComplexArray:
        """Return φ, (..., 3) complex, unscaled: X_u = scale Re φ and X_v = -scale Im φ.

        Raises
        ------
        SurfaceError
            At an end.
        """
        phi = self._phi(z)
        self._refuse(z, ~np.isfinite(phi).all(-1), "the surface runs to infinity (an end)")
        return phi

    def _phi(self, z: ArrayLike) -> ComplexArray:
        def raw(s: ComplexArray) -> ComplexArray:
            g, f = evaluate(self.gauss_map, s), evaluate(self.form, s)
            return np.stack([0.5 * f * (1 - g * g), 0.5j * f * (1 + g * g), f * g], -1)

        points = np.asarray(z, complex)
        with np.errstate(all="ignore"):
            phi = raw(points)
        bad = ~np.isfinite(phi).all(-1)
        if bad.any():
            phi[bad] = limit(raw, points[bad])
        return phi

    def _chart(self, z: ArrayLike) -> tuple[ComplexArray, ComplexArray, FloatArray]:
        """Return (g, g', -1) where |g| <= 1 and (1/g, (1/g)', +1) elsewhere."""

        def inverse(s: ComplexArray) -> ComplexArray:
            return 1.0 / evaluate(self.gauss_map, s)

        def inverse_slope(s: ComplexArray) -> ComplexArray:
            g = evaluate(self.gauss_map, s)
            return -evaluate(self.gauss_map_derivative, s) / (g * g)

        points = np.asarray(z, complex)
        g, slope = filled(self.gauss_map)(points), filled(self.gauss_map_derivative)(points)
        outer = ~(np.abs(g) <= 1)
        if outer.any():
            g[outer] = filled(inverse)(points[outer])
            slope[outer] = filled(inverse_slope)(points[outer])
        return g, slope, np.where(outer, 1.0, -1.0)

    def _refuse(self, z: ArrayLike, bad: ArrayLike, why: str) -> None:
        if np.any(bad):
            place = np.asarray(z, complex)[np.asarray(bad)].ravel()[0]
            raise SurfaceError(f"{self.name}: {why} at z = {show(place)}")

    # -- points, normals, fundamental forms ------------------------------------------------------

    def point(self, z: ArrayLike) -> FloatArray:
        """Return X(z), (..., 3), in mm.

        Raises
        ------
        SurfaceError
            At an end, or when the segment from the base meets one.
        """
        points = np.asarray(z, complex)
        if self.null_curve is None:
            curve = integrate(self._phi, self.base, points.ravel()).reshape(*points.shape, 3)
        else:
            with np.errstate(all="ignore"):
                curve = np.asarray(self.null_curve(points), complex)
            self._refuse(z, ~np.isfinite(curve).all(-1), "the surface runs to infinity (an end)")
        return self.scale * curve.real

    def normal(self, z: ArrayLike) -> FloatArray:
        """Return the unit normal N = X_u × X_v / |X_u × X_v|, (..., 3)."""
        g, _, side = self._chart(z)
        square = np.abs(g) ** 2
        top = _vector(2 * g.real, -2 * side * g.imag, side * (1 - square))
        return top / (1 + square)[..., None]

    def conformal_factor(self, z: ArrayLike) -> FloatArray:
        """Return ds/|dz| = scale |f| (1+|g|²)/2, in mm."""
        phi = self.tangent(z)
        return self.scale * np.sqrt(0.5 * (phi.real**2 + phi.imag**2).sum(-1))

    def _frames(self, z: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return (X_u, X_v) and (N_u, N_v), each (..., 2, 3)."""
        phi = self.scale * self.tangent(z)
        g, slope, side = self._chart(z)
        square = (np.abs(g) ** 2)[..., None]
        normal = _vector(2 * g.real, -2 * side * g.imag, side * (1 - square[..., 0])) / (1 + square)
        turns = []
        for d in (slope, 1j * slope):
            growth = 2 * (g.conj() * d).real
            change = _vector(2 * d.real, -2 * side * d.imag, -side * growth)
            turns.append((change - normal * growth[..., None]) / (1 + square))
        return np.stack([phi.real, -phi.imag], -2), np.stack(turns, -2)

    def first_form(self, z: ArrayLike) -> FloatArray:
        """Return the first fundamental form <X_i, X_j>, (..., 2, 2), in mm²."""
        x, _ = self._frames(z)
        return x @ np.swapaxes(x, -1, -2)

    def second_form(self, z: ArrayLike) -> FloatArray:
        """Return the second fundamental form -<X_i, N_j>, (..., 2, 2), in mm."""
        x, n = self._frames(z)
        form = -x @ np.swapaxes(n, -1, -2)
        return 0.5 * (form + np.swapaxes(form, -1, -2))

    def weingarten(self, z: ArrayLike) -> FloatArray:
        """Return the Weingarten map I⁻¹ II in the basis (X_u, X_v), (..., 2, 2), in 1/mm.

        Raises
        ------
        SurfaceError
            At a branch point.
        """
        first = self.first_form(z)
        self._refuse(z, first[..., 0, 0] * first[..., 1, 1] == 0, "the surface has a branch point")
        return np.asarray(np.linalg.solve(first, self.second_form(z)), float)

    def mean_curvature(self, z: ArrayLike) -> FloatArray:
        """Return H, half the trace of the Weingarten map, in 1/mm: rounding, never exactly set."""
        return 0.5 * np.trace(self.weingarten(z), axis1=-2, axis2=-1)

    def gaussian_curvature(self, z: ArrayLike) -> FloatArray:
        """Return K, the determinant of the Weingarten map, in 1/mm²."""
        return np.linalg.det(self.weingarten(z))

    def principal_curvatures(self, z: ArrayLike) -> FloatArray:
        """Return (κ_u, κ_v), (..., 2), in 1/mm: κ_u < 0 along the u-lines, κ_v > 0 along v."""
        shape = self.weingarten(z)
        mean = 0.5 * np.trace(shape, axis1=-2, axis2=-1)
        root = np.sqrt(np.maximum(mean**2 - np.linalg.det(shape), 0.0))
        return np.stack([mean - root, mean + root], -1)

    def principal_directions(self, z: ArrayLike) -> FloatArray:
        """Return the unit tangents of the u-line and the v-line, (..., 2, 3), right-handed with N.

        They are directions of lines: their common sign is that of the principal root of Q.

        Raises
        ------
        SurfaceError
            At an umbilic, where every direction is principal.
        """
        q = self.hopf(z)
        self._refuse(z, (q == 0) | ~np.isfinite(q), "there are no principal directions")
        along = self.tangent(z) / np.sqrt(q)[..., None]
        pair = np.stack([along.real, -along.imag], -2)
        return pair / np.linalg.norm(pair, axis=-1, keepdims=True)

    # -- curvature-line coordinates --------------------------------------------------------------

    def curvature_coordinates(self, z: ArrayLike) -> ComplexArray:
        """Return w = u + iv = ∫ √Q dz from the base, dimensionless.

        Raises
        ------
        SurfaceError
            If, without a closed form, the segment from the base meets a zero or pole of Q.
        """
        points = np.asarray(z, complex)
        if self.to_curvature is not None:
            return evaluate(self.to_curvature, points)
        start = start_germ(self.hopf, self.base)
        ends = points.ravel()
        return integrate_root(self.hopf, self.base, start.root[0], ends).reshape(points.shape)

    def parameter(self, w: ArrayLike) -> ComplexArray:
        """Return z(w), the inverse of `curvature_coordinates`.

        Raises
        ------
        SurfaceError
            If the continuation from w = 0 meets an umbilic, a branch point or an end; the message
            names the place in z and in w.
        """
        points = np.asarray(w, complex)
        if self.from_curvature is None:
            return continue_from_base(self.hopf, self.base, points.ravel()).z.reshape(points.shape)
        z = evaluate(self.from_curvature, points)
        if not np.isfinite(z).all():
            place = points[~np.isfinite(z)].ravel()[0]
            raise SurfaceError(
                f"{self.name}: the parameter z runs to infinity at w = {show(place)}; "
                "choose a rectangle that avoids it"
            )
        return z

    # -- inverse problems ------------------------------------------------------------------------

    def closest_parameter(self, points: ArrayLike, guess_z: ArrayLike) -> ComplexArray:
        """Return the z whose X(z) is the foot of each of ``points`` (..., 3), near ``guess_z``.

        Raises
        ------
        SurfaceError
            If an iteration does not settle; the message names the guess.
        """
        return foot_parameter(self, points, guess_z)

    def parameter_of_normal(self, normals: ArrayLike, guess_z: ArrayLike) -> ComplexArray:
        """Return the z near ``guess_z`` with N(z) equal to each of ``normals`` (..., 3).

        Raises
        ------
        SurfaceError
            If an iteration does not settle; the message names the normal and the guess.
        """
        return normal_parameter(self, normals, guess_z)


def _vector(x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
    return np.stack(np.broadcast_arrays(x, y, z), -1)

"""Douglas' functional on samples of the unit circle, graded towards the corners of a rim.

The harmonic extension of boundary values X(θ) has the Dirichlet energy

    ½ ∫ |∇X|² = 1/(16π) ∫∫ |X(θ) − X(ϑ)|² / sin²((θ − ϑ)/2) dθ dϑ    [1]_.

With θ = θ(σ) the integrand stays smooth on the diagonal, where it is 4 |X'(σ)|², so that the plain
trapezoid rule in σ is as accurate as X(σ) and θ(σ) are smooth. A corner of the rim has a power law
X ~ θ^α; grading the samples as θ ~ σ^p with p = q/α makes it σ^q, and the rule of order 2q. On
uniform samples the same sum is the exact energy of the trigonometric interpolant.

References
----------
.. [1] J. Douglas, "Solution of the problem of Plateau", Trans. AMS 33 (1931), 263-321.
.. [2] R. Kress, "A Nyström method for boundary integral equations in domains with corners",
   Numer. Math. 58 (1990), 145-161 (grading).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import circulant
from scipy.special import beta, betainc, betaincinv

from phexfab.surface.disc_films.stretch import Stretch

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class BoundaryGrid:
    """Samples on the unit circle, side after side; the first of each side is its corner.

    Attributes
    ----------
    side : (N,) int
        The side of each sample.
    tau : (N,)
        Its number on the side, k/n for k = 0, ..., n − 1.
    place : (N,)
        ``tau`` after the side's stretch.
    share, rest : (N,)
        Share of the side's arc of the circle before and after the sample; both are accurate when
        tiny.
    slope : (N,)
        Change of ``share`` per sample.
    corners : int
        Number of corners, that is of sides; 0 for a smooth rim.
    stretches : (P,)
        Of each side; None for none.
    """

    side: IntArray
    tau: FloatArray
    place: FloatArray
    share: FloatArray
    rest: FloatArray
    slope: FloatArray
    corners: int
    stretches: tuple[Stretch | None, ...]

    def angles(self, gaps: FloatArray) -> FloatArray:
        """Return the angles (N,) for the arcs (P,) between consecutive corners."""
        starts = np.concatenate([[0.0], np.cumsum(gaps)[:-1]])
        return starts[self.side] + gaps[self.side] * self.share

    def weights(self, gaps: FloatArray) -> FloatArray:
        """Return dθ per sample (N,)."""
        return gaps[self.side] * self.slope

    def _nearest(self) -> tuple[IntArray, NDArray[np.bool_]]:
        """The nearer corner of each sample, and whether it is the one at which the side begins."""
        before = self.place <= 0.5
        return np.where(before, self.side, (self.side + 1) % max(self.corners, 1)), before

    def differences(self, gaps: FloatArray) -> FloatArray:
        """Return θ_i − θ_j (N, N), with full relative accuracy next to a corner."""
        theta = self.angles(gaps)
        found = theta[:, None] - theta[None, :]
        if self.corners:
            corner, before = self._nearest()
            own = gaps[self.side] * np.where(before, self.share, -self.rest)
            for c in range(self.corners):
                (at,) = np.nonzero(corner == c)
                found[np.ix_(at, at)] = own[at, None] - own[None, at]
        return found

    def arc_changes(self, moved: int) -> tuple[FloatArray, FloatArray]:
        """Return how differences (N, N) and log-weights (N,) × arc change when a corner moves.

        The second is the change of the arc of the sample's side: +1, −1 or 0.
        """
        before_it, after_it = self.side == (moved - 1) % self.corners, self.side == moved
        change = np.where(before_it, self.share, 0.0) + np.where(after_it, self.rest, 0.0)
        found = change[:, None] - change[None, :]
        corner, before = self._nearest()
        (at,) = np.nonzero(corner == moved)
        own = np.where(after_it & before, -self.share, 0.0)
        own -= np.where(before_it & ~before, self.rest, 0.0)
        found[np.ix_(at, at)] = own[at, None] - own[None, at]
        return found, before_it.astype(float) - after_it.astype(float)


def uniform_grid(count: int, stretch: Stretch | None = None) -> BoundaryGrid:
    """Return ``count`` samples for a smooth rim, uniform on the circle but for the stretch."""
    tau = np.arange(count) / count
    place, slope = (tau, np.ones(count)) if stretch is None else stretch(tau)
    side = np.zeros(count, np.intp)
    return BoundaryGrid(side, tau, place, place, 1.0 - place, slope / count, 0, (stretch,))


def graded_grid(
    counts: IntArray, orders: FloatArray, stretches: tuple[Stretch | None, ...]
) -> BoundaryGrid:
    """Return samples graded towards corners.

    Parameters
    ----------
    counts : (P,) int
        Samples on each side, that of its first corner included.
    orders : (P,)
        Order p of the grading at each corner.
    stretches : (P,)
        Of each side.
    """
    side = np.repeat(np.arange(len(counts)), counts)
    tau = np.concatenate([np.arange(n) / n for n in counts])
    place, rate = tau.copy(), np.ones(len(tau))
    for k, stretch in enumerate(stretches):
        if stretch is not None:
            place[side == k], rate[side == k] = stretch(tau[side == k])
    p, q = orders[side], np.roll(orders, -1)[side]
    slope = rate * place ** (p - 1) * (1 - place) ** (q - 1) / beta(p, q) / counts[side]
    share, rest = power_share(place, p, q)
    return BoundaryGrid(side, tau, place, share, rest, slope, len(counts), stretches)


def power_share(tau: FloatArray, p: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the increasing map of [0, 1] to itself with powers p at 0 and q at 1, and 1 minus it.

    The regularised incomplete beta function: a polynomial for whole p and q.
    """
    return betainc(p, q, tau), betainc(q, p, 1.0 - tau)


def inverse_power_share(share: FloatArray, p: float, q: float) -> FloatArray:
    """Return the inverse of `power_share`."""
    before, after = betaincinv(p, q, share), 1.0 - betaincinv(q, p, 1.0 - share)
    return np.where(share < 0.5, before, after)


@dataclass(frozen=True, eq=False)
class DirichletForm:
    """The quadratic form ½ XᵀAX, equal to the energy, and its change with the corners' places."""

    grid: BoundaryGrid
    gaps: FloatArray
    matrix: FloatArray
    kernel: FloatArray
    cotangent: FloatArray

    @classmethod
    def on(cls, grid: BoundaryGrid, gaps: FloatArray) -> DirichletForm:
        """Return the form for the arcs (P,) between corners (2π for a smooth rim)."""
        half = 0.5 * grid.differences(gaps)
        np.fill_diagonal(half, 1.0)
        sine = np.sin(half)
        np.fill_diagonal(sine, 1.0)
        weights = grid.weights(gaps)
        kernel = weights[:, None] * weights[None, :] / (4 * np.pi * sine**2)
        np.fill_diagonal(kernel, 0.0)
        cotangent = np.cos(half) / sine
        np.fill_diagonal(cotangent, 0.0)
        count = len(weights)
        waves = 2 * np.pi * np.fft.fftfreq(count)
        matrix = circulant(np.fft.ifft(waves**2).real / (2 * np.pi)) - kernel
        matrix[np.diag_indices(count)] += kernel.sum(axis=1)
        return cls(grid, gaps, matrix, kernel, cotangent)

    def energy(self, points: FloatArray) -> float:
        """Return the Dirichlet energy of boundary values (N, 3)."""
        return 0.5 * float((points * (self.matrix @ points)).sum())

    def corner_derivatives(
        self, points: FloatArray, moved: list[int]
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the derivatives of the energy when corners move along the circle.

        Returns
        -------
        (m,), (N, 3, m), (m, m)
            The gradient, the mixed derivatives with the boundary values, and the Hessian.
        """
        m, n = len(moved), len(points)
        gradient, mixed, hessian = np.zeros(m), np.zeros((n, 3, m)), np.zeros((m, m))
        if not m:
            return gradient, mixed, hessian
        square = (points**2).sum(-1)
        apart = square[:, None] + square[None, :] - 2 * points @ points.T
        energy = 0.25 * self.kernel * apart
        arcs = self.gaps[self.grid.side]
        changes = []
        for k, corner in enumerate(moved):
            turn, arc = self.grid.arc_changes(corner)
            rate = (arc / arcs)[:, None] + (arc / arcs)[None, :] - self.cotangent * turn
            np.fill_diagonal(rate, 0.0)
            changes.append((turn, arc / arcs, rate))
            weighted = self.kernel * rate
            gradient[k] = (energy * rate).sum()
            mixed[:, :, k] = weighted.sum(1)[:, None] * points - weighted @ points
        bend = 0.5 * (1 + self.cotangent**2) * energy  # ½ csc²
        np.fill_diagonal(bend, 0.0)
        row = energy.sum(axis=1)
        for k in range(m):
            turn, arc, rate = changes[k]
            weighted, turned = energy * rate, bend * turn
            for l in range(k, m):
                other_turn, other_arc, other_rate = changes[l]
                value = np.vdot(weighted, other_rate) + np.vdot(turned, other_turn)
                hessian[k, l] = hessian[l, k] = value - 2 * (row * arc * other_arc).sum()
        return gradient, mixed, hessian

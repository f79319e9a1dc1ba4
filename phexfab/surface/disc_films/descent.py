"""Descent of Douglas' functional over the reparametrisations of a rim, by damped Newton steps.

The unknowns are the places of the samples on the rim (arc length), the positions of samples on
free sides within their planes, and the places of all corners but three on the unit circle.
The Hessian is exact; where it is not positive, or a step does not descend, it is damped with the
energy's own metric, in which the step for strong damping is a plain descent.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from phexfab.errors import SurfaceError
from phexfab.surface.disc_films.grid import DirichletForm, FloatArray, power_share
from phexfab.surface.disc_films.state import UNEVEN, BoundaryState, resampled, unevenness

STEPS = 40
DAMPING = 1e-2  # of the first step from a rough start
NEAR = 1e-3  # such steps, and dampings, are followed by steps with the same Hessian
SHRINKING = 0.05  # ratio of their lengths
MOVES = 4  # times that the samples are moved within one descent
SETTLED = 1e-12  # of the square root of the energy's expected relative decrease
UNSEEN = 3e-8  # of the same: its square is lost in the energy's rounding
ROUNDING = 1e-14  # relative change of the energy that is no change
AT_CORNER = 1e-11  # share of a side within which samples stay where they started
REACH, BURST = 0.7, 4.0  # shares of a gap by which one step may narrow and widen it


@dataclass(frozen=True, eq=False)
class _Unknowns:
    """Directions in which samples may move, (M, 3), the curves' bending, and s per unit of arc."""

    node: NDArray[np.intp]
    direction: FloatArray
    bending: FloatArray
    rate: FloatArray
    moved: list[int]


def _unknowns(state: BoundaryState) -> _Unknowns:
    sides, grid = state.sides, state.grid
    free = state.free
    at_corner = (grid.tau == 0) & (sides.corners > 0)
    on_rim = np.flatnonzero(~free & ~at_corner & ~_at_rounding(state))
    t = sides.parameter(grid.side[on_rim], state.s[on_rim])
    first = sides.rim.derivative(t) / sides.size
    second = sides.rim.derivative(t, 2) / sides.size
    speed = np.linalg.norm(first, axis=1)
    tangent = first / speed[:, None]
    bending = second / speed[:, None] ** 2
    bending -= (bending * tangent).sum(1, keepdims=True) * tangent
    rate = 1 / (speed * sides.slope(grid.side[on_rim], state.s[on_rim]))
    nodes, ways = [on_rim], [tangent]
    for k, frame in sides.planes.items():
        (inner,) = np.nonzero(free & (grid.side == k) & ~at_corner)
        nodes.append(np.repeat(inner, 2))
        ways.append(np.tile(frame[:, :2].T, (len(inner), 1)))
    for i in np.flatnonzero(free & at_corner):
        line = sides.line(int(grid.side[i]))
        nodes.append(np.repeat(i, line.shape[1]))
        ways.append(line.T)
    node = np.concatenate(nodes)
    loose = len(node) - len(on_rim)
    return _Unknowns(
        node,
        np.concatenate(ways),
        np.concatenate([bending, np.zeros((loose, 3))]),
        np.concatenate([rate, np.ones(loose)]),
        _moving_corners(state.gaps) if sides.corners else [],
    )


def _at_rounding(state: BoundaryState) -> NDArray[np.bool_]:
    """Return which samples are so near a corner that rounding moves them more than a step."""
    if not state.sides.corners:
        return np.zeros(len(state.s), bool)
    orders, side = state.sides.orders, state.grid.side
    share, rest = power_share(state.s, orders[side], np.roll(orders, -1)[side])
    return np.minimum(share, rest) < AT_CORNER


def _moving_corners(gaps: FloatArray) -> list[int]:
    """Return all corners but three, which are the best spread ones (three points may be held)."""
    count = len(gaps)
    if count <= 3:
        return []
    return [c for c in range(count) if c not in {0, (count + 1) // 3, (2 * count + 1) // 3}]


def _gauge(state: BoundaryState, unknowns: _Unknowns) -> FloatArray:
    """Return orthonormal changes (M, k) that only turn the disc into itself (Möbius maps)."""
    corners = state.sides.corners
    if corners > 2:
        return np.empty((len(unknowns.node), 0))
    theta = state.grid.angles(state.gaps)
    if corners == 0:
        moves = np.stack([np.ones_like(theta), np.cos(theta), np.sin(theta)], 1)
    else:  # those that keep the corners where they are
        moves = np.stack([1 - np.cos(theta), np.sin(theta)], 1)
        if corners == 2:
            moves = np.sin(0.5 * theta)[:, None] * np.sin(0.5 * (theta - state.gaps[0]))[:, None]
    along = derivative_by_sample(state.points)
    with np.errstate(all="ignore"):
        speed = along / state.grid.weights(state.gaps)[:, None]
    fields = (speed[unknowns.node] * unknowns.direction).sum(1)[:, None] * moves[unknowns.node]
    return np.linalg.qr(np.where(np.isfinite(fields), fields, 0.0))[0]


def derivative_by_sample(values: FloatArray) -> FloatArray:
    """Return the derivative of periodic samples (N, ...) by their number, spectrally."""
    count = len(values)
    waves = 2j * np.pi * np.fft.fftfreq(count)
    waves[count // 2] = 0
    shape = (-1, *[1] * (values.ndim - 1))
    return np.fft.ifft(waves.reshape(shape) * np.fft.fft(values, axis=0), axis=0).real


def settle(state: BoundaryState, damping: float = DAMPING) -> tuple[BoundaryState, DirichletForm]:
    """Return the state of least energy near the given one, and the energy's form there.

    The samples are moved along as the film's boundary slides.

    Parameters
    ----------
    state : BoundaryState
    damping : float
        Of the first step; 0 where the state is close to the minimum already.

    Raises
    ------
    SurfaceError
        If the descent does not settle.
    """
    moves, form = 0, DirichletForm.on(state.grid, state.gaps)
    energy, last = form.energy(state.points), np.inf
    for _ in range(STEPS):
        unknowns = _unknowns(state)
        gradient, hessian, metric = _derivatives(state, form, unknowns)
        while True:
            factor = _factor(hessian + damping * metric if damping else hessian)
            if factor is not None:
                step = factor.step(gradient)
                expected = np.sqrt(abs(float(gradient @ step)) / energy)
                fresh, taken = _moved(state, unknowns, step)
                fresh_form = DirichletForm.on(fresh.grid, fresh.gaps) if unknowns.moved else form
                reached = fresh_form.energy(fresh.points)
                whole = taken > 0.2 or damping > 1e3
                if expected < UNSEEN or (whole and reached <= energy * (1 + ROUNDING)):
                    break
            damping = max(4 * damping, 1e-6)
            if damping > 1e12:
                raise _unsettled(state, "no step lowers its energy")
        # Steps that the energy cannot see go on while they shrink: to the end of rounding.
        if expected < SETTLED or (expected < UNSEEN and expected > 0.5 * last):
            return fresh, fresh_form
        state, form, energy, last = fresh, fresh_form, reached, expected
        if moves < MOVES and unevenness(state) > 2 * UNEVEN:
            state, last, moves = resampled(state), np.inf, moves + 1
            form = DirichletForm.on(state.grid, state.gaps)
            energy = form.energy(state.points)
        elif expected < NEAR and damping < NEAR and not unknowns.moved:
            ended = _ended(state, form, factor, energy, expected)
            if ended is not None:
                return ended, form
        damping = damping / 8 if damping > 1e-10 else 0.0
    raise _unsettled(state, f"after {STEPS} steps its energy still falls")


def _ended(
    state: BoundaryState, form: DirichletForm, factor: _Factor, energy: float, last: float
) -> BoundaryState | None:
    """Return the minimum next to a state by steps with one Hessian, or None if they do not shrink.

    They cost little, and their error falls by the length of the last whole step each time.
    """
    for _ in range(STEPS):
        unknowns = _unknowns(state)
        gradient = _gradient(state, form, unknowns)
        if len(gradient) != len(factor.size):
            return None
        step = factor.step(gradient)
        expected = np.sqrt(abs(float(gradient @ step)) / energy)
        if not expected <= SHRINKING * last:
            return None
        state, last = _moved(state, unknowns, step)[0], expected
        if expected < SETTLED:
            return state
    return None


def _unsettled(state: BoundaryState, why: str) -> SurfaceError:
    close = np.abs(np.diff(state.points, axis=0, append=state.points[:1])).max(1)
    i = int(close.argmax())
    where = (state.sides.middle + state.sides.size * state.points[i]).round(1).tolist()
    return SurfaceError(
        f"{state.sides.rim.name}: the soap film does not settle ({why}); its samples are widest "
        f"apart near {where} mm: give the rim more points there, or a simpler shape"
    )


def _gradient(state: BoundaryState, form: DirichletForm, unknowns: _Unknowns) -> FloatArray:
    """Return the gradient (M,) for corners that stay, without its part along the gauge."""
    pull = form.matrix @ state.points
    gradient = (pull[unknowns.node] * unknowns.direction).sum(1)
    gauge = _gauge(state, unknowns)
    return gradient - gauge @ (gauge.T @ gradient)


def _derivatives(
    state: BoundaryState, form: DirichletForm, unknowns: _Unknowns
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return gradient (M,), Hessian and damping metric (M, M)."""
    pull = form.matrix @ state.points
    node, way = unknowns.node, unknowns.direction
    metric = form.matrix[np.ix_(node, node)] * (way @ way.T)
    gradient = (pull[node] * way).sum(1)
    hessian = metric.copy()
    hessian[np.diag_indices(len(node))] += (pull[node] * unknowns.bending).sum(1)
    gauge = _gauge(state, unknowns)
    if gauge.shape[1]:
        gradient = gradient - gauge @ (gauge.T @ gradient)
        hessian, metric = (_held(matrix, gauge) for matrix in (hessian, metric))
    slope, mixed, bend = form.corner_derivatives(state.points, unknowns.moved)
    if not len(slope):
        return gradient, hessian, metric
    cross = np.einsum("mc,mck->mk", way, mixed[node])
    zero = np.zeros_like(cross)
    return (
        np.concatenate([gradient, slope]),
        np.block([[hessian, cross], [cross.T, bend]]),
        np.block([[metric, zero], [zero.T, np.diag(np.abs(np.diag(bend)))]]),
    )


def _held(matrix: FloatArray, gauge: FloatArray) -> FloatArray:
    """Return the symmetric matrix without its part along the gauge, which is made stiff."""
    along = matrix @ gauge
    twice = along - 0.5 * gauge @ (gauge.T @ along)
    stiff = np.trace(matrix) / len(matrix)
    twice -= 0.5 * stiff * gauge
    cross = twice @ gauge.T
    return matrix - cross - cross.T


@dataclass(frozen=True, eq=False)
class _Factor:
    """A positive matrix, factored after scaling its diagonal to 1."""

    size: FloatArray
    factor: tuple[FloatArray, bool]

    def step(self, gradient: FloatArray) -> FloatArray:
        """Return the Newton step."""
        return np.asarray(-self.size * cho_solve(self.factor, self.size * gradient))


def _factor(matrix: FloatArray) -> _Factor | None:
    """Return the factors of a matrix, or None where it is not positive."""
    size = 1 / np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    try:
        found = cho_factor(matrix * size[:, None] * size, lower=True, overwrite_a=True)
    except LinAlgError:
        return None
    return _Factor(size, found)


def _moved(
    state: BoundaryState, unknowns: _Unknowns, step: FloatArray
) -> tuple[BoundaryState, float]:
    """Return the state after a step, and the share of it that keeps samples in their order."""
    sides, grid = state.sides, state.grid
    count = len(unknowns.node)
    free = state.free[unknowns.node]
    change = np.zeros_like(state.s)
    change[unknowns.node[~free]] = (step[:count] * unknowns.rate)[~free]
    turn = np.zeros_like(state.gaps)
    for corner, angle in zip(unknowns.moved, step[count:], strict=True):
        turn[corner - 1] += angle
        turn[corner] -= angle
    share = _room(state.gaps, turn)
    s, taken = _pushed(state, share * change)
    share *= taken
    points = sides.point(sides.parameter(grid.side, s))
    held = state.free | ((grid.tau == 0) & (sides.corners > 0))
    points[held] = state.points[held]
    np.add.at(points, unknowns.node[free], share * (step[:count, None] * unknowns.direction)[free])
    return replace(state, s=s, points=points, gaps=state.gaps + share * turn), share


def _pushed(state: BoundaryState, change: FloatArray) -> tuple[FloatArray, float]:
    """Return s + change, held back next to gaps that would close or burst, and the share taken."""
    s, closed = state.s, state.sides.corners > 0
    last = np.append(state.grid.side[1:] != state.grid.side[:-1], True)
    after = np.where(last, 1.0 if closed else s[0] + 1, np.roll(s, -1))
    gaps, share = after - s, np.ones(len(s))

    def widened(by: FloatArray) -> FloatArray:
        return np.where(last & closed, 0.0, np.roll(by, -1)) - by

    for _ in range(12):
        ratio = widened(share * change) / np.maximum(gaps, 1e-300)
        (bad,) = np.nonzero((ratio < -REACH) | (ratio > BURST))
        if not len(bad):
            return s + share * change, 1.0
        near = np.zeros(len(s), bool)
        near[bad] = near[(bad + 1) % len(s)] = True
        share[near] *= 0.5
    room = _room(gaps, widened(change))
    return s + room * change, room


def _room(gap: FloatArray, change: FloatArray) -> float:
    """Return how much of a change may be made before a positive gap falls to 1 − REACH of it."""
    with np.errstate(divide="ignore"):
        return float(min(1.0, np.where(change < 0, REACH * gap / np.abs(change), np.inf).min()))

"""Planar faces in few factorisations; ways that edges or heights do not allow take the long one.

The nearest planar mesh is where the motion back to the start, x₀ − x, is GAᵀλ: pushes across faces
alone. Newton's method on both, planarity and that, keeps λ from step to step, so that a step only
corrects it: damping then slows the correction, and does not draw the mesh back off planar. Two
steps bring the motion within 1 % of the least; the rest only flattens faces, by the last factor.
The first is damped so much that conjugate gradients are cheaper than a factor, the more so the
finer the mesh.

Where the first step leaves much of the heights, planes turn on the way, and the way is bent: A's
change with x, which these steps leave out of the equation for λ, would throw the second step past
the least motion. Half of it is taken then, with more damping, and the rest only flattens.

References
----------
Nocedal, Wright, "Numerical Optimization" (2006), ch. 5 (conjugate gradients), 18 (Newton–Lagrange
steps); Rockafellar,
"Augmented Lagrangians and applications of the proximal point algorithm in convex programming",
Math. Oper. Res. 1 (1976), for damping in the multipliers.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import SolveError
from phexfab.linalg import Factor, factorise
from phexfab.remesh.planarity.hold import Hold
from phexfab.remesh.planarity.rows import Linearised, PlanarRows
from phexfab.remesh.planarity.steps import Edges, Walk

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_SHIFTS = (1e-3, 1e-5, 1e-6, 1e-7, 1e-8)  # damping over the mean diagonal, from factor to factor
_BENT_SHIFTS = (1e-3, 1e-4, 1e-5, 1e-7)  # the same on a bent way
_LEAST = 1e-9  # damping of all later ones
_ROUGH = 1e-2  # of the right side: what conjugate gradients may leave of it in the first step
_ROUNDS = 300  # they may take; with the first damping they need some 200 at most
_SURE = 2e-6  # damping above which a solution needs no refinement: later steps correct it
_BENT = 0.05  # of the heights: what the first step leaves where the way is straight
_HALF = 0.5  # of the correction of λ: taken on a bent way
_NEAR, _BENT_NEAR = 0.3, 0.6  # of the heights: what later steps may leave
_MORE = 1.5  # the same for the second step of a bent way, which is damped less than the first
_MIXED = 3  # steps by a kept factor that the next one learns from
_SLOW = 0.05  # what a step by a kept factor leaves where it is worth while to learn
_CHORD = 0.5  # a kept factor is good while a step leaves at most this share
_SHRUNK = 0.5  # of its bound: how short an edge may be on the way
_SETTLED = 0.3  # of the motion: the last step along planar meshes; then less than 1 % of cost
_STRAY = 0.5  # of the motion: what may be along planar meshes at the end of a bent way
_PULLED = 0.02  # the same where a surface or curve pulls, which moves vertices less than it counts


@dataclass(frozen=True, eq=False)
class _System:
    at: Linearised
    rows: Any  # A (m, 3V)
    moved: Any  # G Aᵀ (3V, m)
    factor: Factor | _Gradients
    refinements: int

    def solve(self, right: FloatArray) -> FloatArray:
        return self.factor.solve(right, self.refinements)


@dataclass(frozen=True, eq=False)
class _Gradients:
    """A damped matrix that solves roughly, by conjugate gradients."""

    matrix: Any
    shift: float

    def solve(self, right: FloatArray, refinements: int) -> FloatArray:
        """Return x with ``(matrix + shift) x = right`` but for a hundredth of the right side."""
        x, left, way = np.zeros_like(right), right.copy(), right.copy()
        square = first = float(left @ left)
        for _ in range(_ROUNDS):
            if not square > _ROUGH**2 * first:
                break
            ahead = self.matrix @ way + self.shift * way
            share = square / float(way @ ahead)
            x += share * way
            left -= share * ahead
            last, square = square, float(left @ left)
            way *= square / last
            way += left
        return x


class _Mixed:
    """Anderson's mixing of the last places and residuals of steps by one factor."""

    def __init__(self, x: FloatArray) -> None:
        self._places, self._residuals = [x], list[FloatArray]()

    def went(self, x: FloatArray) -> None:
        """Note the place that the last step went to."""
        self._places = [*self._places, x][-_MIXED - 1 :]

    def of(self, residual: FloatArray, slow: bool) -> tuple[FloatArray, FloatArray]:
        """Return the least residual that mixing gives, (rows,), and the place for it, (V, 3).

        Where steps are not ``slow``, those of the last place.
        """
        self._residuals = [*self._residuals, residual][-_MIXED - 1 :]
        x = self._places[-1]
        if len(self._residuals) == 1 or not slow:
            return residual, x
        change = np.column_stack([residual - r for r in self._residuals[:-1]])
        share = np.linalg.lstsq(change.T @ change, change.T @ residual, rcond=None)[0]
        for part, place in zip(share, self._places[:-1], strict=True):
            x = x - part * (self._places[-1] - place)
        return residual - change @ share, x


def swift_walk(
    rows: PlanarRows,
    heights: list[FloatArray],
    hold: Hold,
    edges: Edges,
    goal: float,
    most: int,
) -> Walk:
    """Return the end of the walk; ``crooked`` where it did not get through, or edges shrank.

    ``heights`` are those of the start.
    """
    x, steps, solved = hold.start.copy(), 0, 0
    merit, (best, face) = rows.size(heights), rows.worst(heights)
    pushes: list[FloatArray] | None = None
    system: _System | None = None
    enough = _PULLED if hold.pulled else _SETTLED
    settled = bent = crooked = False
    while best > goal and steps < most and not crooked:
        at, planar, residual = rows.linearise(x)
        inverse, anchor = (None, hold.start) if hold.free else hold.around(x)
        shifts = _BENT_SHIFTS if bent else _SHIFTS
        shift = shifts[solved] if solved < len(shifts) else _LEAST
        try:
            system = _system(at, planar, inverse, shift, system, settled)
            pull, weights = np.zeros(x.size), np.zeros(len(rows))
            if not settled:
                if pushes is not None:
                    weights = rows.weights(at, pushes)
                pull = (anchor - x).ravel() - system.moved @ weights
                pull *= _HALF if bent else 1.0
            along = system.rows @ pull
            more = system.solve(residual + along)
            step = (pull - system.moved @ more).reshape(-1, 3)
            aside = pull
            if solved and not (settled or bent):
                aside = pull - system.moved @ system.solve(along)
        except SolveError:
            return Walk(x, steps, max(solved - 1, 0), best, face, crooked=True)
        solved, steps = solved + 1, steps + 1
        x = x + step
        if not settled:
            pushes = rows.pushes(at, weights + more)
        heights = rows.heights(x, at)
        size = rows.size(heights)
        # Where a surface or curve pulls, half a correction of λ is too far from the cheapest.
        if solved <= 2 and not hold.pulled:
            bent |= not size < (_BENT if solved == 1 else _NEAR) * merit
        if solved == 1:
            crooked = not np.isfinite(size)
        else:
            keep = (_BENT_NEAR if settled else _MORE) if bent else _NEAR
            crooked = not size < keep * merit
            far = float(np.linalg.norm(x - hold.start))
            settled |= bent or bool(np.linalg.norm(aside) < enough * far)
        merit, (best, face) = size, rows.worst(heights)
        mixed, slow = _Mixed(x), bent
        while settled and not crooked and best > goal and steps < most:
            back, origin = mixed.of(rows.residual(at, heights), slow)
            ahead = origin - (system.moved @ system.factor.solve(back, 0)).reshape(-1, 3)
            trial = rows.heights(ahead, at)
            size = rows.size(trial)
            if not size < _CHORD * merit:
                break
            slow = bent or size > _SLOW * merit
            x, heights, merit, steps = ahead, trial, size, steps + 1
            mixed.went(ahead)
            best, face = rows.worst(heights)
        least = edges.least if best <= goal else _SHRUNK * edges.least
        crooked |= bool((edges.directions(x)[1] < least).any())
    if bent and system is not None and not crooked:
        crooked = _stray(system, (hold.around(x)[1] - x).ravel())
    return Walk(x, steps, max(solved - 1, 0), best, face, crooked or best > goal)


def _stray(system: _System, pull: FloatArray) -> bool:
    """Return whether a good part of the motion back, (3V,), is along planar meshes."""
    aside = pull - system.moved @ system.factor.solve(system.rows @ pull, 0)
    return not np.linalg.norm(aside) < _STRAY * np.linalg.norm(pull)


def _system(
    at: Linearised,
    planar: Any,
    inverse: FloatArray | None,
    shift: float,
    last: _System | None,
    rough: bool,
) -> _System:
    """Return the damped system of one place; the first one needs no factor."""
    moved = planar.T
    if inverse is not None:
        n = len(inverse)
        blocks = sp.bsr_array((inverse, np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n))
        moved = (blocks if planar.format == "bsr" else blocks.tocsr()) @ moved
    matrix = planar @ moved
    diagonal = matrix.diagonal()
    damping = shift * diagonal.mean()
    if last is None:
        return _System(at, planar, moved, _Gradients(matrix, damping), 0)
    matrix = matrix.tocsc()
    matrix.setdiag(diagonal + damping)
    order = None
    if isinstance(last.factor, Factor) and last.factor.matrix.nnz == matrix.nnz:
        order = last.factor.order
    sure = shift > _SURE
    factor = factorise(matrix, order, single=sure)
    return _System(at, planar, moved, factor, 0 if sure or rough else 4)

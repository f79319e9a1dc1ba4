"""Planar faces in few factorisations, where the way is straight; others take the long one.

The nearest planar mesh is where the motion back to the start, x₀ − x, is GAᵀλ: pushes across faces
alone. Newton's method on both, planarity and that, keeps λ from step to step, so that a step only
corrects it: damping then slows the correction, and does not draw the mesh back off planar. Two
steps bring the motion within 1 % of the least; the rest only flattens faces, by the last factor.

References
----------
Nocedal, Wright, "Numerical Optimization" (2006), ch. 18 (Newton–Lagrange steps); Rockafellar,
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

_FIRST, _FALL, _LEAST = 1e-4, 0.1, 1e-12  # damping over the mean diagonal: at first, by step, last
_SURE = 2e-6  # damping above which a solution needs no refinement: later steps correct it
_NEAR = 0.3  # of the heights: what a step may leave, or the way is not straight
_CHORD = 0.3  # a kept factor is good while a step leaves at most this share
_SHRUNK = 0.5  # of its bound: how short an edge may be on the way
_SETTLED = 0.3  # of the motion: the last step along planar meshes; then less than 1 % of cost
_PULLED = 0.02  # the same where a surface or curve pulls, which moves vertices less than it counts


@dataclass(frozen=True, eq=False)
class _System:
    at: Linearised
    rows: Any  # A (m, 3V)
    moved: Any  # G Aᵀ (3V, m)
    factor: Factor
    refinements: int

    def solve(self, right: FloatArray) -> FloatArray:
        return self.factor.solve(right, self.refinements)


def swift_walk(rows: PlanarRows, hold: Hold, edges: Edges, goal: float, most: int) -> Walk:
    """Return the end of the walk; ``crooked`` where it did not go straight on, or edges shrank."""
    x, steps, factored = hold.start.copy(), 0, 0
    heights = rows.heights(x)
    merit, (best, face) = rows.size(heights), rows.worst(heights)
    pushes: list[FloatArray] | None = None
    system: _System | None = None
    enough = _PULLED if hold.pulled else _SETTLED
    settled = crooked = False
    while best > goal and steps < most and not crooked:
        at, planar, residual = rows.linearise(x)
        inverse, anchor = hold.around(x)
        shift = max(_FIRST * _FALL**factored, _LEAST)
        try:
            system = _factorised(at, planar, inverse, shift, system)
            weights = np.zeros(len(rows)) if pushes is None else rows.weights(at, pushes)
            pull = (anchor - x).ravel() - system.moved @ weights
            if settled:
                pull = np.zeros_like(pull)
            along = system.rows @ pull
            more = system.solve(residual + along)
            step = (pull - system.moved @ more).reshape(-1, 3)
            aside = pull - system.moved @ system.solve(along) if pull.any() else pull
        except SolveError:
            return Walk(x, steps, factored, best, face, crooked=True)
        first, factored, steps = not factored, factored + 1, steps + 1
        x = x + step
        pushes = rows.pushes(at, weights + more)
        heights = rows.heights(x, at)
        size = rows.size(heights)
        crooked = not size < (np.inf if first else _NEAR * merit)
        merit, (best, face) = size, rows.worst(heights)
        far = float(np.linalg.norm(x - hold.start))
        settled |= not first and bool(np.linalg.norm(aside) < enough * far)
        while settled and not crooked and best > goal and steps < most:
            back = system.solve(rows.residual(at, heights))
            ahead = x - (system.moved @ back).reshape(-1, 3)
            trial = rows.heights(ahead, at)
            size = rows.size(trial)
            if not size < _CHORD * merit:
                break
            x, heights, merit, steps = ahead, trial, size, steps + 1
            best, face = rows.worst(heights)
        least = edges.least if best <= goal else _SHRUNK * edges.least
        crooked |= bool((edges.directions(x)[1] < least).any())
    return Walk(x, steps, factored, best, face, crooked or best > goal)


def _factorised(
    at: Linearised, planar: Any, inverse: FloatArray, shift: float, last: _System | None
) -> _System:
    n = len(inverse)
    if (inverse == np.eye(3)).all():
        moved = planar.T.tocsr()
    else:
        blocks = sp.bsr_array((inverse, np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n))
        moved = (blocks.tocsr() @ planar.T).tocsr()
    matrix = (planar @ moved).tocsc()
    diagonal = matrix.diagonal()
    matrix.setdiag(diagonal + shift * diagonal.mean())
    order = None
    if last is not None and last.factor.matrix.nnz == matrix.nnz:
        order = last.factor.order
    sure = shift > _SURE
    factor = factorise(matrix, order, single=sure)
    return _System(at, planar, moved, factor, 0 if sure else 4)

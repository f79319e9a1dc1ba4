"""The long way to planar faces: Gauss–Newton, damped at first, edges guarded from below.

It is taken where ``swift_walk`` does not get through.

A step is the cheapest motion that meets all planarity equations to first order, and keeps the
edges that would become too short at their bound: with A the rows of both and G the inverse cost,
A G Aᵀ λ = residual, a sparse symmetric positive system of about three rows per hexagon. Near the
end the factor is kept, since only the right side still changes.

References
----------
Nocedal, Wright, "Numerical Optimization" (2006), ch. 10, 16 and 18 (Levenberg–Marquardt, active
sets, least change); the projection of Tang et al. 2014 without its auxiliary variables.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import SolveError
from phexfab.linalg import Factor, factorise
from phexfab.remesh.planarity.hold import Hold
from phexfab.remesh.planarity.rows import Linearised, PlanarRows

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

# Damping, over the mean diagonal: on a fine mesh neighbouring planes are nearly parallel, so that
# some equations are met only by long ways along the faces; they are left to later steps.
_HARD = 1e-2  # at first
_FALL = 0.1  # from step to step
_SHIFT = 1e-12  # at last: equations may depend on each other, as on a flat mesh
_ROUNDS = 4  # times that a step is found anew because edges would collapse
_COLLAPSE = 0.85  # of its bound: an edge that falls below this in one step
_CHORD = 0.1  # a kept factor is good while a step leaves at most this share
_NEAR = 0.3  # so is aiming at the cheapest planar mesh, not just at a planar one
_SETTLED = 0.3  # of the motion: what was left to go along planar meshes; then less than 1 % of cost
_MARGIN = 1.002  # guarded edges aim a little above their bound, to be above it when planar
_MENDS = 3  # steps more for edges that are still short when all faces are planar
_LEAPS = 4  # steps that may make faces less planar, while edges are guarded
_PULLED = 0.02  # the same where a surface or curve pulls, which moves vertices less than it counts
_BENT = 0.1  # of a motion along planar meshes: what it may leave of heights over planes
_PULLS = 12  # steps that aim at the cheapest


@dataclass(eq=False)
class Edges:
    """Edges, and the length below which each must not fall."""

    pairs: IntArray  # (E, 2)
    least: FloatArray  # (E,) mm
    active: BoolArray = field(init=False)
    released: IntArray = field(init=False)

    def __post_init__(self) -> None:
        self.active = np.zeros(len(self.pairs), bool)
        self.released = np.zeros(len(self.pairs), np.int64)

    def directions(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return unit vectors (E, 3) along the edges, and their lengths (E,)."""
        along = x[self.pairs[:, 1]] - x[self.pairs[:, 0]]
        length = np.linalg.norm(along, axis=1)
        return along / np.where(length > 0, length, 1.0)[:, None], length

    def join(self, length: FloatArray) -> bool:
        """Take edges of lengths (E,) that are too short into the guard; return whether any is."""
        short = length < self.least
        self.active |= short
        return bool(short.any())

    def rows(self, unit: FloatArray, n: int) -> sp.csr_array:
        """Return the rows of the active edges' lengths, (active, 3n)."""
        on = np.flatnonzero(self.active)
        index = 3 * self.pairs[on][:, :, None] + np.arange(3)
        values = np.stack([-unit[on], unit[on]], 1)
        ends = 6 * np.arange(len(on) + 1)
        return sp.csr_array((values.ravel(), index.ravel(), ends), shape=(len(on), 3 * n))


@dataclass(frozen=True, eq=False)
class _System:
    """Everything that belongs to one factorisation."""

    at: Linearised
    rows: Any  # (m, 3V)
    moved: Any  # G Aᵀ, (3V, m)
    factor: Factor
    guarded: IntArray


@dataclass(frozen=True, eq=False)
class Walk:
    """Where the steps ended.

    ``factored`` systems were factorised in ``steps`` steps; the worst face and its height, mm.
    ``crooked``: edges became too short, or the way bent, so that more damping is wanted.
    """

    x: FloatArray
    steps: int
    factored: int
    height: float
    face: int
    crooked: bool = False


class Steps:
    """The walk from a mesh to a planar one."""

    def __init__(self, rows: PlanarRows, hold: Hold, edges: Edges, goal: float, most: int) -> None:
        self.rows, self.hold, self.edges = rows, hold, edges
        self.goal, self.most = goal, most
        self.factored = 0
        away = hold.start - hold.start.mean(axis=0)
        self.reach = 10 * float(np.linalg.norm(away))

    def run(self) -> Walk:
        """Return the end of the walk: planar to the goal, or as near as it came."""
        x, steps, short = self.hold.start.copy(), 0, False
        heights = self.rows.heights(x)
        best, face = self.rows.worst(heights)
        merit, pulls, leaps, mends = self.rows.size(heights), True, _LEAPS, _MENDS
        enough = _PULLED if self.hold.pulled else _SETTLED
        while (best > self.goal or (short and mends)) and steps < self.most:
            mends -= best <= self.goal
            system, straight, aside = self._aims(x, pulls, max(_HARD * _FALL**steps, _SHIFT))
            steps += 1
            merit = np.inf if short else merit
            taken, share = None, 0.0
            if pulls:
                taken, share = self._aside(x, straight, aside, merit, system.at, steps == 1)
            if taken is None:
                taken = self._searched(x, straight, merit, system.at)
            if taken is None and self.edges.active.any() and leaps:
                # Edges at their bound may have to give way to others first.
                leaps, ahead = leaps - 1, x + straight
                taken = ahead, self.rows.heights(ahead, system.at)
            if taken is None:
                break
            moved = np.linalg.norm(taken[0] - self.hold.start)
            if moved > self.reach:  # far away any corner is nearly in any plane
                break
            settled = steps > 1 and np.linalg.norm(aside) < enough * moved
            pulls = pulls and share > 0 and steps < _PULLS
            x, heights = taken
            merit, (best, face) = self.rows.size(heights), self.rows.worst(heights)
            while best > self.goal and steps < self.most and (settled or not pulls):
                ahead = x + self._back(system, x, heights)
                trial = self.rows.heights(ahead, system.at)
                size = self.rows.size(trial)
                if not size < _CHORD * merit:
                    break
                x, heights, merit, steps = ahead, trial, size, steps + 1
                best, face = self.rows.worst(heights)
            short = self.edges.join(self.edges.directions(x)[1])
        return Walk(x, steps, self.factored, best, face)

    def _aside(
        self,
        x: FloatArray,
        straight: FloatArray,
        aside: FloatArray,
        merit: float,
        at: Linearised,
        first: bool,
    ) -> tuple[tuple[FloatArray, list[FloatArray]] | None, float]:
        """Return a place towards the cheapest planar mesh that is good, and the share of the way.

        Good is what brings faces much nearer to planar, since then the way is straight enough. Off
        a reference or border curve planarity alone does not tell: there the cost may fall instead,
        while faces bend no more than the way along planar meshes bends them, to second order.
        """
        keep = 1.0 if self.hold.pulled else _NEAR
        for share in (1.0, 0.5, 0.25):
            ahead = x + straight + share * aside
            trial = self.rows.heights(ahead, at)
            size = self.rows.size(trial)
            good = first or size < keep * merit
            if not good and self.hold.pulled and size < _BENT * share * np.linalg.norm(aside):
                good = self.hold.cost(ahead) < self.hold.cost(x)
            if good:
                return (ahead, trial), share
        return None, 0.0

    def _searched(
        self, x: FloatArray, step: FloatArray, merit: float, at: Linearised
    ) -> tuple[FloatArray, list[FloatArray]] | None:
        """Return the first place of a halving search at which faces are more nearly planar."""
        share = 1.0
        for _ in range(8):
            ahead = x + share * step
            trial = self.rows.heights(ahead, at)
            if self.rows.size(trial) < (1 - 0.1 * share) * merit:
                return ahead, trial
            share /= 2
        return None

    def _aims(
        self, x: FloatArray, pulls: bool, shift: float
    ) -> tuple[_System, FloatArray, FloatArray]:
        """Return the system, the least step to a planar mesh, and that towards a cheaper one."""
        at, planar, residual = self.rows.linearise(x)
        inverse, anchor = self.hold.around(x)
        blocks = sp.bsr_array(
            (inverse, np.arange(len(x)), np.arange(len(x) + 1)), shape=(x.size, x.size)
        ).tocsr()
        pull = (anchor - x) if pulls else np.zeros_like(x)
        unit, length = self.edges.directions(x)
        for _ in range(_ROUNDS):
            system = self._factorised(at, planar, blocks, unit, shift)
            weights = self._solved(system, self._right(system, residual, length))
            straight = -(system.moved @ weights).reshape(-1, 3)
            aside = np.zeros_like(x)
            if pulls:
                more = self._solved(system, system.rows @ pull.ravel())
                aside = pull - (system.moved @ more).reshape(-1, 3)
                weights = weights + more
            if not self._guard(system, straight + aside, unit, length, weights[len(residual) :]):
                break
        return system, straight, aside

    def _right(self, system: _System, residual: FloatArray, length: FloatArray) -> FloatArray:
        on = system.guarded
        return np.concatenate([residual, length[on] - _MARGIN * self.edges.least[on]])

    def _guard(
        self,
        system: _System,
        step: FloatArray,
        unit: FloatArray,
        length: FloatArray,
        weights: FloatArray,
    ) -> bool:
        """Let go of edges that the guard holds short; take in short ones.

        Returns whether an edge would come near to vanishing or turning round, so that the step
        has to be found anew; others are seen to in the next step.
        """
        edges = self.edges
        i, j = edges.pairs.T
        ahead = length + np.einsum("ei,ei->e", step[j] - step[i], unit)
        leaves = np.zeros_like(edges.active)
        leaves[system.guarded] = weights > 0
        leaves &= edges.released < 2  # an edge let go twice stays
        edges.active &= ~leaves
        edges.released += leaves
        fresh = ~edges.active & ~leaves & (ahead < _COLLAPSE * edges.least)
        edges.active |= fresh
        edges.join(ahead)
        return bool(fresh.any())

    def _factorised(
        self, at: Linearised, planar: Any, blocks: Any, unit: FloatArray, shift: float
    ) -> _System:
        rows = planar
        if self.edges.active.any():
            rows = sp.vstack([planar, self.edges.rows(unit, blocks.shape[0] // 3)], format="csr")
        moved = (blocks @ rows.T).tocsr()
        matrix = (rows @ moved).tocsc()
        shift = shift * matrix.diagonal().mean()
        matrix = matrix + sp.eye_array(matrix.shape[0], format="csc") * shift
        self.factored += 1
        return _System(at, rows, moved, factorise(matrix), np.flatnonzero(self.edges.active))

    def _solved(self, system: _System, right: FloatArray) -> FloatArray:
        try:
            return system.factor.solve(right)
        except SolveError:
            raise SolveError(
                "planar faces cannot be reached by a small motion: the equations contradict each "
                "other to rounding; fix fewer vertices, or free the border"
            ) from None

    def _back(self, system: _System, x: FloatArray, heights: list[FloatArray]) -> FloatArray:
        """Return the step of a kept system from a place nearby."""
        residual = self.rows.residual(system.at, heights)
        _, length = self.edges.directions(x)
        right = self._right(system, residual, length)
        return -(system.moved @ self._solved(system, right)).reshape(-1, 3)

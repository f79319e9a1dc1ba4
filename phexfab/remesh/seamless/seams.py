"""Which lattice vectors the seam conditions take, and the correction that meets them exactly.

Every condition asks that an integral of √Q e^h is a lattice vector. Linearised in the logarithm,
the cheapest h for given vectors is a least-squares problem, its cost a sum over the conditions one
after the other; so vectors are chosen one condition after the other too, the best few partial
choices kept (K-best sphere decoding). The best choices are then solved exactly by Newton.

References
----------
Agrell, Eriksson, Vardy, Zeger, *Closest point search in lattices* (2002).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import SurfaceError
from phexfab.remesh.mesh_lattices.seam_conditions import Conditions, seam_conditions
from phexfab.remesh.plane import PlaneLattice
from phexfab.remesh.seamless.apices import Apices
from phexfab.remesh.seamless.correction import basis, least_distance, n_terms, real_rows, stiffness
from phexfab.remesh.seamless.root_paths import Quantity
from phexfab.surface.domain import Disc
from phexfab.surface.holomorphic import CIRCLE, ComplexArray
from phexfab.surface.weierstrass import MinimalSurface
from phexfab.triangular import asymptotic_gap, mean_distance

FloatArray = NDArray[np.float64]

TURN_SHARE = 0.6  # of the angle to the asymptotic directions may go into turning: 9° of 15°
RATIOS = tuple(1 + 0.0125 * k * s for k in range(13) for s in ((1, -1) if k else (1,)))
SCALE_WEIGHT = 0.5  # of a change of the step, against a turn by as much
RATIO_WEIGHT = 0.7
SIZE_RANGE = 1.15  # the panel size may come out larger or smaller by this factor
BEAM, BRANCHES = 96, 12  # partial choices kept; lattice vectors tried for each
EXACT, EXACT_SHIFTED = 16, 8  # choices solved exactly
SHIFT_WEIGHT = 0.5  # of shifting an apex by the distance of its first neighbours
MOST_SHIFT = 0.23  # of that distance: from 0.25 on panels between two apices may cross themselves
MOST_SPREAD = 0.45  # of that distance: umbilics under one panel


@dataclass(frozen=True, eq=False)
class Problem:
    """A domain's seam conditions as functions of x = (coefficients of h, shifts of the apices).

    Attributes
    ----------
    surface : MinimalSurface
    rest : callable
        Its Hopf differential without the zeros, Q / Π (z - z)^m over the umbilics, cheap.
    domain : Disc
    apices : Apices
        Not shifted.
    conditions : Conditions
        For these.
    grid : (k,) complex
        Places all over the domain.
    log_size, log_root : (k,) float
        There, the logarithms of the mm per unit of w, and of |√Q|.
    core : (k,) bool
        Which of them count for the median size of panels.
    """

    surface: MinimalSurface
    rest: Quantity
    domain: Disc
    apices: Apices
    conditions: Conditions
    grid: ComplexArray
    log_size: FloatArray
    log_root: FloatArray
    core: NDArray[np.bool_]

    @cached_property
    def border(self) -> ComplexArray:
        """The functions of h on the domain's border."""
        return basis(self.domain, self.domain.borders(256).ravel())

    @cached_property
    def grid_table(self) -> ComplexArray:
        """The functions of h at the grid."""
        return basis(self.domain, self.grid)

    @cached_property
    def tables(self) -> list[ComplexArray]:
        """The functions of h at the nodes of each condition."""
        return [basis(self.domain, c.nodes) for c in self.conditions.each]

    @property
    def n_terms(self) -> int:
        """Number of coefficients of h; x has one more for each apex."""
        return n_terms(self.domain)

    def apices_at(self, x: ComplexArray) -> Apices:
        """Return the apices with their shifts."""
        return self.apices.at(self.apices.places + x[self.n_terms :])

    def values(self, x: ComplexArray) -> tuple[ComplexArray, ComplexArray]:
        """Return the integrals (n,) and their derivatives (n, len(x))."""
        h, apices = x[: self.n_terms], self.apices_at(x)
        conditions, tables = self.conditions.each, self.tables
        shifted = bool(np.any(x[self.n_terms :]))
        if shifted:
            made = seam_conditions(
                lambda z: self.rest(z) * apices.product(z),
                self.domain,
                apices.places,
                self.conditions,
            )
            conditions = made.each
            tables = [basis(self.domain, c.nodes) for c in conditions]
        value, slope = (
            np.zeros(len(conditions), complex),
            np.zeros((len(conditions), len(x)), complex),
        )
        for k, (one, table) in enumerate(zip(conditions, tables, strict=True)):
            grown = one.weights * np.exp(table @ h)
            if shifted:  # the root's sign is that of the ways that were not shifted
                known = self.conditions.each[k].weights.sum()
                grown *= -1.0 if (grown.sum() * known.conj()).real < 0 else 1.0
            value[k] = grown.sum()
            slope[k, : self.n_terms] = grown @ table
            slope[k, self.n_terms :] = grown @ apices.slopes(one.nodes)
        return value, slope

    def turn(self, x: ComplexArray) -> float:
        """Return the largest turn by h, radians."""
        return float(np.abs((self.border @ x[: self.n_terms]).imag).max())

    def sizes(self, x: ComplexArray) -> tuple[FloatArray, FloatArray]:
        """Return mm per unit of w̃ at the grid's points, and the area of w̃ that each stands for."""
        h = (self.grid_table @ x[: self.n_terms] + self.apices_at(x).log_root(self.grid)).real
        return np.exp(self.log_size - h), np.exp(2 * (self.log_root + h))

    def median(self, x: ComplexArray) -> float:
        """Return the median of mm per unit of w̃ over the panels in the core."""
        size, area = self.sizes(x)
        return median(size[self.core], area[self.core])

    def reach(self, step: float) -> FloatArray:
        """Return how far in z the first neighbours lie from each apex, (G,)."""
        zeros, circle = self.apices.umbilics, 0.02 * self.domain.radius * CIRCLE
        reach = np.zeros(len(self.apices))
        for j, (place, order) in enumerate(
            zip(self.apices.places, self.apices.orders, strict=True)
        ):
            # Analytic in the middle, where a fallback may be 0/0: the mean of a circle.
            lead = self.rest(place + circle).mean()
            for i in np.flatnonzero(self.apices.group != j):
                lead = lead * (place - zeros.places[i]) ** int(zeros.orders[i])
            p = 0.5 * order + 1
            reach[j] = (step * p / np.sqrt(abs(lead))) ** (1 / p)
        return reach


def turn_limit(row_ratio: float) -> float:
    """Return the largest turn of the rows off the principal direction, radians."""
    return TURN_SHARE * float(np.radians(asymptotic_gap(row_ratio, 0.0)[0]))


def median(value: FloatArray, weight: FloatArray) -> float:
    """Return the weighted median."""
    order = np.argsort(value, kind="stable")
    total = np.cumsum(weight[order])
    return float(value[order][np.searchsorted(total, 0.5 * total[-1])])


def solve_seams(
    problem: Problem,
    wished: ComplexArray,
    panel_size: float,
    row_ratio: float,
    rows_along: str,
    fixed_ratio: bool,
    shifts: bool = False,
) -> tuple[ComplexArray, PlaneLattice] | None:
    """Return h and the lattice, or None where no h within the limits was found.

    Parameters
    ----------
    problem : Problem
    wished : (terms,) complex
        The correction that is best without seams.
    panel_size : float
        Median, mm.
    row_ratio, rows_along : float, str
        The lattice's.
    fixed_ratio : bool
        Keep the row ratio; else it may change a little.
    shifts : bool
        Whether apices may leave their umbilics.

    Returns
    -------
    ((terms + G,) complex, PlaneLattice)
    """
    wished = np.concatenate([wished, np.zeros(len(problem.apices))])
    unit = panel_size / problem.median(wished)
    if not problem.conditions.each:
        return wished, PlaneLattice(unit / mean_distance(row_ratio), row_ratio, rows_along)
    weights = _weights(problem, problem.reach(unit / mean_distance(row_ratio)) if shifts else None)
    tried: list[tuple[float, PlaneLattice, ComplexArray]] = []
    for factor in RATIOS[:1] if fixed_ratio else RATIOS:
        plane = PlaneLattice(
            unit / mean_distance(row_ratio * factor), row_ratio * factor, rows_along
        )
        price = (RATIO_WEIGHT * np.log(factor)) ** 2
        tried += [(price + c, plane, t) for c, t in _choices(problem, wished, plane, weights)]
    tried.sort(key=lambda one: one[0])
    for bounded in (False,) if shifts else (False, True):
        best, least = None, np.inf
        for _, plane, target in tried[: EXACT_SHIFTED if shifts else EXACT]:
            limit = turn_limit(plane.row_ratio)
            x = _exact(problem, wished, target, weights, limit if bounded else None)
            if x is None or problem.turn(x) > limit:
                continue
            # A real constant in h is a change of the step.
            grown = float((x[0] - wished[0]).real)
            whole = PlaneLattice(plane.step * np.exp(-grown), plane.row_ratio, rows_along)
            x[0] -= grown
            now = whole.mean_distance * problem.median(x) / panel_size
            if not 1 / SIZE_RANGE <= now <= SIZE_RANGE or _strays(problem, x, whole.step):
                continue
            off = _pair(x - wished)
            off = off[off != 0] * weights[off != 0]
            cost = float(off @ off)
            cost += (SCALE_WEIGHT * np.log(now)) ** 2
            cost += (RATIO_WEIGHT * np.log(plane.row_ratio / row_ratio)) ** 2
            if cost < least:
                best, least = (x, whole), cost
        if best is not None:
            return best
    return None


def _strays(problem: Problem, x: ComplexArray, step: float) -> bool:
    """Return whether an apex is too far from its umbilics."""
    if not np.any(x[problem.n_terms :]):
        return False
    reach = problem.reach(step)
    spread = np.any(problem.apices_at(x).shift > MOST_SPREAD * reach)
    return bool(spread or np.any(np.abs(x[problem.n_terms :]) > MOST_SHIFT * reach))


def _pair(x: ComplexArray) -> FloatArray:
    return np.concatenate([x.real, x.imag])


def _weights(problem: Problem, reach: FloatArray | None) -> FloatArray:
    """Return the weights of Re x and Im x; a change of scale costs less than a turn."""
    shifts = np.full(len(problem.apices), np.inf) if reach is None else SHIFT_WEIGHT / reach
    weights = np.tile(np.concatenate([stiffness(problem.domain), shifts]), 2)
    weights[0] = SCALE_WEIGHT
    return weights


def _choices(
    problem: Problem, wished: ComplexArray, plane: PlaneLattice, weights: FloatArray
) -> list[tuple[float, ComplexArray]]:
    """Return the cheapest choices of lattice vectors for all conditions, with their costs."""
    value, slope = problem.values(wished)
    n = len(value)
    apart = np.array([c.pair is not None for c in problem.conditions.each])
    # Logarithms where the integral is not zero: those are exact for a constant correction.
    log = np.abs(value) > 0.25 * plane.step
    real, imag = real_rows(slope / np.where(log, value, 1.0)[:, None])
    rows = np.stack([real, imag], 1).reshape(2 * n, -1) / weights
    gram = rows @ rows.T
    lower = np.linalg.cholesky(gram + 1e-10 * np.trace(gram) / len(gram) * np.eye(2 * n))
    costs, taken = np.zeros(1), np.zeros((1, 0), complex)
    white = np.zeros((1, 0))
    for k in range(n):
        block = lower[2 * k : 2 * k + 2]
        guess = white @ block[:, : 2 * k].T
        guess = np.clip(guess, -3.0, 3.0)  # farther away it is no candidate anyway
        shift = guess[:, 0] + 1j * guess[:, 1]
        ahead = value[k] * np.exp(shift) if log[k] else value[k] + shift
        options = plane.nearest_few(ahead, BRANCHES)
        with np.errstate(all="ignore"):
            right = np.log(options / value[k]) if log[k] else options - value[k]
        miss = right - shift[:, None]
        step = np.linalg.solve(
            block[:, 2 * k : 2 * k + 2], np.stack([miss.real, miss.imag]).reshape(2, -1)
        ).T.reshape(*miss.shape, 2)
        total = costs[:, None] + (step**2).sum(-1)
        if apart[k] or log[k]:
            total = np.where(np.abs(options) < 0.5 * plane.step, np.inf, total)
        order = np.argsort(total, axis=None, kind="stable")[:BEAM]
        order = order[np.isfinite(total.ravel()[order])]
        parent, branch = np.unravel_index(order, total.shape)
        costs = total[parent, branch]
        taken = np.column_stack([taken[parent], options[parent, branch]])
        white = np.column_stack([white[parent], step[parent, branch]])
    return list(zip(costs[:EXACT].tolist(), taken[:EXACT], strict=True))


def _exact(
    problem: Problem,
    wished: ComplexArray,
    target: ComplexArray,
    weight: FloatArray,
    limit: float | None,
) -> ComplexArray | None:
    """Return the h nearest to ``wished`` that meets the conditions, by Newton, or None.

    With a limit the turn is bounded all along the border.
    """
    half, terms = len(wished), problem.n_terms
    mass = np.array([np.abs(c.weights).sum() for c in problem.conditions.each]) + np.abs(target)
    x, last = wished.copy(), np.inf
    far = 1.5 * MOST_SHIFT * SHIFT_WEIGHT / weight[terms:half]
    for _ in range(30):
        if np.any(np.abs(x[terms:]) > far):
            return None
        with np.errstate(all="ignore"):
            try:
                value, slope = problem.values(x)
            except SurfaceError:  # an apex that moves into the way between two others
                return None
            miss = float((np.abs(value - target) / mass).max())
        if not miss < 10:
            return None
        if miss <= 1e-15 or (miss < 1e-12 and miss >= 0.5 * last):
            return x
        last = miss
        # y = weight (x - wished): the shortest y with slope (x_new - x) = target - value.
        rows = np.vstack(real_rows(slope)) / weight
        right = target - value + slope @ (x - wished)
        y, _, rank, _ = np.linalg.lstsq(rows, np.concatenate([right.real, right.imag]), rcond=1e-12)
        if limit is not None:
            border = np.zeros((len(problem.border[::2]), half), complex)
            border[:, :terms] = problem.border[::2]
            sideways = real_rows(border)[1]
            start = sideways @ _pair(wished)
            sideways = sideways / weight
            null = np.linalg.svd(rows)[2][rank:].T
            now = start + sideways @ y
            room = 0.985 * limit - np.concatenate([now, -now])
            both = np.vstack([sideways @ null, -sideways @ null])
            extra = least_distance(both, room)
            if extra is None:
                return None
            y = y + null @ extra
        y = y / weight
        x = wished + y[:half] + 1j * y[half:]
    return None

"""One lattice for all umbilics: the coordinate w̃ with dw̃ = √Q e^h dz, h holomorphic and small.

In w = ∫ √Q dz going around an umbilic of order m is a turn by (m+2)π about it: a half-turn or the
identity, in either case a symmetry of a lattice that has a point there. So one lattice covers the
surface without a seam as soon as all differences of umbilics, and the translations around holes,
are lattice vectors: a complex equation for each. They are met by the smallest correction h; which
lattice vectors, and which step of nearly the asked size, is decided first on the linearised cost.

References
----------
Bommes, Zimmer, Kobbelt, *Mixed-integer quadrangulation* (2009), for the seam conditions; Nieser,
Palacios, Polthier, Zhang, *Hexagonal global parameterization of arbitrary surfaces* (2012).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import LatticeError
from phexfab.remesh.lattice import check_directions
from phexfab.remesh.mesh_lattices.seam_conditions import seam_conditions
from phexfab.remesh.plane import PlaneLattice
from phexfab.remesh.seamless.apices import Apices
from phexfab.remesh.seamless.correction import Correction, basis, even_out, n_terms
from phexfab.remesh.seamless.root_paths import Quantity
from phexfab.remesh.seamless.sampled import sampled
from phexfab.remesh.seamless.seams import MOST_SPREAD, Problem, median, solve_seams, turn_limit
from phexfab.surface.domain import Disc
from phexfab.surface.holomorphic import ComplexArray
from phexfab.surface.umbilics import Umbilics, umbilics
from phexfab.surface.weierstrass import MinimalSurface
from phexfab.triangular import EQUILATERAL, mean_distance

FloatArray = NDArray[np.float64]

ROOM = 0.9  # of the turn that size control may use up


@dataclass(frozen=True, eq=False)
class Seamless:
    """A lattice coordinate w̃ of a whole domain.

    Attributes
    ----------
    surface : MinimalSurface
    rest : callable
        Its Hopf differential without zeros, Q / Π (z - z)^m over the umbilics, as a series where
        that is possible: so it is exact near umbilics too.
    domain : Disc
    apices : Apices
        The umbilics, and where the lattice has its 3(m+2)-gons.
    correction : Correction
        h.
    plane : PlaneLattice
        The lattice of w̃.
    anchor, shift : complex
        Without apices, ``w̃(anchor) = shift`` up to a lattice vector, on the principal root.
    turn : float
        Largest angle between rows and the principal direction, degrees.
    sizes : (min, median, max)
        Predicted mean distance of neighbouring panel centres, mm.
    """

    surface: MinimalSurface
    rest: Quantity
    domain: Disc
    apices: Apices
    correction: Correction
    plane: PlaneLattice
    anchor: complex
    shift: complex
    turn: float
    sizes: tuple[float, float, float]

    def quantity(self, z: ArrayLike) -> ComplexArray:
        """Return (dw̃/dz)²."""
        points = np.asarray(z, complex)
        factor = self.apices.product(points) * np.exp(2 * self.correction(points))
        return np.asarray(self.rest(points) * factor)

    def log_density(self, z: ArrayLike) -> ComplexArray:
        """Return log dw̃/dw: the lattice's density and its turn off the principal direction."""
        points = np.asarray(z, complex)
        return self.correction(points) + self.apices.log_root(points)


def seamless(
    surface: MinimalSurface,
    domain: Disc,
    *,
    panel_size: float,
    row_ratio: float = EQUILATERAL,
    rows_along: str = "u",
    evenness: float = 0.0,
    kind: str = "face",
    core: Disc | None = None,
    found: Umbilics | None = None,
    bend: ArrayLike = (),
) -> Seamless:
    """Return the lattice coordinate of a domain in which all umbilics are lattice points.

    Where no correction within the limits does that, the lattice's apices may leave their umbilics
    by less than a quarter of a panel, and umbilics that one panel covers share one apex, whose
    order is the sum of theirs: see ``Apices``.

    Parameters
    ----------
    surface : MinimalSurface
    domain : Disc
    panel_size : float
        Median distance of neighbouring panel centres, mm; met within 15 %.
    row_ratio : float
        Row distance / step, above 0.5.
    rows_along : ``"u"`` or ``"v"``
    evenness : float
        0 to 1: which part of the turn that validity allows goes into panels of even size.
    kind : ``"face"``, ``"edge"`` or ``"vertex"``
        The edge type keeps the row ratio exactly; for the others it may change by up to 15 %
        where that makes the correction smaller.
    core : Disc, optional
        The part of the domain whose panels count for the median size; all of it by default.
    found : Umbilics, optional
        Those of the domain, where they are known already.
    bend : (k,) complex
        First coefficients of a correction to start from (see ``basis``): among all that meet the
        umbilics the one nearest to it is taken, so that the lattice comes to lie a little
        otherwise.

    Raises
    ------
    LatticeError
        If no correction within the limits exists: umbilics too near to each other for panels of
        this size. The message says which, how near, and what panel size would do.
    SurfaceError
        As for ``umbilics``.
    """
    if rows_along not in ("u", "v"):
        raise LatticeError(f"lattice.rows_along = {rows_along!r}: choose 'u' or 'v'")
    if not 0 < panel_size < np.inf:
        raise LatticeError(f"lattice.panel_size = {panel_size}: it must be a positive number")
    if not 0 <= evenness <= 1:
        raise LatticeError(f"lattice.evenness = {evenness}: choose a number from 0 to 1")
    check_directions(row_ratio, 0.0)
    found = umbilics(surface, domain) if found is None else found
    zeros = Apices.of(found)
    rest = sampled(lambda z: surface.hopf(z) / zeros.product(z), domain, zeros.places)
    problem = _problem(surface, rest, domain, zeros, domain if core is None else core)
    limit = turn_limit(row_ratio)
    wished = np.zeros(n_terms(domain), complex)
    if evenness > 0:
        area = np.exp(2 * (problem.log_size + problem.log_root))
        turn = evenness * ROOM * limit
        wished = even_out(domain, problem.grid, problem.log_size, area, turn)
    start = np.zeros_like(wished)
    start[: np.size(bend)] = bend
    shares = (1.0, 0.6, 0.0) if evenness > 0 else (0.0,)
    solved = None
    for share in shares:
        nearest = np.asarray(start + share * wished, complex)
        solved = _solved(problem, nearest, panel_size, row_ratio, rows_along, kind)
        if solved is not None:
            break
    if solved is None:
        _refuse(problem, panel_size, row_ratio, rows_along, kind)
    problem, x, plane = solved
    apices, h = problem.apices_at(x), x[: problem.n_terms]
    shift, half_turn = 0j, problem.conditions.half_turn
    if half_turn is not None:
        grown = half_turn.weights * np.exp(basis(domain, half_turn.nodes) @ h)
        shift = -0.5 * complex(grown.sum())
    return Seamless(
        surface,
        rest,
        domain,
        apices,
        Correction(domain, h),
        plane,
        problem.conditions.anchor,
        shift,
        float(np.degrees(problem.turn(x))),
        _predicted(problem, x, plane),
    )


def _problem(
    surface: MinimalSurface, rest: Quantity, domain: Disc, apices: Apices, core: Disc
) -> Problem:
    grid = domain.grid()
    zeros = Apices.of(apices.umbilics)
    q, factor = np.abs(rest(grid) * zeros.product(grid)), surface.conformal_factor(grid)
    good = (q > 1e-14 * q.max()) & (factor > 0)
    log_root = 0.5 * np.log(q[good])
    return Problem(
        surface,
        rest,
        domain,
        apices,
        seam_conditions(lambda z: rest(z) * apices.product(z), domain, apices.places),
        grid[good],
        np.log(factor[good]) - log_root,
        log_root,
        core.contains(grid[good]),
    )


def _solved(
    problem: Problem,
    wished: ComplexArray,
    panel_size: float,
    row_ratio: float,
    rows_along: str,
    kind: str,
) -> tuple[Problem, ComplexArray, PlaneLattice] | None:
    """Solve with apices in the umbilics; else within a panel of them; else for several at once."""
    options = (panel_size, row_ratio, rows_along, kind == "edge")
    found = solve_seams(problem, wished, *options)
    while found is None and len(problem.apices) > 1:
        found = solve_seams(problem, wished, *options, shifts=True)
        if found is None:
            joined = _join_nearest(problem, wished, panel_size, row_ratio)
            if joined is None:
                return None
            problem = joined
            found = solve_seams(problem, wished, *options)
    return None if found is None else (problem, *found)


def _join_nearest(
    problem: Problem, wished: ComplexArray, panel_size: float, row_ratio: float
) -> Problem | None:
    """Return the problem with the two apices joined that lie nearest to each other in w̃."""
    x = np.concatenate([wished, np.zeros(len(problem.apices))])
    step = panel_size / problem.median(x) / mean_distance(row_ratio)
    length = np.abs(problem.values(x)[0])
    near = [(length[k], c.pair) for k, c in enumerate(problem.conditions.each) if c.pair]
    for _, (j, k) in sorted(near):
        group = problem.apices.group.copy()
        group[group == k] = j
        _, group = np.unique(group, return_inverse=True)
        apices = Apices.of(problem.apices.umbilics, group)
        trial = replace(problem, apices=apices)
        if np.all(apices.shift <= MOST_SPREAD * trial.reach(step)):
            made = _problem(problem.surface, problem.rest, problem.domain, apices, problem.domain)
            return replace(made, core=problem.core)
    return None


def _predicted(
    problem: Problem, x: ComplexArray, plane: PlaneLattice
) -> tuple[float, float, float]:
    size, area = problem.sizes(x)
    # Within half a step of an umbilic no panel centre lies but the umbilic itself.
    near = np.zeros(len(size), bool)
    root = np.sqrt(area)
    apices = problem.apices_at(x)
    for place, order in zip(apices.places, apices.orders, strict=True):
        away = np.abs(problem.grid - place)
        near |= away * root * 2 / (order + 2) < 0.5 * plane.step
    size = plane.mean_distance * size
    core = problem.core
    near |= ~core
    if near.all():
        near = ~core
    middle = median(size[core], area[core])
    return float(size[~near].min()), middle, float(size[~near].max())


def _refuse(
    problem: Problem, panel_size: float, row_ratio: float, rows_along: str, kind: str
) -> NoReturn:
    """Raise the error that says what is too near, and which panel size would do."""
    bare = np.zeros(problem.n_terms, complex)
    x = np.zeros(problem.n_terms + len(problem.apices), complex)
    step = panel_size / problem.median(x)
    length = np.abs(problem.values(x)[0])
    each = problem.conditions.each
    pairs = [k for k, c in enumerate(each) if c.pair is not None]
    one = min(pairs or range(len(each)), key=lambda k: length[k])
    pair = each[one].pair
    if pair is not None:
        ends = problem.surface.point(problem.apices.places[list(pair)])
        near = f"{each[one].text} lie {np.linalg.norm(ends[0] - ends[1]):.4g} mm apart"
    else:
        near = f"{each[one].text} is only {length[one] / step:.2g} panels long"
    remedy = "no panel size was found that would do"
    for k in range(1, 17):
        smaller = float(f"{panel_size * 0.85**k:.3g}")  # as it will be typed
        if _solved(problem, bare, smaller, row_ratio, rows_along, kind) is not None:
            remedy = f"lattice.panel_size = {smaller:g} would do"
            break
    raise LatticeError(
        f"{problem.surface.name}: {near} ({length[one] / step:.2g} panels): one lattice of panels "
        f"of {panel_size:g} mm cannot meet all umbilics and holes without turning its rows more "
        f"than {np.degrees(turn_limit(row_ratio)):.0f}° off the principal directions; {remedy}"
    )

"""Circle packings and hexagonal circle patterns with given border radii, by Newton.

One circle per face of the shell, combinatorics the dual triangulation. In a *packing* neighbours
touch; in a *pattern* neighbours cross at given angles and the three circles of a triangle meet in
a point. In both, interior circles must see an angle sum of 2π, or a multiple of it where the
pattern is branched; in log-radii that is the gradient of a convex functional, so Newton finds the
one solution.

References
----------
Bobenko, Springborn 2004, "Variational principles for circle patterns and Koebe's theorem";
Bobenko, Hoffmann, Springborn 2006, "Minimal surfaces from circle patterns"; Bowers, Stephenson
1996, "A branched Andreev–Thurston theorem for circle packings of the sphere".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import SolveError
from phexfab.linalg import Factor, factorise
from phexfab.parallel.rings import face_rings

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class CircleLaw:
    """How neighbouring circles meet.

    Attributes
    ----------
    triangles : (V, 3) int
    crossing : (V, 3) float or None
        Crossing angle of the edge from corner k to k + 1 of each triangle, radians; the three sum
        to π. None for a packing (neighbours touch).
    """

    triangles: IntArray
    crossing: FloatArray | None = None

    def angles(self, logs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return corner angles (V, 3) and, per edge k→k+1, the weight ∂angle/∂(log r_other)."""
        r = np.exp(logs)[self.triangles]
        a, b, c = r, r[:, [1, 2, 0]], r[:, [2, 0, 1]]
        if self.crossing is None:
            angle = 2 * np.arctan(np.sqrt(b * c / (a * (a + b + c))))
            inradius = np.sqrt(a[:, :1] * b[:, :1] * c[:, :1] / (a + b + c)[:, :1])
            return angle, inradius / (a + b)
        # The kite over edge k→k+1 gives a half-angle at both its centres.
        sine, cosine = np.sin(self.crossing), np.cos(self.crossing)
        at_tail = np.arctan2(b * sine, a + b * cosine)
        at_head = np.arctan2(a * sine, b + a * cosine)
        weight = a * b * sine / (a * a + b * b + 2 * a * b * cosine)
        return at_tail + at_head[:, [2, 0, 1]], weight

    def lengths(self, logs: FloatArray) -> FloatArray:
        """Return (V, 3) distances of the centres of the edge k→k+1."""
        r = np.exp(logs)[self.triangles]
        a, b = r, r[:, [1, 2, 0]]
        if self.crossing is None:
            return a + b
        return np.sqrt(a * a + b * b + 2 * a * b * np.cos(self.crossing))


def cone_targets(triangles: IntArray, n_circles: int) -> FloatArray:
    """Return (F,) angle sums 2π(n/3 − 1) of circles with n triangles around them.

    That is 2π on the regular lattice. Where the lattice closes up around an umbilic of order m,
    n = 3(m + 2), the Gauss map winds m + 1 times and so does the pattern. Meant for lattices that
    are regular elsewhere; circles whose ring does not close have no target (2π stands there).

    Raises
    ------
    SolveError
        If a ring has a number of triangles that no umbilic has: 6, 9, 12, … are possible.
    """
    panels, starts, _, _ = face_rings(triangles, n_circles)
    sides = np.diff(starts)
    odd = np.flatnonzero((sides % 3 != 0) | (sides < 6))
    if len(odd):
        raise SolveError(
            f"face {panels[odd[0]]} of the lattice has {sides[odd[0]]} neighbours: a lattice in "
            "curvature-line coordinates has 6, or 9, 12, … around an umbilic"
        )
    out = np.full(n_circles, 2 * np.pi)
    out[panels] = 2 * np.pi * (sides // 3 - 1)
    return out


@dataclass(frozen=True, eq=False)
class AngleSystem:
    """The equations of the radii: one for each interior circle, one for each hole.

    Attributes
    ----------
    law : CircleLaw
    column : (F,) int
        The unknown that moves a circle's log-radius: its own, its hole's, or −1 where it is fixed.
    target : (U,) float
        Angle sums, radians.
    """

    law: CircleLaw
    column: IntArray
    target: FloatArray

    @classmethod
    def of(
        cls,
        law: CircleLaw,
        n_circles: int,
        *,
        targets: FloatArray | None = None,
        holes: tuple[IntArray, ...] = (),
        hole_targets: FloatArray | None = None,
    ) -> AngleSystem:
        """Number the unknowns; arguments as of ``solve_radii``."""
        panels = face_rings(law.triangles, n_circles)[0]
        column = np.full(n_circles, -1)
        column[panels] = np.arange(len(panels))
        target = np.full(len(panels) + len(holes), 2 * np.pi)
        if targets is not None:
            target[: len(panels)] = targets[panels]
        for k, hole in enumerate(holes):
            column[hole] = len(panels) + k
            # Seen from inside, the border of a plain hole turns once.
            plain = (len(hole) + 2) * np.pi
            target[len(panels) + k] = plain if hole_targets is None else hole_targets[k]
        return cls(law, column, target)

    def miss(self, logs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (U,) what is missing from the targets, and the (3V,) weights of the law."""
        angle, weight = self.law.angles(logs)
        flat, of = angle.ravel(), self.column[self.law.triangles.ravel()]
        sums = np.bincount(of[of >= 0], weights=flat[of >= 0], minlength=len(self.target))
        return self.target - sums, weight.ravel()

    def relative(self, miss: FloatArray) -> float:
        """Return the largest miss; of a hole, whose target is a long sum, in proportion."""
        return float(np.abs(miss * (2 * np.pi / self.target)).max(initial=0.0))

    def factor(self, weight: FloatArray) -> Factor:
        """Factorise the Hessian, a weighted graph Laplacian."""
        tri = self.law.triangles
        ct, ch = self.column[tri.ravel()], self.column[tri[:, [1, 2, 0]].ravel()]
        both = (ct >= 0) & (ch >= 0)
        rows = np.concatenate([ct[both], ch[both], ct[ct >= 0], ch[ch >= 0]])
        cols = np.concatenate([ch[both], ct[both], ct[ct >= 0], ch[ch >= 0]])
        data = np.concatenate([-weight[both], -weight[both], weight[ct >= 0], weight[ch >= 0]])
        size = len(self.target)
        return factorise(sp.csc_matrix((data, (rows, cols)), shape=(size, size)))

    def moved(self, logs: FloatArray, step: FloatArray) -> FloatArray:
        """Return the log-radii after a step of the unknowns."""
        out, moving = logs.copy(), self.column >= 0
        out[moving] += step[self.column[moving]]
        return out

    def response(self, factor: Factor, weight: FloatArray, change: FloatArray) -> FloatArray:
        """Return (F,) the change of all log-radii that keeps the angle sums to first order.

        Parameters
        ----------
        factor, weight
            At the solution.
        change : (F,) float
            A change of the log-radii, as of the fixed circles; the unknowns are added to it.
        """
        tri = self.law.triangles
        tail, head = tri.ravel(), tri[:, [1, 2, 0]].ravel()
        flow = weight * (change[tail] - change[head])
        ct, ch, size = self.column[tail], self.column[head], len(self.target)
        right = np.zeros(size) + np.bincount(ct[ct >= 0], flow[ct >= 0], minlength=size)
        right -= np.bincount(ch[ch >= 0], flow[ch >= 0], minlength=size)
        return self.moved(change, factor.solve(-right))


def solve_radii(
    law: CircleLaw,
    logs: FloatArray,
    *,
    targets: FloatArray | None = None,
    holes: tuple[IntArray, ...] = (),
    hole_targets: FloatArray | None = None,
    tolerance: float = 3e-14,
) -> FloatArray:
    """Return log-radii whose angle sums are 2π, or as asked, around every interior circle.

    Parameters
    ----------
    law : CircleLaw
    logs : (F,) start; circles whose ring does not close keep their value
    targets : (F,) float, optional
        Angle sums of the interior circles, radians; multiples of 2π where the pattern is branched.
        2π without it.
    holes : tuple of index arrays
        Each a closed border around a hole. Its radii may grow by one common factor, chosen so
        that the layout turns around the hole as it should.
    hole_targets : (H,) float, optional
        Sums of all angles at each hole's circles; that of a border of n circles that turns once,
        (n + 2)π, without it.
    tolerance : float
        On the angle sums, radians.

    Raises
    ------
    SolveError
        If Newton does not converge.
    """
    system = AngleSystem.of(law, len(logs), targets=targets, holes=holes, hole_targets=hole_targets)
    return solve_system(system, logs, tolerance)


def solve_system(system: AngleSystem, logs: FloatArray, tolerance: float = 3e-14) -> FloatArray:
    """Return log-radii that solve the equations, from a start; see ``solve_radii``."""
    x = np.array(logs, float)
    miss, weight = system.miss(x)
    worst = system.relative(miss)
    for _ in range(60):
        worst = system.relative(miss)
        if worst <= tolerance:
            break
        move = system.factor(weight).solve(-miss)
        step = 1.0
        while True:
            trial = system.moved(x, step * move)
            miss_trial, weight_trial = system.miss(trial)
            # Convex: the slope along the step must not have turned past the minimum by much.
            slope, before = float(miss_trial @ move), float(miss @ move)
            if step < 1e-6 or (np.isfinite(slope) and slope <= 0.5 * abs(before)):
                break
            step /= 2
        if worst < 1e-9 and system.relative(miss_trial) >= worst / 2:
            break  # rounding is reached
        x, miss, weight = trial, miss_trial, weight_trial
    else:
        raise SolveError(
            f"the circle pattern did not converge (angle sums are {worst:.1e} off)"
            f"{_where(system, miss)}; choose a finer lattice, a smaller rectangle of parameters, "
            'or offset.type = "face"'
        )
    return x


def _where(system: AngleSystem, miss: FloatArray) -> str:
    """Say which circle is worst, and whether it is a branch point too narrow for its angle."""
    worst = int(np.argmax(np.abs(miss * (2 * np.pi / system.target))))
    circles = np.flatnonzero(system.column == worst)
    if len(circles) != 1:
        return f", worst around the hole at face {circles[0]}"
    turns = system.target[worst] / (2 * np.pi)
    many = f", a branch point of {turns:.0f} turns" if turns > 1.5 else ""
    return f", worst at face {circles[0]}{many}"

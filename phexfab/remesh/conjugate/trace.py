"""Curves along a family of directions on a surface, many at once, and where they meet.

Fourth-order Runge–Kutta steps of one length; between samples a cubic through points and tangents.
A curve ends at the border, where a direction is undefined, or where it closes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.remesh.conjugate.fields import Fields, Here

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

TURN = np.cos(np.radians(25.0))
"""A direction that turns more in one step has a singular point beside it."""
AFTER = 8  # steps that a closed curve goes on over itself


@dataclass(frozen=True, eq=False)
class Curves:
    """Curves sampled at equal lengths of arc, from where each was begun.

    Attributes
    ----------
    step : float
        mm between samples.
    points, tangents : (k, n, 3)
    parameters : (k, n, ·)
    origin : int
        Sample at which the curves begin, arc length 0.
    first, last : (k,) int
        The samples there are.
    closed : (k,) float
        Length of a closed curve, else 0.
    ends : (k, 2) int
        Why the curve ends, back and forth: −1 the border or the length asked for, otherwise
        ``Here.why``, 3 for a singular point.
    spare : (k, 2) float
        Steps from the last samples to the border, back and forth, below 1.
    """

    step: float
    points: FloatArray
    tangents: FloatArray
    parameters: FloatArray
    origin: int
    first: IntArray
    last: IntArray
    closed: FloatArray
    ends: IntArray
    spare: FloatArray

    def low(self) -> FloatArray:
        """(k,) least arc lengths."""
        return np.asarray((self.first - self.origin - self.spare[:, 0]) * self.step)

    def high(self) -> FloatArray:
        """(k,) greatest arc lengths."""
        return np.asarray((self.last - self.origin + self.spare[:, 1]) * self.step)

    def at(self, k: IntArray, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return points and derivatives of curves k (n,) at arc lengths s (n,), ends prolonged."""
        i, t = self._slot(k, s)
        p, q = self.points[k, i], self.points[k, i + 1]
        a, b = self.tangents[k, i] * self.step, self.tangents[k, i + 1] * self.step
        t = t[:, None]
        gap = q - p
        c2, c3 = 3 * gap - 2 * a - b, a + b - 2 * gap
        return p + t * (a + t * (c2 + t * c3)), (a + t * (2 * c2 + 3 * t * c3)) / self.step

    def nearest(self, k: int, points: FloatArray, other: FloatArray) -> FloatArray:
        """Return the arc lengths of the samples of curve k nearest to points (n, 3).

        ``other`` (n,) instead, where a curve has no samples.
        """
        last = self.last[k]
        if self.closed[k] > 0:  # once around
            last = min(last, self.origin + int(self.closed[k] / self.step - 0.5))
        samples = self.points[k, self.first[k] : last + 1]
        if len(samples) < 2:
            return other
        away, at = cKDTree(samples).query(points)
        s = (at + self.first[k] - self.origin) * self.step
        return np.asarray(np.where(np.isfinite(away), s, other))

    def nearby(self, k: IntArray, s: FloatArray) -> FloatArray:
        """Return the parameters of the samples nearest to arc lengths s."""
        i, t = self._slot(k, s)
        return np.asarray(self.parameters[k, i + (t > 0.5)])

    def _slot(self, k: IntArray, s: FloatArray) -> tuple[IntArray, FloatArray]:
        place = s / self.step + self.origin
        i = np.floor(place).astype(np.int64)
        i = np.clip(i, self.first[k], np.maximum(self.last[k] - 1, self.first[k]))
        i = np.minimum(i, self.points.shape[1] - 2)
        return i, place - i


def trace(
    fields: Fields,
    start: FloatArray,
    which: int,
    step: float,
    most: int,
    *,
    forward: bool = False,
    signs: FloatArray | None = None,
) -> Curves:
    """Return the curves of family 0 or 1 through parameters (k, ·).

    Parameters
    ----------
    most : int
        Steps to each side.
    forward : bool
        Trace to one side only.
    signs : (k,) float, optional
        ±1, of the direction that the fields give at the start.
    """
    here = fields.at(start)
    k = len(start)
    flip = np.ones(k) if signs is None else signs
    if forward:
        ahead = _traced(fields, start, here, which, step, most, flip)
        back = _empty(start, here.points)
    else:
        # Both ways at once: a step of many curves costs little more than a step of a few.
        twice = np.tile(np.arange(k), 2)
        both = _traced(
            fields, start[twice], _some(here, twice), which, step, most,
            np.concatenate([flip, -flip]),
        )  # fmt: skip
        ahead, back = _half(both, slice(0, k)), _half(both, slice(k, None))
    loop = ahead[3] > 0
    n0, n1 = back[0].shape[1] - 1, ahead[0].shape[1] - 1
    turned = np.concatenate([-back[1][:, :0:-1], ahead[1]], axis=1)
    return (
        Curves(
            step,
            np.concatenate([back[0][:, :0:-1], ahead[0]], axis=1),
            turned,
            np.concatenate([back[2][:, :0:-1], ahead[2]], axis=1),
            n0,
            np.where(loop, n0, n0 - back[4]),
            n0 + ahead[4],
            ahead[3],
            np.stack([np.where(loop, -1, back[5]), ahead[5]], axis=1).reshape(k, 2),
            np.stack([np.where(loop, 0.0, back[6]), ahead[6]], axis=1).reshape(k, 2),
        )
        if n0 + n1
        else _padded(fields, start, here, which, step)
    )


def meet(
    rows: Curves,
    columns: Curves,
    j: IntArray,
    i: IntArray,
    s: FloatArray,
    t: FloatArray,
    far: float,
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return arc lengths on rows j and columns i where they meet, from guesses, and whether.

    ``far`` is the largest step, mm, of Newton's method.
    """
    s, t = s.copy(), t.copy()
    for _ in range(12):
        p, dp = rows.at(j, s)
        q, dq = columns.at(i, t)
        gap = q - p
        a, b, c = ((x * y).sum(1) for x, y in ((dp, dp), (dp, dq), (dq, dq)))
        f, g = (dp * gap).sum(1), (dq * gap).sum(1)
        det = np.maximum(a * c - b * b, 1e-6 * a * c)
        ds, dt = (c * f - b * g) / det, (b * f - a * g) / det
        s += np.clip(ds, -far, far)
        t += np.clip(dt, -far, far)
        if max(np.abs(ds).max(initial=0), np.abs(dt).max(initial=0)) < 1e-10 * far:
            break
    p, _ = rows.at(j, s)
    q, _ = columns.at(i, t)
    # A curve that closes begins where others cross it: they may do so a little before.
    slack = 1e-9 * rows.step
    slack_s = np.where(rows.closed[j] > 0, 0.5 * rows.step, slack)
    slack_t = np.where(columns.closed[i] > 0, 0.5 * rows.step, slack)
    good = np.linalg.norm(q - p, axis=1) < 0.02 * rows.step
    good &= (s >= rows.low()[j] - slack_s) & (s <= rows.high()[j] + slack)
    good &= (t >= columns.low()[i] - slack_t) & (t <= columns.high()[i] + slack)
    return s, t, good


Way = tuple[FloatArray, FloatArray, FloatArray, FloatArray, IntArray, IntArray, FloatArray]


def _empty(start: FloatArray, points: FloatArray) -> Way:
    k = len(start)
    none = np.zeros(k, np.int64)
    return (
        points[:, None],
        np.zeros((k, 1, 3)),
        start[:, None],
        np.zeros(k),
        none,
        none - 1,
        np.zeros(k),
    )


def _half(way: Way, part: slice) -> Way:
    """Return some of the curves, no longer than the longest of them."""
    points, tangents, parameters, closed, count, ends, spare = way
    end = int(count[part].max(initial=0)) + 1
    return (
        points[part, :end],
        tangents[part, :end],
        parameters[part, :end],
        closed[part],
        count[part],
        ends[part],
        spare[part],
    )


def _padded(fields: Fields, start: FloatArray, here: Here, which: int, step: float) -> Curves:
    """Curves of no length: two samples, so that they can be evaluated."""
    k = len(start)
    tangent = here.pair[:, which]
    points = np.stack([here.points, here.points + step * tangent], axis=1)
    zero = np.zeros(k, np.int64)
    why = np.where(here.why > 0, here.why, -1)
    return Curves(
        step, points, np.stack([tangent, tangent], 1), np.stack([start, start], 1), 0, zero, zero,
        np.zeros(k), np.stack([why, why], axis=1), np.zeros((k, 2)),
    )  # fmt: skip


def _traced(
    fields: Fields,
    start: FloatArray,
    here: Here,
    which: int,
    step: float,
    most: int,
    signs: FloatArray,
) -> Way:
    k = len(start)
    u, direction = start.copy(), signs[:, None] * here.pair[:, which]
    begin, heading = here.points, direction.copy()
    points, tangents, parameters = [here.points], [direction.copy()], [start.copy()]
    count, closed, spare = np.zeros(k, np.int64), np.zeros(k), np.zeros(k)
    beyond = np.full_like(u, np.nan)
    left = np.full(k, most)
    ends = np.where(here.why > 0, here.why, -1)
    alive = np.flatnonzero(here.why == 0)
    now = _some(here, alive)
    for number in range(1, most + AFTER + 1):
        if not len(alive):
            break
        ahead, after, fate, way = _step(fields, u[alive], now, direction[alive], which, step)
        good = fate == 0
        ends[alive[~good]] = np.where(fate[~good] == 9, -1, fate[~good])
        out = fate == 9
        beyond[alive[out]] = ahead[out]
        kept = alive[good]
        u[kept], direction[kept] = ahead[good], way[good]
        at = points[-1].copy()
        at[kept] = after.points[good]
        points.append(at)
        tangents.append(direction.copy())
        parameters.append(u.copy())
        count[kept] = number
        left[kept] -= 1
        gap = begin[kept] - at[kept]
        rest = (gap * direction[kept]).sum(1)
        beside = np.linalg.norm(gap - rest[:, None] * direction[kept], axis=1)
        same = (direction[kept] * heading[kept]).sum(1) > 0.9
        back = (number > 8) & same & (rest >= 0) & (rest < step) & (beside < 0.1 * step)
        back &= closed[kept] == 0
        # The remaining arc over a chord, both tangents known to be nearly alike.
        closed[kept[back]] = number * step + rest[back]
        left[kept[back]] = AFTER
        going = left[kept] > 0
        alive = kept[going]
        now = _some(after, np.flatnonzero(good)[going])
    out = np.isfinite(beyond).all(axis=1)
    spare[out] = _inside_share(fields, u[out], beyond[out])
    x, d, v = (np.stack(values, axis=1) for values in (points, tangents, parameters))
    return x, d, v, closed, count, ends, spare


def _inside_share(fields: Fields, u: FloatArray, beyond: FloatArray) -> FloatArray:
    """Return (k,) the share of the way to parameters beyond the border that lies inside."""
    low, high = np.zeros(len(u)), np.ones(len(u))
    for _ in range(20 if len(u) else 0):
        middle = (low + high) / 2
        within = fields.inside(u + middle[:, None] * (beyond - u))
        low, high = np.where(within, middle, low), np.where(within, high, middle)
    return low


def _some(here: Here, index: IntArray) -> Here:
    b = here.bending
    part = type(b)(b.normals[index], b.kappa[index], b.directions[index])
    return Here(here.points[index], part, here.jacobian[index], here.pair[index], here.why[index])


def _step(
    fields: Fields, u: FloatArray, now: Here, before: FloatArray, which: int, h: float
) -> tuple[FloatArray, Here, IntArray, FloatArray]:
    """One step: parameters, directions there, why it failed (9: the border), and the way on."""

    def aligned(here: Here) -> FloatArray:
        d = here.pair[:, which]
        return np.asarray(d * np.where((d * before).sum(1) < 0, -1.0, 1.0)[:, None])

    rate = fields.forward(now, aligned(now))
    total = rate.copy()
    for share, weight in ((0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
        there = fields.at(u + share * h * rate)
        rate = fields.forward(there, aligned(there))
        total += weight * rate
    ahead = fields.placed(u + h / 6 * total)
    after = fields.at(ahead)
    way = aligned(after)
    bent = (way * before).sum(1) < TURN
    fate = np.where(after.why > 0, after.why, np.where(bent, 3, 0))
    fate = np.where(fields.inside(ahead, after.points), fate, 9)
    return ahead, after, fate, way

"""What is refused in rims: crossings, touches, curves given twice, wrong units.

Self-approach is not sampled: stretches of curve that turn by little (measured at five tangents) are
enclosed in balls; pairs of balls that meet are halved until they part, or until two points nearer
than the tolerance are found.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.errors import DesignError
from phexfab.surface.rims.corners import angles_between
from phexfab.surface.rims.pieces import panels_of
from phexfab.surface.rims.rim import Rim
from phexfab.surface.rims.spline import place

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

NEAREST = 1e-6  # two parts nearer than this share of the size touch
SPIKE = 178.0  # degrees: a corner that turns by more runs back along itself
SIZES = (100.0, 1e6)  # mm, the sizes that a rim in mm is believed to have
UNITS = {
    "um": 1e-3,
    "mm": 1.0,
    "cm": 10.0,
    "dm": 100.0,
    "m": 1000.0,
    "km": 1e6,
    "in": 25.4,
    "ft": 304.8,
}
"""Millimetres in each unit that readers take."""

_TURN = 10.0  # degrees by which the tangent turns within one stretch, at most
_PAIRS = 150_000  # stretches side by side that are still told apart
_TRIED = 2048  # pairs searched for a touch before all are halved


def unit_factor(unit: str, what: str) -> float:
    """Return the millimetres in a unit named by ``UNITS``.

    Raises
    ------
    DesignError
        If there is no such unit.
    """
    if unit not in UNITS:
        raise DesignError(f"{what}: there is no unit {unit!r}; choose from {', '.join(UNITS)}")
    return UNITS[unit]


def check_size(rims: Sequence[Rim], unit: str = "mm", what: str = "the rim") -> None:
    """Refuse rims whose size says that the unit is wrong.

    Parameters
    ----------
    rims
        In mm, after conversion; taken together.
    unit
        The unit that was assumed, for the message.

    Raises
    ------
    DesignError
        If the whole is smaller than 100 mm or larger than 1 km; the message says which unit it
        probably is and how to say so.
    """
    low = np.min([rim.box[0] for rim in rims], axis=0)
    high = np.max([rim.box[1] for rim in rims], axis=0)
    size = float(np.linalg.norm(high - low))
    if SIZES[0] <= size <= SIZES[1]:
        return
    number = size / UNITS[unit]
    order = ("m", "ft", "in", "cm", "km") if size < SIZES[0] else ("mm", "um")
    fits = [u for u in order if SIZES[0] <= number * UNITS[u] <= SIZES[1] and u != unit]
    advice = (
        f"it is probably in {fits[0]}: say unit = {fits[0]!r}"
        if fits
        else "scale it first (`Rim.scaled`)"
    )
    raise DesignError(
        f"{what}: its size is {number:.6g} {unit}, outside {SIZES[0]:g} mm to 1 km; {advice}"
    )


def checked(
    rims: Sequence[Rim], unit: str, what: str, smooth: float | None = None
) -> tuple[Rim, ...]:
    """Return rims in mm that a reader found, checked, and smoothed if asked to.

    Raises
    ------
    DesignError
        See `check_size`, `check_rims` and `Rim.smoothed`.
    """
    check_size(rims, unit, what)
    check_rims(rims)
    if smooth is None:
        return tuple(rims)
    rounded = tuple(rim.smoothed(smooth) if len(rim.corners) else rim for rim in rims)
    check_rims(rounded)
    return rounded


def check_rims(rims: Sequence[Rim]) -> None:
    """Refuse rims that cross or touch themselves or one another, or that are given twice.

    Two parts touch if they are nearer than 1e-6 of the size. Rims side by side over their whole
    length are told apart down to about 1e-5 of it; nearer ones "almost touch" and are refused too.
    The work grows as the number of stretches that turn by ten degrees, times its logarithm.

    Raises
    ------
    DesignError
        Naming rims, parameters and the place.
    """
    for rim in rims:
        _check_spikes(rim)
    stretches = [_stretches(rim) for rim in rims]
    size = max(rim.size for rim in rims)
    found = _nearest(rims, stretches, NEAREST * size)
    if found is None:
        return
    (a, s), (b, t), distance, where = found
    close = distance <= NEAREST * size
    if a == b:
        verb = "crosses or touches itself" if close else "almost touches itself"
        raise DesignError(
            f"{rims[a].name} {verb} near {place(where)}, at t = {s:.6f} and t = {t:.6f} "
            f"({distance:.2g} mm apart); a rim must be a simple closed curve"
        )
    first, second = sorted((a, b))
    if _same(rims[first], rims[second], NEAREST * size):
        raise DesignError(
            f"{rims[first].name} and {rims[second].name} are the same curve, through "
            f"{place(where)}; remove one"
        )
    raise DesignError(
        f"{rims[a].name} and {rims[b].name} {'touch' if close else 'almost touch'} near "
        f"{place(where)} ({distance:.2g} mm apart, t = {s:.6f} and {t:.6f}); rims must be apart"
    )


def _check_spikes(rim: Rim) -> None:
    turns = rim.turning(rim.corners)
    sharp = np.flatnonzero(turns > SPIKE)
    if len(sharp):
        t = float(rim.corners[sharp[0]])
        raise DesignError(
            f"{rim.name} turns by {turns[sharp[0]]:.2f}° at {place(rim.point(t))}: it touches "
            f"itself, running back the way it came; corners must turn by less than {SPIKE:g}°"
        )


def _same(one: Rim, two: Rim, tolerance: float) -> bool:
    """Whether all of one curve lies on the other, by samples refined to the nearest point."""
    points = one.samples(max(64, len(one.corners)))[1]
    ends = two._lengths[0]
    t = ends[cKDTree(two.point(ends)).query(points)[1]]
    for _ in range(12):
        d = two.derivative(t)
        t = t - np.sum((two.point(t) - points) * d, axis=1) / np.sum(d * d, axis=1)
    gaps = np.linalg.norm(two.point(t) - points, axis=1)
    return bool(np.median(gaps) <= tolerance)


def _stretches(rim: Rim) -> FloatArray:
    """Parameters (n, 2) of stretches within each of which the tangent turns by little."""
    done: list[FloatArray] = []
    for k, piece in enumerate(rim.pieces):
        panels = panels_of(piece)
        if piece.straight:
            panels = np.linspace(0.0, 1.0, 9)
        low, high = rim.breaks[k], rim.breaks[k + 1]
        ends = low + panels * (high - low)
        ends[-1] = high
        parts = np.stack([ends[:-1], ends[1:]], axis=1)
        for _ in range(24):
            split = _turn(rim, parts) > _TURN
            done.append(parts[~split])
            if not split.any():
                parts = parts[:0]
                break
            parts = _halved(parts[split])
        done.append(parts)
    found = np.concatenate(done)
    return found[np.argsort(found[:, 0], kind="stable")]


def _turn(rim: Rim, parts: FloatArray) -> FloatArray:
    """Greatest angle (n,), degrees, between tangents at start, quarters and end of stretches."""
    inside = parts[:, :1] + np.diff(parts, axis=1) * np.array([0.0, 0.25, 0.5, 0.75])
    tangents = np.concatenate(
        [rim.derivative(inside), rim.derivative(parts[:, 1:], before=True)], axis=1
    )
    return np.sum(angles_between(tangents[:, :-1], tangents[:, 1:]), axis=1)


def _halved(parts: FloatArray) -> FloatArray:
    middle = parts.mean(axis=1)
    ends = np.stack([parts[:, 0], middle, middle, parts[:, 1]], axis=1)
    return ends.reshape(-1, 2)


Place = tuple[int, float]


def _nearest(
    rims: Sequence[Rim], stretches: Sequence[FloatArray], tolerance: float
) -> tuple[Place, Place, float, FloatArray] | None:
    """Two places nearer than the tolerance, or None."""
    owner = np.repeat(np.arange(len(rims)), [len(part) for part in stretches])
    parts = np.concatenate(stretches)
    centre, radius = _balls(rims, owner, parts)
    pairs = _meeting(centre, radius, tolerance)
    who = owner[pairs]
    one, two = parts[pairs[:, 0]], parts[pairs[:, 1]]
    while len(one):
        keep = ~_neighbours(rims, who, one, two)
        who, one, two = who[keep], one[keep], two[keep]
        hit = _approach(rims, who, one, two, tolerance)
        if hit is not None:
            return hit
        if len(one) > _PAIRS:
            return _closest(rims, who, one, two)
        who, one, two = _quartered(rims, who, one, two, tolerance)
    return None


def _quartered(
    rims: Sequence[Rim], who: IntArray, one: FloatArray, two: FloatArray, tolerance: float
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Halve both stretches of each pair; keep the combinations whose balls meet."""
    ones = np.repeat(_halved(one).reshape(-1, 2, 2), 2, axis=1).reshape(-1, 2)
    twos = np.tile(_halved(two).reshape(-1, 2, 2), (1, 2, 1)).reshape(-1, 2)
    who = np.repeat(who, 4, axis=0)
    c1, r1 = _balls(rims, who[:, 0], ones)
    c2, r2 = _balls(rims, who[:, 1], twos)
    meet = np.linalg.norm(c1 - c2, axis=1) <= r1 + r2 + tolerance
    return who[meet], ones[meet], twos[meet]


def _points(rims: Sequence[Rim], owner: IntArray, t: FloatArray, order: int = 0) -> FloatArray:
    out = np.empty((*t.shape, 3))
    for k in np.unique(owner):
        mine = owner == k
        out[mine] = rims[k].point(t[mine]) if order == 0 else rims[k].derivative(t[mine], order)
    return out


def _balls(
    rims: Sequence[Rim], owner: IntArray, parts: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Centres and radii of balls that hold the stretches.

    An arc whose tangents lie within an angle α of its chord is no longer than chord / cos α, and
    no point of it is farther from the chord's middle than half of that.
    """
    ends = _points(rims, owner, parts)
    chord = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    return ends.mean(axis=1), 0.5 * chord / np.cos(np.radians(1.5 * _TURN))


def _meeting(centre: FloatArray, radius: FloatArray, tolerance: float) -> IntArray:
    """Pairs (m, 2) of balls that meet, class of size by class of size."""
    size = np.frexp(np.maximum(radius, tolerance))[1]
    classes = [np.flatnonzero(size == level) for level in np.unique(size)]
    trees = [cKDTree(centre[mine]) for mine in classes]
    found = []
    for i, mine in enumerate(classes):
        reach = 2.0 * radius[mine].max() + tolerance
        inner = trees[i].query_pairs(reach, output_type="ndarray")
        found.append(np.sort(mine[inner], axis=1))
        for j in range(i):
            reaches = radius[mine] + radius[classes[j]].max() + tolerance
            lists = trees[j].query_ball_point(centre[mine], reaches)
            counts = np.array([len(hits) for hits in lists], dtype=np.intp)
            flat = np.fromiter((h for hits in lists for h in hits), np.intp, int(counts.sum()))
            pair = np.stack([np.repeat(mine, counts), classes[j][flat]], axis=1)
            found.append(np.sort(pair, axis=1))
    pairs = np.concatenate(found).astype(np.intp)
    gap = np.linalg.norm(centre[pairs[:, 0]] - centre[pairs[:, 1]], axis=1)
    pairs = pairs[gap <= radius[pairs].sum(axis=1) + tolerance]
    return pairs[np.lexsort(pairs.T[::-1])]


def _neighbours(
    rims: Sequence[Rim], who: IntArray, one: FloatArray, two: FloatArray
) -> NDArray[np.bool_]:
    """Which pairs follow one another and turn too little in all to come back to each other."""
    same = who[:, 0] == who[:, 1]
    found = np.zeros(len(one), dtype=bool)
    for first, second in ((one, two), (two, one)):
        touching = np.flatnonzero(same & ((first[:, 1] % 1.0) == (second[:, 0] % 1.0)))
        for k in np.unique(who[touching, 0]):
            mine = touching[who[touching, 0] == k]
            joint = rims[k].turning(second[mine, 0])
            turn = joint + _turn(rims[k], first[mine]) + _turn(rims[k], second[mine])
            found[mine] |= turn < 0.5 * (180.0 + np.maximum(joint, 0.0))
    return found


def _approach(
    rims: Sequence[Rim], who: IntArray, one: FloatArray, two: FloatArray, tolerance: float
) -> tuple[Place, Place, float, FloatArray] | None:
    """Gauss–Newton for the nearest points of the most entangled pairs, kept inside both."""
    (c1, r1), (c2, r2) = _balls(rims, who[:, 0], one), _balls(rims, who[:, 1], two)
    apart = np.linalg.norm(c1 - c2, axis=1) / (r1 + r2)
    chosen = np.argsort(apart, kind="stable")[:_TRIED]
    who, one, two = who[chosen], one[chosen], two[chosen]
    s, t = one.mean(axis=1), two.mean(axis=1)
    for _ in range(8):
        gap = _points(rims, who[:, 1], t) - _points(rims, who[:, 0], s)
        ds, dt = _points(rims, who[:, 0], s, 1), _points(rims, who[:, 1], t, 1)
        a, b, c = (np.sum(x * y, axis=1) for x, y in ((ds, ds), (ds, dt), (dt, dt)))
        p, q = np.sum(ds * gap, axis=1), np.sum(dt * gap, axis=1)
        det = np.maximum(a * c - b * b, 1e-6 * a * c)  # damped where nearly parallel
        s = np.clip(s + (c * p - b * q) / det, one[:, 0], one[:, 1])
        t = np.clip(t + (b * p - a * q) / det, two[:, 0], two[:, 1])
    return _first(rims, who, s, t, tolerance)


def _closest(
    rims: Sequence[Rim], who: IntArray, one: FloatArray, two: FloatArray
) -> tuple[Place, Place, float, FloatArray] | None:
    return _first(rims, who, one.mean(axis=1), two.mean(axis=1), np.inf)


def _first(
    rims: Sequence[Rim], who: IntArray, s: FloatArray, t: FloatArray, tolerance: float
) -> tuple[Place, Place, float, FloatArray] | None:
    if not len(s):
        return None
    p, q = _points(rims, who[:, 0], s), _points(rims, who[:, 1], t)
    gap = np.linalg.norm(p - q, axis=1)
    # At a common end of two neighbours the distance is nil but so is the way along the curve.
    along = np.full(len(s), np.inf)
    same = who[:, 0] == who[:, 1]
    around = np.abs(s - t)[same]
    lengths = np.array([rim.length for rim in rims])[who[same, 0]]
    along[same] = np.minimum(around, 1.0 - around) * lengths
    gap = np.where(along > 50.0 * NEAREST * lengths.max(initial=0.0), gap, np.inf)
    best = int(np.argmin(gap))
    if not gap[best] <= tolerance:
        return None
    (a, b) = who[best].tolist()
    first, second = (a, float(s[best] % 1.0)), (b, float(t[best] % 1.0))
    return first, second, float(gap[best]), 0.5 * (p[best] + q[best])

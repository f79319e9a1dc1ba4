"""How far apart the curves of a net may lie, so that bricks become simple hexagons.

A brick of length α along rows and height β, in rows shifted by σα to each other, becomes a hexagon
in the plane of its middle. To the order of the curvature its vertices are where the tangent planes
at the middles of three bricks meet: with A = κ_a α², B = κ_b β² (normal curvatures along rows and
columns) every upright edge is shortened by the share

    q = σ(1 − σ) A / B      (σ = 1/2: q = A / 4B)

of β at both ends together, and the vertices between lie q β further apart. So the upright edges
vanish at q = 1, and on a saddle the brick's waist at q = −1: hexagons are simple exactly where

    σ(1 − σ) |κ_a| α² < |κ_b| β².

It is affinely regular at q = 1/3 (K > 0), quasi-regular at q = −1/3 (K < 0), and a plain brick at
q = 0, on parabolic curves with rows in the flat direction. With rows across the flat direction
(κ_b = 0) no spacing will do.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import LatticeError
from phexfab.remesh.conjugate.base import Base
from phexfab.remesh.conjugate.net import ConjugateNet, conjugate_net

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

IDEAL = 1 / 3
LOW = 0.7
"""Least height of a brick over its length."""
SHIFTS = (0.5, 0.4, 0.3, 0.25)


@dataclass(frozen=True, eq=False)
class Sampling:
    """Where rows and columns begin, and what it comes to.

    Attributes
    ----------
    base : Base
    rows, columns : (n,), (m,) float
        Arc lengths on the base column and row, mm.
    shift : float
        σ, of every other row of bricks.
    most : float
        Greatest |q| expected; below 1 faces are simple to the order of the curvature.
    worst : (3,) float
        Where that is, mm.
    area : float
        About the area that the net covers, mm².
    """

    base: Base
    rows: FloatArray
    columns: FloatArray
    shift: float
    most: float
    worst: FloatArray
    area: float


def crossing_number(
    along: FloatArray, across: FloatArray, length: FloatArray, height: FloatArray, shift: float
) -> FloatArray:
    """Return q = σ(1 − σ) κ_a α² / (κ_b β²) of bricks; hexagons are simple where |q| < 1.

    Parameters
    ----------
    along, across : (...) normal curvatures of rows and columns, 1/mm
    length, height : (...) of bricks, mm
    shift : float
    """
    top = shift * (1 - shift) * along * length**2
    bottom = across * height**2
    with np.errstate(divide="ignore", invalid="ignore"):
        q = top / bottom
    return np.asarray(np.where((top == 0) & (bottom == 0), 0.0, q))


def stretch(net: ConjugateNet) -> tuple[FloatArray, FloatArray]:
    """Return (n, m) length along rows per length of the base row, and the same for columns."""
    return (
        _rate(net.along, net.columns, 1, _turn(net, 0)),
        _rate(net.across, net.rows, 0, _turn(net, 1)),
    )


def sample(
    base: Base,
    size: float,
    *,
    shift: float | None = None,
    limit: float = 0.75,
    longest: float = 3.0,
    probe: ConjugateNet | None = None,
) -> Sampling:
    """Choose the rows of a net, and the shift, so that hexagons do not cross themselves.

    Columns lie ``size`` apart on the base row. Rows lie as far apart as makes |q| = 1/3 in the
    middle of its values along a row, and further where |q| would exceed ``limit``; where that is
    more than ``longest`` · size the columns concerned come closer, and the shift becomes less.

    Parameters
    ----------
    base : Base
    size : float
        mm.
    shift : float, optional
        σ in (0, 1); without it 1/2, or the greatest of 0.4, 0.3, 0.25 that helps.
    limit : float
        |q| at most.
    longest : float
        The most that lengths and heights of bricks may differ from ``size`` by, as a factor.
    probe : ConjugateNet, optional
        What ``probed`` returns, if it is there already.

    Raises
    ------
    LatticeError
        If no spacing meets the condition; the message names the place and the curvatures.
    """
    if not 0 < limit < 1:
        raise LatticeError(f"limit = {limit:g} must lie between 0 and 1")
    if shift is not None and not 0 < shift < 1:
        raise LatticeError(f"shift = {shift:g} must lie between 0 and 1")
    require_room(base, size)
    probe = probed(base, size) if probe is None else probe
    ka, kb = probe.curvatures()
    ga, gb = stretch(probe)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(ka) * ga**2 / (np.abs(kb) * gb**2)
    ratio = np.where(probe.there & ~np.isnan(ratio), ratio, 0.0)
    ratio[_vanishing(ka, kb)] = np.inf
    for sigma in SHIFTS if shift is None else (shift,):
        made = _chosen(probe, ratio, size, sigma, limit, longest)
        if made.most <= limit * (1 + 1e-6):
            return made
    raise LatticeError(_hopeless(probe, ratio, made, limit, longest))


def require_room(base: Base, size: float) -> None:
    """Refuse base curves that are too short for one hexagon.

    Raises
    ------
    LatticeError
        The message names the curve, its place and its length.
    """
    for which, name, least in ((0, "row", size), (1, "column", LOW * size)):
        low, high = base.reach(which)
        if high - low < least:
            place = base.row.points[0, base.row.origin].round(1).tolist()
            raise LatticeError(
                f"{base.fields.surface.name}: the {name} through the seed at {place} is "
                f"{high - low:.4g} mm long, too short for a hexagon of {size:.4g} mm; take a "
                "smaller size, or seed the net elsewhere"
            )


def probed(base: Base, size: float) -> ConjugateNet:
    """Return the net by which ``sample`` looks at a surface: of two thirds of the size."""
    return conjugate_net(base, _probes(base, size, 1), _probes(base, size, 0))


def _chosen(
    probe: ConjugateNet, ratio: FloatArray, size: float, sigma: float, limit: float, longest: float
) -> Sampling:
    """Spacings for one shift, and the greatest |q| they leave."""
    base, factor = probe.base, sigma * (1 - sigma)
    length = np.full(ratio.shape[1], float(size))
    ratio = np.minimum(ratio, 1e12)
    need = np.sqrt(factor / limit * (ratio * length**2).max(axis=1, initial=0.0))
    positive = np.where(ratio > 0, ratio, np.nan)
    middle = np.array([np.nanmedian(r) if np.isfinite(r).any() else 0.0 for r in positive])
    ideal = size * np.sqrt(factor / IDEAL * middle)
    height = np.clip(np.maximum(ideal, need), LOW * size, longest * size)
    # Columns where even the highest bricks are too low come closer.
    with np.errstate(divide="ignore"):
        fits = (height[:, None] * np.sqrt(limit / (factor * ratio))).min(axis=0)
    length = np.clip(np.minimum(length, fits), size / longest, size)
    q = factor * ratio * length**2 / height[:, None] ** 2
    at = np.unravel_index(int(q.argmax()), q.shape)
    return Sampling(
        base,
        _placed(base, probe.rows, height, 1),
        _placed(base, probe.columns, length, 0),
        sigma, float(q[at]), probe.points[at], _area(probe),
    )  # fmt: skip


def _vanishing(ka: FloatArray, kb: FloatArray) -> NDArray[np.bool_]:
    """Return (n, m) where the curvature along columns vanishes to the next point, κ_a does not."""
    large = np.nanmax(np.abs(np.stack([ka, kb])), initial=0.0)
    out = np.zeros(ka.shape, bool)
    for axis in (0, 1):
        k, other = np.moveaxis(kb, axis, 0), np.moveaxis(ka, axis, 0)
        change = k[1:] * k[:-1] < 0
        change &= np.minimum(np.abs(other[1:]), np.abs(other[:-1])) > 0.01 * large
        hit = np.moveaxis(out, axis, 0)
        hit[1:] |= change
        hit[:-1] |= change
    return out


def _area(net: ConjugateNet) -> float:
    """Return about the area of the net's quads."""
    p = net.points
    one = np.cross(p[1:, 1:] - p[:-1, :-1], p[:-1, 1:] - p[1:, :-1])
    return float(np.nansum(np.linalg.norm(one, axis=-1)) / 2)


def _placed(base: Base, at: FloatArray, wanted: FloatArray, which: int) -> FloatArray:
    """Return arc lengths whose distances are what is wanted at given arc lengths."""
    low, high = base.reach(which)
    s = np.linspace(low, high, 2001)
    period = (high - low) if base.closed(which) else None
    density = np.interp(s, at, 1 / wanted, period=period)
    total = np.concatenate([[0], np.cumsum((density[1:] + density[:-1]) / 2 * np.diff(s))])
    # Heights are at least what is wanted, lengths at most.
    count = int(np.floor(total[-1] + 1e-9) if which == 1 else np.ceil(total[-1] - 1e-9))
    if base.closed(which):
        # Every other row of bricks is shifted: an even number closes up.
        count = max(4, count - count % 2 if which == 1 else count)
        return np.interp(np.arange(count) * total[-1] / count, total, s)
    return np.interp(np.linspace(0.0, total[-1], max(1, count) + 1), total, s)


def _probes(base: Base, size: float, which: int) -> FloatArray:
    """Arc lengths at two thirds of the distances of a net, the ends of the curve included."""
    low, high = base.reach(which)
    count = max(5, int(np.ceil(1.5 * (high - low) / size)))
    return np.linspace(low, high, count, endpoint=not base.closed(which))


def _turn(net: ConjugateNet, which: int) -> float | None:
    return net.base.reach(which)[1] if net.closed[which] else None


def _rate(arc: FloatArray, at: FloatArray, axis: int, closed: float | None) -> FloatArray:
    """Differentiate arc lengths on the curves by those on the base curve, across holes."""
    arc, rate = np.moveaxis(arc, axis, 0), np.ones_like(np.moveaxis(arc, axis, 0))
    if closed is None:
        gap = np.diff(at)[:, None]
        slope = np.diff(arc, axis=0) / gap
        ahead = np.concatenate([slope, np.full((1, arc.shape[1]), np.nan)])
        behind = np.concatenate([np.full((1, arc.shape[1]), np.nan), slope])
    else:
        # The last slope reaches round; curves of the family close at lengths of their own.
        slope = np.diff(arc, axis=0) / np.diff(at)[:, None]
        ahead = np.concatenate([slope, slope[-1:]])
        behind = np.concatenate([slope[:1], slope])
    both = np.stack([ahead, behind])
    count = np.isfinite(both).sum(axis=0)
    rate = np.where(count > 0, np.nansum(both, axis=0) / np.maximum(count, 1), 1.0)
    return np.moveaxis(rate, 0, axis)


def _hopeless(
    probe: ConjugateNet, ratio: FloatArray, made: Sampling, limit: float, longest: float
) -> str:
    ka, kb = probe.curvatures()
    at = tuple(int(v[0]) for v in np.nonzero((probe.points == made.worst).all(-1)))
    return (
        f"{probe.surface.name}: at {made.worst.round(3).tolist()} hexagons would cross themselves: "
        f"|q| = {made.most:.3g} against {limit:g}, the curvature is {ka[at]:.3g} 1/mm along rows "
        f"and {kb[at]:.3g} across them; bricks up to {longest:g} times as long or high as asked do "
        "not help. Run rows along the flatter direction (the other family), take a part of the "
        "surface, or a greater longest"
    )

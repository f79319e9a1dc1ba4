"""Sharp corners of a rim: which points or joints are corners, and how corners are rounded."""

from __future__ import annotations

from collections.abc import Sequence
from math import comb
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import DesignError
from phexfab.surface.rims.pieces import Piece
from phexfab.surface.rims.spline import SAME, place

if TYPE_CHECKING:
    from phexfab.surface.rims.rim import Rim

FloatArray = NDArray[np.float64]

CORNER_ANGLE = 20.0  # degrees by which a tangent turns at a corner, at least
OUTSTANDING = 3.0  # a turn between points is a corner if so much greater than its neighbours'
ROOM, ROOM_ALONE = 0.499, 0.9  # share of a side that a rounding may take, and the only one of it
_DEGREE = 7
FLAT = 1e-6  # half the turn in radians: less is none


def corner_points(points: ArrayLike, angle: float = CORNER_ANGLE) -> NDArray[np.intp]:
    """Return the indices of the corners among points (n, 3) of a closed curve.

    A point is a corner if the polyline turns there by more than twice ``angle`` (40°), or by more
    than ``angle`` and more than three times what the neighbouring turns foretell (their turn for
    each millimetre, times this point's spacing). So a rectangle, a hexagon and an octagon have
    corners, a circle of ten points has none, and neither has a corner that is drawn rounded.
    A last point equal to the first is left out. Points that make no curve, which `Rim.through`
    refuses, have no corners.
    """
    found = np.asarray(points, dtype=float)
    if found.ndim == 2 and len(found) > 1:
        size = np.linalg.norm(np.ptp(found, axis=0))
        found = found[:-1] if np.linalg.norm(found[-1] - found[0]) <= SAME * size else found
    if len(found) < 3 or not np.isfinite(found).all():
        return np.empty(0, dtype=np.intp)
    steps = np.roll(found, -1, axis=0) - found
    lengths = np.linalg.norm(steps, axis=1)
    if not lengths.all():
        return np.empty(0, dtype=np.intp)
    turns = angles_between(np.roll(steps, 1, axis=0), steps)
    straight = np.ones(len(found), dtype=bool)
    return np.flatnonzero(sharp_joints(turns, lengths, straight, angle))


def sharp_joints(
    turns: FloatArray, lengths: FloatArray, straight: NDArray[np.bool_], angle: float
) -> NDArray[np.bool_]:
    """Return which joints (n,) of a closed chain of pieces are corners.

    Parameters
    ----------
    turns
        (n,) degrees by which the tangent turns where piece k begins.
    lengths, straight
        (n,) length of each piece, and whether it is a straight line.
    angle
        Where a curved piece meets another piece, tangents are exact and a turn above ``angle``
        is a corner. Straight pieces may be the chords of a curve: the rule of `corner_points`.
    """
    reach = 0.5 * (lengths + np.roll(lengths, 1))
    rate = turns / reach
    foretold = np.maximum(np.roll(rate, 1), np.roll(rate, -1)) * reach
    chords = straight & np.roll(straight, 1)
    outstanding = (turns > 2.0 * angle + 1e-6) | (turns > OUTSTANDING * foretold)
    return (turns > angle) & (outstanding | ~chords)


def angles_between(before: FloatArray, after: FloatArray) -> FloatArray:
    """Return angles (n,) in degrees between vectors (n, 3)."""
    cross = np.linalg.norm(np.cross(before, after), axis=-1)
    return np.degrees(np.arctan2(cross, np.sum(before * after, axis=-1)))


def rounded_pieces(
    rim: Rim, radius: float, which: Sequence[int] | None
) -> tuple[list[Piece], list[int], list[float]]:
    """Return pieces, numbers of those that begin at a corner still sharp, and parameter spans."""
    count = len(rim.corners)
    chosen = sorted(set(range(count) if which is None else which))
    if not np.isfinite(radius) or radius <= 0.0:
        raise DesignError(f"{rim.name}: radius {radius} mm; give a length above 0")
    if chosen and not 0 <= chosen[0] <= chosen[-1] < count:
        raise DesignError(f"{rim.name}: corners {chosen} of {count}; count from 0 to {count - 1}")
    if not chosen:
        widths = np.diff(rim.breaks).tolist()
        return (
            list(rim.pieces),
            np.flatnonzero(np.isin(rim.breaks[:-1], rim.corners)).tolist(),
            widths,
        )
    sides = np.array(rim.sides())
    ends = rim.arc_length(sides)
    cut = np.isin(np.arange(count), chosen)
    room = np.diff(ends, axis=1)[:, 0]
    room *= np.where(cut & np.roll(cut, -1), ROOM, ROOM_ALONE)
    for k in chosen:
        most = min(room[k], room[k - 1])
        if radius > most:
            raise DesignError(
                f"{rim.name}: a radius of {radius:g} mm does not fit at corner {k} "
                f"{place(rim.point(rim.corners[k]))}; at most {most:.6g} mm"
            )
    starts = rim.at_length(ends[:, 0] + np.where(cut, radius, 0.0))
    stops = rim.at_length(ends[:, 1] - np.where(np.roll(cut, -1), radius, 0.0))
    starts = np.where(cut, starts, sides[:, 0])
    stops = np.where(np.roll(cut, -1), stops, sides[:, 1])
    pieces: list[Piece] = []
    spans: list[float] = []
    sharp: list[int] = []
    for k in range(count):
        if cut[k]:
            before = float(stops[k - 1])
            pieces.append(_blend(rim, before, float(starts[k]), radius))
            spans.append(_span(rim, before, float(starts[k]), radius))
        else:
            sharp.append(len(pieces))
        stretch = _stretch(rim, float(starts[k]), float(stops[k]))
        pieces += stretch
        spans += [piece.length for piece in stretch]
    return pieces, sharp, spans


def _stretch(rim: Rim, first: float, last: float) -> list[Piece]:
    """The pieces between two parameters, first < last < first + 1, cut at both."""
    found = []
    for turn in range(int(np.floor(first)), int(np.ceil(last))):
        for k, piece in enumerate(rim.pieces):
            low, high = rim.breaks[k] + turn, rim.breaks[k + 1] + turn
            a, b = max(first, low), min(last, high)
            if b - a > 1e-12:
                found.append(piece.part((a - low) / (high - low), (b - low) / (high - low)))
    return found


def _blend(rim: Rim, before: float, after: float, radius: float) -> Piece:
    """The polynomial of degree 7 that continues both sides to third order."""
    span = _span(rim, before, after, radius)
    controls = np.concatenate(
        [_controls(rim, before, span, 1.0), _controls(rim, after, span, -1.0)[::-1]]
    )

    def values(s: FloatArray, order: int) -> FloatArray:
        degree, net = _DEGREE, controls
        for k in range(min(order, _DEGREE + 1)):
            degree = _DEGREE - 1 - k
            net = (degree + 1) * np.diff(net, axis=0)
        if order > _DEGREE:
            return np.zeros((len(s), 3))
        powers = np.arange(degree + 1)
        binomial = np.array([comb(degree, int(j)) for j in powers], dtype=float)
        basis = binomial * s[:, None] ** powers * (1.0 - s)[:, None] ** powers[::-1]
        return basis @ net

    return Piece(values)


def _span(rim: Rim, before: float, after: float, radius: float) -> float:
    """The length of the circular arc that leaves both sides at a distance ``radius`` (mm).

    A blend that runs through it at the sides' speed is nearly that arc. Of all of the same ends it
    bends least, and a film goes on the farther beyond a rim the less that bends.
    """
    ways = rim.derivative(np.array([before, after]))
    half = 0.5 * np.radians(angles_between(ways[:1], ways[1:])[0])
    return float(2.0 * radius * half / np.tan(half)) if half > FLAT else 2.0 * radius


def _controls(rim: Rim, t: float, span: float, sign: float) -> FloatArray:
    """Four Bézier points (4, 3) that give derivatives 0 to 3 of a blend's end at t."""
    at = np.array([t])
    speed = float(np.linalg.norm(rim.derivative(at)))
    unit = sign * span / speed  # span of t that the blend's parameter runs through
    p0 = rim.point(at)[0]
    d1, d2, d3 = (rim.derivative(at, k)[0] * unit**k for k in (1, 2, 3))
    first = d1 / 7.0
    second = d2 / 42.0
    third = d3 / 210.0
    p1 = p0 + first
    p2 = second + 2.0 * p1 - p0
    return np.array([p0, p1, p2, third + 3.0 * p2 - 3.0 * p1 + p0])

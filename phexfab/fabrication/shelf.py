"""Rows on sheets: a deterministic packer for bars and for panels that are nearly alike.

Parts are laid side by side in rows and each row is dropped on the ones below, both by the exact
distance between the contours, so slanted ends and the notches of hourglass hexagons interlock:
congruent ones fall into the row pattern in which they tile the plane. Several ways to turn the
parts are tried and the one with the fewest sheets is kept.

Contours here are already grown by half the spacing: they may touch.

References
----------
Level packing (first-fit decreasing height): Coffman, Garey, Johnson, Tarjan 1980, SIAM J.
Comput. 9(4).
"""

from __future__ import annotations

from bisect import bisect_right, insort
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

# Where a contour lies on its sheet: its index, the angle in degrees, then the shift.
Spot = tuple[int, float, float, float]

_SAME_HEIGHT = 0.03  # rows mix parts whose heights differ by no more than this ratio
_OFFSETS = 8  # starts tried for a row, over one pitch
_RECTANGULAR = 0.93  # share of its rectangle above which a part has nothing to interlock with
_TIGHT = 1e-9
FIT = 2e-7  # mm by which a part may be too large and still fit: rounding


def turned(contour: FloatArray, angle: float) -> FloatArray:
    """Return the contour rotated about the origin by ``angle`` degrees, exactly at right angles."""
    quarter, rest = divmod(angle, 90.0)
    if rest == 0.0:
        c, s = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))[int(quarter) % 4]
    else:
        c, s = float(np.cos(np.radians(angle))), float(np.sin(np.radians(angle)))
    return contour @ np.array([[c, s], [-s, c]])


def resting_angle(contour: FloatArray) -> float:
    """Return the turn in degrees that lays the contour's smallest rectangle along the x axis.

    The rectangle of least area has a side on an edge of the convex hull; ties go to the
    smallest turn, so that equal parts lie alike.
    """
    import shapely

    hull = np.asarray(shapely.convex_hull(shapely.MultiPoint(contour)).exterior.coords)
    step = np.diff(hull, axis=0)
    angles = np.unique(np.round(np.degrees(np.arctan2(step[:, 1], step[:, 0])) % 90.0, 9))
    c, s = np.cos(np.radians(angles)), np.sin(np.radians(angles))
    along = hull[:, :1] * c + hull[:, 1:] * s
    across = hull[:, 1:] * c - hull[:, :1] * s
    length, width = np.ptp(along, axis=0), np.ptp(across, axis=0)
    area = length * width
    best = int(np.flatnonzero(area <= area.min() * (1 + 1e-6))[0])
    turn = -float(angles[best])
    return turn if length[best] >= width[best] * (1 - 1e-6) else turn + 90.0


def _envelope(edges: FloatArray, at: FloatArray, upper: bool) -> FloatArray:
    """Height of the upper (or lower) outline of ``edges`` (m, 4: x0 y0 x1 y1) above each ``at``."""
    x0, y0, x1, y1 = (column[:, None] for column in edges.T)
    run = x1 - x0
    steep = np.abs(run) < _TIGHT
    t = (at - x0) / np.where(steep, 1.0, run)
    flat = y0 + t * (y1 - y0)
    if upper:
        height = np.where(steep, np.maximum(y0, y1), flat)
        miss = -np.inf
    else:
        height = np.where(steep, np.minimum(y0, y1), flat)
        miss = np.inf
    inside = (np.minimum(x0, x1) - _TIGHT <= at) & (at <= np.maximum(x0, x1) + _TIGHT)
    height = np.where(inside, height, miss)
    return height.max(axis=0) if upper else height.min(axis=0)


def _drop(below: FloatArray, above: FloatArray) -> float:
    """Least shift in y that brings ``above`` down onto ``below`` without overlap (−inf: none)."""
    low, high = np.min(above[:, [0, 2]]), np.max(above[:, [0, 2]])
    near = below[
        (np.minimum(below[:, 0], below[:, 2]) <= high)
        & (np.maximum(below[:, 0], below[:, 2]) >= low)
    ]
    if not len(near):
        return -np.inf
    at = np.unique(np.concatenate([near[:, 0], near[:, 2], above[:, 0], above[:, 2]]))
    with np.errstate(invalid="ignore"):
        gap = _envelope(near, at, True) - _envelope(above, at, False)
    return float(np.max(gap[~np.isnan(gap)], initial=-np.inf))


def _flip(edges: FloatArray) -> FloatArray:
    """Swap x and y, so that a slide in x is a drop in y."""
    return edges[:, [1, 0, 3, 2]]


@dataclass
class _Shape:
    """A contour turned for packing: its lower left corner moved to the origin."""

    index: int
    turn: float
    edges: FloatArray
    width: float
    height: float
    area: float
    corner: FloatArray

    def reversed(self) -> _Shape:
        """Return the shape turned half round."""
        size = np.array([self.width, self.height])
        edges = np.hstack([size, size]) - self.edges
        corner = -self.corner - size
        turn = (self.turn + 180.0) % 360.0
        return replace(self, turn=turn, edges=edges, corner=corner)


def _shape(index: int, contour: FloatArray, turn: float) -> _Shape:
    points = turned(contour, turn)
    corner = points.min(axis=0)
    width, height = (float(v) for v in points.max(axis=0) - corner)
    x, y = points.T
    area = 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))
    edges = np.hstack([points, np.roll(points, -1, axis=0)]) - np.hstack([corner, corner])
    return _Shape(index, turn % 360.0, edges, width, height, area, corner)


@dataclass
class _Row:
    """Shapes side by side: each with the x of its lower left corner; ``right`` is the far end."""

    shapes: list[_Shape] = field(default_factory=list)
    lefts: list[float] = field(default_factory=list)
    right: float = 0.0
    height: float = 0.0

    def slide(self, shape: _Shape) -> float:
        """Return the least left end at which ``shape`` clears the row."""
        left = 0.0
        for other, start in zip(reversed(self.shapes), reversed(self.lefts), strict=True):
            if start + other.width <= left:
                continue
            moved = _flip(other.edges) + np.array([0.0, start, 0.0, start])
            left = max(left, _drop(moved, _flip(shape.edges)))
        return left

    def add(self, shape: _Shape, left: float) -> None:
        self.shapes.append(shape)
        self.lefts.append(left)
        self.right = max(self.right, left + shape.width)
        self.height = max(self.height, shape.height)

    def without_last(self) -> _Row:
        row = _Row()
        for shape, left in zip(self.shapes[:-1], self.lefts[:-1], strict=True):
            row.add(shape, left)
        return row

    def edges(self) -> FloatArray:
        return np.vstack(
            [
                shape.edges + np.array([left, 0.0, left, 0.0])
                for shape, left in zip(self.shapes, self.lefts, strict=True)
            ]
        )


class _Pool:
    """Shapes not yet placed, in buckets of like height, widest last; taken out by width."""

    def __init__(self, shapes: Sequence[_Shape]) -> None:
        self.buckets: list[list[_Shape]] = []
        self.tops: list[float] = []
        self.home: dict[int, int] = {}
        for shape in sorted(shapes, key=lambda s: (-s.height, s.index)):
            if not self.tops or shape.height < self.tops[-1] * (1 - _SAME_HEIGHT):
                self.buckets.append([])
                self.tops.append(shape.height)
            self.buckets[-1].append(shape)
            self.home[shape.index] = len(self.buckets) - 1
        for bucket in self.buckets:
            bucket.sort(key=_by_width)

    def tallest(self, limit: float = np.inf) -> int | None:
        """Return the first bucket of parts no taller than ``limit``, or None."""
        for k, bucket in enumerate(self.buckets):
            if bucket and self.tops[k] <= limit:
                return k
        return None

    def take(self, bucket: int, room: float) -> _Shape | None:
        """Take the widest shape within ``room`` from a bucket or from the next lower ones."""
        for shapes in self.buckets[bucket : bucket + 3]:
            k = bisect_right(shapes, room, key=lambda s: s.width)
            if k:
                return shapes.pop(k - 1)
        return None

    def give_back(self, shapes: Sequence[_Shape]) -> None:
        for shape in shapes:
            insort(self.buckets[self.home[shape.index]], shape, key=_by_width)


def _by_width(shape: _Shape) -> tuple[float, int]:
    return shape.width, -shape.index


def _build_row(pool: _Pool, bucket: int, length: float) -> _Row:
    """Fill a row from the pool, widest first, each part the way round that lies closer."""
    row = _Row()
    while True:
        room = length - row.right + FIT
        last = row.shapes[-1] if row.shapes else None
        # Slanted ends may slide over one another: by what they lack to a rectangle, at both ends.
        reach = 2 * (last.width - last.area / last.height) if last else 0.0
        for width in (room + reach, room):
            shape = pool.take(bucket, width)
            if shape is None:
                return row
            ways = (shape, shape.reversed())
            left, k = min((row.slide(way), k) for k, way in enumerate(ways))
            if left + shape.width <= length + FIT:
                row.add(ways[k], left)
                break
            pool.give_back([shape])
        else:
            return row


@dataclass
class _Stack:
    """Rows on one sheet, from the bottom up."""

    rows: list[tuple[_Row, float, float, FloatArray]] = field(default_factory=list)
    top: float = 0.0

    def drop(self, edges: FloatArray) -> float:
        """Return the least height at which a row clears everything below."""
        rise = 0.0
        for _, _, _, below in reversed(self.rows):
            if np.max(below[:, 1]) > rise:
                rise = max(rise, _drop(below, edges))
        return rise

    def add(self, row: _Row, start: float, rise: float) -> None:
        edges = row.edges() + np.array([start, rise, start, rise])
        self.rows.append((row, start, rise, edges))
        self.top = max(self.top, float(np.max(edges[:, 1])))

    def spots(self) -> list[Spot]:
        return [
            (shape.index, shape.turn, left + start - shape.corner[0], rise - shape.corner[1])
            for row, start, rise, _ in self.rows
            for shape, left in zip(row.shapes, row.lefts, strict=True)
        ]


def _settle(stack: _Stack, row: _Row, length: float, interlock: bool) -> tuple[_Row, float, float]:
    """Choose the start of a row, and whether to leave its last part out to gain a better start.

    What counts is the area laid down per height used up.
    """
    best: tuple[float, _Row, float, float] | None = None
    for candidate in [row, row.without_last()] if interlock and len(row.shapes) > 2 else [row]:
        slack = max(length - candidate.right, 0.0)
        pitch = candidate.right / len(candidate.shapes)
        starts = [0.0]
        if interlock and stack.rows:
            starts = [pitch * k / _OFFSETS for k in range(_OFFSETS) if pitch * k / _OFFSETS < slack]
            starts.append(min(slack, pitch))
        area = sum(shape.area for shape in candidate.shapes)
        edges = candidate.edges()
        for start in starts:
            rise = stack.drop(edges + np.array([start, 0.0, start, 0.0]))
            gain = rise + float(np.max(edges[:, 1])) - stack.top
            merit = area / max(gain, 1e-3)
            if best is None or merit > best[0] * (1 + 1e-9):
                best = (merit, candidate, start, rise)
    assert best is not None
    return best[1:]


def pack_rows(
    contours: Sequence[FloatArray],
    turns: Sequence[float],
    length: float,
    width: float,
    limit: int | None = None,
) -> list[list[Spot]]:
    """Pack contours in rows along the length of as many sheets as it takes.

    Parameters
    ----------
    contours : sequence of (n, 2) arrays, mm
        Counter-clockwise, grown by half the spacing.
    turns : sequence of float
        Degrees by which each contour is turned before it is laid into a row; it must fit then.
    length, width : float
        The rectangle to fill, mm.
    limit : int, optional
        Give up, with an empty list, when more sheets than this are needed.

    Returns
    -------
    list of list of (index, angle, x, y)
        Per sheet, in the order of placing: turn the contour about the origin, then shift it.
    """
    shapes = [_shape(k, c, t) for k, (c, t) in enumerate(zip(contours, turns, strict=True))]
    filling = sum(s.area for s in shapes) / max(sum(s.width * s.height for s in shapes), 1e-9)
    interlock = filling < _RECTANGULAR
    pool = _Pool(shapes)
    sheets: list[list[Spot]] = []
    stack = _Stack()
    bucket = pool.tallest()
    while bucket is not None:
        row = _build_row(pool, bucket, length)
        kept, start, rise = _settle(stack, row, length, interlock)
        if rise + kept.height <= width + FIT:
            stack.add(kept, start, rise)
            pool.give_back(row.shapes[len(kept.shapes) :])
            bucket = pool.tallest()
            continue
        pool.give_back(row.shapes)
        lower = [k for k in [pool.tallest(width - stack.top)] if k is not None and k > bucket]
        if lower:
            bucket = lower[0]
            continue
        sheets.append(stack.spots())
        if len(sheets) == limit:
            return []
        stack = _Stack()
        bucket = pool.tallest()
    if stack.rows:
        sheets.append(stack.spots())
    return sheets

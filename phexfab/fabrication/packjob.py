"""One group of parts ready for packing: checked, grown by half the spacing, and laid in rows."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import NestingError
from phexfab.fabrication.parts import FlatPart, Stock
from phexfab.fabrication.shelf import FIT, Spot, pack_rows, resting_angle, turned

if TYPE_CHECKING:
    import shapely

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

CLEAR = 2e-3  # mm added to half the spacing: Sparrow counts in single precision


@dataclass(frozen=True, eq=False)
class Job:
    """The parts of one group, grown by half the spacing and laid along x; the free rectangle."""

    parts: tuple[FlatPart, ...]
    stock: Stock
    contours: tuple[FloatArray, ...]
    turns: tuple[float, ...]
    areas: FloatArray
    length: float
    width: float


def prepare(parts: Sequence[FlatPart], stock: Stock) -> Job:
    """Validate the parts and grow their blanks; refuse what cannot be nested."""
    import shapely

    if stock.spacing < 0 or stock.margin < 0:
        raise NestingError(f"spacing {stock.spacing:g} and margin {stock.margin:g} mm must be ≥ 0")
    free = np.array([stock.length, stock.width]) - 2 * stock.margin
    if free.min() <= 0:
        raise NestingError(
            f"a sheet of {stock.length:g} × {stock.width:g} mm has no room inside its margin of "
            f"{stock.margin:g} mm"
        )
    grow = stock.spacing / 2 + CLEAR
    contours, turns = [], []
    for part in parts:
        blank = _simple(part, "blank", part.blank)
        outline = _simple(part, "outline", part.outline)
        if outline.difference(blank).area > 1e-6 * outline.area:
            raise NestingError(f"{part.mark}: the outline reaches beyond the blank")
        turn = resting_angle(np.asarray(part.blank, float))
        size = np.ptp(turned(np.asarray(part.blank, float), turn), axis=0)
        if not (np.all(size <= free + FIT) or np.all(size[::-1] <= free + FIT)):
            raise NestingError(
                f"{part.mark} needs {size[0]:.1f} × {size[1]:.1f} mm but the sheet is "
                f"{stock.length:g} × {stock.width:g} mm with a margin of {stock.margin:g} mm; "
                "take a larger sheet or smaller panels"
            )
        # Mitres cut at the offset's own distance hold the round offset and have few corners.
        ring = blank.buffer(grow, join_style="mitre", mitre_limit=1.0).exterior
        points = np.asarray(ring.coords)[:-1]
        contours.append(points if ring.is_ccw else points[::-1])
        turns.append(turn)
    areas = np.array([shapely.Polygon(contour).area for contour in contours])
    length, width = (float(v) + 2 * grow for v in free)
    return Job(tuple(parts), stock, tuple(contours), tuple(turns), areas, length, width)


def _simple(part: FlatPart, what: str, contour: FloatArray) -> shapely.Polygon:
    import shapely

    points = np.asarray(contour, float)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) < 3 or not np.isfinite(points).all():
        raise NestingError(f"{part.mark}: its {what} is not a contour of three corners or more")
    polygon = shapely.Polygon(points)
    if not polygon.is_valid or polygon.area <= 0:
        reason = shapely.is_valid_reason(polygon)
        raise NestingError(f"{part.mark}: its {what} crosses itself ({reason}); check the panel")
    if not polygon.exterior.is_ccw:
        raise NestingError(f"{part.mark}: its {what} is clockwise; give it counter-clockwise")
    return polygon


def all_bars(job: Job) -> bool:
    """True where the parts fill their rectangles so well that rows cannot be beaten."""
    boxes = [
        np.prod(np.ptp(turned(c, t), axis=0)) for c, t in zip(job.contours, job.turns, strict=True)
    ]
    return float(np.sum(job.areas)) > 0.9 * float(np.sum(boxes))


def rows(job: Job, chosen: IntArray, limit: int | None = None) -> list[list[Spot]]:
    """Lay parts in rows, the best of four ways: along or across, rows along x or along y."""
    best: list[list[Spot]] = []
    score = (np.inf, np.inf)
    for across in (0.0, 90.0):
        for upright in (False, True):
            room = (job.width, job.length) if upright else (job.length, job.width)
            contours, turns = [], []
            for k in chosen:
                box = np.ptp(turned(job.contours[k], job.turns[k] + across), axis=0)
                fits = box[0] <= room[0] + FIT and box[1] <= room[1] + FIT
                contours.append(job.contours[k])
                turns.append(job.turns[k] + (across if fits else 90.0 - across))
            sheets = pack_rows(contours, turns, *room, limit=limit)
            if not sheets:
                continue
            last = float(sum(job.areas[chosen[k]] for k, *_ in sheets[-1]))
            if (len(sheets), last) < score:
                score = (len(sheets), last)
                best = [[_upright(spot, job.length, upright) for spot in s] for s in sheets]
    return [[(int(chosen[k]), a, x, y) for k, a, x, y in sheet] for sheet in best]


def _upright(spot: Spot, length: float, upright: bool) -> Spot:
    """Turn a spot of a sheet filled along y back by a quarter turn."""
    if not upright:
        return spot
    k, angle, x, y = spot
    return k, angle + 90.0, length - y, x


def rows_by_sheet(job: Job, order: IntArray) -> list[list[Spot]]:
    """Fill one sheet after another with as many parts as the rows hold, the small ones first."""
    layout: list[list[Spot]] = []
    cap = len(order)
    placed = 0
    while placed < len(order):
        left = order[placed:]
        full = max(1, int(np.searchsorted(np.cumsum(job.areas[left]), job.length * job.width)))
        low, high, trial = 0, min(cap, full, len(left)) + 1, min(cap, full, len(left))
        best: list[Spot] = []
        while high - low > 1:
            sheets = rows(job, left[:trial], limit=1)
            if sheets:
                low, best = trial, sheets[0]
            else:
                high = trial
            trial = (low + high) // 2 if not layout else max(high - 1, low + 1)
        # Parts grow from here on: no more of them will fit on a sheet.
        cap = low
        layout.append(best)
        placed += low
    return layout

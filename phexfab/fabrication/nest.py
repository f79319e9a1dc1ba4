"""Nesting: all parts of a job on as few stock sheets as can be.

Two packers answer. Rows (``shelf``) take milliseconds and are the last word on bars; on hourglass
hexagons they find the pattern in which congruent ones tile the plane. Sparrow (``strip``) packs
sheet after sheet denser where the panels vary. Parts go from small to large, so that what did not
fit once need not be tried again with larger ones, and Sparrow is asked only for more than the
rows already hold.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import NestingError
from phexfab.fabrication.layout import (
    Nest,
    fingerprint,
    layout_from_json,
    verify_layout,
)
from phexfab.fabrication.parts import FlatPart, Material, Placement, Sheet, Stock
from phexfab.fabrication.shelf import Spot, pack_rows, resting_angle, turned
from phexfab.fabrication.strip import StripLayout, StripRun, pack_strips

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Progress = Callable[[int, int], None]

_CLEAR = 2e-3  # mm added to half the spacing: Sparrow counts in single precision
_FULL = 0.85  # share of a sheet, spacing included, that irregular parts do not exceed
_SPILL = 2  # parts that a sheet may leave over where its mixture does not fit
_HALF = (0.0, 180.0)
# Seconds a part: for each report of Sparrow and for getting stuck, measured at 30 to 40 parts.
_REPORT_COST, _STUCK_COST = 2.5e-4, 6e-2
_CLOCK_GUARD = 5.0  # the clock ends the search at this many times the nominal seconds


@dataclass(frozen=True, eq=False)
class _Job:
    """The parts of one group, grown by half the spacing and laid along x; the free rectangle."""

    parts: tuple[FlatPart, ...]
    stock: Stock
    contours: tuple[FloatArray, ...]
    turns: tuple[float, ...]
    areas: FloatArray
    length: float
    width: float


def nest(
    parts: Sequence[FlatPart],
    stock: Stock,
    *,
    seed: int = 0,
    seconds: float = 90.0,
    packer: str = "spyrrow",
    progress: Progress | None = None,
    notes: list[str] | None = None,
) -> tuple[Sheet, ...]:
    """Nest parts of one material and thickness on as few sheets as can be.

    Parameters
    ----------
    parts : sequence of FlatPart
        Their blanks are kept apart; they may be non-convex and are turned, never mirrored.
    stock : Stock
    seed : int
        For Sparrow; the same seed gives the same layout unless the clock ends the search.
    seconds : float
        Work for Sparrow, in seconds of a common machine; then the parts left are laid in rows.
        What is counted are steps, so the layout does not depend on the machine's speed; only
        where the clock reaches five times as many seconds is the search cut short by it.
    packer : {"spyrrow", "shelf"}
        ``"shelf"`` lays rows only: a fraction of a second, always the same.
    progress : callable, optional
        Called with the number of parts placed and of all parts.
    notes : list of str, optional
        Gets a line for everything that did not go as planned.

    Returns
    -------
    tuple of Sheet
        Verified; every part lies on exactly one of them.

    Raises
    ------
    NestingError
        If a part is larger than the sheet, a contour is not simple or not counter-clockwise, or
        marks are used twice; the message names the mark, the sizes and a remedy.

    References
    ----------
    Gardeyn, Wauters, Vanden Berghe 2025, arXiv:2509.13329 (Sparrow).
    """
    if packer not in ("spyrrow", "shelf"):
        raise NestingError(f"packer is {packer!r}; it must be 'spyrrow' or 'shelf'")
    if not parts:
        return ()
    notes = [] if notes is None else notes
    job = _prepare(parts, stock)
    everything = np.argsort(np.round(job.areas, 3), kind="stable")
    layout = _rows(job, everything)
    bars = _bars(job)
    if not bars and len(layout) > 1:
        layout = min(layout, _rows_by_sheet(job, everything), key=len)
    fewest = int(np.ceil(np.sum(job.areas) / (_FULL * job.length * job.width) - 1e-9))
    if packer == "spyrrow" and len(layout) > fewest and not bars:
        sparrow = _Sparrow(job, seed, seconds, time.monotonic() + _CLOCK_GUARD * seconds)
        denser = _search(job, everything, len(layout), fewest, sparrow, progress, notes)
        if denser is not None and len(denser) < len(layout):
            layout = denser
    sheets = _sheets(job, layout)
    verify_layout(sheets, parts)
    if progress is not None:
        progress(len(parts), len(parts))
    return sheets


def nest_all(
    flats: Sequence[FlatPart],
    stock: Stock | Mapping[str, Stock],
    *,
    seed: int = 0,
    seconds: float = 90.0,
    packer: str = "spyrrow",
    previous: str | None = None,
    progress: Progress | None = None,
) -> Nest:
    """Nest all parts of a job, each material and thickness on sheets of its own.

    Parameters
    ----------
    flats : sequence of FlatPart
    stock : Stock or mapping of material name to Stock
    seed, seconds, packer, progress
        As in ``nest``; the seconds are for the whole job.
    previous : str, optional
        JSON of an earlier layout; it is used again, after verification, when its fingerprint
        says that neither parts nor stock nor settings have changed.

    Returns
    -------
    Nest
        Sheets are named such as ``PANELS-HPL-8mm-01``.

    Raises
    ------
    NestingError
        As in ``nest``, and where the mapping has no stock for a material.
    """
    groups: dict[tuple[Material, float], list[FlatPart]] = {}
    for flat in flats:
        groups.setdefault((flat.material, flat.thickness), []).append(flat)
    stocks = {material.name: _stock_of(material.name, stock) for material, _ in groups}
    settings = {
        "packer": packer,
        "seed": seed,
        "seconds": seconds,
        "stock": {name: asdict(value) for name, value in stocks.items()},
    }
    print_ = fingerprint(flats, settings)
    notes: list[str] = []
    if previous is not None:
        kept = _kept(previous, print_, flats, notes)
        if kept is not None:
            return kept
    started = time.monotonic()
    sheets: list[Sheet] = []
    done = 0
    for (material, thickness), parts in groups.items():
        base = done

        def report(count: int, _: int, base: int = base) -> None:
            if progress is not None:
                progress(base + count, len(flats))

        left = max(seconds - (time.monotonic() - started), 0.0)
        nested = nest(
            parts,
            stocks[material.name],
            seed=seed,
            seconds=left,
            packer=packer,
            progress=report,
            notes=notes,
        )
        stem = _stem(parts, material, thickness)
        sheets += [replace(sheet, name=f"{stem}-{k + 1:02d}") for k, sheet in enumerate(nested)]
        done += len(parts)
    verify_layout(sheets, flats)
    return Nest(tuple(sheets), tuple(notes), print_)


def _kept(text: str, wanted: str, flats: Sequence[FlatPart], notes: list[str]) -> Nest | None:
    try:
        kept = layout_from_json(text)
        if kept.fingerprint != wanted:
            return None
        verify_layout(kept.sheets, flats)
    except NestingError as error:
        notes.append(f"kept layout not used: {error}")
        return None
    return kept


def _stock_of(material: str, stock: Stock | Mapping[str, Stock]) -> Stock:
    if isinstance(stock, Stock):
        return stock
    if material not in stock:
        raise NestingError(f"no stock sheet is given for {material}; there is {sorted(stock)}")
    return stock[material]


def _stem(parts: Sequence[FlatPart], material: Material, thickness: float) -> str:
    letters = {part.mark[:1] for part in parts}
    family = {"P": "PANELS", "B": "BEAMS"}.get(letters.pop(), "PARTS") if len(letters) == 1 else ""
    name = re.sub(r"[^A-Za-z0-9]+", "-", material.name).strip("-")
    return f"{family or 'PARTS'}-{name}-{thickness:g}mm"


def _prepare(parts: Sequence[FlatPart], stock: Stock) -> _Job:
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
    marks = [part.mark for part in parts]
    if len(set(marks)) < len(marks):
        twice = next(mark for mark in marks if marks.count(mark) > 1)
        raise NestingError(f"the mark {twice} is used twice; every part needs a mark of its own")
    grow = stock.spacing / 2 + _CLEAR
    contours, turns = [], []
    for part in parts:
        blank = _simple(part, "blank", part.blank)
        outline = _simple(part, "outline", part.outline)
        if outline.difference(blank).area > 1e-6 * outline.area:
            raise NestingError(f"{part.mark}: the outline reaches beyond the blank")
        turn = resting_angle(np.asarray(part.blank, float))
        size = np.ptp(turned(np.asarray(part.blank, float), turn), axis=0)
        need = size + 2 * _CLEAR
        if not (np.all(need <= free) or np.all(need[::-1] <= free)):
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
    length, width = (float(v) + stock.spacing for v in free)
    return _Job(tuple(parts), stock, tuple(contours), tuple(turns), areas, length, width)


def _simple(part: FlatPart, what: str, contour: FloatArray):  # type: ignore[no-untyped-def]
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


def _bars(job: _Job) -> bool:
    """True where the parts fill their rectangles so well that rows cannot be beaten."""
    boxes = [
        np.prod(np.ptp(turned(c, t), axis=0)) for c, t in zip(job.contours, job.turns, strict=True)
    ]
    return float(np.sum(job.areas)) > 0.9 * float(np.sum(boxes))


def _rows(job: _Job, chosen: IntArray, limit: int | None = None) -> list[list[Spot]]:
    """Lay parts in rows, the best of four ways: along or across, rows along x or along y."""
    best: list[list[Spot]] = []
    score = (np.inf, np.inf)
    for across in (0.0, 90.0):
        for upright in (False, True):
            room = (job.width, job.length) if upright else (job.length, job.width)
            contours, turns = [], []
            for k in chosen:
                box = np.ptp(turned(job.contours[k], job.turns[k] + across), axis=0)
                fits = box[0] <= room[0] + 1e-9 and box[1] <= room[1] + 1e-9
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


def _rows_by_sheet(job: _Job, order: IntArray) -> list[list[Spot]]:
    """Fill one sheet after another with as many parts as the rows hold, the small ones first."""
    layout: list[list[Spot]] = []
    cap = len(order)
    placed = 0
    while placed < len(order):
        left = order[placed:]
        full = int(np.searchsorted(np.cumsum(job.areas[left]), job.length * job.width))
        low, high, trial = 0, min(cap, full, len(left)) + 1, min(cap, full, len(left))
        best: list[Spot] = []
        while high - low > 1:
            sheets = _rows(job, left[:trial], limit=1)
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


@dataclass
class _Sparrow:
    """Asks Sparrow whether parts fit on a sheet.

    Its work is counted in nominal seconds by the packer's reports, not by the clock, so that a
    slower machine gets the same layout later rather than another one; the clock is only a guard.
    """

    job: _Job
    seed: int
    left: float
    deadline: float
    silent: str = ""

    def ask(
        self, trials: Sequence[tuple[IntArray, float, int]], *, until_one_fits: bool = False
    ) -> list[list[Spot]]:
        """Try sheets side by side: (parts, degrees they are turned by, seed); empty: no."""
        job = self.job
        runs = [
            StripRun(
                tuple(turned(job.contours[k], job.turns[k] + along) for k in parts),
                job.width,
                job.length,
                _HALF,
                self.seed + seed,
                max(int(self.left / (_REPORT_COST * len(parts))), 0),
            )
            for parts, along, seed in trials
        ]
        seconds = max(self.deadline - time.monotonic(), 0.1)
        layouts = pack_strips(runs, seconds, until_one_fits=until_one_fits)
        answers: list[list[Spot]] = []
        costs = []
        for (parts, along, _), layout in zip(trials, layouts, strict=False):
            fits = layout.length <= job.length
            turns = [job.turns[k] + along for k in parts]
            answers.append(
                [(int(parts[k]), turns[k] + a, x, y) for k, a, x, y in layout.spots] if fits else []
            )
            costs.append(len(parts) * (_REPORT_COST * layout.reports + _STUCK_COST * (not fits)))
            if layout.error:
                self.silent = f"Sparrow failed ({layout.error})"
            elif layout.late:
                self.silent = "the clock ran out"
        self.left -= max(costs)  # they ran side by side
        if self.left <= 0 and not self.silent:
            self.silent = "the time given for nesting is spent"
        return answers


def _deal(order: IntArray, hands: int) -> list[IntArray]:
    """Deal parts, sorted by size, to sheets: to and fro, so that all get the same mixture."""
    place = np.arange(len(order))
    turn, seat = np.divmod(place, hands)
    seat = np.where(turn % 2, hands - 1 - seat, seat)
    return [order[seat == hand] for hand in range(hands)]


def _search(
    job: _Job,
    order: IntArray,
    beat: int,
    fewest: int,
    sparrow: _Sparrow,
    progress: Progress | None,
    notes: list[str],
) -> list[list[Spot]] | None:
    """Deal the parts evenly to fewer sheets than ``beat``, the fewest that Sparrow can fill.

    Sheets of mixed sizes leave Sparrow more freedom than sheets of equal parts, and a mixture
    that fits on one sheet tells that the others will.
    """
    order = order[::-1]
    layout: list[list[Spot]] = []
    for hands in range(beat - 1, fewest - 1, -1):
        sample = _deal(order, hands)[0]
        answers = sparrow.ask([(sample, 0.0, 0), (sample, 90.0, 0)], until_one_fits=True)
        if not any(answers):
            break
        chosen, along = hands, 0.0 if answers[0] else 90.0
    else:
        hands = fewest - 1
    if hands == beat - 1:
        if sparrow.silent:
            notes.append(f"{sparrow.silent}: {_name(job)} lies in rows")
        return None
    rest: list[int] = []
    sheets = _deal(order, chosen)
    for k in range(0, chosen, 2):
        if sparrow.silent:
            rest += [int(i) for parts in sheets[k:] for i in parts]
            notes.append(
                f"{sparrow.silent}: {len(rest)} of {len(order)} parts of {_name(job)} lie in rows"
            )
            break
        if progress is not None:
            progress(sum(map(len, layout)), len(order))
        pair = sheets[k : k + 2]
        for parts, answer in zip(pair, sparrow.ask([(p, along, 0) for p in pair]), strict=True):
            spill = 0
            while not answer and not sparrow.silent and spill <= _SPILL:
                # Another seed, the other way round; then without the smallest part.
                held = parts[: len(parts) - spill]
                trials = [(held, along, 1 + spill), (held, 90.0 - along, 1 + spill)]
                answer = next((a for a in sparrow.ask(trials, until_one_fits=True) if a), [])
                spill += 1
            lying = {i for i, *_ in answer}
            rest += [int(i) for i in parts if int(i) not in lying]
            if answer:
                layout.append(answer)
    if rest:
        layout += _rows(job, np.array(sorted(rest), np.int64))
    return layout


def _name(job: _Job) -> str:
    return f"{job.parts[0].material.name} {job.parts[0].thickness:g} mm"


def _sheets(job: _Job, layout: list[list[Spot]]) -> tuple[Sheet, ...]:
    """Turn spots of grown contours in the free rectangle into placements on stock sheets."""
    corner = job.stock.margin - job.stock.spacing / 2
    part = job.parts[0]
    return tuple(
        Sheet(
            f"{k + 1:02d}",
            job.stock,
            part.thickness,
            part.material,
            tuple(
                Placement(
                    job.parts[i].mark,
                    round(angle % 360.0, 6) % 360.0,
                    round(x + corner, 4),
                    round(y + corner, 4),
                )
                for i, angle, x, y in spots
            ),
        )
        for k, spots in enumerate(layout)
    )

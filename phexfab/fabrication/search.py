"""The search for a denser nest: Sparrow, sheet by sheet, until fewer are out of reach.

Sheets of mixed sizes leave Sparrow more freedom than sheets of equal parts: a mixture that fits
on one sheet tells how many sheets are enough, before they are filled. What a last, nearly empty
sheet holds is then pressed into the others.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from phexfab.fabrication.packjob import CLEAR, IntArray, Job, rows
from phexfab.fabrication.shelf import Spot, turned
from phexfab.fabrication.strip import StripRun, pack_strips

Progress = Callable[[int, int], None]

_HALF = (0.0, 180.0)
# Seconds a part: for each report of Sparrow and for getting stuck, measured at 30 to 40 parts.
_REPORT_COST, _STUCK_COST = 3.5e-4, 8e-2
_CLOCK_GUARD = 5.0  # the clock ends the search half a minute after this many times the seconds
FULL = 0.85  # share of a sheet, spacing included, that irregular parts do not exceed
_REFUSED = 0.2  # share of mixtures that may not fit before a number of sheets is given up


@dataclass
class Sparrow:
    """Asks Sparrow whether parts fit on a sheet, as long as the effort given for it lasts.

    Its work is counted in nominal seconds by the packer's reports, not by the clock, so that a
    slower machine gets the same layout later rather than another one; the clock is only a guard.
    ``silent`` tells why no more is asked, once that is so.
    """

    job: Job
    seed: int
    seconds: float
    progress: Progress | None = None
    silent: str = ""
    spent: float = 0.0
    started: float = field(default_factory=time.monotonic)

    def ask(
        self, trials: Sequence[tuple[IntArray, float, int]], *, until_one_fits: bool = False
    ) -> list[list[Spot]]:
        """Try sheets side by side: (parts, degrees they are turned by, seed); empty where not.

        With ``until_one_fits`` the trials after the first that fits are not waited for.
        """
        if self.silent:
            return [[] for _ in trials]
        job = self.job
        left = self.seconds - self.spent
        # Rows may use the last micrometre of the sheet, single precision may not.
        length, width = job.length - 2 * CLEAR, job.width - 2 * CLEAR
        runs = [
            StripRun(
                tuple(turned(job.contours[k], job.turns[k] + along) for k in parts),
                width,
                length,
                _HALF,
                self.seed + seed,
                int(left / (_REPORT_COST * len(parts))),
            )
            for parts, along, seed in trials
        ]
        guard = self.started + 30.0 + _CLOCK_GUARD * self.seconds - time.monotonic()
        layouts = pack_strips(runs, max(guard, 0.1), until_one_fits=until_one_fits)
        answers: list[list[Spot]] = [[] for _ in trials]
        costs = []
        for slot, layout in enumerate(layouts):
            parts, along, _ = trials[slot]
            fits = layout.length <= length
            if fits:
                answers[slot] = [
                    (int(parts[k]), job.turns[int(parts[k])] + along + angle, x + CLEAR, y + CLEAR)
                    for k, angle, x, y in layout.spots
                ]
            costs.append(len(parts) * (_REPORT_COST * layout.reports + _STUCK_COST * (not fits)))
            if layout.error:
                self.silent = f"Sparrow failed ({layout.error})"
            elif layout.late:
                self.silent = "the clock ran out"
        self.spent += max(costs)  # they ran side by side
        if self.spent >= self.seconds and not self.silent:
            self.silent = f"the {self.seconds:g} s given for nesting are spent"
        return answers


def search(
    job: Job, order: IntArray, rows_layout: list[list[Spot]], sparrow: Sparrow, notes: list[str]
) -> list[list[Spot]]:
    """Return a layout on fewer sheets than the rows need, or theirs where there is none.

    Parameters
    ----------
    job : Job
    order : (n,) int array
        All parts, the small ones first.
    rows_layout : list of lists of spots
        What to surpass.
    sparrow : Sparrow
    notes : list of str
        Gets a line when the search was cut short.
    """
    order = order[::-1]
    fewest = int(np.ceil(np.sum(job.areas) / (FULL * job.length * job.width) - 1e-9))
    along: dict[int, float] = {}
    for hands in range(len(rows_layout) - 1, fewest - 1, -1):
        hardest = max(_deal(order, hands), key=lambda parts: float(np.sum(job.areas[parts])))
        ways = sparrow.ask([(hardest, 0.0, 0), (hardest, 90.0, 0)], until_one_fits=True)
        if not any(ways):
            break
        along[hands] = 0.0 if ways[0] else 90.0
    best = rows_layout
    for hands in reversed(along):
        layout, rest = _fill(_deal(order, hands), along[hands], sparrow)
        if rest:
            layout += rows(job, np.array(sorted(rest, key=order.tolist().index), np.int64))
        if len(layout) < len(best):
            best = layout
            break
    if len(best) > fewest:
        best = _press(job, best, sparrow)
    if sparrow.silent:
        notes.append(
            f"{job.parts[0].material.name} {job.parts[0].thickness:g} mm: {sparrow.silent}; "
            f"the nest on {len(best)} sheets may not be the densest"
        )
    return best


def _deal(order: IntArray, hands: int) -> list[IntArray]:
    """Deal parts, sorted by size, to sheets: to and fro, so that all get the same mixture."""
    turn, seat = np.divmod(np.arange(len(order)), hands)
    seat = np.where(turn % 2, hands - 1 - seat, seat)
    return [order[seat == hand] for hand in range(hands)]


def _fill(
    sheets: list[IntArray], along: float, sparrow: Sparrow
) -> tuple[list[list[Spot]], list[int]]:
    """Let Sparrow lay out every sheet, two at a time; return the layouts and what is left over.

    A mixture that does not fit is tried once more with another seed and, beside it, without its
    smallest part. Too many of them and no more are tried.
    """
    layout: list[list[Spot]] = []
    rest: list[int] = []
    total = sum(map(len, sheets))
    refused = 0
    for k in range(0, len(sheets), 2):
        pair = sheets[k : k + 2]
        if refused > _REFUSED * len(sheets):
            rest += _members(pair)
            continue
        if sparrow.progress is not None:
            sparrow.progress(sum(map(len, layout)), total)
        answers = sparrow.ask([(parts, along, 0) for parts in pair])
        for parts, answer in zip(pair, answers, strict=True):
            if not answer:
                refused += 1
                again = [(parts, along, 1), (parts[:-1], along, 1)]
                answer = next(filter(None, sparrow.ask(again, until_one_fits=True)), [])
            if answer:
                layout.append(answer)
            lying = {i for i, *_ in answer}
            rest += [i for i in _members([parts]) if i not in lying]
    return layout, rest


def _members(sheets: Iterable[IntArray]) -> list[int]:
    return [int(i) for parts in sheets for i in parts]


def _press(job: Job, layout: list[list[Spot]], sparrow: Sparrow) -> list[list[Spot]]:
    """Try to add the parts of the emptiest sheet to the others, one by one."""
    fill = [float(sum(job.areas[i] for i, *_ in sheet)) for sheet in layout]
    last = int(np.argmin(fill))
    loose = sorted((i for i, *_ in layout[last]), key=lambda i: (-job.areas[i], i))
    sheets = {k: sheet for k, sheet in enumerate(layout) if k != last}
    room = {k: FULL * job.length * job.width - fill[k] for k in sheets}
    while loose:
        open_ = sorted(
            (k for k in sheets if room[k] >= job.areas[loose[-1]]), key=lambda k: fill[k]
        )
        if len(loose) > max(2 * len(open_) // 3, min(2, len(open_))):
            return layout  # one part more on every other sheet is not to be hoped for
        pair = list(zip(open_, loose[:2], strict=False))
        answers = sparrow.ask(
            [(np.array([i for i, *_ in sheets[k]] + [i]), 0.0, 0) for k, i in pair]
        )
        for (k, i), answer in zip(pair, answers, strict=True):
            if answer:
                sheets[k] = answer
                fill[k] += float(job.areas[i])
                loose.remove(i)
            room[k] = room[k] - float(job.areas[i]) if answer else 0.0
    return list(sheets.values())

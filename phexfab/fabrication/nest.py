"""Nesting: all parts of a job on as few stock sheets as can be.

Two packers answer. Rows (``shelf``) take milliseconds and are the last word on bars; on hourglass
hexagons they find the pattern in which congruent ones tile the plane. Sparrow (``search``) packs
panels of mixed sizes denser; it is asked only for fewer sheets than the rows need.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace

import numpy as np

from phexfab.errors import NestingError
from phexfab.fabrication.layout import Nest, fingerprint, layout_from_json, verify_layout
from phexfab.fabrication.packjob import CLEAR, Job, all_bars, prepare, rows, rows_by_sheet
from phexfab.fabrication.parts import FlatPart, Material, Placement, Sheet, Stock
from phexfab.fabrication.search import Progress, Sparrow, search
from phexfab.fabrication.shelf import Spot


def nest(
    parts: Sequence[FlatPart],
    stock: Stock,
    *,
    seed: int = 0,
    seconds: float = 60.0,
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
        where the clock reaches half a minute and five times the seconds does it end the search.
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
    _refuse_doubles(parts)
    job = prepare(parts, stock)
    order = np.argsort(np.round(job.areas, 3), kind="stable")
    layout = rows(job, order)
    sheets: tuple[Sheet, ...] = ()
    if len(layout) > 1 and not all_bars(job):
        layout = min(layout, rows_by_sheet(job, order), key=lambda sheets: _tally(job, sheets))
        if packer == "spyrrow":
            denser = search(job, order, layout, Sparrow(job, seed, seconds, progress), notes)
            sheets = _accepted(job, denser, notes)
    if not sheets:
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
    seconds: float = 60.0,
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
        As in ``nest``; the seconds are for each material and thickness.
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
    _refuse_doubles(flats)
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
    sheets: list[Sheet] = []
    done = 0
    for (material, thickness), parts in groups.items():
        base = done

        def report(count: int, _: int, base: int = base) -> None:
            if progress is not None:
                progress(base + count, len(flats))

        nested = nest(
            parts,
            stocks[material.name],
            seed=seed,
            seconds=seconds,
            packer=packer,
            progress=report,
            notes=notes,
        )
        stem = _stem(parts, material, thickness)
        sheets += [replace(sheet, name=f"{stem}-{k + 1:02d}") for k, sheet in enumerate(nested)]
        done += len(parts)
    verify_layout(sheets, flats)
    return Nest(tuple(sheets), tuple(notes), print_)


def _accepted(job: Job, layout: list[list[Spot]], notes: list[str]) -> tuple[Sheet, ...]:
    """Return the sheets of a layout that Sparrow had a hand in, or none when it is not sound."""
    sheets = _sheets(job, layout)
    try:
        verify_layout(sheets, job.parts)
    except NestingError as error:
        notes.append(f"Sparrow's layout is not sound ({error}); the parts lie in rows")
        return ()
    return sheets


def _tally(job: Job, layout: list[list[Spot]]) -> tuple[int, float]:
    """What makes a layout good: few sheets, then much left over on the emptiest."""
    return len(layout), min(float(sum(job.areas[i] for i, *_ in sheet)) for sheet in layout)


def _refuse_doubles(parts: Sequence[FlatPart]) -> None:
    seen: set[str] = set()
    for part in parts:
        if part.mark in seen:
            raise NestingError(
                f"the mark {part.mark} is used twice; every part needs a mark of its own"
            )
        seen.add(part.mark)


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


def _sheets(job: Job, layout: list[list[Spot]]) -> tuple[Sheet, ...]:
    """Turn spots of grown contours in the free rectangle into placements on stock sheets."""
    corner = job.stock.margin - job.stock.spacing / 2 - CLEAR
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
                    round(angle % 360.0, 9) % 360.0,
                    round(x + corner, 7),
                    round(y + corner, 7),
                )
                for i, angle, x, y in spots
            ),
        )
        for k, spots in enumerate(layout)
    )

"""Sheets as inline SVG, in millimetres: contours, engraving, marks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

import numpy as np
from numpy.typing import NDArray

from phexfab.fabrication.layout import placed, sheet_yield
from phexfab.fabrication.parts import FlatPart, Placement, Sheet
from phexfab.report.text import number, quantity

FloatArray = NDArray[np.float64]
Engraving = Mapping[str, Sequence[FloatArray]]


def sheet_drawing(sheet: Sheet, flats: Mapping[str, FlatPart], engraving: Engraving) -> str:
    """Return a figure with one sheet, its parts where they are cut.

    Parameters
    ----------
    sheet : Sheet
    flats : mapping of mark to FlatPart
    engraving : mapping of mark to polylines
        In the coordinates of the flat part. It is most of what a sheet holds, so the page carries
        it compressed (``engraved_paths``); parts without any get their mark as text.
    """
    stock = sheet.stock
    border = 0.006 * stock.length
    parts = "\n".join(
        _part(flats[p.mark], p, stock.width, bool(len(engraving.get(p.mark, ()))))
        for p in sheet.placements
    )
    box = " ".join(f"{x:.1f}" for x in (stock.length + 2 * border, stock.width + 2 * border))
    free = (
        f'<rect class="margin" x="{stock.margin:g}" y="{stock.margin:g}" '
        f'width="{stock.length - 2 * stock.margin:g}" '
        f'height="{stock.width - 2 * stock.margin:g}"/>'
    )
    share = sheet_yield(sheet, [flats[p.mark] for p in sheet.placements])
    said = (
        f"{sheet.material.name}, {quantity(sheet.thickness, 'mm')}; "
        f"{number(stock.length)} × {quantity(stock.width, 'mm')}; "
        f"{len(sheet.placements)} parts"
    )
    name = escape(sheet.name)
    return (
        f'<figure class="sheet"><svg viewBox="{-border:.1f} {-border:.1f} {box}" role="img" '
        f'aria-label="{name}"><rect class="stock" width="{stock.length:g}" '
        f'height="{stock.width:g}"/>{free}\n{parts}\n</svg><figcaption><b>{name}</b> '
        f"<span>yield {quantity(round(100 * share), '%')}</span><br>{escape(said)}</figcaption>"
        "</figure>\n"
    )


def engraved_paths(sheets: Sequence[Sheet], engraving: Engraving) -> list[list[str]]:
    """Return the engraving of every part of every sheet as a path in tenths of a millimetre."""
    return [
        [_strokes(engraving.get(p.mark, ()), p, sheet.stock.width) for p in sheet.placements]
        for sheet in sheets
    ]


def _part(flat: FlatPart, spot: Placement, height: float, engraved: bool) -> str:
    outline = _upright(placed(flat.outline, spot), height)
    mark = escape(flat.mark)
    lines = f'<path class="cut" d="{_contour(outline)}"/>'
    if not engraved:
        lines += _label(mark, flat, spot, height)
    return f'<g class="part" data-mark="{mark}"><title>{mark}</title>{lines}</g>'


def _label(mark: str, flat: FlatPart, spot: Placement, height: float) -> str:
    """Return the mark as text along the part, as large as its least width allows."""
    low, high = flat.outline.min(0), flat.outline.max(0)
    size = min(
        0.5 * float((high - low).min()), 1.1 * float(high[0] - low[0]) / len(flat.mark), 70.0
    )
    at = _upright(placed(_middle(flat.outline)[None], spot), height)[0]
    # Upright reading: a part that lies on its head is labelled the other way round.
    turn = (-spot.angle + 90.0) % 180.0 - 90.0
    return (
        f'<text font-size="{size:.1f}" transform="translate({at[0]:.1f} {at[1]:.1f}) '
        f'rotate({turn:.2f})">{mark}</text>'
    )


def _middle(outline: FloatArray) -> FloatArray:
    """Return the centroid of a contour's area."""
    following = np.roll(outline, -1, 0)
    cross = outline[:, 0] * following[:, 1] - following[:, 0] * outline[:, 1]
    return np.asarray(((outline + following) * cross[:, None]).sum(0) / (3 * cross.sum()))


def _upright(points: FloatArray, height: float) -> FloatArray:
    """Return points with y downwards, as SVG counts."""
    return np.column_stack([points[:, 0], height - points[:, 1]])


def _contour(points: FloatArray) -> str:
    rounded = np.round(points, 3) + 0.0  # no −0
    return "M" + "L".join(f"{x:.3f} {y:.3f}" for x, y in rounded.tolist()) + "Z"


def _strokes(strokes: Sequence[FloatArray], spot: Placement, height: float) -> str:
    """Return all polylines as one path in tenths of a millimetre, each step from the last point.

    Whole numbers and small steps make it a third as long; no polylines make an empty path.
    """
    if not len(strokes):
        return ""
    counts = np.array([len(line) for line in strokes], np.int64)
    points = _upright(placed(np.concatenate([np.asarray(s, float) for s in strokes]), spot), height)
    tenths = np.rint(10 * points).astype(np.int64)
    # Steps between rounded points: their errors do not add up.
    steps = np.diff(tenths, axis=0, prepend=np.zeros((1, 2), np.int64))
    words = [f"{x} {y}" if y >= 0 else f"{x}{y}" for x, y in steps.tolist()]
    ends = np.cumsum(counts).tolist()
    starts = [0, *ends[:-1]]
    lines = (
        "m"
        + words[a]
        + "".join(("l" if k == 0 else " ") + w for k, w in enumerate(words[a + 1 : b]))
        for a, b in zip(starts, ends, strict=True)
        if b > a
    )
    return "".join(lines)

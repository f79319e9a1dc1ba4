"""A cut sheet in axes, in millimetres."""

from __future__ import annotations

from typing import TYPE_CHECKING

from phexfab.errors import PhexError
from phexfab.fabrication.layout import sheet_yield
from phexfab.fabrication.marking import marking
from phexfab.fabrication.parts import FlatPart, Sheet
from phexfab.plots.paper import INK, SOFT, axes_or_new, plain
from phexfab.report.figures import draw_sheet
from phexfab.report.text import number, quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from phexfab.pipeline import Build


def plot_sheet(
    build: Build,
    sheet: Sheet | int | str = 0,
    ax: Axes | None = None,
    *,
    engraving: bool = True,
    legend: bool = True,
) -> Axes:
    """Draw a sheet with its parts as they are cut and engraved, and return the axes.

    Parameters
    ----------
    build : Build
    sheet : Sheet, int or str
        One of ``build.sheets``, its place among them, or its name.
    ax : matplotlib Axes, optional
        Where to draw; else in a new figure.
    engraving : bool
        Draw marks, ticks and notes.
    legend : bool
        Say name, material and yield above, and number the axes in mm.

    Returns
    -------
    matplotlib Axes
        In mm, the origin in the sheet's lower left corner.

    Raises
    ------
    PhexError
        If the build has no such sheet; the message lists those it has.
    """
    chosen = _sheet(build, sheet)
    flats: dict[str, FlatPart] = {p.mark: p.flat for p in build.parts.panels}
    flats |= {b.mark: b.flat for b in build.parts.beams}
    marks = [spot.mark for spot in chosen.placements]
    lines = {mark: marking(flats[mark]).lines for mark in marks} if engraving else {}
    stock = chosen.stock
    ax = axes_or_new(ax, (9.0, 1.2 + 8.0 * stock.width / stock.length))
    draw_sheet(ax, chosen, flats, lines)
    rim = 0.01 * stock.length
    ax.set(xlim=(-rim, stock.length + rim), ylim=(-rim, stock.width + rim), aspect="equal")
    if not legend:
        ax.set_axis_off()
        return ax
    share = sheet_yield(chosen, [flats[mark] for mark in marks])
    said = f"{chosen.material.name}, {quantity(chosen.thickness, 'mm')}; {number(len(marks))} parts"
    ax.set_title(chosen.name, loc="left", size=10, color=INK, weight="bold", pad=20)
    words = plain(f"{said}; yield {quantity(round(100 * share), '%')}")
    ax.annotate(
        words, (0, 1), xytext=(0, 6), xycoords="axes fraction", textcoords="offset points",
        size=9, color=SOFT,
    )  # fmt: skip
    ax.set_xlabel("mm", size=9, color=SOFT)
    ax.tick_params(labelsize=8, colors=SOFT, length=3)
    for spine in ax.spines.values():
        spine.set_visible(False)
    return ax


def _sheet(build: Build, sheet: Sheet | int | str) -> Sheet:
    if isinstance(sheet, Sheet):
        return sheet
    for k, one in enumerate(build.sheets):
        if sheet in (k, one.name):
            return one
    names = ", ".join(one.name for one in build.sheets) or "none"
    raise PhexError(f"this build has no sheet {sheet!r}; it has {len(build.sheets)}: {names}")

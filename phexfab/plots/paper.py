"""What all plots share: axes to draw in, and a scale bar."""

from __future__ import annotations

from typing import TYPE_CHECKING

from phexfab.report.charts import round_step
from phexfab.report.text import quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INK, SOFT, LINE = "#1c242c", "#5d6872", "#dfe2e4"
PASS, FAIL = "#2c7351", "#b3261e"


def axes_or_new(ax: Axes | None, size: tuple[float, float]) -> Axes:
    """Return the axes given, or those of a new pyplot figure of a size in inches."""
    if ax is not None:
        return ax
    from matplotlib import pyplot

    made: Axes = pyplot.figure(figsize=size, layout="constrained").add_subplot()
    return made


def scale_bar(ax: Axes, least: float, fontsize: float = 9.0) -> None:
    """Draw a bar of a round length, no shorter than ``least`` mm, in the lower left corner."""
    length = round_step(least)
    (left, right), (low, high) = ax.get_xlim(), ax.get_ylim()
    x, y = left + 0.025 * (right - left), low + 0.04 * (high - low)
    tick = 0.008 * (high - low)
    ax.plot([x, x, x + length, x + length], [y + tick, y, y, y + tick], color=INK, lw=1.0)
    shown = quantity(length / 1000, "m") if length >= 1000 else quantity(length, "mm")
    ax.text(
        x + length / 2, y + tick, plain(shown), ha="center", va="bottom", color=INK, size=fontsize
    )


def plain(text: str) -> str:
    """Return text with spaces that every font has."""
    return text.replace("\u202f", "\u00a0")

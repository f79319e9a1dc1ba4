"""The poster of a design: one call, one A3 page."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from phexfab.errors import PhexError
from phexfab.plots.paper import FAIL, INK, LINE, SOFT, plain
from phexfab.plots.sheets import plot_sheet
from phexfab.report.fields import RAMP, panel_fields, shell_view
from phexfab.report.figures import gauss_picture
from phexfab.report.scene import assembly_layers
from phexfab.report.shade import picture
from phexfab.report.summary import key_figures
from phexfab.report.text import number, quantity
from phexfab.whole import whole

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from phexfab.pipeline import Build

WIDTH, HEIGHT, RIM = 420.0, 297.0, 18.0  # mm: A3 across
COLUMN = 92.0  # mm: the column at the right
DPI = 200
NO_STAMP: dict[str, dict[str, Any]] = {
    ".png": {"Software": None},
    ".pdf": {"Creator": None, "Producer": None, "CreationDate": None},
    ".svg": {"Creator": None, "Date": None, "Format": None, "Type": None},
}
"""What each kind of file would say of the day and the library that made it."""
SERIF = "STIXGeneral"  # comes with matplotlib: the same on every machine
SANS = "DejaVu Sans"


def poster(build: Build, path: str | os.PathLike[str]) -> Path:
    """Write the poster of a design: the shell large, its Gauss image, a sheet, key figures.

    A3 across, 200 dots per inch. The same build gives the same bytes, and the file appears whole
    or not at all.

    Parameters
    ----------
    build : Build
    path : path
        Ends in ``.png``, ``.pdf`` or ``.svg``; of the last two, words and lines are not pixels.

    Raises
    ------
    PhexError
        If the ending is another one.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    target = Path(path)
    ending = target.suffix.lower()
    if ending not in NO_STAMP:
        raise PhexError(f"a poster ends in .png, .pdf or .svg; {target.name} does not")
    with _style():
        figure = Figure(figsize=(WIDTH / 25.4, HEIGHT / 25.4), dpi=DPI, facecolor="white")
        FigureCanvasAgg(figure)
        _compose(figure, build)
        with whole(target) as draft:
            figure.savefig(draft, format=ending[1:], dpi=DPI, metadata=NO_STAMP[ending])
    return target


@contextmanager
def _style() -> Iterator[None]:
    """Set what files depend on, whatever the reader's own settings are."""
    from matplotlib import rc_context, rcParamsDefault

    own = {
        "font.family": SANS,
        "svg.hashsalt": "phexfab",
        "svg.fonttype": "path",
        "pdf.fonttype": 42,
        "text.color": INK,
        "axes.linewidth": 0.6,
    }
    settings: dict[Any, Any] = {**rcParamsDefault, **own}
    for key in [key for key in settings if key.startswith("backend")]:
        del settings[key]
    with rc_context(settings):
        yield


def _compose(figure: Figure, build: Build) -> None:
    right = WIDTH - RIM - COLUMN
    base = 30.0  # mm: where the pictures end and the key figures begin
    _hero(figure, build, (RIM, base + 22, right - RIM - 12, HEIGHT - base - 22 - 52))
    _head(figure, build)
    _gauss(figure, build, (right, HEIGHT - 52 - 108, COLUMN, COLUMN + 14))
    _sheet(figure, build, (right, base + 22, COLUMN, HEIGHT - 52 - 108 - base - 30))
    _figures(figure, build, base)
    failed = sum(not check.ok for check in build.checks)
    total = len(build.checks)
    says = f"{failed} of {total} checks fail" if failed else f"All {total} checks keep their limits"
    _say(figure, RIM, 12, says, size=9, color=FAIL if failed else SOFT)
    about = build.design.project
    signed = ", ".join(
        word for word in (about.author, about.date.isoformat() if about.date else "") if word
    )
    _say(figure, WIDTH - RIM, 12, signed, size=9, color=SOFT, ha="right")


def _head(figure: Figure, build: Build) -> None:
    size = min(54.0, 54.0 * 34 / max(len(build.design.name), 34))
    _say(figure, RIM - 0.6, HEIGHT - 37, build.design.name, size=size, family=SERIF)
    _rule(figure, HEIGHT - 45)


def _hero(figure: Figure, build: Build, box: tuple[float, float, float, float]) -> None:
    size = (_dots(box[2]), _dots(box[3]))
    layers = assembly_layers(build.parts)
    image = picture(layers, size, shell_view(build.shell), ground=True, margin=0.03)
    _paste(figure, image, box)


def _gauss(figure: Figure, build: Build, box: tuple[float, float, float, float]) -> None:
    x, y, wide, tall = box
    fields = panel_fields(build.shell)
    if not fields:
        return
    side = tall - 14
    image = gauss_picture(
        build.shell, fields[0].colours, (_dots(side),) * 2, shell_view(build.shell)
    )
    _paste(figure, image, (x + wide - side, y + 14, side, side))
    low, high = (plain(quantity(limit, fields[0].unit, 3)) for limit in fields[0].limits)
    from matplotlib.colors import LinearSegmentedColormap

    ramp = LinearSegmentedColormap.from_list("phexfab", RAMP)
    bar = figure.add_axes(_share((x + wide - side, y + 9, side, 1.8)))
    bar.imshow(np.linspace(0, 1, 256)[None], cmap=ramp, aspect="auto")
    bar.set_axis_off()
    _say(figure, x + wide - side, y + 4.6, low, size=7.5, color=SOFT)
    _say(figure, x + wide, y + 4.6, high, size=7.5, color=SOFT, ha="right")
    words = f"Gauss image, by {fields[0].name}"
    _say(figure, x + wide - side / 2, y + 0.4, words, size=7.5, color=SOFT, ha="center")


def _sheet(figure: Figure, build: Build, box: tuple[float, float, float, float]) -> None:
    if not build.sheets:
        return
    x, y, wide, tall = box
    sheet = build.sheets[0]
    room = (wide, min(tall - 6, wide * (sheet.stock.width / sheet.stock.length) * 1.02))
    axes = figure.add_axes(_share((x, y + 6, *room)))
    axes.set_anchor("SE")
    plot_sheet(build, sheet, axes, legend=False)
    more = f", the first of {number(len(build.sheets))}" if len(build.sheets) > 1 else ""
    words = f"Sheet {sheet.name}{more}"
    _say(figure, x + wide, y + 1.5, words, size=7.5, color=SOFT, ha="right")


def _figures(figure: Figure, build: Build, y: float) -> None:
    _rule(figure, y + 12)
    figures = key_figures(build.shell, build.parts, len(build.sheets))
    # Each stands as far from the next as its own words are long.
    widths = np.array(
        [max(len(value) + 0.6 * len(unit), len(name)) for name, value, unit in figures]
    )
    room = WIDTH - 2 * RIM
    starts = RIM + room * np.concatenate([[0], np.cumsum(widths + 4)[:-1]]) / (widths + 4).sum()
    for x, (name, value, unit) in zip(starts, figures, strict=True):
        _say(figure, x, y + 4, name, size=8.5, color=SOFT)
        shown = _say(figure, x - 0.3, y - 6, plain(value), size=25, family=SERIF)
        if unit:
            end = shown.get_window_extent().x1 / DPI * 25.4
            _say(figure, end + 1.5, y - 6, unit, size=9, color=SOFT)


def _say(figure: Figure, x: float, y: float, words: str, **style: Any) -> Any:
    """Write words with their baseline at a place in mm from the lower left corner."""
    return figure.text(x / WIDTH, y / HEIGHT, words, va="baseline", **style)


def _rule(figure: Figure, y: float) -> None:
    from matplotlib.lines import Line2D

    ends = np.array([RIM, WIDTH - RIM]) / WIDTH
    figure.add_artist(Line2D(ends, [y / HEIGHT] * 2, color=LINE, lw=0.8))


def _paste(figure: Figure, image: np.ndarray, box: tuple[float, float, float, float]) -> None:
    """Lay a picture on the page, pixel for pixel."""
    axes = figure.add_axes(_share(box))
    axes.set_axis_off()
    flat = image[..., :3] + (1 - image[..., 3:])
    pixels = (np.clip(flat, 0, 1) * 255 + 0.5).astype(np.uint8)
    axes.imshow(pixels, aspect="auto", interpolation="antialiased")


def _share(box: tuple[float, float, float, float]) -> tuple[float, float, float, float]:
    x, y, wide, tall = box
    return (x / WIDTH, y / HEIGHT, wide / WIDTH, tall / HEIGHT)


def _dots(length: float) -> int:
    """Return how many pixels a length in mm has on the page."""
    return round(length / 25.4 * DPI)

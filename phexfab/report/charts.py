"""Histograms as inline SVG."""

from __future__ import annotations

import math
from html import escape

import numpy as np
from numpy.typing import NDArray

from phexfab.report.text import label, number, quantity

FloatArray = NDArray[np.float64]

_WIDTH, _HEIGHT = 320, 150
_LEFT, _RIGHT, _TOP, _BOTTOM = 34, 12, 10, 26
_BINS = 24


def bins(values: FloatArray) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return round bin edges, about two dozen bins or fewer for few values, and the counts.

    Parameters
    ----------
    values : (n,) array
        Finite, at least one.
    """
    low, high = float(values.min()), float(values.max())
    size = max(abs(low), abs(high))
    if high - low <= 1e-9 * size or high == low:
        half = 0.05 * size or 0.5
        return np.array([low - half, low + half]), np.array([len(values)])
    wanted = min(_BINS, max(4, math.ceil(2 * math.sqrt(len(values)))))
    step = round_step((high - low) / wanted)
    first, last = math.floor(low / step), math.floor(high / step) + 1
    # By bin number, so that a value on an edge goes up for every step alike.
    place = np.clip(np.floor(values / step).astype(np.int64) - first, 0, last - first - 1)
    counts = np.bincount(place, minlength=last - first).astype(np.int64)
    return np.asarray(np.arange(first, last + 1) * step, float), counts


def round_step(least: float) -> float:
    """Return the smallest of 1, 2, 2.5, 5 times a power of ten that is no less."""
    power = 10.0 ** math.floor(math.log10(least))
    return power * min(m for m in (1, 2, 2.5, 5, 10) if m * power >= least * (1 - 1e-9))


def histogram(name: str, values: FloatArray, unit: str) -> str:
    """Return a figure with the histogram of values and a line about them.

    Parameters
    ----------
    name : str
    values : array
        What is not finite is counted in the caption and left out of the chart.
    unit : str
    """
    everything = np.asarray(values, float).ravel()
    finite = everything[np.isfinite(everything)]
    lost = len(everything) - len(finite)
    missing = f" · {number(lost)} not a number" if lost else ""
    if not len(finite):
        return _figure(name, f"no values{missing}", "")
    low, middle, high = np.quantile(finite, [0, 0.5, 1]).tolist()
    span = f"{number(low)} – {quantity(high, unit)} · median {quantity(middle, unit)}"
    return _figure(name, escape(span) + missing, _bars(name, finite, unit))


def _figure(name: str, said: str, drawing: str) -> str:
    caption = f"<figcaption><b>{label(name)}</b><br>{said}</figcaption>"
    return f'<figure class="chart">{drawing}{caption}</figure>\n'


def _bars(name: str, values: FloatArray, unit: str) -> str:
    edges, counts = bins(values)
    ticks = [number(edge) for edge in edges.tolist()]
    wide = _WIDTH - _LEFT - _RIGHT
    tall = _HEIGHT - _TOP - _BOTTOM
    peak = int(counts.max())
    step = max(1, int(round_step(peak / 3)))
    across = (edges - edges[0]) / (edges[-1] - edges[0]) * wide + _LEFT
    base = _HEIGHT - _BOTTOM
    lines = []
    for count in range(0, peak + 1, step):
        y = base - tall * count / peak
        lines.append(
            f'<path class="grid" d="M{_LEFT} {y:.1f}H{_WIDTH - _RIGHT}"/>'
            f'<text x="{_LEFT - 5}" y="{y + 3.5:.1f}" text-anchor="end">{number(count)}</text>'
        )
    for k, count in enumerate(counts.tolist()):
        if count:
            x, y = across[k] + 0.5, base - tall * count / peak
            width = max(across[k + 1] - across[k] - 1, 0.5)
            span = escape(f"{ticks[k]} – {quantity(float(edges[k + 1]), unit)}: {number(count)}")
            lines.append(
                f'<rect class="bar" x="{x:.2f}" y="{y:.2f}" width="{width:.2f}" '
                f'height="{base - y:.2f}"><title>{span}</title></rect>'
            )
    every = max(1, math.ceil((len(edges) - 1) / 4))
    for k in range(0, len(edges), every):
        lines.append(
            f'<text x="{across[k]:.1f}" y="{base + 15}" text-anchor="middle">{ticks[k]}</text>'
        )
    last = (
        f'<text x="{_WIDTH - 2}" y="{_HEIGHT - 1}" text-anchor="end">{escape(_name(unit))}</text>'
    )
    return (
        f'<svg viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" '
        f'aria-label="{escape(name)}">{"".join(lines)}{last}</svg>'
    )


def _name(unit: str) -> str:
    return {"1": "", "deg": "degrees"}.get(unit, unit)

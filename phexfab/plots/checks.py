"""The checks of a build in axes: how much of its limit each one uses."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from phexfab.fabrication.parts import CheckResult
from phexfab.plots.paper import FAIL, INK, LINE, PASS, SOFT, axes_or_new, plain
from phexfab.report.text import quantity

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from phexfab.pipeline import Build

LEAST, MOST = 1e-4, 30.0  # shares of a limit that the axis shows


def plot_checks(build: Build, ax: Axes | None = None) -> Axes:
    """Draw each check as the share of its limit that it uses, and return the axes.

    A bar that reaches the line at 1 fails. The axis is logarithmic; what uses less than a
    ten-thousandth of its limit is a bar of no length, and a limit of 0 is kept or not.

    Parameters
    ----------
    build : Build
    ax : matplotlib Axes, optional
        Where to draw; else in a new figure.
    """
    checks = build.checks
    ax = axes_or_new(ax, (9.0, 0.9 + 0.27 * len(checks)))
    shares = np.clip([share_of_limit(check) for check in checks], LEAST, MOST)
    rows = np.arange(len(checks))
    colours = [PASS if check.ok else FAIL for check in checks]
    ax.barh(rows, shares - LEAST, left=LEAST, height=0.62, color=colours, alpha=0.85)
    ax.axvline(1.0, color=INK, lw=1.0)
    ax.set(xscale="log", xlim=(LEAST, MOST), ylim=(len(checks) - 0.4, -0.6))
    ax.set_yticks(rows, [_words(check.name) for check in checks], size=8.5)
    for row, check in zip(rows, checks, strict=True):
        sign = "≤" if check.sense == "<=" else "≥"
        value, limit = (quantity(float(v), check.unit, 3) for v in (check.value, check.limit))
        text = f"{value} {sign} {limit}" + (f", {check.worst}" if check.worst else "")
        ax.annotate(
            plain(text), (1.02, row), xycoords=("axes fraction", "data"), va="center", size=8,
            color=SOFT if check.ok else FAIL, annotation_clip=False,
        )  # fmt: skip
    ax.set_xticks(
        [1e-4, 1e-3, 1e-2, 0.1, 1, 10], ["0.01 %", "0.1 %", "1 %", "10 %", "100 %", "×10"]
    )
    ax.set_xlabel("share of the limit", size=9, color=SOFT)
    ax.tick_params(axis="x", which="minor", length=0)
    ax.tick_params(colors=SOFT, labelsize=8.5, length=0)
    ax.tick_params(axis="y", labelcolor=INK)
    ax.grid(axis="x", color=LINE, lw=0.6)
    ax.set_axisbelow(True)
    for spine in ax.spines.values():
        spine.set_visible(False)
    return ax


def share_of_limit(check: CheckResult) -> float:
    """Return the share of its limit that a check uses: above 1 it fails, NaN counts as infinite.

    A limit of 0, and a value or limit below 0, leave no ratio: such a check uses nothing or all.
    """
    value, limit = float(check.value), float(check.limit)
    if not check.ok and (np.isnan(value) or limit <= 0 or value <= 0):
        return float("inf")
    if check.sense == "<=":
        return max(value, 0.0) / limit if limit > 0 else 0.0
    return limit / value if limit > 0 and value > 0 else 0.0


def _words(name: str) -> str:
    words = name.replace("_", " ")
    return words[:1].upper() + words[1:]

"""Make the picture of the page on rims: python docs/figures_rims.py"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from make_figures import ACCENT, FOLDER, INK, SOFT, save

from phexfab.surface.rims.corners import corner_points
from phexfab.surface.rims.rim import Rim

TURN = 2.0 * np.pi
CANOPY = np.array([[0.0, 0, 0], [12000, 0, 3000], [12000, 9000, 0], [0, 9000, 4000]])


def rims_figure() -> None:
    """A canopy sharp and rounded, corners among points, and how interpolation converges."""
    figure = plt.figure(figsize=(11, 3.6))
    grid = figure.add_gridspec(1, 3, width_ratios=[1.25, 1, 1.1])
    one = figure.add_subplot(grid[0], projection="3d")
    sharp = Rim.through(CANOPY, corners=range(4))
    t = np.linspace(0.0, 1.0, 1201)
    one.plot(*sharp.point(t).T, color=SOFT, lw=1.2)
    one.plot(*sharp.smoothed(4000.0).point(t).T, color=ACCENT, lw=1.8)
    one.plot(*sharp.point(sharp.corners).T, "o", ms=4, color=INK)
    one.set_box_aspect((12, 9, 4.5), zoom=1.1)
    one.view_init(30, -62)
    one.set_title("corners kept, or rounded within 4 m", fontsize=9)
    one.axis("off")

    two = figure.add_subplot(grid[1])
    a = np.linspace(-np.pi / 2, np.pi / 2, 9)
    x = np.linspace(-2.4, 0.4, 8)[:-1]
    points = np.concatenate(
        [
            np.stack([x, -1.0 + 0.0 * x], axis=1),
            np.stack([0.4 + np.cos(a), np.sin(a)], axis=1),
            np.stack([x[::-1], 1.0 + 0.0 * x], axis=1),
            [[-2.05, 0.5], [-1.7, 0.0], [-2.05, -0.5]],
        ]
    )
    points = 1000.0 * np.column_stack([points, np.zeros(len(points))])
    corners = corner_points(points)
    rim = Rim.through(points, corners.tolist())
    two.plot(*rim.point(t)[:, :2].T, color=ACCENT, lw=1.8)
    two.plot(*points[:, :2].T, "o", ms=3.5, color=SOFT)
    two.plot(*points[corners, :2].T, "o", ms=5, color=INK)
    two.set(aspect="equal")
    two.set_title("corners recognised among points", fontsize=9)
    two.axis("off")

    three = figure.add_subplot(grid[2])
    counts = 2 ** np.arange(4, 10)
    for warp, colour, text in ((0.0, ACCENT, "even spacing"), (0.08, INK, "spacing 1 : 3")):
        errors = [_error(int(n), warp) for n in counts]
        three.loglog(counts, errors, "o-", ms=3, lw=1.2, color=colour, label=text)
    guide = counts[2:].astype(float)
    three.loglog(guide, 0.15 * (guide / guide[0]) ** -6.0, "--", lw=1, color=SOFT)
    three.text(guide[1], 0.02, "rate 6", color=SOFT)
    three.set_xticks(counts, [str(n) for n in counts])
    three.minorticks_off()
    three.set(xlabel="points on a rim of 8 m", ylabel="distance from the exact curve, mm")
    three.legend(frameon=False)
    save("rims")


def _curve(t: np.ndarray) -> np.ndarray:
    a = TURN * t
    return 1000.0 * np.stack([np.cos(a), 1.3 * np.sin(a), 0.3 * np.cos(3 * a)], axis=-1)


def _slope(t: np.ndarray) -> np.ndarray:
    a = TURN * t
    return 1000.0 * TURN * np.stack([-np.sin(a), 1.3 * np.cos(a), -0.9 * np.sin(3 * a)], axis=-1)


def _error(n: int, warp: float) -> float:
    """Greatest distance (mm) of a rim through n points from the exact curve."""
    u = np.arange(n) / n
    points = Rim.through(_curve(u + warp * np.sin(TURN * u))).samples(400)[1]
    dense = np.arange(4000) / 4000
    t = dense[np.argmin(np.linalg.norm(points[:, None] - _curve(dense)[None], axis=2), axis=1)]
    for _ in range(20):
        slope = _slope(t)
        t -= np.sum((_curve(t) - points) * slope, axis=1) / np.sum(slope**2, axis=1)
    return float(np.linalg.norm(_curve(t) - points, axis=1).max())


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    rims_figure()

"""Make the picture of the page on soap films: python docs/figures_plateau.py"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from make_figures import ACCENT, FOLDER, INK, SOFT, save

from phexfab.surface.disc_films.extension import ExtendedFilm, film_with_margin
from phexfab.surface.disc_films.plateau import plateau
from phexfab.surface.rims.rim import Rim


def canopy() -> Rim:
    """12 × 9 m, four corners of unequal heights, curved sides."""
    high = np.array([[0, 0, 0], [12, 0, 3], [12, 9, 0.5], [0, 9, 4.0]])
    middle = high.mean(axis=0)
    points = []
    for a, b in zip(high, np.roll(high, -1, axis=0), strict=True):
        u = np.linspace(0, 1, 13)[:-1, None]
        points.append(a + (b - a) * u + (middle - 0.5 * (a + b)) * 0.6 * u * (1 - u))
    return Rim.through(1000 * np.concatenate(points), corners=[0, 12, 24, 36])


def lobed(lobes: int, height: float) -> Rim:
    """A circle of 5 m radius that goes up and down."""
    angle = 2 * np.pi * np.arange(512) / 512
    up = height * np.cos(lobes * angle)
    return Rim.through(5000 * np.stack([np.cos(angle), np.sin(angle), up], -1))


def draw(axes: plt.Axes, wide: ExtendedFilm, title: str) -> None:
    """The film, its rim, and the margin beyond it."""
    border = wide.domain.borders(640)[0]
    arms = np.append(border, border[0]) - wide.domain.centre
    rings = wide.domain.centre + np.linspace(0, 1, 41)[:, None] * arms
    x, y, z = np.moveaxis(wide.surface.point(rings), -1, 0)
    axes.plot_surface(x, y, z, rstride=2, cstride=16, color="#f6efe2", edgecolor=SOFT, lw=0.25)
    rim = np.vstack([wide.film.points, wide.film.points[:1]])
    axes.plot(*rim.T, color=ACCENT, lw=1.6, zorder=5)
    axes.set_box_aspect([np.ptp(v) for v in (x, y, z)], zoom=1.12)
    axes.view_init(48, -62)
    axes.set_axis_off()
    axes.set_title(title, fontsize=9, y=0.96)


def film_figure() -> None:
    """Two films with their margins, and how the error falls."""
    figure = plt.figure(figsize=(11, 3.8))
    for k, (rim, margin, title) in enumerate(
        [
            (canopy(), 900.0, "a canopy of 12 × 9 m, four corners"),
            (lobed(3, 0.2), 900.0, "three lobes, one umbilic"),
        ]
    ):
        wide = film_with_margin(rim, margin)
        axes = figure.add_subplot(1, 3, k + 1, projection="3d", computed_zorder=False)
        draw(axes, wide, f"{title}\nrim met to {wide.rim_distance:.1g} mm")
    axes = figure.add_subplot(1, 3, 3)
    cases = [("three lobes", lobed(3, 0.3), ACCENT, "o-"), ("canopy", canopy(), INK, "s--")]
    for name, rim, colour, style in cases:
        counts = np.array(
            [64, 80, 96, 112, 128, 160, 192] if name != "canopy" else [96, 128, 192, 256, 384, 512]
        )
        exact = plateau(rim, samples=1024).area
        errors = [abs(plateau(rim, samples=int(n)).area / exact - 1) for n in counts]
        axes.loglog(counts, np.maximum(errors, 1e-15), style, ms=4, color=colour, label=name)
    axes.set(xlabel="samples of the rim", ylabel="relative error of area")
    axes.set_xticks([64, 128, 256, 512], ["64", "128", "256", "512"])
    axes.minorticks_off()
    axes.legend(frameon=False)
    save("film")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    film_figure()

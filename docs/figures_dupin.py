"""Make the picture of the page on Dupin duality: python docs/figures_dupin.py"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from make_figures import ACCENT, INK, SOFT, save
from matplotlib.collections import PolyCollection

from phexfab.remesh.dupin.duality import dupin_conic, dupin_indicatrix, star_hexagon
from phexfab.remesh.dupin.ideal import ideal_triangle
from phexfab.remesh.dupin.planar import dupin_hexagons
from phexfab.remesh.triangulations.valid import prespecified_conjugation
from phexfab.surface.freeform.surface import ParametricSurface, nurbs


def star(axes: plt.Axes, kappa: tuple[float, float], title: str) -> None:
    """Draw an ideal triangle star, its Dupin hexagon, and the conic through one triangle."""
    triangle = ideal_triangle([0.0, 0.0], [1.0, 0.15], kappa)
    a, b = triangle[1], triangle[2]
    ring = np.array([a, b, b - a, -a, -b, a - b])
    conic = dupin_conic(triangle, kappa)
    for curve in dupin_indicatrix(np.asarray(kappa) / conic.level):
        bend = (np.asarray(kappa) * curve**2).sum(1) / conic.level
        if (bend > 0).all():
            axes.plot(*(curve + conic.centre).T, color=SOFT, lw=1.2)
    axes.plot(*np.concatenate([ring, ring[:1]]).T, color=INK, lw=0.8)
    for point in ring:
        axes.plot([0, point[0]], [0, point[1]], color=INK, lw=0.8)
    hexagon = star_hexagon(triangle, kappa)
    axes.fill(*hexagon.T, fc=ACCENT, alpha=0.35, ec=ACCENT, lw=1.6)
    axes.plot(*conic.centre, "o", ms=4, color=ACCENT)
    axes.set(aspect="equal", xlim=(-1.7, 1.7), ylim=(-1.7, 1.7))
    axes.axis("off")
    axes.set_title(title, fontsize=9)


def roof() -> ParametricSurface:
    """A vault of 14 × 10 m with bumps across it."""
    x, y = np.meshgrid(np.linspace(0, 14000, 12), np.linspace(0, 10000, 9), indexing="ij")
    wave = np.cos(3 * np.pi * x / 14000 + 0.4) * (1 + 0.3 * np.cos(np.pi * y / 10000))
    z = 1500 * np.sin(np.pi * y / 10000) + 400 * wave
    knots = [np.repeat(np.linspace(0, 1, n - 2), [4, *[1] * (n - 4), 4]) for n in (12, 9)]
    return nurbs(np.stack([x, y, z], -1), (knots[0], knots[1]), (3, 3), name="roof")


def dupin_figure() -> None:
    """Stars for both signs of K, and hexagons on a roof on which K changes its sign."""
    figure = plt.figure(figsize=(11, 4.0))
    grid = figure.add_gridspec(1, 3, width_ratios=[1, 1, 1.5])
    star(figure.add_subplot(grid[0]), (1.0, 0.6), "K > 0: affinely regular")
    star(figure.add_subplot(grid[1]), (-1.0, 0.6), "K < 0: quasi-regular")
    axes = figure.add_subplot(grid[2])
    triangulation = prespecified_conjugation(roof(), 350.0)
    made = dupin_hexagons(triangulation, crossing="drop")
    bending = triangulation.surface.bending(triangulation.parameters[made.points])
    shade = bending.gauss / np.percentile(np.abs(bending.gauss), 90)
    plan = [made.mesh.polygon(f)[:, :2] for f in range(made.mesh.n_faces)]
    faces = PolyCollection(plan, array=np.clip(shade, -1, 1), cmap="RdBu", ec=INK, lw=0.4)
    faces.set_clim(-1.6, 1.6)
    axes.add_collection(faces)
    axes.autoscale()
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_title("a spline roof from above: blue K > 0, red K < 0", fontsize=9)
    save("dupin")


if __name__ == "__main__":
    dupin_figure()

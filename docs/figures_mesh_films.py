"""Make the picture of the page on films on meshes: python docs/figures_mesh_films.py"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from make_figures import ACCENT, INK, save
from mpl_toolkits.mplot3d.art3d import Poly3DCollection
from scipy.optimize import brentq

from phexfab.surface.mesh_films.atlas import atlas
from phexfab.surface.mesh_films.descent import descend
from phexfab.surface.mesh_films.margin import mesh_film_with_margin
from phexfab.surface.mesh_films.mesh_film import MeshFilm, mesh_film
from phexfab.surface.mesh_films.mirror import Mirror, held_border
from phexfab.surface.mesh_films.start import start_mesh
from phexfab.surface.rims.rim import Rim

R = 1000.0


def ring(centre: np.ndarray, axis: np.ndarray, radius: float = R, lift: float = 0.0) -> Rim:
    """Return a ring about an axis, lifted along it three times around."""
    one = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    one /= np.linalg.norm(one)
    two = np.cross(axis, one)

    def point(t: np.ndarray) -> np.ndarray:
        a = 2 * np.pi * np.asarray(t)[..., None]
        return centre + radius * (np.cos(a) * one + np.sin(a) * two) + lift * np.cos(3 * a) * axis

    def slope(t: np.ndarray) -> np.ndarray:
        a = 2 * np.pi * np.asarray(t)[..., None]
        turn = radius * (np.cos(a) * two - np.sin(a) * one)
        return 2 * np.pi * (turn - 3 * lift * np.sin(3 * a) * axis)

    return Rim.of(point, slope)


def draw(axes: plt.Axes, film: MeshFilm, title: str) -> None:
    """Draw a film's triangles, shaded, and its rims."""
    corner = film.points[film.triangles]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    light = 0.45 + 0.55 * np.abs(normal @ np.array([0.4, -0.5, 0.77]))
    colours = np.clip(light[:, None] * np.array([0.97, 0.9, 0.78]), 0, 1)
    axes.add_collection3d(Poly3DCollection(corner, fc=colours, ec=(0, 0, 0, 0.25), lw=0.25))
    for rim in film.rims:
        line = rim.point(np.linspace(0, 1, 400))
        axes.plot(*line.T, color=ACCENT, lw=1.6)
    low, high = film.points.min(axis=0), film.points.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=1.15)
    axes.axis("off")
    axes.set_title(title, fontsize=9, y=1.02)


def convergence(axes: plt.Axes) -> None:
    """Plot the errors of the catenoid film against the mesh width."""
    neck = brentq(lambda a: a * np.cosh(0.5 / a) - 1, 0.56, 1.0) * R
    up = np.array([0.0, 0.0, 1.0])
    rims = ring(-500 * up, up), ring(500 * up, up)
    widths = np.array([250.0, 180.0, 125.0, 90.0, 62.0, 45.0])
    rows = []
    for edge in widths:
        start = start_mesh(rims, edge)
        held = held_border(start.points, start.triangles, ())
        least = descend(start.points, start.triangles, held, name="film")
        film = mesh_film(rims, edge)
        row = []
        for charts in (atlas(least.points, least.triangles), film.atlas):
            at = charts.parameter_of_vertex(np.arange(charts.n_charts))
            x, y, z = charts.charts.origin.T
            bend = charts.surface.principal_curvatures(at)[:, 1]
            row += [np.abs(np.hypot(x, y) - neck * np.cosh(z / neck)).max() / R]
            row += [np.abs(bend * neck * np.cosh(z / neck) ** 2 - 1).max()]
        rows.append(row)
    least_x, least_k, film_x, film_k = np.array(rows).T
    axes.loglog(widths / R, least_k, "--", color=INK, lw=1, label="curvature, least area only")
    axes.loglog(widths / R, least_x, "--", color=ACCENT, lw=1, label="position, least area only")
    axes.loglog(widths / R, film_k, "o-", color=INK, ms=3, label="curvature")
    axes.loglog(widths / R, film_x, "o-", color=ACCENT, ms=3, label="position")
    axes.set_xlabel("edge / radius", fontsize=8)
    axes.set_title("catenoid between rings: largest relative error", fontsize=9)
    axes.tick_params(labelsize=7)
    axes.legend(fontsize=7, frameon=False, loc="lower right")
    axes.grid(alpha=0.25, which="both", lw=0.4)


def main() -> None:
    """Make the picture."""
    figure = plt.figure(figsize=(11, 7))
    angle = 2 * np.pi * np.arange(3) / 3
    ways = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    three = mesh_film(tuple(ring(900 * way, way) for way in ways), 130.0)
    up = np.array([0.0, 0.0, 1.0])
    court = mesh_film((ring(0 * up, up, 6000.0, 900.0), ring(2200 * up, up, 2000.0)), 450.0)
    wide = mesh_film_with_margin(court, 700.0)
    half, whole = np.pi / 2 * R, np.pi * R
    corners = [[half] * 3, [0, whole, half], [0, half, whole]]
    mirrors = (Mirror([0, 0, 0], [1, 0, 0]),)
    cell = mesh_film((Rim.through(corners, corners=range(3)),), 160.0, mirrors=mirrors)
    for k, (film, title, view) in enumerate(
        [
            (three, "three rings", (28, 20)),
            (wide, f"a court, its margin; rims met to {wide.off_rim:.2f} mm", (38, -60)),
            (cell, "a Schwarz P patch, its curved side free in a mirror", (15, 20)),
        ]
    ):
        axes = figure.add_subplot(2, 3, (1, 2, 4)[k], projection="3d")
        axes.view_init(*view)
        draw(axes, film, title)
    convergence(figure.add_subplot(2, 3, (5, 6)))
    axes = figure.add_subplot(2, 3, 3, projection="3d")
    axes.view_init(28, 30)
    tetra = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
    four = mesh_film(tuple(ring(900 * way, way, 800.0) for way in tetra), 110.0)
    draw(axes, four, "four rings")
    save("mesh-films")


if __name__ == "__main__":
    main()

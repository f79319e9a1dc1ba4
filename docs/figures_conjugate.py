"""Make the pictures of conjugate-curves.md and planar-quads.md: python docs/figures_conjugate.py"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from figures_dupin import roof
from make_figures import ACCENT, FOLDER, INK, SOFT, save
from matplotlib.collections import PolyCollection
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.conjugate.fields import level_family, principal_family
from phexfab.remesh.conjugate.hexagons import conjugate_hexagons
from phexfab.remesh.quads.planar_quads import principal_quads
from phexfab.surface.freeform.surface import ParametricSurface, parametric


def solid(
    axes: plt.Axes, mesh: PolyMesh, shade: np.ndarray, view: tuple[int, int], zoom: float
) -> None:
    """Draw faces in space."""
    faces = [mesh.polygon(f) for f in range(mesh.n_faces)]
    colours = plt.get_cmap("RdBu")(0.5 + 0.35 * np.clip(shade, -1, 1))
    axes.add_collection3d(Poly3DCollection(faces, fc=colours, ec=INK, lw=0.35))
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=zoom)
    axes.view_init(*view)
    axes.axis("off")


def bricks(axes: plt.Axes) -> None:
    """What bricks become for five values of q."""
    for k, q in enumerate((1.3, 1 / 3, 0.0, -1 / 3, -1.3)):
        side, top = 0.5 * (1 - q), 0.5 * (1 + q)
        x = np.array([-0.5, 0.0, 0.5, 0.5, 0.0, -0.5])
        y = 0.8 * np.array([-side, -top, -side, side, top, side])
        good = abs(q) < 1
        axes.fill(x + 1.35 * k, y, fc=ACCENT if good else "none", alpha=0.3)
        axes.plot(
            np.append(x, x[0]) + 1.35 * k,
            np.append(y, y[0]),
            color=ACCENT if good else SOFT,
            lw=1.5,
        )
        brick = np.array([[-0.5, -0.4], [0.5, -0.4], [0.5, 0.4], [-0.5, 0.4], [-0.5, -0.4]])
        axes.plot(brick[:, 0] + 1.35 * k, brick[:, 1], "--", color=INK, lw=0.6)
        axes.text(1.35 * k, -1.25, f"q = {q:.2g}", ha="center", fontsize=8)
    axes.set(aspect="equal", ylim=(-1.4, 1.15))
    axes.axis("off")
    axes.set_title("a brick becomes a simple hexagon while |q| < 1", fontsize=9)


def torus() -> ParametricSurface:
    """A torus of 12 m across."""

    def point(u: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, ...]:
        reach = 4200.0 + 1700.0 * np.cos(v)
        return reach * np.cos(u), reach * np.sin(u), 1700.0 * np.sin(v)

    turn = 2 * np.pi
    return parametric(point, (0, turn, 0, turn), periodic=(True, True), name="torus")


def dome() -> ParametricSurface:
    """The top of an ellipsoid, between its umbilics."""

    def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.asarray(3e3 * np.sqrt(1 - (x / 6e3) ** 2 - (y / 4e3) ** 2))

    box = (-3800.0, 3800.0, -2400.0, 2400.0)
    return parametric(lambda x, y: (x, y, height(x, y)), box, name="dome")


def conjugate_figure() -> None:
    """The condition on sampling, a roof of both signs of K, a torus."""
    figure = plt.figure(figsize=(11, 3.4))
    grid = figure.add_gridspec(2, 3, width_ratios=[1.15, 1.35, 1.2], height_ratios=[1, 1])
    bricks(figure.add_subplot(grid[:, 0]))
    axes = figure.add_subplot(grid[:, 1])
    surface = roof()
    made = conjugate_hexagons(surface, level_family(lambda p: p[:, 0]), 450.0)
    mesh = made.mesh
    middle = np.array([mesh.polygon(f).mean(axis=0) for f in range(mesh.n_faces)])
    gauss = surface.bending(surface.nearest(middle)).gauss
    shade = np.clip(gauss / np.percentile(np.abs(gauss), 90), -1, 1)
    plan = [mesh.polygon(f)[:, :2] for f in range(mesh.n_faces)]
    faces = PolyCollection(plan, array=shade, cmap="RdBu", ec=INK, lw=0.4)
    faces.set_clim(-1.6, 1.6)
    axes.add_collection(faces)
    axes.autoscale()
    axes.set(aspect="equal")
    axes.axis("off")
    axes.set_title(f"spline roof, K of both signs: {mesh.n_faces} hexagons", fontsize=9)
    axes = figure.add_subplot(grid[:, 2], projection="3d")
    surface = torus()
    made = conjugate_hexagons(surface, principal_family(), 700.0)
    q = made.bricks.crossing_numbers[made.faces]
    solid(axes, made.mesh, 2 * q, (48, -60), 1.35)
    axes.set_title(f"torus, closed both ways: {made.mesh.n_faces} hexagons", fontsize=9)
    save("conjugate-curves")


def quads_figure() -> None:
    """One coarse net; circular, conical; planar on a roof."""
    figure = plt.figure(figsize=(11, 2.8))
    for k, (kind, levels) in enumerate((("circular", 0), ("circular", 2), ("conical", 2))):
        axes = figure.add_subplot(1, 3, k + 1, projection="3d")
        made = principal_quads(dome(), 350.0 if levels else 1400.0, kind, levels=levels)
        solid(axes, made.mesh, np.full(made.mesh.n_faces, 0.25), (38, -65), 1.05)
        axes.set_title(f"{kind}: {made.mesh.n_faces} quads, {made.exactness:.0e}", fontsize=9)
    save("planar-quads")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    conjugate_figure()
    quads_figure()

"""Make the picture of the page on planarising: python docs/figures_planarise.py"""

from __future__ import annotations

from dataclasses import replace

import matplotlib.pyplot as plt
import numpy as np
from make_figures import FOLDER, INK
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from phexfab.mesh.measures import mean_edge, relative_planarity
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import tangent_shell
from phexfab.remesh.lattice import lattice
from phexfab.remesh.planarity.planarise import planarise
from phexfab.surface import surface


def planarise_figure() -> None:
    """A noisy mesh of hourglass hexagons, and the nearest planar one, by planarity."""
    smooth = surface("enneper").scaled(1000.0)
    exact = tangent_shell(smooth, lattice(smooth.rectangle, 0.12)).mesh
    noise = np.random.default_rng(3).normal(size=exact.vertices.shape)
    mesh = replace(exact, vertices=exact.vertices + 0.03 * mean_edge(exact) * noise)
    found = planarise(mesh)
    norm, colours = LogNorm(1e-16, 1.0), plt.get_cmap("YlOrBr")
    figure = plt.figure(figsize=(10, 4.4))
    report = found.report
    before = f"before: up to {report.planarity_before:.0e} of the mean edge"
    after = f"after {found.steps} steps: {report.planarity_after:.0e}"
    for place, (shown, title) in enumerate([(mesh, before), (found.mesh, after)]):
        axes = figure.add_subplot(1, 2, place + 1, projection="3d")
        draw(axes, shown, colours(norm(np.maximum(relative_planarity(shown), 1e-16))))
        axes.set_title(title, fontsize=9)
    bar = figure.colorbar(
        ScalarMappable(norm, colours), ax=figure.axes, shrink=0.6, orientation="vertical"
    )
    bar.set_label("corner off its face's plane / mean edge", fontsize=8)
    bar.ax.tick_params(labelsize=8)
    plt.savefig(FOLDER / "planarise.png", metadata={"Software": None}, bbox_inches="tight")
    plt.close()


def draw(axes: plt.Axes, mesh: PolyMesh, colours: np.ndarray) -> None:
    """Draw the faces in their colours."""
    polygons = [mesh.polygon(f) for f in range(mesh.n_faces)]
    axes.add_collection3d(Poly3DCollection(polygons, facecolors=colours, edgecolors=INK, lw=0.4))
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    axes.set_box_aspect(high - low, zoom=1.15)
    axes.view_init(32, -60)
    axes.axis("off")


if __name__ == "__main__":
    planarise_figure()

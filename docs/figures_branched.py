"""Make the picture of branched circle packings and holes: python docs/figures_branched.py"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from make_figures import ACCENT, FOLDER, INK, SOFT
from matplotlib.collections import EllipseCollection
from matplotlib.colors import to_rgb
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from phexfab.minimal.gauss_image import gauss_image
from phexfab.minimal.shell import minimal_shell
from phexfab.minimal.sphere import farthest_direction, rotation_to_north
from phexfab.remesh.lattice import Lattice
from phexfab.remesh.seamless.grow import grow_lattice
from phexfab.surface.classical import enneper
from phexfab.surface.domain import Disc
from phexfab.surface.weierstrass import MinimalSurface


def packing(smooth: MinimalSurface, on: Lattice) -> tuple[np.ndarray, np.ndarray]:
    """Centres and radii of the edge type's circles in the plane, from their planes."""
    z = on.points if on.parameters is None else on.parameters
    normals, heights = gauss_image(smooth, on, z, "edge")
    turned = normals @ rotation_to_north(farthest_direction(normals)).T
    # The circle n·x = h of the sphere, projected from the north pole.
    down = heights - turned[:, 2]
    return (turned[:, 0] + 1j * turned[:, 1]) / down, np.sqrt(1 - heights**2) / down


def main() -> None:
    """Draw a monkey saddle with its packing of two sheets, and a packing around a hole."""
    figure = plt.figure(figsize=(12, 4.1))
    smooth = enneper(2).scaled(1000.0)
    on = grow_lattice(smooth, Disc(0, 0.72), panel_size=70.0, kind="edge")
    shell = minimal_shell(smooth, on, "edge")
    ax = figure.add_subplot(1, 3, 1, projection="3d", computed_zorder=False)
    nine = np.diff(shell.rings[1]) > 6
    light = np.array([0.2, -0.45, -0.87])
    shade = 0.72 + 0.28 * np.abs(shell.normals[shell.panels] @ light)
    colours = np.where(nine[:, None], to_rgb(ACCENT), to_rgb("#efe4cf")) * shade[:, None]
    faces = [shell.mesh.polygon(f) for f in range(shell.mesh.n_faces)]
    ax.add_collection3d(Poly3DCollection(faces, facecolors=colours, edgecolors=INK, lw=0.6))
    low, high = shell.mesh.vertices.min(0), shell.mesh.vertices.max(0)
    middle, half = (low + high) / 2, (high - low).max() / 2
    for name, m in zip("xyz", middle, strict=True):
        getattr(ax, f"set_{name}lim")(m - half, m + half)
    ax.set_box_aspect((1, 1, 1), zoom=1.5)
    ax.view_init(elev=62, azim=-75)
    ax.set_axis_off()
    ax.set_title("M: hexagons, and one 9-gon at the umbilic", fontsize=9)

    ax = figure.add_subplot(1, 3, 2)
    centres, radii = packing(smooth, on)
    # Which of the two sheets: arg z over (0, π) or (π, 2π) makes a full turn of g = z².
    second = np.angle(on.parameters) < -1e-9
    _circles(ax, centres[second], radii[second], ACCENT, 0.4, edge=0.0)
    _circles(ax, centres[~second], radii[~second], ACCENT, 0.0, edge=0.9)
    branch = np.argmin(np.abs(on.parameters))
    _circles(ax, centres[[branch]], radii[[branch]], INK, 0.8)
    ax.set_title("its circles touch on two sheets (filled, drawn) that wind around one", fontsize=9)

    ax = figure.add_subplot(1, 3, 3)
    ring = grow_lattice(
        smooth, Disc(0, 1.0, holes=((0.52 + 0.2j, 0.2),)), panel_size=50.0, kind="edge"
    )
    centres, radii = packing(smooth, ring)
    right = np.abs(np.angle(ring.parameters * np.exp(-0.4j))) < np.pi / 2
    _circles(ax, centres[right], radii[right], SOFT, 0.55)
    ax.set_title("one sheet, cut along a ray: circles close around a hole", fontsize=9)
    figure.subplots_adjust(0.0, 0.01, 1.0, 0.92, wspace=0.02)
    figure.savefig(FOLDER / "branched-packing.png", dpi=110, metadata={"Software": None})


def _circles(
    ax: plt.Axes,
    centres: np.ndarray,
    radii: np.ndarray,
    colour: str,
    alpha: float,
    edge: float = 0.5,
) -> None:
    size = 2 * radii
    ax.add_collection(
        EllipseCollection(
            size,
            size,
            0 * size,
            units="xy",
            offsets=np.column_stack([centres.real, centres.imag]),
            transOffset=ax.transData,
            facecolor=(*to_rgb(colour), alpha),
            edgecolor=INK,
            linewidth=edge,
        )
    )
    reach = 1.03 * (np.abs(centres) + radii).max()
    if len(centres) > 1:
        ax.set(xlim=(-reach, reach), ylim=(-reach, reach))
    ax.set_aspect("equal")
    ax.set_axis_off()


if __name__ == "__main__":
    main()

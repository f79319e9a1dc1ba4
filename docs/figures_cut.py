"""Make the pictures on cut borders: python docs/figures_cut.py"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from make_figures import ACCENT, FOLDER, INK, SOFT, save

from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.border import Border
from phexfab.parallel.cut import cut_shell
from phexfab.parallel.shell import Shell
from phexfab.surface import MinimalSurface
from phexfab.surface.catalog import surface

PAPER, SAND = "#f0e6d2", "#e6cda6"
TURN = np.linspace(0.0, 2 * np.pi, 1600, endpoint=False)


def border(smooth: MinimalSurface, w: np.ndarray, corners: tuple[int, ...] = ()) -> Border:
    """Return a border that is drawn in curvature-line coordinates."""
    z = smooth.parameter(w)
    return Border(smooth.point(z), smooth.normal(z), np.array(corners, int))


def draw(axis: plt.Axes, shell: Shell, borders: list[Border], tilt: float) -> np.ndarray:
    """Draw a shell in parallel projection, cut panels darker; return the map to the picture."""
    t = np.radians(tilt)
    view = np.array([[1.0, 0, 0], [0, np.cos(t), np.sin(t)]])
    mesh = shell.mesh
    depth = mesh.vertices @ np.array([0.0, -np.sin(t), np.cos(t)])
    touched = np.zeros(mesh.n_faces, bool)
    touched[mesh.face_of_corner[shell.parents[shell.rings[3]] < 0]] = True
    flat = mesh.vertices @ view.T
    for f in sorted(range(mesh.n_faces), key=lambda f: depth[mesh.face(f)].mean()):
        ring = flat[np.append(mesh.face(f), mesh.face(f)[:1])]
        axis.fill(ring[:, 0], ring[:, 1], fc=SAND if touched[f] else PAPER, ec=INK, lw=0.5)
    for one in borders:
        line = np.vstack([one.points, one.points[:1]]) @ view.T
        axis.plot(line[:, 0], line[:, 1], color=ACCENT, lw=0.6)
    axis.set_aspect("equal")
    axis.axis("off")
    return view


def cut_borders_figure() -> None:
    """A ring, a corner with its node axes, and a catenoid between two planes."""
    axes = plt.subplots(1, 3, figsize=(12.0, 4.6))[1]
    smooth = surface("enneper").scaled(5000.0)
    whole = minimal_shell(smooth, lattice_on(smooth, 260.0), "edge")
    borders = [
        border(smooth, 0.52 * np.exp(1j * TURN)),
        border(smooth, 0.2 * np.exp(-1j * TURN)),
    ]
    made = cut_shell(whole, borders)
    draw(axes[0], made.shell, borders, 0.0)
    axes[0].set_title(
        f"{made.report.panels} panels, {made.report.cut} cut\n"
        f"border within {made.report.rim_distance:.0f} mm, axes within "
        f"{made.report.ruling_angle:.0f}°",
        fontsize=9,
    )

    share = np.arange(400) / 400
    tips = 0.45 * np.exp(0.3j) * np.array([-1 - 1j, 1 - 1j, 1 + 1j, -1 + 1j])
    sides = (tips[:, None] * (1 - share) + np.roll(tips, -1)[:, None] * share).ravel()
    square = border(smooth, sides, (0, 400, 800, 1200))
    made = cut_shell(whole, [square], depth=150.0)
    view = draw(axes[1], made.shell, [square], 35.0)
    rim = made.shell.rim_vertices
    low = made.shell.mesh.vertices[rim] @ view.T
    high = low + 180.0 * made.shell.gauss.vertices[rim] @ view.T
    for a, b in zip(low, high, strict=True):
        axes[1].plot(*zip(a, b, strict=True), color=SOFT, lw=0.8)
    corner = low[np.argmax(low[:, 0])]
    axes[1].set(xlim=(corner[0] - 1300, corner[0] + 300), ylim=(corner[1] - 1200, corner[1] + 100))
    axes[1].set_title("node axes along the border\nlie in the planes of the cut", fontsize=9)

    ring = surface("catenoid").scaled(3000.0)
    box = (-1.0, 1.0, -np.pi, np.pi)
    whole = minimal_shell(ring, lattice_on(ring, 620.0, rectangle=box, closed=True), "face")
    borders = [border(ring, 0.4 + 1j * TURN), border(ring, -0.4 - 1j * TURN)]
    made = cut_shell(whole, borders)
    draw(axes[2], made.shell, borders, 65.0)
    axes[2].set_title("planar borders: one plane each,\nno bend between corners", fontsize=9)
    save("cut-borders")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    cut_borders_figure()

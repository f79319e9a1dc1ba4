"""Make the pictures of the pages: python docs/make_figures.py"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from phexfab.minimal.shell import minimal_shell, surface_distance
from phexfab.parallel.curvature import minimality
from phexfab.remesh.lattice import EQUILATERAL, lattice
from phexfab.surface.catalog import surface

FOLDER = Path(__file__).parent / "img"
INK, ACCENT, SOFT = "#1d2733", "#b3542e", "#8fa3b5"
plt.rcParams.update(
    {
        "font.family": "DejaVu Sans",
        "font.size": 9,
        "axes.edgecolor": INK,
        "axes.labelcolor": INK,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "svg.hashsalt": "phexfab",
        "savefig.dpi": 160,
    }
)


def lattice_figure() -> None:
    """The lattice in curvature-line coordinates beside the hexagons it makes on the surface."""
    smooth = surface("enneper").scaled(1000.0)
    on = lattice((-0.45, 0.45, -0.39, 0.39), 0.15)
    shell = minimal_shell(smooth, on, "face")
    left, right = plt.subplots(1, 2, figsize=(9, 4.1))[1]
    w = on.points
    left.triplot(w.real, w.imag, on.triangles, color=SOFT, lw=0.8)
    border = np.setdiff1d(np.arange(len(w)), shell.panels)
    left.plot(w[shell.panels].real, w[shell.panels].imag, "o", ms=5, color=ACCENT)
    left.plot(w[border].real, w[border].imag, "o", ms=5, mfc="white", mec=INK)
    for angle in (45, 135):
        t = np.radians(angle)
        left.plot(*np.array([[-0.5, 0.5]]) * [[np.cos(t)], [np.sin(t)]], "--", lw=0.8, color=INK)
    label = {"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none"}
    left.text(
        0.2, -0.2, "asymptotic", rotation=-45, ha="center", va="center", fontsize=8, bbox=label
    )
    left.set(
        xlabel="u", ylabel="v", aspect="equal", title="lattice points: panels and border planes"
    )
    mesh = shell.mesh
    for f in range(mesh.n_faces):
        ring = np.vstack([mesh.polygon(f), mesh.polygon(f)[:1]])
        right.fill(ring[:, 0], ring[:, 1], fc="#f0e6d2", ec=INK, lw=0.9)
    chosen = mesh.polygon(mesh.n_faces // 2)
    right.fill(chosen[:, 0], chosen[:, 1], fc=ACCENT, ec=INK, lw=0.9)
    right.set(
        xlabel="x, mm", ylabel="y, mm", aspect="equal", title="planar hexagons, seen from above"
    )
    save("lattice")


def convergence_figure() -> None:
    """Distance to the smooth surface falls with rate 2; the mean curvature is zero throughout."""
    left, right = plt.subplots(1, 2, figsize=(9, 3.6))[1]
    for name, colour in (("enneper", ACCENT), ("helicoid", INK), ("scherk-1", SOFT)):
        smooth = surface(name).scaled(1000.0)
        faces, distance, curvature = [], [], []
        for columns in (8, 16, 32, 64):
            a = 1.2 / columns
            rise = a * EQUILATERAL
            rows = int(1.2 / (1.2 / 8 * EQUILATERAL)) // 2 * 2 * columns // 8
            box = (-0.6, 0.6, -rows * rise / 2, rows * rise / 2)
            shell = minimal_shell(smooth, lattice(box, a), "edge")
            faces.append(len(shell.panels))
            distance.append(surface_distance(smooth, shell).max())
            curvature.append(minimality(shell).max())
        left.loglog(faces, distance, "o-", ms=4, color=colour, label=name)
        right.loglog(faces, curvature, "o-", ms=4, color=colour, label=name)
    guide = np.array([60.0, 4000.0])
    left.loglog(guide, 60 / guide * distance[0] * 1.6, "--", lw=0.8, color=INK)
    left.annotate("∝ panel size²", (500, 60 / 500 * distance[0] * 1.9), fontsize=8)
    left.set(xlabel="panels", ylabel="mm from the smooth surface")
    right.axhline(1e-10, ls="--", lw=0.8, color=INK)
    right.annotate("limit of the check", (60, 1.4e-10), fontsize=8)
    right.set(xlabel="panels", ylabel="largest |H|/√|K|", ylim=(1e-16, 1e-9))
    left.legend(frameon=False)
    save("convergence")


def save(name: str) -> None:
    """Write the current figure."""
    plt.tight_layout()
    plt.savefig(FOLDER / f"{name}.png", metadata={"Software": None})
    plt.close()


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    lattice_figure()
    convergence_figure()

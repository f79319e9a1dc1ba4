"""Make the pictures of the pages on curvature and duality: python docs/figures_curvature.py"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from make_figures import ACCENT, FOLDER, INK, SOFT, save
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.associate import associate
from phexfab.minimal.christoffel import split_coefficients
from phexfab.minimal.shell import minimal_shell, tangent_shell
from phexfab.parallel.curvature import shell_curvatures
from phexfab.remesh.lattice import lattice
from phexfab.surface.catalog import surface
from phexfab.triangular import EQUILATERAL


def curvature_figure() -> None:
    """The faces of M, S and an offset, and how curvatures converge."""
    one, two, three = plt.subplots(
        1, 3, figsize=(11, 3.5), gridspec_kw={"width_ratios": [1, 1, 1.25]}
    )[1]
    smooth = surface("enneper").scaled(1000.0)
    shell = minimal_shell(smooth, lattice((-0.5, 0.5, -0.5, 0.5), 0.25), "edge")
    face = int(np.argmin(np.linalg.norm(shell.points[shell.panels], axis=1)))
    normal = shell.normals[shell.panels[face]]
    x = np.cross([0.0, 1.0, 0.0], normal)
    x /= np.linalg.norm(x)
    frame = np.column_stack([x, np.cross(normal, x)])

    def flat(mesh: PolyMesh) -> np.ndarray:
        polygon = mesh.polygon(face)
        return (polygon - polygon.mean(axis=0)) @ frame

    m, s = flat(shell.mesh), 230.0 * flat(shell.gauss)
    for axes, polygon, title in (
        (one, m, "a face of M, and of M + d·S at ±60 mm"),
        (two, s, "its face of S: mixed area 0"),
    ):
        axes.fill(*polygon.T, fc="#f0e6d2" if axes is one else "#d8e2ea", ec=INK, lw=1.2)
        axes.set(aspect="equal")
        axes.set_title(title, fontsize=9)
        axes.axis("off")
    for d in (-60.0, 60.0):
        ring = m + d / 230.0 * s
        one.plot(*np.vstack([ring, ring[:1]]).T, "--", lw=1, color=ACCENT)
    for name, colour in (("enneper", ACCENT), ("catenoid", INK)):
        made = surface(name).scaled(1000.0)
        steps = 0.16 / 2.0 ** np.arange(5)
        worst = []
        for step in steps:
            u0, u1, v0, v1 = made.rectangle
            u, v, half = (u0 + u1) / 2, (v0 + v1) / 2, (0.64, 0.64 * EQUILATERAL)
            on = lattice((u - half[0], u + half[0], v - half[1], v + half[1]), step)
            start = tangent_shell(made, on, "edge")
            kappa = made.principal_curvatures(start.parameters[start.panels])
            kappa = kappa / (1 - 80.0 * kappa)
            found = shell_curvatures(start.with_heights(start.heights + 80.0 * start.gauss_heights))
            worst.append(
                (
                    np.abs(found.mean - kappa.mean(axis=1)).max() * 1e3,
                    np.abs(found.gaussian - kappa.prod(axis=1)).max() * 1e6,
                )
            )
        h, k = np.array(worst).T
        three.loglog(steps, k, "o-", ms=4, color=colour, label=f"{name}, K in 1/m²")
        three.loglog(steps, h, "s--", ms=4, color=colour, label=f"{name}, H in 1/m")
    three.loglog(steps, 30 * steps**2, ":", color=SOFT)
    three.annotate("∝ step²", (steps[2], 30 * steps[2] ** 2), fontsize=8, ha="right", va="bottom")
    three.set(xlabel="lattice step", title="largest error on the parallel surface at 80 mm")
    three.title.set_fontsize(9)
    three.legend(frameon=False, fontsize=7)
    save("curvature")


def christoffel_figure() -> None:
    """A hexagon and its dual by two quads; and the associate family of a Koebe mesh."""
    figure = plt.figure(figsize=(11, 3.6))
    corner = np.exp(1j * (np.pi * np.arange(6) / 3 + 0.3)) * np.array([1, 1.1, 0.95, 1, 1.05, 0.9])
    hexagon = np.column_stack([corner.real, corner.imag, np.zeros(6)])
    mesh = PolyMesh.from_faces(hexagon, [range(6)])
    c = split_coefficients(mesh, 1)
    dual = np.vstack(
        [np.zeros(3), np.cumsum(c[:, None] * (np.roll(hexagon, -1, axis=0) - hexagon), axis=0)]
    )[:6]
    dual *= 1.15 * np.ptp(hexagon) / np.ptp(dual)
    for k, (polygon, title) in enumerate(
        ((hexagon, "a hexagon of S"), (dual, "its dual, a panel"))
    ):
        axes = figure.add_subplot(1, 5, k + 1)
        axes.fill(*polygon[:, :2].T, fc="#d8e2ea" if k == 0 else "#f0e6d2", ec=INK, lw=1.2)
        # Cut beside edge 1: from corner 0 to corner 3; non-corresponding diagonals are parallel.
        axes.plot(*polygon[[0, 3], :2].T, "--", color=INK, lw=0.9)
        axes.plot(*polygon[[0, 2], :2].T, color=ACCENT if k == 0 else SOFT, lw=1.3)
        axes.plot(*polygon[[1, 3], :2].T, color=SOFT if k == 0 else ACCENT, lw=1.3)
        for j, point in enumerate(polygon[:, :2]):
            axes.annotate(str(j), point, fontsize=8, xytext=(3, 3), textcoords="offset points")
        axes.set(aspect="equal")
        axes.set_title(title, fontsize=9)
        axes.axis("off")
    made = surface("catenoid").scaled(1000.0)
    shell = minimal_shell(made, lattice((-1.0, 1.0, -3.0, 3.0), 0.25, rows_along="v"), "edge")
    for k, angle in enumerate((0.0, 45.0, 90.0)):
        axes = figure.add_subplot(1, 5, k + 3, projection="3d")
        turned = associate(shell, angle)
        points = turned.vertices - turned.vertices.mean(axis=0)
        polygons = [points[face] for face in turned.faces]
        normal = shell.normals[shell.panels]
        light = 0.6 + 0.4 * np.abs(normal @ np.array([0.3, -0.8, 0.5]))
        base = np.array([0.94, 0.88, 0.76])
        axes.add_collection3d(
            Poly3DCollection(
                polygons, facecolors=np.clip(base * light[:, None], 0, 1), edgecolors=INK, lw=0.4
            )
        )
        reach = np.abs(points).max() * 0.72
        axes.set(xlim=(-reach, reach), ylim=(-reach, reach), zlim=(-reach, reach))
        axes.set_box_aspect((1, 1, 1), zoom=1.12)
        axes.view_init(18, -60)
        axes.set_axis_off()
        axes.set_title(f"θ = {angle:g}°", fontsize=9)
    save("christoffel")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    curvature_figure()
    christoffel_figure()

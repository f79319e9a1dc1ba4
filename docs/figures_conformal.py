"""Make the pictures on conformal hexagons and surveyed methods: python docs/figures_conformal.py"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from figures_constructions import panels
from make_figures import ACCENT, FOLDER, INK, SOFT, save

from phexfab.mesh.measures import simple_faces
from phexfab.remesh.conformal.dual import christoffel_dual
from phexfab.remesh.conformal.hexagons import complete_hexagon, dual_hexagon
from phexfab.remesh.conformal.planar import (
    conformal_hexagon,
    on_sphere,
    planar_conformal_mesh,
    ring_tilt,
)
from phexfab.remesh.survey.by_parallel_meshes import parallel_mesh_on
from phexfab.remesh.survey.power_diagram import power_diagram_on
from phexfab.remesh.survey.projective_dual import projective_dual_mesh
from phexfab.remesh.survey.support_function import support_function_mesh
from phexfab.surface.freeform.surface import parametric

PAPER = "#f0e6d2"


def outline(axis, z, colour, dashed) -> None:
    """Draw a hexagon with its corners' numbers and its diagonal z0 z3."""
    ring = np.append(z, z[0])
    axis.plot(ring.real, ring.imag, "-", color=colour, lw=1.4)
    axis.plot(z[[0, 3]].real, z[[0, 3]].imag, "--", color=dashed, lw=0.9)
    middle = z.mean()
    for k, corner in enumerate(z):
        place = middle + 1.14 * (corner - middle)
        axis.text(place.real, place.imag, str(k), ha="center", va="center", fontsize=7)
    axis.set_aspect("equal")
    axis.axis("off")


def conformal_figure() -> None:
    """A hexagon and its dual; a mesh of each case; the last on the sphere, and its dual."""
    figure = plt.figure(figsize=(11.5, 4.6))
    z = complete_hexagon(1.0, 0.45 + 0.85j, -0.9, 0.3 - 0.9j)
    first = figure.add_subplot(2, 4, 1)
    outline(first, z, INK, SOFT)
    first.set_title("conformal hexagon", pad=14)
    second = figure.add_subplot(2, 4, 5)
    outline(second, dual_hexagon(z), ACCENT, SOFT)
    second.set_title("its dual: every edge parallel", pad=14)
    cases = (
        ("case 1: z", conformal_hexagon()[0], 8, 7, False),
        ("case 2: exp(az), 16 around", conformal_hexagon(ring_tilt(16))[0], 16, 8, True),
        ("case 3: exp((a+ib)z)", conformal_hexagon(0.1 + 0.07j)[0], 14, 10, False),
    )
    for k, (title, hexagon, columns, rows, closed) in enumerate(cases):
        flat = planar_conformal_mesh(hexagon, columns, rows, closed=closed)
        axis = figure.add_subplot(2, 4, 2 + k)
        points = flat.points
        for f in range(flat.mesh.n_faces):
            ring = points[flat.mesh.face(f)]
            axis.fill(ring.real, ring.imag, fc=PAPER, ec=INK, lw=0.5)
        axis.set(aspect="equal", title=title)
        axis.axis("off")
        size = (0.4, 1.0, 1.0)[k] / np.median(np.abs(points - points.mean()))
        gauss = on_sphere(flat, size=size)
        dual = christoffel_dual(gauss, flat.twice)
        view = figure.add_subplot(2, 4, 6 + k, projection="3d")
        panels(view, dual, [PAPER] * dual.n_faces)
        view.view_init((25, 12, 20)[k], (-60, -60, 30)[k])
        view.set_title("Christoffel dual of its image on the sphere", fontsize=8)
    save("conformal-hexagons")


def torus(low, high, half):
    """Return a part of a torus of radii 1000 and 400 mm."""

    def place(u, v):
        reach = 1000 + 400 * np.cos(v)
        return reach * np.cos(u), reach * np.sin(u), 400 * np.sin(v)

    return parametric(place, (-half, half, low, high), name="torus")


def survey_figure() -> None:
    """One example of each method, and what its limits look like."""

    def ellipsoid(x, y):
        return 1500 * x, 1000 * y, 700 * np.sqrt(1 - x * x - y * y)

    def monkey(x, y):
        return 1000 * x, 1000 * y, 1000 * (x**3 - 3 * x * y * y) / 3

    def cap(x, y):
        return 1000 * x, 1000 * y, 1000 * np.sqrt(1 - x * x - y * y)

    def saddle(x, y):
        return 1000 * x, 1000 * y, 1000 * x * y

    dome = parametric(ellipsoid, (-0.6, 0.6, -0.6, 0.6), name="ellipsoid")
    part = parametric(monkey, (0.35, 1.0, -0.35, 0.35), name="monkey saddle")
    sphere = parametric(cap, (-0.6, 0.6, -0.6, 0.6), name="sphere cap")
    flat = parametric(saddle, (-0.8, 0.8, -0.8, 0.8), name="hyperbolic paraboloid")
    start = support_function_mesh(flat, 120.0)
    other = parametric(
        lambda x, y: (1000 * x, 1000 * y, 700 * x * y + 150 * x * x), (-1.2, 1.2, -1.2, 1.2)
    )
    off = [0.0, 0.0, 880.0]
    shown = (
        ("power diagram: ellipsoid", power_diagram_on(dome, 110.0), (50, -70)),
        (
            "projective duality: torus, outside",
            projective_dual_mesh(torus(-1.0, 1.0, 0.9), 100.0).shell,
            (10, -20),
        ),
        (
            "projective duality of a sphere,\nbad centre: crossing faces",
            projective_dual_mesh(sphere, 110.0, centre=off, crossing=True).shell,
            (60, -70),
        ),
        (
            "support function: torus, inside",
            support_function_mesh(torus(2.3, 3.98, 0.9), 80.0),
            (25, -150),
        ),
        ("support function: monkey saddle", support_function_mesh(part, 50.0), (55, -70)),
        (
            "parallel meshes: one saddle's\npanels on another",
            parallel_mesh_on(start, other, drop=True).shell,
            (40, -70),
        ),
    )
    figure = plt.figure(figsize=(11.5, 6.4))
    for k, (title, shell, view) in enumerate(shown):
        axis = figure.add_subplot(2, 3, k + 1, projection="3d")
        good = simple_faces(shell.mesh)
        panels(axis, shell.mesh, np.where(good, PAPER, ACCENT))
        axis.view_init(*view)
        axis.set_title(title, fontsize=9)
    save("survey-methods")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    conformal_figure()
    survey_figure()

"""Make the picture of one page: python docs/figures_umbilics.py"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from figures_constructions import ACCENT, PAPER, panels, save

from phexfab.minimal.laplacian import solve_minimal
from phexfab.parallel.shell import Shell
from phexfab.remesh.lattice import Lattice
from phexfab.remesh.seamless.coordinate import seamless
from phexfab.remesh.seamless.grow import lattice_of
from phexfab.surface.catalog import surface
from phexfab.surface.construct import from_weierstrass
from phexfab.surface.domain import Disc
from phexfab.surface.weierstrass import MinimalSurface

P = np.polynomial.polynomial


def with_umbilics(zeros: list[complex]) -> MinimalSurface:
    """The surface f = 1, g' = Π (z - zero)."""
    slope = P.polyfromroots(zeros).astype(complex)
    g = P.polyint(slope)
    square = P.polymul(g, g)
    parts = [0.5 * P.polysub([1], square), 0.5j * P.polyadd([1], square), g]
    curves = [P.polyint(part) for part in parts]
    return from_weierstrass(
        lambda z: P.polyval(z, g),
        np.ones_like,
        gauss_map_derivative=lambda z: P.polyval(z, slope),
        null_curve=lambda z: np.stack([P.polyval(z, c) for c in curves], -1),
        base=0.0123 + 0.0213j,
        scale=1000.0,
    )


def face_shell(smooth: MinimalSurface, on: Lattice) -> Shell:
    """The discrete minimal surface of the face type."""
    z = on.points
    normals, points = smooth.normal(z), smooth.point(z)
    heights = np.einsum("ij,ij->i", normals, points)
    ones = np.ones(len(z))
    return solve_minimal(
        Shell(normals, heights, ones, on.triangles, "face", points, on.step, parameters=z)
    )


def umbilics() -> None:
    """An umbilic of order 2, three simple ones, and two under one panel."""
    figure = plt.figure(figsize=(10, 3.4))
    three = [0.5, -0.3 + 0.4j, -0.3 - 0.4j]
    pair = [0.08 * np.exp(0.3j), -0.08 * np.exp(0.3j)]
    cases = [
        (surface("enneper", order=3).scaled(1000.0), 42.0, 0.9, "order 2: a 12-gon"),
        (with_umbilics(three), 33.0, 1.0, "three of order 1:\n9-gons on one lattice"),
        (with_umbilics(pair), 55.0, 1.0, "two nearer than panels:\none 12-gon covers both"),
    ]
    for k, (smooth, size, radius, title) in enumerate(cases):
        shell = face_shell(smooth, lattice_of(seamless(smooth, Disc(0, radius), panel_size=size)))
        axes = figure.add_subplot(1, 3, k + 1, projection="3d")
        panels(axes, shell.mesh, np.where(shell.mesh.sides > 6, ACCENT, PAPER))
        axes.view_init(52, -75)
        axes.set_title(title, fontsize=9)
    save("umbilics")


if __name__ == "__main__":
    umbilics()

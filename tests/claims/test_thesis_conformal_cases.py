"""Thesis §7.2.1: z, e^{az} and e^{(a+ib)z} come out of the minimal solve as exact special cases.

The Christoffel dual in closed form (§5.3.3) is computed edge by edge and never touches the solver.
"""

import numpy as np
import pytest

from phexfab.errors import MeshError
from phexfab.minimal.conformal import (
    christoffel_dual,
    conformal_gauss_image,
    conformal_hexagon,
    ring_tilt,
)
from phexfab.minimal.gauss_image import gauss_image
from phexfab.minimal.laplacian import mixed_area_matrix, solve_minimal
from phexfab.parallel.curvature import minimality, mixed_areas
from phexfab.parallel.offset import offset_defect
from phexfab.remesh.lattice import lattice
from phexfab.surface.catalog import surface

CASES = {
    "case 1, Enneper": {"columns": 14, "rows": 12, "size": 0.08},
    "case 2, catenoid": {"columns": 20, "rows": 9, "tilt": ring_tilt(20), "closed": True},
    "case 2, dilation": {"columns": 14, "rows": 12, "tilt": 0.12j, "size": 3.0},
    "case 3, helicoid": {"columns": 14, "rows": 12, "tilt": 0.1 + 0.07j, "size": 0.7},
}


def heights_from(shell, points):
    """Face heights of a mesh given by its vertices, and how far faces are from planar."""
    low = np.full(len(shell.normals), np.inf)
    high = -low
    triangles = shell.triangles[shell.used_vertices]
    for k in range(3):
        value = np.einsum("ij,ij->i", shell.normals[triangles[:, k]], points)
        np.minimum.at(low, triangles[:, k], value)
        np.maximum.at(high, triangles[:, k], value)
    return low, high


@pytest.mark.parametrize("case", CASES)
def test_solve_reproduces_the_closed_form_dual(case):
    shell, twice = conformal_gauss_image(**CASES[case])
    assert offset_defect(shell).max() < 1e-14
    points = christoffel_dual(shell, twice)
    low, high = heights_from(shell, points)
    known = np.isfinite(low)
    size = np.abs(points).max()
    assert (high - low)[known].max() < 1e-13 * size
    start = np.where(known, low, 0.0)
    matrix = mixed_area_matrix(shell)
    assert np.abs(matrix @ start).max() < 1e-13 * np.abs(matrix).max() * np.abs(start).max()
    start[shell.panels] = 0.0  # the solver sees the border only
    solved = solve_minimal(shell.with_heights(start))
    assert np.abs(solved.heights - low)[known].max() < 1e-12 * size
    assert np.abs(solved.mesh.vertices - points).max() < 1e-11 * size
    assert minimality(solved).max() < 1e-11
    assert mixed_areas(solved, points, points).min() > 0


@pytest.mark.parametrize("tilt", [0, 0.3, 0.2j, 0.25 - 0.4j])
def test_the_starting_hexagon_is_conformal_and_circular(tilt):
    z, centre, radius = conformal_hexagon(tilt)
    assert np.allclose(np.abs(z - centre), radius, rtol=1e-13)

    def cross_ratio(a, b, c, d):
        return (a - b) * (c - d) / ((b - c) * (d - a))

    assert cross_ratio(z[0], z[1], z[2], z[3]) == pytest.approx(-0.5, abs=1e-12)
    assert cross_ratio(z[0], z[5], z[4], z[3]) == pytest.approx(-0.5, abs=1e-12)


def test_the_circle_pattern_on_enneper_is_the_regular_lattice():
    """Case 1 through the general code: the Gauss map z makes the pattern exact at once."""
    enneper = surface("enneper")
    on = lattice((-0.6, 0.6, -0.6, 0.6), 0.15)
    normals, heights = gauss_image(enneper, on, enneper.parameter(on.points), "vertex")
    w = enneper.parameter(on.points)
    radius = on.step / np.sqrt(3)
    power = np.abs(w) ** 2 - radius**2
    exact = np.column_stack([2 * w.real, 2 * w.imag, power - 1])
    exact /= np.linalg.norm(exact, axis=1, keepdims=True)
    assert np.abs(normals - exact).max() < 1e-13
    assert np.abs(heights - (power + 1) / np.sqrt((power + 1) ** 2 + 4 * radius**2)).max() < 1e-13


def test_a_wrong_choice_of_edges_has_no_dual():
    shell, twice = conformal_gauss_image(columns=8, rows=8, size=0.1)
    with pytest.raises(MeshError, match="not conformal"):
        christoffel_dual(shell, ~twice)
    with pytest.raises(MeshError, match="modulus"):
        conformal_hexagon(1.2)
    with pytest.raises(MeshError, match="at least 5"):
        ring_tilt(3)

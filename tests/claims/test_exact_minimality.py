"""A shell is normals plus heights; one linear solve makes it exactly minimal.

On every surface of the catalog and all three offset types.
"""

import numpy as np
import pytest

from phexfab.minimal.shell import lattice_on, minimal_shell, surface_distance, tangent_shell
from phexfab.parallel.curvature import minimality
from phexfab.parallel.offset import (
    admissible_interval,
    node_axes,
    offset,
    offset_defect,
)
from phexfab.remesh.lattice import lattice
from phexfab.surface.catalog import catalog, surface
from phexfab.testing import assert_minimal, assert_parallel, assert_planar, assert_simple
from phexfab.triangular import EQUILATERAL

KINDS = ("face", "edge", "vertex")


def shell_of(name, kind, size, **options):
    made = surface(name).scaled(1000.0)
    return made, minimal_shell(made, lattice_on(made, size, **options), kind)


def size_for(name, panels):
    """A panel size in mm that gives about so many panels."""
    made = surface(name).scaled(1000.0)
    u0, u1, v0, v1 = made.rectangle
    u, v = np.meshgrid(np.linspace(u0, u1, 33), np.linspace(v0, v1, 33))
    kappa = np.abs(made.principal_curvatures(made.parameter(u + 1j * v))[..., 0])
    stretch = np.median(np.sqrt(made.scale / kappa))
    return stretch * np.sqrt((u1 - u0) * (v1 - v0) / panels / (np.sqrt(3) / 2))


@pytest.mark.parametrize("panels", [60, 700, 3000])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", list(catalog))
def test_every_surface_and_offset_type(name, kind, panels):
    _, shell = shell_of(name, kind, size_for(name, panels))
    assert 0.3 * panels < len(shell.panels) < 2 * panels
    assert_planar(shell.mesh, 1e-12)
    assert_parallel(shell.mesh, shell.gauss, 1e-10)
    assert_minimal(shell, 1e-10)
    assert offset_defect(shell).max() <= 1e-11
    assert_simple(shell.mesh)
    low, high = admissible_interval(shell)
    assert low < 0 < high


def halved_lattices(made, columns=16, times=3):
    """Lattices of step a, a/2, a/4 … whose border lies on one and the same rectangle."""
    u0, u1, v0, v1 = made.rectangle
    centre, a = complex((u0 + u1) / 2, (v0 + v1) / 2), 0.8 * (u1 - u0) / columns
    rise = a * EQUILATERAL
    rows = max(2, int(0.8 * (v1 - v0) / rise) // 2 * 2)
    half = np.array([columns * a, rows * rise]) / 2
    box = (
        centre.real - half[0],
        centre.real + half[0],
        centre.imag - half[1],
        centre.imag + half[1],
    )
    return [lattice(box, a / 2**k) for k in range(times)]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", list(catalog))
def test_distance_to_the_smooth_surface_falls_with_rate_two(name, kind):
    made = surface(name).scaled(1000.0)
    worst = [
        surface_distance(made, minimal_shell(made, on, kind)).max() for on in halved_lattices(made)
    ]
    assert -np.diff(np.log2(worst))[-1] > 1.9, worst


@pytest.mark.parametrize("kind", KINDS)
def test_the_solve_moves_heights_by_second_order(kind):
    made = surface("enneper").scaled(1000.0)
    moved = []
    for on in halved_lattices(made):
        start = tangent_shell(made, on, kind)
        assert minimality(start).max() > 1e-7
        moved.append(np.abs(minimal_shell(made, on, kind).heights - start.heights).max())
    assert -np.diff(np.log2(moved))[-1] > 1.85, moved


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("along", ["u", "v"])
def test_the_catenoid_closes_exactly(kind, along):
    made = surface("catenoid").scaled(1000.0)
    on = lattice_on(made, 300.0, rectangle=(-0.8, 0.8, 0, 2 * np.pi), rows_along=along, closed=True)
    shell = minimal_shell(made, on, kind)
    assert minimality(shell).max() < 1e-10 and offset_defect(shell).max() < 1e-11
    # Turning by one panel maps the shell to itself.
    around = 2 * np.pi / on.step if along == "v" else 2 * np.pi / on.step / (np.sqrt(3) / 2) / 2
    angle = 2 * np.pi / round(around)
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    points = shell.mesh.vertices
    turned = points @ turn.T
    nearest = np.min(np.linalg.norm(turned[:, None] - points[None], axis=2), axis=1)
    assert nearest.max() < 1e-8


@pytest.mark.parametrize("kind", KINDS)
def test_the_offset_interval_is_sharp(kind):
    _, shell = shell_of("enneper", kind, size_for("enneper", 150))
    low, high = admissible_interval(shell)
    i, j = shell.edges[:, 0], shell.edges[:, 1]
    before = shell.mesh.vertices[j] - shell.mesh.vertices[i]
    for distance in (0.999 * low, 0.999 * high):
        after = offset(shell, distance).mesh.vertices
        assert np.einsum("ij,ij->i", after[j] - after[i], before).min() > 0
    for distance in (1.001 * low, 1.001 * high):
        after = shell.with_heights(shell.heights + distance * shell.gauss_heights).mesh.vertices
        assert np.einsum("ij,ij->i", after[j] - after[i], before).min() < 0


@pytest.mark.parametrize("kind", KINDS)
def test_nodes_are_free_of_torsion(kind):
    """Every edge lies in one plane with the node axes of both its ends."""
    _, shell = shell_of("scherk-1", kind, size_for("scherk-1", 300))
    axes, points = node_axes(shell), shell.mesh.vertices
    i, j = shell.edges[:, 0], shell.edges[:, 1]
    along = points[j] - points[i]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    volume = np.einsum("ij,ij->i", np.cross(axes[i], axes[j]), along)
    spread = np.linalg.norm(np.cross(axes[i], axes[j]), axis=1)
    assert (np.abs(volume) / np.maximum(spread, 1e-3)).max() < 1e-9

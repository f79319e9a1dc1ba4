"""All three Gauss images on lattices around umbilics and holes, against the sphere itself."""

import numpy as np
import pytest
from cone_samples import cone_lattice, without

from phexfab.errors import DesignError, SolveError
from phexfab.minimal.closing import hole_angles, plain_borders
from phexfab.minimal.gauss_image import gauss_image
from phexfab.minimal.shell import lattice_on, minimal_shell, surface_distance, tangent_shell
from phexfab.parallel.offset import admissible_interval
from phexfab.remesh.lattice import Lattice, lattice
from phexfab.surface.catalog import surface
from phexfab.surface.classical import enneper
from phexfab.surface.weierstrass import MinimalSurface
from phexfab.testing import assert_minimal, assert_offset, assert_planar, assert_simple

KINDS = ("face", "edge", "vertex")
CIRCLES = ("edge", "vertex")
# Off the centre, around it, and two at once: no symmetry is left.
HOLES = {
    "beside": ((0.5 + 0.2j, 0.16),),
    "around": ((0.05 + 0.02j, 0.36),),
    "three": ((0.58 + 0.1j, 0.11), (-0.45 - 0.35j, 0.11), (0.02 + 0.01j, 0.3)),
}


def holed(order, rings, holes):
    made = cone_lattice(order, rings, 0.9)
    removed = np.zeros(len(made.points), bool)
    for centre, radius in holes:
        removed |= np.abs(made.points - centre) < radius
    return without(made, removed)


def assert_shell(shell, kind):
    assert_planar(shell.mesh, 1e-12)
    assert_minimal(shell, 1e-10)
    assert_simple(shell.mesh)
    assert_offset(shell.gauss, kind, 1e-12)
    low, high = admissible_interval(shell)
    assert low < 0 < high


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("order", [1, 2, 3, 4, 5, 6])
def test_enneper_around_its_umbilic(order, kind):
    made = enneper(order).scaled(1000.0)
    shell = minimal_shell(made, cone_lattice(order, 9, 0.85), kind)
    sides = np.diff(shell.rings[1])
    assert sides[0] == 3 * (order + 1) and (sides[1:] == 6).all()
    assert_shell(shell, kind)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("order", [2, 5])
def test_the_distance_to_the_smooth_surface_falls_with_rate_two(order, kind):
    made = enneper(order).scaled(1000.0)
    shells = [minimal_shell(made, cone_lattice(order, rings, 0.8), kind) for rings in (6, 12, 24)]
    worst = [surface_distance(made, shell).max() for shell in shells]
    assert -np.diff(np.log2(worst))[-1] > 1.9, worst


@pytest.mark.parametrize("kind", CIRCLES)
@pytest.mark.parametrize("holes", list(HOLES))
@pytest.mark.parametrize("order", [2, 3])
def test_general_holes_close(order, holes, kind):
    on = holed(order, 16, HOLES[holes])
    assert len(plain_borders(on.triangles, len(on.points))) == len(HOLES[holes]) + 1
    made = enneper(order).scaled(1000.0)
    shell = minimal_shell(made, on, kind)
    assert_shell(shell, kind)
    # The waves along the holes are as small as the discretisation's error.
    assert surface_distance(made, shell).max() < 0.3


@pytest.mark.parametrize("kind", CIRCLES)
@pytest.mark.parametrize("order", [3, 4, 6])
def test_an_umbilic_may_be_a_border_plane(order, kind):
    """A hole that begins at the umbilic: its circle and those around it have no smooth radius."""
    on = holed(order, 16, ((0.3 + 0.15j, 0.16),))
    umbilic = np.argmin(np.abs(on.points))
    made = enneper(order).scaled(1000.0)
    shell = minimal_shell(made, on, kind)
    assert on.points[umbilic] == 0 and umbilic not in shell.panels
    assert_shell(shell, kind)
    assert surface_distance(made, shell).max() < 0.25


@pytest.mark.parametrize("kind", CIRCLES)
def test_a_general_ring_without_umbilics_closes(kind):
    """A catenoid's ring whose holes are anything but round: nothing turns it into itself."""
    made = surface("catenoid").scaled(1000.0)
    whole = lattice_on(
        made, 150.0, rectangle=(-1.2, 1.2, 0, 2 * np.pi), rows_along="v", closed=True
    )
    u, v = whole.points.real, whole.points.imag
    z = made.parameter(whole.points)
    removed = (u > 0.9 + 0.25 * np.cos(v)) | (u < -0.8 + 0.3 * np.sin(2 * v + 1))
    grown = Lattice(
        z, whole.triangles, whole.upward, whole.step, whole.row_ratio, True, z, np.ones(len(z))
    )
    on = without(grown, removed)
    assert len(on.points) < 0.95 * len(z)
    assert_shell(minimal_shell(made, on, kind), kind)


def test_the_vertex_type_takes_other_row_ratios():
    made = enneper(3).scaled(1000.0)
    shell = minimal_shell(made, cone_lattice(3, 8, 0.8, 1.05), "vertex")
    assert_shell(shell, "vertex")


def test_a_density_scales_the_start_and_changes_nothing_inside():
    """Twice the step at twice the density are the same circles."""
    made, on = enneper(2).scaled(1000.0), cone_lattice(2, 6, 0.8)
    twice = Lattice(
        on.points,
        on.triangles,
        on.upward,
        2 * on.step,
        on.row_ratio,
        parameters=on.parameters,
        density=2 * on.density,
    )
    one = gauss_image(made, on, on.parameters, "edge")
    two = gauss_image(made, twice, on.parameters, "edge")
    assert np.allclose(one[0], two[0], atol=1e-12) and np.allclose(one[1], two[1], atol=1e-12)


def test_border_planes_touch_the_surface_though_its_gauss_map_is_branched():
    made, on = enneper(4).scaled(1000.0), cone_lattice(4, 10, 0.9)
    start = tangent_shell(made, on, "edge")
    border = np.setdiff1d(np.arange(len(on.points)), start.panels)
    z = start.parameters[border]
    assert np.abs(made.normal(z) - start.normals[border]).max() < 1e-12
    assert np.abs(z - on.parameters[border]).max() < 0.05


def test_hole_angles_count_what_the_hole_encloses():
    for order in (1, 2, 4):
        on = holed(order, 14, HOLES["around"])
        chart = on.points**order
        cycles = plain_borders(on.triangles, len(on.points))
        inner = min(cycles, key=lambda c: np.abs(on.points[on.triangles.ravel()[c]]).mean())
        faces = on.triangles.ravel()[inner]
        total = hole_angles(on.triangles, chart, (faces,))[0]
        assert total == pytest.approx((len(faces) + 2 * order) * np.pi, abs=1e-12)


def test_a_lattice_with_a_handle_has_no_plain_borders():
    n = 6
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")

    def at(di, dj):
        return ((i + di) % n * n + (j + dj) % n).ravel()

    torus = np.concatenate(
        [
            np.column_stack([at(0, 0), at(1, 0), at(1, 1)]),
            np.column_stack([at(0, 0), at(1, 1), at(0, 1)]),
        ]
    )
    assert plain_borders(torus[1:], n * n) == []


def test_a_border_that_touches_itself_is_not_plain():
    made = cone_lattice(1, 6, 1.0)
    # Of the fan around face 0 two triangles stay that have nothing else in common.
    near = np.flatnonzero((made.triangles == 0).any(axis=1))
    first = set(made.triangles[near[0]])
    other = next(t for t in near if first & set(made.triangles[t]) == {0})
    gone = np.setdiff1d(near, [near[0], other])
    assert plain_borders(made.triangles, len(made.points))
    assert plain_borders(np.delete(made.triangles, gone, axis=0), len(made.points)) == []


@pytest.mark.parametrize("kind", CIRCLES)
def test_a_gauss_image_that_covers_the_sphere(kind):
    """g = tan z, f = cos² z: Q = 1, and strips of width π cover all but two points."""
    wound = MinimalSurface("wound", np.tan, lambda z: 1 / np.cos(z) ** 2, lambda z: np.cos(z) ** 2)
    on = lattice((-2, 2, -2.5, 2.5), 0.2)
    shell = minimal_shell(wound, on, kind)
    assert_shell(shell, kind)
    off = np.einsum("ij,ij->i", shell.normals, wound.normal(wound.parameter(on.points)))
    assert off.min() > np.cos(np.radians(4))


def test_a_lattice_that_misses_the_umbilic_is_refused():
    """The monkey saddle's lattice laid on the plain saddle."""
    on = cone_lattice(2, 6, 0.8)
    with pytest.raises(SolveError, match="face 0 of the lattice the Gauss map winds 1 times"):
        minimal_shell(enneper(1), on, "edge")


def test_circles_refuse_a_graded_lattice():
    made = surface("enneper").scaled(1000.0)
    on = lattice_on(made, 150.0, evenness=0.5)
    with pytest.raises(DesignError, match=r"lattice.evenness = 0"):
        minimal_shell(made, on, "edge")

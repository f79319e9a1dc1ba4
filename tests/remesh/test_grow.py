"""Lattices grown on whole domains: exact, closed up around umbilics, and good for shells."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from umbilic_samples import face_shell, ring, with_umbilics

from phexfab.errors import LatticeError
from phexfab.parallel.rings import border_loops, face_rings
from phexfab.remesh.seamless.charts import build_atlas
from phexfab.remesh.seamless.coordinate import seamless
from phexfab.remesh.seamless.grow import grow_lattice, lattice_of
from phexfab.surface import surface
from phexfab.surface.domain import Disc
from phexfab.testing import assert_minimal, assert_parallel, assert_planar, assert_simple

UNIT = Disc()
RING = Disc(0, 2.2, ((0, 0.5),))
X, W = (0.5 * a for a in np.polynomial.legendre.leggauss(24))
X = X + 0.5
THREE = (0.5, -0.3 + 0.4j, -0.3 - 0.4j)
FIVE = tuple(0.5 * np.exp(2j * np.pi * (np.arange(5) + 0.1) / 5) * (1 + 0.1 * np.arange(5)))
CASES = [
    ("enneper", surface("enneper").scaled(1000.0), Disc(0, 0.9), 80),
    ("order 2", surface("enneper", order=2).scaled(1000.0), Disc(0, 0.9), 60),
    ("order 3", surface("enneper", order=3).scaled(1000.0), Disc(0, 0.9), 45),
    ("order 4", surface("enneper", order=4).scaled(1000.0), Disc(0, 0.9), 30),
    ("order 6", surface("enneper", order=6).scaled(1000.0), Disc(0, 0.9), 25),
    ("off centre", surface("enneper", order=2).scaled(1000.0), Disc(0.4 - 0.1j, 0.8), 40),
    ("two", with_umbilics((0.4, -0.3 + 0.2j)), UNIT, 35),
    ("three", with_umbilics(THREE), UNIT, 25),
    ("five", with_umbilics(FIVE), UNIT, 14),
    ("orders 1 and 2", with_umbilics((0.4, 0.4, -0.35j)), UNIT, 25),
    ("near pair", with_umbilics((0.05, 0.12j, -0.6)), UNIT, 45),
    ("catenoid", ring(), RING, 200),
    ("ring", ring(0.12, 0.1 - 0.02j), RING, 150),
]


def panels_of(on):
    panels, starts, _, _ = face_rings(on.triangles, len(on.points))
    return panels, np.diff(starts)


@pytest.mark.parametrize("along", ["u", "v"])
@pytest.mark.parametrize(
    ("made", "domain", "size"), [c[1:] for c in CASES], ids=[c[0] for c in CASES]
)
def test_shells_are_exact(made, domain, size, along):
    coordinate = seamless(made, domain, panel_size=size, rows_along=along)
    on = lattice_of(coordinate)
    panels, sides = panels_of(on)
    z = on.parameters
    assert domain.contains(z).all()

    # One disc, or one disc with the domain's holes; every border plane trims a panel.
    edges = np.unique(np.sort(on.triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), 1), axis=0)
    assert len(z) - len(edges) + len(on.triangles) == 1 - len(domain.holes)
    assert len(border_loops(on.triangles, panels, len(z))) == 1 + len(domain.holes)
    assert np.isin(on.triangles, panels).any(1).all()

    # 3(m+2) sides at the apices, six everywhere else.
    expected = np.full(len(z), 6)
    for place, order in zip(coordinate.apices.places, coordinate.apices.orders, strict=True):
        assert np.abs(z - place).min() < 1e-13
        expected[np.abs(z - place).argmin()] = 3 * (order + 2)
    assert np.array_equal(sides, expected[panels])
    assert (sides != 6).sum() == len(coordinate.apices)

    shell = face_shell(made, on)
    assert_planar(shell.mesh, 1e-12)
    assert_minimal(shell, 1e-10)
    assert_simple(shell.mesh)
    assert_parallel(shell.mesh, shell.gauss, 1e-9)

    # Of about the asked size.
    e = np.unique(np.sort(shell.edges[:, 2:], 1), axis=0)
    e = e[e[:, 0] >= 0]
    centres = shell.points[shell.panels]
    median = np.median(np.linalg.norm(centres[e[:, 0]] - centres[e[:, 1]], axis=1))
    assert 0.75 * size < median < 1.3 * size
    assert coordinate.sizes[0] < coordinate.sizes[1] < coordinate.sizes[2]


@pytest.mark.parametrize("along", ["u", "v"])
@pytest.mark.parametrize(
    ("made", "domain", "size"), [c[1:] for c in CASES], ids=[c[0] for c in CASES]
)
def test_every_step_is_a_lattice_vector(made, domain, size, along):
    """∫ √Q e^h dz over the straight way in z between any two neighbours, by the test's own rule."""
    coordinate = seamless(made, domain, panel_size=size, rows_along=along)
    on = lattice_of(coordinate)
    z = on.parameters[on.triangles]
    start, end = z, np.roll(z, -1, axis=1)
    apart = np.ones(start.shape, bool)
    for place in coordinate.apices.places:
        apart &= (np.abs(start - place) > 1e-9) & (np.abs(end - place) > 1e-9)
    a, b = start[apart], end[apart]
    nodes = a[:, None] + (b - a)[:, None] * X
    values = coordinate.quantity(nodes)
    root = np.sqrt(values)
    flip = np.where((root[:, 1:] * root[:, :-1].conj()).real < 0, -1, 1)
    root[:, 1:] *= np.cumprod(flip, axis=1)
    w = (root @ W) * (b - a)
    vectors = coordinate.plane.neighbours
    side = np.nonzero(apart)[1]
    miss = np.abs(w[:, None] - vectors)
    # The first edge runs along a row; the others do not.
    assert miss[side == 0][:, [0, 3]].min(1).max() < 1e-9 * on.step
    assert miss[side > 0][:, [1, 2, 4, 5]].min(1).max() < 1e-9 * on.step
    # Counter-clockwise triangles.
    e = end - start
    assert ((e[:, 0].conj() * e[:, 1]).imag > 0).all()
    assert on.upward.all() and (on.density > 0).all()
    plain = np.ones(len(on.points), bool)
    for place in coordinate.apices.places:
        plain &= np.abs(on.points - place) > 1e-9
    z = on.points[plain]
    assert np.allclose(on.density[plain] ** 2, np.abs(coordinate.quantity(z) / made.hopf(z)))


def test_all_lattice_points_of_a_plain_surface_are_there():
    """On Enneper's surface w = z: the lattice is that of the plane."""
    on = grow_lattice(surface("enneper"), Disc(0, 1), panel_size=0.15)
    i, j = np.meshgrid(np.arange(-40, 41), np.arange(-40, 41))
    plane = on.step * (i + j / 2 + 1j * j * on.row_ratio).ravel()
    plane = plane[np.abs(plane) <= 1]
    panels, _ = panels_of(on)
    away = np.abs(on.points[:, None] - plane)
    assert away.min(1).max() < 1e-13
    closed = [
        p
        for p in plane
        if all(abs(p + on.step * np.exp(1j * np.pi * k / 3)) <= 1 for k in range(6))
    ]
    assert len(panels) == len(closed)


def test_an_umbilic_just_outside_is_left_alone():
    for beyond in (1e-3, 1e-6):
        made = with_umbilics((1.0 + beyond, -0.2j))
        on = grow_lattice(made, UNIT, panel_size=30.0)
        _, sides = panels_of(on)
        assert sorted(set(sides)) == [6, 9] and (sides == 9).sum() == 1
        assert_simple(face_shell(made, on).mesh)


def test_an_umbilic_just_inside_needs_no_panel():
    on = grow_lattice(with_umbilics((0.9999, -0.2j)), UNIT, panel_size=30.0)
    _, sides = panels_of(on)
    assert (sides == 9).sum() == 1


@settings(max_examples=12, deadline=None)
@given(
    places=st.lists(st.tuples(st.floats(0, 0.75), st.floats(0, 2 * np.pi)), min_size=1, max_size=3),
    size=st.floats(30, 90),
    along=st.sampled_from("uv"),
)
def test_any_umbilics_give_a_shell_or_a_refusal(places, size, along):
    zeros = np.array([r * np.exp(1j * t) for r, t in places])
    made = with_umbilics(zeros)
    try:
        on = grow_lattice(made, UNIT, panel_size=size, rows_along=along)
    except LatticeError as refusal:
        assert "panel_size" in str(refusal)
        return
    shell = face_shell(made, on)
    assert_minimal(shell, 1e-9)
    assert_simple(shell.mesh)


def test_domains_without_room_are_refused():
    with pytest.raises(LatticeError, match="no panel fits"):
        grow_lattice(surface("enneper"), Disc(0, 0.1), panel_size=0.3)
    with pytest.raises(LatticeError, match=r"a smaller lattice\.panel_size"):
        grow_lattice(surface("enneper"), Disc(0, 1, ((0.03 + 0.04j, 0.001),)), panel_size=0.2)


def test_a_seam_between_two_formulas_costs_no_charts():
    """Formulas that agree to 1e-10 only: no square beside the seam can hide that."""

    def smooth(z):
        return np.exp(0.3 * z)

    def seamed(z):
        return smooth(z) * (1 + 1e-10 * (np.real(z) > 0.1))

    plain = build_atlas(smooth, UNIT, np.zeros(0, complex), np.zeros(0, int))
    atlas = build_atlas(seamed, UNIT, np.zeros(0, complex), np.zeros(0, int))
    assert len(atlas.centre) <= 2 * len(plain.centre)
    z = UNIT.grid(40)
    chart = atlas.chart_at(z)
    assert (chart >= 0).all()
    assert np.allclose(atlas.coordinate(chart, z)[1] ** 2, smooth(z), rtol=1e-8)


def test_a_chart_that_holds_nowhere_is_quietly_its_centre():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        atlas = build_atlas(np.ones_like, UNIT, np.array([0.3 + 0j]), np.array([1]))  # no zero
        z, found = atlas.place(np.zeros(3, int), np.array([0.0, 0.1, 2.0 + 1j]))
    assert found.tolist() == [True, False, False]
    assert z[0] == 0.3 and np.isfinite(z).all()


def test_the_same_lattice_every_time():
    first, second = (
        grow_lattice(with_umbilics(THREE), UNIT, panel_size=25.0, evenness=0.5) for _ in range(2)
    )
    assert np.array_equal(first.points, second.points)
    assert np.array_equal(first.triangles, second.triangles)


@pytest.mark.parametrize("zeros", [(), (0.3,), THREE, (0.3, 0.3, 0.300001 + 0.02j)])
def test_the_atlas_inverts_itself(zeros):
    quantity = np.ones_like if not zeros else lambda z: np.prod([z - k for k in zeros], 0) + 0 * z
    places, orders = np.unique(np.array(zeros, complex), return_counts=True)
    atlas = build_atlas(quantity, UNIT, places, orders)
    random = np.random.default_rng(6)
    z = np.sqrt(random.uniform(0, 1, 500)) * np.exp(2j * np.pi * random.uniform(0, 1, 500))
    chart = atlas.chart_at(z)
    assert (chart >= 0).all()
    tau, slope = atlas.tau(chart, z)
    back, good = atlas.place(chart, tau)
    assert good.all() and np.abs(back - z).max() < 1e-13
    w, speed = atlas.coordinate(chart, z)
    assert np.allclose(speed**2, quantity(z), rtol=1e-10, atol=1e-13)
    assert np.isfinite(w).all() and np.isfinite(slope).all()

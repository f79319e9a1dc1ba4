"""The seamless coordinate: umbilics and holes on one lattice, by integrals of the test's own."""

import re

import numpy as np
import pytest
from umbilic_samples import lattice_coordinates, ring, root_integral, with_umbilics

from phexfab.errors import LatticeError
from phexfab.remesh.plane import PlaneLattice
from phexfab.remesh.seamless.coordinate import seamless
from phexfab.remesh.seamless.correction import basis, even_out, least_distance
from phexfab.surface import surface
from phexfab.surface.domain import Disc
from phexfab.triangular import EQUILATERAL

UNIT = Disc()
THREE = (0.5, -0.3 + 0.4j, -0.3 - 0.4j)
FIVE = tuple(0.5 * np.exp(2j * np.pi * (np.arange(5) + 0.1) / 5) * (1 + 0.1 * np.arange(5)))
RING = Disc(0, 2.2, ((0, 0.5),))


def whole_to(plane, w):
    """How far lattice coordinates are from whole numbers."""
    x = lattice_coordinates(plane, w)
    return np.abs(x - np.round(x)).max()


@pytest.mark.parametrize("along", ["u", "v"])
@pytest.mark.parametrize(
    ("zeros", "size"),
    [((0.4, -0.3 + 0.2j), 30), (THREE, 20), ((0.4, 0.4, -0.3j), 9), (FIVE, 12)],
)
def test_umbilics_lie_on_one_lattice(zeros, size, along):
    made = with_umbilics(zeros)
    on = seamless(made, UNIT, panel_size=size, rows_along=along)
    places = on.apices.places
    assert np.array_equal(places, on.apices.umbilics.places), "far enough to stay where they are"
    # Other ways than those of the solver: over a corner off the straight line, between all pairs.
    j, k = np.triu_indices(len(places), 1)
    a, b = places[j], places[k]
    turns = [(a + b) / 2 + s * 1j * (b - a) for s in (0.13, 0.21)]
    h = basis(UNIT, np.array([0.1])) @ on.correction.coefficients
    assert np.allclose(on.correction(np.array([0.1])), h)
    for corner in turns:
        w = root_integral(
            lambda z: made.hopf(z) * np.exp(2 * on.correction(z)), np.stack([a, corner, b], 1)
        )
        assert whole_to(on.plane, w) < 1e-9
        assert np.abs(w).min() > 0.9 * min(1, np.hypot(0.5, on.plane.row_ratio)) * on.plane.step
    border = UNIT.borders(999).ravel()
    assert np.abs(np.degrees(on.correction(border).imag)).max() < 10.6
    assert abs(np.log(on.sizes[1] / size)) < np.log(1.151)


def test_a_surface_without_conditions_is_not_corrected():
    for made in (surface("enneper"), surface("enneper", order=3)):
        on = seamless(made, UNIT, panel_size=0.1)
        assert not on.correction.coefficients.any() and on.turn == 0
        assert on.plane.row_ratio == EQUILATERAL
        assert on.sizes[1] == pytest.approx(0.1)


@pytest.mark.parametrize("along", ["u", "v"])
@pytest.mark.parametrize(("c", "d"), [(0, 0), (0.1 + 0.05j, 0.03j), (0.12, 0.1 - 0.02j)])
def test_the_way_around_a_hole_is_a_lattice_vector(c, d, along):
    made = ring(c, d)
    on = seamless(made, RING, panel_size=200, rows_along=along)
    circle = 1.1 * np.exp(2j * np.pi * np.arange(400) / 400)
    dz = 2j * np.pi / 400 * circle
    root = np.sqrt(on.quantity(circle) * circle**2) / circle  # 1/z times a root near 1
    assert whole_to(on.plane, (root * dz).sum()) < 1e-9
    around = abs((root * dz).sum()) / on.plane.step
    assert around > 8 and on.turn < 2


def test_half_turns_around_holes_need_no_umbilic():
    """Q ~ 1/(z² - 1): two half-turns after each other are a lattice vector."""
    two = Disc(0, 2.2, ((-1, 0.3), (1, 0.3)))
    made = with_umbilics([9.0])
    object.__setattr__(made, "form", lambda z: 1 / (z * z - 1) / (z - 9.0))
    on = seamless(made, two, panel_size=150.0)
    circle = 1.9 * np.exp(2j * np.pi * np.arange(2000) / 2000)
    root = np.sqrt(on.quantity(circle) * circle**2) / circle
    assert whole_to(on.plane, (root * 2j * np.pi * circle).mean()) < 1e-8


@pytest.mark.parametrize("gap", [0.02, 0.1, 0.2])
def test_umbilics_under_one_panel_share_an_apex(gap):
    zeros = 0.1 + gap / 2 * np.exp(0.3j) * np.array([1, -1])
    on = seamless(with_umbilics(zeros), UNIT, panel_size=80.0)
    assert on.apices.orders.tolist() == [2]
    assert abs(on.apices.places[0] - 0.1) < 1e-14
    # Far from the pair the factor is 1 + O(gap²), and so is the turn of the rows.
    far = UNIT.borders(64)[0]
    assert np.abs(on.log_density(far)).max() < 0.5 * gap**2


def test_an_apex_may_leave_its_umbilic_within_its_panel():
    zeros = np.array([0.1, 0.1 + 0.45 * np.exp(0.3j)])
    made = with_umbilics(zeros)
    on = seamless(made, UNIT, panel_size=60.0)
    places, known = on.apices.places, on.apices.umbilics.places
    assert on.apices.orders.tolist() == [1, 1]
    assert 0 < np.abs(places - known).max() < 0.1
    corner = places.mean() + 0.2j * (places[1] - places[0])
    ways = np.array([[places[0], corner, places[1]]])
    assert whole_to(on.plane, root_integral(on.quantity, ways)) < 1e-8


def test_a_fixed_row_ratio_is_kept():
    on = seamless(with_umbilics(THREE), UNIT, panel_size=15.0, kind="edge")
    assert on.plane.row_ratio == EQUILATERAL


def test_what_is_too_near_is_named_and_the_remedy_works():
    zeros = (0.0, 0.35, 0.33j, -0.3 - 0.25j)
    made = with_umbilics(zeros)
    with pytest.raises(LatticeError, match=r"lie [\d.]+ mm apart") as caught:
        seamless(made, UNIT, panel_size=90.0, kind="edge")
    size = re.search(r"lattice.panel_size = ([\d.e+]+) would do", str(caught.value))
    assert size is not None
    on = seamless(made, UNIT, panel_size=float(size[1]), kind="edge")
    assert abs(np.log(on.sizes[1] / float(size[1]))) < np.log(1.151)


def test_evenness_evens_sizes_and_costs_turn():
    made = surface("enneper").scaled(1000.0)
    off_centre = Disc(0.3, 0.9)
    ranges, turns = [], []
    for evenness in (0.0, 0.4, 0.8, 1.0):
        on = seamless(made, off_centre, panel_size=60.0, evenness=evenness)
        ranges.append(on.sizes[2] / on.sizes[0])
        turns.append(on.turn)
        assert on.sizes[1] == pytest.approx(60.0)
    assert np.all(np.diff(ranges) < 0) and np.all(np.diff(turns) > 0)
    assert turns[-1] <= 9.0 and ranges[-1] < 0.87 * ranges[0]


def test_even_out_meets_a_wish_that_is_harmonic():
    grid = UNIT.grid(40)
    wish = (0.05 * grid**2 - 0.04j * grid).real
    h = even_out(UNIT, grid, wish + 7.0, np.ones(len(grid)), 1.0)
    assert np.abs((basis(UNIT, grid) @ h).real - wish + wish.mean()).max() < 0.02 * np.ptp(wish)
    tight = even_out(UNIT, grid, wish, np.ones(len(grid)), 0.03)
    turn = np.abs((basis(UNIT, UNIT.borders(700).ravel()) @ tight).imag).max()
    assert 0.029 < turn < 0.0303


def test_least_distance_is_the_foot_on_a_polytope():
    rows = np.array([[-1.0, 0.0], [0.0, -1.0], [1.0, 1.0]])
    assert np.allclose(least_distance(rows, np.array([-1.0, -2.0, 9.0])), [1, 2])
    assert np.allclose(least_distance(rows, np.array([1.0, 1.0, 1.0])), [0, 0])
    assert least_distance(rows, np.array([-1.0, -2.0, 2.0])) is None


@pytest.mark.parametrize("along", ["u", "v"])
def test_nearest_lattice_points(along):
    plane = PlaneLattice(0.7, 0.95, along)
    a, b = plane.basis
    everything = (np.arange(-9, 10) * a + np.arange(-9, 10)[:, None] * b).ravel()
    random = np.random.default_rng(4)
    w = random.uniform(-2, 2, 200) + 1j * random.uniform(-2, 2, 200)
    away = np.abs(w[:, None] - everything)
    assert np.allclose(np.abs(w - plane.nearest(w)), away.min(1))
    assert np.allclose(np.sort(np.abs(plane.nearest_few(w, 7) - w[:, None])), np.sort(away)[:, :7])
    assert len(plane.around(w[0], 1.9)) == (away[0] <= 1.9).sum()
    assert np.allclose(np.sort(np.abs(plane.neighbours)), np.sort(np.abs(everything))[1:7])
    assert np.all(np.diff(np.unwrap(np.angle(plane.neighbours))) > 0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"panel_size": -1.0}, "panel_size = -1"),
        ({"panel_size": 9.0, "rows_along": "x"}, "rows_along = 'x'"),
        ({"panel_size": 9.0, "evenness": 2}, "evenness = 2"),
        ({"panel_size": 9.0, "row_ratio": 0.4}, "row_ratio = 0.4"),
    ],
)
def test_impossible_wishes(options, message):
    with pytest.raises(LatticeError, match=message):
        seamless(surface("enneper"), UNIT, **options)

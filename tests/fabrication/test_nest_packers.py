"""The two packers on their own: rows by exact distance, and Sparrow in a process of its own."""

import numpy as np
import pytest
import shapely
from nest_samples import hourglass, panels, turn

from phexfab.fabrication.shelf import pack_rows, resting_angle, turned
from phexfab.fabrication.strip import StripRun, pack_strips


def laid(contours, spots):
    return [shapely.Polygon(turned(contours[k], a) + np.array([x, y])) for k, a, x, y in spots]


def overlap(polygons):
    return max(
        (a.intersection(b).area for i, a in enumerate(polygons) for b in polygons[i + 1 :]),
        default=0.0,
    )


def test_quarter_turns_are_exact_and_others_are_rotations():
    points = np.array([(3.0, 1.0), (0.1, -2.0)])
    assert np.array_equal(turned(points, 90.0), np.column_stack([-points[:, 1], points[:, 0]]))
    assert np.array_equal(turned(points, -180.0), -points)
    z = points @ np.array([1, 1j]) * np.exp(1j * np.radians(33.0))
    assert np.allclose(turned(points, 33.0) @ np.array([1, 1j]), z, atol=1e-15)


@pytest.mark.parametrize("angle", [0.0, 17.0, 90.0, 133.0, -48.0])
def test_the_resting_angle_lays_the_least_rectangle_along_x(angle):
    rng = np.random.default_rng(3)
    for _ in range(5):
        points = turn(rng.uniform(-1, 1, (7, 2)) * [5, 2], angle)
        size = np.ptp(turned(points, resting_angle(points)), axis=0)
        assert size[0] >= size[1]
        # Against a scan of all directions.
        scan = min(np.prod(np.ptp(turned(points, a), axis=0)) for a in np.linspace(0, 90, 2001))
        assert np.prod(size) <= scan * (1 + 1e-9)


def test_slanted_ends_slide_into_one_another():
    """Parallelograms with one slope: each costs its base and no more."""
    slanted = np.array([(0, 0), (100, 0), (150, 80), (50, 80)], float)
    ((*spots,),) = pack_rows([slanted] * 9, [0.0] * 9, 50 + 900.0, 80.0)
    polygons = laid([slanted] * 9, spots)
    assert overlap(polygons) < 1e-9
    assert shapely.union_all(polygons).bounds == pytest.approx((0, 0, 950, 80))


def test_trapezoids_are_turned_to_meet_slope_on_slope():
    wedge = np.array([(0, 0), (100, 0), (80, 50), (0, 50)], float)
    ((*spots,),) = pack_rows([wedge] * 4, [0.0] * 4, 360.0, 50.0)
    polygons = laid([wedge] * 4, spots)
    assert overlap(polygons) < 1e-9
    assert shapely.union_all(polygons).area == pytest.approx(360 * 50)


def test_a_row_of_hourglasses_drops_into_the_notches_of_the_row_below():
    size = 100.0
    contour = hourglass(size)
    width = np.sqrt(3) * size
    sheets = pack_rows([contour] * 10, [0.0] * 10, 5.5 * width + 1e-6, 3.5 * size + 1e-6)
    assert len(sheets) == 1
    polygons = laid([contour] * 10, sheets[0])
    assert overlap(polygons) < 1e-6


def test_rows_give_up_at_the_limit():
    square = np.array([(0, 0), (100, 0), (100, 100), (0, 100)], float)
    assert pack_rows([square] * 5, [0.0] * 5, 200.0, 200.0, limit=1) == []
    assert [len(s) for s in pack_rows([square] * 5, [0.0] * 5, 200.0, 200.0, limit=2)] == [4, 1]


def run(contours, height, target, **change):
    settings = {"angles": (0.0, 180.0), "seed": 0, "patience": 2000, **change}
    return StripRun(tuple(contours), height, target, **settings)


def test_a_strip_that_fits_is_sound_and_the_same_every_time():
    contours = [flat.outline for flat in panels(8, 90, 200, 5)]
    job = run(contours, 800.0, 1250.0)
    first, second = pack_strips([job, job], 60.0)
    assert first == second and first.error == ""
    assert first.length <= 1250.0 and sorted(k for k, *_ in first.spots) == list(range(8))
    assert {angle for _, angle, _, _ in first.spots} <= {0.0, 180.0}
    polygons = laid(contours, first.spots)
    assert overlap(polygons) < 1e-2  # single precision
    x0, y0, x1, y1 = shapely.total_bounds(polygons)
    assert min(x0, y0) > -1e-2 and x1 < 1250.01 and y1 < 800.01


def test_other_seeds_give_other_layouts():
    contours = [flat.outline for flat in panels(8, 90, 200, 5)]
    a, b = pack_strips([run(contours, 800.0, 1250.0, seed=s) for s in (0, 1)], 60.0)
    assert a.spots != b.spots


def test_what_follows_a_strip_that_fits_is_not_waited_for():
    contours = [flat.outline for flat in panels(8, 90, 200, 5)]
    easy, hopeless = run(contours, 800.0, 1500.0), run(contours, 800.0, 1.0, patience=10**9)
    assert len(pack_strips([easy, hopeless], 60.0, until_one_fits=True)) == 1


def test_patience_ends_a_run_and_the_clock_another():
    contours = [flat.outline for flat in panels(8, 90, 200, 5)]
    (spent,) = pack_strips([run(contours, 800.0, 1.0, patience=5)], 60.0)
    assert spent.length > 1.0 and spent.reports == 6 and not spent.late
    (late,) = pack_strips([run(contours, 800.0, 1.0, patience=10**9)], 0.0)
    assert late.late and late.length == np.inf and late.spots == ()


def test_a_panic_of_the_packer_is_an_answer_not_an_end():
    """An item taller than the strip, and one that crosses itself, make the packer panic."""
    tall = np.array([(0, 0), (10, 0), (10, 900), (0, 900)], float)
    crossed = np.array([(0, 0), (100, 100), (100, 0), (0, 100)], float)
    for shape in (tall, crossed):
        (layout,) = pack_strips([run([shape], 500.0, 100.0)], 60.0)
        assert layout.length == np.inf and layout.error and not layout.late


def test_no_process_to_be_had_is_an_answer_too(monkeypatch):
    monkeypatch.setattr("sys.executable", "/nowhere/python")
    (layout,) = pack_strips([run([hourglass(50)], 500.0, 500.0)], 60.0)
    assert layout.length == np.inf and "/nowhere/python" in layout.error

"""The value Rim: interpolation, arc length, corners, rounding, motions."""

import numpy as np
import pytest
from scipy.integrate import quad

from phexfab.errors import DesignError
from phexfab.surface.rims.corners import corner_points
from phexfab.surface.rims.pieces import line
from phexfab.surface.rims.rim import Rim

TURN = 2.0 * np.pi


def lobed(t):
    """A smooth three-lobed closed curve, mm."""
    a = TURN * np.asarray(t)
    return 1000.0 * np.stack([np.cos(a), 1.3 * np.sin(a), 0.3 * np.cos(3 * a)], axis=-1)


def lobed_slope(t):
    a = TURN * np.asarray(t)
    return 1000.0 * TURN * np.stack([-np.sin(a), 1.3 * np.cos(a), -0.9 * np.sin(3 * a)], axis=-1)


def lobed_bend(t):
    a = TURN * np.asarray(t)
    wave = np.stack([-np.cos(a), -1.3 * np.sin(a), -2.7 * np.cos(3 * a)], axis=-1)
    return 1000.0 * TURN**2 * wave


def distance_to_lobed(points):
    """Distances from the exact curve: nearest of a dense sampling, then Newton."""
    dense = np.linspace(0.0, 1.0, 4001)[:-1]
    gaps = np.linalg.norm(points[:, None] - lobed(dense)[None], axis=2)
    t = dense[np.argmin(gaps, axis=1)]
    for _ in range(4):
        away, d, b = lobed(t) - points, lobed_slope(t), lobed_bend(t)
        t -= np.sum(away * d, axis=1) / (np.sum(d * d, axis=1) + np.sum(away * b, axis=1))
    return np.linalg.norm(lobed(t) - points, axis=1)


QUAD = np.array([[0.0, 0, 0], [12000, 0, 3000], [12000, 9000, 0], [0, 9000, 4000]])


@pytest.fixture
def quad_rim():
    return Rim.through(QUAD, corners=range(4), name="canopy")


@pytest.mark.parametrize("warp", [0.0, 0.08])
def test_interpolation_is_of_order_five_or_better(warp):
    errors = []
    for n in (64, 128, 256):
        u = np.arange(n) / n
        rim = Rim.through(lobed(u + warp * np.sin(TURN * u)))
        errors.append(distance_to_lobed(rim.samples(400)[1]).max())
    rates = np.log2(np.array(errors[:-1]) / errors[1:])
    assert rates.min() >= 5.0
    assert errors[-1] < 1e-5


def test_sides_between_corners_are_of_order_five_too():
    """Two half-circles that meet in two corners: arcs of 270 degrees."""
    errors = []
    for n in (24, 48, 96):
        a = np.linspace(0.25 * np.pi, 1.75 * np.pi, n + 1)
        left = np.stack([np.cos(a), np.sin(a), 0 * a], axis=1)
        right = left[::-1][1:-1] * [-1, 1, 1] + [np.sqrt(2.0), 0, 0]
        right = right[::-1] if right[0, 1] > 0 else right
        rim = Rim.through(1000.0 * np.concatenate([left, right]), corners=[0, n])
        t = np.linspace(0.0, 0.5, 400)
        errors.append(np.abs(np.linalg.norm(rim.point(t), axis=1) - 1000.0).max())
    assert np.log2(np.array(errors[:-1]) / errors[1:]).min() >= 5.0


def test_points_are_met_and_the_curve_closes():
    points = lobed(np.arange(40) / 40)
    rim = Rim.through(points)
    # The parameter is arc length: the points lie at the arc lengths of the spline itself.
    t = np.linspace(0.0, 1.0, 20001)
    near = np.linalg.norm(points[:, None] - rim.point(t)[None], axis=2).min(axis=1)
    assert near.max() < 0.25
    assert rim.point([0.0, 1.0, -3.0]) == pytest.approx(np.tile(points[0], (3, 1)), abs=1e-9)
    for order in range(1, 5):
        scale = np.abs(rim.derivative(t, order)).max()
        gap = rim.derivative(0.0, order) - rim.derivative(0.0, order, before=True)
        assert np.abs(gap).max() <= 1e-9 * scale


def test_shapes_and_derivatives():
    rim = Rim.through(lobed(np.arange(40) / 40))
    t = np.array([[0.11, 0.52], [0.93, 1.37]])
    assert rim.point(t).shape == (2, 2, 3)
    assert rim.point(0.3).shape == (3,)
    step = 1e-5
    for order in (1, 2, 3):
        below = rim.point if order == 1 else lambda x, k=order: rim.derivative(x, k - 1)
        slope = (below(t + step) - below(t - step)) / (2 * step)
        scale = np.abs(slope).max()
        assert np.abs(rim.derivative(t, order) - slope).max() <= 1e-6 * scale
    assert np.all(rim.derivative(t, 9) == 0.0)


def test_exact_callables_and_orders_beyond_those_given():
    t = np.linspace(0.0, 1.0, 57)
    one = Rim.of(lobed, lobed_slope)
    two = Rim.of(lobed, (lobed_slope, lobed_bend))
    assert np.array_equal(one.point(t[:-1]), lobed(t[:-1]))
    assert np.abs(one.derivative(t, 2) - lobed_bend(t)).max() <= 1e-8 * np.abs(lobed_bend(t)).max()
    assert two.derivative(t, 2) == pytest.approx(lobed_bend(t), rel=1e-12, abs=1e-8)
    exact, _ = quad(lambda x: float(np.linalg.norm(lobed_slope(x))), 0.0, 1.0, epsabs=1e-9)
    assert one.length == pytest.approx(exact, rel=1e-12)


def test_corners_have_two_tangents():
    """A half-disc as callables; the corners are at 1/8 and 5/8, not at 0."""

    def point(t):
        s = (np.asarray(t) - 0.125) % 1.0
        arc = np.stack([np.cos(TURN * s), np.sin(TURN * s), 0 * s], axis=-1)
        chord = np.stack([4 * s - 3.0, 0 * s, 0 * s], axis=-1)
        return 500.0 * np.where((s < 0.5)[:, None], arc, chord)

    def slope(t):
        s = (np.asarray(t) - 0.125) % 1.0
        arc = TURN * np.stack([-np.sin(TURN * s), np.cos(TURN * s), 0 * s], axis=-1)
        return 500.0 * np.where((s < 0.5)[:, None], arc, [4.0, 0.0, 0.0])

    rim = Rim.of(point, slope, corners=(0.625, 0.125))
    assert rim.corners.tolist() == [0.125, 0.625]
    assert rim.sides() == ((0.125, 0.625), (0.625, 1.125))
    assert rim.turning(rim.corners) == pytest.approx([90.0, 90.0], abs=1e-6)
    assert rim.turning([0.3, 0.0]) == pytest.approx([0.0, 0.0], abs=1e-6)
    assert rim.derivative(0.625) == pytest.approx([2000.0, 0, 0])
    assert rim.derivative(0.625, before=True) == pytest.approx([0, -500.0 * TURN, 0], abs=1e-6)
    t, points = rim.samples(90)
    assert {0.125, 0.625} <= set(t.tolist())
    steps = np.linalg.norm(np.diff(np.concatenate([points, points[:1]]), axis=0), axis=1)
    assert steps.max() / steps.min() < 1.1


def test_straight_sides_are_straight(quad_rim):
    points = quad_rim.samples(101)[1]
    starts, steps = QUAD, np.roll(QUAD, -1, axis=0) - QUAD
    away = np.stack(
        [
            np.linalg.norm(np.cross(points - a, d), axis=1) / np.linalg.norm(d)
            for a, d in zip(starts, steps, strict=True)
        ]
    ).min(axis=0)
    assert away.max() <= 1e-11
    assert all(quad_rim.is_straight(k) for k in range(4))
    assert quad_rim.length == pytest.approx(np.linalg.norm(steps, axis=1).sum(), rel=1e-14)
    with_middles = np.stack([QUAD, QUAD + 0.3 * steps], axis=1).reshape(-1, 3)
    same = Rim.through(with_middles, corners=[0, 2, 4, 6])
    assert all(same.is_straight(k) for k in range(4))
    assert same.corners == pytest.approx(quad_rim.corners, abs=1e-15)
    bent = Rim.through(np.insert(QUAD, 1, [6000.0, -500.0, 900.0], axis=0), corners=[0, 2, 3, 4])
    assert [bent.is_straight(k) for k in range(4)] == [False, True, True, True]


def test_samples_hit_corners_and_share_by_length(quad_rim):
    t, points = quad_rim.samples(37)
    assert len(t) == len(points) == 37
    assert np.all(np.diff(t) > 0.0)
    assert set(quad_rim.corners.tolist()) <= set(t.tolist())
    steps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    assert steps.max() / steps.min() < 1.15
    with pytest.raises(DesignError, match=r"canopy: 3 samples asked for.*at least 4"):
        quad_rim.samples(3)


def test_arc_length_and_its_inverse():
    rim = Rim.of(lobed, lobed_slope)
    t = np.array([0.0, 0.013, 0.4999, 0.77, 1.0, 2.25, -0.4])
    for value, found in zip(t, rim.arc_length(t), strict=True):
        exact, _ = quad(lambda x: float(np.linalg.norm(lobed_slope(x))), 0.0, value, limit=200)
        assert found == pytest.approx(exact, abs=1e-7)
    assert rim.at_length(rim.arc_length(t)) == pytest.approx(t, abs=1e-13)


def test_reversed_scaled_moved(quad_rim):
    back = quad_rim.reversed()
    t = np.linspace(0.0, 1.0, 64, endpoint=False)
    assert back.point(t) == pytest.approx(quad_rim.point(-t), abs=1e-9)
    assert back.point(back.corners) == pytest.approx(QUAD[[0, 3, 2, 1]], abs=1e-9)
    inside = t[~np.isin(t, [0.0])] + 1e-3
    assert back.derivative(inside) == pytest.approx(-quad_rim.derivative(-inside), abs=1e-6)
    assert quad_rim.turning(quad_rim.corners) == pytest.approx(
        back.turning(back.corners)[[0, 3, 2, 1]], abs=1e-9
    )
    assert quad_rim.scaled(2.0).length == pytest.approx(2.0 * quad_rim.length, rel=1e-14)
    assert quad_rim.moved([1.0, 2.0, 3.0]).point(0.0) == pytest.approx([1.0, 2.0, 3.0])
    mirror = quad_rim.transformed(np.diag([1.0, 1.0, -1.0]))
    assert mirror.point(t)[:, 2] == pytest.approx(-quad_rim.point(t)[:, 2])
    assert quad_rim.size == pytest.approx(np.linalg.norm([12000, 9000, 4000]), rel=1e-12)
    assert quad_rim.named("roof").name == "roof"


def test_planar():
    angle = np.radians(30.0)
    tilt = np.array(
        [[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]]
    )
    ring = lobed(np.arange(60) / 60) * [1, 1, 0]
    rim = Rim.through(ring).transformed(tilt, [10.0, 20.0, 30.0])
    away, centre, normal = rim.planar()
    assert away <= 1e-9
    assert normal == pytest.approx(tilt @ [0, 0, 1], abs=1e-12)
    assert (centre - [10.0, 20.0, 30.0]) @ normal == pytest.approx(0.0, abs=1e-9)
    assert rim.reversed().planar()[2] == pytest.approx(-normal, abs=1e-9)
    wavy, _, up = Rim.through(lobed(np.arange(60) / 60)).planar()
    assert wavy == pytest.approx(300.0, abs=20.0)  # the plane fits arc length, so it tilts
    assert up == pytest.approx([0, 0, 1], abs=3e-2)


def circle(n, radius=1000.0):
    a = TURN * np.arange(n) / n
    return radius * np.stack([np.cos(a), np.sin(a), 0 * a], axis=1)


def test_corners_among_points():
    for n in (3, 4, 5, 6, 7, 8):
        assert corner_points(circle(n)).tolist() == list(range(n))
    for n in (9, 10, 16, 100):
        assert corner_points(circle(n)).tolist() == []
    s = np.linspace(0.0, 1.0, 10, endpoint=False)[:, None]
    sides = [a + s * (b - a) for a, b in zip(QUAD, np.roll(QUAD, -1, axis=0), strict=True)]
    assert corner_points(np.concatenate(sides)).tolist() == [0, 10, 20, 30]
    # A rectangle whose corners are drawn round, three chords for each quarter.
    a = np.radians([0, 30, 60, 90])
    quarter = np.stack([np.cos(a), np.sin(a), 0 * a], axis=1)
    spin = [
        np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) for c, s in ((1, 0), (0, 1), (-1, 0), (0, -1))
    ]
    centres = np.array([[5, 5, 0], [-5, 5, 0], [-5, -5, 0], [5, -5, 0]])
    rounded = [c + quarter @ m.T for c, m in zip(centres, spin, strict=True)]
    assert corner_points(np.concatenate(rounded)).tolist() == []
    # One kink of 30 degrees in a smooth curve stands out; with a higher limit it does not.
    ring = circle(100)
    kinked = np.concatenate([ring[:50], ring[50:] @ np.diag([1.0, 1.0, 1.0])])
    kinked[:, 1] *= np.where(np.arange(100) < 50, 1.0, 0.3)
    kinked[:, 2] += np.where(np.arange(100) < 50, 0.0, 300.0 * np.sin(TURN * np.arange(100) / 100))
    assert corner_points(kinked, 10.0).tolist() == [0, 50]
    assert corner_points(kinked, 180.0).tolist() == []


def test_rounding_is_smooth_and_keeps_its_word(quad_rim):
    radius = 800.0
    soft = quad_rim.smoothed(radius)
    assert len(soft.corners) == 0
    t = np.linspace(0.0, 1.0, 20001)
    for order in (1, 2, 3):
        scale = np.abs(soft.derivative(t, order)).max()
        gap = soft.derivative(soft.breaks[:-1], order) - soft.derivative(
            soft.breaks[:-1], order, before=True
        )
        assert np.abs(gap).max() <= 1e-9 * scale
    turns = np.radians(quad_rim.turning(quad_rim.corners))
    for corner, turn in zip(QUAD, turns, strict=True):
        away = np.linalg.norm(soft.point(t) - corner, axis=1).min()
        # Bézier's middle point, whose controls go on along the sides as fast as a circular arc.
        steps = 2 * np.arange(4) * (turn / 2) / np.tan(turn / 2) / 7
        stated = 2 * radius * np.sin(turn / 2) * ((1 - steps) @ [1, 7, 21, 35]) / 128
        assert away == pytest.approx(stated, rel=1e-3)
        named = radius * np.sin(turn / 2) * (1 - 11 / 32 * turn / np.tan(turn / 2))
        assert stated == pytest.approx(named, rel=1e-12)
    # Outside the radius nothing moves.
    far = np.linalg.norm(soft.point(t)[:, None] - QUAD[None], axis=2).min(axis=1) > 1.001 * radius
    steps = np.roll(QUAD, -1, axis=0) - QUAD
    away = np.stack(
        [
            np.linalg.norm(np.cross(soft.point(t[far]) - a, d), axis=1) / np.linalg.norm(d)
            for a, d in zip(QUAD, steps, strict=True)
        ]
    ).min(axis=0)
    assert away.max() <= 1e-9


def test_rounding_of_chosen_corners_and_curved_sides(quad_rim):
    some = quad_rim.smoothed(500.0, which=[1, 3])
    assert some.point(some.corners) == pytest.approx(QUAD[[0, 2]], abs=1e-9)
    assert quad_rim.smoothed(500.0, which=[]).corners.tolist() == quad_rim.corners.tolist()
    slice_ = Rim.through(np.concatenate([circle(64)[:40], [[0.0, 0, 0]]]), corners=[0, 39, 40])
    soft = slice_.smoothed(200.0)
    for order in (1, 2, 3):
        scale = np.abs(soft.derivative(np.linspace(0, 1, 2000), order)).max()
        gap = soft.derivative(soft.breaks, order) - soft.derivative(soft.breaks, order, before=True)
        assert np.abs(gap).max() <= 1e-6 * scale
    with pytest.raises(DesignError, match=r"canopy: a radius of 6000 mm does not fit at corner 0"):
        quad_rim.smoothed(6000.0)
    with pytest.raises(DesignError, match=r"radius -1\.0 mm"):
        quad_rim.smoothed(-1.0)
    with pytest.raises(DesignError, match=r"corners \[7\] of 4"):
        quad_rim.smoothed(100.0, which=[7])


@pytest.mark.parametrize(
    ("points", "message"),
    [
        (np.empty((0, 3)), "rim: 0 points; a closed curve needs at least 3"),
        ([[0, 0, 0], [900, 0, 0]], "2 points"),
        ([[0, 0, 0], [900, 0, 0], [0, 0, 0]], "2 points"),
        ([[1, 2, 3]] * 4, r"all 4 points are at \(1, 2, 3\)"),
        ([[0, 0], [1, 0], [0, 1]], r"shape \(3, 2\)"),
        ([[0, 0, 0], [900, 0, np.nan], [0, 900, 0]], r"point 1 is \[900.0, 0.0, nan\]"),
        ([[0, 0, 0], [900, 0, 0], [900, 0, 0], [0, 900, 0]], r"points 1 and 2 are both at \(900"),
    ],
)
def test_points_that_make_no_curve(points, message):
    with pytest.raises(DesignError, match=message):
        Rim.through(points)


def test_a_corner_that_is_no_point():
    with pytest.raises(DesignError, match="corner 9 is no index of its 9 points"):
        Rim.through(circle(9), corners=[9])


@pytest.mark.parametrize("step", [[0.0, 0.0, 3.0], [15.0, 0.0, 0.0], [-10.0, -20.0, 0.0]])
def test_overshoot_is_refused_where_it_happens(step):
    """A point a little off beside another throws the interpolant out in the chords next to it."""
    points = np.insert(circle(24), 7, circle(24)[6] + step, axis=0)
    with pytest.raises(DesignError, match=r"lobe: between points [5-8] and [6-9] near .* leaves"):
        Rim.through(points, name="lobe")


def test_uneven_spacing_without_overshoot_is_allowed():
    dense = circle(48)
    for chosen in (
        [0, 1, 2, 3, 4, 5, 6, 18, 30, 42],
        [0, 12, 24, 36],
        [0, 1, 12, 13, 24, 25, 36, 37],
    ):
        rim = Rim.through(dense[chosen])
        assert np.abs(np.linalg.norm(rim.samples(200)[1], axis=1) - 1000.0).max() < 40.0


def test_a_piece_without_length_is_refused():
    pieces = [line(np.zeros(3), np.eye(3)[0]), line(np.eye(3)[0], np.eye(3)[0])]
    with pytest.raises(DesignError, match=r"piece 2 of 2 at \(1, 0, 0\) has no length"):
        Rim.joined(pieces)

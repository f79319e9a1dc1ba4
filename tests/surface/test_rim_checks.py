"""What is refused in rims, and that what is allowed is not."""

import numpy as np
import pytest

from phexfab.errors import DesignError
from phexfab.surface.rims.checks import check_rims, check_size, checked
from phexfab.surface.rims.rim import Rim

A = 2.0 * np.pi * np.arange(64) / 64


def ring(radius=1000.0, height=0.0, start=0.0, centre=(0.0, 0.0)):
    a = A + start
    return np.stack(
        [centre[0] + radius * np.cos(a), centre[1] + radius * np.sin(a), height + 0 * a], axis=1
    )


def eight(lift):
    """A figure of eight whose branches pass at a distance of 2 · lift."""
    wave = np.stack([1000 * np.sin(A), 500 * np.sin(2 * A), lift * np.cos(A)], axis=1)
    return Rim.through(wave, name="eight")


def polygon(points, name="rim"):
    return Rim.through(np.array(points, dtype=float), corners=range(len(points)), name=name)


def test_crossings_are_found_where_they_are():
    with pytest.raises(DesignError, match=r"rim crosses or touches itself near \(500, 500, 0\)"):
        check_rims([polygon([[0, 0, 0], [1000, 1000, 0], [1000, 0, 0], [0, 1000, 0]])])
    with pytest.raises(DesignError, match=r"eight crosses .* near \(0, 0, 0\)"):
        check_rims([eight(0.0)])


def test_near_misses_are_told_from_touches():
    size = eight(0.0).size
    check_rims([eight(1.0)])
    check_rims([eight(2e-6 * size)])  # branches at 4e-6 of the size
    with pytest.raises(DesignError, match="eight crosses or touches itself"):
        check_rims([eight(0.3e-6 * size)])


def test_sharp_but_honest_rims_pass():
    check_rims([polygon([[0, 0, 0], [10000, 0, 0], [0, 600, 0]])])  # a corner of 3.4 degrees
    check_rims([polygon([[0, 0, 0], [1000, 0, 0], [1000, 1, 0], [0, 1, 0]])])  # a slit
    for n in (12, 256, 3000):
        a = 2.0 * np.pi * np.arange(n) / n
        check_rims([Rim.through(1000 * np.stack([np.cos(a), np.sin(a), 0 * a], axis=1))])


def test_spikes_and_slits_are_touches():
    with pytest.raises(DesignError, match=r"turns by 179\.\d+° at \(10000, 0, 0\).*less than 178"):
        check_rims([polygon([[0, 0, 0], [10000, 0, 0], [0, 100, 0]])])
    with pytest.raises(DesignError, match="crosses or touches itself"):
        check_rims([polygon([[0, 0, 0], [1000, 0, 0], [1000, 9e-4, 0], [0, 9e-4, 0]])])


def test_several_rims_are_apart():
    lower, upper = Rim.through(ring(), name="a"), Rim.through(ring(height=300.0), name="b")
    check_rims([lower, upper])
    beside = Rim.through(ring(centre=(2000.0, 0.0)), name="c")
    with pytest.raises(DesignError, match=r"a and c touch near \(1000, -?0(\.\d+)?, 0\)"):
        check_rims([lower, upper, beside])
    linked = Rim.through(ring(centre=(1000.0, 0.0))[:, [0, 2, 1]], name="link")
    check_rims([lower, linked])  # linked, but nowhere near


def test_a_rim_given_twice_is_named():
    one = Rim.through(ring(), name="a")
    two = Rim.through(ring(start=0.05), name="b").reversed()
    with pytest.raises(DesignError, match=r"a and b are the same curve, through \(.*remove one"):
        check_rims([one, two])


def test_random_crossings_against_an_exact_plane_count():
    """Random closed polygons in a plane: refused exactly if two sides cross (shapely's view)."""
    from shapely.geometry import LinearRing

    random = np.random.default_rng(4)
    simple = 0
    for _ in range(60):
        n = int(random.integers(4, 7))
        points = np.column_stack([random.uniform(0, 1000, (n, 2)), np.zeros(n)])
        turn = polygon(points)
        allowed = LinearRing(points[:, :2]).is_simple
        if turn.turning(turn.corners).max() > 178.0:
            continue
        simple += allowed
        if allowed:
            check_rims([turn])
        else:
            with pytest.raises(DesignError, match="crosses or touches itself"):
                check_rims([turn])
    assert 10 < simple < 50


@pytest.mark.parametrize(
    ("factor", "unit", "message"),
    [
        (0.012, "mm", "probably in m: say unit = 'm'"),
        (1e4, "mm", "probably in um: say unit = 'um'"),
        (12.0 * 1000, "m", "probably in mm: say unit = 'mm'"),
        (1e12, "mm", "scale it first"),
    ],
)
def test_sizes_that_tell_of_a_wrong_unit(factor, unit, message):
    rim = Rim.through(ring()).scaled(factor)
    with pytest.raises(DesignError, match=message):
        check_size([rim], unit, "roof.csv")


def test_checked_smooths_and_checks_again():
    square = polygon([[0, 0, 0], [1000, 0, 0], [1000, 1000, 0], [0, 1000, 0]])
    (soft,) = checked([square], "mm", "x", smooth=200.0)
    assert len(soft.corners) == 0
    (same,) = checked([square], "mm", "x")
    assert same is square

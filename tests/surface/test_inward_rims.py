"""Rims that turn inwards: how far a corner may be rounded, and films that go on beyond it."""

import numpy as np
import pytest

from phexfab.errors import DesignError
from phexfab.surface.disc_films.extension import extended
from phexfab.surface.disc_films.graph_fit import BoundaryValues, pole_fit, polynomial_fit
from phexfab.surface.disc_films.graph_patches import graph_curve
from phexfab.surface.disc_films.plateau import plateau
from phexfab.surface.domain import Disc, Star
from phexfab.surface.rims.inward import inward_radius, rounded_inward
from phexfab.surface.rims.rim import Rim

SQUARE = [[0, 0, 0], [1000, 0, 0], [1000, 1000, 0], [0, 1000, 0]]


def test_a_rounding_may_take_most_of_sides_that_end_sharp():
    rim = Rim.through(np.array(SQUARE, float), corners=range(4))
    assert len(rim.smoothed(800.0, [1]).corners) == 3
    with pytest.raises(DesignError, match="at most 499 mm"):
        rim.smoothed(800.0, [1, 2])
    with pytest.raises(DesignError, match="at most 900 mm"):
        rim.smoothed(950.0, [1])


def test_poles_resolve_what_polynomials_cannot():
    t = 2 * np.pi * np.arange(1024) / 1024
    places, steps = np.exp(1j * t), 2j * np.pi / 1024 * np.exp(1j * t)

    def sharp(z):
        return 0.01 / (1.12 - z)

    given = BoundaryValues(places, steps, sharp(places), 0j)
    wide = Disc(0, 1.05)
    off = [
        np.abs(fit(places) - sharp(places)).max()
        for fit in (
            polynomial_fit(given, wide, 48, 1e-3 * 0.05**2),
            pole_fit(given, wide, 0.05, 1e-3 * 0.05**2),
        )
    ]
    assert off[1] < 0.5 * off[0]


@pytest.mark.parametrize(("turn", "least"), [(60.0, 0.62), (90.0, 0.74), (120.0, 0.75)])
def test_a_rounding_bends_nearly_as_little_as_an_arc(turn, least):
    half = np.radians(turn) / 2
    ends = 1000 * np.array([[-np.cos(half), 0, 0], [np.cos(half), 0, 0]])
    top = [0, 1000 * np.sin(half), 0]
    rim = Rim.through(np.array([ends[0], top, ends[1]]), corners=range(3))
    soft = rim.smoothed(500.0, [1])
    t = np.linspace(0, 1, 40001)
    way, bend = soft.derivative(t, 1), soft.derivative(t, 2)
    speed = np.linalg.norm(way, axis=1)
    radius = speed**3 / np.maximum(np.linalg.norm(np.cross(way, bend), axis=1), 1e-9)
    arc = 500.0 / np.tan(half)  # between the same ends
    assert least * arc < radius.min() < arc


def test_patches_hold_where_a_gauss_map_is_much_larger_outside():
    # On a circle round all of the disc, the power drowns the pole.
    def g(z):
        return 0.5 * z**13 + 0.003 / (1.15 - z)

    curve = graph_curve(g, Disc(), np.eye(3))
    assert curve is not None
    z = Disc().grid(60)
    assert np.abs(curve.derivatives(z, (1,))[0][:, 2] / 2 - g(z)).max() < 1e-12


def test_patches_agree_to_the_very_border():
    angle = 2 * np.pi * np.arange(400) / 400
    domain = Star(0.1, reach=1 + 0.2 * np.cos(3 * angle))
    border = domain.border_at(np.zeros(40000, int), np.arange(40000) / 40000)
    poles = domain.centre + 1.04 * (border[::400] - domain.centre)

    def g(z):
        return 1e-3 / (z[:, None] - poles) @ np.ones(len(poles))

    curve = graph_curve(g, domain, np.eye(3))
    assert curve is not None
    # A little further out there are squares that reach into the domain at a tip only.
    wide = domain.centre + 1.0025 * (border - domain.centre)
    whole = curve.derivatives(wide, (0,))[0][:, 2]
    ahead, steps = np.roll(wide, -1), np.roll(wide, -1) - wide
    known = steps * 2 * g(0.5 * (wide + ahead))
    assert np.abs(np.roll(whole, -1) - whole - known).max() < 1e-9


def test_a_film_goes_on_beyond_a_rounded_corner():
    ring = 1000 * np.array(
        [[0, 0, 3], [12, 0, 3.6], [12, 5, 3.1], [7, 5, 3.4], [7, 9, 3], [0, 9, 3.7]]
    )
    (rim,) = rounded_inward([Rim.through(ring, corners=range(6))], 2900.0)
    film = plateau(rim, tolerance=1e-7)
    wide = extended(film, 900.0)
    assert isinstance(wide.domain, Star)
    assert wide.margin > 0.9 * 900.0
    # A film inside one that reaches beyond it: every place is nearer than its rim is.
    assert wide.rim_distance < 4e-3 * 900.0
    inside = 0.9 * np.exp(2j * np.pi * np.arange(100) / 100)
    points = film.surface.point(inside)
    start = np.full(len(points), wide.domain.centre)
    feet = wide.surface.closest_parameter(points, start)
    apart = np.linalg.norm(wide.surface.point(feet) - points, axis=1)
    assert apart.max() < wide.rim_distance


def test_how_tightly_a_rim_turns_inwards():
    rim = Rim.through(np.array(SQUARE, float), corners=range(4))
    assert inward_radius(rim) == np.inf
    ell = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [1, 1, 0], [1, 2, 0], [0, 2, 0]]
    sharp = Rim.through(1000 * np.array(ell, float), corners=range(6))
    assert inward_radius(sharp) == inward_radius(sharp.reversed()) == 0.0
    (soft,) = rounded_inward([sharp], 800.0)
    assert inward_radius(soft) == pytest.approx(0.747 * 800, rel=2e-3)
    # r = 2 + cos 2φ is r = 1 at its waist, with r'' = 4: curvature (r² − r r'')/r³ = −3.
    angle = 2 * np.pi * np.arange(400) / 400
    waist = (
        1000
        * (2 + np.cos(2 * angle))[:, None]
        * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    )
    assert inward_radius(Rim.through(waist)) == pytest.approx(1000 / 3, rel=1e-3)

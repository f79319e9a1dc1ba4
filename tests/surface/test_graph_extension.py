"""Films over a plane, continued by their Gauss map; domains seen from a centre."""

import numpy as np
import pytest
from plateau_samples import enneper_rim

from phexfab.surface.classical import enneper
from phexfab.surface.disc_films.extension import extended
from phexfab.surface.disc_films.graph_extension import continued_over_plan
from phexfab.surface.disc_films.graph_patches import graph_curve
from phexfab.surface.disc_films.plateau import plateau
from phexfab.surface.domain import Disc, Star
from phexfab.surface.quadtree import cover
from phexfab.surface.rims.rim import Rim
from phexfab.surface.umbilics import hopf_zeros, umbilics

ANGLE = 2 * np.pi * np.arange(400) / 400
OVAL = Star(0.3 + 0.1j, reach=1 + 0.3 * np.cos(2 * ANGLE))
CANOPY = 1000 * np.array([[0, 0, 0], [12, 0, 3], [12, 9, 0.5], [0, 9, 4.0]])


def shares(film):
    return np.ones(len(film.angles))


def test_what_a_centre_sees():
    border = OVAL.borders(1000)[0]
    inner, outer = (OVAL.centre + k * (border - OVAL.centre) for k in (0.999, 1.001))
    assert OVAL.contains(inner).all() and not OVAL.contains(outer).any()
    assert OVAL.contains(outer, 0.01).all()
    assert np.abs(OVAL.clipped(outer) - border).max() < 1e-12
    assert np.array_equal(OVAL.clipped(inner), inner)
    assert OVAL.widened(0.01).contains(outer).all()
    away = np.array([2.0, 0.95j, 0.3 + 0.1j])
    apart = np.abs(away[:, None] - border).min(axis=1)
    inside = OVAL.contains(away)
    for reach in (0.01, 0.1, 0.3):
        assert np.array_equal(OVAL.is_outside(away, reach), ~inside & (apart > reach + 0.01))


def test_zeros_in_what_a_centre_sees():
    places = np.array([0.3 + 0.75j, 0.3 + 0.85j, 1.5 + 0.1j, 1.7 + 0.1j])
    found = hopf_zeros(lambda z: np.prod([z - p for p in places], axis=0), OVAL)
    assert np.allclose(found.places, np.sort_complex(places[OVAL.contains(places)]), atol=1e-12)
    assert len(found) == 1 + OVAL.contains(places[1:]).sum()


def test_squares_cover_a_domain_once():
    def owners(middle, half):
        return np.where(half < 0.05 * (1 + np.abs(middle)), np.arange(len(middle)), -1)

    tree = cover(OVAL, owners)
    assert (tree.owner_at(OVAL.grid(101)) >= 0).all()
    assert tree.owner_at(np.array([9.0 + 0j]))[0] == -1
    assert len(np.unique(tree.keys)) == len(tree.keys) and len(tree.levels) > 1


def test_a_curve_in_patches_is_null_and_its_own_derivative():
    # g = z gives Enneper's surface: Φ = (z − z³/3, i(z + z³/3), z²).
    disc = Disc(0.2, 0.7)
    curve = graph_curve(lambda z: z, disc, np.eye(3))
    assert curve is not None
    z = disc.grid(40)
    whole, phi, bend = curve.derivatives(z, (0, 1, 2))
    cube = z**3 / 3
    exact = np.stack([z - cube, 1j * (z + cube), z**2], -1)
    gap = whole - exact
    assert np.abs(gap - gap[0]).max() < 1e-14
    assert np.abs((phi**2).sum(1)).max() < 1e-15
    assert np.abs(bend - np.stack([-2 * z, 2j * z, 2 + 0 * z], -1)).max() < 1e-12


def test_a_gauss_map_that_is_rough_is_left_alone():
    assert graph_curve(lambda z: np.sqrt(z - 0.1), Disc(), np.eye(3)) is None


@pytest.mark.parametrize("turn", [0.0, 1.1])
def test_ennepers_surface_goes_on_as_itself(turn):
    # Tilted, so that the axis has to be found.
    c, s = np.cos(turn), np.sin(turn)
    tilt = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    rim = Rim.through(enneper_rim(0.6).point(np.arange(200) / 200) @ tilt.T)
    film = plateau(rim)
    made = continued_over_plan(film, 60.0, shares(film))
    assert made is not None and made.apart < 1e-3
    edge = made.surface.point(made.domain.borders(60)[0]) @ tilt
    known = enneper().scaled(1000.0)
    feet = known.closest_parameter(edge, (edge[:, 0] - 1j * edge[:, 1]) / 500)
    assert np.linalg.norm(known.point(feet) - edge, axis=1).max() < 0.05
    z = made.domain.grid(20)
    assert np.abs(made.surface.mean_curvature(z) * made.surface.scale).max() < 1e-12


@pytest.mark.parametrize("margin", [1500.0, 600.0, 150.0])
def test_a_margin_however_narrow_beyond_corners(margin):
    rim = Rim.through(CANOPY, corners=range(4))
    film = plateau(rim, tolerance=1e-7)
    wide = extended(film, margin)
    assert isinstance(wide.domain, Star)
    assert wide.rim_distance < 2e-3 * margin
    assert wide.margin > 0.9 * margin
    # No umbilics but those just beyond acute corners.
    assert len(umbilics(wide.surface, wide.domain)) <= 4
    inside = wide.core.grid(30)
    inside = wide.core.centre + 0.9 * (inside - wide.core.centre)
    points = film.surface.point(0.97 * np.exp(1j * ANGLE))
    near = inside[np.abs(inside - wide.core.centre).argmin()]
    feet = wide.surface.closest_parameter(points, np.full(len(points), near))
    assert np.linalg.norm(wide.surface.point(feet) - points, axis=1).max() < 2e-3 * margin


def test_films_that_stand_too_steep_go_another_way():
    # Enneper's patch up to |g| = 1.2 does not lie over a plane.
    film = plateau(enneper_rim(1.2))
    assert continued_over_plan(film, 60.0, shares(film)) is None

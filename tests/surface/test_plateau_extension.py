"""Films that go on beyond their rim."""

import numpy as np
import pytest
from plateau_samples import enneper_rim, lobed
from scipy.spatial import cKDTree

from phexfab.errors import SurfaceError
from phexfab.surface.classical import enneper
from phexfab.surface.disc_films.extension import extended, film_with_margin
from phexfab.surface.disc_films.plateau import plateau
from phexfab.surface.rims.rim import Rim

CANOPY = 1000 * np.array([[0, 0, 0], [12, 0, 3], [12, 9, 0.5], [0, 9, 4.0]])


def fine(rim, count=3000):
    return rim.samples(count)[1]


def checked(wide, rim, margin):
    """What every extension holds: margin and distances as they are reported, H = 0, no folds."""
    surface, middle = wide.surface, wide.domain.centre
    border = wide.domain.borders(1500)[0]
    reached = cKDTree(fine(rim)).query(surface.point(border))[0].min()
    assert reached == pytest.approx(wide.margin, rel=0.02)
    assert reached > 0.85 * margin
    parts = zip((0.6, 0.9, 0.999), (50, 20, 20), strict=True)
    z = np.concatenate([middle + share * (border[::k] - middle) for share, k in parts])
    assert np.all(wide.contains(z)) and not wide.contains(middle + 1.01 * (border[0] - middle))
    assert np.abs(surface.mean_curvature(z) * surface.scale).max() < 1e-6
    assert np.all(wide.contains(wide.rim_parameters))
    # Once around, without a fold.
    turn = np.unwrap(np.angle(np.append(wide.rim_parameters, wide.rim_parameters[0]) - middle))
    assert abs(abs(turn[-1] - turn[0]) - 2 * np.pi) < 1e-9
    assert np.sign(np.diff(turn)).min() == np.sign(np.diff(turn)).max()


def test_a_series_that_converges_is_used_further_out():
    wide = film_with_margin(enneper_rim(0.7), 60.0)
    known = enneper().scaled(1000.0)
    checked(wide, enneper_rim(0.7), 60.0)
    assert wide.rim_distance < 1e-6
    edge = wide.surface.point(wide.domain.borders(40)[0])
    feet = known.closest_parameter(edge, (edge[:, 0] - 1j * edge[:, 1]) / 500)
    assert np.abs(known.point(feet) - edge).max() < 1e-4


def test_beyond_a_rim_the_second_film_is_near_the_first_ones_continuation():
    # Enneper's patch by its rim as a spline: too rough for its series to be used further out.
    rim = Rim.through(enneper_rim(0.7).point(np.arange(40) / 40))
    wide = film_with_margin(rim, 80.0)
    checked(wide, rim, 80.0)
    assert wide.rim_distance < 0.03
    known = enneper().scaled(1000.0)
    edge = wide.surface.point(wide.domain.borders(40)[0])
    feet = known.closest_parameter(edge, (edge[:, 0] - 1j * edge[:, 1]) / 500)
    assert np.linalg.norm(known.point(feet) - edge, axis=1).max() < 0.5


@pytest.mark.parametrize(
    ("rim", "margin", "apart"),
    [
        (lobed(3, 0.3), 150.0, 0.15),
        (Rim.through(CANOPY, corners=range(4)), 900.0, 3.5),
    ],
    ids=["three lobes", "canopy"],
)
def test_the_rim_lies_on_the_extended_film(rim, margin, apart):
    film = plateau(rim)
    wide = extended(film, margin)
    checked(wide, rim, margin)
    assert wide.film is film
    assert wide.rim_distance < apart
    points = fine(rim, 200)
    near = wide.rim_parameters[cKDTree(wide.surface.point(wide.rim_parameters)).query(points)[1]]
    feet = wide.surface.closest_parameter(points, near)
    away = np.linalg.norm(wide.surface.point(feet) - points, axis=1)
    assert away.max() < 1.5 * wide.rim_distance + 1e-6


def test_the_edge_on_a_mirror_plane_is_extended_too():
    corners = 1000 * np.array([[1, 1, 1], [-1, 1, -1], [-1, -1, 1], [1, -1, -1.0]])
    u = np.linspace(0, 1, 9)[1:-1, None]
    bow = corners[3] + (corners[1] - corners[3]) * u + np.sin(np.pi * u) * [0, 0, 700.0]
    rim = Rim.through(np.vstack([corners[1:], bow]), corners=[0, 1, 2])
    wide = extended(plateau(rim, samples=256, free=[2]), 200.0)
    assert wide.rim_distance < 0.05 * 200.0
    # Beyond the plane the film is the mirror image of itself.
    across = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
    (slid,) = np.nonzero(np.isnan(wide.film.boundary))
    middle = wide.film.points[slid[len(slid) // 2]]
    z = wide.rim_parameters[cKDTree(wide.surface.point(wide.rim_parameters)).query(middle)[1]]
    foot = wide.surface.closest_parameter(middle[None], [z])[0]
    room = wide.domain.reach_at(foot - wide.domain.centre) - abs(foot - wide.domain.centre)
    step = 0.05 * np.exp(1j * np.linspace(0, 2 * np.pi, 9)[:-1])
    beside = wide.surface.point(foot + step * room)
    mirrored = beside - 2 * (beside @ across)[:, None] * across
    feet = wide.surface.closest_parameter(mirrored, np.full(len(beside), foot))
    assert np.linalg.norm(wide.surface.point(feet) - mirrored, axis=1).max() < 0.5


def test_a_margin_that_cannot_be_had_is_refused():
    film = plateau(lobed(2), samples=128)
    for margin in (0.0, -5.0, 2000.0):
        with pytest.raises(SurfaceError, match="margin of"):
            extended(film, margin)


def test_a_corner_that_turns_inwards_is_named():
    plan = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2.0]])
    height = 0.3 * np.cos(2 * plan[:, 0] + plan[:, 1])
    rim = Rim.through(1000 * np.column_stack([plan, height]), corners=range(6), name="ell")
    with pytest.raises(SurfaceError, match=r"ell: the film .* near \[1\d{3}.0, 1\d{3}.0") as caught:
        film_with_margin(rim, 200.0)
    assert "smaller panels" in str(caught.value)

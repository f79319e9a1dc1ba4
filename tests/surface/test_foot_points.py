"""Foot points are perpendicular and nearest; normals are met, also where g is infinite."""

import numpy as np
import pytest
from scipy.optimize import brentq
from surface_samples import MAKERS, differences, made, parameters, room

from phexfab.errors import SurfaceError
from phexfab.surface import from_weierstrass, surface

EVERY = pytest.mark.parametrize("name", list(MAKERS))


def nearby(name, share):
    """Guesses a little beside the parameters, in a direction that differs from one to the next."""
    z = parameters(name)
    return z + share * room(name, z) * np.exp(1j * np.arange(len(z)))


@EVERY
@pytest.mark.parametrize("height", [0.0, 0.3, -0.3])
def test_the_foot_of_a_point_above_the_surface(name, height):
    """A point at the height h < 1/κ over X(z) has its foot at z."""
    smooth, z = made(name), parameters(name)
    reach = height / smooth.principal_curvatures(z)[:, 1]
    points = smooth.point(z) + reach[:, None] * smooth.normal(z)
    foot = smooth.closest_parameter(points, nearby(name, 0.02))
    assert (np.abs(foot - z) / room(name, z)).max() < 1e-9


@EVERY
def test_the_line_to_the_foot_is_perpendicular_and_the_foot_is_nearest(name):
    smooth, z = made(name), parameters(name)[:25]
    rough = np.random.default_rng(3).uniform(-1, 1, (len(z), 3))
    points = smooth.point(z) + 0.05 * rough / smooth.principal_curvatures(z)[:, 1:]
    foot = smooth.closest_parameter(points, z)
    gap = points - smooth.point(foot)
    for tangent in differences(smooth.point, foot, 0.02 * room(name, foot))[:2]:
        cosine = (gap * tangent).sum(-1) / np.linalg.norm(tangent, axis=1)
        assert np.allclose(cosine / np.linalg.norm(gap, axis=1), 0, atol=1e-8)
    for turn in np.exp(1j * np.arange(6)):
        beside = smooth.point(foot + 0.01 * room(name, foot) * turn)
        assert (np.linalg.norm(points - beside, axis=1) > np.linalg.norm(gap, axis=1)).all()


@EVERY
def test_the_place_of_a_normal(name):
    smooth, z = made(name), parameters(name)
    found = smooth.parameter_of_normal(smooth.normal(z), nearby(name, 0.05))
    assert (np.abs(found - z) / room(name, z)).max() < 1e-10
    assert np.allclose(smooth.normal(found), smooth.normal(z), atol=1e-13)


@pytest.mark.parametrize("z", [0.0, 1e-9, 0.01 + 0.02j, 0.9j, 1.3])
def test_where_the_gauss_map_is_infinite(z):
    """Enneper's surface turned upside down has its pole of g in the middle."""
    smooth, upright = made("own, g infinite"), surface("enneper").scaled(2.5)
    assert np.allclose(smooth.point(z), upright.point(z) * [-1, 1, 1], atol=1e-14)
    assert np.allclose(smooth.normal(z), upright.normal(z) * [1, -1, -1], atol=1e-15)
    found = smooth.parameter_of_normal(smooth.normal(z), z + 0.1 - 0.05j)
    assert abs(found - z) < 1e-13
    above = smooth.point(z) + 0.5 * smooth.normal(z)
    assert abs(smooth.closest_parameter(above, z + 0.1 - 0.05j) - z) < 1e-12


@pytest.mark.parametrize("u", [-4.0, -8.0, 8.0])
def test_normals_far_out_on_the_catenoid(u):
    smooth = surface("catenoid")
    z = u + 0.7j
    assert abs(smooth.parameter_of_normal(smooth.normal(z), z + 0.2) - z) < 1e-12
    assert np.linalg.norm(smooth.normal(z)) == pytest.approx(1, abs=1e-15)


def test_a_normal_across_the_whole_sphere_is_found():
    smooth = surface("catenoid")
    z = np.array([1.0 + 1.0j, -1.0 - 0.5j, 0.8 - 1.2j])
    assert np.abs(smooth.parameter_of_normal(smooth.normal(z), 0.0) - z).max() < 1e-12


def test_a_stationary_gauss_map_is_refused_by_name():
    smooth = surface("enneper", order=2)
    with pytest.raises(SurfaceError) as caught:
        smooth.parameter_of_normal([[0.0, 0.6, 0.8]], np.zeros(1))
    words = "enneper of order 2: no parameter near z = 0 has the normal [0.0, 0.6, 0.8]"
    assert words in str(caught.value)


def test_a_foot_far_away_from_the_guess():
    """The foot of a point on the catenoid's axis: cosh u sinh u = height - u."""
    smooth = from_weierstrass(np.exp, lambda z: np.exp(-z), name="own catenoid")
    centred = [1.0, 0.0, 0.0]  # X(0) is the origin here, so the axis is at x = 1
    foot = smooth.closest_parameter([[1.0, 0.0, 1e6]], np.array([3.0 + 0j]))
    u = brentq(lambda u: np.cosh(u) * np.sinh(u) + u - 1e6, 0, 10, xtol=1e-14)
    assert foot.real == pytest.approx(u, abs=1e-9)
    radius = np.linalg.norm((smooth.point(foot) - centred)[0, :2])
    assert radius == pytest.approx(np.cosh(u), rel=1e-9)


def test_a_guess_at_a_branch_point_is_refused_by_name():
    """There the surface has no tangent plane to step in."""
    with pytest.raises(SurfaceError, match="bour: no foot point was found from z = 0 for the poi"):
        surface("bour").closest_parameter([[0.1, 0.2, 0.3]], np.zeros(1))

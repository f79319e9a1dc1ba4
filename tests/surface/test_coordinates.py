"""w = ∫ √Q dz: its inverse, its metric, its lines; null curves against quadrature."""

from dataclasses import replace

import numpy as np
import pytest
from surface_samples import MAKERS, SCALE, differences, forms, made, parameters, spread

from phexfab.errors import SurfaceError
from phexfab.surface import surface
from phexfab.surface.lemniscate import QUARTER, arcsl, sl

EVERY = pytest.mark.parametrize("name", list(MAKERS))
CLOSED = [name for name in MAKERS if made(name).null_curve is not None]
CHARTED = [name for name in MAKERS if made(name).to_curvature is not None]


@EVERY
def test_parameter_and_curvature_coordinates_are_inverse(name):
    smooth, w = made(name), spread(name)
    z = smooth.parameter(w)
    assert np.abs(smooth.curvature_coordinates(z) - w).max() < 1e-12
    assert np.abs(smooth.curvature_coordinates(smooth.base)) < 1e-15
    again = smooth.parameter(smooth.curvature_coordinates(z))
    assert np.abs(again - z).max() < 1e-10


@EVERY
def test_the_metric_is_dw_squared_over_kappa(name):
    """ds² = scale² |dw|²/κ with κ unscaled, and the coordinate lines are curvature lines."""
    smooth, w = made(name), spread(name)
    u0, u1, v0, v1 = smooth.rectangle
    step = 0.01 * min(u1 - u0, v1 - v0)
    first, second, normal = forms(differences(lambda p: smooth.point(smooth.parameter(p)), w, step))
    kappa = smooth.principal_curvatures(smooth.parameter(w))[:, 1]
    metric = SCALE**2 / (kappa * SCALE)
    assert np.allclose(first / metric[:, None, None], np.eye(2), atol=2e-7)
    shape = second / (metric * kappa)[:, None, None]
    assert np.allclose(shape, np.diag([-1.0, 1.0]), atol=2e-6)
    assert np.allclose(normal, smooth.normal(smooth.parameter(w)), atol=1e-7)


@EVERY
def test_principal_directions_follow_the_coordinate_lines(name):
    smooth, w = made(name), spread(name)
    u0, u1, v0, v1 = smooth.rectangle
    step = 0.01 * min(u1 - u0, v1 - v0)
    along = differences(lambda p: smooth.point(smooth.parameter(p)), w, step)[:2]
    pair = smooth.principal_directions(smooth.parameter(w))
    for k in range(2):
        cosine = (along[k] * pair[:, k]).sum(-1) / np.linalg.norm(along[k], axis=1)
        assert np.allclose(np.abs(cosine), 1, atol=1e-9)


@pytest.mark.parametrize("name", CLOSED)
def test_the_null_curve_in_closed_form_equals_quadrature(name):
    smooth, z = made(name), parameters(name)
    by_quadrature = replace(smooth, null_curve=None)
    shift = smooth.point(smooth.base)
    assert np.allclose(by_quadrature.point(z) + shift, smooth.point(z), atol=1e-12, rtol=1e-12)
    assert np.abs(by_quadrature.point(smooth.base)).max() == 0


@pytest.mark.parametrize("name", CHARTED)
def test_coordinates_in_closed_form_equal_quadrature_and_continuation(name):
    """Up to the sign of the root, which a closed form may choose."""
    smooth, w, z = made(name), spread(name), parameters(name)
    bare = replace(smooth, to_curvature=None, from_curvature=None)
    closed, numeric = smooth.curvature_coordinates(z), bare.curvature_coordinates(z)
    sign = np.sign((closed * numeric.conj()).real[np.abs(numeric) > 0.01]).mean()
    assert abs(sign) == 1
    assert np.allclose(sign * numeric, closed, atol=1e-12)
    assert np.allclose(bare.parameter(sign * w), smooth.parameter(w), atol=1e-12)


@pytest.mark.parametrize("name", ["henneberg", "catalan", "own, text"])
def test_many_points_that_share_their_ways_are_as_exact_as_one(name):
    smooth = made(name)
    u0, u1, v0, v1 = smooth.rectangle
    w = np.linspace(u0, u1, 50)[:, None] + 1j * np.linspace(v0, v1, 41)
    z = smooth.parameter(w)
    assert z.shape == w.shape
    assert np.abs(smooth.curvature_coordinates(z) - w).max() < 1e-12
    some = w[::17, ::13]
    assert np.abs(z[::17, ::13] - smooth.parameter(some)).max() < 1e-12


def test_coordinates_close_to_a_branch_point():
    """At the distance δ of a simple zero of Q, w is off by 2/3 √Q'(1) δ^(3/2)."""
    smooth = surface("henneberg")
    delta = np.array([1e-3, 1e-6, 1e-9])
    w = smooth.curvature_coordinates(1 - delta)
    limit = w[2]
    assert np.allclose(abs(w[:2] - limit) / delta[:2] ** 1.5, 2 / 3 * np.sqrt(8), rtol=2e-3)


@pytest.mark.parametrize(("name", "place"), [("henneberg", "z = 1"), ("catalan", "z = 0")])
def test_a_way_through_a_zero_of_the_hopf_differential_is_refused(name, place):
    smooth = surface(name)
    beyond = smooth.base + 1.5 * ((1.0 if name == "henneberg" else 0.0) - smooth.base)
    with pytest.raises(SurfaceError, match="does not converge near z = "):
        smooth.curvature_coordinates(beyond)
    near = smooth.curvature_coordinates(smooth.base + (beyond - smooth.base) / 1.5 * (1 - 1e-9))
    with pytest.raises(SurfaceError) as caught:
        smooth.parameter(1.4 * near)
    words = f"a zero of order 1 of the Hopf differential lies in the way at {place}, w = "
    assert words in str(caught.value)


@pytest.mark.parametrize("angle", [0.0, 180.0])
def test_the_catenoid_closes_after_one_turn_and_not_before(angle):
    smooth = surface("catenoid", bonnet_angle=angle).scaled(SCALE)
    assert smooth.period is not None
    w = spread("catenoid") * (1j if angle else 1)
    point = smooth.point(smooth.parameter(w))
    closed = smooth.point(smooth.parameter(w + smooth.period))
    assert np.allclose(closed, point, atol=1e-13 * SCALE * 10)
    half = smooth.point(smooth.parameter(w + smooth.period / 2))
    assert np.linalg.norm(half - point, axis=1).min() > SCALE


@pytest.mark.parametrize("angle", [90.0, 30.0])
def test_its_bendings_do_not_close(angle):
    assert surface("catenoid", bonnet_angle=angle).period is None
    assert surface("catenoid-helicoid", bonnet_angle=angle).period is None


def test_the_catenoid_s_rectangle_is_one_turn_of_a_stable_film():
    u0, u1, v0, v1 = surface("catenoid").rectangle
    critical = 1.1996786402577338  # u tanh u = 1
    assert u1 == -u0 < 0.9 * critical
    assert v1 - v0 == pytest.approx(2 * np.pi, abs=1e-15)


def test_the_lemniscate_sine_solves_its_equation():
    w = 0.9 * QUARTER * (spread("scherk-1").real + 1j * spread("scherk-1").imag) / 2
    h, k = 1e-2, np.exp(2j * np.pi * np.arange(16) / 16)
    slope = (sl(w[:, None] + h * k) / k).mean(1) / h
    assert np.allclose(slope**2, 1 - sl(w) ** 4, atol=1e-11)
    assert np.allclose(arcsl(sl(w)), w, atol=1e-13)
    assert sl(np.array([0.0, QUARTER])) == pytest.approx([0, 1], abs=1e-15)

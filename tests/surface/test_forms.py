"""Points, normals and fundamental forms agree with each other, by derivatives of the points."""

import numpy as np
import pytest
from surface_samples import MAKERS, SCALE, differences, forms, made, parameters, room

from phexfab.errors import SurfaceError
from phexfab.surface import surface

EVERY = pytest.mark.parametrize("name", list(MAKERS))


def measured(name):
    z = parameters(name)
    return z, forms(differences(made(name).point, z, 0.02 * room(name, z)))


@EVERY
def test_the_null_curve_is_null(name):
    phi = made(name).tangent(parameters(name))
    size = (np.abs(phi) ** 2).sum(-1)
    assert (np.abs((phi**2).sum(-1)) / size).max() < 1e-14


@EVERY
def test_first_form_and_conformal_factor(name):
    z, (first, _, _) = measured(name)
    factor = made(name).conformal_factor(z)
    assert np.allclose(made(name).first_form(z) / factor[:, None, None] ** 2, np.eye(2), atol=1e-13)
    assert np.allclose(first / factor[:, None, None] ** 2, np.eye(2), atol=1e-8)


@EVERY
def test_second_form(name):
    z, (_, second, _) = measured(name)
    size = np.linalg.norm(made(name).second_form(z), axis=(1, 2))[:, None, None]
    assert size.min() > 0
    assert (np.abs(made(name).second_form(z) - second) / size).max() < 1e-7


@EVERY
def test_the_surface_is_minimal(name):
    z, (first, second, _) = measured(name)
    shape = np.linalg.solve(first, second)
    kappa = np.sqrt(-np.linalg.det(shape))
    assert (np.abs(np.trace(shape, axis1=1, axis2=2)) / kappa).max() < 1e-7
    assert (np.abs(made(name).mean_curvature(z)) / kappa).max() < 1e-12
    assert np.allclose(made(name).gaussian_curvature(z), np.linalg.det(shape), rtol=1e-6)


@EVERY
def test_curvature_is_that_of_the_weierstrass_data(name):
    smooth, z = made(name), parameters(name)
    if name == "own, g infinite":
        z = z[z != 0]
    g, slope = np.asarray(smooth.gauss_map(z)), np.asarray(smooth.gauss_map_derivative(z))
    form = np.broadcast_to(smooth.form(z), z.shape)
    k = -((4 * np.abs(slope) / (np.abs(form) * (1 + np.abs(g) ** 2) ** 2)) ** 2) / SCALE**2
    assert np.allclose(smooth.gaussian_curvature(z), k, rtol=1e-11)
    kappa = smooth.principal_curvatures(z)
    assert (kappa[:, 0] < 0).all() and np.allclose(kappa[:, 0] * kappa[:, 1], k, rtol=1e-11)


@EVERY
def test_normals_stand_on_the_surface_right_handed(name):
    z, (_, _, normal) = measured(name)
    assert np.allclose(made(name).normal(z), normal, atol=1e-9)


@EVERY
def test_principal_directions_diagonalise_the_weingarten_map(name):
    smooth, z = made(name), parameters(name)
    pair = smooth.principal_directions(z)
    assert np.allclose(pair @ np.swapaxes(pair, 1, 2), np.eye(2), atol=1e-13)
    assert np.allclose(np.cross(pair[:, 0], pair[:, 1]), smooth.normal(z), atol=1e-12)
    # In the basis (X_u, X_v), which is orthogonal: coefficients, then the form in that frame.
    phi = SCALE * smooth.tangent(z)
    basis = np.stack([phi.real, -phi.imag], 1)
    change = pair @ np.swapaxes(basis, 1, 2) @ np.linalg.inv(smooth.first_form(z))
    _, (_, second, _) = measured(name)
    turned = change @ second @ np.swapaxes(change, 1, 2)
    kappa = smooth.principal_curvatures(z)
    size = kappa[:, 1, None, None]
    diagonal = kappa[:, :, None] * np.eye(2)
    assert (np.abs(turned - diagonal) / size).max() < 1e-7


@EVERY
def test_scaled_multiplies_lengths_and_nothing_else(name):
    small, z = made(name), parameters(name)
    large = small.scaled(4.0)
    assert np.allclose(large.point(z), 4 * small.point(z), rtol=1e-14)
    assert np.allclose(large.first_form(z), 16 * small.first_form(z), rtol=1e-14)
    assert np.allclose(large.second_form(z), 4 * small.second_form(z), rtol=1e-14)
    assert np.allclose(large.principal_curvatures(z), small.principal_curvatures(z) / 4, rtol=1e-11)
    assert np.array_equal(large.normal(z), small.normal(z))
    assert large.rectangle == small.rectangle
    assert np.array_equal(large.curvature_coordinates(z), small.curvature_coordinates(z))


@pytest.mark.parametrize("factor", [0.0, -2.0, np.inf, np.nan])
def test_a_scale_must_be_positive(factor):
    with pytest.raises(SurfaceError, match=r"enneper: the scale must be positive, not "):
        surface("enneper").scaled(factor)


@pytest.mark.parametrize("shape", [(), (3,), (2, 3)])
def test_every_shape_of_parameters(shape):
    smooth = made("henneberg")
    z = np.full(shape, 0.75 + 0.6j)
    assert smooth.point(z).shape == (*shape, 3) == smooth.normal(z).shape
    assert smooth.first_form(z).shape == (*shape, 2, 2) == smooth.weingarten(z).shape
    assert smooth.principal_directions(z).shape == (*shape, 2, 3)
    w = smooth.curvature_coordinates(z)
    assert w.shape == shape == smooth.parameter(w).shape == smooth.gaussian_curvature(z).shape
    assert np.allclose(smooth.parameter(w), z, atol=1e-14)


@pytest.mark.parametrize(
    ("name", "ask", "z", "words"),
    [
        ("scherk-1", "tangent", 1j, "runs to infinity (an end) at z = 0+1i"),
        ("scherk-1", "point", -1, "runs to infinity (an end) at z = -1"),
        ("henneberg", "point", 0, "runs to infinity (an end) at z = 0"),
        ("henneberg", "weingarten", 1, "has a branch point at z = 1"),
        ("enneper 5", "principal_directions", 0, "there are no principal directions at z = 0"),
        ("trinoid", "tangent", -1, "runs to infinity (an end) at z = -1"),
    ],
)
def test_singular_places_are_named(name, ask, z, words):
    with pytest.raises(SurfaceError) as caught:
        getattr(made(name), ask)(np.array([0.3 + 0.4j, z]))
    assert words in str(caught.value) and str(caught.value).startswith(made(name).name)


def test_rectangles_are_plain_floats():
    for name in MAKERS:
        assert [type(x) for x in made(name).rectangle] == [float] * 4

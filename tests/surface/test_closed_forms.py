"""The catalog's surfaces are the ones of the literature: their equations and parametrisations."""

from itertools import pairwise

import numpy as np
import pytest
from surface_samples import parameters

from phexfab.surface import associate, catalog, surface


def of(name, **options):
    smooth, z = surface(name, **options), parameters(name)
    return z, *smooth.point(z).T


def same_up_to_a_shift(points, expected):
    gap = points - expected
    assert np.abs(gap - gap[0]).max() < 1e-12
    assert np.ptp(expected, axis=0).min() > 0.1


def test_catenoid():
    _, x, y, z = of("catenoid")
    assert np.allclose(x**2 + y**2, np.cosh(z) ** 2, rtol=1e-13)
    assert np.ptp(z) == pytest.approx(2.0, abs=0.5)


def test_helicoid():
    _, x, y, z = of("helicoid")
    assert np.abs(x * np.cos(z) - y * np.sin(z)).max() < 1e-14
    assert np.ptp(z) > 1 and np.ptp(x**2 + y**2) > 1


def test_scherk_s_first_surface():
    _, x, y, z = of("scherk-1")
    assert np.allclose(np.exp(z) * np.cos(x), np.cos(y), atol=1e-13)
    assert np.ptp(z) > 1


def test_scherk_s_second_surface():
    _, x, y, z = of("scherk-2")
    assert np.allclose(np.sin(z), -np.sinh(x) * np.sinh(y), atol=1e-13)
    assert np.ptp(z) > 0.5


def test_enneper():
    """The implicit equation of degree nine, with x, y, z twice as large as Re ∫ φ dz here."""
    _, x, y, z = 2 * np.array(of("enneper"))
    x, y, z = (a[np.abs(z) > 0.1] for a in (x, y, z))
    inside = (y**2 - x**2) / (2 * z) + 2 * z**2 / 9 + 2 / 3
    other = (y**2 - x**2) / (4 * z) - (x**2 + y**2 + 8 * z**2 / 9) / 4 + 2 / 9
    assert np.allclose(inside**3, 6 * other**2, atol=1e-11)
    assert len(z) > 20 and np.ptp(inside) > 0.1


@pytest.mark.parametrize("order", [1, 2, 3])
def test_enneper_of_any_order(order):
    smooth = surface("enneper", order=order)
    z = smooth.base + 0.7 * (parameters("enneper") - 0.1)
    r, t = np.abs(z), np.angle(z)
    high, n = 2 * order + 1, order + 1
    expected = np.stack(
        [
            0.5 * (r * np.cos(t) - r**high * np.cos(high * t) / high),
            -0.5 * (r * np.sin(t) + r**high * np.sin(high * t) / high),
            r**n * np.cos(n * t) / n,
        ],
        -1,
    )
    same_up_to_a_shift(smooth.point(z), expected)


def test_catalan():
    z, *points = of("catalan")
    u, v = z.real, z.imag
    x, y = u - np.sin(u) * np.cosh(v), 1 - np.cos(u) * np.cosh(v)
    expected = np.stack([x, y, 4 * np.sin(u / 2) * np.sinh(v / 2)], -1)
    same_up_to_a_shift(np.transpose(points), expected)


def test_the_cycloid_is_a_geodesic_of_catalan_s_surface():
    """The plane of the cycloid contains the surface's normals along it."""
    smooth, t = surface("catalan"), np.linspace(-5, -1, 9)
    points, shift = smooth.point(t), np.array([-np.pi, 2, 0])
    cycloid = np.stack([t - np.sin(t), 1 - np.cos(t), 0 * t], -1)
    assert np.abs(points + shift - cycloid).max() < 1e-14
    assert np.abs(smooth.normal(t)[:, 2]).max() < 1e-15


def test_henneberg():
    z, *points = of("henneberg")
    u, v = np.log(np.abs(z)), np.angle(z)
    expected = np.stack(
        [
            2 * np.sinh(u) * np.cos(v) - 2 / 3 * np.sinh(3 * u) * np.cos(3 * v),
            -2 * np.sinh(u) * np.sin(v) - 2 / 3 * np.sinh(3 * u) * np.sin(3 * v),
            2 * np.cosh(2 * u) * np.cos(2 * v),
        ],
        -1,
    )
    same_up_to_a_shift(np.transpose(points), expected)


def test_henneberg_s_surface_is_one_sided():
    smooth, z = surface("henneberg"), parameters("henneberg")
    other = -1 / z.conj()
    assert np.allclose(smooth.point(other), smooth.point(z), atol=1e-12)
    assert np.allclose(smooth.normal(other), -smooth.normal(z), atol=1e-14)


def test_bour():
    z, *points = of("bour")
    r, t = np.abs(z) ** 2, 2 * np.angle(z)
    expected = np.stack(
        [
            r * np.cos(t) / 4 - r**2 * np.cos(2 * t) / 8,
            -r * np.sin(t) / 4 - r**2 * np.sin(2 * t) / 8,
            r**1.5 * np.cos(1.5 * t) / 3,
        ],
        -1,
    )
    same_up_to_a_shift(np.transpose(points), expected)


@pytest.mark.parametrize("order", [3, 5])
def test_bour_is_applicable_to_a_surface_of_revolution(order):
    """The metric depends on |z| alone."""
    smooth = surface("bour", order=order)
    ring = 0.7 * np.exp(1j * np.linspace(-1, 1, 7))
    assert np.ptp(smooth.conformal_factor(ring)) < 1e-15
    assert np.ptp(smooth.point(ring), axis=0).min() > 0.01


def test_richmond():
    z, *points = of("richmond")
    u, v = z.real, z.imag
    square = u * u + v * v
    expected = np.stack(
        [
            -u / (2 * square) - (u**3 - 3 * u * v**2) / 6,
            -v / (2 * square) - (3 * u**2 * v - v**3) / 6,
            u,
        ],
        -1,
    )
    same_up_to_a_shift(np.transpose(points), expected)


@pytest.mark.parametrize("ends", [3, 4, 7])
def test_the_k_noid_closes_around_its_ends_and_has_its_symmetry(ends):
    smooth = surface("jorge-meeks", ends=ends)
    roots = np.exp(1j * np.pi * (2 * np.arange(ends) + 1) / ends)
    circle = 0.2 * np.exp(2j * np.pi * np.arange(256) / 256)
    phi = smooth.tangent(roots[:, None] + circle)
    period = (phi * (2j * np.pi * circle)[:, None]).mean(1)
    assert np.abs(period.real).max() < 1e-12 < 0.1 < np.abs(period.imag).max()
    # Residues balance: the forces of the ends are in equilibrium.
    assert np.abs(period.sum(0)).max() < 1e-12
    z = 0.5 * np.exp(1j * np.linspace(0, 6, 11))
    turn, angle = np.exp(2j * np.pi / ends), 2 * np.pi / ends
    matrix = np.array(
        [[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    )
    centre = smooth.point(np.zeros(1))
    turned = (smooth.point(z) - centre) @ matrix.T
    assert np.allclose(smooth.point(turn * z) - centre, turned, atol=1e-13)


def test_the_ends_of_a_k_noid_are_far_away():
    smooth = surface("trinoid")
    away = np.linalg.norm(
        smooth.point(np.exp(1j * np.pi / 3) * (1 - np.logspace(-2, -4, 3))), axis=1
    )
    assert all(b > 5 * a for a, b in pairwise(away))


@pytest.mark.parametrize("name", list(catalog))
@pytest.mark.parametrize("angle", [35.0, 90.0, 200.0])
def test_bending_keeps_lengths_and_normals(name, angle):
    """Lengths are those of polygons on either surface, at the same parameters."""
    smooth = surface(name)
    turned = associate(smooth, angle)
    z = parameters(name)[:2, None] + 1e-3 * np.linspace(0, 1 + 1j, 33)
    polygon = [np.linalg.norm(np.diff(s.point(z), axis=1), axis=2) for s in (smooth, turned)]
    assert np.allclose(polygon[0], polygon[1], rtol=1e-7)
    assert np.array_equal(smooth.normal(z), turned.normal(z))
    assert np.abs(smooth.second_form(z) - turned.second_form(z)).max() > 0.01
    rotation = np.exp(1j * np.radians(angle) / 2)
    w, v = smooth.curvature_coordinates(z), turned.curvature_coordinates(z)
    sign = np.sign((v * (rotation * w).conj()).real).mean()
    assert abs(sign) == 1 and np.allclose(v, sign * rotation * w, atol=1e-12)


@pytest.mark.parametrize("name", [name for name in catalog if name != "catenoid-helicoid"])
def test_the_rectangle_of_a_bending_fits_into_the_old_one(name):
    smooth, turned = surface(name), surface(name, bonnet_angle=35.0)
    u0, u1, v0, v1 = turned.rectangle
    corners = np.array([complex(u0, v0), complex(u1, v0), complex(u1, v1), complex(u0, v1)])
    back = smooth.curvature_coordinates(turned.parameter(corners))
    half = max(smooth.rectangle[1] - smooth.rectangle[0], smooth.rectangle[3] - smooth.rectangle[2])
    u0, u1, v0, v1 = smooth.rectangle
    out = [u0 - back.real, back.real - u1, v0 - back.imag, back.imag - v1]
    assert np.max(out) == pytest.approx(0, abs=1e-12 * half)  # it fits, and touches


def test_the_conjugate_of_the_catenoid_is_the_helicoid_and_two_quarters_turn_it_over():
    z = parameters("catenoid")
    points = surface("catenoid").point(z)
    helicoid = surface("catenoid", bonnet_angle=90.0).point(z)
    assert np.allclose(helicoid, surface("helicoid").point(z), atol=1e-15)
    assert np.allclose(associate(surface("helicoid"), 90.0).point(z), -points, atol=1e-14)

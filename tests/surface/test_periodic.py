"""Schwarz' P and D and the gyroid in closed form: data, periods, areas, symmetries."""

import itertools

import numpy as np
import pytest
from scipy.special import ellipk, elliprf

from phexfab.errors import SurfaceError
from phexfab.surface import check_rectangle
from phexfab.surface.periodic.closed_forms import (
    CORNER,
    MIDDLE,
    PERIODIC,
    bonnet_angle,
    periodic_area,
    periodic_patch,
    periodic_surface,
)

LEVEL = {
    "schwarz-p": lambda x, y, z: -np.cos(x) - np.cos(y) - np.cos(z),
    "schwarz-d": lambda x, y, z: np.sin(x) * np.cos(y - z) + np.cos(x) * np.sin(y + z),
    "gyroid": lambda x, y, z: np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x),
}
LATTICE = {
    "schwarz-p": np.eye(3),
    "schwarz-d": (np.ones((3, 3)) - np.eye(3)) / 2,
    "gyroid": (np.ones((3, 3)) - 2 * np.eye(3)) / 2,
}


def inside(count, reach, seed=0):
    rng = np.random.default_rng(seed)
    return reach * np.sqrt(rng.random(count)) * np.exp(2j * np.pi * rng.random(count))


def test_the_bonnet_angle_of_the_gyroid():
    assert bonnet_angle("gyroid") == pytest.approx(38.0147739891081, abs=1e-12)
    assert (bonnet_angle("schwarz-d"), bonnet_angle("schwarz-p")) == (0.0, 90.0)


@pytest.mark.parametrize("name", PERIODIC)
def test_the_patch_is_a_minimal_surface_with_one_umbilic(name):
    patch = periodic_patch(name, 700.0)
    h = inside(60, 0.78)
    step = 1e-4
    ring = step * np.exp(2j * np.pi * np.arange(8) / 8)
    # Cauchy's integral on eight points: the null curve is the primitive of the tangent.
    moved = patch.null_curve(h[:, None] + ring)
    slope = (moved * (step**2 / ring / 8)[:, None]).sum(1) / step**2
    assert np.abs(slope - patch.tangent(h)).max() < 1e-10
    tangent = patch.tangent(h)
    assert np.abs((tangent**2).sum(-1)).max() < 1e-14 * np.abs(tangent).max() ** 2
    assert np.abs(patch.mean_curvature(h) / patch.principal_curvatures(h)[:, 1]).max() < 1e-11
    around = 1e-3 * np.exp(2j * np.pi * np.arange(16) / 16)
    turns = np.unwrap(np.angle(patch.hopf(np.append(around, around[0]))))
    assert (turns[-1] - turns[0]) / (2 * np.pi) == pytest.approx(1.0)  # order 1
    assert np.allclose(patch.normal(np.array(0j)), 1 / np.sqrt(3), atol=1e-15)


@pytest.mark.parametrize("name", PERIODIC)
def test_the_patch_has_the_data_of_the_literature(name):
    """Against Carlson's integral of f = e^{iθ}/√(z⁸ − 14z⁴ + 1), in axes turned by 45°."""
    surface = periodic_surface(name)
    rng = np.random.default_rng(3)
    a, b = np.sort(rng.random((2, 40)), axis=0)
    normals = np.stack([b, a, -np.ones(40)], -1)  # between (0, 0, −1), (1, 0, −1), (1, 1, −1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    octant = np.array([int(np.flatnonzero((surface.turns.sum(2) == [1, 1, -1]).all(1))[0])] * 40)
    start = surface.parameter(octant[:1], np.array([[0.0, 0, -1]]), np.array([1.0 + 1j]))[0]
    h = surface.parameter(octant, normals, np.full(40, start))
    height = surface.place(octant, np.zeros(3), h)[:, 2]
    height -= surface.place(octant[0], np.zeros(3), start)[2]
    z = (normals[:, 0] + 1j * normals[:, 1]) / (1 - normals[:, 2])
    t = z * z
    low, high = (2 - np.sqrt(3)) ** 2, (2 + np.sqrt(3)) ** 2
    curve = 0.5 * t * elliprf(1, 1 + low * t * t, 1 + high * t * t)
    # z -> e^{iπ/4} z turns the roots by 45° and θ by 90°. The cells follow from K and K'.
    angle = np.radians(bonnet_angle(name) + 90)
    k, k1 = ellipk(0.25), ellipk(0.75)
    edge = {"schwarz-p": k1, "schwarz-d": 2 * k, "gyroid": 2 / np.hypot(1 / k, 1 / k1)}[name]
    want = 2 / edge * (np.exp(1j * angle) * curve).real
    assert np.abs(want).max() > 0.05
    assert min(np.abs(height - want).max(), np.abs(height + want).max()) < 1e-14


@pytest.mark.parametrize("name", PERIODIC)
def test_patches_fit_and_periods_are_those_of_the_cell(name):
    """Across each of its six sides a patch goes on in one of the eight, shifted by the lattice."""
    surface = periodic_surface(name)
    found, along = [], np.linspace(0, np.pi / 2, 9)
    octant_of = surface.turns.sum(2)
    for own, j in itertools.product(range(8), range(6)):
        turn = surface.turns[own]
        first, last = surface.patch.normal(CORNER[[j, (j + 1) % 6]])
        arc = np.cos(along)[:, None] * first + np.sin(along)[:, None] * last
        h = surface.parameter(np.zeros(9, int), arc, np.full(9, MIDDLE[j]))
        points = surface.place(np.full(9, own), np.zeros(3), h)
        middle = turn @ (first + last) / np.sqrt(2)
        mirrored = 2 * middle * (middle @ octant_of[own]) - octant_of[own]
        beyond = np.full(9, np.abs(octant_of - mirrored).max(1).argmin())
        start = surface.parameter(beyond[:1], middle[None], np.ones(1, complex))
        # The patch beyond has two sides with these normals; one of them, shifted, is the same.
        gaps = []
        for sheet in (start, -start):
            h = surface.parameter(beyond, arc @ turn.T, np.repeat(sheet, 9))
            gaps.append(points - surface.place(beyond, np.zeros(3), h))
        shifts = [gap[4] for gap in gaps if np.ptp(gap, axis=0).max() < 1e-12]
        assert shifts
        found.extend(shifts)
    steps = np.array(found) @ np.linalg.inv(LATTICE[name])
    assert np.abs(steps - np.rint(steps)).max() < 1e-12
    # Together they span that lattice: some three of them have its volume.
    whole = np.unique(np.rint(steps), axis=0)
    volumes = [abs(np.linalg.det(three)) for three in itertools.combinations(whole, 3)]
    assert np.isclose(volumes, 1).any()


@pytest.mark.parametrize("name", PERIODIC)
def test_the_level_set_is_near_and_normals_point_to_its_larger_side(name):
    surface = periodic_surface(name)
    h = inside(50, 0.56, 1)
    for octant in range(8):
        octants = np.full(len(h), octant)
        points = surface.place(octants, np.zeros(3), h)
        normals = surface.patch.normal(h) @ surface.turns[octant].T
        values = [LEVEL[name](*(2 * np.pi * (points + s * normals)).T) for s in (-0.03, 0, 0.03)]
        assert np.abs(values[1]).max() < 0.1
        assert values[0].max() < -0.1 and values[2].min() > 0.1
        assert np.abs(surface.parameter(octants, normals, h * np.exp(0.4j)) - h).max() < 1e-14


@pytest.mark.parametrize("name", PERIODIC)
def test_areas(name):
    patch = periodic_patch(name)
    # A twelfth of the patch as the image of a square: a ray's share times the way along half a
    # side, whose normals run through an eighth of a circle.
    nodes, weights = np.polynomial.legendre.leggauss(40)
    nodes, weights = (nodes + 1) / 2, weights / 2
    arc = np.polynomial.Chebyshev.interpolate
    real = arc(lambda t: side(t).real, 40, [0, np.pi / 4])
    imag = arc(lambda t: side(t).imag, 40, [0, np.pi / 4])
    at = nodes * np.pi / 4
    edge = real(at) + 1j * imag(at)
    slope = (real.deriv()(at) + 1j * imag.deriv()(at)) * np.pi / 4
    factor = patch.conformal_factor(nodes[:, None] * edge) ** 2
    jacobian = nodes[:, None] * (edge.conj() * slope).imag
    area = 12 * np.abs((weights[:, None] * weights * factor * jacobian).sum())
    count = {"schwarz-p": 8, "schwarz-d": 32, "gyroid": 16}[name]
    assert periodic_area(name) == pytest.approx(count * area, rel=1e-12)
    published = {"schwarz-p": 2.3451, "schwarz-d": 2 * 1.9189, "gyroid": 3.0915}[name]
    assert periodic_area(name) == pytest.approx(published, abs=1e-4)
    assert periodic_area(name, 20.0) == pytest.approx(400 * periodic_area(name))


def side(angle):
    normals = np.stack([np.sin(angle), np.cos(angle), np.zeros_like(angle)], -1)
    octants = np.zeros(np.shape(angle), int)
    return periodic_surface("schwarz-p").parameter(octants, normals, np.ones(np.shape(angle)))


def test_d_has_straight_sides_and_p_flat_ones_that_it_meets_at_right_angles():
    arc = np.stack([np.sin(t := np.linspace(0, np.pi / 2, 33)), np.cos(t), 0 * t], -1)
    h = periodic_surface("schwarz-d").parameter(np.zeros(33, int), arc, np.ones(33))
    straight = periodic_patch("schwarz-d").point(h)
    assert np.abs(straight - straight[0])[:, :2].max() < 1e-15
    assert straight[-1, 2] - straight[0, 2] == pytest.approx(0.25, abs=1e-15)
    flat = periodic_patch("schwarz-p").point(h)
    assert np.abs(flat[:, 2] - 0.25).max() < 1e-15  # its normals are horizontal there


@pytest.mark.parametrize("name", PERIODIC)
def test_the_patch_has_curvature_coordinates_beside_its_umbilic(name):
    patch = periodic_patch(name, 3000.0)
    u0, u1, v0, v1 = patch.rectangle
    check_rectangle(patch, (u0, u1), (v0, v1))


def test_refusals():
    with pytest.raises(
        SurfaceError, match=r"schwarz-h.*choose one of schwarz-p, schwarz-d, gyroid"
    ):
        periodic_patch("schwarz-h")
    with pytest.raises(SurfaceError, match="cubic cell must be positive, not -1"):
        periodic_patch("gyroid", -1.0)
    with pytest.raises(
        SurfaceError, match=r"reaches to \|h\| = 0.816 about its flat point, not to 0.900"
    ):
        periodic_patch("gyroid").point(0.9)

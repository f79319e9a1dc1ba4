"""Cross-ratios, quasi-circular polygons, and the six properties of conformal hexagons."""

from fractions import Fraction

import numpy as np
import pytest

from phexfab.errors import MeshError
from phexfab.remesh.conformal.hexagons import (
    circular_defect,
    circular_parallel,
    complete_hexagon,
    conformal_defect,
    cross_ratio,
    dual_hexagon,
    hexagon_properties,
    multi_ratio,
    quasi_circular_defect,
    spatial_cross_ratio,
)


def random_points(seed, *shape):
    rng = np.random.default_rng(seed)
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


def random_hexagons(n, seed=0):
    """Conformal hexagons none of whose corners nearly coincide or run away."""
    z = complete_hexagon(*random_points(seed, 4, 3 * n))
    apart = np.abs(z[:, :, None] - z[:, None, :])
    apart[:, np.arange(6), np.arange(6)] = np.inf
    far = np.where(np.isfinite(apart), apart, 0).max(axis=(1, 2))
    return z[far < 30 * apart.min(axis=(1, 2))][:n]


def moebius(z, seed):
    a, b, c, d = random_points(seed, 4)
    return (a * z + b) / (c * z + d)


def test_cross_ratio_by_its_definition_and_under_moebius_maps():
    z = random_points(1, 500, 4)
    z0, z1, z2, z3 = z.T
    expected = (z0 - z1) * (z2 - z3) / ((z1 - z2) * (z3 - z0))
    assert np.abs(cross_ratio(z) / expected - 1).max() < 1e-13
    assert np.abs(cross_ratio(moebius(z, 2)) / expected - 1).max() < 1e-9
    assert cross_ratio([1, 1j, -1, -1j]) == pytest.approx(-1)


def test_real_cross_ratios_mean_circles():
    angles = np.random.default_rng(3).uniform(0, 2 * np.pi, (300, 4))
    circle = (2 - 1j) + 3 * np.exp(1j * angles)
    assert circular_defect(circle).max() < 1e-11
    # A corner off the circle through the others: the sine is that of the angle between circles.
    off = circle.copy()
    off[:, 3] += 0.1
    assert np.median(circular_defect(off)) > 1e-3
    with pytest.raises(MeshError, match="4 are needed"):
        cross_ratio([1, 2, 3])


def test_spatial_cross_ratio_is_the_plane_one_on_planes_and_spheres():
    z = random_points(4, 400, 4)
    flat = cross_ratio(z)
    flat = flat.real + 1j * np.abs(flat.imag)
    frame = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    plane = (np.stack([z.real, z.imag, 0 * z.real], -1) - [3, 4, 5]) @ frame.T
    assert np.abs(spatial_cross_ratio(plane) - flat).max() < 1e-11 * np.abs(flat).max()
    power = np.abs(z) ** 2
    sphere = np.stack([2 * z.real, 2 * z.imag, power - 1], -1) / (power + 1)[..., None]
    assert np.abs(spatial_cross_ratio(sphere) / flat - 1).max() < 1e-9


def test_quasi_circular_polygons_are_parallel_to_circular_ones():
    rng = np.random.default_rng(6)
    for n in (4, 6, 8, 12):
        circle = np.exp(1j * np.sort(rng.uniform(0, 2 * np.pi, n)))
        edges = np.roll(circle, -1) - circle
        # Other lengths that still close: the null space of Σ λ e = 0.
        null = np.linalg.svd(np.array([edges.real, edges.imag]))[2][2:]
        lengths = 1 + 0.2 * null.T @ rng.normal(size=n - 2)
        lengths -= (
            np.array([edges.real, edges.imag]).T
            @ np.linalg.lstsq(np.array([edges.real, edges.imag]).T, lengths - 1, rcond=None)[0]
        )
        z = np.concatenate([[0], np.cumsum(lengths * edges)[:-1]])
        assert abs(np.sum(lengths * edges)) < 1e-12
        assert quasi_circular_defect(z) < 1e-12
        found = circular_parallel(z)
        assert np.abs(np.abs(found) - 1).max() < 1e-13
        along, own = np.roll(found, -1) - found, np.roll(z, -1) - z
        assert np.abs((along * own.conj()).imag).max() < 1e-12
        # No other member of the family fits better.
        best = (along * own.conj()).real.sum()
        even = np.arange(n) % 2 == 0
        for t in np.exp(1j * np.linspace(0, 2 * np.pi, 400)):
            other = found * np.where(even, t, 1 / t)
            assert ((np.roll(other, -1) - other) * own.conj()).real.sum() <= best + 1e-12


def test_a_polygon_that_is_not_quasi_circular_is_refused():
    with pytest.raises(MeshError, match="is not real"):
        circular_parallel([0, 1, 2 + 1j, 1 + 2j, 2j, -1 + 0.3j])
    with pytest.raises(MeshError, match="even number of corners"):
        multi_ratio([0, 1, 1j, 2, 3])


def test_random_conformal_hexagons_from_four_corners():
    z = random_hexagons(10_000)
    assert len(z) > 5000
    assert conformal_defect(z).max() < 1e-12
    assert np.abs(multi_ratio(z) + 1).max() < 1e-11
    # Both quads lie on circles, the hexagon on none in general.
    assert circular_defect(z[:, [0, 1, 2, 3]]).max() < 1e-12
    assert np.median(circular_defect(z)) > 0.1
    assert conformal_defect(moebius(z[:100], 8)).max() < 1e-9
    circle = np.exp(1j * np.array([0.1, 0.9, 3.3, 5.0]))
    assert circular_defect(complete_hexagon(*circle)) < 1e-13


def printed_properties(z):
    """The six properties as the thesis prints them, with the conjugate in the dual."""
    z0, z1, z2, z3, z4, z5 = z.T
    a0, a1, a2, a3, a4, a5 = z1 - z0, z2 - z1, z3 - z2, z4 - z3, z5 - z4, z0 - z5
    b = z0 - z3
    yield "i", [a0 * a2 / (a1 * b) + 0.5, a3 * a5 / (a4 * b) - 0.5, (a0 + a1 + a2 + b) / b]
    s0 = 0 * z0
    s1 = s0 - 1 / a0.conj()
    s2 = s1 + 2 / a1.conj()
    s3 = s2 - 1 / a2.conj()
    s4 = s3 - 1 / a3.conj()
    s5 = s4 + 2 / a4.conj()
    end = s5 - 1 / a5.conj()
    size = np.max(np.abs([1 / a0, 2 / a1, 1 / a2, 1 / a3, 2 / a4, 1 / a5]), axis=0)
    yield "ii", [(s0 - s3) * b.conj() / 2 - 1]
    yield "iii", [(end - s0) / size]
    top = (s0 - s1) * (s2 - s3) / ((s1 - s2) * (s3 - s0))
    low = (s0 - s5) * (s4 - s3) / ((s5 - s4) * (s3 - s0))
    yield "iv", [top + 0.5, low + 0.5]
    yield (
        "v",
        [
            (s1 - s3) - 3 * (z0 - z2) / abs(z0 - z2) ** 2,
            (s2 - s0) - 3 * (z3 - z1) / abs(z3 - z1) ** 2,
            (s5 - s3) - 3 * (z0 - z4) / abs(z0 - z4) ** 2,
            (s4 - s0) - 3 * (z3 - z5) / abs(z3 - z5) ** 2,
        ],
    )
    t1 = -1 / (s1 - s0).conj()
    t2 = t1 + 2 / (s2 - s1).conj()
    t3 = t2 - 1 / (s3 - s2).conj()
    t4 = t3 - 1 / (s4 - s3).conj()
    t5 = t4 + 2 / (s5 - s4).conj()
    yield "vi", [np.stack([t1, t2, t3, t4, t5]) - np.stack([z1, z2, z3, z4, z5]) + z0]


def test_the_six_properties_hold_on_random_conformal_hexagons():
    z = random_hexagons(10_000, seed=9)
    # Scaled so that lengths, and the dual's, are near 1.
    z = z / np.abs(z[:, 0] - z[:, 3])[:, None]
    for name, residuals in printed_properties(z):
        for residual in residuals:
            scale = 30.0 if name in ("v", "vi") else 1.0  # these two are lengths
            assert np.abs(residual).max() < 1e-12 * scale, name
    assert hexagon_properties(z).worst.max() < 1e-12


class Gaussian:
    """A complex number with rational parts, so that an identity holds exactly or not at all."""

    def __init__(self, x, y=0):
        self.x, self.y = Fraction(x), Fraction(y)

    def __add__(self, other):
        return Gaussian(self.x + other.x, self.y + other.y)

    def __sub__(self, other):
        return Gaussian(self.x - other.x, self.y - other.y)

    def __mul__(self, other):
        return Gaussian(self.x * other.x - self.y * other.y, self.x * other.y + self.y * other.x)

    def __truediv__(self, other):
        size = other.x**2 + other.y**2
        return self * Gaussian(other.x / size, -other.y / size)

    def __eq__(self, other):
        return (self.x, self.y) == (other.x, other.y)

    def __hash__(self):
        return hash((self.x, self.y))

    def bar(self):
        return Gaussian(self.x, -self.y)


def test_the_six_properties_hold_exactly_in_rational_numbers():
    rng = np.random.default_rng(21)
    one, half, two = Gaussian(1), Gaussian(Fraction(1, 2)), Gaussian(2)

    def inverted(z):
        return one / z.bar()

    def last(z0, z1, z3):
        """z2 with (z0 − z1)(z2 − z3) / ((z1 − z2)(z3 − z0)) = −1/2."""
        top, low = z0 - z1, (z0 - z3) * half
        return (top * z3 + low * z1) / (top + low)

    tried = 0
    for _ in range(300):
        z0, z1, z3, z5 = (Gaussian(*pair) for pair in rng.integers(-30, 31, (4, 2)).tolist())
        try:
            z2, z4 = last(z0, z1, z3), last(z0, z5, z3)
            z = [z0, z1, z2, z3, z4, z5]
            a = [z[(k + 1) % 6] - z[k] for k in range(6)]
            b = z0 - z3
            assert a[0] * a[2] / (a[1] * b) == Gaussian(Fraction(-1, 2))
            assert a[3] * a[5] / (a[4] * b) == half
            weights = [Gaussian(w) for w in (-1, 2, -1, -1, 2, -1)]
            s = [Gaussian(0)]
            for weight, edge in zip(weights, a, strict=True):
                s.append(s[-1] + weight * inverted(edge))
        except ZeroDivisionError:  # corners coincide
            continue
        tried += 1
        assert s[6] == s[0]
        assert s[0] - s[3] == two * inverted(b)
        minus = Gaussian(Fraction(-1, 2))
        assert (s[0] - s[1]) * (s[2] - s[3]) / ((s[1] - s[2]) * (s[3] - s[0])) == minus
        assert (s[0] - s[5]) * (s[4] - s[3]) / ((s[5] - s[4]) * (s[3] - s[0])) == minus
        three = Gaussian(3)
        for i, j, k, l in ((1, 3, 0, 2), (2, 0, 3, 1), (5, 3, 0, 4), (4, 0, 3, 5)):
            assert s[i] - s[j] == three * inverted(z[k] - z[l])
        t = [z0]
        for k, weight in enumerate(weights):
            t.append(t[-1] + weight * inverted(s[k + 1] - s[k]))
        assert t == [*z, z0]
    assert tried > 280


def test_the_properties_fail_together_on_other_hexagons():
    z = random_hexagons(2000, seed=10)
    size = np.abs(z[:, 0] - z[:, 3])[:, None]
    found = hexagon_properties(z + 0.05 * size * random_points(11, *z.shape))
    for name in ("products", "diagonal", "closes", "dual_conformal", "crossed", "involution"):
        assert getattr(found, name).min() > 1e-5, name
    # To first order they grow with the disturbance.
    one = hexagon_properties(z + 1e-6 * size * random_points(11, *z.shape)).products
    two = hexagon_properties(z + 2e-6 * size * random_points(11, *z.shape)).products
    assert np.median(two / one) == pytest.approx(2, rel=1e-3)


def test_a_dual_alone_does_not_make_a_hexagon_conformal():
    half = random_points(12, 200, 3)
    symmetric = np.concatenate([half, -half], axis=1)
    found = hexagon_properties(symmetric)
    assert max(found.closes.max(), found.involution.max()) < 1e-12
    assert min(found.products.min(), found.crossed.min(), found.dual_conformal.min()) > 1e-4
    # Two parallelograms on the diagonal: (ii) holds as well.
    z0, z1, z3, z5 = random_points(13, 4, 200)
    boxes = np.stack([z0, z1, z1 + z3 - z0, z3, z3 + z5 - z0, z5], axis=-1)
    found = hexagon_properties(boxes)
    assert found.diagonal.max() < 1e-11
    assert min(found.products.min(), found.crossed.min()) > 1e-4


def test_duals_have_parallel_edges_only_with_the_conjugate():
    z = random_hexagons(500, seed=14)
    dual = dual_hexagon(z)
    along, own = np.roll(dual, -1, axis=-1) - dual, np.roll(z, -1, axis=-1) - z
    sine = np.abs((along * own.conj()).imag) / np.abs(along * own)
    assert sine.max() < 1e-11
    printed = np.array([-1, 2, -1, -1, 2, -1]) / own
    assert np.median(np.abs((printed * own.conj()).imag) / np.abs(printed * own)) > 0.3
    assert conformal_defect(dual).max() < 1e-10
    twice = dual_hexagon(dual)
    assert np.abs(twice - (z - z[:, :1])).max() < 1e-10 * np.abs(z).max()


def test_impossible_hexagons_are_refused():
    with pytest.raises(MeshError, match="does not close"):
        dual_hexagon([0, 1, 2 + 1j, 1 + 2j, 2j, -1 + 0.3j])
    with pytest.raises(MeshError, match="no length"):
        dual_hexagon([0, 0, 2 + 1j, 1 + 2j, 2j, -1 + 0.3j])
    with pytest.raises(MeshError, match="coincide"):
        complete_hexagon(0, 0, 2, 1j)
    with pytest.raises(MeshError, match="infinity"):
        complete_hexagon(0, -1, 2, 1j)

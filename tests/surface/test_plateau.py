"""Soap films of one rim against surfaces and areas that are known."""

import itertools

import numpy as np
import pytest
from plateau_samples import TURN, enneper_rim, helicoid_rim, lobed, smooth_rim
from scipy.integrate import quad
from scipy.special import ellipk

from phexfab.errors import SurfaceError
from phexfab.surface.classical import enneper
from phexfab.surface.disc_films.grid import DirichletForm, graded_grid, uniform_grid
from phexfab.surface.disc_films.null_series import NullBoundary, NullSeries
from phexfab.surface.disc_films.plateau import plateau, umbilic_count
from phexfab.surface.disc_films.start import chord_energy
from phexfab.surface.rims.rim import Rim


def distance(film, known, guess):
    """Largest distance of points of the film from a known minimal surface."""
    rng = np.random.default_rng(1)
    z = np.sqrt(rng.uniform(0, 0.98, 60)) * np.exp(1j * rng.uniform(0, TURN, 60))
    points = film.surface.point(z)
    feet = known.closest_parameter(points, guess(points))
    return np.linalg.norm(known.point(feet) - points, axis=1).max()


def inside(film, count=40, radius=0.95):
    rng = np.random.default_rng(2)
    return radius * np.sqrt(rng.uniform(size=count)) * np.exp(1j * rng.uniform(0, TURN, count))


class TestEnergy:
    def test_of_one_wave_is_its_number(self):
        gaps = np.array([TURN])
        form = DirichletForm.on(uniform_grid(32), gaps)
        for k in (1, 7, 16):
            wave = np.cos(k * form.grid.angles(gaps))
            norm = np.pi if k < 16 else 2 * np.pi  # the highest wave is only sampled at its peaks
            assert form.energy(wave[:, None]) == pytest.approx(0.5 * k * norm, rel=1e-13)

    def test_on_graded_samples_is_the_same(self):
        gaps = np.array([2.0, 1.0, TURN - 3.0])
        errors = []
        for n in (16, 32, 64):
            grid = graded_grid(np.array([n, n, n]), np.array([3.0, 4.0, 6.0]), (None,) * 3)
            theta = grid.angles(gaps)
            values = np.stack([np.cos(theta) - 0.3 * np.sin(2 * theta), np.cos(3 * theta)], 1)
            errors.append(DirichletForm.on(grid, gaps).energy(values) / (np.pi / 2 * 4.18) - 1)
        assert abs(errors[2]) < 1e-6
        assert abs(errors[2]) < abs(errors[1]) / 8 < abs(errors[0]) / 64

    def test_changes_with_the_corners_as_its_derivatives_say(self):
        grid = graded_grid(np.array([16, 20, 12]), np.array([3.0, 5.0, 8.0]), (None,) * 3)
        gaps = np.array([2.0, 1.0, TURN - 3.0])
        points = np.random.default_rng(0).normal(size=(48, 3))
        gradient, mixed, hessian = DirichletForm.on(grid, gaps).corner_derivatives(
            points, [0, 1, 2]
        )
        for c in range(3):
            forms = []
            for step in (1e-5, -1e-5):
                moved = gaps.copy()
                moved[c - 1] += step
                moved[c] -= step
                forms.append(DirichletForm.on(grid, moved))
            plus, minus = forms
            slope = (plus.energy(points) - minus.energy(points)) / 2e-5
            assert gradient[c] == pytest.approx(slope, rel=1e-6)
            change = (plus.matrix - minus.matrix) @ points / 2e-5
            assert mixed[:, :, c] == pytest.approx(change, rel=1e-5, abs=1e-6)
            rows = [f.corner_derivatives(points, [0, 1, 2])[0] for f in forms]
            assert hessian[c] == pytest.approx((rows[0] - rows[1]) / 2e-5, rel=1e-5)

    def test_of_chords_is_that_of_their_fourier_series(self):
        rng = np.random.default_rng(3)
        points, arcs = rng.normal(size=(9, 3)), rng.uniform(0.3, 1, 9)
        arcs *= TURN / arcs.sum()
        chords = np.roll(points, -1, axis=0) - points
        theta = np.append(np.cumsum(arcs) - arcs, TURN)
        # Coefficients of piecewise linear values in closed form, from the jumps of their slope.
        slope = chords / arcs[:, None]
        jump = slope - np.roll(slope, 1, axis=0)
        k = np.arange(1, 20001)
        waves = np.exp(-1j * k[:, None] * theta[:-1]) @ jump / (-(k[:, None] ** 2) * TURN)
        energy = TURN * (k[:, None] * np.abs(waves) ** 2).sum()
        assert chord_energy(chords, arcs)[0] == pytest.approx(energy, rel=1e-7)


class TestKnownSurfaces:
    @pytest.mark.parametrize("order", [1, 2])
    def test_enneper_comes_back(self, order):
        known = enneper(order=order).scaled(1000.0)
        middle = known.point(0.0)  # the catalog's lies elsewhere for orders above 1
        film = plateau(enneper_rim(order=order).moved(middle))
        assert film.conformality < 1e-12

        def guess(points):
            return (points - middle) @ np.array([1, -1j, 0]) / 500

        assert distance(film, known, guess) < 1e-9
        assert isinstance(film.curve, NullSeries)
        assert len(film.curve.coefficients) == 2 * order + 2  # noise is cut off
        assert umbilic_count(film) == order - 1

    def test_the_error_falls_faster_than_any_power(self):
        rim = lobed(2, 0.4)
        exact = plateau(rim, samples=512).area
        errors = [abs(plateau(rim, samples=n).area / exact - 1) for n in (40, 80, 160)]
        for coarse, fine in itertools.pairwise(errors):
            assert fine < max(coarse / 10, 1e-12)
        assert errors[-1] < 1e-11
        assert plateau(rim).conformality < 1e-9

    def test_a_piece_of_the_helicoid(self):
        film = plateau(helicoid_rim(0.8, 0.9))
        x, y, z = (film.surface.point(inside(film)) / 1000).T
        assert np.abs(x * np.sin(z) - y * np.cos(z)).max() < 1e-9
        assert film.conformality < 1e-9

    def test_a_piece_of_the_catenoid(self):
        def point(a):
            u, v = 0.7 * np.cos(a), 0.9 * np.sin(a)
            return 500 * np.stack([np.cosh(u) * np.cos(v), np.cosh(u) * np.sin(v), u], -1)

        def slope(a):
            u, v, du, dv = 0.7 * np.cos(a), 0.9 * np.sin(a), -0.7 * np.sin(a), 0.9 * np.cos(a)
            x = np.sinh(u) * np.cos(v) * du - np.cosh(u) * np.sin(v) * dv
            y = np.sinh(u) * np.sin(v) * du + np.cosh(u) * np.cos(v) * dv
            return 500 * np.stack([x, y, du], -1)

        film = plateau(smooth_rim(point, slope))
        x, y, z = (film.surface.point(inside(film)) / 500).T
        assert np.abs(np.hypot(x, y) - np.cosh(z)).max() < 1e-9

    def test_a_square_piece_of_scherks_surface(self):
        # z = log(cos y / cos x) on |x|, |y| <= 1: four curved sides, four corners.
        side = np.linspace(-1.0, 1.0, 41)[:-1]
        flat = np.concatenate([side + 1j * -1, 1 + 1j * side, -side + 1j, -1 - 1j * side])
        x, y = flat.real, flat.imag
        points = 1000 * np.stack([x, y, np.log(np.cos(y) / np.cos(x))], -1)
        film = plateau(Rim.through(points, corners=[0, 40, 80, 120]))
        x, y, z = (film.surface.point(inside(film)) / 1000).T
        assert np.abs(z - np.log(np.cos(y) / np.cos(x))).max() < 1e-6
        assert film.conformality < 1e-6


class TestPeriodicPatches:
    """Areas of Schwarz' surfaces by quadrature of f = 1/√(z⁸ − 14 z⁴ + 1)."""

    def test_the_d_patch_of_a_skew_quadrilateral(self):
        corners = 1000 * np.array([[1, 1, 1], [-1, 1, -1], [-1, -1, 1], [1, -1, -1.0]])
        film = plateau(Rim.through(corners, corners=range(4)))
        assert film.area == pytest.approx(d_quadrilateral() * 1e6, rel=1e-8)
        assert umbilic_count(film, 0.9) == 0
        # Two-fold axes through the middle are in the film, so that it passes through it.
        assert np.abs(film.surface.point(0.0)).max() < 1e-3

    def test_the_p_patch_between_straight_lines_and_a_mirror_plane(self):
        # A 48th of the cell: two half-lines from a flat point, and the plane x = 1/2.
        centre, one, two = np.array([[0.25, 0.25, 0.25], [0.5, 0, 0.25], [0.5, 0.25, 0]])
        u = np.linspace(0, 1, 9)[1:-1, None]
        bow = one + (two - one) * u + 0.05 * np.sin(np.pi * u) * np.array([0, 1, 1])
        points = 1000 * np.vstack([centre, one, bow, two])
        film = plateau(Rim.through(points, corners=[0, 1, 9]), free=[1])
        assert film.area * 48 / 1e6 == pytest.approx(p_cell_area(), rel=1e-8)

    def test_half_a_patch_meets_its_mirror_plane_at_right_angles(self):
        corners = 1000 * np.array([[1, 1, 1], [-1, 1, -1], [-1, -1, 1], [1, -1, -1.0]])
        whole = plateau(Rim.through(corners, corners=range(4)))
        u = np.linspace(0, 1, 9)[1:-1, None]
        bow = corners[3] + (corners[1] - corners[3]) * u + np.sin(np.pi * u) * [0, 0, 700.0]
        rim = Rim.through(np.vstack([corners[1:], bow]), corners=[0, 1, 2])
        half = plateau(rim, free=[2])
        assert 2 * half.area == pytest.approx(whole.area, rel=1e-8)
        (slid,) = np.nonzero(np.isnan(half.boundary))
        across = np.array([1.0, 1.0, 0.0]) / np.sqrt(2)
        assert np.abs(half.points[slid] @ across).max() < 1e-6
        middle = slid[len(slid) // 4 : -len(slid) // 4]
        normal = half.surface.normal(np.exp(1j * half.angles[middle]))
        assert np.abs(normal @ across).max() < 1e-5


def p_cell_area():
    """Area of the P surface in a cube of side 1, 3 K(1/4)/K(3/4) = 2.345103 (Schwarz; Schoen)."""
    return 3 * ellipk(0.25) / ellipk(0.75)


def d_quadrilateral():
    """Area of the D patch in the quadrilateral of edges 2√2 of a regular tetrahedron.

    P and D are adjoint, ds = |f| (1 + |z|²) |dz|. The sphere falls into 48 triangles of 4-, 3- and
    2-fold points, 0, (√3 − 1)/√2 and 1 on the real axis the first, a second and the next third of
    them. A cell of P is 96 of them, its edge 2√2 times the side from 4 to 3; the patch of D is 8,
    its edge twice the side from 3 to 2.
    """

    def length(start, end):
        # r = start + (end - start) u² takes the root at the start away.
        def rate(u):
            r = start + (end - start) * u * u
            return 2 * u * abs(end - start) * (1 + r * r) / np.sqrt(abs(r**8 - 14 * r**4 + 1))

        return quad(rate, 0, 1, epsabs=1e-13, epsrel=1e-13)[0]

    flat = (np.sqrt(3) - 1) / np.sqrt(2)
    to_fourfold, to_twofold = length(flat, 0.0), length(flat, 1.0)
    triangle = p_cell_area() * (2 * np.sqrt(2) * to_fourfold) ** 2 / 96
    return 8 * triangle * (2 * np.sqrt(2) / (2 * to_twofold)) ** 2


class TestInvariance:
    def test_start_direction_place_and_size_do_not_matter(self):
        film = plateau(lobed(3))
        turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
        for rim, factor in (
            (lobed(3, start=0.37), 1.0),
            (lobed(3, way=-1), 1.0),
            (lobed(3).transformed(2.5 * turn, [1e4, -2e4, 3e3]), 6.25),
        ):
            assert plateau(rim).area == pytest.approx(factor * film.area, rel=1e-10)

    def test_the_speed_of_the_rim_does_not_matter(self):
        def hurried(a):
            return a + 0.6 * np.sin(a)

        def point(a):
            b = hurried(a)
            return 1000 * np.stack([np.cos(b), np.sin(b), 0.3 * np.cos(2 * b)], -1)

        def slope(a):
            b, rate = hurried(a), (1 + 0.6 * np.cos(a))[..., None]
            return 1000 * rate * np.stack([-np.sin(b), np.cos(b), -0.6 * np.sin(2 * b)], -1)

        assert plateau(smooth_rim(point, slope)).area == pytest.approx(
            plateau(lobed(2)).area, rel=1e-9
        )

    def test_no_other_way_along_the_rim_has_less_energy(self):
        rim = lobed(3)
        film = plateau(rim, samples=128)
        gaps = np.array([TURN])
        form = DirichletForm.on(uniform_grid(128), gaps)
        theta = form.grid.angles(gaps)
        rng = np.random.default_rng(4)
        for size in (1e-3, 1e-2, 1e-1):
            wave = sum(rng.normal() * np.cos(k * theta + rng.uniform(0, TURN)) for k in range(2, 7))
            other = rim.point(film.boundary + size / TURN * wave)
            assert form.energy(other) > film.area


class TestSurface:
    @pytest.mark.parametrize("rim", [lobed(2), lobed(5, 0.12)], ids=["saddle", "five lobes"])
    def test_it_is_minimal_and_bounded_by_the_rim(self, rim):
        film = plateau(rim)
        z = inside(film)
        surface = film.surface
        assert np.abs(surface.mean_curvature(z) * surface.scale).max() < 1e-9
        edge = surface.point(np.exp(1j * film.angles))
        assert np.abs(edge - rim.point(film.boundary)).max() < 1e-8
        assert np.all(np.abs(np.diff(np.unwrap(film.boundary, period=1))) > 0)
        assert surface.normal(z)[:, 2].max() < 0
        step = 1e-5
        by_u = surface.point(z + step) - surface.point(z - step)
        by_v = surface.point(z + 1j * step) - surface.point(z - 1j * step)
        normal = np.cross(by_u, by_v)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        assert np.abs(normal - surface.normal(z)).max() < 1e-8
        assert np.abs(surface.closest_parameter(surface.point(z), 0.98 * z) - z).max() < 1e-10

    def test_inverse_problems_work_where_g_has_a_pole(self):
        # Along the axis of a lying helicoid the normals turn through both poles.
        film = plateau(helicoid_rim(1.5, 1.8).transformed([[0, 1, 0], [0, 0, 1], [1, 0, 0]]))
        z = inside(film, 200, 0.98)
        normals = film.surface.normal(z)
        assert normals[:, 2].max() > 0.99
        near = z * (1 + 0.01j)
        assert np.abs(film.surface.parameter_of_normal(normals, near) - z).max() < 1e-9
        points = film.surface.point(z)
        assert np.abs(film.surface.closest_parameter(points, near) - z).max() < 1e-9
        pole = film.surface.parameter_of_normal([[0.0, 0.0, 1.0]], [z[normals[:, 2].argmax()]])
        assert np.isfinite(film.surface.hopf(pole)).all()
        assert film.surface.normal(pole)[0] == pytest.approx([0, 0, 1], abs=1e-9)
        curvature = film.surface.principal_curvatures(np.append(pole, pole + 1e-6))
        assert curvature[0] == pytest.approx(curvature[1], rel=1e-4)

    def test_long_and_lobed_rims_move_their_samples(self):
        def at(by):
            def values(a):
                b = a + by * np.pi / 2
                up = 0.5 * 2**by * np.cos(2 * a + by * np.pi / 2)
                return 1000 * np.stack([5 * np.cos(b), np.sin(b), up], -1)

            return values

        film = plateau(smooth_rim(at(0), at(1), at(2)))
        assert film.conformality < 1e-8
        assert np.diff(film.angles).max() > 100 * np.diff(film.angles).min()
        z = inside(film)
        assert np.abs(film.surface.mean_curvature(z) * film.surface.scale).max() < 1e-7
        assert isinstance(film.curve, NullBoundary)

    @pytest.mark.parametrize(("lobes", "count"), [(2, 0), (3, 1), (4, 2), (5, 3)])
    def test_umbilics_are_two_less_than_lobes(self, lobes, count):
        assert umbilic_count(plateau(lobed(lobes, 0.1))) == count


class TestCanopy:
    def test_four_corners_of_unequal_heights_with_curved_sides(self):
        high = np.array([[0, 0, 0], [12, 0, 3], [12, 9, 0.5], [0, 9, 4.0]])
        middle = high.mean(axis=0)
        points = []
        for a, b in zip(high, np.roll(high, -1, axis=0), strict=True):
            u = np.linspace(0, 1, 13)[:-1, None]
            points.append(a + (b - a) * u + (middle - 0.5 * (a + b)) * 0.6 * u * (1 - u))
        rim = Rim.through(1000 * np.concatenate(points), corners=[0, 12, 24, 36])
        areas = [plateau(rim, samples=n).area for n in (128, 256, 512)]
        assert abs(areas[2] - areas[1]) < abs(areas[1] - areas[0]) / 10
        assert areas[2] == pytest.approx(areas[1], rel=1e-6)
        film = plateau(rim)
        assert film.conformality < 1e-6
        assert umbilic_count(film, 0.95) == 0
        z = inside(film)
        assert np.abs(film.surface.mean_curvature(z) * film.surface.scale).max() < 1e-6
        flat = film.surface.point(z)
        assert np.all((flat[:, :2] > 0) & (flat[:, :2] < [12000, 9000]))


class TestRefusals:
    square = 1000 * np.array([[0, 0, 0], [1, 0, 0.4], [1, 1, 0], [0, 1, 0.4]])

    def test_a_free_side_that_does_not_exist(self):
        rim = Rim.through(self.square, corners=range(4), name="roof")
        with pytest.raises(SurfaceError, match="roof: side 4 cannot be free"):
            plateau(rim, free=[4])
        with pytest.raises(SurfaceError, match="no corners, so no sides"):
            plateau(lobed(2), free=[0])

    def test_a_straight_free_side_names_no_plane(self):
        with pytest.raises(SurfaceError, match="side 2 is straight"):
            plateau(Rim.through(self.square, corners=range(4)), free=[2])

    def test_a_free_side_that_is_not_plane(self):
        side = [[250, -40, 60], [500, -60, 150], [750, -40, 300]]
        rim = Rim.through(np.insert(self.square, [1, 1, 1], side, axis=0), corners=[0, 4, 5, 6])
        with pytest.raises(SurfaceError, match=r"side 0 .* not plane: .* mm near"):
            plateau(rim, free=[0])

    def test_no_side_left_fixed(self):
        with pytest.raises(SurfaceError, match="all 4 sides are free"):
            plateau(Rim.through(self.square, corners=range(4)), free=range(4))

    def test_a_rim_too_long_for_one_disc(self):
        needle = smooth_rim(
            lambda a: 1000 * np.stack([60 * np.cos(a), np.sin(a), np.cos(2 * a)], -1),
            lambda a: 1000 * np.stack([-60 * np.sin(a), np.cos(a), -2 * np.sin(2 * a)], -1),
            name="needle",
        )
        with pytest.raises(SurfaceError, match="needle: the soap film"):
            plateau(needle, samples=128)

    def test_too_few_samples(self):
        with pytest.raises(SurfaceError, match="at least 8"):
            plateau(lobed(2), samples=4)

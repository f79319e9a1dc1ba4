"""Films on meshes against the surfaces whose rims they are given."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial import Delaunay
from scipy.special import ellipk

from phexfab.errors import MeshError, SurfaceError
from phexfab.mesh.polymesh import PolyMesh
from phexfab.surface.classical import enneper
from phexfab.surface.mesh_films.area import area_gradient, area_hessian, total_area
from phexfab.surface.mesh_films.film_area import heights_over
from phexfab.surface.mesh_films.limit import film_limit
from phexfab.surface.mesh_films.mesh_film import border_rims, film_of_mesh, mesh_film, moved_film
from phexfab.surface.mesh_films.mirror import Mirror
from phexfab.surface.mesh_films.triangulated import border_loops, flip_to_delaunay
from phexfab.surface.rims.rim import Rim

R = 1000.0


def ring(centre, axis, radius=R, start=0.0, way=1):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    one = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    one /= np.linalg.norm(one)
    two = np.cross(axis, one)

    def at(t, turn=0.0):
        angle = (way * 2 * np.pi * np.asarray(t) + start + turn)[..., None]
        return radius * (np.cos(angle) * one + np.sin(angle) * two)

    return Rim.of(
        lambda t: np.asarray(centre, float) + at(t),
        lambda t: way * 2 * np.pi * at(t, np.pi / 2),
        name=f"ring at {centre}",
    )


def two_rings(distance, **second):
    below, above = (0, 0, -distance / 2), (0, 0, distance / 2)
    return ring(below, (0, 0, 1)), ring(above, (0, 0, 1), **second)


def vertices(film):
    return film.atlas.parameter_of_vertex(np.arange(len(film.points)))


def catenoid_errors(edge, distance=1.0):
    """Return the film and the errors of positions, normals and curvature, and of the area."""
    neck = brentq(lambda a: a * np.cosh(distance / 2 / a) - 1, 0.56, 1.0) * R
    film = mesh_film(two_rings(distance * R, start=0.4, way=-1), edge)
    x, y, z = film.points.T
    radius = np.hypot(x, y)
    normal = np.column_stack([x / radius, y / radius, -np.sinh(z / neck)])
    normal /= np.cosh(z / neck)[:, None]
    found = film.surface.normal(vertices(film))
    side = np.sign((found * normal).sum(1).mean())
    bend = film.surface.principal_curvatures(vertices(film))[:, 1]
    area = np.pi * neck * (distance * R + neck * np.sinh(distance * R / neck))
    return film, np.array(
        [
            np.abs(radius - neck * np.cosh(z / neck)).max() / R,
            np.abs(found - side * normal).max(),
            np.abs(bend * neck * np.cosh(z / neck) ** 2 - 1).max(),
            abs(film.area / area - 1),
        ]
    )


def test_the_film_between_equal_rings_is_the_catenoid():
    coarse, one = catenoid_errors(200.0)
    fine, two = catenoid_errors(100.0)
    assert (np.log2(one / two) > [3.0, 3.0, 3.0, 3.0]).all()
    assert (two < [2e-6, 1e-5, 5e-4, 1e-6]).all()
    for film in (coarse, fine):
        assert film.gradient <= 1e-10 and film.defect <= 1e-9 and film.unstable == 0
        assert film.smallest_angle > 35
        assert len(film.border_loops()) == 2 and film.off_rim < 0.2
    # The triangles' own least area is only of second order away from the film.
    assert 3 < coarse.moved / fine.moved < 5


def test_rims_are_met_exactly_and_the_first_is_run_along():
    film, _ = catenoid_errors(150.0)
    for k, rim in enumerate(film.rims):
        on = film.rim_of == k
        assert np.array_equal(film.points[on], rim.point(film.parameter[on]))
    loop = next(loop for loop in film.border_loops() if film.rim_of[loop[0]] == 0)
    ahead = np.diff(film.parameter[loop]) % 1.0
    assert (ahead < 0.1).all()


def test_the_rim_of_an_enneper_patch_gives_it_back():
    surface = enneper().scaled(R)

    def circle(t):
        return 0.8 * np.exp(2j * np.pi * np.asarray(t))

    rim = Rim.of(
        lambda t: surface.point(circle(t)),
        lambda t: R * np.real(surface.tangent(circle(t)) * (2j * np.pi * circle(t))[..., None]),
    )
    errors = []
    for edge in (100.0, 50.0):
        film = mesh_film((rim,), edge)
        p = film.points
        z = surface.closest_parameter(p, 2 * (p[:, 0] - 1j * p[:, 1]) / R)
        normal = film.surface.normal(vertices(film))
        side = np.sign((normal * surface.normal(z)).sum(1).mean())
        bend = film.surface.principal_curvatures(vertices(film)) - surface.principal_curvatures(z)
        errors.append(
            [
                np.abs(surface.point(z) - p).max() / R,
                np.abs(normal - side * surface.normal(z)).max(),
                np.abs(bend).max() * R,
            ]
        )
    coarse, fine = np.array(errors)
    assert (np.log2(coarse / fine) > 1.9).all()
    assert (fine < [1e-5, 1e-3, 5e-2]).all()


def test_a_plane_rim_has_a_plane_film():
    film = mesh_film((Rim.through([[0, 0, 0], [2000, 0, 0], [0, 1000, 0]], corners=range(3)),), 150)
    assert np.abs(film.points[:, 2]).max() < 1e-9
    assert film.area == pytest.approx(1e6, rel=1e-12)


def three_rings(distance):
    angles = 2 * np.pi * np.arange(3) / 3
    axes = np.column_stack([np.cos(angles), np.sin(angles), 0 * angles])
    return tuple(ring(distance * axis, axis) for axis in axes)


def test_three_rings_bound_a_film_with_their_symmetry():
    film = mesh_film(three_rings(800.0), 120.0)
    assert len(film.border_loops()) == 3 and film.unstable == 0 and film.gradient <= 1e-10
    # On the axis the normal is the axis, and by threefold symmetry there is an umbilic.
    pole = film.points[np.linalg.norm(film.points[:, :2], axis=1).argmin()]
    vertex = int(np.linalg.norm(film.points - pole, axis=1).argmin())
    z = film.atlas.parameter_near(np.array([0, 0, pole[2]]), vertex)
    assert np.abs(film.surface.normal(z)[:2]).max() < 1e-3
    near, all_ = film.surface.gaussian_curvature(np.array([z])), film.surface.gaussian_curvature
    assert abs(near[0]) < 1e-4 * np.abs(all_(vertices(film))).max()
    finer = mesh_film(three_rings(800.0), 60.0)
    finest = mesh_film(three_rings(800.0), 45.0)
    assert abs(film.area - finest.area) > 4 * abs(finer.area - finest.area)


def test_rims_apart_in_a_plane_leave_holes():
    court = ring((0, 0, 0), (0, 0, 1), 6000.0)
    columns = ring((2500, 0, 900), (0, 0, 1), 900.0), ring((-2500, 300, -600), (0, 0, 1), 1100.0)
    film = mesh_film((court, *columns), 450.0)
    assert len(film.border_loops()) == 3 and film.smallest_angle > 15
    assert np.abs(film.surface.mean_curvature(vertices(film))).max() < 1e-12


def test_rims_in_each_other_s_way_are_refused():
    rims = tuple(ring((300 * k, 0, 100 * k), (0, 0, 1)) for k in range(3))
    with pytest.raises(SurfaceError, match="give a mesh of the film"):
        mesh_film(rims, 200.0)


def test_rings_too_far_apart_are_refused_with_the_distance():
    # tanh x = 1/x at x = 1.19968: the last catenoid spans 2/sinh(1.19968) = 1.32549 radii.
    x = brentq(lambda x: x * np.tanh(x) - 1, 1, 1.5)
    limit = film_limit(two_rings(1400.0), samples=40)
    assert limit.distance == pytest.approx(2 * R / np.sinh(x), rel=3e-3)
    with pytest.raises(SurfaceError, match="too far apart") as refused:
        mesh_film(two_rings(1400.0), 200.0)
    told = float(str(refused.value).split("centres ")[1].split(" mm")[0])
    assert told == pytest.approx(2 * R / np.sinh(x), rel=5e-3)
    assert mesh_film(two_rings(1310.0), 120.0).unstable == 0


def test_three_rings_too_far_apart_are_refused_with_the_share():
    with pytest.raises(SurfaceError, match=r"moved together to [\d.]+ % of their present"):
        mesh_film(three_rings(1600.0), 250.0)


def schwarz_p(edge):
    """Return a 48th of the cell of side 2π·1000 mm: two straight lines and a mirror plane."""
    half, whole = np.pi / 2 * R, np.pi * R
    corners = [[half] * 3, [0, whole, half], [0, half, whole]]
    rim = Rim.through(corners, corners=range(3))
    return mesh_film((rim,), edge, mirrors=(Mirror([0, 0, 0], [1, 0, 0]),))


def test_a_schwarz_p_patch_with_a_free_border_has_the_published_area():
    # Per cubic cell of side 1, m = k²: Fogden, Hyde (1992), A = 3 K(1/4) / K(3/4) = 2.3451028840.
    exact = 3 * ellipk(0.25) / ellipk(0.75)
    films = [schwarz_p(edge) for edge in (300.0, 150.0, 75.0)]
    errors = [abs(48 * film.area / (2 * np.pi * R) ** 2 / exact - 1) for film in films]
    assert np.log2(errors[0] / errors[1]) > 2 and errors[2] < 1e-7
    flat = [total_area(film.points, film.triangles) * 48 / (2 * np.pi * R) ** 2 for film in films]
    assert np.log2(abs(flat[1] - exact) / abs(flat[2] - exact)) > 1.8
    film = films[-1]
    free = np.flatnonzero(film.held.slides[:, 0] & ~film.held.fixed)
    assert len(free) > 10 and np.array_equal(film.points[free, 0], np.zeros(len(free)))
    normal = film.surface.normal(film.atlas.parameter_of_vertex(free))
    assert np.abs(normal[:, 0]).max() < 1e-7  # at right angles to the mirror


def test_two_mirrors_meet_at_a_sliding_corner():
    exact = 3 * ellipk(0.25) / ellipk(0.75)
    half, low = np.pi / 2, 2 * np.pi / 3
    corners = R * np.array([[half] * 3, [0, np.pi, half], [0, low, low]])
    mirrors = Mirror([0, 0, 0], [1, 0, 0]), Mirror([0, 0, 0], [0, 1, -1])
    film = mesh_film((Rim.through(corners, corners=range(3)),), 120.0, mirrors=mirrors)
    assert 96 * film.area / (2 * np.pi * R) ** 2 == pytest.approx(exact, rel=3e-6)
    corner = np.flatnonzero(film.held.slides.all(axis=1) & ~film.held.fixed)
    assert len(corner) == 1
    # The same place on the patch of twice the size, that knows one of the mirrors only.
    height, _ = heights_over(schwarz_p(100.0).atlas, film.points[corner])
    assert np.abs(film.points[corner[0], 1] - film.points[corner[0], 2]) < 1e-9
    assert np.abs(height) < 0.05


def test_a_mirror_that_no_border_lies_in_is_refused():
    with pytest.raises(SurfaceError, match="mirror 1 of 1"):
        mesh_film(two_rings(500.0), 200.0, mirrors=(Mirror([0, 0, 9], [0, 0, 1]),))
    with pytest.raises(SurfaceError, match="normal that is not zero"):
        Mirror([0, 0, 0], [0, 0, 0])


def as_mesh(points, triangles):
    return PolyMesh(points, triangles.ravel(), 3 * np.arange(len(triangles) + 1))


def test_a_rough_mesh_settles_on_the_film_of_its_border():
    film, _ = catenoid_errors(150.0)
    inner = film.rim_of < 0
    rough = film.points.copy()
    rough[inner] += 30 * np.random.default_rng(2).normal(size=(inner.sum(), 3))
    again = film_of_mesh(as_mesh(rough, film.triangles))
    assert again.area == pytest.approx(
        film_of_mesh(as_mesh(film.points, film.triangles)).area, rel=1e-5
    )
    neck = brentq(lambda a: a * np.cosh(0.5 / a) - 1, 0.56, 1.0) * R
    x, y, z = again.points.T
    assert np.abs(np.hypot(x, y) - neck * np.cosh(z / neck)).max() < 0.1


def test_rims_come_back_from_a_mesh_s_border():
    film, _ = catenoid_errors(150.0)
    found = border_rims(film.points, film.triangles)
    assert [len(rim.corners) for rim in found] == [0, 0]
    for rim in found:
        x, y, z = rim.samples(300)[1].T
        assert np.abs(np.hypot(x, y) - R).max() < 1e-3 and np.abs(np.abs(z) - 500).max() < 1e-9
    square = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 0]], float)
    (rim,) = border_rims(square, np.array([[0, 1, 4], [1, 3, 4], [1, 2, 3]]))
    assert len(rim.corners) == 4


def test_the_film_that_soap_would_leave_is_found_when_asked_for():
    neck = brentq(lambda a: a * np.cosh(0.5 / a) - 1, 0.2, 0.5) * R  # the thin catenoid
    n, rows = 60, 25
    angle = 2 * np.pi * (np.arange(n) + 0.5 * (np.arange(rows) % 2)[:, None]) / n
    height = neck * np.linspace(-1, 1, rows)[:, None] * np.arccosh(R / neck) + 0 * angle
    radius = neck * np.cosh(height / neck)
    points = np.stack([radius * np.cos(angle), radius * np.sin(angle), height], -1).reshape(-1, 3)
    points[n:-n] *= [1.01, 1.01, 1.0]
    k, row = np.meshgrid(np.arange(n), np.arange(rows - 1))
    a, b = row * n + k, row * n + (k + 1) % n
    c, d = a + n, b + n
    odd = (row % 2 == 1)[..., None]
    one = np.where(odd, np.stack([a, b, d], -1), np.stack([a, b, c], -1))
    two = np.where(odd, np.stack([a, d, c], -1), np.stack([b, d, c], -1))
    mesh = as_mesh(points, np.concatenate([one.reshape(-1, 3), two.reshape(-1, 3)]))
    film = film_of_mesh(mesh, stable=False)
    x, y, z = film.points.T
    assert film.unstable >= 1
    assert np.abs(np.hypot(x, y) - neck * np.cosh(z / neck)).max() < 2e-3 * R
    assert film.area > film_of_mesh(mesh).area * 1.05


def test_meshes_that_are_no_films_are_refused():
    film, _ = catenoid_errors(200.0)
    quad = PolyMesh.from_faces(np.eye(4, 3), [[0, 1, 2, 3]])
    with pytest.raises(SurfaceError, match="face 0 is no triangle"):
        film_of_mesh(quad)
    turned = film.triangles.copy()
    turned[5] = turned[5, ::-1]
    with pytest.raises(MeshError, match="edges have two triangles on the same side"):
        film_of_mesh(as_mesh(film.points, turned))
    ball = PolyMesh.from_faces(np.eye(4, 3), [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    with pytest.raises(SurfaceError, match="closed"):
        film_of_mesh(ball)


def test_edge_lengths_that_no_mesh_can_have_are_refused():
    for edge in (0.0, -5.0, 5000.0, np.nan):
        with pytest.raises(SurfaceError, match="edge ="):
            mesh_film(two_rings(500.0), edge)


def test_gradient_and_hessian_are_derivatives_of_the_area():
    rng = np.random.default_rng(0)
    flat = rng.uniform(size=(30, 2))
    triangles = Delaunay(flat).simplices.astype(np.int64)
    points = np.column_stack([flat, 0.3 * rng.normal(size=30)])
    lines = rng.normal(size=(30, 3))
    step = 1e-5

    def slope(p):
        return (area_gradient(p, triangles) * lines).sum(1)

    move = rng.normal(size=30)
    way = step * move[:, None] * lines
    change = total_area(points + way, triangles) - total_area(points - way, triangles)
    assert change / (2 * step) == pytest.approx(slope(points) @ move, rel=1e-7)
    turn = (slope(points + way) - slope(points - way)) / (2 * step)
    hessian = area_hessian(points, triangles, lines)
    assert np.abs(hessian @ move - turn).max() < 1e-6 * np.abs(turn).max()


def test_flips_make_a_plane_mesh_delaunay():
    rng = np.random.default_rng(1)
    side = np.linspace(0, 1, 15)
    flat = np.stack(np.meshgrid(side, side), -1).reshape(-1, 2)
    inner = ((flat > 0.01) & (flat < 0.99)).all(axis=1)
    flat[inner] += 0.012 * rng.uniform(-1, 1, (inner.sum(), 2))
    triangles = Delaunay(flat).simplices.astype(np.int64)
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles[turn < 0] = triangles[turn < 0][:, ::-1]
    flat[inner] += 0.006 * rng.uniform(-1, 1, (inner.sum(), 2))
    points = np.column_stack([flat, np.zeros(len(flat))])
    corner = points[triangles]
    up = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2]
    assert (up > 0).all()  # a mesh still, yet no Delaunay one
    before = {tuple(t) for t in np.sort(triangles, axis=1).tolist()}
    after = {tuple(t) for t in np.sort(flip_to_delaunay(points, triangles), axis=1).tolist()}
    wanted = {tuple(t) for t in np.sort(Delaunay(flat).simplices, axis=1).tolist()}
    assert len(before - wanted) > 20 and after == wanted


def test_borders_are_loops():
    triangles = np.array([[0, 1, 2], [0, 2, 3]])
    assert [loop.tolist() for loop in border_loops(triangles)] == [[0, 1, 2, 3]]
    with pytest.raises(MeshError, match="touches itself at vertex 0"):
        border_loops(np.array([[0, 1, 2], [0, 3, 4]]))


def test_a_film_whose_rim_moves_a_little_is_that_of_the_moved_rim():
    t = 2 * np.pi * np.arange(32) / 32
    ring = 1000 * np.stack([np.cos(t), np.sin(t), 0 * t], -1)
    low = Rim.through(ring, name="low")

    def high(rise):
        up = 600 + rise * np.cos(2 * t)
        return Rim.through(np.column_stack([ring[:, :2], up])[::-1], name="high")

    film = mesh_film((low, high(0.0)), 160.0)
    rims = low, high(25.0)
    points = film.points.copy()
    for k, rim in enumerate(rims):
        on = film.rim_of == k
        points[on] = rim.point(film.parameter[on])
    moved, anew = moved_film(film, points, rims), mesh_film(rims, 160.0)
    assert np.array_equal(moved.triangles, film.triangles)
    assert moved.area == pytest.approx(anew.area, rel=1e-5)
    assert np.abs(heights_over(anew.atlas, moved.points)[0]).max() < 0.2

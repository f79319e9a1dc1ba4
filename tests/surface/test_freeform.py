"""Free-form surfaces against closed forms, and against each other."""

import numpy as np
import pytest

from phexfab.errors import MeshError, SurfaceError
from phexfab.mesh.polymesh import PolyMesh
from phexfab.surface.freeform.surface import implicit, mesh_surface, nurbs, parametric

RING, TUBE = 3000.0, 1000.0
TURN = 2 * np.pi


def torus_point(u, v):
    reach = RING + TUBE * np.cos(v)
    return reach * np.cos(u), reach * np.sin(u), TUBE * np.sin(v)


def torus(**options):
    box = (0.0, TURN, 0.0, TURN)
    return parametric(torus_point, box, periodic=(True, True), name="torus", **options)


def implicit_torus(**options):
    def level(x):
        return (x**2).sum(1) + RING**2 - TUBE**2

    def value(x):
        return level(x) ** 2 - 4 * RING**2 * (x[:, :2] ** 2).sum(1)

    def gradient(x):
        return 4 * level(x)[:, None] * x - 8 * RING**2 * x * np.array([1.0, 1.0, 0.0])

    def hessian(x):
        outer = 8 * x[:, :, None] * x[:, None]
        return (
            outer + 4 * level(x)[:, None, None] * np.eye(3) - 8 * RING**2 * np.diag([1.0, 1.0, 0.0])
        )

    box = ([-4100.0] * 3, [4100.0] * 3)
    return implicit(value, gradient, hessian, box, name="implicit torus", **options)


def torus_mesh(n):
    u, v = np.meshgrid(TURN * np.arange(3 * n) / (3 * n), TURN * np.arange(n) / n, indexing="ij")
    points = np.stack(torus_point(u.ravel(), v.ravel()), axis=1)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(3 * n), np.arange(n), indexing="ij"))

    def at(a, b):
        return (a % (3 * n)) * n + b % n

    low = np.stack([at(i, j), at(i + 1, j), at(i + 1, j + 1)], axis=1)
    high = np.stack([at(i, j), at(i + 1, j + 1), at(i, j + 1)], axis=1)
    return PolyMesh.from_faces(points, np.concatenate([low, high]))


def exact(u):
    """Principal curvatures about the outward normal, the greater first."""
    ring = -np.cos(u[:, 1]) / (RING + TUBE * np.cos(u[:, 1]))
    return np.stack([ring, np.full(len(u), -1 / TUBE)], axis=1)


@pytest.fixture
def places():
    return np.random.default_rng(5).uniform(0.0, TURN, (300, 2))


def test_parametric_curvatures_are_those_of_a_torus(places):
    bending = torus().bending(places)
    assert np.abs(bending.kappa - exact(places)).max() * TUBE < 1e-9
    along = np.stack([-np.sin(places[:, 0]), np.cos(places[:, 0]), 0 * places[:, 0]], axis=1)
    assert np.abs((bending.directions[:, 0] * along).sum(1)).min() > 1 - 1e-9
    # right-handed with the normal, and the operator says the same as the form
    turned = np.cross(bending.directions[:, 0], bending.directions[:, 1])
    assert np.abs(turned - bending.normals).max() < 1e-12
    a, b = np.random.default_rng(1).normal(size=(2, 300, 3))
    direct = np.einsum("ki,kij,kj->k", a, bending.operator, b)
    assert np.abs(direct - bending.form(a, b)).max() < 1e-15


def test_the_normal_turns_as_the_form_says(places):
    surface = torus()
    bending = surface.bending(places)
    step = 1.0  # mm
    for k in range(2):
        direction = bending.directions[:, k]
        x = surface.point(places)
        there = surface.normal(surface.nearest(x + step * direction, places))
        back = surface.normal(surface.nearest(x - step * direction, places))
        turn = ((there - back) * direction).sum(1) / (2 * step)
        assert np.abs(turn + bending.kappa[:, k]).max() * TUBE < 1e-5


def test_flipping_changes_the_signs(places):
    one, other = torus().bending(places), torus(flipped=True).bending(places)
    assert np.abs(one.normals + other.normals).max() < 1e-14
    assert np.abs(one.kappa + other.kappa[:, ::-1]).max() < 1e-15


def test_foot_points_come_back(places):
    surface = torus()
    x, normals = surface.point(places), surface.normal(places)
    for off in (-400.0, 600.0):
        found = surface.nearest(x + off * normals)
        assert np.abs(surface.point(found) - x).max() < 1e-8


def test_the_nearest_point_of_a_patch_may_lie_on_its_border():
    patch = parametric(lambda u, v: (u, v, 0 * u), (0.0, 1000.0, 0.0, 500.0))
    u = patch.nearest(np.array([[1500.0, 250.0, 80.0], [-3.0, 900.0, 0.0], [20.0, 30.0, 5.0]]))
    assert np.abs(u - [[1000.0, 250.0], [0.0, 500.0], [20.0, 30.0]]).max() < 1e-9
    assert patch.inside(u).tolist() == [False, False, True]


def test_differences_stay_within_the_domain():
    def dome(u, v):
        return u, v, np.sqrt(1e6 - u**2 - v**2)  # not a number beyond the domain's corners

    half = 1000.0 / np.sqrt(2) * 0.999
    patch = parametric(dome, (-half, half, -half, half))
    edge = np.array([[-half, 0.0], [half, 100.0], [0.0, half], [300.0, -half]])
    assert np.abs(patch.bending(edge).kappa + 1e-3).max() < 1e-9


def test_implicit_and_parametric_agree(places):
    smooth, level = torus(), implicit_torus()
    x = smooth.point(places)
    one, other = smooth.bending(places), level.bending(x)
    assert np.abs(one.normals - other.normals).max() < 1e-11
    assert np.abs(one.kappa - other.kappa).max() * TUBE < 1e-9
    assert np.abs(level.nearest(x + 300.0 * one.normals) - x).max() < 1e-7
    assert np.abs(implicit_torus(flipped=True).normal(x) + one.normals).max() < 1e-11


def test_seeds_cover_the_surface():
    for surface in (torus(), implicit_torus(), mesh_surface(torus_mesh(20))):
        x = surface.point(surface.seeds(1000))
        ring = np.hypot(np.hypot(x[:, 0], x[:, 1]) - RING, x[:, 2])
        assert np.abs(ring - TUBE).max() < 5.0
        assert 300 < len(x) < 3000
        v = np.arctan2(x[:, 2], np.hypot(x[:, 0], x[:, 1]) - RING)
        assert np.histogram(v, 8, (-np.pi, np.pi))[0].min() > 0


def test_a_mesh_nears_its_surface_at_the_promised_rate(places):
    x = torus().point(places)
    bending = torus().bending(places)
    off, bent = [], []
    for n in (24, 48):
        surface = mesh_surface(torus_mesh(n))
        u = surface.nearest(x + 200.0 * bending.normals)
        off.append(np.abs(u - x).max())
        bent.append(np.abs(surface.bending(u).kappa - bending.kappa).max() * TUBE)
        assert surface.inside(u).all()
    assert off[1] < 0.1 and off[0] / off[1] > 8
    assert bent[1] < 0.01 and bent[0] / bent[1] > 3


def test_the_blend_of_a_mesh_has_the_derivatives_it_states():
    surface = mesh_surface(torus_mesh(24))
    rng = np.random.default_rng(2)
    x = torus().point(rng.uniform(0, TURN, (30, 2))) + rng.normal(size=(30, 3)) * 20
    h = 0.1
    axes = h * np.eye(3)
    slope = [(surface.function(x + e) - surface.function(x - e)) / (2 * h) for e in axes]
    turn = [(surface.gradient(x + e) - surface.gradient(x - e)) / (2 * h) for e in axes]
    assert np.abs(np.stack(slope, -1) - surface.gradient(x)).max() < 1e-7
    assert np.abs(np.stack(turn, -1) - surface.hessian(x)).max() * TUBE < 1e-5


def test_a_mesh_ends_at_its_border():
    n = 12
    x, y = np.meshgrid(np.arange(n + 1) * 100.0, np.arange(n + 1) * 100.0, indexing="ij")
    points = np.stack([x.ravel(), y.ravel(), 1e-4 * (x * y).ravel()], axis=1)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    at = i * (n + 1) + j
    low = np.stack([at, at + n + 1, at + n + 2], axis=1)
    high = np.stack([at, at + n + 2, at + 1], axis=1)
    surface = mesh_surface(PolyMesh.from_faces(points, np.concatenate([low, high])))
    inner = surface.nearest(np.array([[610.0, 330.0, 20.0], [1190.0, 5.0, 1.0]]))
    outer = surface.nearest(np.array([[1230.0, 500.0, 61.0], [400.0, -30.0, -1.0]]))
    assert surface.inside(inner).all() and not surface.inside(outer).any()
    # The hyperbolic paraboloid is in the span of the fits: the blend is exact there.
    assert np.abs(inner[:, 2] - 1e-4 * inner[:, 0] * inner[:, 1]).max() < 1e-3
    assert np.abs(surface.bending(inner).gauss[0] * 1e8 + 1).max() < 0.02


def rational_quarter():
    """An eighth of a sphere of 1000 mm, less its pole: NURBS Book, ex. 8.2."""
    s = np.sqrt(0.5)
    arc = np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    control = np.array([[[r * p[0], r * p[1], z] for p in arc] for r, z in arc]) * 1000.0
    weights = np.outer([1.0, s, 1.0], [1.0, s, 1.0])
    knots = np.array([0.0, 0, 0, 1, 1, 1])
    return nurbs(control, (knots, knots), (2, 2), weights=weights, domain=(0.0, 0.9, 0.0, 1.0))


def test_a_rational_spline_is_a_sphere():
    surface = rational_quarter()
    u = surface.seeds(400)
    assert np.abs(np.linalg.norm(surface.point(u), axis=1) - 1000.0).max() < 1e-9
    assert np.abs(np.abs(surface.bending(u).kappa) - 1e-3).max() < 1e-12


def test_spline_derivatives_agree_with_differences():
    rng = np.random.default_rng(3)
    x, y = np.meshgrid(np.arange(7) * 1000.0, np.arange(6) * 1000.0, indexing="ij")
    control = np.stack([x, y, rng.normal(size=x.shape) * 300], axis=-1)
    knots = [np.repeat([0.0, 0.4, 0.7, 1.0], [5, 1, 1, 5]), np.repeat([0.0, 0.5, 1.0], [5, 1, 5])]
    surface = nurbs(control, tuple(knots), (4, 4), weights=rng.uniform(0.5, 2, x.shape))
    # Away from knots, over which a spline of degree 4 is not smooth enough for high differences.
    u = rng.uniform([0.1, 0.1], [0.25, 0.4], (40, 2))
    other = parametric(lambda a, b: surface.point(np.stack([a, b], 1)), surface.domain)
    for one, two in zip(surface.derivatives(u), other.derivatives(u), strict=True):
        assert np.abs(one - two).max() < 1e-6 * np.abs(one).max()


def test_cad_faces_keep_their_curvature(tmp_path):
    cadquery = pytest.importorskip("cadquery")
    from phexfab.cad.freeform_faces import from_face, surfaces_of

    solid = cadquery.Solid.makeTorus(RING, TUBE)
    surface = from_face(solid)
    assert surface.periodic == (True, True)
    x = torus().point(np.random.default_rng(4).uniform(0, TURN, (50, 2)))
    u = surface.nearest(x)
    assert np.abs(surface.point(u) - x).max() < 1e-8
    tube = surface.bending(u).kappa[:, 1]
    assert np.abs(tube + 1 / TUBE).max() * TUBE < 1e-9  # outward normal, as the solid's face
    path = tmp_path / "box.step"
    cadquery.exporters.export(cadquery.Workplane().box(10, 20, 30), str(path))
    faces = surfaces_of(path)
    assert [face.name for face in faces] == [f"box.step, face {k}" for k in range(1, 7)]
    for face in faces:  # all normals outward
        middle = face.point(face.low + face.width / 2)
        assert middle @ face.normal(face.low + face.width / 2) > 0
    with pytest.raises(SurfaceError, match="there are 6 faces"):
        from_face(cadquery.Workplane().box(1, 2, 3))
    with pytest.raises(SurfaceError, match="int holds no CAD shape"):
        from_face(3)


def test_errors_name_the_place():
    with pytest.raises(SurfaceError, match="must have u0 < u1"):
        parametric(lambda u, v: (u, v, u), (1.0, 0.0, 0.0, 1.0))
    with pytest.raises(SurfaceError, match=r"shape \(2, 2\) for 2"):
        parametric(lambda u, v: np.stack([u, v], 1), (0.0, 1.0, 0.0, 1.0)).point([[0, 0], [1, 1]])
    cone = parametric(lambda u, v: (u * np.cos(v), u * np.sin(v), u), (0.0, 1.0, 0.0, TURN))
    with pytest.raises(SurfaceError, match="no normal at u, v = 0, 1"):
        cone.normal([0.0, 1.0])
    with pytest.raises(SurfaceError, match=r"need \d+ knots"):
        nurbs(np.zeros((3, 3, 3)), (np.arange(5.0), np.arange(6.0)), (2, 2))
    with pytest.raises(SurfaceError, match="weights must be positive"):
        nurbs(np.zeros((3, 3, 3)), (np.arange(6.0),) * 2, (2, 2), weights=-np.ones((3, 3)))
    with pytest.raises(SurfaceError, match="is empty"):
        implicit(np.sum, np.sum, np.sum, ([0, 0, 0], [1, 1, 0]))
    square = PolyMesh.from_faces(np.eye(4)[:, :3], [[0, 1, 2, 3]])
    with pytest.raises(MeshError, match="face 0 is no triangle"):
        mesh_surface(square)
    far = implicit(
        lambda x: (x**2).sum(1) + 1.0,
        lambda x: 2 * x,
        lambda x: np.broadcast_to(2 * np.eye(3), (len(x), 3, 3)),
        ([-1] * 3, [1] * 3),
    )
    with pytest.raises(SurfaceError, match="no point in its box"):
        far.seeds(100)

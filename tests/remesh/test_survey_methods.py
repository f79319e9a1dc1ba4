"""Projective duality, the support function, parallel meshes: planes that touch, limits named."""

import numpy as np
import pytest

from phexfab.errors import LatticeError, MeshError, SurfaceError
from phexfab.mesh.measures import edges, planarity, relative_planarity, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.edge_offset import Ellipsoid, Paraboloid, touch_surface
from phexfab.parallel.pairs import parallelism, ratios
from phexfab.remesh.conformal.chart import conformal_chart
from phexfab.remesh.survey.by_parallel_meshes import parallel_mesh_on
from phexfab.remesh.survey.patch import sample_patch
from phexfab.remesh.survey.projective_dual import best_centre, dual_points, projective_dual_mesh
from phexfab.remesh.survey.support_function import SupportFunction, support_function_mesh
from phexfab.surface.freeform.surface import implicit, mesh_surface, nurbs, parametric


def cap(radius=1000.0, half=0.6):
    def place(x, y):
        return radius * x, radius * y, radius * np.sqrt(1 - x * x - y * y)

    return parametric(place, (-half, half, -half, half), name="sphere cap")


def ellipsoid(a=1500.0, b=1000.0, c=700.0, half=0.55):
    def place(x, y):
        return a * x, b * y, c * np.sqrt(1 - x * x - y * y)

    return parametric(place, (-half, half, -half, half), name="ellipsoid")


def torus(low, high, half=0.8, big=1000.0, small=400.0):
    def place(u, v):
        reach = big + small * np.cos(v)
        return reach * np.cos(u), reach * np.sin(u), small * np.sin(v)

    return parametric(place, (-half, half, low, high), name="torus")


def monkey(box, size=1000.0):
    def place(x, y):
        return size * x, size * y, size * (x**3 - 3 * x * y * y) / 3

    return parametric(place, box, name="monkey saddle")


def saddle(half=0.8, size=1000.0):
    def place(x, y):
        return size * x, size * y, size * x * y

    return parametric(place, (-half, half, -half, half), name="hyperbolic paraboloid")


# Surface, panel size, a surface that bends alike to take a mesh from, and its panel size.
SURFACES = {
    "sphere cap": (cap(), 110.0, ellipsoid(1300.0, 1200.0, 1100.0), 120.0),
    "ellipsoid": (ellipsoid(), 110.0, ellipsoid(1300.0, 1000.0, 900.0), 110.0),
    "torus, outside": (torus(-0.9, 0.9), 80.0, torus(-0.8, 0.8, 0.7, 900.0, 300.0), 60.0),
    "torus, inside": (torus(2.5, 3.78), 60.0, torus(2.6, 3.6, 0.7, 1100.0, 500.0), 60.0),
    "monkey saddle": (monkey((0.4, 1.0, -0.3, 0.3)), 50.0, monkey((0.5, 1, -0.2, 0.2), 1200), 50.0),
    "hyperbolic paraboloid": (saddle(), 110.0, saddle(0.7, 1500.0), 150.0),
}
METHODS = ("support function", "projective duality", "parallel meshes")


def made(method, name):
    surface, size, other, other_size = SURFACES[name]
    if method == "support function":
        return support_function_mesh(surface, size)
    if method == "projective duality":
        return projective_dual_mesh(surface, size).shell
    return parallel_mesh_on(support_function_mesh(other, other_size), surface, drop=True).shell


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("method", METHODS)
def test_planar_simple_hexagons_that_touch_the_surface(method, name):
    surface = SURFACES[name][0]
    shell = made(method, name)
    mesh = shell.mesh
    assert mesh.n_faces > 30
    assert (mesh.sides == 6).all()
    assert relative_planarity(mesh).max() < 1e-12
    assert simple_faces(mesh).all()
    # Panels contain their points of contact, or come near them (a hexagon need not contain it).
    points = shell.points[shell.panels]
    reach = np.abs(mesh.vertices[mesh.corners.reshape(-1, 6)] - points[:, None]).max(axis=(1, 2))
    assert reach.max() < 4 * SURFACES[name][1] * 1.5
    # The plane is the tangent plane: the surface leaves it to second order all around.
    u = surface.nearest(points)
    assert np.abs(surface.point(u) - points).max() < 1e-6
    h = 1e-5 * np.ptp(np.reshape(surface.domain, (2, 2)), axis=1)
    for k in range(2):
        step = np.eye(2)[k] * h[k]
        moved = surface.value(u + step) - surface.value(u - step)
        away = np.einsum("ij,ij->i", moved, shell.normals[shell.panels])
        assert np.abs(away).max() < 1e-7 * np.abs(moved).max()
    # Three panels at every vertex inside, two faces at every edge at most.
    valence = np.bincount(mesh.corners)
    assert valence.max() == 3
    euler = len(mesh.vertices) - len(edges(mesh)) + mesh.n_faces
    assert euler == 1


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize(
    ("surface", "what"),
    [
        (torus(0.0, 2 * np.pi, np.pi), "changes its sign"),
        (monkey((-0.5, 0.51, -0.45, 0.56)), "vanishes"),
        (
            parametric(
                lambda x, y: (x, y, np.sqrt(1e6 - x * x)), (-500, 500, 0, 800), name="cylinder"
            ),
            "vanishes everywhere",
        ),
    ],
    ids=["torus", "monkey saddle", "cylinder"],
)
def test_parabolic_points_are_refused(method, surface, what):
    start = support_function_mesh(cap(), 150.0)
    with pytest.raises(SurfaceError, match=what) as raised:
        if method == "support function":
            support_function_mesh(surface, 80.0)
        elif method == "projective duality":
            projective_dual_mesh(surface, 80.0)
        else:
            parallel_mesh_on(start, surface)
    assert surface.name in str(raised.value)
    if surface.name == "monkey saddle":
        # The flat point lies between samples and is found.
        place = str(raised.value).split("near [")[1].split("]")[0]
        assert np.abs([float(x) for x in place.split(",")]).max() < 0.1


def test_faces_that_cross_themselves_are_named():
    # Rows along the other principal direction make thin triangles.
    outside = torus(-0.9, 0.9)
    shell = support_function_mesh(outside, 80.0, turn=90.0, crossing=True)
    bad = int((~simple_faces(shell.mesh)).sum())
    assert bad > 10
    with pytest.raises(LatticeError, match=f"{bad} of {shell.mesh.n_faces} faces cross"):
        support_function_mesh(outside, 80.0, turn=90.0)
    with pytest.raises(LatticeError, match="projective duality does not promise"):
        projective_dual_mesh(outside, 80.0, turn=90.0)
    # A saddle's hexagons on another saddle whose asymptotic directions lie elsewhere.
    start = support_function_mesh(saddle(0.5), 60.0)

    def steep(x, y):
        return 1000 * x, 1000 * y, 1000 * (x * x - 0.05 * y * y)

    other = parametric(steep, (-0.3, 0.3, -3.0, 3.0), name="steep saddle")
    with pytest.raises(LatticeError, match="moving a mesh parallel to itself does not promise"):
        parallel_mesh_on(start, other, drop=True)


def test_a_sphere_gives_a_mesh_around_it():
    shell = support_function_mesh(cap(), 100.0)
    assert np.abs(shell.heights - 1000).max() < 1e-9
    # Vertices lie outside, and nearer than a panel's size asks for.
    far = np.linalg.norm(shell.mesh.vertices, axis=1)
    assert far.min() > 1000
    assert far.max() < np.hypot(1000, 100)


def test_the_support_function_against_closed_forms():
    normals = support_function_mesh(ellipsoid(half=0.4), 120.0).normals
    for support, exact in (
        (SupportFunction.of(ellipsoid()), Ellipsoid(1500.0, 1000.0, 700.0)),
        (
            SupportFunction.of(
                parametric(
                    lambda x, y: (x, y, -x * x / 1800 - y * y / 3000), (-900, 900, -1500, 1500)
                )
            ),
            Paraboloid(900.0, 1500.0),
        ),
    ):
        assert np.abs(support(normals) - exact(normals)).max() < 1e-9
        assert np.abs(support.points(normals) - exact.points(normals)).max() < 1e-5
    with pytest.raises(SurfaceError, match="are not in its Gauss image, the first is 1"):
        support(np.array([[0, 0, 1.0], [0, 0.1, -1.0]]) / [[1.0], [np.sqrt(1.01)]])


def test_it_is_linear_on_every_triangle():
    """h(n) = n·x at the vertex x of a triangle: a polyhedron's support function by definition."""
    shell = support_function_mesh(ellipsoid(), 110.0)
    triangle = shell.triangles[shell.used_vertices]
    weights = np.random.default_rng(0).dirichlet([1, 1, 1], len(triangle))
    inside = np.einsum("tk,tkj->tj", weights, shell.normals[triangle])
    linear = np.einsum("tk,tk->t", weights, shell.heights[triangle])
    vertex = np.einsum("tj,tj->t", inside, shell.mesh.vertices)
    assert np.abs(vertex - linear).max() < 1e-10
    # The piecewise linear function is above the smooth one, which is convex.
    exact = Ellipsoid(1500.0, 1000.0, 700.0)(inside)
    assert (linear - exact).min() > -1e-10


def test_duality_is_an_involution():
    surface = ellipsoid()
    patch = sample_patch(surface)
    centre = best_centre(patch)
    u = np.random.default_rng(1).uniform(-0.5, 0.5, (50, 2))

    def dual(v):
        return dual_points(surface.point(v), surface.normal(v), centre)

    east, north = 1e-5 * np.eye(2)
    du = dual(u + east) - dual(u - east)
    dv = dual(u + north) - dual(u - north)
    normals = np.cross(du, dv)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    back = dual_points(dual(u), normals)
    assert np.abs(back - (surface.point(u) - centre)).max() < 1e-4
    # a x + b y + c z + 1 = 0 on the tangent plane.
    tangent = surface.derivatives(u)[0][:, 0] + surface.point(u) - centre
    assert np.abs(np.einsum("ij,ij->i", dual(u), tangent) + 1).max() < 1e-9


def test_triangles_of_the_dual_surface_are_the_vertices():
    found = projective_dual_mesh(ellipsoid(), 110.0)
    corner = found.dual.vertices[found.dual.corners.reshape(-1, 3)]
    # The plane a·x + 1 = 0 through three dual points, for x the vertex seen from the centre.
    x = np.linalg.solve(corner, -np.ones((len(corner), 3, 1)))[..., 0] + found.centre
    used = found.shell.used_vertices
    assert np.abs(x[used] - found.shell.mesh.vertices).max() < 1e-6
    assert 1 <= found.distortion < 10
    # Regular: equilateral up to the curvature of the dual surface, at its middle.
    sides = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2)
    assert np.median(sides.max(axis=1) / sides.min(axis=1)) < 1.1


def test_duality_names_a_bad_centre_and_its_distortion():
    top = cap().point(np.zeros(2))
    with pytest.raises(SurfaceError, match="passes through the centre"):
        projective_dual_mesh(cap(), 110.0, centre=[300.0, 0.0, top[2]])
    with pytest.raises(SurfaceError, match="at infinity"):
        dual_points([1.0, 0, 0], [0, 0, 1.0])
    with pytest.raises(LatticeError, match="distorts lengths"):
        projective_dual_mesh(cap(), 110.0, centre=[0.0, 0.0, 880.0], distortion_limit=2.0)
    # Even a sphere's faces cross themselves, seen from a centre far off its middle.
    with pytest.raises(LatticeError, match="faces cross themselves"):
        projective_dual_mesh(cap(), 110.0, centre=[0.0, 0.0, 880.0])
    sphere = sample_patch(cap())
    assert np.linalg.norm(best_centre(sphere)) < 1.0


def test_parallel_meshes_stay_parallel_and_report_reversed_edges():
    start = support_function_mesh(ellipsoid(1300.0, 1000.0, 900.0), 110.0)
    found = parallel_mesh_on(start, ellipsoid(), drop=True)
    assert len(found.faces) < len(start.normals)
    assert np.array_equal(found.shell.normals, start.normals[found.faces])
    assert parallelism(found.start.mesh, found.shell.mesh).max() < 1e-8
    assert found.reversed_edges == 0
    # Nothing is left that belongs to no panel.
    assert len(found.shell.used_vertices) == len(found.shell.triangles)
    with pytest.raises(SurfaceError, match="are not in its Gauss image"):
        parallel_mesh_on(start, ellipsoid())
    # A convex mesh on a saddle: a third of its edges, or more, must turn round.
    turned = parallel_mesh_on(support_function_mesh(cap(half=0.5), 120.0), saddle(), crossing=True)
    assert turned.reversed_edges == (ratios(turned.start.mesh, turned.shell.mesh) < 0).sum()
    assert turned.reversed_edges > 0.3 * len(edges(turned.shell.mesh))
    with pytest.raises(MeshError, match="no panel of the given mesh is left"):
        parallel_mesh_on(start, torus(-0.6, 0.6), drop=True)


def test_a_polygon_mesh_may_be_the_start():
    start = support_function_mesh(ellipsoid(1300.0, 1200.0, 1100.0, 0.4), 120.0)
    found = parallel_mesh_on(start.mesh, cap())
    assert found.shell.mesh.n_faces < start.mesh.n_faces
    assert relative_planarity(found.shell.mesh).max() < 1e-12
    with pytest.raises(MeshError, match="no face with neighbours"):
        parallel_mesh_on(PolyMesh.from_faces(np.eye(3), [[0, 1, 2]]), cap())


def test_the_support_function_serves_other_constructions():
    koebe = support_function_mesh(cap(half=0.3), 100.0)
    touching = touch_surface(koebe, SupportFunction.of(ellipsoid()))
    assert np.abs(touching.heights - Ellipsoid(1500.0, 1000.0, 700.0)(koebe.normals)).max() < 1e-9


def test_implicit_surfaces_and_triangle_meshes():
    axes = np.array([1500.0, 1000.0, 700.0])
    patch = sample_patch(ellipsoid(), samples=25)
    triangles = PolyMesh(
        patch.points, patch.triangles.ravel(), 3 * np.arange(len(patch.triangles) + 1)
    )

    def matrix(x):
        return np.broadcast_to(np.diag(2 / axes**2), (*x.shape[:-1], 3, 3))

    exact = implicit(
        lambda x: np.sum((x / axes) ** 2, axis=-1) - 1,
        lambda x: 2 * x / axes**2,
        matrix,
        (-1.1 * axes, 1.1 * axes),
    )
    for surface, error in ((exact, 1e-7), (mesh_surface(triangles), 2.0)):
        with pytest.raises(SurfaceError, match="give a mesh of triangles"):
            support_function_mesh(surface, 110.0)
        for shell in (
            support_function_mesh(surface, 110.0, mesh=triangles),
            projective_dual_mesh(surface, 110.0, mesh=triangles).shell,
        ):
            assert relative_planarity(shell.mesh).max() < 1e-12
            assert (
                np.abs(np.abs(Ellipsoid(*axes)(shell.normals)) - np.abs(shell.heights)).max()
                < error
            )


def test_panels_that_are_too_large_are_refused():
    with pytest.raises(LatticeError, match="no panel has all its neighbours"):
        support_function_mesh(cap(), 900.0)
    with pytest.raises(LatticeError, match="must be positive"):
        support_function_mesh(cap(), 0.0)


def test_the_chart_keeps_angles():
    patch = sample_patch(cap())
    chart = conformal_chart(patch.points, patch.triangles)
    # On a sphere's patch a conformal chart is a Möbius image of the stereographic picture, up to
    # its border; angles of triangles show how near the least-squares chart comes.
    p, z = patch.points[patch.triangles], chart[patch.triangles]

    def angles(x):
        side = [np.linalg.norm(x[:, (k + 1) % 3] - x[:, (k + 2) % 3], axis=1) for k in range(3)]
        return [
            np.arccos(
                (side[k - 1] ** 2 + side[k - 2] ** 2 - side[k] ** 2)
                / (2 * side[k - 1] * side[k - 2])
            )
            for k in range(3)
        ]

    flat = np.stack([z.real, z.imag], -1)
    assert np.degrees(np.abs(np.array(angles(p)) - np.array(angles(flat)))).max() < 0.5
    plane = np.column_stack([patch.u, np.zeros(len(patch.u))])
    flat_chart = conformal_chart(plane, patch.triangles)
    w = patch.u[:, 0] + 1j * patch.u[:, 1]
    fit = np.polyfit(w, flat_chart, 1)
    assert np.abs(np.polyval(fit, w) - flat_chart).max() < 1e-8
    assert (
        planarity(
            PolyMesh(plane, patch.triangles.ravel(), 3 * np.arange(len(patch.triangles) + 1))
        ).max()
        == 0
    )
    with pytest.raises(SurfaceError, match="no area"):
        conformal_chart(np.diag([0.0, 1.0, 2.0])[:, [1, 1, 1]], np.array([[0, 1, 2]]))


def roof(bumps):
    """A cubic B-spline dome of 7 × 7 control points, with or without bumps."""
    x = 750.0 * (np.array([0, 1 / 3, 1, 2, 3, 11 / 3, 4]) - 2)  # Greville's
    u, v = np.meshgrid(x, x, indexing="ij")
    height = 1200 - (u / 60) ** 2 - 1.4 * (v / 60) ** 2
    height = height + bumps * np.sin(u / 330) * np.cos(v / 300)
    knots = np.array([0, 0, 0, 0, 1, 2, 3, 4, 4, 4, 4.0])
    return nurbs(np.stack([u, v, height], -1), (knots, knots), (3, 3), name="roof")


def test_a_nurbs_roof_without_and_with_bumps():
    for shell in (
        support_function_mesh(roof(0.0), 220.0),
        projective_dual_mesh(roof(0.0), 220.0).shell,
    ):
        assert shell.mesh.n_faces > 80
        assert relative_planarity(shell.mesh).max() < 1e-12
        assert simple_faces(shell.mesh).all()
    for method in (support_function_mesh, projective_dual_mesh):
        with pytest.raises(SurfaceError, match="roof: K changes its sign near"):
            method(roof(250.0), 220.0)


def test_of_a_patch_with_a_waist_the_larger_piece_is_covered():
    patch = sample_patch(cap())
    middle = patch.points[patch.triangles].mean(axis=1)
    keep = (np.abs(middle[:, 0] - 100) > 150) | (np.abs(middle[:, 1]) < 40)
    used, corners = np.unique(patch.triangles[keep], return_inverse=True)
    waisted = PolyMesh(patch.points[used], corners.ravel(), 3 * np.arange(keep.sum() + 1))
    mesh = support_function_mesh(cap(), 110.0, mesh=waisted).mesh
    assert len(mesh.vertices) - len(edges(mesh)) + mesh.n_faces == 1
    assert mesh.vertices[:, 0].max() < 20  # the part with x < −50 mm is the larger
    assert mesh.n_faces > 20

"""The atlas of a mesh whose vertices lie on a known surface gives that surface back."""

import numpy as np
import pytest
from scipy.spatial import Delaunay

from phexfab.errors import SurfaceError
from phexfab.surface.classical import catenoid, enneper
from phexfab.surface.mesh_films.atlas import SPACING, atlas, atlas_surface

SURFACES = [enneper().scaled(1000.0), catenoid().scaled(1000.0), enneper(3).scaled(1000.0)]


def irregular(n, seed=0):
    """Return n × n jittered parameters about 0 and their triangles, counter-clockwise."""
    side = np.linspace(-0.6, 0.6, n)
    width = side[1] - side[0]
    x, y = np.meshgrid(side, side)
    x = x + 0.5 * width * (np.arange(n) % 2)[:, None]
    flat = np.column_stack([x.ravel(), y.ravel()])
    flat += 0.2 * width * np.random.default_rng(seed).uniform(-1, 1, flat.shape)
    triangles = Delaunay(flat).simplices.astype(np.int64)
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    longest = np.max([np.linalg.norm(p - q, axis=1) for p, q in ((a, b), (b, c), (c, a))], axis=0)
    turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles[turn < 0] = triangles[turn < 0][:, ::-1]
    return flat[:, 0] + 1j * flat[:, 1], triangles[longest < 1.75 * width]


def errors(surface, n):
    z, triangles = irregular(n)
    points = surface.point(z)
    charts = atlas(points, triangles)
    at = charts.parameter_of_vertex(np.arange(len(z)))
    normal = np.linalg.norm(charts.surface.normal(at) - surface.normal(z), axis=1).max()
    # Q dz² of unit tangents is an invariant: compare the second form of the same directions.
    bend = charts.surface.principal_curvatures(at) - surface.principal_curvatures(z)
    return normal, 1000 * np.abs(bend).max()


@pytest.mark.parametrize("surface", SURFACES, ids=lambda s: s.name)
def test_normals_and_curvatures_converge_on_irregular_meshes(surface):
    coarse, fine = np.array(errors(surface, 20)), np.array(errors(surface, 40))
    assert (np.log2(coarse / fine) > [3.0, 2.5]).all()
    assert (fine < [1e-3, 3e-2]).all()


def test_charts_pass_through_their_vertices_and_know_them():
    z, triangles = irregular(16)
    points = SURFACES[0].point(z)
    charts = atlas(points, triangles)
    vertices = np.arange(len(z))
    at = charts.parameter_of_vertex(vertices)
    assert np.array_equal(charts.chart(at + 3 - 2j), vertices)
    assert np.abs(charts.surface.point(at) - points).max() < 1e-10
    assert len(np.unique(at)) == len(z) and np.abs(at).max() < SPACING * len(z) ** 0.5
    assert (charts.chart([1e9, -1e9j, np.nan]) == -1).all()
    with pytest.raises(SurfaceError):
        charts.surface.point(np.array([1e9 + 0j]))


def test_neighbouring_charts_agree_and_points_find_their_charts():
    z, triangles = irregular(30)
    points = SURFACES[1].point(z)
    charts = atlas(points, triangles)
    other = charts.near[:, 5]
    there = charts.parameter_near(points[other], np.arange(len(z)))
    assert np.abs(charts.surface.point(there) - points[other]).max() < 1e-3  # of 1000 mm
    moved = charts.rechart(there)
    assert np.array_equal(charts.chart(moved), other)
    assert np.abs(charts.surface.normal(moved) - charts.surface.normal(there)).max() < 1e-4


def test_every_method_of_a_surface_works_across_charts():
    z, triangles = irregular(24)
    surface = atlas_surface(SURFACES[0].point(z), triangles)
    charts = atlas(SURFACES[0].point(z), triangles)
    at = charts.parameter_of_vertex(np.arange(len(z))) + 0.3 - 0.2j
    # The form by itself and its derivatives are those of the closed null curve.
    step = 1e-4
    slope = (surface.point(at + step) - surface.point(at - step)) / (2 * step)
    assert np.abs(slope - surface.tangent(at).real).max() < 1e-5
    assert np.abs(surface.mean_curvature(at)).max() < 1e-12
    target = surface.point(at) + 5.0 * surface.normal(at)
    assert np.abs(surface.closest_parameter(target, at + 0.1) - at).max() < 1e-7
    found = surface.parameter_of_normal(surface.normal(at), at + 0.1j)
    assert np.abs(found - at).max() < 1e-7
    with pytest.raises(SurfaceError, match="no curvature coordinates"):
        surface.curvature_coordinates(at)


def test_a_turned_mesh_turns_the_atlas():
    z, triangles = irregular(16)
    points = SURFACES[1].point(z)
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    one, two = atlas(points, triangles), atlas(points @ turn.T + 1e4, triangles)
    at = one.parameter_of_vertex(np.arange(len(z)))
    gap = two.surface.normal(at) - one.surface.normal(at) @ turn.T
    assert np.abs(gap).max() < 1e-8
    bend = two.surface.principal_curvatures(at) - one.surface.principal_curvatures(at)
    assert np.abs(1000 * bend).max() < 1e-7


def test_the_orientation_of_the_triangles_is_that_of_the_normals():
    z, triangles = irregular(16)
    points = SURFACES[0].point(z)
    at = atlas(points, triangles).parameter_of_vertex(np.arange(len(z)))
    one = atlas_surface(points, triangles).normal(at)
    two = atlas_surface(points, triangles[:, ::-1]).normal(at)
    assert np.abs(one + two).max() < 1e-8


def test_an_umbilic_on_a_vertex_is_met():
    surface = SURFACES[2]
    z, triangles = irregular(31)
    vertex = int(np.abs(z).argmin())
    z[vertex] = 0.0
    charts = atlas(surface.point(z), triangles)
    q = charts.surface.hopf(charts.parameter_of_vertex([vertex, 0]))
    assert abs(q[0]) < 1e-3 * abs(q[1])


def test_a_plane_is_flat():
    z, triangles = irregular(12)
    points = np.column_stack([z.real, z.imag, 0 * z.real]) * 500
    surface = atlas_surface(points, triangles)
    at = atlas(points, triangles).parameter_of_vertex(np.arange(len(z))) + 0.5
    assert np.abs(surface.normal(at) - [0, 0, 1]).max() < 1e-12


def test_meshes_that_are_too_small_or_torn_are_refused():
    z, triangles = irregular(3)
    with pytest.raises(SurfaceError, match="refine the mesh"):
        atlas(SURFACES[0].point(z), triangles)
    z, triangles = irregular(12)
    with pytest.raises(SurfaceError, match="belongs to no triangle"):
        atlas(np.vstack([SURFACES[0].point(z), [[0, 0, 0]]]), triangles)
    rough = SURFACES[0].point(z)
    rough += 150 * np.random.default_rng(0).normal(size=rough.shape)  # edges are of 50 mm
    with pytest.raises(SurfaceError, match="near no smooth minimal"):
        atlas(rough, triangles)

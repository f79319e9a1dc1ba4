"""Hexagons from triangulations: tangent duality, Dupin centres, exactly planar faces."""

import numpy as np
import pytest
from dupin_samples import (
    bumpy_roof,
    ellipsoid,
    hypar,
    monkey_saddle,
    sphere_cap,
    torus,
    triangles_of,
)

from phexfab.errors import LatticeError, SolveError
from phexfab.mesh.measures import (
    corner_angles,
    face_normals,
    mean_edge,
    relative_planarity,
    shortest_edge,
    simple_faces,
)
from phexfab.remesh.dupin.hexagons import (
    dupin_centres,
    parabolic_triangles,
    tangent_hexagons,
    tangent_points,
)
from phexfab.remesh.dupin.ideal import QUASI_REGULAR, REGULAR, affine_distance
from phexfab.remesh.dupin.planar import dupin_hexagons
from phexfab.remesh.triangulations.valid import prespecified_conjugation, progressive_conjugation
from phexfab.surface.freeform.surface import mesh_surface, parametric

WAYS = [progressive_conjugation, prespecified_conjugation]
CASES = [(sphere_cap, 500.0), (hypar, 400.0), (torus, 900.0), (ellipsoid, 700.0)]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("make", "step"), CASES)
def test_hexagons_are_planar_and_simple(make, step, way):
    surface = make()
    made = dupin_hexagons(way(surface, step))
    assert relative_planarity(made.mesh).max() < 1e-12
    assert simple_faces(made.mesh).all() and (made.mesh.sides == 6).all()
    assert len(made.crossing) == 0 == len(made.dropped)
    assert shortest_edge(made.mesh) > 0.2 * mean_edge(made.mesh)
    off = surface.point(surface.nearest(made.mesh.vertices)) - made.mesh.vertices
    assert np.linalg.norm(off, axis=1).max() < 0.15 * mean_edge(made.mesh)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("make", [bumpy_roof, monkey_saddle])
def test_difficult_surfaces_lose_the_faces_that_cross(make, way):
    triangulation = way(make(), 500.0)
    made = dupin_hexagons(triangulation, crossing="drop")
    assert relative_planarity(made.mesh).max() < 1e-10
    assert simple_faces(made.mesh).all()
    assert len(made.dropped) < 0.04 * made.mesh.n_faces
    kept = dupin_hexagons(triangulation, crossing="keep")
    assert kept.mesh.n_faces == made.mesh.n_faces + len(made.dropped)
    if len(kept.crossing):
        with pytest.raises(LatticeError, match=r"faces cross themselves.*radii of curvature"):
            dupin_hexagons(triangulation)


def test_a_mesh_of_a_roof_gives_hexagons():
    surface = mesh_surface(triangles_of(bumpy_roof(), 50, 36), name="roof mesh")
    triangulation = prespecified_conjugation(surface, 700.0, layers=(4, 4))
    made = dupin_hexagons(triangulation, crossing="drop")
    assert relative_planarity(made.mesh).max() < 1e-10
    assert simple_faces(made.mesh).all() and made.mesh.n_faces > 60


def test_shapes_are_those_of_the_thesis():
    for make, model in ((sphere_cap, REGULAR), (hypar, QUASI_REGULAR)):
        triangulation = progressive_conjugation(make(), 300.0, layers=(4, 4))
        mesh = dupin_hexagons(triangulation).mesh
        corners = mesh.vertices[mesh.corners].reshape(-1, 6, 3)
        assert np.median(affine_distance(corners, model)) < 0.05
        reflex = (corner_angles(mesh) > 180).reshape(-1, 6).sum(axis=1)
        assert (reflex == (0 if model is REGULAR else 2)).all()


def test_hexagons_change_their_kind_across_parabolic_curves():
    triangulation = prespecified_conjugation(torus(), 700.0)
    made = dupin_hexagons(triangulation)
    reflex = (corner_angles(made.mesh) > 180).reshape(-1, 6).sum(axis=1)
    outward = np.cos(triangulation.parameters[made.points][:, 1])  # has the sign of K
    assert (reflex[outward > 0.3] == 0).all() and (reflex[outward < -0.3] == 2).all()
    assert (outward > 0.3).sum() > 200 and (outward < -0.3).sum() > 200


@pytest.mark.parametrize("make", [sphere_cap, hypar])
def test_tangent_hexagons_lie_in_tangent_planes(make):
    surface = make()
    triangulation = progressive_conjugation(surface, 400.0)
    mesh, points = tangent_hexagons(triangulation)
    assert relative_planarity(mesh).max() < 1e-9
    assert simple_faces(mesh).all()
    normals = surface.normal(triangulation.parameters[points])
    assert np.abs(face_normals(mesh) - normals).max() < 1e-9
    off = mesh.vertices[mesh.corners] - triangulation.points[points][mesh.face_of_corner]
    assert np.abs((off * normals[mesh.face_of_corner]).sum(1)).max() < 1e-8


def test_dupin_centres_near_tangent_points_with_the_square_of_the_step():
    ratios = []
    for step in (400.0, 200.0):
        triangulation = progressive_conjugation(hypar(), step, layers=(3, 3))
        gap = dupin_centres(triangulation) - tangent_points(triangulation)
        ratios.append(np.linalg.norm(gap, axis=1).max() / step)
    assert ratios[0] / ratios[1] > 1.7 and ratios[1] < 0.002


def test_parabolic_triangles_are_those_across_the_circles():
    triangulation = prespecified_conjugation(torus(), 700.0)
    region = parabolic_triangles(triangulation)
    v = triangulation.parameters[triangulation.triangles][..., 1]
    # cos v = 0 on the parabolic circles; 0.05 of the greater |κ| is at |cos v| about 0.2
    assert (np.abs(np.cos(v)).min(axis=1)[region] < 0.25).all()
    across = (np.sign(np.cos(v)).min(axis=1)) != np.sign(np.cos(v)).max(axis=1)
    assert region[across].all() and across.any()
    centroids = triangulation.points[triangulation.triangles].mean(axis=1)
    plain = dupin_centres(triangulation, rule="centroid")
    assert np.abs(plain - centroids)[region].max() == 0


def test_a_cylinder_has_no_tangent_points_but_hexagons():
    cylinder = parametric(
        lambda x, y: (x, 2000 * np.sin(y), 2000 * np.cos(y)), (0.0, 4000.0, -1.0, 1.0)
    )
    triangulation = prespecified_conjugation(cylinder, 400.0)
    with pytest.raises(SolveError, match="do not meet"):
        tangent_hexagons(triangulation)
    made = dupin_hexagons(triangulation)
    assert relative_planarity(made.mesh).max() < 1e-12 and simple_faces(made.mesh).all()


def test_closeness_draws_the_mesh_to_the_surface():
    surface = hypar()
    triangulation = progressive_conjugation(surface, 400.0, layers=(4, 4))

    def off(made):
        foot = surface.point(surface.nearest(made.mesh.vertices))
        return np.linalg.norm(foot - made.mesh.vertices, axis=1).mean()

    near = dupin_hexagons(triangulation, closeness=100.0)
    assert off(near) < 0.9 * off(dupin_hexagons(triangulation))
    assert relative_planarity(near.mesh).max() < 1e-12


def test_options_are_checked():
    triangulation = progressive_conjugation(hypar(), 500.0, layers=(2, 2))
    with pytest.raises(LatticeError, match='rule = "none"'):
        dupin_hexagons(triangulation, rule="none")
    with pytest.raises(LatticeError, match='crossing = "no"'):
        dupin_hexagons(triangulation, crossing="no")

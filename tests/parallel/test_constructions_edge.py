"""Edge offsets: Koebe polyhedra moved to touch a surface, repaired, and Laguerre-transformed."""

from dataclasses import replace

import numpy as np
import pytest

from phexfab.errors import MeshError, SurfaceError
from phexfab.mesh.measures import mean_edge, signed_areas, simple_faces
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.curvature import minimality
from phexfab.parallel.edge_offset import Ellipsoid, Paraboloid, edge_offset_mesh, touch_surface
from phexfab.parallel.laguerre import boost, dilation, laguerre, rotation, scaling, translation
from phexfab.parallel.offset import edge_ratios, offset, offset_defect
from phexfab.parallel.repair import ratio_matrix, repair_crossings
from phexfab.surface.catalog import surface
from phexfab.testing import assert_offset, assert_parallel, assert_planar, assert_simple

MADE = surface("enneper").scaled(1000.0)
ON = lattice_on(MADE, 120.0)
SHELLS = {kind: minimal_shell(MADE, ON, kind) for kind in ("face", "edge", "vertex")}
KOEBE = SHELLS["edge"]
MEAN = KOEBE.normals.mean(axis=0) / np.linalg.norm(KOEBE.normals.mean(axis=0))
UPWARD = laguerre(KOEBE, rotation(np.cross(MEAN, [0, 0, 1]), np.degrees(np.arccos(MEAN[2]))))


def random_transformation(seed: int):
    rng = np.random.default_rng(seed)
    parts = [
        boost(rng.normal(size=3), 0.3 * rng.uniform()),
        rotation(rng.normal(size=3), 360 * rng.uniform()),
        translation(300 * rng.normal(size=3)),
        dilation(30 * rng.normal()),
        scaling(rng.uniform(0.5, 2)),
    ]
    return np.linalg.multi_dot([parts[k] for k in rng.permutation(5)])


# -- touching a surface --------------------------------------------------------------------------


def test_planes_touch_an_ellipsoid_and_edges_stay_tangent():
    body = Ellipsoid(1200.0, 1000.0, 900.0)
    made = edge_offset_mesh(KOEBE, body).shell
    x = made.points
    assert np.abs((x**2 / [1200.0**2, 1000.0**2, 900.0**2]).sum(1) - 1).max() < 1e-14
    assert np.abs(np.einsum("ij,ij->i", made.normals, x) - made.heights).max() < 1e-10
    gradient = x / [1200.0**2, 1000.0**2, 900.0**2]
    gradient /= np.linalg.norm(gradient, axis=1, keepdims=True)
    assert np.abs(gradient - made.normals).max() < 1e-14
    assert_offset(made.gauss, "edge", 1e-12)
    assert_parallel(made.mesh, made.gauss, 1e-11)
    assert_planar(made.mesh, 1e-12)
    assert_simple(made.mesh)
    # The polyhedron was made for a saddle; on a dome its corners run the other way.
    assert signed_areas(made.mesh, made.normals[made.panels]).min() > 0
    assert (edge_ratios(made) > 0).all()


def test_planes_touch_a_saddle():
    made = edge_offset_mesh(UPWARD, Paraboloid(1000.0, -900.0)).shell
    x, y, z = made.points.T
    assert np.abs(z + x**2 / 2000.0 - y**2 / 1800.0).max() < 1e-10
    assert np.abs(np.einsum("ij,ij->i", made.normals, made.points) - made.heights).max() < 1e-10
    assert_simple(made.mesh)
    assert signed_areas(made.mesh, made.normals[made.panels]).min() > 0
    with pytest.raises(SurfaceError, match="does not point upwards"):
        touch_surface(KOEBE, Paraboloid(1000.0, -900.0))


def test_planes_touch_a_minimal_surface_with_and_without_a_guess():
    made = edge_offset_mesh(replace(KOEBE, parameters=np.zeros(0, complex)), MADE).shell
    assert np.abs(MADE.normal(made.parameters) - made.normals).max() < 1e-12
    assert np.abs(made.points - touch_surface(KOEBE, MADE).points).max() < 1e-9
    border = np.setdiff1d(np.arange(len(KOEBE.normals)), KOEBE.panels)
    tangent = np.einsum("ij,ij->i", KOEBE.points, KOEBE.normals)
    assert np.abs(made.heights - tangent)[border].max() < 1e-9


def test_a_support_function_of_ones_gives_the_sphere():
    made = touch_surface(KOEBE, lambda n: np.full(len(n), 700.0))
    ball = touch_surface(KOEBE, Ellipsoid(700.0, 700.0, 700.0))
    assert np.abs(made.heights - ball.heights).max() < 1e-12
    assert np.abs(made.points - ball.points).max() < 1e-12
    with pytest.raises(SurfaceError, match="one finite height"):
        touch_surface(KOEBE, lambda n: np.ones(3))


def test_a_mesh_that_is_no_koebe_polyhedron_is_refused():
    with pytest.raises(MeshError, match="no Koebe polyhedron"):
        edge_offset_mesh(SHELLS["face"], Ellipsoid(1000.0, 1000.0, 1000.0))


# -- repairs -------------------------------------------------------------------------------------


def test_the_ratios_are_this_linear_function_of_the_heights():
    for seed in range(3):
        heights = 100 * np.random.default_rng(seed).normal(size=len(KOEBE.heights))
        told = ratio_matrix(KOEBE) @ heights
        assert np.abs(told - edge_ratios(KOEBE.with_heights(heights))).max() < 1e-8


@pytest.mark.parametrize("seed", range(4))
def test_crossings_are_repaired_and_the_offset_type_stays(seed):
    """Planes of a valid shell pushed about until many panels cross themselves."""
    size = 0.12 * mean_edge(KOEBE.mesh)
    noise = np.random.default_rng(seed).normal(scale=size, size=len(KOEBE.heights))
    broken = KOEBE.with_heights(KOEBE.heights + noise)
    made = repair_crossings(broken)
    assert len(made.crossing) and len(made.turned)
    assert made.crossing.tolist() == np.flatnonzero(~simple_faces(broken.mesh)).tolist()
    assert not len(made.left) and made.note == ""
    assert_simple(made.shell.mesh)
    assert signed_areas(made.shell.mesh, KOEBE.normals[KOEBE.panels]).min() > 0
    assert_parallel(made.shell.mesh, KOEBE.mesh, 1e-8)
    assert_offset(made.shell.gauss, "edge", 1e-12)
    flipped = (edge_ratios(broken) < 0) != (edge_ratios(made.shell) < 0)
    assert np.flatnonzero(flipped).tolist() == made.turned.tolist()
    step = made.shell.heights - broken.heights
    assert np.flatnonzero(step).tolist() == made.moved.tolist()
    assert np.abs(made.moves).max() < 8 * size
    # The least sum: not above that of undoing all the noise.
    assert np.abs(made.moves).sum() < np.abs(noise).sum()


def test_a_valid_mesh_is_left_alone():
    made = repair_crossings(KOEBE)
    assert made.shell is KOEBE and not len(made.moved) and not len(made.crossing)


def test_a_flat_ellipsoid_is_reported_and_repaired():
    made = edge_offset_mesh(KOEBE, Ellipsoid(1000.0, 300.0, 200.0))
    raw = edge_offset_mesh(KOEBE, Ellipsoid(1000.0, 300.0, 200.0), repair=False)
    assert len(raw.left) == len(made.crossing) > 0
    assert (edge_ratios(made.shell) > 0).all()
    assert_simple(made.shell.mesh)


def test_a_repair_that_cannot_be_says_so():
    """All edges of one panel to point to one side of a line: then it cannot close."""
    signs = np.where(edge_ratios(KOEBE) < 0, -1, 1)
    row_of = {tuple(sorted(e)): k for k, e in enumerate(KOEBE.edges[:, :2].tolist())}
    ring = KOEBE.mesh.face(len(KOEBE.panels) // 2).tolist()
    s = KOEBE.gauss.vertices
    side = s[ring[1]] - s[ring[0]] + 0.01 * (s[ring[2]] - s[ring[1]])
    for i, j in zip(ring, ring[1:] + ring[:1], strict=True):
        signs[row_of[tuple(sorted((i, j)))]] = 1 if (s[j] - s[i]) @ side > 0 else -1
    made = repair_crossings(KOEBE, signs=signs)
    assert "no heights give all edges their wanted sense" in made.note
    assert not len(made.moved)


def test_a_fraction_outside_its_range_is_refused():
    with pytest.raises(MeshError, match="fraction = 1"):
        repair_crossings(KOEBE, fraction=1.0)


# -- Laguerre transformations --------------------------------------------------------------------


@pytest.mark.parametrize("kind", SHELLS)
@pytest.mark.parametrize("seed", range(4))
def test_every_offset_type_stays_what_it_is(kind, seed):
    made = laguerre(SHELLS[kind], random_transformation(seed))
    assert offset_defect(made).max() < 1e-12
    assert np.abs(np.linalg.norm(made.normals, axis=1) - 1).max() < 1e-14
    assert_parallel(made.mesh, made.gauss, 1e-10)
    assert_planar(made.mesh, 1e-12)


@pytest.mark.parametrize("kind", SHELLS)
def test_transformations_form_a_group(kind):
    shell, one, two = SHELLS[kind], random_transformation(11), random_transformation(12)
    product, steps = laguerre(shell, one @ two), laguerre(laguerre(shell, two), one)
    back = laguerre(laguerre(shell, one), np.linalg.inv(one))
    for a, b in ((product, steps), (shell, back)):
        assert np.abs(a.normals - b.normals).max() < 1e-13
        assert np.abs(a.gauss_heights - b.gauss_heights).max() < 1e-13
        assert np.abs(a.heights - b.heights).max() < 1e-10


def test_boosts_along_one_direction_add_their_rapidities():
    d = [1.0, 2.0, -2.0]
    assert np.abs(boost(d, 0.4) @ boost(d, 0.3) - boost(d, 0.7)).max() < 1e-14


def test_boosts_are_moebius_maps_of_face_type_normals():
    """In the stereographic chart from the direction's opposite they only stretch."""
    shell, rapidity = SHELLS["face"], 0.5
    made = laguerre(shell, boost([0, 0, 1], rapidity))
    for one, two in zip(shell.normals, made.normals, strict=True):
        before, after = one[:2] / (1 + one[2]), two[:2] / (1 + two[2])
        assert np.abs(after - np.exp(-rapidity) * before).max() < 1e-12 * (1 + np.abs(before).max())


@pytest.mark.parametrize("kind", SHELLS)
def test_dilations_are_offsets_and_similarities_what_they_should_be(kind):
    shell = SHELLS[kind]
    assert np.allclose(laguerre(shell, dilation(-9.0)).heights, offset(shell, -9.0).heights)
    moved = laguerre(shell, translation([30.0, -20.0, 50.0]) @ scaling(2.0)).mesh.vertices
    assert np.abs(moved - (2 * shell.mesh.vertices + [30.0, -20.0, 50.0])).max() < 1e-9
    turn = rotation([1, 1, 0], 40.0)
    turned = laguerre(shell, turn).mesh.vertices
    assert np.abs(turned - shell.mesh.vertices @ turn[:3, :3].T).max() < 1e-9
    assert np.allclose(minimality(laguerre(shell, turn)), 0, atol=1e-11)
    assert minimality(laguerre(shell, boost([1, 0, 0], 0.3))).max() > 1e-2


def test_moving_the_face_planes_alone_loses_the_edge_type():
    """It is the vertex cones that move: acting on face planes (n, 1; h) is another map."""
    tilt = boost([1, 0, 1], 0.4)[:4, :4]
    moved = np.linalg.solve(tilt.T, np.column_stack([KOEBE.normals, np.ones(len(ON.points))]).T).T
    plain = moved[:, :3] / np.linalg.norm(moved[:, :3], axis=1, keepdims=True)
    right = laguerre(KOEBE, boost([1, 0, 1], 0.4))
    assert np.abs(plain - right.normals).max() > 1e-4
    # No heights make these normals a Koebe polyhedron: neighbouring circles would touch.
    wrong = replace(right, normals=plain)
    assert offset_defect(wrong).max() > 1e-4


def test_other_matrices_and_too_strong_boosts_are_refused():
    with pytest.raises(MeshError, match=r"\(5, 5\) matrix"):
        laguerre(KOEBE, np.eye(4))
    with pytest.raises(MeshError, match="Lorentz product"):
        laguerre(KOEBE, np.diag([1.0, 2.0, 1.0, 1.0, 1.0]))
    with pytest.raises(MeshError, match="keep the orientation"):
        laguerre(KOEBE, np.diag([-1.0, 1.0, 1.0, 1.0, 1.0]))
    with pytest.raises(MeshError, match="pass through infinity"):
        laguerre(KOEBE, boost(-KOEBE.normals.mean(axis=0), 6.0) @ boost([0, 0, 1], 6.0))
    with pytest.raises(MeshError, match="no direction"):
        boost([0, 0, 0], 1.0)

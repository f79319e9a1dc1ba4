"""Circular, conical, Koebe, and which offsets a mesh allows (thesis §4.4, 5.3.1, ch. 6)."""

import itertools
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from phexfab.errors import MeshError
from phexfab.mesh.io import read_mesh, weld
from phexfab.mesh.measures import corner_angles, relative_planarity
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.classify import (
    circularity,
    classify_mesh,
    conicality,
    koebe_residual,
    quasi_circularity,
)
from phexfab.parallel.pairs import classify_pair, is_parallel, offset_pair, worst_edge
from phexfab.parallel.space import parallel_space
from phexfab.parallel.sphere_fit import fit_to_sphere, sphere_miss
from phexfab.parallel.to_offset import nearest_offset_mesh
from phexfab.surface.catalog import surface

KINDS = ["face", "edge", "vertex"]
DATA = Path(__file__).resolve().parents[3] / "shared" / "data"


@cache
def shell(kind, name="enneper"):
    made = surface(name).scaled(1000.0)
    closed = name == "catenoid"
    return minimal_shell(made, lattice_on(made, 400.0 if closed else 120.0, closed=closed), kind)


@cache
def classified(kind):
    return classify_mesh(shell(kind).mesh)


def polygon(points):
    flat = np.asarray(points, float)
    return PolyMesh.from_faces(np.column_stack([flat, np.zeros(len(flat))]), [range(len(flat))])


def circle(angles):
    return np.column_stack([np.cos(angles), np.sin(angles)])


def test_a_circular_polygon_is_circular_and_a_moved_corner_shows():
    points = circle([0.1, 0.9, 2.0, 3.1, 4.0, 5.5]) * 30 + [100, 7]
    assert circularity(polygon(points))[0] < 1e-14
    points[2] += 0.3 * circle([2.0])[0]  # one hundredth of the radius, outwards
    assert 1e-3 < circularity(polygon(points))[0] < 2e-2


def test_quasi_circular_means_parallel_to_a_circular_polygon():
    """Corners of any polygon parallel to a circular one, flipped edges too; and back."""
    base = polygon(circle([0.1, 0.9, 2.0, 3.1, 4.0, 5.5]))
    rng = np.random.default_rng(3)
    made = parallel_space(base)
    for size in (0.2, 1.0, 5.0):
        other = made.member(size * rng.standard_normal(made.dimension))
        assert quasi_circularity(other)[0] < 1e-9
        assert circularity(other)[0] > 1e-3
    bent = base.vertices.copy()
    bent[0, 0] += 0.01
    angles = corner_angles(PolyMesh(bent, base.corners, base.starts))
    defect = quasi_circularity(PolyMesh(bent, base.corners, base.starts))[0]
    # The thesis' criterion, for a convex hexagon: both alternating sums are 360 degrees.
    assert defect == pytest.approx(abs(angles[::2].sum() - 360), rel=1e-9)
    assert defect > 0.1


def test_odd_polygons_are_always_quasi_circular():
    assert quasi_circularity(polygon([[0, 0], [3, 0], [4, 2], [1, 5], [-1, 1]]))[0] == 0


def star(normals, signs):
    """Four faces about the origin in planes of given normals, rays where neighbours meet."""
    rays = np.cross(normals, np.roll(normals, -1, axis=0)) * np.asarray(signs)[:, None]
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    before = np.roll(rays, 1, axis=0)  # face k has its corner between ray k − 1 and ray k
    turn = (np.cross(before, rays) * normals).sum(1)
    corners = np.degrees(np.arctan2(turn, (before * rays).sum(1)))
    faces = [[4, (k - 1) % 4, k] for k in range(4)]
    return PolyMesh.from_faces(np.vstack([rays, np.zeros(3)]), faces), corners


def on_circle(rng, opening):
    angle = rng.uniform(0, 2 * np.pi, 4)
    ring = [np.sin(opening) * np.cos(angle), np.sin(opening) * np.sin(angle)]
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return np.column_stack([*ring, np.full(4, np.cos(opening))]) @ (turn * np.linalg.det(turn))


def test_conical_vertices_are_those_with_equal_sums_of_opposite_corners():
    rng, seen = np.random.default_rng(4), 0
    for _ in range(400):
        normals = on_circle(rng, rng.uniform(0.05, 1.4))
        bent = normals + 0.05 * rng.normal(size=(4, 3))
        bent /= np.linalg.norm(bent, axis=1, keepdims=True)
        for signs in itertools.product((1, -1), repeat=4):
            mesh, corners = star(normals, signs)
            if (corners > 1).all():  # below 180° and counter-clockwise about all four normals
                seen += 1
                assert abs(corners[0] - corners[1] + corners[2] - corners[3]) < 1e-6
                assert conicality(mesh)[4] < 1e-9
            mesh, corners = star(bent, signs)
            if (corners > 1).all() and (corners < 179).all():
                off = abs(corners[0] - corners[1] + corners[2] - corners[3])
                assert (off > 1e-6) == (conicality(mesh)[4] > 1e-9)
    assert seen > 200


def test_planes_through_one_line_touch_no_cone():
    angle = np.array([0.1, 0.9, 2.0, 2.8])
    rays = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    tips = np.array([[0, 0, 1.0], [0, 0, 0]])
    # Four half-planes of one axis: their normals lie on a great circle.
    mesh = PolyMesh.from_faces(np.vstack([rays, tips]), [[5, k, 4] for k in range(4)])
    assert conicality(mesh)[5] == 1.0


def test_a_flat_vertex_is_conical_to_rounding():
    rng = np.random.default_rng(2)
    angle = np.array([0.1, 1.5, 3.2, 4.6])
    flat = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    mesh = PolyMesh.from_faces(
        np.vstack([flat, np.zeros(3)]) @ turn, [[4, k, (k + 1) % 4] for k in range(4)]
    )
    assert conicality(mesh)[4] == 0


def test_four_planes_on_a_cone_are_conical_and_a_tilted_one_shows():
    def pyramid(heights):
        ring = np.column_stack([circle([0, 1.2, 3.0, 4.5]), heights])
        faces = [[4, i, (i + 1) % 4] for i in range(4)]
        return PolyMesh.from_faces(np.vstack([ring, [[0, 0, 1.0]]]), faces)

    # Planes through the apex that touch a cone: traces tangent to the unit circle at these angles.
    a = np.array([0, 1.2, 3.0, 4.5])
    meet = [
        np.linalg.solve(np.vstack([circle([t]), circle([u])]), [1, 1])
        for t, u in zip(a, np.roll(a, -1), strict=True)
    ]
    cone = PolyMesh.from_faces(
        np.vstack([np.column_stack([meet, np.zeros(4)]), [[0, 0, 1.0]]]),
        [[4, i, (i + 1) % 4] for i in range(4)],
    )
    assert conicality(cone)[4] < 1e-14
    assert conicality(pyramid([0, 0.3, 0, -0.2]))[4] > 1e-2
    assert conicality(shell("edge").mesh).max() == 0  # three planes always touch one cone


@pytest.mark.parametrize("name", ["enneper", "catenoid"])
def test_gauss_images_show_their_type(name):
    limits = {"circular": 1e-11, "koebe": 1e-11}
    for kind in KINDS:
        gauss = shell(kind, name).gauss
        koebe = koebe_residual(gauss)
        is_circular = circularity(gauss).max() < limits["circular"]
        is_koebe = max(koebe.edges.max(), koebe.incircles.max()) < limits["koebe"]
        assert is_circular == (kind == "vertex")
        assert is_koebe == (kind == "edge")
        assert (koebe.touching.max() < limits["koebe"]) == (kind == "edge")
        assert (sphere_miss(gauss, "face").max() < 1e-11) == (kind == "face")


def test_the_mesh_of_a_vertex_shell_is_quasi_circular_but_not_circular():
    mesh = shell("vertex").mesh
    assert quasi_circularity(mesh).max() < 1e-9 and circularity(mesh).max() > 1e-2
    assert quasi_circularity(shell("face").mesh).max() > 1e-3


@pytest.mark.parametrize("kind", KINDS)
def test_classified_right_from_the_mesh_alone(kind):
    found = classified(kind)
    assert found.kind == kind
    assert set(found.kinds) == {kind, "face"}  # a simple mesh always has a face offset
    for other, fit in found.fits.items():
        assert is_parallel(shell(kind).mesh, fit.gauss, 1e-10)
        assert (fit.worst < 1e-12) == (other in found.kinds)
        # The offset along the S found is of that type, measured on the pair.
        pair = offset_pair(shell(kind).mesh, fit.gauss, 10.0)
        assert classify_pair(shell(kind).mesh, pair).spreads[other] < 3 * fit.worst + 1e-11


@pytest.mark.parametrize("kind", KINDS)
def test_every_member_of_the_space_is_of_the_same_type(kind):
    made = parallel_space(shell(kind).mesh)
    member = made.member(2 * np.random.default_rng(6).standard_normal(made.dimension))
    assert classify_mesh(member).kind == kind


def test_the_gauss_image_of_an_edge_offset_is_found_again():
    """A Koebe image in P(M) is rigid, a vertex image has two parameters, so only this is one."""
    found = classified("edge").fits["edge"].gauss
    assert np.abs(found.vertices - shell("edge").gauss.vertices).max() < 1e-10
    moved = fit_to_sphere(parallel_space(shell("vertex").mesh), "vertex", shell("vertex").gauss)
    assert moved.worst < 1e-13
    assert np.abs(moved.gauss.vertices - shell("vertex").gauss.vertices).max() < 1e-10


def test_turned_vertex_images_are_vertex_images():
    """The two-parameter family: mirror any point of the sphere along the edges."""
    mesh = shell("vertex").mesh
    made = parallel_space(mesh)
    first = classified("vertex").fits["vertex"].gauss
    wish = PolyMesh(first.vertices + np.array([0.02, -0.01, 0.0]), mesh.corners, mesh.starts)
    other = fit_to_sphere(made, "vertex", wish)
    assert other.worst < 1e-9
    assert np.abs(other.gauss.vertices - first.vertices).max() > 1e-4


def test_a_rotational_mesh_is_of_several_types():
    """By symmetry its faces are quasi-circular whatever the shell was made for."""
    found = classify_mesh(shell("edge", "catenoid").mesh)
    assert set(found.kinds) == {"vertex", "edge", "face"} and found.kind == "edge"
    assert found.quasi_circular < 1e-9


def test_circular_quads_have_a_vertex_offset_and_a_quad_torus_a_face_offset_too():
    u, v = np.meshgrid(np.linspace(0.2, 1.4, 5), np.linspace(0.3, 1.8, 6), indexing="ij")
    points = np.stack(
        [(3 + np.cos(u)) * np.cos(v), (3 + np.cos(u)) * np.sin(v), np.sin(u)], -1
    ).reshape(-1, 3)
    at = np.arange(30).reshape(5, 6)
    faces = np.stack([at[:-1, :-1], at[:-1, 1:], at[1:, 1:], at[1:, :-1]], -1).reshape(-1, 4)
    torus = PolyMesh.from_faces(points, faces)
    assert circularity(torus).max() < 1e-13 and conicality(torus).max() < 1e-12
    found = classify_mesh(torus)
    assert {"vertex", "face"} <= set(found.kinds) and found.fits["vertex"].worst < 1e-11


@pytest.mark.parametrize("wanted", KINDS)
@pytest.mark.parametrize("kind", KINDS)
def test_the_nearest_mesh_with_an_offset(kind, wanted):
    mesh = shell(kind).mesh
    made = nearest_offset_mesh(mesh, wanted)
    assert made.miss < 1e-12 and sphere_miss(made.gauss, wanted).max() < 1e-12
    assert relative_planarity(made.mesh).max() < 1e-12
    assert worst_edge(made.mesh, made.gauss)[0] < 1e-10
    assert classify_pair(made.mesh, offset_pair(made.mesh, made.gauss, 10.0), 1e-9).kind == wanted
    assert made.moved == pytest.approx(
        np.linalg.norm(made.mesh.vertices - mesh.vertices, axis=1), abs=1e-12
    )
    if wanted in (kind, "face"):
        assert made.moved.max() < 1e-8  # nothing to do
    else:
        assert 1e-3 < made.moved.max() < 5


def test_what_cannot_be_moved_is_refused():
    with pytest.raises(MeshError, match="not simple"):
        nearest_offset_mesh(
            PolyMesh.from_faces(
                [[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]],
                [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]],
            ),
            "vertex",
        )
    with pytest.raises(MeshError, match='kind = "corner"'):
        fit_to_sphere(parallel_space(shell("edge").mesh), "corner")


def public(name):
    if not (DATA / name).exists():
        pytest.skip(f"the public mesh {name} is not beside the repository (../shared/data)")
    return read_mesh(DATA / name)


@pytest.mark.parametrize(
    ("name", "miss"), [("enneper2.off", 1e-5), ("catenoid3.off", 2e-6)], ids=["enneper", "catenoid"]
)
def test_public_minimal_meshes_have_a_vertex_offset(name, miss):
    """To what their printed digits allow: faces are planar to 4e-5 of the mean edge only."""
    mesh = public(name)
    if name.startswith("catenoid"):
        mesh = weld(mesh, 0.01)
        assert len(mesh.vertices) == 3400
    found = classify_mesh(mesh)
    assert found.kind == "vertex"
    assert found.fits["vertex"].worst < miss
    assert np.abs(np.linalg.norm(found.fits["vertex"].gauss.vertices, axis=1) - 1).max() < miss
    assert found.sine < 1e-3 and found.planarity < 4e-5
    # Digits, not shape: a mesh that has the offset exactly lies within 0.06 of 30 mm edges.
    exact = nearest_offset_mesh(mesh, "vertex")
    assert exact.miss < 1e-11 and exact.moved.max() < 0.1


def test_the_public_koebe_mesh_touches_the_sphere():
    mesh = public("hexagonalminimal_plusgauss.off")
    koebe = koebe_residual(mesh)
    assert koebe.edges.max() < 4e-11
    assert koebe.incircles.max() < 1e-9 and koebe.touching.max() < 1e-8
    assert sphere_miss(mesh, "vertex").max() > 1e-3
    assert fit_to_sphere(parallel_space(mesh), "edge").worst < 1e-10

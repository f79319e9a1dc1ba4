"""P(M) (thesis §4.1): dimension, basis, ratios, blends; and what an offset pair says (§4.2–4.3)."""

from functools import cache

import numpy as np
import pytest

from phexfab.errors import MeshError, OffsetLimitError
from phexfab.mesh.measures import edges, relative_planarity
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.curvature import minimality
from phexfab.parallel.offset import admissible_interval, edge_ratios
from phexfab.parallel.pairs import (
    blend,
    classify_pair,
    gauss_from_pair,
    is_parallel,
    offset_pair,
    pair_interval,
    parallelism,
    ratios,
    worst_edge,
)
from phexfab.parallel.simple import border_of, is_simple, shell_of_mesh, simple_basis
from phexfab.parallel.space import parallel_space
from phexfab.surface.catalog import surface

KINDS = ["face", "edge", "vertex"]


@cache
def shell(kind, name="enneper"):
    made = surface(name).scaled(1000.0)
    closed = name == "catenoid"
    return minimal_shell(made, lattice_on(made, 400.0 if closed else 160.0, closed=closed), kind)


@cache
def space(kind, name="enneper"):
    return parallel_space(shell(kind, name).mesh)


def random_member(kind, seed, size=20.0):
    coordinates = np.random.default_rng(seed).standard_normal(space(kind).dimension)
    return space(kind).member(size * coordinates)


def turning(mesh, other):
    """How far the other's edges are off M's directions, over the other's mean edge."""
    pairs = edges(mesh)
    one, two = (m.vertices[pairs[:, 1]] - m.vertices[pairs[:, 0]] for m in (mesh, other))
    one /= np.linalg.norm(one, axis=1, keepdims=True)
    return np.linalg.norm(np.cross(one, two), axis=1).max() / np.linalg.norm(two, axis=1).mean()


def quads(n, dent=0.0):
    """A translation surface of n × n planar quads (dented in one vertex)."""
    u, v = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij")
    points = np.stack([u, v + 0.05 * u**2, 0.1 * u**2 - 0.07 * v**2], -1).reshape(-1, 3)
    points[(n + 1) * (n // 2) + n // 2, 2] += dent
    at = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    faces = np.stack([at[:-1, :-1], at[1:, :-1], at[1:, 1:], at[:-1, 1:]], -1).reshape(-1, 4)
    return PolyMesh.from_faces(points, faces)


def dodecahedron():
    """A closed simple mesh: the dual of the icosahedron, corners ordered about each face."""
    g = (1 + 5**0.5) / 2
    tips = np.array(
        [p for a in (-1, 1) for b in (-g, g) for p in ((0, a, b), (a, b, 0), (b, 0, a))]
    )
    near = [
        [i, j, k]
        for i in range(12)
        for j in range(i)
        for k in range(j)
        if max(np.linalg.norm(tips[a] - tips[b]) for a, b in ((i, j), (j, k), (i, k))) < 2.01
    ]
    points = np.array([tips[row].mean(axis=0) for row in near])
    faces = []
    for i, tip in enumerate(tips):
        ring = [v for v, row in enumerate(near) if i in row]
        x = np.cross(tip, points[ring[0]])
        y = np.cross(tip, x)
        ring.sort(key=lambda v: np.arctan2(points[v] @ y, points[v] @ x))
        faces.append(ring)
    return PolyMesh.from_faces(points, faces)


@pytest.mark.parametrize("kind", KINDS)
def test_a_simple_disc_has_a_dimension_for_every_face_and_border_run(kind):
    mesh = shell(kind).mesh
    border = border_of(mesh)
    expected = mesh.n_faces + int((border.valence == 1).sum())
    assert space(kind).dimension == expected == len(edges(mesh)) - 2 * mesh.n_faces + 3
    # By another route: rank of "every edge keeps its direction", densely.
    general = parallel_space(mesh, method="directions")
    assert general.dimension == expected
    assert general.gap[0] < 1e-12 < 1e-3 < general.gap[1]


def test_a_closed_simple_mesh_has_a_dimension_for_every_face():
    """Without a border: the number of faces, as the thesis' remark on simple meshes says."""
    solid = dodecahedron()
    assert is_simple(solid) and len(border_of(solid).corner) == 0
    assert parallel_space(solid).dimension == solid.n_faces == 12
    assert parallel_space(solid, method="directions").dimension == 12


def test_a_ring_keeps_closed():
    mesh = shell("edge", "catenoid").mesh
    ring = parallel_space(mesh)
    assert ring.method == "heights"
    # Two equations for each face, three for the way around the hole.
    assert ring.dimension == len(edges(mesh)) - 2 * mesh.n_faces - 3 + 3
    assert parallel_space(mesh, method="directions").dimension == ring.dimension


def test_quads_have_one_dimension_for_every_row_and_column():
    """A parallel translation surface scales each row and each column of edges; or moves."""
    for n in (3, 5):
        mesh = quads(n)
        assert simple_basis(mesh) is None
        assert parallel_space(mesh).method == "directions"
        assert parallel_space(mesh).dimension == 2 * n + 3


def test_triangles_only_move_and_scale():
    mesh = quads(2, dent=0.3)
    cut = [face for f in mesh.faces for face in (f[[0, 1, 2]], f[[0, 2, 3]])]
    assert parallel_space(PolyMesh.from_faces(mesh.vertices, cut)).dimension == 4


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", ["heights", "directions"])
def test_random_members_are_parallel_and_planar(kind, method):
    mesh = shell(kind).mesh
    made = parallel_space(mesh, method=method)
    for seed in range(3):
        coordinates = 20 * np.random.default_rng(seed).standard_normal(made.dimension)
        member = made.member(coordinates)
        assert turning(mesh, member) < 1e-12
        assert relative_planarity(member).max() < 1e-12
        assert not is_parallel(mesh, PolyMesh(mesh.vertices[::-1], mesh.corners, mesh.starts))
        change = ratios(mesh, member) - 1
        assert np.allclose(made.ratio_matrix @ coordinates, change, atol=1e-10)


def test_the_fields_are_independent_and_hold_translations_and_scaling():
    made = space("edge")
    flat = made.fields.reshape(made.dimension, -1)
    flat = flat / np.linalg.norm(flat, axis=1, keepdims=True)
    assert np.linalg.matrix_rank(flat, tol=1e-7) == made.dimension
    n = len(made.mesh.vertices)
    for wish in (*(np.tile(axis, n) for axis in np.eye(3)), made.mesh.vertices.ravel() / 1000):
        rest = wish - flat.T @ np.linalg.lstsq(flat.T, wish, rcond=None)[0]
        assert np.abs(rest).max() < 1e-9


def test_the_gauss_image_is_a_member():
    for kind in KINDS:
        assert is_parallel(shell(kind).mesh, shell(kind).gauss, 1e-11)


def test_blends_are_members_and_strangers_are_refused():
    one, two = random_member("face", 1), random_member("face", 2)
    mesh = shell("face").mesh
    mixed = blend([mesh, one, two], [0.5, 0.3, -0.7])
    assert turning(mesh, mixed) < 1e-12
    expected = 0.5 + 0.3 * ratios(mesh, one) - 0.7 * ratios(mesh, two)
    assert np.allclose(ratios(mesh, mixed), expected, atol=1e-11)
    with pytest.raises(MeshError, match=r"member 1 is not parallel to the first: edge \d+-\d+"):
        blend([mesh, PolyMesh(mesh.vertices[::-1], mesh.corners, mesh.starts)], [1, 1])
    with pytest.raises(MeshError, match="one weight each"):
        blend([mesh], [0.5, 0.5])


def test_other_faces_are_not_parallel():
    mesh, other = quads(2), quads(3)
    assert not is_parallel(mesh, other)
    with pytest.raises(MeshError, match="do not correspond"):
        parallelism(mesh, other)


def test_the_worst_edge_is_found():
    mesh = quads(3)
    moved = mesh.vertices.copy()
    moved[0] += [0, 0, 1e-3]
    sine, edge = worst_edge(mesh, PolyMesh(moved, mesh.corners, mesh.starts))
    assert 0 in edge and 5e-4 < sine < 1.1e-3


@pytest.mark.parametrize("kind", KINDS)
def test_offset_pairs_compose_and_tell_what_they_are(kind):
    """Offset of an offset = one offset, S of S = S, and the type of the pair."""
    mesh, gauss = shell(kind).mesh, shell(kind).gauss
    low, high = pair_interval(mesh, gauss)
    assert (low, high) == pytest.approx(admissible_interval(shell(kind)), rel=1e-12)
    for d in (0.4 * low, 0.4 * high):
        once = offset_pair(mesh, gauss, d)
        twice = offset_pair(offset_pair(mesh, gauss, 0.3 * d), gauss, 0.7 * d)
        assert np.abs(once.vertices - twice.vertices).max() < 1e-12 * 1000
        again = gauss_from_pair(mesh, once, d)
        assert np.abs(again.vertices - gauss.vertices).max() < 1e-12
        found = classify_pair(mesh, once, 1e-10)
        assert found.kinds == (kind,) and found.kind == kind
        assert found.distance == pytest.approx(d, rel=1e-12)
        assert found.spreads[kind] < 1e-12 and found.sine < 1e-10
        assert min(found.spreads[k] for k in KINDS if k != kind) > 1e-4
        assert np.abs(gauss_from_pair(mesh, once).vertices - gauss.vertices).max() < 1e-12
    assert (
        np.abs(
            gauss_from_pair(gauss, offset_pair(gauss, gauss, 0.5), 0.5).vertices - gauss.vertices
        ).max()
        < 1e-12
    )
    with pytest.raises(OffsetLimitError, match=r"edge \d+-\d+ would flip; keep the distance"):
        offset_pair(mesh, gauss, 1.001 * high)
    assert ratios(mesh, offset_pair(mesh, gauss, 0.999 * high)).min() > 0
    assert ratios(mesh, offset_pair(mesh, gauss, 0.999 * low)).min() > 0


@pytest.mark.parametrize("kind", KINDS)
def test_the_gauss_image_serves_every_member(kind):
    """Thesis §4.3: S gives offsets of one type to all of P(M)."""
    member, gauss = random_member(kind, 4, 3.0), shell(kind).gauss
    moved = PolyMesh(member.vertices + 5.0 * gauss.vertices, member.corners, member.starts)
    measured = classify_pair(shell(kind).mesh, moved, 1e-6)
    assert measured.kind is None  # against M the distance is not constant
    distance = np.linalg.norm(gauss.vertices, axis=1) if kind == "vertex" else None
    if kind == "vertex":
        assert np.abs(distance - 1).max() < 1e-12
    assert classify_pair(member, moved, 1e-6).spreads[kind] < 1e-9


def test_a_mesh_is_no_offset_of_itself():
    with pytest.raises(MeshError, match="the same"):
        classify_pair(quads(2), quads(2))


@pytest.mark.parametrize("name", ["enneper", "catenoid"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_shell_comes_back_from_its_mesh(kind, name):
    made = shell(kind, name)
    again = shell_of_mesh(made.mesh, made.gauss, kind=kind)
    assert np.array_equal(again.mesh.starts, made.mesh.starts)
    # Corners may begin elsewhere around a face: compare as sets, and the points by corner.
    for f in range(made.mesh.n_faces):
        assert set(again.mesh.face(f)) == set(made.mesh.face(f))
    assert np.abs(again.mesh.vertices - made.mesh.vertices).max() < 1e-8
    assert np.abs(again.gauss.vertices - made.gauss.vertices).max() < 1e-11
    assert minimality(again).max() < 1e-10
    assert np.sort(edge_ratios(again)) == pytest.approx(np.sort(edge_ratios(made)), rel=1e-6)


def test_faces_at_the_border_can_become_border_planes():
    made = shell("edge")
    again = shell_of_mesh(made.mesh, made.gauss, kind="edge", border="panels")
    assert 0 < len(again.panels) < len(made.panels)
    for row, f in enumerate(again.panels):
        points = np.sort(again.mesh.polygon(row), axis=0)
        assert points == pytest.approx(np.sort(made.mesh.polygon(f), axis=0), abs=1e-8)


def test_without_a_gauss_image_faces_touch_the_sphere():
    again = shell_of_mesh(shell("edge").mesh)
    height = np.einsum(
        "ij,ij->i",
        again.gauss.vertices[again.gauss.corners[again.gauss.starts[:-1]]],
        again.normals[again.panels],
    )
    assert np.abs(height - 1).max() < 1e-12


def test_what_is_no_plane_description_is_refused():
    with pytest.raises(MeshError, match="not simple"):
        shell_of_mesh(quads(3))
    with pytest.raises(MeshError, match="heights are no coordinates"):
        parallel_space(quads(3), method="heights")
    with pytest.raises(MeshError, match="belong to no face"):
        parallel_space(PolyMesh.from_faces(np.eye(4, 3), [[0, 1, 2]]))

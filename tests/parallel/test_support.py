"""Node torsion, support quads and beam heights, with and without an offset mesh."""

import numpy as np
import pytest

from phexfab.errors import MeshError
from phexfab.mesh.measures import edges, face_normals
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.edge_offset import Ellipsoid, edge_offset_mesh
from phexfab.parallel.offset import offset
from phexfab.parallel.support import (
    beam_heights,
    best_axes,
    node_torsion,
    pair_beam_heights,
    support_angles,
    support_structure,
    torsion_of_axes,
    vertex_normals,
)
from phexfab.surface.catalog import surface
from phexfab.testing import assert_planar

MADE = surface("enneper").scaled(1000.0)
ON = lattice_on(MADE, 120.0)
SHELLS = {kind: minimal_shell(MADE, ON, kind) for kind in ("face", "edge", "vertex")}


def members(kind):
    """Random members of P(M) with the shell's Gauss image."""
    shell = SHELLS[kind]
    for seed in range(3):
        noise = np.random.default_rng(seed).normal(size=len(shell.heights))
        yield shell.with_heights(shell.heights + noise)


def a_bent_strip():
    """Two triangles and axes whose mid-planes can be told by hand."""
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0]], float)
    return PolyMesh.from_faces(points, [[0, 1, 2], [1, 0, 3]])


def test_torsion_of_a_beam_told_by_hand():
    """Axes at both ends of the edge along x, turned by +20° and −10° about it."""
    mesh = a_bent_strip()
    turn = np.radians([20.0, -10.0, 0.0, 0.0])
    axes = np.column_stack([np.zeros(4), np.sin(turn), np.cos(turn)])
    axes[0] += [0.7, 0, 0]  # along the edge: changes the axis, not its mid-plane
    found = torsion_of_axes(mesh, 3 * axes)
    row = edges(mesh).tolist().index([0, 1])
    assert abs(found.torsion[row] - 30.0) < 1e-12
    # Off the middle plane by 15°, less where the axis leans along the edge.
    lean = np.degrees(np.arcsin(np.sin(np.radians(15.0)) / np.sqrt(1 + 0.49)))
    assert np.abs(found.off_axis[row] - [lean, 15.0]).max() < 1e-12
    assert abs(found.tilt[1] - 10.0) < 1e-12
    assert abs(found.nodes[1] - found.off_axis[(found.edges == 1)].max()) < 1e-15


@pytest.mark.parametrize("kind", SHELLS)
def test_an_offset_mesh_frees_all_nodes_of_torsion(kind):
    for shell in members(kind):
        found = node_torsion(shell.mesh, shell.gauss)
        assert found.torsion.max() < 1e-9 and found.nodes.max() < 1e-9
        assert found.tilt.max() < 45
        moved = offset(shell, 1.0).mesh.vertices - shell.mesh.vertices
        pair = PolyMesh(moved, shell.mesh.corners, shell.mesh.starts)
        assert node_torsion(shell.mesh, pair).torsion.max() < 1e-9


def test_vertex_normals_twist_the_beams():
    found = node_torsion(SHELLS["face"].mesh)
    assert found.torsion.max() > 1.0 and found.tilt.max() < 1e-6
    # The two mid-planes, by another route: the dihedral angle of a tetrahedron.
    i, j = found.edges[5]
    p, q = SHELLS["face"].mesh.vertices[[i, j]]
    a, b = found.axes[i], found.axes[j]
    x, y = (v - (v @ (q - p)) / ((q - p) @ (q - p)) * (q - p) for v in (a, b))
    cosine = abs(x @ y) / np.linalg.norm(x) / np.linalg.norm(y)
    assert abs(found.torsion[5] - np.degrees(np.arccos(cosine))) < 1e-9


def test_best_axes_have_less_torsion_the_further_they_may_lean():
    mesh = SHELLS["face"].mesh
    plain = node_torsion(mesh)
    pulls = [1.0, 0.1, 0.01]
    found = [node_torsion(mesh, axes="best", pull=pull) for pull in pulls]
    worst = [plain.torsion.max()] + [f.torsion.max() for f in found]
    assert (np.diff(worst) < 0).all() and worst[-1] < 1e-2
    tilt = [np.sqrt(np.mean(f.tilt**2)) for f in found]
    assert (np.diff(tilt) > 0).all() and tilt[-1] < 20


def test_best_axes_are_a_least_of_what_they_minimise():
    mesh, pull = SHELLS["face"].mesh, 0.1
    pairs, normals = edges(mesh), vertex_normals(mesh)
    along = mesh.vertices[pairs[:, 1]] - mesh.vertices[pairs[:, 0]]
    along /= np.linalg.norm(along, axis=1, keepdims=True)

    def price(a):
        twist = np.einsum("ij,ij->i", np.cross(a[pairs[:, 0]], a[pairs[:, 1]]), along)
        return np.sum(twist**2) + pull**2 * np.sum((a - normals) ** 2)

    best = best_axes(mesh, pull, rounds=30)
    rng = np.random.default_rng(0)
    for size in (1e-1, 1e-2, 1e-3):
        for _ in range(10):
            other = best + size * rng.normal(size=best.shape)
            assert price(other / np.linalg.norm(other, axis=1, keepdims=True)) > price(best)


@pytest.mark.parametrize("kind", SHELLS)
def test_support_quads_are_planar_and_stand_on_every_edge(kind):
    for shell in members(kind):
        made = support_structure(shell.mesh, shell.gauss, -90.0)
        assert_planar(made, 1e-11)
        assert (made.sides == 4).all()
        n = len(shell.mesh.vertices)
        quads = made.corners.reshape(-1, 4)
        assert np.array_equal(quads[:, :2], edges(shell.mesh))
        assert np.array_equal(quads[:, 2:], quads[:, 1::-1] + n)
        top = offset(shell.with_heights(SHELLS[kind].heights), -30.0)
        low = support_structure(SHELLS[kind].mesh, shell.gauss, -30.0)
        assert np.abs(low.vertices[n:] - top.mesh.vertices).max() < 1e-9


def bend(mesh, pairs):
    normals = face_normals(mesh)[pairs]
    cross = np.linalg.norm(np.cross(normals[:, 0], normals[:, 1]), axis=1)
    return np.degrees(np.arctan2(cross, np.einsum("ij,ij->i", normals[:, 0], normals[:, 1])))


def test_conical_axes_make_every_support_quad_bisect_its_two_faces():
    for shell in members("face"):
        pairs, angles = support_angles(shell.mesh, shell.gauss)
        assert len(pairs) == (shell.edges[:, 3] >= 0).sum()
        assert np.abs(angles[:, 0] - angles[:, 1]).max() < 1e-9
        assert np.abs(np.abs(angles.sum(axis=1)) - bend(shell.mesh, pairs)).max() < 1e-9


@pytest.mark.parametrize("kind", ["edge", "vertex"])
def test_other_axes_split_the_bend_as_the_heights_of_the_gauss_faces(kind):
    shell = SHELLS[kind]
    pairs, angles = support_angles(shell.mesh, shell.gauss)
    heights = shell.gauss_heights[shell.panels][pairs]
    ratio = np.cos(np.radians(angles))
    assert np.abs(ratio[:, 0] * heights[:, 1] - ratio[:, 1] * heights[:, 0]).max() < 1e-12
    assert np.abs(np.abs(angles.sum(axis=1)) - bend(shell.mesh, pairs)).max() < 1e-9
    assert np.abs(angles[:, 0] - angles[:, 1]).max() > 0.1


def test_ridges_are_positive_and_valleys_negative():
    dome = edge_offset_mesh(SHELLS["edge"], Ellipsoid(900.0, 1000.0, 1000.0)).shell
    assert support_angles(dome.mesh, dome.gauss)[1].min() > 0
    saddle = SHELLS["edge"]
    signs = np.sign(support_angles(saddle.mesh, saddle.gauss)[1].sum(axis=1))
    assert set(signs) == {-1.0, 1.0}


@pytest.mark.parametrize("depth", [-90.0, 35.0])
def test_beams_of_an_edge_offset_have_one_height(depth):
    for shell in members("edge"):
        found = beam_heights(shell, depth)
        assert np.abs(found.heights / abs(depth) - 1).max() < 1e-12
        assert found.spread < 1e-12


def test_beams_of_the_other_types_vary_by_what_their_spheres_say():
    """By the bend for the face type, by the edge of S for the vertex type."""
    shell = SHELLS["face"]
    found = beam_heights(shell, -90.0)
    row = {tuple(e): k for k, e in enumerate(found.edges.tolist())}
    inner = shell.edges[shell.edges[:, 3] >= 0]
    place = [row[tuple(sorted(e))] for e in inner[:, :2].tolist()]
    angle = np.radians(bend(shell.mesh, inner[:, 2:]))
    assert np.abs(found.heights[place] - 90.0 / np.cos(angle / 2)).max() < 1e-10
    shell = SHELLS["vertex"]
    found = beam_heights(shell, -90.0)
    ends = shell.gauss.vertices[found.edges]
    half = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / 2
    assert np.abs(found.heights - 90.0 * np.sqrt(1 - half**2)).max() < 1e-10
    assert found.slant.max() < 1e-12
    assert found.spread > 1e-4


@pytest.mark.parametrize("kind", SHELLS)
def test_heights_are_those_of_the_support_quads(kind):
    """Area of each quad over the mean of its parallel sides."""
    shell = SHELLS[kind]
    quads = support_structure(shell.mesh, shell.gauss, -90.0)
    p = quads.vertices[quads.corners.reshape(-1, 4)]
    area = np.linalg.norm(np.cross(p[:, 2] - p[:, 0], p[:, 3] - p[:, 1]), axis=1) / 2
    sides = [np.linalg.norm(p[:, a] - p[:, b], axis=1) for a, b in ((1, 0), (2, 3))]
    found = beam_heights(shell, -90.0)
    assert np.abs(area / (np.add(*sides) / 2) - found.heights).max() < 1e-9
    assert np.abs(found.ends - np.linalg.norm(p[:, :2] - p[:, 3:1:-1], axis=2)).max() < 1e-9


def test_variation_of_heights_falls_with_the_square_of_the_panels():
    spreads = []
    for size in (160.0, 80.0, 40.0):
        spreads.append(beam_heights(minimal_shell(MADE, lattice_on(MADE, size), "face"), 1).spread)
    assert (-np.diff(np.log2(spreads)) > 1.5).all()


def test_pairs_of_different_meshes_are_refused():
    mesh = SHELLS["face"].mesh
    other = PolyMesh(mesh.vertices, np.roll(mesh.corners, 1), mesh.starts)
    for verb in (node_torsion, support_angles):
        with pytest.raises(MeshError, match="other faces"):
            verb(mesh, other)
    with pytest.raises(MeshError, match="other faces"):
        pair_beam_heights(mesh, other, 10.0)
    with pytest.raises(MeshError, match="axes = 'conical'"):
        node_torsion(mesh, axes="conical")

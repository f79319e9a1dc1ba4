"""Vertex offsets: the alternating angles, and the parallel mesh inscribed in the unit sphere."""

from pathlib import Path

import numpy as np
import pytest

from phexfab.errors import MeshError
from phexfab.mesh.io import read_mesh
from phexfab.mesh.measures import corner_angles
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.support import node_torsion, vertex_normals
from phexfab.parallel.vertex_offset import alternating_angles, inscribed_parallel
from phexfab.surface.catalog import surface
from phexfab.testing import assert_offset, assert_parallel, assert_planar

MADE = surface("enneper").scaled(1000.0)
SHELL = minimal_shell(MADE, lattice_on(MADE, 100.0), "vertex")
PUBLIC = Path(__file__).parents[2].parent / "shared" / "data" / "enneper2.off"


def random_member(seed: int):
    """A member of P(M) far from minimal; edges may flip."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(scale=3.0, size=len(SHELL.heights))
    return SHELL.with_heights(SHELL.heights + noise).mesh


def circle_of(p, q, r):
    """Centre of the circle through three points, by its linear equations."""
    normal = np.cross(q - p, r - p)
    rows = np.array([q - p, r - p, normal])
    right = [(q @ q - p @ p) / 2, (r @ r - p @ p) / 2, normal @ p]
    return np.linalg.solve(rows, right)


def second_meeting(sphere, p, centre, normal):
    """The other point where a sphere (four points on it) meets a circle that passes through p."""
    rows = 2 * (sphere[1:] - sphere[0])
    middle = np.linalg.solve(rows, (sphere[1:] ** 2).sum(1) - (sphere[0] ** 2).sum())
    axis = np.cross(normal, middle - centre)
    axis /= np.linalg.norm(axis)
    # Both points lie mirrored about the plane through both centres.
    return p - 2 * ((p - centre) @ axis) * axis


def ring_of_circular_quads(sides: int, seed: int):
    """A closed ring of planar quads with circumcircles, otherwise without any symmetry."""
    rng = np.random.default_rng(seed)
    turn = 2 * np.pi * np.arange(sides) / sides
    top = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(sides)])
    top += rng.normal(scale=0.12, size=top.shape)
    bottom = [top[0] + [0.1, 0.05, -0.8]]
    for k in range(sides - 1):
        p, q, r = top[k], top[k + 1], bottom[k]
        centre, normal = circle_of(p, q, r), np.cross(q - p, r - p)
        normal /= np.linalg.norm(normal)
        if k < sides - 2:
            if k == sides - 3:  # the last free one makes the last two circles meet twice
                last = np.array([top[sides - 2], top[sides - 1], top[0], bottom[0]])
                bottom.append(second_meeting(last, q, centre, normal))
                continue
            towards = q + np.array([0.05, -0.04, -0.8]) - centre
            towards -= (towards @ normal) * normal
            bottom.append(centre + towards / np.linalg.norm(towards) * np.linalg.norm(p - centre))
        else:  # beyond top[-1] on both circles: this one and that through top[-1], top[0]
            other = np.array([top[-1], top[0], bottom[0], circle_sphere_point(top, bottom)])
            bottom.append(second_meeting(other, q, centre, normal))
    faces = [[k, k + sides, (k + 1) % sides + sides, (k + 1) % sides] for k in range(sides)]
    return PolyMesh.from_faces(np.vstack([top, bottom]), faces)


def circle_sphere_point(top, bottom):
    """A point off the plane of the last circle, to make a sphere through it."""
    normal = np.cross(top[0] - top[-1], bottom[0] - top[-1])
    return top[-1] + normal + [0.3, 0.1, 0.2]


def test_the_angles_of_vertex_type_panels_alternate_and_those_of_other_types_do_not():
    assert np.abs(alternating_angles(SHELL.mesh)).max() < 1e-9
    for kind in ("face", "edge"):
        other = minimal_shell(MADE, lattice_on(MADE, 100.0), kind).mesh
        assert np.abs(alternating_angles(other)).max() > 1e-3


def test_alternating_angles_count_reflex_corners():
    mesh = SHELL.mesh
    for f in range(mesh.n_faces):
        angles = corner_angles(mesh)[mesh.starts[f] : mesh.starts[f + 1]]
        assert (angles > 180).sum() == 2
        assert abs(angles[::2].sum() - 360) < 1e-9 and abs(angles[1::2].sum() - 360) < 1e-9


@pytest.mark.parametrize("seed", range(4))
def test_every_first_vertex_gives_an_inscribed_parallel_mesh(seed):
    mesh = random_member(seed)
    wish = np.random.default_rng(100 + seed).normal(size=3)
    made = inscribed_parallel(mesh, wish)
    assert made.freedom == 2
    assert made.gaps.max() < 1e-12 and made.spreads.max() < 1e-12
    first = made.mesh.vertices[np.unique(mesh.corners)[0]]
    assert np.linalg.norm(first - wish / np.linalg.norm(wish)) < 1e-12
    assert_offset(made.mesh, "vertex", 1e-12)
    assert_planar(made.mesh, 1e-11)
    assert_parallel(mesh, made.mesh, 1e-9)


def test_the_best_start_is_nearest_to_the_vertex_normals():
    best = inscribed_parallel(SHELL.mesh)
    normals = vertex_normals(SHELL.mesh)
    agreement = np.sum(best.mesh.vertices * normals)
    first = best.mesh.vertices[0]
    for step in 0.05 * np.random.default_rng(3).normal(size=(20, 3)):
        other = inscribed_parallel(SHELL.mesh, first + step).mesh.vertices
        assert np.sum(other * normals) < agreement
    assert np.sum(SHELL.gauss.vertices * normals) <= agreement
    # The Gauss image from which the shell was made is one of them.
    own = inscribed_parallel(SHELL.mesh, SHELL.gauss.vertices[0])
    assert np.abs(own.mesh.vertices - SHELL.gauss.vertices).max() < 1e-11


def test_sharing_the_gaps_heals_printed_digits_and_leaves_an_exact_mesh_alone():
    plain = inscribed_parallel(SHELL.mesh)
    shared = inscribed_parallel(SHELL.mesh, refine=True)
    assert np.abs(shared.mesh.vertices - plain.mesh.vertices).max() < 1e-9
    printed = PolyMesh(np.round(SHELL.mesh.vertices, 2), SHELL.mesh.corners, SHELL.mesh.starts)
    before = inscribed_parallel(printed, tolerance=1e-2)
    after = inscribed_parallel(printed, tolerance=1e-2, refine=True)
    assert before.freedom == after.freedom == 2
    assert after.gaps.max() < 0.5 * before.gaps.max()


def test_a_mesh_without_the_angles_has_none():
    other = minimal_shell(MADE, lattice_on(MADE, 100.0), "face").mesh
    made = inscribed_parallel(other)
    assert made.freedom == -1 and made.gaps.max() > 1e-5


@pytest.mark.parametrize(("sides", "freedom"), [(5, -1), (6, 0), (7, -1)])
def test_on_a_ring_the_angles_are_not_enough(sides, freedom):
    """All faces satisfy the criterion, but the reflections around the hole need not close.

    An even number of them is a rotation and leaves one axis, an odd number leaves nothing.
    """
    mesh = ring_of_circular_quads(sides, 5)
    assert_planar(mesh, 1e-12)
    assert np.abs(alternating_angles(mesh)).max() < 1e-9
    made = inscribed_parallel(mesh)
    assert made.freedom == freedom
    assert made.spreads[1] > 1e-3
    # Cut open, the same faces are a disc, and the criterion is sufficient.
    cut = PolyMesh(mesh.vertices, mesh.corners[:-4], mesh.starts[:-1])
    assert inscribed_parallel(cut).freedom == 2


def test_odd_faces_have_no_condition_but_fix_the_first_vertex():
    turn = np.radians([0, 78, 141, 228, 294])
    points = np.column_stack([np.cos(turn), 0.7 * np.sin(turn), np.zeros(5)])
    mesh = PolyMesh.from_faces(points, [range(5)])
    assert np.isnan(alternating_angles(mesh)).all()
    made = inscribed_parallel(mesh, np.array([0.6, 0.3, 0.5]))
    assert made.freedom == 1
    assert_offset(made.mesh, "vertex", 1e-13)
    assert_parallel(mesh, made.mesh, 1e-12)


def test_pieces_and_edges_of_no_length_are_refused():
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    two = PolyMesh.from_faces(np.vstack([square, square + 3]), [range(4), range(4, 8)])
    with pytest.raises(MeshError, match="several pieces"):
        inscribed_parallel(two)
    flat = square.copy()
    flat[1] = flat[0]
    with pytest.raises(MeshError, match="edge 0-1 has no length"):
        inscribed_parallel(PolyMesh.from_faces(flat, [range(4)]))


@pytest.mark.skipif(not PUBLIC.exists(), reason="the public meshes are not beside the repository")
def test_a_public_mesh_is_of_the_vertex_type_to_its_printed_digits():
    mesh = read_mesh(PUBLIC)
    made = inscribed_parallel(mesh, tolerance=1e-3)
    assert made.freedom == 2
    assert 1e-5 < made.gaps.max() < 1e-3
    shared = inscribed_parallel(mesh, tolerance=1e-3, refine=True)
    # What is left at worst is the direction of the shortest edges in the file.
    assert shared.gaps.max() < 3e-4 and shared.gaps.max() < 0.5 * made.gaps.max()
    assert node_torsion(mesh, shared.mesh).torsion.max() < 2e-4
    assert_offset(shared.mesh, "vertex", 1e-12)
    assert np.abs(alternating_angles(mesh)).max() < 0.1

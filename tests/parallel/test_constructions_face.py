"""Face offsets: vertex normals by planes and by angles, against exact arithmetic."""

from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
import pytest

from phexfab.errors import DesignError, MeshError
from phexfab.mesh.measures import corner_angles, face_normals
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.face_offset import (
    face_offset,
    face_offset_image,
    normals_by_angles,
    normals_by_planes,
)
from phexfab.surface.catalog import surface
from phexfab.testing import assert_parallel, assert_planar

MADE = surface("enneper").scaled(1000.0)
SHELL = minimal_shell(MADE, lattice_on(MADE, 100.0), "edge")
# Directions of three edges seen from above, in degrees: a convex corner, one with a reflex angle,
# one with a right angle (where the thesis' tangents have a pole).
CORNERS = {
    "convex": (10.0, 130.0, 250.0),
    "reflex": (0.0, 60.0, 120.0),
    "right": (0.0, 90.0, 200.0),
    "skew": (3.0, 51.0, 290.0),
}


def corner(name: str, slope: float):
    """Three edge vectors of a corner; the slopes, nearly 0, make it nearly coplanar."""
    turn = np.radians(CORNERS[name])
    height = slope * np.array([1.0, -0.7, 0.4])
    return np.column_stack([np.cos(turn), np.sin(turn), height])


def exact_normal(edges) -> np.ndarray:
    """The w with N_i·w = 1, in 60 digits from the exact values of the doubles in ``edges``."""
    rows = [[Fraction(x) for x in e] for e in edges.tolist()]

    def cross(a, b):
        return [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]

    def dot(a, b):
        return sum(x * y for x, y in zip(a, b, strict=True))

    with localcontext() as context:
        context.prec = 60

        def number(x):
            return Decimal(x.numerator) / Decimal(x.denominator)

        # Seen counter-clockwise from above also where the corner is reflex.
        planes = [cross(rows[k], rows[(k + 1) % 3]) for k in range(3)]
        planes = [p if p[2] > 0 else [-x for x in p] for p in planes]
        sizes = [number(dot(p, p)).sqrt() for p in planes]
        volume = number(dot(planes[0], cross(planes[1], planes[2])))
        pairs = [cross(planes[(k + 1) % 3], planes[(k + 2) % 3]) for k in range(3)]
        w = [sum(number(pairs[k][c]) * sizes[k] for k in range(3)) / volume for c in range(3)]
        return np.array([float(x) for x in w])


def measured(edges):
    """Normals and interior angles of the three faces in doubles, as a mesh would give them."""
    following = np.roll(edges, -1, axis=0)
    normals = np.cross(edges, following)
    normals *= np.sign(normals[:, 2])[:, None]
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    sine = np.einsum("ij,ij->i", np.cross(edges, following), normals)
    angles = np.degrees(np.arctan2(sine, np.einsum("ij,ij->i", edges, following))) % 360
    return normals[None], angles[None]


@pytest.mark.parametrize("name", CORNERS)
@pytest.mark.parametrize("slope", [0.3, 1e-3, 1e-6, 1e-9])
def test_the_angles_keep_all_digits_where_planes_become_coplanar(name, slope):
    edges = corner(name, slope)
    normals, angles = measured(edges)
    assert np.abs(normals_by_angles(normals, angles)[0] - exact_normal(edges)).max() < 1e-14


@pytest.mark.parametrize("name", CORNERS)
def test_the_planes_lose_as_many_digits_as_the_normals_share(name):
    lost = []
    for slope in (1e-3, 1e-6, 1e-9):
        edges = corner(name, slope)
        normals, _ = measured(edges)
        lost.append(np.abs(normals_by_planes(normals)[0] - exact_normal(edges)).max())
    assert lost[0] < 1e-11
    assert lost[1] > 1e-13 and lost[2] > 1e-10


def test_a_reflex_angle_taken_below_180_is_wrong():
    """Trap: θ and 360° − θ give different weights."""
    edges = corner("reflex", 0.3)
    normals, angles = measured(edges)
    assert (angles > 180).sum() == 1
    small = np.where(angles > 180, 360 - angles, angles)
    assert np.abs(normals_by_angles(normals, small)[0] - exact_normal(edges)).max() > 1e-2


def test_the_formula_of_the_thesis_is_the_same_vector():
    normals, angles = measured(corner("skew", 0.3))
    theta = np.radians(angles[0])
    after, before = np.roll(theta, -1), np.roll(theta, 1)
    beta, gamma = (theta + after - before) / 2, (theta + before - after) / 2
    thesis = (np.tan(beta) + np.tan(gamma)) @ normals[0]
    ours = normals_by_angles(normals, angles)[0]
    assert np.abs(thesis / (thesis @ normals[0][0]) - ours).max() < 1e-14


def members():
    """Members of P(M) whose planes are moved at random, without flipping an edge."""
    from phexfab.parallel.offset import edge_ratios

    reach = np.abs(edge_ratios(SHELL)).min()
    for seed in range(4):
        noise = np.random.default_rng(seed).uniform(-1, 1, len(SHELL.heights))
        yield SHELL.with_heights(SHELL.heights + 1e-3 * reach * noise).mesh


def test_both_methods_agree_on_random_members():
    for mesh in members():
        one, two = face_offset_image(mesh), face_offset_image(mesh, "planes")
        assert (corner_angles(mesh) > 180).sum() == 2 * mesh.n_faces
        assert np.abs(one.vertices - two.vertices).max() < 1e-12


@pytest.mark.parametrize("method", ["angles", "planes"])
def test_every_face_moves_by_the_distance_border_included(method):
    for mesh in members():
        moved = face_offset(mesh, -35.0, method)
        normals = face_normals(mesh)[mesh.face_of_corner]
        step = (moved.vertices - mesh.vertices)[mesh.corners]
        assert np.abs(np.einsum("ij,ij->i", step, normals) + 35.0).max() < 1e-10
        assert_parallel(mesh, moved, 1e-11)
        assert_planar(moved, 1e-12)


def test_offsets_of_offsets_are_one_offset():
    mesh = SHELL.mesh
    twice = face_offset(face_offset(mesh, 12.0), 7.5)
    assert np.abs(twice.vertices - face_offset(mesh, 19.5).vertices).max() < 1e-10


def test_four_faces_coplanar_faces_and_other_methods_are_refused():
    turn = np.radians([0, 90, 180, 270])
    roof = np.column_stack([np.cos(turn), np.sin(turn), np.full(4, -0.5)])
    tent = PolyMesh.from_faces(
        np.vstack([[0, 0, 0], roof]), [[0, k + 1, (k + 1) % 4 + 1] for k in range(4)]
    )
    with pytest.raises(MeshError, match="4 faces meet in vertex 0"):
        face_offset_image(tent)
    flat = np.tile([0.0, 0.0, 1.0], (1, 3, 1))
    with pytest.raises(MeshError, match='use method "angles"'):
        normals_by_planes(flat)
    assert normals_by_angles(flat, np.array([[120.0, 120.0, 120.0]])).ravel().tolist() == [0, 0, 1]
    with pytest.raises(DesignError, match="method = 'tangents'"):
        face_offset_image(tent, "tangents")

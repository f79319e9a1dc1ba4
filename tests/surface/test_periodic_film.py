"""Films of periodic surfaces on triangle meshes: exact, welded, and cut at their box."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial import cKDTree

from phexfab.errors import SurfaceError
from phexfab.surface.periodic.closed_forms import PERIODIC, periodic_area
from phexfab.surface.periodic.mesh import periodic_film

CELL = 1000.0


@pytest.fixture(scope="module")
def films():
    return {
        name: periodic_film(name, cell=CELL, edge_length=60.0, margin=80.0) for name in PERIODIC
    }


def directed(triangles):
    return np.column_stack([triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()])


@pytest.mark.parametrize("name", PERIODIC)
def test_the_mesh_is_a_welded_oriented_manifold(films, name):
    film = films[name]
    for mesh in (film, film.cut):
        edges = directed(mesh.triangles)
        assert len(np.unique(edges, axis=0)) == len(edges)
        keys = set(map(tuple, edges.tolist()))
        outer = [a for a, b in keys if (b, a) not in keys]
        assert len(outer) == len(set(outer))  # no two fans meet in a vertex
        assert np.array_equal(np.unique(mesh.triangles), np.arange(len(mesh.points)))
        near, _ = cKDTree(mesh.points).query(mesh.points, k=2)
        assert near[:, 1].min() > (1e-2 * CELL if mesh is film else 0)
    a, b, c = np.moveaxis(film.points[film.triangles], 1, 0)
    flat = np.cross(b - a, c - a)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    assert (film.normals[film.triangles] * flat[:, None]).sum(-1).min() > 0.9


@pytest.mark.parametrize("name", PERIODIC)
def test_triangles_are_of_one_size_and_well_shaped(films, name):
    film = films[name]
    corners = film.points[film.triangles]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1)
    assert edges.mean() <= 60.0 and edges.max() < 1.5 * edges.min()
    a, b, c = edges.T
    cosines = [(b * b + c * c - a * a) / (2 * b * c), (a * a + c * c - b * b) / (2 * a * c)]
    cosines.append((a * a + b * b - c * c) / (2 * a * b))
    angles = np.degrees(np.arccos(cosines))
    assert angles.min() > 40 and angles.max() < 80


@pytest.mark.parametrize("name", PERIODIC)
def test_the_mesh_covers_the_box_and_the_margin(films, name):
    film = films[name]
    edges = directed(film.triangles)
    keys = set(map(tuple, edges.tolist()))
    rim = film.points[[a for a, b in keys if (b, a) not in keys]]
    assert ((rim < -80.0) | (rim > film.box + 80.0)).any(axis=1).all()


@pytest.mark.parametrize("name", PERIODIC)
def test_every_vertex_is_on_every_patch_that_it_belongs_to(films, name):
    film = films[name]
    corners = np.eye(3)
    for k in range(3):
        points, normals = film.at(np.arange(len(film.triangles)), corners[k])
        ids = film.triangles[:, k]
        assert np.abs(points - film.points[ids]).max() < 1e-12 * CELL
        assert np.abs(normals - film.normals[ids]).max() < 1e-12


@pytest.mark.parametrize("name", PERIODIC)
def test_normals_and_curvatures_against_the_points(name):
    """Twice the height of a neighbour over its distance squared is the normal curvature."""
    misses = []
    for edge in (60.0, 30.0):
        film = periodic_film(name, cell=CELL, edge_length=edge)
        i, j = directed(film.triangles).T
        chord = film.points[j] - film.points[i]
        square = (chord**2).sum(1)
        middle = 0.5 * (film.normals[i] - film.normals[j])
        seen = 2 * (chord * middle).sum(1) / square
        along = chord / np.sqrt(square)[:, None]
        want = [
            film.curvatures[v] * (1 - 2 * (along * film.directions[v]).sum(1) ** 2) for v in (i, j)
        ]
        misses.append(CELL * np.abs(seen - 0.5 * (want[0] + want[1])).max())
    assert CELL * film.curvatures.max() > 3
    assert misses[0] < 1.5 and misses[1] < misses[0] / 3
    assert np.abs((film.directions * film.normals).sum(1)).max() < 1e-14


@pytest.mark.parametrize("name", PERIODIC)
def test_umbilics_are_vertices_and_eight_per_primitive_cell(films, name):
    film = periodic_film(name, cell=CELL, edge_length=90.0, corner=(0.07, 0.03, 0.05), margin=1.0)
    at = film.points[film.umbilics]
    count = ((at > 0) & (at < film.box)).all(axis=1).sum()
    assert count == {"schwarz-p": 8, "schwarz-d": 32, "gyroid": 16}[name]
    assert (film.orders == 1).all() and (film.curvatures[film.umbilics] == 0).all()
    assert (film.directions[film.umbilics] == 0).all()
    rest = np.setdiff1d(np.arange(len(film.points)), film.umbilics)
    assert film.curvatures[rest].min() * CELL > 0.1
    assert np.allclose(np.linalg.norm(film.directions[rest], axis=1), 1, atol=1e-14)
    assert np.abs(np.abs(film.normals[film.umbilics]) - 1 / np.sqrt(3)).max() < 1e-15


@pytest.mark.parametrize("name", PERIODIC)
def test_the_area_in_the_box_converges_with_rate_two(name):
    want = periodic_area(name, CELL)
    misses = [
        periodic_film(name, cell=CELL, edge_length=edge).cut.area / want - 1 for edge in (80, 40)
    ]
    assert 0 < misses[1] < 0.004 and 3 < misses[0] / misses[1] < 5.5


@pytest.mark.parametrize("name", PERIODIC)
def test_cells_repeat(name):
    film = periodic_film(name, cell=CELL, cells=(2, 1, 1), edge_length=120.0)
    tree = cKDTree(film.points)
    inner = np.flatnonzero((film.points[:, 0] > 0) & (film.points[:, 0] < CELL))
    inner = inner[((film.points[inner] > 0) & (film.points[inner] < film.box)).all(axis=1)]
    gap, there = tree.query(film.points[inner] + [CELL, 0, 0])
    assert gap.max() < 1e-11 * CELL
    assert np.abs(film.normals[there] - film.normals[inner]).max() < 1e-13
    area = film.cut.area / periodic_film(name, cell=CELL, edge_length=120.0).cut.area
    assert area == pytest.approx(2, rel=2e-3)


@pytest.mark.parametrize("name", PERIODIC)
def test_borders_are_on_the_surface_and_in_the_box_s_faces(films, name):
    film = films[name]
    for border in film.cut.borders:
        n = len(border.points)
        sides = np.searchsorted(border.corners, np.arange(n), side="right") - 1
        face = border.faces[np.maximum(sides, 0)]
        axis, high = np.divmod(face, 2)
        place = np.where(high, film.box[axis], 0.0)
        assert np.abs(border.points[np.arange(n), axis] - place).max() < 1e-9
        following = np.roll(border.points, -1, axis=0)
        assert np.abs(following[np.arange(n), axis] - place).max() < 1e-9
        assert (border.points > -1e-9).all() and (border.points < film.box + 1e-9).all()
        assert np.abs(np.linalg.norm(border.normals, axis=1) - 1).max() < 1e-14
        # The film is on the left.
        middle = border.normals + np.roll(border.normals, -1, axis=0)
        left = np.cross(middle, following - border.points)
        assert (left[np.arange(n), axis] * np.where(high, -1, 1)).min() > 0
        # Dense, without jumps, and smooth: normals are across the curve.
        steps = np.linalg.norm(following - border.points, axis=1)
        assert steps.max() < 30.0 and steps.min() > 0
        along = (following - border.points) / steps[:, None]
        assert np.abs((along * middle).sum(1)).max() < 0.1
    assert len(film.cut.borders) == {"schwarz-p": 6, "schwarz-d": 2}.get(name, 4)


@pytest.mark.parametrize("name", PERIODIC)
def test_border_points_are_feet_on_the_closed_form(films, name):
    """Border points are found again by the foot-point iteration of the patch about a flat point."""
    film = films[name]
    surface, found = film.surface, 0
    row = np.zeros(len(film.points), int)
    row[film.triangles] = np.arange(len(film.triangles))[:, None]
    tree = cKDTree(film.points[film.umbilics])
    for border in film.cut.borders:
        points, normals = border.points[5::11], border.normals[5::11]
        t = row[film.umbilics[tree.query(points)[1]]]
        octants = film.octants[t]
        local = points / CELL - film.shifts[t] - surface.centres[octants]
        local = np.einsum("nji,nj->ni", surface.turns[octants], local)
        normals = np.einsum("nji,nj->ni", surface.turns[octants], normals)
        own = (normals > -0.05).all(axis=1)  # near the patch of the nearest flat point
        found += own.sum()
        guess = _sheet(surface, normals[own], local[own])
        foot = surface.patch.closest_parameter(local[own], guess)
        assert np.abs(surface.patch.point(foot) - local[own]).max(initial=0) < 1e-12
    assert found > 20


def _sheet(surface, normals, local):
    zero = np.zeros(len(local), int)
    h = surface.parameter(zero, normals, np.ones(len(local), complex))
    gaps = [np.linalg.norm(surface.patch.point(s * h) - local, axis=1) for s in (1, -1)]
    return np.where(gaps[0] < gaps[1], h, -h)


def test_p_meets_its_box_at_right_angles_in_six_round_openings(films):
    film = films["schwarz-p"]
    assert sorted(int(border.faces[0]) for border in film.cut.borders) == [0, 1, 2, 3, 4, 5]
    for border in film.cut.borders:
        assert len(border.corners) == 0
        assert np.abs(border.normals[:, border.faces[0] // 2]).max() < 1e-13
    # A sphere with six holes.
    edges = np.sort(directed(film.cut.triangles), axis=1)
    count = len(film.cut.points) - len(np.unique(edges, axis=0)) + len(film.cut.triangles)
    assert count == 2 - 6


def test_d_is_cut_in_straight_lines_with_corners_at_flat_points(films):
    film = films["schwarz-d"]
    flat = cKDTree(film.points[film.umbilics])
    for border in film.cut.borders:
        assert len(border.corners) == 12
        assert flat.query(border.points[border.corners])[0].max() < 1e-10
        ends = np.append(border.corners, len(border.points))
        points = np.vstack([border.points, border.points[:1]])
        for a, b in pairwise(ends):
            along = points[b] - points[a]
            along /= np.linalg.norm(along)
            off = np.cross(points[a : b + 1] - points[a], along)
            assert np.abs(off).max() < 1e-10


def test_the_gyroid_s_cut_avoids_flat_points_and_stays_in_one_piece(films):
    film = films["gyroid"]
    flat = cKDTree(film.points[film.umbilics])
    assert len(film.cut.borders) == 4
    for border in film.cut.borders:
        assert flat.query(border.points)[0].min() > CELL / 128
        ends = np.append(border.corners[1:], border.corners[0] + len(border.points))
        for begin, end, face in zip(border.corners, ends, border.faces, strict=True):
            side = np.arange(begin, end) % len(border.points)
            lean = np.degrees(np.arcsin(np.abs(border.normals[side, face // 2])))
            assert lean.max() < 36.5  # within reach of one plane for each side


def test_more_cells_more_openings():
    film = periodic_film("schwarz-p", cell=CELL, cells=(2, 2, 1), edge_length=150.0)
    assert len(film.cut.borders) == 2 * (2 * 1 + 1 * 2 + 2 * 2)
    assert np.array_equal(film.box, [2000.0, 2000.0, 1000.0])


def test_any_box_may_be_cut_and_what_only_touches_is_refused():
    film = periodic_film("gyroid", cell=CELL, edge_length=70.0, corner=(0, 0, 0))
    assert len(film.cut.borders) == 1 and len(film.cut.borders[0].corners) == 18
    assert film.cut.area == pytest.approx(periodic_area("gyroid", CELL), rel=0.01)
    with pytest.raises(SurfaceError, match=r"touches the box at .* choose another corner"):
        periodic_film("gyroid", cell=CELL, edge_length=70.0, corner=(0.125, 0.125, 0.125))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"cell": 0.0}, "cubic cell must be positive"),
        ({"cells": (1, 0, 1)}, "three whole numbers"),
        ({"cells": (1, 1)}, "three whole numbers"),
        ({"cells": (1, 1.5, 1)}, "three whole numbers"),
        ({"edge_length": -1.0}, "edge length must be positive"),
        ({"edge_length": 0.01}, "more than .* triangles; choose longer edges"),
        ({"margin": -1.0}, "margin must not be negative"),
        ({"corner": (0, 0)}, "corner of the box must be three numbers"),
        ({"name": "neovius"}, "no periodic surface"),
    ],
)
def test_impossible_sizes_are_refused(change, message):
    given = {"name": "schwarz-p", "cell": 100.0, "edge_length": 20.0} | change
    with pytest.raises(SurfaceError, match=message):
        periodic_film(given.pop("name"), **given)

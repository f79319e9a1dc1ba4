"""Cuts that are repeated: straight sides fold, and every side keeps the folds that served it."""

from dataclasses import replace

import numpy as np
import pytest
from cut_samples import border, circle, polygon, whole

from phexfab.errors import MeshError
from phexfab.mesh.measures import signed_areas, simple_faces
from phexfab.parallel.border import Border
from phexfab.parallel.cut import cut_shell
from phexfab.parallel.fence import Stations, build_fence
from phexfab.parallel.folds import Wanted, flat_sides, fold, straight_planes
from phexfab.parallel.rounds import Cutting, cut_folding, cut_stepping
from phexfab.parallel.stations import place_stations
from phexfab.parallel.walk import Ground
from phexfab.surface.periodic.mesh import periodic_film

DEPTH = (70.0, 5.0)
LEAST = 40.0


@pytest.fixture(scope="module")
def straight():
    """The borders of two cells of Schwarz' D: straight sides, at 60° and 90° to each other."""
    film = periodic_film("schwarz-d", cell=6000.0, cells=(2, 1, 1), edge_length=300.0, margin=400.0)
    found = []
    for one in film.cut.borders:
        made = Border(one.points, one.normals, one.corners)
        m = len(made.corners)
        free = np.full((m, 4), np.nan)
        at = Stations(made.stops[made.corners], np.zeros((m, 3)), np.ones(m, bool), free)
        found.append((made, at))
    return found


def test_planes_of_straight_sides_lean_no_more_than_their_corners_ask_for(straight):
    """Along a straight side normals turn by arccos 1/3, at a corner of 60° tan lean = √2."""
    for one, at in straight:
        fence = build_fence(one, at, 30.0)
        assert fence.angle == pytest.approx(np.degrees(np.arctan(np.sqrt(2))), abs=0.2)


def test_straight_sides_get_the_plane_of_their_fence(straight):
    one, at = straight[0]
    fence = build_fence(one, at, 30.0)
    made = straight_planes(one, at, fence)
    for k in range(len(at.along)):
        end = at.along[(k + 1) % len(at.along)]
        side, _ = one.at(one.between(at.along[k], end, 100.0))
        assert np.abs(side @ made.planes[k, :3] - made.planes[k, 3]).max() < 1e-6
    assert build_fence(one, made, 30.0).way == "flat"
    smooth, _ = whole()
    square, corners = polygon(0.4 * np.array([-1 - 1j, 1 - 1j, 1 + 1j, -1 + 1j]))
    bent = border(smooth, square, corners)
    bare = Stations(bent.stops[corners], np.zeros((4, 3)), np.ones(4, bool), at.planes[:4])
    assert np.isnan(straight_planes(bent, bare, build_fence(bent, bare, 30.0)).planes).all()


def window():
    """A piece of a catenoid between two planes z = ± and two planar meridians."""
    smooth, shell = whole("catenoid", 300.0)
    w, corners = polygon([-0.51 - 0.9j, 0.72 - 0.9j, 0.72 + 0.93j, -0.51 + 0.93j])
    one = border(smooth, w, corners)
    ground = Ground.of(shell)
    size = float(np.sqrt(np.median(signed_areas(shell.mesh, ground.normals))))
    limits = (0.05 * size**2, 0.08 * size, LEAST, DEPTH)
    start = place_stations(ground.finder, one, 0.04 * size, size, LEAST)
    return Cutting(shell, ground, [one], limits, 0.04 * size, size, None), start


def test_held_sides_do_not_turn_next_to_their_corners():
    cutting, start = window()
    one = cutting.borders[0]
    turned = []
    for held in (False, True):
        wanted = Wanted(LEAST, DEPTH, cutting.size, held)
        sides = flat_sides(cutting.ground, one, start, wanted)
        made = fold(cutting.whole, cutting.ground, one, start, sides)
        fence = build_fence(one, made, cutting.size / 12)
        ends = np.flatnonzero(made.fixed)
        slopes = []
        for k in (*ends, *(ends - 1)):
            a, b = made.along[k], made.along[(k + 1) % len(made.along)]
            chord = np.diff(one.at([a, b])[0], axis=0)[0]
            slopes.append(abs(fence.normals[k] @ chord) / np.linalg.norm(chord))
        turned.append(max(slopes))
    assert turned[0] > 0.02 and turned[1] < 1e-9


def test_folds_leave_no_edge_that_vanishes_within_the_depth():
    cutting, start = window()
    plain, _ = cut_stepping(cutting, [start])
    made, _ = cut_folding(cutting, [start])
    assert plain.cost > 0 and made.cost == 0
    shell = made.shell
    tail, head = shell.edges[:, 0], shell.edges[:, 1]
    along = shell.mesh.vertices[head] - shell.mesh.vertices[tail]
    image = shell.gauss.vertices[head] - shell.gauss.vertices[tail]
    border_ends = np.unique(shell.edges[shell.edges[:, 3] < 0, :2])
    near = np.isin(shell.edges[:, :2], border_ends).any(axis=1)
    for t in (-DEPTH[0], 0.0, DEPTH[1]):
        left = np.einsum("ij,ij->i", along + t * image, along)[near]
        assert left.min() > 0
    assert np.linalg.norm(along[near], axis=1).min() >= LEAST


def test_what_a_cut_costs_is_shared_out_to_its_sides():
    """Away from corners every short edge counts once, there for both sides."""
    cutting, start = window()
    made, _ = cut_stepping(cutting, [start])
    sides = flat_sides(
        cutting.ground, cutting.borders[0], start, Wanted(LEAST, DEPTH, cutting.size)
    )
    costs = cutting.cost_along(made, [sides])[0]
    assert len(costs) == len(sides) > 1 and min(costs) >= 0 and made.cost > 0
    assert made.cost <= sum(costs) + 1e-9 <= 2 * made.cost + 2e-9


def test_a_panel_that_crosses_itself_is_named():
    smooth, shell = whole()
    f = int(shell.panels[np.linalg.norm(shell.points[shell.panels], axis=1).argmin()])
    heights = shell.heights.copy()
    heights[f] -= 40.0
    bad = replace(shell, heights=heights)
    assert not simple_faces(bad.mesh).all()
    one = border(smooth, circle(0.3, 0.3))
    assert np.linalg.norm(one.points - shell.points[f], axis=1).min() < 100
    with pytest.raises(MeshError, match=r"crosses itself before any cut.*another panel size"):
        cut_shell(bad, [one])

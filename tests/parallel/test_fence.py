"""Fences: planes through chords whose common lines come near the film's normals."""

import numpy as np
import pytest
from cut_samples import TURN, border, circle, polygon, whole

from phexfab.errors import MeshError
from phexfab.parallel.border import Border, distance_to_segments
from phexfab.parallel.fence import build_fence, flat_plane
from phexfab.parallel.slivers import triangulations
from phexfab.parallel.stations import PanelFinder, place_stations


def fence_of(drawn, corners=(), sagitta=8.0, size=200.0, **options):
    smooth, shell = whole()
    one = border(smooth, drawn, corners)
    finder = PanelFinder(shell.mesh)
    stations = place_stations(finder, one, sagitta, size, 8.0, **options)
    return build_fence(one, stations, size / 12, **options)


@pytest.mark.parametrize(
    ("drawn", "corners"),
    [(circle(0.5), ()), polygon(0.4 * np.array([-1 - 1j, 1 - 1j, 1 + 1j, -1 + 1j]) * np.exp(0.4j))],
)
def test_neighbouring_planes_meet_in_the_rulings(drawn, corners):
    fence = fence_of(drawn, corners)
    before = np.roll(fence.normals, 1, axis=0)
    for normals, heights in ((fence.normals, fence.heights), (before, np.roll(fence.heights, 1))):
        assert np.abs(np.einsum("ij,ij->i", normals, fence.rulings)).max() < 1e-9
        miss = np.einsum("ij,ij->i", normals, fence.points) - heights
        assert np.abs(miss).max() < 1e-9
    _, normals = fence.border.at(fence.stations.along)
    lean = np.degrees(np.arccos(np.einsum("ij,ij->i", fence.rulings, normals)))
    assert lean.max() <= fence.angle + 1e-9 < 45
    assert fence.way == "fitted"


def test_planes_that_hold_the_normals_would_lean_much_more():
    """Why planes are fitted: upright ones meet in lines that the geodesic torsion tilts."""
    fence = fence_of(circle(0.5), sagitta=2.0)
    _, normals = fence.border.at(fence.stations.along)
    chord = np.roll(fence.points, -1, axis=0) - fence.points
    upright = np.cross(chord, normals + np.roll(normals, -1, axis=0))
    upright /= np.linalg.norm(upright, axis=1, keepdims=True)
    rulings = np.cross(np.roll(upright, 1, axis=0), upright)
    rulings /= np.linalg.norm(rulings, axis=1, keepdims=True)
    lean = np.degrees(np.arccos(np.abs(np.einsum("ij,ij->i", rulings, normals))))
    assert lean.max() > 1.2 * fence.angle


def test_normals_through_one_point_are_nearly_met():
    """A circle of latitude on a sphere: all normals pass through its centre."""
    points = 1000.0 * np.column_stack(
        [0.8 * np.cos(TURN), 0.8 * np.sin(TURN), np.full(len(TURN), 0.6)]
    )
    one = Border(points, points, np.zeros(0, int))
    stations = place_stations(PanelFinder(whole()[1].mesh), one, 10.0, 100.0, 4.0)
    fence = build_fence(one, stations, 10.0)
    _, normals = one.at(stations.along)
    lean = np.linalg.norm(np.cross(fence.rulings, normals), axis=1)
    assert np.degrees(lean).max() < 0.2  # chords stand within the cone by the sagitta


def test_chords_stay_within_the_sagitta():
    for sagitta in (20.0, 5.0, 1.0):
        fence = fence_of(circle(0.5), sagitta=sagitta)
        ends = np.roll(fence.points, -1, axis=0)
        off = distance_to_segments(fence.border.points, fence.points, ends)
        assert off.max() <= sagitta * 1.001


def test_planar_sides_that_the_film_crosses_steeply_get_one_plane():
    smooth, _ = whole("catenoid", 500.0, closed=True)
    one = border(smooth, 0.3 + 1j * TURN)
    plane = flat_plane(one, 0.0, one.length)
    assert plane is not None
    assert abs(abs(plane[2]) - 1) < 1e-9
    steep = border(smooth, 0.9 + 1j * TURN)  # the film leans 44° there: no single plane
    assert flat_plane(steep, 0.0, steep.length) is None


def test_borders_that_are_none_are_refused():
    points = np.column_stack([np.cos(TURN), np.sin(TURN), 0 * TURN])
    up = np.tile([0.0, 0.0, 1.0], (len(TURN), 1))
    with pytest.raises(MeshError, match="at least 8"):
        Border(points[:5], up[:5], np.zeros(0, int))
    with pytest.raises(MeshError, match="points 3 and 4 of a border coincide"):
        Border(np.vstack([points[:4], points[3:]]), up[[0, *range(len(up))]], np.zeros(0, int))
    with pytest.raises(MeshError, match="zero normal"):
        Border(points, 0 * up, np.zeros(0, int))
    with pytest.raises(MeshError, match="corner"):
        Border(points, up, np.array([5000]))


def test_distances_to_segments_many_and_few_agree():
    rng = np.random.default_rng(1)
    begin, end, points = rng.normal(size=(3, 200, 3))
    many = distance_to_segments(points, begin, end)
    few = np.min(
        [distance_to_segments(points, begin[k : k + 5], end[k : k + 5]) for k in range(0, 200, 5)],
        axis=0,
    )
    assert np.allclose(many, few, rtol=1e-12)


def test_triangulations_are_counted_by_catalan_numbers():
    assert [len(triangulations(n)) for n in range(3, 9)] == [1, 2, 5, 14, 42, 132]

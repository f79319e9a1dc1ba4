"""Insetting polygons edge by edge, against shapely's mitred buffer and plain algebra."""

import numpy as np
import pytest
import shapely
from shapely import Polygon

from phexfab.fabrication.inset import edge_directions, inset, inset_limits
from phexfab.mesh.polymesh import PolyMesh

HOURGLASS = np.array([[-2, 2.2], [-2, -2.2], [0, -1.1], [2, -2.2], [2, 2.2], [0, 1.1]], float)
LOPSIDED = np.array([[-2, 2], [-1.7, -2.4], [0.3, -0.7], [2.1, -1.9], [1.8, 2.5], [-0.2, 0.9]])
NINE = np.array(
    [
        [r * np.cos(a), r * np.sin(a)]
        for r, a in zip([1.0, 2.0, 2.1] * 3, np.arange(9) * 2 * np.pi / 9, strict=True)
    ]
)
POLYGONS = (HOURGLASS, LOPSIDED, NINE)


def batch(polygons):
    starts = np.cumsum([0] + [len(p) for p in polygons])
    return np.vstack(polygons), PolyMesh(np.zeros((0, 3)), np.arange(starts[-1]), starts)


def limits_of(polygons, speeds):
    points, mesh = batch(polygons)
    return inset_limits(points, edge_directions(points, mesh), speeds, mesh)


@pytest.mark.parametrize("distance", [0.01, 0.2, 0.4, -0.3])
def test_equal_distances_are_a_mitred_buffer(distance):
    points, mesh = batch(POLYGONS)
    moved = inset(points, np.full(len(points), distance), mesh)
    for f, polygon in enumerate(POLYGONS):
        found = Polygon(moved[mesh.starts[f] : mesh.starts[f + 1]])
        expected = Polygon(polygon).buffer(-distance, join_style="mitre", mitre_limit=50)
        assert found.is_valid
        assert found.symmetric_difference(expected).area < 1e-12


def test_every_edge_moves_by_its_own_distance():
    points, mesh = batch(POLYGONS)
    distances = np.random.default_rng(1).uniform(-0.2, 0.3, len(points))
    moved = inset(points, distances, mesh)
    for c, d in enumerate(distances):
        a, b = points[c], points[mesh.next_corner[c]]
        inward = np.array([-(b - a)[1], (b - a)[0]]) / np.linalg.norm(b - a)
        for corner in (moved[c], moved[mesh.next_corner[c]]):
            assert (corner - a) @ inward == pytest.approx(d, abs=1e-13)


def test_a_straight_corner_moves_straight_in():
    square = np.array([[0, 0], [1, 0], [2, 0], [2, 2], [0, 2]], float)
    points, mesh = batch([square])
    moved = inset(points, np.full(5, 0.25), mesh)
    np.testing.assert_allclose(moved[1], [1, 0.25], atol=1e-15)
    np.testing.assert_allclose(moved[0], [0.25, 0.25], atol=1e-15)


@pytest.mark.parametrize("seed", range(20))
def test_the_limit_is_where_the_polygon_stops_being_simple(seed):
    """Against bisection with shapely, on random non-convex hexagons and speeds."""
    rng = np.random.default_rng(seed)
    polygon = (HOURGLASS if seed % 2 else NINE) + rng.uniform(
        -0.25, 0.25, (6 if seed % 2 else 9, 2)
    )
    speeds = rng.uniform(0.5, 1.5, len(polygon))
    (limit,) = limits_of([polygon], speeds)
    points, mesh = batch([polygon])
    directions = edge_directions(points, mesh)

    def good(t):
        moved = inset(points, t * speeds, mesh)
        edge = moved[mesh.next_corner] - moved
        forward = (np.einsum("ij,ij->i", edge, directions) > 0).all()
        return forward and shapely.is_valid(Polygon(moved))

    assert all(good(t) for t in np.linspace(0, limit * (1 - 1e-9), 40))
    assert not good(limit * (1 + 1e-6))


def test_known_limits():
    square = np.array([[0, 0], [2, 0], [2, 2], [0, 2]], float)
    assert limits_of([square], np.ones(4))[0] == pytest.approx(1, abs=1e-15)
    # The waist closes where the two reflex corners meet, each running at 1/sin of half its angle.
    lean = np.arctan2(2, 1.1)
    assert limits_of([HOURGLASS], np.ones(6))[0] == pytest.approx(1.1 * np.sin(lean), rel=1e-12)
    # Growing outward never ends for a square.
    assert limits_of([square], -np.ones(4))[0] == np.inf


def test_a_contour_that_is_reversed_from_the_start_has_no_room():
    square = np.array([[0, 0], [2, 0], [2, 2], [0, 2]], float)
    points, mesh = batch([square])
    directions = edge_directions(points, mesh)
    beyond = inset(points, np.full(4, 1.5), mesh)
    for speeds in (np.ones(4), -np.ones(4)):
        assert inset_limits(beyond, directions, speeds, mesh)[0] == 0.0

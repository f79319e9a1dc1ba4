"""Measures of polygons against shapely, numpy's SVD and figures known by hand."""

import numpy as np
import pytest
import shapely

from phexfab.errors import MeshError
from phexfab.mesh import measures
from phexfab.mesh.polymesh import PolyMesh

SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]
L_SHAPE = [[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]]
# The hourglass of a P-Hex mesh: reflex corners 0 and 3.
HOURGLASS = [[0, 1], [-2, 2], [-2, -2], [0, -1], [2, -2], [2, 2]]
BOW_TIE = [[0, 0], [2, 2], [2, 0], [0, 1]]


def placed(polygons, seed=0, away=0.0):
    """The plane polygons as one mesh, each turned and moved in space at random; and the normals."""
    rng = np.random.default_rng(seed)
    points, normals, faces, first = [], [], [], 0
    for polygon in polygons:
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        turn *= np.linalg.det(turn)
        flat = np.column_stack([np.asarray(polygon, float), np.zeros(len(polygon))])
        points.append(flat @ turn.T + rng.normal(size=3) + away)
        normals.append(turn[:, 2])
        faces.append(range(first, first + len(polygon)))
        first += len(polygon)
    return PolyMesh.from_faces(np.concatenate(points), faces), np.array(normals)


def random_star(rng, n):
    """A simple, non-convex polygon around the origin, counter-clockwise."""
    angle = np.sort(rng.uniform(0, 2 * np.pi, n) / n + 2 * np.pi * np.arange(n) / n)
    radius = rng.uniform(0.3, 3.0, n)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def stars(count=60, seed=5):
    rng = np.random.default_rng(seed)
    return [random_star(rng, int(n)) for n in rng.integers(5, 12, count)]


def test_areas_and_normals_of_non_convex_faces():
    polygons = stars()
    mesh, normals = placed(polygons, away=50.0)
    areas = np.array([shapely.Polygon(p).area for p in polygons])
    assert np.allclose(measures.signed_areas(mesh), areas, rtol=1e-12)
    assert np.allclose(measures.signed_areas(mesh, -normals), -areas, rtol=1e-12)
    assert np.allclose(measures.face_normals(mesh), normals, atol=1e-12)


def test_centroids_are_those_of_area():
    polygons = [*stars(), L_SHAPE]
    mesh, _ = placed(polygons)
    found = measures.face_centroids(mesh)
    for f, polygon in enumerate(polygons):
        middle = shapely.Polygon(polygon).centroid
        # A rigid motion keeps distances: to three corners they fix the point in its plane.
        flat = np.asarray(polygon, float)
        wanted = np.linalg.norm(flat - [middle.x, middle.y], axis=1)
        assert np.allclose(np.linalg.norm(mesh.polygon(f) - found[f], axis=1), wanted, rtol=1e-11)


def test_reflex_corners_are_told_from_sharp_ones():
    mesh, normals = placed([L_SHAPE, HOURGLASS])
    angles = measures.corner_angles(mesh)
    assert np.allclose(angles[:6], [90, 90, 90, 270, 90, 90])
    lean = np.degrees(np.arctan2(1, 2))
    sharp = 90 - lean
    assert np.allclose(angles[6:], [180 + 2 * lean, sharp, sharp, 180 + 2 * lean, sharp, sharp])
    assert np.allclose(measures.corner_angles(mesh, -normals), 360 - angles)


def test_angles_add_up_to_those_of_a_polygon():
    mesh, _ = placed(stars())
    total = np.add.reduceat(measures.corner_angles(mesh), mesh.starts[:-1])
    assert np.allclose(total, 180.0 * (mesh.sides - 2))


def test_planarity_of_a_saddle_quadrilateral_is_its_height():
    lifted = np.column_stack([SQUARE, [0.01, -0.01, 0.01, -0.01]])
    mesh = PolyMesh.from_faces(lifted, [range(4)])
    assert measures.planarity(mesh) == pytest.approx([0.01], rel=1e-12)
    edge = np.hypot(1.0, 0.02)
    assert measures.relative_planarity(mesh) == pytest.approx([0.01 / edge], rel=1e-12)


@pytest.mark.parametrize("bump", [1e-9, 1e-3, 0.3])
def test_planarity_agrees_with_the_singular_value_decomposition(bump):
    rng = np.random.default_rng(3)
    # One direction 200 times longer: the least-squares plane of a thin face is the hard one.
    mesh, normals = placed([np.asarray(p) * [200.0, 1.0] for p in stars()])
    points = mesh.vertices + bump * rng.normal(size=(len(mesh.vertices), 1)) * np.repeat(
        normals, mesh.sides, axis=0
    )
    bumpy = PolyMesh(points, mesh.corners, mesh.starts)
    found = measures.planarity(bumpy)
    for f in range(mesh.n_faces):
        local = bumpy.polygon(f) - bumpy.polygon(f).mean(axis=0)
        normal = np.linalg.svd(local)[2][2]
        assert found[f] == pytest.approx(np.abs(local @ normal).max(), rel=1e-5, abs=1e-12)


def test_planar_faces_far_from_the_origin_are_planar_to_rounding():
    mesh, _ = placed(stars(), away=1e4)
    assert measures.planarity(mesh).max() < 1e-11


def test_a_face_on_a_line_has_no_measure_that_is_not_a_number():
    mesh = PolyMesh.from_faces([[0, 0, 0], [1, 0, 0], [3, 0, 0]], [range(3)])
    assert measures.planarity(mesh) == [0.0]
    assert not measures.simple_faces(mesh).any()
    assert np.allclose(measures.face_centroids(mesh), [[4 / 3, 0, 0]])
    assert np.isnan(measures.face_normals(mesh)).all()


def test_libhedra_s_percentage_of_quadrilaterals_and_hexagons():
    # Diagonals of length √2, at right angles, their lines 0.02 apart.
    lifted = np.column_stack([SQUARE, [0.01, -0.01, 0.01, -0.01]])
    quadrilateral = PolyMesh.from_faces(lifted, [range(4)])
    assert measures.libhedra_planarity(quadrilateral) == pytest.approx([100 * 0.02 / np.sqrt(2)])
    turn = np.arange(6) * np.pi / 3
    d = 0.01
    crown = np.column_stack([np.cos(turn), np.sin(turn), d * (-1.0) ** np.arange(6)])
    # Its diagonals (1, 3) and (2, 4) have length √3 at 60° and are level at heights d and −d.
    hexagon = PolyMesh.from_faces(crown, [range(6)])
    assert measures.libhedra_planarity(hexagon) == pytest.approx([100 * 2 * d / np.sqrt(3)])
    flat = PolyMesh.from_faces(crown * [1, 1, 0], [range(6)])
    assert measures.libhedra_planarity(flat).max() < 1e-12


def test_edges_of_a_cube_are_counted_once():
    corners = np.array([[x, y, z] for x in (0, 2) for y in (0, 2) for z in (0, 2)], float)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    corners[7] = [3, 2, 2]
    cube = PolyMesh.from_faces(corners, faces)
    assert len(measures.edges(cube)) == 12
    lengths = sorted(measures.edge_lengths(cube))
    assert lengths == pytest.approx([2] * 9 + [np.sqrt(5)] * 2 + [3])
    assert measures.mean_edge(cube) == pytest.approx((18 + 2 * np.sqrt(5) + 3) / 12)
    assert measures.shortest_edge(cube) == 2


def test_simple_faces_by_hand():
    folded = [[0, 0], [2, 0], [1, 0], [1, 1]]  # runs back over its own edge
    twice = [[0, 0], [1, 0], [1, 0], [0, 1]]  # an edge without length
    touching = [[0, 0], [4, 0], [4, 2], [2, 0], [0, 2]]  # a corner on an edge
    straight = [[0, 0], [1, 0], [2, 0], [1, 1]]  # a corner of 180° is fine
    polygons = [SQUARE, L_SHAPE, HOURGLASS, BOW_TIE, folded, twice, touching, straight]
    mesh, _ = placed(polygons)
    simple = [True, True, True, False, False, False, False, True]
    assert measures.simple_faces(mesh).tolist() == simple
    backwards, _ = placed([polygon[::-1] for polygon in polygons])
    assert measures.simple_faces(backwards).tolist() == simple


def test_simple_faces_agree_with_shapely_on_lattice_polygons():
    """Corners on a coarse grid, so that edges touch, overlap and cross in every way."""
    rng = np.random.default_rng(11)
    polygons = []
    while len(polygons) < 1500:
        polygon = rng.integers(0, 6, (int(rng.integers(3, 8)), 2))
        if (polygon != np.roll(polygon, 1, axis=0)).any(axis=1).all():
            polygons.append(polygon)
    wanted = [shapely.Polygon(p).is_valid for p in polygons]
    assert 200 < sum(wanted) < 1300
    mesh, _ = placed(polygons, away=3.0)
    assert measures.simple_faces(mesh).tolist() == wanted


def test_a_mesh_without_faces_has_empty_measures_and_no_mean():
    nothing = PolyMesh.from_faces(np.eye(3), [])
    for verb in (measures.planarity, measures.simple_faces, measures.signed_areas):
        assert len(verb(nothing)) == 0
    for verb in (measures.mean_edge, measures.shortest_edge):
        with pytest.raises(MeshError, match="no face"):
            verb(nothing)

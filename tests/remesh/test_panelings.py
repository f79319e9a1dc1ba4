"""Triangles and planar quadrilaterals on a smooth surface."""

import numpy as np
import pytest

from phexfab.errors import LatticeError, MeshError
from phexfab.mesh.measures import edges, face_normals, mean_edge, planarity, signed_areas
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.panelings import (
    covered_rectangle,
    planar_quads,
    quad_paneling,
    triangle_paneling,
)
from phexfab.surface.catalog import surface

BOX = (-0.5, 0.5, -0.35, 0.35)
ENNEPER = surface("enneper").scaled(1000.0)
CATENOID = surface("catenoid").scaled(1000.0)
RING = (-0.6, 0.6, -np.pi, np.pi)
MAKERS = {
    "triangles": lambda count: triangle_paneling(ENNEPER, BOX, count),
    "triangles along v": lambda count: triangle_paneling(ENNEPER, BOX, count, rows_along="v"),
    "quads": lambda count: quad_paneling(ENNEPER, BOX, count),
    "ring of triangles": lambda count: triangle_paneling(
        CATENOID, RING, count, rows_along="v", closed=True
    ),
    "ring of stacked triangles": lambda count: triangle_paneling(
        CATENOID, RING, count, rows_along="u", closed=True
    ),
    "ring of quads": lambda count: quad_paneling(CATENOID, RING, count, closed=True),
}


def inner_valences(mesh):
    """Valences of the vertices around which as many faces as edges lie, by plain counting."""
    neighbours, faces = {}, {}
    for face in mesh.faces:
        for i, j in zip(face, np.roll(face, -1), strict=True):
            neighbours.setdefault(int(i), set()).add(int(j))
            neighbours.setdefault(int(j), set()).add(int(i))
            faces[int(i)] = faces.get(int(i), 0) + 1
    return {len(neighbours[i]) for i in neighbours if len(neighbours[i]) == faces[i]}


@pytest.mark.parametrize("name", MAKERS)
def test_they_are_the_right_kind_of_mesh(name):
    made = MAKERS[name](150)
    mesh = made.mesh
    sides = 3 if "triangles" in name else 4
    assert set(mesh.sides) == {sides}
    assert inner_valences(mesh) == {12 // sides + (2 if sides == 3 else 1)}
    assert len(mesh.vertices) - len(edges(mesh)) + mesh.n_faces == (0 if "ring" in name else 1)
    assert abs(np.log(mesh.n_faces / 150)) < 0.1
    smooth = CATENOID if "ring" in name else ENNEPER
    at = smooth.normal(made.parameters[mesh.corners[mesh.starts[:-1]]])
    assert np.einsum("ij,ij->i", face_normals(mesh), at).min() > 0.9


@pytest.mark.parametrize("name", MAKERS)
def test_they_cover_the_rectangle(name):
    # The area under the rectangle, by the midpoint rule on the definition of the first form.
    ring = "ring" in name
    smooth, box = (CATENOID, RING) if ring else (ENNEPER, BOX)
    u = box[0] + (box[1] - box[0]) * (np.arange(200) + 0.5) / 200
    v = box[2] + (box[3] - box[2]) * (np.arange(200) + 0.5) / 200
    cell = (u[1] - u[0]) * (v[1] - v[0])
    w = u[:, None] + 1j * v
    h = 1e-5
    along = (smooth.point(smooth.parameter(w + h)) - smooth.point(smooth.parameter(w - h))) / h / 2
    area = float((along**2).sum() * cell)  # conformal: |X_u|² = |X_v|²
    assert signed_areas(MAKERS[name](600).mesh).sum() == pytest.approx(area, rel=0.02)


@pytest.mark.parametrize("name", [name for name in MAKERS if "triangles" in name])
def test_triangles_have_their_vertices_on_the_surface(name):
    made = MAKERS[name](60)
    smooth = CATENOID if "ring" in name else ENNEPER
    assert np.abs(smooth.point(made.parameters) - made.mesh.vertices).max() < 1e-9


@pytest.mark.parametrize("name", ["quads", "ring of quads"])
def test_quads_are_planar_and_stay_near_the_surface(name):
    moved = []
    for count in (60, 240):
        made = MAKERS[name](count)
        smooth = CATENOID if "ring" in name else ENNEPER
        assert planarity(made.mesh).max() <= 1e-12 * mean_edge(made.mesh)
        gap = np.linalg.norm(smooth.point(made.parameters) - made.mesh.vertices, axis=1)
        moved.append(gap.max() / mean_edge(made.mesh))
    assert moved[0] < 0.01
    assert moved[1] < moved[0] / 3 + 1e-12  # curvature lines: planar to second order


def test_the_nearest_planar_quad_of_a_twisted_square_is_the_square():
    h = 0.05
    square = np.array([[0, 0, h], [1, 0, -h], [1, 1, h], [0, 1, -h]])
    flat = planar_quads(PolyMesh.from_faces(square, [[0, 1, 2, 3]]))
    assert np.abs(flat.vertices - square * [1, 1, 0]).max() < 1e-9


def test_planar_quads_moves_a_net_of_twisted_quads_as_little_as_it_can():
    x, y = np.meshgrid(np.arange(4.0), np.arange(3.0))
    points = np.column_stack([x.ravel(), y.ravel(), 0.04 * (x * y).ravel()])
    faces = [[4 * r + k, 4 * r + k + 1, 4 * r + k + 5, 4 * r + k + 4]
             for r in range(2) for k in range(3)]  # fmt: skip
    flat = planar_quads(PolyMesh.from_faces(points, faces))
    assert planarity(flat).max() < 1e-12

    # At the nearest point the way back is a combination of the conditions' gradients.
    def volumes(vertices):
        a, b, c, d = (vertices[[f[k] for f in faces]] for k in range(4))
        return np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a))

    slopes = np.array([
        (volumes(flat.vertices + e.reshape(-1, 3)) - volumes(flat.vertices - e.reshape(-1, 3)))
        / 2e-5 for e in 1e-5 * np.eye(points.size)
    ])  # fmt: skip
    back = (points - flat.vertices).ravel()
    rest = back - slopes @ np.linalg.lstsq(slopes, back, rcond=None)[0]
    assert np.linalg.norm(back) > 1e-3
    assert np.linalg.norm(rest) < 1e-6 * np.linalg.norm(back)


@pytest.mark.parametrize("closed", [False, True])
def test_the_covered_rectangle_has_the_area(closed):
    box = RING if closed else BOX
    smooth = CATENOID if closed else ENNEPER
    whole = signed_areas(quad_paneling(smooth, box, 4000, closed=closed).mesh).sum()
    part = covered_rectangle(smooth, box, 0.7 * whole, closed=closed)
    covered = signed_areas(quad_paneling(smooth, part, 4000, closed=closed).mesh).sum()
    assert covered == pytest.approx(0.7 * whole, rel=2e-3)
    margins = np.array(box) - part
    assert margins[0] == pytest.approx(-margins[1]) and margins[0] < 0
    assert margins[2] == pytest.approx(0 if closed else margins[0])


def test_the_covered_rectangle_never_grows():
    assert covered_rectangle(ENNEPER, BOX, 1e12) == BOX


def test_what_cannot_be_is_refused():
    with pytest.raises(LatticeError, match="does not close"):
        quad_paneling(ENNEPER, BOX, 50, closed=True)
    with pytest.raises(LatticeError, match="1 panels"):
        triangle_paneling(ENNEPER, BOX, 1)
    with pytest.raises(LatticeError, match="is empty"):
        quad_paneling(ENNEPER, (0.5, -0.5, 0, 1), 50)
    with pytest.raises(LatticeError, match="must be positive"):
        covered_rectangle(ENNEPER, BOX, 0.0)
    with pytest.raises(MeshError, match="face 0 has 3 corners"):
        planar_quads(triangle_paneling(ENNEPER, BOX, 20).mesh)

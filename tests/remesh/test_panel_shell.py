"""Meshes of panels as shells: closed ones, ragged borders, and what has no planes, by place."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from phexfab.cli.starter import Origin, starter
from phexfab.errors import MeshError
from phexfab.mesh.clean import clean
from phexfab.mesh.io import write_mesh
from phexfab.mesh.measures import edge_lengths, mean_edge, relative_planarity, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.simple import border_of
from phexfab.remesh.panel_shell import panel_shell
from phexfab.remesh.planarity.planarise import planarise


def honeycomb(rings=4, size=700.0, radius=12_000.0):
    """Tangent planes of a paraboloid above a honeycomb: exactly planar hexagons, in mm."""
    i, j = (a.ravel() for a in np.meshgrid(*2 * [np.arange(-rings, rings + 1)]))
    near = np.abs(i + j) <= rings
    centres = size * np.column_stack([i + j / 2, j * np.sqrt(0.75)])[near]
    turn = np.radians(30 + 60 * np.arange(6))
    corners = centres[:, None] + size / np.sqrt(3) * np.column_stack([np.cos(turn), np.sin(turn)])
    height = np.einsum("fni,fi->fn", corners, centres) * 2 - (centres**2).sum(axis=1)[:, None]
    points = np.dstack([corners, -height / radius]).reshape(-1, 3)
    return clean(PolyMesh.from_faces(points, np.arange(len(points)).reshape(-1, 6)))[0]


def dodecahedron():
    """The polar dual of an icosahedron."""
    golden = (1 + np.sqrt(5)) / 2
    flat = np.array([[0, a, b * golden] for a in (-1, 1) for b in (-1, 1)])
    points = np.vstack([np.roll(flat, k, axis=1) for k in range(3)])
    hull = ConvexHull(points)
    faces = []
    for point in points:
        around = np.flatnonzero((np.abs(hull.points[hull.simplices] - point).sum(2) == 0).any(1))
        across = np.cross(point, [0.3, 0.5, 0.7])
        at = hull.equations[around, :3]
        faces.append(around[np.argsort(np.arctan2(at @ np.cross(point, across), at @ across))])
    return hull.equations[:, :3], faces


def test_a_closed_mesh_is_a_shell_without_border():
    points, faces = dodecahedron()
    mesh = PolyMesh.from_faces(1000 * points * [1, 0.9, 0.7], faces)  # planes stay planes
    assert not len(border_of(mesh).corner)
    made = panel_shell(mesh)
    assert len(made.shell.panels) == 12 and len(made.shell.normals) == 12
    assert made.moved.max() < 1e-9


def test_a_border_that_runs_straight_on_is_refused_by_place():
    mesh = honeycomb()
    assert len(panel_shell(mesh).shell.panels) == mesh.n_faces
    edge = border_of(mesh)
    ends = mesh.corners[edge.corner]
    b = int(np.flatnonzero(edge.valence[ends] == 1)[0])
    points = mesh.vertices.copy()
    points[ends[b]] = (points[ends[edge.before[b]]] + points[ends[edge.after[b]]]) / 2
    straight = PolyMesh(points, mesh.corners, mesh.starts)
    said = rf"straight on at 1 vertices of one face, first vertex {ends[b]} at \["
    with pytest.raises(MeshError, match=said):
        panel_shell(straight)
    assert len(panel_shell(straight, border="drop").shell.panels)


@pytest.mark.parametrize("border", ["keep", "drop"])
def test_a_mesh_that_is_flat_is_refused_by_place(border):
    mesh = honeycomb()
    flat = PolyMesh(mesh.vertices * [1, 1, 0], mesh.corners, mesh.starts)
    with pytest.raises(MeshError, match=r"at \d+ vertices the planes .* first vertex \d+ at \["):
        panel_shell(flat, border=border)


def bent():
    """Noise, and the border's vertices pulled inward or outward so that it hardly turns."""
    mesh = honeycomb(2)
    edge = border_of(mesh)
    ends = mesh.corners[edge.corner]
    points = mesh.vertices.copy()
    middle = (points[ends[edge.before]] + points[ends[edge.after]]) / 2
    points[ends] += 0.6 * (middle - points[ends])
    noise = np.random.default_rng(0).normal(size=points.shape)
    return PolyMesh(points + 0.08 * mean_edge(mesh) * noise, mesh.corners, mesh.starts)


def test_a_dropped_border_is_free_to_move():
    mesh = bent()
    made = panel_shell(mesh, border="drop")
    free = planarise(mesh, keep_border=False, strict=False)
    assert np.array_equal(made.planarised.mesh.vertices, free.mesh.vertices)


def test_the_border_gives_way_before_faces_cross():
    mesh = bent()  # as near to its border as can be, face 1 would be a bow tie
    held = planarise(mesh)  # strict: it raises where a face crosses itself
    assert held.report.off_border > 0 and simple_faces(held.mesh).all()
    assert relative_planarity(held.mesh).max() < 1e-12
    assert (edge_lengths(held.mesh) >= 0.9 * edge_lengths(mesh)).all()


def without(mesh, face):
    faces = [corners for f, corners in enumerate(mesh.faces) if f != face]
    return PolyMesh.from_faces(mesh.vertices, faces)


@pytest.mark.parametrize("metres", [False, True])
def test_a_new_design_for_a_mesh_builds_as_it_is(tmp_path, metres):
    mesh = honeycomb(3)
    points = mesh.vertices / (1000 if metres else 1)
    write_mesh(PolyMesh(points, mesh.corners, mesh.starts), tmp_path / "panels.obj")
    origin = Origin(mesh=tmp_path / "panels.obj", method="planarise")
    text, built = starter(origin, tmp_path / "roof.toml")
    assert built.ok and len(built.parts.panels) == mesh.n_faces
    assert ('unit = "m"' in text) == metres and 'border = "keep"' in text
    # Facets of 700 mm across, as a bar's length tells.
    assert max(beam.length for beam in built.parts.beams) > 300


def test_a_new_design_leaves_out_a_border_that_has_no_planes(tmp_path):
    mesh = honeycomb(4)
    inside = int(np.argmin(np.linalg.norm(mesh.vertices[mesh.corners[::6]], axis=1)))
    write_mesh(without(mesh, inside), tmp_path / "panels.off")
    origin = Origin(mesh=tmp_path / "panels.off", method="planarise")
    text, built = starter(origin, tmp_path / "roof.toml")
    assert 'border = "drop"' in text and 0 < len(built.parts.panels) < mesh.n_faces - 1

"""The public assertions hold on exact values, and say where when they do not."""

from dataclasses import replace

import numpy as np
import pytest

from phexfab import testing
from phexfab.fabrication.parts import Solid
from phexfab.fabrication.polyhedra import prism_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.surface.catalog import surface

MADE = surface("enneper").scaled(2000.0)
SHELLS = {
    kind: minimal_shell(MADE, lattice_on(MADE, 420.0), kind) for kind in ("face", "edge", "vertex")
}
CUBE = Solid(
    np.array([[x, y, z] for z in (0, 1) for x, y in ((0, 0), (1, 0), (1, 1), (0, 1))], float),
    prism_faces(4),
)


def said(assertion, *arguments):
    with pytest.raises(AssertionError) as caught:
        assertion(*arguments)
    return str(caught.value)


def with_vertex(mesh, vertex, by):
    vertices = mesh.vertices.copy()
    vertices[vertex] += by
    return PolyMesh(vertices, mesh.corners, mesh.starts)


@pytest.mark.parametrize("kind", SHELLS)
def test_exact_shells_hold(kind):
    shell = SHELLS[kind]
    testing.assert_planar(shell.mesh)
    testing.assert_planar(shell.gauss)
    testing.assert_parallel(shell.mesh, shell.gauss)
    testing.assert_minimal(shell)
    testing.assert_simple(shell.mesh)
    testing.assert_offset(shell.gauss, kind)


@pytest.mark.parametrize("kind", SHELLS)
def test_a_gauss_image_is_of_one_type_only(kind):
    for other in set(SHELLS) - {kind}:
        assert said(testing.assert_offset, SHELLS[kind].gauss, other).startswith(other)
    with pytest.raises(ValueError, match='kind = "faces"'):
        testing.assert_offset(SHELLS[kind].gauss, "faces")


def test_offset_names_the_vertex_off_the_sphere():
    gauss = SHELLS["vertex"].gauss
    off = with_vertex(gauss, 4, 1e-6 * gauss.vertices[4])
    assert said(testing.assert_offset, off, "vertex").startswith(
        "vertex 4 misses the unit sphere by 1.000e-06 > 1.0e-11"
    )


def test_planar_names_the_face():
    mesh = SHELLS["face"].mesh
    lonely = int(np.flatnonzero(np.bincount(mesh.corners) == 1)[0])  # a corner of one face only
    face = int(mesh.face_of_corner[np.flatnonzero(mesh.corners == lonely)[0]])
    bent = with_vertex(mesh, lonely, [0.1, 0.1, 0.1])
    assert said(testing.assert_planar, bent).startswith(f"face {face} is off its plane")


def test_parallel_names_the_edge_and_refuses_other_faces():
    mesh, gauss = SHELLS["edge"].mesh, SHELLS["edge"].gauss
    lonely = int(np.flatnonzero(np.bincount(mesh.corners) == 1)[0])
    message = said(testing.assert_parallel, with_vertex(mesh, lonely, [1.0, 1.0, 1.0]), gauss)
    edge = message.split()[1].split("-")
    assert str(lonely) in edge and "is not parallel: sine" in message
    fewer = PolyMesh.from_faces(gauss.vertices, gauss.faces[:-1])
    assert "do not have the same faces" in said(testing.assert_parallel, mesh, fewer)


def test_minimal_names_a_panel_beside_the_lifted_one():
    shell = SHELLS["face"]
    heights = shell.heights.copy()
    heights[shell.panels[6]] += 1.0
    panel = int(said(testing.assert_minimal, shell.with_heights(heights)).split()[1])
    assert set(shell.mesh.face(6).tolist()) & set(shell.mesh.face(panel).tolist())


def test_simple_counts_the_faces_that_are_not():
    square, bow = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 0, 0], [1, 1, 0], [1, 0, 0]]
    mesh = PolyMesh.from_faces([*square, *bow, [0, 1, 0]], [range(4), range(4, 8)])
    assert said(testing.assert_simple, mesh) == "face 1 is not a simple polygon; 1 faces in all"


def test_closed_solids():
    testing.assert_closed_solid(CUBE)
    open_ = replace(CUBE, faces=CUBE.faces[:-1])
    assert "does not belong to two opposite faces" in said(testing.assert_closed_solid, open_)
    inverted = Solid(CUBE.vertices, tuple(face[::-1] for face in CUBE.faces))
    assert said(testing.assert_closed_solid, inverted).endswith("its volume is -1")
    vertices = CUBE.vertices.copy()
    vertices[6, 2] += 1e-3
    assert "face 1 is off its plane" in said(
        testing.assert_closed_solid, Solid(vertices, CUBE.faces)
    )
    # A cap that crosses itself can still be closed, planar and of positive volume.
    star = np.array([[0, 0], [4, 0], [4, 4], [1, -1], [0, 4]], float)
    caps = [np.column_stack([star, np.full(5, z)]) for z in (0.0, 1.0)]
    crossed = Solid(np.concatenate(caps), prism_faces(5))
    assert "is not a simple polygon" in said(testing.assert_closed_solid, crossed)


def test_same_mesh_is_to_the_last_bit():
    mesh = SHELLS["face"].mesh
    testing.assert_same_mesh(mesh, PolyMesh(mesh.vertices.copy(), mesh.corners, mesh.starts))
    vertices = mesh.vertices.copy()
    vertices[3, 1] = np.nextafter(vertices[3, 1], np.inf)
    other = PolyMesh(vertices, mesh.corners, mesh.starts)
    assert said(testing.assert_same_mesh, mesh, other).startswith("vertex 3 is")
    longer = PolyMesh(np.vstack([mesh.vertices, [0, 0, 0]]), mesh.corners, mesh.starts)
    assert "vertices against" in said(testing.assert_same_mesh, mesh, longer)


def test_nothing_measured_and_what_is_no_number_do_not_pass():
    nothing = PolyMesh.from_faces(np.eye(3), [])
    with pytest.raises(AssertionError, match="nothing to measure"):
        testing.assert_parallel(nothing, nothing)
    mesh = SHELLS["face"].mesh
    nowhere = PolyMesh(np.full_like(mesh.vertices, np.nan), mesh.corners, mesh.starts)
    assert "nan" in said(testing.assert_planar, nowhere)
    assert "not a simple polygon" in said(testing.assert_simple, nowhere)

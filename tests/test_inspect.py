"""Meshes from elsewhere: measured values against bodies and shells that are known."""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from phexfab.cli import app
from phexfab.errors import MeshError
from phexfab.inspection import inspect_files, inspect_mesh
from phexfab.mesh import PolyMesh, write_mesh
from phexfab.mesh.measures import edge_lengths
from phexfab.mesh.polygons import import_polygons
from phexfab.minimal.shell import minimal_shell
from phexfab.parallel.offset import admissible_interval, offset
from phexfab.remesh.lattice import lattice
from phexfab.remesh.panelings import triangle_paneling
from phexfab.surface.catalog import surface

PUBLIC = Path(__file__).parent.parent.parent / "shared" / "data"
CORNERS = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
CUBE = PolyMesh.from_faces(
    CORNERS, [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
)
ENNEPER = surface("enneper").scaled(1000.0)


@pytest.fixture(scope="module")
def shell():
    return minimal_shell(ENNEPER, lattice((-0.45, 0.45, -0.4, 0.4), 0.15), "vertex")


def apart(mesh):
    """The same faces, no two of which share a vertex."""
    return PolyMesh(mesh.vertices[mesh.corners], np.arange(len(mesh.corners)), mesh.starts)


def public(name):
    path = PUBLIC / name
    if not path.exists():
        pytest.skip(f"{path} is not there")
    return path


def test_a_cube():
    found = inspect_mesh(CUBE, name="cube").sections
    assert found["counts"] == {
        "vertices": 8,
        "edges": 12,
        "faces": 6,
        "Euler characteristic": 2,
        "pieces": 1,
        "borders": 0,
        "border edges": 0,
        "manifold and oriented": True,
        "sides of faces": {"4": 6},
        "valence of inner vertices": {"3": 8},
        "valence on the border": {},
        "simple mesh": True,
    }
    assert found["edges"] == {"shortest": 2, "mean": 2, "longest": 2}
    assert found["faces"]["total area"] == pytest.approx(24)
    assert (found["faces"]["convex faces"], found["faces"]["reflex corners"]) == (6, 0)
    assert found["offset types"]["corners off a circle / size"] < 1e-12
    assert found["offset types"]["edges off the unit sphere"] == pytest.approx(np.sqrt(2) - 1)
    assert set(found["offset types"]["offset types"].split(", ")) == {"vertex", "edge", "face"}


def test_a_cube_and_a_larger_cube():
    larger = PolyMesh(1.5 * CORNERS, CUBE.corners, CUBE.starts)
    found = inspect_mesh(CUBE, larger).sections
    assert found["pair"]["face distance"] == pytest.approx(0.5)
    assert found["pair"]["edge distance"] == pytest.approx(0.5 * np.sqrt(2))
    assert found["pair"]["vertex distance"] == pytest.approx(0.5 * np.sqrt(3))
    found = inspect_mesh(CUBE, CUBE, gauss=True).sections
    assert found["pair"]["type"] == "face"
    assert found["curvature"]["mean H"] == pytest.approx(-1)
    assert found["curvature"]["sum of K"] == pytest.approx(24)
    assert found["curvature"]["offset without flips from"] == pytest.approx(-1)
    assert found["curvature"]["offset without flips to"] == np.inf
    assert found["curvature"]["largest node torsion, °"] < 1e-9


def test_a_shell_and_its_offset(shell):
    distance = 0.4 * admissible_interval(shell)[1]
    found = inspect_mesh(shell.mesh, offset(shell, distance).mesh)
    counts, pair, curved = (found.sections[key] for key in ("counts", "pair", "curvature"))
    assert counts["vertices"] - counts["edges"] + counts["faces"] == 1
    assert set(counts["valence of inner vertices"]) == {"3"}
    assert found.sections["faces"]["reflex corners of a face"] == {"2": counts["faces"]}
    assert pair["type"] == "vertex"
    assert abs(pair["distance"]) == pytest.approx(abs(distance), rel=1e-9)
    assert pair["vertex distance's spread"] < 1e-9 < pair["edge distance's spread"]
    assert curved["largest |H|/√|K|"] < 1e-7
    assert curved["smallest K"] < curved["largest K"] < 0
    assert curved["largest node torsion, °"] < 1e-6 < curved["with vertex normals, °"]
    ends = np.array([curved["offset without flips from"], curved["offset without flips to"]])
    if pair["distance"] * distance < 0:
        ends = -ends[::-1]
    assert ends == pytest.approx(admissible_interval(shell), rel=1e-6)


def test_without_an_offset_the_gauss_image_is_found(shell):
    whole = inspect_mesh(shell.mesh)
    found = whole.sections
    assert found["offset types"]["offset types"] == "vertex, face"
    assert found["curvature"]["Gauss image"] == "found, vertex type"
    # One of a family: the shell's own has |H| = 0 to rounding, and this one lies close to it.
    assert found["curvature"]["largest |H|/√|K|"] < 1e-3
    assert "give the offset" in whole.notes[-1]


def test_files_are_welded_alike(shell, tmp_path):
    for name, mesh in (("m.obj", shell.mesh), ("s.off", shell.gauss)):
        write_mesh(apart(mesh), tmp_path / name)
    for tolerance in (None, 1e-3):
        found = inspect_files(
            tmp_path / "m.obj", tmp_path / "s.off", gauss=True, tolerance=tolerance
        )
        vertices = len(shell.mesh.vertices)
        assert found.sections["counts"]["vertices"] == vertices
        assert found.sections["counts"]["vertices welded"] == len(shell.mesh.corners) - vertices
        assert found.sections["pair"]["type"] == "vertex"
        assert found.sections["pair"]["vertex type misses the sphere by"] < 1e-9
        assert found.sections["curvature"]["largest |H|/√|K|"] < 1e-7


def test_what_is_farther_apart_than_digits_is_not_welded_unasked(shell, tmp_path):
    mesh = apart(shell.mesh)
    shift = 0.004 * edge_lengths(shell.mesh).min() * np.sin(np.arange(mesh.vertices.size))
    write_mesh(replace(mesh, vertices=mesh.vertices + shift.reshape(-1, 3)), tmp_path / "m.obj")
    loose = inspect_files(tmp_path / "m.obj")
    assert loose.sections["counts"]["pieces"] == shell.mesh.n_faces
    assert loose.sections["counts"]["vertices welded"] == 0
    assert "--weld" in loose.notes[-1] and "offset types" not in loose.sections
    length = float(re.search(r"--weld (\S+)", loose.notes[-1])[1])  # what the note proposes does
    found = inspect_files(tmp_path / "m.obj", tolerance=length).sections["counts"]
    assert (found["vertices"], found["pieces"]) == (len(shell.mesh.vertices), 1)


def test_an_offset_that_parts_vertices_leaves_all_as_they_are(tmp_path):
    # Two squares whose common side is one in the mesh, and open in what is called its offset.
    square = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    faces = [[0, 1, 2, 3], [4, 5, 6, 7]]
    write_mesh(
        PolyMesh.from_faces(np.vstack([square, square + np.array([1, 0, 0])]), faces),
        tmp_path / "a.obj",
    )
    write_mesh(
        PolyMesh.from_faces(np.vstack([square, square + np.array([1.5, 0, 1])]), faces),
        tmp_path / "b.obj",
    )
    assert inspect_files(tmp_path / "a.obj").sections["counts"]["vertices welded"] == 2
    found = inspect_files(tmp_path / "a.obj", tmp_path / "b.obj")
    assert found.sections["counts"]["vertices"] == 8
    assert found.notes[0].startswith("vertices are left unwelded: vertices that are one within")
    with pytest.raises(MeshError, match="lower the tolerance"):
        inspect_files(tmp_path / "a.obj", tmp_path / "b.obj", tolerance=1e-6)


def test_what_hinders_is_noted():
    triangles = inspect_mesh(triangle_paneling(ENNEPER, (-0.4, 0.4, -0.4, 0.4), 30).mesh)
    assert "no offset" in triangles.notes[0]
    fin = PolyMesh.from_faces(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0, -1, 0]], [[0, 1, 2], [0, 1, 3], [1, 0, 4]]
    )
    found = inspect_mesh(fin)
    assert "1 edges belong to more than two faces" in found.notes
    assert found.sections["counts"]["manifold and oriented"] is False
    turned = inspect_mesh(PolyMesh.from_faces(CORNERS[:4], [[0, 1, 3], [0, 3, 2]]))
    assert turned.sections["counts"]["manifold and oriented"] is True
    turned = inspect_mesh(PolyMesh.from_faces(CORNERS[:4], [[0, 1, 3], [0, 3, 2][::-1]]))
    assert "1 edges have faces of opposite orientation on their two sides" in turned.notes


def test_meshes_that_cannot_be_measured_are_refused(shell):
    with pytest.raises(MeshError, match="no face"):
        inspect_mesh(PolyMesh(np.zeros((0, 3)), np.zeros(0, int), np.zeros(1, int)))
    with pytest.raises(MeshError, match="do not correspond"):
        inspect_mesh(shell.mesh, CUBE)
    with pytest.raises(MeshError, match="the same"):
        inspect_mesh(CUBE, CUBE)


# -- meshes that others published ------------------------------------------------------------------


def test_a_published_koebe_mesh():
    found = inspect_files(public("hexagonalminimal_plusgauss.off")).sections
    assert (found["counts"]["vertices"], found["counts"]["faces"]) == (400, 180)
    assert found["counts"]["borders"] == 2
    assert found["offset types"]["edges off the unit sphere"] < 4e-11
    assert "edge" in found["offset types"]["offset types"]
    assert found["faces"]["convex faces"] == 180


@pytest.mark.parametrize(
    ("name", "welded", "vertices", "faces", "borders"),
    [("enneper2.off", 0, 1920, 900, 1), ("catenoid3.off", 6500, 3400, 1650, 2)],
)
def test_published_minimal_surfaces(name, welded, vertices, faces, borders):
    found = inspect_files(public(name)).sections
    counts = found["counts"]
    assert counts["vertices welded"] == welded == import_polygons(public(name))[1].welded
    assert (counts["vertices"], counts["faces"], counts["borders"]) == (vertices, faces, borders)
    assert found["faces"]["reflex corners of a face"] == {"2": faces}
    assert found["faces"]["planarity / mean edge"] < 5e-5
    assert found["offset types"]["vertex offset misses by"] < 1e-5
    assert found["curvature"]["Gauss image"] == "found, vertex type"
    assert found["curvature"]["largest |H|/√|K|"] < 1e-3


# -- the command -----------------------------------------------------------------------------------


def run(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


def test_the_command_prints_a_table_or_json(shell, tmp_path):
    write_mesh(shell.mesh, tmp_path / "m.obj")
    write_mesh(shell.gauss, tmp_path / "s.obj")
    result = run("inspect", tmp_path / "m.obj", tmp_path / "s.obj", "--gauss")
    assert result.exit_code == 0, result.output
    for words in ("counts", "Euler characteristic", "planarity / mean edge", "pair", "curvature"):
        assert words in result.stdout
    result = run("inspect", tmp_path / "m.obj", tmp_path / "s.obj", "--gauss", "--json")
    data = json.loads(result.stdout)
    assert data["exit_code"] == 0 and data["name"] == "m.obj" and data["pair"]["type"] == "vertex"
    assert data["counts"]["faces"] == shell.mesh.n_faces
    write_mesh(CUBE, tmp_path / "cube.off")  # its offsets outwards have no limit
    result = run("inspect", tmp_path / "cube.off", tmp_path / "cube.off", "--gauss", "--json")
    assert json.loads(result.stdout)["curvature"]["offset without flips to"] is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 7\n", "bad.obj, line 4: "),
        ("v 0 0 0\nv 1 x 0\n", "bad.obj, line 2: "),
        ("v 0 0 0\n", "no face"),
    ],
)
def test_unreadable_files_are_code_2_and_named(tmp_path, text, said):
    (tmp_path / "bad.obj").write_text(text)
    result = run("inspect", tmp_path / "bad.obj")
    assert (result.exit_code, result.stdout) == (2, "")
    assert said in result.stderr and "Traceback" not in result.stderr


def test_other_mistakes_are_code_2(shell, tmp_path):
    write_mesh(shell.mesh, tmp_path / "m.obj")
    write_mesh(CUBE, tmp_path / "cube.obj")
    mesh = tmp_path / "m.obj"
    for words in (
        (tmp_path / "nowhere.obj",),
        (tmp_path / "m.stl",),
        (mesh, "--gauss"),
        (mesh, tmp_path / "cube.obj"),
        (mesh, "--weld", "1e6"),
        (),
    ):
        result = run("inspect", *words)
        assert result.exit_code == 2, words
        assert "Traceback" not in result.stderr

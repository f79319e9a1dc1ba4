"""OBJ and OFF: exact round trips, the dialects in use, and errors that name file and line."""

from pathlib import Path

import numpy as np
import pytest

from phexfab.errors import MeshError
from phexfab.mesh import (
    PolyMesh,
    read_mesh,
    read_obj,
    read_off,
    weld,
    write_mesh,
    write_obj,
    write_off,
)
from phexfab.mesh.measures import relative_planarity, simple_faces
from phexfab.testing import assert_offset, assert_planar, assert_same_mesh

PUBLIC = Path(__file__).resolve().parents[2].parent / "shared" / "data"
TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"


def awkward():
    """Numbers that lose bits when written with fewer than 17 digits, and faces of 3, 5, 6 sides."""
    rng = np.random.default_rng(1)
    points = rng.normal(size=(12, 3)) * 10.0 ** rng.integers(-300, 300, (12, 1))
    points[:2] = [[0.1, -0.0, 5e-324], [1 / 3, 2**53 + 2, -1e308]]
    return PolyMesh.from_faces(points, [[0, 1, 2], [3, 4, 5, 6, 7], [0, 11, 10, 9, 8, 2]])


def written(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def message(verb, *arguments, **options):
    with pytest.raises(MeshError) as caught:
        verb(*arguments, **options)
    return str(caught.value)


@pytest.mark.parametrize("ending", [".obj", ".off", ".OBJ"])
def test_what_is_written_is_read_back_to_the_last_bit(tmp_path, ending):
    path = tmp_path / f"mesh{ending}"
    mesh = awkward()
    write_mesh(mesh, path)
    back = read_mesh(path)
    assert_same_mesh(back, mesh)
    assert np.signbit(back.vertices[0, 1])
    first = path.read_bytes()
    write_mesh(back, path)
    assert path.read_bytes() == first


def test_a_mesh_without_faces_survives(tmp_path):
    points = PolyMesh.from_faces(np.eye(3), [])
    for ending in (".obj", ".off"):
        write_mesh(points, tmp_path / f"points{ending}")
        assert_same_mesh(read_mesh(tmp_path / f"points{ending}"), points)


def test_the_dialects_of_obj(tmp_path):
    text = """\ufeff# a comment
    mtllib none.mtl
    o thing
    v 0 0 0 1.0 0.5 0.25
    v 1 0 0 0.1 0.2 0.3   # colours are passed over
    v 1 1 0
    vt 0 0
    vn 0 0 1
    f 1/1/1 2//1 3/1
    v 0 1 0
    f -4 -3 \\
      -2 -1
    """
    mesh = read_obj(written(tmp_path / "dialects.obj", text))
    assert [face.tolist() for face in mesh.faces] == [[0, 1, 2], [0, 1, 2, 3]]
    assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


def test_the_dialects_of_off(tmp_path):
    coloured = (
        "COFF # with colours\n\n3 1 0\n0 0 0 255 0 0 255\n1 0 0 0 0 0 0\n0 1 0\n3 0 1 2 9 9 9\n"
    )
    bare = "3 1\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\nand then anything\n"
    inline = "OFF 3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    meshes = [
        read_off(written(tmp_path / f"{k}.off", text))
        for k, text in enumerate((coloured, bare, inline))
    ]
    assert meshes[0].vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    for mesh in meshes:
        assert_same_mesh(mesh, meshes[0])


def test_off_files_that_count_from_one(tmp_path):
    points = "OFF\n4 1 0\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
    all_used = written(tmp_path / "all.off", points + "4 1 2 3 4\n")
    assert read_off(all_used).face(0).tolist() == [0, 1, 2, 3]
    assert "line 7: a face names vertex 4, but vertices run from 0 to 3" in message(
        read_off, all_used, first=0
    )
    unclear = written(tmp_path / "unclear.off", points + "3 1 2 3\n")
    assert read_off(unclear).face(0).tolist() == [1, 2, 3]
    assert read_off(unclear, first=1).face(0).tolist() == [0, 1, 2]
    mixed = written(tmp_path / "mixed.off", points + "3 0 2 4\n")
    assert "names vertex 4" in message(read_off, mixed)
    assert "names vertex 0, but vertices run from 1 to 4" in message(read_off, mixed, first=1)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("v 0 0\n", 'line 1: "0 0" does not begin with three finite numbers'),
        ("v 0 0 nan\n", "line 1: .* three finite numbers"),
        ("v 0 x 0\n", 'line 1: "0 x 0"'),
        (TRIANGLE + "f 1 2\n", "line 4: a face has 2 corners"),
        (TRIANGLE + "f 0 1 2\n", "line 4: OBJ counts vertices from 1, not from 0"),
        (TRIANGLE + "\nf 1 2 4\n", "line 5: a face names vertex 4, but vertices run from 1 to 3"),
        (TRIANGLE + "f -4 1 2\n", "line 4: a face names vertex 0,"),
        (TRIANGLE + "f 1 2 3.5\n", 'line 4: "3.5" is not a whole number'),
    ],
)
def test_wrong_obj_files_are_refused_by_line(tmp_path, text, said):
    path = written(tmp_path / "wrong.obj", text)
    with pytest.raises(MeshError, match=said) as caught:
        read_obj(path)
    assert str(caught.value).startswith(str(path))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "line 1: the numbers of vertices and faces are missing"),
        ("PLY\n", 'line 1: "PLY" does not begin an OFF text file'),
        ("4OFF\n1 0 0\n0 0 0 0\n", 'line 1: "4OFF"'),
        ("OFF BINARY\n", 'line 1: "OFF BINARY"'),
        ("OFF\n3\n", "line 2: the numbers of vertices and faces are missing"),
        ("OFF\n-3 1 0\n", "line 2: -3 is no number"),
        ("OFF\n2 1 0\n0 0 0\n", "ends after 1 of 2 vertices and 0 of 1 faces"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n", "ends after 3 of 3 vertices and 0 of 1 faces"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1\n", "line 6: a face of 3 corners with 2"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n2 0 1\n", "line 6: a face of 2 corners"),
        ("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 -1 2\n", "line 6: a face names vertex -1"),
    ],
)
def test_wrong_off_files_are_refused_by_line(tmp_path, text, said):
    path = written(tmp_path / "wrong.off", text)
    with pytest.raises(MeshError, match=said) as caught:
        read_off(path)
    assert str(caught.value).startswith(str(path))


def test_files_that_are_not_there_and_formats_that_are_not_known(tmp_path):
    assert "cannot be read (No such file" in message(read_obj, tmp_path / "none.obj")
    assert 'unknown mesh format ".stl"; use .obj or .off' in message(read_mesh, "mesh.stl")
    assert 'unknown mesh format ""' in message(write_mesh, awkward(), tmp_path / "mesh")
    away = tmp_path / "no" / "such" / "folder.obj"
    assert "cannot be written" in message(write_obj, awkward(), away)


@pytest.mark.parametrize("write", [write_obj, write_off])
def test_a_write_that_fails_leaves_the_old_file(tmp_path, write, monkeypatch):
    path = written(tmp_path / "mesh", "old")
    broken = PolyMesh.from_faces([[0, 0, 0], [1, 0, 0], [0, np.inf, 0]], [[0, 1, 2]])
    assert "vertex 2 is [ 0. inf  0.]; only finite coordinates" in message(write, broken, path)

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", full)
    assert "cannot be written (No space left on device)" in message(write, awkward(), path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def loose_grid(shift=0.0):
    """A 3×3 grid of unit squares, each with its own four corners, moved apart by up to shift."""
    rng = np.random.default_rng(2)
    unit = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    points = np.concatenate([unit + np.array([i, j, 0]) for j in range(3) for i in range(3)])
    points += shift * rng.uniform(-1, 1, points.shape) / np.sqrt(12)
    return PolyMesh.from_faces(points, np.arange(36).reshape(9, 4))


def test_welding_joins_what_is_close_and_keeps_faces():
    exact = weld(loose_grid(), 0.0)
    assert len(exact.vertices) == 16
    assert exact.sides.tolist() == [4] * 9
    loose = loose_grid(1e-3)
    assert len(weld(loose, 0.0).vertices) == 36
    joined = weld(loose, 2e-3)
    assert len(joined.vertices) == 16
    assert np.abs(joined.vertices - exact.vertices).max() < 1e-3
    assert np.array_equal(joined.corners, exact.corners)
    # Vertices stay where the first of them was: nothing is averaged.
    assert all((loose.vertices == vertex).all(axis=1).any() for vertex in joined.vertices)


def test_welding_drops_repeated_corners_and_unused_vertices():
    points = [[9, 9, 9], [0, 0, 0], [1, 0, 0], [1, 0, 1e-9], [0, 1, 0], [5, 0, 0], [5, 5, 0]]
    mesh = PolyMesh.from_faces(points, [[1, 2, 3, 4], [2, 5, 6]])
    welded = weld(mesh, 1e-6)
    assert [face.tolist() for face in welded.faces] == [[0, 1, 2], [1, 3, 4]]
    assert welded.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 0, 0], [5, 5, 0]]


def test_welding_refuses_what_would_spoil_the_mesh():
    grid = loose_grid()
    for tolerance in (-1.0, 0.1, np.nan):
        assert "between 0 and a tenth of the mean edge, 0.1" in message(weld, grid, tolerance)
    sliver = PolyMesh.from_faces(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 2, 0], [2, 2, 1e-5], [1, 0, 0]],
        [[0, 1, 2], [3, 4, 5]],
    )
    said = message(weld, sliver, 1e-3)
    assert "leaves face 1 with 2 corners; lower the tolerance" in said


def public(name):
    path = PUBLIC / name
    if not path.exists():
        pytest.skip(f"{name} is not beside the repository in shared/data")
    return read_off(path)


def test_a_public_file_of_900_hexagons():
    mesh = public("enneper2.off")
    assert (len(mesh.vertices), mesh.n_faces) == (1920, 900)
    assert simple_faces(mesh).all()
    assert 1e-5 < relative_planarity(mesh).max() < 1e-4


def test_a_public_file_that_is_stored_unwelded():
    mesh = public("catenoid3.off")
    assert (len(mesh.vertices), mesh.n_faces) == (9900, 1650)
    assert len(weld(mesh, 1e-2).vertices) == 3400
    assert_planar(mesh, 5e-5)


def test_a_public_file_that_counts_from_one_is_a_koebe_mesh():
    mesh = public("hexagonalminimal_plusgauss.off")
    assert (len(mesh.vertices), mesh.n_faces) == (400, 180)
    assert_offset(mesh, "edge", 1e-10)

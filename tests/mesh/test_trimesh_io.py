"""Triangle meshes from files of four kinds, and what is refused."""

import struct

import numpy as np
import pytest

from phexfab.errors import MeshError
from phexfab.mesh.io import write_mesh
from phexfab.mesh.polymesh import PolyMesh
from phexfab.mesh.trimesh_io import check_manifold, read_triangles

POINTS = np.array([[0, 0, 0], [1, 0, 0.25], [1, 1, 0], [0, 1, 0.5], [2, 0.5, 0]], float)
FACES = [[0, 1, 2], [0, 2, 3], [1, 4, 2]]


def corners(mesh):
    """Return triangles as corner points, each begun at its lowest, in order."""
    rows = []
    for face in mesh.vertices[mesh.corners.reshape(-1, 3)].round(9).tolist():
        first = face.index(min(face))
        rows.append(face[first:] + face[:first])
    return sorted(rows)


WANTED = corners(PolyMesh.from_faces(POINTS, FACES))


def stl_text(way="vertex"):
    rows = ["solid film"]
    for face in FACES:
        rows += ["facet normal 0 0 0", " outer loop"]
        rows += [f"  {way} {x} {y} {z}" for x, y, z in POINTS[face]]
        rows += [" endloop", "endfacet"]
    return "\n".join([*rows, "endsolid film", ""]).encode()


def stl_binary(head=b"solid, but binary"):
    data = head.ljust(80, b" ") + struct.pack("<I", len(FACES))
    for face in FACES:
        data += struct.pack("<12fH", 0, 0, 0, *POINTS[face].ravel(), 0)
    return data


def ply(kind, sides="uchar", index="int", extra=True):
    order = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}[kind]
    head = ["ply", f"format {kind} 1.0", "comment of a film", f"element vertex {len(POINTS)}"]
    head += ["property double x", "property float y", "property double z"]
    head += ["property uchar red"] * extra
    head += [f"element face {len(FACES)}", f"property list {sides} {index} vertex_indices"]
    head += ["property float quality"] * extra
    data = ("\n".join([*head, "end_header"]) + "\n").encode()
    for x, y, z in POINTS:
        row = [x, y, z, *([7] if extra else [])]
        if order:
            data += struct.pack(order + "dfd" + "B" * extra, *row)
        else:
            data += (" ".join(map(str, row)) + "\n").encode()
    for face in FACES:
        row = [3, *face, *([0.5] if extra else [])]
        if order:
            data += struct.pack(order + "B3i" + "f" * extra, *row)
        else:
            data += (" ".join(map(str, row)) + "\n").encode()
    return data


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("text.stl", stl_text()),
        ("capital.STL", stl_text("VERTEX")),
        ("binary.stl", stl_binary()),
        ("plain.stl", stl_binary(b"")),
        ("text.ply", ply("ascii")),
        ("little.ply", ply("binary_little_endian")),
        ("big.ply", ply("binary_big_endian")),
        ("bare.ply", ply("binary_little_endian", extra=False)),
    ],
)
def test_stl_and_ply_are_read(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    mesh = read_triangles(tmp_path / name)
    assert len(mesh.vertices) == 5
    assert corners(mesh) == WANTED


@pytest.mark.parametrize("ending", [".obj", ".off"])
def test_obj_and_off_are_read_and_quads_split_along_the_shorter_diagonal(tmp_path, ending):
    points = POINTS.copy()
    points[2] = [0.8, 0.8, 0]
    write_mesh(PolyMesh.from_faces(points, [[0, 1, 2, 3], [1, 4, 2]]), tmp_path / f"film{ending}")
    mesh = read_triangles(tmp_path / f"film{ending}")
    assert (mesh.sides == 3).all() and mesh.n_faces == 3
    assert corners(mesh) == corners(PolyMesh.from_faces(points, [[0, 1, 2], [0, 2, 3], [1, 4, 2]]))


def test_near_vertices_are_made_one(tmp_path):
    points = np.vstack([POINTS, POINTS[[1, 2]] + 1e-7])
    mesh = PolyMesh.from_faces(points, [[0, 1, 2], [0, 2, 3], [5, 4, 6]])
    write_mesh(mesh, tmp_path / "film.obj")
    assert len(read_triangles(tmp_path / "film.obj").vertices) == 5


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        ([[0, 1, 2], [0, 2, 3], [1, 2, 4]], "1 edges have two faces on the same side"),
        ([[0, 1, 2], [0, 1, 3], [0, 1, 4]], "2 edges have two faces on the same side"),
        ([[0, 1, 2], [2, 3, 4]], "sheets touch at 1 vertices"),
        ([[0, 1, 4, 2, 3]], "1 faces have more than four corners, first face 0 with 5"),
    ],
)
def test_what_is_no_oriented_manifold_of_triangles_is_refused(tmp_path, faces, message):
    write_mesh(PolyMesh.from_faces(POINTS, faces), tmp_path / "film.off")
    with pytest.raises(MeshError, match=message) as refused:
        read_triangles(tmp_path / "film.off")
    assert "film.off" in str(refused.value)


def test_a_closed_mesh_is_a_manifold():
    check_manifold(PolyMesh.from_faces(np.eye(4, 3), [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]))


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.xyz", b"", "unknown mesh format"),
        ("a.stl", b"\0" * 100, "no STL file"),
        ("a.stl", stl_binary()[:-3], "line|no STL file|no faces"),
        ("a.stl", b"solid\nfacet\nvertex 1 2\n", "line 3"),
        ("a.stl", b"solid\nvertex 1 2 3\nvertex 1 2 3\n", "ends inside a facet"),
        ("a.stl", b"solid\nendsolid\n", "no faces"),
        ("a.ply", b"plyx", "no PLY file"),
        ("a.ply", ply("ascii").replace(b"double x", b"triple x"), "line 5"),
        ("a.ply", ply("ascii").replace(b"property float y\n", b""), "with x, y and z"),
        ("a.ply", ply("ascii").replace(b"vertex_indices", b"corners"), "vertex_indices"),
        ("a.ply", ply("ascii").replace(b"ascii", b"morse"), "encoding"),
        ("a.ply", ply("ascii")[:-9], "ends early"),
        ("a.ply", ply("binary_little_endian")[:-2], "ends early"),
        ("a.ply", ply("ascii").replace(b"0.25", b"nan"), "vertex 1 has"),
        ("a.ply", ply("ascii").replace(b"\n3 0 1 2", b"\n3 0 1 9"), "names vertex 9"),
    ],
)
def test_malformed_files_are_refused_by_name(tmp_path, name, data, message):
    (tmp_path / name).write_bytes(data)
    with pytest.raises(MeshError, match=message) as refused:
        read_triangles(tmp_path / name)
    assert name in str(refused.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    for name in ("no.stl", "no.ply", "no.obj"):
        with pytest.raises(MeshError, match="cannot be read"):
            read_triangles(tmp_path / name)

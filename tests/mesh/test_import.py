"""Meshes from elsewhere: four formats read alike, mended with a report, or refused by place."""

import json
import re
import struct
from itertools import pairwise

import numpy as np
import pytest

from phexfab.errors import MeshError
from phexfab.mesh.clean import clean
from phexfab.mesh.half_edges import border_loops, twins
from phexfab.mesh.io import write_mesh
from phexfab.mesh.measures import area_vectors
from phexfab.mesh.polygons import import_polygons, read_polygons
from phexfab.mesh.polymesh import PolyMesh
from phexfab.testing import assert_same_mesh

POINTS = np.array(
    [[0, 0, 0], [1, 0, 0], [2, 0, 0.125], [0, 1, 0], [1, 1, 0], [2, 1, 0], [3, 0.5, 1 / 3]]
)
FACES = [[0, 1, 4, 3], [1, 2, 5, 4], [2, 6, 5]]


def mixed():
    return PolyMesh.from_faces(POINTS, FACES)


def ply(order, mesh=None):
    """A PLY file with a colour, an element between and a face property, as text or binary."""
    mesh = mesh or mixed()
    head = (
        f"ply\nformat {order} 1.0\ncomment made here\nelement vertex {len(mesh.vertices)}\n"
        "property double x\nproperty double y\nproperty double z\nproperty uchar red\n"
        "element material 1\nproperty float shine\n"
        f"element face {mesh.n_faces}\nproperty list uchar int vertex_indices\n"
        "property short layer\nend_header\n"
    ).encode()
    if order == "ascii":
        rows = ["{:.17g} {:.17g} {:.17g} 7".format(*p) for p in mesh.vertices] + ["0.5"]
        rows += [" ".join(map(str, [len(f), *f, 3])) for f in mesh.faces]
        return head + ("\n".join(rows) + "\n").encode()
    mark = "<" if order == "binary_little_endian" else ">"
    body = b"".join(struct.pack(mark + "dddB", *p, 7) for p in mesh.vertices)
    body += struct.pack(mark + "f", 0.5)
    for face in mesh.faces:
        body += struct.pack(f"{mark}B{len(face)}ih", len(face), *face, 3)
    return head + body


def compas(version=2, points=POINTS, faces=FACES):
    """What COMPAS writes; keys with gaps, as after vertices were deleted."""
    vertex = {str(10 * k): dict(zip("xyz", p, strict=True)) for k, p in enumerate(points.tolist())}
    data = {
        "default_vertex_attributes": {"x": 0.0, "y": 0.0, "z": 0.0},
        "vertex": vertex,
        "face": {str(k): [10 * v for v in face] for k, face in enumerate(faces)},
        "facedata": {},
        "edgedata": {},
    }
    if version == 2:
        return {"dtype": "compas.datastructures/Mesh", "data": data, "guid": "0", "name": "Mesh"}
    return {"compas": "1.17", "datatype": "compas.datastructures.Mesh", "value": data}


def message(verb, *arguments, **options):
    with pytest.raises(MeshError) as caught:
        verb(*arguments, **options)
    return str(caught.value)


@pytest.mark.parametrize("order", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_ply_of_either_byte_order(tmp_path, order):
    path = tmp_path / "mesh.ply"
    path.write_bytes(ply(order))
    assert_same_mesh(read_polygons(path), mixed())


@pytest.mark.parametrize("ending", [".obj", ".off"])
def test_obj_and_off(tmp_path, ending):
    path = tmp_path / f"mesh{ending}"
    write_mesh(mixed(), path)
    mesh, report = import_polygons(path)
    assert_same_mesh(mesh, mixed())
    assert report.sides == ((3, 1), (4, 2)) and not report.mended
    assert (report.vertices, report.faces, report.pieces, report.borders) == (7, 3, 1, 1)


@pytest.mark.parametrize("version", [1, 2])
def test_compas_json(tmp_path, version):
    path = tmp_path / "mesh.json"
    path.write_text(json.dumps(compas(version)))
    assert_same_mesh(read_polygons(path), mixed())
    path.write_text(json.dumps([compas(version)]))
    assert_same_mesh(read_polygons(path), mixed())


def test_compas_defaults_and_errors(tmp_path):
    path = tmp_path / "mesh.json"

    def said(change):
        data = compas()
        change(data["data"])
        path.write_text(json.dumps(data))
        return message(read_polygons, path)

    def flat(data):
        for attributes in data["vertex"].values():
            del attributes["z"]

    data = compas()
    flat(data["data"])
    path.write_text(json.dumps(data))
    assert not read_polygons(path).vertices[:, 2].any()
    assert "face 1 names vertex 5, which there is not" in said(
        lambda d: d["face"].update({"1": [10, 20, 5]})
    )
    assert "face 2 has 2 corners; 3 are needed" in said(lambda d: d["face"].update({"2": [10, 20]}))
    assert "vertex 30 has y = 'a', no number" in said(lambda d: d["vertex"]["30"].update(y="a"))
    assert "vertex 30 is [" in said(lambda d: d["vertex"]["30"].update(y=float("nan")))
    path.write_text("{")
    assert "no JSON file" in message(read_polygons, path)
    path.write_text('{"data": {"vertex": {}}}')
    assert 'there is no object with "vertex" and "face"' in message(read_polygons, path)
    assert "cannot be read" in message(read_polygons, tmp_path / "none.json")
    assert 'unknown mesh format ".stp"; use .obj, .off, .ply, .json' in message(
        read_polygons, "mesh.stp"
    )


def test_off_that_counts_from_one(tmp_path):
    path = tmp_path / "mesh.off"
    rows = ["OFF", "7 3 0", *(" ".join(map(repr, p)) for p in POINTS.tolist())]
    rows += [" ".join(map(str, [len(f), *(v + 1 for v in f)])) for f in FACES]
    path.write_text("\n".join(rows))
    assert_same_mesh(read_polygons(path), mixed())


def loose(noise=0.0):
    """Every face with its own vertices, and two vertices that nobody uses."""
    points = np.concatenate([POINTS[face] for face in FACES])
    points = points + noise * np.random.default_rng(0).uniform(-1, 1, points.shape)
    ends = np.cumsum([0, *map(len, FACES)])
    faces = [range(a, b) for a, b in pairwise(ends)]
    return PolyMesh.from_faces(np.vstack([points, [[9, 9, 9], [8, 8, 8]]]), faces)


def test_unwelded_vertices_are_joined_and_unused_ones_dropped():
    mesh, report = clean(loose())
    assert [len(mesh.vertices), mesh.n_faces] == [7, 3]
    assert (report.welded, report.unused, report.pieces, report.mended) == (4, 2, 1, True)
    assert np.allclose(area_vectors(mesh), area_vectors(mixed()), atol=1e-15)
    apart, report = clean(loose(1e-3), weld_within=0)
    assert (len(apart.vertices), report.pieces) == (11, 3)
    assert len(clean(loose(1e-3), weld_within=1e-2)[0].vertices) == 7


def test_an_open_seam_is_refused_with_the_weld_that_closes_it():
    said = message(clean, loose(1e-3))
    assert re.search(r"an open seam: 4 pairs of border vertices .* at \[0\.999, ", said)
    enough = float(re.search(r"\(weld_within\) = (\S+) ", said)[1])
    closed, report = clean(loose(1e-3), weld_within=enough)
    assert (len(closed.vertices), report.pieces) == (7, 1)
    # Vertices that are near because an edge between them is short are no seam.
    short = np.vstack([POINTS, POINTS[3] + [0, 0.01, 0]])
    assert clean(PolyMesh.from_faces(short, [[0, 1, 4, 7, 3], *FACES[1:]]))[1].pieces == 1


@pytest.mark.parametrize("ending", [".obj", ".off"])
def test_unwelded_files_of_six_digits_are_joined(tmp_path, ending):
    # Every face with its own corners, as six digits write places that differ by rounding.
    whole = grid(12)
    turn = np.linalg.qr(np.random.default_rng(2).normal(size=(3, 3)))[0]
    points = (30 * whole.vertices @ turn.T + 700)[whole.corners]
    points += np.random.default_rng(3).normal(size=points.shape) * 1e-4
    rows = [" ".join(f"{v:.6g}" for v in p) for p in points]
    count = range(0, len(rows), 4)
    if ending == ".obj":
        lines = [f"v {row}" for row in rows]
        lines += [f"f {k + 1} {k + 2} {k + 3} {k + 4}" for k in count]
    else:
        lines = ["OFF", f"{len(rows)} {len(count)} 0", *rows]
        lines += [f"4 {k} {k + 1} {k + 2} {k + 3}" for k in count]
    path = tmp_path / f"mesh{ending}"
    path.write_text("\n".join(lines))
    mesh, report = import_polygons(path)
    assert (len(mesh.vertices), report.pieces, report.borders) == (len(whole.vertices), 1, 1)


def test_short_edges_are_not_welded_away():
    # Six digits of 1e6 would be 20; the shortest edge is 9.
    mesh = grid(3)
    points = mesh.vertices * [30_000, 9.0, 1] + [1e6, 0, 0]
    assert len(clean(PolyMesh.from_faces(points, mesh.faces))[0].vertices) == len(points)


def test_corners_that_fall_together_are_dropped():
    points = np.vstack([POINTS, POINTS[1] + [0, 1e-9, 0]])
    mesh, report = clean(PolyMesh.from_faces(points, [[0, 1, 7, 4, 3], *FACES[1:]]))
    assert (report.welded, report.corners_dropped) == (1, 1)
    assert mesh.sides.tolist() == [4, 4, 3]


def grid(n=4):
    index = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    faces = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], -1)
    x, y = np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0))
    return PolyMesh.from_faces(np.stack([x, y, 0 * x], -1).reshape(-1, 3), faces.reshape(-1, 4))


def flipped(mesh, faces):
    rows = [f[::-1] if k in faces else f for k, f in enumerate(mesh.faces)]
    return PolyMesh.from_faces(mesh.vertices, rows)


def test_flipped_patches_are_turned_and_reported():
    bad = flipped(grid(), {5, 6, 9})
    mesh, report = clean(bad)
    assert report.turned == (5, 6, 9)
    assert (area_vectors(mesh)[:, 2] > 0).all()
    assert all(set(a) == set(b) for a, b in zip(mesh.faces, bad.faces, strict=True))
    said = message(clean, bad, turn=False)
    assert "3 faces are oriented against their neighbours, first face 5 at [1.5, 1.5, 0.0]" in said


def test_every_piece_keeps_the_way_of_its_larger_part():
    one, two = grid(3), grid(3)
    both = PolyMesh.from_faces(
        np.vstack([one.vertices, two.vertices + np.array([0, 0, 5])]),
        [*one.faces, *(f[::-1] + len(one.vertices) for f in two.faces)],
    )
    mesh, report = clean(flipped(both, {0, 10, 11}))
    assert report.turned == (0, 10, 11) and report.pieces == 2
    assert np.sign(area_vectors(mesh)[:, 2]).tolist() == [1.0] * 9 + [-1.0] * 9


def test_a_band_with_one_side_is_refused():
    n = 12
    angle = 2 * np.pi * np.arange(n) / n
    arm = np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)
    across = np.cos(angle / 2)[:, None] * arm + np.sin(angle / 2)[:, None] * [0, 0, 1]
    points = np.vstack([3 * arm - across, 3 * arm + across])
    faces = [[k, k + 1, k + 1 + n, k + n] for k in range(n - 1)] + [[n - 1, n, 0, 2 * n - 1]]
    said = message(clean, PolyMesh.from_faces(points, faces))
    assert "12 faces are on a piece with one side only" in said and "first face 0 at [" in said


@pytest.mark.parametrize(
    ("faces", "said"),
    [
        ([[0, 1, 4, 1, 3]], "1 faces have a vertex more than once, first face 0 with vertex 1 at"),
        (
            [*FACES, [4, 0, 1, 3]],
            "1 faces have the same corners as another, first face 3 as face 0",
        ),
        (
            [*FACES, [1, 4, 6]],
            "1 edges have more than two faces, first the edge of vertices 1 and 4 at "
            "[1.0, 0.5, 0.0] with faces [0, 1, 3]",
        ),
        ([[0, 1, 3], [1, 2, 5]], "sheets touch at 1 vertices without sharing an edge"),
    ],
)
def test_what_is_no_manifold_is_refused_by_place(faces, said):
    assert said in message(clean, PolyMesh.from_faces(POINTS, faces), name="roof.obj")


def test_messages_begin_with_the_file(tmp_path):
    path = tmp_path / "empty.off"
    path.write_text("OFF\n0 0 0\n")
    assert message(read_polygons, path) == f"{path}: the file has no faces"
    path = tmp_path / "two.ply"
    two = ply("ascii").replace(b"3 2 6 5 3\n", b"2 2 6 3\n")
    path.write_bytes(two)
    assert message(read_polygons, path) == f"{path}: face 2 has 2 corners; 3 are needed"
    path = tmp_path / "short.ply"
    path.write_bytes(ply("binary_big_endian")[:-9])
    assert "ends early" in message(read_polygons, path)


def test_twins_and_border_loops():
    mesh = grid(3)
    other = twins(mesh)
    inner = other >= 0
    assert inner.sum() == 24 and np.array_equal(other[other[inner]], np.flatnonzero(inner))
    (loop,) = border_loops(mesh)
    assert loop.tolist() == [0, 1, 2, 3, 7, 11, 15, 14, 13, 12, 8, 4]
    ring = PolyMesh.from_faces(mesh.vertices, [f for k, f in enumerate(mesh.faces) if k != 4])
    assert sorted(map(len, border_loops(ring))) == [4, 12]

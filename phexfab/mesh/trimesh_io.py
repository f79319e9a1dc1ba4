"""Triangle meshes from files: OBJ, OFF, PLY and STL, welded, quads split, manifolds only."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from phexfab.errors import MeshError
from phexfab.mesh.io import read_obj, read_off, same_place, weld
from phexfab.mesh.polymesh import PolyMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_PLY_TYPES = {
    "char": "i1", "int8": "i1", "uchar": "u1", "uint8": "u1",
    "short": "i2", "int16": "i2", "ushort": "u2", "uint16": "u2",
    "int": "i4", "int32": "i4", "uint": "u4", "uint32": "u4",
    "float": "f4", "float32": "f4", "double": "f8", "float64": "f8",
}  # fmt: skip
_STL_RECORD = np.dtype([("normal", "<f4", 3), ("corner", "<f4", (3, 3)), ("extra", "<u2")])


def read_triangles(path: str | os.PathLike[str]) -> PolyMesh:
    """Read a triangle mesh; the file's ending, ``.obj``, ``.off``, ``.ply`` or ``.stl``, tells how.

    Vertices nearer than `same_place` says are made one, quadrilaterals are split along their
    shorter diagonal.

    Raises
    ------
    MeshError
        If the ending is another or the file malformed; if faces have more than four corners, edges
        have two faces on one side, or sheets touch at a vertex: the message counts them and names
        the first place.
    """
    name, ending = os.fspath(path), Path(path).suffix.lower()
    readers: dict[str, Callable[[str], PolyMesh]] = {
        ".obj": read_obj,
        ".off": read_off,
        ".ply": read_ply,
        ".stl": read_stl,
    }
    if ending not in readers:
        raise MeshError(f'{name}: unknown mesh format "{ending}"; use {", ".join(readers)}')
    mesh = readers[ending](name)
    if not mesh.n_faces:
        raise MeshError(f"{name}: the file has no faces")
    try:
        mesh = weld(mesh, same_place(mesh))
    except MeshError as error:
        raise MeshError(f"{name}: {error}") from error
    mesh = _split(mesh, name)
    check_manifold(mesh, name)
    return mesh


def check_manifold(mesh: PolyMesh, name: str = "the mesh") -> None:
    """Refuse a mesh that is no consistently oriented manifold with border.

    Raises
    ------
    MeshError
        With the number of edges that have two faces on one side, or of vertices at which sheets
        touch, and the first place.
    """
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    n = len(mesh.vertices)
    key = tail * n + head
    order = np.argsort(key, kind="stable")
    twice = np.flatnonzero(np.diff(key[order]) == 0)
    if len(twice):
        at = order[twice[0]]
        place = mesh.vertices[[tail[at], head[at]]].mean(axis=0).round(3).tolist()
        raise MeshError(
            f"{name}: {len(twice)} edges have two faces on the same side, first the edge of "
            f"vertices {tail[at]} and {head[at]} at {place}: neighbours are oriented against each "
            "other, or more than two faces meet; orient the faces alike and part the sheets"
        )
    # Corners around a vertex hang together through the edges that leave it and arrive at it.
    place_of = np.minimum(np.searchsorted(key[order], head * n + tail), len(order) - 1)
    twin = order[place_of]
    has = key[twin] == head * n + tail
    here, there = np.flatnonzero(has), mesh.next_corner[twin[has]]
    links = coo_array((np.ones(len(here)), (here, there)), shape=(len(key), len(key)))
    _, fan = connected_components(links, directed=False)
    _, first = np.unique(fan, return_index=True)
    fans = np.bincount(mesh.corners[first], minlength=n)
    torn = np.flatnonzero(fans > 1)
    if len(torn):
        raise MeshError(
            f"{name}: sheets touch at {len(torn)} vertices without sharing an edge, first at "
            f"{mesh.vertices[torn[0]].round(3).tolist()}; part them there"
        )


def _split(mesh: PolyMesh, name: str) -> PolyMesh:
    large = np.flatnonzero(mesh.sides > 4)
    if len(large):
        place = mesh.polygon(int(large[0])).mean(axis=0).round(3).tolist()
        raise MeshError(
            f"{name}: {len(large)} faces have more than four corners, first face {large[0]} with "
            f"{mesh.sides[large[0]]} at {place}; triangulate the mesh"
        )
    three = mesh.starts[:-1][mesh.sides == 3][:, None] + np.arange(3)
    a, b, c, d = mesh.corners[mesh.starts[:-1][mesh.sides == 4][:, None] + np.arange(4)].T
    x = mesh.vertices
    first = np.linalg.norm(x[a] - x[c], axis=1) <= np.linalg.norm(x[b] - x[d], axis=1)
    one = np.where(first, [a, b, c], [a, b, d]).T
    two = np.where(first, [a, c, d], [b, c, d]).T
    triangles = np.concatenate([mesh.corners[three], one, two]).astype(np.int64)
    return PolyMesh(x, triangles.ravel(), 3 * np.arange(len(triangles) + 1))


# -- STL -----------------------------------------------------------------------------------------


def read_stl(path: str | os.PathLike[str]) -> PolyMesh:
    """Read an STL file, text or binary; equal corners are made one vertex.

    Raises
    ------
    MeshError
        If the file cannot be read, ends early, or a coordinate is not finite.
    """
    name = os.fspath(path)
    data = _bytes(name)
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else -1
    # Binary files may begin with "solid" too: their length is what tells.
    if count >= 0 and len(data) == 84 + 50 * count:
        corners = np.frombuffer(data, _STL_RECORD, count, 84)["corner"].astype(float)
    elif data.lstrip()[:5].lower() == b"solid":
        corners = _stl_text(data, name)
    else:
        raise MeshError(
            f'{name}: {len(data)} bytes are no STL file: it does not begin with "solid", and '
            f"{max(count, 0)} triangles would need {84 + 50 * max(count, 0)} bytes"
        )
    if not np.isfinite(corners).all():
        bad = int(np.flatnonzero(~np.isfinite(corners).all(axis=(1, 2)))[0])
        raise MeshError(f"{name}: triangle {bad} has a coordinate that is not finite")
    points, index = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces = index.reshape(-1).astype(np.int64)
    return PolyMesh(points, faces, 3 * np.arange(len(corners) + 1))


def _stl_text(data: bytes, name: str) -> FloatArray:
    rows: list[list[float]] = []
    for number, line in enumerate(data.decode("ascii", "replace").splitlines(), 1):
        words = line.split()
        if words and words[0].lower() == "vertex":
            try:
                row = [float(word) for word in words[1:4]]
            except ValueError:
                row = []
            if len(row) != 3:
                raise MeshError(f'{name}, line {number}: "{line.strip()}" is no vertex')
            rows.append(row)
        elif words and words[0].lower() == "endloop" and len(rows) % 3:
            raise MeshError(f"{name}, line {number}: a facet does not have three vertices")
    if len(rows) % 3:
        raise MeshError(f"{name}: the file ends inside a facet, after {len(rows)} vertices")
    return np.array(rows, float).reshape(-1, 3, 3)


# -- PLY -----------------------------------------------------------------------------------------


def read_ply(path: str | os.PathLike[str]) -> PolyMesh:
    """Read vertices and faces of a PLY file, text or binary; all other properties are passed over.

    Raises
    ------
    MeshError
        If the file cannot be read, its header is not understood, or it ends early.

    References
    ----------
    G. Turk, "The PLY polygon file format" (1994).
    """
    name = os.fspath(path)
    data = _bytes(name)
    kind, elements, start = _ply_header(data, name)
    if kind == "ascii":
        words = iter(data[start:].split())

        def take(dtype: str) -> float:
            word = next(words, None)
            if word is None:
                raise MeshError(f"{name}: the file ends early")
            try:
                return float(word)
            except ValueError:
                text = word.decode("ascii", "replace")
                raise MeshError(f'{name}: "{text}" is not a number') from None

    else:
        order = "<" if kind == "binary_little_endian" else ">"
        at = start

        def take(dtype: str) -> float:
            nonlocal at
            kind_of = np.dtype(order + dtype)
            if at + kind_of.itemsize > len(data):
                raise MeshError(f"{name}: the file ends early")
            value = np.frombuffer(data, kind_of, 1, at)[0]
            at += kind_of.itemsize
            return float(value)

    points = np.zeros((0, 3))
    faces: list[list[int]] = []
    for element, count, properties in elements:
        lists = [p for p in properties if len(p) == 3]
        if kind != "ascii" and not lists:
            # Rows of one length are read at a stroke.
            record = np.dtype([(p[0], order + p[1]) for p in properties])
            if at + count * record.itemsize > len(data):
                raise MeshError(f"{name}: the file ends early")
            table = np.frombuffer(data, record, count, at)
            at += count * record.itemsize
            if element == "vertex":
                points = np.column_stack([table[axis].astype(float) for axis in "xyz"])
            continue
        values = []
        for _ in range(count):
            row = {}
            for prop in properties:
                if len(prop) == 3:
                    sides = int(take(prop[1]))
                    found = [take(prop[2]) for _ in range(sides)]
                    if element == "face" and prop[0] in ("vertex_indices", "vertex_index"):
                        faces.append([int(i) for i in found])
                else:
                    row[prop[0]] = take(prop[1])
            if element == "vertex":
                values.append([row[axis] for axis in "xyz"])
        if element == "vertex":
            points = np.array(values, float).reshape(-1, 3)
    if not np.isfinite(points).all():
        bad = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        raise MeshError(f"{name}: vertex {bad} has a coordinate that is not finite")
    try:
        return PolyMesh.from_faces(points, faces)
    except MeshError as error:
        raise MeshError(f"{name}: {error}") from error


def _ply_header(
    data: bytes, name: str
) -> tuple[str, list[tuple[str, int, list[tuple[str, ...]]]], int]:
    """Return the encoding, the elements with their properties, and where the body begins."""
    end = data.find(b"end_header")
    if not data.startswith(b"ply") or end < 0:
        raise MeshError(f'{name}: no PLY file: it needs "ply" first and "end_header"')
    start = data.find(b"\n", end) + 1 or len(data)
    kind = ""
    elements: list[tuple[str, int, list[tuple[str, ...]]]] = []
    for number, line in enumerate(data[:end].decode("ascii", "replace").splitlines(), 1):
        words = line.split()
        try:
            match words:
                case ["format", encoding, _]:
                    kind = encoding
                case ["element", element, count]:
                    elements.append((element, int(count), []))
                case ["property", "list", length, item, prop]:
                    elements[-1][2].append((prop, _PLY_TYPES[length], _PLY_TYPES[item]))
                case ["property", item, prop]:
                    elements[-1][2].append((prop, _PLY_TYPES[item]))
        except (KeyError, ValueError, IndexError):
            raise MeshError(f'{name}, line {number}: "{line}" is not understood') from None
    if kind not in ("ascii", "binary_little_endian", "binary_big_endian"):
        raise MeshError(f'{name}: the encoding "{kind}" is not known')
    named = {element: {p[0] for p in properties} for element, _, properties in elements}
    if not {"x", "y", "z"} <= named.get("vertex", set()):
        raise MeshError(f"{name}: there is no element vertex with x, y and z")
    if not {"vertex_indices", "vertex_index"} & named.get("face", set()):
        raise MeshError(f"{name}: there is no element face with vertex_indices")
    return kind, elements, start


def _bytes(name: str) -> bytes:
    try:
        return Path(name).read_bytes()
    except OSError as error:
        raise MeshError(f"{name}: cannot be read ({error.strerror})") from error

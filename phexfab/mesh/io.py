"""Polygon meshes on disk: OBJ and OFF with faces of any number of sides, read and written exactly.

Numbers are written with 17 significant digits, so that what is read back is the same to the last
bit, and files appear whole or not at all.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from phexfab.errors import MeshError
from phexfab.mesh.measures import edge_lengths, mean_edge
from phexfab.mesh.polymesh import PolyMesh
from phexfab.whole import whole

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Lines = Iterator[tuple[int, list[str]]]

WELD = 1e-5
"""Vertices nearer than this share of the mean edge are one; see `same_place`."""
WELD_MOST = 1e-3
"""The largest share, in files of few digits."""

# Words that may precede "OFF" for what follows the coordinates on a vertex line (texture, colour,
# normal); it is skipped. "4" and "n" mean other dimensions.
_OFF_HEADERS = {prefix + "OFF" for prefix in ("", "C", "N", "CN", "ST", "STC", "STN", "STCN")}


def read_mesh(path: str | os.PathLike[str]) -> PolyMesh:
    """Read a polygon mesh; the file's ending, ``.obj`` or ``.off``, tells the format.

    Parameters
    ----------
    path : path
        Faces may have any number of sides. The file says nothing of units: numbers stay as they
        are.

    Raises
    ------
    MeshError
        If the ending is another, or the file is malformed; the message names file and line.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import phexfab as px
    >>> mesh = px.PolyMesh.from_faces([(0, 0, 0), (400, 0, 0), (200, 300, 0)], [(0, 1, 2)])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     px.write_mesh(mesh, Path(folder) / "panel.off")
    ...     px.read_mesh(Path(folder) / "panel.off").vertices.tolist()
    [[0.0, 0.0, 0.0], [400.0, 0.0, 0.0], [200.0, 300.0, 0.0]]
    """
    verb: Callable[..., PolyMesh] = _by_ending(path, {".obj": read_obj, ".off": read_off})
    return verb(path)


def write_mesh(mesh: PolyMesh, path: str | os.PathLike[str]) -> None:
    """Write a polygon mesh as the file's ending, ``.obj`` or ``.off``, tells.

    Parameters
    ----------
    mesh : PolyMesh
    path : path
        Written in full digits, so that reading it gives the same numbers.

    Raises
    ------
    MeshError
        If the ending is another, the file cannot be written, or a coordinate is not finite.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import phexfab as px
    >>> mesh = px.PolyMesh.from_faces([(0, 0, 0), (400, 0, 0), (200, 300, 0)], [(0, 1, 2)])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     px.write_mesh(mesh, Path(folder) / "panel.obj")
    ...     print((Path(folder) / "panel.obj").read_text().strip())
    # phexfab polygon mesh
    v 0 0 0
    v 400 0 0
    v 200 300 0
    f 1 2 3
    """
    verb: Callable[..., None] = _by_ending(path, {".obj": write_obj, ".off": write_off})
    verb(mesh, path)


def read_obj(path: str | os.PathLike[str]) -> PolyMesh:
    """Read vertices and faces of a Wavefront OBJ file; everything else in it is passed over.

    Faces may be written ``f a/b/c``, vertices may carry a colour or a weight, and negative
    indices count back from the latest vertex.

    Raises
    ------
    MeshError
        Naming file and line.
    """
    name = os.fspath(path)
    points: list[list[float]] = []
    faces: list[list[int]] = []
    lines: list[int] = []
    for number, words in _words(name, continued=True):
        if words[0] == "v":
            points.append(_point(words[1:], name, number))
        elif words[0] == "f":
            corners = [_integer(word.split("/", 1)[0], name, number) for word in words[1:]]
            if 0 in corners:
                raise MeshError(f"{name}, line {number}: OBJ counts vertices from 1, not from 0")
            faces.append([i - 1 if i > 0 else len(points) + i for i in corners])
            lines.append(number)
    return _assemble(name, points, faces, lines, first=1)


def read_off(path: str | os.PathLike[str], first: int | None = None) -> PolyMesh:
    """Read an OFF file, colours and normals passed over.

    Parameters
    ----------
    path : path of the file
    first : {0, 1}, optional
        What the first vertex is called. OFF says 0, yet files that count from 1 are about; left
        out, a file is taken to count from 1 when a face names the vertex after the last and none
        names 0. A file that counts from 1 and never uses its last vertex needs ``first=1``.

    Raises
    ------
    MeshError
        Naming file and line.
    """
    name = os.fspath(path)
    lines = _words(name)
    counts, number = _off_header(name, lines)
    points: list[list[float]] = []
    faces: list[list[int]] = []
    where: list[int] = []
    for number, words in lines:
        if len(points) < counts[0]:
            points.append(_point(words, name, number))
        elif len(faces) < counts[1]:
            sides = _integer(words[0], name, number)
            if not 3 <= sides < len(words):
                raise MeshError(
                    f"{name}, line {number}: a face of {sides} corners with {len(words) - 1} "
                    "numbers after its count; 3 corners or more are needed, on one line"
                )
            faces.append([_integer(word, name, number) for word in words[1 : sides + 1]])
            where.append(number)
        else:
            break
    if len(points) < counts[0] or len(faces) < counts[1]:
        raise MeshError(
            f"{name}, line {number}: the file ends after {len(points)} of {counts[0]} vertices "
            f"and {len(faces)} of {counts[1]} faces"
        )
    named = np.concatenate([np.asarray(face, np.int64) for face in faces]) if faces else np.zeros(0)
    if first is None:
        from_one = len(named) > 0 and named.max() == len(points) and named.min() >= 1
        first = 1 if from_one else 0
    return _assemble(name, points, [[i - first for i in f] for f in faces], where, first)


def write_obj(mesh: PolyMesh, path: str | os.PathLike[str]) -> None:
    """Write a mesh as Wavefront OBJ, polygons as they are, with 17 significant digits.

    Raises
    ------
    MeshError
        If the file cannot be written or a coordinate is not finite.
    """
    rows = (f"v {row}\n" for row in _coordinates(mesh, path))
    corners = (mesh.corners + 1).tolist()
    faces = (f"f {' '.join(map(str, corners[i:j]))}\n" for i, j in _spans(mesh))
    _write_whole(path, "# phexfab polygon mesh\n" + "".join(rows) + "".join(faces))


def write_off(mesh: PolyMesh, path: str | os.PathLike[str]) -> None:
    """Write a mesh as OFF, counting from 0, with 17 significant digits.

    Raises
    ------
    MeshError
        If the file cannot be written or a coordinate is not finite.
    """
    rows = (f"{row}\n" for row in _coordinates(mesh, path))
    corners = mesh.corners.tolist()
    faces = (f"{j - i} {' '.join(map(str, corners[i:j]))}\n" for i, j in _spans(mesh))
    head = f"OFF\n{len(mesh.vertices)} {mesh.n_faces} 0\n"
    _write_whole(path, head + "".join(rows) + "".join(faces))


def same_place(mesh: PolyMesh) -> float:
    """Return the distance below which two vertices are one as files write them.

    `WELD` of the mean edge; where more, what six digits leave of the largest coordinate, up to
    `WELD_MOST` of the mean edge and a third of the shortest.
    """
    length = edge_lengths(mesh)
    edge = float(length.mean())
    shortest = float(length[length > WELD * edge].min(initial=np.inf))
    digits = 2e-5 * float(np.abs(mesh.vertices[mesh.corners]).max())
    return max(WELD * edge, min(digits, WELD_MOST * edge, shortest / 3))


def weld(mesh: PolyMesh, tolerance: float) -> PolyMesh:
    """Return the mesh with vertices closer than a tolerance made one.

    Of the vertices that hang together the first keeps its place, the others are dropped; so are
    vertices that no face uses. Corners that become the same as the one before are dropped too.

    Parameters
    ----------
    mesh : PolyMesh
    tolerance : float
        In the unit of the vertices; 0 joins only what is equal. It must stay below a tenth of the
        mean edge.

    Raises
    ------
    MeshError
        If the tolerance is negative or too large, or a face is left with fewer than 3 corners.
    """
    if not mesh.n_faces:
        return PolyMesh(np.zeros((0, 3)), mesh.corners, mesh.starts)
    if not 0 <= tolerance < mean_edge(mesh) / 10:
        raise MeshError(
            f"weld tolerance = {tolerance:g}: take one between 0 and a tenth of the mean edge, "
            f"{mean_edge(mesh) / 10:.3g}"
        )
    n = len(mesh.vertices)
    pairs = cKDTree(mesh.vertices).query_pairs(tolerance, output_type="ndarray")
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(n, n))
    _, group = connected_components(links, directed=False)
    _, keeper = np.unique(group, return_index=True)  # the lowest vertex of each group
    corners = keeper[group][mesh.corners]
    fresh = corners != corners[mesh.previous_corner]
    sides = np.add.reduceat(fresh.astype(np.int64), mesh.starts[:-1])
    if sides.min() < 3:
        raise MeshError(
            f"welding within {tolerance:g} leaves face {int(sides.argmin())} with {sides.min()} "
            "corners; lower the tolerance"
        )
    used, index = np.unique(corners[fresh], return_inverse=True)
    starts = np.concatenate([[0], np.cumsum(sides)]).astype(np.int64)
    return PolyMesh(mesh.vertices[used], index.reshape(-1).astype(np.int64), starts)


def _by_ending(path: str | os.PathLike[str], verbs: dict[str, Any]) -> Any:
    ending = Path(path).suffix.lower()
    if ending not in verbs:
        raise MeshError(
            f'{os.fspath(path)}: unknown mesh format "{ending}"; use {" or ".join(verbs)}'
        )
    return verbs[ending]


def _words(name: str, continued: bool = False) -> Lines:
    """Yield line numbers and words, without comments and empty lines; ``\\`` joins lines."""
    try:
        text = Path(name).read_text(encoding="utf-8-sig", errors="replace")
    except OSError as error:
        raise MeshError(f"{name}: cannot be read ({error.strerror})") from error
    pending = ""
    for number, line in enumerate(text.splitlines(), 1):
        line = pending + line.split("#", 1)[0].rstrip()
        pending = ""
        if continued and line.endswith("\\"):
            pending = line[:-1] + " "
            continue
        if words := line.split():
            yield number, words


def _off_header(name: str, lines: Lines) -> tuple[tuple[int, int], int]:
    """Return the numbers of vertices and faces, and the line that told them."""
    number, words = next(lines, (1, []))
    if words and not words[0].lstrip("-").isdigit():
        if words[0] not in _OFF_HEADERS or "BINARY" in words:
            raise MeshError(
                f'{name}, line {number}: "{" ".join(words)}" does not begin an OFF text file of '
                "points in space"
            )
        words = words[1:]
        if not words:
            number, words = next(lines, (number, []))
    if len(words) < 2:
        raise MeshError(f"{name}, line {number}: the numbers of vertices and faces are missing")
    counts = _integer(words[0], name, number), _integer(words[1], name, number)
    if min(counts) < 0:
        raise MeshError(f"{name}, line {number}: {min(counts)} is no number of vertices or faces")
    return counts, number


def _point(words: list[str], name: str, number: int) -> list[float]:
    try:
        point = [float(word) for word in words[:3]]
    except ValueError:
        point = []
    if len(point) < 3 or not np.all(np.isfinite(point)):
        raise MeshError(
            f'{name}, line {number}: "{" ".join(words)}" does not begin with three finite numbers'
        )
    return point


def _integer(word: str, name: str, number: int) -> int:
    try:
        return int(word)
    except ValueError:
        raise MeshError(f'{name}, line {number}: "{word}" is not a whole number') from None


def _assemble(
    name: str, points: list[list[float]], faces: list[list[int]], lines: list[int], first: int
) -> PolyMesh:
    for face, number in zip(faces, lines, strict=True):
        if len(face) < 3:
            raise MeshError(f"{name}, line {number}: a face has {len(face)} corners; 3 are needed")
        for index in (min(face), max(face)):
            if not 0 <= index < len(points):
                raise MeshError(
                    f"{name}, line {number}: a face names vertex {index + first}, but vertices "
                    f"run from {first} to {len(points) - 1 + first}"
                )
    return PolyMesh.from_faces(np.array(points, float).reshape(-1, 3), faces)


def _spans(mesh: PolyMesh) -> list[tuple[int, int]]:
    return list(pairwise(mesh.starts.tolist()))


def _coordinates(mesh: PolyMesh, path: str | os.PathLike[str]) -> Iterator[str]:
    bad = np.flatnonzero(~np.isfinite(mesh.vertices).all(axis=1))
    if len(bad):
        raise MeshError(
            f"{os.fspath(path)}: vertex {bad[0]} is {mesh.vertices[bad[0]]}; only finite "
            "coordinates can be written"
        )
    return (f"{x:.17g} {y:.17g} {z:.17g}" for x, y, z in mesh.vertices.tolist())


def _write_whole(path: str | os.PathLike[str], text: str) -> None:
    try:
        with whole(path) as draft:
            draft.write_text(text, encoding="ascii", newline="\n")
    except OSError as error:
        raise MeshError(f"{path}: cannot be written ({error.strerror})") from error

"""One door for polygon meshes from elsewhere: OBJ, OFF, PLY and COMPAS JSON, made sound."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from phexfab.errors import MeshError
from phexfab.mesh.clean import ImportReport, clean
from phexfab.mesh.compas_json import read_compas
from phexfab.mesh.io import read_obj, read_off
from phexfab.mesh.polymesh import PolyMesh
from phexfab.mesh.trimesh_io import read_ply

_READERS: dict[str, Callable[[str], PolyMesh]] = {
    ".obj": read_obj,
    ".off": read_off,
    ".ply": read_ply,
    ".json": read_compas,
}


def read_polygons(
    path: str | os.PathLike[str],
    *,
    weld_within: float | None = None,
    turn: bool = True,
    first: int | None = None,
) -> PolyMesh:
    """Read a polygon mesh, made sound or refused; `import_polygons` also says what was mended."""
    return import_polygons(path, weld_within=weld_within, turn=turn, first=first)[0]


def import_polygons(
    path: str | os.PathLike[str],
    *,
    weld_within: float | None = None,
    turn: bool = True,
    first: int | None = None,
) -> tuple[PolyMesh, ImportReport]:
    """Read a polygon mesh and say what was mended.

    Parameters
    ----------
    path : path of a file
        ``.obj``, ``.off``, ``.ply`` (text, or binary of either byte order) or ``.json`` (COMPAS).
    weld_within : float, optional
        Vertices nearer than this become one, mm; by default 1e-5 of the mean edge.
    turn : bool
        Turn faces that are oriented against the larger part of their piece; False refuses them.
    first : {0, 1}, optional
        What an OFF file calls its first vertex; see `phexfab.mesh.io.read_off`.

    Raises
    ------
    MeshError
        If the format is unknown, the file malformed, or the mesh no manifold; see
        `phexfab.mesh.clean.clean`. Messages name the file, how many places there are, and the
        first with its face and coordinates.
    """
    name, ending = os.fspath(path), Path(path).suffix.lower()
    if ending not in _READERS:
        raise MeshError(f'{name}: unknown mesh format "{ending}"; use {", ".join(_READERS)}')
    mesh = read_off(name, first) if ending == ".off" else _READERS[ending](name)
    return clean(mesh, weld_within=weld_within, turn=turn, name=name)

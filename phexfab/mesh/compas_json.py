"""Meshes that COMPAS wrote as JSON, of its versions 1 and 2."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import numpy as np

from phexfab.errors import MeshError
from phexfab.mesh.polymesh import PolyMesh


def read_compas(path: str | os.PathLike[str]) -> PolyMesh:
    """Read vertices and faces of a COMPAS mesh; attributes are passed over.

    Vertices and faces keep the order of the file; their keys need not be consecutive.

    Raises
    ------
    MeshError
        If the file is no JSON or holds no mesh, a face names a key that no vertex has or has less
        than three corners, or a coordinate is not a finite number; vertex and face go by their
        keys.

    References
    ----------
    COMPAS, ``compas.datastructures.Mesh.__data__``.
    """
    name = os.fspath(path)
    try:
        found = json.loads(Path(name).read_text(encoding="utf-8-sig"))
    except OSError as error:
        raise MeshError(f"{name}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise MeshError(f"{name}: no JSON file ({error})") from error
    data = _mesh_in(found)
    if data is None:
        raise MeshError(f'{name}: no COMPAS mesh: there is no object with "vertex" and "face"')
    default = data.get("default_vertex_attributes")
    default = default if isinstance(default, dict) else {}
    keys = {key: k for k, key in enumerate(data["vertex"])}
    points = np.zeros((len(keys), 3))
    for key, k in keys.items():
        attributes = data["vertex"][key]
        for axis, letter in enumerate("xyz"):
            value = default.get(letter, 0.0)
            if isinstance(attributes, dict):
                value = attributes.get(letter, value)
            if isinstance(value, bool) or not isinstance(value, int | float):
                raise MeshError(f"{name}: vertex {key} has {letter} = {value!r}, no number")
            points[k, axis] = value
        if not np.isfinite(points[k]).all():
            raise MeshError(f"{name}: vertex {key} is {points[k]}; coordinates must be finite")
    faces = []
    for key, corners in data["face"].items():
        if not isinstance(corners, list) or len(corners) < 3:
            count = len(corners) if isinstance(corners, list) else 0
            raise MeshError(f"{name}: face {key} has {count} corners; 3 are needed")
        unknown = [corner for corner in corners if str(corner) not in keys]
        if unknown:
            raise MeshError(f"{name}: face {key} names vertex {unknown[0]}, which there is not")
        faces.append([keys[str(corner)] for corner in corners])
    return PolyMesh.from_faces(points, faces)


def _mesh_in(found: Any) -> dict[str, Any] | None:
    """Return the object that holds vertices and faces, through COMPAS' wrappers."""
    for _ in range(4):
        if isinstance(found, list) and len(found) == 1:
            found = found[0]
        if not isinstance(found, dict):
            return None
        if isinstance(found.get("vertex"), dict) and isinstance(found.get("face"), dict):
            return found
        # Version 2 writes "data", version 1 wrote "value".
        found = found.get("data", found.get("value"))
    return None

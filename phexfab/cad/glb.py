"""glTF for viewers: every part a named node under its family, coloured, at its true size.

glTF counts in metres and its y-axis points up, so coordinates are converted, not only labelled:
(x, y, z) mm becomes (x, z, −y)/1000 m, and programs whose z-axis points up turn it back. Every
part has an origin of its own in the middle of its box: single precision then loses nothing, and
viewers turn parts about their middle.

References
----------
Khronos Group, glTF 2.0 specification (ISO/IEC 12113:2022).
"""

from __future__ import annotations

import json
import struct
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phexfab.cad.tree import Family, families, material, metadata
from phexfab.cad.triangles import as_solid
from phexfab.fabrication.clash import triangulations
from phexfab.fabrication.parts import Parts, Solid
from phexfab.whole import whole

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_METRE = 1000.0
_FLOAT, _SHORT = 5126, 5123
_ARRAY, _ELEMENTS = 34962, 34963
_ROUGHNESS = {"panels": 0.85, "beams": 0.55, "nodes": 0.45}


def write_glb(parts: Parts, path: str | Path, name: str = "shell") -> Path:
    """Write panels, beams and nodes as a binary glTF file.

    The tree is ``name`` → ``panels``, ``beams``, ``nodes`` → the parts, each a node and a mesh
    named by its mark, with what the parts list says of it in ``extras`` (lengths in mm there).

    Parameters
    ----------
    parts : Parts
    path : str or Path
        Replaced as a whole when the file is complete.
    name : str
        Of the root node.

    Raises
    ------
    PartError
        If marks are not unique or there is no part.
    """
    data = glb_bytes(parts, name)
    with whole(path) as draft:
        draft.write_bytes(data)
    return Path(path)


def glb_bytes(parts: Parts, name: str = "shell") -> bytes:
    """Return the binary glTF file of some parts; see ``write_glb``."""
    file = _File(name)
    for family in families(parts):
        file.add(family)
    return file.bytes()


class _File:
    """A glTF document that grows family by family."""

    def __init__(self, name: str) -> None:
        self.nodes: list[dict[str, Any]] = [{"name": name, "children": []}]
        self.meshes: list[dict[str, Any]] = []
        self.materials: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.chunks: tuple[list[bytes], ...] = ([], [], [])  # positions, normals, indices
        self.sizes = [0, 0, 0]

    def add(self, family: Family) -> None:
        branch: dict[str, Any] = {"name": family.name, "children": []}
        self.nodes[0]["children"].append(len(self.nodes))
        self.nodes.append(branch)
        self.materials.append(_material(family))
        solids = [as_solid(geometry) for _, geometry in family.members]
        filled = triangulations(solids)
        for part, solid, triangles in zip(family.parts, solids, filled, strict=True):
            points, normals, indices = _flat_shaded(solid, triangles)
            middle = (points.min(axis=0) + points.max(axis=0)) / 2
            position = self._vectors(0, _turned(points - middle) / _METRE)
            attributes = {"POSITION": position, "NORMAL": self._vectors(1, _turned(normals))}
            primitive = {
                "attributes": attributes,
                "indices": self._indices(indices),
                "material": len(self.materials) - 1,
            }
            branch["children"].append(len(self.nodes))
            self.nodes.append(
                {
                    "name": part.mark,
                    "mesh": len(self.meshes),
                    "translation": (np.round(_turned(middle) / _METRE, 9) + 0.0).tolist(),
                    "extras": metadata(part),
                }
            )
            self.meshes.append({"name": part.mark, "primitives": [primitive]})

    def _append(self, view: int, data: bytes, accessor: dict[str, Any]) -> int:
        accessor = {"bufferView": view, "byteOffset": self.sizes[view], **accessor}
        self.chunks[view].append(data)
        self.sizes[view] += len(data)
        self.accessors.append(accessor)
        return len(self.accessors) - 1

    def _vectors(self, view: int, values: FloatArray) -> int:
        single = values.astype("<f4") + np.float32(0)
        accessor = {"componentType": _FLOAT, "count": len(single), "type": "VEC3"}
        if view == 0:
            accessor |= {"min": single.min(0).tolist(), "max": single.max(0).tolist()}
        return self._append(view, single.tobytes(), accessor)

    def _indices(self, triangles: IntArray) -> int:
        accessor = {"componentType": _SHORT, "count": triangles.size, "type": "SCALAR"}
        return self._append(2, triangles.astype("<u2").tobytes(), accessor)

    def bytes(self) -> bytes:
        body = b"".join(_padded(b"".join(chunk), b"\0") for chunk in self.chunks)
        views, begin = [], 0
        for k, size in enumerate(self.sizes):
            view = {"buffer": 0, "byteOffset": begin, "byteLength": size}
            views.append(
                view | ({"byteStride": 12, "target": _ARRAY} if k < 2 else {"target": _ELEMENTS})
            )
            begin += -(-size // 4) * 4
        document = {
            "asset": {"version": "2.0", "generator": "phexfab"},
            "scene": 0,
            "scenes": [{"name": self.nodes[0]["name"], "nodes": [0]}],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": views,
            "buffers": [{"byteLength": len(body)}],
        }
        text = json.dumps(document, separators=(",", ":"), ensure_ascii=False, allow_nan=False)
        head = _padded(text.encode(), b" ")
        chunks = b"".join(
            struct.pack("<I4s", len(chunk), kind) + chunk
            for chunk, kind in ((head, b"JSON"), (body, b"BIN\0"))
        )
        return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def _padded(data: bytes, fill: bytes) -> bytes:
    return data + fill * (-len(data) % 4)


def _turned(vectors: FloatArray) -> FloatArray:
    """Return vectors in glTF's axes: y up, z towards the viewer."""
    return np.stack([vectors[..., 0], vectors[..., 2], -vectors[..., 1]], axis=-1)


@lru_cache(maxsize=1024)
def _corner_table(faces: tuple[tuple[int, ...], ...]) -> tuple[IntArray, IntArray, IntArray]:
    """Return the corners of all faces, their face, and where vertex v of face f is among them."""
    corners = np.array([v for face in faces for v in face], np.int64)
    owner = np.repeat(np.arange(len(faces)), [len(face) for face in faces])
    place = np.full((len(faces), int(corners.max()) + 1), -1)
    place[owner, corners] = np.arange(len(corners))
    return corners, owner, place


def _flat_shaded(solid: Solid, triangles: IntArray) -> tuple[FloatArray, FloatArray, IntArray]:
    """Return points, normals and triangles of a solid whose faces share no corner."""
    corners, owner, place = _corner_table(solid.faces)
    points = np.asarray(solid.vertices, float)[corners]
    face = np.repeat(np.arange(len(solid.faces)), [len(f) - 2 for f in solid.faces])
    a, b, c = np.moveaxis(solid.vertices[triangles], 1, 0)
    normals = np.zeros((len(solid.faces), 3))
    np.add.at(normals, face, np.cross(b - a, c - a))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return points, normals[owner], place[face[:, None], triangles]


def _material(family: Family) -> dict[str, Any]:
    srgb = np.array(family.colour)
    linear = np.where(srgb <= 0.04045, srgb / 12.92, ((srgb + 0.055) / 1.055) ** 2.4)
    return {
        "name": f"{family.name}: {material(family.parts[0]).name}",
        "pbrMetallicRoughness": {
            "baseColorFactor": [*np.round(linear, 6).tolist(), 1.0],
            "metallicFactor": 0.0,
            "roughnessFactor": _ROUGHNESS[family.name],
        },
    }

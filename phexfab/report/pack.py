"""Scenes packed for the page's 3-D views: whole numbers in one compressed stream."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.report.camera import View
from phexfab.report.data import ReportData
from phexfab.report.details import (
    EDGES,
    ENDS,
    LABELS,
    border_beams,
    cut_panels,
    part_details,
    part_note,
)
from phexfab.report.drawings import engraved_paths
from phexfab.report.fields import (
    NEUTRAL,
    RAMP,
    PanelField,
    face_marks,
    gauss_mesh,
    panel_fields,
    shell_view,
)
from phexfab.report.scene import Layer, assembly_layers, gauss_layer, mesh_layer, sphere_layer
from phexfab.report.text import quantity

FloatArray = NDArray[np.float64]

_STEPS = 65535  # positions are kept to this fraction of the scene's size: 0.1 mm in 6 m
_LIFT = {"panels": 1.0, "beams": 0.0, "nodes": -0.6}  # where a family goes when all is exploded


class Packer:
    """Arrays of whole numbers laid end to end; ``add`` says where each one lies."""

    def __init__(self) -> None:
        self.runs: list[bytes] = []
        self.size = 0

    def add(self, values: ArrayLike) -> dict[str, Any]:
        """Keep non-negative whole numbers in the smallest type that holds them."""
        array = np.asarray(values)
        top = array.max(initial=0)
        kind = "u1" if top < 2**8 else "u2" if top < 2**16 else "u4"
        run = array.astype(f"<{kind}").tobytes()
        place = {"type": kind, "at": self.size, "count": int(array.size)}
        run += bytes(-len(run) % 4)
        self.runs.append(run)
        self.size += len(run)
        return place

    def pack(self, value: Any) -> str:
        """Return JSON and arrays, compressed, as base64: four bytes with the JSON's length first.

        The JSON is padded with spaces to a multiple of four bytes, the arrays follow.
        """
        text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        head = text.encode()
        head += b" " * (-len(head) % 4)
        stream = len(head).to_bytes(4, "little") + head + b"".join(self.runs)
        return base64.b64encode(zlib.compress(stream, 9)).decode("ascii")


def page_data(data: ReportData) -> str:
    """Return all that the page's script needs, as ``Packer.pack`` lays it out."""
    packer = Packer()
    marks = face_marks(data.shell, [(p.face, p.mark) for p in data.parts.panels])
    fields = panel_fields(data.shell)
    paint = fields[0].colours if fields else np.zeros((0, 3))
    look = shell_view(data.shell)
    scenes: dict[str, Any] = {}
    layers = assembly_layers(data.parts)
    if layers:
        scenes["assembly"] = _assembly(packer, data, layers, look)
    if len(marks):
        shell = mesh_layer("shell", data.shell.mesh, marks, paint)
        gauss = gauss_layer(gauss_mesh(data.shell), marks, paint)
        scenes["shell"] = _scene(packer, (shell,), look)
        scenes["gauss"] = _scene(packer, (gauss,), look, sphere_layer(40))
    details = part_details(data)
    model = {
        "title": data.title,
        "ramp": RAMP,
        "neutral": NEUTRAL,
        "scenes": scenes,
        "faces": marks,
        "fields": [_field(packer, field) for field in fields],
        "labels": LABELS,
        "edges": EDGES,
        "ends": ENDS,
        "parts": details,
        "notes": {mark: part_note(entry) for mark, entry in details.items()},
        "also": _at_nodes(data),
        "engraving": engraved_paths(data.sheets, data.engraving),
    }
    return packer.pack(model)


def _at_nodes(data: ReportData) -> dict[str, list[str]]:
    """Return the beams at each node that has no hub to show."""
    hubs = {node.mark for node in data.parts.nodes}
    found: dict[str, list[str]] = {}
    for beam in data.parts.beams:
        for node in beam.nodes:
            if node not in hubs:
                found.setdefault(node, []).append(beam.mark)
    return found


def _assembly(
    packer: Packer, data: ReportData, layers: Sequence[Layer], view: View
) -> dict[str, Any]:
    """Return the scene of all parts, with groups to hide and the way out of each part."""
    scene = _scene(packer, layers, view) | {"ground": True}
    rims = {"panels": cut_panels(data), "beams": border_beams(data)}
    rim_names = {"panels": "Cut panels", "beams": "Rim beams"}
    axes = _ways_out(data)
    size = float(np.median(np.ptp(_panel_boxes(data), axis=1))) if data.parts.panels else 0.0
    groups: list[str] = []
    for layer, packed in zip(layers, scene["layers"], strict=True):
        at_rim = np.array(rims.get(layer.family, [False] * len(layer.marks)), bool)
        group = np.full(len(at_rim), len(groups))
        groups.append(layer.family.capitalize())
        if at_rim.any():
            group[at_rim] = len(groups)
            groups.append(rim_names[layer.family])
        packed["groups"] = packer.add(group)
        packed["axes"] = packer.add(np.rint(127 * axes[layer.family]) + 127)
        packed["lift"] = _LIFT[layer.family] * 0.7 * size / scene["radius"]
    return scene | {"groups": groups}


def _panel_boxes(data: ReportData) -> FloatArray:
    """Return (P, 2, 2) lower and upper corners of the panels' contours."""
    return np.array([(p.flat.outline.min(0), p.flat.outline.max(0)) for p in data.parts.panels])


def _ways_out(data: ReportData) -> dict[str, FloatArray]:
    """Return for each family a unit vector per part: out of the shell, away from the beams."""
    shell, parts = data.shell, data.parts
    normals = shell.normals[shell.panels]
    left, right = shell.edges[:, 2], shell.edges[:, 3]
    along_edge = _unit(normals[left] + np.where(right < 0, 0, 1)[:, None] * normals[right])
    own = along_edge[np.array([beam.edge for beam in parts.beams], np.int64)]
    middles = shell.mesh.vertices[shell.edges[:, :2]].mean(1)
    down = 0.0
    for beam, out in zip(parts.beams, own, strict=True):
        down += float((beam.solid.vertices.mean(0) - middles[beam.edge]) @ out)
    side = -1.0 if down > 0 else 1.0
    drums = np.array([node.cylinder.axis for node in parts.nodes], float).reshape(-1, 3)
    at_node = np.zeros_like(shell.mesh.vertices)
    np.add.at(at_node, shell.mesh.corners, normals[shell.mesh.face_of_corner])
    toward = (drums * at_node[np.array([n.vertex for n in parts.nodes], np.int64)]).sum(1)
    return {
        "panels": side * normals[np.array([p.face for p in parts.panels], np.int64)],
        "beams": side * own,
        "nodes": side * np.sign(toward)[:, None] * drums,
    }


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-9))


def _scene(
    packer: Packer, layers: Sequence[Layer], view: View, haze: Layer | None = None
) -> dict[str, Any]:
    everything = [*layers, *([haze] if haze else [])]
    points = np.concatenate([layer.vertices for layer in everything])
    low, high = points.min(0), points.max(0)
    middle = (low + high) / 2
    scene = {
        "low": low.tolist(),
        "span": np.maximum(high - low, 1e-9).tolist(),
        "middle": middle.tolist(),
        "radius": float(np.linalg.norm(points - middle, axis=1).max()) or 1.0,
        "view": [view.azimuth, view.elevation],
        "layers": [_layer(packer, layer, low, high) for layer in layers],
        "groups": [layer.family.capitalize() for layer in layers],
    }
    if haze:
        scene["haze"] = _layer(packer, haze, low, high)
    return scene


def _layer(packer: Packer, layer: Layer, low: FloatArray, high: FloatArray) -> dict[str, Any]:
    """Return a layer with indices counted from each part's first vertex: they stay small."""
    count = len(layer.marks)
    vertices = np.bincount(layer.vertex_part, minlength=count)
    first = np.cumsum(vertices) - vertices
    line_part = layer.vertex_part[layer.lines[:, 0]]
    steps = np.rint((layer.vertices - low) / np.maximum(high - low, 1e-9) * _STEPS)
    return {
        "marks": layer.marks,
        "colours": packer.add(np.rint(np.clip(layer.colours, 0, 1) * 255)),
        "positions": packer.add(steps),
        "vertices": packer.add(vertices),
        "triangles": packer.add(layer.triangles - first[layer.part][:, None]),
        "triangle_counts": packer.add(np.bincount(layer.part, minlength=count)),
        "lines": packer.add(layer.lines - first[line_part][:, None]),
        "line_counts": packer.add(np.bincount(line_part, minlength=count)),
    }


def _field(packer: Packer, field: PanelField) -> dict[str, Any]:
    place = field.positions
    # 255 says that a panel has no value.
    steps = np.where(np.isfinite(place), np.rint(np.nan_to_num(place) * 254), 255)
    low, high = field.limits
    return {
        "name": field.name,
        "low": quantity(low, field.unit, 3),
        "high": quantity(high, field.unit, 3),
        "places": packer.add(steps),
        "values": [quantity(float(v), field.unit, 4) for v in field.values],
    }

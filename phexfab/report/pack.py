"""Scenes packed for the page's 3-D view: typed arrays in base64, and what belongs to each part."""

from __future__ import annotations

import base64
import json
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.report.camera import View
from phexfab.report.data import ReportData
from phexfab.report.fields import NEUTRAL, RAMP, PanelField, face_marks, panel_fields, shell_view
from phexfab.report.scene import Layer, assembly_layers, gauss_layer, mesh_layer, sphere_layer
from phexfab.report.text import quantity

FloatArray = NDArray[np.float64]

_STEPS = 65535  # positions are kept to this fraction of the scene's size: 0.1 mm in 6 m


def page_scenes(data: ReportData) -> dict[str, Any]:
    """Return all that the page's script needs, ready for JSON."""
    marks = face_marks(data.shell, [(p.face, p.mark) for p in data.parts.panels])
    fields = panel_fields(data.shell)
    paint = fields[0].colours if fields else np.zeros((0, 3))
    look = shell_view(data.shell)
    scenes: dict[str, Any] = {}
    layers = assembly_layers(data.parts)
    if layers:
        scenes["assembly"] = _scene(layers, look)
    if len(marks):
        shown = [_field(field) for field in fields]
        shell = mesh_layer("shell", data.shell.mesh, marks, paint)
        gauss = gauss_layer(data.shell.gauss, marks, paint)
        scenes["shell"] = _scene((shell,), look) | {"turns": "gauss", "fields": shown}
        scenes["gauss"] = _scene((gauss,), look, sphere_layer(40)) | {"turns": "gauss"}
    return {
        "ramp": RAMP,
        "neutral": NEUTRAL,
        "scenes": scenes,
        "parts": part_notes(data),
        "also": _at_nodes(data),
    }


def part_notes(data: ReportData) -> dict[str, str]:
    """Return for each mark what a reader wants to know on pointing at the part."""
    sheet = {p.mark: s.name for s in data.sheets for p in s.placements}
    notes = {}
    for panel in data.parts.panels:
        flat = panel.flat
        notes[panel.mark] = (
            f"panel, {quantity(flat.thickness, 'mm')} {flat.material.name}, "
            f"{quantity(panel.area / 1e6, 'm²', 3)}, {quantity(panel.mass, 'kg', 3)}"
        )
    for beam in data.parts.beams:
        notes[beam.mark] = (
            f"beam, {quantity(round(beam.length, 1), 'mm')} long, {beam.flat.material.name}, "
            f"{quantity(beam.mass, 'kg', 3)}"
        )
    for node in data.parts.nodes:
        drum = node.cylinder
        notes[node.mark] = (
            f"hub, ⌀ {quantity(2 * drum.radius, 'mm')} × {quantity(round(drum.length, 1), 'mm')}, "
            f"{node.material.name}, {quantity(node.mass, 'kg', 3)}"
        )
    return {m: f"{note}, sheet {sheet[m]}" if m in sheet else note for m, note in notes.items()}


def dump(value: Any) -> str:
    """Return JSON that may stand inside a script element: no tag can end it."""
    text = json.dumps(value, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for mark in "<>&\u2028\u2029":
        text = text.replace(mark, f"\\u{ord(mark):04x}")
    return text


def _at_nodes(data: ReportData) -> dict[str, list[str]]:
    """Return the beams at each node that has no hub to show."""
    hubs = {node.mark for node in data.parts.nodes}
    found: dict[str, list[str]] = {}
    for beam in data.parts.beams:
        for node in beam.nodes:
            if node not in hubs:
                found.setdefault(node, []).append(beam.mark)
    return found


def _scene(layers: Sequence[Layer], view: View, haze: Layer | None = None) -> dict[str, Any]:
    everything = [*layers, *([haze] if haze else [])]
    points = np.concatenate([layer.vertices for layer in everything])
    low, high = points.min(0), points.max(0)
    middle = (low + high) / 2
    scene = {
        "low": _finite(low),
        "span": _finite(np.maximum(high - low, 1e-9)),
        "middle": _finite(middle),
        "radius": float(np.linalg.norm(points - middle, axis=1).max()) or 1.0,
        "view": [view.azimuth, view.elevation, view.opening],
        "layers": [_layer(layer, low, high) for layer in layers],
    }
    if haze:
        scene["haze"] = _layer(haze, low, high)
    return scene


def _layer(layer: Layer, low: FloatArray, high: FloatArray) -> dict[str, Any]:
    """Return a layer with indices counted from each part's first vertex: they stay small."""
    count = len(layer.marks)
    vertices = np.bincount(layer.vertex_part, minlength=count)
    first = np.cumsum(vertices) - vertices
    line_part = layer.vertex_part[layer.lines[:, 0]]
    steps = np.rint((layer.vertices - low) / np.maximum(high - low, 1e-9) * _STEPS)
    return {
        "family": layer.family,
        "marks": layer.marks,
        "colours": _encode(np.rint(np.clip(layer.colours, 0, 1) * 255)),
        "positions": _encode(steps),
        "vertices": _encode(vertices),
        "triangles": _encode(layer.triangles - first[layer.part][:, None]),
        "triangle_counts": _encode(np.bincount(layer.part, minlength=count)),
        "lines": _encode(layer.lines - first[line_part][:, None]),
        "line_counts": _encode(np.bincount(line_part, minlength=count)),
    }


def _field(field: PanelField) -> dict[str, Any]:
    place = field.positions
    # 255 says that a panel has no value.
    steps = np.where(np.isfinite(place), np.rint(np.nan_to_num(place) * 254), 255)
    low, high = field.limits
    return {
        "name": field.name,
        "low": quantity(low, field.unit, 3),
        "high": quantity(high, field.unit, 3),
        "places": _encode(steps),
        "values": [quantity(float(v), field.unit, 4) for v in field.values],
    }


def _encode(values: ArrayLike) -> dict[str, str]:
    """Return non-negative whole numbers in the smallest type that holds them."""
    array = np.asarray(values)
    top = array.max(initial=0)
    kind = "u1" if top < 2**8 else "u2" if top < 2**16 else "u4"
    data = array.astype(f"<{kind}").tobytes()
    return {"type": kind, "data": base64.b64encode(data).decode("ascii")}


def _finite(values: FloatArray) -> list[float]:
    return [float(v) for v in values]

"""The bill of materials: a row per part, and a cut list of what to buy."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from phexfab.fabrication.drawn import area_and_centroid
from phexfab.fabrication.parts import FlatPart, Parts, Sheet
from phexfab.mesh.polymesh import PolyMesh
from phexfab.whole import whole

FloatArray = NDArray[np.float64]
Row = dict[str, str | float | None]

# Column -> decimals of its numbers (None: text). The unit is the end of the name.
BOM_COLUMNS: dict[str, int | None] = {
    "mark": None,
    "kind": None,
    "material": None,
    "thickness_mm": 2,
    "section_mm": None,
    "length_mm": 2,
    "width_mm": 2,
    "area_m2": 6,
    "volume_mm3": 4,
    "mass_kg": 4,
    "bevels_deg": None,
    "mitres_deg": None,
    "slopes_deg": None,
    "sheet": None,
    "neighbours": None,
}
CUT_LIST_COLUMNS: dict[str, int | None] = {
    "kind": None,
    "material": None,
    "thickness_mm": 2,
    "section_mm": None,
    "quantity": 0,
    "total_length_m": 3,
    "total_area_m2": 4,
    "total_mass_kg": 3,
}


def bom_rows(parts: Parts, sheets: Sequence[Sheet] = ()) -> list[Row]:
    """Return a row per part, panels, beams and nodes in order, keyed by ``BOM_COLUMNS``.

    Parameters
    ----------
    parts : Parts
    sheets : sequence of Sheet
        Where the flat parts were nested; parts on no sheet have an empty ``sheet``.

    Returns
    -------
    list of dict
        Numbers as numbers, ``None`` where a column says nothing about that kind of part. Length and
        width are those of the least rectangle around the blank of a panel (length ≥ width), of the
        box along the bar for a beam, and length and diameter of a hub. Bevels are one per edge of
        the flat pattern, mitres are those at vertex i left and right, then at j; see ``Panel`` and
        ``Beam``.
    """
    place = {item.mark: sheet.name for sheet in sheets for item in sheet.placements}
    boxes = least_boxes([panel.flat.blank for panel in parts.panels])
    rows: list[Row] = []
    for panel, (length, width) in zip(parts.panels, boxes.tolist(), strict=True):
        row = _flat_row(panel.flat, "panel", length, width, place)
        row |= {
            "section_mm": f"{panel.flat.thickness:g}",
            "area_m2": panel.area * 1e-6,
            "volume_mm3": panel.volume,
            "mass_kg": panel.mass,
            "bevels_deg": _angles(note.bevel for note in panel.flat.edges),
            "neighbours": " ".join(note.neighbour for note in panel.flat.edges if note.neighbour),
        }
        rows.append(row)
    areas = _areas([beam.flat.outline for beam in parts.beams]).tolist()
    for beam, area in zip(parts.beams, areas, strict=True):
        length, height = (beam.flat.blank.max(axis=0) - beam.flat.blank.min(axis=0)).tolist()
        row = _flat_row(beam.flat, "beam", length, height, place)
        row |= {
            "section_mm": f"{beam.flat.thickness:g}x{height:.10g}",
            "area_m2": area * 1e-6,
            "volume_mm3": beam.volume,
            "mass_kg": beam.mass,
            "mitres_deg": _angles(angle for end in beam.mitres for angle in end),
            "slopes_deg": _angles(beam.slopes),
            "neighbours": " ".join((*beam.neighbours, *beam.nodes)),
        }
        rows.append(row)
    for node in parts.nodes:
        cylinder = node.cylinder
        empty: Row = dict.fromkeys(BOM_COLUMNS)
        rows.append(
            empty
            | {
                "mark": node.mark,
                "kind": "node",
                "material": node.material.name,
                "section_mm": f"D{2.0 * cylinder.radius:g}",
                "length_mm": cylinder.length,
                "width_mm": 2.0 * cylinder.radius,
                "volume_mm3": node.volume,
                "mass_kg": node.mass,
                "neighbours": " ".join(node.neighbours),
            }
        )
    return rows


def cut_list(rows: Iterable[Row]) -> list[Row]:
    """Return what to buy: rows of a bill of materials added up by kind, material and section.

    Keyed by ``CUT_LIST_COLUMNS``, in order of first appearance. Lengths are added for beams and
    nodes, areas for panels and beams.
    """
    groups: dict[tuple[str | float | None, ...], list[Row]] = {}
    keys = ("kind", "material", "thickness_mm", "section_mm")
    for row in rows:
        groups.setdefault(tuple(row[key] for key in keys), []).append(row)

    def total(members: list[Row], column: str) -> float:
        return float(sum(value for row in members if isinstance(value := row[column], int | float)))

    result: list[Row] = []
    for key, members in groups.items():
        line: Row = dict(zip(keys, key, strict=True))
        panel, node = key[0] == "panel", key[0] == "node"
        line["quantity"] = len(members)
        line["total_length_m"] = None if panel else total(members, "length_mm") * 1e-3
        line["total_area_m2"] = None if node else total(members, "area_m2")
        line["total_mass_kg"] = total(members, "mass_kg")
        result.append(line)
    return result


def write_bom(path: str | Path, rows: Sequence[Row]) -> Path:
    """Write the rows of ``bom_rows`` or ``cut_list`` as CSV and return the path.

    UTF-8, comma, ``\\n``; fixed decimals, so the same parts give the same bytes. The file appears
    whole or not at all.
    """
    path = Path(path)
    columns = CUT_LIST_COLUMNS if rows and "quantity" in rows[0] else BOM_COLUMNS
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    for row in rows:
        writer.writerow([_text(row[name], decimals) for name, decimals in columns.items()])
    with whole(path) as draft:
        draft.write_text(text.getvalue(), encoding="utf-8", newline="")
    return path


def least_boxes(polygons: Sequence[FloatArray]) -> FloatArray:
    """Return the (N, 2) length and width in mm of the rectangle of least area around each polygon.

    The least rectangle lies along an edge of the convex hull, and every such edge joins two
    corners: all pairs of corners are tried, many polygons at once.
    """
    boxes = np.zeros((len(polygons), 2))
    counts = np.array([len(polygon) for polygon in polygons], np.int64)
    for n in np.unique(counts):
        members = np.flatnonzero(counts == n)
        first, second = np.triu_indices(n, 1)
        for chunk in np.array_split(members, max(1, len(members) * n**3 // 4_000_000)):
            points = np.stack([polygons[i] for i in chunk])
            x = points[:, second] - points[:, first]
            x = x / np.linalg.norm(x, axis=2, keepdims=True)
            y = np.stack([-x[..., 1], x[..., 0]], axis=2)
            spans = np.stack(
                [np.ptp(np.einsum("npi,nci->npc", axis, points), axis=2) for axis in (x, y)], axis=2
            )
            best = np.argmin(spans[..., 0] * spans[..., 1], axis=1)
            found = spans[np.arange(len(chunk)), best]
            boxes[chunk] = np.sort(found, axis=1)[:, ::-1]
    return boxes


def _areas(polygons: Sequence[FloatArray]) -> FloatArray:
    """Return the (N,) areas of counter-clockwise polygons in mm²."""
    if not polygons:
        return np.zeros(0)
    starts = np.cumsum([0] + [len(polygon) for polygon in polygons])
    ring = PolyMesh(np.zeros((0, 3)), np.arange(starts[-1]), starts)
    return area_and_centroid(np.concatenate(polygons), ring)[0]


def _flat_row(flat: FlatPart, kind: str, length: float, width: float, place: dict[str, str]) -> Row:
    row: Row = dict.fromkeys(BOM_COLUMNS)
    return row | {
        "mark": flat.mark,
        "kind": kind,
        "material": flat.material.name,
        "thickness_mm": flat.thickness,
        "length_mm": length,
        "width_mm": width,
        "sheet": place.get(flat.mark, ""),
    }


def _angles(values: Iterable[float]) -> str:
    # Adding 0.0 turns a rounded -0.000 into 0.000.
    return " ".join(f"{round(value, 3) + 0.0:.3f}" for value in values)


def _text(value: str | float | None, decimals: int | None) -> str:
    if value is None:
        return ""
    if isinstance(value, str) or decimals is None:
        return str(value)
    return f"{round(value, decimals) + 0.0:.{decimals}f}"

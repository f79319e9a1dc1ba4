"""What the page tells of each part: its numbers, its edges, its neighbours, its sheet."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from phexfab.fabrication.bom import least_boxes
from phexfab.fabrication.parts import Beam, Node, Panel
from phexfab.parallel.shell import Shell
from phexfab.report.data import ReportData
from phexfab.report.text import number, quantity

FloatArray = NDArray[np.float64]

LABELS = {
    "panel": ("Material", "Thickness", "Blank", "Area", "Mass", "Corners"),
    "beam": ("Material", "Section", "Between nodes", "Bar", "Mass", "Panels meet at"),
    "node": ("Material", "Diameter", "Length", "Mass"),
}
"""What the values of a part of each kind are, in order."""
EDGES = ("Length", "Corner", "Fold", "Bevel", "Beam", "Panel")
"""The columns of a panel's edges: mm, the angle at the edge's first corner, the angle between the
panels that meet, the bevel (degrees), the marks of what lies under and beyond it."""
ENDS = ("Node", "Left", "Right", "Slope")
"""The columns of a beam's ends: the node, both mitres and the slope (degrees)."""


def part_details(data: ReportData) -> dict[str, Any]:
    """Return what is known of each part, by its mark, ready for JSON.

    Each part has ``kind``; ``values``, in the order of ``LABELS``; ``rows``, in the order of
    ``EDGES`` or ``ENDS``; ``near``, the marks of its neighbours; and ``sheet``, its name.
    """
    parts = data.parts
    sheet = {p.mark: s.name for s in data.sheets for p in s.placements}
    folds = _folds(data.shell)
    found = {
        **_panels(parts.panels, parts.beams, data.shell, folds),
        **{beam.mark: _beam(beam, folds) for beam in parts.beams},
        **{node.mark: _node(node) for node in parts.nodes},
    }
    for mark, entry in found.items():
        if mark in sheet:
            entry["sheet"] = sheet[mark]
    return found


def part_note(entry: dict[str, Any]) -> str:
    """Return the few words that stand beside the pointer."""
    values = dict(zip(LABELS[entry["kind"]], entry["values"], strict=True))
    size = {
        "panel": lambda: f"{values['Thickness']} {values['Material']}, {values['Area']}",
        "beam": lambda: f"{values['Between nodes']} long, {values['Material']}",
        "node": lambda: f"⌀ {values['Diameter']} × {values['Length']}, {values['Material']}",
    }[entry["kind"]]()
    kind = "hub" if entry["kind"] == "node" else entry["kind"]
    return f"{kind}, {size}, {values['Mass']}"


def _panels(
    panels: tuple[Panel, ...], beams: tuple[Beam, ...], shell: Shell, folds: FloatArray
) -> dict[str, dict[str, Any]]:
    mesh = shell.mesh
    rows = {_ends(edge[0], edge[1]): k for k, edge in enumerate(shell.edges.tolist())}
    under = {beam.edge: beam.mark for beam in beams}
    boxes = least_boxes([panel.flat.blank for panel in panels])
    found = {}
    for panel, (long, wide) in zip(panels, boxes.tolist(), strict=True):
        flat = panel.flat
        along = np.roll(flat.outline, -1, 0) - flat.outline
        length = np.linalg.norm(along, axis=1)
        turn = np.degrees(
            np.arctan2(_cross(np.roll(along, 1, 0), along), (np.roll(along, 1, 0) * along).sum(1))
        )
        corners = mesh.corners[mesh.starts[panel.face] : mesh.starts[panel.face + 1]]
        edges = []
        beside = []
        for k, note in enumerate(flat.edges):
            edge = rows[_ends(int(corners[k]), int(corners[(k + 1) % len(corners)]))]
            beam = under.get(edge, "")
            edges.append(
                (
                    number(round(float(length[k]), 1), 6),
                    _degrees(180.0 - float(turn[k])),
                    _degrees(float(folds[edge])) if note.neighbour else "",
                    _degrees(note.bevel),
                    beam,
                    note.neighbour,
                )
            )
            beside += [mark for mark in (note.neighbour, beam) if mark]
        found[panel.mark] = {
            "kind": "panel",
            "values": (
                flat.material.name,
                quantity(flat.thickness, "mm"),
                f"{number(round(long))} × {quantity(round(wide), 'mm')}",
                quantity(panel.area / 1e6, "m²"),
                quantity(panel.mass, "kg"),
                number(len(corners)),
            ),
            "rows": edges,
            "near": beside,
        }
    return found


def _beam(beam: Beam, folds: FloatArray) -> dict[str, Any]:
    flat = beam.flat
    long, high = np.ptp(flat.blank, axis=0).tolist()
    fold = float(folds[beam.edge])
    return {
        "kind": "beam",
        "values": (
            flat.material.name,
            f"{number(flat.thickness)} × {quantity(round(high, 1), 'mm')}",
            quantity(round(beam.length, 1), "mm", 6),
            quantity(round(long, 1), "mm", 6),
            quantity(beam.mass, "kg"),
            "" if np.isnan(fold) else _degrees(fold),
        ),
        "rows": [
            (node, _degrees(left), _degrees(right), _degrees(slope))
            for node, (left, right), slope in zip(beam.nodes, beam.mitres, beam.slopes, strict=True)
        ],
        "near": list(beam.neighbours),
    }


def _node(node: Node) -> dict[str, Any]:
    drum = node.cylinder
    return {
        "kind": "node",
        "values": (
            node.material.name,
            quantity(2 * drum.radius, "mm"),
            quantity(round(drum.length, 1), "mm"),
            quantity(node.mass, "kg"),
        ),
        "rows": [],
        "near": list(node.neighbours),
    }


def _folds(shell: Shell) -> FloatArray:
    """Return the (E,) angles between the panels that meet at each edge, NaN on the border."""
    left, right = shell.edges[:, 2], shell.edges[:, 3]
    normals = shell.normals[shell.panels]
    a, b = normals[left], normals[right]
    angle = np.degrees(np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(1)))
    return np.where(right < 0, np.nan, angle)


def border_beams(data: ReportData) -> list[bool]:
    """Return for each beam whether it stands on the border of the shell."""
    border = data.shell.edges[:, 3] < 0
    return [bool(border[beam.edge]) for beam in data.parts.beams]


def cut_panels(data: ReportData) -> list[bool]:
    """Return for each panel whether a rim cuts it."""
    shell = data.shell
    cut = np.zeros(shell.mesh.n_faces, bool)
    cut[shell.edges[shell.rim_edges, 2]] = True
    return [bool(cut[panel.face]) for panel in data.parts.panels]


def _ends(i: int, j: int) -> tuple[int, int]:
    return (i, j) if i < j else (j, i)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _degrees(angle: float) -> str:
    return quantity(round(angle, 1) + 0.0, "deg")

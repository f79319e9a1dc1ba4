"""A comparison as a value: figures in rows, written as tables and as a picture."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

from phexfab.mesh.polymesh import PolyMesh

Figure = float | int | str | None

COLUMNS: dict[str, tuple[str, str]] = {
    "panels": ("panels", ""),
    "nodes": ("nodes", ""),
    "members": ("members", ""),
    "valence": ("members at an inner node", ""),
    "covered_area": ("area covered", "m²"),
    "panel_area": ("mean panel area", "m²"),
    "panel_length": ("mean panel length", "mm"),
    "longest_panel": ("longest panel", "mm"),
    "nonconvex_panels": ("non-convex panels", ""),
    "member_length": ("length of all members", "m"),
    "member_length_per_area": ("members per area", "m/m²"),
    "nodes_per_area": ("nodes per area", "1/m²"),
    "box_waste": ("waste in bounding rectangles", "%"),
    "nest_waste": ("waste in nests", "%"),
    "sheets": ("sheets", ""),
    "torsion": ("largest node torsion", "°"),
    "mean_torsion": ("mean node torsion", "°"),
    "best_torsion": ("largest with the best axes", "°"),
    "planarity": ("planarity / mean edge", ""),
    "offset_types": ("exact offset types", ""),
    "offset_miss": ("best offset's error / distance", ""),
    "member_mass": ("mass of members", "kg"),
    "panel_mass": ("mass of panels", "kg"),
    "mass_per_area": ("mass of both per area", "kg/m²"),
    "deviation": ("largest deviation", "mm"),
    "mean_deviation": ("mean deviation", "mm"),
}
"""Key of a figure: what it is, and its unit; ``compare`` says how it is measured."""


@dataclass(frozen=True, eq=False)
class Row:
    """One way to panel the surface.

    Attributes
    ----------
    name : str
        ``"triangles"``, ``"quads"`` or ``"hexagons"``.
    mesh : PolyMesh
        mm.
    figures : mapping
        Keyed by ``COLUMNS``; None where there is no such number.
    notes : tuple of str
        What else a reader should know.
    """

    name: str
    mesh: PolyMesh
    figures: Mapping[str, Figure]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Comparison:
    """A surface panelled with triangles, planar quadrilaterals and planar hexagons.

    Attributes
    ----------
    title : str
    equal : str
        ``"size"`` or ``"deviation"``: what is the same in all three.
    rows : tuple of Row
    """

    title: str
    equal: str
    rows: tuple[Row, ...]

    def row(self, name: str) -> Row:
        """Return the row of that name."""
        for row in self.rows:
            if row.name == name:
                return row
        raise KeyError(name)

    def write(self, directory: str | PathLike[str]) -> Path:
        """Write ``comparison.csv``, ``comparison.json`` and ``comparison.png`` into a folder.

        Numbers have six digits in both tables; the same design gives the same bytes.
        """
        from phexfab.report.comparison import comparison_figure

        target = Path(directory)
        target.mkdir(parents=True, exist_ok=True)
        (target / "comparison.csv").write_text(self.to_csv(), encoding="utf-8", newline="")
        (target / "comparison.json").write_text(self.to_json(), encoding="utf-8", newline="")
        comparison_figure(
            f"{self.title}: equal {self.equal}",
            [(row.name, row.mesh) for row in self.rows],
            self.table(),
            target / "comparison.png",
        )
        return target

    def table(self) -> list[tuple[str, ...]]:
        """Return a line per figure, as texts: what it is, and its value in every row."""
        return [
            (
                f"{label}, {unit}" if unit else label,
                *(_short(row.figures[key]) for row in self.rows),
            )
            for key, (label, unit) in COLUMNS.items()
        ]

    def to_csv(self) -> str:
        """Return a line per way to panel; units are in the heads of the columns."""
        text = io.StringIO(newline="")
        writer = csv.writer(text, lineterminator="\n")
        heads = [f"{key} [{unit}]" if unit else key for key, (_, unit) in COLUMNS.items()]
        writer.writerow(["paneling", *heads])
        for row in self.rows:
            values = [_digits(row.figures[key]) for key in COLUMNS]
            writer.writerow([row.name, *("" if value is None else value for value in values)])
        return text.getvalue()

    def to_json(self) -> str:
        """Return the figures, their units and what they mean as JSON."""
        data = {
            "title": self.title,
            "equal": self.equal,
            "columns": {key: {"is": label, "unit": unit} for key, (label, unit) in COLUMNS.items()},
            "rows": {
                row.name: {key: _digits(row.figures[key]) for key in COLUMNS}
                | {"notes": list(row.notes)}
                for row in self.rows
            },
        }
        return json.dumps(data, indent=1, ensure_ascii=False) + "\n"


def _digits(value: Figure) -> Figure:
    """Return a number of six digits: more would be noise."""
    return float(f"{value:.6g}") if isinstance(value, float) else value


def _short(value: Figure) -> str:
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"
    return str(value)

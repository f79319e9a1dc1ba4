"""The shell's faces coloured by curvature, with the numbers: PLY for analysis, OBJ for rendering.

Panels share no corners, so that each keeps its own colour in programs that colour corners, and
they are cut into triangles, since few programs fill a non-convex face rightly.

References
----------
Turk 1994, The PLY polygon file format; Wavefront, Object files, appendix B1 of the Advanced
Visualizer manual.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from phexfab.whole import whole

if TYPE_CHECKING:
    from phexfab.report.scene import Layer

FloatArray = NDArray[np.float64]

CLASSES = 9
"""Materials in an OBJ file: colours in so many steps."""


@dataclass(frozen=True, eq=False)
class Measured:
    """A number for every panel: name, unit and (P,) values."""

    name: str
    unit: str
    values: FloatArray

    @property
    def key(self) -> str:
        """The name as a word: ``gaussian_curvature``."""
        return re.sub(r"[^a-z0-9]+", "_", self.name.lower()).strip("_")


def write_ply(layer: Layer, measures: Sequence[Measured], path: str | Path, title: str) -> Path:
    """Write faces as binary PLY: colours on corners and faces, numbers as properties of faces.

    Parameters
    ----------
    layer : Layer
        One part per panel, with its colour; in mm.
    measures : sequence of Measured
    path : str or Path
    title : str
    """
    scalars = [measure.key for measure in measures]
    colour = ["property uchar red", "property uchar green", "property uchar blue"]
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"comment {title.encode('ascii', 'replace').decode()}; coordinates in mm",
        *(f"comment {m.key} in {m.unit.translate(_ASCII) or '1'}" for m in measures),
        *(f"comment part {k} {mark}" for k, mark in enumerate(layer.marks)),
        f"element vertex {len(layer.vertices)}",
        *(f"property double {axis}" for axis in "xyz"),
        *colour,
        f"element face {len(layer.triangles)}",
        "property list uchar int vertex_indices",
        *colour,
        "property int part",
        *(f"property float {key}" for key in scalars),
        "end_header\n",
    ]
    rgb = np.round(255 * layer.colours).astype(np.uint8)
    vertices = np.zeros(len(layer.vertices), [("p", "<f8", 3), ("c", "u1", 3)])
    vertices["p"], vertices["c"] = layer.vertices, rgb[layer.vertex_part]
    kind = [("n", "u1"), ("v", "<i4", 3), ("c", "u1", 3), ("part", "<i4")]
    faces = np.zeros(len(layer.triangles), [*kind, ("values", "<f4", len(measures))])
    faces["n"], faces["v"], faces["c"] = 3, layer.triangles, rgb[layer.part]
    faces["part"] = layer.part
    faces["values"] = np.column_stack([m.values for m in measures])[layer.part]
    with whole(path) as draft:
        draft.write_bytes("\n".join(header).encode("ascii") + vertices.tobytes() + faces.tobytes())
    return Path(path)


def write_coloured_obj(
    layer: Layer, measure: Measured, path: str | Path, title: str
) -> tuple[Path, Path]:
    """Write faces as OBJ, a group per mark, and an MTL file of the same name beside it.

    Corners carry the exact colour, which some programs show; the materials are the colours of nine
    classes of the measure, which all do. A comment at each group gives the number.
    """
    target = Path(path)
    materials = target.with_suffix(".mtl")
    finite = measure.values[np.isfinite(measure.values)]
    low, high = (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)
    span = high - low if high > low else 1.0
    step = np.clip(np.nan_to_num((measure.values - low) / span) * CLASSES, 0, CLASSES - 1)
    classes = step.astype(int)
    unit = measure.unit.translate(_ASCII)
    with whole(materials) as draft:
        draft.write_text("".join(_materials(layer, measure, classes, unit)), encoding="ascii")
    with whole(target) as draft, open(draft, "w", encoding="utf-8", newline="\n") as file:
        file.writelines(_object(layer, measure, classes, unit, materials.name, title))
    return target, materials


def _materials(
    layer: Layer, measure: Measured, classes: NDArray[np.int64], unit: str
) -> Iterator[str]:
    for k in np.unique(classes).tolist():
        own = classes == k
        red, green, blue = layer.colours[own].mean(axis=0).tolist()
        low, high = measure.values[own].min(), measure.values[own].max()
        yield (
            f"# {measure.key} {low:.6g} to {high:.6g} {unit}\nnewmtl {measure.key}_{k + 1}\n"
            f"Kd {red:.6f} {green:.6f} {blue:.6f}\nKa 0 0 0\nKs 0 0 0\nd 1\nillum 1\n"
        )


def _object(
    layer: Layer,
    measure: Measured,
    classes: NDArray[np.int64],
    unit: str,
    materials: str,
    title: str,
) -> Iterator[str]:
    yield f"# {title}; millimetres, z up\nmtllib {materials}\n"
    for point, colour in zip(
        layer.vertices.tolist(), layer.colours[layer.vertex_part].tolist(), strict=True
    ):
        x, y, z = point
        yield f"v {x!r} {y!r} {z!r} {colour[0]:.4f} {colour[1]:.4f} {colour[2]:.4f}\n"
    begin = np.searchsorted(layer.part, np.arange(len(layer.marks) + 1))
    rows = (layer.triangles + 1).tolist()
    for k, mark in enumerate(layer.marks):
        yield (
            f"# {measure.key} {measure.values[k]:.6g} {unit}\ng {mark}\n"
            f"usemtl {measure.key}_{classes[k] + 1}\n"
        )
        for a, b, c in rows[begin[k] : begin[k + 1]]:
            yield f"f {a} {b} {c}\n"


_ASCII = str.maketrans({"²": "2", "³": "3", "µ": "u", "°": "deg"})

"""Cut sheets as DXF: closed contours, single-stroke engraving, millimetres, one file a sheet.

What shops ask for: one closed polyline per contour, 1:1, a layer per operation, no blocks, no
splines, nothing twice, the origin at the sheet's corner. Written geometry is nominal; the kerf is
part of the spacing.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import NestingError
from phexfab.fabrication.layout import placed, sheet_yield
from phexfab.fabrication.marking import engraving
from phexfab.fabrication.parts import FlatPart, Sheet
from phexfab.whole import whole

if TYPE_CHECKING:
    from ezdxf.document import Drawing

FloatArray = NDArray[np.float64]
Engraving = Mapping[str, Sequence[FloatArray]]

LAYERS = {"CUT": (1, 25), "ENGRAVE": (5, 13), "SHEET": (8, 13), "NOTES": (7, 13)}
"""Layer: AutoCAD colour, line weight in 1/100 mm."""
VERSIONS = ("R2010", "R12")
_MILLIMETRES = 4
_EXACT = 1e-6  # mm by which a drawn edge may differ from the part's


def file_name(sheet: Sheet, meta: Mapping[str, str]) -> str:
    """Return ``project_sheet_quantity_revision.dxf``; the sheet names material and thickness."""
    words = [meta.get("project", ""), sheet.name, f"{len(sheet.placements)}pcs"]
    if meta.get("revision"):
        words.append(f"rev{meta['revision']}")
    slugs = [re.sub(r"[^A-Za-z0-9.]+", "-", word).strip("-.") for word in words]
    return "_".join(filter(None, slugs)) + ".dxf"


def write_sheets(
    sheets: Sequence[Sheet],
    flats: Mapping[str, FlatPart],
    folder: str | Path,
    meta: Mapping[str, str],
    *,
    version: str = "R2010",
    marks: Engraving | None = None,
) -> list[Path]:
    """Write a DXF file per sheet into a folder, which is made where it is missing.

    Parameters
    ----------
    sheets : sequence of Sheet
    flats : mapping of mark to FlatPart
    folder : path
    meta : mapping
        ``project``, ``revision`` and ``author``, for the file names and the notes.
    version : {"R2010", "R12"}
    marks : mapping of mark to polylines, optional
        The engraving, in the coordinates of the flat patterns; made where it is not given.

    Raises
    ------
    NestingError
        If the version is unknown, a part is missing, or the file, read back, is not what was drawn.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    return [
        write_sheet(
            sheet, flats, folder / file_name(sheet, meta), meta, version=version, marks=marks
        )
        for sheet in sheets
    ]


def write_sheet(
    sheet: Sheet,
    flats: Mapping[str, FlatPart],
    path: str | Path,
    meta: Mapping[str, str],
    *,
    version: str = "R2010",
    marks: Engraving | None = None,
) -> Path:
    """Write one sheet, read back and audited, whole or not at all. See ``write_sheets``."""
    import ezdxf

    if version not in VERSIONS:
        raise NestingError(f"DXF version {version!r}: choose one of {', '.join(VERSIONS)}")
    missing = [p.mark for p in sheet.placements if p.mark not in flats]
    if missing:
        raise NestingError(
            f"sheet {sheet.name} holds {missing[0]}, whose flat pattern is not given"
        )
    with _fixed_meta_data():
        drawing = ezdxf.new(version, units=0 if version == "R12" else _MILLIMETRES)
        _draw(drawing, sheet, flats, meta, marks)
        # ezdxf adds classes in the order of a set, which differs from process to process.
        for name in sorted(drawing.entitydb.dxf_types_in_use()):
            drawing.classes.add_class(name)
        with whole(path) as draft:
            drawing.saveas(draft)
            _read_back(draft, sheet, flats)
    return Path(path)


def _read_back(path: Path, sheet: Sheet, flats: Mapping[str, FlatPart]) -> None:
    """Audit the written file and compare its contours with the parts, edge by edge."""
    import ezdxf

    drawing = ezdxf.readfile(path)
    findings = drawing.audit()
    if findings.has_issues:
        problem = (findings.errors + findings.fixes)[0]
        raise NestingError(f"the drawing of sheet {sheet.name} is not sound: {problem.message}")
    contours = []
    entity: Any  # LWPolyline, or Polyline in R12
    for entity in drawing.modelspace().query('*[layer=="CUT"]'):
        points = entity.vertices() if entity.dxftype() == "LWPOLYLINE" else entity.points()
        contours.append((bool(entity.is_closed), np.array([tuple(p)[:2] for p in points])))
    if len(contours) != len(sheet.placements):
        raise NestingError(
            f"the drawing of sheet {sheet.name} has {len(contours)} contours for "
            f"{len(sheet.placements)} parts"
        )
    for placement, (closed, points) in zip(sheet.placements, contours, strict=True):
        wanted = np.asarray(flats[placement.mark].outline, float)
        if not closed or len(points) != len(wanted):
            raise NestingError(f"the contour of {placement.mark} on {sheet.name} is not closed")
        drawn, exact = (np.hypot(*(np.roll(p, -1, axis=0) - p).T) for p in (points, wanted))
        error = float(np.abs(drawn - exact).max())
        if not error <= _EXACT:
            raise NestingError(
                f"an edge of {placement.mark} on {sheet.name} is {error:.3g} mm off its length"
            )


@contextmanager
def _fixed_meta_data() -> Iterator[None]:
    """Keep GUIDs and time stamps out of the file: the same sheet gives the same bytes."""
    import ezdxf

    before = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True
    try:
        yield
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = before


def _draw(
    drawing: Drawing,
    sheet: Sheet,
    flats: Mapping[str, FlatPart],
    meta: Mapping[str, str],
    marks: Engraving | None,
) -> None:
    if drawing.dxfversion > "AC1009":
        drawing.header["$MEASUREMENT"] = 1
    for name, (colour, weight) in LAYERS.items():
        layer = drawing.layers.add(name, color=colour)
        if drawing.dxfversion > "AC1009":
            layer.dxf.lineweight = weight
    space = drawing.modelspace()

    def line(points: FloatArray, layer: str, closed: bool) -> None:
        rows: Any = [(float(x), float(y)) for x, y in points]
        if drawing.dxfversion > "AC1009":
            space.add_lwpolyline(rows, close=closed, dxfattribs={"layer": layer})
        else:
            space.add_polyline2d(rows, close=closed, dxfattribs={"layer": layer})

    stock = sheet.stock
    line(_rectangle(0.0, stock.length, stock.width), "SHEET", True)
    line(_rectangle(stock.margin, stock.length, stock.width), "SHEET", True)
    for placement in sheet.placements:
        flat = flats[placement.mark]
        line(placed(flat.outline, placement), "CUT", True)
        strokes = engraving(flat) if marks is None else marks[placement.mark]
        for stroke in strokes:
            line(placed(stroke, placement), "ENGRAVE", False)
    height = max(12.0, stock.width / 60)
    for row, text in enumerate(_notes(sheet, flats, meta)):
        note = space.add_text(text, height=height, dxfattribs={"layer": "NOTES"})
        note.set_placement((0.0, -(row + 1) * 1.7 * height - 10.0))


def _rectangle(inset: float, length: float, width: float) -> FloatArray:
    x0, x1, y0, y1 = inset, length - inset, inset, width - inset
    return np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])


def _notes(sheet: Sheet, flats: Mapping[str, FlatPart], meta: Mapping[str, str]) -> list[str]:
    stock = sheet.stock
    share = 100 * sheet_yield(sheet, [flats[p.mark] for p in sheet.placements])
    title = [meta.get("project", ""), sheet.name]
    if meta.get("revision"):
        title.append(f"revision {meta['revision']}")
    if meta.get("author"):
        title.append(meta["author"])
    return [
        " - ".join(filter(None, title)),
        f"{sheet.material.name}, {sheet.thickness:g} mm, sheet {stock.length:g} x "
        f"{stock.width:g} mm, {len(sheet.placements)} parts, yield {share:.0f} %",
        "millimetres, nominal contours, seen from the outside; bevels in degrees, + where the part"
        " is larger on the far side",
    ]

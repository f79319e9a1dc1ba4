"""Rims from a table of points: CSV with commas, semicolons or tabs, one or several curves."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from phexfab.errors import DesignError
from phexfab.surface.rims.checks import UNITS, checked, unit_factor
from phexfab.surface.rims.corners import CORNER_ANGLE, corner_points
from phexfab.surface.rims.rim import Rim

LOOPS = ("loop", "rim", "curve")
"""Columns that name the closed curve to which a point belongs."""
_YES = {"1", "true", "yes", "y", "x", "corner"}
_NO = {"", "0", "false", "no", "n"}
_HEADING = re.compile(r"^\s*([A-Za-z]+)\s*(?:[\[(_]\s*([A-Za-z]+)\s*[\])]?)?\s*$")


@dataclass(frozen=True)
class _Row:
    line: int
    cells: list[str]


@dataclass(frozen=True)
class _Point:
    line: int
    place: tuple[float, float, float]
    loop: str
    corner: bool


def read_rim_csv(
    path: str | Path,
    *,
    unit: str | None = None,
    corner_angle: float = CORNER_ANGLE,
    smooth: float | None = None,
) -> tuple[Rim, ...]:
    """Return the rims in a table of points.

    Columns x, y, z in this order, or in any order under a header that names them. Cells are
    separated by commas, tabs or semicolons; numbers may have decimal commas where cells are not
    separated by commas. A column ``loop`` (or ``rim``, ``curve``) or a blank line separates
    closed curves. A column ``corner`` with 1, yes or x marks corners; without it they are
    recognised, see `rim_corners.corner_points`. Lines that begin with # are comments.

    Parameters
    ----------
    path
        UTF-8 text.
    unit
        Of the numbers: one of ``rim_checks.UNITS``; by default what a header such as ``x [m]``
        says, or mm.
    corner_angle
        Degrees by which the polyline must turn for a corner to be recognised; 180: none.
    smooth
        Round every corner within this length (mm), see `Rim.smoothed`.

    Raises
    ------
    DesignError
        Naming the file and the line for cells that are no numbers, and the rim and the place for
        curves that cannot be rims (`rim_checks`).
    """
    file = Path(path)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise DesignError(f"{file}: there is no such file; check the path") from None
    except (OSError, UnicodeDecodeError) as error:
        raise DesignError(f"{file}: cannot be read as text: {error}") from error
    blocks, separator = _blocks(text)
    if not blocks:
        raise DesignError(f"{file.name}: there are no points; write a line x,y,z for each")
    columns, stated = _columns(blocks, file.name)
    used = unit or stated or "mm"
    factor = unit_factor(used, file.name)
    decimal_comma = separator != ","
    curves: dict[tuple[int, str], list[_Point]] = {}
    for number, block in enumerate(blocks):
        for row in block:
            point = _point(row, columns, decimal_comma, file.name)
            # A named loop may go on after a blank line.
            curves.setdefault((0 if point.loop else number, point.loop), []).append(point)
    rims = []
    for position, ((_, loop), points) in enumerate(curves.items()):
        title = file.name if len(curves) == 1 else f"{file.name}:{loop or position + 1}"
        rims.append(_rim(points, factor, title, corner_angle, "corner" in columns))
    return checked(rims, used, file.name, smooth)


def _rim(points: Sequence[_Point], factor: float, title: str, angle: float, marked: bool) -> Rim:
    where = [[factor * value for value in point.place] for point in points]
    if marked:
        corners = [k for k, point in enumerate(points) if point.corner]
    else:
        corners = corner_points(where, angle).tolist()
    try:
        return Rim.through(where, corners, title)
    except DesignError as error:
        lines = f"{points[0].line} to {points[-1].line}"
        raise DesignError(f"{error} (lines {lines}; points count from 0)") from None


def _blocks(text: str) -> tuple[list[list[_Row]], str]:
    """Rows between blank lines, and the separator."""
    lines = [(k, line) for k, line in enumerate(text.splitlines(), 1)]
    lines = [(k, line) for k, line in lines if not line.lstrip().startswith("#")]
    body = "\n".join(line for _, line in lines)
    separator = next((mark for mark in (";", "\t", ",") if mark in body), " ")
    blocks: list[list[_Row]] = [[]]
    for number, line in lines:
        if not line.strip().strip(separator).strip():
            blocks.append([])
            continue
        if separator == " ":
            cells = line.split()
        else:
            cells = next(csv.reader(io.StringIO(line), delimiter=separator))
        blocks[-1].append(_Row(number, [cell.strip() for cell in cells]))
    return [block for block in blocks if block], separator


def _columns(blocks: list[list[_Row]], name: str) -> tuple[dict[str, int], str]:
    """Place of each named column, and the unit that the header states; the header is removed."""
    head = blocks[0][0]
    if not any(re.search("[A-Za-z]", cell) and not _is_number(cell) for cell in head.cells):
        if len(head.cells) != 3:
            raise DesignError(
                f"{name}, line {head.line}: {len(head.cells)} columns without a header; give "
                "x, y, z, or name the columns in a header: x,y,z,loop,corner"
            )
        return {"x": 0, "y": 1, "z": 2}, ""
    columns: dict[str, int] = {}
    units = set()
    for place, cell in enumerate(head.cells):
        match = _HEADING.match(cell)
        key = match.group(1).lower() if match else cell.lower()
        key = "loop" if key in LOOPS else key
        if key in columns:
            raise DesignError(f"{name}, line {head.line}: two columns are called {key!r}")
        columns[key] = place
        if match and match.group(2) and key in {"x", "y", "z"}:
            units.add(match.group(2))
    missing = [key for key in ("x", "y", "z") if key not in columns]
    if missing:
        raise DesignError(
            f"{name}, line {head.line}: no column {', '.join(missing)} among "
            f"{', '.join(head.cells)}; name the columns x, y, z"
        )
    if len(units) > 1 or not units <= set(UNITS):
        raise DesignError(
            f"{name}, line {head.line}: units {', '.join(sorted(units))} in the header; give one "
            f"of {', '.join(UNITS)}"
        )
    blocks[0] = blocks[0][1:]
    if not blocks[0]:
        del blocks[0]
    if not blocks:
        raise DesignError(f"{name}: there is a header but there are no points")
    return columns, units.pop() if units else ""


def _is_number(cell: str) -> bool:
    try:
        float(cell.replace(",", "."))
    except ValueError:
        return False
    return True


def _point(row: _Row, columns: dict[str, int], decimal_comma: bool, name: str) -> _Point:
    here = f"{name}, line {row.line}"
    if len(row.cells) <= max(columns[key] for key in "xyz"):
        raise DesignError(f"{here}: {len(row.cells)} cells; x, y and z are needed")
    values = []
    for key in "xyz":
        cell = row.cells[columns[key]]
        number = cell.replace(",", ".") if decimal_comma else cell
        try:
            value = float(number)
        except ValueError:
            raise DesignError(
                f"{here}: {key} = {cell!r} is no number; write 1234.5, or with semicolons "
                "between cells 1234,5"
            ) from None
        if not math.isfinite(value):
            raise DesignError(f"{here}: {key} = {cell}; every coordinate must be finite")
        values.append(value)
    extra = {
        key: row.cells[columns[key]] if key in columns and columns[key] < len(row.cells) else ""
        for key in ("loop", "corner")
    }
    mark = extra["corner"].lower()
    if mark not in _YES | _NO:
        raise DesignError(f"{here}: corner = {extra['corner']!r}; write 1 or 0")
    return _Point(row.line, (values[0], values[1], values[2]), extra["loop"], mark in _YES)

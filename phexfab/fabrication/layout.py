"""A layout of parts on sheets as a value: verified, measured, kept as JSON.

A nest takes a minute and may end by the clock, so its layout is kept beside the drawings and used
again while the fingerprint of everything that went into it is unchanged.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from math import fsum

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import NestingError
from phexfab.fabrication.parts import FlatPart, Material, Placement, Sheet, Stock
from phexfab.fabrication.shelf import turned

FloatArray = NDArray[np.float64]

_TOLERANCE = 1e-6  # mm
_FORMAT = 1


@dataclass(frozen=True)
class Nest:
    """All sheets of a job, with what happened on the way.

    Attributes
    ----------
    sheets : tuple of Sheet
    notes : tuple of str
        What a reader of the report should know: a packer that gave up, a clock that ran out.
    fingerprint : str
        Of the parts, the stock and the settings; see ``fingerprint``.
    reused : bool
        True when the layout was taken from a previous one.
    """

    sheets: tuple[Sheet, ...]
    notes: tuple[str, ...] = ()
    fingerprint: str = ""
    reused: bool = False


def placed(contour: FloatArray, placement: Placement) -> FloatArray:
    """Return a contour where it lies on the sheet: turned about the origin, then moved."""
    return turned(np.asarray(contour, float), placement.angle) + np.array(
        [placement.x, placement.y]
    )


def sheet_yield(sheet: Sheet, flats: Iterable[FlatPart]) -> float:
    """Return the share of the sheet's area that becomes parts (0 to 1)."""
    parts = {flat.mark: flat for flat in flats}
    area = fsum(_area(parts[p.mark].outline) for p in sheet.placements)
    return area / (sheet.stock.length * sheet.stock.width)


def _area(contour: FloatArray) -> float:
    x, y = np.asarray(contour, float).T
    return 0.5 * abs(float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y)))


def verify_layout(sheets: Sequence[Sheet], flats: Sequence[FlatPart]) -> None:
    """Check that every part lies once on a sheet of its own kind, clear of the others.

    Parameters
    ----------
    sheets : sequence of Sheet
    flats : sequence of FlatPart
        All parts that must be found on the sheets.

    Raises
    ------
    NestingError
        If a part is missing, doubled, unknown, of another material or thickness, reaches into
        the margin, or lies closer to another than the spacing (less 1e-6 mm); the message names
        the parts and the sheet.
    """
    parts = {flat.mark: flat for flat in flats}
    seen: dict[str, str] = {}
    for sheet in sheets:
        for placement in sheet.placements:
            mark = placement.mark
            if mark not in parts:
                raise NestingError(f"sheet {sheet.name} holds {mark}, which is no part of this job")
            if mark in seen:
                raise NestingError(f"{mark} lies on {seen[mark]} and on {sheet.name}; nest again")
            seen[mark] = sheet.name
            flat = parts[mark]
            if (flat.material, flat.thickness) != (sheet.material, sheet.thickness):
                raise NestingError(
                    f"{mark} is {flat.material.name} {flat.thickness:g} mm but lies on "
                    f"{sheet.name}, {sheet.material.name} {sheet.thickness:g} mm"
                )
        _verify_sheet(sheet, parts)
    missing = [flat.mark for flat in flats if flat.mark not in seen]
    if missing:
        raise NestingError(f"{len(missing)} parts lie on no sheet, the first is {missing[0]}")


def _verify_sheet(sheet: Sheet, parts: Mapping[str, FlatPart]) -> None:
    import shapely

    if not sheet.placements:
        raise NestingError(f"sheet {sheet.name} is empty")
    stock = sheet.stock
    blanks = np.array(
        [shapely.Polygon(placed(parts[p.mark].blank, p)) for p in sheet.placements], object
    )
    bounds = shapely.bounds(blanks)
    inside = np.column_stack([bounds[:, :2], np.array([stock.length, stock.width]) - bounds[:, 2:]])
    free = inside.min(axis=1)
    worst = int(free.argmin())
    if not free[worst] >= stock.margin - _TOLERANCE:
        raise NestingError(
            f"{sheet.placements[worst].mark} lies {free[worst]:.6g} mm from the border of "
            f"{sheet.name}; the margin is {stock.margin:g} mm"
        )
    tree = shapely.STRtree(blanks)
    reach = max(stock.spacing - _TOLERANCE, 0.0)
    i, j = tree.query(blanks, predicate="dwithin", distance=reach)
    i, j = i[i < j], j[i < j]
    if reach == 0.0:  # parts may touch, but not overlap
        over = shapely.area(shapely.intersection(blanks[i], blanks[j])) > _TOLERANCE
        i, j = i[over], j[over]
    if len(i):
        gap = shapely.distance(blanks[i], blanks[j])
        k = int(gap.argmin())
        first, second = (sheet.placements[int(n[k])].mark for n in (i, j))
        raise NestingError(
            f"{first} and {second} lie {gap[k]:.6g} mm apart on {sheet.name}; "
            f"the spacing is {stock.spacing:g} mm"
        )


def fingerprint(flats: Sequence[FlatPart], settings: Mapping[str, object]) -> str:
    """Return the SHA-256 of the parts, rounded to 1e-6 mm, and of the settings."""
    digest = hashlib.sha256(json.dumps(settings, sort_keys=True).encode())
    for flat in flats:
        head = [flat.mark, flat.material.name, flat.material.density, flat.thickness]
        digest.update(json.dumps(head).encode())
        for contour in (flat.outline, flat.blank):
            digest.update(json.dumps((np.round(contour, 6) + 0.0).tolist()).encode())
    return digest.hexdigest()


def layout_to_json(nest: Nest) -> str:
    """Return the layout as JSON text, one placement a line, always the same bytes."""
    sheets = []
    for sheet in nest.sheets:
        head = json.dumps(
            {
                "name": sheet.name,
                "stock": asdict(sheet.stock),
                "thickness": sheet.thickness,
                "material": asdict(sheet.material),
            }
        )
        rows = ",\n".join("   " + json.dumps([p.mark, p.angle, p.x, p.y]) for p in sheet.placements)
        sheets.append(f'  {head[:-1]}, "placements": [\n{rows}\n  ]}}')
    body = ",\n".join(sheets)
    return (
        f'{{"format": {_FORMAT},\n "fingerprint": {json.dumps(nest.fingerprint)},\n'
        f' "notes": {json.dumps(list(nest.notes))},\n "sheets": [\n{body}\n ]}}\n'
    )


def layout_from_json(text: str) -> Nest:
    """Return the layout kept in JSON text by ``layout_to_json``.

    Raises
    ------
    NestingError
        If the text is not such a layout.
    """
    try:
        data = json.loads(text)
        if data["format"] != _FORMAT:
            raise NestingError(
                f"the kept layout has format {data['format']}, not {_FORMAT}; nest again"
            )
        sheets = tuple(
            Sheet(
                item["name"],
                Stock(**item["stock"]),
                item["thickness"],
                Material(**item["material"]),
                tuple(
                    Placement(str(mark), float(angle), float(x), float(y))
                    for mark, angle, x, y in item["placements"]
                ),
            )
            for item in data["sheets"]
        )
        notes = tuple(str(note) for note in data["notes"])
        return Nest(sheets, notes, str(data["fingerprint"]), reused=True)
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, NestingError):
            raise
        raise NestingError(f"the kept layout cannot be read ({error}); nest again") from error

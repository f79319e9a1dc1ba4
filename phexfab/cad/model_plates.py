"""The panels of a scale model, laid flat on printer plates with their marks engraved.

Every panel lies on the side that its normal points to, so that this side comes out smooth, and
carries its mark on the side that is seen from within.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray
from shapely.geometry.polygon import orient

from phexfab.cad.scale_model import ScaleModel, as_arrays, snapped
from phexfab.cad.triangles import Body
from phexfab.errors import PartError
from phexfab.fabrication.marking import EDGE_CLEARANCE, marking
from phexfab.fabrication.parts import EdgeNote, FlatPart, Panel
from phexfab.whole import whole

FloatArray = NDArray[np.float64]

ENGRAVED = 0.4  # mm deep: two common layers
_STROKE = (0.5, 1.2)  # mm wide, at least and at most: a common nozzle is 0.4 mm
_STROKE_SHARE = 1 / 7  # of the letters' height
_LETTERS = 1.8  # mm high, at least: what can still be read
_CLEARANCE = 1.0  # mm between letters and the panel's contour
_MARGIN, _SPACING = 5.0, 3.0  # mm: kept free on the bed's border, and between panels


@dataclass(frozen=True, eq=False)
class Plate:
    """One load of the printer's bed.

    Attributes
    ----------
    number : int
        From 1.
    panels : tuple of Body
        Named by their marks, lying on the bed, in mm.
    unmarked : tuple of str
        Panels with no room for their mark; it is their name all the same.
    rows : tuple of int
        For each panel the row on the bed, from 1 at the front.
    """

    number: int
    panels: tuple[Body, ...]
    unmarked: tuple[str, ...]
    rows: tuple[int, ...]


def panel_plates(panels: Sequence[Panel], spec: ScaleModel, scale: float) -> tuple[Plate, ...]:
    """Lay the panels of a scale model on printer plates, row by row in the order of their marks.

    Parameters
    ----------
    panels : sequence of Panel
    spec : ScaleModel
    scale : float
        20 is 1:20.

    Returns
    -------
    tuple of Plate
        Panels are as thick as in the building, divided by the scale, but no thinner than the wall
        below the engraving.

    Raises
    ------
    PartError
        If a panel is larger than the bed.
    """
    plates: list[Plate] = []
    bodies: list[Body] = []
    bare: list[str] = []
    rows: list[int] = []
    row = 1
    x = y = depth = _MARGIN  # where the next panel goes, and where its row ends
    for panel in panels:
        flat = _small(panel.flat, scale, spec.wall)
        points, triangles, marked = _engraved(flat)
        points = _turned_to_fit(points, spec, scale, flat.mark)
        width, height, _ = np.ptp(points, axis=0)
        if x + width > spec.bed[0] - _MARGIN:
            x, y, row = _MARGIN, depth + _SPACING, row + 1
        if y + height > spec.bed[1] - _MARGIN:
            plates.append(Plate(len(plates) + 1, tuple(bodies), tuple(bare), tuple(rows)))
            bodies, bare, rows, row = [], [], [], 1
            x = y = depth = _MARGIN
        corner = np.append(points[:, :2].min(axis=0), 0.0)
        bodies.append(snapped(flat.mark, points - corner + [x, y, 0.0], triangles))
        rows.append(row)
        if not marked:
            bare.append(flat.mark)
        x, depth = x + width + _SPACING, max(depth, y + height)
    return (*plates, Plate(len(plates) + 1, tuple(bodies), tuple(bare), tuple(rows)))


def write_listing(plates: Sequence[Plate], path: str | Path) -> None:
    """Write where on which plate every panel lies, as a table: for those too small for a mark.

    Columns: plate; row, from 1 at the front of the bed; place in the row, from 1 at the left;
    mark; x and y of the middle in mm; whether the mark or its number is engraved.
    """
    lines = ["plate,row,place,mark,x,y,engraved"]
    for plate in plates:
        places: dict[int, int] = {}
        for body, row in zip(plate.panels, plate.rows, strict=True):
            places[row] = places.get(row, 0) + 1
            x, y = (body.points.min(axis=0) + body.points.max(axis=0))[:2] / 2
            engraved = "no" if body.mark in plate.unmarked else "yes"
            lines.append(
                f"{plate.number},{row},{places[row]},{body.mark},{x:.1f},{y:.1f},{engraved}"
            )
    with whole(path) as draft:
        draft.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _turned_to_fit(points: FloatArray, spec: ScaleModel, scale: float, mark: str) -> FloatArray:
    """Turn a panel by a quarter where only that fits the bed; refuse one that fits neither way."""
    size = np.ptp(points, axis=0)[:2]
    room = np.array(spec.bed[:2]) - 2 * _MARGIN
    if (size <= room).all():
        return points
    if (size[::-1] <= room).all():
        return np.column_stack([-points[:, 1], points[:, 0], points[:, 2]])
    needed = scale * float((np.sort(size) / np.sort(room)).max())
    raise PartError(
        f"{mark} of a model at 1:{scale:g} is {size[0]:.0f} × {size[1]:.0f} mm and the bed leaves "
        f"{room[0]:g} × {room[1]:g} mm; take a scale of 1:{np.ceil(needed):.0f}, or a larger bed"
    )


def _small(flat: FlatPart, scale: float, wall: float) -> FlatPart:
    """Return a panel as it lies on the plate: to scale, seen from behind, thick enough."""
    outline = np.asarray(flat.outline, float)[::-1] * [-1, 1] / scale
    thickness = max(flat.thickness / scale, wall + ENGRAVED)
    notes = (EdgeNote("", 0.0),) * len(outline)
    return FlatPart(flat.mark, outline, outline, notes, thickness, flat.material)


def _engraved(flat: FlatPart) -> tuple[FloatArray, NDArray[np.int64], bool]:
    """Return points and triangles of a flat panel with its mark cut into its top."""
    from manifold3d import CrossSection, FillRule

    slab = CrossSection([flat.outline], FillRule.Positive).extrude(flat.thickness)
    lines, height = _lettering(flat)
    if not lines:
        return *as_arrays(slab), False
    width = float(np.clip(height * _STROKE_SHARE, *_STROKE))
    grooves = shapely.union_all(
        [shapely.LineString(line).buffer(width / 2, quad_segs=4) for line in lines]
    )
    rings = [
        np.asarray(ring.coords)[:-1]
        for polygon in shapely.get_parts(grooves)
        for oriented in (orient(polygon),)
        for ring in (oriented.exterior, *oriented.interiors)
    ]
    cutter = CrossSection(rings, FillRule.Positive).extrude(2 * ENGRAVED)
    return *as_arrays(slab - cutter.translate((0, 0, flat.thickness - ENGRAVED))), True


def _lettering(flat: FlatPart) -> tuple[list[FloatArray], float]:
    """Return the strokes of a panel's mark, of its bare number where that is all that fits."""
    number = flat.mark.lstrip("ABCDEFGHIJKLMNOPQRSTUVWXYZ").lstrip("0")
    if set(number) <= set("01689"):
        number += "."  # tells 66 from 99
    # Marks are laid out for the workshop, 3 mm from the contour; a model has less to spare.
    larger = EDGE_CLEARANCE / _CLEARANCE
    outline = larger * np.asarray(flat.outline, float)
    for text in (flat.mark, number):
        made = marking(replace(flat, mark=text, outline=outline, blank=outline))
        if made.height >= larger * _LETTERS:
            return [line / larger for line in made.lines], made.height / larger
    return [], 0.0

"""Where the engraving goes: the part mark, and at every edge whose neighbour it faces.

The mark is as large as fits, well inside the contour. Every edge that has a neighbour or a bevel
gets a short tick at its middle and, along it, the neighbour's mark and the bevel in degrees, such
as ``P018 +3.2``: positive where the part is larger on the side away from the viewer. A square edge
carries no figure. Nothing touches the contour, nor one text another.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from phexfab.fabrication.parts import EdgeNote, FlatPart
from phexfab.fabrication.shelf import resting_angle
from phexfab.fabrication.strokes import text_strokes, text_width

if TYPE_CHECKING:
    import shapely

FloatArray = NDArray[np.float64]

# A mark's letter height, the centre of its box and its direction in radians.
Spot = tuple[float, FloatArray, float]

EDGE_CLEARANCE = 3.0  # mm between engraving and contour
_AIR = 1.5  # mm between two texts
_TICK = 5.0
NOTE_HEIGHTS = (8.0, 6.0, 5.0, 4.0, 3.0, 2.5)
MARK_HEIGHT = 40.0
MARK_SMALLEST = 2.5
_SMALL_MARK = 12.0  # notes give way before the mark gets smaller than this
_FILL = 0.9  # share of its room that the mark takes
_GRID = 9
_NOWHERE: Spot = (0.0, np.zeros(2), 0.0)


@dataclass(frozen=True, eq=False)
class Marking:
    """The engraving of one part.

    Attributes
    ----------
    lines : tuple of (n, 2) arrays, mm
        Polylines in the coordinates of the flat pattern.
    height : float
        Height of the mark's letters, mm; 0 where not even the smallest fit.
    bare : tuple of int
        Edges with something to say whose note found no room: they have their tick only.
    """

    lines: tuple[FloatArray, ...]
    height: float
    bare: tuple[int, ...] = ()


def note_text(note: EdgeNote) -> str:
    """Return what is written along an edge: ``P018 +3.2``, ``P018`` when square, "" on a border.

    An edge cut to a ridge has two bevels, near and far side: ``N105 +60.3/-29.3``.
    """
    bevels = [note.bevel] if note.far_bevel is None else [note.bevel, note.far_bevel]
    figures = [f"{bevel:+.1f}" for bevel in bevels]
    square = all(float(figure) == 0.0 for figure in figures)
    return " ".join(filter(None, [note.neighbour, "" if square else "/".join(figures)]))


def engraving(flat: FlatPart) -> tuple[FloatArray, ...]:
    """Return the polylines to engrave on a part, in the coordinates of its flat pattern."""
    return marking(flat).lines


def marking(flat: FlatPart) -> Marking:
    """Lay out the engraving of a part.

    Parameters
    ----------
    flat : FlatPart

    Returns
    -------
    Marking
        All of it lies inside the outline, 3 mm or more from it.

    Raises
    ------
    DesignError
        If a mark holds a letter that has no strokes.
    """
    import shapely

    outline = np.asarray(flat.outline, float)
    region = _inside(shapely.Polygon(outline))
    if region is None:
        return Marking((), 0.0, tuple(k for k, note in enumerate(flat.edges) if note_text(note)))
    texts = {k: note_text(note) for k, note in enumerate(flat.edges) if note_text(note)}
    ticks = {k: tick for k in texts if (tick := _tick(outline, k, region)) is not None}
    lines = list(ticks.values())
    turn = -resting_angle(outline)

    notes: dict[int, FloatArray] = {}
    height = 0.0
    spot = _place_mark(flat.mark, region, lines, [], turn) if not texts else _NOWHERE
    for height in NOTE_HEIGHTS if texts else ():
        notes = _place_notes(outline, region, lines, texts, height)
        spot = _place_mark(flat.mark, region, lines, list(notes.values()), turn)
        if spot[0] >= _SMALL_MARK and len(notes) == len(texts):
            break
    else:
        if texts:
            spot, notes = _thin_out(flat.mark, region, lines, notes, turn)
    for k, box in notes.items():
        lines += _written(texts[k], height, box)
    mark_height, centre, angle = spot
    if mark_height > 0.0:
        lines += _written(flat.mark, mark_height, _box(flat.mark, mark_height, centre, angle))
    return Marking(tuple(lines), mark_height, tuple(k for k in texts if k not in notes))


def _thin_out(
    mark: str,
    region: shapely.Polygon,
    lines: Sequence[FloatArray],
    notes: dict[int, FloatArray],
    turn: float,
) -> tuple[Spot, dict[int, FloatArray]]:
    """Keep the notes, in order, that leave the mark the better part of its room."""
    alone = _place_mark(mark, region, lines, [], turn)
    enough = min(_SMALL_MARK, 0.7 * alone[0])
    spot = alone
    kept: dict[int, FloatArray] = {}
    for k, box in notes.items():
        trial = _place_mark(mark, region, lines, [*kept.values(), box], turn)
        if trial[0] >= enough:
            spot, kept[k] = trial, box
    return spot, kept


def _inside(polygon: shapely.Polygon) -> shapely.Polygon | None:
    """The polygon set back from its contour; of several pieces the largest, None when none."""
    region = polygon.buffer(-EDGE_CLEARANCE, join_style="mitre")
    if region.geom_type == "MultiPolygon":
        region = max(region.geoms, key=lambda piece: piece.area)
    return None if region.is_empty else region


def _frame(outline: FloatArray, k: int) -> tuple[FloatArray, FloatArray, float]:
    """Middle of edge ``k``, its unit direction (the inside lies to its left) and its length."""
    tail, head = outline[k], outline[(k + 1) % len(outline)]
    length = float(np.hypot(*(head - tail)))
    return (tail + head) / 2, (head - tail) / max(length, 1e-9), length


def _tick(outline: FloatArray, k: int, region: shapely.Polygon) -> FloatArray | None:
    """A short line square to the edge at its middle, shortened until it lies inside."""
    import shapely

    middle, along, _ = _frame(outline, k)
    inward = np.array([-along[1], along[0]])
    start = middle + inward * (EDGE_CLEARANCE + 1e-6)
    for length in (_TICK, _TICK / 2, _TICK / 4):
        line = np.array([start, start + inward * length])
        if region.covers(shapely.LineString(line)):
            return line
    return None


def _box(text: str, height: float, centre: FloatArray, angle: float) -> FloatArray:
    """Corners of a text's box about ``centre``: lower left first, counter-clockwise."""
    half = np.array([text_width(text, height), height]) / 2
    c, s = np.cos(angle), np.sin(angle)
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
    return np.asarray(corners @ np.array([[c, s], [-s, c]]) + centre)


def _wider(box: FloatArray, by: float) -> FloatArray:
    """The box grown by ``by`` on all sides."""
    x, y = box[1] - box[0], box[3] - box[0]
    x, y = by * x / np.hypot(*x), by * y / np.hypot(*y)
    return box + np.array([-x - y, x - y, x + y, y - x])


def _written(text: str, height: float, box: FloatArray) -> list[FloatArray]:
    along = box[1] - box[0]
    c, s = along / max(float(np.hypot(*along)), 1e-9)
    turn = np.array([[c, s], [-s, c]])
    return [stroke @ turn + box[0] for stroke in text_strokes(text, height)]


def _place_notes(
    outline: FloatArray,
    region: shapely.Polygon,
    ticks: Sequence[FloatArray],
    texts: Mapping[int, str],
    height: float,
) -> dict[int, FloatArray]:
    """Boxes for the notes that find room: above the tick, beside it, or further along the edge."""
    import shapely

    shapely.prepare(region)
    taken = [shapely.LineString(tick) for tick in ticks]
    boxes: dict[int, FloatArray] = {}
    for k, text in texts.items():
        middle, along, length = _frame(outline, k)
        inward = np.array([-along[1], along[0]])
        angle = float(np.arctan2(along[1], along[0]))
        if np.cos(angle) < -1e-9:  # no note stands on its head
            angle += np.pi
        half = text_width(text, height) / 2
        above = EDGE_CLEARANCE + _TICK + _AIR + height / 2
        beside = EDGE_CLEARANCE + height / 2 + 1e-6
        spots = [(0.0, above)]
        spots += [(side * (half + 2 * _AIR), beside) for side in (1, -1)]
        spots += [(side * part * length, above) for part in (0.1, 0.2, 0.3) for side in (1, -1)]
        spots += [(0.0, above + step * height) for step in (1.5, 3.0)]
        shifts = np.array(spots) @ np.array([along, inward])
        trials = _box(text, height, middle, angle) + shifts[:, None, :]
        polygons = shapely.polygons(trials)
        free = shapely.contains_properly(region, polygons)
        free[free] &= ~shapely.dwithin(polygons[free][:, None], taken, _AIR).any(axis=1)
        if free.any():
            best = int(np.flatnonzero(free)[0])
            boxes[k] = trials[best]
            taken.append(polygons[best])
    return boxes


def _place_mark(
    mark: str,
    region: shapely.Polygon,
    lines: Sequence[FloatArray],
    boxes: Sequence[FloatArray],
    turn: float,
) -> Spot:
    """Height, centre and angle (radians) of the largest mark along or across the part.

    In coordinates scaled by the text's shape its box is a square, and the square about a point
    is as large as the point's distance to the obstacles in the maximum norm: no search is needed
    for the size, only a grid, refined, for the point.
    """
    import shapely

    around = np.array([_wider(box, _AIR) for box in boxes]).reshape(-1, 4, 2)
    blocks = shapely.polygons(around)
    contours = [np.asarray(region.exterior.coords), *lines]
    contours += [np.vstack([block, block[:1]]) for block in around]
    segments = np.vstack([np.hstack([run[:-1], run[1:]]) for run in contours])
    shapely.prepare(region)
    aspect = text_width(mark, 1.0)
    # Where there is room for more than the largest mark, the point nearest the middle is taken.
    full = MARK_HEIGHT / 2 / _FILL
    middle = np.array(region.centroid.coords[0])
    best = _NOWHERE
    turns = sorted(((turn + way + 89.0) % 180.0 - 89.0 for way in (0.0, 90.0)), key=abs)
    for angle in np.radians(turns):
        c, s = np.cos(angle), np.sin(angle)
        to_text = np.array([[c, -s], [s, c]]) / np.array([aspect, 1.0])
        scaled = (segments.reshape(-1, 2) @ to_text).reshape(-1, 4)
        points = segments[:, :2] @ to_text
        low, high = points.min(axis=0), points.max(axis=0)
        back = np.linalg.inv(to_text)
        for _ in range(3):
            ticks = [np.linspace(a, b, _GRID) for a, b in zip(low, high, strict=True)]
            grid = np.stack(np.meshgrid(*ticks), axis=-1).reshape(-1, 2)
            world = grid @ back
            free = shapely.contains_xy(region, *world.T)
            free &= ~shapely.intersects_xy(blocks[:, None], *world.T).any(axis=0)
            reach = np.zeros(len(grid))
            reach[free] = _square_distance(grid[free], scaled)
            far = np.hypot(*(world - middle).T) / full
            k = int(np.argmax(np.round(np.minimum(reach, full) * (1 - 1e-3 * far), 9)))
            step = (high - low) / (_GRID - 1)
            low, high = grid[k] - step, grid[k] + step
            if 2 * reach[k] > best[0] * (1 + 1e-9):
                best = (2 * min(float(reach[k]), full), world[k], float(angle))
            if reach[k] >= full:
                break
        if best[0] >= 2 * full:
            break
    height, centre, angle = best
    height *= _FILL
    return (height, centre, angle) if height >= MARK_SMALLEST else _NOWHERE


def _square_distance(points: FloatArray, segments: FloatArray) -> FloatArray:
    """Distance from points (m, 2) to the nearest of segments (n, 4) in the maximum norm."""
    start = segments[None, :, :2] - points[:, None]
    step = (segments[:, 2:] - segments[:, :2])[None]
    x, y = start[..., 0], start[..., 1]
    dx, dy = step[..., 0], step[..., 1]
    # max(|x|, |y|) is convex along a segment: least at an end or where x, y, x+y or x-y vanishes.
    parameters = [np.zeros_like(x), np.ones_like(x)]
    for value, slope in ((x, dx), (y, dy), (x + y, dx + dy), (x - y, dx - dy)):
        slope = np.broadcast_to(slope, value.shape)
        safe = np.where(np.abs(slope) < 1e-12, 1.0, slope)
        parameters.append(np.clip(-value / safe, 0.0, 1.0))
    nearest = np.min(
        [np.maximum(np.abs(x + t * dx), np.abs(y + t * dy)) for t in parameters], axis=0
    )
    return np.asarray(nearest.min(axis=1))

"""What is engraved on a flat part: its mark, and along every edge the neighbour and the bevel.

All lettering lies inside the part, clear of its edges and of each other; panels are non-convex, so
every box is tested against the polygon itself.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely
from numpy.typing import NDArray

from phexfab.fabrication.parts import EdgeNote, FlatPart
from phexfab.fabrication.strokes import text_strokes, text_width

FloatArray = NDArray[np.float64]

MARK_HEIGHTS = (30.0, 25.0, 20.0, 16.0, 12.0, 10.0, 8.0, 6.0, 5.0, 4.0, 3.0)
NOTE_HEIGHTS = (9.0, 7.0, 6.0, 5.0, 4.0, 3.0, 2.5)
SLIDES = (0.5, 0.42, 0.58, 0.34, 0.66, 0.26, 0.74)
EDGE_CLEARANCE = 3.0  # mm between lettering and the contour
TICK_START, TICK_END = 1.0, 7.0  # mm inside the edge


@dataclass(frozen=True, eq=False)
class Marking:
    """The engraving of one part.

    Attributes
    ----------
    lines : tuple of (n, 2) arrays, mm
        Open polylines in the coordinates of the flat pattern.
    height : float
        Height of the mark's letters, mm; 0 where not even the smallest fits.
    bare : tuple of int
        Edges with something to say whose note found no room: they have their tick only.
    """

    lines: tuple[FloatArray, ...]
    height: float
    bare: tuple[int, ...]


def engraving(flat: FlatPart) -> tuple[FloatArray, ...]:
    """Return the polylines to engrave on a part, in the coordinates of its flat pattern."""
    return marking(flat).lines


def marking(flat: FlatPart) -> Marking:
    """Lay out the engraving of a part.

    The mark stands as large as it fits, up to 30 mm. Every edge with a neighbour or a bevel has a
    tick at its middle and, along it, the neighbour's mark and the bevel in degrees, such as
    ``P018 +3.2``: positive where the part is larger on the side away from the viewer. The end of a
    mitred bar has two, near and far side: ``N105 +60.3/-29.3``.
    """
    outline = np.asarray(flat.outline, float)
    part = shapely.Polygon(outline)
    room = part.buffer(-EDGE_CLEARANCE, join_style="mitre")
    shapely.prepare(room)
    lines: list[FloatArray] = []
    taken: list[shapely.Geometry] = []
    ticks, notes = _edge_notes(flat, outline, part)
    for tick in ticks.values():
        lines.append(tick)
        taken.append(shapely.LineString(tick).buffer(1.0))
    height = _place_mark(flat.mark, part, room, outline, taken, lines)
    bare = [
        edge
        for edge, text in notes.items()
        if not _place_note(text, edge, outline, room, taken, lines)
    ]
    return Marking(tuple(lines), height, tuple(bare))


def _edge_notes(
    flat: FlatPart, outline: FloatArray, part: shapely.Polygon
) -> tuple[dict[int, FloatArray], dict[int, str]]:
    """Return the ticks and the texts of the edges that have something to say."""
    ticks, notes = {}, {}
    for k, edge in enumerate(flat.edges):
        text = " ".join(filter(None, [edge.neighbour, _bevel_text(edge)]))
        if not text:
            continue
        notes[k] = text
        middle, _, inward = _edge_frame(outline, k, 0.5)
        tick = np.array([middle + TICK_START * inward, middle + TICK_END * inward])
        if part.contains(shapely.LineString(tick)):
            ticks[k] = tick
    return ticks, notes


def _bevel_text(edge: EdgeNote) -> str:
    """Return the bevel in degrees, both of them as near/far for a ridge, nothing for square."""
    bevels = [edge.bevel] if edge.far_bevel is None else [edge.bevel, edge.far_bevel]
    return "/".join(f"{b:+.1f}" for b in bevels) if any(abs(b) >= 0.05 for b in bevels) else ""


def _edge_frame(outline: FloatArray, k: int, t: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a point on edge k, the edge's direction and the direction into the part."""
    a, b = outline[k], outline[(k + 1) % len(outline)]
    along = (b - a) / np.linalg.norm(b - a)
    return a + t * (b - a), along, np.array([-along[1], along[0]])


def _box(centre: FloatArray, along: FloatArray, width: float, height: float) -> FloatArray:
    up = np.array([-along[1], along[0]])
    x, y = along * width / 2, up * height / 2
    return np.array([centre - x - y, centre + x - y, centre + x + y, centre - x + y])


def _write(text: str, height: float, box: FloatArray) -> list[FloatArray]:
    """Return the strokes of a text whose box has its lower left corner first."""
    x = (box[1] - box[0]) / np.linalg.norm(box[1] - box[0])
    frame = np.array([x, [-x[1], x[0]]])
    return [stroke @ frame + box[0] for stroke in text_strokes(text, height)]


def _place_mark(
    text: str,
    part: shapely.Polygon,
    room: shapely.Geometry,
    outline: FloatArray,
    taken: list[shapely.Geometry],
    lines: list[FloatArray],
) -> float:
    """Place the mark as large as it fits; return its height, 0 where none does."""
    edges = np.roll(outline, -1, axis=0) - outline
    longest = edges[np.argsort(-np.linalg.norm(edges, axis=1), kind="stable")[:3]]
    directions = [np.array([1.0, 0.0])] + [e / np.linalg.norm(e) for e in longest]
    directions = [d if d[0] > 1e-9 or (abs(d[0]) <= 1e-9 and d[1] > 0) else -d for d in directions]
    hub = shapely.maximum_inscribed_circle(part, tolerance=2.0)
    middle = np.array(hub.coords[0])
    centroid = np.array(part.centroid.coords[0])
    reach = 0.25 * np.sqrt(part.area)
    shifts = np.array(
        [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)]
    )
    centres = np.concatenate([[centroid], middle + reach * 0.5 * shifts, middle + reach * shifts])
    for height in MARK_HEIGHTS:
        width = text_width(text, height)
        boxes = np.array([_box(c, d, width, height) for d in directions for c in centres])
        fits = shapely.contains(room, shapely.polygons(boxes))
        for k in np.flatnonzero(fits):
            frame = shapely.Polygon(boxes[k])
            if any(frame.intersects(other) for other in taken):
                continue
            taken.append(frame.buffer(0.15 * height + 1.0, join_style="mitre"))
            lines += _write(text, height, boxes[k])
            return height
    return 0.0


def _place_note(
    text: str,
    edge: int,
    outline: FloatArray,
    room: shapely.Geometry,
    taken: list[shapely.Geometry],
    lines: list[FloatArray],
) -> bool:
    """Place the note of an edge along it; return False where it finds no room."""
    length = float(np.linalg.norm(outline[(edge + 1) % len(outline)] - outline[edge]))
    for height in NOTE_HEIGHTS:
        width = text_width(text, height)
        if width > length:
            continue
        for t in SLIDES:
            point, along, inward = _edge_frame(outline, edge, t)
            centre = point + inward * (TICK_END + 1.5 + height / 2)
            readable = along[0] > 1e-9 or (abs(along[0]) <= 1e-9 and along[1] > 0)
            box = _box(centre, along if readable else -along, width, height)
            frame = shapely.Polygon(box)
            if not room.contains(frame) or any(frame.intersects(other) for other in taken):
                continue
            taken.append(frame.buffer(1.0, join_style="mitre"))
            lines += _write(text, height, box)
            return True
    return False

"""Engraving: inside the part, clear of its contour and of itself, saying the right thing."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from phexfab.errors import DesignError
from phexfab.fabrication.marking import (
    EDGE_CLEARANCE,
    MARK_HEIGHT,
    MARK_SMALLEST,
    engraving,
    marking,
    note_text,
)
from phexfab.fabrication.parts import EdgeNote, FlatPart, Material
from phexfab.fabrication.strokes import text_strokes, text_width

HPL = Material("HPL", 1350.0)
TICK = 5.0


def hourglass(a, b, depth, jitter=(0.0,) * 12):
    """A panel as they are on minimal surfaces: two reflex corners."""
    points = np.array([(-a, -b), (0, -b + depth), (a, -b), (a, b), (0, b - depth), (-a, b)], float)
    return points + np.reshape(jitter, (6, 2))


def flat(outline, notes=None, mark="P017"):
    edges = notes or tuple(EdgeNote(f"P{k:03d}", 1.5 * k) for k in range(len(outline)))
    return FlatPart(mark, outline, outline, edges, 8.0, HPL)


def texts_of(part, made):
    """The polylines grouped by what they belong to, by counting the strokes of each text."""
    said = [k for k, note in enumerate(part.edges) if note_text(note)]
    noted = [k for k in said if k not in made.bare]
    lines = list(made.lines)
    words = [text_strokes(note_text(part.edges[k]), 1.0) for k in noted]
    words += [text_strokes(part.mark, 1.0)] if made.height else []
    total = sum(map(len, words))
    groups = [[line] for line in lines[: len(lines) - total]]  # ticks
    rest = lines[len(lines) - total :]
    for word in words:
        groups.append(rest[: len(word)])
        rest = rest[len(word) :]
    return groups


@settings(max_examples=40, deadline=None)
@given(
    a=st.floats(40, 400),
    b=st.floats(40, 400),
    depth=st.floats(5, 35),
    jitter=st.tuples(*[st.floats(-6, 6)] * 12),
    turn=st.floats(0, 360),
)
def test_everything_lies_inside_and_nothing_touches(a, b, depth, jitter, turn):
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    part = flat(hourglass(a, b, depth, jitter) @ np.array([[c, s], [-s, c]]))
    polygon = shapely.Polygon(part.outline)
    made = marking(part)
    assert made.height >= MARK_SMALLEST
    drawn = [
        shapely.MultiLineString([shapely.LineString(p) for p in g]) for g in texts_of(part, made)
    ]
    for item in drawn:
        assert polygon.contains(item)
        assert item.distance(polygon.exterior) >= EDGE_CLEARANCE - 1e-6
    tree = shapely.STRtree(drawn)
    i, j = tree.query(drawn, predicate="dwithin", distance=0.5)
    assert np.all(i == j)


def test_the_mark_grows_with_the_part_up_to_its_limit():
    sizes = (15, 20, 40, 80, 200, 400)
    heights = [marking(flat(hourglass(s, s, s / 4))).height for s in sizes]
    assert heights == sorted(heights)
    assert heights[0] < heights[2] < MARK_HEIGHT
    assert heights[-1] == pytest.approx(MARK_HEIGHT)


def test_the_mark_is_as_large_as_a_search_by_hand_finds():
    """A rectangle's largest inscribed text is known: the room's height or its width decides."""
    quiet = (EdgeNote("", 0.0),) * 4
    for width, height in ((90.0, 30.0), (60.0, 44.0), (400.0, 36.0)):
        outline = np.array([(0, 0), (width, 0), (width, height), (0, height)], float)
        room = np.array([width, height]) - 2 * EDGE_CLEARANCE
        best = min(room[1], room[0] / text_width("P017", 1.0))
        assert marking(flat(outline, quiet)).height == pytest.approx(
            min(0.9 * best, MARK_HEIGHT), rel=0.03
        )


def test_notes_name_the_neighbour_and_the_bevel():
    """Counted in strokes: a note has exactly the strokes of its text, and one tick."""
    outline = hourglass(200, 200, 60)
    quiet = tuple(EdgeNote("", 0.0) for _ in range(6))
    base = len(engraving(flat(outline, quiet)))
    assert base == len(text_strokes("P017", 1.0))
    for note, text in (
        (EdgeNote("P123", 0.0), "P123"),
        (EdgeNote("P123", -0.04), "P123"),
        (EdgeNote("P123", 3.24), "P123 +3.2"),
        (EdgeNote("", -4.0), "-4.0"),
        (EdgeNote("N105", 60.3, -29.3), "N105 +60.3/-29.3"),
    ):
        assert note_text(note) == text
        made = marking(flat(outline, (note, *quiet[1:])))
        assert made.bare == ()
        assert len(made.lines) - base == 1 + len(text_strokes(text, 1.0))


def test_a_tick_stands_square_on_the_middle_of_its_edge_and_the_note_beside_it():
    outline = hourglass(200, 180, 60)
    quiet = [EdgeNote("", 0.0)] * 6
    for k in range(6):
        notes = [*quiet]
        notes[k] = EdgeNote("P100", 2.0)
        part = flat(outline, tuple(notes))
        tick, note, _ = texts_of(part, marking(part))
        tail, head = outline[k], outline[(k + 1) % 6]
        along = (head - tail) / np.linalg.norm(head - tail)
        start, end = tick[0] - (tail + head) / 2
        assert abs(start @ along) < 1e-9 and abs(end @ along) < 1e-9
        assert np.linalg.norm(end - start) == pytest.approx(TICK)
        assert np.linalg.norm(start) == pytest.approx(EDGE_CLEARANCE, abs=1e-5)
        # The note is nearer to its own edge than to any other, and reads left to right.
        points = np.concatenate(note)
        distances = [
            shapely.MultiPoint(points).distance(
                shapely.LineString([outline[i], outline[(i + 1) % 6]])
            )
            for i in range(6)
        ]
        assert int(np.argmin(distances)) == k
        stem = note[0][np.argsort(note[0] @ [-along[1], along[0]])]
        assert abs(along[0]) < 1e-9 or note[-1].mean(axis=0)[0] > stem[0][0]


def test_an_edge_without_room_keeps_its_tick_and_is_reported():
    outline = np.array([(0, 0), (300, 0), (300, 200), (290, 200), (284, 30), (0, 30)], float)
    notes = tuple(EdgeNote("P999", 2.0) for _ in outline)
    made = marking(flat(outline, notes))
    assert 2 in made.bare and 0 not in made.bare
    assert made.height >= MARK_SMALLEST


def test_a_part_too_small_for_letters_says_so():
    made = marking(flat(hourglass(5, 5, 2)))
    assert made.height == 0 and made.bare == (0, 1, 2, 3, 4, 5)
    assert marking(flat(hourglass(2, 2, 1))).lines == ()


def test_a_mark_without_strokes_is_refused():
    with pytest.raises(DesignError, match="'%'"):
        marking(flat(hourglass(200, 200, 60), mark="P%7"))

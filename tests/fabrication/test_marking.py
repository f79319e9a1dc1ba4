"""Lettering: inside the part, clear of edges and of itself, saying the right thing."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from phexfab.fabrication.marking import EDGE_CLEARANCE, MARK_HEIGHTS, engraving, marking
from phexfab.fabrication.parts import EdgeNote, FlatPart, Material
from phexfab.fabrication.strokes import _GLYPHS, text_strokes, text_width

HPL = Material("HPL", 1350.0)


def hourglass(a, b, depth, jitter=(0.0,) * 12):
    """A panel as they are on minimal surfaces: two reflex corners."""
    points = np.array([(-a, -b), (0, -b + depth), (a, -b), (a, b), (0, b - depth), (-a, b)], float)
    return points + np.reshape(jitter, (6, 2))


def flat(outline, notes=None, mark="P017"):
    edges = notes or tuple(EdgeNote(f"P{k:03d}", 1.5 * k) for k in range(len(outline)))
    return FlatPart(mark, outline, outline, edges, 8.0, HPL)


@settings(max_examples=30, deadline=None)
@given(
    a=st.floats(60, 400),
    b=st.floats(60, 400),
    depth=st.floats(5, 50),
    jitter=st.tuples(*[st.floats(-8, 8)] * 12),
)
def test_everything_lies_inside_and_nothing_overlaps(a, b, depth, jitter):
    part = flat(hourglass(a, b, depth, jitter))
    polygon = shapely.Polygon(part.outline)
    made = marking(part)
    assert made.height > 0
    inside = polygon.buffer(1e-9)
    for line in made.lines:
        assert inside.contains(shapely.LineString(line))
    # Letters of different texts never cross: group lines by text through their order.
    lettering = [shapely.LineString(line) for line in made.lines]
    ticks = [
        line for line in lettering if len(line.coords) == 2 and line.length == pytest.approx(6)
    ]
    others = [line for line in lettering if line not in ticks]
    for tick in ticks:
        assert all(tick.distance(other) > 0.5 for other in others)
    border = polygon.exterior
    assert min(line.distance(border) for line in others) >= EDGE_CLEARANCE - 1e-9


def test_the_mark_is_as_large_as_it_fits():
    assert marking(flat(hourglass(200, 200, 60))).height == MARK_HEIGHTS[0]
    heights = [marking(flat(hourglass(s, s, s / 4))).height for s in (20, 40, 80, 200)]
    assert heights == sorted(heights) and heights[0] < heights[-1]


def test_notes_name_the_neighbour_and_the_bevel():
    """Counted in strokes: a note has exactly the strokes of its text."""
    outline = hourglass(200, 200, 60)
    quiet = tuple(EdgeNote("", 0.0) for _ in range(6))
    base = len(marking(flat(outline, quiet)).lines)
    for note, text in (
        (EdgeNote("P123", 0.0), "P123"),
        (EdgeNote("P123", 3.24), "P123 +3.2"),
        (EdgeNote("", -4.0), "-4.0"),
        (EdgeNote("N105", 60.3, -29.3), "N105 +60.3/-29.3"),
    ):
        made = marking(flat(outline, (note, *quiet[1:])))
        assert made.bare == ()
        assert len(made.lines) - base == 1 + len(text_strokes(text, 1.0))


def test_an_edge_without_room_keeps_its_tick_and_is_reported():
    outline = np.array([(0, 0), (300, 0), (300, 200), (296, 200), (290, 30), (0, 30)], float)
    notes = tuple(EdgeNote("P999", 2.0) for _ in outline)
    made = marking(flat(outline, notes))
    assert 3 in made.bare and 2 in made.bare


def test_lettering_stands_upright():
    made = engraving(flat(hourglass(200, 200, 60), tuple(EdgeNote("", 0.0) for _ in range(6))))
    strokes = text_strokes("P017", MARK_HEIGHTS[0])
    assert len(made) == len(strokes)
    for drawn, wanted in zip(made, strokes, strict=True):
        assert np.allclose(drawn - drawn[0], wanted - wanted[0], atol=1e-9)


@pytest.mark.parametrize("letter", sorted(set(_GLYPHS) - {" "}))
def test_every_glyph_stays_in_its_cell_and_differs_from_all_others(letter):
    drawn = text_strokes(letter, 6.0)
    points = np.concatenate(drawn)
    assert points.min() >= 0 and points[:, 0].max() <= 4 and points[:, 1].max() <= 6
    for other in set(_GLYPHS) - {letter}:
        theirs = text_strokes(other, 6.0)
        assert len(theirs) != len(drawn) or any(
            a.shape != b.shape or not np.allclose(a, b) for a, b in zip(drawn, theirs, strict=True)
        )


def test_width_is_that_of_the_strokes():
    for text in ("H", "P017", "M-/MH"):
        x = np.concatenate(text_strokes(text, 12.0))[:, 0]
        assert x.max() == pytest.approx(text_width(text, 12.0))
    assert text_width("", 10) == 0
    assert len(text_strokes("ab", 1)) == len(text_strokes("AB", 1))
    assert len(text_strokes("%", 1)) == len(text_strokes("?", 1))

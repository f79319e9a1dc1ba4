"""Single-stroke lettering: cells, widths, and letters that can be told apart."""

from itertools import pairwise

import numpy as np
import pytest

from phexfab.errors import DesignError
from phexfab.fabrication.strokes import LETTERS, text_strokes, text_width

CAPITALS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"


def raster(letter):
    """Which cells of a coarse grid a letter's strokes pass through."""
    cells = set()
    for run in text_strokes(letter, 6.0):
        for a, b in pairwise(run):
            for t in np.linspace(0, 1, 25):
                cells.add(tuple(np.floor((a + t * (b - a)) * 2 + 0.5).astype(int)))
    return cells


def test_the_letters_that_marks_and_notes_need_are_there():
    assert set(CAPITALS + "-/.+ °") <= set(LETTERS)


@pytest.mark.parametrize("letter", CAPITALS)
def test_capitals_fill_their_cell(letter):
    points = np.concatenate(text_strokes(letter, 12.0))
    assert points.min() >= 0
    assert points[:, 1].min() == 0 and points[:, 1].max() == 12.0
    assert points[:, 0].max() == pytest.approx(text_width(letter, 12.0))
    assert 4.0 <= points[:, 0].max() <= 8.0


def test_any_two_capitals_differ_in_what_is_drawn():
    drawn = {letter: raster(letter) for letter in CAPITALS}
    for k, a in enumerate(CAPITALS):
        for b in CAPITALS[k + 1 :]:
            assert len(drawn[a] ^ drawn[b]) >= 6, (a, b)


def test_width_is_that_of_the_strokes_and_scales_with_the_height():
    for text in ("H", "P017", "P018 +3.2", "M-/MH"):
        x = np.concatenate(text_strokes(text, 12.0))[:, 0]
        assert x.min() >= 0 and x.max() == pytest.approx(text_width(text, 12.0))
        assert text_width(text, 3.0) == pytest.approx(text_width(text, 12.0) / 4)
    assert text_width("", 10.0) == 0
    assert text_strokes("", 10.0) == []


def test_letters_follow_one_another_without_touching():
    for pair in ("AV", "LT", "00", "WW", "11", "3.", ".2", "-5"):
        first, both = text_strokes(pair[0], 6.0), text_strokes(pair, 6.0)
        last = np.concatenate(both[len(first) :])
        assert last[:, 0].min() - np.concatenate(first)[:, 0].max() >= 1.0


def test_lower_case_is_written_as_capitals():
    for a, b in zip(text_strokes("p018", 5.0), text_strokes("P018", 5.0), strict=True):
        assert np.array_equal(a, b)


def test_a_letter_without_strokes_is_refused_by_name():
    with pytest.raises(DesignError, match="'%'"):
        text_strokes("P%", 5.0)
    with pytest.raises(DesignError, match="A-Z"):
        text_width("#1", 5.0)

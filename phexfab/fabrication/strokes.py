"""Single-stroke lettering: every glyph a few polylines that a laser or a router follows once.

Drawn on a grid 4 wide and 6 high; a zero is slashed, so that it is no O.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

_ADVANCE, _CAP = 5.5, 6.0
_O = "1 0 3 0 4 1 4 5 3 6 1 6 0 5 0 1 1 0"
_P = "0 0 0 6 3 6 4 5 4 4 3 3 0 3"
_GLYPHS = {
    "0": _O + ";1 1.5 3 4.5",
    "1": "1 5 2 6 2 0;1 0 3 0",
    "2": "0 5 1 6 3 6 4 5 4 4 0 0 4 0",
    "3": "0 5 1 6 3 6 4 5 4 4 3 3 4 2 4 1 3 0 1 0 0 1;1.5 3 3 3",
    "4": "3 0 3 6 0 2 4 2",
    "5": "4 6 0 6 0 3.5 3 3.5 4 2.5 4 1 3 0 1 0 0 1",
    "6": "4 5 3 6 1 6 0 5 0 1 1 0 3 0 4 1 4 2.5 3 3.5 1 3.5 0 2.5",
    "7": "0 6 4 6 1.5 0",
    "8": "1 3 0 4 0 5 1 6 3 6 4 5 4 4 3 3 1 3 0 2 0 1 1 0 3 0 4 1 4 2 3 3",
    "9": "0 1 1 0 3 0 4 1 4 5 3 6 1 6 0 5 0 3.5 1 2.5 3 2.5 4 3.5",
    "A": "0 0 2 6 4 0;0.66 2 3.34 2",
    "B": "0 0 0 6 3 6 4 5 4 4 3 3 0 3;3 3 4 2 4 1 3 0 0 0",
    "C": "4 5 3 6 1 6 0 5 0 1 1 0 3 0 4 1",
    "D": "0 0 0 6 2.5 6 4 4.5 4 1.5 2.5 0 0 0",
    "E": "4 6 0 6 0 0 4 0;0 3 3 3",
    "F": "4 6 0 6 0 0;0 3 3 3",
    "G": "4 5 3 6 1 6 0 5 0 1 1 0 3 0 4 1 4 3 2.5 3",
    "H": "0 0 0 6;4 0 4 6;0 3 4 3",
    "I": "1 0 3 0;1 6 3 6;2 0 2 6",
    "J": "0 1 1 0 2.5 0 3.5 1 3.5 6",
    "K": "0 0 0 6;4 6 0 2.5;1.4 3.4 4 0",
    "L": "0 6 0 0 4 0",
    "M": "0 0 0 6 2 3 4 6 4 0",
    "N": "0 0 0 6 4 0 4 6",
    "O": _O,
    "P": _P,
    "Q": _O + ";2.5 1.5 4 0",
    "R": _P + ";2 3 4 0",
    "S": "0 1 1 0 3 0 4 1 4 2 3 3 1 3 0 4 0 5 1 6 3 6 4 5",
    "T": "0 6 4 6;2 6 2 0",
    "U": "0 6 0 1 1 0 3 0 4 1 4 6",
    "V": "0 6 2 0 4 6",
    "W": "0 6 1 0 2 4 3 0 4 6",
    "X": "0 0 4 6;0 6 4 0",
    "Y": "0 6 2 3 4 6;2 3 2 0",
    "Z": "0 6 4 6 0 0 4 0",
    "-": "0.5 3 3.5 3",
    "+": "0.5 3 3.5 3;2 1.5 2 4.5",
    "/": "0 0 4 6",
    ".": "1.7 0 2.3 0 2.3 0.6 1.7 0.6 1.7 0",
    "°": "1 5 1.5 6 2.5 6 3 5 2.5 4 1.5 4 1 5",
    "?": "0 5 1 6 3 6 4 5 4 4 2 3 2 2;2 0 2 0.5",
    " ": "",
}


def _parse(glyph: str) -> list[FloatArray]:
    return [
        np.array(stroke.split(), float).reshape(-1, 2) / _CAP
        for stroke in glyph.split(";")
        if stroke
    ]


_STROKES = {letter: _parse(glyph) for letter, glyph in _GLYPHS.items()}


def text_width(text: str, height: float) -> float:
    """Return the width in mm of a line of text with capitals of a given height in mm."""
    return max(0.0, (_ADVANCE * len(text) - (_ADVANCE - 4.0)) / _CAP * height)


def text_strokes(text: str, height: float) -> list[FloatArray]:
    """Return the strokes of a line of text, its lower left corner at the origin.

    Parameters
    ----------
    text : str
        Small letters are drawn as capitals, unknown characters as question marks.
    height : float
        Of the capitals, mm.

    Returns
    -------
    list of (n, 2) arrays, mm
        Open polylines.
    """
    strokes = []
    for place, letter in enumerate(text.upper()):
        shift = np.array([place * _ADVANCE / _CAP, 0.0])
        strokes += [(s + shift) * height for s in _STROKES.get(letter, _STROKES["?"])]
    return strokes

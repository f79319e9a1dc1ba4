"""Single-stroke lettering: marks that a laser, a mill or a plotter writes in one pass.

The letters stand on a grid four wide and six high, with cut corners instead of curves. Zero is
slashed and I carries serifs, so that 0 O, 1 I, 2 Z, 5 S and 8 B are told apart on scratched steel.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import DesignError

FloatArray = NDArray[np.float64]

_CAP = 6.0  # grid units in the height of a letter
_GAP = 1.7  # grid units between letters
_SPACE = 2.5

# Strokes are parted by blanks; every two digits are the x and y of a point.
_GRID = {
    "0": "100105163645413010 1135",
    "1": "051610 0020",
    "2": "05163645440040",
    "3": "05163645443323 334241301001",
    "4": "30360242",
    "5": "460603334241301001",
    "6": "3614020110304142331302",
    "7": "064610",
    "8": "13040516364544331302011030414233",
    "9": "1032444536160504133344",
    "A": "002640 1333",
    "B": "00063645443303 3342413000",
    "C": "4536160501103041",
    "D": "00062644422000",
    "E": "46060040 0333",
    "F": "460600 0333",
    "G": "45361605011030414323",
    "H": "0006 4046 0343",
    "I": "0626 1610 0020",
    "J": "3631201001",
    "K": "0006 460340",
    "L": "060030",
    "M": "0006234640",
    "N": "00064046",
    "O": "100105163645413010",
    "P": "00063645443303",
    "Q": "100105163645413010 2240",
    "R": "00063645443303 2340",
    "S": "453616050413334241301001",
    "T": "0646 2620",
    "U": "060110304146",
    "V": "062046",
    "W": "0610233046",
    "X": "0046 0640",
    "Y": "062346 2320",
    "Z": "06460040",
    "-": "0333",
    "+": "0343 2125",
    "/": "0046",
    "=": "0242 0444",
    "_": "0040",
    "°": "0516251405",
}
# What does not fall on the grid.
_FINE: dict[str, tuple[tuple[tuple[float, float], ...], ...]] = {
    ".": (((0.0, 0.0), (0.0, 0.7)),),
    ",": (((0.5, 0.7), (0.5, 0.0), (0.0, -1.0)),),
    ":": (((0.0, 0.8), (0.0, 1.5)), ((0.0, 3.8), (0.0, 4.5))),
    "(": (((1.0, 6.5), (0.0, 4.5), (0.0, 1.5), (1.0, -0.5)),),
    ")": (((0.0, 6.5), (1.0, 4.5), (1.0, 1.5), (0.0, -0.5)),),
}


def _glyphs() -> dict[str, tuple[FloatArray, ...]]:
    table = {
        letter: tuple(
            np.array([[int(x), int(y)] for x, y in zip(run[::2], run[1::2], strict=True)], float)
            for run in strokes.split()
        )
        for letter, strokes in _GRID.items()
    }
    for letter, strokes_ in _FINE.items():
        table[letter] = tuple(np.array(run) for run in strokes_)
    table[" "] = ()
    return table


_GLYPHS = _glyphs()
_WIDTHS = {
    letter: max((float(run[:, 0].max()) for run in strokes), default=_SPACE)
    for letter, strokes in _GLYPHS.items()
}

LETTERS = "".join(sorted(_GLYPHS))


def _letters(text: str) -> str:
    capitals = text.upper()
    unknown = [letter for letter in capitals if letter not in _GLYPHS]
    if unknown:
        raise DesignError(
            f"{text!r} cannot be engraved: there is no letter {unknown[0]!r}; use A-Z, 0-9 and "
            "- + / . , : = _ ( ) °"
        )
    return capitals


def text_width(text: str, height: float) -> float:
    """Return the width in mm of a line of text with capitals ``height`` mm high.

    Raises
    ------
    DesignError
        If a letter has no strokes.
    """
    letters = _letters(text)
    if not letters:
        return 0.0
    units = sum(_WIDTHS[letter] for letter in letters) + _GAP * (len(letters) - 1)
    return units * height / _CAP


def text_strokes(text: str, height: float) -> list[FloatArray]:
    """Return the strokes of a line of text.

    Parameters
    ----------
    text : str
        Lower-case letters are written as capitals.
    height : float
        Of a capital, mm.

    Returns
    -------
    list of (n, 2) arrays
        Open or closed polylines; the text starts at the origin and stands on the x axis.

    Raises
    ------
    DesignError
        If a letter has no strokes.
    """
    scale = height / _CAP
    strokes = []
    at = 0.0
    for letter in _letters(text):
        strokes += [(run + np.array([at, 0.0])) * scale for run in _GLYPHS[letter]]
        at += _WIDTHS[letter] + _GAP
    return strokes

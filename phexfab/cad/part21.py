"""The text of ISO 10303-21 exchange files: strings, numbers, and runs of similar entities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def quote(text: str) -> str:
    """Return a string literal: quotes and backslashes doubled, the rest of Unicode as ``\\X2\\``.

    References
    ----------
    ISO 10303-21, clause 6.4.3.
    """
    out = []
    for char in text:
        code = ord(char)
        if 0x20 <= code <= 0x7E:
            out.append(char * 2 if char in "'\\" else char)
        elif code <= 0xFFFF:
            out.append(f"\\X2\\{code:04X}\\X0\\")
        else:
            out.append(f"\\X4\\{code:08X}\\X0\\")
    return "'" + "".join(out) + "'"


def numbers(values: FloatArray) -> NDArray[np.object_]:
    """Return floats as objects whose ``str`` is a Part-21 real.

    Python's shortest ``repr`` is one, but below 1e-4 it may leave out the decimal point that the
    standard demands; those few become text here.
    """
    out = values.astype(object)
    tiny = (np.abs(values) < 1e-4) & (values != 0)
    out[tiny] = [f"{value:.15f}".rstrip("0") for value in values[tiny].tolist()]
    return out


def references(ids: Sequence[int]) -> str:
    """Return ``(#1,#2,…)``, broken into lines of some 16 references."""
    rows = (ids[k : k + 16] for k in range(0, len(ids), 16))
    return "(" + ",\n".join(",".join(f"#{i}" for i in row) for row in rows) + ")"


@dataclass(frozen=True)
class Ref:
    """The entity that is ``offset`` after the first one of its run."""

    offset: int


@dataclass(frozen=True)
class Real:
    """A number: column ``column`` of the array given to ``Run.write``."""

    column: int


class Run:
    """A run of entities that repeats with other numbers, such as all entities of one part.

    Written down once per topology, then filled for hundreds of parts at a time: this is what makes
    the file quick to write.
    """

    def __init__(self) -> None:
        self.count = 0
        self._text: list[str] = []
        self._fields: list[Ref | Real | None] = []

    def add(self, text: str, *fields: Ref | Real | None) -> Ref:
        """Append an entity and return a reference to it.

        Parameters
        ----------
        text : str
            The entity with ``%s`` for each field.
        fields : Ref, Real, or None for the part's mark (quoted)
        """
        ref = Ref(self.count)
        self.count += 1
        slots = tuple("#%s" if isinstance(field, Ref) else "%s" for field in fields)
        self._text.append(f"#%s={text % slots};\n")
        self._fields += [ref, *fields]
        return ref

    def point(self, kind: str, column: int) -> Ref:
        """Append a ``CARTESIAN_POINT`` or ``DIRECTION`` from three columns."""
        return self.add(f"{kind}('',(%s,%s,%s))", Real(column), Real(column + 1), Real(column + 2))

    def write(self, first: IntArray, marks: Sequence[str], values: FloatArray) -> list[str]:
        """Return the text of every repetition.

        Parameters
        ----------
        first : (k,) int array
            The number of the first entity of each.
        marks : k strings, not yet quoted
        values : (k, columns) array
        """
        table = np.empty((len(first), len(self._fields)), object)
        refs = [i for i, f in enumerate(self._fields) if isinstance(f, Ref)]
        offsets = np.array([f.offset for f in self._fields if isinstance(f, Ref)])
        table[:, refs] = first[:, None] + offsets
        reals = [i for i, f in enumerate(self._fields) if isinstance(f, Real)]
        columns = [f.column for f in self._fields if isinstance(f, Real)]
        table[:, reals] = numbers(values)[:, columns]
        names = [i for i, f in enumerate(self._fields) if f is None]
        table[:, names] = np.array([quote(mark) for mark in marks], object)[:, None]
        text = "".join(self._text)
        return [text % tuple(row) for row in table.tolist()]

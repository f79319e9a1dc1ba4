"""What can go wrong, by name. Every error also derives from a builtin.

A message names the file, key or part, the value, and what to do about it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any


class PhexError(Exception):
    """Base of every error that phexfab raises on purpose.

    Examples
    --------
    >>> import phexfab as px
    >>> try:
    ...     px.minimal_surface("enneper", order=0)
    ... except px.PhexError as error:
    ...     print(error)
    enneper: order must be between 1 and 12, not 0
    """


class DesignError(PhexError, ValueError):
    """The design asks for something impossible; the message names key, value and remedy.

    Attributes
    ----------
    problems : tuple of phexfab.design.problem.Problem
        Every mistake of a design file on its own; () where the message is about one thing.

    Examples
    --------
    >>> import phexfab as px
    >>> try:
    ...     px.make_design({"surface": {"name": "enneper"}, "lattice": {"panel_size": "5 kg"}})
    ... except px.DesignError as error:
    ...     print(error.problems[0].key)
    lattice.panel_size
    """

    def __init__(self, message: str = "", problems: Iterable[Any] = ()) -> None:
        super().__init__(message)
        self.problems = tuple(problems)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (str(self), self.problems)


class SurfaceError(PhexError, ValueError):
    """A smooth surface cannot be evaluated there: a branch point, a pole, an end."""


class LatticeError(DesignError):
    """The lattice does not give valid hexagons on this surface."""


class MeshError(PhexError, ValueError):
    """A mesh is malformed, or not of the kind a verb needs."""


class SolveError(PhexError, ArithmeticError):
    """A solver did not converge, or its system is singular."""


class OffsetLimitError(DesignError):
    """An edge would flip at that offset; the message names the admissible interval."""


class PartError(DesignError):
    """A part cannot be made with these sizes; the message names its mark."""


class NestingError(DesignError):
    """A part does not fit the stock sheet, or a layout failed its verification."""


class MissingLibraryError(PhexError, ImportError):
    """An optional library is absent or broken; the message says how to install it."""

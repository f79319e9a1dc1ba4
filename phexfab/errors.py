"""What can go wrong, by name. Every error also derives from a builtin.

A message names the file, key or part, the value, and what to do about it.
"""


class PhexError(Exception):
    """Base of every error that phexfab raises on purpose."""


class DesignError(PhexError, ValueError):
    """The design asks for something impossible; the message names key, value and remedy."""


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

"""Part marks: a letter for the family and a number, the same on drawings, in STEP and in lists.

Marks follow the order of the shell (its faces, edges and vertices), so a design that is built
again carries the same marks.
"""

from __future__ import annotations

from phexfab.parallel.shell import Shell


def marks(letter: str, count: int) -> tuple[str, ...]:
    """Return ``count`` marks such as ``P001``, counted from 1.

    Parameters
    ----------
    letter : str
        What the number follows.
    count : int
        Numbers are padded with zeros to the width of this one, three digits at least, so that
        marks sort like numbers.
    """
    width = max(3, len(str(count)))
    return tuple(f"{letter}{k:0{width}d}" for k in range(1, count + 1))


def panel_marks(shell: Shell) -> tuple[str, ...]:
    """Return the marks of all faces of ``shell.mesh``: ``P001``, …"""
    return marks("P", shell.mesh.n_faces)


def beam_marks(shell: Shell) -> tuple[str, ...]:
    """Return the marks of all rows of ``shell.edges``: ``B001``, …"""
    return marks("B", len(shell.edges))


def node_marks(shell: Shell) -> tuple[str, ...]:
    """Return the marks of all vertices of ``shell.mesh``: ``N001``, …, hub or no hub."""
    return marks("N", len(shell.mesh.vertices))

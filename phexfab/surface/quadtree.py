"""Squares of a quadtree that cover a domain, each as large as it may be, and who owns a place."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from phexfab.surface.domain import Disc
from phexfab.surface.holomorphic import ComplexArray

IntArray = NDArray[np.int64]

DEEPEST = 22
MOST_OPEN = 40_000  # squares still to be covered, beyond which a function is noise to them
ALONG = np.linspace(-0.96, 0.96, 9)
ROUND = np.concatenate([1j**k * (1 + 1e-9 + 1j * ALONG) for k in range(4)])  # a square's border


@dataclass(frozen=True, eq=False)
class Quadtree:
    """Squares and their owners.

    Attributes
    ----------
    keys, owner : (L,) int
        The squares, sorted, and the number of what each belongs to.
    corner, side : complex, float
        Lower left corner and side of the whole.
    """

    keys: IntArray
    owner: IntArray
    corner: complex
    side: float

    @cached_property
    def levels(self) -> list[int]:
        """Depths at which there are squares."""
        return sorted({int(level) for level in self.keys >> 48})

    def owner_at(self, z: ComplexArray) -> IntArray:
        """Return who owns each of ``z``; -1 where nothing is covered."""
        away = (z - self.corner) / self.side
        owner = np.full(z.shape, -1)
        inside = (away.real >= 0) & (away.real < 1) & (away.imag >= 0) & (away.imag < 1)
        todo = np.flatnonzero(inside)
        for level in self.levels:
            if not len(todo):
                break
            key = _key(
                level,
                (away.real[todo] * 2.0**level).astype(np.int64),
                (away.imag[todo] * 2.0**level).astype(np.int64),
            )
            slot = np.minimum(np.searchsorted(self.keys, key), len(self.keys) - 1)
            hit = self.keys[slot] == key
            owner[todo[hit]] = self.owner[slot[hit]]
            todo = todo[~hit]
        return owner

    def contacts(self, domain: Disc) -> tuple[IntArray, IntArray, ComplexArray]:
        """Return pairs of owners that meet, and a place in the domain where they do."""
        level = self.keys >> 48
        column, row = (self.keys >> 24) & 0xFFFFFF, self.keys & 0xFFFFFF
        half = self.side / 2.0 ** (level + 1)
        middle = self.corner + (2 * column + 1) * half + 1j * (2 * row + 1) * half
        at = middle[:, None] + half[:, None] * ROUND
        inside = domain.contains(at)
        at, mine = at[inside], np.broadcast_to(self.owner[:, None], inside.shape)[inside]
        other = self.owner_at(at)
        meets = (other >= 0) & (other != mine)
        mine, other, at = mine[meets], other[meets], at[meets]
        key = np.minimum(mine, other) * (self.owner.max(initial=0) + 1) + np.maximum(mine, other)
        one = np.unique(key, return_index=True)[1]
        return mine[one], other[one], at[one]


def cover(
    domain: Disc, owners: Callable[[ComplexArray, float], IntArray], deepest: int = DEEPEST
) -> Quadtree:
    """Return squares that cover a domain.

    Parameters
    ----------
    domain : Disc
    owners : callable
        Of (n,) middles of squares and half their side: the owner of each, -1 where the square has
        to be cut in four.
    deepest : int
        How often it may be cut; what is left then stays uncovered.
    """
    # Off the centre, so that no line of the grid is a symmetry of the surface.
    side = 2.06 * domain.radius
    corner = domain.centre - domain.radius * (1.031 + 1.0293j)
    keys, owner = [np.zeros(0, np.int64)], [np.zeros(0, np.int64)]
    column = row = np.zeros(1, np.int64)
    for level in range(deepest):
        half = side / 2 ** (level + 1)
        middle = corner + (2 * column + 1) * half + 1j * (2 * row + 1) * half
        near = ~domain.is_outside(middle, half * np.sqrt(2))
        column, row, middle = column[near], row[near], middle[near]
        if not 0 < len(middle) <= MOST_OPEN:
            break
        mine = owners(middle, half)
        done = mine >= 0
        keys.append(_key(level, column[done], row[done]))
        owner.append(mine[done])
        column, row = (
            (2 * a[~done, None] + np.array(step)).ravel()
            for a, step in ((column, [0, 1, 0, 1]), (row, [0, 0, 1, 1]))
        )
    key, number = np.concatenate(keys), np.concatenate(owner)
    order = np.argsort(key, kind="stable")
    return Quadtree(key[order], number[order], corner, side)


def _key(level: int, column: IntArray, row: IntArray) -> IntArray:
    return (level << 48) + (column << 24) + row

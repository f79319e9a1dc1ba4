"""Apices of a lattice: the places of its 3(m+2)-gons, at umbilics or within a panel of them.

A panel that covers an umbilic need not have it in its middle, and one panel may cover several
umbilics that lie nearer to each other than panels do. With apices z' of orders M for umbilics z of
orders m the lattice's coordinate is ``dw̃ = √(Q Π (z - z')^M / Π (z - z)^m) e^h dz``: outside the
panels at the apices the factor only adds a little to the correction h.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from phexfab.surface.holomorphic import ComplexArray
from phexfab.surface.umbilics import Umbilics

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Apices:
    """Umbilics in groups, one apex for each group.

    Attributes
    ----------
    umbilics : Umbilics
    group : (n,) int
        The apex of each umbilic, 0 to G - 1.
    places : (G,) complex
    """

    umbilics: Umbilics
    group: IntArray
    places: ComplexArray

    @classmethod
    def of(cls, umbilics: Umbilics, group: IntArray | None = None) -> Apices:
        """Return apices in the middle of each group; each umbilic alone by default."""
        number = np.arange(len(umbilics)) if group is None else group
        n = int(number.max(initial=-1)) + 1
        weight = np.bincount(number, umbilics.orders, n)
        real = np.bincount(number, umbilics.orders * umbilics.places.real, n) / weight
        imag = np.bincount(number, umbilics.orders * umbilics.places.imag, n) / weight
        single = np.bincount(number, minlength=n) == 1
        places = real + 1j * imag
        places[number[single[number]]] = umbilics.places[single[number]]  # exactly
        return cls(umbilics, number, places)

    def __len__(self) -> int:
        return len(self.places)

    def at(self, places: ComplexArray) -> Apices:
        """Return the same groups with apices elsewhere."""
        return Apices(self.umbilics, self.group, places)

    @cached_property
    def orders(self) -> IntArray:
        """(G,) orders: the sums of the umbilics'."""
        total = np.bincount(self.group, self.umbilics.orders, len(self.places))
        return total.astype(np.int64)

    @cached_property
    def moved(self) -> IntArray:
        """Umbilics that are not their own apex."""
        return np.flatnonzero(self.umbilics.places != self.places[self.group])

    @cached_property
    def shift(self) -> FloatArray:
        """(G,) largest distance of an apex from its umbilics."""
        away = np.zeros(len(self.places))
        np.maximum.at(away, self.group, np.abs(self.umbilics.places - self.places[self.group]))
        return away

    def product(self, z: ComplexArray) -> ComplexArray:
        """Return Π (z - z')^M over the apices."""
        value = np.ones(np.shape(z), complex)
        for place, order in zip(self.places, self.orders, strict=True):
            value *= (z - place) ** int(order)
        return value

    def log_root(self, z: ComplexArray) -> ComplexArray:
        """Return half the logarithm of what the apices change in Q, 0 far away."""
        value = np.zeros(np.shape(z), complex)
        with np.errstate(all="ignore"):
            for i in self.moved:
                ratio = (z - self.places[self.group[i]]) / (z - self.umbilics.places[i])
                value += 0.5 * self.umbilics.orders[i] * np.log(ratio)
        return value

    def slopes(self, z: ComplexArray) -> ComplexArray:
        """Return the derivatives (..., G) of ``log_root`` with respect to the apices."""
        return -0.5 * self.orders / (z[..., None] - self.places)

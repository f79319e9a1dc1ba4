"""Plane domains of parameters: a disc, with round holes or without."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import SurfaceError
from phexfab.surface.holomorphic import ComplexArray, show

Hole = tuple[complex, float]


@dataclass(frozen=True)
class Disc:
    """The closed disc ``|z - centre| <= radius`` without the open discs ``holes``.

    Attributes
    ----------
    centre : complex
    radius : float
    holes : tuple of (centre, radius)
        They lie inside the disc and apart from each other.
    """

    centre: complex = 0.0
    radius: float = 1.0
    holes: tuple[Hole, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "centre", complex(self.centre))
        object.__setattr__(self, "radius", float(self.radius))
        holes = tuple((complex(c), float(r)) for c, r in self.holes)
        object.__setattr__(self, "holes", holes)
        if not (np.isfinite(self.centre) and 0 < self.radius < np.inf):
            raise SurfaceError(
                f"a disc of radius {self.radius} about {show(self.centre)}: the radius must be "
                "positive and both finite"
            )
        for k, (c, r) in enumerate(holes):
            if not (r > 0 and abs(c - self.centre) + r < self.radius):
                raise SurfaceError(
                    f"the hole of radius {r:g} about {show(c)} does not lie inside the disc of "
                    f"radius {self.radius:g} about {show(self.centre)}"
                )
            for other, s in holes[:k]:
                if abs(c - other) <= r + s:
                    raise SurfaceError(
                        f"the holes about {show(other)} and {show(c)} touch: make one hole of them"
                    )

    def contains(self, z: ArrayLike, slack: float = 0.0) -> NDArray[np.bool_]:
        """Return whether each of ``z`` lies inside, or less than ``slack`` outside."""
        points = np.asarray(z, complex)
        inside = np.abs(points - self.centre) <= self.radius + slack
        for c, r in self.holes:
            inside &= np.abs(points - c) >= r - slack
        return np.asarray(inside)

    def grid(self, across: int = 72) -> ComplexArray:
        """Return the points of a square grid, ``across`` of them along a diameter, inside."""
        x = (np.arange(across) + 0.5) / across * 2 - 1
        points = self.centre + self.radius * (x[:, None] + 1j * x).ravel()
        return np.asarray(points[self.contains(points)], complex)

    def borders(self, n: int = 256) -> ComplexArray:
        """Return ``n`` points on each border circle, (1 + holes, n)."""
        turn = np.exp(2j * np.pi * np.arange(n) / n)
        circles = [(self.centre, self.radius), *self.holes]
        return np.asarray([c + r * turn for c, r in circles], complex)

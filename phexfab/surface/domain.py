"""Plane domains of parameters: discs, with round holes or without, and what a centre sees."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from phexfab.errors import SurfaceError
from phexfab.surface.holomorphic import ComplexArray, show

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]
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

    Examples
    --------
    >>> import phexfab as px
    >>> ring = px.Disc(0, 0.9, holes=((0, 0.3),))
    >>> ring.contains([0.1, 0.5, 1.0j]).tolist()
    [False, True, False]
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

    @property
    def is_round(self) -> bool:
        """Whether the outer border is a circle."""
        return True

    def reach_at(self, arm: ComplexArray) -> FloatArray:
        """Return how far the outer border is from the centre, in the directions of ``arm``."""
        return np.full(np.shape(arm), self.radius)

    def widened(self, share: float) -> Self:
        """Return the domain with its borders moved outwards by a share of their radius."""
        holes = tuple((c, r * (1 - share)) for c, r in self.holes)
        return replace(self, radius=self.radius * (1 + share), holes=holes)

    def contains(self, z: ArrayLike, slack: float = 0.0) -> BoolArray:
        """Return whether each of ``z`` lies inside, or less than ``slack`` outside."""
        points = np.asarray(z, complex)
        arm = points - self.centre
        inside = np.abs(arm) <= self.reach_at(arm) + slack
        for c, r in self.holes:
            inside &= np.abs(points - c) >= r - slack
        return np.asarray(inside)

    def is_outside(self, centre: ComplexArray, reach: float) -> BoolArray:
        """Return which discs of radius ``reach`` lie wholly outside the domain."""
        away = np.abs(centre - self.centre) > self.radius + reach
        for c, r in self.holes:
            away |= np.abs(centre - c) + reach < r
        return np.asarray(away)

    def clipped(self, z: ComplexArray) -> ComplexArray:
        """Return ``z`` with what lies outside moved radially to the domain's border.

        A loop keeps its winding numbers about all places inside: nothing is moved across them.
        """
        arm = z - self.centre
        reach = self.reach_at(arm)
        z = np.where(np.abs(arm) > reach, self.centre + reach * _unit(arm), z)
        for c, r in self.holes:
            z = np.where(np.abs(z - c) < r, c + r * _unit(z - c), z)
        return z

    def border_at(self, number: IntArray, s: FloatArray) -> ComplexArray:
        """Return places on borders, 0 the outer one, at numbers s in [0, 1] around them."""
        centres = np.array([self.centre, *(c for c, _ in self.holes)])
        radii = np.array([0.0, *(r for _, r in self.holes)])
        turn = np.exp(2j * np.pi * s)
        reach = np.where(number == 0, self.reach_at(turn), radii[number])
        return np.asarray(centres[number] + reach * turn)

    def borders(self, n: int = 256) -> ComplexArray:
        """Return ``n`` points on each border, (1 + holes, n)."""
        number = np.arange(1 + len(self.holes))[:, None]
        return self.border_at(*np.broadcast_arrays(number, np.arange(n) / n))

    def grid(self, across: int = 72) -> ComplexArray:
        """Return the points of a square grid, ``across`` of them along a diameter, inside."""
        x = (np.arange(across) + 0.5) / across * 2 - 1
        points = self.centre + self.radius * (x[:, None] + 1j * x).ravel()
        return np.asarray(points[self.contains(points)], complex)


@dataclass(frozen=True, eq=False)
class Star(Disc):
    """What is seen from a centre: the places at most so far away as the border in their direction.

    Attributes
    ----------
    centre, radius, holes
        See `Disc`; ``radius`` is the farthest that the border gets, and found from ``reach``.
    reach : (n,)
        Distance of the border at angles 2π k / n; linear between them.
    """

    reach: FloatArray = field(default_factory=lambda: np.ones(1))

    def __post_init__(self) -> None:
        object.__setattr__(self, "radius", float(np.max(self.reach)))
        super().__post_init__()

    @property
    def is_round(self) -> bool:
        return False

    def reach_at(self, arm: ComplexArray) -> FloatArray:
        place = np.angle(arm) / (2 * np.pi) % 1.0 * len(self.reach)
        low = np.minimum(place.astype(np.int64), len(self.reach) - 1)
        share = place - low
        after = np.where(low + 1 < len(self.reach), low + 1, 0)
        return np.asarray((1 - share) * self.reach[low] + share * self.reach[after])

    def widened(self, share: float) -> Self:
        wide = super().widened(share)
        return replace(wide, reach=self.reach * (1 + share))

    @cached_property
    def _border(self) -> tuple[cKDTree, float]:
        """Points of the outer border, and the farthest that one of the border is from them."""
        border = self.border_at(np.zeros(4096, np.int64), np.arange(4096) / 4096)
        widest = float(np.abs(np.diff(border, append=border[:1])).max())
        return cKDTree(np.column_stack([border.real, border.imag])), 0.5 * widest

    def is_outside(self, centre: ComplexArray, reach: float) -> BoolArray:
        tree, gap = self._border
        apart = tree.query(np.column_stack([centre.real, centre.imag]))[0] > reach + gap
        arm = centre - self.centre
        away = apart & (np.abs(arm) > self.reach_at(arm))
        return np.asarray(away | super().is_outside(centre, reach))


def _unit(z: ComplexArray) -> ComplexArray:
    return np.asarray(np.exp(1j * np.angle(z)))

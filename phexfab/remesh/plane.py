"""The triangular lattice of the plane: its vectors, its nearest points."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.triangular import mean_distance

ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]


@dataclass(frozen=True)
class PlaneLattice:
    """The points ``step (i + j/2) + 1j step row_ratio j``, times 1j where rows run along v.

    It is its own image under half-turns about its points and under its translations.

    Attributes
    ----------
    step, row_ratio : float
        Distance of neighbours in a row; distance of rows divided by it.
    rows_along : ``"u"`` or ``"v"``
    """

    step: float
    row_ratio: float
    rows_along: str = "u"

    @property
    def basis(self) -> tuple[complex, complex]:
        """The vectors to the next point in the row and to the next row."""
        along = self.step * (1j if self.rows_along == "v" else 1.0 + 0j)
        return along, along * complex(0.5, self.row_ratio)

    @property
    def neighbours(self) -> ComplexArray:
        """The (6,) vectors to the neighbours, counter-clockwise; the first runs along the row."""
        a, b = self.basis
        return np.array([a, b, b - a, -a, -b, a - b])

    @property
    def mean_distance(self) -> float:
        """Mean distance of neighbours."""
        return self.step * mean_distance(self.row_ratio)

    def nearest(self, w: ArrayLike) -> ComplexArray:
        """Return the lattice point nearest to each of ``w``."""
        points = np.asarray(w, complex)
        a, b = self.basis
        q = points / a
        row = np.floor(q.imag / self.row_ratio)
        best = np.full(points.shape, np.inf + 0j)
        for j in (row, row + 1):
            candidate = np.round(q.real - 0.5 * j) * a + j * b
            best = np.where(np.abs(candidate - points) < np.abs(best - points), candidate, best)
        return best

    def nearest_few(self, w: ComplexArray, n: int) -> ComplexArray:
        """Return the ``n`` nearest lattice points of each of ``w`` (k,), (k, n), nearest first."""
        points = self.nearest(w)
        cloud = self.around(0j, self.step * (2 + np.sqrt(n)))
        all_near = points[:, None] + cloud
        order = np.argsort(np.abs(all_near - w[:, None]), axis=1, kind="stable")[:, :n]
        return np.take_along_axis(all_near, order, 1)

    def remainder(self, w: ArrayLike) -> ComplexArray:
        """Return ``w`` minus the nearest lattice point."""
        return np.asarray(w, complex) - self.nearest(w)

    def around(self, w: complex, radius: float) -> ComplexArray:
        """Return all lattice points within a distance, row by row."""
        a, b = self.basis
        q, reach = w / a, radius / self.step
        rows = np.arange(
            np.ceil((q.imag - reach) / self.row_ratio),
            np.floor((q.imag + reach) / self.row_ratio) + 1,
        )
        i = np.arange(np.floor(-reach) - 1, np.ceil(reach) + 2)
        columns = np.round(q.real - 0.5 * rows)[:, None] + i
        points = (columns * a + rows[:, None] * b).ravel()
        return np.asarray(points[np.abs(points - w) <= radius])

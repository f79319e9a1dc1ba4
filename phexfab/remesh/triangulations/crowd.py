"""The points that are already there: where a layer would run into them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


class Crowd:
    """Points that grow in number; trees are rebuilt as it doubles, so that none is built often."""

    def __init__(self) -> None:
        self._trees: list[cKDTree] = []

    def add(self, groups: Sequence[FloatArray]) -> None:
        """Add points (k, 3)."""
        fresh = np.concatenate([np.zeros((0, 3)), *groups])
        while self._trees and self._trees[-1].n <= len(fresh):
            fresh = np.concatenate([self._trees.pop().data, fresh])
        if len(fresh):
            self._trees.append(cKDTree(fresh))

    def near(self, points: FloatArray, radius: float) -> BoolArray:
        """Return (k,) whether any point lies within ``radius`` of points (k, 3)."""
        out = np.zeros(len(points), bool)
        for tree in self._trees:
            out |= np.isfinite(tree.query(points, distance_upper_bound=radius)[0])
        return out

    def away(self, points: FloatArray) -> FloatArray:
        """Return (k,) how far points (k, 3) are from the nearest that is there."""
        out = np.full(len(points), np.inf)
        for tree in self._trees:
            out = np.minimum(out, tree.query(points)[0])
        return out

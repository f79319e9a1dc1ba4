"""Cutting again and again: stations step aside and sides fold until no edge is too short.

One cut says which edges are too short and where. Stations on fitted sides then move away from
vertices and edges. Flat sides fold instead, in one of several ways, and each side keeps the folds
that served it best: so a long border with many sides needs no luck with all of them at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.errors import MeshError
from phexfab.parallel.aside import RimEdges, rim_edges, step_aside
from phexfab.parallel.border import Border
from phexfab.parallel.cut_planes import shell_of_pieces
from phexfab.parallel.fence import Fence, Stations, build_fence
from phexfab.parallel.folds import FlatSide, Wanted, flat_sides, fold, shifted, straight_planes
from phexfab.parallel.shell import Shell
from phexfab.parallel.slivers import Patchwork, Tidied, tidy
from phexfab.parallel.split import split
from phexfab.parallel.walk import Ground, LostWayError, walk

FloatArray = NDArray[np.float64]

ROUNDS = 6
"""How often stations may step aside, to avoid vertices and short edges."""

FOLDS = ((1.0, False), (1.5, False), (1.0, True), (1.5, True))
"""Distances, over the shortest edge, at which folded sides keep from vertices; held at corners?"""

WORK, CUTS = 120_000, (10, 30)
"""Panels in all cuts together while sides fold; how many cuts that is at least and at most."""

Limits = tuple[float, float, float, tuple[float, float]]
"""Least area and width of a piece, shortest edge, depth below and above."""


@dataclass(frozen=True, eq=False)
class Attempt:
    """A cut, with what was measured of it.

    Attributes
    ----------
    shell : Shell
    fences : list of Fence
        Of the borders, in order.
    tidied : Tidied
    merged, cut : int
        Small pieces that a neighbour was extended over; pieces that the borders cut off.
    rim : RimEdges
    """

    shell: Shell
    fences: list[Fence]
    tidied: Tidied
    merged: int
    cut: int
    rim: RimEdges

    @property
    def cost(self) -> float:
        """Pieces that are too thin, and edges that are too short, very short ones more."""
        return len(self.tidied.deepest) + self.rim.lack


@dataclass(frozen=True, eq=False)
class Cutting:
    """What is to be cut along which borders.

    Attributes
    ----------
    whole : Shell
    ground : Ground
        Of that shell.
    borders : sequence of Border
    limits : Limits
    sagitta, size : float, mm
        How far chords may leave their border; of a panel.
    direction : (3,) or None
        Along which is to be cut.
    """

    whole: Shell
    ground: Ground
    borders: Sequence[Border]
    limits: Limits
    sagitta: float
    size: float
    direction: FloatArray | None

    def fences(self, stations: Sequence[Stations]) -> list[Fence]:
        """Return the planes for stations; MeshError where they would lean too much."""
        return [
            build_fence(one, at, self.size / 12, self.direction)
            for one, at in zip(self.borders, stations, strict=True)
        ]

    def attempt(self, fences: list[Fence], turn: int) -> Attempt:
        """Cut along fences; vertices in a plane change sides with the turn.

        Raises
        ------
        LostWayError
            If a fence meets a vertex or runs along an edge.
        """
        whole, ground, limits = self.whole, self.ground, self.limits
        push = 1e-7 * self.size * (-1.0 if turn % 2 == 0 else 1.0)
        walks, first = [], 0
        for fence in fences:
            walks.append(walk(ground, fence, push, first))
            first += len(fence.normals)
        pieces = split(whole, ground, walks)
        rim = int(np.count_nonzero(pieces.parent >= 0))
        old = pieces.parent[:rim]
        plane_normals = np.concatenate([fence.normals for fence in fences])
        normals = np.concatenate([whole.normals[old], plane_normals])
        plane_heights = np.concatenate([fence.heights for fence in fences])
        heights = np.concatenate([whole.heights[old], plane_heights])
        try:
            patch = Patchwork(normals, heights, pieces.triangles, rim)
        except ValueError as error:
            raise LostWayError(f"a border touches a panel twice: {error}") from error
        tidied = tidy(patch, pieces.cut.tolist(), limits[0], limits[1])
        shell = shell_of_pieces(whole, patch, old, fences)
        return Attempt(
            shell,
            fences,
            tidied,
            tidied.merged + pieces.filled,
            len(pieces.cut) + pieces.filled,
            rim_edges(shell, limits[2], limits[3]),
        )

    def step_aside(self, fences: list[Fence], made: Attempt | None, turn: int) -> list[Stations]:
        """Return stations that keep away from what was too near in a cut, or in none."""
        margin = max(self.limits[2], 1e-3 * self.size)
        deepest = np.zeros((0, 3)) if made is None else made.tidied.deepest
        rim = None if made is None else made.rim
        return [
            step_aside(self.ground, fence, margin, self.limits[1], self.sagitta, deepest, rim, turn)
            for fence in fences
        ]

    @cached_property
    def trees(self) -> list[cKDTree]:
        """Of the borders' points."""
        return [cKDTree(one.points) for one in self.borders]

    def cost_along(self, made: Attempt, sides: Sequence[Sequence[FlatSide]]) -> list[list[float]]:
        """Return what every side adds to the cost of a cut; corners count for both of theirs."""
        spots = np.concatenate([made.rim.spots, made.tidied.deepest])
        costs = np.concatenate([made.rim.lacks, np.ones(len(made.tidied.deepest))])
        found = []
        for border, tree, row in zip(self.borders, self.trees, sides, strict=True):
            away, point = tree.query(spots) if len(spots) else (np.zeros(0), np.zeros(0, int))
            stop = border.stops[point]
            near = away < self.size
            found.append(
                [float(costs[near & one.along(border, stop, self.size / 4)].sum()) for one in row]
            )
        return found


def cut_stepping(
    cutting: Cutting, stations: list[Stations]
) -> tuple[Attempt | None, MeshError | None]:
    """Cut, stations stepping aside; return the best cut, and why others failed.

    Raises
    ------
    MeshError
        If planes would lean too much from the first.
    """
    best: Attempt | None = None
    failure: MeshError | None = None
    idle = 0
    for k in range(ROUNDS):
        try:
            fences = cutting.fences(stations)
        except MeshError as error:  # stations that stepped aside may make planes lean too much
            if not k:
                raise
            return best, failure or error
        made = None
        try:
            made = cutting.attempt(fences, k)
        except LostWayError as error:
            failure = failure or error
        else:
            idle = idle + 1 if best is not None and made.cost > 0.98 * best.cost else 0
            if best is None or made.cost < best.cost:
                best = made
            if not made.cost or idle == 2:
                break
        stations = cutting.step_aside(fences, made, k)
    return best, failure


def cut_folding(
    cutting: Cutting, stations: list[Stations]
) -> tuple[Attempt | None, MeshError | None]:
    """Cut, flat and straight sides folding; return the best cut, if any, and why others failed.

    A side that has lost nothing in one way of folding keeps it while the others try the next one;
    in the end all have the folds that served each of them best.
    """
    least, depth, size = cutting.limits[2], cutting.limits[3], cutting.size
    ways = [Wanted(reach * least, depth, size, held) for reach, held in FOLDS]
    if cutting.direction is None:
        stations = [
            straight_planes(one, at, fence)
            for one, at, fence in zip(
                cutting.borders, stations, cutting.fences(stations), strict=True
            )
        ]
    sides = [
        flat_sides(cutting.ground, one, at, ways[0])
        for one, at in zip(cutting.borders, stations, strict=True)
    ]
    if not any(sides):
        return None, None
    best: Attempt | None = None
    failure: MeshError | None = None
    kept = [[(np.inf, one) for one in row] for row in sides]
    left = int(np.clip(WORK / cutting.whole.mesh.n_faces, *CUTS))
    for way in (*ways, None):
        folds = [
            [
                known if way is None or not cost else replace(one, wanted=way)
                for (cost, known), one in zip(known_row, row, strict=True)
            ]
            for known_row, row in zip(kept, sides, strict=True)
        ]
        made, lost, cuts = _folded(cutting, stations, folds, kept, min(left, ROUNDS))
        failure, left = failure or lost, left - cuts
        if made is not None and (best is None or made.cost < best.cost):
            best = made
        if not left or (best is not None and not best.cost):
            break
    return best, failure


def _folded(
    cutting: Cutting,
    stations: list[Stations],
    folds: list[list[FlatSide]],
    kept: list[list[tuple[float, FlatSide]]],
    rounds: int,
) -> tuple[Attempt | None, MeshError | None, int]:
    """Cut with sides folding in one way; sides that do better than ``kept`` take its place.

    Returns the best cut, why others failed, and how many there were.
    """
    best: Attempt | None = None
    failure: MeshError | None = None
    idle = 0
    for k in range(rounds):
        stations = [
            fold(cutting.whole, cutting.ground, one, at, row)
            for one, at, row in zip(cutting.borders, stations, folds, strict=True)
        ]
        try:
            fences = cutting.fences(stations)
        except MeshError as error:
            return best, failure or error, k + 1
        made = None
        try:
            made = cutting.attempt(fences, k)
        except LostWayError as error:
            failure = failure or error
        else:
            idle += 1
            if best is None or made.cost < 0.98 * best.cost:
                idle = 0
            if best is None or made.cost < best.cost:
                best = made
            for b, row in enumerate(cutting.cost_along(made, folds)):
                for n, cost in enumerate(row):
                    if cost < kept[b][n][0]:
                        kept[b][n], idle = (cost, folds[b][n]), 0
            if not made.cost or idle == 2:
                break
        stations = cutting.step_aside(fences, made, k)
        if made is not None:
            folds = [
                shifted(row, fence, made.rim) for row, fence in zip(folds, fences, strict=True)
            ]
    return best, failure, k + 1

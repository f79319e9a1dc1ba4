"""Boundary values of a film as samples on the circle and on the rim: the start, and refinement."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

from phexfab.surface.disc_films.grid import (
    BoundaryGrid,
    FloatArray,
    graded_grid,
    inverse_power_share,
    uniform_grid,
)
from phexfab.surface.disc_films.sides import Sides
from phexfab.surface.disc_films.start import start_arcs
from phexfab.surface.disc_films.stretch import Stretch, stretch_between

START = 160  # chords of the rim in the start
UNEVEN = 1.5  # distance of samples on the rim, by the mean one, above which they are moved
WAVES = 12.0  # samples per wave of their density


@dataclass(frozen=True, eq=False)
class BoundaryState:
    """Boundary values of a film: samples on the circle and on the rim.

    Attributes
    ----------
    sides : Sides
    grid : BoundaryGrid
    gaps : (P,)
        Arcs of the circle between corners.
    s : (N,)
        Side coordinates of the samples, ascending on each side.
    points : (N, 3)
        In units of the rim.
    """

    sides: Sides
    grid: BoundaryGrid
    gaps: FloatArray
    s: FloatArray
    points: FloatArray

    @property
    def free(self) -> NDArray[np.bool_]:
        """Whether each sample is free, corners between free and fixed sides not included."""
        loose = np.zeros(max(self.sides.corners, 1), bool)
        loose[list(self.sides.planes)] = True
        held = (self.grid.tau == 0) & ~np.roll(loose, 1)[self.grid.side]
        return loose[self.grid.side] & ~held

    def parameters(self) -> FloatArray:
        """Return the rim parameters (N,); on free sides those of the start, without meaning."""
        return self.sides.parameter(self.grid.side, self.s)


def first_state(sides: Sides, count: int) -> BoundaryState:
    """Return a start with the right parts of the circle for the parts of the rim."""
    rim = sides.rim
    lengths = np.diff(rim.arc_length(sides.ends), axis=1)[:, 0]
    starts = rim.arc_length(sides.ends[:, 0])
    pieces = np.maximum(np.rint(START * lengths / lengths.sum()), 8).astype(int)
    shares = [np.arange(n) / n for n in pieces]
    t = [
        rim.at_length(a + length * share)
        for a, length, share in zip(starts, lengths, shares, strict=True)
    ]
    arcs = np.split(start_arcs(sides.point(np.concatenate(t))), np.cumsum(pieces)[:-1])
    gaps = np.array([part.sum() for part in arcs])
    tables = []
    for k, part in enumerate(arcs):
        turned = np.append(0.0, np.cumsum(part) / gaps[k])
        along = (np.append(t[k], sides.ends[k, 1]) - sides.ends[k, 0]) / np.ptp(sides.ends[k])
        if sides.corners:
            after = (k + 1) % sides.corners
            turned = inverse_power_share(turned, sides.grading[k], sides.grading[after])
            along = inverse_power_share(along, sides.orders[k], sides.orders[after])
        turned[-1] = along[-1] = 1.0
        tables.append((turned, along))
    counts = side_counts(lengths, count)
    return _sampled(sides, gaps, counts, tables, (None,) * len(counts))


def side_counts(lengths: FloatArray, count: int) -> NDArray[np.intp]:
    """Return samples per side: half of them shared out evenly, half by length; even numbers."""
    wish = 0.5 * count * (1 / len(lengths) + lengths / lengths.sum())
    return 2 * np.maximum(np.rint(0.5 * wish), 4).astype(np.intp)


def _sampled(
    sides: Sides,
    gaps: FloatArray,
    counts: NDArray[np.intp],
    tables: list[tuple[FloatArray, FloatArray]],
    stretches: tuple[Stretch | None, ...],
) -> BoundaryState:
    """Return the state that interpolates (place, s) of each side; s need not begin at 0."""
    moved = list(stretches)
    for k, (place, s) in enumerate(tables):
        if k not in sides.planes and (moved[k] is not None or _unevenness(s) > UNEVEN):
            wanted = 0.5 * (s - s[0] + _turning(sides, k, s))
            moved[k] = stretch_between(place, wanted, len(place) / WAVES, not sides.corners)
    if sides.corners:
        grid = graded_grid(counts, sides.grading, tuple(moved))
    else:
        grid = uniform_grid(int(counts[0]), moved[0])
    values = np.empty(len(grid.tau))
    for k, (place, s) in enumerate(tables):
        new = grid.side == k
        if not sides.corners:
            place, s = (np.concatenate([v[-4:-1] - 1, v, v[1:4] + 1]) for v in (place, s))
        values[new] = PchipInterpolator(place, s)(grid.place[new])
    return BoundaryState(sides, grid, gaps, values, sides.point(sides.parameter(grid.side, values)))


def resampled(state: BoundaryState, factor: int = 1) -> BoundaryState:
    """Return the state on ``factor`` times as many samples, moved to where they are needed."""
    sides, old = state.sides, state.grid
    counts = factor * np.bincount(old.side)
    tables = []
    for k in range(len(counts)):
        mine = old.side == k
        s = state.s[mine]
        closed = 1.0 if sides.corners else 1.0 + s[0]
        tables.append((np.append(old.place[mine], 1.0), np.append(s, closed)))
    found = _sampled(sides, state.gaps, counts, tables, old.stretches)
    starts = np.flatnonzero(old.tau == 0)
    for k in sides.planes:
        ring = np.append(np.flatnonzero(old.side == k), starts[(k + 1) % len(counts)])
        new = found.grid.side == k
        curve = PchipInterpolator(tables[k][0], state.points[ring])
        found.points[new] = curve(found.grid.place[new])
    return found


def _turning(sides: Sides, side: int, s: FloatArray) -> FloatArray:
    """Return the share of a side's turning up to each s."""
    sides_of_s = np.full(len(s), side)
    t = sides.parameter(sides_of_s, np.minimum(s, 1.0) if sides.corners else s)
    first, second = sides.rim.derivative(t), sides.rim.derivative(t, 2)
    rate = np.linalg.norm(np.cross(first, second), axis=1) / (first**2).sum(1)
    part = 0.5 * (rate[1:] + rate[:-1]) * np.abs(np.diff(t))
    # Evenly where a side is straight.
    part += 0.1 * np.diff(s)
    return np.append(0.0, np.cumsum(part) / part.sum())


def _unevenness(s: FloatArray) -> float:
    """Return the widest distance between samples on the rim by the mean one."""
    return float(np.diff(s).max() * (len(s) - 1) / (s[-1] - s[0]))


def unevenness(state: BoundaryState) -> float:
    """Return the greatest unevenness of any fixed side's samples."""
    found = [1.0]
    for k in range(max(state.sides.corners, 1)):
        if k not in state.sides.planes:
            mine = state.s[state.grid.side == k]
            found.append(
                _unevenness(np.append(mine, 1.0 + (0.0 if state.sides.corners else mine[0])))
            )
    return max(found)

"""The first row of a triangulation: a curve along a direction field, closed where it comes back."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import LatticeError
from phexfab.remesh.triangulations.fields import Directions
from phexfab.surface.freeform.surface import FreeformSurface

FloatArray = NDArray[np.float64]

PART = 4  # steps of a trace per edge
MOST = 4000  # edges of a row


@dataclass(frozen=True, eq=False)
class Row:
    """Points of one row.

    Attributes
    ----------
    u : (n, 2) or (n, 3) float
    x : (n, 3) float
    columns : (n,) int
        Places in the row; neighbours in the row have neighbouring ones.
    closed : bool
        Whether the last point's neighbour is the first.
    """

    u: FloatArray
    x: FloatArray
    columns: NDArray[np.int64]
    closed: bool


def first_row(
    surface: FreeformSurface, directions: Directions, start: FloatArray, step: float
) -> Row:
    """Trace a curve along the row field through a parameter and divide it evenly.

    Raises
    ------
    LatticeError
        If the start is on or beyond the border, or the row is shorter than three steps.
    """
    if not bool(surface.inside(start)):
        raise LatticeError(f"{surface.name}: start {np.round(start, 6).tolist()} is not inside")
    ahead, closed = _trace(surface, directions, start, step, 1.0)
    path = ahead
    if not closed:
        back, _ = _trace(surface, directions, start, step, -1.0)
        path = np.concatenate([back[:0:-1], ahead])
    points = surface.point(path)
    if closed:
        path, points = np.concatenate([path, path[:1]]), np.concatenate([points, points[:1]])
    lengths = np.linalg.norm(np.diff(points, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(lengths)])
    if at[-1] < 3 * step:
        raise LatticeError(
            f"{surface.name}: the row through {points[0].round(3).tolist()} is {at[-1]:.6g} mm "
            f"long, less than three steps of {step:.6g} mm: take a smaller step"
        )
    if closed:
        count = round(at[-1] / step)
        places = at[-1] * np.arange(count) / count
    else:
        # The start stays a point of the row, whatever the border does.
        home = at[len(back) - 1]
        first, last = -np.floor(home / step), np.floor((at[-1] - home) / step)
        places = home + step * np.arange(first, last + 1)
    x = np.stack([np.interp(places, at, points[:, k]) for k in range(3)], axis=1)
    guess = path[np.minimum(np.searchsorted(at, places), len(path) - 1)]
    u = surface.nearest(x, guess)
    return Row(u, surface.point(u), np.arange(len(u)), closed)


def _trace(
    surface: FreeformSurface, directions: Directions, start: FloatArray, step: float, sign: float
) -> tuple[FloatArray, bool]:
    """Heun's method, a quarter of the step at a time; True if the curve closed up."""
    h = step / PART
    u = start[None]
    x = surface.point(u)
    home = x[0]
    bending = surface.bending(u)
    heading = sign * directions(x, bending)[0]
    origin = heading
    path = [start]
    for k in range(MOST * PART):
        ahead = surface.nearest(x + h * heading, u)
        bend = surface.bending(ahead)
        onward = directions(surface.point(ahead), bend)[0]
        onward = onward * np.sign(onward @ heading or 1.0)
        mean = heading + onward
        next_u = surface.nearest(x + h * mean / np.linalg.norm(mean), u)
        if not bool(surface.inside(next_u)[0]):
            return np.array(path), False
        x, u = surface.point(next_u), next_u
        bend = surface.bending(u)
        turned = directions(x, bend)[0]
        heading = turned * np.sign(turned @ onward or 1.0)
        if k > 2 * PART and np.linalg.norm(x[0] - home) < 0.75 * h and heading @ origin > 0.5:
            return np.array(path), True
        path.append(u[0])
    raise LatticeError(
        f"{surface.name}: a row winds on for more than {MOST} edges of {step:.6g} mm; take a "
        "larger step, or rows in another direction"
    )

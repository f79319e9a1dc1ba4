"""Corners of rims that turn inwards: films cannot go on beyond them, unless they are rounded."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from phexfab.surface.rims.rim import Rim

IntArray = NDArray[np.int64]

SAMPLES = 2048  # places at which a rim's curvature is measured


def inward_corners(rim: Rim, hole: bool = False) -> IntArray:
    """Return the numbers of a rim's corners at which the film has an angle of more than 180°.

    Parameters
    ----------
    rim : Rim
    hole : bool
        The film lies around the rim, not within it.

    Notes
    -----
    Seen along the rim's vector area ``½ ∮ x × dx``, about which it runs counter-clockwise.
    """
    if not len(rim.corners):
        return np.zeros(0, np.int64)
    _, points = rim.samples(max(512, 8 * len(rim.corners)))
    offset = points - points.mean(axis=0)
    area = np.cross(offset, np.roll(offset, -1, axis=0)).sum(axis=0)
    before, after = rim.derivative(rim.corners, before=True), rim.derivative(rim.corners)
    turn = np.cross(before, after) @ area
    return np.flatnonzero(turn > 0 if hole else turn < 0)


def inward_radius(rim: Rim) -> float:
    """Return the least radius, mm, with which an outer rim turns inwards: 0 at a sharp corner.

    Seen along the rim's vector area; infinite where it nowhere turns inwards.
    """
    if len(inward_corners(rim)):
        return 0.0
    t, points = rim.samples(SAMPLES)
    offset = points - points.mean(axis=0)
    area = np.cross(offset, np.roll(offset, -1, axis=0)).sum(axis=0)
    way, bend = rim.derivative(t, 1), rim.derivative(t, 2)
    turn = np.cross(bend, way) @ (area / np.linalg.norm(area)) / np.linalg.norm(way, axis=1) ** 3
    return float(1.0 / turn.max()) if turn.max() > 0 else float("inf")


def rounded_inward(rims: Sequence[Rim], radius: float) -> tuple[Rim, ...]:
    """Return rims with those corners rounded at which the film turns inwards.

    Parameters
    ----------
    rims : sequence of Rim
        Of one film; the longest is the outer one.
    radius : float, mm
        Along the rim on both sides of a corner, see ``Rim.smoothed``.

    Raises
    ------
    DesignError
        If the radius does not fit.
    """
    outer = max(range(len(rims)), key=lambda k: rims[k].length) if rims else 0
    made = []
    for k, rim in enumerate(rims):
        corners = inward_corners(rim, hole=k != outer)
        made.append(rim.smoothed(radius, corners.tolist()) if len(corners) else rim)
    return tuple(made)

"""Interpolating splines of degree 5 through the points of a rim, parametrised by arc length."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline, make_interp_spline

from phexfab.errors import DesignError
from phexfab.surface.rims.pieces import Piece, length_between, line, spline

FloatArray = NDArray[np.float64]

DEGREE = 5
SAME = 1e-9  # points nearer than this share of the size are one
STRAIGHT = 1e-12  # a side is straight if no point is farther from its chord, of its length
OVERSHOOT = 0.25  # of a chord, as an arc of 106 degrees: the most between two points


def place(point: ArrayLike) -> str:
    """Return coordinates (3,) in mm as messages write them."""
    x, y, z = (round(float(value), 6) + 0.0 for value in np.asarray(point, dtype=float))
    return f"({x:.6g}, {y:.6g}, {z:.6g})"


def clean_points(
    points: ArrayLike, corners: Sequence[int], name: str
) -> tuple[FloatArray, NDArray[np.intp]]:
    """Return the points (n, 3), without a repeated last one, and the sorted corner indices.

    Raises
    ------
    DesignError
        If they do not make a closed curve; the message names the place.
    """
    found = np.array(points, dtype=float)
    if found.ndim != 2 or found.shape[1] != 3:
        raise DesignError(f"{name}: points have shape {found.shape}; give (n, 3): x, y, z in mm")
    bad = np.flatnonzero(~np.isfinite(found).all(axis=1))
    if len(bad):
        raise DesignError(
            f"{name}: point {bad[0]} is {found[bad[0]].tolist()}; every coordinate must be finite"
        )
    size = float(np.linalg.norm(np.ptp(found, axis=0))) if len(found) else 0.0
    if len(found) and size == 0.0:
        raise DesignError(
            f"{name}: all {len(found)} points are at {place(found[0])}; the rim has no length"
        )
    if len(found) > 1 and np.linalg.norm(found[-1] - found[0]) <= SAME * size:
        # Closed by repeating the first point; a corner marked on either is the same corner.
        corners = [0 if k == len(found) - 1 else k for k in corners]
        found = found[:-1]
    if len(found) < 3:
        raise DesignError(f"{name}: {len(found)} points; a closed curve needs at least 3")
    gaps = np.linalg.norm(np.roll(found, -1, axis=0) - found, axis=1)
    twice = np.flatnonzero(gaps <= SAME * size)
    if len(twice):
        k = int(twice[0])
        raise DesignError(
            f"{name}: points {k} and {(k + 1) % len(found)} are both at {place(found[k])}; "
            "remove one"
        )
    sharp = np.unique(np.asarray(list(corners), dtype=np.intp))
    if len(sharp) and (sharp[0] < 0 or sharp[-1] >= len(found)):
        raise DesignError(
            f"{name}: corner {int(sharp[-1] if sharp[-1] >= len(found) else sharp[0])} is no index "
            f"of its {len(found)} points; count from 0"
        )
    return found, sharp


def closed_spline(points: FloatArray, name: str) -> Piece:
    """Return the smooth closed piece through points (n, 3), starting at the first."""
    closed = np.concatenate([points, points[:1]])
    curve, at = _arc_length_spline(closed, periodic=True)
    _check_overshoot(curve, at, closed, np.arange(len(points) + 1) % len(points), name)
    return spline(curve, 0.0, float(at[-1]))


def pieces_between_corners(points: FloatArray, corners: NDArray[np.intp], name: str) -> list[Piece]:
    """Return one piece for each side, the first starting at the first corner."""
    n = len(points)
    pieces = []
    ends = [*corners[1:].tolist(), int(corners[0]) + n]
    for first, last in zip(corners.tolist(), ends, strict=True):
        index = np.arange(first, last + 1) % n
        side = points[index]
        if _is_straight(side):
            pieces.append(line(side[0], side[-1]))
            continue
        pieces.append(open_spline(side, index, name))
    return pieces


def open_spline(points: FloatArray, index: NDArray[np.intp], name: str) -> Piece:
    """Return the smooth piece through points (n, 3); ``index`` (n,) numbers them for messages."""
    curve, at = _arc_length_spline(points, periodic=False)
    _check_overshoot(curve, at, points, index, name)
    return spline(curve, 0.0, float(at[-1]))


def _is_straight(points: FloatArray) -> bool:
    chord = points[-1] - points[0]
    length = float(np.linalg.norm(chord))
    if length == 0.0:
        return False
    along = (points - points[0]) @ chord / length
    off = np.linalg.norm(points - points[0] - along[:, None] * chord / length, axis=1)
    return bool(np.all(np.diff(along) > 0.0) and off.max() <= STRAIGHT * length)


def _arc_length_spline(points: FloatArray, periodic: bool) -> tuple[BSpline, FloatArray]:
    """Interpolate at chord lengths, then twice more at the arc lengths of the interpolant.

    With chord lengths alone a quintic stays at fourth order (Floater and Surazhsky 2006).
    Returns the spline and its parameters (n,) at the points.
    """
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    for again in (True, True, False):
        steps = steps / steps.mean()  # knots about 1 apart keep the system well scaled
        at = np.concatenate([[0.0], np.cumsum(steps)])
        if periodic:
            curve = make_interp_spline(at, points, k=DEGREE, bc_type="periodic")
        else:
            curve = make_interp_spline(at, points, k=min(DEGREE, len(points) - 1))
        if again:
            # Every knot is a data point, so each stretch is one polynomial.
            piece, share = spline(curve, 0.0, float(at[-1])), at / at[-1]
            steps = length_between(piece, share[:-1], share[1:])
    return curve, at


def _check_overshoot(
    curve: BSpline, at: FloatArray, points: FloatArray, index: NDArray[np.intp], name: str
) -> None:
    """Refuse an interpolant that leaves the polyline: uneven spacing, or a corner not named."""
    start, chord = points[:-1], np.diff(points, axis=0)
    length = np.linalg.norm(chord, axis=1)
    inside = at[:-1, None] + np.diff(at)[:, None] * np.arange(1, 12) / 12
    offset = curve(inside) - start[:, None]
    along = np.einsum("nkc,nc->nk", offset, chord) / length[:, None] ** 2
    nearest = np.clip(along, 0.0, 1.0)[..., None] * chord[:, None]
    away = np.linalg.norm(offset - nearest, axis=2).max(axis=1) / length
    worst = int(np.argmax(away))
    if away[worst] > OVERSHOOT:
        middle = 0.5 * (points[worst] + points[worst + 1])
        raise DesignError(
            f"{name}: between points {int(index[worst])} and {int(index[worst + 1])} near "
            f"{place(middle)} the smooth curve leaves the straight line by {away[worst]:.2g} of "
            f"the points' distance (limit {OVERSHOOT}); the spacing is too uneven there: add "
            "points, or mark a corner"
        )

"""The sides of a rim as a film sees them: fixed curves, and planes along which its edge slides."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import beta

from phexfab.errors import SurfaceError
from phexfab.surface.disc_films.grid import FloatArray, power_share
from phexfab.surface.rims.rim import Rim

ORDER = 6.0  # of boundary values at a corner, as functions of the sample's number
STEEPEST = 28.0  # limit of the grading, reached at corners below 26 degrees
OUT_OF_PLANE = 1e-6  # of the rim's size: how far a free side may leave its plane


@dataclass(frozen=True, eq=False)
class Sides:
    """Sides of a rim in units of its size, about its middle.

    Attributes
    ----------
    rim : Rim
    size : float
        mm per unit.
    middle : (3,)
        In mm.
    ends : (P, 2)
        Rim parameters at which each side begins and ends; one row for a smooth rim.
    corners : int
        0 for a smooth rim.
    grading : (P,)
        Order p of the samples' grading at each corner, see `plateau_grid`.
    orders : (P,)
        Order of the boundary values there: p times the share of the corner's angle in 180°.
    planes : dict
        For each free side its orthonormal frame (3, 3): two directions, then the normal.
    """

    rim: Rim
    size: float
    middle: FloatArray
    ends: FloatArray
    corners: int
    grading: FloatArray
    orders: FloatArray
    planes: dict[int, FloatArray]

    def parameter(self, side: NDArray[np.intp], s: FloatArray) -> FloatArray:
        """Return rim parameters for side coordinates s in [0, 1], slow towards corners."""
        start, end = self.ends[side].T
        if not self.corners:
            return start + (end - start) * s
        share, rest = power_share(s, self.orders[side], np.roll(self.orders, -1)[side])
        return np.where(s < 0.5, start + (end - start) * share, end - (end - start) * rest)

    def slope(self, side: NDArray[np.intp], s: FloatArray) -> FloatArray:
        """Return the derivative of `parameter` by s."""
        width = self.ends[side, 1] - self.ends[side, 0]
        if not self.corners:
            return width
        p, q = self.orders[side], np.roll(self.orders, -1)[side]
        return width * s ** (p - 1) * (1 - s) ** (q - 1) / beta(p, q)

    def point(self, t: FloatArray) -> FloatArray:
        """Return points (n, 3) in units."""
        return (self.rim.point(t) - self.middle) / self.size

    def line(self, corner: int) -> FloatArray:
        """Return the directions (3, k) along which a corner between two free sides slides."""
        one, two = self.planes[corner], self.planes[(corner - 1) % self.corners]
        along = np.cross(one[:, 2], two[:, 2])
        length = np.linalg.norm(along)
        return one[:, :2] if length < 1e-6 else (along / length)[:, None]


def sides_of(rim: Rim, free: Sequence[int] = ()) -> Sides:
    """Return the sides of a rim; ``free`` are the numbers of those that slide in their planes.

    Raises
    ------
    SurfaceError
        If a free side does not exist, is not plane, or lies on one line (which spans no plane);
        or if no side is fixed.
    """
    ends = np.array(rim.sides())
    corners = len(rim.corners)
    chosen = sorted({int(side) for side in free})
    count = len(ends)
    for side in chosen:
        if not 0 <= side < count or not corners:
            known = f"sides 0 to {count - 1}" if corners else "no corners, so no sides"
            raise SurfaceError(f"{rim.name}: side {side} cannot be free, the rim has {known}")
    if corners and len(chosen) == count:
        raise SurfaceError(
            f"{rim.name}: all {count} sides are free, so that the film may shrink away; keep at "
            "least one side fixed"
        )
    size = rim.size
    planes = {side: _plane(rim, side, ends[side], size) for side in chosen}
    low, high = rim.box
    shares = np.array([_angle_share(rim, c, ends, planes) for c in range(corners)])
    shares = shares.reshape(-1)
    grading = np.clip(ORDER / np.maximum(shares, 1e-3), 2.0, STEEPEST)
    return Sides(rim, size, 0.5 * (low + high), ends, corners, grading, grading * shares, planes)


def _plane(rim: Rim, side: int, ends: FloatArray, size: float) -> FloatArray:
    points = rim.point(np.linspace(ends[0], ends[1] - 1e-12, 129))
    offset = points - points[0]
    _, spread, frame = np.linalg.svd(offset, full_matrices=False)
    if spread[1] <= 1e-9 * size * len(points) ** 0.5:
        raise SurfaceError(
            f"{rim.name}: side {side} is straight, so that it does not name a plane to slide in; "
            "draw it as a curve in its plane"
        )
    out = np.abs(offset @ frame[2])
    if out.max() > OUT_OF_PLANE * size:
        where = points[int(out.argmax())].round(1).tolist()
        raise SurfaceError(
            f"{rim.name}: side {side} cannot be free, because it is not plane: it leaves its "
            f"plane by {2 * out.max():.3g} mm near {where}; draw it in a plane or keep it fixed"
        )
    return frame.T


def _angle_share(rim: Rim, corner: int, ends: FloatArray, planes: dict[int, FloatArray]) -> float:
    """Return an angle of the film at a corner by 180°, from below where it is not known."""
    before = (corner - 1) % len(ends)
    out = rim.derivative(np.array([ends[corner, 0]]))[0]
    back = -rim.derivative(np.array([ends[corner, 0]]), before=True)[0]
    out, back = out / np.linalg.norm(out), back / np.linalg.norm(back)
    if corner in planes and before in planes:
        cosine = abs(planes[corner][:, 2] @ planes[before][:, 2])
        return 1.0 if cosine > 1 - 1e-9 else float(np.arccos(cosine) / np.pi)
    if corner in planes or before in planes:
        normal = planes[corner if corner in planes else before][:, 2]
        tangent = back if corner in planes else out
        return max(float(np.arcsin(min(abs(normal @ tangent), 1.0)) / np.pi), 1 / 12)
    chord = np.linalg.norm(out - back)
    return float(2 * np.arctan2(chord, np.linalg.norm(out + back)) / np.pi)

"""The borders along which a shell is cut: closed polylines on the film, with its normals."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from phexfab.errors import MeshError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Border:
    """A closed curve on a film, densely sampled; the film lies to its left.

    Left is meant walking along the curve, seen from the tips of the normals: an outer border runs
    counter-clockwise, the border of a hole clockwise.

    Attributes
    ----------
    points : (n, 3) mm
        In order; the last is joined to the first.
    normals : (n, 3) unit
        The film's normals there.
    corners : (c,) int
        Which points are sharp corners, ascending; empty for a smooth curve.

    Raises
    ------
    MeshError
        If there are fewer than 8 points, two neighbours coincide, a value is not finite, a normal
        vanishes, or a corner is no point.

    Examples
    --------
    >>> import numpy as np
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(5000.0)  # mm
    >>> z = surface.parameter(0.4 * np.exp(2j * np.pi * np.arange(400) / 400))
    >>> border = px.Border(surface.point(z), surface.normal(z), [])
    >>> print(f"{border.length / 1e3:.2f} m")
    7.29 m
    """

    points: FloatArray
    normals: FloatArray
    corners: IntArray

    def __post_init__(self) -> None:
        points, normals = np.asarray(self.points, float), np.asarray(self.normals, float)
        corners = np.unique(np.asarray(self.corners, np.int64))
        n = len(points)
        if points.shape != (n, 3) or normals.shape != points.shape or n < 8:
            raise MeshError(
                f"a border has {points.shape} points and {normals.shape} normals; give (n, 3) each "
                "with n of at least 8"
            )
        size = np.linalg.norm(normals, axis=1)
        if not (np.all(np.isfinite(points)) and np.all(np.isfinite(size)) and size.min() > 0):
            raise MeshError("a border has points or normals that are no numbers, or a zero normal")
        if len(corners) and (corners[0] < 0 or corners[-1] >= n):
            raise MeshError(f"corner {corners[-1]} of a border is no point; it has {n}")
        gaps = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
        if gaps.min() == 0:
            k = int(gaps.argmin())
            raise MeshError(f"points {k} and {(k + 1) % n} of a border coincide; leave one out")
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "normals", normals / size[:, None])
        object.__setattr__(self, "corners", corners)

    @cached_property
    def stops(self) -> FloatArray:
        """(n + 1,) mm along the border at every point, and its length at the end."""
        gaps = np.linalg.norm(np.roll(self.points, -1, axis=0) - self.points, axis=1)
        return np.concatenate([[0.0], np.cumsum(gaps)])

    @property
    def length(self) -> float:
        """Length, mm."""
        return float(self.stops[-1])

    def at(self, along: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the points (m, 3) and unit normals (m, 3) at (m,) mm along the border."""
        s = np.asarray(along, float) % self.length
        stops, n = self.stops, len(self.points)
        k = np.clip(np.searchsorted(stops, s, side="right") - 1, 0, n - 1)
        t = ((s - stops[k]) / (stops[k + 1] - stops[k]))[:, None]
        onward = (k + 1) % n
        points = (1 - t) * self.points[k] + t * self.points[onward]
        normals = (1 - t) * self.normals[k] + t * self.normals[onward]
        return points, normals / np.linalg.norm(normals, axis=1, keepdims=True)

    def between(self, start: float, end: float, spacing: float) -> FloatArray:
        """Return mm along the border from ``start`` on to ``end``, both included."""
        span = (end - start) % self.length or self.length
        return start + np.linspace(0.0, span, max(3, int(np.ceil(span / spacing)) + 1))


def place(point: FloatArray) -> str:
    """Return how messages write a point."""
    return "(" + ", ".join(f"{x:.0f}" for x in point) + ") mm"


def samples_of(begin: FloatArray, end: FloatArray, spacing: float) -> FloatArray:
    """Return points on segments (n, 3) to (n, 3), no further apart than the spacing."""
    count = np.maximum(np.ceil(np.linalg.norm(end - begin, axis=1) / spacing), 1).astype(np.int64)
    owner = np.repeat(np.arange(len(begin)), count)
    share = (np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)) / count[owner]
    return begin[owner] + share[:, None] * (end - begin)[owner]


def distance_to_segments(points: FloatArray, begin: FloatArray, end: FloatArray) -> FloatArray:
    """Return the (m,) distances of points from the nearest of n segments.

    Of many, segments are cut into pieces of about their mean length; the nearest piece's middle
    bounds the distance, and a second look at all pieces within that bound makes it exact.
    """
    if len(points) * len(begin) < 2000:
        chord = end - begin
        offset = points[:, None] - begin
        share = np.einsum("psi,si->ps", offset, chord) / np.einsum("si,si->s", chord, chord)
        offset = offset - np.clip(share, 0.0, 1.0)[:, :, None] * chord
        return np.sqrt(np.einsum("psi,psi->ps", offset, offset).min(axis=1))
    length = np.linalg.norm(end - begin, axis=1)
    spacing = float(max(length.mean(), length.sum() / 20_000))
    count = np.maximum(np.ceil(length / spacing), 1).astype(np.int64)
    owner = np.repeat(np.arange(len(begin)), count)
    step = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)
    share = (step / count[owner])[:, None]
    low = begin[owner] + share * (end - begin)[owner]
    along = (end - begin)[owner] / count[owner][:, None]
    tree = cKDTree(low + along / 2)
    reach = float(np.linalg.norm(along, axis=1).max()) / 2

    def to(rows: IntArray, piece: IntArray) -> FloatArray:
        offset = points[rows] - low[piece]
        square = np.einsum("ij,ij->i", along[piece], along[piece])
        t = np.clip(np.einsum("ij,ij->i", offset, along[piece]) / square, 0.0, 1.0)
        return np.asarray(np.linalg.norm(offset - t[:, None] * along[piece], axis=1))

    rows = np.arange(len(points))
    middle, nearest = tree.query(points)
    bound = to(rows, nearest)
    near = tree.query_ball_point(points, np.minimum(bound, middle) + reach * (1 + 1e-9))
    sizes = np.array([len(row) for row in near])
    rows = np.repeat(rows, sizes)
    flat = np.concatenate([np.asarray(row, np.int64) for row in near])
    np.minimum.at(bound, rows, to(rows, flat))
    return bound

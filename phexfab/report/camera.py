"""Where a picture is taken from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class View:
    """A look at a scene from outside.

    Attributes
    ----------
    azimuth, elevation : float
        Degrees: where the eye stands, seen from the scene; z is up.
    opening : float
        Degrees of the lens; small is nearly parallel.
    """

    azimuth: float = -62.0
    elevation: float = 24.0
    opening: float = 26.0

    @property
    def axes(self) -> FloatArray:
        """Rows: to the right, upwards, and from the scene to the eye."""
        a, e = np.radians([self.azimuth, self.elevation])
        back = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return np.array([right, np.cross(back, right), back])


@dataclass(frozen=True, eq=False)
class Camera:
    """A view fitted to points: projects to pixels and back.

    Attributes
    ----------
    axes : (3, 3) array
        Rows right, up, back.
    target : (3,) array
    distance : float
        From the target to the eye.
    near, far : float
        Bounds of the distance of the points from the eye's plane.
    scale : float
        Pixels per unit of slope.
    centre : (2,) array
        Pixel of the optical axis.
    """

    axes: FloatArray
    target: FloatArray
    distance: float
    near: float
    far: float
    scale: float
    centre: FloatArray

    @property
    def eye(self) -> FloatArray:
        """(3,) position of the eye."""
        return self.target + self.distance * self.axes[2]

    def project(self, points: FloatArray) -> FloatArray:
        """Return (…, 3): pixel x, pixel y downwards, depth in 0..1 growing towards the eye."""
        local = (points - self.target) @ self.axes.T
        away = self.distance - local[..., 2]
        x = self.centre[0] + self.scale * local[..., 0] / away
        y = self.centre[1] - self.scale * local[..., 1] / away
        low, high = 1 / self.far, 1 / self.near
        return np.stack([x, y, (1 / away - low) / (high - low)], axis=-1)

    def rays(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Return (…, 3) directions through pixels, of unit length along the optical axis."""
        u = (x - self.centre[0]) / self.scale
        v = (self.centre[1] - y) / self.scale
        return u[..., None] * self.axes[0] + v[..., None] * self.axes[1] - self.axes[2]

    def away(self, depth: FloatArray) -> FloatArray:
        """Return the distance from the eye's plane that belongs to a depth."""
        low, high = 1 / self.far, 1 / self.near
        return 1 / (low + depth * (high - low))


def fit_camera(view: View, points: FloatArray, size: tuple[int, int], margin: float) -> Camera:
    """Return the camera that shows all points with a margin (a fraction of the picture)."""
    axes = view.axes
    low, high = points.min(0), points.max(0)
    target = (low + high) / 2
    radius = float(np.linalg.norm(points - target, axis=1).max()) or 1.0
    distance = radius / np.sin(np.radians(view.opening) / 2)
    local = (points - target) @ axes.T
    away = distance - local[:, 2]
    flat = local[:, :2] / away[:, None]
    left, right = flat.min(0), flat.max(0)
    extent = np.maximum(right - left, 1e-9 * radius / distance)
    room = np.array(size) * (1 - 2 * margin)
    scale = float((room / extent).min())
    middle = (left + right) / 2
    centre = np.array(size) / 2 + scale * np.array([-middle[0], middle[1]])
    # Ground and slack behind and in front of the points.
    near, far = away.min() - 0.05 * radius, away.max() + 0.05 * radius
    return Camera(axes, target, float(distance), float(near), float(far), scale, centre)

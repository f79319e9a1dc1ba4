"""Between the plane and the unit sphere: rotations that keep the pole clear, circles as planes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def stereographic(normals: FloatArray) -> ComplexArray:
    """Return g = (x + iy)/(1 − z) of unit vectors (..., 3), the north pole being infinity."""
    return np.asarray((normals[..., 0] + 1j * normals[..., 1]) / (1 - normals[..., 2]), complex)


def farthest_direction(normals: FloatArray) -> FloatArray:
    """Return a unit vector as far as can be from all of the (n, 3) unit vectors."""
    k = np.arange(600) + 0.5
    z = 1 - 2 * k / len(k)
    azimuth = np.pi * (1 + np.sqrt(5)) * k
    ring = np.sqrt(1 - z * z)
    candidates = np.column_stack([ring * np.cos(azimuth), ring * np.sin(azimuth), z])
    mean = normals.mean(axis=0)
    size = np.linalg.norm(mean)
    if size > 1e-3:
        candidates = np.vstack([-mean / size, candidates])
    thinned = normals[:: max(1, len(normals) // 2000)]
    worst = np.max(candidates @ thinned.T, axis=1)
    # The first of nearly equal ones, so that rounding does not decide.
    return candidates[int(np.flatnonzero(worst <= worst.min() + 1e-9)[0])]


def rotation_to_north(direction: FloatArray) -> FloatArray:
    """Return a (3, 3) rotation that takes a unit vector to (0, 0, 1).

    The shortest one on the northern half; from the southern half a half-turn about x goes before
    it, since near the south pole the shortest rotation is lost in rounding.
    """
    half_turn = np.diag([1.0, -1.0, -1.0])
    x, y, z = direction if direction[2] >= 0 else half_turn @ direction
    v = np.array([y, -x, 0.0])  # direction × north
    skew = np.array([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])
    turn = np.eye(3) + skew + skew @ skew / (1 + z)
    return turn if direction[2] >= 0 else turn @ half_turn


def lift_circles(centres: ComplexArray, radii: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Lift circles of the plane to the sphere and return the planes they lie in.

    Returns
    -------
    normals : (F, 3)
        Unit normals, pointing to the side of the lifted disc.
    heights : (F,)
        Below 1; the circle's plane is ``n·x = h``.
    """
    power = np.abs(centres) ** 2 - radii**2
    normal = np.column_stack([2 * centres.real, 2 * centres.imag, power - 1])
    size = np.sqrt((power + 1) ** 2 + 4 * radii**2)
    return normal / size[:, None], (power + 1) / size

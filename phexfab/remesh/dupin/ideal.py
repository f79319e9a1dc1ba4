"""Ideal triangles, whose Dupin hexagons are affinely regular (K > 0) or quasi-regular (K < 0)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]

REGULAR = np.stack([np.cos(np.arange(6) * np.pi / 3), np.sin(np.arange(6) * np.pi / 3)], axis=1)
"""The regular hexagon."""

QUASI_REGULAR = np.array(
    [[1, 0.75**0.5], [-1, 0.75**0.5], [-0.5, 0], [-1, -(0.75**0.5)], [1, -(0.75**0.5)], [0.5, 0]]
)
"""The quasi-regular hexagon: two halves of a regular one joined by their short bases."""


@dataclass(frozen=True, eq=False)
class IdealConstruction:
    """The construction of an ideal triangle over an edge AB.

    Attributes
    ----------
    middle : (..., 2) float
        M, the midpoint of AB.
    parallelogram : (..., 2, 2) float
        D and E: AD and BE are conjugate to AB; MD and ME are conjugate to each other for K > 0 and
        asymptotic for K < 0.
    apex : (..., 2) float
        C, on the line through M conjugate to AB, with |CM| = √3 |AD|.
    """

    middle: FloatArray
    parallelogram: FloatArray
    apex: FloatArray


def ideal_construction(a: ArrayLike, b: ArrayLike, kappa: ArrayLike) -> IdealConstruction:
    """Construct the ideal triangles over edges AB, on their left.

    Parameters
    ----------
    a, b : (..., 2)
        Ends, along the principal directions.
    kappa : (..., 2)
        Principal curvatures at M. Where AB is asymptotic, or has an asymptotic conjugate (a
        parabolic point), the apex degenerates: it is M, or not finite.

    References
    ----------
    Thesis §5.1.4 (whose "K < 0" in the case of the ellipse means K > 0); Wang et al. 2008.
    """
    a, b = np.asarray(a, float), np.asarray(b, float)
    k = np.asarray(kappa, float)
    middle, half = 0.5 * (a + b), 0.5 * (b - a)
    line = np.stack([-(k * half)[..., 1], (k * half)[..., 0]], axis=-1)
    side = np.sign(half[..., 0] * line[..., 1] - half[..., 1] * line[..., 0])
    line = np.where(side < 0, -1.0, 1.0)[..., None] * line
    # The conic with semidiameter MA has the conjugate semidiameter b with |II(b, b)| = |II(A, A)|:
    # DE touches the ellipse there; for a hyperbola M + A + b lies on the asymptote.
    along = np.abs((k * half**2).sum(-1))
    across = np.abs((k * line**2).sum(-1))
    with np.errstate(all="ignore"):
        semi = np.sqrt(along / across)[..., None] * line
    corners = np.stack([a + semi, b + semi], axis=-2)
    return IdealConstruction(middle, corners, middle + np.sqrt(3.0) * semi)


def ideal_triangle(a: ArrayLike, b: ArrayLike, kappa: ArrayLike) -> FloatArray:
    """Return the ideal triangles (..., 3, 2) over edges AB, their apex on the left."""
    one, two = np.broadcast_arrays(np.asarray(a, float), np.asarray(b, float))
    return np.stack([one, two, ideal_construction(one, two, kappa).apex], axis=-2)


def ideal_centres(triangles: ArrayLike) -> FloatArray:
    """Return the ideal places (..., 4, 2) of a Dupin centre in triangles (..., 3, 2).

    First the centroid, for K > 0; then, for K < 0, the midpoints of the centroid and each corner.
    """
    corner = np.asarray(triangles, float)
    centroid = corner.mean(axis=-2, keepdims=True)
    return np.concatenate([centroid, 0.5 * (corner + centroid)], axis=-2)


def affine_distance(hexagons: ArrayLike, model: ArrayLike = REGULAR) -> FloatArray:
    """Return (...) how far hexagons are from affine images of a model hexagon.

    Parameters
    ----------
    hexagons : (..., 6, 2) or (..., 6, 3)
    model : (6, 2)
        ``REGULAR`` or ``QUASI_REGULAR``; the corner at which it begins is free.

    Returns
    -------
    (...) float
        Root mean square distance to the best affine image over that of the corners from their
        mean: 0 for an affine image.
    """
    corner = np.asarray(hexagons, float)
    corner = corner - corner.mean(axis=-2, keepdims=True)
    shape = np.asarray(model, float)
    best = np.full(corner.shape[:-2], np.inf)
    size = (corner**2).sum(axis=(-1, -2))
    for shift in range(6):
        basis = np.linalg.qr(np.roll(shape - shape.mean(axis=0), shift, axis=0))[0]
        caught = np.einsum("ia,...ij->...aj", basis, corner)
        rest = corner - np.einsum("ia,...aj->...ij", basis, caught)
        best = np.minimum(best, (rest**2).sum(axis=(-1, -2)))
    return np.sqrt(best / size)

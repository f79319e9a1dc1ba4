"""Charts of a curved patch in which equilateral triangles of the plane are nearly equilateral.

The chart is the flattening of a triangulation that changes angles least. What counts as the patch
is free: the surface, its Gauss image, or its projective dual. An aligned chart also keeps principal
directions parallel as far as that goes, since hexagons of tangent planes are valid only while the
rows of the lattice follow them.

References
----------
Lévy, Petitjean, Ray, Maillot 2002, "Least squares conformal maps".
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import SurfaceError
from phexfab.linalg import factorise
from phexfab.remesh.survey.patch import Patch

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]

_ROUNDS = 3


def conformal_chart(points: FloatArray, triangles: IntArray) -> ComplexArray:
    """Return the least-squares conformal flattening (N,) complex of a triangulated disc.

    Parameters
    ----------
    points : (N, 3)
    triangles : (T, 3) int
        All kept counter-clockwise.

    Raises
    ------
    SurfaceError
        If a triangle has no area or is turned over in the plane.
    """
    rows = _conformal_rows(points, triangles)
    one = int(np.argmax(np.sum((points - points.mean(axis=0)) ** 2, axis=1)))
    other = int(np.argmax(np.sum((points - points[one]) ** 2, axis=1)))
    n, apart = len(points), float(np.linalg.norm(points[other] - points[one]))
    chart = _solved(rows, np.array([one, n + one, other, n + other]), [0.0, 0.0, apart, 0.0])
    turned = _turned(chart, triangles)
    if len(turned):
        place = points[triangles[turned[0]][0]].round(3).tolist()
        raise SurfaceError(
            f"the patch cannot be flattened: its chart folds near {place}; take a smaller part"
        )
    return chart


def aligned_chart(patch: Patch, image: FloatArray) -> ComplexArray:
    """Return a nearly conformal chart (N,) complex of an image, rows running along the real axis.

    Parameters
    ----------
    patch : Patch
    image : (N, 3)
        The image of every sample, such as its normal.

    Returns
    -------
    The rows are the principal direction of the larger |κ|, or on a saddle, where either will do,
    the one of the larger |κ| on the whole. On a sphere the chart is just conformal.

    Raises
    ------
    SurfaceError
        See ``conformal_chart``.
    """
    chart = conformal_chart(image, patch.triangles)
    rows = _conformal_rows(image, patch.triangles)
    p = image[patch.triangles]
    one, two = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    size = np.sqrt(np.linalg.norm(np.cross(one, two), axis=1))
    axes = [_in_edges(patch, axis) for axis in range(2)]
    lengths = [np.linalg.norm(x[:, :1] * one + x[:, 1:] * two, axis=1) for x in axes]
    weight, larger = _evenness(patch)
    n, count = len(chart), len(p)
    if weight.sum() <= 1e-6 * count:
        return chart
    for _ in range(_ROUNDS):
        chart = chart / row_direction(patch, chart)
        z = chart[patch.triangles]
        steps = [x[:, 0] * (z[:, 1] - z[:, 0]) + x[:, 1] * (z[:, 2] - z[:, 0]) for x in axes]
        nearer = np.abs(steps[1].real / lengths[1]) > np.abs(steps[0].real / lengths[0])
        axis = np.where(larger < 0, nearer, larger)
        x = np.where(axis[:, None] == 1, axes[1], axes[0])
        x = x * (size * np.sqrt(weight) / np.where(axis == 1, lengths[1], lengths[0]))[:, None]
        # The imaginary part of the step along the chosen direction should vanish.
        values = np.column_stack([-x.sum(axis=1), x])
        row = np.repeat(np.arange(count), 3)
        along = sp.csr_matrix((values.ravel(), (row, n + patch.triangles.ravel())), (count, 2 * n))
        left, right = int(np.argmin(chart.real)), int(np.argmax(chart.real))
        apart = float(chart.real[right] - chart.real[left])
        aligned = _solved(
            sp.vstack([rows, along]).tocsr(), np.array([left, n + left, right]), [0.0, 0.0, apart]
        )
        if len(_turned(aligned, patch.triangles)):
            return chart
        chart = aligned
    return chart


def row_direction(patch: Patch, chart: ComplexArray) -> complex:
    """Return the unit direction in a chart of the larger |κ|, averaged; 1 where there is none."""
    x = _in_edges(patch, 0)
    z = chart[patch.triangles]
    d = x[:, 0] * (z[:, 1] - z[:, 0]) + x[:, 1] * (z[:, 2] - z[:, 0])
    double = (d / np.abs(d)) ** 2
    p = patch.points[patch.triangles]
    areas = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    weight, _ = _evenness(patch)
    k1, k2 = np.abs(patch.bending.kappa[patch.triangles[:, 0]]).T
    four = np.sum(areas * weight * double**2)
    two_fold = np.sum(areas * (k1 - k2) / (k1 + k2) * double)
    if abs(four) <= 1e-9 * areas.sum():
        return 1.0 + 0.0j
    rows = np.exp(0.25j * np.angle(four))
    return complex(rows if (two_fold * np.conj(rows) ** 2).real >= 0 else 1j * rows)


def _evenness(patch: Patch) -> tuple[FloatArray, IntArray]:
    """Return how much each triangle minds its rows' direction, and the axis it wants, or −1.

    Where K > 0 only uneven curvatures matter; where K < 0 the rows must keep to one of the two.
    """
    first = patch.triangles[:, 0]
    k1, k2 = np.abs(patch.bending.kappa[first]).T
    saddle = patch.bending.gauss[first] < 0
    weight = np.where(saddle, 1.0, ((k1 - k2) / (k1 + k2)) ** 2)
    return weight, np.where(saddle, -1, (k2 > k1).astype(np.int64))


def _in_edges(patch: Patch, axis: int) -> FloatArray:
    """Return (T, 2) a principal direction at each triangle in terms of its first and last edge."""
    p = patch.points[patch.triangles]
    edge = np.stack([p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]], axis=1)
    gram = np.einsum("tij,tkj->tik", edge, edge)
    right = np.einsum("tij,tj->ti", edge, patch.bending.directions[patch.triangles[:, 0], axis])
    return np.asarray(np.linalg.solve(gram, right[..., None])[..., 0])


def _conformal_rows(points: FloatArray, triangles: IntArray) -> Any:
    """Return (2T, 2N) rows that vanish on conformal charts, of all real, then all other parts."""
    p = points[triangles]
    along, beside = p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]
    length = np.linalg.norm(along, axis=1)
    area = np.linalg.norm(np.cross(along, beside), axis=1)
    if not np.all(area > 1e-12 * length**2):
        raise SurfaceError(
            f"a triangle of the patch near {p[int(np.argmin(area))][0].round(3).tolist()} has no "
            "area: the samples coincide there (a pole); choose a domain without it"
        )
    third = np.einsum("ij,ij->i", along, beside) / length + 1j * area / length
    corner = np.column_stack([np.zeros(len(p)), length, third])
    # Σ (q_{k+2} − q_{k+1}) ζ_k = 0 for an affine map that is a similarity, counter-clockwise.
    weight = (np.roll(corner, -2, axis=1) - np.roll(corner, -1, axis=1)) / np.sqrt(area)[:, None]
    row = np.repeat(np.arange(len(p)), 3)
    shape = (len(p), len(points))
    m = sp.csr_matrix((weight.ravel(), (row, triangles.ravel())), shape=shape)
    return sp.bmat([[m.real, -m.imag], [m.imag, m.real]]).tocsr()


def _solved(rows: Any, pinned: IntArray, values: list[float]) -> ComplexArray:
    """Return the chart of least residual with some of its 2N coordinates given."""
    size = rows.shape[1]
    free = np.setdiff1d(np.arange(size), pinned)
    matrix, right = rows[:, free], -(rows[:, pinned] @ np.array(values))
    flat = np.zeros(size)
    flat[pinned] = values
    flat[free] = factorise(matrix.T @ matrix).solve(matrix.T @ right)
    return np.asarray(flat[: size // 2] + 1j * flat[size // 2 :], complex)


def _turned(chart: ComplexArray, triangles: IntArray) -> IntArray:
    z = chart[triangles]
    area = ((z[:, 1] - z[:, 0]).conj() * (z[:, 2] - z[:, 0])).imag
    return np.flatnonzero(~(area > 0))

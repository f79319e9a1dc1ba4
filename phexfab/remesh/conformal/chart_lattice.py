"""A regular lattice in a chart of a curved patch."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from phexfab.errors import LatticeError
from phexfab.remesh.conformal.chart import row_direction
from phexfab.remesh.survey.patch import Patch
from phexfab.triangular import EQUILATERAL

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class ChartLattice:
    """Lattice points of a chart.

    Attributes
    ----------
    places : (F,) complex
        In the chart, exactly regular.
    u : (F, 2) or (F, 3)
        Parameters of the surface, interpolated between samples.
    triangles : (V, 3) int
        Counter-clockwise; each has at least one point with a closed ring.
    distortion : float
        Largest over smallest size of the lattice's triangles on the surface (lengths).
    """

    places: ComplexArray
    u: FloatArray
    triangles: IntArray
    distortion: float


def chart_lattice(
    patch: Patch,
    chart: ComplexArray,
    panel_size: float,
    *,
    turn: float = 0.0,
    row_ratio: float = EQUILATERAL,
) -> ChartLattice:
    """Return the lattice that is regular in a chart of a patch.

    Parameters
    ----------
    patch : Patch
    chart : (N,) complex
        Place of every sample; all triangles counter-clockwise. See
        ``phexfab.remesh.conformal.chart``.
    panel_size : float
        Mean distance of neighbouring lattice points on the surface, mm.
    turn : float
        Degrees by which rows are turned off the principal direction of the larger |κ|, which is
        averaged over the patch.
    row_ratio : float
        Row distance / step.

    Raises
    ------
    LatticeError
        If no lattice point has a closed ring.
    """
    if not panel_size > 0:
        raise LatticeError(f"panel_size = {panel_size}: it must be positive, in mm")
    p, z = patch.points[patch.triangles], chart[patch.triangles]
    areas = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1) / 2
    flat = ((z[:, 1] - z[:, 0]).conj() * (z[:, 2] - z[:, 0])).imag / 2
    step = panel_size * np.sqrt(EQUILATERAL / row_ratio * flat.sum() / areas.sum())
    along = step * row_direction(patch, chart) * np.exp(1j * np.radians(turn))
    # Lattice coordinates: ζ = origin + along·(s + t/2 + i·row_ratio·t), s and t whole numbers.
    origin = np.sum(flat * z.mean(axis=1)) / flat.sum()
    w = (chart - origin) / along
    t = w.imag / row_ratio
    s = w.real - t / 2
    places, host, share = _inside(np.column_stack([s, t])[patch.triangles])
    triangles = _ringed(places)
    used, inverse = np.unique(triangles, return_inverse=True)
    if not len(used):
        raise LatticeError(
            f"panel_size = {panel_size:g} mm: no panel has all its neighbours on the patch; take "
            "smaller panels or a larger domain"
        )
    host, share = host[used], share[used]
    u = np.einsum("fk,fkj->fj", share, patch.u[patch.triangles[host]])
    scale = np.sqrt(areas / flat)[host]
    at = places[used] @ np.array([1.0, 0.5 + 1j * row_ratio])
    return ChartLattice(
        origin + along * at, u, inverse.reshape(-1, 3), float(scale.max() / scale.min())
    )


def _inside(corners: FloatArray) -> tuple[IntArray, IntArray, FloatArray]:
    """Return whole-number points (F, 2) in the triangles (T, 3, 2), their triangle and weights."""
    low = np.ceil(corners.min(axis=1) - 1e-9).astype(np.int64)
    high = np.floor(corners.max(axis=1) + 1e-9).astype(np.int64)
    count = np.maximum(high - low + 1, 0)
    total = count.prod(axis=1)
    host = np.repeat(np.arange(len(corners)), total)
    order = np.arange(len(host)) - np.repeat(np.cumsum(total) - total, total)
    width = count[host, 1]
    places = low[host] + np.column_stack(
        [order // np.maximum(width, 1), order % np.maximum(width, 1)]
    )
    a, b, c = corners[host, 0], corners[host, 1], corners[host, 2]

    def area(p: FloatArray, q: FloatArray, r: FloatArray) -> FloatArray:
        one, two = q - p, r - p
        return np.asarray(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])

    whole = area(a, b, c)
    share = np.column_stack([area(places, b, c), area(a, places, c), area(a, b, places)])
    share = share / whole[:, None]
    keep = share.min(axis=1) > -1e-9
    places, first = np.unique(places[keep], axis=0, return_index=True)
    return places, host[keep][first], np.clip(share[keep][first], 0.0, 1.0)


def _ringed(places: IntArray) -> IntArray:
    """Return the lattice triangles of which some corner has all six, in the largest piece."""
    if not len(places):
        return np.zeros((0, 3), np.int64)
    low, high = places.min(axis=0) - 1, places.max(axis=0) + 1
    number = np.full(high - low + 1, -1)
    number[tuple((places - low).T)] = np.arange(len(places))

    def at(ds: int, dt: int) -> IntArray:
        return number[places[:, 0] + ds - low[0], places[:, 1] + dt - low[1]]

    here = np.arange(len(places))
    triangles = np.concatenate(
        [np.column_stack([here, at(1, 0), at(0, 1)]), np.column_stack([here, at(0, 1), at(-1, 1)])]
    )
    triangles = triangles[(triangles >= 0).all(axis=1)]
    panel = np.bincount(triangles.ravel(), minlength=len(places)) == 6
    triangles = triangles[panel[triangles].any(axis=1)]
    # Panels that share an edge are one piece.
    ends = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    ends = ends[panel[ends].all(axis=1)]
    graph = sp.coo_matrix((np.ones(len(ends)), tuple(ends.T)), shape=(len(places),) * 2)
    label = connected_components(graph, directed=False)[1]
    if panel.any():
        panel &= label == np.argmax(np.bincount(label[panel]))
    return np.asarray(triangles[panel[triangles].any(axis=1)])

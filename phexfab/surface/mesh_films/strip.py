"""First meshes between two rims: rows of vertices on the straight lines that join them."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from phexfab.surface.mesh_films.area import total_area

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def strip(samples: list[tuple[FloatArray, FloatArray]], edge: float) -> tuple[FloatArray, IntArray]:
    """Join two rims by rows of vertices on straight lines, with the pairing of least area.

    Parameters
    ----------
    samples : list of two ((k,) parameters, (k, 3) points)
    edge : float
        Length of edges to aim at, mm.

    Returns
    -------
    points : (n, 3) float
        First those of the first rim, then those of the second.
    triangles : (m, 3) int
    """
    (_, one), (_, two) = samples
    fine = 4 * max(len(one), len(two))
    a, b = _resampled(one, fine), _resampled(two, fine)
    best, found, ahead = np.inf, b, 1
    for direction in (1, -1):
        run = b[::direction]
        # Σ |a_j − run_{j+s}|² is least where the circular correlation is largest.
        spectrum = np.conj(np.fft.rfft(a, axis=0)) * np.fft.rfft(run, axis=0)
        score = np.fft.irfft(spectrum.sum(1), fine)
        shifted = np.roll(run, -int(score.argmax()), axis=0)
        triangles = _stitched(np.arange(fine), fine + np.arange(fine), a, shifted)
        area = total_area(np.concatenate([a, shifted]), triangles)
        if area < best:
            best, found, ahead = area, shifted, direction
    width = float(np.linalg.norm(a - found, axis=1).mean())
    rows = max(2, round(width / (edge * np.sqrt(3) / 2)))
    # The second rim's own samples, in the order of the pairing.
    start = int(np.linalg.norm(two - found[0], axis=1).argmin())
    order = (start + ahead * np.arange(len(two))) % len(two)
    levels, positions = [np.arange(len(one))], [one, two]
    count = len(one) + len(two)
    for r in range(1, rows):
        share = r / rows
        n = round((1 - share) * len(one) + share * len(two))
        # Every other row is shifted by half, so that triangles come out equilateral.
        at = (np.arange(n) + 0.5 * (r % 2)) / n * fine
        positions.append((1 - share) * _at(a, at) + share * _at(found, at))
        levels.append(count + np.arange(n))
        count += n
    levels.append(len(one) + order)
    points = np.concatenate(positions)
    rings = [_stitched(low, high, points[low], points[high]) for low, high in pairwise(levels)]
    return points, np.concatenate(rings)


def _resampled(closed: FloatArray, n: int) -> FloatArray:
    """Return n points at equal arc lengths on a closed polygon, the first its first."""
    run = np.concatenate([closed, closed[:1]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(run, axis=0), axis=1))])
    at = np.arange(n) / n * length[-1]
    return np.column_stack([np.interp(at, length, run[:, k]) for k in range(3)])


def _at(closed: FloatArray, place: FloatArray) -> FloatArray:
    low = np.floor(place).astype(np.int64)
    share = (place - low)[:, None]
    n = len(closed)
    return (1 - share) * closed[low % n] + share * closed[(low + 1) % n]


def _stitched(low: IntArray, high: IntArray, a: FloatArray, b: FloatArray) -> IntArray:
    """Return triangles between two closed rows, the shorter diagonal first."""
    n, m = len(low), len(high)
    # Begin at the pair of the second row nearest to the first of the first.
    start = int(np.linalg.norm(b - a[0], axis=1).argmin())
    high, b = np.roll(high, -start), np.roll(b, -start, axis=0)
    first, second = a.tolist(), b.tolist()
    i = j = 0
    out = []
    while i < n or j < m:
        ai, bj = first[i % n], second[j % m]
        up = sum((x - y) ** 2 for x, y in zip(ai, second[(j + 1) % m], strict=True))
        along = sum((x - y) ** 2 for x, y in zip(first[(i + 1) % n], bj, strict=True))
        # Neither row may run ahead of its share of the turn by more than a step or two.
        lead = (i + 1) * m - (j + 1) * n
        if j == m or (i < n and lead <= 2 * max(n, m) and (along <= up or -lead > 2 * max(n, m))):
            out.append((low[i % n], low[(i + 1) % n], high[j % m]))
            i += 1
        else:
            out.append((low[i % n], high[(j + 1) % m], high[j % m]))
            j += 1
    return np.array(out, np.int64)

"""Whole solutions of linear equations, and the lattice point nearest to a given one.

References
----------
Cohen 1993, "A Course in Computational Algebraic Number Theory", sec. 2.4 and 2.6; Babai 1986, "On
Lovász' lattice reduction and the nearest lattice point problem".
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def null_space(rows: NDArray[Any], size: int) -> IntArray:
    """Return (size, k) a basis of all whole solutions x of ``rows @ x = 0``.

    Column operations with whole coefficients, in Python's integers.

    Parameters
    ----------
    rows : (r, size) whole numbers
    size : int
    """
    work = [[int(row[j]) for row in rows] for j in range(size)]  # columns
    made = [[int(i == j) for i in range(size)] for j in range(size)]
    first = 0
    for r in range(len(rows)):
        while True:
            alive = [j for j in range(first, size) if work[j][r]]
            if len(alive) < 2:
                break
            least = min(alive, key=lambda j: (abs(work[j][r]), sum(map(abs, made[j])), j))
            for j in alive:
                if j == least:
                    continue
                times = work[j][r] // work[least][r]
                work[j] = [x - times * y for x, y in zip(work[j], work[least], strict=True)]
                made[j] = [x - times * y for x, y in zip(made[j], made[least], strict=True)]
        if alive:
            work[first], work[alive[0]] = work[alive[0]], work[first]
            made[first], made[alive[0]] = made[alive[0]], made[first]
            first += 1
    free = made[first:]
    return np.array(free, np.int64).reshape(len(free), size).T


def reduced_basis(gram: FloatArray) -> IntArray:
    """Return (k, k) unimodular U such that the columns of U are short and nearly orthogonal.

    Lenstra, Lenstra and Lovász' reduction of the form ``x·gram·x``.
    """
    k = len(gram)
    basis = np.eye(k, dtype=np.int64)
    low = np.linalg.cholesky(gram).T.copy()  # columns are the vectors
    i = 1
    for _ in range(200 * k * k + 1):
        if i >= k:
            break
        upper = np.array(np.linalg.qr(low[:, : i + 1], mode="r"), float)
        for j in range(i - 1, -1, -1):
            times = int(np.rint(upper[j, i] / upper[j, j]))
            if times:
                upper[:, i] -= times * upper[:, j]
                low[:, i] -= times * low[:, j]
                basis[:, i] -= times * basis[:, j]
        if upper[i, i] ** 2 >= (0.75 - (upper[i - 1, i] / upper[i - 1, i - 1]) ** 2) * (
            upper[i - 1, i - 1] ** 2
        ):
            i += 1
        else:
            low[:, [i - 1, i]] = low[:, [i, i - 1]]
            basis[:, [i - 1, i]] = basis[:, [i, i - 1]]
            i = max(i - 1, 1)
    return basis


def nearest_points(vectors: FloatArray, targets: FloatArray) -> IntArray:
    """Return (k, s) whole x with ``vectors @ x`` near the targets: Babai's planes, then descent.

    Parameters
    ----------
    vectors : (d, k)
        A reduced basis as columns.
    targets : (d, s)
    """
    k, count = vectors.shape[1], targets.shape[1]
    q, upper = np.linalg.qr(vectors)
    rest = q.T @ targets
    x = np.zeros((k, count), np.int64)
    for j in range(k - 1, -1, -1):
        x[j] = np.rint(rest[j] / upper[j, j]).astype(np.int64)
        rest = rest - upper[:, j, None] * x[j]
    if not k:
        return x
    slope = vectors.T @ (vectors @ x - targets)
    products = vectors.T @ vectors
    square = np.diag(products)[:, None]
    column = np.arange(count)
    for _ in range(16 * k):
        best = np.rint(-slope / square)
        gain = best * (2 * slope + best * square)
        j = np.argmin(gain, axis=0)
        move = np.where(gain[j, column] < 0, best[j, column], 0.0)
        if not move.any():
            break
        x[j, column] += move.astype(np.int64)
        slope = slope + products[:, j] * move
    return x

"""A z-buffer in arrays: which triangle is seen at each pixel, hidden surfaces exact."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_CHUNK = 3_000_000  # pixels in flight: bounds the memory, not the result


def rasterise(points: FloatArray, width: int, height: int) -> tuple[IntArray, FloatArray]:
    """Return the nearest triangle at every pixel centre, and its depth.

    Triangles become horizontal spans, spans become pixels; depth and number share one 64-bit
    key, so the nearest triangle is a minimum and ties go to the lower number.

    Parameters
    ----------
    points : (T, 3, 3) array
        Corners as (x, y) in pixels, y downwards, and a depth in 0..1 that is affine on screen
        and grows towards the eye (1/distance in a perspective, −distance in a parallel view).
    width, height : int
        In pixels.

    Returns
    -------
    seen : (height, width) int array
        Triangle number, −1 where there is none.
    depth : (height, width) array
        Depth of that triangle, 0 where there is none.
    """
    buffer = np.full(width * height, np.iinfo(np.uint64).max, np.uint64)
    tri, row, left, right = _spans(points, width, height)
    origin, slope_x, slope_y = _planes(points)
    nearest, farthest = points[:, :, 2].max(1), points[:, :, 2].min(1)
    count = right - left + 1
    ends = np.cumsum(count)
    total = int(ends[-1]) if len(ends) else 0
    cuts = np.searchsorted(ends, np.arange(0, max(total, 1), _CHUNK))
    for begin, end in zip(cuts, [*cuts[1:], len(tri)], strict=True):
        n = count[begin:end]
        span = np.repeat(np.arange(begin, end), n)
        x = left[span] + np.arange(len(span)) - np.repeat(np.cumsum(n) - n, n)
        t = tri[span]
        # Per span first: a slope is followed along x only.
        at_row = origin[tri[begin:end]] + slope_y[tri[begin:end]] * (row[begin:end] + 0.5)
        depth = np.repeat(at_row, n) + slope_x[t] * (x + 0.5)
        depth = np.clip(depth, farthest[t], nearest[t])
        key = ((1.0 - depth) * (2.0**32 - 2)).astype(np.uint64) << np.uint64(32)
        np.minimum.at(buffer, row[span] * width + x, key | t.astype(np.uint64))
    empty = buffer == np.iinfo(np.uint64).max
    seen = np.where(empty, -1, (buffer & np.uint64(0xFFFFFFFF)).astype(np.int64))
    far = (buffer >> np.uint64(32)).astype(np.float64) / (2.0**32 - 2)
    shape = (height, width)
    return seen.reshape(shape), np.where(empty, 0.0, 1.0 - far).reshape(shape)


def _spans(
    points: FloatArray, width: int, height: int
) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Return triangle, row, first and last column of every run of pixel centres inside."""
    x, y = points[:, :, 0], points[:, :, 1]
    ahead_x, ahead_y = np.roll(x, -1, 1), np.roll(y, -1, 1)
    area = (x * ahead_y - ahead_x * y).sum(1)
    top = np.maximum(np.ceil(y.min(1) - 0.5), 0).astype(np.int64)
    bottom = np.minimum(np.floor(y.max(1) - 0.5), height - 1).astype(np.int64)
    rows = np.where(area == 0, 0, np.maximum(bottom - top + 1, 0))
    tri = np.repeat(np.arange(len(points)), rows)
    row = top[tri] + np.arange(len(tri)) - np.repeat(np.cumsum(rows) - rows, rows)
    low = np.full(len(tri), -np.inf)
    high = np.full(len(tri), np.inf)
    sign = np.sign(area)
    for k in range(3):
        fall = y[:, k] - ahead_y[:, k]
        steep = fall != 0
        step = np.divide(x[:, k] - ahead_x[:, k], fall, out=np.zeros(len(x)), where=steep)
        crossing = x[tri, k] + (row + 0.5 - y[tri, k]) * step[tri]
        inward = (fall * sign)[tri]
        low = np.where(inward > 0, np.maximum(low, crossing), low)
        high = np.where(inward < 0, np.minimum(high, crossing), high)
    # The slack closes hairline cracks between neighbours; ties are settled by depth.
    left = np.ceil(np.clip(low, 0, width) - 0.5 - 1e-6).astype(np.int64)
    right = np.floor(np.clip(high, 0, width) - 0.5 + 1e-6).astype(np.int64)
    left, right = np.maximum(left, 0), np.minimum(right, width - 1)
    keep = right >= left
    return tri[keep], row[keep], left[keep], right[keep]


def _planes(points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return depth at the picture's corner and its slopes along x and y, per triangle."""
    first, second = points[:, 1] - points[:, 0], points[:, 2] - points[:, 0]
    area = first[:, 0] * second[:, 1] - second[:, 0] * first[:, 1]
    safe = np.where(area == 0, 1.0, area)
    slope_x = (first[:, 2] * second[:, 1] - second[:, 2] * first[:, 1]) / safe
    slope_y = (first[:, 0] * second[:, 2] - second[:, 0] * first[:, 2]) / safe
    origin = points[:, 0, 2] - slope_x * points[:, 0, 0] - slope_y * points[:, 0, 1]
    return origin, slope_x, slope_y

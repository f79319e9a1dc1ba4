"""Triangles of simple polygons in space, convex or not, all polygons of equal size at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.mesh.polymesh import PolyMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_SLACK = 1e-9  # of a triangle's area: how far outside a corner still blocks an ear


def triangulate(mesh: PolyMesh) -> tuple[IntArray, IntArray]:
    """Cut every face of a mesh into triangles by clipping ears.

    A fan from one corner is wrong on a non-convex face, and on a minimal surface every panel is
    one. Of all ears the best shaped is cut first. Faces with the same number of sides are clipped
    together, so the cost is linear in the number of faces.

    Parameters
    ----------
    mesh : PolyMesh
        Planar, simple faces.

    Returns
    -------
    triangles : (T, 3) int array
        Vertex indices, oriented like their face; ``n − 2`` for a face with ``n`` sides.
    faces : (T,) int array
        Face of each triangle, ascending.

    References
    ----------
    Meisters, Polygons have ears, Am. Math. Monthly 82 (1975).
    """
    triangles: list[IntArray] = [np.zeros((0, 3), np.int64)]
    owners: list[IntArray] = [np.zeros(0, np.int64)]
    for sides in np.unique(mesh.sides):
        faces = np.flatnonzero(mesh.sides == sides)
        corners = mesh.corners[mesh.starts[faces][:, None] + np.arange(sides)]
        local = _clip(_flatten(mesh.vertices[corners]))
        rows = np.arange(len(faces))[:, None, None]
        triangles.append(corners[rows, local].reshape(-1, 3))
        owners.append(np.repeat(faces, sides - 2))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(triangles)[order], owner[order]


def _flatten(points: FloatArray) -> FloatArray:
    """Return (K, n, 2) coordinates in the plane of each (K, n, 3) polygon, counter-clockwise."""
    centred = points - points.mean(1, keepdims=True)
    normal = np.cross(centred, np.roll(centred, -1, 1)).sum(1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    # The axis least along the normal keeps the frame well conditioned.
    seed = np.eye(3)[np.abs(normal).argmin(1)]
    first = np.cross(seed, normal)
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-300)
    second = np.cross(normal, first)
    frame = np.stack([first, second], axis=2)
    return centred @ frame


def _clip(points: FloatArray) -> IntArray:
    """Return (K, n − 2, 3) corner numbers of the ears of (K, n, 2) polygons."""
    count, sides = points.shape[:2]
    left = np.tile(np.arange(sides), (count, 1))
    out = np.empty((count, sides - 2, 3), np.int64)
    every = np.arange(count)
    for turn in range(sides - 3):
        ring = points[every[:, None], left]
        before, after = np.roll(ring, 1, 1), np.roll(ring, -1, 1)
        ear = _score(before, ring, after).argmax(1)
        size = sides - turn
        chosen = (ear[:, None] + np.array([-1, 0, 1])) % size
        out[:, turn] = left[every[:, None], chosen]
        left = left[np.arange(size) != ear[:, None]].reshape(count, size - 1)
    out[:, -1] = left
    return out


def _score(before: FloatArray, tip: FloatArray, after: FloatArray) -> FloatArray:
    """Return (K, m): shape of the triangle at each corner, below zero where it is no ear."""
    sides = ((before, tip), (tip, after), (after, before))
    area = _cross(tip - before, after - before)
    lengths = sum(((q - p) ** 2).sum(-1) for p, q in sides)
    shape = area / np.maximum(lengths, 1e-300)
    # A corner blocks an ear when it lies in the closed triangle without being one of its corners.
    inside = np.ones((*area.shape, area.shape[1]), bool)
    slack = -_SLACK * np.abs(area)[:, :, None]
    for p, q in sides:
        offset = tip[:, None] - p[:, :, None]
        inside &= _cross((q - p)[:, :, None], offset) >= slack
    number = np.arange(area.shape[1])
    apart = (number - number[:, None]) % len(number)
    inside &= (apart > 1) & (apart < len(number) - 1)
    return np.where(inside.any(2) | (area <= 0), shape - 10.0, shape)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]

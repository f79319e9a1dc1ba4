"""How far faces are from planar, as equations: as many for a face as it has corners beyond three.

A face is planar when the heights h of its corners over its least-squares plane vanish. Those
heights are free of constant and linear parts, so n − 3 numbers Cᵀh hold them, C an orthonormal
basis of what is left over in R^n; moving a corner by δ changes them by Cᵀ(n·δ), up to terms that
vanish with h.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.mesh.polymesh import PolyMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class _Group:
    """Faces with the same number of corners."""

    faces: IntArray  # (f,)
    vertices: IntArray  # (n, f)


@dataclass(frozen=True, eq=False)
class Linearised:
    """Planarity at one place: per group the normals (3, f) and bases (n, n − 3, f)."""

    normals: list[FloatArray]
    bases: list[FloatArray]


class PlanarRows:
    """The planarity equations of all faces with more than three corners.

    Faces come last in all arrays: long runs of numbers for every operation.
    """

    def __init__(self, mesh: PolyMesh) -> None:
        self.groups: list[_Group] = []
        columns, lengths, owners = [], [], []
        for n in np.unique(mesh.sides[mesh.sides > 3]):
            faces = np.flatnonzero(mesh.sides == n)
            vertices = mesh.corners[mesh.starts[faces] + np.arange(n)[:, None]]
            self.groups.append(_Group(faces, vertices))
            index = (3 * vertices.T[:, :, None] + np.arange(3)).reshape(-1, 1, 3 * n)
            columns.append(np.broadcast_to(index, (len(faces), n - 3, 3 * n)).ravel())
            lengths.append(np.full(len(faces) * (n - 3), 3 * n))
            owners.append(np.repeat(faces, n - 3))
        if len(self.groups) == 1:
            columns, lengths = [vertices.T.ravel()], [np.full(len(faces), n)]
        self._columns = _joined(columns, np.int64)
        self._starts = np.concatenate([[0], np.cumsum(_joined(lengths, np.int64))])
        if self._starts[-1] < 2**31 and 3 * len(mesh.vertices) < 2**31:  # what scipy is fast with
            self._columns = self._columns.astype(np.int32)
            self._starts = self._starts.astype(np.int32)
        self.face_of_row = _joined(owners, np.int64)
        self._width = 3 * len(mesh.vertices)

    def __len__(self) -> int:
        return len(self.face_of_row)

    def heights(self, x: FloatArray, like: Linearised | None = None) -> list[FloatArray]:
        """Return per group the (n, f) heights of corners over their least-squares planes.

        Seen from the normals of a place nearby they have its signs, and are good to the square of
        how far planes have turned since, over their size.
        """
        seen = [None] * len(self.groups) if like is None else like.normals
        return [_fit(p, normal)[1] for p, normal in zip(self._points(x), seen, strict=True)]

    def linearise(self, x: FloatArray) -> tuple[Linearised, sp.sparray, FloatArray]:
        """Return bases and normals, the Jacobian (rows, 3V) and the residual (rows,), mm."""
        normals, bases, heights, data = [], [], [], []
        for points in self._points(x):
            flat, height, normal = _fit(points)
            normals.append(normal)
            bases.append(_complement(flat))
            heights.append(height)
            share = bases[-1].transpose(2, 0, 1)[:, :, :, None]
            data.append(share * normal.T[:, None, None])  # (f, n, n − 3, 3)
        at = Linearised(normals, bases)
        return at, self._jacobian(data), self.residual(at, heights)

    def _jacobian(self, data: list[FloatArray]) -> sp.sparray:
        shape = (len(self), self._width)
        if len(data) == 1:  # a block for each corner: products take a third of the time
            blocks = data[0].reshape(-1, *data[0].shape[2:])
            return sp.bsr_array((blocks, self._columns, self._starts), shape=shape)
        flat = _joined([d.transpose(0, 2, 1, 3).ravel() for d in data])
        return sp.csr_array((flat, self._columns, self._starts), shape=shape)

    def residual(self, at: Linearised, heights: list[FloatArray]) -> FloatArray:
        """Return (rows,) heights from elsewhere in the bases of a place, mm."""
        pairs = zip(at.bases, heights, strict=True)
        return _joined([np.einsum("nkf,nf->kf", b, h).T.ravel() for b, h in pairs])

    def pushes(self, at: Linearised, weights: FloatArray) -> list[FloatArray]:
        """Return per group what weights (rows,) of the equations push corners by, (3, n, f)."""
        out, done = [], 0
        for normal, basis in zip(at.normals, at.bases, strict=True):
            _, k, f = basis.shape
            share = np.einsum("nkf,kf->nf", basis, weights[done : done + f * k].reshape(f, k).T)
            out.append(share * normal[:, None])
            done += f * k
        return out

    def weights(self, at: Linearised, pushes: list[FloatArray]) -> FloatArray:
        """Return the weights (rows,) at one place whose pushes are those from one nearby."""
        pairs = zip(at.normals, pushes, strict=True)
        return self.residual(at, [np.einsum("inf,if->nf", push, normal) for normal, push in pairs])

    @staticmethod
    def size(heights: list[FloatArray]) -> float:
        """Return the norm of all heights, mm."""
        return float(np.sqrt(sum(float(np.vdot(h, h)) for h in heights)))

    def worst(self, heights: list[FloatArray]) -> tuple[float, int]:
        """Return the largest height of a corner over its face's plane, mm, and the face."""
        best, face = 0.0, -1
        for group, height in zip(self.groups, heights, strict=True):
            size = np.abs(height).max(axis=0)
            at = int(size.argmax())
            if not size[at] <= best:
                best, face = float(size[at]), int(group.faces[at])
        return best, face

    def _points(self, x: FloatArray) -> Iterator[FloatArray]:
        """Yield per group the corners (3, n, f) of vertices (V, 3), about their face's mean."""
        across = np.ascontiguousarray(x.T)
        for group in self.groups:
            points = across.take(group.vertices, axis=1)
            points -= points[:, :1].copy()
            points -= np.add.reduce(points, axis=1, keepdims=True) / len(group.vertices)
            yield points


def _joined(parts: list[Any], kind: type = float) -> Any:
    return np.concatenate(parts) if parts else np.zeros(0, kind)


def _fit(
    x: FloatArray, seen: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return corner places in (2, n, f), and heights (n, f) over, the planes of (3, f) normals.

    Least squares, for corners (3, n, f) about their mean: linear fits in a frame that starts at
    the area vector and follows the plane, which is good to the height's cube; faces of hardly any
    area start at the scatter's axes. One fit from normals ``seen`` from nearby, where they are
    given.
    """
    if seen is not None:
        return _linear_fit(x, seen, x[:, 1] - x[:, 0])
    normal, along = _first_frame(x)
    normal = _linear_fit(x, normal, along)[2]
    return _linear_fit(x, normal, along)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the products (3, …) of vectors (3, …)."""
    return np.stack([a[i] * b[j] - a[j] * b[i] for i, j in ((1, 2), (2, 0), (0, 1))])


def _first_frame(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return normals (3, f) of corners (3, n, f) about their mean, and directions across them."""
    after = x[:, np.arange(1, x.shape[1] + 1) % x.shape[1]]
    normal = _cross(x, after).sum(axis=1)
    area, extent = np.sqrt((normal**2).sum(axis=0)), np.einsum("inf,inf->f", x, x)
    along = x[:, 1] - x[:, 0]
    thin = np.flatnonzero(~(area > 0.05 * extent))
    normal /= np.maximum(area, 1e-300)
    if len(thin):
        axes = np.linalg.eigh(np.einsum("inf,jnf->fij", x[:, :, thin], x[:, :, thin]))[1]
        normal[:, thin], along[:, thin] = axes[:, :, 0].T, axes[:, :, 2].T
    return normal, along


def _linear_fit(
    x: FloatArray, normal: FloatArray, along: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Fit linearly in the frame of normals (3, f) and the directions ``along`` (3, f)."""
    e = along - np.einsum("if,if->f", along, normal) * normal
    size = np.sqrt(np.einsum("if,if->f", e, e))
    extent = np.einsum("inf,inf->f", x, x)
    lost = np.flatnonzero(~(size > 1e-9 * np.sqrt(extent)))
    if len(lost):  # no length, or upright: any other direction
        up = normal[:, lost]
        other = np.eye(3)[np.abs(up).argmin(axis=0)].T
        e[:, lost] = other - (other * up).sum(axis=0) * up
        size = np.sqrt((e * e).sum(axis=0))
    e = e / size
    frame = np.stack([e, _cross(normal, e), normal])
    local = np.einsum("inf,jif->jnf", x, frame)
    flat, off = local[:2], local[2]
    xx, xy, xz = np.einsum("nf,jnf->jf", local[0], local)
    yy, yz = np.einsum("nf,jnf->jf", local[1], local[1:])
    det = xx * yy - xy * xy
    solid = det > 1e-24 * (xx + yy) ** 2
    if not solid.all():  # corners on a line leave the plane free
        det = np.where(solid, det, np.inf)
    a = (yy * xz - xy * yz) / det
    b = (xx * yz - xy * xz) / det
    stretch = np.sqrt(1 + a * a + b * b)
    height = (off - a * flat[0] - b * flat[1]) / stretch
    return flat, height, (normal - a * e - b * frame[1]) / stretch


def _complement(flat: FloatArray) -> FloatArray:
    """Return orthonormal bases (n, n − 3, f) of what is orthogonal to 1, x and y in R^n.

    What is orthogonal to 1 has a basis that does not depend on the face; Householder's two
    reflections in it for y and x leave the rest.
    """
    _, n, f = flat.shape
    fixed = _orthogonal_to_one(n)
    x, y = (fixed.T @ flat).reshape(2, n - 1, f)
    v, v_factor = _mirror(y)
    x -= (v_factor * np.einsum("nf,nf->f", v, x)) * v
    w, w_factor = _mirror(x[1:])
    # H_v H_w has the columns e_j − w_j·(factor·w) − v·factor·(v_j − w_j·factor·(v·w)).
    scaled = w_factor * w
    share = v_factor * (v[2:] - np.einsum("nf,nf->f", v[1:], w) * scaled[1:])
    basis = np.einsum("nf,kf->nkf", fixed @ v, -share)
    basis -= np.einsum("nf,kf->nkf", fixed[:, 1:] @ w, scaled[1:])
    basis += fixed[:, 2:, None]
    return basis


def _mirror(v: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return Householder vectors (n, f) for v onto its first axis, and 2 over their squares."""
    v = v.copy()
    size = np.sqrt(np.einsum("nf,nf->f", v, v))
    v[0] += np.where(v[0] < 0, -size, size)
    square = np.einsum("nf,nf->f", v, v)
    return v, np.divide(2.0, square, out=np.zeros_like(square), where=square > 0)


@lru_cache(maxsize=64)
def _orthogonal_to_one(n: int) -> FloatArray:
    """Return an orthonormal basis (n, n − 1) of what sums to nothing: Householder's, of 1."""
    v, factor = _mirror(np.ones((n, 1)))
    return np.eye(n)[:, 1:] - factor * v * v[1:].T

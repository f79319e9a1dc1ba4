"""How far faces are from planar, as equations: as many for a face as it has corners beyond three.

A face is planar when the heights h of its corners over its least-squares plane vanish. Those
heights are free of constant and linear parts, so n − 3 numbers Cᵀh hold them, C an orthonormal
basis of what is left over in R^n; moving a corner by δ changes them by Cᵀ(n·δ), up to terms that
vanish with h.
"""

from __future__ import annotations

from dataclasses import dataclass

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
    vertices: IntArray  # (f, n)


@dataclass(frozen=True, eq=False)
class Linearised:
    """Planarity at one place: per group the normals (f, 3) and bases (f, n, n − 3)."""

    normals: list[FloatArray]
    bases: list[FloatArray]


class PlanarRows:
    """The planarity equations of all faces with more than three corners."""

    def __init__(self, mesh: PolyMesh) -> None:
        self.groups: list[_Group] = []
        for n in np.unique(mesh.sides[mesh.sides > 3]):
            faces = np.flatnonzero(mesh.sides == n)
            self.groups.append(
                _Group(faces, mesh.corners[mesh.starts[faces][:, None] + np.arange(n)])
            )
        sizes = [g.vertices.shape for g in self.groups]
        columns, lengths, owners = [], [], []
        for (f, n), group in zip(sizes, self.groups, strict=True):
            shape = (f, n - 3, n, 3)
            index = 3 * group.vertices[:, None, :, None] + np.arange(3)
            columns.append(np.broadcast_to(index, shape).ravel())
            lengths.append(np.full(f * (n - 3), 3 * n))
            owners.append(np.repeat(group.faces, n - 3))
        self._columns = np.concatenate(columns) if columns else np.zeros(0, np.int64)
        ends = np.cumsum(np.concatenate(lengths)) if lengths else np.zeros(0, np.int64)
        self._starts = np.concatenate([[0], ends])
        if self._starts[-1] < 2**31 and 3 * len(mesh.vertices) < 2**31:  # what scipy is fast with
            self._columns = self._columns.astype(np.int32)
            self._starts = self._starts.astype(np.int32)
        self.face_of_row = np.concatenate(owners) if owners else np.zeros(0, np.int64)
        self._width = 3 * len(mesh.vertices)

    def __len__(self) -> int:
        return len(self.face_of_row)

    def heights(self, x: FloatArray, like: Linearised | None = None) -> list[FloatArray]:
        """Return per group the (f, n) heights of corners over their least-squares planes.

        Seen from the normals of a place nearby they have its signs, and are good to the square of
        how far planes have turned since, over their size.
        """
        starts: list[FloatArray | None] = [None] * len(self.groups)
        if like is not None:
            starts = list(like.normals)
        pairs = zip(self.groups, starts, strict=True)
        return [_fit(x[group.vertices], normal)[1] for group, normal in pairs]

    def linearise(self, x: FloatArray) -> tuple[Linearised, sp.csr_array, FloatArray]:
        """Return bases and normals, the Jacobian (rows, 3V) and the residual (rows,), mm."""
        normals, bases, data, right = [], [], [], []
        for group in self.groups:
            flat, height, normal = _fit(x[group.vertices])
            basis = _complement(flat)
            normals.append(normal)
            bases.append(basis)
            data.append(np.einsum("fik,fj->fkij", basis, normal).ravel())
            right.append(np.einsum("fik,fi->fk", basis, height).ravel())
        values = np.concatenate(data) if data else np.zeros(0)
        shape = (len(self), self._width)
        jacobian = sp.csr_array((values, self._columns, self._starts), shape=shape)
        return Linearised(normals, bases), jacobian, _joined(right)

    def residual(self, at: Linearised, heights: list[FloatArray]) -> FloatArray:
        """Return (rows,) heights from elsewhere in the bases of a place, mm."""
        pairs = zip(at.bases, heights, strict=True)
        return _joined([np.einsum("fik,fi->fk", b, h).ravel() for b, h in pairs])

    def pushes(self, at: Linearised, weights: FloatArray) -> list[FloatArray]:
        """Return per group what weights (rows,) of the equations push corners by, (f, n, 3)."""
        out, done = [], 0
        for normal, basis in zip(at.normals, at.bases, strict=True):
            f, _, k = basis.shape
            share = (basis @ weights[done : done + f * k].reshape(f, k, 1))[:, :, 0]
            out.append(share[:, :, None] * normal[:, None, :])
            done += f * k
        return out

    def weights(self, at: Linearised, pushes: list[FloatArray]) -> FloatArray:
        """Return the weights (rows,) at one place whose pushes are those from one nearby."""
        parts = []
        for normal, basis, push in zip(at.normals, at.bases, pushes, strict=True):
            share = np.einsum("fni,fi->fn", push, normal)
            parts.append((share[:, None, :] @ basis).ravel())
        return _joined(parts)

    @staticmethod
    def size(heights: list[FloatArray]) -> float:
        """Return the norm of all heights, mm."""
        return float(np.sqrt(sum(float((h * h).sum()) for h in heights)))

    def worst(self, heights: list[FloatArray]) -> tuple[float, int]:
        """Return the largest height of a corner over its face's plane, mm, and the face."""
        best, face = 0.0, -1
        for group, height in zip(self.groups, heights, strict=True):
            size = np.abs(height).max(axis=1)
            at = int(size.argmax())
            if not size[at] <= best:
                best, face = float(size[at]), int(group.faces[at])
        return best, face


def _joined(parts: list[FloatArray]) -> FloatArray:
    return np.concatenate(parts) if parts else np.zeros(0)


def _fit(
    points: FloatArray, seen: FloatArray | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return corner places in (f, n, 2), and heights (f, n) over, the planes of (f, 3) normals.

    Least squares: linear fits in a frame that starts at the area vector and follows the plane,
    which is good to the height's cube; faces of hardly any area start at the scatter's axes. One
    fit from normals ``seen`` from nearby, where they are given.
    """
    # Coordinates first and faces last: long runs of numbers for every operation.
    x = np.ascontiguousarray((points - points[:, :1]).transpose(2, 1, 0))
    x -= x.mean(axis=1, keepdims=True)
    if seen is not None:
        flat, height, normal = _linear_fit(x, seen.T, x[:, 1] - x[:, 0])
        return flat.transpose(2, 1, 0), height.T, normal.T
    normal, along = _first_frame(x)
    for _ in range(2):
        flat, height, normal = _linear_fit(x, normal, along)
    return flat.transpose(2, 1, 0), height.T, normal.T


def _first_frame(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return normals (3, f) of corners (3, n, f) about their mean, and directions across them."""
    after = np.roll(x, -1, axis=1)
    normal = np.stack(
        [(x[i] * after[j] - x[j] * after[i]).sum(axis=0) for i, j in ((1, 2), (2, 0), (0, 1))]
    )
    area, extent = np.sqrt((normal**2).sum(axis=0)), (x * x).sum(axis=(0, 1))
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
    e = along - (along * normal).sum(axis=0) * normal
    size = np.sqrt((e * e).sum(axis=0))
    lost = np.flatnonzero(~(size > 1e-9 * np.sqrt((x * x).sum(axis=(0, 1)))))
    if len(lost):  # no length, or upright: any other direction
        up = normal[:, lost]
        other = np.eye(3)[np.abs(up).argmin(axis=0)].T
        e[:, lost] = other - (other * up).sum(axis=0) * up
        size = np.sqrt((e * e).sum(axis=0))
    e = e / size
    g = np.stack([normal[i] * e[j] - normal[j] * e[i] for i, j in ((1, 2), (2, 0), (0, 1))])
    flat = np.stack([(x * e[:, None]).sum(axis=0), (x * g[:, None]).sum(axis=0)])
    off = (x * normal[:, None]).sum(axis=0)
    xx, yy, xy = ((flat[i] * flat[j]).sum(axis=0) for i, j in ((0, 0), (1, 1), (0, 1)))
    xz, yz = (flat * off).sum(axis=1)
    det = xx * yy - xy * xy
    solid = det > 1e-24 * (xx + yy) ** 2
    safe = np.where(solid, det, 1.0)
    a = np.where(solid, (yy * xz - xy * yz) / safe, 0.0)
    b = np.where(solid, (xx * yz - xy * xz) / safe, 0.0)
    stretch = np.sqrt(1 + a * a + b * b)
    height = (off - a * flat[0] - b * flat[1]) / stretch
    return flat, height, (normal - a * e - b * g) / stretch


def _complement(flat: FloatArray) -> FloatArray:
    """Return orthonormal bases (f, n, n − 3) of what is orthogonal to 1, x and y in R^n."""
    count, n, _ = flat.shape
    work = np.concatenate([np.ones((count, n, 1)), flat[:, :, ::-1]], axis=2)
    mirrors = []
    for k in range(3):  # Householder
        v = work[:, k:, k].copy()
        size = np.linalg.norm(v, axis=1)
        v[:, 0] += np.where(v[:, 0] < 0, -size, size)
        square = np.einsum("fi,fi->f", v, v)
        mirrors.append((v, np.divide(2.0, square, out=np.zeros(count), where=square > 0)))
        _mirror(work, *mirrors[-1], k)
    basis = np.zeros((count, n, n - 3))
    basis[:, np.arange(3, n), np.arange(n - 3)] = 1.0
    for k in (2, 1, 0):
        _mirror(basis, *mirrors[k], k)
    return basis


def _mirror(matrix: FloatArray, v: FloatArray, factor: FloatArray, k: int) -> None:
    share = np.einsum("fi,fij->fj", v, matrix[:, k:]) * factor[:, None]
    matrix[:, k:] -= v[:, :, None] * share[:, None, :]

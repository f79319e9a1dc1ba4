"""Equations of planar, circular and conical quad meshes, each row of length 1.

* planar: the volume of a quad's four corners vanishes;
* circular: moreover opposite angles have the same sum;
* conical: moreover opposite angles about every inner vertex of four faces have the same sum, which
  is when their planes touch a cone of revolution. (That their normals lie on a circle is weaker:
  the cone may then touch a plane beyond the face's edges.)

References
----------
Thesis §3.2, §4.4.1, §4.4.3; Liu, Pottmann, Wallner, Yang, Wang 2006, "Geometric modeling with
conical meshes and developable surfaces".
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import MeshError
from phexfab.mesh.half_edges import twins
from phexfab.mesh.polymesh import PolyMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

KINDS = ("planar", "circular", "conical")


def quads_of(mesh: PolyMesh) -> IntArray:
    """Return the (F, 4) corners of a quad mesh.

    Raises
    ------
    MeshError
        If a face is no quadrilateral, or there is none.
    """
    if not mesh.n_faces:
        raise MeshError("the mesh has no face")
    if not (mesh.sides == 4).all():
        odd = int(np.flatnonzero(mesh.sides != 4)[0])
        raise MeshError(f"face {odd} has {mesh.sides[odd]} corners; only quadrilaterals will do")
    return mesh.corners.reshape(-1, 4)


def stars_of(mesh: PolyMesh) -> tuple[IntArray, IntArray]:
    """Return the inner vertices of four faces (s,), and those faces in order (s, 4).

    Raises
    ------
    MeshError
        If an inner vertex has more than four faces: their planes cannot be asked to touch a cone
        here. With three they always do.
    """
    opposite = twins(mesh)
    before = mesh.previous_corner
    inner = np.ones(len(mesh.vertices), bool)
    inner[mesh.corners[opposite < 0]] = False
    inner[mesh.corners[mesh.next_corner[opposite < 0]]] = False
    valence = np.bincount(mesh.corners, minlength=len(mesh.vertices))
    over = np.flatnonzero(inner & (valence > 4))
    if len(over):
        raise MeshError(
            f"vertex {over[0]} at {mesh.vertices[over[0]].round(3).tolist()} has "
            f"{valence[over[0]]} faces; conical quad meshes here have 4 (or 3)"
        )
    vertices = np.flatnonzero(inner & (valence == 4))
    corner = np.full(len(mesh.vertices), -1, np.int64)
    corner[mesh.corners] = np.arange(len(mesh.corners))
    now = corner[vertices]
    faces = []
    for _ in range(4):
        faces.append(mesh.face_of_corner[now])
        now = opposite[before[now]]  # the next face about the vertex
    return vertices, np.stack(faces, axis=1) if len(vertices) else np.zeros((0, 4), np.int64)


class QuadRows:
    """The equations of one kind on one mesh."""

    def __init__(self, mesh: PolyMesh, kind: str) -> None:
        if kind not in KINDS:
            raise MeshError(f'kind = "{kind}": "planar", "circular" or "conical"')
        self.kind = kind
        self.quads = quads_of(mesh)
        self.width = 3 * len(mesh.vertices)
        none = (np.zeros(0, np.int64), np.zeros((0, 4), np.int64))
        self.vertices, self.stars = stars_of(mesh) if kind == "conical" else none

    def linearise(self, x: FloatArray) -> tuple[sp.csr_array, FloatArray]:
        """Return the Jacobian (rows, 3V), rows of length 1, and the residual (rows,) in mm."""
        parts = [self._planar(x)]
        if self.kind == "circular":
            parts.append(self._circular(x))
        if self.kind == "conical":
            parts.append(self._conical(x))
        blocks, right = [], []
        for value, slope, vertices in parts:
            size = np.sqrt((slope**2).sum(axis=(1, 2)))
            scale = np.divide(1.0, size, out=np.zeros(len(size)), where=size > 0)
            columns = 3 * vertices[:, :, None] + np.arange(3)
            rows = np.repeat(np.arange(len(value)), columns[0].size if len(value) else 1)
            data = (slope * scale[:, None, None]).ravel()
            shape = (len(value), self.width)
            blocks.append(sp.csr_array((data, (rows[: len(data)], columns.ravel())), shape=shape))
            right.append(value * scale)
        return sp.vstack(blocks, format="csr"), np.concatenate(right)

    def opposite_angles(self, x: FloatArray) -> FloatArray:
        """Return what sums of opposite angles differ by about (s,) vertices of conical meshes."""
        return np.abs(self._conical(x)[0])

    def _planar(self, x: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
        a, b, c, d = (x[self.quads[:, k]] for k in range(4))
        at_b, at_c, at_d = (np.cross(p - a, q - a) for p, q in ((c, d), (d, b), (b, c)))
        volume = np.einsum("ij,ij->i", b - a, at_b)
        return volume, np.stack([-(at_b + at_c + at_d), at_b, at_c, at_d], axis=1), self.quads

    def _circular(self, x: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
        """Angles at corners 0 and 2 less those at 1 and 3."""
        value, slope = np.zeros(len(self.quads)), np.zeros((len(self.quads), 4, 3))
        for k in range(4):
            ring = np.array([k, (k + 1) % 4, (k + 3) % 4])
            angle, by = _angle(*(x[self.quads[:, i]] for i in ring))
            sign = 1.0 if k % 2 == 0 else -1.0
            value += sign * angle
            slope[:, ring] += sign * by
        return value, slope, self.quads

    def _conical(self, x: FloatArray) -> tuple[FloatArray, FloatArray, IntArray]:
        """Angles of the first and third face about a vertex less those of the others."""
        value = np.zeros(len(self.vertices))
        slopes, vertices = [], []
        for k in range(4):
            quad = self.quads[self.stars[:, k]]
            at = np.argmax(quad == self.vertices[:, None], axis=1)[:, None]
            ring = np.take_along_axis(quad, np.concatenate([at, (at + 1) % 4, (at + 3) % 4], 1), 1)
            angle, by = _angle(*(x[ring[:, i]] for i in range(3)))
            sign = 1.0 if k % 2 == 0 else -1.0
            value += sign * angle
            slopes.append(sign * by)
            vertices.append(ring)
        return value, np.concatenate(slopes, axis=1), np.concatenate(vertices, axis=1)


def _angle(p: FloatArray, q: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the angle (n,) at p between q and r, and its gradients (n, 3, 3) at p, q, r."""
    e, f = q - p, r - p
    le, lf = np.linalg.norm(e, axis=1), np.linalg.norm(f, axis=1)
    e, f = e / le[:, None], f / lf[:, None]
    cosine = (e * f).sum(1)
    sine = np.linalg.norm(np.cross(e, f), axis=1)
    safe = np.maximum(sine, 1e-9)
    on_q = (cosine[:, None] * e - f) / (le * safe)[:, None]
    on_r = (cosine[:, None] * f - e) / (lf * safe)[:, None]
    return np.arctan2(sine, cosine), np.stack([-on_q - on_r, on_q, on_r], axis=1)

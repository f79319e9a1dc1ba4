"""Polygon meshes as arrays: vertices, and the corners of all faces in one run."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import MeshError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PolyMesh:
    """A polygon mesh whose faces may have any number of sides and need not be convex.

    Attributes
    ----------
    vertices : (V, 3) float array, in mm (or unit length for a Gauss image)
    corners : (C,) int array
        Vertex index of every face corner, face after face, counter-clockwise seen from the tip
        of the face normal.
    starts : (F + 1,) int array
        Face ``f`` owns ``corners[starts[f]:starts[f + 1]]``.

    Examples
    --------
    >>> import phexfab as px
    >>> corners = [(0, 0, 0), (400, 0, 0), (400, 300, 0), (0, 300, 0), (200, 500, 0)]  # mm
    >>> mesh = px.PolyMesh.from_faces(corners, [(0, 1, 2, 3), (3, 2, 4)])
    >>> mesh.n_faces, mesh.sides.tolist()
    (2, [4, 3])
    >>> mesh.polygon(1).tolist()
    [[0.0, 300.0, 0.0], [400.0, 300.0, 0.0], [200.0, 500.0, 0.0]]
    """

    vertices: FloatArray
    corners: IntArray
    starts: IntArray

    def __repr__(self) -> str:
        return f"<PolyMesh: {len(self.starts) - 1} faces, {len(self.vertices)} vertices>"

    @classmethod
    def from_faces(cls, vertices: FloatArray, faces: Iterable[Sequence[int]]) -> PolyMesh:
        """Return a mesh from a list of faces, each a sequence of vertex indices.

        Raises
        ------
        MeshError
            If a face has fewer than three corners or names a vertex that does not exist.
        """
        points = np.asarray(vertices, float).reshape(-1, 3)
        rows = [np.asarray(face, np.int64) for face in faces]
        counts = np.array([len(row) for row in rows], np.int64)
        if len(rows) and counts.min() < 3:
            raise MeshError(f"face {int(counts.argmin())} has {counts.min()} corners; 3 are needed")
        corners = np.concatenate(rows) if rows else np.zeros(0, np.int64)
        if len(corners) and (corners.min() < 0 or corners.max() >= len(points)):
            raise MeshError(f"a face names vertex {corners.max()} but there are {len(points)}")
        return cls(points, corners, np.concatenate([[0], np.cumsum(counts)]).astype(np.int64))

    @property
    def n_faces(self) -> int:
        """Number of faces."""
        return len(self.starts) - 1

    @cached_property
    def sides(self) -> IntArray:
        """(F,) number of sides of each face."""
        return np.diff(self.starts)

    @cached_property
    def face_of_corner(self) -> IntArray:
        """(C,) face that owns each corner."""
        return np.repeat(np.arange(self.n_faces), self.sides)

    @cached_property
    def next_corner(self) -> IntArray:
        """(C,) index of the next corner around the same face."""
        following = np.arange(1, len(self.corners) + 1)
        following[self.starts[1:] - 1] = self.starts[:-1]
        return following

    @cached_property
    def previous_corner(self) -> IntArray:
        """(C,) index of the previous corner around the same face."""
        preceding = np.arange(-1, len(self.corners) - 1)
        preceding[self.starts[:-1]] = self.starts[1:] - 1
        return preceding

    def face(self, f: int) -> IntArray:
        """Return the vertex indices of face ``f``."""
        return self.corners[self.starts[f] : self.starts[f + 1]]

    @cached_property
    def faces(self) -> list[IntArray]:
        """All faces as index arrays (views, in order)."""
        return [self.face(f) for f in range(self.n_faces)]

    def polygon(self, f: int) -> FloatArray:
        """Return the (n, 3) corner points of face ``f``."""
        return self.vertices[self.face(f)]

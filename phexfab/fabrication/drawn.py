"""The faces of M drawn in their own planes, all at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.fabrication.frames import edge_frames
from phexfab.fabrication.inset import edge_directions
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class DrawnFaces:
    """Plane drawings of all faces, and how the node planes stand on their edges.

    Attributes
    ----------
    mesh : PolyMesh
        M; the corners below are in its corner order.
    origin, x, y, normal : (F, 3)
        Frame of each drawing: the centroid, the direction in which the face is longest, ``y`` to
        its left, and the face normal, which points to whoever looks at the drawing.
    points : (C, 2) mm
        Corners in these frames.
    directions : (C, 2) unit
        Of the edge from each corner to the next.
    cosine, sine : (C,)
        Of the angle β between the face normal and the node plane of each edge; positive where a
        panel that ends on the node planes widens along the normal.
    """

    mesh: PolyMesh
    origin: FloatArray
    x: FloatArray
    y: FloatArray
    normal: FloatArray
    points: FloatArray
    directions: FloatArray
    cosine: FloatArray
    sine: FloatArray

    def in_space(self, points: FloatArray, level: float) -> FloatArray:
        """Return the (C, 3) points at a height above the faces."""
        f = self.mesh.face_of_corner
        flat = points[:, :1] * self.x[f] + points[:, 1:] * self.y[f]
        placed: FloatArray = self.origin[f] + flat + level * self.normal[f]
        return placed


def _per_face(values: FloatArray, mesh: PolyMesh) -> FloatArray:
    """Return the sums over the corners of each face."""
    total: FloatArray = np.add.reduceat(values, mesh.starts[:-1], axis=0)
    return total


def area_and_centroid(points: FloatArray, mesh: PolyMesh) -> tuple[FloatArray, FloatArray]:
    """Return the (F,) areas and (F, 2) centroids of plane polygons given by their corners."""
    base = points[mesh.starts[:-1]][mesh.face_of_corner]
    p = points - base
    q = p[mesh.next_corner]
    cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    area = _per_face(cross, mesh) / 2.0
    centroid = _per_face(cross[:, None] * (p + q), mesh) / (6.0 * area[:, None])
    return area, centroid + points[mesh.starts[:-1]]


def _principal_angle(points: FloatArray, mesh: PolyMesh) -> FloatArray:
    """Return the (F,) direction in radians in which each polygon, centred at 0, is longest."""
    q = points[mesh.next_corner]
    cross = points[:, 0] * q[:, 1] - points[:, 1] * q[:, 0]

    def moment(a: int, b: int) -> FloatArray:
        pairs = (
            points[:, a] * points[:, b]
            + q[:, a] * q[:, b]
            + (points[:, a] * q[:, b] + q[:, a] * points[:, b]) / 2.0
        )
        return _per_face(cross * pairs, mesh) / 12.0

    angle: FloatArray = np.arctan2(2.0 * moment(0, 1), moment(0, 0) - moment(1, 1)) / 2.0
    return angle


def draw_faces(shell: Shell) -> DrawnFaces:
    """Lay every face of M into its plane: centroid at 0, x along its longest direction.

    Seen from the tip of the normal; of the two ways x is the one within 90° of the first edge.
    """
    mesh = shell.mesh
    owner = mesh.face_of_corner
    normal = shell.normals[shell.panels]
    frames = edge_frames(shell, mesh.corners, mesh.corners[mesh.next_corner])

    first = mesh.starts[:-1]
    origin = mesh.vertices[mesh.corners[first]]
    x = frames.along[first]
    x = x - np.einsum("ij,ij->i", x, normal)[:, None] * normal
    x = x / np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(normal, x)
    offset = mesh.vertices[mesh.corners] - origin[owner]
    points = np.column_stack(
        [np.einsum("ij,ij->i", offset, x[owner]), np.einsum("ij,ij->i", offset, y[owner])]
    )
    _, centre = area_and_centroid(points, mesh)
    points = points - centre[owner]
    origin = origin + centre[:, :1] * x + centre[:, 1:] * y

    angle = _principal_angle(points, mesh)
    angle = np.where(np.cos(angle) < 0.0, angle + np.pi, angle)
    c, s = np.cos(angle), np.sin(angle)
    points = np.column_stack(
        [
            c[owner] * points[:, 0] + s[owner] * points[:, 1],
            -s[owner] * points[:, 0] + c[owner] * points[:, 1],
        ]
    )
    x, y = c[:, None] * x + s[:, None] * y, c[:, None] * y - s[:, None] * x

    inward = np.cross(normal[owner], frames.along)
    return DrawnFaces(
        mesh=mesh,
        origin=origin,
        x=x,
        y=y,
        normal=normal,
        points=points,
        directions=edge_directions(points, mesh),
        cosine=np.einsum("ij,ij->i", frames.left, inward),
        sine=np.einsum("ij,ij->i", frames.left, normal[owner]),
    )

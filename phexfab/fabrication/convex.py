"""Convex cells that cover solids, and planes that keep cells apart: clears pairs that only touch.

Panels are non-convex and interlock, so no plane parts two neighbours as a whole. A prism-like
solid on an n-gon is therefore covered by the n − 2 wedges over a fan of its lower cap, and the
hulls of the wedges are parted from each other. A cover is enough, and any fan gives one: the wedges
are the image of a triangulated ball whose boundary is mapped to that of the solid, so every inner
point lies in some wedge, be the fan's triangles overlapping or not. A fan from the most reflex
corner merely makes the cover tight.

References
----------
Gottschalk 1996, "Separating axis theorem and oriented bounding boxes".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.fabrication.parts import Cylinder, Solid
from phexfab.fabrication.polyhedra import prism_faces

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
Faces = tuple[tuple[int, ...], ...]

CHUNK = 2_000_000  # projections held at once, some tens of megabytes


@dataclass(frozen=True, eq=False)
class Cells:
    """Convex cells of one kind: polyhedra of one topology, or cylinders.

    Attributes
    ----------
    points : (M, n, 3) corners in mm; of a cylinder the two ends of its axis
    normals : (M, d, 3) outward unit normals of faces (zero where a face has no area)
    support : (M, d) the largest ``normal·x`` over the cell
    edges : (e, 2) corner pairs, one of each edge; of a cylinder its axis
    solid : (M,) the solid that each cell belongs to
    axis : (M, 3) unit axes of cylinders; None for polyhedra
    radius : (M,) radii of cylinders in mm; None for polyhedra
    """

    points: FloatArray
    normals: FloatArray
    support: FloatArray
    edges: IntArray
    solid: IntArray
    axis: FloatArray | None = None
    radius: FloatArray | None = None

    def swell(self, i: IntArray, directions: FloatArray) -> FloatArray | float:
        """Return (n, k): how far cell ``i`` reaches past its points along unit directions."""
        if self.axis is None or self.radius is None:
            return 0.0
        cosine = np.einsum("nki,ni->nk", directions, self.axis[i])
        return np.asarray(self.radius[i, None] * np.sqrt(np.clip(1 - cosine * cosine, 0, 1)))

    @property
    def boxes(self) -> tuple[FloatArray, FloatArray]:
        """(M, 3) lower and upper corners of axis-parallel boxes around the cells."""
        everyone = np.arange(len(self.points))
        room = self.swell(everyone, np.broadcast_to(np.eye(3), (len(everyone), 3, 3)))
        return self.points.min(axis=1) - room, self.points.max(axis=1) + room


def by_topology(
    solids: Sequence[Solid | Cylinder],
) -> list[tuple[IntArray, FloatArray, Faces]]:
    """Return ``indices, vertices (k, n, 3), faces`` for the polyhedra of each topology."""
    groups: dict[tuple[Faces, int], tuple[list[int], list[FloatArray]]] = {}
    for index, solid in enumerate(solids):
        if isinstance(solid, Solid):
            kind = solid.faces, len(solid.vertices)
            members, vertices = groups.setdefault(kind, ([], []))
            members.append(index)
            vertices.append(solid.vertices)
    return [
        (np.array(members), np.stack(vertices), faces)
        for (faces, _), (members, vertices) in groups.items()
    ]


def solid_edges(faces: Faces) -> IntArray:
    """Return the (e, 2) edges of a solid's faces, each once, sorted."""
    return np.array(sorted({(min(a, b), max(a, b)) for f in faces for a, b in _sides(f)}))


def _sides(face: tuple[int, ...]) -> list[tuple[int, int]]:
    return [(face[k - 1], face[k]) for k in range(len(face))]


def face_planes(points: FloatArray, faces: Faces) -> FloatArray:
    """Return the (M, len(faces), 3) unit area vectors of faces; zero where there is no area."""
    rows = []
    for face in faces:
        ring = points[:, face]
        ring = ring - ring[:, :1]
        a, b = ring[:, 1:-1], ring[:, 2:]
        rows.append(np.cross(a, b).sum(axis=1))
    vectors = np.stack(rows, axis=1)
    lengths = np.linalg.norm(vectors, axis=2, keepdims=True)
    return np.divide(vectors, lengths, out=np.zeros_like(vectors), where=lengths > 0)


def convex_cells(solids: Sequence[Solid | Cylinder]) -> list[Cells]:
    """Return convex cells whose hulls cover the solids.

    A convex solid is one cell, a cylinder too. A non-convex solid is the wedges over a fan if it
    has the faces of ``prism_faces``, else it is one cell, its hull.
    """
    round_ones = [k for k, solid in enumerate(solids) if isinstance(solid, Cylinder)]
    found = [_cylinders(np.array(round_ones), solids)] if round_ones else []
    for index, vertices, faces in by_topology(solids):
        k = len(vertices[0]) // 2
        bent = ~_is_convex(vertices, faces) & (faces == prism_faces(k))
        if not bent.all():
            found.append(_cells(index[~bent], vertices[~bent], faces))
        if bent.any():
            wedges = _wedges(vertices[bent], k)
            found.append(_cells(np.repeat(index[bent], k - 2), wedges, prism_faces(3)))
    return found


def _cells(index: IntArray, points: FloatArray, faces: Faces) -> Cells:
    normals = face_planes(points, faces)
    support = np.einsum("mdi,mni->mdn", normals, points).max(axis=2)
    return Cells(points, normals, support, solid_edges(faces), index)


def _cylinders(index: IntArray, solids: Sequence[Solid | Cylinder]) -> Cells:
    several = [solid for k in index.tolist() if isinstance(solid := solids[k], Cylinder)]
    axis = np.array([one.axis for one in several])
    axis = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    base = np.array([one.base for one in several])
    tip = base + np.array([one.length for one in several])[:, None] * axis
    normals = np.stack([-axis, axis], axis=1)
    support = np.stack(
        [-np.einsum("ij,ij->i", base, axis), np.einsum("ij,ij->i", tip, axis)], axis=1
    )
    radius = np.array([one.radius for one in several])
    points = np.stack([base, tip], axis=1)
    return Cells(points, normals, support, np.array([[0, 1]]), index, axis, radius)


def _is_convex(vertices: FloatArray, faces: Faces) -> BoolArray:
    """True where no corner lies beyond the plane of a face."""
    normals = face_planes(vertices, faces)
    on_face = vertices[:, [face[0] for face in faces]]
    level = np.einsum("mdi,mdi->md", normals, on_face)
    beyond = np.einsum("mdi,mni->mdn", normals, vertices) - level[:, :, None]
    size = np.ptp(vertices, axis=1).max(axis=1)
    return np.asarray(beyond.max(axis=(1, 2)) <= 1e-9 * size)


def _wedges(vertices: FloatArray, k: int) -> FloatArray:
    """Return (M·(k−2), 6, 3) wedges over a fan of the lower cap, prism-like on triangles."""
    cap = vertices[:, :k] - vertices[:, :1]
    following, back = np.roll(cap, -1, axis=1) - cap, np.roll(cap, 1, axis=1) - cap
    area = np.cross(cap, np.roll(cap, -1, axis=1)).sum(axis=1)
    sine = np.einsum("mki,mi->mk", np.cross(following, back), area)
    sine = sine / np.linalg.norm(area, axis=1)[:, None]
    angle = np.arctan2(sine, np.einsum("mki,mki->mk", following, back)) % (2 * np.pi)
    first = angle.argmax(axis=1)
    step = np.arange(1, k - 1)
    ring = np.stack([np.zeros_like(step), step, step + 1], axis=1)  # (k−2, 3)
    corners = (first[:, None, None] + ring) % k
    corners = np.concatenate([corners, corners + k], axis=2)
    return vertices[np.arange(len(vertices))[:, None, None], corners].reshape(-1, 6, 3)


def parted(a: Cells, i: IntArray, b: Cells, j: IntArray, tolerance: float) -> BoolArray:
    """Return (n,) True where a plane parts cell ``i`` of ``a`` from cell ``j`` of ``b``.

    Parameters
    ----------
    a, b : Cells
    i, j : (n,) int
    tolerance : float
        Cells that reach past the plane by less than this, in mm, are taken to touch.

    Notes
    -----
    Planes of faces are tried for all pairs, then planes along an edge of either for what is left.
    """
    done = _beyond(a, i, b, j, tolerance)
    rest = np.flatnonzero(~done)
    done[rest] = _beyond(b, j[rest], a, i[rest], tolerance)
    rest = np.flatnonzero(~done)
    width = len(a.edges) * len(b.edges)
    corners = a.points.shape[1] + b.points.shape[1]
    for part in np.array_split(rest, 1 + len(rest) * width * corners // CHUNK):
        if len(part):
            done[part] = _parted_by_edges(a, i[part], b, j[part], tolerance)
    return done


def _beyond(a: Cells, i: IntArray, b: Cells, j: IntArray, tolerance: float) -> BoolArray:
    """True where all of cell j lies beyond one face plane of cell i."""
    done = np.zeros(len(i), bool)
    size = a.normals.shape[1] * b.points.shape[1]
    for part in np.array_split(np.arange(len(i)), 1 + len(i) * size // CHUNK):
        planes = a.normals[i[part]]
        least = np.matmul(planes, b.points[j[part]].transpose(0, 2, 1)).min(axis=2)
        least = least - b.swell(j[part], planes)
        real = np.any(planes != 0, axis=2)
        done[part] = np.any(real & (least >= a.support[i[part]] - tolerance), axis=1)
    return done


def _parted_by_edges(a: Cells, i: IntArray, b: Cells, j: IntArray, tolerance: float) -> BoolArray:
    """True where a plane parallel to an edge of either cell has them on different sides."""
    p, q = a.points[i], b.points[j]
    along = p[:, a.edges[:, 1]] - p[:, a.edges[:, 0]]
    across = q[:, b.edges[:, 1]] - q[:, b.edges[:, 0]]
    axes = np.cross(along[:, :, None], across[:, None]).reshape(len(i), -1, 3)
    lengths = np.linalg.norm(axes, axis=2, keepdims=True)
    # Nearly parallel edges give a direction of rounding only; it is unit all the same, so a gap
    # found along it is a gap.
    axes = np.divide(axes, lengths, out=np.zeros_like(axes), where=lengths > 0)
    middle = p.mean(axis=1, keepdims=True)
    one = np.matmul(axes, (p - middle).transpose(0, 2, 1))
    two = np.matmul(axes, (q - middle).transpose(0, 2, 1))
    gap = np.maximum(two.min(axis=2) - one.max(axis=2), one.min(axis=2) - two.max(axis=2))
    gap = gap - a.swell(i, axes) - b.swell(j, axes)
    return np.asarray(np.any((lengths[..., 0] > 0) & (gap >= -tolerance), axis=1))

"""Which solids run into each other, how much and where.

Pairs come from a bounding-box tree, planes clear what merely touches, and only what is left is
intersected by manifold3d. So the cost grows with the parts, not with the pairs of parts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from phexfab.errors import PartError
from phexfab.fabrication.convex import by_topology, convex_cells, face_planes, parted
from phexfab.fabrication.parts import Cylinder, Solid
from phexfab.fabrication.polyhedra import prism_faces, volumes

if TYPE_CHECKING:
    from manifold3d import Manifold

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

ROUNDING = 1e-9  # an overlap below this part of the smaller solid is rounding of the boolean
SIDES = 64  # of the prism that stands for a cylinder


@dataclass(frozen=True)
class Clash:
    """Two solids that overlap.

    Attributes
    ----------
    mark_a, mark_b : str
        Their part marks, in the order of the solids.
    volume : float
        Of what they have in common, mm³.
    place : (x, y, z)
        Its centroid, mm.
    relative : float
        The volume over that of the smaller of the two.
    """

    mark_a: str
    mark_b: str
    volume: float
    place: tuple[float, float, float]
    relative: float


def clashes(
    solids: Sequence[Solid | Cylinder], marks: Sequence[str], tolerance: float = 1e-6
) -> list[Clash]:
    """Return every pair of solids that overlap, in the order of the solids.

    Parameters
    ----------
    solids : sequence of Solid or Cylinder
        Closed, faces planar and outward, convex or not. Cylinders are parted from others
        exactly; where that fails they are intersected as the inscribed prism of 64 sides, so that
        what touches one does not count; overlaps thinner than 0.12 % of its radius may go unseen.
    marks : sequence of str
    tolerance : float
        In mm: solids that run into each other by less are taken to touch.

    Raises
    ------
    PartError
        If a solid that has to be intersected is not closed; the message names its mark.
    """
    pairs = _touching(solids, tolerance)
    index, compact = np.unique(pairs, return_inverse=True)
    several = [solids[k] for k in index.tolist()]
    bodies = [as_prism(one) if isinstance(one, Cylinder) else one for one in several]
    names = [marks[k] for k in index.tolist()]
    size = volumes(bodies).tolist()
    built = _manifolds(bodies, names)
    found = []
    for i, j in compact.reshape(-1, 2).tolist():
        common = built[i] ^ built[j]
        volume, smaller = common.volume(), min(size[i], size[j])
        if volume > ROUNDING * smaller:
            found.append(Clash(names[i], names[j], volume, _centroid(common), volume / smaller))
    return found


def box_pairs(low: FloatArray, high: FloatArray) -> IntArray:
    """Return the (n, 2) pairs ``i < j`` of boxes that overlap, sorted; touching boxes do too.

    Parameters
    ----------
    low, high : (N, 3) corners of axis-parallel boxes

    Notes
    -----
    The tree is of the plane in which the boxes crowd least: a tower's panels lie above each other
    in plan but not in elevation.
    """
    if len(low) < 2:
        return np.zeros((0, 2), np.int64)
    extent = np.maximum(high.max(axis=0) - low.min(axis=0), 1e-300)
    span = (high - low) / extent
    x, y = min(
        combinations(range(3), 2), key=lambda k: float((span[:, k[0]] * span[:, k[1]]).sum())
    )
    z = 3 - x - y
    boxes = shapely.box(low[:, x], low[:, y], high[:, x], high[:, y])
    first, second = shapely.STRtree(boxes).query(boxes)
    keep = first < second
    first, second = first[keep], second[keep]
    keep = (low[first, z] <= high[second, z]) & (low[second, z] <= high[first, z])
    pairs = np.column_stack([first[keep], second[keep]]).astype(np.int64)
    return pairs[np.lexsort(pairs.T[::-1])]


def as_prism(cylinder: Cylinder, sides: int = SIDES) -> Solid:
    """Return the prism that is inscribed in a cylinder."""
    axis = cylinder.axis / np.linalg.norm(cylinder.axis)
    x = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    x = x / np.linalg.norm(x)
    y = np.cross(axis, x)
    turn = 2 * np.pi * np.arange(sides) / sides
    rim = cylinder.radius * (np.cos(turn)[:, None] * x + np.sin(turn)[:, None] * y)
    low = cylinder.base + rim
    return Solid(np.concatenate([low, low + cylinder.length * axis]), prism_faces(sides))


def _touching(solids: Sequence[Solid | Cylinder], tolerance: float) -> IntArray:
    """Return the (n, 2) pairs that no plane parts, sorted."""
    if not solids:
        return np.zeros((0, 2), np.int64)
    cells = convex_cells(solids)
    owner = np.concatenate([cell.solid for cell in cells])
    lows, highs = zip(*(cell.boxes for cell in cells), strict=True)
    # Boxes that overlap by less than the tolerance belong to cells that at most touch.
    low, high = np.concatenate(lows) + tolerance / 2, np.concatenate(highs) - tolerance / 2
    lowest, highest = np.full((len(solids), 3), np.inf), np.full((len(solids), 3), -np.inf)
    np.minimum.at(lowest, owner, low)
    np.maximum.at(highest, owner, high)
    pairs = box_pairs(lowest, highest)
    one, two, pair = _cell_pairs(owner, pairs, len(solids))
    near = np.all((low[one] <= high[two]) & (low[two] <= high[one]), axis=1)
    one, two, pair = one[near], two[near], pair[near]

    begin = np.cumsum([0] + [len(cell.points) for cell in cells])
    kind_one = np.searchsorted(begin, one, side="right") - 1
    kind_two = np.searchsorted(begin, two, side="right") - 1
    apart = np.zeros(len(one), bool)
    for k in range(len(cells)):
        for m in range(len(cells)):
            rows = np.flatnonzero((kind_one == k) & (kind_two == m))
            if len(rows):
                i, j = one[rows] - begin[k], two[rows] - begin[m]
                apart[rows] = parted(cells[k], i, cells[m], j, tolerance)
    return pairs[np.unique(pair[~apart])]


def _cell_pairs(
    owner: IntArray, pairs: IntArray, n_solids: int
) -> tuple[IntArray, IntArray, IntArray]:
    """Return the cells of both solids of every pair, each with each, and which pair it was."""
    order = np.argsort(owner, kind="stable")
    count = np.bincount(owner, minlength=n_solids)
    first = np.concatenate([[0], np.cumsum(count)])[:-1]
    a, b = pairs.T
    each = count[a] * count[b]
    pair = np.repeat(np.arange(len(pairs)), each)
    local = np.arange(len(pair)) - np.repeat(np.cumsum(each) - each, each)
    one = order[first[a][pair] + local // count[b][pair]]
    two = order[first[b][pair] + local % count[b][pair]]
    return one, two, pair


def _manifolds(solids: Sequence[Solid], marks: Sequence[str]) -> list[Manifold]:
    """Return the solids as manifold3d bodies, their faces triangulated properly.

    Raises
    ------
    PartError
        If one is not closed.
    """
    import manifold3d

    bodies = []
    for solid, triangles, mark in zip(solids, triangulations(solids), marks, strict=True):
        points = np.ascontiguousarray(solid.vertices, float)
        body = manifold3d.Manifold(manifold3d.Mesh64(points, triangles.astype(np.uint64)))
        if body.status() != manifold3d.Error.NoError:
            raise PartError(
                f"{mark}: its solid is not closed ({body.status().name}); every edge must belong "
                "to two faces that run along it in opposite directions"
            )
        bodies.append(body)
    return bodies


def triangulations(solids: Sequence[Solid]) -> list[IntArray]:
    """Return for every solid the (n, 3) triangles that fill its faces, non-convex ones too."""
    import manifold3d

    found: list[IntArray] = [np.zeros((0, 3), np.int64)] * len(solids)
    for index, vertices, faces in by_topology(solids):
        normals = face_planes(vertices, faces)
        pieces = []
        for k, face in enumerate(faces):
            corners, normal = np.array(face), normals[:, k]
            ring = vertices[:, corners] - vertices[:, corners[:1]]
            if len(face) == 3:
                local = np.broadcast_to([[0, 1, 2]], (len(index), 1, 3))
            elif len(face) == 4:
                # The diagonal from corner 0 lies inside when both its triangles turn left.
                halves = np.cross(ring[:, 1:3], ring[:, 2:4])
                inside = np.all(np.einsum("mki,mi->mk", halves, normal) > 0, axis=1)
                cuts = np.array([[[1, 2, 3], [1, 3, 0]], [[0, 1, 2], [0, 2, 3]]])
                local = cuts[inside.astype(int)]
            else:
                flat = _flattened(ring, normal)
                local = np.stack([manifold3d.triangulate([polygon]) for polygon in flat])
            pieces.append(corners[local])
        for one, triangles in zip(index.tolist(), np.concatenate(pieces, axis=1), strict=True):
            found[one] = triangles
    return found


def _flattened(ring: FloatArray, normal: FloatArray) -> FloatArray:
    """Return (m, n, 2) corners of faces in their planes, counter-clockwise about the normals."""
    x = np.cross(normal, np.eye(3)[np.abs(normal).argmin(axis=1)])
    length = np.linalg.norm(x, axis=1, keepdims=True)
    x = np.divide(x, length, out=np.zeros_like(x), where=length > 0)  # a face may have no area
    frame = np.stack([x, np.cross(normal, x)], axis=2)
    return np.matmul(ring, frame)


def _centroid(body: Manifold) -> tuple[float, float, float]:
    mesh = body.to_mesh64()
    points = np.asarray(mesh.vert_properties)[:, :3]
    origin = points.mean(axis=0)
    a, b, c = (points[np.asarray(mesh.tri_verts)] - origin).transpose(1, 0, 2)
    weight = np.einsum("ij,ij->i", a, np.cross(b, c))
    middle = origin + weight @ (a + b + c) / (4 * weight.sum())
    return float(middle[0]), float(middle[1]), float(middle[2])

"""Parts as triangles: what viewers and slicers take where CAD programs take faces and edges."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from phexfab.cad.tree import Geometry
from phexfab.errors import PartError
from phexfab.fabrication.clash import as_prism, triangulations
from phexfab.fabrication.parts import Solid

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SIDES = 32  # of the prism that stands for a hub


@dataclass(frozen=True, eq=False)
class Body:
    """A closed triangle mesh with a name.

    Attributes
    ----------
    mark : str
    points : (n, 3) array, mm
    triangles : (t, 3) int array
        Counter-clockwise seen from outside.
    """

    mark: str
    points: FloatArray
    triangles: IntArray

    @property
    def volume(self) -> float:
        """Signed volume, mm³."""
        a, b, c = np.moveaxis((self.points - self.points.mean(axis=0))[self.triangles], 1, 0)
        return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def bodies(members: Sequence[tuple[str, Geometry]]) -> list[Body]:
    """Return named polyhedra and cylinders as triangle meshes.

    A cylinder becomes a prism of 32 sides and of the same volume, some 0.3 % of its radius wider
    at the corners.
    """
    solids = [as_solid(part) for _, part in members]
    return [
        Body(mark, np.asarray(solid.vertices, float), triangles)
        for (mark, _), solid, triangles in zip(members, solids, triangulations(solids), strict=True)
    ]


def as_solid(part: Geometry) -> Solid:
    """Return a polyhedron as it is, and a cylinder as a prism of the same volume."""
    if isinstance(part, Solid):
        return part
    turn = 2 * math.pi / SIDES
    return as_prism(replace(part, radius=part.radius * math.sqrt(turn / math.sin(turn))), SIDES)


def require_closed(body: Body) -> None:
    """Refuse a mesh that a slicer could not fill.

    Raises
    ------
    PartError
        If an edge does not have exactly two triangles, one along each direction, a triangle has
        two corners in one, or the volume is not positive.
    """
    tri = body.triangles
    tail, head = tri.ravel(), np.roll(tri, -1, axis=1).ravel()
    n = len(body.points)
    along, against = np.sort(tail * n + head), np.sort(head * n + tail)
    if (tail == head).any() or (np.diff(along) == 0).any() or not np.array_equal(along, against):
        raise PartError(f"{body.mark}: its triangles do not close; report this with the design")
    if not body.volume > 0:
        raise PartError(f"{body.mark}: its volume is {body.volume:.3g} mm³; it is inside out")

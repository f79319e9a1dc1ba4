"""The one value everything stands on: face normals, heights of M and heights of its Gauss image S.

A face plane is ``n·x = h``; a vertex is where the planes of one dual triangle meet. So faces are
planar by construction, all meshes with the same normals are parallel (thesis §4.1), and an offset
is ``h + d·h_S`` (§4.2).
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from phexfab.mesh.polymesh import PolyMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def plane_vertices(normals: FloatArray, heights: FloatArray, triangles: IntArray) -> FloatArray:
    """Return the (V, 3) points where the planes of each dual triangle meet.

    Parameters
    ----------
    normals : (F, 3) unit normals
    heights : (F,) heights, ``n·x = h``
    triangles : (V, 3) faces that meet at each vertex
    """
    rows = normals[triangles]
    right = heights[triangles]
    point = np.asarray(np.linalg.solve(rows, right[..., None])[..., 0], float)
    # One step of refinement: the three normals are nearly parallel on a fine mesh.
    residual = right - np.einsum("vij,vj->vi", rows, point)
    return point + np.asarray(np.linalg.solve(rows, residual[..., None])[..., 0], float)


@dataclass(frozen=True, eq=False)
class Shell:
    """A P-Hex mesh M with its Gauss image S, as planes.

    Attributes
    ----------
    normals : (F, 3) unit face normals
    heights : (F,) heights of M's face planes, mm
    gauss_heights : (F,) heights of S's face planes, unit length
    triangles : (V, 3) int
        The three faces that meet at each vertex, counter-clockwise about the normals.
    kind : str
        Offset type: ``"face"``, ``"edge"`` or ``"vertex"``.
    points : (F, 3) array, mm
        The point of the smooth surface whose normal is the face's.
    step : float
        Lattice step in curvature-line coordinates (0 where there is none).
    parameters : (F,) complex
        The surface's parameter at ``points`` (empty where there is no surface).
    whole : Shell or None
        What a cut shell was cut from: its panels have the curvatures that they had there.
    parents : (F,) int
        For a cut shell, the face of ``whole`` that each face comes from; −1 for rim planes, which
        cut the border panels. Empty for others.

    Faces whose ring of triangles does not close are *border planes*: they trim the border panels
    and carry the boundary heights, but are no panels. ``panels`` lists the others.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> len(shell.panels), len(shell.edges), len(shell.mesh.vertices)
    (27, 101, 75)
    >>> shell.mesh.vertices.shape == shell.gauss.vertices.shape
    True
    """

    normals: FloatArray
    heights: FloatArray
    gauss_heights: FloatArray
    triangles: IntArray
    kind: str
    points: FloatArray
    step: float = 0.0
    parameters: NDArray[np.complex128] = field(default_factory=lambda: np.zeros(0, complex))
    whole: Shell | None = None
    parents: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))

    def __repr__(self) -> str:
        return f"<Shell: {len(self.panels)} panels, {self.kind} offsets>"

    @cached_property
    def rings(self) -> tuple[IntArray, IntArray, IntArray, IntArray]:
        """Return ``panels, starts, vertices, neighbours``.

        ``panels`` (P,) are the faces with a closed ring. Panel ``p`` has corners
        ``vertices[starts[p]:starts[p+1]]`` counter-clockwise; ``neighbours`` (same length) is the
        face beyond the edge from a corner to the next one.
        """
        from phexfab.parallel.rings import face_rings

        return face_rings(self.triangles, len(self.normals))

    @property
    def panels(self) -> IntArray:
        """(P,) faces that are whole polygons, in order; face ``p`` of ``mesh`` is ``panels[p]``."""
        return self.rings[0]

    @cached_property
    def rim_vertices(self) -> NDArray[np.bool_]:
        """(V',) True for the vertices of ``mesh`` that lie in a rim plane; none unless cut."""
        if not len(self.parents):
            return np.zeros(len(self.used_vertices), bool)
        return np.asarray((self.parents[self.triangles[self.used_vertices]] < 0).any(axis=1))

    @cached_property
    def rim_edges(self) -> NDArray[np.bool_]:
        """(E,) True for the edges of ``edges`` along a rim plane; none unless cut."""
        if not len(self.parents):
            return np.zeros(len(self.edges), bool)
        from phexfab.parallel.rings import edge_faces

        return self.parents[edge_faces(self)[1][:, 1]] < 0

    @cached_property
    def used_vertices(self) -> IntArray:
        """(V',) vertices (triangles) that belong to a panel, in order; the rest is not built."""
        return np.unique(self.rings[2])

    def _polymesh(self, heights: FloatArray) -> PolyMesh:
        _, starts, vertices, _ = self.rings
        used = self.used_vertices
        points = plane_vertices(self.normals, heights, self.triangles[used])
        return PolyMesh(points, np.searchsorted(used, vertices), starts)

    @cached_property
    def mesh(self) -> PolyMesh:
        """M in mm: one face per panel."""
        return self._polymesh(self.heights)

    @cached_property
    def gauss(self) -> PolyMesh:
        """S, the Gauss image: same vertex and face order as ``mesh``."""
        return self._polymesh(self.gauss_heights)

    @cached_property
    def edges(self) -> IntArray:
        """(E, 4) rows ``vertex i, vertex j, left panel, right panel`` of ``mesh``.

        Seen from the tip of the normals the left panel lies left of i→j; the right panel is −1 on
        the border. Sorted by (left panel, corner).
        """
        from phexfab.parallel.rings import shell_edges

        return shell_edges(self)

    def turned_over(self) -> Shell:
        """Return the same M with its normals on the other side, and −S for S."""
        return replace(
            self,
            normals=-self.normals,
            heights=-self.heights,
            triangles=self.triangles[:, ::-1],
            whole=None if self.whole is None else self.whole.turned_over(),
        )

    def with_heights(self, heights: FloatArray) -> Shell:
        """Return the parallel shell with other heights (a member of P(M), thesis §4.1).

        It no longer knows what it was cut from: that had the old heights.
        """
        moved = replace(self, heights=np.asarray(heights, float), whole=None)
        for name in (
            "rings",
            "used_vertices",
            "gauss",
            "edges",
            "rim_vertices",
            "rim_edges",
        ):  # none depends on the heights
            if name in self.__dict__:
                moved.__dict__[name] = self.__dict__[name]
        return moved

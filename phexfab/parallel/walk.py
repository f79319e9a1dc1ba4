"""Walking along a fence over a mesh: which panels and edges it crosses, in order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.errors import MeshError
from phexfab.mesh.measures import signed_areas, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.border import Border, place
from phexfab.parallel.fence import Fence
from phexfab.parallel.shell import Shell
from phexfab.parallel.stations import PanelFinder

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


_ENDS = (
    "the shell ends at {}, before the border along which it is to be cut; make the shell reach "
    "further beyond the border"
)


class LostWayError(MeshError):
    """A walk met a vertex or ran along an edge; a fence that is moved a little may do better."""


@dataclass(frozen=True, eq=False)
class Ground:
    """A whole shell's mesh, ready to be walked over.

    Attributes
    ----------
    mesh : PolyMesh
    normals : (P, 3), heights : (P,)
        Planes of the panels.
    twin : (C,) int
        The corner at which the same edge begins in the panel beyond; −1 on the border.
    finder : PanelFinder
    vertices : cKDTree
        Of the mesh's vertices.
    """

    mesh: PolyMesh
    normals: FloatArray
    heights: FloatArray
    twin: IntArray
    finder: PanelFinder
    vertices: cKDTree

    @classmethod
    def of(cls, shell: Shell) -> Ground:
        """Return the ground of a whole shell."""
        mesh = shell.mesh
        n = len(mesh.vertices)
        tail, head = mesh.corners, mesh.corners[mesh.next_corner]
        key, back = tail * n + head, head * n + tail
        order = np.argsort(key)
        slot = np.minimum(np.searchsorted(key[order], back), len(key) - 1)
        twin = np.where(key[order[slot]] == back, order[slot], -1)
        planes = shell.panels
        return cls(
            mesh,
            shell.normals[planes],
            shell.heights[planes],
            twin,
            PanelFinder(mesh),
            cKDTree(mesh.vertices),
        )


def refuse_crossed(ground: Ground, borders: Sequence[Border], kind: str) -> None:
    """Raise MeshError where a border runs through a panel that crosses itself before any cut.

    Parameters
    ----------
    ground : Ground
    borders : sequence of Border
    kind : str
        Offset type of the shell: circles ask for more than the face type does.
    """
    mesh, middle = ground.mesh, ground.finder.middle
    crossed = np.flatnonzero(~simple_faces(mesh) | ~(signed_areas(mesh, ground.normals) > 0))
    if not len(crossed):
        return
    tree = cKDTree(np.concatenate([one.points for one in borders]))
    other = "" if kind == "face" else ', or offset.type = "face", which needs no circles'
    for f in crossed.tolist():
        reach = float(np.linalg.norm(mesh.polygon(f) - middle[f], axis=1).max())
        if tree.query(middle[f])[0] < reach:
            raise MeshError(
                f"no border can be cut through the panel at {place(middle[f])}, which crosses "
                "itself before any cut: the lattice is too coarse there, or bent too much to close "
                f"up around umbilics; choose another panel size{other}"
            )


@dataclass(frozen=True)
class Crossing:
    """Where a plane of the fence crosses an edge of the mesh, leaving a panel.

    Attributes
    ----------
    corner : int
        At which the edge begins in the panel that is left.
    share : float
        How far along the edge, 0 to 1.
    plane : int
    """

    corner: int
    share: float
    plane: int


@dataclass(frozen=True)
class Arc:
    """A piece of the walk inside one panel, from one crossing to the next.

    Attributes
    ----------
    panel : int
    planes : tuple of int
        The planes followed, with a station between each two.
    """

    panel: int
    planes: tuple[int, ...]


def walk(
    ground: Ground, fence: Fence, push: float = 0.0, first: int = 0
) -> tuple[list[Arc], list[Crossing]]:
    """Walk once around a fence.

    Parameters
    ----------
    ground : Ground
    fence : Fence
    push : float, mm
        Given planes are moved outward by this much while walking, so that vertices in such a plane
        count as inside (outside where negative).
    first : int
        Number of the fence's first plane in the result.

    Returns
    -------
    arcs, crossings
        As many of both; arc k ends at crossing k, from where arc k + 1 begins.

    Raises
    ------
    LostWayError
        If it meets a vertex or edge, or crosses its own way.
    MeshError
        If it leaves the mesh, or stays in one panel.
    """
    arcs, crossings = _Walker(ground, fence, push).run()
    return (
        [Arc(arc.panel, tuple(first + k for k in arc.planes)) for arc in arcs],
        [Crossing(one.corner, one.share, first + one.plane) for one in crossings],
    )


class _Walker:
    def __init__(self, ground: Ground, fence: Fence, push: float) -> None:
        self.ground = ground
        self.fence = fence
        given = np.isfinite(fence.stations.planes[:, 3])
        self.heights = fence.heights + np.where(given, push, 0.0)
        self.m = len(fence.points)
        # Across every ruling in the plane that ends there: is a point beyond it?
        following = np.roll(fence.rulings, -1, axis=0)
        self.across = np.cross(following, fence.normals) if self.m else np.zeros((0, 3))
        if self.m:
            # The border's way just before the ruling: a long side may begin beyond its line.
            begin = fence.stations.along
            ahead = np.roll(begin, -1) - begin
            ahead[-1] += fence.border.length
            last = fence.border.at(begin + ahead)[0] - fence.border.at(begin + 0.95 * ahead)[0]
            self.across *= np.sign(np.einsum("ij,ij->i", self.across, last))[:, None]

    def run(self) -> tuple[list[Arc], list[Crossing]]:
        panel, plane, point = self._start()
        begin = panel
        ground = self.ground
        steps: list[tuple[int, tuple[int, ...], Crossing]] = []
        planes = [plane]
        came_by, seen = -1, set()
        while True:
            corner, share, spot = self._exit(panel, plane, point, came_by)
            if self._beyond(plane, spot):
                plane = (plane + 1) % self.m
                point = self._station(panel, plane)
                if plane == 0:
                    break
                planes.append(plane)
                came_by = -1
                continue
            if (corner, plane) in seen:
                if self.m == 0 and (corner, plane) == (steps[0][2].corner, 0):
                    planes = []
                    break
                raise LostWayError(f"the border comes back on itself at {place(spot)}")
            seen.add((corner, plane))
            steps.append((panel, tuple(planes), Crossing(corner, share, plane)))
            came_by = int(ground.twin[corner])
            if came_by < 0:
                raise MeshError(_ENDS.format(place(spot)))
            panel, point, planes = int(ground.mesh.face_of_corner[came_by]), spot, [plane]
        if not steps:
            raise MeshError(
                f"the border around {place(self.fence.border.points.mean(axis=0))} lies within one "
                "panel; make the panels smaller or leave this border out"
            )
        if self.m and panel != begin:
            raise LostWayError(f"the border does not close at {place(self.fence.points[0])}")
        arcs = [Arc(f, along) for f, along, _ in steps]
        if self.m:  # the walk began in the middle of an arc
            first = arcs[0]
            arcs[0] = Arc(first.panel, (*planes, *first.planes))
        return arcs, [crossing for _, _, crossing in steps]

    def _ring(self, panel: int) -> tuple[int, FloatArray]:
        mesh = self.ground.mesh
        a, b = int(mesh.starts[panel]), int(mesh.starts[panel + 1])
        return a, mesh.vertices[mesh.corners[a:b]]

    def _crossings(
        self, panel: int, plane: int
    ) -> tuple[FloatArray, list[tuple[float, int, float, FloatArray, bool]]]:
        """Return the way along the plane in a panel, and where it crosses the outline."""
        first, ring = self._ring(panel)
        n = self.fence.normals[plane]
        # Written out, so that a vertex has the same value in all of its panels.
        high = ring[:, 0] * n[0] + ring[:, 1] * n[1] + ring[:, 2] * n[2] - self.heights[plane]
        ahead = np.cross(self.ground.normals[panel], n)
        found = []
        sides = high.tolist()
        for j, here in enumerate(sides):
            k = j + 1 if j + 1 < len(sides) else 0
            if (here >= 0) != (sides[k] >= 0):
                share = here / (here - sides[k])
                spot = ring[j] + share * (ring[k] - ring[j])
                found.append((float(spot @ ahead), first + j, share, spot, here >= 0))
        return ahead, found

    def _exit(
        self, panel: int, plane: int, point: FloatArray, came_by: int
    ) -> tuple[int, float, FloatArray]:
        """Return the corner, share and point at which the way out of a panel crosses its edge."""
        ahead, found = self._crossings(panel, plane)
        now = float(point @ ahead)
        onward = [one for one in found if one[0] > now and one[1] != came_by]
        if not onward:
            raise LostWayError(f"the border runs along an edge at {place(point)}")
        _, corner, share, spot, leaves = min(onward, key=lambda one: one[0])
        if not leaves:
            raise LostWayError(f"the border runs along an edge at {place(point)}")
        return corner, share, spot

    def _beyond(self, plane: int, spot: FloatArray) -> bool:
        if not self.m:
            return False
        end = self.fence.points[(plane + 1) % self.m]
        return bool((spot - end) @ self.across[plane] >= 0)

    def _station(self, panel: int, station: int) -> FloatArray:
        """Return where the ruling of a station meets the panel's plane."""
        ground, fence = self.ground, self.fence
        n, base, ruling = ground.normals[panel], fence.points[station], fence.rulings[station]
        return np.asarray(base + (ground.heights[panel] - n @ base) / (n @ ruling) * ruling)

    def _start(self) -> tuple[int, int, FloatArray]:
        """Return panel, plane and point to begin with."""
        ground, fence = self.ground, self.fence
        finder = ground.finder
        if self.m:
            base = fence.points[0]
            near = np.atleast_1d(finder.tree.query(base, k=min(12, len(finder.middle)))[1])
            spots = [(int(f), self._station(int(f), 0)) for f in near]
            for f, spot in sorted(spots, key=lambda one: float(np.linalg.norm(one[1] - base))):
                if self._inside(f, 0, spot):
                    return f, 0, spot
            if finder.find(base[None], fence.rulings[:1])[0] < 0:
                raise MeshError(_ENDS.format(place(base)))
            raise LostWayError(f"the border runs over an edge at {place(base)}")
        border = fence.border
        along = np.arange(64) * border.length / 64
        points, normals = border.at(along)
        for f, point in zip(finder.find(points, normals).tolist(), points, strict=True):
            if f < 0:
                continue
            n, r = ground.normals[f], fence.normals[0]
            # The nearest point of the line in which the panel's and the border's planes meet.
            both = np.stack([n, r, np.cross(n, r)])
            right = np.array([ground.heights[f], self.heights[0], both[2] @ point])
            spot = np.linalg.solve(both, right)
            if self._inside(f, 0, spot):
                return f, 0, spot
        raise LostWayError(f"the border around {place(points.mean(axis=0))} misses the shell")

    def _inside(self, panel: int, plane: int, spot: FloatArray) -> bool:
        """Return whether a point of the plane lies in a panel: leaving comes next, not entering."""
        ahead, found = self._crossings(panel, plane)
        now = float(spot @ ahead)
        onward = [one for one in found if one[0] > now]
        return bool(onward) and min(onward, key=lambda one: one[0])[4]

"""Small pieces at a cut: merged into their neighbours, or dropped.

To merge a piece is to take its face out of the dual triangulation and to triangulate the hole
again without it: the neighbours' planes are extended, their common edges prolonged to the rim. All
triangulations of the hole are tried and the one with the longest shortest edge is taken, if its
panels are simple polygons.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from phexfab.mesh.measures import signed_areas, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.border import distance_to_segments
from phexfab.parallel.shell import plane_vertices

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

LARGEST_HOLE = 9
"""Neighbours, rim planes included, of a piece that may be merged."""


@cache
def triangulations(n: int) -> tuple[tuple[tuple[int, int, int], ...], ...]:
    """Return all triangulations of a polygon with n corners, as index triples in order."""

    def of(i: int, j: int) -> Iterator[tuple[tuple[int, int, int], ...]]:
        if j - i < 2:
            yield ()
            return
        for k in range(i + 1, j):
            for low in of(i, k):
                for high in of(k, j):
                    yield (*low, (i, k, j), *high)

    return tuple(of(0, n - 1))


@dataclass(frozen=True, eq=False)
class Tidied:
    """What became of small pieces.

    Attributes
    ----------
    merged, dropped, kept : int
        Merged into a neighbour; left out; too deep to be left out.
    deepest : (n, 3) mm
        The inner corner farthest from the rim of each thin piece that could not be merged.
    """

    merged: int
    dropped: int
    kept: int
    deepest: FloatArray


class Patchwork:
    """A dual triangulation that can be changed face by face.

    Parameters
    ----------
    normals, heights : (F, 3), (F,)
        Planes of panels, then rim planes.
    triangles : (V, 3) int
    rim : int
        The first rim plane; all following faces are rim planes.

    Raises
    ------
    ValueError
        If two triangles share a directed edge.
    """

    def __init__(
        self, normals: FloatArray, heights: FloatArray, triangles: IntArray, rim: int
    ) -> None:
        self.normals, self.heights, self.rim = normals, heights, rim
        self.next: dict[tuple[int, int], int] = {}
        self.some: dict[int, int] = {}
        for a, b, c in triangles.tolist():
            self._add(a, b, c)
        self.copies: list[int] = []
        """Given rim plane that each extra rim plane is a copy of."""

    def _add(self, a: int, b: int, c: int) -> None:
        for p, q, r in ((a, b, c), (b, c, a), (c, a, b)):
            if (p, q) in self.next:
                raise ValueError(f"face {p} has face {q} for neighbour twice")
            self.next[p, q] = r
            self.some[p] = q

    def _remove(self, a: int, b: int, c: int) -> None:
        for pair in ((a, b), (b, c), (c, a)):
            del self.next[pair]

    def triangles(self) -> IntArray:
        """Return all triangles, each from its lowest face on, in order."""
        found = [(a, b, c) for (a, b), c in self.next.items() if a < b and a < c]
        return np.array(sorted(found), np.int64).reshape(-1, 3)

    def is_rim(self, face: int) -> bool:
        """Return whether a face is a rim plane."""
        return face >= self.rim

    def rings(self, faces: list[int]) -> dict[int, list[int]]:
        """Return the neighbours of faces, counter-clockwise; empty where a ring is open."""
        return {f: self._ring(f, self.some[f]) if f in self.some else [] for f in faces}

    def _ring(self, face: int, first: int) -> list[int]:
        ring, at = [first], self.next.get((face, first), -1)
        while at != first:
            if at < 0 or len(ring) > 400:
                return []
            ring.append(at)
            at = self.next.get((face, at), -1)
        return ring

    def outlines(self, rings: dict[int, list[int]]) -> PolyMesh:
        """Return faces with these rings as polygons (vertices are not shared)."""
        rows = [
            (f, a, b)
            for f, ring in rings.items()
            for a, b in zip(ring, [*ring[1:], ring[0]], strict=True)
        ]
        table = np.array(rows, np.int64)
        starts = np.cumsum([0, *(len(ring) for ring in rings.values())])
        points = plane_vertices(self.normals, self.heights, table)
        return PolyMesh(points, np.arange(len(points)), starts.astype(np.int64))

    def split_plane(self, plane: int) -> int:
        """Return a new rim plane that coincides with one there is."""
        self.normals = np.vstack([self.normals, self.normals[plane]])
        self.heights = np.append(self.heights, self.heights[plane])
        given = len(self.heights) - 1 - len(self.copies)
        self.copies.append(plane if plane < given else self.copies[plane - given])
        return len(self.heights) - 1


def tidy(patch: Patchwork, pieces: list[int], least: float, width: float) -> Tidied:
    """Merge or drop the pieces that are too small or too thin; the patchwork is changed.

    Where no neighbour can be extended over a piece (its inner corner is one at which a neighbour
    is reflex), it is left out if it is thin, so that the rim moves by no more than the width.

    Parameters
    ----------
    patch : Patchwork
    pieces : list of int
        Faces that touch the rim.
    least : float, mm²
    width : float, mm
        Least depth of a piece, from the rim to its farthest corner.
    """
    rings = patch.rings(pieces)
    merged = dropped = kept = 0
    waiting = []
    for f, (area, depth, corner) in _sizes(patch, rings).items():
        if area < least or depth < width:
            waiting.append((area, f, depth, corner))
    stuck = []
    for _, f, depth, corner in sorted(waiting, key=lambda one: one[:2]):
        ring = rings[f]
        changed = _merge(patch, f, ring, rings)
        if changed:
            merged += 1
            rings.update(changed)
            del rings[f]
            continue
        if depth < width:
            stuck.append(corner)
        if depth < width and _drop(patch, f, ring):
            dropped += 1
            del rings[f]
            rings = patch.rings(list(rings))  # a rim plane may have got another number
        else:
            kept += 1
    return Tidied(merged, dropped, kept, np.array(stuck).reshape(-1, 3))


def _sizes(
    patch: Patchwork, rings: dict[int, list[int]]
) -> dict[int, tuple[float, float, FloatArray]]:
    """Return area, depth from the rim and farthest corner of every face that touches it."""
    rings = {f: ring for f, ring in rings.items() if any(map(patch.is_rim, ring))}
    if not rings:
        return {}
    mesh = patch.outlines(rings)
    areas = signed_areas(mesh, patch.normals[np.array(list(rings))])
    found = {}
    for k, (f, ring) in enumerate(rings.items()):
        points = mesh.polygon(k)
        rim = np.array([patch.is_rim(g) for g in [*ring[1:], ring[0]]])
        ends = np.roll(points, -1, axis=0)
        if rim.all():
            found[f] = float(areas[k]), np.inf, points[0]
            continue
        # Both ways: a corner of the border may lie farther from what is inside than the reverse.
        inward = distance_to_segments(points, points[rim], ends[rim])
        outward = distance_to_segments(points, points[~rim], ends[~rim])
        far = int(inward.argmax())
        found[f] = float(areas[k]), float(max(inward[far], outward.max())), points[far]
    return found


def _merge(
    patch: Patchwork, face: int, ring: list[int], known: dict[int, list[int]]
) -> dict[int, list[int]]:
    """Take a face out and let its neighbours meet; return their new rings, or nothing."""
    n = len(ring)
    if n > LARGEST_HOLE or _rim_runs(patch, ring) != 1:
        return {}
    beside = [g for g in ring if not patch.is_rim(g)]
    old = known | patch.rings([g for g in beside if g not in known])
    if any(not old[g] for g in beside):
        return {}
    centre = patch.outlines({face: ring}).vertices
    reach = 1.0 * float(np.linalg.norm(np.ptp(centre, axis=0)))
    middle = centre.mean(axis=0)
    best: tuple[float, dict[int, list[int]], tuple[tuple[int, int, int], ...]] | None = None
    for choice in triangulations(n):
        triples = tuple((ring[i], ring[j], ring[k]) for i, j, k in choice)
        if not _allowed(patch, face, ring, triples):
            continue
        points = plane_vertices(patch.normals, patch.heights, np.array(triples))
        if np.linalg.norm(points - middle, axis=1).max() > reach:
            continue
        rings = _without(face, ring, triples, {g: old[g] for g in beside})
        if not rings:
            continue
        quality = _quality(patch, rings)
        if quality > 0 and (best is None or quality > best[0]):
            best = quality, rings, triples
    if best is None:
        return {}
    for a, b in zip(ring, [*ring[1:], ring[0]], strict=True):
        patch._remove(face, a, b)
    for triple in best[2]:
        patch._add(*triple)
    return best[1]


def _rim_runs(patch: Patchwork, ring: list[int]) -> int:
    rim = [patch.is_rim(g) for g in ring]
    return sum(one and not rim[k - 1] for k, one in enumerate(rim))


def _allowed(
    patch: Patchwork, face: int, ring: list[int], triples: tuple[tuple[int, int, int], ...]
) -> bool:
    """Return whether no new pair of neighbours exists already, nor two rim planes anew."""
    place = {g: k for k, g in enumerate(ring)}
    n = len(ring)
    for triple in triples:
        if all(patch.is_rim(g) for g in triple):
            return False
        for a, b in zip(triple, (triple[1], triple[2], triple[0]), strict=True):
            if (place[b] - place[a]) % n in (1, n - 1):
                continue
            if (a, b) in patch.next or (b, a) in patch.next:
                return False
            if patch.is_rim(a) and patch.is_rim(b):
                return False
    return True


def _without(
    face: int,
    ring: list[int],
    triples: tuple[tuple[int, int, int], ...],
    rings: dict[int, list[int]],
) -> dict[int, list[int]]:
    """Return the rings of the neighbours after a face's star has been triangulated anew."""
    fans: dict[int, dict[int, int]] = {}
    for a, b, c in triples:
        for p, q, r in ((a, b, c), (b, c, a), (c, a, b)):
            fans.setdefault(p, {})[q] = r
    after = dict(zip(ring, [*ring[1:], ring[0]], strict=True))
    made = {}
    for g, row in rings.items():
        # In g's ring the face stood between the one after g and the one before it in the star.
        k = row.index(face)
        at, end = row[k - 1], row[(k + 1) % len(row)]
        if at != after[g]:
            return {}
        between: list[int] = []
        while at != end:
            at = fans[g].get(at, -1)
            if at < 0:
                return {}
            between.append(at)
        new = [*row[:k], *between[:-1], *row[k + 1 :]]
        if len(new) < 3 or len(set(new)) < len(new):
            return {}
        made[g] = new
    return made


def _quality(patch: Patchwork, rings: dict[int, list[int]]) -> float:
    """Return the shortest edge of the faces, or 0 where one is no simple polygon."""
    mesh = patch.outlines(rings)
    faces = np.array(list(rings))
    along = mesh.vertices[mesh.next_corner] - mesh.vertices
    # Along a rim plane every edge runs forward.
    beyond = np.array([g for ring in rings.values() for g in [*ring[1:], ring[0]]])
    rim = np.flatnonzero(beyond >= patch.rim)
    own = faces[mesh.face_of_corner[rim]]
    forward = np.cross(patch.normals[own], patch.normals[beyond[rim]])
    if np.any(np.einsum("ij,ij->i", along[rim], forward) <= 0):
        return 0.0
    if np.any(signed_areas(mesh, patch.normals[faces]) <= 0) or not simple_faces(mesh).all():
        return 0.0
    return float(np.linalg.norm(along, axis=1).min())


def _drop(patch: Patchwork, face: int, ring: list[int]) -> bool:
    """Leave a piece out: its plane becomes a border plane, the old edges the border."""
    if _rim_runs(patch, ring) != 1:
        return False
    n = len(ring)
    first = next(k for k in range(n) if patch.is_rim(ring[k]) and not patch.is_rim(ring[k - 1]))
    run = [ring[(first + k) % n] for k in range(n) if patch.is_rim(ring[(first + k) % n])]
    if len(run) == n or n - len(run) < 2:
        return False
    for a, b in pairwise(run):
        patch._remove(face, a, b)
    if len(run) == 1:
        # One plane before and behind the gap: from here on a copy of it, or the ring stays closed.
        plane, copy = run[0], patch.split_plane(run[0])
        at = face
        while True:
            beyond = patch.next.get((at, plane), -1)
            if beyond < 0 or beyond == copy:
                break
            patch._remove(at, plane, beyond)
            patch._add(at, copy, beyond)
            if patch.is_rim(beyond):
                break
            at = beyond
    return True

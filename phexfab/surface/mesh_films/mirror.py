"""Where the vertices of a film are held: fixed, free in mirror planes, or free in space.

A film that meets a plane at right angles goes on by reflection (Schwarz), so a free border needs
no equations of its own: the film is fitted together with its mirror images.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from phexfab.errors import SurfaceError
from phexfab.surface.mesh_films.triangulated import edges_of

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

RINGS = 3
"""How many rings of triangles along a free border are reflected."""


@dataclass(frozen=True, eq=False)
class Mirror:
    """A plane that a film meets at right angles.

    Attributes
    ----------
    point, normal : (3,) float
        A point of the plane, mm, and its normal of any length.
    """

    point: FloatArray
    normal: FloatArray

    def __post_init__(self) -> None:
        point, normal = np.asarray(self.point, float), np.asarray(self.normal, float)
        length = float(np.linalg.norm(normal))
        if point.shape != (3,) or normal.shape != (3,) or not 0 < length < np.inf:
            raise SurfaceError(
                f"a mirror plane needs a point and a normal that is not zero, not {self.point} "
                f"and {self.normal}"
            )
        object.__setattr__(self, "point", point)
        object.__setattr__(self, "normal", normal / length)

    def height(self, points: ArrayLike) -> FloatArray:
        """Return the signed distances (...) of points (..., 3), mm."""
        return (np.asarray(points, float) - self.point) @ self.normal

    def image(self, points: ArrayLike) -> FloatArray:
        """Return the mirror images of points (..., 3)."""
        return np.asarray(points, float) - 2 * self.height(points)[..., None] * self.normal


@dataclass(frozen=True, eq=False)
class Held:
    """How the vertices of a film are held.

    Attributes
    ----------
    fixed : (n,) bool
    mirrors : tuple of Mirror
    slides : (n, len(mirrors)) bool
        In which planes a vertex has to stay.
    """

    fixed: BoolArray
    mirrors: tuple[Mirror, ...]
    slides: BoolArray

    @cached_property
    def projectors(self) -> FloatArray:
        """(n, 3, 3) projection of vectors to those along which each vertex may move."""
        out = np.tile(np.eye(3), (len(self.fixed), 1, 1))
        out[self.fixed] = 0.0
        sliding = np.flatnonzero(self.slides.any(axis=1) & ~self.fixed)
        patterns, which = np.unique(self.slides[sliding], axis=0, return_inverse=True)
        for k, pattern in enumerate(patterns):
            planes = np.array([m.normal for m, on in zip(self.mirrors, pattern, strict=True) if on])
            along = np.linalg.svd(planes)[2][np.linalg.matrix_rank(planes, 1e-6) :]
            out[sliding[which.reshape(-1) == k]] = along.T @ along
        return out

    def projected(self, vectors: FloatArray) -> FloatArray:
        """Return the parts of vectors (n, 3) along which the vertices may move."""
        return np.einsum("nij,nj->ni", self.projectors, vectors)

    def lines(self, normals: FloatArray) -> FloatArray:
        """Return the unit directions (n, 3) along which vertices move; zero where fixed."""
        free = self.projected(normals)
        length = np.linalg.norm(free, axis=1, keepdims=True)
        return free / np.where(length > 0, length, 1.0)

    def snapped(self, points: FloatArray) -> FloatArray:
        """Return points with those that slide put exactly into their planes."""
        out = points.copy()
        for k, mirror in enumerate(self.mirrors):
            rows = self.slides[:, k] & ~self.fixed
            out[rows] -= mirror.height(out[rows])[:, None] * mirror.normal
        return out


def held_border(points: FloatArray, triangles: IntArray, mirrors: tuple[Mirror, ...]) -> Held:
    """Return how a mesh is held: fixed along its border, free where border edges lie in mirrors.

    Vertices where a free border meets a fixed one are fixed; where two free borders meet, the
    vertex stays in both planes.
    """
    edges = edges_of(triangles, points)
    rim = edges.ends[edges.border]
    fixed = np.zeros(len(points), bool)
    slides = np.zeros((len(points), len(mirrors)), bool)
    if not mirrors:
        fixed[rim] = True
        return Held(fixed, mirrors, slides)
    length = np.linalg.norm(points[rim[:, 1]] - points[rim[:, 0]], axis=1)
    tolerance = 1e-6 * length.mean()
    flat = np.stack(
        [(np.abs(mirror.height(points[rim])) <= tolerance).all(axis=1) for mirror in mirrors], 1
    )
    fixed[rim[~flat.any(axis=1)]] = True
    for k in range(len(mirrors)):
        slides[rim[flat[:, k]], k] = True
    unused = np.flatnonzero(~flat.any(axis=0))
    if len(unused):
        raise SurfaceError(
            f"mirror {unused[0] + 1} of {len(mirrors)} (point "
            f"{mirrors[unused[0]].point.tolist()}): no border edge lies in its plane; a free "
            "border has to start in its plane"
        )
    return Held(fixed, mirrors, slides)


@dataclass(frozen=True, eq=False)
class Reflected:
    """A mesh with the mirror images beyond its free borders.

    Attributes
    ----------
    source : (N,) int
        The vertex that each is an image of; the first n are themselves.
    linear : (N, 3, 3) float
    shift : (N, 3) float
        The image is ``linear @ x + shift``.
    triangles : (M, 3) int
    """

    source: IntArray
    linear: FloatArray
    shift: FloatArray
    triangles: IntArray

    def points(self, points: FloatArray) -> FloatArray:
        """Return the (N, 3) positions of all, from those (n, 3) of the mesh."""
        return np.einsum("nij,nj->ni", self.linear, points[self.source]) + self.shift


def reflected(points: FloatArray, triangles: IntArray, held: Held) -> Reflected:
    """Return the mesh with images of `RINGS` rings along its free borders, closed up at corners."""
    n = len(points)
    source, linear = np.arange(n), np.tile(np.eye(3), (n, 1, 1))
    shift, faces = np.zeros((n, 3)), triangles
    if not held.mirrors:
        return Reflected(source, linear, shift, faces)
    ends = edges_of(triangles).ends
    step = sp.csr_array(
        (np.ones(2 * len(ends)), (ends.ravel(), ends[:, ::-1].ravel())), shape=(n, n)
    )
    size = float(np.median(np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)))
    slides = held.slides & ~held.fixed[:, None]
    # Once for each plane; then again about corners, until their images close up (at most a
    # corner of 180°/4 is closed by three more).
    for pass_ in range(4):
        now = np.einsum("nij,nj->ni", linear, points[source]) + shift
        tree = cKDTree(now)
        new_source: list[IntArray] = []
        new_linear, new_shift, new_faces = [], [], []
        end = len(source)
        for k, mirror in enumerate(held.mirrors):
            start = slides[:, k] if pass_ == 0 else slides[:, k] & (slides.sum(axis=1) > 1)
            if not start.any():
                continue
            reach = start.astype(float)
            for _ in range(RINGS):
                reach = reach + step @ reach
            near = reach[source] > 0
            mine = faces[near[faces].all(axis=1)]
            used = np.unique(mine)
            image = mirror.image(now[used])
            away, twin = tree.query(image)
            known = away < 1e-3 * size
            index = np.zeros(len(source), np.int64)
            index[used[known]] = twin[known]
            fresh = used[~known]
            index[fresh] = end + np.arange(len(fresh))
            end += len(fresh)
            turn = np.eye(3) - 2 * np.outer(mirror.normal, mirror.normal)
            new_source.append(source[fresh])
            new_linear.append(turn @ linear[fresh])
            new_shift.append(mirror.image(shift[fresh]))
            new_faces.append(index[mine][:, ::-1])
        if end == len(source):
            break
        source = np.concatenate([source, *new_source])
        linear = np.concatenate([linear, *new_linear])
        shift = np.concatenate([shift, *new_shift])
        faces = np.concatenate([faces, *new_faces])
        # Two planes may make the same image: weld, and keep each triangle once.
        now = np.einsum("nij,nj->ni", linear, points[source]) + shift
        first = _first_of_each(now, 1e-3 * size)
        keep, index = np.unique(first, return_inverse=True)
        faces = index.reshape(-1)[faces]
        source, linear, shift = source[keep], linear[keep], shift[keep]
        _, once = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
        faces = faces[np.sort(once)]
    return Reflected(source, linear, shift, faces)


def _first_of_each(points: FloatArray, tolerance: float) -> IntArray:
    """Return for every point the lowest index of those at its place."""
    first = np.arange(len(points))
    pairs = cKDTree(points).query_pairs(tolerance, output_type="ndarray")
    if len(pairs):
        np.minimum.at(first, pairs.max(axis=1), pairs.min(axis=1))
    return first

"""Triangle meshes as smooth surfaces: local polynomial fits, blended."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import perm
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.errors import MeshError
from phexfab.surface.freeform.bending import BoolArray, FloatArray
from phexfab.surface.freeform.implicit import ImplicitSurface, frame
from phexfab.surface.mesh_films.stencil import stencils, vertex_normals

if TYPE_CHECKING:
    from phexfab.mesh.polymesh import PolyMesh

IntArray = NDArray[np.int64]

POWERS = np.array([[i, j] for d in range(4) for i in range(d, -1, -1) for j in [d - i]])
NEAR = 20  # fits that may count at a point


@dataclass(frozen=True, eq=False)
class BlendedFits:
    """A function in space that vanishes on a smooth surface near the vertices of a mesh.

    In the frame of every vertex a cubic height is fitted to its two rings; the function is the mean
    of what a point is off those heights, weighted by Wendland's C² function of the distance from
    the vertex.

    Attributes
    ----------
    points, normals : (n, 3) float
    frames : (n, 3, 3) float
        Rows are two tangents and the normal.
    heights : (n, 10) float
        Coefficients by ``POWERS``.
    radius : (n,) float
        Where each vertex' weight ends, mm.

    References
    ----------
    Ohtake et al. 2003, "Multi-level partition of unity implicits"; Cazals and Pouget 2005,
    "Estimating differential quantities using polynomial fitting of osculating jets".
    """

    points: FloatArray
    triangles: IntArray
    frames: FloatArray
    heights: FloatArray
    radius: FloatArray

    @cached_property
    def tree(self) -> cKDTree:
        """The vertices' tree."""
        return cKDTree(self.points)

    def jet(self, x: FloatArray, order: int) -> tuple[FloatArray, ...]:
        """Return the function (k,), and to ``order`` its gradient (k, 3) and Hessian (k, 3, 3)."""
        count = min(NEAR, len(self.points))
        # Far points use the nearest vertex' own fit: its weight is drawn out to there.
        distance, near = self.tree.query(x, count)
        reach = np.maximum(self.radius[near], 1.25 * distance[:, :1])
        # Sheets that face the other way do not mix.
        facing = np.einsum("kmj,kj->km", self.frames[near, 2], self.frames[near[:, 0], 2]) > 0
        gap = x[:, None] - self.points[near]
        axes = self.frames[near]
        local = np.einsum("kmij,kmj->kmi", axes, gap)
        coefficient = self.heights[near]
        q = local[..., 2] - _height(coefficient, local, 0, 0)
        s = np.minimum(distance / reach, 1.0)
        w = np.where(facing, (1 - s) ** 4 * (4 * s + 1), 0.0)
        total = w.sum(1)
        value = (w * q).sum(1) / total
        if order == 0:
            return (value,)
        slope = np.stack(
            [
                -_height(coefficient, local, 1, 0),
                -_height(coefficient, local, 0, 1),
                np.ones_like(q),
            ],
            axis=-1,
        )
        dq = np.einsum("kmij,kmi->kmj", axes, slope)
        # w'(s)/s = −20 (1−s)³ and d = |gap|: ∇w = w'/s · gap / R².
        pull = np.where(facing, -20 * (1 - s) ** 3, 0.0) / reach**2
        dw = pull[..., None] * gap
        off = q - value[:, None]
        gradient = np.einsum("km,kmj->kj", w, dq) + np.einsum("km,kmj->kj", off, dw)
        gradient = gradient / total[:, None]
        if order == 1:
            return value, gradient
        xx, xy, yy = (-_height(coefficient, local, i, j) for i, j in ((2, 0), (1, 1), (0, 2)))
        t1, t2 = axes[:, :, 0], axes[:, :, 1]
        hq = (
            np.einsum("km,kmi,kmj->kij", w * xx, t1, t1)
            + np.einsum("km,kmi,kmj->kij", w * yy, t2, t2)
            + np.einsum("km,kmi,kmj->kij", w * xy, t1, t2)
            + np.einsum("km,kmi,kmj->kij", w * xy, t2, t1)
        )
        with np.errstate(all="ignore"):
            steep = np.where(s > 0, 60 * (1 - s) ** 2 / (s * reach**4), 0.0) * facing
        hw = np.einsum("km,kmi,kmj->kij", off * steep, gap, gap)
        hw += np.einsum("km,km->k", off, pull)[:, None, None] * np.eye(3)
        lean = dq - gradient[:, None]
        cross = np.einsum("kmi,kmj->kij", dw, lean)
        hessian = hq + hw + cross + cross.transpose(0, 2, 1)
        return value, gradient, hessian / total[:, None, None]

    @cached_property
    def _around(self) -> IntArray:
        """(n, most) triangles at each vertex, padded with the first."""
        corner = self.triangles.ravel()
        order = np.argsort(corner, kind="stable")
        owner = order // 3
        starts = np.searchsorted(corner[order], np.arange(len(self.points) + 1))
        degree = np.diff(starts)
        slot = np.minimum(np.arange(degree.max()), degree[:, None] - 1)
        return np.asarray(owner[starts[:-1, None] + slot])

    @cached_property
    def _borders(self) -> BoolArray:
        """(m, 3) whether edge k of a triangle (from corner k to the next) is a border."""
        n = len(self.points)
        tail, head = self.triangles, np.roll(self.triangles, -1, axis=1)
        return np.asarray(~np.isin(tail * n + head, head * n + tail))

    def within(self, x: FloatArray) -> BoolArray:
        """Return (k,) False where the nearest point of the mesh lies on its border."""
        near = self.tree.query(x, min(3, len(self.points)))[1]
        near = near.reshape(len(x), -1)
        candidates = self._around[near].reshape(len(x), -1)
        corner = self.points[self.triangles[candidates]]
        weights, away = _closest(x[:, None], corner)
        best = away.argmin(axis=1)
        row = np.arange(len(x))
        weights, triangle = weights[row, best], candidates[row, best]
        # Edge k misses corner k + 2: that corner's weight vanishes on it.
        on_edge = np.roll(weights, -2, axis=1) <= 1e-9
        return np.asarray(~(on_edge & self._borders[triangle]).any(axis=1))


def _height(coefficient: FloatArray, local: FloatArray, i: int, j: int) -> FloatArray:
    """Return the (i, j)-th derivative of the heights at local places."""
    out = np.zeros(local.shape[:-1])
    x, y = local[..., 0], local[..., 1]
    one = np.ones_like(x)
    xs, ys = [one, x, x * x, x * x * x], [one, y, y * y, y * y * y]
    for k, (p, q) in enumerate(POWERS.tolist()):
        if p < i or q < j:
            continue
        factor = float(perm(p, i) * perm(q, j))
        out += factor * coefficient[..., k] * (xs[p - i] * ys[q - j])
    return out


def _monomials(x: FloatArray, y: FloatArray) -> FloatArray:
    one = np.ones_like(x)
    return np.stack(
        [one, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y], -1
    )


def _closest(x: FloatArray, corner: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return barycentric weights (..., 3) of triangles' nearest points to x, and distances²."""
    edge = np.roll(corner, -1, axis=-2) - corner
    normal = np.cross(edge[..., 0, :], edge[..., 1, :])
    square = (normal**2).sum(-1)
    gap = x[..., None, :] - corner
    with np.errstate(all="ignore"):
        # The weight of corner k+2 is the area over edge k.
        areas = (np.cross(edge, gap) * normal[..., None, :]).sum(-1) / square[..., None]
        t = np.clip((gap * edge).sum(-1) / (edge**2).sum(-1), 0.0, 1.0)
    inner = np.roll(areas, 2, axis=-1)
    foot = corner + t[..., None] * edge
    away = ((x[..., None, :] - foot) ** 2).sum(-1)
    side = away.argmin(axis=-1)[..., None]
    along = np.take_along_axis(t, side, -1)
    place = np.arange(3)
    on_edge = np.where(place == side, 1 - along, np.where(place == (side + 1) % 3, along, 0.0))
    within = (inner >= 0).all(axis=-1)
    weights = np.where(within[..., None], inner, on_edge)
    nearest = np.einsum("...k,...kj->...j", weights, corner)
    return weights, ((x - nearest) ** 2).sum(-1)


def mesh_surface(mesh: PolyMesh, *, name: str = "mesh") -> ImplicitSurface:
    """Return the smooth surface of a triangle mesh.

    Around each vertex a cubic height over its normal is fitted to two rings of neighbours; the
    surface is the zero of their blend (``BlendedFits``), twice continuously differentiable, and
    passes the vertices of a smooth surface within O(h⁴) of the edge length h. Curvatures are those
    of the blend, to O(h²). The surface ends at the border of the mesh.

    Parameters
    ----------
    mesh : PolyMesh
        Triangles, oriented; mm.
    name : str

    Raises
    ------
    MeshError
        If a face is no triangle, or the mesh has fewer than 16 vertices.
    SurfaceError
        If vertices coincide, are loose, or a part has too few of them.
    """
    if not (mesh.sides == 3).all() or mesh.n_faces == 0:
        bad = int(np.flatnonzero(mesh.sides != 3)[0]) if mesh.n_faces else 0
        raise MeshError(f"{name}: face {bad} is no triangle; triangulate the mesh first")
    if len(mesh.vertices) < 16:
        raise MeshError(f"{name}: {len(mesh.vertices)} vertices are too few; 16 are needed")
    points = np.asarray(mesh.vertices, float)
    triangles = mesh.corners.reshape(-1, 3)
    around = stencils(points, triangles)
    normals = vertex_normals(points, triangles)
    fits = None
    for _ in range(2):  # once more in the frames of the fitted normals
        axes = np.stack([*frame(normals), normals], axis=1)
        gap = points[around.points] - points[:, None]
        local = np.einsum("nij,nmj->nmi", axes, gap) / around.size[:, None, None]
        design = _monomials(local[..., 0], local[..., 1])
        weight = around.weights.copy()
        weight[:, 0] = 1.0
        unknown, seen = design * weight[..., None], local[..., 2] * weight
        normal_matrix = np.einsum("nmi,nmj->nij", unknown, unknown)
        # A trace of damping on the cubic part keeps one-sided stencils at the border solvable.
        ridge = 1e-9 * np.einsum("nii->n", normal_matrix)
        normal_matrix[:, np.arange(10), np.arange(10)] += ridge[:, None] * (POWERS.sum(1) > 1)
        right = np.einsum("nmi,nm->ni", unknown, seen)
        heights = np.linalg.solve(normal_matrix, right[..., None])[..., 0]
        slope = heights[:, 1:3]
        fits = BlendedFits(
            points,
            triangles,
            axes,
            heights * around.size[:, None] ** (1.0 - POWERS.sum(1)),
            2.2 * around.size,
        )
        tilted = axes[:, 2] - slope[:, :1] * axes[:, 0] - slope[:, 1:] * axes[:, 1]
        normals = tilted / np.linalg.norm(tilted, axis=1, keepdims=True)
    assert fits is not None
    blend = fits
    margin = 0.05 * np.linalg.norm(np.ptp(points, axis=0))
    surface = ImplicitSurface(
        name,
        lambda x: blend.jet(x, 0)[0],
        lambda x: blend.jet(x, 1)[1],
        lambda x: blend.jet(x, 2)[2],
        points.min(axis=0) - margin,
        points.max(axis=0) + margin,
        within=blend.within,
        start=lambda x: np.asarray(points[blend.tree.query(x)[1]]),
        sites=points,
        jet=blend.jet,
    )
    return surface

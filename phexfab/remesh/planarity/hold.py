"""What it costs a vertex to move: fixed ones, border vertices on their curve, a surface to hug.

The cost of a vertex at x is |x − x₀|² + w·d(x)², d its distance from the border curve or the
reference surface. Near the foot of x it is the quadratic (x − a)ᵀW(x − a) up to a constant; steps
use W's inverse G, which is 0 for a vertex that does not move at all.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from phexfab.mesh.half_edges import border_loops
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.planarity.nearest import Reference

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

BORDER = 1e4
"""Square of what a step off the border curve costs, over a step along it."""
CORNER = np.cos(np.radians(40.0))
"""A border that turns by more than 40° at a vertex has a corner there. Corner after corner is a
ragged stretch, as whole hexagons leave it: no curve to stay on, and its vertices are free."""


class BorderCurve:
    """Cubic splines through the border's vertices, between its corners."""

    def __init__(self, mesh: PolyMesh) -> None:
        self._curves: list[tuple[CubicSpline, IntArray, FloatArray]] = []
        corner: list[IntArray] = []
        for loop in border_loops(mesh):
            points = mesh.vertices[loop]
            onward = np.roll(points, -1, axis=0) - points
            length = np.linalg.norm(onward, axis=1, keepdims=True)
            unit = np.divide(onward, length, out=np.zeros_like(onward), where=length > 0)
            turns = np.einsum("ij,ij->i", unit, np.roll(unit, 1, axis=0)) < CORNER
            sharp = np.flatnonzero(turns)
            corner.append(loop[turns & ~np.roll(turns, 1) & ~np.roll(turns, -1)])
            if not len(sharp):
                self._add(loop, np.append(np.arange(len(loop)), 0), points, "periodic")
            for first, last in zip(sharp, np.roll(sharp, -1), strict=True):
                count = (last - first - 1) % len(loop) + 1
                if count > 1:
                    self._add(
                        loop, (first + np.arange(count + 1)) % len(loop), points, "not-a-knot"
                    )
        self.corners = np.concatenate(corner) if corner else np.zeros(0, np.int64)
        self.vertices = np.concatenate([self.corners, *(v for _, v, _ in self._curves)])

    def _add(self, loop: IntArray, order: IntArray, points: FloatArray, end: str) -> None:
        through = points[order]
        chord = np.linalg.norm(np.diff(through, axis=0), axis=1)
        s = np.concatenate([[0.0], np.cumsum(np.maximum(chord, 1e-300))])
        inner = slice(0, -1) if end == "periodic" else slice(1, -1)
        self._curves.append((CubicSpline(s, through, bc_type=end), loop[order][inner], s[inner]))

    def feet(self, x: FloatArray) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return the vertices that can glide, their feet (k, 3) and the tangents there."""
        vertices, feet, tangents = [np.zeros(0, np.int64)], [np.zeros((0, 3))], [np.zeros((0, 3))]
        for curve, v, s in self._curves:
            low, high = curve.x[0], curve.x[-1]
            t = s.copy()
            for _ in range(20):
                slope = curve(t, 1)
                gap = x[v] - curve(t)
                step = np.einsum("ij,ij->i", gap, slope) / np.einsum("ij,ij->i", slope, slope)
                t = t + step
                if curve.extrapolate != "periodic":
                    t = np.clip(t, low, high)
                if np.abs(step).max(initial=0.0) < 1e-14 * (high - low):
                    break
            slope = curve(t, 1)
            vertices.append(v)
            feet.append(curve(t))
            tangents.append(slope / np.linalg.norm(slope, axis=1, keepdims=True))
        return np.concatenate(vertices), np.vstack(feet), np.vstack(tangents)

    def departure(self, x: FloatArray, start: FloatArray) -> float:
        """Return the largest distance of a border vertex from its curve, or its corner, mm."""
        v, feet, _ = self.feet(x)
        corner = self.corners
        away = [np.linalg.norm(x[v] - feet, axis=1)]
        away.append(np.linalg.norm(x[corner] - start[corner], axis=1))
        return float(np.concatenate(away).max(initial=0.0))


class Hold:
    """The cost of motion of all vertices."""

    def __init__(
        self,
        start: FloatArray,
        fixed: BoolArray,
        border: BorderCurve | None,
        reference: Reference | None,
        closeness: float,
        off_border: float = BORDER,
    ) -> None:
        self.start, self.fixed = start, fixed
        self.border, self.reference, self.closeness = border, reference, closeness
        self.off_border = off_border

    @property
    def pulled(self) -> bool:
        """Whether anything but the start pulls at vertices."""
        return (self.reference is not None and self.closeness > 0) or (
            self.border is not None and len(self.border.vertices) > 0
        )

    @property
    def free(self) -> bool:
        """Whether all vertices move at one cost in all directions: G is the identity."""
        return not self.pulled and not self.fixed.any()

    def around(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return G (V, 3, 3) and the cheapest places a (V, 3), mm, seen from x."""
        n = len(x)
        inverse = np.tile(np.eye(3), (n, 1, 1))
        pull = self.start.copy()
        if self.reference is not None and self.closeness > 0:
            w = self.closeness
            foot, normal = self.reference.nearest(x)
            across = normal[:, :, None] * normal[:, None, :]
            inverse -= w / (1 + w) * across
            pull = pull + w * np.einsum("vij,vj->vi", across, foot)
        if self.border is not None:
            v, foot, tangent = self.border.feet(x)
            along = tangent[:, :, None] * tangent[:, None, :]
            cost = self.off_border
            inverse[v] = (np.eye(3) + cost * along) / (1 + cost)
            off = np.eye(3) - along
            pull[v] = self.start[v] + cost * np.einsum("vij,vj->vi", off, foot)
            corner = self.border.corners
            inverse[corner] = np.eye(3) / (1 + cost)
            pull[corner] = (1 + cost) * self.start[corner]
        anchor = np.einsum("vij,vj->vi", inverse, pull)
        inverse[self.fixed] = 0.0
        anchor[self.fixed] = self.start[self.fixed]
        return inverse, anchor

    def cost(self, x: FloatArray) -> float:
        """Return the summed cost, mm²."""
        moved = x - self.start
        total = float(np.einsum("vi,vi->", moved, moved))
        if self.reference is not None and self.closeness > 0:
            foot, normal = self.reference.nearest(x)
            gap = np.einsum("vi,vi->v", x - foot, normal)  # beyond its border nothing pulls back
            if self.border is not None:  # those follow their curve
                gap[self.border.vertices] = 0.0
            total += self.closeness * float(gap @ gap)
        if self.border is not None:
            v, foot, _ = self.border.feet(x)
            total += self.off_border * float(((x[v] - foot) ** 2).sum())
            total += self.off_border * float((moved[self.border.corners] ** 2).sum())
        return total

"""A minimal surface on a triangle mesh: an atlas of local Weierstrass polynomials.

Each vertex has a chart, a minimal surface in closed form that is fitted to the mesh about it, and
all charts lie side by side on a square grid in one z-plane: z names the chart by the nearest grid
point and the place in it by the remainder ζ. So the atlas is a `MinimalSurface` like any other.
Neighbouring charts are not continuations of each other; they agree to the order of the fit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import SurfaceError
from phexfab.surface.holomorphic import ComplexArray
from phexfab.surface.mesh_films.chart_fit import (
    Charts,
    fit_or_lower,
    horner,
    local_curve,
    start_charts,
)
from phexfab.surface.mesh_films.stencil import Stencils, stencils, vertex_normals
from phexfab.surface.weierstrass import MinimalSurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SPACING = 16.0
"""Distance of the charts in z. A power of two, so that taking ζ from z is exact."""


@dataclass(frozen=True, eq=False)
class Atlas:
    """Local minimal surfaces about the vertices of a mesh, and the z-plane that holds them.

    A chart's own coordinate ζ is 0 at its vertex and of size 1 about at the vertex's neighbours;
    the fit reaches to |ζ| = 2 about.

    Attributes
    ----------
    name : str
    charts : Charts
    near : (n, k) int
        The vertices near each one, itself first, padded with itself.
    """

    name: str
    charts: Charts
    near: IntArray
    _spinor: ComplexArray = field(repr=False)

    @property
    def n_charts(self) -> int:
        """Number of charts, one per vertex."""
        return len(self.charts.origin)

    @cached_property
    def _columns(self) -> int:
        return math.isqrt(self.n_charts - 1) + 1

    def parameter_of_vertex(self, vertices: ArrayLike) -> ComplexArray:
        """Return the parameters z (...) of vertices (...): the centres of their charts."""
        row, column = np.divmod(np.asarray(vertices, np.int64), self._columns)
        half = self._columns // 2
        return SPACING * ((column - half) + 1j * (row - half))

    def chart(self, z: ArrayLike) -> IntArray:
        """Return the vertices whose charts the parameters z (...) are in; -1 outside all."""
        points = np.asarray(z, complex)
        half = self._columns // 2
        with np.errstate(invalid="ignore"):
            column = np.rint(points.real / SPACING) + half
            row = np.rint(points.imag / SPACING) + half
            inside = (column >= 0) & (column < self._columns) & (row >= 0)
            inside &= row * self._columns + column < self.n_charts
        index = np.where(inside, row * self._columns + column, -1)
        return index.astype(np.int64)

    def parameter_near(self, points: ArrayLike, vertices: ArrayLike) -> ComplexArray:
        """Return the parameters of the feet of points (..., 3) in the charts of vertices (...).

        Raises
        ------
        SurfaceError
            If a foot is not found: the point is far from its vertex.
        """
        target = np.asarray(points, float)
        v = np.broadcast_to(np.asarray(vertices, np.int64), target.shape[:-1])
        frame = self.charts.frame[v, :2]
        gap = (target - self.charts.origin[v]) / self.charts.scale[v][..., None]
        flat = np.einsum("...ij,...j->...i", frame, gap)
        guess = 2.0 * (flat[..., 0] - 1j * flat[..., 1])
        return self.surface.closest_parameter(target, self.parameter_of_vertex(v) + guess)

    def rechart(self, z: ArrayLike) -> ComplexArray:
        """Return parameters of the same points of the surface in the charts nearest to them.

        The points move by what neighbouring charts differ by.

        Raises
        ------
        SurfaceError
            If a parameter is in no chart, or a foot is not found.
        """
        start = np.asarray(z, complex)
        target = self.surface.point(start)
        old = self.chart(start)
        v, best = old, np.full(start.shape, np.inf)
        while True:
            ring = self.near[v]
            away = np.linalg.norm(self.charts.origin[ring] - target[..., None, :], axis=-1)
            pick = away.argmin(axis=-1)[..., None]
            now = np.take_along_axis(away, pick, -1)[..., 0]
            if not (now < best).any():
                break
            v = np.where(now < best, np.take_along_axis(ring, pick, -1)[..., 0], v)
            best = np.minimum(now, best)
        out, moved = start.copy(), v != old
        if moved.any():
            out[moved] = self.parameter_near(target[moved], v[moved])
        return out

    def _split(self, z: ComplexArray) -> tuple[IntArray, ComplexArray]:
        v = self.chart(z)
        zeta = np.where(v >= 0, z - self.parameter_of_vertex(np.maximum(v, 0)), complex(np.nan))
        return v, zeta

    def _gauss(self, z: ComplexArray) -> tuple[ComplexArray, ComplexArray, ComplexArray, IntArray]:
        """Return numerator and denominator of g, the local g' and the charts."""
        v, zeta = self._split(z)
        a = self.charts.coefficients[v]
        g = horner(a, zeta)
        slope = horner(a[..., 1:] * np.arange(1, a.shape[-1]), zeta)
        p, q = self._spinor[v, 0], self._spinor[v, 1]
        # Straight up g is infinite; a huge g does the same without a special case.
        bottom = p.conj() - q.conj() * g
        return p * g + q, np.where(bottom == 0, 1e-100, bottom), slope, v

    @cached_property
    def surface(self) -> MinimalSurface:
        """The atlas as a surface in mm; no curvature coordinates run across its charts."""

        def gauss_map(z: ComplexArray) -> ComplexArray:
            top, bottom, _, _ = self._gauss(z)
            return top / bottom

        def gauss_map_derivative(z: ComplexArray) -> ComplexArray:
            _, bottom, slope, _ = self._gauss(z)
            return slope / bottom**2

        def form(z: ComplexArray) -> ComplexArray:
            _, bottom, _, v = self._gauss(z)
            return self.charts.scale[v] * bottom**2

        def null_curve(z: ComplexArray) -> ComplexArray:
            v, zeta = self._split(z)
            curve = local_curve(self.charts.coefficients[v], zeta)
            curve[..., 2] += self.charts.lift[v]
            turned = np.einsum("...i,...ij->...j", curve, self.charts.frame[v])
            return self.charts.origin[v] + self.charts.scale[v][..., None] * turned

        def no_coordinates(_: ComplexArray) -> ComplexArray:
            raise SurfaceError(
                f"{self.name}: a film on a mesh has no curvature coordinates from one base; use "
                "a lattice that is grown on the surface"
            )

        return MinimalSurface(
            name=self.name,
            gauss_map=gauss_map,
            gauss_map_derivative=gauss_map_derivative,
            form=form,
            null_curve=null_curve,
            base=complex(self.parameter_of_vertex(0)),
            to_curvature=no_coordinates,
            from_curvature=no_coordinates,
        )


def atlas(
    points: FloatArray,
    triangles: IntArray,
    *,
    normals: FloatArray | None = None,
    name: str = "film on a mesh",
    count: int | None = None,
) -> Atlas:
    """Return the atlas of a mesh that stands for a minimal surface.

    Every chart passes through its vertex and is fitted to two rings of vertices around, at borders
    to as many as are needed. Where the vertices lie on a smooth minimal surface, normals are right
    to fifth and the Hopf differential to fourth order in the mesh width. Where they are on none,
    as about re-entrant corners, charts are of lower order.

    Parameters
    ----------
    points : (n, 3) float, in mm
    triangles : (m, 3) int
        Consistently oriented; the surface's normals point to the side from which they are seen
        counter-clockwise.
    normals : (n, 3) float, optional
        Normals of the vertices, by which the frames are set; by areas of triangles without. The
        charts' own normals are found by the fit.
    name : str
    count : int, optional
        Charts only for the first ``count`` vertices; the others are there to be fitted to, as
        mirror images at a free border are.

    Raises
    ------
    SurfaceError
        If a part of the mesh is too small, folded or too coarse.
    """
    points = np.asarray(points, float)
    triangles = np.asarray(triangles, np.int64)
    stencil = stencils(points, triangles, count)
    if normals is None:
        normals = vertex_normals(points, triangles)
    start = start_charts(points, stencil, np.asarray(normals, float))
    found, _ = fit_or_lower(start, points, stencil, through_vertex=True)
    return atlas_of_charts(name, found.charts, stencil)


def atlas_of_charts(name: str, charts: Charts, stencil: Stencils) -> Atlas:
    """Return charts that are fitted already as an atlas."""
    count = len(charts.origin)
    near = np.where(stencil.points < count, stencil.points, np.arange(count)[:, None])
    return Atlas(name, charts, near, _spinors(charts.frame))


def atlas_surface(
    points: FloatArray,
    triangles: IntArray,
    *,
    normals: FloatArray | None = None,
    name: str = "film on a mesh",
) -> MinimalSurface:
    """Return the minimal surface through the vertices of a mesh: `atlas` as a surface.

    Parameters
    ----------
    points : (n, 3) mm
        On a minimal surface, or nearly: vertices of a mesh.
    triangles : (m, 3) int
    normals : (n, 3) unit vectors, optional
    name : str

    Raises
    ------
    MeshError, SurfaceError
        As `atlas`.

    Examples
    --------
    >>> import phexfab as px
    >>> film = px.periodic_film("schwarz-d", cell=1000.0, edge_length=80.0)  # mm
    >>> surface = px.atlas_surface(film.points, film.triangles)
    >>> isinstance(surface, px.MinimalSurface)
    True
    """
    return atlas(points, triangles, normals=normals, name=name).surface


def _spinors(frame: FloatArray) -> ComplexArray:
    """Return (p, q) with g = (p g_local + q) / (p̄ − q̄ g_local), (n, 2), for rows = local axes.

    With N = (2 Re g, 2 Im g, |g|² − 1)/(|g|² + 1) the rotation with quaternion (w, x, y, z) is
    p = w + iz, q = −y + ix.
    """
    # Rotation's matrix takes local to global: its columns are the axes.
    turn = np.swapaxes(frame, -1, -2)
    diagonal = np.einsum("nii->ni", turn)
    trace = diagonal.sum(1)
    # Four ways to the quaternion; the one with the largest pivot is exact to rounding.
    squares = np.column_stack([1 + trace, 1 + 2 * diagonal - trace[:, None]])
    best = squares.argmax(axis=1)
    skew = np.stack(
        [
            turn[:, 2, 1] - turn[:, 1, 2],
            turn[:, 0, 2] - turn[:, 2, 0],
            turn[:, 1, 0] - turn[:, 0, 1],
        ],
        1,
    )
    even = turn + np.swapaxes(turn, -1, -2)
    table = np.empty((len(turn), 4, 4))
    table[:, 0, 0] = squares[:, 0]
    table[:, 0, 1:] = table[:, 1:, 0] = skew
    table[:, 1:, 1:] = even
    table[:, [1, 2, 3], [1, 2, 3]] = squares[:, 1:]
    quaternion = table[np.arange(len(turn)), best]
    w, x, y, z = (quaternion / np.linalg.norm(quaternion, axis=1, keepdims=True)).T
    return np.stack([w + 1j * z, -y + 1j * x], 1)

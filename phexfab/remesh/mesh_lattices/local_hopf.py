"""Q near an umbilic as a polynomial in the tangent plane, its zeros gathered in one place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import dijkstra

from phexfab.errors import MeshError
from phexfab.remesh.mesh_lattices.line_field import NEXT, LineField, chart_hopf, tangent

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class LocalHopf:
    """``Q = G(ζ)·(ζ − c)^m`` in the tangent plane, ζ complex in mm.

    Attributes
    ----------
    origin : (3,) mm
        The point ζ = 0.
    axes : (2, 3)
        Unit vectors of the tangent plane.
    centre : complex
        c, and ``order``, m.
    factor : (d,) complex
        Coefficients of G, the highest power first.
    vertices : (k,) int
        Vertices near by, the nearest to c first, and ``hopf`` (k,): Q that they are to have.
    """

    origin: FloatArray
    axes: FloatArray
    centre: complex
    order: int
    factor: ComplexArray
    vertices: IntArray
    hopf: ComplexArray

    def value(self, points: FloatArray) -> ComplexArray:
        """Return Q at points (k, 3)."""
        zeta = _chart(points, self.origin, self.axes)
        return np.asarray(np.polyval(self.factor, zeta) * (zeta - self.centre) ** self.order)

    def lines(self, hopf: ComplexArray) -> FloatArray:
        """Return (k, 3) directions of the u-lines where Q has these values."""
        turned = np.exp(-0.5j * np.angle(hopf))
        return np.asarray(turned.real[:, None] * self.axes[0] + turned.imag[:, None] * self.axes[1])

    @property
    def place(self) -> FloatArray:
        """(3,) the point ζ = c, mm."""
        return np.asarray(
            self.origin + self.centre.real * self.axes[0] + self.centre.imag * self.axes[1]
        )


def _chart(points: FloatArray, origin: FloatArray, axes: FloatArray) -> ComplexArray:
    local = (points - origin) @ axes.T
    return np.asarray(local[..., 0] + 1j * local[..., 1])


def local_hopf(
    field: LineField, lengths: sp.csr_matrix, members: IntArray, zeros: FloatArray, order: int
) -> LocalHopf:
    """Fit Q around triangles that hold zeros of a total order.

    Parameters
    ----------
    field : LineField
    lengths : (n, n) sparse
        Lengths of the mesh's edges.
    members : (k,) int
        Triangles.
    zeros : (k, 3)
        Places of the zeros in them, mm.
    order : int

    Raises
    ------
    MeshError
        If the mesh has too few vertices there.
    """
    corners = np.unique(field.triangles[members])
    normal = field.normals[corners].mean(axis=0)[None]
    normal /= np.linalg.norm(normal)
    first = tangent(np.eye(3)[[int(np.abs(normal).argmin())]], normal)[0]
    axes = np.stack([first, np.cross(normal[0], first)])
    origin = zeros.mean(axis=0)
    own = field.points[field.triangles[members]]
    mesh_size = float(np.linalg.norm(own - own[:, NEXT], axis=2).mean())
    spread = float(np.linalg.norm(own - origin, axis=2).max())
    reach = 2 * spread + 3 * mesh_size
    distance = dijkstra(lengths, indices=corners, limit=reach, min_only=True)
    near = np.flatnonzero(np.isfinite(distance))
    zeta = _chart(field.points[near], origin, axes)
    q = chart_hopf(field, near, axes[0], axes[1])
    inside = np.abs(zeta) <= reach
    powers = np.arange(order + 1, -1, -1)
    if inside.sum() < 2 * len(powers):
        raise MeshError(
            f"the mesh is too coarse at the umbilic of order {order} near "
            f"({origin[0]:.1f}, {origin[1]:.1f}, {origin[2]:.1f}) mm: refine it there"
        )
    fitted = np.linalg.lstsq((zeta[inside, None] / reach) ** powers, q[inside], rcond=None)[0]
    roots = np.roots(fitted) * reach
    roots = roots[np.argsort(np.abs(roots))][:order]
    if order and (len(roots) < order or np.abs(roots).max() > spread + mesh_size):
        # A fit of values that vary too much has its zeros elsewhere: take those that were found.
        roots = np.zeros(order, complex)
        table = (zeta[inside, None] / reach) ** powers[:2]
        lead = np.linalg.lstsq(table, q[inside], rcond=None)[0]
        fitted = np.concatenate([lead, np.zeros(order)])
    centre = complex(roots.mean()) if order else 0j
    if np.abs(roots - centre).max(initial=0.0) > mesh_size / 2:
        # Several zeros made one: its place is free, and best resolved around a vertex.
        inner_ones = ~field.on_border[near]
        if inner_ones.any():
            free = zeta[inner_ones]
            centre = complex(free[np.abs(free - centre).argmin()])
    factor = fitted / reach**powers
    factor = np.polydiv(factor, np.poly(roots))[0] if order else factor

    # The polynomial where the zeros are, what is given far away; between them Q as given with
    # its zeros moved.
    inner = float(np.abs(roots - centre).max(initial=0.0)) + 1.5 * mesh_size
    order_by = np.argsort(np.abs(zeta - centre), kind="stable")
    order_by = order_by[np.abs(zeta - centre)[order_by] < 2 * inner]
    zeta, near, q = zeta[order_by], near[order_by], q[order_by]
    radius = np.abs(zeta - centre)
    blend = np.clip(2 - radius / inner, 0.0, 1.0)
    blend = blend * blend * (3 - 2 * blend)
    away = np.prod(zeta[:, None] - roots, axis=1) if order else np.ones(len(zeta), complex)
    ratio = (zeta - centre) ** order / np.where(away == 0, 1.0, away)
    model = np.polyval(factor, zeta) * (zeta - centre) ** order
    hopf = np.where(radius < inner, model, q * (1 + blend * (ratio - 1)))
    return LocalHopf(origin, axes, centre, order, np.asarray(factor), near, hopf)

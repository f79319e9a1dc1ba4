"""Triangles and planar quadrilaterals on a smooth surface, to compare hexagons with.

Both fill a rectangle of curvature-line coordinates with cells that are congruent there, so that at
an equal number of panels they cover the same area with panels of the same mean size.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import LatticeError, MeshError, SolveError
from phexfab.linalg import factorise
from phexfab.mesh.measures import mean_edge, planarity
from phexfab.mesh.polymesh import PolyMesh
from phexfab.surface.weierstrass import MinimalSurface, Rectangle
from phexfab.triangular import EQUILATERAL

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]

_REACH = 4  # numbers of rows tried on either side of the one that would give regular cells
_ASPECT = 0.2  # what a cell off its regular shape counts against panels more or less than asked


@dataclass(frozen=True, eq=False)
class Paneling:
    """A mesh that covers a part of a smooth surface.

    Attributes
    ----------
    mesh : PolyMesh
        Corners counter-clockwise about the surface's normal, mm.
    parameters : (V,) complex
        The surface's parameter z at, or near the foot of, each vertex.
    """

    mesh: PolyMesh
    parameters: ComplexArray


def covered_rectangle(
    surface: MinimalSurface, rectangle: Rectangle, area: float, *, closed: bool = False
) -> Rectangle:
    """Return the rectangle, drawn in from its open sides, over which the surface has an area.

    A shell of whole hexagons does not reach the border of its rectangle of parameters; this is
    what it covers, in size.

    Parameters
    ----------
    surface : MinimalSurface
    rectangle : (u0, u1, v0, v1)
        In curvature-line coordinates.
    area : float
        mm².
    closed : bool
        Keep the whole period of the surface.

    Raises
    ------
    LatticeError
        If the area is not positive, or the surface does not close.

    Notes
    -----
    Never more than the rectangle itself: beyond it the surface may be singular.
    """
    across = _closed_direction(surface) if closed else ""
    u0, u1, v0, v1 = rectangle
    widths = ([] if across == "u" else [u1 - u0]) + ([] if across == "v" else [v1 - v0])

    def drawn_in(margin: float) -> Rectangle:
        u, v = (0.0 if across == way else margin for way in "uv")
        return u0 + u, u1 - u, v0 + v, v1 - v

    if not area > 0:
        raise LatticeError(f"an area of {area:g} mm² was asked for; it must be positive")
    if area >= _smooth_area(surface, rectangle):
        return rectangle
    low, high = 0.0, min(widths) / 2  # the area falls steadily with the margin
    for _ in range(48):
        middle = (low + high) / 2
        if _smooth_area(surface, drawn_in(middle)) > area:
            low = middle
        else:
            high = middle
    return drawn_in((low + high) / 2)


def triangle_paneling(
    surface: MinimalSurface,
    rectangle: Rectangle,
    count: int,
    *,
    rows_along: str = "u",
    closed: bool = False,
) -> Paneling:
    """Return a mesh of about ``count`` triangles with all vertices on the surface.

    Rows of triangles that are equilateral in curvature-line coordinates, as nearly as whole
    numbers allow; six meet at every inner vertex. The zigzag ends of the rows stand out of the
    rectangle as far as they stand back from it.

    Parameters
    ----------
    surface : MinimalSurface
    rectangle : (u0, u1, v0, v1)
        In curvature-line coordinates.
    count : int
    rows_along : ``"u"`` or ``"v"``
    closed : bool
        Close the mesh under the surface's period.

    Raises
    ------
    LatticeError
        If the count is below 2, or the surface does not close.

    References
    ----------
    Thesis ch. 3.
    """
    around = _closed_direction(surface) if closed else ""
    along, width, height, centre = _box(rectangle, rows_along)
    loop, stack = around == rows_along, around not in ("", rows_along)
    trim = 0 if loop else 1

    def columns(panels: float, rows: int) -> float:
        return (panels / rows + trim) / 2

    n, m = _grid(
        width,
        height,
        count,
        EQUILATERAL,
        2,
        columns,
        lambda n, m: m * (2 * n - trim),
        step=2 if stack else 1,
        fewest=3 if loop else 1,
    )
    dx, dy = width / (n - trim / 2), height / m
    rows = m if stack else m + 1
    i, j = np.meshgrid(np.arange(n + trim), np.arange(rows))
    here = centre + along * (
        (i + 0.5 * (j % 2) - (n - trim / 2) / 2 - trim / 4) * dx + 1j * (j - m / 2) * dy
    )
    faces = []
    for r in range(m):
        low, high, odd = r, (r + 1) % rows, r % 2
        k = np.arange(n + trim)
        if loop:
            right = (k + 1) % n
            up = [(low, k), (low, right), (high, right if odd else k)]
            down = [(high, right), (high, k), (low, k if odd else right)]
        else:
            # Even rows have n + 1 points, odd rows n.
            lower = k[: n - odd]
            upper = k[: n - 1 + odd]
            up = [(low, lower), (low, lower + 1), (high, lower + odd)]
            down = [(high, upper + 1), (high, upper), (low, upper + 1 - odd)]
        for corner in (up, down):
            faces.append(np.column_stack([row * (n + trim) + column for row, column in corner]))
    return _on_surface(surface, here.ravel(), np.concatenate(faces))


def quad_paneling(
    surface: MinimalSurface, rectangle: Rectangle, count: int, *, closed: bool = False
) -> Paneling:
    """Return a mesh of about ``count`` planar quadrilaterals near the surface.

    Lines of principal curvature in square cells of isothermic coordinates are planar to second
    order; the vertices then move as little as makes every quadrilateral planar to rounding.

    Parameters
    ----------
    surface : MinimalSurface
    rectangle : (u0, u1, v0, v1)
        In curvature-line coordinates.
    count : int
    closed : bool
        Close the mesh under the surface's period.

    Raises
    ------
    LatticeError
        If the count is below 1, or the surface does not close.
    SolveError
        If the quadrilaterals cannot be made planar.

    References
    ----------
    Thesis ch. 3; Liu, Pottmann, Wallner, Yang, Wang 2006, "Geometric modeling with conical meshes
    and developable surfaces".
    """
    around = _closed_direction(surface) if closed else ""
    along, width, height, centre = _box(rectangle, around or "u")  # rows go around
    n, m = _grid(
        width,
        height,
        count,
        1.0,
        1,
        lambda panels, rows: panels / rows,
        lambda n, m: n * m,
        fewest=3 if around else 1,
    )
    wide = n if around else n + 1
    i, j = np.meshgrid(np.arange(wide), np.arange(m + 1))
    here = centre + along * ((i - n / 2) * width / n + 1j * (j - m / 2) * height / m)
    k, r = (axis.ravel() for axis in np.meshgrid(np.arange(n), np.arange(m)))
    right = (k + 1) % wide
    faces = np.column_stack(
        [r * wide + k, r * wide + right, (r + 1) * wide + right, (r + 1) * wide + k]
    )
    raw = _on_surface(surface, here.ravel(), faces)
    return Paneling(planar_quads(raw.mesh), raw.parameters)


def planar_quads(mesh: PolyMesh, *, rounds: int = 30) -> PolyMesh:
    """Return the nearest mesh whose quadrilaterals are planar.

    Minimises Σ|x − x₀|² under det(b−a, c−a, d−a) = 0 of every face by Gauss–Newton: each step
    solves the linearised conditions for the point nearest to the given mesh.

    Parameters
    ----------
    mesh : PolyMesh
        Quadrilaterals only, nearly planar.
    rounds : int
        Steps at most; a handful does from a curvature-line mesh.

    Raises
    ------
    MeshError
        If a face is no quadrilateral.
    SolveError
        If faces stay further than 1e-12 of the mean edge from their planes.
    """
    if mesh.n_faces and not (mesh.sides == 4).all():
        odd = int(np.flatnonzero(mesh.sides != 4)[0])
        raise MeshError(f"face {odd} has {mesh.sides[odd]} corners; only quadrilaterals will do")
    unit = mean_edge(mesh)
    start = mesh.vertices / unit
    quads = mesh.corners.reshape(-1, 4)
    columns = (3 * quads[:, :, None] + np.arange(3)).reshape(-1, 12)
    rows = np.repeat(np.arange(len(quads)), 12)
    best, least = mesh, float(planarity(mesh).max()) / unit
    x, stalled = start, 0
    for _ in range(rounds):
        a, b, c, d = (x[quads[:, k]] for k in range(4))
        at_b, at_c, at_d = (np.cross(p - a, q - a) for p, q in ((c, d), (d, b), (b, c)))
        volume = np.einsum("ij,ij->i", b - a, at_b)
        slopes = np.hstack([-(at_b + at_c + at_d), at_b, at_c, at_d])
        jacobian = sp.csr_matrix(
            (slopes.ravel(), (rows, columns.ravel())), shape=(len(quads), x.size)
        )
        back = (start - x).ravel()
        force = factorise((jacobian @ jacobian.T).tocsc()).solve(volume + jacobian @ back)
        x = x + (back - jacobian.T @ force).reshape(-1, 3)
        moved = PolyMesh(x * unit, mesh.corners, mesh.starts)
        off = float(planarity(moved).max()) / unit
        stalled = 0 if off < least / 2 else stalled + 1
        if off < least:
            best, least = moved, off
        if stalled == 2:
            break
    if not least <= 1e-12:
        raise SolveError(
            f"the quadrilaterals stay {least:.1e} of their edges off their planes: choose smaller "
            "panels"
        )
    return best


def _smooth_area(surface: MinimalSurface, rectangle: Rectangle) -> float:
    """Return the area of the surface over a rectangle of curvature-line coordinates, mm²."""
    node, weight = np.polynomial.legendre.leggauss(24)
    u0, u1, v0, v1 = rectangle
    u, v = (u0 + u1 + (u1 - u0) * node) / 2, (v0 + v1 + (v1 - v0) * node) / 2
    z = surface.parameter(u[:, None] + 1j * v)
    density = surface.conformal_factor(z) ** 2 / np.abs(surface.hopf(z))  # ds²/|dw|²
    return float(weight @ density @ weight) * (u1 - u0) * (v1 - v0) / 4


def _closed_direction(surface: MinimalSurface) -> str:
    if surface.period is None:
        raise LatticeError(f"{surface.name} does not close; give a range of parameters")
    return "v" if abs(surface.period.imag) > abs(surface.period.real) else "u"


def _box(rectangle: Rectangle, rows_along: str) -> tuple[complex, float, float, complex]:
    """Return the rows' direction, length along and across them, and the centre."""
    if rows_along not in ("u", "v"):
        raise LatticeError(f"rows_along = {rows_along!r}: choose 'u' or 'v'")
    u0, u1, v0, v1 = rectangle
    if not (u1 > u0 and v1 > v0):
        raise LatticeError(f"the rectangle u = [{u0}, {u1}], v = [{v0}, {v1}] is empty")
    centre = complex((u0 + u1) / 2, (v0 + v1) / 2)
    if rows_along == "u":
        return 1.0, u1 - u0, v1 - v0, centre
    return 1j, v1 - v0, u1 - u0, centre


def _grid(
    width: float,
    height: float,
    count: int,
    ratio: float,
    per_cell: int,
    columns: Callable[[float, int], float],
    panels: Callable[[int, int], int],
    *,
    step: int = 1,
    fewest: int = 1,
) -> tuple[int, int]:
    """Return the numbers of columns and rows that come nearest to count and regular cells.

    ``ratio`` is the regular cell's height over its width, ``step`` divides the number of rows.
    """
    if count < per_cell:
        raise LatticeError(f"{count} panels were asked for; ask for {per_cell} at least")
    cell = np.sqrt(width * height * per_cell / count / ratio)
    near = max(1, round(height / (cell * ratio * step)))
    best, least = (fewest, step), np.inf
    for rows in range(max(1, near - _REACH) * step, (near + _REACH) * step + 1, step):
        exact = columns(count, rows)
        for n in {max(fewest, int(np.floor(exact))), max(fewest, int(np.ceil(exact)))}:
            shape = (height / rows) / (width / exact) / ratio
            cost = abs(np.log(panels(n, rows) / count)) + _ASPECT * abs(np.log(shape))
            if cost < least:
                best, least = (n, rows), cost
    return best


def _on_surface(surface: MinimalSurface, w: ComplexArray, faces: IntArray) -> Paneling:
    """Return the mesh of the points that faces use, in order."""
    used, index = np.unique(faces, return_inverse=True)
    z = surface.parameter(w[used])
    sides = faces.shape[1]
    starts = np.arange(0, faces.size + 1, sides, dtype=np.int64)
    corners = index.reshape(-1).astype(np.int64)
    return Paneling(PolyMesh(surface.point(z), corners, starts), z)

"""The triangular lattice in curvature-line coordinates, whose points become panels.

Rows run along a principal direction, every other row shifted by half a step, so that the dual
hexagons are valid on a surface of negative curvature (thesis §5.1.3, Dupin duality). Distances
here are in curvature-line coordinates w = u + iv; on the surface a step is ``step/√κ`` long.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import LatticeError
from phexfab.triangular import ASYMPTOTIC_MARGIN, EQUILATERAL, asymptotic_gap, mean_distance

IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class Lattice:
    """Lattice points and their triangles.

    Attributes
    ----------
    points : (F,) complex
        Curvature-line coordinates of the points; those on the border trim the border panels.
    triangles : (V, 3) int
        Counter-clockwise; each holds at least one point with a closed ring, a panel.
    upward : (V,) bool
        True where the triangle's first edge lies in a row and its apex above; else its second
        edge lies in the row above its first point.
    step, row_ratio : float
        Distance of neighbours in a row; distance of rows divided by it.
    closed : bool
        True when the lattice closes up around the surface's period.
    parameters : (F,) complex or None
        The surface's parameters z of the points where they are known already: a lattice that is
        grown on a film, where w is no global coordinate and ``points`` are these parameters.
    density : (F,) float or None
        ``|dw̃/dw|``, where the lattice is regular in w̃ rather than in w itself; None for 1.

    Examples
    --------
    >>> import phexfab as px
    >>> on = px.lattice_on(px.minimal_surface("scherk-1").scaled(2000.0), panel_size=500.0)
    >>> len(on.points), len(on.triangles), on.closed
    (259, 457, False)
    """

    points: ComplexArray
    triangles: IntArray
    upward: NDArray[np.bool_]
    step: float
    row_ratio: float
    closed: bool = False
    parameters: ComplexArray | None = None
    density: NDArray[np.float64] | None = None

    @property
    def neighbour_distance(self) -> float:
        """Mean distance of neighbouring points."""
        return self.step * mean_distance(self.row_ratio)


def check_directions(row_ratio: float, turn: float) -> None:
    """Refuse a lattice one of whose edge families meets an asymptotic direction.

    On a surface of negative curvature the dual hexagon is valid when one or two of the three
    lattice directions lie in the sector around the first principal direction that the asymptotic
    directions (at ±45°) bound, and none on its border, where edges vanish (thesis §5.1.3).

    Parameters
    ----------
    row_ratio : float
        Row distance divided by the step.
    turn : float
        Degrees by which rows are turned off the principal direction.

    Raises
    ------
    LatticeError
    """
    near, inside = asymptotic_gap(row_ratio, turn)
    if near < ASYMPTOTIC_MARGIN or inside not in (1, 2):
        raise LatticeError(
            f"lattice.turn = {turn:g}°, lattice.row_ratio = {row_ratio:g}: an edge family runs "
            f"{near:.1f}° from an asymptotic direction, where panel edges vanish; keep turn near "
            f"0° and row_ratio above 0.5 (0.866 is equilateral)"
        )


def lattice(
    rectangle: tuple[float, float, float, float],
    step: float,
    *,
    row_ratio: float = EQUILATERAL,
    rows_along: str = "u",
    turn: float = 0.0,
    period: complex | None = None,
) -> Lattice:
    """Return the lattice whose outermost points lie inside or on a rectangle of parameters.

    Parameters
    ----------
    rectangle : (u0, u1, v0, v1)
    step : float
        Distance of neighbours in a row; where ``period`` is given it is adjusted so that a whole
        number of panels goes around.
    row_ratio : float
        Row distance / step, above 0.5.
    rows_along : ``"u"`` or ``"v"``
    turn : float
        Degrees by which the rows are turned off that direction.
    period : complex, optional
        Close the lattice under w → w + period, parallel to the u- or the v-axis.

    Raises
    ------
    LatticeError
        If a lattice direction is asymptotic, the rectangle is too small for one panel, or the
        lattice is turned although it has to close.

    References
    ----------
    Thesis §5.1.3; Wang, Liu et al. 2008, "Hexagonal meshes with planar faces".

    Examples
    --------
    >>> import phexfab as px
    >>> on = px.lattice((-1, 1, -1, 1), step=0.4)
    >>> len(on.points), len(on.triangles)
    (31, 43)
    >>> px.lattice((-1, 1, -1, 1), step=0.4, row_ratio=0.4)
    Traceback (most recent call last):
        ...
    phexfab.errors.LatticeError: lattice.turn = 0°, lattice.row_ratio = 0.4: an edge family runs
        6.3° from an asymptotic direction, where panel edges vanish; keep turn near 0° and row_ratio
        above 0.5 (0.866 is equilateral)
    """
    if rows_along not in ("u", "v"):
        raise LatticeError(f"lattice.rows_along = {rows_along!r}: choose 'u' or 'v'")
    if not (np.isfinite(step) and step > 0):
        raise LatticeError(f"the lattice step is {step}; it must be a positive number")
    check_directions(row_ratio, turn)
    u0, u1, v0, v1 = rectangle
    if not (u1 > u0 and v1 > v0):
        raise LatticeError(f"the rectangle u = [{u0}, {u1}], v = [{v0}, {v1}] is empty")
    along = 1j if rows_along == "v" else 1.0
    spin = along * np.exp(1j * np.radians(turn))
    centre = complex((u0 + u1) / 2, (v0 + v1) / 2)
    half = np.array([u1 - u0, v1 - v0]) / 2

    columns = rows = 0
    if period is not None:
        if turn:
            raise LatticeError(
                f"lattice.turn = {turn:g}°: a lattice that closes cannot be turned; set turn = 0"
            )
        size = abs(period)
        if abs((period / along).imag) < 1e-12 * size:  # rows go around
            columns = max(3, round(size / step))
            step = size / columns
        elif abs((period / along).real) < 1e-12 * size:  # rows are stacked around
            rows = max(4, 2 * round(size / (2 * row_ratio * step)))
            step = size / (rows * row_ratio)
        else:
            raise LatticeError("the surface's period is not parallel to a principal direction")

    rise = step * row_ratio
    reach = float(np.hypot(*half))
    extent = half[::-1] if rows_along == "v" else half
    if turn:
        n_col, n_row = int(reach / step) + 2, int(reach / rise) + 2
        t0 = s0 = 0.0
    else:  # centre the rows, and the points of the longer rows, in the rectangle
        fit = 1 + 1e-9
        wide = int(2 * extent[0] / step * fit) % 2
        n_col = int(extent[0] / step * fit) + 2
        high = int(2 * extent[1] / rise * fit)
        n_row = high // 2 + 2
        t0 = step / 2 * wide
        s0 = rise / 2 * (high % 2)
    i = np.arange(columns) if columns else np.arange(-n_col, n_col + 1)
    j = np.arange(rows) if rows else np.arange(-n_row, n_row + 1)
    jj, ii = np.meshgrid(j, i, indexing="ij")
    shift = np.mod(jj, 2)
    t = (ii + 0.5 * shift) * step + (0.0 if columns else t0)
    s = jj * rise + (0.0 if rows else s0)
    local = spin * (t + 1j * s)
    points = (centre + local).ravel()

    slack = 1e-9 * step
    inside = np.ones(len(points), bool)
    if not (period is not None and abs(period.real) > 0):
        inside &= np.abs((points - centre).real) <= half[0] + slack
    if not (period is not None and abs(period.imag) > 0):
        inside &= np.abs((points - centre).imag) <= half[1] + slack

    triangles, upward = _grid_triangles(len(j), len(i), np.mod(j, 2), bool(rows), bool(columns))
    keep = inside[triangles].all(axis=1)
    triangles, upward = triangles[keep], upward[keep]
    # Keep what touches a panel: a point all of whose six triangles are there.
    valence = np.bincount(triangles.ravel(), minlength=len(points))
    keep = (valence[triangles] == 6).any(axis=1)
    triangles, upward = triangles[keep], upward[keep]
    if not len(triangles):
        raise LatticeError(
            f"no panel fits the rectangle u = [{u0:g}, {u1:g}], v = [{v0:g}, {v1:g}] at a lattice "
            f"step of {step:.3g}: choose a smaller lattice.panel_size or a larger rectangle"
        )
    used = np.unique(triangles)
    return Lattice(
        points[used],
        np.searchsorted(used, triangles),
        upward,
        step,
        row_ratio,
        period is not None,
    )


def _grid_triangles(
    n_rows: int, n_cols: int, odd: IntArray, wrap_rows: bool, wrap_cols: bool
) -> tuple[IntArray, NDArray[np.bool_]]:
    """Return both triangles above every lattice point, where all their points exist."""
    jj, ii = np.meshgrid(np.arange(n_rows), np.arange(n_cols), indexing="ij")
    shift = odd[jj]
    # upward: (i,j), (i+1,j), apex (i+shift, j+1); downward: (i,j), (i+shift, j+1), (i+shift-1, j+1)
    corners = [
        [(ii, jj), (ii + 1, jj), (ii + shift, jj + 1)],
        [(ii, jj), (ii + shift, jj + 1), (ii + shift - 1, jj + 1)],
    ]
    found = []
    for triangle in corners:
        index, valid = [], np.ones(jj.shape, bool)
        for column, row in triangle:
            if wrap_cols:
                column = column % n_cols
            if wrap_rows:
                row = row % n_rows
            valid &= (column >= 0) & (column < n_cols) & (row < n_rows)
            index.append(row * n_cols + column)
        found.append(np.stack(index, -1)[valid])
    upward = np.repeat([True, False], [len(found[0]), len(found[1])])
    return np.concatenate(found), upward

"""Valid triangulations: regular triangle meshes on a surface whose dual hexagons do not cross.

Layer by layer from a first row: over every edge an apex on the line through its middle that is
conjugate to it. *Progressive conjugation* lets each row be what the ideal triangles below it make
of it; *pre-specified conjugation* follows a given field of row directions with even layers.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import LatticeError
from phexfab.remesh.dupin.duality import validity
from phexfab.remesh.triangulations.crowd import Crowd
from phexfab.remesh.triangulations.fields import Directions, smooth_rows
from phexfab.remesh.triangulations.march import Layering, extended, kept, next_rows
from phexfab.remesh.triangulations.seed import Row, first_row
from phexfab.surface.freeform.surface import FreeformSurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MOST_LAYERS = 2000
LONGEST = 3.5  # edge of a triangle, over the step
APART = 0.55  # least distance from points of other layers, over the step


@dataclass(frozen=True, eq=False)
class Triangulation:
    """A regular triangle mesh on a surface.

    Attributes
    ----------
    surface : FreeformSurface
    parameters : (n, 2) or (n, 3) float
    points : (n, 3) float
    triangles : (m, 3) int
        Counter-clockwise about the surface's normal.
    rows, columns : (n,) int
        Where each point is: neighbours in a row differ by one column; the apex over columns j and
        j + 1 of row i has column j in row i + 1.
    """

    surface: FreeformSurface
    parameters: FloatArray
    points: FloatArray
    triangles: IntArray
    rows: IntArray
    columns: IntArray

    def margins(self) -> FloatArray:
        """Return (m,) validity margins at the triangles' centroids: positive valid, 1 ideal."""
        corner = self.points[self.triangles]
        guess = self.parameters[self.triangles[:, 0]]
        bending = self.surface.bending(self.surface.nearest(corner.mean(axis=1), guess))
        gap = corner - corner.mean(axis=1, keepdims=True)
        flat = np.einsum("mij,mkj->mki", bending.directions, gap)
        return validity(flat, bending.kappa)


def progressive_conjugation(
    surface: FreeformSurface,
    step: float,
    *,
    start: ArrayLike | None = None,
    rows: Directions | None = None,
    layers: tuple[int, int] | None = None,
    bounds: tuple[float, float] = (0.55, 1.8),
) -> Triangulation:
    """Triangulate by progressive conjugation: ideal triangles, whatever rows they make.

    Parameters
    ----------
    surface : FreeformSurface
    step : float
        Edge length of the first row, mm.
    start : parameter, optional
        A point of the first row; the middle of the surface without it.
    rows : Directions, optional
        Directions that the first row follows; ``smooth_rows(surface)`` without it.
    layers : (left, right), optional
        How many layers to build; to the border without it.
    bounds : (low, high)
        Heights of triangles, over those of equilateral ones on their edge.

    Raises
    ------
    LatticeError
        If the start is not inside, or fewer than one whole star of triangles fits.

    References
    ----------
    Thesis §5.1.4; Wang et al. 2008, "Hexagonal meshes with planar faces".
    """
    how = Layering(_checked(step), *bounds)
    field = rows or smooth_rows(surface)
    return _layers(surface, how, field, start, layers)


def prespecified_conjugation(
    surface: FreeformSurface,
    step: float,
    *,
    rows: Directions | None = None,
    start: ArrayLike | None = None,
    layers: tuple[int, int] | None = None,
    bounds: tuple[float, float] = (0.55, 1.8),
    hold: float = 0.15,
) -> Triangulation:
    """Triangulate by pre-specified conjugation: rows follow a field, layers their conjugates.

    Parameters
    ----------
    surface : FreeformSurface
    step : float
        Edge length of the first row, mm.
    rows : Directions, optional
        The row field; ``smooth_rows(surface)`` without it. Across parabolic curves it must be
        near the flat principal direction.
    start, layers, bounds
        As for ``progressive_conjugation``.
    hold : float
        Weight of the wish for ideal heights against following the field.

    Raises
    ------
    LatticeError
        If the start is not inside, or fewer than one whole star of triangles fits.

    References
    ----------
    Thesis §5.1.4; Wang et al. 2008.
    """
    field = rows or smooth_rows(surface)
    how = Layering(_checked(step), *bounds, follow=field, hold=hold)
    return _layers(surface, how, field, start, layers)


def _checked(step: float) -> float:
    if not (np.isfinite(step) and step > 0):
        raise LatticeError(f"step = {step}: a length in mm above 0 is needed")
    return float(step)


def middle_of(surface: FreeformSurface) -> FloatArray:
    """Return the middle of the domain, or the seed point nearest to the middle of the seeds."""
    if surface.domain is not None:
        u0, u1, v0, v1 = surface.domain
        return np.array([0.5 * (u0 + u1), 0.5 * (v0 + v1)])
    u = surface.seeds(900)
    x = surface.point(u)
    return np.asarray(u[((x - x.mean(axis=0)) ** 2).sum(1).argmin()])


def _layers(
    surface: FreeformSurface,
    how: Layering,
    field: Directions,
    start: ArrayLike | None,
    layers: tuple[int, int] | None,
) -> Triangulation:
    begin = middle_of(surface) if start is None else np.asarray(start, float)
    seed = first_row(surface, field, begin, how.step)
    made: dict[int, list[Row]] = {0: [seed]}
    crowd = Crowd()
    for side, limit in zip((1, -1), layers or (MOST_LAYERS, MOST_LAYERS), strict=True):
        now = [seed]
        for k in range(1, limit + 1):
            # Right of a row the apex over columns j, j + 1 has column j + 1.
            fresh = [piece for row in now for piece in next_rows(surface, row, side, how)]
            if side < 0:
                fresh = [replace(p, columns=p.columns + 1) for p in fresh]
            # The layer before has not yet joined the crowd: its points are neighbours.
            fresh = [part for p in fresh for part in kept(p, ~crowd.near(p.x, APART * how.step))]
            period = len(seed.x) if seed.closed else 0
            grown = list(fresh)
            for at, piece in enumerate(fresh):
                grown[at] = extended(surface, piece, how, grown, at, now, crowd, period)
            if k > 1 or side < 0:
                crowd.add([row.x for row in now])
            now = [p for p in grown if len(p.x) > 1 or p.closed]
            if not now:
                break
            made[side * k] = now
        crowd.add([row.x for row in now])
        if side == 1:
            crowd.add([seed.x])
    return _assembled(surface, made, seed, how.step)


def _assembled(
    surface: FreeformSurface, made: dict[int, list[Row]], seed: Row, step: float
) -> Triangulation:
    period = len(seed.x) if seed.closed else 0
    number: dict[tuple[int, int], int] = {}
    u: list[FloatArray] = []
    x: list[FloatArray] = []
    rows: list[int] = []
    columns: list[int] = []
    joined: set[tuple[int, int]] = set()  # (row, column) whose edge to the next column exists
    for r in sorted(made):
        for piece in made[r]:
            for k, column in enumerate(piece.columns.tolist()):
                at = column % period if period else column
                number[r, at] = len(u)
                u.append(piece.u[k])
                x.append(piece.x[k])
                rows.append(r)
                columns.append(at)
                if k + 1 < len(piece.columns) or piece.closed:
                    joined.add((r, at))
    triangles = []
    for r, c in sorted(joined):
        after = (c + 1) % period if period else c + 1
        a, b = number[r, c], number[r, after]
        apex = number.get((r + 1, c))
        if apex is not None:
            triangles.append((a, b, apex))
        foot = number.get((r - 1, after))
        if foot is not None:
            triangles.append((a, foot, b))
    parameters, points = np.array(u), np.array(x)
    corners = np.array(triangles, np.int64).reshape(-1, 3)
    corner = points[corners]
    edge = np.roll(corner, -1, axis=1) - corner
    # Pieces of rows that came to neighbouring columns by chance are no neighbours; nothing folds.
    sound = np.linalg.norm(edge, axis=2).max(axis=1) < LONGEST * step
    normals = surface.normal(parameters)[corners].mean(axis=1)
    sound &= (np.cross(edge[:, 0], edge[:, 1]) * normals).sum(1) > 0
    corners = corners[sound]
    if not len(corners):
        raise LatticeError(f"{surface.name}: no triangle fits; take a smaller step")
    used, slots = np.unique(corners, return_inverse=True)
    return Triangulation(
        surface,
        parameters[used],
        points[used],
        slots.reshape(-1, 3),
        np.array(rows, np.int64)[used],
        np.array(columns, np.int64)[used],
    )

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
from phexfab.remesh.triangulations.march import HOLD, Layering, extended, kept, next_rows
from phexfab.remesh.triangulations.seed import Row, first_row
from phexfab.surface.freeform.surface import FreeformSurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MOST_LAYERS = 2000
FRONTS = 24
BARE = 1.3  # distance from points, over the step, at which a further front may begin
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
        j + 1 of row i has column j in row i + 1. Rows of different fronts have different numbers.
    fronts : (n,) int
        The front that each point belongs to, from 0. Fronts have no triangle in common.
    """

    surface: FreeformSurface
    parameters: FloatArray
    points: FloatArray
    triangles: IntArray
    rows: IntArray
    columns: IntArray
    fronts: IntArray

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
    hold: float = HOLD,
    fronts: int = FRONTS,
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
    hold : float
        Weight of the wish for ideal heights against even layers. With 1 triangles are as ideal as
        may be, and rows tear sooner where curvature varies along them.
    fronts : int
        How many may begin, each in the midst of the widest part that those before left bare: where
        layers converge, or beside a singularity of the row field. With 1 the mesh is in one piece,
        and with ``layers`` given there is one only.

    Raises
    ------
    LatticeError
        If the start is not inside, or fewer than one whole star of triangles fits.

    References
    ----------
    Thesis §5.1.4; Wang et al. 2008, "Hexagonal meshes with planar faces".
    """
    how = Layering(_checked(step), *bounds, hold=hold)
    field = rows or smooth_rows(surface)
    return _triangulated(surface, how, field, start, layers, fronts)


def prespecified_conjugation(
    surface: FreeformSurface,
    step: float,
    *,
    rows: Directions | None = None,
    start: ArrayLike | None = None,
    layers: tuple[int, int] | None = None,
    bounds: tuple[float, float] = (0.55, 1.8),
    hold: float = HOLD,
    fronts: int = FRONTS,
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
    start, layers, bounds, fronts
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
    return _triangulated(surface, how, field, start, layers, fronts)


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


def _triangulated(
    surface: FreeformSurface,
    how: Layering,
    field: Directions,
    start: ArrayLike | None,
    layers: tuple[int, int] | None,
    fronts: int,
) -> Triangulation:
    """Lay fronts of layers, each beginning in the midst of what is left bare."""
    begin = middle_of(surface) if start is None else np.asarray(start, float)
    crowd = Crowd()
    seed = first_row(surface, field, begin, how.step)
    made = [_assembled(surface, _front(surface, how, seed, crowd, layers), seed, how.step)]
    if layers is None and fronts > 1:
        count = int(np.clip(4 * len(made[0].points), 400, 8000))
        seeds = surface.seeds(count)
        places = surface.point(seeds)
        bare = np.ones(len(seeds), bool)
        while len(made) < fronts:
            away = np.where(bare, crowd.away(places), 0.0)
            at = int(away.argmax())
            if away[at] < BARE * how.step:
                break
            # Whether a front fits here or not, none begins beside this place again.
            bare &= np.linalg.norm(places - places[at], axis=1) > 0.8 * away[at]
            more = _further(surface, how, field, seeds[at], crowd)
            if more is not None:
                made.append(more)
    return _united(surface, made)


def _further(
    surface: FreeformSurface, how: Layering, field: Directions, begin: FloatArray, crowd: Crowd
) -> Triangulation | None:
    """Return the front that begins at a bare place, or None where no triangle fits."""
    try:
        row = first_row(surface, field, begin, how.step)
    except LatticeError:  # the row is too short, or winds on
        return None
    # Of the row the stretch about the beginning that keeps off what is there.
    pieces = kept(row, ~crowd.near(row.x, APART * how.step))
    home = surface.point(begin)
    near = [np.linalg.norm(piece.x - home, axis=1).min() for piece in pieces]
    if not near or len(pieces[int(np.argmin(near))].x) < 3:
        return None
    seed = pieces[int(np.argmin(near))]
    try:
        return _assembled(surface, _front(surface, how, seed, crowd, None), seed, how.step)
    except LatticeError:  # no triangle fits
        return None


def _united(surface: FreeformSurface, parts: list[Triangulation]) -> Triangulation:
    """Return fronts as one triangulation."""
    first = np.cumsum([0, *(len(part.points) for part in parts)])
    low = [int(part.rows.min()) for part in parts]
    base = np.cumsum([0, *(int(np.ptp(part.rows)) + 2 for part in parts)])
    return Triangulation(
        surface,
        np.concatenate([part.parameters for part in parts]),
        np.concatenate([part.points for part in parts]),
        np.concatenate([part.triangles + n for part, n in zip(parts, first, strict=False)]),
        np.concatenate(
            [parts[0].rows]
            + [
                p.rows - l + b + low[0]
                for p, l, b in zip(parts[1:], low[1:], base[1:], strict=False)
            ]
        ),
        np.concatenate([part.columns for part in parts]),
        np.repeat(np.arange(len(parts)), np.diff(first)),
    )


def _front(
    surface: FreeformSurface,
    how: Layering,
    seed: Row,
    crowd: Crowd,
    layers: tuple[int, int] | None,
) -> dict[int, list[Row]]:
    """Return the rows on both sides of a first one; the crowd gets their points."""
    made: dict[int, list[Row]] = {0: [seed]}
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
    return made


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
        np.zeros(len(used), np.int64),
    )

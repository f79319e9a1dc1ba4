"""One layer of triangles beside a row: over every edge an apex on its middle's conjugate.

Every apex is as high as the ideal triangle asks, within bounds; the heights of a layer are solved
together, so that the next row is even, or follows prescribed directions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve

from phexfab.remesh.triangulations.crowd import Crowd
from phexfab.remesh.triangulations.fields import Directions, conjugate
from phexfab.remesh.triangulations.seed import Row
from phexfab.surface.freeform.surface import Bending, FreeformSurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

IDEAL = np.sqrt(3.0)
HOLD = 0.15
CROWDED, STRETCHED = 0.4, 2.5  # bounds of an edge along a row, over the step


@dataclass(frozen=True)
class Layering:
    """How layers are built.

    Attributes
    ----------
    step : float
        Edge length along rows, mm.
    low, high : float
        Bounds of the height, over that of an equilateral triangle on the edge.
    margin : float
        The height is at least this multiple of the conjugate semidiameter |AD|: at 1 the star
        turns invalid, at √3 it is ideal.
    follow : Directions or None
        Row directions that the layers follow; None lets rows go as they come.
    hold : float
        Weight of the wish for ideal heights against an even or prescribed next row. With 1 rows
        follow the heights, and tear where those differ: ideal ones are low in hyperbolic regions
        and high in elliptic ones.
    """

    step: float
    low: float = 0.55
    high: float = 1.8
    margin: float = 1.2
    follow: Directions | None = None
    hold: float = HOLD


def next_rows(surface: FreeformSurface, row: Row, side: int, how: Layering) -> list[Row]:
    """Return the next row on the left (side 1) or right (−1), in pieces where the border cuts it.

    The apex over columns j, j + 1 has column j.
    """
    n = len(row.x)
    tail = np.arange(n if row.closed else n - 1)
    head = (tail + 1) % n
    if not len(tail):
        return []
    a, b = row.x[tail], row.x[head]
    # Parameters of an edge that crosses a seam cannot be averaged: one end is the guess.
    um = surface.nearest(0.5 * (a + b), row.u[tail])
    middle = surface.point(um)
    bending = surface.bending(um)
    along = b - a
    if how.follow is not None:
        given = how.follow(middle, bending)
        along = given * np.where((given * along).sum(1) < 0, -1.0, 1.0)[:, None]
    line = side * conjugate(along, bending)
    target, least = _heights(b - a, line, bending, how)
    height = target
    for _ in range(1 if how.follow is None else 3):
        height = _solved(surface, um, middle, line, bending, target, height, row.closed, how)
        height = np.maximum(height, least)
    u = surface.nearest(middle + height[:, None] * line, um)
    x = surface.point(u)
    good = surface.inside(u)
    gap = np.linalg.norm(x - middle, axis=1)
    good &= gap > 0.5 * np.minimum(height, how.low * IDEAL * 0.5 * how.step)
    fresh = Row(u, x, row.columns[tail], row.closed)
    return kept(fresh, good & _unfolded(fresh, b - a, how))


def kept(row: Row, good: BoolArray) -> list[Row]:
    """Return what is left of a row, in pieces, when only the good points stay."""
    if good.all():
        return [row]
    out = []
    for p in _runs(good, row.closed):
        # A piece of a ring has columns in steps of one, beyond the ring's last.
        columns = row.columns[p[0]] + np.arange(len(p))
        out.append(Row(row.u[p], row.x[p], columns, False))
    return out


def _unfolded(row: Row, edge: FloatArray, how: Layering) -> BoolArray:
    """Return where a layer neither turns back on itself nor is stretched or crowded out."""
    n = len(row.x)
    one = np.arange(n if row.closed else n - 1)
    two = (one + 1) % n
    onward = row.x[two] - row.x[one]
    length = np.linalg.norm(onward, axis=1)
    straight = 0.5 * (edge[one] + edge[two])
    cosine = (onward * straight).sum(1) / np.maximum(
        length * np.linalg.norm(straight, axis=1), 1e-300
    )
    bad = (length < CROWDED * how.step) | (length > STRETCHED * how.step) | (cosine < 0.5)
    good = np.ones(n, bool)
    good[one[bad]] = False
    good[two[bad]] = False
    return good


def _heights(
    edge: FloatArray, line: FloatArray, bending: Bending, how: Layering
) -> tuple[FloatArray, FloatArray]:
    """Return ideal heights within bounds, and the least ones that are valid."""
    half = 0.5 * np.linalg.norm(edge, axis=1)
    along = np.abs(bending.form(0.5 * edge, 0.5 * edge))
    across = np.abs(bending.form(line, line))
    top = how.high * IDEAL * half
    with np.errstate(all="ignore"):
        semi = np.sqrt(along / across)
    # Planar points have no conic; equilateral triangles are as good as any.
    semi = np.where(np.isfinite(semi), np.minimum(semi, top), np.where(along > 0, top, half))
    least = np.minimum(how.margin * semi, top)
    # Bounds are for the mean edge too, lest short edges breed short triangles.
    floor = how.low * IDEAL * 0.5 * (half + 0.5 * how.step)
    return np.clip(IDEAL * semi, np.maximum(floor, least), np.maximum(top, floor)), least


def _solved(
    surface: FreeformSurface,
    um: FloatArray,
    middle: FloatArray,
    line: FloatArray,
    bending: Bending,
    target: FloatArray,
    height: FloatArray,
    closed: bool,
    how: Layering,
) -> FloatArray:
    """Heights near the target for which the next row is even, or along the field."""
    n = len(target)
    if n < 2:
        return target
    one = np.arange(n if closed else n - 1)
    two = (one + 1) % n
    if how.follow is None:
        left, right = -np.ones(len(one)), np.ones(len(one))
        fixed = np.zeros(len(one))
    else:
        u = surface.nearest(middle + height[:, None] * line, um)
        x = surface.point(u)
        between = surface.nearest(0.5 * (x[one] + x[two]), u[one])
        bend = surface.bending(between)
        normal = bend.normals
        along = how.follow(surface.point(between), bend)
        across = np.cross(normal, along)
        across *= np.sign((across * line[one]).sum(1))[:, None]
        # The lift off the tangent plane is no matter of the row: x replaces middle + height·line.
        base = x - height[:, None] * line
        left, right = -(across * line[one]).sum(1), (across * line[two]).sum(1)
        fixed = -(across * (base[two] - base[one])).sum(1)
    rows = np.concatenate([np.arange(len(one))] * 2)
    matrix = sp.csr_array(
        (np.concatenate([left, right]), (rows, np.concatenate([one, two]))), shape=(len(one), n)
    )
    normal_matrix = sp.csc_matrix(matrix.T @ matrix + how.hold**2 * sp.eye_array(n))
    return np.asarray(spsolve(normal_matrix, matrix.T @ fixed + how.hold**2 * target))


def _runs(good: BoolArray, closed: bool) -> list[IntArray]:
    """Return the runs of True as indices; in a ring they may pass the end."""
    index = np.flatnonzero(good)
    if not len(index):
        return []
    cuts = np.flatnonzero(np.diff(index) > 1) + 1
    runs = np.split(index, cuts)
    if closed and len(runs) > 1 and good[0] and good[-1]:
        runs = [np.concatenate([runs[-1], runs[0]]), *runs[1:-1]]
    return runs


def extended(
    surface: FreeformSurface,
    row: Row,
    how: Layering,
    pieces: list[Row],
    at: int,
    before: list[Row],
    crowd: Crowd,
    period: int,
    most: int = 400,
) -> Row:
    """Return a piece ``at`` of a row, with points added at both ends until the border.

    A new point repeats the last edge, turned along the field where there is one. It keeps its
    distance from the crowd, the row before and the other pieces, and out of columns in use
    (counted modulo ``period`` in rings).
    """
    if row.closed or len(row.x) < 2:
        return row
    last = np.concatenate([piece.x for piece in before])
    others = np.concatenate(
        [np.zeros((0, 3)), *(piece.x for k, piece in enumerate(pieces) if k != at)]
    )
    taken = {int(c) % period if period else int(c) for piece in pieces for c in piece.columns}
    for end in (0, 1):
        u, x, columns = list(row.u), list(row.x), row.columns.tolist()
        if end == 0:
            u, x, columns = u[::-1], x[::-1], columns[::-1]
        sign = 1 if end else -1
        for _ in range(most):
            column = columns[-1] + sign
            if any((c % period if period else c) in taken for c in (column, column + sign)):
                break
            edge = x[-1] - x[-2]
            length = 0.5 * (np.linalg.norm(edge) + how.step)
            bend = surface.bending(u[-1])
            normal = bend.normals
            heading = edge - (edge @ normal) * normal
            if how.follow is not None:
                bent = Bending(normal[None], bend.kappa[None], bend.directions[None])
                along = how.follow(x[-1][None], bent)[0]
                heading = along * np.sign(along @ heading or 1.0)
            heading = heading / np.linalg.norm(heading)
            next_u = surface.nearest(x[-1] + length * heading, u[-1])
            next_x = surface.point(next_u)
            if not bool(surface.inside(next_u)) or np.linalg.norm(next_x - x[-1]) < 0.5 * length:
                break
            if crowd.near(next_x[None], 0.6 * how.step)[0]:
                break
            if np.linalg.norm(last - next_x, axis=1).min() < CROWDED * how.step:
                break
            if np.linalg.norm(others - next_x, axis=1).min(initial=np.inf) < 0.8 * how.step:
                break
            taken.add(column % period if period else column)
            u.append(next_u)
            x.append(next_x)
            columns.append(column)
        if end == 0:
            u, x, columns = u[::-1], x[::-1], columns[::-1]
        row = Row(np.array(u), np.array(x), np.array(columns, np.int64), False)
    return row

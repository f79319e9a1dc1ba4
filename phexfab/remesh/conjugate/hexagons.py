"""Planar hexagons from a conjugate net: quads laid like bricks, moved until they are planar."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import LatticeError, SolveError
from phexfab.mesh.measures import face_centroids, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.conjugate.base import Base, base_curves
from phexfab.remesh.conjugate.fields import Family, Free
from phexfab.remesh.conjugate.net import ConjugateNet, conjugate_net, joined
from phexfab.remesh.conjugate.sampling import (
    Sampling,
    crossing_number,
    probed,
    require_room,
    sample,
)
from phexfab.remesh.fewer_panels import reach
from phexfab.remesh.planarity.nearest import FreeformReference
from phexfab.remesh.planarity.planarise import Planarised, planarise
from phexfab.surface.freeform.surface import FreeformSurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

ROUNDS = 8  # of leaving out crossing faces
FLUNG = 4.0  # reach of a planar face over its brick's
BOUND = 0.45  # of a brick's height: the most that a vertex moves along its column


@dataclass(frozen=True, eq=False)
class Bricks:
    """Hexagons with the layout of a brick wall, their corners at points of a net.

    Attributes
    ----------
    net : ConjugateNet
        Its columns are those of the even rows of bricks and those of the odd rows in turn.
    shift : float
        σ, of the odd rows.
    mesh : PolyMesh
    rows, columns : (F,) int
        Of the net, at each brick's first corner.
    crossing_numbers : (F,) float
        q of each brick; hexagons are simple where |q| < 1.
    """

    net: ConjugateNet
    shift: float
    mesh: PolyMesh
    rows: IntArray
    columns: IntArray
    crossing_numbers: FloatArray


@dataclass(frozen=True, eq=False)
class ConjugateHexagons:
    """Planar hexagons, and how they came about.

    Attributes
    ----------
    mesh : PolyMesh
        Planar faces.
    bricks : Bricks
        The layout, face by face the same unless some were dropped.
    faces : (F,) int
        The brick of each face.
    planarised : Planarised
    crossing : (k,) int
        Faces that are not simple, or reach four times as far as their bricks; none unless they
        were to be kept.
    dropped : (d,) int
        Bricks left out for that reason.
    sampling : Sampling or None
        How rows and columns were chosen, if they were.
    """

    mesh: PolyMesh
    bricks: Bricks
    faces: IntArray
    planarised: Planarised
    crossing: IntArray
    dropped: IntArray
    sampling: Sampling | None = None


def brick_layout(
    base: Base, rows: ArrayLike, columns: ArrayLike, shift: float = 0.5, *, start: str = "tangent"
) -> Bricks:
    """Return nearly planar hexagons: quads of a conjugate net, every other row shifted.

    Parameters
    ----------
    base : Base
    rows, columns : (n,), (m,) float
        Arc lengths on the base column and row.
    shift : float
        Of every other row of bricks, over their length.
    start : "tangent" or "brick"
        Vertices where the tangent planes of three bricks meet, to the order of the curvature, or
        at the points of the net, as the thesis has it.

    Raises
    ------
    LatticeError
        If no brick fits, or a net that closes across its rows has an odd number of them.
    """
    if start not in ("tangent", "brick"):
        raise LatticeError(f'start = "{start}": "tangent" or "brick"')
    if not 0 < shift < 1:
        raise LatticeError(f"shift = {shift:g} must lie between 0 and 1")
    t, s = np.asarray(rows, float), np.asarray(columns, float)
    end = [base.reach(0)[1]] if base.closed(0) else []
    step = np.diff(np.append(s, end))
    both = np.concatenate([s, s[: len(step)] + shift * step])
    net = conjugate_net(base, t, np.sort(both))
    n, m = net.there.shape
    if net.closed[1] and n % 2:
        raise LatticeError(
            f"{net.surface.name}: columns close up, so rows must be even in number, not {n}"
        )
    j = np.arange(n if net.closed[1] else n - 1)
    c = np.arange(m if net.closed[0] else m - 2)
    j, c = (a.ravel() for a in np.meshgrid(j, c, indexing="ij"))
    j, c = j[(j + c) % 2 == 0], c[(j + c) % 2 == 0]
    up = (j + 1) % n
    ring = [(j, 0), (j, 1), (j, 2), (up, 2), (up, 1), (up, 0)]
    faces = np.stack([row * m + (c + k) % m for row, k in ring], axis=1)
    whole = net.there.ravel()[faces].all(axis=1)
    if not whole.any():
        raise LatticeError(f"{net.surface.name}: no hexagon fits; take a smaller size")
    faces, j, c = faces[whole], j[whole], c[whole]
    length, height = _spacings(net)
    ka, kb = net.curvatures()
    q = crossing_number(ka, kb, length, height, shift)
    points = net.points if start == "brick" else _tangent_points(net, shift, length, height)
    mesh, _, kept = joined(net.surface, points.reshape(-1, 3), faces)
    at = q.ravel()[faces[kept]]
    worst = np.abs(at).argmax(axis=1)
    return Bricks(net, shift, mesh, j[kept], c[kept], at[np.arange(len(kept)), worst])


def conjugate_hexagons(
    surface: FreeformSurface,
    family: Family,
    size: float,
    *,
    rows: str = "auto",
    seed: ArrayLike | None = None,
    shift: float | None = None,
    limit: float = 0.75,
    longest: float = 3.0,
    least_angle: float = 20.0,
    start: str = "tangent",
    closeness: float = 0.0,
    crossing: str = "raise",
) -> ConjugateHexagons:
    """Return planar hexagons along conjugate curves of a surface.

    Parameters
    ----------
    surface : FreeformSurface
    family : Family
        ``principal_family``, ``field_family`` or ``level_family``; the other is conjugate to it.
    size : float
        Length of bricks, mm.
    rows : "family", "conjugate" or "auto"
        Which curves rows of bricks follow; by itself, of those that meet the condition on sampling,
        the ones that cover more of the surface, and if both do those with the lesser |q|.
    seed : array_like, optional
        Parameters of the point at which the net begins.
    shift, limit, longest
        See ``sample``.
    least_angle : float
        Degrees between the families, below which curves end.
    start : "tangent" or "brick"
        See ``brick_layout``.
    closeness : float
        What a square distance from the surface costs, over a square motion along it; 0: the nearest
        planar mesh.
    crossing : "raise", "drop" or "keep"
        What becomes of faces that cross themselves or are flung out: an error that names them, a
        mesh without them, or a mesh with them, numbered in ``crossing``.

    Raises
    ------
    LatticeError
        If the families are not defined, no sampling avoids crossing faces, or faces cross; the
        message names the place.
    SolveError
        If planar faces are not reached.

    References
    ----------
    Thesis §5.2; Wang, Liu 2008, "A note on planar hexagonal meshes".
    """
    bricks, sampling = chosen_bricks(
        surface, family, size, rows=rows, seed=seed, shift=shift, limit=limit, longest=longest,
        least_angle=least_angle, start=start,
    )  # fmt: skip
    made = planar_hexagons(bricks, closeness=closeness, crossing=crossing)
    return replace(made, sampling=sampling)


def chosen_bricks(
    surface: FreeformSurface,
    family: Family,
    size: float,
    *,
    rows: str = "auto",
    seed: ArrayLike | None = None,
    shift: float | None = None,
    limit: float = 0.75,
    longest: float = 3.0,
    least_angle: float = 20.0,
    start: str = "tangent",
    free: Free | None = None,
) -> tuple[Bricks, Sampling]:
    """Return the layout that ``conjugate_hexagons`` begins with, and how it was sampled.

    Parameters and errors are those of ``conjugate_hexagons``; ``free`` says which points (k, 3)
    the net may reach.
    """
    swaps = {"family": (False,), "conjugate": (True,), "auto": (False, True)}
    if rows not in swaps:
        raise LatticeError(f'rows = "{rows}": "family", "conjugate" or "auto"')
    found: list[Sampling] = []
    refused: list[LatticeError] = []
    base = base_curves(surface, family, size, seed=seed, least_angle=least_angle, free=free)
    probe: ConjugateNet | None = None
    for swapped in swaps[rows]:
        way = base.turned() if swapped else base
        try:
            require_room(way, size)
            probe = probed(base, size) if probe is None else probe
            net = probe.turned() if swapped else probe
            found.append(sample(way, size, shift=shift, limit=limit, longest=longest, probe=net))
        except LatticeError as error:
            refused.append(error)
    if not found:
        raise refused[0]
    # The net that covers more; of two that cover the same the one with the lesser |q|.
    widest = max(s.area for s in found)
    sampling = min((s for s in found if s.area > 0.95 * widest), key=lambda s: s.most)
    bricks = brick_layout(
        sampling.base, sampling.rows, sampling.columns, sampling.shift, start=start
    )
    return bricks, sampling


def planar_hexagons(
    bricks: Bricks, *, closeness: float = 0.0, crossing: str = "raise"
) -> ConjugateHexagons:
    """Return the planar hexagons nearest to a layout of bricks.

    Parameters and errors are those of ``conjugate_hexagons``.
    """
    if crossing not in ("raise", "drop", "keep"):
        raise LatticeError(f'crossing = "{crossing}": "raise", "drop" or "keep"')
    surface = bricks.net.surface
    near = FreeformReference(surface) if closeness > 0 else None
    mesh, faces = bricks.mesh, np.arange(bricks.mesh.n_faces)
    middles = face_centroids(mesh)
    far = FLUNG * reach(mesh, middles)
    for _ in range(ROUNDS):
        made = planarise(
            mesh, keep_border=False, reference=near, closeness=closeness or 1.0, strict=False
        )
        bad = ~simple_faces(made.mesh) | (reach(made.mesh, middles[faces]) > far[faces])
        if not bad.any() or crossing != "drop":
            break
        if bad.all():
            raise LatticeError(f"{surface.name}: every face crosses itself; take a smaller size")
        rings = mesh.corners.reshape(-1, 6)[~bad]
        mesh, _, kept = joined(surface, mesh.vertices, rings)
        faces = faces[~bad][kept]
    else:
        raise LatticeError(
            f"{surface.name}: after leaving out {bricks.mesh.n_faces - len(faces)} faces others "
            "still cross; take a smaller size, or a part of the surface"
        )
    found = np.flatnonzero(bad)
    if len(found) and crossing == "raise":
        raise LatticeError(_crossing_message(surface, bricks, made.mesh, faces, found))
    if not made.report.converged:
        worst = made.report.worst_face
        raise SolveError(
            f"{surface.name}: face {worst} at "
            f"{made.mesh.polygon(worst).mean(axis=0).round(3).tolist()} stays "
            f"{made.planarity[worst]:.1e} of an edge from its plane; take a smaller size"
        )
    dropped = np.setdiff1d(np.arange(bricks.mesh.n_faces), faces)
    return ConjugateHexagons(made.mesh, bricks, faces, made, found, dropped)


def _crossing_message(
    surface: FreeformSurface, bricks: Bricks, mesh: PolyMesh, faces: IntArray, found: IntArray
) -> str:
    q = bricks.crossing_numbers[faces[found]]
    first = int(np.abs(q).argmax())
    face = int(found[first])
    place = mesh.polygon(face).mean(axis=0).round(3).tolist()
    return (
        f"{surface.name}: {len(found)} of {mesh.n_faces} faces cross themselves or are flung "
        f"out, first face {face} at {place} with q = {q[first]:.3g} (simple "
        "to the order of the curvature while |q| < 1); take a smaller size or limit, rows along "
        'the other family, or crossing = "drop"'
    )


def _spacings(net: ConjugateNet) -> tuple[FloatArray, FloatArray]:
    """Return (n, m) local length of bricks and height of their rows, mm."""
    length = 2 * _local(net.along, 1, net.base, 0)
    height = _local(net.across, 0, net.base, 1)
    return length, height


def _local(arc: FloatArray, axis: int, base: Base, which: int) -> FloatArray:
    """Return the mean distance to both neighbours on the curve; of one, at an end."""
    arc = np.moveaxis(arc, axis, 0)
    step = np.diff(arc, axis=0)
    if base.closed(which):
        # Of the step that closes the curve, the neighbours' mean is near enough.
        step = np.concatenate([step, (step[:1] + step[-1:]) / 2])
        both = np.stack([step, np.roll(step, 1, axis=0)])
    else:
        none = np.full((1, arc.shape[1]), np.nan)
        both = np.stack([np.concatenate([step, none]), np.concatenate([none, step])])
    count = np.isfinite(both).sum(axis=0)
    mean = np.divide(
        np.nansum(both, axis=0), count, out=np.full(arc.shape, np.nan), where=count > 0
    )
    return np.moveaxis(mean, 0, axis)


def _tangent_points(
    net: ConjugateNet, shift: float, length: FloatArray, height: FloatArray
) -> FloatArray:
    """Return (n, m, 3) where the tangent planes of bricks meet, to the order of the curvature.

    A vertex leaves its net point along the column, towards the upright edge that begins there, by
    the share q/2 of the row's height, and the surface along the normal, by as much as the plane of
    a brick does there. Planes lie so that they are as far above the surface as below it.
    """
    n, m = net.there.shape
    ka, kb = net.curvatures()
    half = np.clip(crossing_number(ka, kb, length, height, shift) / 2, -BOUND, BOUND)
    half = np.nan_to_num(half)
    upward = (np.arange(n)[:, None] + np.arange(m)[None, :]) % 2 == 0
    move = np.where(upward, 1.0, -1.0) * half * height
    a, b = ka * length**2, kb * height**2
    lift = -(a / 4 + (0.5 - half) ** 2 * b) / 2 + (a + b) / 24
    lift = lift + kb * move**2 / 2
    return (
        net.points + move[..., None] * net.tangents[:, :, 1] + lift[..., None] * net.bending.normals
    )

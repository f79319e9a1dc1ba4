"""The nearest mesh with exactly planar faces, to any polygon mesh."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import MeshError, SolveError
from phexfab.mesh.half_edges import border_loops
from phexfab.mesh.measures import edges, mean_edge, planarity_and_simple, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.planarity.hold import BORDER, BorderCurve, Hold
from phexfab.remesh.planarity.nearest import Reference, as_reference
from phexfab.remesh.planarity.rows import PlanarRows
from phexfab.remesh.planarity.steps import Edges, Steps, Walk
from phexfab.remesh.planarity.swift import swift_walk
from phexfab.surface.freeform.surface import FreeformSurface
from phexfab.surface.weierstrass import MinimalSurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

CLOSENESS = 100.0
"""What a square distance from the reference surface costs, over one moved along it."""
_LOOSER = (BORDER, BORDER / 100, 0.0)
"""Squares of what a step off the border costs: the next where faces cross, or stay off planes."""


@dataclass(frozen=True)
class PlanarReport:
    """What planarising did; lengths in mm.

    Attributes
    ----------
    converged : bool
        Whether planarity is within the tolerance, or what rounding of the coordinates leaves.
    planarity_before, planarity_after : float
        Largest distance of a corner from its face's plane, over the mean edge.
    worst_face : int
        The face with ``planarity_after``.
    motion_rms, motion_max : float
    furthest_vertex : int
    edge_share : float
        The least ratio of an edge's length to what it was.
    shortest_before, shortest_after : float
        Length of the shortest edge.
    short_edges : int
        Edges below the asked share, because there is no planar mesh nearby without them.
    crossing : tuple of int
        Faces that were simple and no longer are.
    off_border : float
        Largest distance of a border vertex from the border curve it was to stay on (0 if free).
    off_reference : float
        Largest distance of a vertex from the reference (0 without one).
    steps, factorisations : int
    """

    converged: bool
    planarity_before: float
    planarity_after: float
    worst_face: int
    motion_rms: float
    motion_max: float
    furthest_vertex: int
    edge_share: float
    shortest_before: float
    shortest_after: float
    short_edges: int
    crossing: tuple[int, ...]
    off_border: float
    off_reference: float
    steps: int
    factorisations: int


@dataclass(frozen=True, eq=False)
class Planarised:
    """A planar mesh and how it came about.

    Attributes
    ----------
    mesh : PolyMesh
        Faces as given, vertices moved.
    moved : (V,) float
        How far each vertex moved, mm.
    planarity : (F,) float
        Largest distance of a corner from its face's plane, over the mean edge.
    steps : int
    report : PlanarReport
    """

    mesh: PolyMesh
    moved: FloatArray
    planarity: FloatArray
    steps: int
    report: PlanarReport


def planarise(
    mesh: PolyMesh,
    *,
    fixed: ArrayLike | None = None,
    keep_border: bool | str = True,
    reference: Reference | PolyMesh | MinimalSurface | FreeformSurface | None = None,
    closeness: float = CLOSENESS,
    shortest: float = 0.9,
    tolerance: float = 1e-13,
    most_steps: int = 60,
    strict: bool = True,
) -> Planarised:
    """Return the nearest mesh whose faces are planar to rounding.

    Vertices move as little as possible, in the sum of squares. Faces may have any number of sides
    and reflex corners; triangles are planar as they are.

    Parameters
    ----------
    mesh : PolyMesh
    fixed : (V,) bool or (k,) int, optional
        Vertices that keep their place to the last bit.
    keep_border : bool or ``"fixed"``
        True: border vertices glide along the border curve, a spline through them between corners
        of more than 40°, at which they stay. A step off the curve counts a hundred times, so that
        they leave it only where faces with four and more border corners cannot be planar
        otherwise; the report says how far. Where faces would cross themselves for it, or not
        become planar, it counts ten times, then no more than any other. Where corner follows
        corner, as whole hexagons leave a border, there is no curve and vertices are free.
        ``"fixed"``: border vertices do not move.
        False: they move like all others.
    reference : PolyMesh, MinimalSurface, FreeformSurface or Reference, optional
        A surface to stay close to.
    closeness : float
        What a square distance from the reference costs, over a square motion along it.
    shortest : float
        No edge becomes shorter than this share of its length, where a planar mesh allows it; 0 for
        no guard.
    tolerance : float
        Planarity to reach, over the mean edge; what rounding of the coordinates leaves is granted.
    most_steps : int
    strict : bool
        Raise where faces are not planar in the end or cross themselves; False returns what there
        is, and the report tells.

    Raises
    ------
    MeshError
        If coordinates are not finite, an option is out of its range, or a face's fixed corners
        are not in a plane.
    SolveError
        If planar faces are not reached, or faces that were simple cross themselves: the message
        names the worst face.

    References
    ----------
    Tang, Sun, Gomes, Wallner, Pottmann, "Form-finding with polyhedral meshes made simple", ACM
    Trans. Graph. 33 (2014), for planarity as constraints that are projected upon; Nocedal, Wright,
    "Numerical Optimization" (2006), ch. 18.
    """
    still = _still(mesh, fixed, keep_border)
    _check(mesh, still, shortest, closeness, tolerance)
    start = np.asarray(mesh.vertices, float)
    pairs = edges(mesh)
    length = np.linalg.norm(start[pairs[:, 1]] - start[pairs[:, 0]], axis=1)
    size = float(length.mean())
    rounding = 4 * np.finfo(float).eps * float(np.abs(start).max(initial=0.0))
    goal = max(tolerance * size, rounding)
    rows = PlanarRows(mesh)
    curve = BorderCurve(mesh) if keep_border is True else None
    near = None if reference is None else as_reference(reference)
    held = curve is not None and len(curve.vertices) > 0

    first = rows.heights(start)
    before = rows.worst(first)[0] / size
    found: list[tuple[Planarised, Walk]] = []
    for cost in _LOOSER if held else _LOOSER[:1]:
        hold = Hold(start, still, curve if cost else None, near, closeness, cost)
        walk = _walk(rows, first, hold, pairs, length, shortest, goal, most_steps)
        x = np.where(still[:, None], start, walk.x)
        made = replace(mesh, vertices=x)
        off, simple = planarity_and_simple(made)
        off = off / size
        new = np.linalg.norm(x[pairs[:, 1]] - x[pairs[:, 0]], axis=1)
        left = 0.0 if curve is None else curve.departure(x, start)
        report = _report(
            mesh, made, walk, goal, before, off, simple, (length, new), shortest, near, left
        )
        moved = np.linalg.norm(x - start, axis=1)
        found.append((Planarised(made, moved, off, walk.steps, report), walk))
        if report.converged and not report.crossing:
            break
    best, walk = min(found, key=lambda f: (not f[0].report.converged, len(f[0].report.crossing)))
    if strict:
        _refuse(best.mesh, best.report, walk, size)
    return best


def _walk(
    rows: PlanarRows,
    heights: list[FloatArray],
    hold: Hold,
    pairs: IntArray,
    length: FloatArray,
    shortest: float,
    goal: float,
    most: int,
) -> Walk:
    """Walk with the whole guard; with half of it, then none, where that leads nowhere."""
    swift = swift_walk(rows, heights, hold, Edges(pairs, shortest * length), goal, most)
    if not swift.crooked:
        return swift
    shares = (shortest, shortest / 2, 0.0) if shortest > 0 else (0.0,)
    walks = []
    for share in shares:
        walks.append(Steps(rows, hold, Edges(pairs, share * length), goal, most).run())
        if walks[-1].height <= goal:
            break
    return min(walks, key=lambda walk: walk.height)


def _still(mesh: PolyMesh, fixed: ArrayLike | None, keep_border: bool | str) -> BoolArray:
    n = len(mesh.vertices)
    still = np.zeros(n, bool)
    if fixed is not None:
        given = np.asarray(fixed)
        if given.dtype == bool:
            if given.shape != (n,):
                raise MeshError(f"fixed has shape {given.shape}; one bool for {n} vertices")
            still |= given
        elif given.size:
            if not np.issubdtype(given.dtype, np.integer):
                raise MeshError(f"fixed is {given.dtype}; indices of vertices, or a mask of bool")
            if given.min() < 0 or given.max() >= n:
                raise MeshError(
                    f"fixed names vertex {given.max() if given.max() >= n else given.min()}, but "
                    f"vertices run from 0 to {n - 1}"
                )
            still[given] = True
    if keep_border == "fixed":
        for loop in border_loops(mesh):
            still[loop] = True
    elif keep_border not in (True, False):
        raise MeshError(f'keep_border = {keep_border!r}; use True, False or "fixed"')
    return still


def _check(
    mesh: PolyMesh, still: BoolArray, shortest: float, closeness: float, tolerance: float
) -> None:
    if not mesh.n_faces:
        raise MeshError("the mesh has no face to planarise")
    bad = np.flatnonzero(~np.isfinite(mesh.vertices).all(axis=1))
    if len(bad):
        raise MeshError(f"vertex {bad[0]} is {mesh.vertices[bad[0]]}; coordinates must be finite")
    if not 0 <= shortest < 1:
        raise MeshError(f"shortest = {shortest:g}; a share of the edges' lengths in [0, 1)")
    if not (closeness >= 0 and np.isfinite(closeness)):
        raise MeshError(f"closeness = {closeness:g}; a number not below 0")
    if not tolerance > 0:
        raise MeshError(f"tolerance = {tolerance:g}; a number above 0")
    count = np.add.reduceat(still[mesh.corners].astype(np.int64), mesh.starts[:-1])
    for f in np.flatnonzero(count > 3):
        held = mesh.face(int(f))[still[mesh.face(int(f))]]
        points = mesh.vertices[held]
        spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)[2]
        if spread > 1e-12 * mean_edge(mesh) + 8e-16 * np.abs(points).max():
            raise MeshError(
                f"face {f} near {points.mean(axis=0).round(3).tolist()} has {count[f]} fixed "
                f"corners that are {spread:.3g} mm off a plane; free one of vertices "
                f"{held.tolist()}, at {points.round(3).tolist()}"
            )


def _report(
    mesh: PolyMesh,
    made: PolyMesh,
    walk: Walk,
    goal: float,
    before: float,
    off: FloatArray,
    simple: BoolArray,
    lengths: tuple[FloatArray, FloatArray],
    shortest: float,
    near: Reference | None,
    off_border: float,
) -> PlanarReport:
    x = made.vertices
    moved = np.linalg.norm(x - mesh.vertices, axis=1)
    old, new = lengths
    share = np.divide(new, old, out=np.ones(len(old)), where=old > 0)
    crossing = np.flatnonzero(~simple)
    if len(crossing):  # those that were not simple at first do not count
        crossing = crossing[simple_faces(mesh)[crossing]]
    off_reference = 0.0
    if near is not None:
        off_reference = float(np.linalg.norm(x - near.nearest(x)[0], axis=1).max())
    return PlanarReport(
        # Height is measured from the face's own plane; measures differ by rounding.
        converged=bool(walk.height <= goal),
        planarity_before=before,
        planarity_after=float(off.max()),
        worst_face=int(off.argmax()),
        motion_rms=float(np.sqrt((moved**2).mean())),
        motion_max=float(moved.max()),
        furthest_vertex=int(moved.argmax()),
        edge_share=float(share.min()),
        shortest_before=float(old.min()),
        shortest_after=float(new.min()),
        short_edges=int((share < shortest).sum()),
        crossing=tuple(int(f) for f in crossing),
        off_border=off_border,
        off_reference=off_reference,
        steps=walk.steps,
        factorisations=walk.factored,
    )


def _refuse(made: PolyMesh, report: PlanarReport, walk: Walk, size: float) -> None:
    if not report.converged:
        place = made.polygon(walk.face).mean(axis=0).round(3).tolist()
        raise SolveError(
            f"face {walk.face} at {place} stays {walk.height:.3g} mm off a plane "
            f"({walk.height / size:.1e} of the mean edge) after {walk.steps} steps; free fixed or "
            'border vertices, lower "closeness" or "shortest", or start from a mesh more nearly '
            "planar"
        )
    if report.crossing:
        face = report.crossing[0]
        place = made.polygon(face).mean(axis=0).round(3).tolist()
        raise SolveError(
            f"{len(report.crossing)} faces cross themselves once planar, first face {face} at "
            f"{place}; no planar mesh with simple faces is near: change the mesh there, or take "
            "strict=False to see it"
        )

"""Least area on a triangle mesh: harmonic steps from afar, then Newton along the normals.

Harmonic steps (Pinkall, Polthier) minimise the Dirichlet energy over the present metric, an upper
bound of the area that is sharp where they start, so that they never raise the area. Newton works
on the area itself with its exact Hessian along fixed lines. Where that is not definite, part of
its negative curvature is left out until it is, so that every step goes down.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import SolveError, SurfaceError
from phexfab.linalg import Factor, factorise
from phexfab.surface.mesh_films.area import (
    area_gradient,
    area_hessian,
    gather,
    smallest_angle,
    stiffness,
    total_area,
)
from phexfab.surface.mesh_films.mirror import Held
from phexfab.surface.mesh_films.stencil import vertex_normals
from phexfab.surface.mesh_films.triangulated import edges_of, evened, flip_to_delaunay

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

TOLERANCE = 1e-11
"""Where Newton ends: the area's slope along a vertex' line over half its ring's perimeter."""

STEPS = 40


class PinchError(SurfaceError):
    """A film tears: there is none of this topology in these rims."""


@dataclass(frozen=True, eq=False)
class Descent:
    """The end of a descent.

    Attributes
    ----------
    points : (n, 3) float, in mm
    triangles : (m, 3) int
    gradient : float
        The largest slope of the area along a vertex' line, over half its ring's perimeter.
    steps : int
        Harmonic and Newton steps together.
    unstable : int
        Negative eigenvalues of the Hessian: ways in which the film would fall to less area.
    """

    points: FloatArray
    triangles: IntArray
    gradient: float
    steps: int
    unstable: int


def harmonic_step(points: FloatArray, triangles: IntArray, held: Held) -> FloatArray:
    """Return the points that minimise the Dirichlet energy over the present metric."""
    matrix = stiffness(points, triangles)
    sliding = held.slides.any(axis=1) & ~held.fixed
    if not sliding.any():
        free = np.flatnonzero(~held.fixed)
        out = points.copy()
        right = matrix[free][:, np.flatnonzero(held.fixed)] @ points[held.fixed]
        out[free] = factorise(matrix[free][:, free]).solve(-right)
        return out
    # Unknown are the parts that each vertex' projector leaves: in an eigenbasis of it, those with
    # eigenvalue 1.
    free_part, frames = np.linalg.eigh(held.projectors)
    turn = sp.block_diag(list(np.swapaxes(frames, 1, 2)), format="csr")
    large = (turn @ sp.kron(matrix, sp.eye_array(3), format="csr") @ turn.T).tocsc()
    own = np.einsum("nji,nj->ni", frames, points).ravel()
    free, rest = np.flatnonzero(free_part.ravel() > 0.5), np.flatnonzero(free_part.ravel() < 0.5)
    if len(rest) and len(free):
        own[free] = factorise(large[free][:, free]).solve(-(large[free][:, rest] @ own[rest]))
    return np.einsum("nij,nj->ni", frames, own.reshape(-1, 3))


def improved(points: FloatArray, triangles: IntArray, held: Held) -> tuple[FloatArray, IntArray]:
    """Return the mesh after Delaunay flips and two rounds of evening out in the surface."""
    triangles = flip_to_delaunay(points, triangles)
    for _ in range(2):
        normals = vertex_normals(points, triangles)
        step = held.projected(evened(points, triangles, normals) - points)
        points = held.snapped(points + 0.5 * step)
    return points, triangles


def slope(
    points: FloatArray, triangles: IntArray, lines: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the area's slope along the lines, (n,) mm, and half the perimeter of each ring."""
    corner = points[triangles]
    facing = np.linalg.norm(corner[:, [2, 0, 1]] - corner[:, [1, 2, 0]], axis=2)
    ring = gather(0.5 * facing, triangles, len(points))
    return (area_gradient(points, triangles) * lines).sum(1), ring


def descend(
    points: FloatArray, triangles: IntArray, held: Held, *, name: str, stable: bool = True
) -> Descent:
    """Bring a mesh to least area.

    Parameters
    ----------
    points : (n, 3) float, in mm
    triangles : (m, 3) int
    held : Held
    name : str
        What messages call the film.
    stable : bool
        Whether only a film of least area will do. Otherwise Newton seeks the nearest stationary
        area, as for patches of periodic surfaces that soap would leave; the start has to be near.

    Raises
    ------
    PinchError
        If a neck closes.
    SurfaceError
        If the descent does not settle.
    """
    steps, unit = 0, _median_edge(points, triangles)
    if stable:
        for _ in range(3):
            points = held.snapped(harmonic_step(points, triangles, held))
            points, triangles = improved(points, triangles, held)
            steps += 1
            _refuse_pinch(points, triangles, unit, name)
    settled = False
    lines = held.lines(vertex_normals(points, triangles))
    size = np.inf
    for _ in range(STEPS):
        if not settled:
            lines = held.lines(vertex_normals(points, triangles))
        free = np.flatnonzero((lines != 0).any(axis=1))
        gradient, ring = slope(points, triangles, lines)
        size = float((np.abs(gradient) / ring)[free].max(initial=0.0))
        if size <= TOLERANCE:
            break
        hessian = area_hessian(points, triangles, lines)[free][:, free]
        factor, softened = _definite(hessian, points, triangles, lines, free, stable)
        step = np.zeros(len(points))
        step[free] = factor.solve(-gradient[free])
        share = min(1.0, 0.5 / max(float((np.abs(step) / ring)[free].max()), 1e-300))
        if stable:
            share = _descending(points, triangles, lines, step, float(gradient @ step), share)
        moved = held.snapped(points + share * step[:, None] * lines)
        steps += 1
        if share == 0.0:
            if settled:  # nothing but rounding is left
                break
            moved, triangles = improved(points, triangles, held)
            moved = held.snapped(harmonic_step(moved, triangles, held))
        points = moved
        if softened == 0.0 and share == 1.0 and size < 0.02:
            settled = True
        elif not settled:
            _refuse_pinch(points, triangles, unit, name)
            if stable and steps % 3 == 0:
                points, triangles = improved(points, triangles, held)
    gradient, ring = slope(points, triangles, lines)
    free = np.flatnonzero((lines != 0).any(axis=1))
    size = float((np.abs(gradient) / ring)[free].max(initial=0.0))
    if not size <= 1e-10:
        if stable:
            raise PinchError(f"{name}: after {steps} steps the area still falls ({size:.1e})")
        raise SurfaceError(
            f"{name}: no stationary area was found in {steps} steps (slope {size:.1e}); start "
            "from a mesh that is closer to the film"
        )
    hessian = area_hessian(points, triangles, lines)[free][:, free]
    negative = factorise(hessian).negative_pivots if len(free) else 0
    return Descent(points, triangles, size, steps, -1 if negative is None else negative)


def _definite(
    hessian: Any,
    points: FloatArray,
    triangles: IntArray,
    lines: FloatArray,
    free: IntArray,
    stable: bool,
) -> tuple[Factor, float]:
    """Return a factor of (1 − θ) H + θ K with the least θ of a few that makes it definite."""
    if not stable:
        return factorise(hessian), 0.0
    convex = None
    for theta in (0.0, 0.3, 0.7, 1.0):
        matrix = hessian
        if theta:
            if convex is None:
                convex = stiffness(points, triangles)[free][:, free]
            matrix = (1 - theta) * hessian + theta * convex
        try:
            factor = factorise(matrix)
        except SolveError:
            continue
        if factor.negative_pivots == 0 or theta == 1.0:
            return factor, theta
    raise SolveError("the stiffness matrix of the film is singular; its mesh has no fixed border")


def _descending(
    points: FloatArray,
    triangles: IntArray,
    lines: FloatArray,
    step: FloatArray,
    slope: float,
    share: float,
) -> float:
    """Return the part of a step that lowers the area enough (Armijo); 0 if none does."""
    area = total_area(points, triangles)
    if slope >= 0:
        return 0.0
    for _ in range(20):
        if abs(slope) * share < 1e-13 * area:  # the area cannot tell any more
            return share
        fresh = total_area(points + share * step[:, None] * lines, triangles)
        if fresh <= area + 1e-4 * share * slope:
            return share
        share *= 0.5
    return 0.0


def _median_edge(points: FloatArray, triangles: IntArray) -> float:
    ends = edges_of(triangles, points).ends
    return float(np.median(np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)))


def _refuse_pinch(points: FloatArray, triangles: IntArray, unit: float, name: str) -> None:
    ends = edges_of(triangles).ends
    length = np.linalg.norm(points[ends[:, 0]] - points[ends[:, 1]], axis=1)
    worst = int(length.argmin())
    if length[worst] < 0.03 * unit or smallest_angle(points, triangles) < 0.05:
        place = points[ends[worst]].mean(axis=0)
        raise PinchError(f"{name}: the film pinches at {place.round(1).tolist()}")

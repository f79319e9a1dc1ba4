"""Members of P(M) with a purpose: nearest to a target, without flipped edges, pulled by handles.

All results are M plus a combination of the fields of P(M), so they are parallel to M to rounding
whatever the solver does.

References
----------
Thesis §4.1; Pottmann et al. 2007, sec. 2; Mehrotra 1992, "On the implementation of a primal-dual
interior point method".
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import MeshError, SolveError
from phexfab.linalg import factorise
from phexfab.mesh.measures import mean_edge
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.pairs import ratios
from phexfab.parallel.space import ParallelSpace, parallel_space

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def _space(where: PolyMesh | ParallelSpace) -> ParallelSpace:
    return where if isinstance(where, ParallelSpace) else parallel_space(where)


def _points(space: ParallelSpace, target: PolyMesh | FloatArray) -> FloatArray:
    points = target.vertices if isinstance(target, PolyMesh) else np.asarray(target, float)
    if points.shape != space.mesh.vertices.shape:
        raise MeshError(
            f"the target has {points.shape} coordinates, the mesh {space.mesh.vertices.shape}: "
            "give one point for every vertex"
        )
    return points


def nearest_member(
    where: PolyMesh | ParallelSpace,
    target: PolyMesh | FloatArray,
    weights: FloatArray | None = None,
) -> PolyMesh:
    """Return the member of P(M) nearest to a target, by least squares over the vertices.

    Parameters
    ----------
    where : PolyMesh or ParallelSpace
        M, or its space when that is at hand.
    target : PolyMesh or (V, 3) array, mm
    weights : (V,) array, optional
        Weight of every vertex' squared distance; at least one for each dimension must not be 0.

    Raises
    ------
    MeshError
        If the target is of another size.

    References
    ----------
    Thesis §4.1.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> wish = shell.mesh.vertices + [0, 0, 100] * (shell.mesh.vertices[:, :1] > 0)  # mm
    >>> px.is_parallel(shell.mesh, px.nearest_member(shell.mesh, wish))
    True
    """
    space = _space(where)
    step = _points(space, target) - space.mesh.vertices
    points = space.mesh.vertices + nearest_field(space, step, weights)
    return PolyMesh(points, space.mesh.corners, space.mesh.starts)


def nearest_field(
    space: ParallelSpace, target: FloatArray, weights: FloatArray | None = None
) -> FloatArray:
    """Return the (V, 3) combination of the fields of P(M) nearest to a target.

    Unlike ``nearest_member`` it starts from nothing, not from M, so that a Gauss image, of size 1,
    does not inherit the printed digits of a mesh that measures metres.

    Parameters
    ----------
    space : ParallelSpace
    target : (V, 3) array
    weights : (V,) array, optional
    """
    weight = np.ones(len(target)) if weights is None else np.asarray(weights, float)
    weighted = sp.diags(np.repeat(weight, 3)) @ space.basis
    factor = factorise(_lifted(space.basis.T @ weighted))
    coordinates = np.zeros(space.dimension)
    for _ in range(3):  # the normal equations lose digits; what is left is solved for again
        rest = target - space.displacement(coordinates)
        coordinates = coordinates + factor.solve(weighted.T @ rest.ravel())
    return space.displacement(coordinates)


def _lifted(normal: Any) -> Any:
    """Return a positive semidefinite matrix with a rounding-sized diagonal added."""
    diagonal = normal.diagonal()
    return (normal + sp.diags(1e-14 * diagonal + 1e-300)).tocsc()


def admissible_member(
    where: PolyMesh | ParallelSpace,
    target: PolyMesh | FloatArray,
    lower: float = 0.1,
) -> PolyMesh:
    """Return the member of P(M) nearest to a target of which no edge is flipped or too short.

    Parameters
    ----------
    where : PolyMesh or ParallelSpace
    target : PolyMesh or (V, 3) array, mm
    lower : float
        Every edge keeps at least this signed ratio to M's edge; below 1, so that M itself is
        inside.

    Raises
    ------
    MeshError
        If ``lower`` is not below 1, or the target is of another size.
    SolveError
        If the interior point method does not converge.

    References
    ----------
    Thesis §4.1; Mehrotra 1992.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> from phexfab.parallel.pairs import ratios
    >>> wish = shell.mesh.vertices * [1.0, 1.0, -1.0]  # upside down
    >>> made = px.admissible_member(shell.mesh, wish, lower=0.2)
    >>> print(f"{ratios(shell.mesh, made).min():.3f}")  # no edge is flipped
    0.200
    """
    space = _space(where)
    scale = mean_edge(space.mesh)
    step = (_points(space, target) - space.mesh.vertices).ravel() / scale
    quadratic = (space.basis.T @ space.basis) / scale**2
    coordinates = _bounded(
        _lifted(quadratic), space.basis.T @ step / scale, space.ratio_matrix, lower
    )
    return space.member(coordinates)


def _bounded(quadratic: Any, linear: FloatArray, ratio: Any, lower: float) -> FloatArray:
    """Minimise ½ cᵀQc − bᵀc with all ratios 1 + A c ≥ lower, by a primal-dual interior point."""
    if not lower < 1:
        raise MeshError(f"lower ratio = {lower:g}: take one below 1, the ratio of M itself")
    c = np.zeros(len(linear))
    slack = np.full(ratio.shape[0], 1.0 - lower)
    dual = np.full(ratio.shape[0], max(float(np.abs(linear).mean()), 1e-3))
    size = 1.0 + float(np.abs(linear).max(initial=0.0))
    for _ in range(100):
        down = quadratic @ c - linear - ratio.T @ dual
        gap = float(slack @ dual) / len(slack)
        primal = slack - ratio @ c - (1 - lower)
        if max(float(np.abs(down).max()) / size, gap) < 1e-12:
            return c
        weight = dual / slack
        factor = factorise((quadratic + ratio.T @ sp.diags(weight) @ ratio).tocsc())

        def step(
            centre: FloatArray,
            factor: Any = factor,
            weight: FloatArray = weight,
            down: FloatArray = down,
            primal: FloatArray = primal,
            slack: FloatArray = slack,
        ) -> tuple[FloatArray, FloatArray, FloatArray]:
            push = centre / slack + weight * primal
            dc = factor.solve(-down + ratio.T @ push)
            ds = ratio @ dc - primal
            return dc, ds, centre / slack - weight * ds

        _, ds, dz = step(-dual * slack)
        ahead = min(_reach(slack, ds), _reach(dual, dz))
        after = float((slack + ahead * ds) @ (dual + ahead * dz)) / len(slack)
        centre = gap * (after / gap) ** 3 if gap > 0 else 0.0
        dc, ds, dz = step(centre - dual * slack - ds * dz)
        along, upward = 0.995 * _reach(slack, ds), 0.995 * _reach(dual, dz)
        along = upward = min(1.0, along, upward)
        c, slack, dual = c + along * dc, slack + along * ds, dual + upward * dz
    raise SolveError(
        f"no member with all ratios above {lower:g} was settled on (gap {gap:.1e}); lower the bound"
    )


def _reach(value: FloatArray, step: FloatArray) -> float:
    """Return the largest multiple of a step that keeps all values positive (at most 1e3)."""
    falling = step < 0
    return float((-value[falling] / step[falling]).min(initial=1e3))


@dataclass(frozen=True, eq=False)
class Deformation:
    """A member of P(M) made by pulling vertices.

    Attributes
    ----------
    mesh : PolyMesh
        Parallel to M: all panels keep the angles of their corners.
    miss : (n,) float array, mm
        How far each pulled vertex stays from its target: rounding, if P(M) allows all of them.
    ratios : (E,) float array
        Signed ratios of the edges to M's.
    """

    mesh: PolyMesh
    miss: FloatArray
    ratios: FloatArray


def deform(
    where: PolyMesh | ParallelSpace,
    vertices: IntArray,
    targets: FloatArray,
    *,
    lower: float | None = None,
) -> Deformation:
    """Pull some vertices to targets inside P(M), changing the edges' lengths as little as can be.

    Parameters
    ----------
    where : PolyMesh or ParallelSpace
    vertices : (n,) int
        Vertices to move, or to hold where they are.
    targets : (n, 3) array, mm
    lower : float, optional
        No edge gets a smaller signed ratio to M's edge; targets beyond that are missed as little
        as can be.

    Returns
    -------
    Deformation
        The member with the least Σ (ratio − 1)² among those that reach the targets, or come
        nearest to them.

    Raises
    ------
    MeshError
        If a vertex does not exist, or the numbers of vertices and targets differ.

    References
    ----------
    Thesis §4.1.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> corners = shell.mesh.vertices[[0, 40]]
    >>> pulled = px.deform(shell.mesh, [0, 40], corners + [[0, 0, 50.0], [0, 0, 0]])  # mm
    >>> print(f"{abs(pulled.mesh.vertices[0] - corners[0]).max():.1f}")
    50.0
    >>> px.is_parallel(shell.mesh, pulled.mesh)
    True
    """
    space = _space(where)
    index = np.asarray(vertices, np.int64).reshape(-1)
    wish = np.asarray(targets, float).reshape(-1, 3)
    n_v = len(space.mesh.vertices)
    if len(index) != len(wish):
        raise MeshError(f"{len(index)} vertices and {len(wish)} targets: give one target each")
    if len(index) and not (index.min() >= 0 and index.max() < n_v):
        raise MeshError(f"vertex {index.max()} does not exist; the mesh has {n_v}")
    scale = mean_edge(space.mesh)
    basis = space.basis.tocsr()
    handles = basis[(3 * index[:, None] + np.arange(3)).ravel()] / scale
    step = ((wish - space.mesh.vertices[index]) / scale).ravel()
    ratio = space.ratio_matrix
    # Without handles translations are free: a whisper of the displacement itself holds them.
    soft = ratio.T @ ratio + 1e-10 * (basis.T @ basis) / scale**2
    stiff = 1e4
    quadratic = _lifted(soft + stiff * (handles.T @ handles))
    factor = factorise(quadratic)
    coordinates, pull, least = np.zeros(space.dimension), np.zeros(len(step)), np.inf
    for _ in range(30):  # augmented Lagrangian: the pull grows until the targets are reached
        linear = handles.T @ (stiff * step + pull)
        if lower is None:
            coordinates = factor.solve(linear)
        else:
            coordinates = _bounded(quadratic, linear, ratio, lower)
        rest = step - handles @ coordinates
        size = float(np.abs(rest).max(initial=0.0))
        if size < 1e-13 or (lower is not None and not size < 0.9 * least):
            break
        pull, least = pull + stiff * rest, size
    moved = space.member(coordinates)
    return Deformation(
        moved, np.linalg.norm(moved.vertices[index] - wish, axis=1), ratios(space.mesh, moved)
    )

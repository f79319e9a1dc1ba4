"""Local minimal surfaces through scattered points: one Weierstrass polynomial about every vertex.

About a vertex, in a frame whose third axis points against the normal and with lengths divided by
``s``, every minimal surface is

    x = c e₃ + Re ∫ (½(1 − g²), i/2 (1 + g²), g) dζ,   g(ζ) = a₀ + a₁ ζ + … + a_d ζ^d + …

because ζ = ∫ f dz makes f = 1. A polynomial of degree d has only 2(d + 1) real unknowns, about half
of those of a general height function that reaches as far, and every choice of them is minimal.

References
----------
Dierkes, Hildebrandt, Sauvigny, Minimal Surfaces (2010), sec. 3.3 (the representation).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import SurfaceError
from phexfab.surface.mesh_films.stencil import Stencils

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]

DEGREE = 4
"""Degree of g: the surface then has contact of order five with the one it stands for."""

STEPS = 25


@dataclass(frozen=True, eq=False)
class Charts:
    """Local minimal surfaces, one per vertex.

    Attributes
    ----------
    origin : (n, 3) float
        The vertices, mm.
    frame : (n, 3, 3) float
        Rows are the local axes; the third points against the normal of the triangles.
    scale : (n,) float
        s, mm. ζ has size 1 about at the neighbours of the vertex.
    lift : (n,) float
        c: height of the chart over its vertex at ζ = 0, along the third axis and in units of s.
    coefficients : (n, d + 1) complex
        a₀ … a_d.
    """

    origin: FloatArray
    frame: FloatArray
    scale: FloatArray
    lift: FloatArray
    coefficients: ComplexArray


def start_charts(points: FloatArray, stencil: Stencils, normals: FloatArray) -> Charts:
    """Return planar charts, the start of a fit, from the (N, 3) normals of the points."""
    count = len(stencil.size)
    # The mean over the stencil: slivers at a border make the normal of one vertex unsure.
    heft = stencil.weights**2
    heft[:, 0] = 1.0
    normal = (normals[stencil.points] * heft[..., None]).sum(1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    # The axis that is least along the normal gives a frame without a bad case.
    other = np.eye(3)[np.abs(normal).argmin(axis=1)]
    first = np.cross(other, normal)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    frame = np.stack([first, np.cross(first, normal), -normal], axis=1)
    return Charts(
        points[:count],
        frame,
        2.0 * stencil.size,
        np.zeros(count),
        np.zeros((count, DEGREE + 1), complex),
    )


def horner(coefficients: ComplexArray, zeta: ComplexArray) -> ComplexArray:
    """Return Σ c_k ζ^k, coefficients (..., d + 1) for ζ (...)."""
    value = np.array(np.broadcast_to(coefficients[..., -1], zeta.shape))
    for k in range(coefficients.shape[-1] - 2, -1, -1):
        value = value * zeta + coefficients[..., k]
    return value


def square(coefficients: ComplexArray) -> ComplexArray:
    """Return the coefficients of g², (..., 2d + 1)."""
    d = coefficients.shape[-1]
    out = np.zeros((*coefficients.shape[:-1], 2 * d - 1), complex)
    for k in range(d):
        out[..., k : k + d] += coefficients[..., k : k + 1] * coefficients
    return out


def primitive(coefficients: ComplexArray) -> ComplexArray:
    """Return the coefficients of ∫₀ g, (..., d + 2)."""
    d = coefficients.shape[-1]
    out = np.zeros((*coefficients.shape[:-1], d + 1), complex)
    out[..., 1:] = coefficients / np.arange(1, d + 1)
    return out


def local_curve(coefficients: ComplexArray, zeta: ComplexArray) -> ComplexArray:
    """Return ∫₀^ζ (½(1 − g²), i/2 (1 + g²), g) dζ, (..., 3); its real part is the surface."""
    both = horner(primitive(square(coefficients)), zeta)
    return np.stack(
        [0.5 * (zeta - both), 0.5j * (zeta + both), horner(primitive(coefficients), zeta)], -1
    )


def local_normal(g: ComplexArray) -> FloatArray:
    """Return the unit normals (..., 3) with the stereographic images ``g``."""
    size = np.abs(g) ** 2
    return np.stack([2 * g.real, 2 * g.imag, size - 1], -1) / (1 + size)[..., None]


@dataclass(frozen=True, eq=False)
class Fit:
    """Charts fitted to points.

    Attributes
    ----------
    charts : Charts
    influence : (n, k) float
        How much a chart rises along its normal at ζ = 0 when a point of the stencil rises along
        its own by 1; zeros where charts pass through their vertices.
    misfit : (n,) float
        Root mean square distance of the points, over the mean length of the vertex' edges.
    """

    charts: Charts
    influence: FloatArray
    misfit: FloatArray


ROUGH = 0.02
"""Misfit above which a surface is not smooth at the size of the mesh."""

FOLDED = 0.8
"""Misfit above which a mesh is no surface."""


def fit_or_lower(
    charts: Charts, points: FloatArray, stencil: Stencils, *, through_vertex: bool
) -> tuple[Fit, BoolArray]:
    """Fit charts as `fit` does, those that stay `ROUGH` with g of first degree only.

    Returns
    -------
    fit : Fit
    low : (n,) bool
        Which charts are of first degree.

    Raises
    ------
    SurfaceError
        If many charts are rough, or one stays far from its points: the mesh is folded there, or
        too coarse.
    """
    found = fit(charts, points, stencil, through_vertex=through_vertex)
    low = ~(found.misfit <= ROUGH)
    if low.mean() > 0.3:
        raise SurfaceError(
            f"about {int(low.sum())} of {len(low)} vertices the mesh is near no smooth minimal "
            "surface; a finer or smoother mesh is needed"
        )
    if low.any():
        found = fit(found.charts, points, stencil, through_vertex=through_vertex, low=low)
    if not found.misfit.max() < FOLDED:
        worst = int(np.nan_to_num(found.misfit, nan=np.inf).argmax())
        raise SurfaceError(
            f"no minimal surface fits the mesh about vertex {worst} at "
            f"{charts.origin[worst].round(1).tolist()}: it is folded there or too coarse; refine it"
        )
    return found, low


def fit(
    charts: Charts,
    points: FloatArray,
    stencil: Stencils,
    *,
    through_vertex: bool,
    low: BoolArray | None = None,
) -> Fit:
    """Fit every chart to the points of its stencil: least squares of the distances to it.

    Levenberg–Marquardt in the coefficients, with the feet of the points moved along in every step.

    Parameters
    ----------
    charts : Charts
        The start.
    points : (N, 3) float, in mm
    stencil : Stencils
    through_vertex : bool
        The chart passes through its vertex exactly (lift 0). Otherwise the vertex itself is left
        out of the fit and the lift is free, so that it tells by how much the vertex is off the
        minimal surface through its surroundings.
    low : (n,) bool, optional
        Charts whose g is of first degree only; they start anew.
    """
    gap = points[stencil.points] - charts.origin[:, None]
    target = np.einsum("nij,nkj->nki", charts.frame, gap) / charts.scale[:, None, None]
    weights = stencil.weights
    zeta = 2.0 * (target[..., 0] - 1j * target[..., 1])
    d = charts.coefficients.shape[1]
    unknowns = 2 * d + (0 if through_vertex else 1)
    now = np.concatenate(
        [charts.coefficients.real, charts.coefficients.imag, charts.lift[:, None]], 1
    )[:, :unknowns]
    shape = np.ones(now.shape)
    if low is not None:
        now[low] = 0.0
        shape[low, 2:d] = shape[low, d + 2 : 2 * d] = 0.0
    if charts.coefficients.any():  # a warm start needs the feet on its charts first
        for _ in range(2):
            zeta = zeta + _to_feet(now, zeta, target, d)[0]
    trial, damping = now.copy(), np.zeros(len(now))
    cost = np.full(len(now), np.inf)
    matrix, right = np.zeros((len(now), unknowns, unknowns)), np.zeros_like(now)
    todo = np.arange(len(now))
    for _ in range(STEPS):
        feet, distance, rows = _linearised(trial[todo], zeta[todo], target[todo], d)
        zeta[todo] = feet
        rows = rows * weights[todo, :, None] * shape[todo, None]
        distance = distance * weights[todo]
        fresh = (distance**2).sum(1)
        # Feet on their way blur the cost a little: only a step that clearly raises it is taken
        # back.
        good = fresh <= 1.5 * cost[todo] + 1e-20
        ok, kept = todo[good], rows[good]
        now[ok], cost[ok] = trial[ok], fresh[good]
        matrix[ok] = np.swapaxes(kept, -1, -2) @ kept
        right[ok] = (kept * distance[good][..., None]).sum(1)
        damping[todo] = np.where(good, 0.1 * damping[todo], np.maximum(10 * damping[todo], 1e-3))
        damping[damping < 1e-6] = 0.0
        step = _solved(matrix[todo], right[todo], damping[todo])
        trial[todo] = now[todo] + step
        size = np.abs(step).max(axis=1)
        settled = good & (size < 1e-11)
        now[todo[settled]] = trial[todo[settled]]
        todo = todo[~settled]
        if not len(todo):
            break
    heft = np.maximum((weights**2).sum(1), 1e-300)
    misfit = np.sqrt(cost / heft) * charts.scale / stencil.size
    influence = np.zeros(weights.shape)
    if not through_vertex:
        _, _, rows = _linearised(now, zeta, target, d)
        rows = rows * weights[..., None] * shape[:, None]
        unit = np.zeros_like(now)
        unit[:, -1] = 1.0
        lifting = _solved(np.swapaxes(rows, -1, -2) @ rows, unit, np.zeros(len(now)))
        influence = (rows @ lifting[..., None])[..., 0] * weights
        influence *= local_normal(now[:, 0] + 1j * now[:, d])[:, 2:]
    fitted = replace(
        charts,
        coefficients=now[:, :d] + 1j * now[:, d : 2 * d],
        lift=np.zeros(len(now)) if through_vertex else now[:, -1],
    )
    return Fit(fitted, influence, misfit)


def _to_feet(
    unknowns: FloatArray, zeta: ComplexArray, target: FloatArray, d: int
) -> tuple[ComplexArray, FloatArray, ComplexArray]:
    """Return steps to the points' feet, the gaps from where they are now, and g there."""
    a = unknowns[:, :d] + 1j * unknowns[:, d : 2 * d]
    curve = local_curve(a[:, None], zeta).real
    if unknowns.shape[1] > 2 * d:
        curve[..., 2] += unknowns[:, -1:]
    gap = target - curve
    g = horner(a[:, None], zeta)
    # One tangential Gauss–Newton step with |φ|² = ½ (1 + |g|²)².
    square_g = g * g
    slope = 0.5 * ((1 - square_g) * gap[..., 0] + 1j * (1 + square_g) * gap[..., 1])
    slope += g * gap[..., 2]
    return 4.0 * slope.conj() / (1 + np.abs(g) ** 2) ** 2, gap, g


def _linearised(
    unknowns: FloatArray, zeta: ComplexArray, target: FloatArray, d: int
) -> tuple[ComplexArray, FloatArray, FloatArray]:
    """Return better feet, the points' distances, and how unknowns raise the charts there."""
    way, gap, g = _to_feet(unknowns, zeta, target, d)
    feet = zeta + way
    a = unknowns[:, :d] + 1j * unknowns[:, d : 2 * d]
    free = unknowns.shape[1] - 2 * d
    normal = local_normal(g)
    distance = (normal * gap).sum(-1)
    # δX = Re Σ δa_k ∫ (−g ζ^k, i g ζ^k, ζ^k) dζ.
    powers = np.arange(1, d + 1)
    lower = normal[..., 1] * 1j - normal[..., 0]
    rise = np.empty((*feet.shape, d), complex)
    rise[..., 0] = feet
    for k in range(1, d):
        rise[..., k] = rise[..., k - 1] * feet
    total, run = np.zeros_like(rise), np.ones_like(feet)
    for m in range(d):
        total += (a[:, m, None] * run)[..., None] * (1.0 / (powers + m))
        run = run * feet
    columns = rise * (lower[..., None] * total + normal[..., 2:] / powers)
    rows = np.empty((*feet.shape, 2 * d + free))
    rows[..., :d], rows[..., d : 2 * d] = columns.real, -columns.imag
    if free:
        rows[..., -1] = normal[..., 2]
    return feet, distance, rows


def _solved(matrix: FloatArray, right: FloatArray, damping: FloatArray) -> FloatArray:
    """Solve damped normal equations; a whisper of a ridge keeps one-sided stencils definite."""
    diagonal = np.einsum("nii->ni", matrix)
    ridge = 1e-13 * diagonal.max(axis=1, keepdims=True) + damping[:, None] * diagonal + 1e-300
    n = matrix.shape[1]
    damped = matrix.copy()
    damped[:, np.arange(n), np.arange(n)] += ridge
    return np.asarray(np.linalg.solve(damped, right[..., None])[..., 0], float)

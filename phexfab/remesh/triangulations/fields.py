"""Pairs of conjugate directions on a surface: rows and what crosses them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu
from scipy.spatial import cKDTree

from phexfab.errors import LatticeError
from phexfab.surface.freeform.surface import Bending, FreeformSurface

FloatArray = NDArray[np.float64]
Directions = Callable[[FloatArray, Bending], FloatArray]
"""Points (k, 3) and the bending there to row directions (k, 3), of either sign."""

SHEAR = 0.1  # regularises conjugates where a row is nearly asymptotic, over the greatest |κ|


def flat_directions(bending: Bending) -> FloatArray:
    """Return the principal directions (..., 3) with the smaller |κ|.

    Only they, or the directions near them, can be rows across a parabolic curve: there every other
    direction has this one as its conjugate.
    """
    kappa = np.abs(bending.kappa)
    pick = (kappa[..., 1] < kappa[..., 0]).astype(int)
    return np.asarray(
        np.take_along_axis(bending.directions, pick[..., None, None], axis=-2)[..., 0, :]
    )


def conjugate(rows: FloatArray, bending: Bending) -> FloatArray:
    """Return the unit directions (..., 3) conjugate to ``rows``, on their left.

    Where a row is nearly asymptotic its conjugate nears the row itself, or is anything (a flat
    direction); it is drawn to the perpendicular there by a term of 0.1 of the greatest curvature.
    """
    flat = bending.flat(rows)
    flat = flat / np.linalg.norm(flat, axis=-1, keepdims=True)
    left = np.stack([-flat[..., 1], flat[..., 0]], axis=-1)
    along = (bending.kappa * flat**2).sum(-1)
    mixed = (bending.kappa * flat * left).sum(-1)
    guard = (SHEAR * np.abs(bending.kappa).max(-1)) ** 2 + 1e-300
    slide = -mixed * along / (along**2 + guard)
    line = left + slide[..., None] * flat
    return bending.lifted(line / np.linalg.norm(line, axis=-1, keepdims=True))


@dataclass(frozen=True, eq=False)
class RowField:
    """Row directions known at sample points; between them those of the nearest, blended.

    Attributes
    ----------
    points : (n, 3) float
    lines : (n, 3) float
        Unit directions, signs without meaning.
    """

    points: FloatArray
    lines: FloatArray
    tree: cKDTree

    def __call__(self, points: FloatArray, bending: Bending) -> FloatArray:
        """Return unit directions (k, 3) in the tangent planes."""
        away, near = self.tree.query(points, min(6, len(self.points)))
        reach = 1.02 * away[:, -1:]
        weight = (1 - away / np.maximum(reach, 1e-300)) ** 2
        tensor = np.einsum("km,kmi,kmj->kij", weight, self.lines[near], self.lines[near])
        return principal_line(tensor, bending)


def principal_line(tensor: FloatArray, bending: Bending) -> FloatArray:
    """Return the tangent direction (k, 3) along which a symmetric tensor (k, 3, 3) is greatest."""
    d = bending.directions
    a = np.einsum("ki,kij,kj->k", d[:, 0], tensor, d[:, 0])
    b = np.einsum("ki,kij,kj->k", d[:, 0], tensor, d[:, 1])
    c = np.einsum("ki,kij,kj->k", d[:, 1], tensor, d[:, 1])
    angle = 0.5 * np.arctan2(2 * b, a - c)
    return bending.lifted(np.stack([np.cos(angle), np.sin(angle)], axis=-1))


def smooth_rows(
    surface: FreeformSurface,
    samples: int = 2500,
    *,
    toward: ArrayLike | None = None,
    smoothing: float = 1.0,
) -> RowField:
    """Return a smooth field of row directions, flat where the surface is nearly parabolic.

    The line tensors t tᵀ of the field differ as little as possible between neighbouring samples and
    from what the curvature asks for: near parabolic curves the flat principal direction; in a
    hyperbolic region one family of principal directions throughout, that which is flatter on the
    whole, so that rows keep off asymptotic directions; in an elliptic region nothing but a little
    of ``toward``.

    Parameters
    ----------
    surface : FreeformSurface
    samples : int
        About how many points the field is solved at.
    toward : (3,), optional
        A direction in space that rows take where nothing else asks. Without it the lines of the
        parameter u, or the longest side of the box of an implicit surface or mesh.
    smoothing : float
        Weight of smoothness, in squares of the mean distance of samples.

    Raises
    ------
    LatticeError
        If ``toward`` is zero or there are fewer than 4 samples.

    References
    ----------
    Thesis §5.1.4 asks for two conjugate fields and leaves their choice open.
    """
    u = surface.seeds(samples)
    if len(u) < 4:
        raise LatticeError(f"{surface.name}: a row field needs 4 samples; there are {len(u)}")
    points = surface.point(u)
    bending = surface.bending(u)
    graph = _neighbours(points, bending.normals)
    laplacian = sp.diags_array(np.asarray(graph.sum(axis=1)).ravel()) - graph
    kappa = np.abs(bending.kappa)
    total = kappa.sum(-1)
    ratio = np.abs(kappa[:, 0] - kappa[:, 1]) / np.where(total > 0, total, 1.0)
    curved = total > 1e-6 * total.max(initial=0.0)
    # Ratios below 0.6 (|κ₁| < 4 |κ₂|) ask for nothing, those above 0.95 for all.
    near = np.clip((ratio - 0.6) / 0.35, 0.0, 1.0)
    near = near * near * (3 - 2 * near)
    parabolic = np.where(curved, near, 0.0)
    saddle = np.where(curved & (bending.gauss < 0), 0.5 * (1 - near), 0.0)
    flat = flat_directions(bending)
    family = bending.directions[np.arange(len(u)), _families(graph, bending, ratio, curved)]
    drawn = _drawn(surface, u, points, bending, toward)
    parts = ((parabolic, flat), (saddle, family), (np.full(len(u), 1e-2), drawn))
    target = sum(w[:, None] * np.einsum("ki,kj->kij", d, d).reshape(-1, 9) for w, d in parts)
    matrix = sp.csc_matrix(smoothing * laplacian + sp.diags_array(sum(w for w, _ in parts)))
    tensor = splu(matrix).solve(np.asarray(target)).reshape(-1, 3, 3)
    return RowField(points, principal_line(tensor, bending), cKDTree(points))


def _neighbours(points: FloatArray, normals: FloatArray) -> sp.csr_array:
    """Symmetric graph of the six nearest samples; opposite sheets are no neighbours."""
    near = cKDTree(points).query(points, min(7, len(points)))[1]
    facing = (np.einsum("kj,kmj->km", normals, normals[near]) > 0)[:, 1:]
    near = near[:, 1:]
    row = np.repeat(np.arange(len(points)), near.shape[1])[facing.ravel()]
    shape = (len(points), len(points))
    graph = sp.csr_array((np.ones(len(row)), (row, near[facing])), shape=shape)
    return sp.csr_array(graph.maximum(graph.T))


def _families(
    graph: sp.csr_array, bending: Bending, ratio: FloatArray, curved: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """Return 0 or 1, which principal family is flatter over each connected hyperbolic region."""
    saddle = (bending.gauss < 0) & curved
    link = graph.tocoo()
    keep = saddle[link.row] & saddle[link.col]
    inner = sp.coo_array((link.data[keep], (link.row[keep], link.col[keep])), shape=graph.shape)
    _, region = connected_components(inner, directed=False)
    kappa = np.abs(bending.kappa)
    vote = np.bincount(region, ratio**2 * np.sign(kappa[:, 0] - kappa[:, 1]))
    return (vote[region] > -1e-9).astype(np.int64)


def _drawn(
    surface: FreeformSurface,
    u: FloatArray,
    points: FloatArray,
    bending: Bending,
    toward: ArrayLike | None,
) -> FloatArray:
    """Unit tangents that rows take where the curvature asks for none."""
    if toward is None and surface.domain is not None:
        lines = surface.derivatives(u)[0][:, 0]
    else:
        aim = np.eye(3)[np.ptp(points, axis=0).argmax()] if toward is None else toward
        aim = np.asarray(aim, float).reshape(3)
        if not np.linalg.norm(aim) > 0:
            raise LatticeError("toward is zero; give a direction in space")
        lines = aim - (bending.normals @ aim)[:, None] * bending.normals
        lines = lines / np.linalg.norm(aim)
        return np.asarray(lines)
    return np.asarray(lines / np.linalg.norm(lines, axis=1, keepdims=True))

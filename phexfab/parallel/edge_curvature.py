"""Edge curvatures of a parallel pair, and the face curvatures of quads that follow from them.

An edge of the Gauss image is ``s_j − s_i = κ_ij (m_j − m_i)``, so an edge of the offset M + d·S is
(1 + d κ_ij) times M's: κ_ij is *minus* a principal curvature in the sign of Steiner's formula,
1 − 2dH + d²K = (1 − dκ₁)(1 − dκ₂). A sphere of radius R with outward normals has κ_ij = 1/R and
H = −1/R. An edge of the offset vanishes at d = −1/κ_ij (``phexfab.parallel.pairs.pair_interval``).

References
----------
Thesis §7.1.1.2; Bobenko, Pottmann, Wallner 2010.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import MeshError
from phexfab.mesh.polymesh import PolyMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def edge_vectors(mesh: PolyMesh) -> FloatArray:
    """Return (C, 3) vectors from every corner to the next one around its face."""
    return mesh.vertices[mesh.corners[mesh.next_corner]] - mesh.vertices[mesh.corners]


def twin_corners(mesh: PolyMesh) -> IntArray:
    """Return (C,) the corner whose edge runs the other way, −1 on the border.

    Raises
    ------
    MeshError
        If two faces run along an edge in the same direction.
    """
    n = len(mesh.vertices)
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    key = tail * n + head
    order = np.argsort(key, kind="stable")
    ordered = key[order]
    again = np.flatnonzero(ordered[1:] == ordered[:-1])
    if len(again):
        c = order[again[0]]
        raise MeshError(
            f"edge {tail[c]}-{head[c]} is run along twice in the same direction: orient the faces "
            "alike and let at most two share an edge"
        )
    if not len(key):
        return np.zeros(0, np.int64)
    wanted = head * n + tail
    slot = np.minimum(np.searchsorted(ordered, wanted), len(order) - 1)
    return np.where(ordered[slot] == wanted, order[slot], -1)


def edge_curvatures(mesh: PolyMesh, gauss: PolyMesh) -> FloatArray:
    """Return κ_ij of the edge from every face corner to the next, 1/mm.

    Parameters
    ----------
    mesh, gauss : PolyMesh
        A parallel pair. Where edges are not quite parallel, κ fits best in the least-squares
        sense.

    Returns
    -------
    (C,) array in the order of ``mesh.corners``; both sides of an edge have the same value.
        Infinite, or not a number, where M's edge has no length.

    References
    ----------
    Thesis §7.1.1.2.
    """
    m, s = edge_vectors(mesh), edge_vectors(gauss)
    above, below = np.einsum("ij,ij->i", m, s), np.einsum("ij,ij->i", m, m)
    return np.divide(above, below, out=np.full(len(below), np.nan), where=below > 0)


def quad_curvatures(curvatures: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return H_f and K_f of quadrilaterals from their four edge curvatures.

        H = (κ₁₂κ₃₀ − κ₀₁κ₂₃) / D,    D = κ₀₁ + κ₂₃ − κ₁₂ − κ₃₀
        K = (κ₀₁κ₁₂κ₂₃ + κ₂₃κ₃₀κ₀₁ − κ₁₂κ₂₃κ₃₀ − κ₃₀κ₀₁κ₁₂) / D

    The thesis prints H with the opposite sign: with its own ``s_j − s_i = κ (m_j − m_i)`` the
    printed fraction is +area(M_f, S_f)/area(M_f), while H_F = −area(M_f, S_f)/area(M_f). K is of
    even degree and does not care. Written without the printed 1/κ, K also holds where κ = 0.

    Where all four κ agree the face of S is a scaled copy of M's: H = −κ, K = κ². Where D vanishes
    otherwise, the face of M has no area, and both are not numbers.

    Parameters
    ----------
    curvatures : (F, 4) array, 1/mm, of the edges 01, 12, 23, 30

    Returns
    -------
    mean, gaussian : (F,) arrays, 1/mm and 1/mm²

    Notes
    -----
    Only quads have such a formula. The two closing conditions Σe = 0 and Σκe = 0 leave an n-gon
    n − 2 free edge vectors; for n = 4 they are one affine frame, which cancels in ratios of areas.

    References
    ----------
    Thesis §7.1.1.2; Bobenko, Pottmann, Wallner 2010.
    """
    k = np.asarray(curvatures, float)
    if k.ndim != 2 or k.shape[1] != 4:
        raise MeshError(
            f"edge curvatures of shape {k.shape}: only quads have their H and K from edges; use "
            "the mixed areas for other faces"
        )
    a, b, c, d = k.T
    below = (a - b) + (c - d)
    scale = np.abs(k).max(axis=1, initial=0.0)
    same = np.ptp(k, axis=1) <= 4 * np.finfo(float).eps * scale
    safe = np.where(same | (below == 0), np.nan, below)
    mean = np.where(same, -k.mean(axis=1), (b * d - a * c) / safe)
    cubic = a * c * (b + d) - b * d * (a + c)
    return mean, np.where(same, k.mean(axis=1) ** 2, cubic / safe)


def quad_face_curvatures(mesh: PolyMesh, gauss: PolyMesh) -> tuple[FloatArray, FloatArray]:
    """Return (F,) H_f and K_f of a quad mesh by way of its edge curvatures.

    Raises
    ------
    MeshError
        If a face is not a quadrilateral.
    """
    odd = np.flatnonzero(mesh.sides != 4)
    if len(odd):
        raise MeshError(
            f"face {odd[0]} has {mesh.sides[odd[0]]} sides: edge curvatures give H and K of quads "
            "only; use pair_curvatures"
        )
    return quad_curvatures(edge_curvatures(mesh, gauss).reshape(-1, 4))

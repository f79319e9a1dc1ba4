"""The minimal solve: boundary heights in, the discrete minimal surface out, by one linear solve.

The mixed area of a panel with its Gauss image is linear in the heights of the panel and its
neighbours,

    area(M_f, S_f) = ½ Σ_g ℓ_fg (h_g − h_f cos t_fg) / sin t_fg,

with the signed edge lengths ℓ of S and the angles t between normals. Setting all of them to zero
is the discrete form of (Δ + 2) h = 0 for the support function of a minimal surface.

References
----------
Thesis §7.1.2, §7.2.2.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import MeshError
from phexfab.linalg import Factor, factorise
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]
Weights = tuple[FloatArray, FloatArray]


def _weights(shell: Shell) -> Weights:
    """Return ℓ/(2 sin t) and cos t of every panel corner's edge to the neighbour beyond it."""
    panels, _, _, neighbours = shell.rings
    mesh, s = shell.mesh, shell.gauss.vertices
    n_f = shell.normals[panels[mesh.face_of_corner]]
    n_g = shell.normals[neighbours]
    cross = np.cross(n_f, n_g)
    sine = np.linalg.norm(cross, axis=1)
    if len(sine) and not sine.min() > 1e-12:
        raise MeshError(
            f"panel {int(mesh.face_of_corner[sine.argmin()])} and a neighbour have the same "
            "normal: the Gauss image has collapsed there"
        )
    edge = s[mesh.corners[mesh.next_corner]] - s[mesh.corners]
    length = np.einsum("ij,ij->i", edge, cross) / sine
    return length / sine / 2, np.einsum("ij,ij->i", n_f, n_g)


def mixed_area_matrix(shell: Shell, weights: Weights | None = None) -> sp.csr_matrix:
    """Return the (P, F) sparse matrix A with ``A @ heights = area(M_f, S_f)`` for every panel.

    Raises
    ------
    MeshError
        If two neighbours have the same normal.
    """
    panels, _, _, neighbours = shell.rings
    weight, cosine = _weights(shell) if weights is None else weights
    row = shell.mesh.face_of_corner
    n = len(panels)
    shape = (n, len(shell.normals))
    off = sp.csr_matrix((weight, (row, neighbours)), shape=shape)
    diagonal = np.bincount(row, weights=-weight * cosine, minlength=n)
    return (off + sp.csr_matrix((diagonal, (np.arange(n), panels)), shape=shape)).tocsr()


def local_mixed_areas(
    shell: Shell, heights: FloatArray, weights: Weights | None = None
) -> FloatArray:
    """Return the same areas with heights over a corner of each panel instead of the origin.

    Equal to ``mixed_area_matrix(shell) @ heights`` but for rounding, which then grows with the
    size of a panel and not with its distance from the origin.
    """
    panels, starts, _, neighbours = shell.rings
    weight, cosine = _weights(shell) if weights is None else weights
    mesh = shell.with_heights(heights).mesh
    row = mesh.face_of_corner
    origin = mesh.vertices[mesh.corners[starts[:-1]]][row]
    over_g = heights[neighbours] - np.einsum("ij,ij->i", shell.normals[neighbours], origin)
    over_f = heights[panels[row]] - np.einsum("ij,ij->i", shell.normals[panels[row]], origin)
    areas = np.bincount(row, weights=weight * (over_g - over_f * cosine), minlength=len(panels))
    return np.asarray(areas, float)


@dataclass(frozen=True, eq=False)
class MinimalSolver:
    """Keeps the factorised system of one Gauss image, for any number of boundary heights."""

    shell: Shell
    border: NDArray[np.int64]
    coupling: sp.csr_matrix
    factor: Factor
    sign: float
    weights: Weights

    @classmethod
    def of(cls, shell: Shell) -> MinimalSolver:
        """Factorise the minimal system of a shell's Gauss image.

        Raises
        ------
        SolveError
            If the system is singular.
        """
        weights = _weights(shell)
        matrix = mixed_area_matrix(shell, weights)
        is_panel = np.zeros(len(shell.normals), bool)
        is_panel[shell.panels] = True
        border = np.flatnonzero(~is_panel)
        # −½(Δ + 2) up to sign: positive definite exactly where the surface is stable.
        sign = 1.0 if matrix[:, shell.panels].diagonal().sum() > 0 else -1.0
        inner = sign * matrix[:, shell.panels]
        return cls(shell, border, sign * matrix[:, border], factorise(inner), sign, weights)

    def solve(self, heights: FloatArray) -> FloatArray:
        """Return (F,) heights: those given on the border planes, H_f = 0 on every panel."""
        solved = np.array(heights, float)
        right = -(self.coupling @ solved[self.border])
        solved[self.shell.panels] = self.factor.solve(right)
        for _ in range(2):  # refine with residuals that do not know where the origin is
            residual = self.sign * local_mixed_areas(self.shell, solved, self.weights)
            solved[self.shell.panels] -= self.factor.solve(residual)
        return solved

    def border_answer(self, change: FloatArray) -> FloatArray:
        """Return the (P,) change of panel heights when border heights change by (B,)."""
        return -self.factor.solve(self.coupling @ change, 0)

    def border_answer_transposed(self, weights: FloatArray) -> FloatArray:
        """Return (B,) of the transposed map: the matrix of the panels is symmetric."""
        return np.asarray(-(self.coupling.T @ self.factor.solve(weights, 0)), float)

    @property
    def index(self) -> int | None:
        """Number of area-decreasing directions with fixed border: 0 on a stable soap film."""
        return self.factor.negative_pivots


def solve_minimal(shell: Shell) -> Shell:
    """Return the discrete minimal surface with this Gauss image and these border heights.

    Parameters
    ----------
    shell : Shell
        Heights of its border planes are kept, those of its panels replaced.

    Raises
    ------
    SolveError
        If the system is singular: the Gauss image bounds a region on which the surface is just
        unstable (a hemisphere is the first one).

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> heights = shell.heights.copy()
    >>> heights[0] += 20.0  # mm: one border plane moves outwards
    >>> moved = px.solve_minimal(shell.with_heights(heights))
    >>> bool(px.is_discrete_minimal(moved.mesh, shell.gauss))
    True
    """
    return replace(shell, heights=MinimalSolver.of(shell).solve(shell.heights))

"""One door to sparse direct solvers: SuperLU always, PARDISO where ``pypardiso`` is installed.

Determinism comes first: PARDISO is used only when asked for by ``PHEXFAB_SOLVER=pardiso``.
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import SuperLU, splu

from phexfab.errors import MissingLibraryError, SolveError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


_PANEL = 3  # columns SuperLU updates at a time: on surfaces a tenth faster than its own choice


@dataclass(frozen=True, eq=False)
class Factor:
    """A factorised symmetric matrix (possibly indefinite) that solves with refinement."""

    matrix: Any
    backend: Any
    given: IntArray | None = None
    single: bool = False

    @property
    def order(self) -> IntArray | None:
        """The order of elimination, for matrices of the same pattern (None where unknown)."""
        if self.given is not None or not isinstance(self.backend, SuperLU):
            return self.given
        return np.argsort(self.backend.perm_c)

    def solve(self, right: FloatArray, refinements: int = 4) -> FloatArray:
        """Return x with ``matrix @ x = right``, refined until the residual is rounding.

        With no ``refinements`` the residual is not looked at: for steps that correct each other.

        Raises
        ------
        SolveError
            If the solution is not finite or its residual stays above 1e-8 of the right side.
        """
        x = self._raw(right)
        if not refinements and np.all(np.isfinite(x)):
            return x
        best, size = x, np.inf
        for _ in range(max(refinements, 1)):
            residual = right - self.matrix @ x
            now = float(np.abs(residual).max(initial=0.0))
            if not np.isfinite(now) or now >= size:
                break
            best, size = x, now
            x = x + self._raw(residual)
        scale = float(np.abs(right).max(initial=0.0)) + float(
            (abs(self.matrix) @ np.abs(best)).max(initial=0.0)
        )
        if not np.all(np.isfinite(best)) or size > 1e-8 * max(scale, 1e-300):
            raise SolveError(
                f"the linear system is singular to rounding (residual {size:.1e}); the Gauss image "
                "may just fill a region on which the surface is not stable: change the rectangle "
                "of parameters slightly"
            )
        return best

    def _raw(self, right: FloatArray) -> FloatArray:
        if isinstance(self.backend, SuperLU):
            given = right.astype(np.float32 if self.single else float, copy=False)
            if self.given is None:
                return np.asarray(self.backend.solve(given), float)
            x = np.empty_like(right)
            x[self.given] = self.backend.solve(given[self.given])
            return x
        return np.asarray(self.backend.solve(self.matrix, right))

    @property
    def negative_pivots(self) -> int | None:
        """Number of negative pivots, the matrix' negative eigenvalues (None where unknown).

        Sylvester's law: without pivoting off the diagonal, U's diagonal has the signs of D in
        LDLᵀ.
        """
        if not isinstance(self.backend, SuperLU):
            return None
        if not np.array_equal(self.backend.perm_r, self.backend.perm_c):
            return None
        return int(np.count_nonzero(self.backend.U.diagonal() < 0))


def factorise(matrix: Any, order: IntArray | None = None, *, single: bool = False) -> Factor:
    """Factorise a sparse symmetric matrix, indefinite ones too.

    Parameters
    ----------
    matrix : (n, n) sparse
    order : (n,) int, optional
        ``Factor.order`` of a matrix with the same pattern: it need not be sought again.
    single : bool
        Factors of single precision, cheaper by a quarter: refinement gives the other digits where
        the condition is below about 1e6. Without effect on PARDISO.

    Raises
    ------
    SolveError
        If the matrix is exactly singular.
    """
    csc = sp.csc_matrix(matrix)
    if os.environ.get("PHEXFAB_SOLVER", "") == "pardiso":
        try:
            import pypardiso
        except ImportError as error:
            raise MissingLibraryError(
                "PHEXFAB_SOLVER=pardiso needs the library pypardiso: pip install pypardiso"
            ) from error
        return Factor(csc.tocsr(), pypardiso.PyPardisoSolver())
    given = csc.astype(np.float32) if single else csc
    try:
        backend = splu(
            given if order is None else given[order][:, order],
            permc_spec="MMD_AT_PLUS_A" if order is None else "NATURAL",
            diag_pivot_thresh=0.0,
            panel_size=_PANEL,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise SolveError(f"the linear system is singular: {error}") from error
    return Factor(csc, backend, order, single)

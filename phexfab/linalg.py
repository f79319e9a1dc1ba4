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


@dataclass(frozen=True, eq=False)
class Factor:
    """A factorised symmetric matrix (possibly indefinite) that solves with refinement."""

    matrix: Any
    backend: Any

    def solve(self, right: FloatArray) -> FloatArray:
        """Return x with ``matrix @ x = right``, refined until the residual is rounding.

        Raises
        ------
        SolveError
            If the solution is not finite or its residual stays above 1e-8 of the right side.
        """
        x = self._raw(right)
        best, size = x, np.inf
        for _ in range(4):
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
            return np.asarray(self.backend.solve(right))
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


def factorise(matrix: Any) -> Factor:
    """Factorise a sparse symmetric matrix, indefinite ones too.

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
    try:
        backend = splu(
            csc,
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
    except RuntimeError as error:
        raise SolveError(f"the linear system is singular: {error}") from error
    return Factor(csc, backend)

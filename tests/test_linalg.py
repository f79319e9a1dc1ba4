"""The sparse solver door: refinement, inertia, singular systems."""

import numpy as np
import pytest
import scipy.sparse as sp

from phexfab.errors import SolveError
from phexfab.linalg import factorise


def indefinite(n, shift):
    grid = sp.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n))
    return (sp.kron(grid, sp.eye(n)) + sp.kron(sp.eye(n), grid) - shift * sp.eye(n * n)).tocsc()


@pytest.mark.parametrize("shift", [0.0, 0.3, 1.7])
def test_negative_pivots_count_negative_eigenvalues(shift):
    matrix = indefinite(12, shift)
    eigenvalues = np.linalg.eigvalsh(matrix.toarray())
    assert factorise(matrix).negative_pivots == int((eigenvalues < 0).sum())


def test_the_residual_is_rounding():
    matrix = indefinite(30, 0.3)
    rng = np.random.default_rng(0)
    x = rng.normal(size=900)
    solved = factorise(matrix).solve(matrix @ x)
    assert np.abs(matrix @ solved - matrix @ x).max() < 1e-13
    assert np.abs(solved - x).max() < 1e-10


def test_a_singular_system_is_refused():
    matrix = sp.csc_matrix(np.array([[1.0, 1.0], [1.0, 1.0]]))
    with pytest.raises(SolveError, match="singular"):
        factorise(matrix).solve(np.array([1.0, 2.0]))


@pytest.mark.parametrize("single", [False, True])
def test_the_order_of_one_factor_serves_the_next(single):
    n = 40
    line = sp.diags_array([-np.ones(n - 1), 2.1 * np.ones(n), -np.ones(n - 1)], offsets=[-1, 0, 1])
    grid = (sp.kron(line, sp.eye_array(n)) + sp.kron(sp.eye_array(n), line)).tocsc()
    first = factorise(grid, single=single)
    assert np.array_equal(np.sort(first.order), np.arange(n * n))
    second = factorise(grid * 1.7, first.order, single=single)
    assert np.array_equal(second.order, first.order)
    assert second.backend.L.nnz <= 1.02 * first.backend.L.nnz
    right = np.random.default_rng(0).normal(size=n * n)
    x = second.solve(right)
    assert np.abs(1.7 * grid @ x - right).max() < 1e-13  # refined, in single precision too
    rough = np.abs(1.7 * grid @ second.solve(right, 0) - right).max()
    assert (1e-9 < rough < 1e-4) if single else rough < 1e-13

"""Border heights that let the discrete surface be smooth right up to its border.

Tangent planes miss the discrete equation L h = 0 by a smooth function of second order in the step.
With the tangent heights kept on the border the solution makes up for it inside only, and where the
border zigzags (the ends of rows) its second differences, hence K, are wrong at first order. A
smooth correction of second order, found as a polynomial in the curvature-line coordinates, takes
the miss away everywhere: K converges at second order on every panel, and the shell comes nearer
to the smooth surface.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import NDArray

from phexfab.minimal.laplacian import MinimalSolver, mixed_area_matrix
from phexfab.parallel.shell import Shell
from phexfab.remesh.lattice import Lattice

FloatArray = NDArray[np.float64]
DEGREE = 8
WAVES = 5  # around a lattice that closes
ROUNDS = 40  # of conjugate gradients, at most
SHARE = 0.1  # weight of the correction's size against what it leaves of the miss


def smooth_border(
    start: Shell, on: Lattice, solver: MinimalSolver, period: complex | None = None
) -> FloatArray:
    """Return the (F,) heights of a tangent shell, those of its border planes corrected.

    Parameters
    ----------
    start : Shell
        From ``tangent_shell``.
    on : Lattice
        A rectangle's, or a grown one, which has no global coordinates: there the heights are those
        whose solution is nearest to the tangent planes, in the sense of least squares.
    solver : MinimalSolver
        Of that shell.
    period : complex, optional
        The surface's, where the lattice closes.

    Notes
    -----
    Minimised are ``|L(h + p)|²/|L h|² + SHARE² |p|²/|e|²`` over polynomials p of total degree 8
    (trigonometric around a ring), with e the change that the solve makes without p.
    """
    if on.parameters is not None:
        return _nearest_border(start, solver)
    miss = mixed_area_matrix(start, solver.weights) @ start.heights
    change = solver.solve(start.heights) - start.heights
    size, change_size = np.linalg.norm(miss), np.linalg.norm(change)
    if not (size > 0 and change_size > 0):
        return start.heights
    shapes = _shapes(on, period)
    moved = mixed_area_matrix(start, solver.weights) @ shapes
    rows = np.concatenate([moved / size, SHARE / change_size * shapes])
    right = np.concatenate([-miss / size, np.zeros(len(shapes))])
    # The triangular factor says all that least squares needs, and costs one pass over the rows.
    triangle: FloatArray = np.asarray(np.linalg.qr(np.column_stack([rows, right]), "r"), float)
    share = np.linalg.lstsq(triangle[:-1, :-1], triangle[:-1, -1], rcond=1e-12)[0]
    return np.asarray(start.heights + shapes @ share, float)


def _nearest_border(start: Shell, solver: MinimalSolver) -> FloatArray:
    """Return heights whose border planes give the solution nearest to the tangent planes.

    Where a film is nearly unstable, as large pieces of periodic surfaces are, the solution
    magnifies a few of the small misses at the border. Moving the border planes by as little takes
    that away: minimised is ``|h − h₀|²`` over all solutions h, by conjugate gradients on the
    border's heights. Few rounds are needed, for short waves along the border do not reach far.
    """
    panels = start.panels
    off = (solver.solve(start.heights) - start.heights)[panels]
    step = -solver.border_answer_transposed(off)
    left, size = step.copy(), float(step @ step)
    moved, enough = np.zeros(len(step)), 1e-6 * size
    for _ in range(ROUNDS):
        if size <= enough:
            break
        image = step + solver.border_answer_transposed(solver.border_answer(step))
        share = size / float(step @ image)
        moved, left = moved + share * step, left - share * image
        before, size = size, float(left @ left)
        step = left + size / before * step
    heights = np.array(start.heights, float)
    heights[solver.border] += moved
    return heights


def _shapes(on: Lattice, period: complex | None) -> FloatArray:
    """Return the (F, n) values of the polynomials at the lattice points."""
    u, v = on.points.real, on.points.imag
    if not on.closed or period is None:
        return _products(_powers(u), _powers(v))
    around, across = (v, u) if abs(period.imag) > abs(period.real) else (u, v)
    turn = 2 * np.pi / abs(period) * around[:, None] * np.arange(1, WAVES + 1)
    waves = np.concatenate([np.ones((len(u), 1)), np.cos(turn), np.sin(turn)], axis=1)
    return np.asarray((_powers(across)[:, :, None] * waves[:, None, :]).reshape(len(u), -1), float)


def _powers(x: FloatArray) -> FloatArray:
    low, high = x.min(), x.max()
    return np.asarray(chebvander((2 * x - low - high) / (high - low), DEGREE), float)


def _products(a: FloatArray, b: FloatArray) -> FloatArray:
    i, j = np.meshgrid(np.arange(DEGREE + 1), np.arange(DEGREE + 1), indexing="ij")
    keep = (i + j).ravel() <= DEGREE
    return np.asarray(a[:, i.ravel()[keep]] * b[:, j.ravel()[keep]], float)

"""Integrals of analytic functions along straight segments, refined until they stand still."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import SurfaceError
from phexfab.surface.holomorphic import ComplexArray, show

NODES, WEIGHTS = (0.5 * a for a in np.polynomial.legendre.leggauss(16))
NODES = NODES + 0.5
DEPTH = 34
MOST = 4096  # panels left open per segment, or altogether when there are many segments

Panel = tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]


def _halves(owner: NDArray[np.int64], a: NDArray[np.float64], b: NDArray[np.float64]) -> Panel:
    """Return every panel cut into two, left and right next to each other."""
    middle = 0.5 * (a + b)
    return (
        np.repeat(owner, 2),
        np.stack([a, middle], 1).ravel(),
        np.stack([middle, b], 1).ravel(),
    )


def _refuse(what: str, place: complex, start: complex, end: complex) -> SurfaceError:
    return SurfaceError(
        f"{what} does not converge near z = {show(place)}, on the way from {show(start)} to "
        f"{show(end)}: a pole, an end or a branch cut lies there; choose another base or parameter"
    )


def integrate(
    integrand: Callable[[ComplexArray], ComplexArray],
    start: complex,
    ends: ComplexArray,
    tolerance: float = 1e-14,
) -> ComplexArray:
    """Return the integral of a vector of analytic functions from ``start`` to each of ``ends``.

    Parameters
    ----------
    integrand : callable
        Maps (n, k) parameters to (n, k, c) values; poles may come back not finite.
    start : complex
    ends : (n,) complex
    tolerance : float
        Relative to the integral of the modulus along each segment.

    Returns
    -------
    (n, c) complex

    Raises
    ------
    SurfaceError
        If a segment meets a singularity; the message names the place.
    """
    ends = np.asarray(ends, complex)
    span = ends - start

    def gauss(panel: Panel) -> tuple[ComplexArray, NDArray[np.float64]]:
        owner, a, b = panel
        t = a[:, None] + (b - a)[:, None] * NODES
        with np.errstate(all="ignore"):
            values = integrand(start + span[owner, None] * t)
            values = values * ((b - a) * span[owner])[:, None, None] * WEIGHTS[:, None]
            return values.sum(1), np.abs(values).sum(1).max(1)

    owner = np.arange(len(ends))
    panel: Panel = (owner, np.zeros(len(ends)), np.ones(len(ends)))
    coarse, mass = gauss(panel)
    mass = np.where(np.isfinite(mass), mass, 0.0)
    total = np.zeros((len(ends), coarse.shape[1]), complex)
    for _ in range(DEPTH):
        if len(panel[0]) > max(MOST, 64 * len(ends)):
            break
        halves = _halves(*panel)
        fine, fine_mass = gauss(halves)
        pairs = fine.reshape(-1, 2, fine.shape[1])
        with np.errstate(invalid="ignore"):
            gap = np.abs(pairs.sum(1) - coarse).max(1)
            grown = fine_mass.reshape(-1, 2).sum(1)
        np.maximum.at(mass, panel[0], np.where(np.isfinite(grown), grown, 0.0))
        done = gap <= tolerance * mass[panel[0]]
        np.add.at(total, panel[0][done], pairs[done].sum(1))
        if done.all():
            return total
        rest = np.repeat(~done, 2)
        panel, coarse = (halves[0][rest], halves[1][rest], halves[2][rest]), fine[rest]
    i = int(panel[0][0])
    raise _refuse("the integral of the null curve", start + span[i] * panel[1][0], start, ends[i])


def integrate_root(
    quantity: Callable[[ComplexArray], ComplexArray],
    start: complex,
    root: complex,
    ends: ComplexArray,
    tolerance: float = 1e-13,
) -> ComplexArray:
    """Return the integral of a square root, continuous from ``start`` to each of ``ends``.

    Parameters
    ----------
    quantity : callable
        The analytic function under the root.
    start, root : complex
        Where to begin, and which of the two roots is meant there.
    ends : (n,) complex
    tolerance : float
        Relative to the integral over each of the panels that the segment is cut into, or a
        hundredth of it to the whole segment: near a zero, rounding keeps a panel from better.

    Returns
    -------
    (n,) complex

    Raises
    ------
    SurfaceError
        If a segment meets a zero or a pole; the message names the place.
    """
    ends = np.asarray(ends, complex)
    span = ends - start

    def gauss(panel: Panel) -> tuple[ComplexArray, ComplexArray, NDArray, NDArray]:
        """Integrate root(q/q_a) over each panel; return also root(q_b/q_a), if sure, √|q_a|."""
        owner, a, b = panel
        t = np.concatenate([[0.0], NODES, [1.0]])
        with np.errstate(all="ignore"):
            q = quantity(start + span[owner, None] * (a[:, None] + (b - a)[:, None] * t))
            ratio = q[:, 1:] / q[:, :1]
            sure = np.all(np.isfinite(ratio) & (ratio.real > 0), axis=1)
            roots = np.sqrt(ratio)
            part = (b - a) * span[owner] * (roots[:, :-1] @ WEIGHTS)
            return part, roots[:, -1], sure, np.sqrt(np.abs(q[:, 0]))

    owner = np.arange(len(ends))
    panel: Panel = (owner, np.zeros(len(ends)), np.ones(len(ends)))
    coarse = gauss(panel)
    with np.errstate(all="ignore"):
        whole = np.nan_to_num(np.abs(coarse[0]) * coarse[3], posinf=0.0)
    kept: list[tuple[NDArray, ...]] = []
    for depth in range(DEPTH + 1):
        if depth == DEPTH or len(panel[0]) > max(MOST, 64 * len(ends)):
            i = int(panel[0][0])
            place = start + span[i] * panel[1][0]
            raise _refuse("the curvature-line coordinate", place, start, ends[i])
        halves = _halves(*panel)
        part, turn, sure, size = gauss(halves)
        with np.errstate(all="ignore"):
            joined = part[::2] + turn[::2] * part[1::2]
            mass = np.maximum(np.abs(part[::2]) + np.abs(turn[::2] * part[1::2]), 1e-300)
            gap = np.abs(joined - coarse[0])
            close = gap <= tolerance * mass
            close |= gap * size[::2] <= 0.01 * tolerance * whole[panel[0]]
            done = close & sure[::2] & sure[1::2]
        done |= span[panel[0]] == 0
        kept.append(
            (panel[0][done], panel[1][done], joined[done], turn[::2][done] * turn[1::2][done])
        )
        if done.all():
            break
        rest = np.repeat(~done, 2)
        panel = (halves[0][rest], halves[1][rest], halves[2][rest])
        coarse = (part[rest], turn[rest], sure[rest], size[rest])

    # Link the panels of every segment in order: each one starts with the root that the last left.
    owner, a, joined, turn = (np.concatenate(column) for column in zip(*kept, strict=True))
    order = np.lexsort((a, owner))
    owner, joined, turn = owner[order], joined[order], turn[order]
    first = np.searchsorted(owner, np.arange(len(ends)))
    count = np.diff(np.append(first, len(owner)))
    total, current = np.zeros(len(ends), complex), np.full(len(ends), complex(root))
    for k in range(int(count.max(initial=0))):
        has = np.flatnonzero(count > k)
        rows = first[has] + k
        total[has] += current[has] * joined[rows]
        current[has] *= turn[rows]
    total[span == 0] = 0.0
    return total

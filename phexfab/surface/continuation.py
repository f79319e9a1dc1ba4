"""The parameter z as a function of the curvature-line coordinate w: analytic continuation.

A step from w to w + d solves ``∫ √Q dz = d`` for the new z by Newton, with the integral over the
step taken by Gauss' rule; nothing accumulates but rounding. A step is only taken while Q stays
within half of its value at the start of the step, so that no zero or pole is near and the
root's branch is sure.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import SurfaceError
from phexfab.surface.holomorphic import CIRCLE, ComplexArray, show

Quantity = Callable[[ComplexArray], ComplexArray]

_RULES = [(0.5 + 0.5 * x, 0.5 * w) for x, w in map(np.polynomial.legendre.leggauss, (4, 7, 16))]
REACH = 0.5  # |Q/Q_start - 1| allowed within one step
SMALLEST = 1e-7  # of the way: a shorter step means that a singularity is in it
ZERO_OR_POLE = ("a zero", "a pole")
INFINITY = "the point at infinity of z"
CLUSTER = 16  # points that share one long way from the base


@dataclass(frozen=True, eq=False)
class Germ:
    """Places where z(w) is known: ``w``, ``z``, ``Q(z)`` and the root ``√Q`` on its branch."""

    w: ComplexArray
    z: ComplexArray
    q: ComplexArray
    root: ComplexArray

    def __getitem__(self, index: NDArray) -> Germ:
        return Germ(self.w[index], self.z[index], self.q[index], self.root[index])


def start_germ(hopf: Quantity, base: complex) -> Germ:
    """Return the germ at the base, where w = 0 and the root is the principal one.

    Raises
    ------
    SurfaceError
        If the base is a zero or a pole of the Hopf differential.
    """
    z = np.array([base], complex)
    q = hopf(z)
    if not np.isfinite(q[0]) or q[0] == 0:
        raise SurfaceError(
            f"the base z = {show(base)} is {describe(hopf, base)[0]}; "
            "curvature-line coordinates cannot start there: choose another base"
        )
    return Germ(np.zeros(1, complex), z, q, np.sqrt(q))


def hop(hopf: Quantity, germ: Germ, w: ComplexArray) -> tuple[Germ, NDArray[np.bool_]]:
    """Return the germs at ``w``, one step from the given ones, and which steps are sure.

    Parameters
    ----------
    hopf : callable
        Q(z) of (n, k) parameters.
    germ : Germ of n places
    w : (n,) complex
    """
    step = w - germ.w
    dz = step / germ.root
    sure = np.ones(len(w), bool)
    with np.errstate(all="ignore"):
        for rule in (0, 1, 2, 2):
            x, weights = _RULES[rule]
            t = np.append(x, 1.0)
            values = hopf(germ.z[:, None] + dz[:, None] * t)
            ratio = values / germ.q[:, None]
            sure &= (np.abs(ratio - 1.0) <= REACH).all(1)
            roots = germ.root[:, None] * np.sqrt(ratio)
            change = (step - dz * (roots[:, :-1] @ weights)) / roots[:, -1]
            dz = dz + change
        # Newton doubles the digits: after a last change of 1e-8 nothing is left to do.
        sure &= np.abs(change) <= 1e-8 * np.abs(dz) + 1e-300
        z = germ.z + dz
        q = hopf(z)
        root = germ.root * np.sqrt(q / germ.q)
    return Germ(w, z, q, root), sure & np.isfinite(root)


def march(hopf: Quantity, start: Germ, w: ComplexArray) -> tuple[Germ, NDArray[np.float64]]:
    """Continue germs along straight segments, all of them in step, each with its own pace.

    Parameters
    ----------
    hopf : callable
    start : Germ of n places
    w : (n,) complex
        Where each of them goes.

    Returns
    -------
    (Germ, (n,) float)
        The germs at ``w``, and the shortest step that each way needed (infinite when one step
        was enough): no singularity is nearer to the way than that.

    Raises
    ------
    SurfaceError
        If a way meets a zero or pole of Q; the message names the place in z and in w.
    """
    here = [start.w.copy(), start.z.copy(), start.q.copy(), start.root.copy()]
    pace = np.abs(w - start.w)
    length = np.maximum(pace, 1e-300)
    shortest = np.full(len(w), np.inf)
    todo = np.flatnonzero(pace > 0)
    while len(todo):
        now = Germ(*(a[todo] for a in here))
        left = w[todo] - now.w
        share = pace[todo] / np.maximum(np.abs(left), 1e-300)
        target = np.where(share >= 0.999, w[todo], now.w + share * left)
        new, sure = hop(hopf, now, target)
        moved = todo[sure]
        for a, b in zip(here, (new.w, new.z, new.q, new.root), strict=True):
            a[moved] = b[sure]
        whole = pace[moved] >= length[moved]
        shortest[moved] = np.where(whole, shortest[moved], np.minimum(shortest[moved], pace[moved]))
        pace[moved] *= 1.6
        pace[todo[~sure]] *= 0.5
        lost = todo[~sure][pace[todo[~sure]] < SMALLEST * length[todo[~sure]]]
        if len(lost):
            i = int(lost[0])
            what, place, at = describe(hopf, here[1][i], here[0][i], here[3][i])
            raise SurfaceError(
                f"curvature-line coordinates cannot be continued to w = {show(w[i])}: {what} lies "
                f"in the way at z = {show(place)}, w = {show(at)}; "
                "choose a rectangle that avoids it"
            )
        todo = todo[(here[0] != w)[todo]]
    return Germ(*here), shortest


def continue_from_base(hopf: Quantity, base: complex, w: ComplexArray) -> Germ:
    """Return the germs at ``w``, continued from the base along straight segments from w = 0.

    Many points share their ways: one way leads to the middle of every cell of a grid, and from
    there it is one step. A cell whose way came so near to a singularity that its points might
    see it from the other side is taken apart again.

    Parameters
    ----------
    hopf : callable
    base : complex
    w : (n,) complex

    Raises
    ------
    SurfaceError
        As for `march`.
    """
    origin = start_germ(hopf, base)
    zeros = np.zeros(len(w), np.int64)
    if len(w) < 4 * CLUSTER:
        return march(hopf, origin[zeros], w)[0]
    low = complex(w.real.min(), w.imag.min())
    size = max(np.ptp(w.real), np.ptp(w.imag), 1e-300) / np.ceil(np.sqrt(len(w) / CLUSTER))
    away = (w - low) / size
    column, row = away.real.astype(np.int64), away.imag.astype(np.int64)
    index = column * (row.max() + 1) + row
    _, first, cell = np.unique(index, return_index=True, return_inverse=True)
    middle = low + size * (column[first] + 0.5 + 1j * (row[first] + 0.5))
    try:
        germs, shortest = march(hopf, origin[np.zeros(len(middle), np.int64)], middle)
    except SurfaceError:  # a middle is not one of the points asked for
        return march(hopf, origin[zeros], w)[0]
    result, sure = hop(hopf, germs[cell], w)
    alone = np.flatnonzero(~sure | (shortest[cell] < size))
    if len(alone):
        again, _ = march(hopf, origin[zeros[alone]], w[alone])
        for a, b in zip(
            (result.z, result.q, result.root), (again.z, again.q, again.root), strict=True
        ):
            a[alone] = b
    return result


def describe(
    hopf: Quantity, z: complex, w: complex = 0.0, root: complex | None = None
) -> tuple[str, complex, complex]:
    """Say which zero or pole of Q is nearest to ``z``: its kind, its z, and its w.

    Circles about z grow until the winding number of Q is not zero; that is the order, and the
    first moment of Q'/Q on the circle is the place. A pole of order 2 or more lies at w = inf.

    Parameters
    ----------
    hopf : callable
    z, w, root : complex
        A place near the singularity, its coordinate and the root of Q there.
    """
    place, order = complex(z), 0
    for radius in 1e-7 * 3.0 ** np.arange(15):
        place, circle = complex(z), radius * CIRCLE
        for _ in range(5):  # each circle is centred at the place that the one before gave
            with np.errstate(all="ignore"):
                q = hopf(place + circle)
                turns = np.angle(np.roll(q, -1) / q)
                # Between two samples the phase must not turn so far that its sense is unsure.
                clear = np.isfinite(turns).all() and np.abs(turns).max() < 2.0
                order = round(turns.sum() / (2 * np.pi)) if clear else 0
                if not order:
                    break
                speed = np.fft.ifft(np.fft.fft(q) * np.fft.fftfreq(len(q), 1.0 / len(q)))
                shift = (circle * speed / q).mean() / order
            if not abs(shift) <= 2 * radius:
                order = 0
                break
            place += complex(shift)
        if order and abs(shift) <= 1e-3 * radius:
            break
        place, order = complex(z), 0
    if order <= -2:
        w = complex(np.inf)  # an infinite way in w, so never in a rectangle
    elif order and root is not None:
        # With 1 - t = s² along the way there, √Q is analytic in s at its end, for any order > -2.
        s, weights = _RULES[2]
        with np.errstate(all="ignore"):
            roots = root * np.sqrt(
                hopf(np.asarray(place + (z - place) * s * s, complex)) / hopf(np.array(z, complex))
            )
        w = complex(w - (z - place) * (2 * s * roots) @ weights)
    if order:
        kind = ZERO_OR_POLE[order < 0]
        return f"{kind} of order {abs(order)} of the Hopf differential", place, w
    # Where Q behaves like z^k with k < -2 on a wide circle, w stays finite as z grows.
    with np.errstate(all="ignore"):
        q = hopf(np.asarray(z * (1 + 0.5 * CIRCLE), complex))
        power = 2 * (q * CIRCLE.conj()).mean() / hopf(np.array(z, complex))
    if power.real < -2.5 and abs(power - round(power.real)) < 0.02:
        away = 0.0 if root is None else 2.0 / (power + 2.0) * z * root
        return INFINITY, complex(np.inf), complex(w - away)
    return "a singular point", place, w

"""Integrals of √Q e^h along ways between umbilics and around holes, ready for any h.

A way is cut into panels of Gauss' rule once; afterwards an integral is a sum over its nodes. Where
a way ends in an umbilic the substitution ``t = s²(3 - 2s)`` makes the integrand analytic there.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import SurfaceError
from phexfab.surface.domain import Disc
from phexfab.surface.holomorphic import ComplexArray, show

FloatArray = NDArray[np.float64]
Quantity = Callable[[ComplexArray], ComplexArray]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(16)
MOST_PANELS = 2048
INSIDE = np.linspace(0.0, 1.0, 65)
GOOD, FAIR = 2e-14, 1e-9  # relative change of an integral: stop refining; still accept


@dataclass(frozen=True)
class Arc:
    """A straight piece of a way, or a piece of a circle.

    Attributes
    ----------
    start, end : complex
    centre : complex or None
        Of the circle; None for a straight piece.
    sweep : float
        Angle from start to end, radians, positive counter-clockwise.
    ends : (bool, bool)
        Whether the piece starts and whether it ends in a zero of Q.
    """

    start: complex
    end: complex
    centre: complex | None = None
    sweep: float = 0.0
    ends: tuple[bool, bool] = (False, False)

    def at(self, s: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Return z and dz/ds at numbers s in [0, 1]."""
        first, last = self.ends
        if first and last:
            t, speed = s * s * (3 - 2 * s), 6 * s * (1 - s)
        elif first:
            t, speed = s * s, 2 * s
        elif last:
            t, speed = s * (2 - s), 2 * (1 - s)
        else:
            t, speed = s, np.ones_like(s)
        if self.centre is None:
            span = self.end - self.start
            return np.asarray(self.start + span * t, complex), np.asarray(span * speed, complex)
        arm = (self.start - self.centre) * np.exp(1j * self.sweep * t)
        return np.asarray(self.centre + arm), np.asarray(1j * self.sweep * arm * speed)


@dataclass(frozen=True, eq=False)
class Way:
    """Nodes of a way and the weights that integrate √Q dz.

    Attributes
    ----------
    nodes, weights : (k,) complex
    piece : (k,) int
        The piece of the way that a node lies on.
    sign : float
        1 where the root at the end of a closed way is that at its start, else -1.
    panels : int
        Panels of each piece.
    """

    nodes: ComplexArray
    weights: ComplexArray
    piece: NDArray[np.int64]
    sign: float
    panels: int


def straight(start: complex, end: complex, domain: Disc, ends: tuple[bool, bool]) -> list[Arc]:
    """Return the straight way from ``start`` to ``end``, around the holes that it meets.

    Where that leaves the domain, the way goes over the centre, from which all is seen.
    """
    span = end - start
    over = domain.centre
    leaves = not domain.contains(start + span * INSIDE, 1e-9 * domain.radius).all()
    if leaves and not domain.is_round and over not in (start, end):
        first = straight(start, over, domain, (ends[0], False))
        return first + straight(over, end, domain, (False, ends[1]))
    crossed = []
    for c, r in domain.holes:
        middle = ((c - start) / span).real  # fraction at the foot of the perpendicular
        off = abs(((c - start) / span).imag) * abs(span)
        if off < r * (1 - 1e-9):
            half = np.sqrt(r * r - off * off) / abs(span)
            if middle - half > -1e-9 and middle + half < 1 + 1e-9:
                crossed.append((middle - half, middle + half, c))
    pieces, here = [], start
    for enter, leave, c in sorted(crossed, key=lambda x: x[0]):
        a, b = start + enter * span, start + leave * span
        pieces.append(Arc(here, a, ends=(ends[0] and here == start, False)))
        pieces.append(Arc(a, b, c, float(np.angle((b - c) / (a - c)))))
        here = b
    pieces.append(Arc(here, end, ends=(ends[0] and here == start, ends[1])))
    return [p for p in pieces if abs(p.start - p.end) > 0]


def way(quantity: Quantity, pieces: list[Arc], root: complex | None = None, panels: int = 0) -> Way:
    """Return nodes and weights of a way, with √Q continuous along it.

    Parameters
    ----------
    quantity : callable
        Q.
    pieces : list of Arc
        One after the other.
    root : complex, optional
        √Q at the start of the way, to tell which of the two roots is meant.
    panels : int
        Of a way much like this one; 0 to find out how many it takes.

    Raises
    ------
    SurfaceError
        If the way meets a zero or pole of Q.
    """
    if panels:
        known = _sampled(quantity, pieces, root, panels)
        if known is not None:
            return known
    last, panels = None, 2
    while panels <= MOST_PANELS:
        made = _sampled(quantity, pieces, root, panels)
        if made is not None:
            sums = np.array([made.weights.sum(), (made.weights * made.nodes).sum()])
            mass = float(np.abs(made.weights).sum())
            change = np.inf if last is None else float(np.abs(sums - last).max()) / mass
            if change <= GOOD or (change <= FAIR and 2 * panels > MOST_PANELS):
                return made
            last = sums
        panels *= 2
    raise SurfaceError(
        f"the way from z = {show(pieces[0].start)} to {show(pieces[-1].end)} runs into a zero or a "
        "pole of the Hopf differential: change the domain slightly"
    )


def _sampled(
    quantity: Quantity, pieces: list[Arc], root: complex | None, panels: int
) -> Way | None:
    s = ((np.arange(panels)[:, None] + 0.5 + 0.5 * NODES) / panels).ravel()
    share = np.tile(0.5 * WEIGHTS / panels, panels)
    parts = [piece.at(s) for piece in pieces]
    z = np.concatenate([p[0] for p in parts])
    dz = np.concatenate([p[1] for p in parts])
    with np.errstate(all="ignore"):
        q = quantity(z)
        ratio = q[1:] / q[:-1]
    if not np.isfinite(q).all() or (q == 0).any() or np.abs(np.angle(ratio)).max() > 1.5:
        return None
    roots = np.sqrt(q)
    turned = np.where((roots[1:] * roots[:-1].conj()).real < 0, -1.0, 1.0)
    roots *= np.concatenate([[1.0], np.cumprod(turned)])
    if root is not None and (roots[0] * np.conj(root)).real < 0:
        roots = -roots
    sign = 1.0 if (roots[-1] * roots[0].conj()).real > 0 else -1.0
    weights = roots * dz * np.tile(share, len(pieces))
    return Way(z, weights, np.repeat(np.arange(len(pieces)), len(s)), sign, panels)

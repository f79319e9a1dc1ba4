"""Umbilics: all zeros of the Hopf differential Q in a domain, with their orders.

The phase of Q turns once around a square for every zero inside (argument principle). Squares that
hold zeros are cut in four until a circle holds one zero, simple or multiple; its place then is the
zero of the last derivative that vanishes, found by Newton on Taylor coefficients. Zeros that
rounding cannot tell apart are one zero of higher order.

References
----------
Delves, Lyness, *A numerical method for locating the zeros of an analytic function* (1967);
Kravanja, Van Barel, *Computing the Zeros of Analytic Functions* (2000).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import SurfaceError
from phexfab.surface.continuation import describe
from phexfab.surface.domain import Disc
from phexfab.surface.holomorphic import ComplexArray, show
from phexfab.surface.weierstrass import MinimalSurface
from phexfab.surface.zeros import CIRCLE, SAMPLES, middle_of_zeros, single_zero

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Quantity = Callable[[ComplexArray], ComplexArray]

CELLS = (6, 12, 24, 48)  # squares along the first grid; the next one where the count is wrong
HALVINGS, MOST_OPEN = 36, 4096  # of the pieces between samples; pieces of a loop left to halve
CIRCLES = (1.6, 2.2)  # about a square, in halves of its side; a multiple zero needs some room
ALIKE = 0.7  # |Q_next/Q - 1| of neighbouring samples, so that no turn of the phase is missed
CLUSTER = 1e-4  # of the radius: zeros that near to each other may be one of higher order
SMALLEST = 1e-9  # of the radius: a square that small is a point
MOST_SQUARES = 4096  # that are still to be searched
MOST_UNRESOLVED = 128  # squares on whose border a zero lies, or nothing but noise
UNRESOLVED = -(10**6)


@dataclass(frozen=True, eq=False)
class Umbilics:
    """Zeros of the Hopf differential.

    Attributes
    ----------
    places : (n,) complex
        In z, sorted by real part, then imaginary part.
    orders : (n,) int
        A panel there has ``3 (order + 2)`` sides.
    """

    places: ComplexArray = field(default_factory=lambda: np.zeros(0, complex))
    orders: IntArray = field(default_factory=lambda: np.zeros(0, np.int64))

    def __len__(self) -> int:
        return len(self.places)


def umbilics(surface: MinimalSurface, domain: Disc, blur: float = 0.0) -> Umbilics:
    """Return all umbilics of a surface in a domain, to rounding.

    Parameters
    ----------
    surface : MinimalSurface
        Analytic in the domain and a hair beyond its border.
    domain : Disc
    blur : float
        See `hopf_zeros`.

    Raises
    ------
    SurfaceError
        If the domain holds a branch point or an end (the message names place and order), or Q is
        zero throughout (a plane).

    Examples
    --------
    >>> import phexfab as px
    >>> monkey_saddle = px.minimal_surface("enneper", order=2).scaled(5000.0)
    >>> found = px.umbilics(monkey_saddle, px.Disc(0, 0.9))
    >>> found.orders.tolist()  # a panel of 3 · (1 + 2) sides closes up around it
    [1]
    >>> bool(abs(found.places[0]) < 1e-12)
    True
    """
    found = hopf_zeros(surface.hopf, domain, surface.name, blur)
    for place, order in zip(found.places, found.orders, strict=True):
        branch = branch_order(surface, complex(place))
        if branch:
            raise SurfaceError(
                f"{surface.name}: z = {show(complex(place))} is a branch point of order {branch} "
                f"(a zero of order {int(order)} of the Hopf differential): the tangent plane winds "
                f"{branch + 1} times there and a panel would cross itself; choose a domain without "
                "it, or another rim"
            )
    return found


def hopf_zeros(
    quantity: Quantity, domain: Disc, name: str = "surface", blur: float = 0.0
) -> Umbilics:
    """Return the zeros of an analytic function in a domain, with their orders.

    Parameters
    ----------
    quantity : callable
        Of complex arrays.
    domain : Disc
    name : str
        For messages.
    blur : float
        Relative error of the function, where that is more than rounding: zeros that it may have
        parted are one of higher order.

    Raises
    ------
    SurfaceError
        If there is a pole inside, or the function is zero throughout.
    """
    with np.errstate(all="ignore"):
        values = np.abs(quantity(domain.grid(16)))
    if not np.any(values > 0):
        raise SurfaceError(
            f"{name}: the film is a plane, which has no curvature lines to lay hexagons along "
            "(its Hopf differential vanishes); bend the rim out of its plane"
        )
    wide, turns = _turns_of_border(quantity, domain)
    total = int(turns[0] - turns[1:].sum())
    for cells in CELLS:
        found = _search(quantity, wide, turns[1:], cells, name, blur)
        inside = wide.contains(found.places)
        if (turns == UNRESOLVED).any() or int(found.orders[inside].sum()) == total:
            keep = domain.contains(found.places, 1e-13 * domain.radius)
            places, orders = found.places[keep], found.orders[keep]
            speck = 1e-9 * domain.radius
            order = np.lexsort((np.round(places.imag / speck), np.round(places.real / speck)))
            return Umbilics(places[order], orders[order])
    raise SurfaceError(
        f"{name}: the Hopf differential winds {total} times around the domain, but its zeros "
        f"count {int(found.orders[inside].sum())}: the surface is not analytic in the domain "
        "(an end or a branch cut lies inside)"
    )


def branch_order(surface: MinimalSurface, z: complex, radius: float = 0.02) -> int:
    """Return the order of the branch point at ``z``: that of the zero of φ, 0 where there is none.

    Parameters
    ----------
    surface : MinimalSurface
    z : complex
        An umbilic.
    radius : float
        Of the circle that is sampled; reduced until φ is analytic on it.
    """
    for _ in range(8):
        try:
            phi = surface.tangent(z + radius * CIRCLE)
        except SurfaceError:
            phi = np.full((SAMPLES, 3), np.nan)
        taylor = np.abs(np.fft.fft(phi, axis=0)).max(1) / SAMPLES
        if np.all(taylor[SAMPLES // 4 :] <= 1e-11 * taylor.max()):
            break
        radius /= 3
    return int(np.flatnonzero(taylor > 1e-9 * taylor.max())[0])


def windings(
    quantity: Quantity, loops: Callable[[IntArray, FloatArray], ComplexArray], n: int
) -> IntArray:
    """Return how often the phase of a function turns along each of ``n`` closed ways.

    Parameters
    ----------
    quantity : callable
    loops : callable
        Maps (k,) numbers of ways and (k,) numbers in [0, 1] to (k,) places.
    n : int

    Returns
    -------
    (n,) int
        ``UNRESOLVED`` where a way meets a zero or a pole.
    """
    s = np.tile(np.arange(SAMPLES + 1) / SAMPLES, (n, 1))
    owner = np.repeat(np.arange(n), SAMPLES + 1)
    with np.errstate(all="ignore"):
        q = quantity(loops(owner, s.ravel())).reshape(s.shape)
    q[:, -1] = q[:, 0]
    owner = np.repeat(np.arange(n), SAMPLES)
    s0, s1 = s[:, :-1].ravel(), s[:, 1:].ravel()
    q0, q1 = q[:, :-1].ravel(), q[:, 1:].ravel()
    turns = np.zeros(n)
    for _ in range(HALVINGS):
        middle = 0.5 * (s0 + s1)
        # Both halves must be quiet: a piece that turns once in all looks quiet from its ends.
        with np.errstate(all="ignore"):
            q = quantity(loops(owner, middle))
            first, second = q / q0, q1 / q
            good = (np.abs(first - 1) <= ALIKE) & (np.abs(second - 1) <= ALIKE)
        angle = np.angle(first[good]) + np.angle(second[good])
        np.add.at(turns, owner[good], angle / (2 * np.pi))
        left = ~good
        owner, s0, s1, middle = owner[left], s0[left], s1[left], middle[left]
        q0, q1, q = q0[left], q1[left], q[left]
        if not len(owner) or len(owner) > MOST_OPEN * n:
            break
        owner = np.concatenate([owner, owner])
        s0, s1 = np.concatenate([s0, middle]), np.concatenate([middle, s1])
        q0, q1 = np.concatenate([q0, q]), np.concatenate([q, q1])
    result = np.round(turns).astype(np.int64)
    result[owner] = UNRESOLVED
    return result


def _turns_of_border(quantity: Quantity, domain: Disc) -> tuple[Disc, IntArray]:
    """Return a domain a hair wider, on whose border Q has no zero, and how Q winds around it."""
    for nudge in (0.0, 1e-9, 1e-8, 1e-7, 1e-6):
        wide = domain.widened(nudge)
        turns = windings(quantity, wide.border_at, 1 + len(wide.holes))
        if (turns != UNRESOLVED).all():
            break
    return wide, turns


def _square(s: FloatArray) -> ComplexArray:
    """Return the border of the square |x|, |y| <= 1 at numbers in [0, 1)."""
    side = np.minimum(np.floor(4 * s), 3).astype(int)
    return (1 - 1j + 2j * (4 * s - side)) * 1j**side


def _cell_turns(
    quantity: Quantity, domain: Disc, holes: IntArray, centre: ComplexArray, half: float
) -> IntArray:
    """Return how many zeros the domain has in squares, a little larger where one is on the border.

    Parameters
    ----------
    quantity, domain
    holes : int array
        How Q winds around the holes.
    centre : (n,) complex
    half : float
        Half the side of the squares.
    """
    turns = np.full(len(centre), UNRESOLVED)
    for grow in (1.0, 1.013, 1.041, 1.09):
        todo = np.flatnonzero(turns == UNRESOLVED)
        if not len(todo):
            break
        at, size = centre[todo], half * grow

        def loops(
            k: IntArray, s: FloatArray, at: ComplexArray = at, size: float = size
        ) -> ComplexArray:
            return domain.clipped(at[k] + size * _square(s))

        found = windings(quantity, loops, len(todo))
        for (c, _), around in zip(domain.holes, holes, strict=True):
            away = c - at
            inside = np.maximum(np.abs(away.real), np.abs(away.imag)) < size
            found[inside & (found != UNRESOLVED)] -= around
        turns[todo] = found
    return turns


def _search(
    quantity: Quantity, domain: Disc, holes: IntArray, cells: int, name: str, blur: float
) -> Umbilics:
    size = 1.07 * domain.radius
    x = (np.arange(cells) + 0.5) / cells * 2 - 1
    # Off the centre, so that no line of the grid is a symmetry of the surface.
    corner = domain.centre + domain.radius * (0.01370 + 0.02113j)
    centre: ComplexArray = np.asarray(corner + size * (x[:, None] + 1j * x).ravel(), complex)
    half = size / cells
    places: list[complex] = []
    orders: list[int] = []
    parent = np.full(len(centre), -1)
    parents, parent_turns = np.zeros(0, complex), np.zeros(0, np.int64)

    def known(z: complex, half: float, turn: int) -> bool:
        """Whether a neighbour's larger circle has found these zeros already."""
        away = np.array(places, complex) - z
        mine = np.maximum(np.abs(away.real), np.abs(away.imag)) <= 1.1 * half
        return turn > 0 and sum(o for o, m in zip(orders, mine, strict=True) if m) == turn

    while len(centre):
        near = ~domain.is_outside(centre, 1.55 * half)
        centre, parent = centre[near], parent[near]
        turns = _cell_turns(quantity, domain, holes, centre, half)
        if half < CLUSTER * domain.radius:
            # Where noise begins to part zeros that a square held together, they are one.
            held = np.bincount(parent, np.where(turns == UNRESOLVED, -np.inf, turns), len(parents))
            for k in np.flatnonzero((parent_turns > 0) & (held < parent_turns)):
                z = complex(parents[k])
                if not known(z, 2 * half, int(parent_turns[k])):
                    places.append(middle_of_zeros(quantity, z, 3 * half, int(parent_turns[k])))
                    orders.append(int(parent_turns[k]))
            keep = held[parent] >= parent_turns[parent]
            centre, turns = centre[keep], turns[keep]
        rest: list[complex] = []
        rest_turns: list[int] = []
        for z, turn in zip(centre, turns, strict=True):
            if turn == 0:
                continue
            tiny, noisy = half < SMALLEST * domain.radius, half < CLUSTER * domain.radius
            if known(z, half, turn):
                continue
            single = None
            for reach in CIRCLES if turn > 0 else ():
                single = single or single_zero(quantity, complex(z), reach * half, blur, noisy)
            if single is not None and abs(single[0] - z) <= 1.6 * half:
                same = min(1e-7 * domain.radius, 0.1 * half)  # seen from a neighbouring square
                if not any(abs(single[0] - p) <= same for p in places):
                    places.append(single[0])
                    orders.append(single[1])
            elif not tiny:
                rest.append(z)
                rest_turns.append(int(turn))
            elif turn > 0 and turn != UNRESOLVED:
                places.append(complex(z))
                orders.append(int(turn))
            elif domain.contains(z):
                what, place, _ = describe(quantity, complex(z))
                raise SurfaceError(
                    f"{name}: {what} lies in the domain at z = {show(place)}: the surface runs to "
                    "infinity (an end) or is not analytic there; choose a domain without it"
                )
        if len(rest) > MOST_SQUARES or (turns == UNRESOLVED).sum() > MOST_UNRESOLVED:
            raise SurfaceError(
                f"{name}: the Hopf differential is noise around z = {show(rest[0])}: the surface "
                "is not analytic there, or not known well enough; choose a smaller domain, or a "
                "smoother rim"
            )
        half /= 2
        children = half * np.array([-1 - 1j, 1 - 1j, -1 + 1j, 1 + 1j])
        parents, parent_turns = np.array(rest, complex), np.array(rest_turns, np.int64)
        parent = np.repeat(np.arange(len(parents)), 4)
        centre = np.asarray((parents[:, None] + children).ravel(), complex)
    return Umbilics(np.array(places, complex), np.array(orders, np.int64))

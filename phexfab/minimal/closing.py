"""Circle packings and patterns that close around holes.

With all border radii given, the layout of a ring misses closing by a similarity: a rotation and a
translation, three real numbers a hole. So the radii of the hole's border are multiplied by a smooth
positive function. Its constant part is an unknown of the convex problem, which makes the rotation
right (``solve_radii``). Its waves along the border are found here: Newton on the translations, with
derivatives through the factorised Hessian, and of all solutions the one with the smallest waves.
On a surface of rotational symmetry the waves vanish.

The rotation to be reached is that of the smooth Gauss map around the hole, a multiple of 2π; it is
counted from the smooth image of the lattice, whatever branch points or ends the hole encloses.

References
----------
Bobenko, Springborn 2004, "Variational principles for circle patterns and Koebe's theorem".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import SolveError
from phexfab.minimal.circles import AngleSystem, CircleLaw, solve_system
from phexfab.minimal.layout import Development, border_cycles

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]

OPEN = 1e-9
"""A hole's translation, over its mean edge, below which it is closed as it is."""
REMEDY = 'use offset.type = "face", which needs no circle packing'


def chart_angles(triangles: IntArray, chart: ComplexArray) -> FloatArray:
    """Return the (V, 3) angles of a triangulation's image in the plane, between −π and π."""
    here, onward, back = (chart[triangles[:, [k, (k + 1) % 3, (k + 2) % 3]]] for k in range(3))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(np.angle((back - here) / (onward - here)))


def plain_borders(triangles: IntArray, n: int) -> list[IntArray]:
    """Return the borders (half-edges in order) of a triangulation that can be laid out.

    None if it has handles, so that no planar layout exists, or its border touches itself.
    """
    cycles = border_cycles(triangles, n)
    tails = np.concatenate([triangles.ravel()[cycle] for cycle in cycles])
    used = len(np.unique(triangles))
    edges = (3 * len(triangles) + len(tails)) // 2
    genus = (2 - len(cycles) - (used - edges + len(triangles))) // 2
    return cycles if genus == 0 and len(np.unique(tails)) == len(tails) else []


def hole_angles(
    triangles: IntArray, chart: ComplexArray, holes: tuple[IntArray, ...]
) -> FloatArray:
    """Return (H,) the sum of all angles at each hole's border circles, radians.

    Parameters
    ----------
    triangles : (V, 3) int
    chart : (F,) complex
        The smooth Gauss map.
    holes : tuple of index arrays
        Faces around each hole.

    Notes
    -----
    A closed polygon of n corners turns by a multiple of 2π, so its angles sum to (n + 2k)π: k = 1
    around a plain hole, more where the hole encloses branch points.
    """
    angle = chart_angles(triangles, chart).ravel()
    total = np.bincount(triangles.ravel(), angle, minlength=len(chart))
    return np.array(
        [np.pi * (len(h) + 2 * np.round((total[h].sum() / np.pi - len(h)) / 2)) for h in holes]
    )


def solve_closed(
    law: CircleLaw,
    logs: FloatArray,
    targets: FloatArray,
    cycles: list[IntArray],
    chart: ComplexArray,
) -> tuple[FloatArray, ComplexArray, float]:
    """Return log-radii, centres and the gap of a packing or pattern that closes.

    Parameters
    ----------
    law : CircleLaw
    logs : (F,) float
        Start; border radii stay, those of holes but for a smooth factor.
    targets : (F,) float
        Angle sums of the interior circles, see ``cone_targets``.
    cycles : list of (n,) int
        The borders, see ``border_cycles``. The one whose image lies farthest out keeps its radii.
    chart : (F,) complex
        The smooth Gauss map.

    Returns
    -------
    logs, centres : (F,) arrays
    gap : float
        The largest miss of a contact, over its edge.

    Raises
    ------
    SolveError
        If Newton does not converge.
    """
    tail = law.triangles.ravel()
    order = sorted(cycles, key=lambda cycle: float(np.abs(chart[tail[cycle]]).mean()))
    holes = tuple(tail[cycle] for cycle in order[:-1])
    wanted = hole_angles(law.triangles, chart, holes)
    system = AngleSystem.of(law, len(logs), targets=targets, holes=holes, hole_targets=wanted)
    logs = solve_system(system, logs)
    development = Development.of(law.triangles, len(logs))
    vectors = development.vectors(law, logs)
    if holes and np.abs(_translations(vectors, order[:-1])).max() > OPEN:
        logs = _close(system, development, logs, order[:-1], chart, wanted)
        vectors = development.vectors(law, logs)
    centre = development.centres(vectors)
    head = law.triangles[:, [1, 2, 0]].ravel()
    length = np.abs(vectors)
    gap = np.abs(np.abs(centre[head] - centre[tail]) - length) / length
    return logs, centre, float(gap.max(initial=0.0))


def _translations(vectors: ComplexArray, cycles: list[IntArray]) -> ComplexArray:
    """Return (H,) by how much each border misses closing, over its mean edge."""
    return np.array([vectors[c].sum() / np.abs(vectors[c]).mean() for c in cycles])


def _close(
    system: AngleSystem,
    development: Development,
    logs: FloatArray,
    cycles: list[IntArray],
    chart: ComplexArray,
    wanted: FloatArray,
) -> FloatArray:
    """Return log-radii with waves along the holes, so that all translations vanish."""
    law = system.law
    waves, stiffness = _waves(development.triangles, cycles, chart, wanted)

    def missing(at: FloatArray) -> FloatArray:
        miss = _translations(development.vectors(law, at), cycles)
        return np.concatenate([miss.real, miss.imag])

    miss, tiny = missing(logs), 1e-5
    for _ in range(30):
        _, weight = system.miss(logs)
        factor = system.factor(weight)
        moves = [system.response(factor, weight, wave) for wave in waves]
        slopes = [(missing(logs + tiny * m) - missing(logs - tiny * m)) / (2 * tiny) for m in moves]
        matrix = np.column_stack(slopes) / stiffness
        # The smallest waves that close all holes, high ones counting more.
        share = np.linalg.lstsq(matrix, -miss, rcond=1e-10)[0] / stiffness
        move = np.asarray(moves).T @ share
        # Radii are not changed by more than half at a time.
        step = min(1.0, 0.5 / max(float(np.abs(move).max()), 1e-300))
        while True:
            trial = solve_system(system, logs + step * move)
            after = missing(trial)
            if np.abs(after).max() < np.abs(miss).max() or step < 1e-4:
                break
            step /= 2
        if not np.abs(after).max() < np.abs(miss).max():
            break
        done = np.abs(after).max() > 0.1 * np.abs(miss).max() and np.abs(after).max() < 1e-10
        logs, miss = trial, after
        if done or np.abs(miss).max() < 1e-13:
            break
    if not np.abs(miss).max() < 1e-8:
        worst = int(np.argmax(np.abs(miss))) % len(cycles)
        face = int(development.triangles.ravel()[cycles[worst][0]])
        raise SolveError(
            f"the circles do not close up around the hole at face {face} (they miss by "
            f"{np.abs(miss).max():.1e} of an edge); choose a finer lattice, or {REMEDY}"
        )
    return logs


def _waves(
    triangles: IntArray, cycles: list[IntArray], chart: ComplexArray, wanted: FloatArray
) -> tuple[list[FloatArray], FloatArray]:
    """Return (F,) cosines and sines along each hole's border, by arc length, and their weights.

    Where the layout turns k times around a hole it is the k-th wave that moves it in first order;
    two more serve holes of any shape.
    """
    tail, head = triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
    waves, stiffness = [], []
    for cycle, angle in zip(cycles, wanted, strict=True):
        length = np.abs(chart[head[cycle]] - chart[tail[cycle]])
        along = 2 * np.pi * (np.cumsum(length) - length) / length.sum()
        turns = abs(round((angle / np.pi - len(cycle)) / 2))
        for k in range(1, turns + 3):
            for shape in (np.cos(k * along), np.sin(k * along)):
                wave = np.zeros(len(chart))
                wave[tail[cycle]] = shape
                waves.append(wave)
                stiffness.append(float(k))
    return waves, np.array(stiffness)

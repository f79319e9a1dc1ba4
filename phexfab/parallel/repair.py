"""Faces that cross themselves, repaired within P(M) by the least move of planes.

With S's face convex, the signs of M's edge ratios around a face say how it turns: it can only be
simple if they change 0 times (bent like S, K > 0) or 4 times (two reflex corners, K < 0). Lengths
and gaps of fixed directions are linear in the heights, so wanted signs and an open waist between
opposite reflex corners are linear inequalities.

References
----------
Thesis §4.1 for P(M); §6.2, which leaves self-crossings open.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse.csgraph import connected_components

from phexfab.errors import MeshError, SolveError
from phexfab.mesh.measures import signed_areas, simple_faces
from phexfab.parallel.offset import edge_ratios
from phexfab.parallel.rings import edge_faces
from phexfab.parallel.shell import Shell
from phexfab.parallel.tree import spanning_tree, sum_to_root

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ROUNDS = 3  # a repaired face may, rarely, make a neighbour cross itself


@dataclass(frozen=True, eq=False)
class Repair:
    """A shell after its repair, and what was repaired.

    Attributes
    ----------
    shell : Shell
    crossing : (n,) int
        Panels that crossed themselves before the repair.
    turned : (n,) int
        Edges (rows of ``shell.edges``) whose sense along S's edge the repair changed.
    moved : (n,) int
        Faces (rows of ``shell.normals``) whose plane moved, away from the surface's tangent plane.
    moves : (n,) float
        By how much, mm along the normal.
    left : (n,) int
        Panels that still cross themselves; empty where the repair succeeded.
    note : str
        Why a repair was not possible, or empty.
    """

    shell: Shell
    crossing: IntArray
    turned: IntArray
    moved: IntArray
    moves: FloatArray
    left: IntArray
    note: str = ""


def ratio_matrix(shell: Shell) -> sp.csr_matrix:
    """Return the (E, F) matrix that takes heights to the edge ratios of ``offset.edge_ratios``."""
    s = shell.gauss.vertices
    i, j = shell.edges[:, 0], shell.edges[:, 1]
    along = s[j] - s[i]
    along = along / np.einsum("ij,ij->i", along, along)[:, None]
    rows, cols, values = [], [], []
    for end, sign in ((j, 1.0), (i, -1.0)):
        faces = shell.triangles[shell.used_vertices[end]]
        weight = np.linalg.solve(np.swapaxes(shell.normals[faces], 1, 2), along[..., None])[..., 0]
        rows.append(np.repeat(np.arange(len(i)), 3))
        cols.append(faces.ravel())
        values.append(sign * weight.ravel())
    where = (np.concatenate(rows), np.concatenate(cols))
    shape = (len(i), len(shell.normals))
    return sp.coo_matrix((np.concatenate(values), where), shape=shape).tocsr()


def repair_crossings(
    shell: Shell, *, fraction: float = 0.2, signs: IntArray | None = None
) -> Repair:
    """Move planes as little as possible until no face crosses itself, within P(M).

    Edges get wanted signs, turning over those that are shortest; then the heights change by the
    least sum of |Δh| for which every edge has its sign and hexagons with opposite reflex corners
    have an open waist, which makes them simple. That is a linear programme: its solution moves
    few planes, and all others stay on the surface.

    Parameters
    ----------
    shell : Shell
        Of any offset type, which does not change; corners counter-clockwise about the normals.
    fraction : float
        Between 0 and 1: what edges (and half of it: waists) around a crossing keep at least, over
        the mean edge ratio of the panels there. Others keep at least half of what they have.
    signs : (E,) ±1, optional
        Wanted sense of each edge (rows of ``shell.edges``); found as described if left out.

    Returns
    -------
    Repair
        ``left`` and ``note`` say what could not be repaired. Where no heights give the wanted
        signs the planes stay where they are.

    Raises
    ------
    MeshError
        If ``fraction`` is not between 0 and 1.
    """
    if not 0 < fraction < 1:
        raise MeshError(f"fraction = {fraction:g} must lie between 0 and 1, for example 0.2")
    none = np.zeros(0, np.int64)
    crossing = np.flatnonzero(~simple_faces(shell.mesh))
    if signs is None and not len(crossing):
        return Repair(shell, crossing, none, none, np.zeros(0), none)
    fixed, left, note = shell, crossing, ""
    for _ in range(ROUNDS):
        try:
            fixed = _repair_once(fixed, left, fraction, signs)
        except SolveError as error:
            note = str(error)
            break
        left = np.flatnonzero(~simple_faces(fixed.mesh))
        if not len(left):
            break
    else:
        note = f"panel {left[0]} still crosses itself: give other signs"
    before, after = edge_ratios(shell), edge_ratios(fixed)
    step = fixed.heights - shell.heights
    moved = np.flatnonzero(step)
    turned = np.flatnonzero((before < 0) != (after < 0))
    return Repair(fixed, crossing, turned, moved, step[moved], left, note)


def _repair_once(
    shell: Shell, crossing: IntArray, fraction: float, signs: IntArray | None
) -> Shell:
    ratios = edge_ratios(shell)
    wanted = _wanted_signs(shell, ratios) if signs is None else np.asarray(signs, np.int64)
    turned = np.flatnonzero(wanted != np.where(ratios < 0, -1, 1))
    faces = edge_faces(shell)[1]
    near = np.zeros(len(shell.normals), bool)
    near[shell.panels[crossing]] = True
    near[faces[turned]] = True
    floor = fraction * _mean_around(shell, np.abs(ratios))
    floor = np.where(near[faces].any(axis=1), floor, np.minimum(floor, 0.5 * np.abs(ratios)))
    matrix = ratio_matrix(shell)
    waist, open_by = _waists(shell, wanted, ratios, fraction, near[shell.panels])
    rows = sp.vstack([sp.diags(wanted.astype(float)) @ matrix, waist @ matrix]).tocsr()
    have = np.concatenate([wanted * ratios, waist @ ratios])
    return shell.with_heights(
        shell.heights + _least_move(rows, np.concatenate([floor, open_by]) - have)
    )


def _corner_edges(shell: Shell) -> IntArray:
    """Return the (C,) edge of ``shell.edges`` that leaves each corner of the mesh."""
    mesh = shell.mesh
    n = len(mesh.vertices)
    ends = np.sort(shell.edges[:, :2], axis=1)
    asked = np.sort(np.column_stack([mesh.corners, mesh.corners[mesh.next_corner]]), axis=1)
    key = ends[:, 0] * n + ends[:, 1]
    order = np.argsort(key)
    return order[np.searchsorted(key[order], asked[:, 0] * n + asked[:, 1])]


def _mean_around(shell: Shell, values: FloatArray) -> FloatArray:
    """Return for each edge the mean of the values on the one or two panels beside it."""
    mesh = shell.mesh
    edge = _corner_edges(shell)
    mean = np.add.reduceat(values[edge], mesh.starts[:-1]) / mesh.sides
    total = np.bincount(edge, mean[mesh.face_of_corner], minlength=len(values))
    return total / np.bincount(edge, minlength=len(values))


def _wanted_signs(shell: Shell, ratios: FloatArray) -> IntArray:
    """Return (E,) signs that change as often around every panel as its sense in S asks."""
    s = shell.gauss.vertices
    length = np.linalg.norm(s[shell.edges[:, 1]] - s[shell.edges[:, 0]], axis=1)
    against = signed_areas(shell.gauss, shell.normals[shell.panels]) < 0
    if against.sum() * 2 < len(against):  # bent like S: no edge against the others
        return np.full(len(ratios), 1 if float(ratios @ length) >= 0 else -1)
    crossing = ~simple_faces(shell.mesh)
    sign, cost = np.where(ratios < 0, -1, 1), np.abs(ratios) * length
    family = _families(shell)
    if family is not None:
        # On a saddle one of the lattice's three directions runs against the other two. Which one,
        # the whole mesh says: the choice that contradicts the least length.
        choices = [sense * np.where(family == k, -1, 1) for k in range(3) for sense in (1, -1)]
        pattern = min(choices, key=lambda choice: float(cost[choice != sign].sum()))
        edge = _corner_edges(shell)
        touched = np.zeros(len(ratios), bool)
        touched[edge[crossing[shell.mesh.face_of_corner]]] = True
        cost = np.where(pattern == sign, cost, 1e-3 * cost)
        sign = np.where(touched, pattern, sign)
    return _alternate(shell, sign, cost, crossing)


def _families(shell: Shell) -> IntArray | None:
    """Return (E,) which of three directions of a hexagonal lattice each edge belongs to.

    Carried from panel to panel: edges three apart are of one family. None where the numbers of
    sides do not allow it (6, and 9, 12 at umbilics, do) or panels do not hang together.
    """
    mesh, edge = shell.mesh, _corner_edges(shell)
    if np.any(mesh.sides % 3):
        return None
    place = np.arange(len(edge)) - mesh.starts[:-1][mesh.face_of_corner]
    order = np.argsort(edge, kind="stable")
    twin = np.flatnonzero(edge[order[1:]] == edge[order[:-1]])
    one, two = order[twin], order[twin + 1]
    f, g = mesh.face_of_corner[one], mesh.face_of_corner[two]
    n = mesh.n_faces
    graph = sp.csr_matrix((np.ones(len(f)), (f, g)), shape=(n, n))
    if connected_components(graph, directed=False)[0] > 1:
        return None
    up = spanning_tree(graph, 0)
    step = sp.csr_matrix(
        (
            np.concatenate([place[one] - place[two], place[two] - place[one]]) % 3 + 1,
            (np.concatenate([f, g]), np.concatenate([g, f])),
        ),
        shape=(n, n),
    )
    child = np.arange(1, n)
    shift = np.zeros(n, np.int64)
    shift[1:] = np.asarray(step[up[child], child]).ravel() - 1
    family = np.empty(len(shell.edges), np.int64)
    family[edge] = (place + sum_to_root(shift, up)[mesh.face_of_corner]) % 3
    return family


def _alternate(
    shell: Shell, sign: IntArray, length: FloatArray, crossing: NDArray[np.bool_]
) -> IntArray:
    """Turn short edges over until the signs change 4 times around every convex face of S.

    Hexagons that cross themselves, or get an edge turned, also need their reflex corners three
    apart.
    """
    mesh, edge = shell.mesh, _corner_edges(shell)
    beside: list[list[int]] = [[] for _ in length]
    for e, f in zip(edge.tolist(), mesh.face_of_corner.tolist(), strict=True):
        beside[e].append(f)
    rows = [edge[a:b] for a, b in zip(mesh.starts[:-1], mesh.starts[1:], strict=True)]
    sign, strict = sign.copy(), crossing.copy()

    def bad(f: int) -> bool:
        # The face around an umbilic winds m+1 times in S: 3(m+2) sides, 2(m+2) changes.
        around = sign[rows[f]]
        same = np.flatnonzero(around == np.roll(around, 1))
        sides = len(around)
        if sides - len(same) != (2 * sides // 3 if sides > 6 and sides % 3 == 0 else 4):
            return True
        return bool(strict[f] and sides == 6 and same[1] - same[0] != 3)

    def cure(f: int) -> tuple[float, tuple[int, ...]]:
        """Return the cheapest one or two edges that put a face right, and their cost."""
        own = [int(e) for e in rows[f] if not turned[e]]
        some = [(e,) for e in own] + [(a, b) for k, a in enumerate(own) for b in own[k + 1 :]]
        best: tuple[float, tuple[int, ...]] = (np.inf, ())
        for pick in some:
            around = {g for e in pick for g in beside[e]}
            before = sum(bad(g) for g in around)
            sign[list(pick)] *= -1
            spoilt = max(sum(bad(g) for g in around) - before + 1, 0)
            cost = float(sum(length[e] for e in pick)) * (1 + spoilt)
            if not bad(f) and cost < best[0]:
                best = (cost, pick)
            sign[list(pick)] *= -1
        return best

    turned = np.zeros(len(sign), bool)
    queue = [f for f in range(mesh.n_faces) if bad(f)]
    while queue:  # every edge is turned at most once, so this ends
        found = sorted((*cure(f), f) for f in queue)
        again: set[int] = set()
        busy: set[int] = set()
        for cost, pick, f in found:
            around = {g for e in pick for g in beside[e]}
            if not np.isfinite(cost) or around & busy:
                if np.isfinite(cost):
                    again.add(f)
                continue
            sign[list(pick)] *= -1
            turned[list(pick)] = True
            strict[list(around)] = True
            busy |= around
            again |= around
        queue = sorted(f for f in again if bad(f))
    return sign


def _waists(
    shell: Shell, wanted: IntArray, ratios: FloatArray, fraction: float, near: NDArray[np.bool_]
) -> tuple[sp.csr_matrix, FloatArray]:
    """Return rows W and floors: W @ ratios ≥ floor opens the waist of hexagons.

    In a hexagon with reflex corners p and q three apart, q has to lie to the left of both edges
    at p, and p of both at q. Then the diagonal cuts it into two convex quadrilaterals.
    """
    mesh, edge = shell.mesh, _corner_edges(shell)
    s = shell.gauss.vertices
    chord = s[mesh.corners[mesh.next_corner]] - s[mesh.corners]  # S's edge from each corner
    sense = wanted[edge]
    straight = sense == sense[mesh.previous_corner]  # no change: reflex where S runs against M
    against = signed_areas(shell.gauss, shell.normals[shell.panels]) < 0
    hexagon = np.flatnonzero((mesh.sides == 6) & against)
    around = mesh.starts[hexagon][:, None] + np.arange(6)
    rows: list[IntArray] = []
    cols: list[IntArray] = []
    values: list[FloatArray] = []
    floors: list[FloatArray] = []
    count = 0
    for k in range(6):
        ring = np.roll(around, -k, axis=1)
        opposite = straight[ring[:, 0]] & straight[ring[:, 3]] & (straight[ring].sum(axis=1) == 2)
        ring = ring[opposite]
        face = mesh.face_of_corner[ring[:, 0]]
        normal = shell.normals[shell.panels[face]]
        mean = np.mean(np.abs(ratios[edge[ring]]) * np.linalg.norm(chord[ring], axis=2), axis=1)
        for beside in (ring[:, 0], ring[:, 5]):  # the edges that leave and reach corner 0
            line = sense[beside][:, None] * chord[beside]
            left = np.cross(normal, line / np.linalg.norm(line, axis=1, keepdims=True))
            weight = np.einsum("fj,fkj->fk", left, chord[ring[:, :3]])
            have = np.sum(weight * ratios[edge[ring[:, :3]]], axis=1)
            asked = 0.5 * fraction * mean
            calm = ~near[face]
            keep = ~calm | (have > 0)
            floors.append(np.where(calm, np.minimum(asked, 0.5 * have), asked)[keep])
            rows.append(np.repeat(count + np.arange(int(keep.sum())), 3))
            cols.append(edge[ring[keep, :3]].ravel())
            values.append(weight[keep].ravel())
            count += int(keep.sum())
    where = (np.concatenate(rows), np.concatenate(cols))
    shape = (count, len(ratios))
    return sp.coo_matrix((np.concatenate(values), where), shape).tocsr(), np.concatenate(floors)


def _least_move(rows: sp.csr_matrix, short: FloatArray) -> FloatArray:
    """Return the (F,) Δh of least sum of sizes with rows @ Δh ≥ short."""
    norm = np.sqrt(np.asarray(rows.multiply(rows).sum(axis=1)).ravel())
    short = short / norm
    size = float(short.max(initial=0.0))
    if size <= 0:
        return np.zeros(rows.shape[1])
    rows = sp.diags(1 / norm) @ rows
    # Δh = size·(p − q); the margin covers the solver's tolerance of 1e-7.
    answer = linprog(
        np.ones(2 * rows.shape[1]),
        A_ub=sp.hstack([-rows, rows]).tocsr(),
        b_ub=-short / size - 1e-6 * (short > 0),
        bounds=(0, None),
        method="highs-ds",
    )
    if answer.status == 2:
        raise SolveError(
            "no heights give all edges their wanted sense: this lattice has no valid faces on "
            "the surface; turn it, or choose another row ratio"
        )
    if answer.x is None:
        raise SolveError(f"the linear programme of the repair failed: {answer.message}")
    p, q = np.split(answer.x, 2)
    return size * (p - q)

"""Splitting a mesh along walks: which panels stay, in which pieces, and their dual triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from phexfab.errors import MeshError
from phexfab.parallel.border import place
from phexfab.parallel.shell import Shell
from phexfab.parallel.walk import Arc, Crossing, Ground, LostWayError

IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Pieces:
    """What lies to the left of the borders, as dual triangles.

    Attributes
    ----------
    parent : (n,) int
        Face of the whole shell for each piece, −1 − k for plane k of the fences, which come last.
    triangles : (V, 3) int
        Rows of ``parent``, counter-clockwise.
    cut : (m,) int
        Rows of the pieces that a border crosses.
    filled : int
        Pieces left out because a neighbour touches the plane on both of their sides.
    """

    parent: IntArray
    triangles: IntArray
    cut: IntArray
    filled: int


@dataclass
class _Crossed:
    """The outline of a crossed panel with the arcs on it, corner by corner."""

    ends: dict[int, list[tuple[float, bool, int]]]  # corner -> (share, leaves, arc)


def split(
    whole: Shell, ground: Ground, walks: Sequence[tuple[list[Arc], list[Crossing]]]
) -> Pieces:
    """Return the part of a whole shell to the left of closed walks over it.

    Parameters
    ----------
    whole : Shell
    ground : Ground
    walks : sequence of (arcs, crossings)
        With plane numbers that count through all walks.

    Raises
    ------
    LostWayError
        If the walks cross.
    MeshError
        If a border of the whole shell is left over, or nothing, or several parts.
    """
    arcs: list[Arc] = []
    crossings: list[Crossing] = []
    previous: list[int] = []
    for one, two in walks:
        first = len(arcs)
        previous += [first + (k - 1) % len(one) for k in range(len(one))]
        arcs += one
        crossings += two
    following = [0] * len(arcs)
    for k, before in enumerate(previous):
        following[before] = k

    crossed = _outlines(ground, arcs, crossings, previous)
    onward, removed = _pockets(ground, arcs, crossings, previous, following, crossed)
    piece_of_corner = np.full(len(ground.mesh.corners), -1)
    piece_of_arc, owner = _loops(ground, arcs, crossings, crossed, onward, removed, piece_of_corner)
    cut = len(owner)
    owner += _inner_panels(ground, set(crossed), piece_of_corner, cut)
    planes = 1 + max(max(arc.planes) for arc in arcs)
    triangles = _kept_triangles(whole, ground, piece_of_corner)
    made = []
    skipped = removed | set(onward.values())
    for k, arc in enumerate(arcs):
        if k in skipped:
            continue
        piece = piece_of_arc[k]
        along = list(arc.planes)
        last = k
        while last in onward:  # the arc runs on beyond a pocket, in the same plane
            last = onward[last]
            along += arcs[last].planes[1:]
        made += [(piece, len(owner) + a, len(owner) + b) for a, b in pairwise(along)]
        beyond = piece_of_arc[following[last]]
        made.append((piece, len(owner) + arcs[last].planes[-1], beyond))
    all_triangles = np.concatenate([triangles, np.array(made, np.int64).reshape(-1, 3)])
    _one_part(ground, owner, all_triangles)
    return Pieces(
        np.concatenate([whole.panels[np.array(owner)], -1 - np.arange(planes)]),
        all_triangles,
        np.arange(cut),
        len(removed),
    )


def _outlines(
    ground: Ground, arcs: list[Arc], crossings: list[Crossing], previous: list[int]
) -> dict[int, _Crossed]:
    crossed: dict[int, _Crossed] = {}
    for k, arc in enumerate(arcs):
        ends = crossed.setdefault(arc.panel, _Crossed({})).ends
        out, into = crossings[k], crossings[previous[k]]
        ends.setdefault(out.corner, []).append((out.share, True, k))
        ends.setdefault(int(ground.twin[into.corner]), []).append((1.0 - into.share, False, k))
    for one in crossed.values():
        for row in one.ends.values():
            row.sort()
    return crossed


def _run(
    ground: Ground, outline: _Crossed, corner: int, share: float
) -> tuple[list[int], tuple[float, bool, int] | None]:
    """Follow an outline counter-clockwise to the next crossing; return the corners passed."""
    mesh = ground.mesh
    passed: list[int] = []
    sides = int(mesh.sides[mesh.face_of_corner[corner]])
    for _ in range(sides + 1):
        for one in outline.ends.get(corner, ()):
            if one[0] > share:
                return passed, one
        corner, share = int(mesh.next_corner[corner]), -1.0
        passed.append(corner)
    return passed, None


def _pockets(
    ground: Ground,
    arcs: list[Arc],
    crossings: list[Crossing],
    previous: list[int],
    following: list[int],
    crossed: dict[int, _Crossed],
) -> tuple[dict[int, int], set[int]]:
    """Find where a panel leaves a plane at a reflex corner and comes back to it.

    Such a panel would have the same plane for neighbour twice. The small pieces between are left
    out, and the panel is continued over them: in its own plane that fills a notch.
    """
    onward: dict[int, int] = {}
    removed: set[int] = set()
    for k, arc in enumerate(arcs):
        outline = crossed[arc.panel]
        if len(outline.ends) < 3 and sum(map(len, outline.ends.values())) < 4:
            continue
        out = crossings[k]
        _, met = _run(ground, outline, out.corner, out.share)
        if met is None or met[1] or met[2] == k or arcs[met[2]].planes[0] != arc.planes[-1]:
            continue
        between: list[int] = []
        at = following[k]
        while at != met[2] and len(between) < 24 and len(arcs[at].planes) == 1:
            between.append(at)
            at = following[at]
        if at == met[2]:
            onward[k] = at
            removed.update(between)
    for k in [k for k in onward if k in removed]:  # a pocket within a pocket
        del onward[k]
    return onward, removed


def _loops(
    ground: Ground,
    arcs: list[Arc],
    crossings: list[Crossing],
    crossed: dict[int, _Crossed],
    onward: dict[int, int],
    removed: set[int],
    piece_of_corner: IntArray,
) -> tuple[list[int], list[int]]:
    """Close every arc along its panel's outline; return the piece of each arc and its panel."""
    piece_of_arc = [-1] * len(arcs)
    owner: list[int] = []
    for k, arc in enumerate(arcs):
        if piece_of_arc[k] >= 0:
            continue
        loop, corners, now = [], [], k
        while True:
            loop.append(now)
            if now in onward:
                now = onward[now]
            else:
                out = crossings[now]
                passed, met = _run(ground, crossed[arc.panel], out.corner, out.share)
                if met is None or met[1] or len(loop) > len(arcs):
                    mesh = ground.mesh
                    spot = mesh.vertices[mesh.corners[out.corner]]
                    raise LostWayError(f"borders cross each other near {place(spot)}")
                corners += passed
                now = met[2]
            if now == k:
                break
            if now in loop:
                raise LostWayError("borders cross each other")
        gone = [a for a in loop if a in removed]
        if gone and len(gone) < len(loop):
            spot = ground.finder.middle[arc.panel]
            raise LostWayError(f"the border runs along an edge near {place(spot)}")
        for a in loop:
            piece_of_arc[a] = len(owner) if not gone else -2
        if gone:
            continue
        piece_of_corner[corners] = len(owner)
        owner.append(arc.panel)
    return piece_of_arc, owner


def _inner_panels(
    ground: Ground, crossed: set[int], piece_of_corner: IntArray, first: int
) -> list[int]:
    """Number the panels that no border crosses and that lie to the left; return them."""
    mesh, twin = ground.mesh, ground.twin
    whole = np.ones(mesh.n_faces, bool)
    whole[list(crossed)] = False
    face = mesh.face_of_corner
    inner = np.flatnonzero((twin >= 0) & whole[face] & whole[face[twin]])
    graph = coo_matrix(
        (np.ones(len(inner)), (face[inner], face[twin[inner]])), shape=(mesh.n_faces,) * 2
    )
    label = connected_components(graph, directed=False)[1]
    # An uncrossed edge of a crossed panel says on which side the panel beyond lies.
    beside = np.flatnonzero(~whole[face] & (twin >= 0))
    beside = beside[whole[face[twin[beside]]]]
    kept = (piece_of_corner[beside] >= 0) & (piece_of_corner[mesh.next_corner[beside]] >= 0)
    votes = np.zeros((int(label.max(initial=0)) + 1, 2), np.int64)
    np.add.at(votes, (label[face[twin[beside]]], kept.astype(np.int64)), 1)
    both = np.flatnonzero((votes > 0).all(axis=1))
    if len(both):
        spot = ground.finder.middle[np.flatnonzero(whole & (label == both[0]))[0]]
        raise LostWayError(f"the border leaves both sides of the panel at {place(spot)} joined")
    inside = np.flatnonzero(whole & (votes[label, 1] > 0))
    number = np.full(mesh.n_faces, -1)
    number[inside] = first + np.arange(len(inside))
    mine = whole[face]
    piece_of_corner[mine] = number[face[mine]]
    return [int(f) for f in inside]


def _kept_triangles(whole: Shell, ground: Ground, piece_of_corner: IntArray) -> IntArray:
    """Return the dual triangles of the vertices that stay, as pieces."""
    mesh = ground.mesh
    table = whole.triangles[whole.used_vertices]
    face = whole.panels[mesh.face_of_corner]
    column = (table[mesh.corners] == face[:, None]).argmax(axis=1)
    pieces = np.full(table.shape, -1)
    pieces[mesh.corners, column] = piece_of_corner
    kept = (pieces >= 0).any(axis=1)
    part = kept & (pieces < 0).any(axis=1)
    if part.any():
        panel = np.zeros(len(whole.normals), bool)
        panel[whole.panels] = True
        rows = np.flatnonzero(part)
        inside = panel[table[rows]].all(axis=1)
        spot = place(mesh.vertices[rows[np.argmin(inside)]])
        if inside.all():
            raise LostWayError(f"a border runs along an edge near {spot}")
        raise MeshError(
            f"after the cut the shell would still end in its own border, at {spot}; give every "
            "border, each with the film on its left seen from the tips of the normals"
        )
    return pieces[kept]


def _one_part(ground: Ground, owner: list[int], triangles: IntArray) -> None:
    """Refuse what hangs together in no more than a corner, or not at all."""
    n = len(owner)
    a, b = triangles.ravel(), np.roll(triangles, -1, axis=1).ravel()
    both = (a < n) & (b < n)
    graph = coo_matrix((np.ones(int(both.sum())), (a[both], b[both])), shape=(n, n))
    count, label = connected_components(graph, directed=False)
    if count > 1:
        other = int(np.flatnonzero(label != np.bincount(label).argmax())[0])
        raise LostWayError(
            f"the borders cut the shell into {count} parts, one at "
            f"{place(ground.finder.middle[owner[other]])}; cut them one by one"
        )

"""Cutting a mesh with umbilics open to a disc, and what has to hold across the cuts.

On the disc w is a plain function. Across a cut it continues as ±w + t with one translation t per
cut *segment*. The value at a corner is then ±(value of its vertex) plus a whole combination of
translations; closing up around the vertices gives relations among translations and the values at
umbilics, whose whole solutions are all that a lattice can do on this mesh.

References
----------
Kälberer, Nieser, Polthier 2007, "QuadCover"; Bommes, Zimmer, Kobbelt 2009, "Mixed-integer
quadrangulation".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import breadth_first_order, connected_components

from phexfab.errors import MeshError
from phexfab.remesh.mesh_lattices.line_field import LineField
from phexfab.remesh.seamless.integers import null_space

IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Cut:
    """A mesh with umbilics cut open to a disc.

    Attributes
    ----------
    signs : (m,) int
        ±1 by which each triangle's steps are multiplied so that they agree on the disc.
    flip : (3m,) int
        ±1: w beyond the half-edge is ``flip·w + translation``.
    sign : (3m,) int
        Sign with which the value of a corner's vertex counts at the corner.
    whole : (3m, k) sparse int
        What k free whole unknowns (each a lattice vector) add at each corner. At an umbilic they
        are all there is.
    shift : (3m, k) sparse int
        The translation of every half-edge in these unknowns.
    fixed : (n,) bool
        Vertices without a value of their own: umbilics.
    pinned : bool
        Whether the lattice's place is still free (no umbilic, no half-turn), so that one vertex
        may be put at 0.
    """

    signs: IntArray
    flip: IntArray
    sign: IntArray
    whole: sp.csr_matrix
    shift: sp.csr_matrix
    fixed: NDArray[np.bool_]
    pinned: bool


def cut_open(field: LineField) -> Cut:
    """Cut a line field's mesh open.

    Raises
    ------
    MeshError
        If the mesh falls into several pieces.
    """
    half, m = field.half, len(field.triangles)
    triangle = np.repeat(np.arange(m), 3)
    inner = np.flatnonzero(half.twin >= 0)
    pair = inner[inner < half.twin[inner]]
    a, b = triangle[pair], triangle[half.twin[pair]]
    agree = field.signs[pair] * field.signs[half.twin[pair]]
    label = np.arange(1, len(pair) + 1)
    graph = sp.csr_matrix((np.tile(label, 2), (np.r_[a, b], np.r_[b, a])), shape=(m, m))
    order, before = breadth_first_order(graph, 0, directed=False)
    if len(order) < m:
        missing = field.points[field.triangles[np.setdiff1d(np.arange(m), order)[0], 0]]
        raise MeshError(
            "the mesh falls into several pieces, one of them at "
            f"({missing[0]:.1f}, {missing[1]:.1f}, {missing[2]:.1f}) mm: give each piece by itself"
        )
    # Signs along the tree; two triangles that share two edges are told apart by the tree's edge.
    lookup: dict[tuple[int, int], int] = {}
    for k, (x, y) in enumerate(zip(a.tolist(), b.tolist(), strict=True)):
        lookup.setdefault((x, y), k)
        lookup.setdefault((y, x), k)
    signs = np.ones(m, np.int64)
    in_tree = np.zeros(len(pair), bool)
    agree_list, sign_list = agree.tolist(), signs.tolist()
    for child in order[1:].tolist():
        parent = int(before[child])
        k = lookup[parent, child]
        in_tree[k] = True
        sign_list[child] = sign_list[parent] * agree_list[k]
    signs = np.array(sign_list, np.int64)
    flip = np.ones(3 * m, np.int64)
    across = agree * signs[a] * signs[b]
    flip[pair] = flip[half.twin[pair]] = across

    odd = field.cone_order % 2 == 1
    cut = _peeled(half.tail[pair], half.head[pair], ~in_tree, odd | field.on_border)
    if np.any(across[~cut] < 0):
        raise MeshError("the signs of the curvature lines do not agree: the mesh is too coarse")
    segment, leaving, count = _segments(
        np.flatnonzero(cut), half.tail[pair], half.head[pair], odd | field.on_border
    )
    return _relations(field, signs, flip, pair, segment, leaving, count)


def _peeled(
    tail: IntArray, head: IntArray, cut: NDArray[np.bool_], keep: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Return the cut edges that stay when loose ends are closed again."""
    left = cut.copy()
    at: dict[int, set[int]] = {}
    for e in np.flatnonzero(cut).tolist():
        at.setdefault(int(tail[e]), set()).add(e)
        at.setdefault(int(head[e]), set()).add(e)
    loose = [v for v, edges in at.items() if len(edges) == 1 and not keep[v]]
    while loose:
        v = loose.pop()
        if len(at[v]) != 1:
            continue
        e = at[v].pop()
        left[e] = False
        other = int(head[e]) if int(tail[e]) == v else int(tail[e])
        at[other].discard(e)
        if len(at[other]) == 1 and not keep[other]:
            loose.append(other)
    return left


def _segments(
    edges: IntArray, tail: IntArray, head: IntArray, stop: NDArray[np.bool_]
) -> tuple[dict[int, int], dict[int, int], int]:
    """Return segment of every cut edge, and +1 where the edge runs along it."""
    at: dict[int, list[int]] = {}
    for e in edges.tolist():
        at.setdefault(int(tail[e]), []).append(e)
        at.setdefault(int(head[e]), []).append(e)
    segment: dict[int, int] = {}
    leaving: dict[int, int] = {}
    count = 0
    for start in sorted(v for v, found in at.items() if len(found) != 2 or stop[v]):
        for first in at[start]:
            if first in segment:
                continue
            v, e = start, first
            while True:
                ahead = int(tail[e]) == v
                segment[e], leaving[e] = count, 1 if ahead else -1
                v = int(head[e]) if ahead else int(tail[e])
                if len(at[v]) != 2 or stop[v]:
                    break
                e = at[v][0] if at[v][1] == e else at[v][1]
            count += 1
    return segment, leaving, count


def _relations(
    field: LineField,
    signs: IntArray,
    flip: IntArray,
    pair: IntArray,
    segment: dict[int, int],
    leaving: dict[int, int],
    count: int,
) -> Cut:
    """Express corners and translations by free whole unknowns."""
    half, m = field.half, len(field.triangles)
    vertex = field.triangles.ravel()
    after = (np.arange(3 * m) // 3) * 3 + (np.arange(3 * m) + 1) % 3
    is_cut = np.zeros(len(pair), bool)
    is_cut[list(segment)] = True
    glue = pair[~is_cut]
    # Corner i of a triangle has the number of the half-edge that leaves it.
    back = half.twin[glue]
    row = np.r_[glue, after[glue]]
    column = np.r_[after[back], back]
    joined = sp.csr_matrix((np.ones(len(row)), (row, column)), shape=(3 * m, 3 * m))
    n_class, corner_class = connected_components(joined, directed=False)
    class_vertex = np.empty(n_class, np.int64)
    class_vertex[corner_class] = vertex

    size = count + len(field.cones)
    cone_column = {int(v): count + k for k, v in enumerate(field.cones)}
    links: dict[int, list[tuple[int, int, int, int]]] = {}
    shift_rows: dict[int, tuple[int, int]] = {}
    for e, s in segment.items():
        h = int(pair[e])
        g = int(half.twin[h])
        turn, way = int(flip[h]), leaving[e]
        # Left to right along the segment: w -> turn·w + t; back: w -> turn·w − turn·t.
        shift_rows[h] = (s, 1 if way > 0 else -turn)
        shift_rows[g] = (s, -turn if way > 0 else 1)
        for x, y in ((h, int(after[g])), (int(after[h]), g)):
            cx, cy = int(corner_class[x]), int(corner_class[y])
            links.setdefault(cx, []).append((cy, turn, s, shift_rows[h][1]))
            links.setdefault(cy, []).append((cx, turn, s, shift_rows[g][1]))

    sign = np.ones(n_class, np.int64)
    offset: dict[int, IntArray] = {}
    zero = np.zeros(size, np.int64)
    found: set[tuple[int, ...]] = set()
    for root in sorted(links):
        if root in offset:
            continue
        offset[root] = zero
        queue = [root]
        while queue:
            here = queue.pop()
            for there, turn, s, weight in links[here]:
                value = turn * offset[here]
                value[s] += weight
                if there not in offset:
                    sign[there], offset[there] = turn * sign[here], value
                    queue.append(there)
                    continue
                gap = value - offset[there]
                v = int(class_vertex[there])
                if sign[there] != turn * sign[here]:
                    gap[cone_column[v]] += turn * sign[here] - sign[there]
                if gap.any():
                    found.add(tuple((gap * np.sign(gap[np.flatnonzero(gap)[0]])).tolist()))
    # The lattice's own place: an umbilic lies at 0, or without one a half-turn about 0.
    turned = [s for e, s in segment.items() if flip[pair[e]] < 0]
    pinned = not len(field.cones) and not turned
    if not pinned:
        place = zero.copy()
        place[count if len(field.cones) else min(turned)] = 1
        found.add(tuple(place.tolist()))
    basis = null_space(np.array(sorted(found), dtype=object).reshape(len(found), size), size)

    entries = [
        (k, j, value[j]) for k, value in offset.items() for j in np.flatnonzero(value).tolist()
    ]
    entries += [
        (k, cone_column[int(class_vertex[k])], sign[k])
        for k in np.flatnonzero(field.is_cone[class_vertex]).tolist()
    ]
    combos = _sparse(entries, (n_class, size))
    shift = _sparse([(h, s, weight) for h, (s, weight) in shift_rows.items()], (3 * m, size))
    matrix = sp.csr_matrix(basis)
    return Cut(
        signs,
        flip,
        sign[corner_class],
        (combos @ matrix).tocsr()[corner_class],
        (shift @ matrix).tocsr(),
        field.is_cone,
        pinned,
    )


def _sparse(entries: list[tuple[int, int, int]], shape: tuple[int, int]) -> sp.csr_matrix:
    table = np.array(entries, np.int64).reshape(-1, 3)
    return sp.csr_matrix((table[:, 2], (table[:, 0], table[:, 1])), shape=shape, dtype=np.int64)

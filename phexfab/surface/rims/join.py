"""Curves that lie about, put end to end into closed rims; corners recognised at the joints."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from phexfab.errors import DesignError
from phexfab.surface.rims.corners import CORNER_ANGLE, angles_between, sharp_joints
from phexfab.surface.rims.pieces import Piece, line
from phexfab.surface.rims.rim import Rim
from phexfab.surface.rims.spline import open_spline, place

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

JOIN = 1e-6  # ends nearer than this share of the size are one point
_IN_LINE = 1e-7  # degrees: straight pieces that turn by less are one line


@dataclass(frozen=True, eq=False)
class Strand:
    """A curve that is part of a rim, and what a message calls it, such as "LINE 2F"."""

    piece: Piece
    label: str


def join_strands(
    strands: Sequence[Strand],
    name: str,
    tolerance: float | None = None,
    corner_angle: float = CORNER_ANGLE,
) -> tuple[Rim, ...]:
    """Return the closed rims that curves form end to end, in the order of their first curves.

    Ends that differ by no more than the tolerance are drawn together to their mean. Tangents are
    compared at each joint: a turn above ``corner_angle`` is a corner. Straight strands in a row
    that meet at no corner are taken for the chords of a curve and interpolated; lines that go
    straight on become one line.

    Parameters
    ----------
    strands
        In mm, in any order and direction. The first one of each rim gives its direction.
    name
        What messages call the rim; with several, ``name:1``, ``name:2``, ...
    tolerance
        mm; 1e-6 of the size of everything by default.
    corner_angle
        Degrees; see `rim_corners.sharp_joints`.

    Raises
    ------
    DesignError
        For a strand without length, strands given twice, ends that meet nothing (with the gap and
        where it is), and points in which more than two ends meet.
    """
    if not strands:
        raise DesignError(f"{name}: there is no curve")
    ends = np.array([strand.piece.ends for strand in strands])
    size = size_of(strands)
    reach = JOIN * size if tolerance is None else tolerance
    if not reach >= 0.0:
        raise DesignError(f"{name}: tolerance {tolerance} mm; give a length of 0 or more")
    for strand in strands:
        if not strand.piece.length > reach:
            raise DesignError(
                f"{name}: {strand.label} at {place(strand.piece.ends[0])} has no length "
                f"({strand.piece.length:.3g} mm); remove it"
            )
    _check_twice(strands, ends, reach, name)
    nodes = _nodes(ends.reshape(-1, 3), reach)
    _check_nodes(strands, ends, nodes, reach, name)
    sums = np.stack([np.bincount(nodes, ends.reshape(-1, 3)[:, k]) for k in range(3)], axis=1)
    centres = sums / np.bincount(nodes)[:, None]
    loops = _loops(nodes.reshape(-1, 2))
    rims = []
    for number, loop in enumerate(loops):
        pieces = []
        for k, backward in loop:
            at = nodes.reshape(-1, 2)[k]
            shift = centres[at] - ends[k]
            piece = strands[k].piece
            if np.abs(shift).max() > 1e-14 * size:
                piece = piece.pulled(shift[0], shift[1])
            pieces.append(piece.reversed() if backward else piece)
        title = name if len(loops) == 1 else f"{name}:{number + 1}"
        rims.append(rim_of_pieces(pieces, title, corner_angle))
    return tuple(rims)


def rim_of_pieces(pieces: Sequence[Piece], name: str, corner_angle: float = CORNER_ANGLE) -> Rim:
    """Return the rim of pieces end to end, with its corners recognised; see `join_strands`."""
    chain = list(pieces)
    tangents = np.array([piece.tangents for piece in chain])
    turns = angles_between(np.roll(tangents[:, 1], 1, axis=0), tangents[:, 0])
    lengths = np.array([piece.length for piece in chain])
    straight = np.array([piece.straight for piece in chain])
    sharp = sharp_joints(turns, lengths, straight, corner_angle)
    # A chord goes on where two straight pieces meet at no corner.
    goes_on = straight & np.roll(straight, 1) & ~sharp
    if goes_on.all():
        return Rim.through([piece.ends[0] for piece in chain], name=name)
    first = int(np.argmax(sharp)) if sharp.any() else int(np.argmin(goes_on))
    order = (first + np.arange(len(chain))) % len(chain)
    found: list[Piece] = []
    corners: list[int] = []
    run: list[int] = []
    for k in [*order.tolist(), None]:
        if run and (k is None or not goes_on[k]):
            found += _chords([chain[i] for i in run], turns[run], name)
            run = []
        if k is None:
            break
        if sharp[k]:
            corners.append(len(found))
        if straight[k]:
            run.append(k)
        else:
            found.append(chain[k])
    return Rim.joined(found, corners, name)


def _chords(run: list[Piece], turns: FloatArray, name: str) -> list[Piece]:
    """Straight pieces in a row: one line, or the curve through their ends."""
    if len(run) == 1:
        return run
    points = np.array([*(piece.ends[0] for piece in run), run[-1].ends[1]])
    if np.all(turns[1:] <= _IN_LINE):
        return [line(points[0], points[-1])]
    return [open_spline(points, np.arange(len(points)), name)]


def size_of(strands: Sequence[Strand]) -> float:
    """Return the diagonal of a box around strands, mm."""
    s = np.linspace(0.0, 1.0, 9)
    points = np.concatenate([strand.piece.values(s, 0) for strand in strands])
    if not np.isfinite(points).all():
        bad = next(st for st in strands if not np.isfinite(st.piece.values(s, 0)).all())
        raise DesignError(f"{bad.label} has coordinates that are not finite; draw it again")
    return float(np.linalg.norm(np.ptp(points, axis=0)))


def _check_twice(strands: Sequence[Strand], ends: FloatArray, reach: float, name: str) -> None:
    """Refuse curves given twice: same ends and the same points at thirds of their length."""
    thirds = np.array([_at_thirds(strand.piece) for strand in strands])
    flip = np.array([tuple(e[0]) > tuple(e[1]) for e in np.round(ends / max(reach, 1e-12))])
    keys = np.concatenate([ends, thirds], axis=1)  # start, end, third, two thirds
    keys[flip] = keys[flip][:, [1, 0, 3, 2]]
    pairs = cKDTree(keys.reshape(len(strands), -1)).query_pairs(
        4.0 * max(reach, 1e-12), output_type="ndarray"
    )
    if len(pairs):
        i, j = pairs[np.lexsort(pairs.T[::-1])][0].tolist()
        raise DesignError(
            f"{name}: {strands[i].label} and {strands[j].label} at {place(ends[i, 0])} are the "
            "same curve; remove one"
        )


def _at_thirds(piece: Piece) -> FloatArray:
    if piece.straight:
        return piece.values(np.array([1.0, 2.0]) / 3.0, 0)
    whole = Rim("", np.empty(0), (piece,), np.array([0.0, 1.0]))
    return whole.point(whole.at_length(whole.length * np.array([1.0, 2.0]) / 3.0))


def _nodes(ends: FloatArray, reach: float) -> IntArray:
    """Number (2n,) of the point in which each end lies."""
    pairs = cKDTree(ends).query_pairs(reach, output_type="ndarray")
    graph = coo_array(
        (np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(ends), len(ends))
    )
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.intp)


def _check_nodes(
    strands: Sequence[Strand], ends: FloatArray, nodes: IntArray, reach: float, name: str
) -> None:
    """Refuse points in which one end, or more than two, meet."""
    degree = np.bincount(nodes)[nodes]
    flat = ends.reshape(-1, 3)
    many = np.flatnonzero(degree > 2)
    if len(many):
        k = int(many[0])
        meeting = [strands[i // 2].label for i in np.flatnonzero(nodes == nodes[k]).tolist()]
        raise DesignError(
            f"{name}: {len(meeting)} ends meet at {place(flat[k])} ({', '.join(meeting[:6])}); "
            "in a rim two curves meet in a point: remove the others, or choose a layer"
        )
    loose = np.flatnonzero(degree == 1)
    if len(loose):
        k = int(loose[0])
        others = loose[1:]
        gaps = np.linalg.norm(flat[others] - flat[k], axis=1)
        near = int(others[np.argmin(gaps)])
        raise DesignError(
            f"{name}: the curve is open at {place(flat[k])}, an end of {strands[k // 2].label}; "
            f"the nearest loose end is {gaps.min():.6g} mm away at {place(flat[near])} "
            f"({strands[near // 2].label}), and ends must meet within {reach:.3g} mm: close the "
            "gap, or say tolerance"
        )


def _loops(at: IntArray) -> list[list[tuple[int, bool]]]:
    """Loops of (strand, backward) from the nodes (n, 2) of the strands' ends."""
    ends_of: dict[int, list[int]] = {}
    for end, node in enumerate(at.ravel().tolist()):
        ends_of.setdefault(node, []).append(end)
    done = np.zeros(len(at), dtype=bool)
    loops = []
    for start in range(len(at)):
        if done[start]:
            continue
        loop: list[tuple[int, bool]] = []
        entry = 2 * start
        while not done[entry // 2]:
            done[entry // 2] = True
            loop.append((entry // 2, bool(entry % 2)))
            exit_ = entry ^ 1
            one, two = ends_of[int(at.ravel()[exit_])]
            entry = two if one == exit_ else one
        loops.append(loop)
    return loops

"""Lattice points and triangles of a seamless parametrisation, traced exactly on its mesh.

Lattice coordinates are whole multiples of a binary fraction, so on which side of an edge a point
lies is decided in whole numbers, and alike from both sides of a seam. Every point inside, on an
edge or at a vertex appears once; its neighbours are found by walking one lattice step straight
through the triangles.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.csgraph import connected_components

from phexfab.errors import LatticeError
from phexfab.remesh.lattice import Lattice
from phexfab.remesh.mesh_lattices.line_field import half_edges
from phexfab.remesh.mesh_lattices.patchwork import located
from phexfab.remesh.mesh_lattices.points import (
    LatticePoints,
    Slots,
    lattice_points,
    slots_of,
)
from phexfab.remesh.mesh_lattices.poisson import lattice_basis
from phexfab.remesh.mesh_lattices.seamless import Seamless, closings, jacobians
from phexfab.remesh.mesh_lattices.walk import walk
from phexfab.triangular import ASYMPTOTIC_MARGIN, EQUILATERAL

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]

_STRAY = 0.05  # share of panels in groups by themselves that may be dropped
_HOLE = 4.0  # lattice steps around a hole, at least
_TURN = 14.0  # degrees; at 15 an edge family of the equilateral lattice vanishes


@dataclass(frozen=True, eq=False)
class MeshLattice:
    """A triangular lattice on a triangle mesh.

    Attributes
    ----------
    lattice : Lattice
        Every triangle counter-clockwise about the normals with its first edge along a row, all
        upward. ``points`` are w̃ on the mesh cut open, √mm; put the surface's parameters there
        when they are known. ``density`` is |dw̃/dw|, w = ∫√Q with |dw| = √κ ds in √mm.
    face : (F,) int
        Triangle of the mesh in which each lattice point lies, and ``barycentric`` (F, 3), where.
    umbilics : (U,) int
        Lattice points that are umbilics, and ``orders`` (U,): rings have 3(m + 2) triangles there.
    strain : float
        Root mean square deviation of the coordinates from exact curvature-line coordinates.
    turn : float
        Largest angle in degrees by which a lattice edge at a panel is turned off its direction.
    """

    lattice: Lattice
    face: IntArray
    barycentric: FloatArray
    umbilics: IntArray
    orders: IntArray
    strain: float
    turn: float

    @property
    def density(self) -> FloatArray:
        """(F,) |dw̃/dw| at the lattice points."""
        density = self.lattice.density
        return np.ones(len(self.face)) if density is None else density

    def on_mesh(self, values: ArrayLike, triangles: ArrayLike) -> FloatArray:
        """Return values given at the mesh's vertices, (n, …), at the lattice points, (F, …)."""
        corner = np.asarray(values)[np.asarray(triangles)[self.face]]
        return np.asarray(np.einsum("fk,fk...->f...", self.barycentric, corner))


def mesh_lattice(
    points: ArrayLike,
    triangles: ArrayLike,
    normals: ArrayLike,
    directions: ArrayLike,
    curvatures: ArrayLike,
    *,
    panel_size: float,
    row_ratio: float = EQUILATERAL,
    rows_along: str = "u",
    kind: str = "face",
    same_topology: bool = True,
) -> MeshLattice:
    """Return the lattice of a minimal surface that is given as a mesh, of any topology.

    Parameters
    ----------
    points, triangles, normals, directions, curvatures
        See `phexfab.remesh.mesh_lattices.seamless.seamless`.
    panel_size : float
        Median distance of neighbouring panel centres, mm; changed by up to 15 % so that the
        lattice closes.
    row_ratio, rows_along, kind
        As there.
    same_topology : bool
        Refuse panels in several groups, or with other holes and handles than the mesh. Without it
        panels may leave out necks, as in a margin that is cut away later, and groups that are a
        small part of all panels are dropped.

    Raises
    ------
    MeshError
        If the mesh or its directions are malformed, or too coarse at an umbilic.
    LatticeError
        If no lattice of that size closes, panels would not be valid or none fits; the message
        names place and remedy.

    Examples
    --------
    >>> import phexfab as px
    >>> film = px.periodic_film("schwarz-p", cell=1000.0, edge_length=50.0, margin=100.0)  # mm
    >>> found = px.mesh_lattice(
    ...     film.points,
    ...     film.triangles,
    ...     film.normals,
    ...     film.directions,
    ...     film.curvatures,
    ...     panel_size=120.0,
    ... )
    >>> len(found.lattice.points), len(found.lattice.triangles)
    (248, 432)
    """
    ways = closings(
        points,
        triangles,
        normals,
        directions,
        curvatures,
        panel_size=panel_size,
        row_ratio=row_ratio,
        rows_along=rows_along,
        kind=kind,
    )
    failed: LatticeError | None = None
    for on in ways:
        try:
            return traced(on, panel_size, same_topology)
        except LatticeError as error:
            failed = failed or error
    raise failed or LatticeError(_remark(panel_size, "no lattice closes on this mesh"))


def traced(on: Seamless, panel_size: float = 0.0, same_topology: bool = True) -> MeshLattice:
    """Return the lattice of a seamless parametrisation; see `mesh_lattice`.

    Raises
    ------
    LatticeError
        If no panel fits, lattice edges come too near to asymptotic directions, or the lattice has
        not the topology of the mesh.
    """
    found = lattice_points(on)
    slots = slots_of(on, found)
    neighbour, square = walk(on, found, slots)
    n = len(found.first)
    one, two = np.arange(len(slots.own)), slots.following
    good = slots.joined & (neighbour[one] >= 0) & (neighbour[two] >= 0)
    one = one[good]
    raw = np.column_stack([slots.own[one], neighbour[one], neighbour[two[good]]])
    # Seen from its three corners a triangle has its row edge first, second, last.
    shift = slots.direction[one] % 3
    raw = raw[np.arange(len(raw))[:, None], (shift[:, None] + np.arange(3)) % 3]
    triangles, seen = np.unique(raw, axis=0, return_counts=True)
    triangles = triangles[seen == 3]
    distinct = (triangles != np.roll(triangles, 1, axis=1)).all(axis=1)
    if not distinct.all() or (seen > 3).any():
        raise LatticeError(_remark(panel_size, "fewer than three panels go around somewhere"))
    ring = np.bincount(slots.own, minlength=n)
    closed = np.ones(n, bool)
    closed[slots.own[~slots.joined]] = False
    valence = np.bincount(triangles.ravel(), minlength=n)
    panel = closed & (valence == ring) & (ring > 0)
    if not panel.any():
        raise LatticeError(_remark(panel_size, "no panel fits the mesh"))
    panel = _one_group(triangles, panel, panel_size, 0.0 if same_topology else _STRAY)
    triangles = triangles[panel[triangles].any(axis=1)]
    used = np.unique(triangles)
    number = np.full(n, -1)
    number[used] = np.arange(len(used))
    triangles = number[triangles]
    _check_topology(on, triangles, panel_size, same_topology)
    turn = _check_turn(on, found, slots, neighbour, square, panel, panel_size)

    hits = found.first[used]
    face, weight = found.face[hits], found.weight[hits]
    field = on.field
    basis = lattice_basis(on.step, on.row_ratio, on.rows_along)
    stretch = np.sqrt(np.abs(np.linalg.det(jacobians(on))))
    density = stretch[face]
    cone_at = np.where(
        found.corner[hits] >= 0,
        field.triangles[face, np.maximum(found.corner[hits], 0)],
        -1,
    )
    is_cone = (cone_at >= 0) & field.is_cone[cone_at]
    if is_cone.any():  # w has no derivative there: the mean over the triangles around
        incident = field.is_cone[field.triangles]
        total = np.bincount(field.triangles[incident], np.repeat(stretch, 3)[incident.ravel()])
        many = np.bincount(field.triangles[incident])
        density[is_cone] = (total / np.maximum(many, 1))[cone_at[is_cone]]
    umbilics = np.flatnonzero(is_cone)
    made = Lattice(
        found.at[hits] @ basis,
        triangles,
        np.ones(len(triangles), bool),
        on.step,
        on.row_ratio,
        closed=_euler(triangles) != 1,
        density=density,
    )
    return MeshLattice(
        made,
        *located(field, on.given, face, weight),
        umbilics,
        field.cone_order[cone_at[umbilics]],
        on.strain,
        turn,
    )


def _remark(panel_size: float, what: str) -> str:
    return f"lattice.panel_size = {panel_size:g}: {what}; choose smaller panels"


def _euler(triangles: IntArray) -> int:
    """Return V − E + F; a vertex where parts only touch counts once for each part."""
    n = int(triangles.max()) + 1
    half = half_edges(triangles, n)
    corner = np.flatnonzero(half.twin >= 0)
    back = half.twin[corner]
    after = corner // 3 * 3 + (corner + 1) % 3
    behind = back // 3 * 3 + (back + 1) % 3
    row, column = np.r_[corner, after], np.r_[behind, back]
    size = 3 * len(triangles)
    joined = sp.csr_matrix((np.ones(len(row)), (row, column)), shape=(size, size))
    return int(connected_components(joined, directed=False)[0]) - len(half.ends) + len(triangles)


def _one_group(
    triangles: IntArray, panel: NDArray[np.bool_], panel_size: float, stray: float
) -> NDArray[np.bool_]:
    """Return the panels of the largest group that edges join; refuse if others are too many."""
    tail, head = triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
    both = panel[tail] & panel[head]
    graph = sp.csr_matrix((np.ones(both.sum()), (tail[both], head[both])), shape=(len(panel),) * 2)
    _, label = connected_components(graph, directed=False)
    size = np.bincount(label[panel])
    kept = panel & (label == size.argmax())
    if panel.sum() - kept.sum() > stray * panel.sum():
        raise LatticeError(
            _remark(
                panel_size,
                f"the panels fall into {np.count_nonzero(size)} groups that no edge joins",
            )
        )
    return np.asarray(kept)


def _check_topology(
    on: Seamless, triangles: IntArray, panel_size: float, same_topology: bool
) -> None:
    """Refuse a lattice with other holes and handles than the mesh, or one that closes a hole."""
    have, want = _euler(triangles), _euler(on.field.triangles)
    if have != want and same_topology:
        raise LatticeError(
            _remark(
                panel_size,
                f"the panels leave out a neck or close a hole of the mesh (Euler characteristic "
                f"{have} instead of {want})",
            )
        )
    # Three edges may close around a hole that is no larger than their triangle.
    half = on.field.half
    rim = np.flatnonzero(half.twin < 0)
    ends = np.column_stack([half.tail[rim], half.head[rim]])
    graph = sp.csr_matrix((np.ones(len(rim)), ends.T), shape=(len(on.field.points),) * 2)
    _, label = connected_components(graph, directed=False)
    length = np.bincount(label[ends[:, 0]], np.abs(on.field.edge_steps[half.edge[rim]]))
    loop = np.unique(label[ends[:, 0]])
    tight = loop[length[loop] < _HOLE * on.step]
    if len(tight):
        place = on.field.points[ends[label[ends[:, 0]] == tight[0], 0]].mean(axis=0)
        raise LatticeError(
            _remark(
                panel_size,
                f"the hole at ({place[0]:.0f}, {place[1]:.0f}, {place[2]:.0f}) mm is smaller than "
                "a panel",
            )
        )


def _check_turn(
    on: Seamless,
    found: LatticePoints,
    slots: Slots,
    neighbour: IntArray,
    square: ComplexArray,
    panel: NDArray[np.bool_],
    panel_size: float,
) -> float:
    """Return the largest turn in degrees; refuse lattice edges near asymptotic directions."""
    ring = np.bincount(slots.own, minlength=len(panel))
    keep = (neighbour >= 0) & panel[slots.own] & (ring[slots.own] == 6)
    keep &= ring[neighbour] == 6
    angle = np.degrees(np.angle(square[keep])) / 2 - (90 if on.rows_along == "v" else 0)
    k = slots.direction[keep] % 3
    ideal = np.array([0.0, *np.degrees(np.arctan2(on.row_ratio, [0.5, -0.5]))])[k]
    off = (angle - ideal + 90) % 180 - 90
    slope = np.abs((angle + 90) % 180 - 90)
    room = np.where(k == 0, 45 - slope, slope - 45)
    if not len(room):
        return 0.0
    worst = int(np.minimum(room - ASYMPTOTIC_MARGIN, _TURN - np.abs(off)).argmin())
    if room[worst] < ASYMPTOTIC_MARGIN or abs(off[worst]) > _TURN:
        place = np.einsum(
            "k,kj->j",
            found.weight[slots.hit[keep][worst]],
            on.field.points[on.field.triangles[found.face[slots.hit[keep][worst]]]],
        )
        size = panel_size * min(0.7, 9 / max(abs(off[worst]), 1))
        raise LatticeError(
            f"lattice.panel_size = {panel_size:g}: near ({place[0]:.0f}, {place[1]:.0f}, "
            f"{place[2]:.0f}) mm a lattice edge is turned by {abs(off[worst]):.0f}° to close up, "
            f"{max(room[worst], 0.0):.1f}° from an asymptotic direction, where panel edges vanish; "
            f"choose smaller panels, about {size:.3g} mm"
        )
    return float(np.abs(off).max())

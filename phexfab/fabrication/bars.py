"""Where bars stand: how deep below M, and how their ends are cut at the nodes.

Everything about a bar follows from the node planes. Its top edge line is an edge of the parallel
mesh ``M ± δ·S``, so the top lines of a node meet in a point of its axis. Its ends are cut by planes
through the axis, so seen along the axis a bar is a strip of the width w between two lines through
one point: ``cot(θ/2)·w/2`` beyond that point, θ the angle to the next bar around the axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import DesignError, PartError
from phexfab.fabrication.frames import EdgeFrames, edge_frames
from phexfab.fabrication.marks import beam_marks, panel_marks
from phexfab.fabrication.panels import PanelSpec
from phexfab.fabrication.parts import Material
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

ENDS = ("mitred", "hub")
UPRIGHT = 1e-3  # cosine between a panel's normal and a node plane down to which bars can stand
COPLANAR = 1e-9  # radians: two end faces this close to one plane are made one face


@dataclass(frozen=True)
class BeamSpec:
    """How bars are made.

    Attributes
    ----------
    width, height : float, mm
        Of the flat bar; it stands on its narrow side, in the node plane.
    ends : {"mitred", "hub"}
        Mitred so that the bars of a node meet in its axis, or cut square to the node plane and
        parallel to the axis, clear of a hub.
    seat : float, mm
        Least height kept free between bars and panels (a gasket, a cleat).
    hub_radius, hub_clearance : float, mm
        With ``ends="hub"``: radius of the hub, and what is kept free between it and the bars.
    material : Material

    Raises
    ------
    DesignError
        If a size or a name is impossible; the message names it.

    Examples
    --------
    >>> import phexfab as px
    >>> px.BeamSpec(width=10, height=90, material=px.Material("aluminium", 2700.0)).ends
    'mitred'
    >>> px.BeamSpec(ends="square")
    Traceback (most recent call last):
        ...
    phexfab.errors.DesignError: beam ends is 'square'; choose one of mitred, hub
    """

    width: float = 10.0
    height: float = 90.0
    ends: str = "mitred"
    seat: float = 0.0
    hub_radius: float = 30.0
    hub_clearance: float = 1.0
    material: Material = Material("steel", 7850.0)  # noqa: RUF009 - a frozen value

    def __post_init__(self) -> None:
        for name, value in (("width", self.width), ("height", self.height)):
            if not (math.isfinite(value) and value > 0.0):
                raise DesignError(f"beam {name} is {value:g} mm; give a size above 0 mm")
        for name in ("seat", "hub_radius", "hub_clearance"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0.0):
                raise DesignError(f"beam {name} is {value:g} mm; give 0 mm or more")
        if self.ends not in ENDS:
            raise DesignError(f"beam ends is {self.ends!r}; choose one of {', '.join(ENDS)}")


def down(panel: PanelSpec) -> float:
    """Return the side of M on which bars stand: −1 against the normals, +1 along them.

    It is the side away from the panels; below panels that are centred on M.
    """
    return 1.0 if panel.side == "inside" else -1.0


def beam_drop(shell: Shell, spec: BeamSpec, panel: PanelSpec) -> float:
    """Return the offset δ in mm that takes the bars' top lines clear of the panels.

    The top edges of all bars are the edges of ``M − δ·S`` (``M + δ·S`` with panels inside): one
    value for the whole shell, the smallest for which no bar's top corner comes closer to the
    underside plane of a panel beside it than ``spec.seat``, measured across the top of the bar.

    Parameters
    ----------
    shell : Shell
    spec : BeamSpec
    panel : PanelSpec

    Raises
    ------
    PartError
        If an edge has no length or no node plane, or that plane lies in a panel; the message names
        the place or the parts.

    Notes
    -----
    In the cross-section of an edge (x to the left, z up in the node plane, the edge of M at 0) the
    underside of a panel that reaches τ below M is ``n_x·x + n_z·z = −τ``. The corner at
    ``x = ±w/2`` stays below it when the top lies ``(τ + max(±n_x·w/2, 0))/n_z`` down; S's edge
    line passes the origin at the distance ρ, so ``M − δ·S`` is ``δ·ρ`` down.
    """
    edges = shell.edges
    if len(edges) == 0:
        return 0.0
    frames = edge_frames(shell, edges[:, 0], edges[:, 1])
    side = down(panel)
    under = panel.levels[0] if side < 0.0 else -panel.levels[1]  # of the panel's underside, <= 0
    deepest = np.zeros(len(edges))
    for column, lateral in ((2, 1.0), (3, -1.0)):
        beside = np.flatnonzero(edges[:, column] >= 0)  # border edges have a panel on one side
        normal = shell.normals[shell.panels[edges[beside, column]]]
        across = lateral * np.einsum("ij,ij->i", normal, frames.left[beside])
        upward = np.einsum("ij,ij->i", normal, frames.up[beside])
        _refuse_lying(shell, beside, column, upward)
        drop = (-under + np.maximum(-side * across, 0.0) * spec.width / 2.0) / upward
        deepest[beside] = np.maximum(deepest[beside], drop)
    return float(np.max((deepest + spec.seat) / frames.distance))


def _refuse_lying(shell: Shell, edges: IntArray, column: int, upward: FloatArray) -> None:
    """Raise PartError where a bar would lie in the plane of a panel beside it, or beyond."""
    if len(upward) and not upward.min() > UPRIGHT:
        worst = int(upward.argmin())
        edge, lean = int(edges[worst]), np.degrees(np.arccos(np.clip(upward[worst], -1.0, 1.0)))
        raise PartError(
            f"beam {beam_marks(shell)[edge]} would lie in panel "
            f"{panel_marks(shell)[shell.edges[edge, column]]}, whose normal leans {lean:.1f}° off "
            'the beam; choose another lattice.panel_size, or border.panels = "whole"'
        )


@dataclass(frozen=True, eq=False)
class BarEnds:
    """The cuts at both ends of every edge; column 0 is the end at vertex i, column 1 at j.

    Attributes
    ----------
    left, right : (E, 2) radians
        Angle around the node axis from the bar to the next bar on its left and on its right, left
        being the edge's own left at both ends; above π where a panel has a reflex corner.
    cut_left, cut_right : (E, 2) mm
        Where the end face meets the bar's left and right side, along the edge, from the node axis
        into the bar; negative where the bar reaches beyond the axis.
    pointed : (E, 2) bool
        The end has two faces that meet in the axis; otherwise it is one plane.
    """

    left: FloatArray
    right: FloatArray
    cut_left: FloatArray
    cut_right: FloatArray
    pointed: BoolArray


def around_nodes(shell: Shell, frames: EdgeFrames) -> tuple[FloatArray, FloatArray]:
    """Return the (E, 2) angles in radians from every bar's end to the next one left and right.

    The angles are those seen along the node axis; around each node they add up to 2π.
    """
    edges = shell.edges
    n = len(edges)
    node = np.concatenate([edges[:, 0], edges[:, 1]])
    direction = np.concatenate([frames.along, -frames.along])
    axis = shell.gauss.vertices / np.linalg.norm(shell.gauss.vertices, axis=1, keepdims=True)
    # Any direction across the axis serves as zero; take the coordinate axis most across it.
    zero = np.eye(3)[np.argmin(np.abs(axis), axis=1)]
    zero = zero - np.einsum("ij,ij->i", zero, axis)[:, None] * axis
    zero = zero / np.linalg.norm(zero, axis=1, keepdims=True)
    quarter = np.cross(axis, zero)
    angle = np.arctan2(
        np.einsum("ij,ij->i", direction, quarter[node]),
        np.einsum("ij,ij->i", direction, zero[node]),
    )
    order = np.lexsort((angle, node))
    sorted_node = node[order]
    begin = np.searchsorted(sorted_node, sorted_node, side="left")
    end = np.searchsorted(sorted_node, sorted_node, side="right")
    place = np.arange(2 * n)
    following = order[np.where(place + 1 < end, place + 1, begin)]
    to_next = np.empty(2 * n)
    to_next[order] = angle[following] - angle[order]
    to_next = np.where(to_next <= 0.0, to_next + 2.0 * np.pi, to_next)
    to_previous = np.empty(2 * n)
    to_previous[following] = to_next[order]
    # At j the bar runs against the edge, so its own left is the edge's right.
    left = np.column_stack([to_next[:n], to_previous[n:]])
    right = np.column_stack([to_previous[:n], to_next[n:]])
    return left, right


def bar_ends(shell: Shell, spec: BeamSpec, frames: EdgeFrames) -> BarEnds:
    """Return how the bars of a shell are cut at their ends.

    Mitred, a bar ends on the two planes through the node axis that halve the angles to its
    neighbours. For a hub it ends on one plane across the node plane, parallel to the axis, at the
    distance ``max(hub_radius + hub_clearance, cot(θ/2)·w/2)`` from it: clear of the hub and, at
    sharp corners, of its neighbours.
    """
    left, right = around_nodes(shell, frames)
    half = spec.width / 2.0
    cut_left, cut_right = half / np.tan(left / 2.0), half / np.tan(right / 2.0)
    pointed = np.abs(left + right - 2.0 * np.pi) > COPLANAR
    if spec.ends == "hub":
        reach = np.maximum(spec.hub_radius + spec.hub_clearance, np.maximum(cut_left, cut_right))
        cut_left = cut_right = reach
        pointed = np.zeros_like(pointed)
    # These are distances from the axis; along an edge that leans against it they are longer.
    tips = shell.edges[:, :2]
    upright = frames.distance[:, None] / np.linalg.norm(shell.gauss.vertices, axis=1)[tips]
    return BarEnds(left, right, cut_left / upright, cut_right / upright, pointed)

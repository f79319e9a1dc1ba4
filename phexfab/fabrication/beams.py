"""Beams: a flat bar on every edge of the shell, standing in the node plane.

A bar is convex: a top and a bottom across the node plane, two sides parallel to it, and at each end
one or two planes parallel to the node axis. Its corners are written down directly: each end has
three lines parallel to the axis (left side, axis, right side), cut off by top and bottom.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import PartError
from phexfab.fabrication.bars import BarEnds, BeamSpec, bar_ends, beam_drop, down
from phexfab.fabrication.frames import EdgeFrames, edge_frames
from phexfab.fabrication.marks import beam_marks, node_marks, panel_marks
from phexfab.fabrication.panels import PanelSpec
from phexfab.fabrication.parts import Beam, EdgeNote, FlatPart, Solid
from phexfab.fabrication.polyhedra import prism_faces, volumes
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Bars:
    """All bars of a shell as arrays; column 0 is the end at vertex i of the edge, column 1 at j.

    Attributes
    ----------
    frames : EdgeFrames
    ends : BarEnds
    top : (E, 2, 3) mm
        Where the top line meets the node axes.
    fall : (E, 2, 3) mm
        From there along the axis to the bottom.
    side : float
        −1 where bars stand against the normals, +1 along them.
    """

    frames: EdgeFrames
    ends: BarEnds
    top: FloatArray
    fall: FloatArray
    side: float

    @property
    def length(self) -> FloatArray:
        """(E,) mm along the top between the node axes."""
        return np.einsum("ij,ij->i", self.top[:, 1] - self.top[:, 0], self.frames.along)

    @property
    def run(self) -> FloatArray:
        """(E, 2) mm by which the axes lean along the edge between top and bottom."""
        return np.einsum("evi,ei->ev", self.fall, self.frames.along)


def lay_bars(shell: Shell, spec: BeamSpec, panel: PanelSpec) -> Bars:
    """Return where the bars of a shell stand and how they are cut, as arrays.

    Parameters
    ----------
    shell : Shell
    spec : BeamSpec
    panel : PanelSpec
        The panels they carry: bars stand on the other side, clear of them.
    """
    tips = shell.edges[:, :2]
    frames = edge_frames(shell, tips[:, 0], tips[:, 1])
    side = down(panel)
    m, s = shell.mesh.vertices, shell.gauss.vertices
    top = m[tips] + side * beam_drop(shell, spec, panel) * s[tips]
    # ρ is how far S's edge rises in the node plane, so h/ρ times S is the height h across the top.
    fall = side * (spec.height / frames.distance)[:, None, None] * s[tips]
    return Bars(frames, bar_ends(shell, spec, frames), top, fall, side)


def beams(shell: Shell, spec: BeamSpec, panel: PanelSpec) -> tuple[Beam, ...]:
    """Return a bar for every row of ``shell.edges``, border edges too, in order.

    Parameters
    ----------
    shell : Shell
    spec : BeamSpec
    panel : PanelSpec
        The panels they carry.

    Returns
    -------
    tuple of Beam
        Left and right are the edge's, seen from the tips of the normals from vertex i to j. A mitre
        is positive where the bar's side is shorter than its middle; a slope is positive where the
        bar is longer at the bottom. The flat pattern lies in the node plane, x from i to j, y up to
        the panels, lower left corner of its box at 0; its edges are bottom, end j, top, end i. The
        end's bevel is the mitre of the end face on the drawing's side (the right one, or the left
        one where panels lie inside); both are in ``mitres``.

    Raises
    ------
    PartError
        If a bar is so short that its ends cross; the message names it.

    References
    ----------
    Thesis §4.2: offset meshes have torsion-free nodes.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> bars = px.beams(shell, px.BeamSpec(width=10, height=90), px.PanelSpec())
    >>> print(len(bars), bars[0].mark, f"{bars[0].length:.1f} mm")
    101 B001 317.5 mm
    >>> print([f"{left:.1f}°/{right:.1f}°" for left, right in bars[0].mitres])
    ['-27.1°/27.1°', '60.5°/-33.0°']
    """
    edges = shell.edges
    if len(edges) == 0:
        return ()
    bars = lay_bars(shell, spec, panel)
    names = beam_marks(shell)
    _refuse_crossed(bars, spec, names)

    solids = _solids(bars, spec)
    sizes = volumes(solids)
    masses = (sizes * (spec.material.density * 1e-9)).tolist()
    lengths = bars.length.tolist()
    # Positive where the axis leans outward on its way down, at either end.
    rise = np.abs(np.einsum("evi,ei->ev", bars.fall, bars.frames.up))
    slopes = np.degrees(np.arctan2(bars.run * [-1.0, 1.0], rise)).tolist()
    mitres = np.zeros((len(edges), 2, 2))
    if spec.ends == "mitred":
        mitres = 90.0 - np.degrees(np.stack([bars.ends.left, bars.ends.right], axis=2)) / 2.0
    outlines = _outlines(bars, spec)
    near = 1 if bars.side < 0.0 else 0
    seen = mitres[:, :, [near, 1 - near]].tolist()

    end_marks = np.array(node_marks(shell), object)[edges[:, :2]].tolist()
    met = _neighbours(shell, names)
    plain = EdgeNote("", 0.0)
    made = []
    for e, name in enumerate(names):
        (mark_i, mark_j), (at_i, at_j) = end_marks[e], seen[e]
        notes = (plain, EdgeNote(mark_j, *at_j), plain, EdgeNote(mark_i, *at_i))
        outline = outlines[e]
        flat = FlatPart(name, outline, outline, notes, spec.width, spec.material)
        (a, b), (c, d) = mitres[e].tolist()
        made.append(
            Beam(
                mark=name,
                edge=e,
                nodes=(mark_i, mark_j),
                neighbours=met[e],
                solid=solids[e],
                flat=flat,
                length=lengths[e],
                mitres=((a, b), (c, d)),
                slopes=(slopes[e][0], slopes[e][1]),
                volume=float(sizes[e]),
                mass=masses[e],
            )
        )
    return tuple(made)


def _solids(bars: Bars, spec: BeamSpec) -> list[Solid]:
    """Write down the corners: the lower cap (against ``up``) first, then the upper one.

    Each cap runs i left, i axis, i right, j right, j axis, j left; an end that is one plane has no
    corner on the axis.
    """
    half = spec.width / 2.0 * bars.frames.left
    along = bars.frames.along
    left, right = bars.ends.cut_left, bars.ends.cut_right
    cap = np.stack(
        [
            bars.top[:, 0] + half + left[:, :1] * along,
            bars.top[:, 0],
            bars.top[:, 0] - half + right[:, :1] * along,
            bars.top[:, 1] - half - right[:, 1:] * along,
            bars.top[:, 1],
            bars.top[:, 1] + half - left[:, 1:] * along,
        ],
        axis=1,
    )
    other = cap + bars.fall[:, [0, 0, 0, 1, 1, 1]]
    corners = np.stack([other, cap] if bars.side < 0.0 else [cap, other], axis=1)

    kind = 2 * bars.ends.pointed[:, 0] + bars.ends.pointed[:, 1]
    solids: list[Solid] = [Solid(np.zeros((0, 3)), ())] * len(kind)
    for which in range(4):
        keep = [0, *([1] if which & 2 else []), 2, 3, *([4] if which & 1 else []), 5]
        rows = np.flatnonzero(kind == which)
        vertices = corners[rows][:, :, keep].reshape(len(rows), 2 * len(keep), 3)
        faces = prism_faces(len(keep))
        for row, points in zip(rows.tolist(), vertices, strict=True):
            solids[row] = Solid(points, faces)
    return solids


def _outermost(ends: BarEnds) -> FloatArray:
    """Return the (E, 2) least of the cuts at each end: where the silhouette ends."""
    least = np.minimum(ends.cut_left, ends.cut_right)
    return np.where(ends.pointed, np.minimum(least, 0.0), least)


def _outlines(bars: Bars, spec: BeamSpec) -> FloatArray:
    """Return the (E, 4, 2) silhouettes of the bars on their node planes, counter-clockwise."""
    reach = _outermost(bars.ends)
    run = bars.run
    begin, end = reach[:, 0], bars.length - reach[:, 1]
    x = np.stack([begin + run[:, 0], end + run[:, 1], end, begin], axis=1)
    x = x - x.min(axis=1, keepdims=True)
    y = np.broadcast_to([0.0, 0.0, spec.height, spec.height], x.shape)
    return np.stack([x, y], axis=2)


def spare_lengths(bars: Bars) -> tuple[FloatArray, FloatArray]:
    """Return what the ends of every bar leave of its shortest line, and its length at the top.

    Both are (E,) mm. A bar with nothing left has no solid.
    """
    top = bars.length
    bottom = top + bars.run[:, 1] - bars.run[:, 0]
    cuts = np.stack([bars.ends.cut_left, np.zeros_like(bars.ends.cut_left), bars.ends.cut_right])
    return np.minimum(top, bottom) - cuts.sum(axis=2).max(axis=0), top


def _refuse_crossed(bars: Bars, spec: BeamSpec, names: tuple[str, ...]) -> None:
    """Raise PartError if any of the lines along a bar has no length left."""
    rest, top = spare_lengths(bars)
    bottom = top + bars.run[:, 1] - bars.run[:, 0]
    used = np.minimum(top, bottom) - rest
    worst = int(np.argmin(rest))
    if rest[worst] <= 0.0:
        reason, remedy = (
            (f"{spec.width:g} mm wide bars", "narrower or lower bars")
            if spec.ends == "mitred"
            else (f"hubs of radius {spec.hub_radius:g} mm", "smaller hubs or lower bars")
        )
        raise PartError(
            f"beam {names[worst]} is too short: {top[worst]:.1f} mm between its node axes at the "
            f"top, {bottom[worst]:.1f} mm at the bottom {spec.height:g} mm below, of which its "
            f"ends take {used[worst]:.1f} mm for {reason}; choose {remedy}, or larger panels"
        )


def _neighbours(shell: Shell, names: tuple[str, ...]) -> list[tuple[str, ...]]:
    """Return for every edge the marks of its panels, then of the beams at i and at j."""
    edges = shell.edges
    plates = panel_marks(shell)
    at_node = beams_at_nodes(shell)
    found = []
    for e, (i, j, left, right) in enumerate(edges.tolist()):
        carried = [plates[f] for f in (left, right) if f >= 0]
        others = [names[b] for v in (i, j) for b in at_node[v] if b != e]
        found.append((*carried, *others))
    return found


def beams_at_nodes(shell: Shell) -> list[list[int]]:
    """Return for every vertex of ``shell.mesh`` the rows of ``shell.edges`` that end there."""
    at_node: list[list[int]] = [[] for _ in range(len(shell.mesh.vertices))]
    for e, (i, j) in enumerate(shell.edges[:, :2].tolist()):
        at_node[i].append(e)
        at_node[j].append(e)
    return at_node

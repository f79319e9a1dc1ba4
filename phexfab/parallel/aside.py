"""Stations step aside where the cut would pass close by a vertex and leave a short edge.

A vertex at a small distance g from a rim plane leaves an edge of about that length, whichever side
it is on. Moving the two stations of the plane across the border by a little takes the plane away
from it; a station that stands close to an edge of the mesh moves along the border instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.mesh.measures import corner_angles, signed_areas, simple_faces
from phexfab.parallel.border import place
from phexfab.parallel.fence import Fence, Stations
from phexfab.parallel.shell import Shell
from phexfab.parallel.stations import deviation, moved, without
from phexfab.parallel.walk import Ground, LostWayError

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

INSET = 0.25
"""Of the shortest edge: what panels lose along every edge to gaps, and bars to half their width."""

LOST = 10.0
"""What an edge counts from which no panel or no bar can be made, against 1 for a short one."""


def step_aside(
    ground: Ground,
    fence: Fence,
    margin: float,
    width: float,
    sagitta: float,
    deepest: FloatArray,
    rim: RimEdges | None,
    turn: int,
) -> Stations:
    """Return stations from which the fence keeps away from vertices, as far as possible.

    Parameters
    ----------
    ground : Ground
    fence : Fence
    margin : float, mm
        Wanted distance of vertices.
    width : float, mm
        Wanted distance of those in ``deepest``, unless the plane passes on their other side.
    sagitta : float, mm
        Twice this is what a chord may deviate from the border where a station goes.
    deepest : (n, 3) mm
        Inner corners of small pieces that could not be merged.
    rim : RimEdges, or None
        Of the cut by this fence. None where it could not be made; then stations leave the edges of
        the whole mesh that are close to them.
    turn : int
        Number of the round: vertices in a plane change sides with it.
    """
    stations = fence.stations
    m = len(stations.along)
    if not m:
        return stations
    low = np.full(len(ground.mesh.vertices), -margin)
    if len(deepest):
        away, which = ground.vertices.query(deepest)
        low[which[away < 1e-3 * margin]] = -max(1.05 * width, margin)
    plane, share, high, low = _close_by(ground, fence, margin, low)
    aside = stations.aside.copy()
    freedom = _freedom(fence)
    most = max(margin, 0.6 * width)
    # A few sweeps of projections: each vertex asks to leave its strip by the nearer side.
    for _ in range(8):
        for k, t, g, least in zip(plane, share, high, low, strict=True):
            a, b, n = k, (k + 1) % m, fence.normals[k]
            moves = (1 - t) * (aside[a] - stations.aside[a]) + t * (aside[b] - stations.aside[b])
            now = g - float(moves @ n)
            if not least < now < margin:
                continue
            middle = (least + margin) / 2
            outside = now > middle or (now == middle and turn % 2 == 1)
            step = now - margin if outside else now - least
            ways = (1 - t) * (freedom[a] @ n), t * (freedom[b] @ n)
            square = float(ways[0] @ ways[0] + ways[1] @ ways[1])
            if square < 0.05:
                continue
            for station, way in zip((a, b), ways, strict=True):
                aside[station] = _no_longer(aside[station] + step / square * way, most)
    if rim is None:
        given = np.isfinite(stations.planes[:, 3])
        leave = np.where(given & np.roll(given, 1), 0.0, _away_from_edges(ground, fence, margin))
        return moved(stations, leave, aside)
    along, push, gone = _between_ends(fence, rim, margin, sagitta)
    given = np.isfinite(stations.planes[:, 3])
    folds = given & np.roll(given, 1)
    along[folds], gone[folds] = 0.0, False
    for k in np.flatnonzero(push.any(axis=1)).tolist():
        aside[k] = _no_longer(aside[k] + freedom[k] @ push[k], most)
    return without(moved(stations, along, aside), gone)


def _freedom(fence: Fence) -> FloatArray:
    """Return (m, 3, 3) projectors on the ways in which stations may step.

    Across the border where it is smooth; anywhere in the film at a corner, but within the planes
    that are given.
    """
    stations = fence.stations
    normals = fence.border.at(stations.along)[1]
    before = np.roll(fence.normals, 1, axis=0)
    across = fence.normals + before
    across = across - np.einsum("ij,ij->i", across, normals)[:, None] * normals
    square = np.einsum("ij,ij->i", across, across)[:, None, None]
    smooth = across[:, :, None] * across[:, None, :] / square
    free = np.where(
        stations.fixed[:, None, None], np.eye(3) - normals[:, :, None] * normals[:, None, :], smooth
    )
    given = np.isfinite(stations.planes[:, 3])
    one, two = given & ~np.roll(given, 1), np.roll(given, 1) & ~given
    for mine, plane in ((one, fence.normals), (two, before)):
        within = np.cross(normals[mine], plane[mine])
        within /= np.linalg.norm(within, axis=1, keepdims=True)
        free[mine] = within[:, :, None] * within[:, None, :]
    free[given & np.roll(given, 1)] = 0.0
    return free


def _close_by(
    ground: Ground, fence: Fence, margin: float, low: FloatArray
) -> tuple[IntArray, FloatArray, FloatArray, FloatArray]:
    """Return planes with vertices near: plane, where along the chord (0 to 1), height, lowest."""
    begin = fence.points
    end = np.roll(begin, -1, axis=0)
    length = np.linalg.norm(end - begin, axis=1)
    near = ground.vertices.query_ball_point((begin + end) / 2, length / 2 + 4 * margin)
    plane = np.repeat(np.arange(len(begin)), [len(row) for row in near])
    vertex = np.concatenate([np.asarray(row, np.int64) for row in near])
    points = ground.mesh.vertices[vertex]
    chord = (end - begin)[plane] / length[plane][:, None]
    share = np.einsum("ij,ij->i", points - begin[plane], chord) / length[plane]
    high = np.einsum("ij,ij->i", points, fence.normals[plane]) - fence.heights[plane]
    slack = margin / length[plane]
    keep = (high < margin) & (high > low[vertex]) & (share > -slack) & (share < 1 + slack)
    return plane[keep], np.clip(share[keep], 0.0, 1.0), high[keep], low[vertex[keep]]


def _away_from_edges(ground: Ground, fence: Fence, margin: float) -> FloatArray:
    """Return (m,) mm along the border by which stations leave the edges close to them."""
    mesh = ground.mesh
    m = len(fence.points)
    finder = ground.finder
    panel = finder.find(fence.points, fence.rulings)
    shift = np.zeros(m)
    ahead = np.roll(fence.points, -1, axis=0) - np.roll(fence.points, 1, axis=0)
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    for k in np.flatnonzero(panel >= 0).tolist():
        f = int(panel[k])
        n, ruling, base = ground.normals[f], fence.rulings[k], fence.points[k]
        spot = base + (ground.heights[f] - n @ base) / (n @ ruling) * ruling
        ring = mesh.polygon(f)
        along = np.roll(ring, -1, axis=0) - ring
        size = np.einsum("ij,ij->i", along, along)
        t = np.clip(np.einsum("ij,ij->i", spot - ring, along) / size, 0.0, 1.0)
        off = spot - ring - t[:, None] * along
        gap = np.linalg.norm(off, axis=1)
        j = int(gap.argmin())
        if gap[j] >= margin:
            continue
        inward = np.cross(n, along[j]) / np.sqrt(size[j])
        slope = float(inward @ ahead[k])
        if abs(slope) > 0.2:
            shift[k] = np.clip((margin - gap[j]) / slope, -2 * margin, 2 * margin)
    return shift


def _between_ends(
    fence: Fence, rim: RimEdges, margin: float, sagitta: float
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Say how stations leave the ends of their panels' arcs.

    Returns
    -------
    shift : (m,) mm
        Along the border, towards the middle of the arc.
    push : (m, 3) mm
        Of corners: along the chord whose edge is too short.
    gone : (m,) bool
        Stations to leave out: the arc is too short for two edges, the border nearly straight.
    """
    stations, border = fence.stations, fence.border
    m = len(fence.points)
    shift, push, gone = np.zeros(m), np.zeros((m, 3)), np.zeros(m, bool)
    if not len(rim.stations):
        return shift, push, gone
    chord = np.roll(fence.points, -1, axis=0) - fence.points
    chord /= np.linalg.norm(chord, axis=1, keepdims=True)
    lack = rim.wanted - rim.lengths  # before, after
    which = cKDTree(fence.points).query(rim.stations)[1]
    across = rim.stations - fence.points[which]
    rise = np.einsum("ij,ij->i", across, fence.rulings[which])[:, None]
    near = np.linalg.norm(across - rise * fence.rulings[which], axis=1) < 0.1 * margin
    for k in np.flatnonzero(near & (lack > 0).any(axis=1)).tolist():
        station = int(which[k])
        before, after = lack[k].tolist()
        if stations.fixed[station]:
            push[station] = 1.2 * (
                max(before, 0.0) * chord[station - 1] - max(after, 0.0) * chord[station]
            )
            continue
        if before + after < 0:  # there is room: a little more than what is lacking
            room = -(before + after) / 4
            shift[station] = before + room if before > 0 else -(after + room)
            continue
        a = stations.along[station - 1] - (border.length if station == 0 else 0.0)
        b = stations.along[(station + 1) % m] + (border.length if station == m - 1 else 0.0)
        free = not (gone[station - 1] or gone[(station + 1) % m])
        if free and m - gone.sum() > 3 and deviation(border, a, b, margin * 25) < 2 * sagitta:
            gone[station] = True
        else:
            shift[station] = (before - after) / 2
    return shift, push, gone


def _no_longer(step: FloatArray, most: float) -> FloatArray:
    return step * min(1.0, most / max(float(np.linalg.norm(step)), 1e-300))


@dataclass(frozen=True, eq=False)
class RimEdges:
    """Edges of a cut shell that end on its border.

    Attributes
    ----------
    shortest : float, mm
    spots : (m, 3) mm
        An end on the border of each that is too short.
    lacks : (m,)
        Wanted over actual length of these, and more for each from which no part can be made.
    stations : (n, 3) mm
        Vertices on the border at which two rim planes meet.
    lengths, wanted : (n, 2) mm
        Of the border edges before and after each.
    """

    shortest: float
    spots: FloatArray
    lacks: FloatArray
    stations: FloatArray
    lengths: FloatArray
    wanted: FloatArray

    @property
    def lack(self) -> float:
        """Sum of all lacks."""
        return float(self.lacks.sum())


def rim_edges(shell: Shell, least: float, depth: tuple[float, float]) -> RimEdges:
    """Measure the edges at the border of a cut shell.

    Parameters
    ----------
    shell : Shell
    least : float, mm
    depth : (below, above), mm
        Edges that vanish in an offset between −below and above, what corners take of panels and
        bars subtracted, are too short, too.

    Raises
    ------
    LostWayError
        If a panel is no simple polygon.
    """
    mesh, gauss = shell.mesh, shell.gauss
    bad = ~simple_faces(mesh) | ~(signed_areas(mesh, shell.normals[shell.panels]) > 0)
    if bad.any():
        spot = mesh.polygon(int(bad.argmax())).mean(axis=0)
        raise LostWayError(f"the cut panel at {place(spot)} is no simple polygon")
    tail, head = shell.edges[:, 0], shell.edges[:, 1]
    border = shell.edges[:, 3] < 0
    along = mesh.vertices[head] - mesh.vertices[tail]
    length = np.linalg.norm(along, axis=1)
    image = gauss.vertices[head] - gauss.vertices[tail]
    # An offset by t adds t times its image, which is parallel, to an edge.
    gain = np.einsum("ij,ij->i", along, image) / length
    needed = np.maximum(depth[0] * gain, -depth[1] * gain) + INSET * least * _bevels(shell)
    wanted = np.maximum(least, needed)
    n = len(mesh.vertices)
    at_rim = np.zeros(n, bool)
    at_rim[tail[border]] = True
    mine = at_rim[tail] | at_rim[head]
    short = mine & (length < wanted)
    ends = mesh.vertices[np.where(at_rim[tail], tail, head)[short]]
    before, after = np.zeros(n, np.int64), np.zeros(n, np.int64)
    after[tail[border]] = np.flatnonzero(border)
    before[head[border]] = np.flatnonzero(border)
    planes = (shell.parents < 0)[shell.triangles[shell.used_vertices]].sum(axis=1)
    station = np.flatnonzero(planes == 2)
    pairs = np.column_stack([before[station], after[station]])
    return RimEdges(
        float(length[mine].min()),
        ends,
        wanted[short] / length[short] + LOST * (length < needed)[short],
        mesh.vertices[station],
        length[pairs],
        wanted[pairs],
    )


def _bevels(shell: Shell) -> FloatArray:
    """Return (E,) by how much edges get shorter, over the width by which a panel is inset.

    cot α/2 + cot β/2 with the panel's angles at the two ends; the larger of both sides.
    """
    mesh, edges = shell.mesh, shell.edges
    n = len(mesh.vertices)
    half = np.radians(corner_angles(mesh, shell.normals[shell.panels])) / 2
    slope = 1.0 / np.tan(np.clip(half, 1e-6, np.pi - 1e-6))
    loss = slope + slope[mesh.next_corner]
    key = mesh.corners * n + mesh.corners[mesh.next_corner]
    order = np.argsort(key)
    found = np.zeros(len(edges))
    for tail, head in ((0, 1), (1, 0)):
        wanted = edges[:, tail] * n + edges[:, head]
        slot = np.minimum(np.searchsorted(key[order], wanted), len(key) - 1)
        row = order[slot]
        found = np.maximum(found, np.where(key[row] == wanted, loss[row], 0.0))
    return found

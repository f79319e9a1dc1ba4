"""A mesh of panels as a shell of the face type: planar faces, three at every vertex inside.

The outermost faces stay panels where border planes can be found: a *run* of border edges, between
border vertices that have a single face, needs one plane. Runs of one or two edges have it; longer
ones join the planarising as if they were faces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import MeshError, SolveError
from phexfab.mesh.half_edges import border_loops
from phexfab.mesh.measures import face_centroids, face_normals, mean_edge, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.shell import Shell
from phexfab.parallel.simple import Border, border_of, border_runs, shell_of_mesh
from phexfab.remesh.planarity.nearest import Reference
from phexfab.remesh.planarity.planarise import CLOSENESS, Planarised, planarise

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

STRAIGHT = 1e-3
"""Width of a run over its length below which it counts as straight, with an upright plane."""
FAR = 0.5
"""Most by which a run's vertices may move into one plane, in mean edges."""
HELD = 1e-6
"""Most by which a fixed vertex, where planes meet, may be off its place, in mean edges."""
FLAT = 1e-9
"""Volume of three unit normals below which their planes have no single point in common."""


@dataclass(frozen=True, eq=False)
class PanelShell:
    """A shell, and how its mesh was made planar.

    Attributes
    ----------
    shell : Shell
        Of the face type.
    planarised : Planarised
        With all faces, and behind them those that stand for runs of the border.
    vertices : (V,) int
        Which vertex of the given mesh each vertex of ``shell.mesh`` was.
    moved : (V,) float
        How far each vertex of ``shell.mesh`` is from where it was, mm.
    """

    shell: Shell
    planarised: Planarised
    vertices: IntArray
    moved: FloatArray


def require_trivalent(mesh: PolyMesh, name: str) -> Border:
    """Refuse a mesh in which other than three edges meet at a vertex inside, two or three outside.

    Raises
    ------
    MeshError
        The message names the first vertices, their places, how many there are, and the remedy.
    """
    border = border_of(mesh)
    if border is None:
        raise MeshError(
            f"{name}: pieces of the mesh touch in single vertices, or its faces are not oriented "
            "alike; give each piece its own vertices"
        )
    outside = np.zeros(len(mesh.vertices), bool)
    outside[mesh.corners[border.corner]] = True
    used = border.valence > 0
    for wrong, where, allowed in (
        (used & ~outside & (border.valence != 3), "inside", "three"),
        (outside & (border.valence > 2), "on the border", "one or two"),
    ):
        bad = np.flatnonzero(wrong)
        if len(bad):
            first = ", ".join(
                f"{v} at {mesh.vertices[v].round(1).tolist()} with {border.valence[v]}"
                for v in bad[:3].tolist()
            )
            raise MeshError(
                f"{name}: {len(bad)} vertices {where} do not have {allowed} faces: {first}"
                f"{', …' if len(bad) > 3 else ''}; three panels meet at every node of such a "
                "shell: split these vertices into two with an edge between, shift every second "
                "row of a quad mesh by half a face, or give the dual of a triangle mesh"
            )
    return border


def panel_shell(
    mesh: PolyMesh,
    *,
    border: str = "keep",
    fixed: ArrayLike = (),
    reference: Reference | None = None,
    closeness: float = CLOSENESS,
    name: str = "the mesh",
) -> PanelShell:
    """Return a polygon mesh, made planar, as a shell of the face type.

    Parameters
    ----------
    mesh : PolyMesh
        Three faces at every vertex inside; mm.
    border : ``"keep"`` or ``"drop"``
        Keep the outermost faces as panels, with border planes through their border edges; or
        drop them, so that they are the border planes of those within.
    fixed : (k,) int
        Vertices that keep their place to rounding.
    reference, closeness
        A surface to stay close to, and how close; see ``planarise``.
    name : str
        What messages call it.

    Raises
    ------
    MeshError
        If other than three faces meet at a vertex, the border allows no planes, neighbouring
        faces lie in one plane, or no panel remains; if fixed vertices leave a face or a stretch of
        the border no plane, or no panel that remains has them.
    SolveError
        If planar faces are not reached, faces cross themselves once planar, or a fixed vertex is
        not where its planes meet.

    References
    ----------
    Thesis §4.1, §4.2.
    """
    if border not in ("keep", "drop"):
        raise MeshError(f'border = "{border}"; use "keep" or "drop"')
    edge = require_trivalent(mesh, name)
    straight, runs = _long_runs(mesh, edge, name) if border == "keep" else ([], [])
    held = np.unique(np.asarray(fixed, np.int64))
    _refuse_fixed(mesh, straight, runs, held, name)
    joined = _with_faces(mesh, runs)
    made = planarise(
        joined,
        fixed=held,
        # Where the outermost faces are left out, their rims need not stay where they are.
        keep_border=border == "keep" and not runs,
        reference=reference,
        closeness=closeness,
        strict=False,
    )
    crossing = np.array(made.report.crossing, np.int64)
    crossing = crossing[crossing < mesh.n_faces]
    if not made.report.converged or len(crossing):
        _refuse(mesh, made, crossing, name, len(held))
    planar = _slid(PolyMesh(made.mesh.vertices, mesh.corners, mesh.starts), edge, straight)
    if runs or straight:
        ends = np.unique(np.concatenate(runs + straight))
        far = np.linalg.norm(planar.vertices - mesh.vertices, axis=1)[ends] / mean_edge(mesh)
        if far.max() > FAR:
            v = int(ends[far.argmax()])
            raise MeshError(
                f"{name}: the border is too far off a plane at {(far > FAR).sum()} vertices, worst "
                f"near vertex {v} at {mesh.vertices[v].round(1).tolist()} by {far.max():.2f} of an "
                'edge; no single plane trims the panels there: take border = "drop"'
            )
    _refuse_flat(planar, edge, border, name)
    if border == "drop":
        shell = shell_of_mesh(planar, border="panels")
        if not len(shell.panels):
            raise MeshError(
                f"{name}: no face has neighbours all around, so none remains; take a larger mesh "
                'or border = "keep"'
            )
    else:
        shell = _upright(planar, shell_of_mesh(planar))
        if not simple_faces(shell.mesh).all():
            bad = int(np.argmin(simple_faces(shell.mesh)))
            raise SolveError(
                f"{name}: face {bad} at {shell.points[bad].round(1).tolist()} crosses itself once "
                'its border is cut by planes; take border = "drop"'
            )
    at = shell.used_vertices
    if border == "drop":  # the dual triangles of shell_of_mesh are the inner vertices, in order
        at = np.flatnonzero(edge.valence == 3)[at]
    lost = np.setdiff1d(held, at)
    if len(lost):
        raise MeshError(
            f"{name}: {len(lost)} of {len(held)} fixed vertices (mesh.fixed) are on the outermost "
            f"faces, first vertex {lost[0]} at {mesh.vertices[lost[0]].round(1).tolist()}, which "
            'border = "drop" leaves out; fix others, or take border = "keep"'
        )
    moved = np.linalg.norm(shell.mesh.vertices - mesh.vertices[at], axis=1)
    left = np.where(np.isin(at, held), moved, 0.0)
    if left.max(initial=0.0) > HELD * mean_edge(mesh):
        v = int(at[left.argmax()])
        raise SolveError(
            f"{name}: fixed vertex {v} (mesh.fixed) at {mesh.vertices[v].round(1).tolist()} is "
            f"{left.max():.3g} mm off its place once the border is cut by planes; fix vertices "
            "farther from straight stretches of the border"
        )
    return PanelShell(shell, made, at, moved)


def _long_runs(mesh: PolyMesh, edge: Border, name: str) -> tuple[list[IntArray], list[IntArray]]:
    """Return the vertices of straight runs, and of others that have three edges or more."""
    found = border_runs(mesh, edge)
    if found is None:
        whole = [loop for loop in border_loops(mesh) if (edge.valence[loop] == 2).all()]
        middle = mesh.vertices[whole[0]].mean(axis=0).round(1).tolist()
        raise MeshError(
            f"{name}: at every vertex of {len(whole)} borders two faces meet, first the border of "
            f"{len(whole[0])} edges around {middle} with vertex {whole[0][0]}; no plane trims "
            'panels there: close the hole with a face, or take border = "drop"'
        )
    if not len(edge.corner):
        return [], []
    run, place = found
    tail = mesh.corners[edge.corner]
    head = mesh.corners[mesh.next_corner[edge.corner]]
    order = np.lexsort((place, run))
    starts = np.flatnonzero(place[order] == 0)
    straight, bent = [], []
    for piece in np.split(order, starts[1:]):
        vertices = np.append(tail[piece], head[piece[-1]])
        if len(piece) < 2 or vertices[0] == vertices[-1]:
            continue
        gap = mesh.vertices[vertices] - mesh.vertices[vertices].mean(axis=0)
        size = np.linalg.svd(gap, compute_uv=False)
        if size[1] <= STRAIGHT * size[0]:
            straight.append(vertices)
        elif len(piece) > 2:
            bent.append(vertices)
    return straight, bent


def _refuse_fixed(
    mesh: PolyMesh, straight: list[IntArray], bent: list[IntArray], fixed: IntArray, name: str
) -> None:
    """Refuse fixed vertices within straight runs, and those of others that have no plane.

    Two panels that both have a part of one line in their planes can only meet along that line: on
    a straight stretch of the border, nodes between panels leave the line by a little.
    """
    on = np.zeros(len(mesh.vertices), bool)
    on[fixed] = True
    within = [run[1:-1][on[run[1:-1]]] for run in straight]
    if any(map(len, within)):
        v = int(np.concatenate(within)[0])
        raise MeshError(
            f"{name}: {sum(map(len, within))} fixed vertices (mesh.fixed) lie within straight "
            f"stretches of the border, first vertex {v} at {mesh.vertices[v].round(1).tolist()}; "
            "panels bent against each other leave that line where they meet: fix its ends instead"
        )
    exact = 1e-12 * mean_edge(mesh) + 8e-16 * float(np.abs(mesh.vertices).max())
    for run in bent:
        mine = run[on[run]]
        if len(mine) > 3:
            gap = mesh.vertices[mine] - mesh.vertices[mine].mean(axis=0)
            off = np.abs(gap @ np.linalg.svd(gap)[2][2])
            if off.max() > exact:
                v = int(mine[off.argmax()])
                raise MeshError(
                    f"{name}: {len(mine)} fixed vertices (mesh.fixed) of a stretch of the border "
                    f"that needs one plane are {off.max():.3g} mm off it, worst vertex {v} at "
                    f"{mesh.vertices[v].round(1).tolist()}; fix three of them, or give a mesh "
                    "whose border is plane there"
                )


def _slid(mesh: PolyMesh, edge: Border, runs: list[IntArray]) -> PolyMesh:
    """Return a planar mesh with the vertices of each straight run in the upright plane of its ends.

    They slide along the edge between their two panels, so that faces stay planar.
    """
    points = mesh.vertices.copy()
    normals = face_normals(mesh)
    corner = np.full(len(points), -1)
    corner[mesh.corners[edge.corner]] = edge.corner
    for run in runs:
        middle = run[1:-1]
        panels = mesh.face_of_corner[corner[run[:-1]]]
        across = np.cross(points[run[-1]] - points[run[0]], normals[panels].mean(axis=0))
        # At a border vertex of two faces the corner before it is the other end of their edge.
        along = points[middle] - points[mesh.corners[mesh.previous_corner[corner[middle]]]]
        off = (points[middle] - points[run[0]]) @ across
        points[middle] -= (off / (along @ across))[:, None] * along
    return PolyMesh(points, mesh.corners, mesh.starts)


def _with_faces(mesh: PolyMesh, runs: list[IntArray]) -> PolyMesh:
    """Return the mesh with a face beyond each run."""
    if not runs:
        return mesh
    corners = np.concatenate([mesh.corners, *(run[::-1] for run in runs)])
    ends = mesh.starts[-1] + np.cumsum([len(run) for run in runs])
    return PolyMesh(mesh.vertices, corners, np.concatenate([mesh.starts, ends]))


def _refuse(mesh: PolyMesh, made: Planarised, crossing: IntArray, name: str, held: int) -> None:
    if len(crossing):
        face, what = int(crossing[0]), f"{len(crossing)} faces cross themselves once planar, first"
    else:
        face, what = made.report.worst_face, "faces do not become planar, worst"
    place = made.mesh.polygon(face).mean(axis=0).round(1).tolist()
    kind = "face" if face < mesh.n_faces else "border run behind face"
    raise SolveError(
        f"{name}: {what} {kind} {min(face, mesh.n_faces - 1)} at {place} "
        f"({made.planarity[face]:.1e} of an edge off its plane); "
        f"{'fix fewer vertices (mesh.fixed), ' if held else ''}begin with a mesh more nearly "
        'planar there, or leave the outermost faces out with border = "drop"'
    )


def _refuse_flat(mesh: PolyMesh, edge: Border, border: str, name: str) -> None:
    """Refuse nodes whose three planes, or two where a border plane is the third, are one."""
    order = np.argsort(mesh.corners, kind="stable")
    normals = face_normals(mesh)[mesh.face_of_corner[order]]
    first = np.concatenate([[0], np.cumsum(edge.valence)[:-1]])
    inside = np.ones(len(mesh.vertices), bool)
    inside[mesh.corners[edge.corner]] = False
    three, two = np.flatnonzero(inside & (edge.valence == 3)), np.zeros(0, np.int64)
    if border == "keep":
        two = np.flatnonzero(~inside & (edge.valence == 2))
    a, b, c = (normals[first[three] + k] for k in range(3))
    volume = np.abs(np.einsum("vi,vi->v", a, np.cross(b, c)))
    sine = np.linalg.norm(np.cross(normals[first[two]], normals[first[two] + 1]), axis=1)
    bad = np.concatenate([three[~(volume > FLAT)], two[~(sine > FLAT)]])
    if len(bad):
        v = int(bad[0])
        faces = np.sort(mesh.face_of_corner[order[first[v] : first[v] + edge.valence[v]]]).tolist()
        raise MeshError(
            f"{name}: at {len(bad)} vertices the planes of neighbouring faces do not meet in a "
            f"point of their own, first vertex {v} at {mesh.vertices[v].round(1).tolist()} with "
            f"faces {faces}: where the mesh is flat or bent one way only, no three planes fix a "
            "node; join such faces into one, or give the mesh curvature there"
        )
    if border == "keep":
        _refuse_straight(mesh, edge, name)


def _refuse_straight(mesh: PolyMesh, edge: Border, name: str) -> None:
    """Refuse border vertices of one face at which it goes straight on: both planes are one."""
    tail, head = mesh.corners[edge.corner], mesh.corners[mesh.next_corner[edge.corner]]
    along = mesh.vertices[head] - mesh.vertices[tail]
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    sine = np.linalg.norm(np.cross(along[edge.before], along), axis=1)
    bad = np.flatnonzero((edge.valence[tail] == 1) & ~(sine > FLAT))
    if len(bad):
        v, face = int(tail[bad[0]]), int(mesh.face_of_corner[edge.corner[bad[0]]])
        raise MeshError(
            f"{name}: the border runs straight on at {len(bad)} vertices of one face, first vertex "
            f"{v} at {mesh.vertices[v].round(1).tolist()} of face {face}; leave these vertices out "
            'of their faces, or take border = "drop"'
        )


def _upright(mesh: PolyMesh, shell: Shell) -> Shell:
    """Return the shell with border planes whose Gauss image keeps node axes along the normals.

    The height of a border plane in S is free for the face type. It is chosen so that the axes at
    its nodes are the normal of their panel, or between those of their two, on average: an upright
    border plane then stays where it is under offsets, a flat one moves like a panel.
    """
    edge = border_of(mesh)
    found = None if edge is None else border_runs(mesh, edge)
    if edge is None or found is None or not len(edge.corner):
        return shell
    run, _ = found
    n_f, count = mesh.n_faces, np.bincount(run)
    normals = face_normals(mesh)
    tail = mesh.corners[edge.corner]
    head = mesh.corners[mesh.next_corner[edge.corner]]
    own = normals[mesh.face_of_corner[edge.corner]]
    total = np.zeros((len(mesh.vertices), 3))
    for at in (tail, head):
        np.add.at(total, at, own)  # twice the same, or one of each of the two faces
    axes = 2 * total / np.einsum("ij,ij->i", total, total).clip(1e-300)[:, None]
    # n·x = 1 for both normals a, b: x = (a + b)/(1 + a·b) = 2 (a + b)/|a + b|².
    planes = shell.normals[n_f:]
    heights = shell.gauss_heights.copy()
    lean = np.einsum("ij,ij->i", planes[run], (axes[tail] + axes[head]) / 2)
    heights[n_f:] = np.bincount(run, lean) / count
    # As far beyond the border as the panel's middle is within.
    middle = (mesh.vertices[tail] + mesh.vertices[head]) / 2
    beyond = 2 * middle - face_centroids(mesh)[mesh.face_of_corner[edge.corner]]
    points = shell.points.copy()
    points[n_f:] = np.column_stack([np.bincount(run, beyond[:, k]) / count for k in range(3)])
    return replace(shell, gauss_heights=heights, points=points)

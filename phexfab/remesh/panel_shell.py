"""A mesh of panels as a shell of the face type: planar faces, three at every vertex inside.

The outermost faces stay panels where border planes can be found: a *run* of border edges, between
border vertices that have a single face, needs one plane. Runs of one or two edges have it; longer
ones join the planarising as if they were faces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import MeshError, SolveError
from phexfab.mesh.measures import face_centroids, face_normals, mean_edge, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.shell import Shell
from phexfab.parallel.simple import Border, border_of, border_runs, shell_of_mesh
from phexfab.remesh.planarity.planarise import Planarised, planarise

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

STRAIGHT = 1e-3
"""Width of a run over its length below which it counts as straight, with an upright plane."""
FAR = 0.5
"""Most by which a run's vertices may move into one plane, in mean edges."""


@dataclass(frozen=True, eq=False)
class PanelShell:
    """A shell, and how its mesh was made planar.

    Attributes
    ----------
    shell : Shell
        Of the face type.
    planarised : Planarised
        With all faces, and behind them those that stand for runs of the border.
    moved : (V,) float
        How far each vertex of ``shell.mesh`` is from where it was, mm.
    """

    shell: Shell
    planarised: Planarised
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


def panel_shell(mesh: PolyMesh, *, border: str = "keep", name: str = "the mesh") -> PanelShell:
    """Return a polygon mesh, made planar, as a shell of the face type.

    Parameters
    ----------
    mesh : PolyMesh
        Three faces at every vertex inside; mm.
    border : ``"keep"`` or ``"drop"``
        Keep the outermost faces as panels, with border planes through their border edges; or
        drop them, so that they are the border planes of those within.
    name : str
        What messages call it.

    Raises
    ------
    MeshError
        If other than three faces meet at a vertex, the border allows no planes, or no panel
        remains.
    SolveError
        If planar faces are not reached, or faces cross themselves once planar.

    References
    ----------
    Thesis §4.1, §4.2.
    """
    if border not in ("keep", "drop"):
        raise MeshError(f'border = "{border}"; use "keep" or "drop"')
    edge = require_trivalent(mesh, name)
    straight, runs = _long_runs(mesh, edge, name) if border == "keep" else ([], [])
    joined = _with_faces(_straightened(mesh, straight), runs)
    made = planarise(joined, keep_border=not runs, strict=False)
    crossing = np.array(made.report.crossing, np.int64)
    crossing = crossing[crossing < mesh.n_faces]
    if not made.report.converged or len(crossing):
        _refuse(mesh, made, crossing, name)
    planar = _straightened(PolyMesh(made.mesh.vertices, mesh.corners, mesh.starts), straight)
    if runs:
        ends = np.unique(np.concatenate(runs))
        far = made.moved[ends] / mean_edge(mesh)
        if far.max() > FAR:
            v = int(ends[far.argmax()])
            raise MeshError(
                f"{name}: near border vertex {v} at {mesh.vertices[v].round(1).tolist()} the "
                f"border leaves its plane by {far.max():.2f} of an edge; no single plane trims "
                'the panels there: take border = "drop"'
            )
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
    moved = np.linalg.norm(shell.mesh.vertices - mesh.vertices[at], axis=1)
    return PanelShell(shell, made, moved)


def _long_runs(mesh: PolyMesh, edge: Border, name: str) -> tuple[list[IntArray], list[IntArray]]:
    """Return the vertices of straight runs, and of others that have three edges or more."""
    found = border_runs(mesh, edge)
    if found is None:
        raise MeshError(
            f"{name}: two faces meet at every vertex of a border, so no plane trims a panel "
            'there; take border = "drop"'
        )
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


def _straightened(mesh: PolyMesh, runs: list[IntArray]) -> PolyMesh:
    """Return the mesh with the vertices of each run on the line through its ends."""
    if not runs:
        return mesh
    points = mesh.vertices.copy()
    for run in runs:
        along = points[run[-1]] - points[run[0]]
        share = (points[run] - points[run[0]]) @ along / (along @ along)
        points[run[1:-1]] = points[run[0]] + share[1:-1, None] * along
    return PolyMesh(points, mesh.corners, mesh.starts)


def _with_faces(mesh: PolyMesh, runs: list[IntArray]) -> PolyMesh:
    """Return the mesh with a face beyond each run."""
    if not runs:
        return mesh
    corners = np.concatenate([mesh.corners, *(run[::-1] for run in runs)])
    ends = mesh.starts[-1] + np.cumsum([len(run) for run in runs])
    return PolyMesh(mesh.vertices, corners, np.concatenate([mesh.starts, ends]))


def _refuse(mesh: PolyMesh, made: Planarised, crossing: IntArray, name: str) -> None:
    if len(crossing):
        face, what = int(crossing[0]), f"{len(crossing)} faces cross themselves once planar, first"
    else:
        face, what = made.report.worst_face, "faces do not become planar, worst"
    place = made.mesh.polygon(face).mean(axis=0).round(1).tolist()
    kind = "face" if face < mesh.n_faces else "border run behind face"
    raise SolveError(
        f"{name}: {what} {kind} {min(face, mesh.n_faces - 1)} at {place} "
        f"({made.planarity[face]:.1e} of an edge off its plane); begin with a mesh more nearly "
        'planar there, or leave the outermost faces out with border = "drop"'
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

"""Checks of the shell itself: what the theory promises, measured from vertices.

Nothing is taken from a solver: planes, edges and areas are measured again from the corner points of
M and S.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import MeshError
from phexfab.fabrication.limits import Limits, Origin, verdict
from phexfab.fabrication.marks import beam_marks, node_marks, panel_marks
from phexfab.fabrication.parts import CheckResult
from phexfab.mesh.measures import (
    corner_angles,
    mean_edge,
    planarity,
    signed_areas,
    simple_faces,
)
from phexfab.parallel.curvature import minimality
from phexfab.parallel.offset import edge_ratios, node_axes, offset_defect
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]


# A collapsed edge or face gives values that are not numbers, and those fail their check.
@np.errstate(divide="ignore", invalid="ignore")
def check_geometry(
    shell: Shell,
    limits: Limits | None = None,
    *,
    surface_distance: FloatArray | None = None,
    offset_distance: float | None = None,
    rim_distance: float | None = None,
    minimal: bool = True,
    origin: Origin = "lattice",
) -> list[CheckResult]:
    """Return the checks of a shell, each with its worst face, edge or vertex.

    Parameters
    ----------
    shell : Shell
    limits : Limits, optional
    surface_distance : (V,) array, mm, optional
        Distance of every vertex of ``shell.mesh`` from the smooth surface.
    offset_distance : float, mm, optional
        The signed offset d that is built; checks M + d·S and the interval that d must lie in.
    rim_distance : float, mm, optional
        Largest distance between a given rim and the border.
    minimal : bool
        Whether the shell is to be minimal; False leaves that check out.
    origin : ``"lattice"``, ``"given"`` or ``"covered"``
        What the panels come from: a lattice on a minimal surface, a mesh that was given, or a
        method that covers a free-form surface. Remedies are for that.

    Raises
    ------
    MeshError
        If the shell has no panel, or ``surface_distance`` is not one number per vertex.

    References
    ----------
    Thesis §4.2 (offsets), §6.1 (node axes), §7.1 (curvature).

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> for result in px.check_geometry(shell, px.Limits(shortest_edge=40)):
    ...     print(result.name, "ok" if result.ok else f"FAILED at {result.worst}")
    planarity ok
    planarity_mm ok
    parallelism ok
    minimality ok
    offset_constancy ok
    node_axis_torsion ok
    simple_faces ok
    shortest_edge ok
    beam_angle ok
    """
    limits = limits or Limits()
    judge = partial(verdict, origin=origin)
    mesh = shell.mesh
    if not mesh.n_faces:
        raise MeshError("the shell has no panel; choose smaller panels or a larger rectangle")
    faces, beams, nodes = panel_marks(shell), beam_marks(shell), node_marks(shell)
    # Cut panels keep the distance of their planes; along the rim nothing else is promised.
    keeps = {
        "face": np.ones(mesh.n_faces, bool),
        "edge": ~shell.rim_edges,
        "vertex": ~shell.rim_vertices,
    }[shell.kind]
    by_kind = {"face": faces, "edge": beams, "vertex": nodes}[shell.kind]
    by_kind = _those(by_kind, keeps)
    bad, off_plane = bad_faces(shell), planarity(mesh)
    lengths, ends = edge_lengths(shell), shell.edges[:, :2]
    torsion = node_axis_torsion(shell)
    curved = [judge("minimality", limits, minimality(shell), faces)] if minimal else []
    results = [
        judge("planarity", limits, off_plane / mean_edge(mesh), faces),
        judge("planarity_mm", limits, off_plane, faces),
        judge("parallelism", limits, parallelism(shell), beams),
        *curved,
        judge("offset_constancy", limits, offset_defect(shell)[keeps], by_kind),
        judge(
            "node_axis_torsion",
            limits,
            torsion.ravel(),
            [nodes[v] for v in ends.ravel().tolist()],
            f"at beam {beams[int(np.argmax(torsion.max(axis=1)))]}",
        ),
        judge(
            "simple_faces",
            limits,
            np.array([float(bad.sum())]),
            [faces[int(bad.argmax())] if bad.any() else ""],
        ),
        judge("shortest_edge", limits, lengths, beams),
    ]
    angles, at_rim = beam_angles(shell), shell.rim_vertices
    for name, kept in (("beam_angle", ~at_rim), ("rim_beam_angle", at_rim)):
        if kept.any():
            results.append(judge(name, limits, angles[kept], _those(nodes, kept)))
    if offset_distance:
        spread = offset_spread(shell, offset_distance)[keeps]
        results.append(judge("offset_spread", limits, spread, by_kind))
        share = offset_shares(shell, offset_distance)
        results.append(judge("offset_interval", limits, share, beams))
    if surface_distance is not None:
        distance = np.asarray(surface_distance, float).ravel()
        if len(distance) != len(nodes):
            raise MeshError(
                f"surface_distance has {len(distance)} values, the shell {len(nodes)} vertices"
            )
        results.append(judge("surface_distance", limits, np.abs(distance), nodes))
    if rim_distance is not None:
        results.append(judge("rim_distance", limits, np.array([rim_distance]), [""]))
    return results


def measure(shell: Shell) -> dict[str, FloatArray]:
    """Return what a shell's histograms show, by name.

    ``edge_length`` (E,) mm, ``panel_area`` (P,) mm², ``planarity`` (P,) mm, ``minimality`` (P,),
    ``corner_angle`` (C,) and ``beam_angle`` (V,) in degrees, and ``dihedral_angle``, of every inner
    edge, the degrees between the normals of its panels.
    """
    mesh, normals = shell.mesh, shell.normals[shell.panels]
    return {
        "edge_length": edge_lengths(shell),
        "panel_area": signed_areas(mesh, normals),
        "planarity": planarity(mesh),
        "minimality": minimality(shell),
        "corner_angle": corner_angles(mesh, normals),
        "beam_angle": beam_angles(shell),
        "dihedral_angle": dihedral_angles(shell),
    }


def edge_lengths(shell: Shell) -> FloatArray:
    """Return the (E,) lengths of ``shell.edges``, mm."""
    return np.asarray(np.linalg.norm(_along(shell, shell.mesh.vertices), axis=1))


def parallelism(shell: Shell) -> FloatArray:
    """Return the (E,) sines of the angles between M's edges and S's."""
    m, s = _along(shell, shell.mesh.vertices), _along(shell, shell.gauss.vertices)
    across = np.linalg.norm(np.cross(m, s), axis=1) / np.linalg.norm(m, axis=1)
    # An edge of S without length has no direction: what counts is how far it is off.
    return across / np.maximum(np.linalg.norm(s, axis=1), 1e-4)


def bad_faces(shell: Shell) -> BoolArray:
    """Return (P,) True where a face of M is not a simple polygon, or runs clockwise."""
    areas = signed_areas(shell.mesh, shell.normals[shell.panels])
    return ~simple_faces(shell.mesh) | ~(areas > 0)


def node_axis_torsion(shell: Shell) -> FloatArray:
    """Return (E, 2) degrees between the node axes at both ends of an edge and the beam's mid-plane.

    The mid-plane contains the edge and the mean of both axes. In a mesh with a parallel Gauss
    image it contains both of them, so the angles vanish.
    """
    axes = node_axes(shell)[shell.edges[:, :2]]
    normal = np.cross(_along(shell, shell.mesh.vertices), axes.sum(axis=1))
    normal = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    sine = np.abs(np.einsum("ei,evi->ev", normal, axes))
    return np.degrees(np.arcsin(np.minimum(sine, 1.0)))


def beam_angles(shell: Shell) -> FloatArray:
    """Return, for each of V nodes, the smallest angle in degrees between two of its beams.

    Seen along the node axis; 360 where a node has a single beam.
    """
    ends, axes = shell.edges[:, :2], node_axes(shell)
    vertex = np.concatenate([ends[:, 0], ends[:, 1]])
    along = _along(shell, shell.mesh.vertices)
    along = np.concatenate([along, -along])
    x = np.cross(axes, np.eye(3)[np.abs(axes).argmin(axis=1)])
    y = np.cross(axes, x)  # as long as x
    angle = np.degrees(
        np.arctan2(np.einsum("ij,ij->i", along, y[vertex]), np.einsum("ij,ij->i", along, x[vertex]))
    )
    order = np.lexsort((angle, vertex))
    vertex, angle = vertex[order], angle[order]
    count = np.bincount(vertex, minlength=len(axes))
    first = np.concatenate([[0], np.cumsum(count)])[:-1]
    onward = np.arange(1, len(angle) + 1)
    last = (first + count)[count > 0] - 1
    onward[last] = first[count > 0]
    turn = angle[onward] - angle
    turn[last] += 360.0
    least = np.full(len(axes), 360.0)
    np.minimum.at(least, vertex, turn)
    return least


def dihedral_angles(shell: Shell) -> FloatArray:
    """Return the degrees between the normals of the two panels of every inner edge, in order."""
    normals = shell.normals[shell.panels]
    inner = shell.edges[shell.edges[:, 3] >= 0]
    a, b = normals[inner[:, 2]], normals[inner[:, 3]]
    sine = np.linalg.norm(np.cross(a, b), axis=1)
    return np.degrees(np.arctan2(sine, np.einsum("ij,ij->i", a, b)))


def offset_spread(shell: Shell, distance: float) -> FloatArray:
    """Return by how much M and M + d·S miss the distance d, over d: per face, edge or vertex.

    Face type: distance of the offset's corners from the face's plane, the worst corner of every
    face. Edge type: distance of parallel edge lines. Vertex type: distance of vertices.
    """
    mesh = shell.mesh
    moved = shell.with_heights(shell.heights + distance * shell.gauss_heights).mesh.vertices
    step = moved - mesh.vertices
    if shell.kind == "face":
        normals = shell.normals[shell.panels][mesh.face_of_corner]
        rise = np.einsum("ij,ij->i", step[mesh.corners], normals)
        miss = np.abs(rise / distance - 1.0)
        return np.maximum.reduceat(miss, mesh.starts[:-1])
    if shell.kind == "edge":
        along = _along(shell, mesh.vertices)
        along = along / np.linalg.norm(along, axis=1, keepdims=True)
        step = step[shell.edges[:, 0]]
        step = step - np.einsum("ij,ij->i", step, along)[:, None] * along
    return np.abs(np.linalg.norm(step, axis=1) / abs(distance) - 1.0)


def offset_shares(shell: Shell, distance: float) -> FloatArray:
    """Return (E,) the offset as a share of the one at which each edge vanishes; below 1 is safe.

    The edge of M + d·S is ``c + d`` times that of S, so it vanishes at ``d = −c``; edges that only
    grow have 0.
    """
    ratios = edge_ratios(shell)
    with np.errstate(divide="ignore"):
        share = -distance / ratios
    # A vanished edge of M is at its limit already.
    return np.where(ratios == 0, math.inf, np.maximum(share, 0.0))


def _those(marks: Sequence[str], kept: BoolArray) -> tuple[str, ...]:
    return tuple(mark for mark, keep in zip(marks, kept.tolist(), strict=True) if keep)


def _along(shell: Shell, vertices: FloatArray) -> FloatArray:
    return np.asarray(vertices[shell.edges[:, 1]] - vertices[shell.edges[:, 0]])

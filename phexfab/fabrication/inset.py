"""Insetting non-convex polygons edge by edge, many at a time, and how far it can go.

Every edge line moves inward by its own distance; new corners are where neighbouring lines meet
again. Corners move on straight lines, so the first failure has a closed form: an edge shrinks to
nothing, or a corner runs into another edge (the waist of an hourglass panel).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.mesh.polymesh import PolyMesh

FloatArray = NDArray[np.float64]


def edge_directions(points: FloatArray, mesh: PolyMesh) -> FloatArray:
    """Return the (C, 2) unit direction of the edge from every corner to the next."""
    edge = points[mesh.next_corner] - points
    unit: FloatArray = edge / np.linalg.norm(edge, axis=1, keepdims=True)
    return unit


def corner_shifts(directions: FloatArray, distances: FloatArray, mesh: PolyMesh) -> FloatArray:
    """Return how corners move when every edge line moves to its left by its own distance.

    Parameters
    ----------
    directions : (C, 2) unit vectors
        Of the edge from each corner to the next, polygons counter-clockwise.
    distances : (C,)
        To the left (inward) where positive.
    mesh : PolyMesh
        Says which corners belong together; its vertices are not used.

    Returns
    -------
    (C, 2) array, the shift a with ``left₋₁·a = d₋₁`` and ``left·a = d``.
    """
    before = directions[mesh.previous_corner]
    d0, d1 = distances[mesh.previous_corner], distances
    turn = before[:, 0] * directions[:, 1] - before[:, 1] * directions[:, 0]
    straight = turn == 0.0
    shift = d0[:, None] * directions - d1[:, None] * before
    shift = shift / np.where(straight, 1.0, turn)[:, None]
    # Two edges in one line have no single meeting point: go straight inward.
    return np.where(straight[:, None], d1[:, None] * left_of(directions), shift)


def left_of(directions: FloatArray) -> FloatArray:
    """Return the directions turned by +90°."""
    return np.column_stack([-directions[:, 1], directions[:, 0]])


def inset(points: FloatArray, distances: FloatArray, mesh: PolyMesh) -> FloatArray:
    """Return the (C, 2) corners of the polygons with every edge moved inward by its distance.

    No check is made here; see ``inset_limits``.
    """
    return points + corner_shifts(edge_directions(points, mesh), distances, mesh)


def inset_limits(
    points: FloatArray, directions: FloatArray, speeds: FloatArray, mesh: PolyMesh
) -> FloatArray:
    """Return, for every polygon, how far it can be inset before an edge or its waist vanishes.

    Parameters
    ----------
    points : (C, 2) corners at parameter 0, of simple polygons
    directions : (C, 2) unit edge directions, kept by the inset
    speeds : (C,)
        Distance that each edge line moves inward per unit of the parameter.
    mesh : PolyMesh
        Connectivity.

    Returns
    -------
    (F,) array
        The smallest parameter at which an edge has length zero or a corner meets an edge that is
        not its own; 0 where an edge is reversed from the start, inf where nothing ever happens.
    """
    follow = mesh.next_corner
    velocity = corner_shifts(directions, speeds, mesh)
    length = np.einsum("ij,ij->i", points[follow] - points, directions)
    growth = np.einsum("ij,ij->i", velocity[follow] - velocity, directions)
    limit = np.full(len(points), np.inf)
    shrinking = growth < 0.0
    limit[shrinking] = length[shrinking] / -growth[shrinking]
    limit[length <= 0.0] = 0.0

    normals = left_of(directions)
    start = mesh.starts[mesh.face_of_corner]
    sides = mesh.sides[mesh.face_of_corner]
    place = np.arange(len(points)) - start
    # A corner slides along its own two edges, so it meets the edge beyond one of them only where
    # that one has shrunk to nothing, and that is seen above.
    for ahead in range(2, int(mesh.sides.max(initial=0)) - 2):
        edge = start + (place + ahead) % sides
        away = np.einsum("ij,ij->i", points - points[edge], normals[edge])
        closing = np.einsum("ij,ij->i", velocity - velocity[edge], normals[edge])
        with np.errstate(divide="ignore", invalid="ignore"):
            when = -away / closing
            along = np.einsum("ij,ij->i", points - points[edge], directions[edge])
            along += when * np.einsum("ij,ij->i", velocity - velocity[edge], directions[edge])
            span = length[edge] + when * growth[edge]
        slack = 1e-9 * length[edge]  # corner on corner counts as a hit
        hit = (ahead < sides - 2) & (when > 0.0) & (along >= -slack) & (along <= span + slack)
        limit[hit] = np.minimum(limit[hit], when[hit])
    if len(points) == 0:
        return np.zeros(0)
    smallest: FloatArray = np.minimum.reduceat(limit, mesh.starts[:-1])
    return smallest

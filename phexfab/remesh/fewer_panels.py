"""Fewer panels: what hangs on by one edge, or is of a small piece, is left out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from phexfab.mesh.half_edges import twins
from phexfab.mesh.measures import face_centroids
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.rings import face_rings
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def firm_faces(
    pairs: IntArray, count: int, *, places: IntArray | None = None, share: float = 1.0
) -> BoolArray:
    """Return (count,) True for the faces of the largest piece in which each has two neighbours.

    Faces that hang on one edge go, then those that hang on what remains, so that no strip of single
    faces sticks out. Where nothing is wider than that, the largest piece as it is.

    Parameters
    ----------
    pairs : (n, 2) int
        Faces with a common edge, each pair in both orders.
    count : int
        Number of faces.
    places : (k, 2) int, optional
        Faces and the vertices they have; further pieces are kept if this is given.
    share : float
        Faces of a further piece over those of the largest, at least; none that touches a larger
        one in a vertex is kept.
    """
    kept = np.ones(count, bool)
    while True:
        joined = kept[pairs].all(axis=1)
        hanging = kept & (np.bincount(pairs[joined, 0], minlength=count) < 2)
        if not hanging.any():
            break
        kept &= ~hanging
    if not kept.any():
        kept[:] = True
    inner = pairs[kept[pairs].all(axis=1)]
    links = coo_array((np.ones(len(inner)), (inner[:, 0], inner[:, 1])), shape=(count, count))
    piece = connected_components(links, directed=False)[1]
    sizes = np.bincount(piece[kept], minlength=piece.max() + 1)
    largest = int(sizes.argmax())
    out = kept & (piece == largest)
    if places is None:
        return np.asarray(out)
    used = np.zeros(places[:, 1].max() + 1, bool)
    used[places[out[places[:, 0]], 1]] = True
    for other in np.argsort(-sizes, kind="stable").tolist():
        if other == largest or sizes[other] < max(share * sizes[largest], 1):
            continue
        its = kept & (piece == other)
        vertices = places[its[places[:, 0]], 1]
        if not used[vertices].any():
            used[vertices] = True
            out |= its
    return np.asarray(out)


def firm_mesh(mesh: PolyMesh, *, share: float | None = None) -> PolyMesh:
    """Return the mesh of the faces that ``firm_faces`` finds, without loose vertices.

    With a ``share`` further pieces of that many faces, over the largest's, are kept.
    """
    places = None if share is None else np.column_stack([mesh.face_of_corner, mesh.corners])
    kept = firm_faces(_neighbours(mesh), mesh.n_faces, places=places, share=share or 0.0)
    if kept.all():
        return mesh
    used, slots = np.unique(mesh.corners[kept[mesh.face_of_corner]], return_inverse=True)
    starts = np.concatenate([[0], np.cumsum(mesh.sides[kept])])
    return PolyMesh(mesh.vertices[used], slots.astype(np.int64), starts.astype(np.int64))


def centre_distances(mesh: PolyMesh) -> FloatArray:
    """Return the mean distance of each face's centroid from its neighbours', if it has any."""
    pairs, middle = _neighbours(mesh), face_centroids(mesh)
    count = np.bincount(pairs[:, 0], minlength=mesh.n_faces)
    away = np.linalg.norm(middle[pairs[:, 1]] - middle[pairs[:, 0]], axis=1)
    total = np.bincount(pairs[:, 0], away, mesh.n_faces)
    return np.asarray(total[count > 0] / count[count > 0])


def reach(mesh: PolyMesh, centres: FloatArray) -> FloatArray:
    """Return how far (F,) the farthest corner of each face is from a centre (F, 3) of its own."""
    away = np.linalg.norm(mesh.vertices[mesh.corners] - centres[mesh.face_of_corner], axis=1)
    return np.asarray(np.maximum.reduceat(away, mesh.starts[:-1]))


def _neighbours(mesh: PolyMesh) -> IntArray:
    beyond = twins(mesh)
    inner = np.flatnonzero(beyond >= 0)
    return np.column_stack([mesh.face_of_corner[inner], mesh.face_of_corner[beyond[inner]]])


def firm_shell(shell: Shell, *, share: float | None = None) -> Shell:
    """Return the shell of the panels that ``firm_faces`` finds; the others are border planes.

    With a ``share`` further pieces of that many panels, over the largest's, are kept.
    """
    panels, starts, vertices, _ = shell.rings
    if len(panels) < 2:
        return shell
    owner = np.repeat(np.arange(len(panels)), np.diff(starts))
    places = None if share is None else np.column_stack([owner, vertices])
    kept = firm_faces(neighbours(shell), len(panels), places=places, share=share or 0.0)
    return without_panels(shell, panels[~kept])


def neighbours(shell: Shell) -> IntArray:
    """Return (n, 2) panels with a common edge, by their place in ``shell.panels``, both ways."""
    panels, starts, _, beyond = shell.rings
    number = np.full(len(shell.normals), -1)
    number[panels] = np.arange(len(panels))
    pairs = np.column_stack([np.repeat(np.arange(len(panels)), np.diff(starts)), number[beyond]])
    return np.asarray(pairs[pairs[:, 1] >= 0])


def pieces(shell: Shell) -> int:
    """Return in how many pieces the panels are; one hangs together by edges."""
    pairs, count = neighbours(shell), len(shell.panels)
    links = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return int(connected_components(links, directed=False)[0])


def without_panels(shell: Shell, gone: ArrayLike) -> Shell:
    """Return the shell without some panels.

    A panel stays one as long as its ring is closed, so a hole takes three panels that meet in a
    node: where one is to go from amidst others, two of its neighbours go with it.

    Parameters
    ----------
    shell : Shell
    gone : (k,) int
        Faces, among ``shell.panels``.
    """
    out = np.asarray(gone, np.int64)
    if not len(out):
        return shell
    wanted = np.zeros(len(shell.normals), bool)
    wanted[shell.panels] = True
    wanted[out] = False
    triangles = shell.triangles
    while True:
        triangles = triangles[wanted[triangles].any(axis=1)]
        panels, starts, vertices, _ = face_rings(triangles, len(wanted))
        still = np.flatnonzero(~wanted[panels])
        if not len(still):
            break
        wanted[triangles[vertices[starts[still]]]] = False
    return _compact(shell, triangles)


def _compact(shell: Shell, triangles: IntArray) -> Shell:
    """Return the shell with these triangles only, and the faces that they name."""
    left, inverse = np.unique(triangles, return_inverse=True)
    return replace(
        shell,
        normals=shell.normals[left],
        heights=shell.heights[left],
        gauss_heights=shell.gauss_heights[left],
        triangles=inverse.reshape(-1, 3).astype(np.int64),
        points=shell.points[left],
        parameters=shell.parameters[left] if len(shell.parameters) else shell.parameters,
        parents=shell.parents[left] if len(shell.parents) else shell.parents,
        whole=None,
    )

"""Fewer panels: what hangs on by one edge, or is not of the largest piece, is left out."""

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


def firm_faces(pairs: IntArray, count: int) -> BoolArray:
    """Return (count,) True for the faces of the largest piece in which each has two neighbours.

    Faces that hang on one edge go, then those that hang on what remains, so that no strip of single
    faces sticks out. Where nothing is wider than that, the largest piece as it is.

    Parameters
    ----------
    pairs : (n, 2) int
        Faces with a common edge, each pair in both orders.
    count : int
        Number of faces.
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
    return np.asarray(kept & (piece == np.bincount(piece[kept]).argmax()))


def firm_mesh(mesh: PolyMesh) -> PolyMesh:
    """Return the mesh of the faces that ``firm_faces`` finds, without loose vertices."""
    kept = firm_faces(_neighbours(mesh), mesh.n_faces)
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


def _neighbours(mesh: PolyMesh) -> IntArray:
    beyond = twins(mesh)
    inner = np.flatnonzero(beyond >= 0)
    return np.column_stack([mesh.face_of_corner[inner], mesh.face_of_corner[beyond[inner]]])


def firm_shell(shell: Shell) -> Shell:
    """Return the shell of the panels that ``firm_faces`` finds; the others are border planes."""
    panels, starts, _, beyond = shell.rings
    if len(panels) < 2:
        return shell
    number = np.full(len(shell.normals), -1)
    number[panels] = np.arange(len(panels))
    pairs = np.column_stack([np.repeat(np.arange(len(panels)), np.diff(starts)), number[beyond]])
    kept = firm_faces(pairs[pairs[:, 1] >= 0], len(panels))
    return without_panels(shell, panels[~kept])


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

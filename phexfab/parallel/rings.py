"""Rings of triangles around a face: the corners of panels, and the edges between them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from phexfab.errors import MeshError

if TYPE_CHECKING:
    from phexfab.parallel.shell import Shell

IntArray = NDArray[np.int64]


def face_rings(triangles: IntArray, n_faces: int) -> tuple[IntArray, IntArray, IntArray, IntArray]:
    """Order the triangles around every face; see ``Shell.rings`` for what comes back.

    Raises
    ------
    MeshError
        If two triangles share a directed edge: the dual triangulation is not an oriented
        manifold.
    """
    n = len(triangles)
    # A corner of triangle t at face f sees f's neighbours a, then b, counter-clockwise: the
    # polygon edge towards b ends at the next corner, which is the one whose first neighbour is b.
    face = triangles.ravel()
    first = triangles[:, [1, 2, 0]].ravel()
    second = triangles[:, [2, 0, 1]].ravel()
    corner_triangle = np.repeat(np.arange(n), 3)
    key = face * n_faces + first
    order = np.argsort(key, kind="stable")
    sorted_key = key[order]
    if np.any(sorted_key[1:] == sorted_key[:-1]):
        raise MeshError("two dual triangles share a directed edge; orient the triangulation")
    wanted = face * n_faces + second
    slot = np.minimum(np.searchsorted(sorted_key, wanted), len(order) - 1)
    found = sorted_key[slot] == wanted
    following = np.where(found, order[slot], -1)

    valence = np.bincount(face, minlength=n_faces)
    open_face = np.zeros(n_faces, bool)
    open_face[face[~found]] = True
    panels = np.flatnonzero((valence > 2) & ~open_face)
    starts = np.concatenate([[0], np.cumsum(valence[panels])])

    # Walk all rings at once, one corner further a turn; begin at the lowest triangle.
    begin = np.full(n_faces, 3 * n)
    np.minimum.at(begin, face, np.arange(3 * n))
    current = begin[panels]
    ring = np.empty(starts[-1], np.int64)
    for k in range(int(valence[panels].max(initial=0))):
        alive = valence[panels] > k
        ring[starts[:-1][alive] + k] = current[alive]
        current = np.where(alive, following[current], current)
    if np.any(current != begin[panels]):
        raise MeshError("a face has several rings of triangles; the mesh is not a manifold there")
    return panels, starts, corner_triangle[ring], second[ring]


def edge_faces(shell: Shell) -> tuple[IntArray, IntArray]:
    """Return the corners that own the edges of ``shell.edges``, and (E, 2) faces beside them.

    Faces are rows of ``shell.normals``, border planes included: left, right.
    """
    panels, _, _, neighbours = shell.rings
    mesh = shell.mesh
    left = panels[mesh.face_of_corner]
    is_panel = np.zeros(len(shell.normals), bool)
    is_panel[panels] = True
    corner = np.flatnonzero(~is_panel[neighbours] | (left < neighbours))
    return corner, np.column_stack([left[corner], neighbours[corner]])


def shell_edges(shell: Shell) -> IntArray:
    """Return the edges of a shell's mesh; see ``Shell.edges``."""
    mesh = shell.mesh
    corner, faces = edge_faces(shell)
    index = np.full(len(shell.normals), -1)
    index[shell.panels] = np.arange(len(shell.panels))
    return np.column_stack(
        [mesh.corners[corner], mesh.corners[mesh.next_corner[corner]], index[faces]]
    )


def border_loops(triangles: IntArray, panels: IntArray, n_faces: int) -> list[IntArray]:
    """Return the connected groups of border planes, each in index order.

    A disc has one, a ring two.
    """
    is_panel = np.zeros(n_faces, bool)
    is_panel[panels] = True
    tail, head = triangles.ravel(), triangles[:, [1, 2, 0]].ravel()
    both = ~is_panel[tail] & ~is_panel[head]
    graph = coo_matrix(
        (np.ones(int(both.sum())), (tail[both], head[both])), shape=(n_faces, n_faces)
    )
    _, label = connected_components(graph, directed=False)
    border = np.flatnonzero(~is_panel)
    return [border[label[border] == k] for k in np.unique(label[border])]

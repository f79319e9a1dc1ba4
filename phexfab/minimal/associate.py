"""The conjugate of a discrete minimal surface, and its associate family.

Let M be parallel to S and ``Δm = m_j − m_i``. Because Δs is parallel to Δm, ``s_i × Δm`` is the
same from both ends of an edge. Around a face with normal n, in a plane of S at height h,

    Σ s_i × Δm  =  h n × Σ Δm  +  2 area(M_f, S_f) n  =  2 area(M_f, S_f) n,

so these vectors are the edges of a mesh M* **exactly where H_f = 0**, for any Gauss image at all:
face, edge or vertex type. M* is the conjugate surface and ``M_θ = cos θ M + sin θ M*`` the family.

What M_θ keeps, with t_e the foot of the perpendicular from the origin to the line of S's edge e
(then ``s_i × Δm = t_e × Δm``, a quarter turn about t_e times |t_e|):

* every edge stays perpendicular to t_e; it is turned about t_e and scaled by
  ``√(cos²θ + |t_e|² sin²θ)``;
* edge type (Koebe): |t_e| = 1, the edges are turned by θ about the normal in which they touch the
  sphere, and **all lengths are kept**: the family is isometric. Else lengths change by O(step²);
* the faces of M_θ are planar at multiples of 180° only; at 90° the edges around a vertex i lie in
  a plane instead, with normal s_i;
* M_θ is no longer parallel to S. The mixed area of face and Gauss image, with the area vector's
  bilinear form along n_f, stays zero for the vertex type, and is O(step²) relative otherwise.

References
----------
Thesis §7.2; Bobenko, Hoffmann, Springborn 2006, "Minimal surfaces from circle patterns", Ann. of
Math. 164 (the isometric family of Koebe type); Bobenko, Pinkall 1996 (the vertex type, by a
discrete Weierstrass representation); Wallner, Pottmann 2008, "Infinitesimally flexible meshes and
discrete minimal surfaces", Monatsh. Math. 153.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from phexfab.errors import MeshError
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.edge_curvature import edge_vectors
from phexfab.parallel.shell import Shell
from phexfab.parallel.tree import spanning_tree, sum_to_root
from phexfab.surface.construct import unit

FloatArray = NDArray[np.float64]


def conjugate_edges(mesh: PolyMesh, gauss: PolyMesh) -> FloatArray:
    """Return (C, 3) edges of the conjugate mesh, ``s × Δm``, from every corner to the next one."""
    s = gauss.vertices[mesh.corners]
    # The middle of S's edge serves both faces beside it alike, to the last bit but the sign.
    return np.cross((s + s[mesh.next_corner]) / 2, edge_vectors(mesh))


def conjugate(mesh: PolyMesh, gauss: PolyMesh, tolerance: float = 1e-8) -> PolyMesh:
    """Return the conjugate M* of a discrete minimal surface M with Gauss image S.

    Parameters
    ----------
    mesh, gauss : PolyMesh
        A parallel pair with vanishing mixed areas; of any offset type.
    tolerance : float
        How far faces may stay open, over the mean edge.

    Returns
    -------
    PolyMesh
        Same faces as M, mm, the mean of its vertices in the origin. Its faces are not planar; the
        edges around vertex i are perpendicular to ``s_i``.

    Raises
    ------
    MeshError
        If the pair is not minimal; the message names the worst face. If M* does not close around
        a ring: the message gives the translation by which it misses (a catenoid's conjugate is a
        helicoid).

    References
    ----------
    Bobenko, Hoffmann, Springborn 2006; see the head of this module.
    """
    steps = conjugate_edges(mesh, gauss)
    if not len(steps):
        raise MeshError("the mesh has no face, so there is nothing to conjugate")
    size = float(np.linalg.norm(steps, axis=1).mean())
    begin = mesh.starts[:-1]
    opening = np.linalg.norm(np.add.reduceat(steps, begin), axis=1)
    worst = int(np.argmax(opening))
    if not opening[worst] <= tolerance * size:
        raise MeshError(
            f"face {worst} of the conjugate stays open by {opening[worst] / size:.1e} of an edge: "
            "the pair is not discrete minimal there; solve for the Christoffel dual first"
        )
    used, place = np.unique(mesh.corners, return_inverse=True)
    tail, head = place, place[mesh.next_corner]
    n, count = len(used), len(steps)
    index = csr_matrix((np.arange(1, count + 1), (tail, head)), shape=(n, n), dtype=np.int64)
    parent = spanning_tree(index, 0)
    child = np.flatnonzero(parent != np.arange(n))
    out = np.asarray(index[parent[child], child]).ravel()
    back = np.asarray(index[child, parent[child]]).ravel()
    local = np.zeros((n, 3))
    local[child] = np.where((out > 0)[:, None], steps[out - 1], -steps[back - 1])
    points = sum_to_root(local, parent)
    miss = points[head] - points[tail] - steps
    far = int(np.argmax(np.linalg.norm(miss, axis=1)))
    if not np.linalg.norm(miss[far]) <= tolerance * size * np.sqrt(n):
        period = ", ".join(f"{x:.6g}" for x in miss[far])
        raise MeshError(
            f"the conjugate does not close around the ring: it misses by ({period}); build the "
            "surface as an open rectangle, not closed, to have its associate family"
        )
    vertices = np.zeros_like(mesh.vertices)
    vertices[used] = points - points.mean(axis=0)
    return PolyMesh(vertices, mesh.corners, mesh.starts)


def associate_pair(mesh: PolyMesh, gauss: PolyMesh, degrees: float) -> PolyMesh:
    """Return M_θ = cos θ M + sin θ M*, the associate mesh of a discrete minimal surface.

    Parameters
    ----------
    mesh, gauss : PolyMesh
        A parallel pair with vanishing mixed areas.
    degrees : float
        The Bonnet angle θ, as for ``phexfab.surface.construct.associate``; 180 gives −M.

    Returns
    -------
    PolyMesh
        Same faces, mm. **Its faces are not planar** between multiples of 180°; to build an
        associate surface of planar panels, panel the smooth associate surface. See the head of
        this module for what is kept.

    Raises
    ------
    MeshError
        As ``conjugate``; and if the angle is not finite.
    """
    if not np.isfinite(degrees):
        raise MeshError(f"the Bonnet angle is {degrees}: it must be a finite number of degrees")
    turn = unit(degrees)
    if turn.imag == 0:
        return PolyMesh(turn.real * mesh.vertices, mesh.corners, mesh.starts)
    other = conjugate(mesh, gauss)
    points = turn.real * mesh.vertices + turn.imag * other.vertices
    return PolyMesh(points, mesh.corners, mesh.starts)


def associate(shell: Shell, degrees: float) -> PolyMesh:
    """Return the associate mesh M_θ of a minimal shell, of any offset type.

    Isometric (all edge lengths kept) for the edge type.

    Parameters
    ----------
    shell : Shell
        Discrete minimal.
    degrees : float
        The Bonnet angle θ.

    Raises
    ------
    MeshError
        If the shell is not minimal, or closes around a ring that its conjugate does not.
    """
    return associate_pair(shell.mesh, shell.gauss, degrees)

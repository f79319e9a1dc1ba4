"""Oriented and mixed areas of parallel faces, and the curvatures that Steiner's formula gives.

Computed from the vertices alone, so they also serve to check what the solver claims.

References
----------
Thesis §7.1.1; Bobenko, Pottmann, Wallner 2010, "A curvature theory for discrete surfaces based on
mesh parallelity".
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]


def mixed_areas(shell: Shell, first: FloatArray, second: FloatArray) -> FloatArray:
    """Return area(P_f, Q_f) of every panel for two members of P(M), given by their vertices.

    Parameters
    ----------
    shell : Shell
        Gives the corners and the normals.
    first, second : (V, 3) vertices of two meshes parallel to ``shell.mesh``

    Returns
    -------
    (P,) array; ``first is second`` gives the oriented areas.
    """
    mesh = shell.mesh
    normals = shell.normals[shell.panels]
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    begin = mesh.starts[:-1]
    # Areas do not depend on the origin; near the face they suffer least from rounding.
    origin_p = first[tail[begin]][mesh.face_of_corner]
    origin_q = second[tail[begin]][mesh.face_of_corner]
    p0, p1 = first[tail] - origin_p, first[head] - origin_p
    q0, q1 = second[tail] - origin_q, second[head] - origin_q
    cross = np.cross(p0, q1) + np.cross(q0, p1)
    parts = np.einsum("ij,ij->i", cross, normals[mesh.face_of_corner])
    return np.add.reduceat(parts, begin) / 4


def mean_curvatures(shell: Shell) -> FloatArray:
    """Return H_f = −area(M_f, S_f)/area(M_f) of every panel, 1/mm."""
    m, s = shell.mesh.vertices, shell.gauss.vertices
    return -mixed_areas(shell, m, s) / mixed_areas(shell, m, m)


def gaussian_curvatures(shell: Shell) -> FloatArray:
    """Return K_f = area(S_f)/area(M_f) of every panel, 1/mm²."""
    m, s = shell.mesh.vertices, shell.gauss.vertices
    return mixed_areas(shell, s, s) / mixed_areas(shell, m, m)


def minimality(shell: Shell) -> FloatArray:
    """Return the scale-free |H_f|/√|K_f| of every panel; 0 on a discrete minimal surface."""
    m, s = shell.mesh.vertices, shell.gauss.vertices
    mixed = mixed_areas(shell, m, s)
    return np.abs(mixed) / np.sqrt(
        np.abs(mixed_areas(shell, m, m)) * np.abs(mixed_areas(shell, s, s))
    )

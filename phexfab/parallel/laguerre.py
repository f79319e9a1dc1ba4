"""Laguerre transformations of a shell and its Gauss image: a design handle that keeps offsets.

A vertex of M with its offsets is the line ``(m + d·s, −d)`` of points-with-radius in R^{3,1}, an
oriented cone of revolution. These lines meet along edges and lie, around a face, in the
hyperplane ``n·x + δ·r = h``, δ the height of S's face. Laguerre transformations move R^{3,1} by
``X → A X + T`` with a multiple A of a Lorentz matrix, so lines go to lines and hyperplanes to
hyperplanes: (n, δ; h) goes to ``P' = A⁻ᵀ(n, δ)``, ``h' = h + P'·T``, scaled so that |n'| = 1. That
an edge, a vertex or a face of S touches the sphere is said by the Lorentz product alone, so all
three offset types stay what they are. Normals of face-type shells move on the sphere by Möbius
maps; for the other types the circles in which S's faces cut it do.

A transformation here is a (5, 5) matrix ``[[A, T], [0, 1]]``, so that products compose.

References
----------
Thesis §4.4.2; Pottmann, Grohs, Blaschitz 2010, "Edge offset meshes in Laguerre geometry".
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import MeshError
from phexfab.parallel.shell import Shell, plane_vertices

FloatArray = NDArray[np.float64]
_METRIC = np.diag([1.0, 1.0, 1.0, -1.0])


def rotation(axis: ArrayLike, angle: float) -> FloatArray:
    """Return the rotation about an axis through the origin, by an angle in degrees."""
    x, y, z = _direction(axis)
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    t = np.radians(angle)
    matrix = np.eye(5)
    matrix[:3, :3] += np.sin(t) * skew + (1 - np.cos(t)) * skew @ skew
    return matrix


def translation(vector: ArrayLike) -> FloatArray:
    """Return the translation by a vector in mm."""
    matrix = np.eye(5)
    matrix[:3, 4] = np.asarray(vector, float)
    return matrix


def dilation(distance: float) -> FloatArray:
    """Return the transformation that offsets every shell by a distance in mm, to M + d·S."""
    matrix = np.eye(5)
    matrix[3, 4] = distance
    return matrix


def scaling(factor: float) -> FloatArray:
    """Return the scaling about the origin by a positive factor; S stays as it is.

    Raises
    ------
    MeshError
        If the factor is not positive.
    """
    if not 0 < factor < np.inf:
        raise MeshError(f"the factor {factor:g} of a scaling must be positive")
    return np.diag([factor, factor, factor, factor, 1.0])


def boost(direction: ArrayLike, rapidity: float) -> FloatArray:
    """Return the Lorentz boost: it draws normals towards a direction.

    Parameters
    ----------
    direction : (3,)
        Normals flow towards it along great circles, away from its opposite.
    rapidity : float
        Without unit; boosts along one direction add up. A normal at right angles to the direction
        ends at the angle whose sine is 1/cosh(rapidity).
    """
    d = _direction(direction)
    matrix = np.eye(5)
    matrix[:3, :3] += (np.cosh(rapidity) - 1) * np.outer(d, d)
    matrix[3, 3] = np.cosh(rapidity)
    matrix[:3, 3] = matrix[3, :3] = -np.sinh(rapidity) * d
    return matrix


def laguerre(shell: Shell, matrix: FloatArray) -> Shell:
    """Return the image of M and S under a Laguerre transformation; the offset type stays.

    Shells do not stay minimal, except under similarities: neither offsets nor boosts keep mean
    curvature. (The wider class that stays is that of Laguerre-minimal surfaces.)

    Parameters
    ----------
    shell : Shell
    matrix : (5, 5) array
        A product of ``rotation``, ``translation``, ``dilation``, ``scaling`` and ``boost``.

    Returns
    -------
    Shell
        Without parameters. ``points`` are the images of the smooth surface's points, brought onto
        the face planes (they lie there for the face type; for the others the image of the smooth
        surface touches other planes by the square of the panels' size).

    Raises
    ------
    MeshError
        If the matrix is no Laguerre transformation that keeps orientation, or a vertex would pass
        through infinity; the message names the vertex.

    References
    ----------
    Pottmann, Grohs, Blaschitz 2010.
    """
    linear, shift = _parts(matrix)
    old = np.column_stack([shell.normals, shell.gauss_heights])
    used = shell.triangles[shell.used_vertices]
    s = plane_vertices(shell.normals, shell.gauss_heights, used)
    time = s @ linear[3, :3] - linear[3, 3]  # of the lines' directions (s, −1); −1 before
    if np.any(time >= -1e-9 * linear[3, 3]):
        worst = int(np.argmax(time))
        raise MeshError(
            f"vertex {worst} of the shell would pass through infinity; use a smaller rapidity, or "
            "another direction"
        )
    moved = np.linalg.solve(linear.T, old.T).T
    size = np.linalg.norm(moved[:, :3], axis=1)
    normals = moved[:, :3] / size[:, None]
    heights = (shell.heights + moved @ shift) / size
    points = _contact_points(shell, linear, shift)
    off = heights - np.einsum("ij,ij->i", points, normals)
    return replace(
        shell,
        normals=normals,
        gauss_heights=moved[:, 3] / size,
        heights=heights,
        points=points + off[:, None] * normals,
        parameters=np.zeros(0, complex),
    )


def _contact_points(shell: Shell, linear: FloatArray, shift: FloatArray) -> FloatArray:
    """Move points with normals as spheres of radius 0 and the lines of spheres that touch there."""
    point = shell.points @ linear[:, :3].T + shift
    along = np.column_stack([shell.normals, -np.ones(len(shell.normals))]) @ linear.T
    return point[:, :3] - (point[:, 3] / along[:, 3])[:, None] * along[:, :3]


def _direction(vector: ArrayLike) -> FloatArray:
    v = np.asarray(vector, float)
    length = float(np.linalg.norm(v))
    if v.shape != (3,) or not 0 < length < np.inf:
        raise MeshError(f"{vector!r} is no direction; give three numbers that are not all zero")
    return v / length


def _parts(matrix: FloatArray) -> tuple[FloatArray, FloatArray]:
    m = np.asarray(matrix, float)
    if m.shape != (5, 5) or np.any(m[4] != [0, 0, 0, 0, 1]):
        raise MeshError("a Laguerre transformation is a (5, 5) matrix with last row 0 0 0 0 1")
    linear, shift = m[:4, :4], m[:4, 4]
    product = linear.T @ _METRIC @ linear
    factor = -product[3, 3]
    if not np.allclose(product, factor * _METRIC, rtol=0, atol=1e-9 * np.abs(linear).max() ** 2):
        raise MeshError(
            "the matrix does not keep the Lorentz product up to a factor; build it from "
            "rotation, translation, dilation, scaling and boost"
        )
    if not (factor > 0 and linear[3, 3] > 0 and np.linalg.det(linear) > 0):
        raise MeshError("the matrix mirrors space or turns planes over; keep the orientation")
    return linear, shift

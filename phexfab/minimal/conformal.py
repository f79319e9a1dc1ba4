"""Conformal hexagon meshes of the plane, lifted to the sphere, and their Christoffel dual.

The thesis' three cases, discretising z, e^{az} and e^{(a+ib)z}: one circular hexagon that is a
Möbius image of the regular one, repeated by two commuting similarities. Their duals in closed
form are discrete Enneper's surfaces, catenoids and helicoids; here they are special cases of the
vertex type, and the closed form is an independent check of the minimal solve.

References
----------
Thesis §5.3, §7.2.1; Müller 2011, "Conformal hexagonal meshes", Geom. Dedicata.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.minimal.sphere import lift_circles
from phexfab.parallel.rings import edge_faces
from phexfab.parallel.shell import Shell
from phexfab.remesh.conformal.dual import dual_points
from phexfab.remesh.conformal.planar import conformal_hexagon, orbit, ring_tilt, similarities

__all__ = ["christoffel_dual", "conformal_gauss_image", "conformal_hexagon", "ring_tilt"]

FloatArray = NDArray[np.float64]


def conformal_gauss_image(
    columns: int, rows: int, *, tilt: complex = 0.0, size: float = 1.0, closed: bool = False
) -> tuple[Shell, NDArray[np.bool_]]:
    """Return the lifted conformal hexagon mesh as a shell whose M is its own Gauss image.

    Parameters
    ----------
    columns, rows : int
        Hexagons along α and along β; the outermost ones become border planes.
    tilt : complex
        Of the starting hexagon. 0 gives case 1 (z → z).
    size : float
        Scale of the plane mesh before it is lifted to the sphere; it is centred at the fixed
        point of the similarities, or at the middle in case 1.
    closed : bool
        Identify columns cyclically (case 2, with ``tilt = ring_tilt(columns)``).

    Returns
    -------
    shell : Shell
        Kind ``"vertex"``; heights equal to the heights of S.
    twice : (E,) bool
        The edges between neighbours along α, whose duals carry the coefficient 2.
    """
    hexagon, centre, radius = conformal_hexagon(tilt)
    alpha, beta = similarities(hexagon)
    k, l = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    moved = orbit(alpha, beta, centre, k, l)
    factor = np.abs(alpha.factor) ** l * np.abs(beta.factor) ** k
    if alpha.is_translation and beta.is_translation:
        moved = moved - moved.mean()
    else:
        # Centred, and scaled so that the middle row has the size of the hexagon.
        middle = beta.factor ** -((rows - 1) / 2)
        moved = (moved - (alpha if beta.is_translation else beta).fixed_point) * middle
        factor = factor * abs(middle)
    centres = np.asarray(size * moved.ravel(), complex)
    normals, heights = lift_circles(centres, size * radius * factor.ravel())

    def flat(row: NDArray[np.int64], column: NDArray[np.int64]) -> NDArray[np.int64]:
        column = column % columns if closed else column
        ok = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        return np.where(ok, row * columns + column, -1).ravel()

    # Corner 1 of hexagon (k, l) meets α's and β's copies, corner 4 the copies the other way.
    near = np.column_stack([flat(k, l), flat(k + 1, l), flat(k, l + 1)])
    far = np.column_stack([flat(k, l), flat(k - 1, l), flat(k, l - 1)])
    triangles = np.concatenate([near, far])
    triangles = triangles[(triangles >= 0).all(axis=1)]
    # Counter-clockwise in the plane.
    p = moved.ravel()[triangles]
    turn = ((p[:, 1] - p[:, 0]).conj() * (p[:, 2] - p[:, 0])).imag
    if np.median(turn) < 0:
        triangles = triangles[:, [0, 2, 1]]
    shell = Shell(normals, heights, heights, triangles, "vertex", heights[:, None] * normals)
    faces = edge_faces(shell)[1]
    return shell, faces[:, 0] // columns == faces[:, 1] // columns


def christoffel_dual(shell: Shell, twice: NDArray[np.bool_]) -> FloatArray:
    """Return the vertices of the Christoffel dual of a conformal hexagon mesh, in closed form.

    Parameters
    ----------
    shell : Shell
        Its Gauss image is the conformal mesh.
    twice : (E,) bool
        The edges of ``shell.edges`` whose dual is 2e/|e|²; all others have −e/|e|² (the printed
        formula lacks the conjugate: only with it are the duals' edges parallel).

    Raises
    ------
    MeshError
        If the dual edges do not close around a face: the mesh is not conformal.

    References
    ----------
    Thesis §5.3.3.
    """
    return dual_points(shell.gauss.vertices, shell.edges[:, :2], twice)

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
from scipy.optimize import brentq
from scipy.sparse import csr_matrix

from phexfab.errors import MeshError
from phexfab.minimal.sphere import lift_circles
from phexfab.parallel.rings import edge_faces
from phexfab.parallel.shell import Shell
from phexfab.parallel.tree import spanning_tree, sum_to_root

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


def conformal_hexagon(tilt: complex = 0.0) -> tuple[ComplexArray, complex, float]:
    """Return a circular conformal hexagon (6,), the centre and the radius of its circle.

    It is the image of the regular hexagon e^{iπk/3} under z → z/(1 − tilt·z), |tilt| < 1.
    """
    if not abs(tilt) < 1:
        raise MeshError(f"tilt = {tilt}: its modulus must be below 1")
    z = np.exp(1j * np.pi * np.arange(6) / 3)
    shrink = 1 / (1 - abs(tilt) ** 2)
    return z / (1 - tilt * z), np.conj(tilt) * shrink, float(shrink)


def _similarities(z: ComplexArray) -> tuple[complex, complex, complex, complex]:
    """Return α = (a, b): z → az + b with (z4, z5) → (z2, z1), and β with (z3, z4) → (z1, z0)."""
    a = (z[1] - z[2]) / (z[5] - z[4])
    b = (z[0] - z[1]) / (z[4] - z[3])
    return a, z[2] - a * z[4], b, z[1] - b * z[3]


def ring_tilt(n: int) -> float:
    """Return the tilt whose mesh closes after ``n`` hexagons along α (thesis' case 2).

    For a real tilt α is a rotation and β²α⁻¹ a dilation; ``n`` rotations make a full turn.
    """
    if n < 5:
        raise MeshError(f"a conformal ring needs at least 5 hexagons around, not {n}")

    def miss(size: float) -> float:
        return float(np.angle(_similarities(conformal_hexagon(size)[0])[0]) - 2 * np.pi / n)

    return float(brentq(miss, 1e-9, 0.9, xtol=1e-16, rtol=1e-15))


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
    z, centre, radius = conformal_hexagon(tilt)
    a, a0, b, b0 = _similarities(z)
    k, l = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    if abs(a - 1) < 1e-12 and abs(b - 1) < 1e-12:
        moved = centre + a0 * (l - (columns - 1) / 2) + b0 * (k - (rows - 1) / 2)
        factor = np.ones(moved.shape)
    else:
        fixed = a0 / (1 - a) if abs(a - 1) > abs(b - 1) else b0 / (1 - b)
        log_a, log_b = np.log(a), np.log(b)
        power = np.exp(log_a * l + log_b * (k - (rows - 1) / 2))
        moved = (centre - fixed) * power
        factor = np.abs(power)
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
    s, edges = shell.gauss.vertices, shell.edges
    i, j = edges[:, 0], edges[:, 1]
    e = s[j] - s[i]
    dual = np.where(twice, 2.0, -1.0)[:, None] * e / np.sum(e * e, axis=1, keepdims=True)
    n = len(s)
    index = csr_matrix((np.arange(1, len(i) + 1), (i, j)), shape=(n, n), dtype=np.int64)
    parent = spanning_tree(index, 0)
    child = np.flatnonzero(parent != np.arange(n))
    out = np.asarray(index[parent[child], child]).ravel()
    back = np.asarray(index[child, parent[child]]).ravel()
    steps = np.zeros((n, 3))
    steps[child] = np.where((out > 0)[:, None], dual[out - 1], -dual[back - 1])
    points = sum_to_root(steps, parent)
    miss = np.abs(points[j] - points[i] - dual).max() / np.abs(dual).max()
    if not miss < 1e-8:
        raise MeshError(f"the dual does not close (by {miss:.1e}): the mesh is not conformal")
    return points

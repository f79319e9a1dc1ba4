"""Surfaces whose umbilics are known, rings, and the shells on their lattices."""

import numpy as np

from phexfab.minimal.laplacian import solve_minimal
from phexfab.parallel.shell import Shell
from phexfab.surface import from_weierstrass

P = np.polynomial.polynomial
SCALE = 1000.0


def with_umbilics(zeros, base=0.0123 + 0.0213j, lead=1.0):
    """The surface f = 1, g' = lead Π (z - zero): its umbilics are the zeros."""
    slope = lead * P.polyfromroots(zeros).astype(complex)
    g = P.polyint(slope)
    square = P.polymul(g, g)
    parts = [0.5 * P.polysub([1], square), 0.5j * P.polyadd([1], square), g]
    curves = [P.polyint(part) for part in parts]
    return from_weierstrass(
        lambda z: P.polyval(z, g),
        np.ones_like,
        gauss_map_derivative=lambda z: P.polyval(z, slope),
        null_curve=lambda z: np.stack([P.polyval(z, c) for c in curves], -1),
        base=base,
        scale=SCALE,
        name="polynomial",
    )


def ring(c=0.0, d=0.0):
    """A closed ring in 0.5 < |z| < 2.2, g = z, f = 1/z² + c + d/z⁴: the catenoid for c = d = 0.

    No component of its null curve has a residue but the height, whose period is imaginary.
    """

    def power(z, k):
        return np.log(z) if k == -1 else z ** (k + 1) / (k + 1)

    def curve(z):
        low, high, middle = (
            power(z, -2 + s) + c * power(z, s) + d * power(z, -4 + s) for s in (0, 2, 1)
        )
        return np.stack([0.5 * (low - high), 0.5j * (low + high), middle], -1)

    return from_weierstrass(
        lambda z: z,
        lambda z: 1 / z**2 + c + d / z**4,
        gauss_map_derivative=np.ones_like,
        null_curve=curve,
        base=1.0,
        scale=SCALE,
        name="ring",
    )


def face_shell(surface, on):
    """The exact discrete minimal surface of the face type on a grown lattice."""
    z = on.parameters
    normals, points = surface.normal(z), surface.point(z)
    heights = np.einsum("ij,ij->i", normals, points)
    start = Shell(
        normals, heights, np.ones(len(z)), on.triangles, "face", points, on.step, parameters=z
    )
    return solve_minimal(start)


def root_integral(quantity, ways):
    """∫ √quantity dz along each row of polylines (n, k) by Gauss' rule, the root continuous.

    The first and the last piece may begin or end in a zero: t = s² there.
    """
    x, w = np.polynomial.legendre.leggauss(40)
    x, w = (x + 1) / 2, w / 2
    start, end = ways[:, :-1, None], ways[:, 1:, None]
    t = np.broadcast_to(x, (ways.shape[1] - 1, len(x))).copy()
    speed = np.ones_like(t)
    t[0], speed[0] = x**2, 2 * x
    t[-1], speed[-1] = x * (2 - x), 2 * (1 - x)
    if len(t) == 1:
        t[0], speed[0] = x * x * (3 - 2 * x), 6 * x * (1 - x)
    z = (start + (end - start) * t).reshape(len(ways), -1)
    dz = ((end - start) * (speed * w)).reshape(len(ways), -1)
    root = np.sqrt(quantity(z))
    flip = np.where((root[:, 1:] * root[:, :-1].conj()).real < 0, -1, 1)
    root[:, 1:] *= np.cumprod(flip, axis=1)
    return (root * dz).sum(1)


def lattice_coordinates(plane, w):
    """(..., 2) coordinates in the lattice's basis, whole numbers at lattice points."""
    a, b = plane.basis
    matrix = np.array([[a.real, b.real], [a.imag, b.imag]])
    return np.linalg.solve(matrix, np.stack([np.real(w), np.imag(w)]).reshape(2, -1)).T

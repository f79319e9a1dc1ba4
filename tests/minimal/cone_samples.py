"""Lattices on cones, in closed form: Enneper's surfaces of higher order around their umbilic."""

import numpy as np

from phexfab.parallel.rings import face_rings
from phexfab.remesh.lattice import Lattice
from phexfab.triangular import EQUILATERAL


def cone_lattice(order, rings, radius, row_ratio=EQUILATERAL):
    """The lattice of ``rings`` rings around the umbilic of Enneper's surface of that order.

    f = 1 and g = z^n have Q = n z^(n−1), so w = 2√n/(n+1) z^((n+1)/2) runs through the angle
    (n+1)π around z = 0: 3(n+1) sectors of the triangular lattice. ``radius`` is |z| of the corners
    of the outermost ring.
    """
    sectors = 3 * (order + 1)
    count = 1 + sectors * rings * (rings + 1) // 2

    def number(k, i, j):
        """Of i steps along ray k and j along ray k + 1."""
        ring = i + j
        place = (k * ring + j) % (sectors * ring) if ring else 0
        return 1 + sectors * ring * (ring - 1) // 2 + place if ring else 0

    ray = np.array([1, 0.5 + row_ratio * 1j, -0.5 + row_ratio * 1j])
    place, turn = np.zeros(count, complex), np.zeros(count)
    triangles = []
    for k in range(sectors):
        # Rays 0, 3, 6 … are rows; every half-turn has three sectors.
        half, a = divmod(k, 3)
        one, two = ray[a], ray[a + 1] if a < 2 else -ray[0]
        for i in range(rings + 1):
            for j in range(rings + 1 - i):
                if i:
                    me = number(k, i, j)
                    w = i * one + j * two
                    place[me], turn[me] = w, np.pi * half + np.angle(w)
                corners = [(i, j), (i + 1, j), (i, j + 1)]
                if i + j < rings:
                    triangles.append(_row_first(k, corners, a))
                if i + j + 1 < rings:
                    triangles.append(_row_first(k, [(i + 1, j + 1), (i, j + 1), (i + 1, j)], a))
    tri = np.array([[number(*corner) for corner in t] for t in triangles])
    power = 2 / (order + 1)
    z = np.abs(place) ** power * np.exp(1j * power * turn)
    z *= radius / rings**power
    step = 2 * np.sqrt(order) / (order + 1) * radius ** (1 / power) / rings
    upward = np.ones(len(tri), bool)
    return Lattice(z, tri, upward, step, row_ratio, parameters=z, density=np.ones(count))


def _row_first(k, corners, a):
    """Turn a triangle so that its first edge lies along a row."""
    # In sector 0 the first ray is the row, in sector 2 the second, in sector 1 the side between.
    first = {0: 0, 1: 1, 2: 2}[a]
    return [(k, *corners[(first + s) % 3]) for s in range(3)]


def without(lattice, removed):
    """The lattice without the points where ``removed`` holds, and without what touches no panel."""
    tri = lattice.triangles
    full = np.bincount(tri.ravel(), minlength=len(lattice.points))
    tri = tri[~removed[tri].any(axis=1)]
    left = np.bincount(tri.ravel(), minlength=len(lattice.points))
    inner = np.zeros(len(full), bool)
    inner[face_rings(lattice.triangles, len(full))[0]] = True
    panel = inner & (left == full)
    tri = tri[panel[tri].any(axis=1)]
    used = np.unique(tri)
    z = lattice.parameters[used]
    return Lattice(
        z,
        np.searchsorted(used, tri),
        np.ones(len(tri), bool),
        lattice.step,
        lattice.row_ratio,
        parameters=z,
        density=lattice.density[used],
    )

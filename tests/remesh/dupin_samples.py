"""Surfaces on which triangulations and hexagons are tried."""

import numpy as np

from phexfab.mesh.polymesh import PolyMesh
from phexfab.surface.freeform.surface import nurbs, parametric


def graph(height, width, depth, name):
    box = (-width, width, -depth, depth)
    return parametric(lambda x, y: (x, y, height(x, y)), box, name=name)


def sphere_cap():
    return graph(lambda x, y: np.sqrt(2.5e7 - x * x - y * y), 3000.0, 2500.0, "cap")


def hypar():
    return graph(lambda x, y: x * y / 5000.0, 3000.0, 2500.0, "hypar")


def monkey_saddle():
    return graph(lambda x, y: (x**3 - 3 * x * y * y) / 3e7, 3000.0, 3000.0, "monkey saddle")


def ellipsoid():
    def point(u, v):
        return 6e3 * np.cos(v) * np.cos(u), 4e3 * np.cos(v) * np.sin(u), 3e3 * np.sin(v)

    box = (0.0, 2 * np.pi, -1.0, 1.0)
    return parametric(point, box, periodic=(True, False), name="ellipsoid")


def torus():
    def point(u, v):
        reach = 6000.0 + 2000.0 * np.cos(v)
        return reach * np.cos(u), reach * np.sin(u), 2000.0 * np.sin(v)

    box = (0.0, 2 * np.pi, 0.0, 2 * np.pi)
    return parametric(point, box, periodic=(True, True), name="torus")


def clamped(n):
    return np.concatenate([np.zeros(3), np.linspace(0, 1, n - 2), np.ones(3)])


def bumpy_roof(bump=400.0, rough=0.0):
    """A vault with bumps across it; K changes its sign across it."""
    x, y = np.meshgrid(np.linspace(0, 14000, 12), np.linspace(0, 10000, 9), indexing="ij")
    wave = np.cos(3 * np.pi * x / 14000 + 0.4) * (1 + 0.3 * np.cos(np.pi * y / 10000))
    z = 1500 * np.sin(np.pi * y / 10000) + bump * wave
    z = z + rough * np.random.default_rng(3).normal(size=z.shape)
    return nurbs(np.stack([x, y, z], -1), (clamped(12), clamped(9)), (3, 3), name="roof")


def triangles_of(surface, n=60, m=45):
    u0, u1, v0, v1 = surface.domain
    grid = np.stack(np.meshgrid(np.linspace(u0, u1, n), np.linspace(v0, v1, m), indexing="ij"), -1)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n - 1), np.arange(m - 1), indexing="ij"))
    at = i * m + j
    low = np.stack([at, at + m, at + m + 1], axis=1)
    high = np.stack([at, at + m + 1, at + 1], axis=1)
    return PolyMesh.from_faces(surface.point(grid).reshape(-1, 3), np.concatenate([low, high]))

"""Shells and independent measures for the tests of parts."""

from functools import lru_cache

import manifold3d
import numpy as np

from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.surface.catalog import surface

KINDS = ("face", "edge", "vertex")


@lru_cache(maxsize=8)
def sample(kind="face", closed=True):
    """A small shell in mm with edges of some 300 mm: a closed catenoid, or a patch of Enneper's."""
    made = surface("catenoid" if closed else "enneper").scaled(1200.0 if closed else 3000.0)
    options = {"rectangle": (-0.8, 0.8, 0.0, 2 * np.pi), "closed": True} if closed else {}
    return minimal_shell(made, lattice_on(made, 450.0, **options), kind)


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def face_normal(points):
    """Outward unit normal of a planar polygon in space."""
    p = points - points[0]
    return unit(np.cross(p, np.roll(p, -1, axis=0)).sum(axis=0))


def as_manifold(solid):
    """The solid in manifold3d, its faces triangulated by manifold3d: no code of phexfab."""
    triangles = []
    for face in solid.faces:
        points = solid.vertices[list(face)]
        n = face_normal(points)
        axis = int(np.argmax(np.abs(n)))
        flat = np.delete(points, axis, axis=1) if axis != 1 else points[:, [2, 0]]
        if n[axis] < 0:
            flat = flat[:, ::-1]
        triangles.append(np.array(face)[manifold3d.triangulate([flat])])
    mesh = manifold3d.Mesh64(solid.vertices.astype(float), np.vstack(triangles).astype(np.uint64))
    made = manifold3d.Manifold(mesh)
    assert made.status() == manifold3d.Error.NoError
    return made


def largest_overlap(manifolds):
    """Largest common volume of any two, and how many pairs were close enough to look at."""
    boxes = np.array([m.bounding_box() for m in manifolds])
    low, high = boxes[:, :3] - 1e-6, boxes[:, 3:] + 1e-6
    worst, looked = 0.0, 0
    for i in range(len(boxes)):
        near = (low[i] < high[i + 1 :]).all(axis=1) & (low[i + 1 :] < high[i]).all(axis=1)
        for j in np.flatnonzero(near) + i + 1:
            looked += 1
            worst = max(worst, (manifolds[i] ^ manifolds[j]).volume())
    return worst, looked

"""Several conjugate nets about an umbilic: sectors covered, pieces that keep off each other."""

import numpy as np
import pytest
from dupin_samples import hypar, monkey_saddle

from phexfab.errors import LatticeError
from phexfab.mesh.measures import relative_planarity, simple_faces
from phexfab.remesh.conjugate.fields import principal_family
from phexfab.remesh.conjugate.sectors import conjugate_sectors

SIZE = 600.0


def count_above(mesh, points):
    """How many faces lie over each of points (n, 2) of the plane below, by crossing numbers."""
    count = np.zeros(len(points), int)
    for face in mesh.faces:
        a = mesh.vertices[face, :2]
        b = np.roll(a, -1, axis=0)
        spans = (a[:, None, 1] > points[:, 1]) != (b[:, None, 1] > points[:, 1])
        rise = np.where(spans, b[:, None, 1] - a[:, None, 1], 1.0)
        x = a[:, None, 0] + (points[:, 1] - a[:, None, 1]) * (b - a)[:, None, 0] / rise
        count += (spans & (x > points[:, 0])).sum(axis=0) % 2
    return count


@pytest.fixture(scope="module")
def sectors():
    return conjugate_sectors(monkey_saddle(), principal_family(), SIZE)


def test_all_sectors_of_a_monkey_saddle_are_covered(sectors):
    surface = monkey_saddle()
    u0, u1, v0, v1 = surface.domain
    alone = sectors.nets[0]
    points = np.random.default_rng(2).uniform([u0, v0], [u1, v1], size=(5000, 2))
    assert (count_above(alone.mesh, points) > 0).mean() < 0.5
    assert (count_above(sectors.mesh, points) > 0).mean() > 0.65
    # In each of six directions from the flat point something is covered.
    way = np.floor(np.arctan2(points[:, 1], points[:, 0]) / (np.pi / 3)).astype(int)
    alone, covered = (count_above(m, points) > 0 for m in (alone.mesh, sectors.mesh))
    assert min(alone[way == k].mean() for k in range(-3, 3)) < 0.1
    assert min(covered[way == k].mean() for k in range(-3, 3)) > 0.4


def test_nets_keep_off_each_other_and_are_planar(sectors):
    surface = monkey_saddle()
    u0, u1, v0, v1 = surface.domain
    points = np.random.default_rng(3).uniform([u0, v0], [u1, v1], size=(5000, 2))
    assert count_above(sectors.mesh, points).max() == 1
    assert relative_planarity(sectors.mesh).max() < 1e-12
    assert simple_faces(sectors.mesh).all()
    counts = [net.mesh.n_faces for net in sectors.nets]
    assert len(counts) > 1 and counts == np.bincount(sectors.net_of_face).tolist()
    of_corner = sectors.net_of_face[sectors.mesh.face_of_corner]
    pairs = np.unique(np.column_stack([sectors.mesh.corners, of_corner]), axis=0)
    assert len(pairs) == len(sectors.mesh.vertices)  # each vertex belongs to one net


def test_one_net_is_enough_where_it_covers_all():
    made = conjugate_sectors(hypar(), principal_family(), 600.0)
    assert len(made.nets) == 1 and not made.refused


def test_nets_are_at_least_one():
    with pytest.raises(LatticeError, match="nets = 0"):
        conjugate_sectors(monkey_saddle(), principal_family(), SIZE, nets=0)

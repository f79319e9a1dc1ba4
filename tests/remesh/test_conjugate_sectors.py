"""Several conjugate nets about an umbilic: sectors covered, pieces that keep off each other."""

import numpy as np
import pytest
from dupin_samples import bumpy_roof, hypar, monkey_saddle
from scipy.spatial import cKDTree

from phexfab.errors import LatticeError
from phexfab.mesh.measures import relative_planarity, simple_faces
from phexfab.remesh.conjugate import hexagons
from phexfab.remesh.conjugate.fields import field_family, plane_families, principal_family
from phexfab.remesh.conjugate.hexagons import chosen_bricks, planar_hexagons
from phexfab.remesh.conjugate.sectors import CLEAR, conjugate_sectors
from phexfab.remesh.coverage import coverage
from phexfab.remesh.triangulations.fields import smooth_rows

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


def test_curves_of_further_nets_end_before_the_faces_of_those_before(sectors):
    first, second = sectors.nets[:2]
    start = first.mesh.vertices[first.mesh.corners]
    middle = (start + start[first.mesh.next_corner]) / 2
    marks = cKDTree(np.concatenate([start, middle]))
    for curves in second.bricks.net.curves:
        for k in range(len(curves.first)):
            samples = curves.points[k, curves.first[k] : curves.last[k] + 1]
            assert marks.query(samples)[0].min() >= CLEAR * SIZE


def test_of_several_families_the_one_that_covers_most_is_followed():
    surface = bumpy_roof()
    field, planes = field_family(smooth_rows(surface)), plane_families(surface)
    options = {"nets": 1, "crossing": "drop"}
    made = conjugate_sectors(surface, [field, *planes], 900.0, **options)
    alone = conjugate_sectors(surface, field, 900.0, **options)
    assert made.families[0] in planes and alone.families == (field,)
    assert coverage(surface, made.mesh).share > coverage(surface, alone.mesh).share + 0.1


def test_a_face_flung_out_counts_as_one_that_crosses_itself(monkeypatch):
    bricks, _ = chosen_bricks(hypar(), principal_family(), SIZE)
    fine = planar_hexagons(bricks)
    monkeypatch.setattr(hexagons, "FLUNG", 0.5)
    kept = planar_hexagons(bricks, crossing="keep")
    assert len(kept.crossing) == fine.mesh.n_faces
    with pytest.raises(LatticeError, match="are flung out, first face"):
        planar_hexagons(bricks)
    with pytest.raises(LatticeError, match="every face crosses itself"):
        planar_hexagons(bricks, crossing="drop")


def test_a_seed_too_near_the_border_is_refused_before_anything_is_traced():
    surface = hypar()
    u0, u1, v0, v1 = surface.domain
    near = [u0 + 1e-3 * (u1 - u0), v0 + 1e-3 * (v1 - v0)]
    with pytest.raises(LatticeError, match=r"through the seed at .* mm long, too short"):
        chosen_bricks(surface, field_family([1.0, -1.0, 0.0]), SIZE, seed=near)

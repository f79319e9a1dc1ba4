"""Valid triangulations: regular, on the surface, valid by the conditions of §5.1.3."""

import numpy as np
import pytest
from dupin_samples import bumpy_roof, hypar, monkey_saddle, sphere_cap, torus

from phexfab.errors import LatticeError
from phexfab.remesh.dupin.duality import centre_is_inside, corners_on_both_branches
from phexfab.remesh.triangulations.fields import conjugate, flat_directions, smooth_rows
from phexfab.remesh.triangulations.valid import prespecified_conjugation, progressive_conjugation
from phexfab.surface.freeform.surface import mesh_surface

WAYS = [progressive_conjugation, prespecified_conjugation]


def flat_triangles(made):
    """Triangles in principal coordinates of their centroids, and the curvatures there."""
    corner = made.points[made.triangles]
    middle = made.surface.nearest(corner.mean(axis=1))
    bending = made.surface.bending(middle)
    gap = corner - made.surface.point(middle)[:, None]
    return np.einsum("mij,mkj->mki", bending.directions, gap), bending.kappa


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("make", "step"), [(sphere_cap, 400.0), (hypar, 350.0), (torus, 900.0)])
def test_every_triangle_is_valid(make, step, way):
    made = way(make(), step)
    flat, kappa = flat_triangles(made)
    round_ = kappa.prod(axis=1) > 0
    valid = np.where(round_, centre_is_inside(flat, kappa), corners_on_both_branches(flat, kappa))
    # On a parabolic curve itself there is no conic, and next to it no telling.
    told = np.abs(kappa).min(axis=1) > 0.01 * np.abs(kappa).max(axis=1)
    assert valid[told].all() and (made.margins() > 0)[told].all()
    assert told.sum() > 200
    if make is torus:  # elliptic and hyperbolic, and bands across the parabolic circles between
        assert 0.3 < round_.mean() < 0.7


@pytest.mark.parametrize("way", WAYS)
def test_the_mesh_is_regular_and_on_the_surface(way):
    made = way(sphere_cap(), 400.0)
    assert np.abs(np.linalg.norm(made.points, axis=1) - 5000.0).max() < 1e-8
    assert np.abs(made.surface.point(made.parameters) - made.points).max() < 1e-9
    # The triangles are oriented about the normal, and each directed edge is there once.
    a, b, c = (made.points[made.triangles[:, k]] for k in range(3))
    normals = made.surface.normal(made.parameters)[made.triangles[:, 0]]
    assert ((np.cross(b - a, c - a) * normals).sum(1) > 0).all()
    tail, head = made.triangles.ravel(), np.roll(made.triangles, -1, axis=1).ravel()
    pairs = tail * len(made.points) + head
    assert len(np.unique(pairs)) == len(pairs)
    degree = np.bincount(tail)
    on_border = np.zeros(len(made.points), bool)
    lone = ~np.isin(head * len(made.points) + tail, pairs)
    on_border[tail[lone]] = on_border[head[lone]] = True
    assert (degree[~on_border] == 6).all() and (~on_border).sum() > 100
    # Neighbours are neighbours of the lattice.
    rows, columns = made.rows[head] - made.rows[tail], made.columns[head] - made.columns[tail]
    steps = {(0, 1), (0, -1), (1, 0), (1, -1), (-1, 0), (-1, 1)}
    assert set(zip(rows.tolist(), columns.tolist(), strict=True)) <= steps


def test_progressive_triangles_are_nearly_ideal():
    for make, step in ((sphere_cap, 300.0), (hypar, 300.0)):
        margins = progressive_conjugation(make(), step, layers=(4, 4)).margins()
        assert abs(np.median(margins) - 1) < 0.05


def test_prescribed_rows_are_followed():
    surface = torus()

    def parallels(points, bending):
        lines = np.stack([-points[:, 1], points[:, 0], 0 * points[:, 0]], axis=1)
        return lines / np.linalg.norm(lines, axis=1, keepdims=True)

    made = prespecified_conjugation(surface, 900.0, rows=parallels, layers=(6, 6))
    for row in np.unique(made.rows):
        x = made.points[made.rows == row]
        assert np.ptp(x[:, 2]) < 1.0  # mm: a parallel
    count = np.bincount(made.rows - made.rows.min())
    assert (count == count[0]).all() and len(count) == 13


def test_conjugates_are_conjugate_and_on_the_left():
    surface = bumpy_roof()
    bending = surface.bending(surface.seeds(500))
    angle = np.random.default_rng(1).uniform(0, 2 * np.pi, len(bending.normals))
    rows = bending.lifted(np.stack([np.cos(angle), np.sin(angle)], axis=1))
    across = conjugate(rows, bending)
    size = np.abs(bending.kappa).max(axis=1)
    clear = np.abs(bending.form(rows, rows)) > 0.7 * size
    # The guard of 0.1 against asymptotic rows costs at most (0.1 / 0.7)².
    assert (np.abs(bending.form(rows, across)) / size)[clear].max() < 0.0205
    assert ((np.cross(rows, across) * bending.normals).sum(1) > 0).all()


def test_rows_are_flat_on_parabolic_curves():
    surface = torus()
    field = smooth_rows(surface)
    u = np.stack([np.linspace(0, 6, 40), np.full(40, np.pi / 2)], axis=1)
    bending = surface.bending(u)
    along = field(surface.point(u), bending)
    assert np.abs((along * flat_directions(bending)).sum(1)).min() > 0.995


@pytest.mark.parametrize("way", WAYS)
def test_layers_stop_before_they_fold(way):
    made = way(monkey_saddle(), 400.0)  # rows of a line field of index −1/2 cannot cover it
    corner = made.points[made.triangles]
    plan = corner[..., :2]
    one, two = plan[:, 1] - plan[:, 0], plan[:, 2] - plan[:, 0]
    area = 0.5 * (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])
    assert (area > 0).all()
    # No place is covered twice: random places of the plan lie in one triangle at most.
    place = np.random.default_rng(2).uniform(-3000, 3000, (400, 1, 1, 2))
    ahead = np.roll(plan, -1, axis=1) - plan
    gap = place - plan
    within = (ahead[..., 0] * gap[..., 1] - ahead[..., 1] * gap[..., 0] > 0).all(axis=2)
    assert within.sum(axis=1).max() == 1


def test_what_cannot_be_is_named():
    with pytest.raises(LatticeError, match="step = -1"):
        progressive_conjugation(hypar(), -1)
    with pytest.raises(LatticeError, match="take a smaller step"):
        prespecified_conjugation(hypar(), 5000.0)
    with pytest.raises(LatticeError, match="is not inside"):
        progressive_conjugation(hypar(), 300.0, start=(9000.0, 0.0))
    with pytest.raises(LatticeError, match="toward is zero"):
        smooth_rows(hypar(), toward=(0, 0, 0))


def test_a_mesh_is_triangulated_too():
    from dupin_samples import triangles_of

    surface = mesh_surface(triangles_of(hypar(), 25, 21), name="mesh of a hypar")
    made = prespecified_conjugation(surface, 500.0, layers=(3, 3))
    assert (made.margins() > 0).all() and len(made.triangles) > 60
    x, y, z = made.points.T
    assert np.abs(z - x * y / 5000.0).max() < 0.5

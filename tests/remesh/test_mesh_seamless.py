"""Seamless coordinates on meshes: umbilics found, seams closed exactly, distortion small."""

from itertools import product

import numpy as np
import pytest
from mesh_samples import catenoid, disc, enneper, many_umbilics, sampled, schwarz_p

from phexfab.errors import LatticeError, MeshError
from phexfab.remesh.mesh_lattices.line_field import line_field
from phexfab.remesh.mesh_lattices.poisson import lattice_basis
from phexfab.remesh.mesh_lattices.seamless import folds, jacobians, seamless
from phexfab.remesh.mesh_lattices.umbilics import lattice_step, with_umbilics
from phexfab.remesh.seamless.integers import nearest_points, null_space, reduced_basis

THREE = (0.5, -0.35 + 0.3j, -0.2 - 0.5j)


def test_null_space_holds_every_whole_solution():
    rows = np.array([[2, 1, 0, -1], [0, 2, -2, 4]], dtype=object)
    basis = null_space(rows, 4)
    assert basis.shape == (4, 2)
    assert not np.any(rows.astype(int) @ basis)
    inverse = np.linalg.pinv(basis.astype(float))
    for x in product(range(-4, 5), repeat=4):
        if not np.any(rows.astype(int) @ np.array(x)):
            k = inverse @ np.array(x)
            assert np.allclose(k, np.rint(k), atol=1e-9)


def test_null_space_without_relations_is_everything():
    assert np.array_equal(null_space(np.zeros((0, 3), dtype=object), 3), np.eye(3))
    assert null_space(np.zeros((0, 0), dtype=object), 0).shape == (0, 0)


def test_reduced_basis_is_unimodular_and_short():
    rng = np.random.default_rng(5)
    skew = np.eye(6) + np.triu(rng.integers(-9, 10, (6, 6)), 1)
    gram = skew.T @ np.diag(rng.uniform(1, 2, 6)) @ skew
    change = reduced_basis(gram)
    assert abs(abs(np.linalg.det(change)) - 1) < 1e-9
    # The lattice has a basis with squares between 1 and 2; LLL's are within its known factor.
    assert np.diag(change.T @ gram @ change).max() < 2 * 2 ** (6 - 1)


def test_nearest_points_are_near():
    rng = np.random.default_rng(2)
    low = np.linalg.cholesky(np.eye(3) + 0.3 * np.ones((3, 3))).T
    grid = np.array(list(product(range(-4, 5), repeat=3)))
    goals = low @ rng.uniform(-2, 2, (3, 40))
    found = nearest_points(low, goals)
    ratios = []
    for x, goal in zip(found.T, goals.T, strict=True):
        away = np.linalg.norm(low @ x - goal)
        # Babai: within half the box that the orthogonalised basis spans.
        assert away <= np.linalg.norm(np.diag(low)) / 2 + 1e-12
        # Descent: no change of one coordinate helps.
        for move in (*np.eye(3), *-np.eye(3)):
            assert np.linalg.norm(low @ (x + move) - goal) >= away - 1e-12
        ratios.append(away / np.linalg.norm(grid @ low.T - goal, axis=1).min())
    assert np.mean(np.array(ratios) < 1 + 1e-9) > 0.8
    assert nearest_points(np.zeros((0, 0)), np.zeros((0, 4))).shape == (0, 4)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_ennepers_umbilic_has_its_order(order):
    sample = enneper(order, rings=14, centre=0.013 + 0.007j)
    found = with_umbilics(line_field(*sample.arrays), 1.0)
    assert found.orders.tolist() == [order - 1] * (order > 1)
    mesh_size = float(np.median(found.lengths))
    for v in found.cones:
        truth = sample.surface.point(np.zeros(1))[0]
        assert np.linalg.norm(found.points[v] - truth) < 0.2 * mesh_size


def test_simple_umbilics_lie_where_they_are():
    sample = many_umbilics(THREE, rings=30)
    found = with_umbilics(line_field(*sample.arrays), 0.1)
    truth = sample.surface.point(np.array(THREE))
    away = np.linalg.norm(found.points[found.cones][:, None] - truth, axis=2).min(axis=1)
    assert found.orders.tolist() == [1, 1, 1]
    assert away.max() < 0.05 * np.median(found.lengths)


def test_near_umbilics_become_one_of_the_summed_order():
    sample = many_umbilics([0.2, 0.24], rings=30)
    field = line_field(*sample.arrays)
    assert with_umbilics(field, 0.5).orders.tolist() == [2]
    assert with_umbilics(field, 0.002).orders.tolist() == [1, 1]


def test_schwarz_p_has_eight_umbilics_per_cell():
    found = with_umbilics(line_field(*schwarz_p(6, (2, 1, 1)).arrays), 0.1)
    assert found.orders.tolist() == [1] * 16


@pytest.mark.parametrize(
    "sample, size",
    [
        (catenoid(), 200.0),
        (many_umbilics(THREE, rings=30), 40.0),
        (schwarz_p(8), 60.0),
        (schwarz_p(6, (2, 2, 1)), 80.0),
    ],
    ids=["annulus", "three umbilics", "cell", "ring of cells"],
)
@pytest.mark.parametrize("rows_along", ["u", "v"])
def test_seams_close_exactly(sample, size, rows_along):
    on = seamless(*sample.arrays, panel_size=size, rows_along=rows_along)
    half, x = on.field.half, on.corners.reshape(-1, 2)
    inner = np.flatnonzero(half.twin >= 0)
    twin = half.twin[inner]
    after = inner // 3 * 3 + (inner + 1) % 3
    beyond = twin // 3 * 3 + (twin + 1) % 3
    flip = on.flip[inner, None]
    # Not one unit in the last place: whole numbers.
    assert np.array_equal(x[beyond], flip * x[inner] + on.shift[inner])
    assert np.array_equal(x[twin], flip * x[after] + on.shift[inner])
    assert not np.any(on.shift % on.unit)
    assert not np.any(on.corners[on.field.is_cone[on.field.triangles]] % on.unit)
    assert not len(folds(on))
    asked = lattice_step(line_field(*sample.arrays), size, on.row_ratio)
    assert abs(np.log(on.step / asked)) < 0.15


def test_steps_are_the_surfaces_own_coordinates():
    # Order-2 Enneper: w is z^1.5 up to a factor, known in closed form.
    error = []
    for rings in (12, 24):
        sample = enneper(2, rings=rings, scale=1.0)
        field = with_umbilics(line_field(*sample.arrays), 0.1)
        # Triangles as given, an umbilic at no corner.
        same = (field.triangles[: len(sample.triangles)] == sample.triangles).all(axis=1)
        keep = np.flatnonzero(same & ~field.is_cone[sample.triangles].any(axis=1))
        tri = field.triangles[keep]
        z = sample.z[tri]
        middle = z.mean(axis=1, keepdims=True)
        factor = np.sqrt(sample.surface.hopf(middle) / middle)
        w = 2 / 3 * factor * middle**1.5 * np.exp(1.5 * np.log(z / middle))
        truth = np.roll(w, -1, axis=1) - w
        found = field.steps[keep]
        off = np.minimum(np.abs(found - truth), np.abs(found + truth)).max()
        error.append(off * rings)  # relative to the length of a step
    assert error[1] < 0.35 * error[0]


def test_without_obstacles_w_itself_comes_back():
    strains = []
    for rings in (10, 20):
        on = seamless(*enneper(1, rings=rings).arrays, panel_size=150.0)
        strains.append(on.strain)
        assert np.abs(jacobians(on) - np.eye(2)).max() < 0.5 / rings**2
    assert strains[1] < 0.35 * strains[0]


def test_signs_of_directions_do_not_matter():
    sample = many_umbilics(THREE, rings=20)
    p, t, n, d, k = sample.arrays
    signs = np.random.default_rng(0).choice([-1.0, 1.0], len(p))
    one = seamless(p, t, n, d, k, panel_size=40.0)
    two = seamless(p, t, n, d * signs[:, None], k, panel_size=40.0)
    assert np.array_equal(one.corners, two.corners)


def test_only_sizes_count_not_units_or_place():
    sample = many_umbilics(THREE, rings=20)
    p, t, n, d, k = sample.arrays
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    one = seamless(p, t, n, d, k, panel_size=40.0)
    two = seamless(10 * p @ turn.T + 77, t, n @ turn.T, d @ turn.T, k / 10, panel_size=400.0)
    assert np.abs(one.corners - two.corners).max() < 1e-6 * one.unit
    assert two.step == pytest.approx(one.step * np.sqrt(10), rel=1e-6)


def test_the_edge_type_keeps_its_equilateral_rows():
    sample = many_umbilics(THREE, rings=20)
    on = seamless(*sample.arrays, panel_size=30.0, kind="edge")
    assert on.row_ratio == pytest.approx(np.sqrt(3) / 2, rel=1e-12)
    first, second = lattice_basis(on.step, on.row_ratio, "u")
    assert abs(second) == pytest.approx(abs(first), rel=1e-12)


def test_a_garbage_direction_at_an_exact_umbilic_does_no_harm():
    sample = enneper(2, rings=14)
    assert sample.curvatures.min() == 0
    d = sample.directions.copy()
    d[sample.curvatures.argmin()] = np.nan
    p, t, n, _, k = sample.arrays
    on = seamless(p, t, n, d, k, panel_size=100.0)
    assert on.field.orders.tolist() == [1]


def planar_arrays():
    z, t = disc(1.0, 4)
    p = np.column_stack([z.real, z.imag, 0 * z.real])
    n = np.broadcast_to([0.0, 0.0, 1.0], p.shape)
    d = np.broadcast_to([1.0, 0.0, 0.0], p.shape)
    return p, t, n, d, np.ones(len(p))


def test_refusals_name_what_is_wrong():
    p, t, n, d, k = planar_arrays()
    with pytest.raises(LatticeError, match="plane"):
        seamless(p, t, n, d, 0 * k, panel_size=0.2)
    with pytest.raises(LatticeError, match="panel size is -1"):
        seamless(p, t, n, d, k, panel_size=-1.0)
    with pytest.raises(LatticeError, match="rows_along = 'w'"):
        seamless(p, t, n, d, k, panel_size=0.2, rows_along="w")
    with pytest.raises(MeshError, match="turned against the normals"):
        seamless(p, t, -n, d, k, panel_size=0.2)
    with pytest.raises(MeshError, match=r"vertex 3 .* not a number"):
        broken = k.copy()
        broken[3] = np.nan
        seamless(p, t, n, d, broken, panel_size=0.2)
    with pytest.raises(MeshError, match="must all be"):
        seamless(p, t, n[:-1], d, k, panel_size=0.2)
    with pytest.raises(MeshError, match="several pieces"):
        two = np.concatenate([t, t + len(p)])
        seamless(
            np.concatenate([p, p + 5]),
            two,
            *(np.concatenate([a, a]) for a in (n, d)),
            np.concatenate([k, k]),
            panel_size=0.2,
        )
    with pytest.raises(MeshError, match="oriented manifold"):
        seamless(p, np.concatenate([t, t[:1]]), n, d, k, panel_size=0.2)
    with pytest.raises(MeshError, match="wind by"):
        around = np.column_stack([np.cos(p[:, 0]), np.sin(p[:, 0]), 0 * p[:, 0]])
        angle = 0.5 * np.angle(p[:, 0] - 0.05 + 1j * (p[:, 1] - 0.03))
        around = np.column_stack([np.cos(angle), np.sin(angle), 0 * angle])
        seamless(p, t, n, around, k, panel_size=0.2)


def test_umbilics_nearer_than_a_panel_are_refused_with_the_size_that_would_do():
    sample = many_umbilics(0.3 * np.exp(2j * np.pi * (np.arange(5) / 5 + 0.05)), rings=30)
    with pytest.raises(LatticeError, match=r"between the umbilics .* mm or .* steps .* would do"):
        seamless(*sample.arrays, panel_size=20.0)
    coarse = seamless(*sample.arrays, panel_size=60.0)
    assert coarse.field.orders.tolist() == [5]


def test_a_mirrored_sample_has_the_same_lattice_size():
    # Mirroring swaps the sides; with normals and triangles turned alike nothing else changes.
    p, t, n, d, k = enneper(2, rings=14).arrays
    mirror = np.array([1.0, -1.0, 1.0])
    one = seamless(p, t, n, d, k, panel_size=100.0)
    two = seamless(p * mirror, t[:, ::-1], n * mirror, d * mirror, k, panel_size=100.0)
    assert two.step == pytest.approx(one.step, rel=1e-9)


def test_sampled_data_is_what_it_claims():
    sample = sampled(enneper(1, rings=3).surface, *disc(0.4, 3))
    step = 1e-4 * sample.directions
    bent = []
    for side in (step, -step):
        z = sample.surface.closest_parameter(sample.points + side, sample.z)
        bent.append(sample.surface.normal(z))
    slope = np.einsum("ij,ij->i", bent[0] - bent[1], sample.directions) / 2e-4
    assert np.allclose(slope, sample.curvatures, rtol=1e-4)  # dN = −κ_u, and κ_u = −κ

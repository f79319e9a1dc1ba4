"""Conjugate nets against closed forms: confocal quadrics, meridians, the torus."""

import numpy as np
import pytest
from dupin_samples import bumpy_roof, graph, hypar, sphere_cap, torus
from scipy.spatial import cKDTree

from phexfab.errors import LatticeError
from phexfab.mesh.half_edges import border_loops
from phexfab.mesh.measures import edges, planarity
from phexfab.remesh.conjugate.base import base_curves, even
from phexfab.remesh.conjugate.fields import (
    conjugate_direction,
    field_family,
    level_family,
    principal_family,
)
from phexfab.remesh.conjugate.net import conjugate_net
from phexfab.surface.freeform.surface import Bending, implicit

AXES = np.array([6e3, 4e3, 3e3])


def dome():
    a, b, c = AXES
    return graph(lambda x, y: c * np.sqrt(1 - (x / a) ** 2 - (y / b) ** 2), 3800.0, 2400.0, "dome")


def across(p):
    return p[:, 0]


def net_of(surface, family, size, **options):
    base = base_curves(surface, family, size, **options)
    return conjugate_net(base, even(base, size, 1), even(base, size, 0))


def test_conjugate_directions_make_the_second_form_vanish():
    rng = np.random.default_rng(5)
    frames = np.linalg.qr(rng.normal(size=(200, 3, 3)))[0]
    frames[:, 1] *= np.sign(np.linalg.det(frames))[:, None]
    bending = Bending(frames[:, 2], rng.normal(size=(200, 2)), frames[:, :2])
    a = bending.lifted(rng.normal(size=(200, 2)))
    b = conjugate_direction(bending, a)
    form = np.einsum("ki,kij,kj->k", a, bending.operator, b)
    assert np.abs(form).max() < 1e-13
    assert np.abs((b * frames[:, 2]).sum(1)).max() < 1e-14
    assert np.allclose(np.linalg.norm(b, axis=1), 1.0)


def test_across_a_flat_direction_is_the_other_principal_one():
    bending = Bending(np.eye(3)[[2]], np.array([[0.0, -1e-3]]), np.eye(3)[None, :2])
    assert np.allclose(np.abs(conjugate_direction(bending, [[1.0, 0, 0]])), [[0, 1, 0]])


def test_principal_curves_of_an_ellipsoid_lie_on_confocal_quadrics():
    net = net_of(dome(), principal_family(), 400.0)
    x = net.points[net.there]
    squares = AXES**2
    # Roots λ of Σ x²/(a² − λ) = 1 besides 0: x lies on two more quadrics with the same foci.
    poly = np.zeros((len(x), 4))
    for k in range(3):
        others = np.delete(squares, k)
        poly[:, 1:] += x[:, [k]] ** 2 * np.array([1.0, -others.sum(), others.prod()])
    poly += np.poly(squares) * np.array([1.0])
    roots = np.sort([np.roots(row).real for row in poly], axis=1)
    assert np.abs(roots[:, 0]).max() < 1e-4 * squares.min()
    spread = []
    for which in (1, 2):
        grid = np.full(net.there.shape, np.nan)
        grid[net.there] = roots[:, which]
        spread.append([np.ma.masked_invalid(grid).std(axis=k).max() for k in (0, 1)])
    # One is constant on rows, the other on columns; each varies across by far more.
    spread = np.array(spread) / np.ptp(squares)
    assert np.sort(spread.min(axis=1))[-1] < 1e-6
    assert spread.max(axis=1).min() > 1e-2
    assert {int(k) for k in spread.argmin(axis=1)} == {0, 1}


def test_planes_cut_a_sphere_along_rows_and_meridians_are_columns():
    net = net_of(sphere_cap(), level_family(across), 400.0)
    x = np.where(net.there[..., None], net.points, np.nan)
    assert np.nanmax(np.ptp(x[..., 0], axis=1)) < 1e-4
    angle = np.arctan2(x[..., 1], x[..., 2])
    assert np.nanmax(np.nanmax(angle, axis=0) - np.nanmin(angle, axis=0)) < 1e-7
    assert np.nanmax(net.conjugacy()) < 1e-12


def test_quads_are_planar_to_second_order_only_along_conjugate_curves():
    roof = bumpy_roof()
    off = []
    for size in (800.0, 400.0):
        quads = net_of(roof, level_family(across), size).quads()
        off.append(planarity(quads).max() / size)
    assert off[0] > 3 * off[1]  # h² over the edge; of any other curves it is h
    assert off[1] < 1e-3


def test_a_torus_closes_both_ways():
    net = net_of(torus(), principal_family(), 900.0)
    quads = net.quads()
    assert net.closed == (True, True)
    assert net.there.all()
    assert not border_loops(quads)
    assert len(quads.vertices) - len(edges(quads)) + quads.n_faces == 0
    shape = net.there.shape
    assert sorted(shape)[0] == pytest.approx(2 * np.pi * 2000 / 900, abs=1)


def test_the_whole_domain_is_covered_up_to_its_border():
    cap = sphere_cap()
    net = net_of(cap, field_family([1.0, 0.0, 0.0]), 500.0)
    reach = np.abs(net.parameters[net.there]).max(axis=0)
    assert reach[1] > 2490 or reach[0] > 2990


def test_implicit_surfaces_have_nets_too():
    ball = implicit(
        lambda p: (p**2).sum(1) - 9e6,
        lambda p: 2 * p,
        lambda p: np.broadcast_to(2 * np.eye(3), (len(p), 3, 3)),
        box=((-4e3, -4e3, 1500.0), (4e3, 4e3, 4e3)),
        name="ball",
    )
    net = net_of(ball, level_family(across), 500.0, seed=[100.0, 50.0, 3000.0])
    assert net.there.sum() > 30
    x = np.where(net.there[..., None], net.points, np.nan)
    assert np.nanmax(np.abs(np.linalg.norm(x, axis=-1) - 3000.0)) < 1e-6
    assert np.ma.masked_invalid(x[..., 0]).ptp(axis=1).max() < 1e-3


def test_undefined_families_are_named_with_their_place():
    with pytest.raises(LatticeError, match=r"cap.*umbilic"):
        base_curves(sphere_cap(), principal_family(), 400.0)
    with pytest.raises(LatticeError, match=r"hypar.*meet at less than 20 degrees"):
        base_curves(hypar(), level_family(across), 400.0)
    saddle = graph(lambda x, y: (x**3 - 3 * x * y * y) / 3e7, 3e3, 3e3, "monkey")
    with pytest.raises(LatticeError, match=r"monkey: at \[.*0\.0, .*0\.0.*seed the net elsewhere"):
        base_curves(saddle, principal_family(), 300.0, seed=[0.0, 0.0])
    with pytest.raises(LatticeError, match="spacing"):
        base_curves(hypar(), principal_family(), -1.0)
    with pytest.raises(LatticeError, match="which"):
        principal_family(2)
    with pytest.raises(LatticeError, match="not zero"):
        field_family([0.0, 0.0, 0.0])


def test_rows_beyond_the_base_curve_are_refused():
    base = base_curves(hypar(), principal_family(), 400.0)
    with pytest.raises(LatticeError, match="beyond the base curve"):
        conjugate_net(base, [0.0, 1e5], [0.0, 100.0])
    with pytest.raises(LatticeError, match="increasing"):
        conjugate_net(base, [0.0, -100.0], [0.0, 100.0])


def test_a_net_turned_is_the_net_traced_the_other_way():
    surface, family = hypar(), principal_family()
    one = net_of(surface, family, 600.0)
    base = base_curves(surface, family, 600.0, swapped=True)
    two = conjugate_net(base, even(base, 600.0, 1), even(base, 600.0, 0))
    turned = one.turned()
    assert turned.there.sum() == two.there.sum() == one.there.sum()
    assert (turned.there == one.there.T).all() and turned.closed == one.closed[::-1]
    # The same points, perhaps the other way round.
    points = turned.points[turned.there]
    assert cKDTree(points).query(two.points[two.there])[0].max() < 1e-6
    assert np.nanmax(turned.conjugacy()) < 1e-9
    assert turned.turned().base.fields.swapped == one.base.fields.swapped


def test_tangents_run_the_way_of_their_curves_all_over_a_net():
    net = net_of(dome(), principal_family(), 500.0)
    ahead = net.points[:, 1:] - net.points[:, :-1]
    up = net.points[1:] - net.points[:-1]
    there = net.there[:, 1:] & net.there[:, :-1]
    assert ((ahead * net.tangents[:, :-1, 0]).sum(-1)[there] > 0).all()
    there = net.there[1:] & net.there[:-1]
    assert ((up * net.tangents[:-1, :, 1]).sum(-1)[there] > 0).all()

"""Members of P(M) with a purpose: least squares, bounds on the edges, handles."""

from functools import cache

import numpy as np
import pytest

from phexfab.errors import MeshError
from phexfab.mesh.measures import corner_angles, edges
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.nearest import admissible_member, deform, nearest_member
from phexfab.parallel.pairs import ratios, worst_edge
from phexfab.parallel.space import parallel_space
from phexfab.surface.catalog import surface


@cache
def space(method="heights"):
    made = surface("enneper").scaled(1000.0)
    mesh = minimal_shell(made, lattice_on(made, 120.0), "edge").mesh
    return parallel_space(mesh, method=method)


def target(seed=0, size=40.0):
    mesh = space().mesh
    return mesh.vertices + size * np.random.default_rng(seed).standard_normal(mesh.vertices.shape)


def test_the_nearest_member_is_the_projection():
    wish = target()
    nearest = nearest_member(space(), wish)
    dense = space().fields.reshape(space().dimension, -1).T
    rest = (wish - space().mesh.vertices).ravel()
    best = np.linalg.lstsq(dense, rest, rcond=None)[0]
    expected = space().mesh.vertices + (dense @ best).reshape(-1, 3)
    assert np.abs(nearest.vertices - expected).max() < 1e-8
    other = nearest_member(space("directions"), wish)
    assert np.abs(nearest.vertices - other.vertices).max() < 1e-8


def test_a_member_is_nearest_to_itself():
    coordinates = 10 * np.random.default_rng(5).standard_normal(space().dimension)
    member = space().member(coordinates)
    assert np.abs(nearest_member(space(), member).vertices - member.vertices).max() < 1e-10


def test_weights_count():
    wish = target()
    weights = np.ones(len(wish))
    weights[7] = 1e6
    nearest = nearest_member(space().mesh, wish, weights)
    assert np.linalg.norm(nearest.vertices[7] - wish[7]) < 1e-2
    plain = nearest_member(space().mesh, wish)
    assert np.linalg.norm(plain.vertices[7] - wish[7]) > 1


@pytest.mark.parametrize("lower", [-0.5, 0.1, 0.6])
def test_no_edge_falls_below_its_bound_and_the_rest_is_optimal(lower):
    """Karush–Kuhn–Tucker: the gradient is a combination of the active bounds with signs ≥ 0."""
    wish, mesh = target(), space().mesh
    assert ratios(mesh, nearest_member(space(), wish)).min() < lower
    found = admissible_member(space(), wish, lower)
    ratio = ratios(mesh, found)
    assert ratio.min() > lower - 1e-9
    assert worst_edge(mesh, found)[0] < 1e-10
    active = np.flatnonzero(ratio < lower + 1e-7)
    assert len(active)
    dense = space("directions").basis.toarray()
    slope = dense.T @ (found.vertices - wish).ravel()
    across = space("directions").ratio_matrix[active].toarray().T
    push = np.linalg.lstsq(across, slope, rcond=None)[0]
    assert np.linalg.norm(slope - across @ push) < 1e-5 * np.linalg.norm(slope)
    assert push.min() > -1e-5 * np.abs(push).max()


def test_bounds_that_do_not_bind_change_nothing():
    wish = target(size=0.5)
    free, bound = nearest_member(space(), wish), admissible_member(space(), wish, 0.1)
    assert ratios(space().mesh, free).min() > 0.1
    assert np.abs(free.vertices - bound.vertices).max() < 1e-4


def test_handles_are_reached_and_panels_keep_their_angles():
    mesh = space().mesh
    held = np.array([0, 30, 60, len(mesh.vertices) - 1])
    wish = mesh.vertices[held] + [[0, 0, 0], [0, 0, 25], [10, 0, 0], [0, 0, 0]]
    moved = deform(space(), held, wish)
    assert moved.miss.max() < 1e-8
    assert worst_edge(mesh, moved.mesh)[0] < 1e-11
    assert moved.ratios.min() > 0
    assert corner_angles(moved.mesh) == pytest.approx(corner_angles(mesh), abs=1e-9)
    # Nothing that still reaches the targets has less change: the slope is spanned by the handles.
    rows = space("directions").basis[(3 * held[:, None] + np.arange(3)).ravel()].toarray().T
    change = space("directions").ratio_matrix
    slope = change.T @ (moved.ratios - 1)
    rest = slope - rows @ np.linalg.lstsq(rows, slope, rcond=None)[0]
    assert np.linalg.norm(rest) < 1e-6 * np.linalg.norm(slope)


def test_one_handle_only_moves_the_mesh():
    mesh = space().mesh
    moved = deform(mesh, [12], mesh.vertices[[12]] + [3.0, -4.0, 5.0])
    assert np.abs(moved.mesh.vertices - mesh.vertices - [3.0, -4.0, 5.0]).max() < 1e-6
    assert np.abs(moved.ratios - 1).max() < 1e-8


def test_handles_stop_at_the_bound():
    mesh = space().mesh
    i, j = edges(mesh)[60]
    here = mesh.vertices
    far = (np.array([0, 30]), here[[0, 30]] + [[0, 0, 0], [0, 0, 600]], True)
    # Both ends of an edge in one point: only an edge of ratio 0 gets there.
    shut = (np.array([i, j]), (here[[i, i]] + here[[j, j]]) / 2, False)
    for held, wish, reached in (far, shut):
        free = deform(space(), held, wish)
        bound = deform(space(), held, wish, lower=0.3)
        assert free.ratios.min() < 0.3 and free.miss.max() < 1e-6
        assert bound.ratios.min() > 0.3 - 1e-9
        assert worst_edge(mesh, bound.mesh)[0] < 1e-11
        assert (bound.miss.max() < 1e-3) == reached
    half = np.linalg.norm(here[j] - here[i]) / 2
    assert bound.miss == pytest.approx([0.3 * half, 0.3 * half], rel=1e-3)


def test_ratios_are_those_of_the_edges():
    mesh = space().mesh
    moved = deform(space(), [0, 30], mesh.vertices[[0, 30]] + [[0, 0, 0], [5, 5, 5]])
    pairs = edges(mesh)
    one, two = (m.vertices[pairs[:, 1]] - m.vertices[pairs[:, 0]] for m in (mesh, moved.mesh))
    assert two == pytest.approx(moved.ratios[:, None] * one, abs=1e-8)


def test_wrong_wishes_are_named():
    mesh = space().mesh
    with pytest.raises(MeshError, match="one target each"):
        deform(space(), [0, 1], mesh.vertices[:1])
    with pytest.raises(MeshError, match="does not exist"):
        deform(space(), [len(mesh.vertices)], mesh.vertices[:1])
    with pytest.raises(MeshError, match="take one below 1"):
        admissible_member(space(), mesh, 1.0)
    with pytest.raises(MeshError, match="one point for every vertex"):
        nearest_member(space(), mesh.vertices[:-1])

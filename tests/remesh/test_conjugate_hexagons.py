"""Hexagons along conjugate curves: the condition on sampling, planar and simple faces."""

import numpy as np
import pytest
from dupin_samples import bumpy_roof, graph, hypar, monkey_saddle, sphere_cap, torus

from phexfab.errors import LatticeError
from phexfab.mesh.half_edges import border_loops
from phexfab.mesh.measures import relative_planarity, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.conjugate.base import base_curves, even
from phexfab.remesh.conjugate.fields import field_family, level_family, principal_family
from phexfab.remesh.conjugate.hexagons import brick_layout, conjugate_hexagons, planar_hexagons
from phexfab.remesh.conjugate.sampling import crossing_number, sample


def across(p):
    return p[:, 0]


def dome():
    def height(x, y):
        return 3e3 * np.sqrt(1 - (x / 6e3) ** 2 - (y / 4e3) ** 2)

    return graph(height, 3800.0, 2400.0, "dome")


def outside():
    """A part of the torus, K > 0, as a graph over its axis' direction."""
    return graph(
        lambda x, y: np.sqrt((6e3 + np.sqrt(4e6 - y * y)) ** 2 - x * x), 3e3, 1200.0, "outside"
    )


def tangent_hexagon(ka, kb, alpha, beta, sigma):
    """Corners of a brick's hexagon where three tangent planes of z = (ka x² + kb y²)/2 meet."""
    form = np.diag([ka, kb])
    up = [np.array([sigma * alpha, beta]), np.array([(sigma - 1) * alpha, beta])]
    down = [v * [1, -1] for v in up]
    side = np.array([alpha, 0.0])
    pairs = [(-side, down[1]), (down[1], down[0]), (down[0], side), (side, up[0]), tuple(up)]
    pairs.append((up[1], -side))
    corner = []
    for p, q in pairs:
        # The planes there and at the middle: c·F x = c·F c / 2.
        corner.append(np.linalg.solve([form @ p, form @ q], [p @ form @ p / 2, q @ form @ q / 2]))
    return np.column_stack([np.array(corner), np.zeros(6)])


def test_the_crossing_number_tells_simple_hexagons():
    rng = np.random.default_rng(8)
    n = 400
    ka, kb = rng.normal(size=n), rng.normal(size=n)
    alpha, beta = rng.uniform(0.3, 3, size=(2, n))
    sigma = rng.uniform(0.15, 0.85, size=n)
    rings = np.array([tangent_hexagon(*v) for v in zip(ka, kb, alpha, beta, sigma, strict=True)])
    mesh = PolyMesh(rings.reshape(-1, 3), np.arange(6 * n), np.arange(0, 6 * n + 1, 6))
    q = np.array([crossing_number(*v) for v in zip(ka, kb, alpha, beta, sigma, strict=True)])
    assert (np.abs(q) < 1).sum() > 50
    assert (np.abs(q) > 1).sum() > 50
    assert np.array_equal(simple_faces(mesh), np.abs(q) < 1)


def test_regular_hexagons_have_a_third():
    ring = tangent_hexagon(1.0, 1.0, 1.0, np.sqrt(0.75), 0.5)
    side = np.linalg.norm(np.roll(ring, -1, axis=0) - ring, axis=1)
    assert np.ptp(side) < 1e-15
    assert crossing_number(1.0, 1.0, 1.0, np.sqrt(0.75), 0.5) == pytest.approx(1 / 3)


SURFACES = {
    "sphere cap": (sphere_cap(), level_family(across), 500.0, 100),
    "ellipsoid": (dome(), principal_family(), 500.0, 90),
    "torus outside": (outside(), principal_family(), 400.0, 60),
    "hyperbolic paraboloid": (hypar(), principal_family(), 450.0, 100),
    "monkey saddle": (monkey_saddle(), principal_family(), 350.0, 120),
    "roof": (bumpy_roof(), level_family(across), 700.0, 150),
}


@pytest.mark.parametrize("name", SURFACES)
def test_hexagons_are_planar_simple_and_near(name):
    surface, family, size, least = SURFACES[name]
    made = conjugate_hexagons(surface, family, size)
    mesh = made.mesh
    assert mesh.n_faces >= least
    assert (mesh.sides == 6).all()
    assert relative_planarity(mesh).max() < 1e-12
    assert simple_faces(mesh).all()
    assert np.bincount(mesh.corners).max() == 3
    assert made.sampling.most <= 0.75 * (1 + 1e-6)
    away = mesh.vertices - surface.point(surface.nearest(mesh.vertices))
    assert np.linalg.norm(away, axis=1).max() < 0.25 * size
    # To the order of the curvature the start is planar: hardly anything is left to move.
    assert np.median(made.planarised.moved) < 0.02 * size


def test_a_torus_closes_with_three_faces_at_every_vertex():
    made = conjugate_hexagons(torus(), principal_family(), 1300.0)
    mesh = made.mesh
    assert not border_loops(mesh)
    assert len(mesh.vertices) == 2 * mesh.n_faces
    assert relative_planarity(mesh).max() < 1e-12
    assert simple_faces(mesh).all()
    assert made.bricks.crossing_numbers.min() < 0 < made.bricks.crossing_numbers.max()


def test_bricks_at_the_points_of_the_net_become_planar_too():
    made = conjugate_hexagons(sphere_cap(), level_family(across), 600.0, start="brick")
    assert relative_planarity(made.mesh).max() < 1e-12
    assert simple_faces(made.mesh).all()
    tangent = conjugate_hexagons(sphere_cap(), level_family(across), 600.0)
    before = [m.planarised.report.planarity_before for m in (tangent, made)]
    assert before[0] < 0.05 * before[1]


def test_rows_run_along_the_flat_direction_of_a_cylinder():
    vault = graph(lambda x, y: np.sqrt(1.6e7 - y * y), 3000.0, 2500.0, "vault")
    along = field_family([1.0, 0.0, 0.0])
    with pytest.raises(LatticeError, match=r"vault: at \[.*would cross themselves.*other family"):
        conjugate_hexagons(vault, along, 500.0, rows="conjugate")
    made = conjugate_hexagons(vault, along, 500.0)
    assert not made.sampling.base.fields.swapped
    assert np.abs(made.bricks.crossing_numbers).max() < 1e-6
    assert simple_faces(made.mesh).all()
    assert relative_planarity(made.mesh).max() < 1e-12


def test_the_shift_is_less_where_spacing_alone_does_not_do():
    # κ_a / κ_b = 5: lengths and heights by a factor 1.1 leave q = 5/4/1.1⁴ = 0.85 at shift 1/2.
    bowl = graph(lambda x, y: (5 * x * x + y * y) / 4e5, 900.0, 900.0, "bowl")
    base = base_curves(bowl, field_family([1.0, 0, 0]), 100.0)
    chosen = sample(base, 100.0, longest=1.1, limit=0.74)
    assert chosen.shift < 0.5
    assert chosen.most <= 0.74 * (1 + 1e-6)
    with pytest.raises(LatticeError, match="do not help"):
        sample(base, 100.0, longest=1.1, limit=0.74, shift=0.5)


def test_rows_too_close_cross_and_are_named_dropped_or_kept():
    cap = sphere_cap()
    base = base_curves(cap, level_family(across), 500.0)
    bricks = brick_layout(base, even(base, 200.0, 1), even(base, 700.0, 0))
    assert bricks.crossing_numbers.min() > 1
    with pytest.raises(LatticeError, match=r"cap: \d+ of \d+ faces cross.*face \d+ at \[.*q = "):
        planar_hexagons(bricks)
    kept = planar_hexagons(bricks, crossing="keep")
    assert len(kept.crossing)
    assert np.array_equal(kept.crossing, np.flatnonzero(~simple_faces(kept.mesh)))


def test_options_are_checked():
    cap, family = sphere_cap(), level_family(across)
    for option, text in (
        ({"rows": "both"}, "rows"),
        ({"crossing": "hide"}, "crossing"),
        ({"start": "no"}, "start"),
        ({"limit": 1.2}, "limit"),
        ({"shift": 0.0}, "shift"),
    ):
        with pytest.raises(LatticeError, match=text):
            conjugate_hexagons(cap, family, 900.0, **option)


def test_crossing_faces_are_named_kept_or_left_out():
    base = base_curves(hypar(), principal_family(), 450.0)
    rows, columns = even(base, 450.0, 1), even(base, 450.0, 0)
    good = brick_layout(base, rows, columns)
    # Rows so near to each other, in a strip of the net, that |q| is far above 1 there.
    tight = np.sort(np.concatenate([rows, rows[:1] + 60.0 * np.arange(1, 4)]))
    bricks = brick_layout(base, tight, columns)
    crossing = np.abs(bricks.crossing_numbers) > 1.2
    assert crossing.any() and not (np.abs(good.crossing_numbers) > 1).any()
    with pytest.raises(LatticeError, match=r"faces cross themselves .*, first face .* with q = "):
        planar_hexagons(bricks)
    kept = planar_hexagons(bricks, crossing="keep")
    assert np.array_equal(np.flatnonzero(~simple_faces(kept.mesh)), kept.crossing)
    assert len(kept.crossing) and kept.mesh.n_faces == bricks.mesh.n_faces
    made = planar_hexagons(bricks, crossing="drop")
    assert simple_faces(made.mesh).all() and not len(made.crossing)
    assert relative_planarity(made.mesh).max() < 1e-12
    assert np.intersect1d(kept.crossing, made.dropped).size == len(kept.crossing)
    both = np.sort(np.concatenate([made.faces, made.dropped]))
    assert np.array_equal(both, np.arange(bricks.mesh.n_faces))
    with pytest.raises(LatticeError, match='crossing = "no"'):
        planar_hexagons(bricks, crossing="no")

"""Circle packings and patterns: angle sums, contacts, known exact solutions."""

import numpy as np
import pytest
from cone_samples import cone_lattice, without

from phexfab.errors import MeshError, SolveError
from phexfab.minimal.circles import CircleLaw, cone_targets, solve_radii
from phexfab.minimal.gauss_image import lattice_pattern
from phexfab.minimal.layout import border_cycles, lay_out
from phexfab.parallel.rings import border_loops, face_rings
from phexfab.remesh.lattice import lattice

LATTICE = lattice((-1, 1, -0.8, 0.8), 0.2)
PANELS = face_rings(LATTICE.triangles, len(LATTICE.points))[0]


def law_of(kind, made=LATTICE):
    if kind == "packing":
        return CircleLaw(made.triangles)
    return CircleLaw(made.triangles, lattice_pattern(made)[0])


@pytest.mark.parametrize("kind", ["packing", "pattern"])
def test_weights_are_the_derivatives_of_the_angles(kind):
    law = law_of(kind)
    rng = np.random.default_rng(1)
    logs = rng.normal(scale=0.2, size=len(LATTICE.points))
    _, weight = law.angles(logs)
    t = 17
    h = 1e-6
    for k in range(3):
        other = law.triangles[t, (k + 1) % 3]
        up, down = logs.copy(), logs.copy()
        up[other] += h
        down[other] -= h
        slope = (law.angles(up)[0][t, k] - law.angles(down)[0][t, k]) / (2 * h)
        assert slope == pytest.approx(weight[t, k], rel=1e-8)


@pytest.mark.parametrize("kind", ["packing", "pattern"])
def test_triangle_angles_sum_to_pi(kind):
    rng = np.random.default_rng(2)
    angle, _ = law_of(kind).angles(rng.normal(scale=0.4, size=len(LATTICE.points)))
    assert np.allclose(angle.sum(axis=1), np.pi, atol=1e-13)


@pytest.mark.parametrize("kind", ["packing", "pattern"])
def test_random_borders_give_a_layout_that_closes(kind):
    rng = np.random.default_rng(3)
    logs = rng.normal(scale=0.3, size=len(LATTICE.points))
    law = law_of(kind)
    solved = solve_radii(law, logs)
    border = np.setdiff1d(np.arange(len(logs)), PANELS)
    assert np.array_equal(solved[border], logs[border])
    centre, gap = lay_out(law, solved)
    assert gap < 1e-12
    # Measured in the plane, not through the law: contacts, or the common point of three circles.
    r = np.exp(solved)
    t = law.triangles
    if kind == "packing":
        for a, b in ((0, 1), (1, 2), (2, 0)):
            distance = np.abs(centre[t[:, a]] - centre[t[:, b]])
            assert np.allclose(distance, r[t[:, a]] + r[t[:, b]], rtol=1e-11)
    else:
        point = radical_centres(centre[t], r[t])
        for k in range(3):
            assert np.allclose(np.abs(point - centre[t[:, k]]), r[t[:, k]], rtol=1e-10)


def radical_centres(c, r):
    power = np.abs(c) ** 2 - r**2
    a = np.stack([(c[:, 1:] - c[:, :1]).real, (c[:, 1:] - c[:, :1]).imag], axis=-1) * 2
    x = np.linalg.solve(a, (power[:, 1:] - power[:, :1])[..., None])[..., 0]
    return x[:, 0] + 1j * x[:, 1]


@pytest.mark.parametrize("kind", ["packing", "pattern"])
def test_doyle_spirals_are_exact(kind):
    """Radii e^{Re(cw)} solve both laws for every complex c (thesis §7.2.1, case 3)."""
    logs = ((0.7 - 0.4j) * LATTICE.points).real
    law = law_of(kind)
    angle, _ = law.angles(logs)
    sums = np.bincount(law.triangles.ravel(), angle.ravel(), minlength=len(logs))
    assert np.allclose(sums[PANELS], 2 * np.pi, atol=1e-13)
    start = logs.copy()
    start[PANELS] += 0.3 * np.sin(np.arange(len(PANELS)))
    assert np.allclose(solve_radii(law, start), logs, atol=1e-12)


@pytest.mark.parametrize("kind", ["packing", "pattern"])
def test_a_ring_closes_around_its_hole(kind):
    made = lattice((-1, 1, 0, 1), 0.25, rows_along="v", period=2j * np.pi)
    law = law_of(kind, made)
    panels = face_rings(made.triangles, len(made.points))[0]
    loops = border_loops(made.triangles, panels, len(made.points))
    inner = min(loops, key=lambda loop: made.points[loop].real.mean())
    logs = made.points.real + np.log(made.step / 2)
    solved = solve_radii(law, logs, holes=(inner,))
    assert lay_out(law, solved)[1] < 1e-11
    # Rotational symmetry makes it a spiral: log-radii linear in u.
    rise = np.polyfit(made.points.real, solved, 1)
    assert np.allclose(np.polyval(rise, made.points.real), solved, atol=1e-11)


def test_pieces_are_refused():
    two = np.vstack([LATTICE.triangles, LATTICE.triangles + len(LATTICE.points)])
    with pytest.raises(MeshError, match="several pieces"):
        lay_out(CircleLaw(two), np.zeros(2 * len(LATTICE.points)))


@pytest.mark.parametrize("kind", ["packing", "pattern"])
@pytest.mark.parametrize("order", [2, 3, 5])
def test_branched_packings_touch_on_every_sheet(kind, order):
    """Random borders around a branch circle that winds as often as its lattice asks."""
    made = cone_lattice(order, 5, 1.0)
    law = law_of(kind, made)
    targets = cone_targets(made.triangles, len(made.points))
    assert targets[0] == 2 * np.pi * order and (targets[1:] == 2 * np.pi).all()
    logs = np.random.default_rng(order).normal(scale=0.3, size=len(made.points))
    solved = solve_radii(law, logs, targets=targets)
    centre, gap = lay_out(law, solved)
    assert gap < 1e-12
    # The neighbours of circle 0 wind about it: summed in the plane, not through the law.
    t, angle = made.triangles, 0.0
    for a, b, c in zip(*t.T, strict=True):
        while 0 in (b, c):
            a, b, c = b, c, a
        if a == 0:
            angle += np.angle((centre[c] - centre[a]) / (centre[b] - centre[a]))
    assert angle == pytest.approx(2 * np.pi * order, abs=1e-11)
    r = np.exp(solved)
    distance = np.abs(centre[t] - centre[t[:, [1, 2, 0]]])
    a, b = r[t], r[t[:, [1, 2, 0]]]
    cosine = 1.0 if kind == "packing" else np.cos(law.crossing)
    assert np.allclose(distance**2, a * a + b * b + 2 * a * b * cosine, rtol=1e-11)


def test_rings_that_no_umbilic_has_are_refused():
    fan = np.array([[0, k + 1, (k + 1) % 7 + 1] for k in range(7)])
    with pytest.raises(SolveError, match="face 0 of the lattice has 7 neighbours"):
        cone_targets(fan, 8)


def test_borders_are_walked_with_the_surface_on_the_left():
    made = cone_lattice(1, 8, 1.0)
    made = without(made, np.abs(made.points - 0.2) < 0.25)
    cycles = border_cycles(made.triangles, len(made.points))
    assert len(cycles) == 2
    tail = made.triangles.ravel()
    areas = []
    for cycle in cycles:
        z = made.points[tail[cycle]]
        areas.append((z.conj() * np.roll(z, -1)).imag.sum() / 2)
        onward = made.triangles[:, [1, 2, 0]].ravel()[cycle]
        assert np.array_equal(onward, np.roll(tail[cycle], -1))
    assert max(areas) > 0 > min(areas) and max(areas) > -3 * min(areas)

"""Spacing functions of rectangles: more even panels, still exact, inside the asymptotic limit."""

import numpy as np
import pytest

from phexfab.errors import LatticeError
from phexfab.minimal.grading import RATIOS, grading
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.surface.catalog import catalog, surface
from phexfab.testing import assert_minimal, assert_planar, assert_simple


def panel_sizes(shell):
    """Mean distance of the contact points of neighbouring faces, for every panel."""
    panels, starts, _, neighbours = shell.rings
    owner = np.repeat(panels, np.diff(starts))
    far = np.linalg.norm(shell.points[owner] - shell.points[neighbours], axis=1)
    return np.add.reduceat(far, starts[:-1]) / np.diff(starts)


@pytest.mark.parametrize("along", ["u", "v"])
@pytest.mark.parametrize("name", list(catalog))
def test_graded_panels_are_more_even_and_exact(name, along):
    made = surface(name).scaled(1000.0)
    size = 70 * np.ptp(made.rectangle[:2])
    spreads, worst = [], []
    for evenness in (0.0, 0.5, 1.0):
        on = lattice_on(made, size, rows_along=along, evenness=evenness)
        shell = minimal_shell(made, on, "face")
        assert_planar(shell.mesh, 1e-12)
        assert_minimal(shell, 1e-10)
        assert_simple(shell.mesh)
        sizes = panel_sizes(shell)
        spreads.append(np.log(sizes).std())
        worst.append(sizes.max() / sizes.min())
        assert np.median(sizes) == pytest.approx(size, rel=0.15)
    # On these κ has ridges across both families: no functions of one coordinate can follow them.
    if name not in ("henneberg", "helicoid"):
        assert spreads[2] < spreads[1] < spreads[0] and spreads[2] < 0.8 * spreads[0]
        assert worst[2] < worst[1] < worst[0]
    assert worst[2] < 1.05 * worst[0]


def test_the_catenoid_is_evened_out_exactly():
    """κ = 1/cosh² u depends on one coordinate alone: its panels can be made all alike."""
    made = surface("catenoid").scaled(1000.0)
    box = (-0.6, 0.6, 0.0, 2.0)
    sizes = {
        e: panel_sizes(
            minimal_shell(made, lattice_on(made, 30.0, rectangle=box, evenness=e), "face")
        )
        for e in (0.0, 1.0)
    }
    assert np.ptp(sizes[0.0]) / np.median(sizes[0.0]) > 0.12
    assert np.ptp(sizes[1.0]) / np.median(sizes[1.0]) < 0.02


@pytest.mark.parametrize("along", ["u", "v"])
def test_spacing_keeps_the_ends_the_families_and_the_ratio(along):
    made = surface("scherk-2").scaled(1000.0)
    u0, u1, v0, v1 = made.rectangle
    u, v = np.linspace(u0, u1, 33), np.linspace(v0, v1, 33)
    w = u[None, :] + 1j * v[:, None]
    kappa = np.abs(made.principal_curvatures(made.parameter(w))[..., 0])
    found = grading(u, v, np.sqrt(made.scale / kappa), 1.0, row_ratio=0.866, rows_along=along)
    assert np.allclose(found.place(np.array([u0 + 1j * v0, u1 + 1j * v1])), [w[0, 0], w[-1, -1]])
    ratio = found.dv[:, None] / found.du[None, :]
    ratio = found.row_ratio * (ratio if along == "u" else 1 / ratio)
    assert RATIOS[0] - 1e-9 < ratio.min() and ratio.max() < RATIOS[1] + 1e-9
    # Derivatives are those of the functions: measured by differences.
    p = np.linspace(u0, u1, 401)[1:-1]
    h = 1e-5
    slope = (found.place(p + h + 0j) - found.place(p - h + 0j)).real / (2 * h)
    assert (slope > 0).all()
    assert np.allclose(slope, np.interp(p, found.p, found.du), rtol=0.02)


def test_no_evenness_is_the_plain_lattice_to_the_last_bit():
    made = surface("catalan").scaled(1000.0)
    plain, same = lattice_on(made, 150.0), lattice_on(made, 150.0, evenness=0.0)
    assert plain.points.tobytes() == same.points.tobytes() and plain.step == same.step


def test_a_ring_stays_even_around():
    made = surface("catenoid").scaled(1000.0)
    box = (-1.2, 1.2, 0.0, 2 * np.pi)
    on = lattice_on(made, 150.0, rectangle=box, rows_along="v", closed=True, evenness=1.0)
    around = np.unique(np.round(on.points.imag / (on.step / 2), 9))
    assert np.allclose(around, np.round(around), atol=1e-6)
    assert_minimal(minimal_shell(made, on, "face"), 1e-10)


@pytest.mark.parametrize("evenness", [-0.1, 1.5, float("nan")])
def test_a_share_outside_zero_to_one_is_refused(evenness):
    with pytest.raises(LatticeError, match=r"lattice\.evenness"):
        lattice_on(surface("enneper").scaled(1000.0), 150.0, evenness=evenness)


def test_a_turned_lattice_is_not_graded():
    with pytest.raises(LatticeError, match=r"lattice.turn = 4°"):
        lattice_on(surface("enneper").scaled(1000.0), 150.0, turn=4.0, evenness=0.5)

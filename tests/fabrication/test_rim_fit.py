"""Limits that a cut misses, measured before parts are: the checks of the parts are the judges."""

import numpy as np
import pytest

from phexfab.errors import PartError
from phexfab.fabrication.bars import BeamSpec, beam_drop
from phexfab.fabrication.beams import beams
from phexfab.fabrication.checks import Limits, check_geometry, check_parts
from phexfab.fabrication.panels import PanelSpec, largest_gaps, panels
from phexfab.fabrication.parts import Parts
from phexfab.fabrication.rim_fit import ROOMLESS, lack_cost, rim_lacks
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.border import Border
from phexfab.parallel.cut import cut_shell
from phexfab.parallel.offset import admissible_interval, edge_ratios
from phexfab.surface import surface

RIM = {"shortest_edge", "rim_beam_angle", "rim_corner", "rim_mitre", "rim_distance"}
PANEL, BEAM = PanelSpec(4.0, 6.0), BeamSpec(6.0, 40.0)
NOTHING = (1e-6, 1e-6)
HALVES = Limits(
    shortest_edge=24.0, rim_beam_angle=21.0, rim_corner=20.0, rim_mitre=79.5, rim_distance=28.0
)  # about half of the samples miss each
SAMPLES = [(turn, how) for turn in (0.0, 1.0, 2.5, 4.0) for how in ({}, {"shortest_edge": 25.0})]
FREE = Limits(
    shortest_edge=0, rim_beam_angle=0, rim_corner=0, rim_mitre=360, rim_distance=1e9,
    offset_interval=1e9,
)  # fmt: skip


def cut(turn=0.0, **how):
    """A round piece of Enneper's surface, the lattice turned against the rim's middle."""
    film = surface("enneper").scaled(5000.0)
    whole = minimal_shell(film, lattice_on(film, panel_size=500.0))
    w = 0.4 * np.exp(2j * np.pi * np.arange(400) / 400) + 0.03 * np.exp(1j * turn)
    z = film.parameter(w)
    made = cut_shell(whole, [Border(film.point(z), film.normal(z), [])], **how)
    return made.shell, made.report.rim_distance


@pytest.mark.parametrize(("turn", "how"), SAMPLES)
def test_what_is_missed_is_what_the_checks_of_the_parts_miss(turn, how):
    shell, off = cut(turn, **how)
    lacks = rim_lacks(shell, HALVES, PANEL, BEAM, NOTHING, off)
    parts = Parts(panels(shell, PANEL), beams(shell, BEAM, PANEL), ())
    checks = check_geometry(shell, HALVES, rim_distance=off) + check_parts(parts, shell, HALVES)
    failed = {check.name: check for check in checks if not check.ok}
    assert set(lacks) == set(failed) & RIM
    for name, lack in lacks.items():
        assert lack == pytest.approx(abs(np.log(failed[name].value / failed[name].limit)))


def test_the_samples_fail_and_pass():
    missed = []
    for turn, how in SAMPLES:
        shell, off = cut(turn, **how)
        missed.append(rim_lacks(shell, HALVES, PANEL, BEAM, NOTHING, off))
    for name in RIM:
        assert 0 < sum(name in one for one in missed) < len(missed), name


def ends(shell):
    return shell.mesh.vertices[shell.edges[:, 1]] - shell.mesh.vertices[shell.edges[:, 0]]


def test_room_that_is_missing():
    shell, _ = cut()
    low, high = admissible_interval(shell)
    assert not rim_lacks(shell, FREE, PANEL, None, (-0.99 * low, 0.99 * high))
    for depth in ((-1.01 * low, 0.0), (0.0, 1.01 * high)):
        assert set(rim_lacks(shell, FREE, PANEL, None, depth)) == {"depth"}
    most = largest_gaps(shell, PANEL).min()
    assert not rim_lacks(shell, FREE, PanelSpec(4.0, 0.99 * most), None, NOTHING)
    assert set(rim_lacks(shell, FREE, PanelSpec(4.0, 1.01 * most), None, NOTHING)) == {"gap"}
    wide = BeamSpec(400.0, 40.0)
    with pytest.raises(PartError):
        beams(shell, wide, PANEL)
    assert set(rim_lacks(shell, FREE, PANEL, wide, NOTHING)) == {"bars"}


def test_missing_room_is_worst_then_how_many_then_how_far():
    ranked = [{}, {"rim_corner": 0.1}, {"rim_corner": 0.2}, {"a": 0.01, "b": 0.01}, {"gap": 1e-9}]
    costs = [lack_cost(one) for one in ranked]
    assert costs == sorted(costs) and len(set(costs)) == len(costs)


# -- edges at which no part can end ----------------------------------------------------------------


def collapsed():
    """A shell offset to where one of its edges vanishes."""
    shell, _ = cut()
    ratios = edge_ratios(shell)
    at = float(ratios[np.argmin(np.where(ratios > 0, ratios, np.inf))])
    return shell.with_heights(shell.heights - at * shell.gauss_heights)


@pytest.mark.filterwarnings("error")
def test_an_edge_without_length_is_named_before_any_part_is_made():
    shell = collapsed()
    assert np.linalg.norm(ends(shell), axis=1).min() < 1e-9
    spot = shell.mesh.vertices[shell.edges[np.linalg.norm(ends(shell), axis=1).argmin(), 0]]
    for make in (
        lambda: beam_drop(shell, BEAM, PANEL),
        lambda: beams(shell, BEAM, PANEL),
        lambda: panels(shell, PANEL),
    ):
        with pytest.raises(PartError, match="has no length") as caught:
            make()
        assert f"{spot[0]:.0f}" in str(caught.value) and "panel_size" in str(caught.value)
    assert set(ROOMLESS) <= set(rim_lacks(shell, FREE, PANEL, BEAM, NOTHING))


@pytest.mark.filterwarnings("error")
def test_bars_clear_the_panels_beside_them_and_border_edges_have_one():
    shell, _ = cut()
    asked = []
    for i, j, *beside in shell.edges.tolist():
        along = shell.mesh.vertices[j] - shell.mesh.vertices[i]
        along = along / np.linalg.norm(along)
        rise = shell.gauss.vertices[[i, j]].mean(axis=0)
        rise = rise - (rise @ along) * along
        up = rise / np.linalg.norm(rise)
        for face, left in zip(beside, (1.0, -1.0), strict=True):
            if face >= 0:
                normal = shell.normals[shell.panels[face]]
                corner = max(left * (normal @ np.cross(up, along)), 0.0) * BEAM.width / 2
                asked.append(corner / (normal @ up) / np.linalg.norm(rise))
    assert beam_drop(shell, BEAM, PANEL) == pytest.approx(max(asked), rel=1e-12)


def test_a_bar_that_would_lie_in_its_panel_is_named():
    shell, _ = cut()
    face, edge = 5, int(np.flatnonzero(shell.edges[:, 2] == 5)[0])
    i, j = shell.edges[edge, :2]
    along = ends(shell)[edge] / np.linalg.norm(ends(shell)[edge])
    normals = shell.normals.copy()
    axis = shell.gauss.vertices[[i, j]].mean(axis=0)
    normals[shell.panels[face]] = np.cross(axis - (axis @ along) * along, along)
    broken = Leaning(shell, normals)
    with pytest.raises(PartError, match=f"would lie in panel P00{face + 1}, whose normal leans 9"):
        beam_drop(broken, BEAM, PANEL)


class Leaning:
    """A shell whose panels' normals are not its planes'."""

    def __init__(self, shell, normals):
        self.shell, self.normals = shell, normals

    def __getattr__(self, name):
        return getattr(self.shell, name)

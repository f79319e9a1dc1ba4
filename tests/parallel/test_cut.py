"""Shells cut along borders: exact by birth, near the border, or refused."""

import numpy as np
import pytest
from cut_samples import TURN, border, circle, polygon, whole

from phexfab.errors import MeshError, PhexError
from phexfab.fabrication.geometry_checks import bad_faces, node_axis_torsion
from phexfab.mesh.measures import relative_planarity, signed_areas
from phexfab.parallel.curvature import minimality
from phexfab.parallel.cut import cut_shell
from phexfab.parallel.offset import offset


def assert_exact(shell):
    assert not bad_faces(shell).any()
    assert relative_planarity(shell.mesh).max() < 1e-12
    # Edges of S may have any length, and none between parallel axes: by how much its ends are off.
    tail, head = shell.edges[:, :2].T
    m = shell.mesh.vertices[head] - shell.mesh.vertices[tail]
    s = shell.gauss.vertices[head] - shell.gauss.vertices[tail]
    off = np.linalg.norm(np.cross(m, s), axis=1) / np.linalg.norm(m, axis=1)
    assert off.max() < 1e-11
    assert node_axis_torsion(shell).max() < 1e-6


def panel_size(shell):
    return float(np.sqrt(np.median(signed_areas(shell.mesh))))


def loops(shell):
    """Number of closed border lines of the mesh, and its Euler characteristic."""
    rim = shell.edges[shell.edges[:, 3] < 0, :2]
    onward = dict(rim.tolist())
    assert len(onward) == len(rim) and set(onward) == set(onward.values())
    count, left = 0, set(onward)
    while left:
        at, count = left.pop(), count + 1
        while onward[at] in left:
            at = onward[at]
            left.remove(at)
    return count, len(shell.mesh.vertices) - len(shell.edges) + shell.mesh.n_faces


THREE = 0.45 * (1 + 0.15 * np.cos(3 * TURN)) * np.exp(1j * TURN)
SQUARE, CORNERS = polygon(0.45 * np.array([-1 - 1j, 1 - 1j, 1 + 1j, -1 + 1j]) * np.exp(0.3j))


@pytest.mark.parametrize("kind", ["face", "edge", "vertex"])
@pytest.mark.parametrize(("drawn", "corners"), [(circle(0.5), ()), (THREE, ()), (SQUARE, CORNERS)])
def test_cut_shells_are_exact_and_reach_the_border(kind, drawn, corners):
    smooth, shell = whole(kind=kind)
    made = cut_shell(shell, [border(smooth, drawn, corners)])
    assert_exact(made.shell)
    assert loops(made.shell) == (1, 1)
    assert made.report.rim_distance < 0.12 * panel_size(shell)
    assert made.report.ruling_angle < 45
    assert made.report.shortest_edge > 0.02 * panel_size(shell)
    # The same panels as before, where the border does not come.
    parents = made.parent[made.shell.panels]
    inner = ~np.isin(
        made.shell.panels, made.shell.triangles[(made.parent < 0)[made.shell.triangles].any(axis=1)]
    )
    assert inner.sum() > 50
    before = signed_areas(shell.mesh)[np.searchsorted(shell.panels, parents[inner])]
    assert np.allclose(signed_areas(made.shell.mesh)[inner], before, rtol=1e-9)
    assert minimality(made.shell).max() < 1e-10


def test_the_area_is_that_of_the_film_within_the_border():
    smooth, shell = whole(size=120.0)
    made = cut_shell(shell, [border(smooth, circle(0.5))])
    r, t = np.meshgrid((np.arange(200) + 0.5) / 400, TURN[::4])
    w = r * np.exp(1j * t)
    # w = u + iv is isothermic with ds² = |dw|²/κ.
    kappa = np.abs(smooth.principal_curvatures(smooth.parameter(w))[..., 0]) / smooth.scale
    film = float((r / kappa).mean() * 0.5 * 2 * np.pi)
    assert signed_areas(made.shell.mesh).sum() == pytest.approx(film, rel=0.01)


def test_a_ring_between_two_borders():
    smooth, shell = whole()
    made = cut_shell(shell, [border(smooth, circle(0.5)), border(smooth, circle(0.2, turn=-1))])
    assert_exact(made.shell)
    assert loops(made.shell) == (2, 0)
    middle = np.linalg.norm(made.shell.mesh.vertices[:, :2], axis=1)
    assert middle.min() > 0.15 * middle.max()


def test_two_planes_cut_a_catenoid_and_the_borders_lie_in_them():
    smooth, shell = whole("catenoid", 500.0, closed=True)
    made = cut_shell(shell, [border(smooth, 0.4 + 1j * TURN), border(smooth, -0.4 - 1j * TURN)])
    assert_exact(made.shell)
    assert made.report.ways == ("flat", "flat")
    assert made.report.planes == 2
    assert loops(made.shell) == (2, 0)
    height = np.abs(smooth.point(smooth.parameter(np.array([0.4])))[0, 2])
    on_rim = made.shell.mesh.vertices[made.shell.rim_vertices]
    assert np.abs(np.abs(on_rim[:, 2]) - height).max() < 1e-8
    # Beams on the border stand in the plane: the axes there are horizontal.
    assert np.abs(made.shell.gauss.vertices[made.shell.rim_vertices][:, 2]).max() < 1e-12


def test_offsets_of_a_cut_shell_stay_within_its_rim_planes():
    smooth, shell = whole(kind="edge")
    made = cut_shell(shell, [border(smooth, circle(0.5))], depth=20.0).shell
    moved = offset(made, -20.0)
    assert_exact(moved)
    rim = np.flatnonzero(made.parents < 0)
    for f in rim.tolist():
        rows = np.flatnonzero((made.triangles[made.used_vertices] == f).any(axis=1))
        for mesh in (made.mesh, moved.mesh):
            miss = mesh.vertices[rows] @ made.normals[f] - made.heights[f]
            assert np.abs(miss).max() < 1e-7


def test_a_border_along_lattice_lines_and_through_vertices():
    smooth, shell = whole(size=300.0)
    w = smooth.curvature_coordinates(shell.parameters)
    u = np.unique(np.round(w.real, 9))
    v = np.unique(np.round(w.imag, 9))
    a, b = u[np.searchsorted(u, -0.4)], u[np.searchsorted(u, 0.4)]
    for low, high in (
        (v[np.searchsorted(v, -0.4)], v[np.searchsorted(v, 0.4)]),
        (v[np.searchsorted(v, -0.4)] / 2 + v[np.searchsorted(v, -0.4) + 1] / 2, 0.35),
    ):
        drawn, corners = polygon([a + 1j * low, b + 1j * low, b + 1j * high, a + 1j * high])
        made = cut_shell(shell, [border(smooth, drawn, corners)])
        assert_exact(made.shell)


@pytest.mark.parametrize("size", [700.0, 60.0])
def test_coarse_and_fine_panels(size):
    smooth, shell = whole(size=size)
    radius = 0.35
    made = cut_shell(shell, [border(smooth, circle(radius))])
    assert_exact(made.shell)
    assert made.report.rim_distance < 0.12 * panel_size(shell)


def test_a_plumb_cut_has_vertical_planes_and_axes():
    smooth, shell = whole()
    made = cut_shell(shell, [border(smooth, circle(0.4))], direction=(0, 0, 2))
    assert_exact(made.shell)
    assert made.report.ways == ("direction",)
    assert np.abs(made.shell.normals[made.parent < 0][:, 2]).max() < 1e-12
    stations = (made.parent < 0)[made.shell.triangles[made.shell.used_vertices]].sum(axis=1) == 2
    axes = made.shell.gauss.vertices[stations]
    assert np.abs(axes[:, :2]).max() < 1e-9


def test_smaller_sagitta_brings_the_border_nearer():
    smooth, shell = whole(size=300.0)
    one = border(smooth, circle(0.45))
    rough = cut_shell(shell, [one], sagitta=60.0, shortest_edge=0.0, sliver_width=0.0)
    fine = cut_shell(shell, [one], sagitta=2.0, shortest_edge=0.0, sliver_width=0.0)
    assert rough.report.planes < fine.report.planes
    assert fine.report.rim_distance < 0.5 * rough.report.rim_distance


def test_what_cannot_be_cut_is_refused():
    smooth, shell = whole()
    with pytest.raises(MeshError, match=r"shell ends at .* make the shell reach further"):
        cut_shell(shell, [border(smooth, circle(0.72))])
    with pytest.raises(MeshError, match="film on its left"):
        cut_shell(shell, [border(smooth, circle(0.4, turn=-1))])
    inside = smooth.curvature_coordinates(shell.parameters[shell.panels[40:41]])[0]
    with pytest.raises(MeshError, match="one panel"):
        cut_shell(shell, [border(smooth, circle(0.002, inside))])
    eight = 0.4 * np.sin(TURN) + 0.2j * np.sin(2 * TURN) + 0.01
    with pytest.raises(PhexError, match=r"cross|no cut|parts|leaves both"):
        cut_shell(shell, [border(smooth, eight)])
    with pytest.raises(MeshError, match="no border"):
        cut_shell(shell, [])
    with pytest.raises(MeshError, match=r"lean .* from the film's normal"):
        cut_shell(shell, [border(smooth, circle(0.4))], direction=(1, 0, 0))


def test_equal_input_gives_equal_output():
    smooth, shell = whole()
    one, two = (cut_shell(shell, [border(smooth, THREE)]).shell for _ in range(2))
    assert np.array_equal(one.triangles, two.triangles)
    assert np.array_equal(one.heights, two.heights)


def random_border(rng, smooth, box):
    u0, u1, v0, v1 = box
    radius = rng.uniform(0.08, 0.32)
    centre = rng.uniform(0.4, 0.6, 2)
    corners = ()
    if rng.random() < 0.3:
        n = int(rng.integers(3, 7))
        turn = 2 * np.pi * (np.arange(n) + rng.uniform(-0.2, 0.2, n)) / n
        drawn, corners = polygon(radius * rng.uniform(0.8, 1.2, n) * np.exp(1j * turn))
    else:
        waves = rng.normal(size=4) * 0.12 / np.arange(1, 5)
        phase = rng.uniform(0, 2 * np.pi, 4)
        bumps = np.cos(np.arange(2, 6)[:, None] * TURN + phase[:, None])
        drawn = radius * (1 + waves @ bumps) * np.exp(1j * TURN)
    w = u0 + (u1 - u0) * (centre[0] + drawn.real) + 1j * (v0 + (v1 - v0) * (centre[1] + drawn.imag))
    return border(smooth, w, corners)


def run_random(seed, count, samples):
    rng = np.random.default_rng(seed)
    cut = 0
    for k in range(count):
        smooth, shell = whole(*samples[k % len(samples)])
        one = random_border(rng, smooth, smooth.rectangle)
        try:
            made = cut_shell(shell, [one])
        except PhexError as error:
            assert "mm" in str(error)  # it names a place
            continue
            assert_exact(made.shell)
        assert loops(made.shell) == (1, 1)
        cut += 1
    return cut


SAMPLES = [("enneper", 300.0), ("enneper", 120.0), ("helicoid", 400.0), ("scherk-1", 600.0)]


def test_random_borders_are_cut_exactly_or_refused():
    assert run_random(3, 24, SAMPLES) >= 22


@pytest.mark.long
def test_many_random_borders_are_cut_exactly_or_refused():
    assert run_random(4, 400, SAMPLES) >= 380

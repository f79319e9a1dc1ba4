"""From a boundary curve to a shell that is exact, whatever the film: umbilics, holes, any rim.

The long run over random rims: ``pytest -m long tests/claims/test_films.py``.
"""

import os

import numpy as np
import pytest
from film_samples import KINDS, lobed, made, random_rim, ring, umbilic_order
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from phexfab.errors import PhexError
from phexfab.mesh.measures import signed_areas
from phexfab.surface.catalog import surface
from phexfab.surface.disc_films.plateau import plateau, umbilic_count
from phexfab.surface.rims.rim import Rim


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("panel_size", [700.0, 480.0])
@pytest.mark.parametrize("lobes", [2, 3, 4, 5, 7])
def test_a_disc_with_so_many_umbilics(lobes, panel_size, kind):
    rim = lobed(lobes, 0.18 if lobes < 5 else 0.1)
    if kind == "face":
        assert umbilic_count(plateau(rim)) == lobes - 2
    found = made([rim], panel_size=panel_size, kind=kind)
    assert umbilic_order(found.shell) == lobes - 2
    assert found.rim_distance < 0.1 * panel_size


COAXIAL = (ring(6000.0), ring(3000.0, (0, 0, 2200.0)))
SKEW = (ring(6000.0), ring(2600.0, (900.0, 300.0, 2200.0), 0.25))
THREE = (ring(9000.0), ring(2200.0, (-4300.0, 0, 3200.0)), ring(2200.0, (4300.0, 0, -3200.0)))


def assert_holes(shell, holes):
    """The Euler characteristic counts holes."""
    count = len(shell.mesh.vertices) - len(shell.edges) + shell.mesh.n_faces
    assert count == 1 - holes


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("rims", "panel_size"), [(COAXIAL, 480.0), (SKEW, 700.0)])
def test_an_annulus(rims, panel_size, kind):
    found = made(rims, panel_size=panel_size, kind=kind)
    assert_holes(found.shell, 1)
    assert umbilic_order(found.shell) == 0
    assert found.rim_distance < 0.12 * panel_size


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("rims", "panel_size"), [(COAXIAL, 700.0), (SKEW, 480.0), (THREE, 600.0), (THREE, 420.0)]
)
def test_more_annuli_and_a_film_with_two_holes(rims, panel_size, kind):
    found = made(rims, panel_size=panel_size, kind=kind)
    assert_holes(found.shell, len(rims) - 1)
    # On a disc with holes the umbilics' orders sum to one less than the holes, twice.
    assert umbilic_order(found.shell) == 2 * (len(rims) - 2)


def outcome(rim, panel_size, kind, evenness):
    """Return what a rim comes to: a valid shell, or a refusal that says where and what to do."""
    try:
        made(
            [rim],
            panel_size=panel_size,
            kind=kind,
            lattice={"evenness": evenness},
            sheets={"panels": {"length": 20000.0, "width": 10000.0}},
        )
    except PhexError as error:
        text = str(error)
        assert len(text) > 40 and "\n" not in text, text
        assert any(word in text for word in ("panel", "rim", "border", "film")), text
        return f"{type(error).__name__}: {text}"
    return "shell"


FIXED = [
    ([(2, 0.5, 0.1, 0.2, 0.1), (3, 0.1, -0.4, 0.3, 0.2)], 9000.0, 0.9, 17, "face", 0.0),
    ([(3, 0.6, 0.2, 0.1, -0.3), (4, 0.2, 0.3, -0.2, 0.1)], 14000.0, 1.0, 21, "edge", 0.0),
    ([(2, 0.7, 0.0, 0.3, 0.0), (5, 0.4, 0.6, 0.5, 0.3)], 6000.0, 0.8, 19, "vertex", 0.0),
    ([(1, 0.0, 0.0, 0.4, 0.2), (2, 0.3, 0.8, 0.0, 0.0)], 22000.0, 0.7, 24, "face", 1.0),
    ([(2, 0.4, 0.4, 0.2, 0.2), (3, 0.9, 0.0, 0.0, 0.5)], 5000.0, 1.0, 15, "edge", 0.0),
    ([(2, 0.8, 0.1, 0.6, 0.3)] * 2 + [(4, 0.1, 0.1, 0.3, 0.3)], 12000.0, 0.95, 20, "vertex", 1.0),
]


@pytest.mark.parametrize("case", FIXED)
def test_a_smooth_rim_gives_a_shell(case):
    modes, size, across, panels, kind, evenness = case
    assert outcome(random_rim(modes, size, across), size / panels, kind, evenness) == "shell"


FACTOR = st.floats(-1, 1)
MODES = st.lists(
    st.tuples(st.integers(1, 7), FACTOR, FACTOR, FACTOR, FACTOR),
    min_size=2,
    max_size=6,
    unique_by=lambda mode: mode[0],
)
REFUSED: list[str] = []


@pytest.mark.long
@settings(
    max_examples=int(os.environ.get("PHEXFAB_RIMS", "200")),
    deadline=None,
    derandomize=True,
    suppress_health_check=list(HealthCheck),
)
@given(
    modes=MODES,
    size=st.floats(4000.0, 30000.0),
    across=st.floats(0.6, 1.0),
    panels=st.floats(12.0, 30.0),
    kind=st.sampled_from(KINDS),
    evenness=st.sampled_from([0.0, 1.0]),
)
def test_a_random_smooth_rim_gives_a_shell_or_a_clear_refusal(
    modes, size, across, panels, kind, evenness
):
    found = outcome(random_rim(modes, size, across), size / panels, kind, evenness)
    if found != "shell":
        REFUSED.append(found)


def test_the_rim_of_enneper_gives_enneper_back_with_rate_two():
    known = surface("enneper").scaled(10000.0)
    angle = 2 * np.pi * np.arange(96) / 96
    rim = Rim.through(known.point(0.7 * np.exp(1j * angle)))
    worst = []
    for panel_size in (600.0, 300.0):
        vertices = made([rim], panel_size=panel_size).shell.mesh.vertices
        foot = known.closest_parameter(vertices, (vertices[:, 0] - 1j * vertices[:, 1]) / 5000)
        worst.append(np.linalg.norm(known.point(foot) - vertices, axis=1).max())
    assert worst[0] < 0.05 * 600
    assert np.log2(worst[0] / worst[1]) > 1.6, worst


def test_two_equal_rings_give_the_catenoid_with_rate_two():
    waist = 4000.0
    height, radius = 0.6 * waist, waist * np.cosh(0.6)
    off = []
    for panel_size in (900.0, 450.0):
        rims = (ring(radius, (0, 0, -height)), ring(radius, (0, 0, height)))
        x, y, z = made(rims, panel_size=panel_size).shell.mesh.vertices.T
        # The distance along the radius, times the sine of the profile's slope.
        off.append(np.abs((np.hypot(x, y) - waist * np.cosh(z / waist)) / np.cosh(z / waist)).max())
    assert off[0] < 0.05 * 900
    assert np.log2(off[0] / off[1]) > 1.6, off


def test_a_cell_of_schwarz_p_has_eight_nine_gons_and_its_area():
    off = []
    for panel_size in (750.0, 520.0):
        asked = {"periodic": "schwarz-p", "scale": 6000.0}
        found = made(surface=asked, panel_size=panel_size)
        sides = found.shell.whole.mesh.sides[np.isin(found.shell.whole.panels, found.shell.parents)]
        assert sorted(set(sides.tolist())) == [6, 9] and (sides == 9).sum() == 8
        assert_holes(found.shell, 5)
        film = found.figures["film area"][0]
        off.append(abs(signed_areas(found.shell.mesh).sum() / 1e6 / film - 1))
    assert off[0] < 0.05
    assert np.log(off[0] / off[1]) / np.log(750 / 520) > 1.5, off

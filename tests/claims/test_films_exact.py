"""The discrete shell is exact whatever the film: any number of umbilics, discs and rings."""

import numpy as np
import pytest
from film_samples import KINDS, assert_exact, design, waves
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from phexfab.errors import PhexError
from phexfab.forming import form
from phexfab.surface.disc_films.plateau import plateau, umbilic_count

LOBES = {  # umbilics: (lobes, share of a saddle that parts the umbilics, panel size)
    0: (2, 0.0, 600.0),
    1: (3, 0.0, 600.0),
    2: (4, 0.06, 600.0),
    3: (5, 0.09, 600.0),
    5: (7, 0.12, 450.0),
}


def silent(*_):
    """Nobody watches."""


def lobed(umbilics):
    lobes, saddle, size = LOBES[umbilics]
    up = [(lobes, 0.2 if lobes == 2 else 0.12, 0.0)]
    if saddle:
        up.append((2, saddle, 0.02))
    return waves(up, size=6000.0), size


def check_umbilics(umbilics, kind):
    rim, size = lobed(umbilics)
    assert umbilic_count(plateau(rim)) == umbilics
    made = form(design(panel_size=size, kind=kind), silent, (rim,))
    assert_exact(made.shell)
    sides = np.diff(made.shell.whole.rings[1])
    assert sorted(sides[sides != 6]) == [9] * umbilics
    assert made.rim_distance < 0.08 * size


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("umbilics", [0, 1, 2, 3])
def test_rims_with_few_umbilics(umbilics, kind):
    check_umbilics(umbilics, kind)


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_a_rim_with_five_umbilics(kind):
    check_umbilics(5, kind)


@pytest.mark.parametrize("kind", KINDS)
def test_a_ring_between_two_rims(kind):
    low = waves([(2, 0.04, 0.0)], size=6000.0, name="low")
    high = waves([(0, 0.5, 0.0)], size=3200.0, across=(1.0, 0.9), name="high")
    made = form(design(panel_size=800.0, kind=kind), silent, (low, high))
    assert_exact(made.shell)
    mesh = made.shell.mesh
    edges = len(made.shell.edges)
    assert len(mesh.vertices) - edges + mesh.n_faces == 0  # an annulus


wave = st.tuples(
    st.integers(2, 5), st.floats(-0.125, 0.125, width=32), st.floats(-0.125, 0.125, width=32)
)


@pytest.mark.long
def test_two_hundred_random_rims():
    """A valid shell or a refusal that says why; never anything else, and refusals are rare."""
    refused: list[str] = []
    built: list[int] = []

    @settings(
        max_examples=200, deadline=None, derandomize=True, suppress_health_check=list(HealthCheck)
    )
    @given(
        up=st.lists(wave, min_size=1, max_size=3),
        out=st.lists(wave, max_size=1),
        size=st.floats(3000, 15000),
        parts=st.floats(8, 16),
        kind=st.sampled_from(KINDS),
        evenness=st.sampled_from([0.0, 1.0]),
    )
    def one_rim(up, out, size, parts, kind, evenness):
        flat = [(n, c / 2, s / 2) for n, c, s in out]
        rim = waves([*up, (2, 0.08, 0.0)], flat, size=size)
        stock = {"length": 4 * size, "width": 4 * size}
        asked = design(
            panel_size=size / parts,
            kind=kind,
            lattice={"evenness": evenness},
            sheets={"panels": stock, "beams": stock},
        )
        try:
            made = form(asked, silent, (rim,))
        except PhexError as refusal:
            assert len(str(refusal)) > 40
            refused.append(str(refusal))
            return
        assert_exact(made.shell, 1e-9)
        built.append(made.shell.mesh.n_faces)

    one_rim()
    print(f"{len(built)} built, {len(refused)} refused:", *refused, sep="\n")
    assert len(built) + len(refused) >= 200
    assert len(refused) < 0.1 * len(built)

"""The discrete shell is exact whatever the film: any number of umbilics, discs and rings."""

import re
from collections import Counter

import numpy as np
import pytest
from film_samples import KINDS, assert_exact, design, waves
from hypothesis import HealthCheck, Phase, given, settings
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
SADDLE = (2, 0.08, 0.0)  # under all waves, so that no film is plane
PLAIN = 45.0  # degrees that a rim climbs at most: steeper ones may be refused more often
MOST_REFUSED, MOST_REFUSED_PLAIN = 0.15, 0.02
REMEDY = re.compile(r"\b(choose|change|would do|make|round)\b")


def climb(up):
    """The steepest slope of a rim's waves over a circle, degrees."""
    angle = np.linspace(0.0, 2 * np.pi, 2000)
    terms = [n * (s * np.cos(n * angle) - c * np.sin(n * angle)) for n, c, s in up]
    return np.degrees(np.arctan(np.abs(sum(terms)).max()))


def attempt(up, out, size, parts, kind, evenness):
    """What comes of a random rim: ``(outcome, what it says)``."""
    flat = [(n, c / 2, s / 2) for n, c, s in out]
    rim = waves([*up, SADDLE], flat, size=size)
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
        says = str(refusal)
        clear = re.search(r"\d", says) and REMEDY.search(says)
        return ("refused" if clear else "unclear"), says
    except Exception as error:
        return "broken", repr(error)
    try:
        assert_exact(made.shell, 1e-9)
    except AssertionError as error:
        return "bad", str(error)
    return "built", f"{made.shell.mesh.n_faces} panels"


@pytest.mark.long
def test_two_hundred_random_rims():
    """A valid shell or a refusal that says why; never anything else, and refusals are rare."""
    trials = []

    @settings(
        max_examples=200,
        deadline=None,
        derandomize=True,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(
        up=st.lists(wave, min_size=1, max_size=3),
        out=st.lists(wave, max_size=1),
        size=st.floats(3000, 15000),
        parts=st.floats(8, 16),
        kind=st.sampled_from(KINDS),
        evenness=st.sampled_from([0.0, 1.0]),
    )
    def one_rim(**rim):
        trials.append((*attempt(**rim), rim))

    one_rim()
    counts = Counter(outcome for outcome, _, _ in trials)
    reasons = Counter(re.sub(r"-?\d[\d.]*", "#", says) for o, says, _ in trials if o == "refused")
    plain = [o for o, _, rim in trials if climb([*rim["up"], SADDLE]) <= PLAIN]
    print(dict(counts), f"{plain.count('built')} of {len(plain)} up to {PLAIN:.0f}° built")
    print(*(f"{n} x {reason}" for reason, n in reasons.most_common()), sep="\n")
    assert not [trial for trial in trials if trial[0] not in ("built", "refused")]
    assert len(trials) >= 200 and len(plain) >= 120
    assert counts["built"] >= (1 - MOST_REFUSED) * len(trials)
    assert plain.count("built") >= (1 - MOST_REFUSED_PLAIN) * len(plain)

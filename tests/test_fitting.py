"""A rim fits wherever the lattice happens to lie: other cuts and other placements are tried."""

from pathlib import Path

import numpy as np
import pytest

from phexfab import ending, fitting, forming
from phexfab.design import load_design, make_design
from phexfab.ending import FIRST, Knife
from phexfab.errors import MeshError
from phexfab.films import film_of, film_within
from phexfab.fitting import CHANGED, STEPS
from phexfab.forming import form
from phexfab.parallel.curvature import minimality
from phexfab.pipeline import build
from phexfab.placing import AS_ASKED, Placement, lattice_at, placements

EXAMPLES = Path(__file__).parent.parent / "examples"
RIMS = {"rim_distance", "rim_corner", "rim_beam_angle", "rim_mitre", "shortest_edge"}
TURN = 2 * np.pi * np.arange(160) / 160


def silent(stage, done, total):
    """Nobody watches."""


def sized(name, panel_size, **checks):
    design = load_design(EXAMPLES / f"{name}.toml")
    lattice = design.lattice.model_copy(update={"panel_size": panel_size})
    limits = design.checks.model_copy(update=checks)
    return design.model_copy(update={"lattice": lattice, "checks": limits})


def saddle(panel_size=600.0, **checks):
    """A roof of 6 m without umbilics."""
    points = 3000.0 * np.stack([np.cos(TURN), np.sin(TURN), 0.15 * np.cos(2 * TURN)], axis=1)
    tables = {"surface": {"rim": points.tolist()}, "lattice": {"panel_size": panel_size}}
    beams = {"width": 8.0, "height": 60.0}
    return make_design({**tables, "beams": beams, "checks": checks})


def missed(made):
    return {check.name for check in made.checks if not check.ok} & RIMS


# -- the claim -------------------------------------------------------------------------------------


SIZES = [
    *(("garden-roof", size) for size in (418.0, 511.0)),  # no umbilic: the lattice may move
    ("four-corner-canopy", 614.0),  # four of them, which hold it
    ("ring-court", 671.0),  # a film on a mesh
]


def test_the_rim_fits_at_sizes_at_which_first_cuts_miss():
    changed = 0
    for name, size in SIZES:
        made = build(sized(name, size))
        assert not missed(made), (name, size)
        changed += CHANGED in made.figures
        assert minimality(made.shell).max() <= 1e-10
    # Without a second try most of them miss a limit.
    assert changed >= 2


@pytest.mark.long
@pytest.mark.parametrize(
    "name",
    [
        "four-corner-canopy",
        "five-lobed-roof",
        "three-lobed-roof",
        "garden-roof",
        "flower-pavilion",
        "ring-court",
    ],
)
def test_nearly_all_sizes_within_15_percent_fit(name):
    asked = load_design(EXAMPLES / f"{name}.toml").lattice.panel_size
    sizes = asked * np.linspace(0.85, 1.15, 12)
    bad = [size for size in sizes.round(1).tolist() if missed(build(sized(name, size)))]
    assert len(bad) <= 1, bad


# -- how it is done --------------------------------------------------------------------------------


class Counted:
    """Calls of a function of a room, counted."""

    def __init__(self, monkeypatch, room, name):
        self.calls, original = [], getattr(room, name)

        def called(*given, **named):
            self.calls.append(given)
            return original(*given, **named)

        monkeypatch.setattr(room, name, called)


def test_what_fits_at_once_is_left_alone(monkeypatch):
    cuts = Counted(monkeypatch, ending, "cut_shell")
    lattices = Counted(monkeypatch, fitting, "lattice_at")
    found = form(saddle(rim_distance=1000.0, rim_corner=0.0, shortest_edge=1.0), silent)
    assert len(cuts.calls) == 1 and not lattices.calls
    assert CHANGED not in found.figures


def test_what_cannot_fit_is_tried_a_bounded_number_of_times_on_one_film(monkeypatch):
    films = Counted(monkeypatch, forming, "film_of")
    lattices = Counted(monkeypatch, fitting, "lattice_at")
    cuts = Counted(monkeypatch, ending, "cut_shell")
    made = build(saddle(900.0, rim_distance=8.0))
    assert len(films.calls) == 1
    assert 5 < len(lattices.calls) + len(cuts.calls) <= STEPS + 1
    (check,) = [check for check in made.checks if check.name == "rim_distance"]
    assert not check.ok and "Remedy" in check.note
    # The best of all is kept: it is nearer to the rim than the first.
    monkeypatch.undo()
    monkeypatch.setattr(forming, "fitted", lambda *given: fitting.Fit(given[-1], None, {}))
    first = form(saddle(900.0, rim_distance=8.0), silent)
    assert check.value < first.rim_distance


def test_a_rim_far_off_is_cut_again_but_no_lattice_is_laid_for_it(monkeypatch):
    lattices = Counted(monkeypatch, fitting, "lattice_at")
    cuts = Counted(monkeypatch, ending, "cut_shell")
    form(saddle(900.0, rim_distance=0.01), silent)
    assert 1 < len(cuts.calls) <= 4 and not lattices.calls


def test_the_same_design_gives_the_same_shell():
    one, two = (form(sized("garden-roof", 511.0), silent) for _ in range(2))
    assert one.figures == two.figures
    assert np.array_equal(one.shell.mesh.vertices, two.shell.mesh.vertices)


def test_room_for_bars_is_found_by_cutting_again(monkeypatch):
    """Whatever the first cut leaves: no film and no lattice is made anew."""
    films = Counted(monkeypatch, forming, "film_of")
    lattices = Counted(monkeypatch, fitting, "lattice_at")
    original = ending.cut_shell

    def first_one_tight(whole, borders, **how):
        if len(seen) == 0:
            how |= {"shortest_edge": 0.0, "depth": 0.0, "sliver_width": 0.0, "sliver_share": 0.0}
        seen.append(how)
        return original(whole, borders, **how)

    seen = []
    monkeypatch.setattr(ending, "cut_shell", first_one_tight)
    loose = {"rim_distance": 90.0, "rim_corner": 0.0, "rim_beam_angle": 0.0, "rim_mitre": 90.0}
    design = saddle(550.0, shortest_edge=30.0, **loose)
    found = form(design, silent)
    assert len(seen) > 1 and len(films.calls) == 1 and not lattices.calls
    assert found.figures[CHANGED][0].startswith("cut with ")
    assert seen[1]["shortest_edge"] > seen[0]["shortest_edge"]


def test_a_wish_for_chords_is_kept_in_every_cut(monkeypatch):
    seen = []
    original = ending.cut_shell

    def watched(whole, borders, **how):
        seen.append((how["sagitta"], how["sliver_width"]))
        return original(whole, borders, **how)

    monkeypatch.setattr(ending, "cut_shell", watched)
    design = saddle(900.0, rim_corner=80.0)
    border = design.border.model_copy(update={"sagitta": 30.0, "sliver_width": 25.0})
    form(design.model_copy(update={"border": border}), silent)
    assert len(seen) > 5 and set(seen) == {(30.0, 25.0)}


def test_no_room_in_any_cut_is_refused():
    """Bars deeper than edges at the rim last: the error says how deep they may be."""
    design = saddle(900.0)
    beams = design.beams.model_copy(update={"height": 6000.0})
    with pytest.raises(MeshError, match=r"vanish .* lower bars"):
        form(design.model_copy(update={"beams": beams}), silent)


# -- placements ------------------------------------------------------------------------------------


def film_for(design):
    return film_of(design, film_within(design))


def test_a_free_lattice_moves_and_keeps_its_size():
    design = saddle()
    film = film_for(design)
    tried = placements(film)
    assert tried[0] == AS_ASKED and len(set(tried)) == len(tried)
    moved = [one for one in tried if one.along or one.across]
    assert len(moved) >= 5 and all(0 <= one.along < 1 and 0 <= one.across < 1 for one in moved)
    still = lattice_at(design, film)
    for one in moved:
        made = lattice_at(design, film, one)
        assert made.step == still.step
        nearest = np.abs(made.points[:, None] - still.points).min(axis=1)
        apart = np.abs(still.points[:, None] - still.points)
        first = np.sort(apart, axis=1)[:, 1]
        assert np.median(nearest) > 0.1 * np.median(first), one


def test_umbilics_stay_lattice_points_when_rows_are_bent():
    design = sized("four-corner-canopy", 640.0)
    film = film_for(design)
    umbilics = film.ground.umbilics.places
    tried = [one for one in placements(film) if one.bend]
    assert len(umbilics) > 1 and len(tried) >= 5
    assert not any(one.along or one.across for one in placements(film))
    still, bent = lattice_at(design, film), lattice_at(design, film, tried[0])
    for made in (still, bent):
        assert np.abs(umbilics[:, None] - made.points).min(axis=1).max() < 1e-9
    far = np.abs(bent.points[:, None] - still.points).min(axis=1)
    assert np.median(far) > 1e-3


def test_a_placement_says_what_it_is():
    assert str(AS_ASKED) == "" and str(FIRST) == ""
    assert str(Placement(0.975)) == "panels made 2.5 % smaller"
    assert str(Placement(1.05)) == "panels made 5 % larger"
    said = str(Placement(1.0, 0.25, 0.5))
    assert said == "panels moved by 0.25 along and 0.50 across rows"
    assert "2.9°" in str(Placement(bend=(0, 0.05)))
    assert str(Knife(1.5)) == "cut with 1.5 times the room for edges"
    assert "7.5 mm" in str(Knife(sagitta=7.5)) and "20 mm" in str(Knife(sliver=20.0))

"""Nesting: nothing lost, nothing too close, as few sheets as the packers promise."""

import dataclasses
import json
from itertools import combinations

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from nest_samples import HPL, STEEL, bars, hourglass, lying, panels, part, turn

import phexfab.fabrication.search as search_module
from phexfab.errors import NestingError
from phexfab.fabrication.layout import layout_from_json, layout_to_json, sheet_yield, verify_layout
from phexfab.fabrication.nest import nest, nest_all
from phexfab.fabrication.parts import Placement, Stock
from phexfab.fabrication.strip import StripLayout

SMALL = Stock(1000.0, 800.0)


def assert_sound(sheets, flats):
    """Every part once, gaps and margins kept: by brute force over all pairs."""
    marks = [p.mark for sheet in sheets for p in sheet.placements]
    assert sorted(marks) == sorted(flat.mark for flat in flats)
    for sheet in sheets:
        stock = sheet.stock
        shapes = {mark: shapely.Polygon(p) for mark, p in lying(sheet, flats).items()}
        room = shapely.box(
            stock.margin, stock.margin, stock.length - stock.margin, stock.width - stock.margin
        ).buffer(1e-6)
        assert all(room.contains(shape) for shape in shapes.values())
        for a, b in combinations(shapes.values(), 2):
            assert a.distance(b) >= stock.spacing - 1e-6


# -- rows -------------------------------------------------------------------------------------


@st.composite
def stars(draw):
    """A simple polygon, rarely convex: corners in the order of their angle about the origin."""
    count = draw(st.integers(3, 9))
    gaps = np.array(draw(st.lists(st.floats(0.3, 1.0), min_size=count, max_size=count)))
    angles = np.cumsum(gaps) / gaps.sum() * 2 * np.pi
    radii = np.array(draw(st.lists(st.floats(15, 140), min_size=count, max_size=count)))
    return np.column_stack([np.cos(angles), np.sin(angles)]) * radii[:, None]


@settings(max_examples=40, deadline=None)
@given(
    outlines=st.lists(stars(), min_size=1, max_size=14),
    spacing=st.floats(0, 20),
    margin=st.floats(0, 25),
)
def test_rows_of_any_polygons_are_sound(outlines, spacing, margin):
    flats = [part(f"P{k:03d}", outline) for k, outline in enumerate(outlines)]
    sheets = nest(flats, Stock(700.0, 500.0, margin, spacing), packer="shelf")
    assert_sound(sheets, flats)


def test_congruent_hourglasses_fall_into_the_pattern_in_which_they_tile_the_plane():
    """The pattern's count is known: rows at 1.5 sizes, every other one shifted by half a width."""
    size, stock = 200.0, Stock(3000.0, 1500.0, 10.0, 8.0)
    flats = [part(f"P{k:03d}", turn(hourglass(size), 37.0)) for k in range(60)]
    sheets = nest(flats, stock, packer="shelf")
    assert_sound(sheets, flats)
    width = np.sqrt(3) * size + 8  # sides stand 8 mm apart
    pitch = 1.5 * size + 8 / np.cos(np.radians(30))  # notches are slanted by 30°
    across = int((2980 + 8 - width / 2) // width)
    rows = 1 + int((1480 - 2 * size) // pitch)
    assert len(sheets[0].placements) >= across * rows
    # Bounding rectangles, the way most shops' programs nest, hold a quarter less.
    rectangles = int((2980 + 8) // width) * int((1480 + 8) // (2 * size + 8))
    assert len(sheets[0].placements) > 1.25 * rectangles


def test_bars_lie_dense():
    flats = bars(300)
    stock = Stock(3000.0, 1500.0)
    sheets = nest(flats, stock)
    assert_sound(sheets, flats)
    # The share that rows of 90 mm can reach at all, and 94 % of it on every full sheet.
    best = 15 * 90 * 2980 / (3000 * 1500)
    assert all(sheet_yield(sheet, flats) > 0.94 * best for sheet in sheets[:-1])
    total = sum(shapely.Polygon(flat.outline).area for flat in flats)
    assert len(sheets) == int(np.ceil(total / (best * 3000 * 1500) - 1e-9))


def test_a_part_that_fits_only_turned_is_turned():
    outline = np.array([(0, 0), (300, 0), (300, 760), (0, 760)], float)
    flats = [part("P001", turn(outline, 33.0)), part("P002", outline), part("P003", outline)]
    sheets = nest(flats, Stock(1000.0, 800.0), packer="shelf")
    assert_sound(sheets, flats)
    assert len(sheets) == 1


def test_nothing_gives_no_sheets():
    assert nest([], SMALL) == ()
    assert nest_all([], SMALL).sheets == ()


# -- Sparrow ----------------------------------------------------------------------------------


def test_sparrow_needs_fewer_sheets_than_rows_and_repeats_itself():
    flats = panels(16, 90, 220, 2)
    rows = nest(flats, SMALL, packer="shelf")
    notes = []
    dense = nest(flats, SMALL, seconds=30, notes=notes)
    assert_sound(dense, flats)
    assert (len(rows), len(dense)) == (3, 2) and notes == []
    assert nest(flats, SMALL, seconds=30) == dense


def test_where_the_effort_is_spent_the_parts_lie_in_rows_and_a_note_says_so():
    flats = panels(16, 90, 220, 2)
    notes = []
    sheets = nest(flats, SMALL, seconds=0.01, notes=notes)
    assert sheets == nest(flats, SMALL, packer="shelf")
    assert len(notes) == 1 and "HPL 8 mm" in notes[0] and "0.01 s" in notes[0]


def test_where_the_packer_fails_the_parts_lie_in_rows_and_a_note_says_so(monkeypatch):
    flats = panels(16, 90, 220, 2)

    def broken(runs, seconds, *, until_one_fits=False):
        return [StripLayout(np.inf, (), error="out of memory") for _ in runs]

    monkeypatch.setattr(search_module, "pack_strips", broken)
    nested = nest_all(flats, SMALL)
    assert_sound(nested.sheets, flats)
    assert nested.sheets == nest_all(flats, SMALL, packer="shelf").sheets
    assert len(nested.notes) == 1 and "out of memory" in nested.notes[0]


def test_a_layout_of_the_packer_that_is_not_sound_is_not_taken(monkeypatch):
    flats = panels(16, 90, 220, 2)

    def heap(runs, seconds, *, until_one_fits=False):
        spots = [tuple((k, 0.0, 400.0, 400.0) for k in range(len(run.contours))) for run in runs]
        return [StripLayout(1.0, spot, 1) for spot in spots]

    monkeypatch.setattr(search_module, "pack_strips", heap)
    notes = []
    sheets = nest(flats, SMALL, notes=notes)
    assert sheets == nest(flats, SMALL, packer="shelf")
    assert len(notes) == 1 and "not sound" in notes[0]


# -- refusals ---------------------------------------------------------------------------------


def test_a_part_larger_than_the_sheet_is_refused_with_its_sizes():
    with pytest.raises(
        NestingError, match=r"P007 needs 1200\.0 × 1039\.2 mm.*1000 × 800 mm.*larger"
    ):
        nest([part("P006", hourglass(100)), part("P007", turn(hourglass(400) * 1.5, 20))], SMALL)
    just = np.array([(0, 0), (980, 0), (980, 780), (0, 780)], float)
    for degrees in (0.0, 90.0, 20.0):  # exactly the room inside the margin
        flats = [part("P001", turn(just, degrees))]
        assert_sound(nest(flats, SMALL), flats)
    with pytest.raises(NestingError, match="P001"):
        nest([part("P001", just * 1.000001)], SMALL)


@pytest.mark.parametrize(
    ("outline", "message"),
    [
        ([(0, 0), (100, 100), (100, 0), (0, 100)], "P001: its blank crosses itself"),
        ([(0, 0), (0, 100), (100, 0)], "P001: its blank is clockwise"),
        ([(0, 0), (1, 0)], "three corners"),
        ([(0, 0), (1, 0), (np.nan, 1)], "three corners"),
    ],
)
def test_what_is_no_contour_is_refused(outline, message):
    with pytest.raises(NestingError, match=message):
        nest([part("P001", np.array(outline, float))], SMALL)


def test_wrong_requests_are_refused():
    good = part("P001", hourglass(100))
    with pytest.raises(NestingError, match="'spyrrow' or 'shelf'"):
        nest([good], SMALL, packer="guillotine")
    with pytest.raises(NestingError, match="P001 is used twice"):
        nest([good, good], SMALL)
    with pytest.raises(NestingError, match="no room"):
        nest([good], Stock(100.0, 100.0, 60.0))
    with pytest.raises(NestingError, match="spacing -1"):
        nest([good], Stock(1000.0, 800.0, 10.0, -1.0))
    with pytest.raises(NestingError, match="beyond the blank"):
        nest([part("P001", hourglass(100), blank=hourglass(90))], SMALL)
    with pytest.raises(NestingError, match="no stock sheet is given for HPL"):
        nest_all([good], {"S235": SMALL})


# -- verification -----------------------------------------------------------------------------


def moved(sheet, mark, **change):
    placements = tuple(
        dataclasses.replace(p, **change) if p.mark == mark else p for p in sheet.placements
    )
    return dataclasses.replace(sheet, placements=placements)


def test_a_bad_layout_is_refused_with_the_marks_and_the_distance():
    square = np.array([(0, 0), (100, 0), (100, 100), (0, 100)], float)
    flats = [part("P001", square), part("P002", square)]
    (sheet,) = nest(flats, SMALL, packer="shelf")
    base = dataclasses.replace(
        sheet, placements=(Placement("P001", 0, 10, 10), Placement("P002", 90, 218, 10))
    )
    verify_layout([base], flats)
    verify_layout([moved(base, "P002", x=218 - 9e-7)], flats)
    with pytest.raises(NestingError, match=r"P001 and P002 lie 7\.99999 mm apart"):
        verify_layout([moved(base, "P002", x=218 - 1e-5)], flats)
    with pytest.raises(NestingError, match="P001 and P002 lie 0 mm apart"):
        verify_layout([moved(base, "P002", x=150)], flats)
    with pytest.raises(NestingError, match="P002 lies 9 mm from the border"):
        verify_layout([moved(base, "P002", y=9)], flats)
    with pytest.raises(NestingError, match="P002 lies -90 mm"):
        verify_layout([moved(base, "P002", x=1090)], flats)
    with pytest.raises(NestingError, match="1 parts lie on no sheet, the first is P003"):
        verify_layout([base], [*flats, part("P003", square)])
    with pytest.raises(NestingError, match="holds P002, which is no part"):
        verify_layout([base], flats[:1])
    with pytest.raises(NestingError, match="P001 lies on"):
        verify_layout([base, base], flats)
    with pytest.raises(NestingError, match="P002 is S235 8 mm but lies on"):
        verify_layout([base], [flats[0], part("P002", square, STEEL)])
    with pytest.raises(NestingError, match="is empty"):
        verify_layout([dataclasses.replace(base, placements=())], [])


def test_parts_may_touch_where_no_spacing_is_asked_for():
    square = np.array([(0, 0), (100, 0), (100, 100), (0, 100)], float)
    flats = [part("P001", square), part("P002", square)]
    stock = Stock(1000.0, 800.0, 0.0, 0.0)
    (sheet,) = nest(flats, stock, packer="shelf")
    touching = dataclasses.replace(
        sheet, placements=(Placement("P001", 0, 0, 0), Placement("P002", 0, 100, 0))
    )
    verify_layout([touching], flats)
    with pytest.raises(NestingError, match="P001 and P002"):
        verify_layout([moved(touching, "P002", x=99.9)], flats)


# -- the whole job ----------------------------------------------------------------------------


def mixed():
    flats = panels(5, 90, 200, 4) + bars(4)
    return [
        *flats,
        part("X001", hourglass(80), HPL, 12.0),
        part("P900", hourglass(70), STEEL, 10.0),
    ]


def test_materials_and_thicknesses_lie_on_sheets_of_their_own():
    flats = mixed()
    stocks = {"HPL": SMALL, "S235": Stock(2000.0, 1000.0)}
    nested = nest_all(flats, stocks, packer="shelf")
    assert_sound(nested.sheets, flats)
    kinds = {(s.material.name, s.thickness) for s in nested.sheets}
    assert kinds == {("HPL", 8.0), ("HPL", 12.0), ("S235", 10.0)}
    assert all(sheet.stock == stocks[sheet.material.name] for sheet in nested.sheets)
    names = [sheet.name for sheet in nested.sheets]
    assert names[0] == "PANELS-HPL-8mm-01" and "PARTS-HPL-12mm-01" in names
    assert "PARTS-S235-10mm-01" in names  # bars and a panel of one material share sheets
    assert len(set(names)) == len(names)


def test_yield_is_the_area_of_outlines_over_that_of_the_sheet():
    square = np.array([(0, 0), (100, 0), (100, 100), (0, 100)], float)
    wider = np.array([(-5, -5), (105, -5), (105, 105), (-5, 105)], float)
    flats = [part("P001", square, blank=wider), part("P002", square, blank=wider)]
    (sheet,) = nest(flats, SMALL, packer="shelf")
    assert sheet_yield(sheet, flats) == pytest.approx(2 * 100 * 100 / 800e3)
    assert_sound([sheet], flats)


def test_a_layout_survives_json_and_is_used_again_only_while_nothing_has_changed():
    flats = mixed()
    first = nest_all(flats, SMALL, packer="shelf")
    text = layout_to_json(first)
    assert json.loads(text)["fingerprint"] == first.fingerprint
    assert layout_from_json(text).sheets == first.sheets
    again = nest_all(flats, SMALL, packer="shelf", previous=text)
    assert again.reused and again.sheets == first.sheets and layout_to_json(again) == text

    shifted = [dataclasses.replace(flats[0], outline=flats[0].outline * (1 - 1e-6)), *flats[1:]]
    for other, stock, seed in (
        (shifted, SMALL, 0),
        (flats, Stock(1000.0, 800.0, 10.0, 9.0), 0),
        (flats, SMALL, 1),
        (flats[1:], SMALL, 0),
    ):
        anew = nest_all(other, stock, seed=seed, packer="shelf", previous=text)
        assert not anew.reused and anew.fingerprint != first.fingerprint
        assert_sound(anew.sheets, other)


def test_the_kept_layout_itself_is_taken_not_a_new_one():
    flats = panels(3, 90, 120, 1)
    stock = Stock(3000.0, 800.0)
    first = nest_all(flats, stock, packer="shelf")
    mark = max(first.sheets[0].placements, key=lambda p: p.x).mark
    data = json.loads(layout_to_json(first))
    assert len(first.sheets) == 1
    # Slide one part to the far side of the sheet by hand: a shop may do so, if it stays sound.
    away = json.dumps({**data, "sheets": [_slid(data["sheets"][0], mark, 600.0)]})
    kept = nest_all(flats, stock, packer="shelf", previous=away)
    assert kept.reused and kept.sheets != first.sheets
    spoiled = json.dumps({**data, "sheets": [_slid(data["sheets"][0], mark, 6000.0)]})
    anew = nest_all(flats, stock, packer="shelf", previous=spoiled)
    assert not anew.reused and anew.sheets == first.sheets
    assert len(anew.notes) == 1 and mark in anew.notes[0]


def _slid(sheet, mark, by):
    rows = [[m, a, x + by if m == mark else x, y] for m, a, x, y in sheet["placements"]]
    return {**sheet, "placements": rows}


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"format": 99}', '{"format": 1, "sheets": [3]}'])
def test_an_unreadable_layout_is_noted_and_nested_anew(text):
    flats = panels(3, 90, 120, 1)
    nested = nest_all(flats, SMALL, packer="shelf", previous=text)
    assert not nested.reused and len(nested.notes) == 1
    assert nested.sheets == nest_all(flats, SMALL, packer="shelf").sheets


def test_progress_counts_up_to_all_parts():
    seen = []
    flats = mixed()
    nest_all(flats, SMALL, packer="shelf", progress=lambda done, total: seen.append((done, total)))
    assert seen[-1] == (len(flats), len(flats))
    assert [done for done, _ in seen] == sorted(done for done, _ in seen)

"""The design file: what may be asked for, and what is said when it is wrong."""

import datetime
import math
import pickle
import re
from dataclasses import fields
from fractions import Fraction
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from phexfab.design import MATERIALS, Design, load_design, make_design, parse_design, quantity
from phexfab.design.checks import Checks
from phexfab.design.fields import Section
from phexfab.design.model import Surface
from phexfab.design.rules import median_panel
from phexfab.errors import DesignError, LatticeError, PhexError
from phexfab.fabrication import bars, nodes, panels
from phexfab.fabrication.limits import KINDS, Limits
from phexfab.minimal import gauss_image
from phexfab.pipeline import build
from phexfab.remesh.lattice import check_directions
from phexfab.surface.catalog import catalog
from phexfab.triangular import EQUILATERAL, mean_distance

MINIMAL = '[surface]\nname = "catenoid"\n[lattice]\npanel_size = 600\n'
MANUAL = Path(__file__).parent.parent / "docs" / "design-file.md"


def with_key(table: str, line: str) -> str:
    """Return the minimal design with one more line in a table."""
    header = f"[{table}]\n"
    if header in MINIMAL:
        key = line.split("=")[0].strip()
        kept = [old for old in MINIMAL.splitlines() if old.split("=")[0].strip() != key]
        return "\n".join(kept).replace(header.strip(), header + line) + "\n"
    return MINIMAL + header + line + "\n"


def refusal(text: str) -> str:
    with pytest.raises(DesignError) as caught:
        parse_design(text, source="house.toml")
    return str(caught.value)


# -- what is right ---------------------------------------------------------------------------------


def test_a_minimal_file_is_enough():
    design = parse_design(MINIMAL)
    assert (design.lattice.panel_size, design.panels.thickness) == (600.0, 8.0)
    assert design.beams.height == 90.0
    assert design.offset.distance is None


def test_every_key_can_be_set_and_comes_back():
    text = """
        title = "Pavilion"
        [project]
        author = "A. Architect"
        organisation = "Office"
        revision = "B"
        date = 2026-05-01
        [surface]
        name = "enneper"
        order = 2
        bonnet_angle = "0.5 rad"
        scale = "2.2 m"
        u = [-0.8, 0.8]
        v = "closed"
        [border]
        direction = "plumb"
        sagitta = "1 cm"
        sliver = 0.1
        sliver_width = 20
        [lattice]
        panel_size = "2 ft"
        rows_along = "u"
        row_ratio = 1.1
        turn = 0
        evenness = 0.5
        [offset]
        type = "vertex"
        distance = "-9.8 cm"
        [panels]
        material = "cheese"
        density = "1.1 g/cm3"
        thickness = "0.5 in"
        gap = 6
        side = "inside"
        edges = "mitred"
        [beams]
        kind = "flat"
        material = "spruce"
        width = 40
        height = 120
        seat = 3
        ends = "hub"
        [nodes]
        kind = "hub"
        radius = 50
        clearance = 1
        [sheets.panels]
        length = "2.5 m"
        width = 1250
        margin = 5
        spacing = 6
        [nesting]
        packer = "shelf"
        seconds = "1 min"
        seed = 7
        [checks]
        panel_mass = "25 kg"
        shortest_edge = "3 cm"
        [output]
        dxf_version = "R12"
    """
    design = parse_design(text)
    assert design.project.date == datetime.date(2026, 5, 1)
    assert design.surface.bonnet_angle == pytest.approx(math.degrees(0.5), rel=1e-15)
    assert design.surface.u == (-0.8, 0.8)
    assert (design.surface.scale, design.lattice.panel_size) == (2200.0, 609.6)
    assert (design.offset.distance, design.panels.thickness) == (-98.0, 12.7)
    assert (design.panels.density, design.beams.density) == (1100.0, MATERIALS["spruce"])
    assert (design.sheets.panels.length, design.sheets.beams.length) == (2500.0, 3000.0)
    assert design.nesting.seconds == 60.0
    assert design.checks.limits() == {"panel_mass": 25.0, "shortest_edge": 30.0}


FILMS = [
    ('name = "enneper"\nradius = 0.9\ncentre = [0, 0.1]', {"source": "named", "radius": 0.9}),
    ('g = "z"\nheight_differential = "z"\nbase = [1, -2]', {"base": (1.0, -2.0)}),
    ('rim = "rim.csv"', {"source": "rim", "rim": ("rim.csv",), "unit": None}),
    (
        'rim = ["out.dxf", "in.step"]\nunit = "m"\nlayer = "RIM"\ncorner_angle = 25\n'
        'smooth_corners = "30 cm"\nfree = [1, 2]',
        {"rim": ("out.dxf", "in.step"), "unit": "m", "smooth_corners": 300.0, "free": (1, 2)},
    ),
    (
        "rim = [[0, 0, 0], [6000, 0, 900], [0, 6000, 0]]",
        {"rim": (((0.0, 0.0, 0.0), (6000.0, 0.0, 900.0), (0.0, 6000.0, 0.0)),)},
    ),
    (
        "rim = [[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 0, 2], [1, 0, 2], [0, 1, 2]]]",
        {"source": "rim"},
    ),
    ('mesh = "film.obj"\nunit = "m"', {"source": "mesh", "mesh": "film.obj"}),
    (
        'periodic = "gyroid"\ncells = [2, 1, 3]\nscale = "4 m"',
        {"source": "periodic", "cells": (2, 1, 3), "scale": 4000.0},
    ),
]


@pytest.mark.parametrize(("lines", "expected"), FILMS)
def test_every_kind_of_film_can_be_asked_for(lines, expected):
    design = parse_design(f"[surface]\n{lines}\n[lattice]\npanel_size = 600\n")
    assert {key: getattr(design.surface, key) for key in expected} == expected
    assert Design.model_validate(design.model_dump()) == design
    assert Design.model_validate_json(design.model_dump_json()) == design
    assert len({design, make_design(design.model_dump())}) == 1


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ('rim = "a.csv"\nmesh = "b.obj"', ["several surfaces", "leave out rim, or mesh"]),
        ('rim = "a.csv"\nscale = 2', ["surface.scale", "its own size"]),
        ('name = "enneper"\nfree = [1]', ["surface.free", "belongs to rim"]),
        ('name = "enneper"\nbase = [1, 0]', ["surface.base", "height_differential"]),
        ('name = "enneper"\nunit = "m"', ["surface.unit", "rim or mesh"]),
        ('name = "enneper"\nradius = 1\nu = [0, 1]', ["surface.u", "given by radius"]),
        ('periodic = "gyroid"\ncells = [0, 1, 1]', ["surface.cells", "at least one"]),
        ('mesh = "a.obj"\ncells = [2, 1, 1]', ["surface.cells", "belongs to periodic"]),
        ("rim = 3", ["surface.rim = 3", "a file", 'write rim = "rim.csv"']),
        ("rim = [[0, 0], [1, 1]]", ["surface.rim", "points [[x, y, z], …]"]),
        ('rim = "a.csv"\n[lattice]\nturn = 3', ["lattice.turn", "umbilics"]),
    ],
)
def test_a_film_has_one_source_and_no_keys_of_another(lines, words):
    tail = "panel_size = 600\n"
    text = f"[surface]\n{lines}\n{'' if '[lattice]' in lines else '[lattice]'}\n{tail}"
    told = refusal(text)
    for word in words:
        assert word in told


def test_a_design_survives_a_round_trip_and_keeps_where_it_came_from(tmp_path):
    path = tmp_path / "house.toml"
    path.write_text(with_key("project", 'date = "2026-05-01"'), encoding="utf-8")
    design = load_design(path)
    assert Design.model_validate(design.model_dump()) == design
    assert Design.model_validate_json(design.model_dump_json()) == design
    assert (design.source, design.text) == (str(path), path.read_text())
    again = pickle.loads(pickle.dumps(design))
    assert (again, again.source, again.text) == (design, design.source, design.text)
    assert "text" not in design.model_dump()


def test_designs_are_keys_of_a_dictionary():
    one, same = parse_design(MINIMAL, source="a"), parse_design(MINIMAL, source="b")
    other = parse_design(with_key("lattice", "panel_size = 500"))
    assert len({one: 1, same: 2, other: 3}) == 2
    assert one != other and one != "a design"


def test_a_design_cannot_be_changed():
    with pytest.raises(ValueError, match="frozen"):
        parse_design(MINIMAL).panels.thickness = 3


def test_the_name_is_the_title_or_the_file():
    assert parse_design('title = "Pavilion"\n' + MINIMAL, source="x/y.toml").name == "Pavilion"
    assert parse_design(MINIMAL, source="x/y.toml").name == "y"


def test_a_byte_order_mark_is_no_mistake(tmp_path):
    path = tmp_path / "windows.toml"
    path.write_bytes(b"\xef\xbb\xbf" + MINIMAL.replace("\n", "\r\n").encode())
    assert load_design(path) == parse_design(MINIMAL)


def test_a_design_given_as_dictionaries():
    made = make_design({"surface": {"name": "catenoid"}, "lattice": {"panel_size": "60 cm"}})
    assert made == parse_design(MINIMAL)


def test_a_rounded_equilateral_ratio_is_exactly_equilateral():
    design = parse_design(with_key("lattice", "row_ratio = 0.866"))
    assert design.lattice.row_ratio == EQUILATERAL


@pytest.mark.parametrize("name", MATERIALS)
def test_known_materials_need_no_density(name):
    design = parse_design(with_key("panels", f'material = "{name.upper()}"'))
    assert design.panels.density == MATERIALS[name]


# -- what is wrong: each message names key, value and remedy --------------------------------------

WRONG = [
    # table, line, key, value as written, words of the remedy
    ("panels", "thikness = 8", "panels.thikness", "8", 'did you mean "thickness"?'),
    ("panels", "radius = 8", "panels.radius", "8", "it belongs to [surface] or [nodes]"),
    ("nesting", "qqq = 8", "nesting.qqq", "8", "packer, seconds, seed"),
    ("frobnicate", "x = 8", "frobnicate", "{…}", "a design knows title, project, surface"),
    ("panels", 'thickness = "8 kg"', "panels.thickness", '"8 kg"', "mass, but a length"),
    ("panels", 'thickness = "8 furlong"', "panels.thickness", '"8 furlong"', "one of mm, cm, m"),
    ("panels", 'thickness = "eight"', "panels.thickness", '"eight"', 'write 8 or "8 mm"'),
    ("panels", 'thickness = "0,8 cm"', "panels.thickness", '"0,8 cm"', "decimals with a point"),
    ("panels", "thickness = -8", "panels.thickness", "-8", "write for example thickness = 8"),
    ("panels", 'thickness = "-8 mm"', "panels.thickness", '"-8 mm"', "must be greater than 0"),
    ("panels", "thickness = 0", "panels.thickness", "0", "must be greater than 0"),
    ("panels", "thickness = true", "panels.thickness", "true", 'write 8 or "8 mm"'),
    ("panels", "thickness = nan", "panels.thickness", "nan", 'write 8 or "8 mm"'),
    ("panels", "thickness = inf", "panels.thickness", "inf", 'write 8 or "8 mm"'),
    ("panels", 'thickness = "1e999 mm"', "panels.thickness", '"1e999 mm"', 'write 8 or "8 mm"'),
    ("panels", "gap = -1", "panels.gap", "-1", "must be at least 0"),
    ("panels", "gap = 600", "panels.gap", "600", "take a smaller gap"),
    ("panels", 'side = "outsid"', "panels.side", '"outsid"', 'did you mean "outside"?'),
    ("panels", 'edges = "beveled"', "panels.edges", '"beveled"', '"square", "mitred"'),
    ("panels", "material = 3", "panels.material", "3", "put it in quotes"),
    ("panels", 'density = "3 mm"', "panels.density", '"3 mm"', "length, but a density"),
    ("beams", "height = 0", "beams.height", "0", "write for example height = 90"),
    ("beams", "height = 1600", "beams.height", "1600", "larger sheets"),
    ("beams", "width = 500", "beams.width", "500", "take slimmer beams"),
    ("beams", 'ends = "hub"', "beams.ends", '"hub"', 'take nodes.kind = "hub"'),
    ("nodes", 'kind = "hub"', "nodes.kind", '"hub"', 'take beams.ends = "hub"'),
    ("lattice", "panel_size = 1500", "lattice.panel_size", "1500", "smaller panels or larger"),
    ("lattice", "panel_size = 0", "lattice.panel_size", "0", "must be greater than 0"),
    ("lattice", "row_ratio = 0.5", "lattice.row_ratio", "0.5", "must be greater than 0.5"),
    ("lattice", "row_ratio = -1", "lattice.row_ratio", "-1", "must be greater than 0.5"),
    ("lattice", 'row_ratio = "1"', "lattice.row_ratio", '"1"', "0.866"),
    ("lattice", "row_ratio = 1.2", "lattice.row_ratio", "1.2", 'take offset.type = "face"'),
    ("lattice", "row_ratio = 0.51", "lattice.row_ratio", "0.51", "take 0.54 or more"),
    ("lattice", "turn = 15", "lattice.turn", "15", "keep turn within ±13.0°"),
    ("lattice", "turn = -15", "lattice.turn", "-15", "keep turn within ±13.0°"),
    ("lattice", 'turn = "15 mm"', "lattice.turn", '"15 mm"', "length, but an angle"),
    ("lattice", 'rows_along = "w"', "lattice.rows_along", '"w"', '"u", "v"'),
    ("offset", 'type = "edges"', "offset.type", '"edges"', 'did you mean "edge"?'),
    ("offset", 'distance = "far"', "offset.distance", '"far"', 'write -98 or "-9.8 cm"'),
    ("surface", "order = 0", "surface.order", "0", "must be at least 1"),
    ("surface", 'order = "2"', "surface.order", '"2"', "without quotes"),
    ("surface", "scale = -1", "surface.scale", "-1", "must be greater than 0"),
    ("surface", "u = [1, 0]", "surface.u", "[1, 0]", "the smaller number first"),
    ("surface", "u = [1, 1]", "surface.u", "[1, 1]", "the smaller number first"),
    ("surface", "u = [1]", "surface.u", "[1]", "write [0.0, 1.0]"),
    ("surface", 'v = "open"', "surface.v", '"open"', 'write [from, to] or "closed"'),
    ("surface", 'v = ["a", "b"]', "surface.v", '["a", "b"]', 'or "closed"'),
    ("sheets.panels", "margin = 800", "sheets.panels.margin", "800", "smaller margin"),
    ("sheets.beams", "length = 0", "sheets.beams.length", "0", "must be greater than 0"),
    ("sheets.panels", "lenght = 9", "sheets.panels.lenght", "9", 'did you mean "length"?'),
    ("nesting", "seed = 1.5", "nesting.seed", "1.5", "without a point"),
    ("nesting", "seed = true", "nesting.seed", "true", "without a point"),
    ("nesting", 'seconds = "3 mm"', "nesting.seconds", '"3 mm"', "length, but a time"),
    ("nesting", 'packer = "best"', "nesting.packer", '"best"', '"spyrrow", "shelf"'),
    ("output", 'dxf_version = "R13"', "output.dxf_version", '"R13"', '"R2010", "R12"'),
    ("project", 'date = "1 May"', "project.date", '"1 May"', "write it as 2026-05-01"),
    ("checks", "panel_mas = 3", "checks.panel_mas", "3", 'did you mean "panel_mass"?'),
    ("checks", "panel_mass = -3", "checks.panel_mass", "-3", "must be at least 0"),
    ("checks", 'panel_mass = "3 mm"', "checks.panel_mass", '"3 mm"', "length, but a mass"),
    ("checks", 'mitre_angle = "3 mm"', "checks.mitre_angle", '"3 mm"', "length, but an angle"),
    ("project", "date = 3", "project.date", "3", "write it as 2026-05-01"),
]


@pytest.mark.parametrize(("table", "line", "key", "value", "remedy"), WRONG)
def test_a_wrong_key_is_refused_by_name_with_value_and_remedy(table, line, key, value, remedy):
    text = with_key(table, line)
    message = refusal(text)
    first, *lines = message.splitlines()
    assert first == "house.toml: one thing is wrong", message
    at = text.splitlines().index(line if key != table else f"[{table}]") + 1
    assert lines[0].startswith(f"  {key} = {value} (line {at}): "), message
    assert remedy in lines[0], message


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["surface: is missing", "[surface]", "lattice: is missing", "[lattice]"]),
        (MINIMAL.replace("panel_size", "# "), ["lattice.panel_size: is missing", "= 600"]),
        (MINIMAL.replace("name", "# "), ["surface.name", 'add name = "catenoid"']),
        (MINIMAL.replace('name = "catenoid"', 'g = "z"'), ["surface.height_differential", "add"]),
        ("surface = 3\n", ["surface = 3 (line 1)", "write it as [surface]"]),
        (with_key("panels", 'material = "cheese"'), ["panels.density", '"cheese"', "HPL"]),
        (with_key("surface", 'u = "closed"\nv = "closed"'), ["surface.v", "for one of them"]),
        (
            with_key("surface", 'v = "closed"').replace("= 600", "= 600\nturn = 4"),
            ["lattice.turn = 4", "take turn = 0"],
        ),
        (
            MINIMAL + '[beams]\nends = "hub"\n[nodes]\nkind = "hub"\nradius = 180\n',
            ["nodes.radius = 180", "346 mm", "take a smaller radius"],
        ),
        (with_key("surface", 'g = "z"'), ['surface.name = "catenoid"', "leave out name"]),
        (
            MINIMAL.replace("name", "order = 2\nheight_differential = 'z'\ng"),
            ["surface.order = 2", "leave it out"],
        ),
    ],
)
def test_what_is_missing_or_does_not_go_together(text, words):
    message = refusal(text)
    for word in words:
        assert word in message, message


def test_all_mistakes_are_named_at_once_in_the_order_of_the_file():
    message = refusal(
        'titel = "x"\n[panels]\nthickness = "8 kg"\ngap = 700\n[lattice]\npanel_size = 600\n'
        'turn = 15\n[surface]\nname = "catenoid"\nu = 3\n[sheets.beams]\nwidht = 3\n'
    )
    keys = [line.split()[0] for line in message.splitlines()[1:]]
    assert message.startswith("house.toml: 5 things are wrong")
    assert keys == ["titel", "panels.thickness", "lattice.turn", "surface.u", "sheets.beams.widht"]


def test_a_mistake_in_one_table_hides_no_rule_about_others():
    message = refusal(with_key("lattice", "turn = 15").replace("name =", "nam ="))
    assert "lattice.turn = 15" in message and "surface.nam" in message


@pytest.mark.parametrize(
    ("text", "line"),
    [("[surface]\nname = catenoid\n", 2), ("x = 1\n\n\ny = = 2\n", 4), ("[surface\n", 1)],
)
def test_a_slip_of_toml_is_reported_with_its_line(text, line):
    message = refusal(text)
    assert message.startswith(f"house.toml: line {line} is not TOML")
    assert text.splitlines()[line - 1] in message


@pytest.mark.parametrize(
    ("line", "remedy"),
    [
        ("[lattice]\n", "each table and each key stands in the file once"),
        ("panel_size = 500\npanel_size = 600\n", "each table and each key stands in the file once"),
        ("panel size = 450\n", "write key = value; keys have no spaces"),
        ("panel_size: 450\n", "write key = value; keys have no spaces"),
        ("title = “Roof”\n", "quotes are straight"),
        ("title = Roof\n", "stand in quotes"),
        ("[panels\n", "write a table as [name]"),
    ],
)
def test_a_slip_of_toml_comes_with_its_own_remedy(line, remedy):
    assert remedy in refusal(MINIMAL + line).splitlines()[2]


def test_of_a_list_the_wrong_item_is_named_with_the_list_and_its_line():
    text = with_key("output", 'files = ["glb", "stp"]')
    line = text.splitlines().index('files = ["glb", "stp"]') + 1
    assert f'output.files = ["glb", "stp"] (line {line}): "stp": no such choice' in refusal(text)


def test_a_material_spelt_otherwise_is_proposed():
    message = refusal(with_key("panels", 'material = "Aluminum"'))
    assert 'did you mean material = "aluminium"? add density' in message
    assert "did you mean" not in refusal(with_key("panels", 'material = "cheese"'))


@pytest.mark.parametrize(
    "surface", ['rim = "eaves.csv"', 'rim = ["eaves.csv"]', 'mesh = "eaves.csv"']
)
def test_a_file_that_is_not_there_is_named_by_its_key(tmp_path, surface):
    design = tmp_path / "house.toml"
    design.write_text(f"[surface]\n{surface}\n[lattice]\npanel_size = 600\n", encoding="utf-8")
    key = surface.split()[0]
    with pytest.raises(
        DesignError, match=rf'^surface\.{key} = "eaves\.csv": there is no such file'
    ):
        build(design)


def test_a_flat_rim_is_told_to_bend():
    ring = np.linspace(0, 2 * np.pi, 49)[:-1]
    points = np.column_stack([3000 * np.cos(ring), 2000 * np.sin(ring), 0 * ring])
    keys = {"surface": {"rim": [points.tolist()]}, "lattice": {"panel_size": 600}}
    with pytest.raises(PhexError, match=r"the film is a plane.*bend the rim out of its plane"):
        build(make_design(keys))


def test_files_that_cannot_be_read(tmp_path):
    with pytest.raises(DesignError, match=r"nowhere\.toml: there is no such file"):
        load_design(tmp_path / "nowhere.toml")
    with pytest.raises(DesignError, match="is a folder"):
        load_design(tmp_path)
    (tmp_path / "drawing.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(DesignError, match=r"drawing\.toml: is not text in UTF-8"):
        load_design(tmp_path / "drawing.toml")


# -- the numbers that the rules stand on -----------------------------------------------------------


@pytest.mark.parametrize("ratio", [0.55, EQUILATERAL, 1.3, 2.0])
def test_the_rule_about_directions_is_the_lattice_s_own(ratio):
    for turn in np.arange(-90.0, 91.0, 1.5):
        text = with_key("lattice", f"turn = {turn}\nrow_ratio = {ratio}")
        text += '[offset]\ntype = "face"\n'
        try:
            check_directions(ratio, float(turn))
        except LatticeError:
            assert "asymptotic" in refusal(text)
        else:
            assert parse_design(text).lattice.turn == turn


@pytest.mark.parametrize("ratio", [0.55, 0.7, EQUILATERAL, 1.0, 1.4, 2.0])
def test_the_median_panel_is_where_the_tangent_planes_of_its_neighbours_meet(ratio):
    # Independent route: on the surface z = (y² - x²)/2 + O(3) the tangent planes at 0, p and q
    # meet where B(p, x) = B(p, p)/2 and B(q, x) = B(q, q)/2, B the second fundamental form.
    design = parse_design(with_key("lattice", f"row_ratio = {ratio}") + '[offset]\ntype="face"\n')
    step = 600.0 / mean_distance(ratio)
    half = step * np.array([[1.0, 0.0], [0.5, ratio], [-0.5, ratio]])
    ring = np.concatenate([half, -half])
    form = np.diag([-1.0, 1.0])
    corners = []
    for p, q in zip(ring, np.roll(ring, -1, axis=0), strict=True):
        pair = np.array([p, q])
        corners.append(np.linalg.solve(pair @ form, np.einsum("ki,ij,kj->k", pair, form, pair) / 2))
    panel = shapely.Polygon(corners)
    box = panel.convex_hull
    edges = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)

    asked = median_panel(design.lattice)
    low_x, low_y, high_x, high_y = panel.bounds
    assert panel.is_valid and panel.area == pytest.approx(step**2 * ratio, rel=1e-9)
    assert box.area == pytest.approx((high_x - low_x) * (high_y - low_y), rel=1e-9)
    assert (asked.width, asked.length) == pytest.approx((high_x - low_x, high_y - low_y), rel=1e-9)
    assert asked.width <= asked.length
    assert asked.short_edge == pytest.approx(np.sort(edges)[:4], rel=1e-9)

    def left(gap: float) -> shapely.Geometry:
        return panel.buffer(-gap / 2, join_style="mitre", mitre_limit=100.0)

    assert left(asked.widest_gap * (1 - 1e-6)).geom_type == "Polygon"
    after = left(asked.widest_gap * (1 + 1e-6))
    assert after.is_empty or after.geom_type == "MultiPolygon"


# -- units ---------------------------------------------------------------------------------------

QUANTITIES = [
    ("8 mm", "length", 8.0),
    ("0.8 cm", "length", 8.0),
    ("1.1cm", "length", 11.0),
    ("3 m", "length", 3000.0),
    ("1.5 in", "length", 38.1),
    ("2 ft", "length", 609.6),
    ("50 um", "length", 0.05),
    ("1_200", "length", 1200.0),
    ("+1.2e3 mm", "length", 1200.0),
    (" .5 m ", "length", 500.0),
    ("30 deg", "angle", 30.0),
    ("30°", "angle", 30.0),
    ("100 gon", "angle", 90.0),
    ("0.5 rad", "angle", math.degrees(0.5)),
    ("20 kg", "mass", 20.0),
    ("500 g", "mass", 0.5),
    ("2 lb", "mass", 0.90718474),
    ("7850 kg/m3", "density", 7850.0),
    ("1.35 g/cm3", "density", 1350.0),
    ("2.5 t/m³", "density", 2500.0),
    ("62.42796 lb/ft3", "density", 1000.0),
    ("1.5 min", "time", 90.0),
]


@pytest.mark.parametrize(("text", "kind", "value"), QUANTITIES)
def test_quantities_with_units(text, kind, value):
    assert quantity(text, kind) == pytest.approx(value, rel=1e-7 if "lb/" in text else 4e-16)


@pytest.mark.parametrize("text", ["8 kg", "30 deg", "7850 kg/m3", "5 min"])
def test_a_unit_of_another_kind_is_refused_by_name(text):
    with pytest.raises(DesignError, match="but a length is needed; write 8 or"):
        quantity(text, "length")


@pytest.mark.parametrize(
    "value", ["", "mm", "eight", "8 mm mm", "8 mm; 3", "1e9999", "--8", "8 MM", None, [8], True]
)
def test_what_is_no_quantity_is_refused(value):
    with pytest.raises(DesignError):
        quantity(value, "length")


@given(st.decimals(-1000, 1000, places=4), st.sampled_from(["mm", "cm", "m", "in", "ft"]))
def test_conversion_is_correctly_rounded(number, unit):
    factor = {"mm": "1", "cm": "10", "m": "1000", "in": "25.4", "ft": "304.8"}[unit]
    assert quantity(f"{number} {unit}", "length") == float(Fraction(str(number)) * Fraction(factor))


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_bare_numbers_and_their_text_agree(number):
    if abs(number) < 1e299:
        assert quantity(number, "length") == number
        assert quantity(repr(number), "length") == number


# -- agreement with the other rooms ----------------------------------------------------------------


@pytest.mark.parametrize("name", catalog)
def test_every_option_of_the_catalog_is_a_key(name):
    assert set(catalog[name].options) <= set(Surface.model_fields)


def test_every_check_has_its_key_and_every_key_its_check():
    assert set(Checks.model_fields) == {field.name for field in fields(Limits)} == set(KINDS)


@pytest.mark.parametrize("name", KINDS)
def test_limits_are_given_in_the_check_s_unit(name):
    unit = {"1": "", "mm": "mm", "deg": "deg", "kg": "kg"}[KINDS[name].unit]
    value = f'"3 {unit}"' if unit else "3"
    design = parse_design(with_key("checks", f"{name} = {value}"))
    assert getattr(Limits(**design.checks.limits()), name) == 3.0
    other = "rad/s" if not unit else "kg" if unit != "kg" else "mm"
    assert f"checks.{name}" in refusal(with_key("checks", f'{name} = "3 {other}"'))


def test_panels_beams_and_nodes_accept_every_choice():
    for table, key, room in (
        ("panels", "side", panels.SIDES),
        ("panels", "edges", panels.EDGES),
        ("beams", "ends", bars.ENDS),
        ("nodes", "kind", nodes.KINDS),
        ("offset", "type", gauss_image.KINDS),
    ):
        field = getattr(parse_design(MINIMAL), table).__class__.model_fields[key]
        assert set(get_args(field.annotation)) == set(room)


# -- the manual --------------------------------------------------------------------------------


def keys(model: type[Section], path: str = "") -> list[str]:
    """Return the paths of all keys below a model."""
    found = []
    for name, field in model.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, Section):
            found += keys(kind, f"{path}{name}.")
        else:
            found.append(path + name)
    return found


@pytest.mark.parametrize("key", keys(Design))
def test_the_manual_names_every_key_with_its_default(key):
    table, _, name = key.rpartition(".")
    text = MANUAL.read_text(encoding="utf-8")
    section = text.split(f"## `[{table}]`", 1)[-1].split("\n## ", 1)[0] if table else text
    row = re.search(rf"^\| `{name}` \| (.*?) \| ", section, re.MULTILINE)
    assert row, f"docs/design-file.md does not explain {key}"
    value = parse_design(MINIMAL).model_dump()
    for step in key.split("."):
        value = value[step]
    if table == "checks":
        value = getattr(Limits(), name)
    if isinstance(value, float | int) and name not in ("panel_size", "density"):
        assert float(row[1]) == pytest.approx(value, rel=1e-4)
    elif isinstance(value, str) and key not in ("title", "surface.name"):
        assert row[1] == f'`"{value}"`'


def test_the_manual_s_example_is_a_design():
    block = MANUAL.read_text(encoding="utf-8").split("```toml\n", 1)[1].split("```", 1)[0]
    assert parse_design(block).surface.name == "catenoid"

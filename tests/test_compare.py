"""Triangles, quads and hexagons on one surface: counted and measured again by other routes."""

import csv
import io
import json

import numpy as np
import pytest
from typer.testing import CliRunner

from phexfab.cli import app
from phexfab.compare import compare
from phexfab.design import parse_design
from phexfab.errors import DesignError
from phexfab.mesh.measures import edge_lengths

SMALL = """title = "small"
[surface]
name = "enneper"
scale = "4 m"
u = [-0.6, 0.6]
v = [-0.6, 0.6]
[lattice]
panel_size = 420
[panels]
density = 7850
gap = 6
[sheets.panels]
length = 3000
width = 1500
"""
RING = '[surface]\nname = "catenoid"\nv = "closed"\n[lattice]\npanel_size = 900\n'
NAMES = ["triangles", "quads", "hexagons"]


@pytest.fixture(scope="module")
def found():
    return compare(parse_design(SMALL))


def test_inside_six_four_and_three_members_meet(found):
    assert [row.name for row in found.rows] == NAMES
    assert [row.figures["valence"] for row in found.rows] == [6, 4, 3]


@pytest.mark.parametrize("name", NAMES)
def test_members_are_counted(found, name):
    row = found.row(name)
    once = set()
    for face in row.mesh.faces:
        once |= {frozenset((int(i), int(j))) for i, j in zip(face, np.roll(face, 1), strict=True)}
    assert row.figures["members"] == len(once)
    assert row.figures["nodes"] - row.figures["members"] + row.figures["panels"] == 1
    points = row.mesh.vertices
    total = sum(np.linalg.norm(points[i] - points[j]) for i, j in map(tuple, once))
    assert row.figures["member_length"] == pytest.approx(total / 1000)
    assert row.figures["member_mass"] == pytest.approx(total * 10 * 90 * 7850e-9)


def test_panels_are_of_one_mean_area(found):
    sizes = [row.figures["panel_area"] for row in found.rows]
    assert np.ptp(sizes) < 0.01 * np.mean(sizes)
    assert np.ptp([row.figures["covered_area"] for row in found.rows]) < 0.25 * np.mean(
        [row.figures["covered_area"] for row in found.rows]
    )


def test_all_panels_are_planar(found):
    assert max(row.figures["planarity"] for row in found.rows) <= 1e-10


def test_hexagons_alone_have_exact_offsets_and_no_torsion(found):
    triangles, quads, hexagons = found.rows
    assert "face" in hexagons.figures["offset_types"]
    assert triangles.figures["offset_types"] == quads.figures["offset_types"] == "none"
    assert hexagons.figures["torsion"] < 1e-6
    assert triangles.figures["torsion"] > 1 > quads.figures["torsion"] > 1e-6


def test_where_hexagons_lose(found):
    assert [row.figures["nonconvex_panels"] for row in found.rows[:2]] == [0, 0]
    assert found.row("hexagons").figures["nonconvex_panels"] == found.row("hexagons").mesh.n_faces
    # An acute triangle fills half of its least rectangle, a quad of curvature lines nearly all.
    waste = [row.figures["box_waste"] for row in found.rows]
    assert waste[0] == pytest.approx(50)
    assert waste[1] < 15 < waste[2] < waste[0]


@pytest.mark.parametrize("name", NAMES)
def test_waste_in_nests_and_mass_follow_from_the_cut_area(found, name):
    figures = found.row(name).figures
    cut = figures["panel_mass"] / 8 / 7850 * 1e9  # mm²
    if found.row(name).figures["sheets"] is not None:
        sheets = figures["sheets"] * 3000 * 1500
        assert figures["nest_waste"] == pytest.approx(100 * (1 - cut / sheets))
    # The gap of 6 mm takes a strip of 3 mm off along every edge, less the corners.
    edge = sum(
        np.linalg.norm(p - np.roll(p, 1, axis=0), axis=1).sum()
        for p in map(found.row(name).mesh.polygon, range(figures["panels"]))
    )
    assert figures["covered_area"] * 1e6 - cut == pytest.approx(3 * edge, rel=0.03)


def test_equal_deviation_is_equal():
    found = compare(parse_design(SMALL), "deviation")
    away = [row.figures["deviation"] for row in found.rows]
    assert np.abs(np.log(np.array(away) / away[2])).max() < 0.12
    assert found.row("triangles").figures["panels"] > 1.2 * found.row("hexagons").figures["panels"]


def test_a_ring_stays_a_ring():
    for row in compare(parse_design(RING)).rows:
        figures = row.figures
        assert figures["nodes"] - figures["members"] + figures["panels"] == 0
        assert figures["deviation"] < 0.2 * edge_lengths(row.mesh).max()


def test_panels_too_large_for_the_sheet_are_said_so():
    text = SMALL.replace("length = 3000\nwidth = 1500", "length = 560\nwidth = 560")
    row = compare(parse_design(text)).row("triangles")
    assert row.figures["nest_waste"] is None and row.figures["sheets"] is None
    (note,) = row.notes
    assert "not nested" in note


def test_without_beams_members_weigh_nothing():
    row = compare(parse_design(SMALL + '[beams]\nkind = "none"\n')).row("quads")
    assert row.figures["member_mass"] == 0 and row.figures["member_length"] > 0
    assert "no beams" in row.notes[-1]


@pytest.mark.parametrize("options", [{"equal": "weight"}, {"packer": "hand"}])
def test_unknown_options_are_refused(options):
    with pytest.raises(DesignError, match="choose"):
        compare(parse_design(SMALL), **options)


def test_tables_agree_and_bytes_repeat(found, tmp_path):
    again = compare(parse_design(SMALL))
    found.write(tmp_path / "a")
    again.write(tmp_path / "b")
    names = sorted(path.name for path in (tmp_path / "a").iterdir())
    assert names == ["comparison.csv", "comparison.json", "comparison.png"]
    for name in names:
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    data = json.loads((tmp_path / "a" / "comparison.json").read_text(encoding="utf-8"))
    rows = list(csv.reader(io.StringIO((tmp_path / "a" / "comparison.csv").read_text("utf-8"))))
    assert [row[0] for row in rows[1:]] == NAMES
    for row in rows[1:]:
        for head, text in zip(rows[0][1:], row[1:], strict=True):
            key = head.split(" [")[0]
            value = data["rows"][row[0]][key]
            assert text == ("" if value is None else str(value))
            assert head == (f"{key} [{unit}]" if (unit := data["columns"][key]["unit"]) else key)
    assert (tmp_path / "a" / "comparison.png").read_bytes().startswith(b"\x89PNG")


def run(*words):
    return CliRunner().invoke(app, [str(word) for word in words])


@pytest.mark.parametrize("columns", [40, 100])
def test_the_command_prints_and_writes(tmp_path, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", str(columns))
    design = tmp_path / "small.toml"
    design.write_text(SMALL)
    result = run("compare", design, "-o", tmp_path / "out")
    assert result.exit_code == 0, result.output
    for word in ("small, equal size", "members at an inner node", "face"):
        assert word in result.stdout
    assert len(list((tmp_path / "out").iterdir())) == 3


@pytest.mark.parametrize("words", [("--equal", "weight"), ("--packer", "hand"), ("-o", "FILE")])
def test_wrong_options_are_code_2(tmp_path, words):
    design = tmp_path / "small.toml"
    design.write_text(SMALL)
    result = run("compare", design, words[0], str(design) if words[1] == "FILE" else words[1])
    assert result.exit_code == 2
    assert "Traceback" not in result.stderr

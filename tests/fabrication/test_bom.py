"""The bill of materials says what the parts are, row by row, and the same bytes every time."""

import csv

import numpy as np
import pytest
from parts_samples import sample

from phexfab.fabrication.bars import BeamSpec
from phexfab.fabrication.beams import beams
from phexfab.fabrication.bom import (
    BOM_COLUMNS,
    CUT_LIST_COLUMNS,
    bom_rows,
    cut_list,
    least_boxes,
    write_bom,
)
from phexfab.fabrication.nodes import NodeSpec, nodes
from phexfab.fabrication.panels import PanelSpec, panels
from phexfab.fabrication.parts import Material, Parts, Placement, Sheet, Stock

OAK = Material("oak", 700.0)


@pytest.fixture(scope="module")
def parts():
    shell, panel = sample("edge"), PanelSpec(8.0, 6.0, edges="mitred", material=OAK)
    bars = BeamSpec(ends="hub")
    return Parts(
        panels(shell, panel), beams(shell, bars, panel), nodes(shell, NodeSpec("hub"), bars, panel)
    )


def read(path):
    with open(path, encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_one_row_per_part_with_its_figures(parts, tmp_path):
    placed = (Placement(parts.panels[2].mark, 0.0, 1.0, 1.0),)
    sheet = Sheet("panels-8mm-1", Stock(3000, 1500), 8.0, OAK, placed)
    rows = read(write_bom(tmp_path / "bom.csv", bom_rows(parts, [sheet])))
    everything = (*parts.panels, *parts.beams, *parts.nodes)
    assert list(rows[0]) == list(BOM_COLUMNS)
    assert [row["mark"] for row in rows] == [part.mark for part in everything]
    for row, part in zip(rows, everything, strict=True):
        assert float(row["volume_mm3"]) == pytest.approx(part.volume, abs=5.1e-5)
        assert float(row["mass_kg"]) == pytest.approx(part.mass, abs=5.1e-5)
    panel, beam, node = rows[2], rows[len(parts.panels)], rows[-1]
    assert (panel["kind"], panel["material"], panel["sheet"]) == ("panel", "oak", "panels-8mm-1")
    assert rows[3]["sheet"] == ""
    assert float(panel["area_m2"]) == pytest.approx(parts.panels[2].area * 1e-6, abs=5.1e-7)
    angles = [note.bevel for note in parts.panels[2].flat.edges]
    np.testing.assert_allclose([float(a) for a in panel["bevels_deg"].split()], angles, atol=5.1e-4)
    marks = [note.neighbour for note in parts.panels[2].flat.edges if note.neighbour]
    assert panel["neighbours"].split() == marks
    first = parts.beams[0]
    assert (beam["kind"], beam["section_mm"], beam["thickness_mm"]) == ("beam", "10x90", "10.00")
    box = np.ptp(first.flat.outline, axis=0)
    assert float(beam["length_mm"]) == pytest.approx(box[0], abs=5.1e-3)
    assert float(beam["width_mm"]) == 90.0
    assert len(beam["mitres_deg"].split()) == 4
    assert len(beam["slopes_deg"].split()) == 2
    assert set(beam["neighbours"].split()) == {*first.neighbours, *first.nodes}
    assert (node["kind"], node["section_mm"], node["thickness_mm"]) == ("node", "D60", "")
    assert float(node["length_mm"]) == pytest.approx(parts.nodes[-1].cylinder.length, abs=5.1e-3)


def test_beam_area_is_that_of_its_outline(parts):
    rows = bom_rows(Parts((), parts.beams))
    for row, beam in zip(rows, parts.beams, strict=True):
        x, y = beam.flat.outline.T
        area = abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))) / 2
        assert row["area_m2"] == pytest.approx(area * 1e-6, rel=1e-12)


def test_the_same_parts_give_the_same_bytes(parts, tmp_path):
    first = write_bom(tmp_path / "a.csv", bom_rows(parts)).read_bytes()
    second = write_bom(tmp_path / "b.csv", bom_rows(parts)).read_bytes()
    assert first == second
    assert b"\r" not in first
    assert b"-0.000" not in first.replace(b"-0.0001", b"")


def test_a_cut_list_adds_up(parts, tmp_path):
    rows = bom_rows(parts)
    lines = cut_list(rows)
    assert [(line["kind"], line["quantity"]) for line in lines] == [
        ("panel", len(parts.panels)),
        ("beam", len(parts.beams)),
        ("node", len(parts.nodes)),
    ]
    mass = sum(part.mass for part in (*parts.panels, *parts.beams, *parts.nodes))
    assert sum(line["total_mass_kg"] for line in lines) == pytest.approx(mass, rel=1e-12)
    length = sum(np.ptp(beam.flat.outline[:, 0]) for beam in parts.beams)
    assert lines[1]["total_length_m"] == pytest.approx(length * 1e-3, rel=1e-12)
    area = sum(panel.area for panel in parts.panels)
    assert lines[0]["total_area_m2"] == pytest.approx(area * 1e-6, rel=1e-12)
    written = read(write_bom(tmp_path / "cut.csv", lines))
    assert list(written[0]) == list(CUT_LIST_COLUMNS)
    assert written[1]["quantity"] == str(len(parts.beams))


def test_a_cut_list_keeps_thicknesses_apart(parts):
    shell = sample("edge")
    thick = panels(shell, PanelSpec(12.0, 6.0, material=OAK))
    lines = cut_list(bom_rows(Parts(parts.panels + thick)))
    assert [line["thickness_mm"] for line in lines] == [8.0, 12.0]


@pytest.mark.parametrize("seed", range(4))
def test_the_least_box_is_no_larger_than_any_turned_box(seed):
    """Against boxes at 20,000 angles; and it must hold the polygon, so it cannot be smaller."""
    rng = np.random.default_rng(seed)
    polygons = [rng.normal(size=(n, 2)) * [300, 100] for n in (6, 9, 4, 6)]
    boxes = least_boxes(polygons)
    angle = np.linspace(0, np.pi, 20000)
    axes = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    for polygon, (length, width) in zip(polygons, boxes, strict=True):
        across = np.ptp(polygon @ axes.T, axis=0)
        areas = across * np.roll(across, len(angle) // 2)
        assert length >= width > 0
        assert length * width <= areas.min() * (1 + 1e-9)
        assert length * width == pytest.approx(areas.min(), rel=2e-3)


def test_a_known_box():
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    ell = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]], float) @ turn.T
    np.testing.assert_allclose(least_boxes([ell]), [[4, 3]], rtol=1e-14)


def test_a_failed_write_leaves_the_old_file_and_nothing_else(parts, tmp_path, monkeypatch):
    path = write_bom(tmp_path / "bom.csv", bom_rows(parts))
    before = path.read_bytes()

    def refuse(*_):
        raise OSError("disk full")

    monkeypatch.setattr("phexfab.whole.os.replace", refuse)
    with pytest.raises(OSError, match="disk full"):
        write_bom(path, bom_rows(Parts(())))
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == ["bom.csv"]


def test_no_parts_give_a_header(tmp_path):
    text = write_bom(tmp_path / "bom.csv", bom_rows(Parts(()))).read_text("utf-8")
    assert text == ",".join(BOM_COLUMNS) + "\n"

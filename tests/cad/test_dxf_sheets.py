"""DXF sheets, read back: closed contours, exact edges, layers, the same bytes."""

import os
import subprocess
import sys
from pathlib import Path

import ezdxf
import numpy as np
import pytest
import shapely

from phexfab.cad.dxf import LAYERS, file_name, write_sheet, write_sheets
from phexfab.errors import NestingError
from phexfab.fabrication.nest import nest_all
from phexfab.fabrication.parts import EdgeNote, FlatPart, Material, Stock

HPL = Material("HPL", 1350.0)
META = {"project": "Court / roof", "revision": "B", "author": "Someone"}
STOCK = Stock(1500.0, 1000.0, 10.0, 6.0)


def parts(count=7):
    rng = np.random.default_rng(5)
    made = {}
    for k in range(count):
        points = np.array(
            [(-200, -180), (0, -120), (200, -180), (200, 180), (0, 120), (-200, 180)], float
        ) + rng.uniform(-15, 15, (6, 2))
        notes = tuple(EdgeNote(f"P{i:03d}", 2.0) for i in range(6))
        made[f"P{k:03d}"] = FlatPart(f"P{k:03d}", points, points, notes, 8.0, HPL)
    return made


FLATS = parts()
SHEETS = nest_all(list(FLATS.values()), STOCK, packer="shelf").sheets


def contours(path):
    """Closed polylines of the CUT layer, from either version."""
    drawing = ezdxf.readfile(path)
    found = []
    for entity in drawing.modelspace().query('*[layer=="CUT"]'):
        if entity.dxftype() == "LWPOLYLINE":
            assert entity.closed
            found.append(np.array([(x, y) for x, y, *_ in entity.get_points()]))
        else:
            assert entity.dxftype() == "POLYLINE" and entity.is_closed
            found.append(np.array([(v.x, v.y) for v in entity.points()]))
    return drawing, found


@pytest.mark.parametrize("version", ["R2010", "R12"])
def test_contours_keep_their_edges_stay_on_the_sheet_and_apart(tmp_path, version):
    paths = write_sheets(SHEETS, FLATS, tmp_path, META, version=version)
    count = 0
    for sheet, path in zip(SHEETS, paths, strict=True):
        drawing, found = contours(path)
        assert not drawing.audit().has_issues
        assert len(found) == len(sheet.placements)
        polygons = []
        for placement, points in zip(sheet.placements, found, strict=True):
            wanted = FLATS[placement.mark].outline
            edges = np.linalg.norm(np.roll(points, -1, 0) - points, axis=1)
            exact = np.linalg.norm(np.roll(wanted, -1, 0) - wanted, axis=1)
            assert np.abs(edges - exact).max() < 1e-9
            polygons.append(shapely.Polygon(points))
            count += 1
        room = shapely.box(10, 10, 1490, 990).buffer(1e-6)
        assert all(room.contains(polygon) for polygon in polygons)
        for i, a in enumerate(polygons):
            assert all(a.distance(b) >= 6 - 1e-6 for b in polygons[i + 1 :])
    assert count == len(FLATS)


@pytest.mark.parametrize("version", ["R2010", "R12"])
def test_a_reader_that_repairs_finds_nothing_to_repair(tmp_path, version):
    from ezdxf import recover

    for path in write_sheets(SHEETS, FLATS, tmp_path, META, version=version):
        drawing, findings = recover.readfile(path)
        assert not findings.has_errors and not findings.has_fixes
        assert drawing.acad_release == version
        kinds = {entity.dxftype() for entity in drawing.modelspace()}
        assert kinds == {"TEXT", "POLYLINE" if version == "R12" else "LWPOLYLINE"}


def test_layers_units_and_only_plain_polylines(tmp_path):
    path = write_sheet(SHEETS[0], FLATS, tmp_path / "a.dxf", META)
    drawing = ezdxf.readfile(path)
    assert drawing.header["$INSUNITS"] == 4 and drawing.header["$MEASUREMENT"] == 1
    space = drawing.modelspace()
    assert {e.dxf.layer for e in space} == set(LAYERS)
    assert {e.dxftype() for e in space} == {"LWPOLYLINE", "TEXT"}
    assert not any(e.closed for e in space.query('LWPOLYLINE[layer=="ENGRAVE"]'))
    sheet, margin = space.query('LWPOLYLINE[layer=="SHEET"]')
    assert tuple(sheet.get_points()[0][:2]) == (0, 0)
    assert shapely.Polygon([p[:2] for p in margin.get_points()]).area == 1480 * 980
    assert all(text.dxf.insert.y < 0 for text in space.query("TEXT"))  # outside the border
    texts = " ".join(text.dxf.text for text in space.query("TEXT"))
    for word in ("Court / roof", "revision B", "HPL", "8 mm", "yield", "Someone"):
        assert word in texts
    # Nothing is drawn twice.
    drawn = [
        tuple(np.round(np.array(e.get_points())[:, :2], 6).ravel())
        for e in space.query("LWPOLYLINE")
    ]
    assert len(drawn) == len(set(drawn))


def test_engraving_lies_inside_the_contours(tmp_path):
    path = write_sheet(SHEETS[0], FLATS, tmp_path / "a.dxf", META)
    drawing, found = contours(path)
    parts_area = shapely.unary_union([shapely.Polygon(points) for points in found]).buffer(1e-6)
    strokes = drawing.modelspace().query('LWPOLYLINE[layer=="ENGRAVE"]')
    assert len(strokes) > 20 * len(found)
    for stroke in strokes:
        assert parts_area.contains(shapely.LineString([p[:2] for p in stroke.get_points()]))


def test_the_same_sheet_gives_the_same_bytes(tmp_path):
    for version in ("R2010", "R12"):
        first = write_sheet(SHEETS[0], FLATS, tmp_path / f"1{version}.dxf", META, version=version)
        second = write_sheet(SHEETS[0], FLATS, tmp_path / f"2{version}.dxf", META, version=version)
        assert first.read_bytes() == second.read_bytes()
    assert not ezdxf.options.write_fixed_meta_data_for_testing


def test_the_same_sheet_gives_the_same_bytes_in_another_process(tmp_path):
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); import test_dxf_sheets as t;"
        "t.write_sheet(t.SHEETS[0], t.FLATS, sys.argv[2], t.META)"
    )
    written = []
    for seed in ("1", "2", "3"):
        path = tmp_path / f"{seed}.dxf"
        here = str(Path(__file__).parent)
        root = str(Path(__file__).parents[2])
        subprocess.run(
            [sys.executable, "-c", code, here, str(path)],
            check=True,
            env=os.environ | {"PYTHONHASHSEED": seed, "PYTHONPATH": root},
        )
        written.append(path.read_bytes())
    assert written[0] == written[1] == written[2]


def test_names_carry_project_material_thickness_quantity_and_revision():
    name = file_name(SHEETS[0], META)
    assert name == f"Court-roof_PANELS-HPL-8mm-01_{len(SHEETS[0].placements)}pcs_revB.dxf"


def test_refusals_leave_no_file(tmp_path):
    with pytest.raises(NestingError, match="R2010, R12"):
        write_sheet(SHEETS[0], FLATS, tmp_path / "a.dxf", META, version="R9")
    fewer = {k: v for k, v in FLATS.items() if k != SHEETS[0].placements[0].mark}
    with pytest.raises(NestingError, match=SHEETS[0].placements[0].mark):
        write_sheet(SHEETS[0], fewer, tmp_path / "a.dxf", META)
    assert not list(tmp_path.iterdir())


def test_a_file_that_is_not_what_was_drawn_is_refused_and_removed(tmp_path, monkeypatch):
    from ezdxf.document import Drawing

    saveas = Drawing.saveas

    def spoil(how):
        def save(drawing, name, *args, **kwargs):
            how(drawing.modelspace().query('LWPOLYLINE[layer=="CUT"]'))
            saveas(drawing, name, *args, **kwargs)

        monkeypatch.setattr(Drawing, "saveas", save)

    def stretch(contours):
        contours[0].set_points([(1.001 * x, 1.001 * y) for x, y, *_ in contours[0]])

    for how, message in (
        (stretch, "off its length"),
        (lambda contours: contours[0].close(False), "not closed"),
        (lambda contours: contours[0].destroy(), "contours for"),
    ):
        spoil(how)
        with pytest.raises(NestingError, match=message):
            write_sheet(SHEETS[0], FLATS, tmp_path / "a.dxf", META)
        assert not list(tmp_path.iterdir())

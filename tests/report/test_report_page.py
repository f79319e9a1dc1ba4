"""The page as a browser reads it: whole, safe, self-contained, the same twice."""

import base64
import json
import os
import re
import struct
import xml.etree.ElementTree as ET
import zlib
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from report_samples import EVIL, made, page, page_text, sample, small_pictures

from phexfab.fabrication.marking import marking
from phexfab.fabrication.parts import CheckResult, Parts
from phexfab.report import page as page_module
from phexfab.report.data import ReportData
from phexfab.report.drawings import sheet_drawing
from phexfab.report.page import report_html, write_report
from phexfab.report.text import quantity


def refuse(constant):
    raise ValueError(f"{constant} is no JSON")


@lru_cache(maxsize=1)
def stream():
    """The page's data as its script unpacks it: the JSON, and the bytes of the arrays."""
    (text,) = re.findall(r'<script [^>]*id="report-data">(.*?)</script>', page_text(), re.S)
    unpacked = zlib.decompress(base64.b64decode(text, validate=True))
    size = int.from_bytes(unpacked[:4], "little")
    assert size % 4 == 0
    return json.loads(unpacked[4 : 4 + size], parse_constant=refuse), unpacked[4 + size :]


def model():
    return stream()[0]


def decode(array):
    kind = {"u1": "<u1", "u2": "<u2", "u4": "<u4"}[array["type"]]
    assert array["at"] % 4 == 0  # typed arrays begin at whole words
    return np.frombuffer(stream()[1], kind, array["count"], array["at"]).astype(np.int64)


def sheets():
    """The drawings of the sheets, by name, as XML."""
    found = re.findall(r'<figure class="sheet">(<svg.*?</svg>)', page_text(), re.S)
    drawings = [ET.fromstring(text) for text in found]
    return {drawing.get("aria-label"): drawing for drawing in drawings}


def test_every_tag_is_closed_in_order():
    assert page().mismatched == [] and page().open == []


def test_text_from_outside_stays_text():
    assert page().text["title"][0] == EVIL
    assert page().said("h1") == EVIL
    assert sample().design_text in page().said("pre")
    assert "<i>heavy</i>" in page().said("td")
    assert "the clock <ran> out" in page().said("p")
    kinds = [tag for tag, _ in page().elements]
    assert kinds.count("script") == 2
    assert not [a for _, attrs in page().elements for a in attrs if a.startswith("on")]


def test_nothing_is_loaded_from_elsewhere():
    for tag, attributes in page().elements:
        assert tag not in ("link", "iframe", "object", "embed", "base")
        for name in ("src", "href", "xlink:href", "action", "data", "srcset"):
            assert re.match(r"data:image/png;base64,|#", attributes.get(name) or "#"), (tag, name)
    assert not re.search(r"https?:|@import|url\(|\bfetch\(|XMLHttpRequest|import\(", page_text())
    policies = [
        a["content"]
        for tag, a in page().elements
        if tag == "meta" and a.get("http-equiv") == "Content-Security-Policy"
    ]
    assert len(policies) == 1 and "default-src 'none'" in policies[0]


def test_every_part_is_on_the_page_and_in_the_view():
    parts = sample().parts
    flat = {part.mark for part in (*parts.panels, *parts.beams)}
    drawn = [a["data-mark"] for tag, a in page().elements if tag == "g" and "data-mark" in a]
    assert sorted(drawn) == sorted(flat)
    layers = model()["scenes"]["assembly"]["layers"]
    shown = [mark for layer in layers for mark in layer["marks"]]
    assert sorted(shown) == sorted(flat | {node.mark for node in parts.nodes})


def test_the_view_has_the_solids():
    """Volumes from the triangles as the page decodes them, by the divergence theorem."""
    scene = model()["scenes"]["assembly"]
    low, span = np.array(scene["low"]), np.array(scene["span"])
    volumes = {}
    for layer in scene["layers"]:
        points = low + decode(layer["positions"]).reshape(-1, 3) / 65535 * span
        counts = decode(layer["vertices"])
        owners = np.repeat(np.arange(len(counts)), decode(layer["triangle_counts"]))
        first = (np.cumsum(counts) - counts)[owners]
        a, b, c = np.moveaxis(
            points[decode(layer["triangles"]).reshape(-1, 3) + first[:, None]], 1, 0
        )
        middle = np.array(
            [points[n - m : n].mean(0) for n, m in zip(np.cumsum(counts), counts, strict=True)]
        )
        a, b, c = (p - middle[owners] for p in (a, b, c))
        volume = np.bincount(owners, np.einsum("ij,ij->i", a, np.cross(b, c)) / 6)
        volumes |= dict(zip(layer["marks"], volume, strict=True))
    # Corners are kept to 1/65535 of the scene: half a step on both sides of the thickness.
    for part in (*sample().parts.panels, *sample().parts.beams):
        slack = 2 * span.max() / 65535 / part.flat.thickness
        assert volumes[part.mark] == pytest.approx(part.volume, rel=slack)


def test_contours_are_as_long_as_those_of_the_parts():
    flats = {p.mark: p.flat for p in (*sample().parts.panels, *sample().parts.beams)}
    assert set(sheets()) == {sheet.name for sheet in sample().sheets}
    for sheet in sample().sheets:
        drawing = sheets()[sheet.name]
        groups = drawing.findall("g")
        assert [g.get("data-mark") for g in groups] == [p.mark for p in sheet.placements]
        for group in groups:
            (path,) = [p for p in group.findall("path") if p.get("class") == "cut"]
            numbers = re.fullmatch(r"M([-\d. L]+)Z", path.get("d"))[1]
            points = np.array(numbers.replace("L", " ").split(), float).reshape(-1, 2)
            assert (points >= 0).all()
            assert (points <= [sheet.stock.length, sheet.stock.width]).all()
            # Cutting from the front: the drawing may be turned, but not mirrored.
            points = points * [1, -1]
            ahead = np.roll(points, -1, 0)
            outline = flats[group.get("data-mark")].outline
            lengths = np.linalg.norm(np.roll(outline, -1, 0) - outline, axis=1)
            np.testing.assert_allclose(np.linalg.norm(ahead - points, axis=1), lengths, atol=2e-3)
            x, y = (points - points[0]).T
            assert x @ np.roll(y, -1) - y @ np.roll(x, -1) > 0


def strokes_of(path):
    """Polylines of a path of relative whole-number steps, in tenths."""
    at, lines = np.zeros(2), []
    for command, numbers in re.findall(r"([ml])([^ml]*)", path):
        for step in np.array(re.findall(r"-?\d+", numbers), float).reshape(-1, 2):
            at = at + step
            if command == "m":
                lines.append([at])
                command = "l"
            else:
                lines[-1].append(at)
    return [np.array(line) / 10 for line in lines]


def test_engraving_lies_where_the_part_lies():
    seen = 0
    for sheet, paths in zip(sample().sheets, model()["engraving"], strict=True):
        groups = sheets()[sheet.name].findall("g")
        for group, spot, path in zip(groups, sheet.placements, paths, strict=True):
            lines = sample().engraving.get(spot.mark, ())
            assert bool(path) == bool(len(lines))
            if not len(lines):
                assert group.find("text").text == spot.mark
                continue
            found = strokes_of(path)
            turn = np.exp(1j * np.radians(spot.angle))
            assert len(found) == len(lines)
            for line, got in zip(lines, found, strict=True):
                z = (line[:, 0] + 1j * line[:, 1]) * turn + spot.x + 1j * spot.y
                want = np.column_stack([z.real, sheet.stock.width - z.imag])
                np.testing.assert_allclose(got, want, atol=0.051)
                seen += len(line)
    assert seen == sum(len(line) for lines in sample().engraving.values() for line in lines)


def test_pictures_stand_in_the_file():
    images = [a for tag, a in page().elements if tag == "img"]
    assert len(images) == 3
    for image in images:
        data = base64.b64decode(image["src"].removeprefix("data:image/png;base64,"), validate=True)
        width, height = struct.unpack(">II", data[16:24])
        assert data.startswith(b"\x89PNG") and width > 150 and height > 100
        assert image["alt"]


def test_failing_checks_come_first_and_the_verdict_says_so():
    rows = re.findall(r"<tr.*?</tr>", page_text().split('<table class="checks">')[1], re.S)[1:4]
    verdicts = [re.search(r">(PASS|FAIL)<", row)[1] for row in rows]
    assert verdicts == ["FAIL", "FAIL", "PASS"]
    assert (
        "Panel mass" in rows[0] and "61.5" in rows[0] and sample().parts.panels[1].mark in rows[0]
    )
    assert "not a number" in rows[1]
    assert page().said("strong") == "FAIL"
    assert "2 of 3 checks fail" in page().said("span")


@pytest.mark.parametrize(
    ("checks", "word"),
    [
        ((), "NOT CHECKED"),
        ((CheckResult("planarity", 0.0, 1.0, "1"),), "PASS"),
        ((CheckResult("planarity", float("nan"), 1.0, "1"),), "FAIL"),
    ],
)
def test_a_build_without_parts_has_an_honest_page(checks, word, monkeypatch):
    for name in ("shell_figure", "gauss_figure"):
        monkeypatch.setattr(page_module, name, lambda *args, **options: b"")
    text = report_html(ReportData("bare", "mm", sample().shell, Parts(()), checks=checks))
    assert re.search(r"<strong class=\"\w+\">([A-Z ]+)</strong>", text)[1] == word
    assert 'data-scene="assembly"' not in text and 'data-scene="shell"' in text


def test_the_same_data_gives_the_same_bytes_and_the_file_is_whole(tmp_path):
    with small_pictures():
        write_report(sample(), tmp_path / "report.html")
    assert (tmp_path / "report.html").read_bytes() == page_text().encode()
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_a_failure_leaves_the_old_report(tmp_path, monkeypatch):
    monkeypatch.setattr(page_module, "report_html", lambda data: "new")
    target = tmp_path / "report.html"
    target.write_text("old")

    def broken(*args):
        raise OSError("disk full")

    monkeypatch.setattr(os, "replace", broken)
    with pytest.raises(OSError, match="disk full"):
        write_report(sample(), target)
    assert target.read_text() == "old" and len(list(tmp_path.iterdir())) == 1


def test_a_thousand_panels_and_their_beams_are_a_page_of_less_than_5_mb():
    """From what one part more costs, engraving and all, and what the pictures take at most."""
    sizes = []
    for panel_size in (700.0, 420.0):
        shell, parts, found, flats = made(panel_size)
        lines = {flat.mark: marking(flat).lines for flat in flats}
        with small_pictures():
            text = report_html(ReportData("large", "mm", shell, parts, tuple(found), lines))
        sizes.append((len(flats), len(re.sub(r"base64,[^\"]*", "", text).encode())))
    (few, small), (many, large) = sizes
    each = (large - small) / (many - few)
    pictures = 1_000_000
    assert small + each * (1000 + 3300) + pictures < 5_000_000
    assert many > 2 * few


@pytest.mark.parametrize("families", [("panels",), ("panels", "nodes"), ("beams",), ("nodes",)])
def test_a_page_may_lack_any_family(families):
    parts = {"panels": (), "beams": (), "nodes": ()}
    parts |= {name: getattr(sample().parts, name) for name in families}
    with small_pictures():
        text = report_html(ReportData("some", "mm", sample().shell, Parts(**parts)))
    (found,) = re.findall(r'id="report-data">(.*?)</script>', text, re.S)
    unpacked = zlib.decompress(base64.b64decode(found))
    made = json.loads(unpacked[4 : 4 + int.from_bytes(unpacked[:4], "little")])
    shown = [mark for layer in made["scenes"]["assembly"]["layers"] for mark in layer["marks"]]
    assert shown == [part.mark for name in families for part in parts[name]]


def test_the_card_knows_what_the_parts_know():
    """Every part's edges, ends and neighbours; what a panel calls its neighbour calls it back."""
    parts, told = sample().parts, model()["parts"]
    edges = sample().shell.edges
    normals = sample().shell.normals[sample().shell.panels]
    under = {beam.mark: edges[beam.edge] for beam in parts.beams}
    for panel in parts.panels:
        rows = told[panel.mark]["rows"]
        assert [row[5] for row in rows] == [note.neighbour for note in panel.flat.edges]
        for row, note in zip(rows, panel.flat.edges, strict=True):
            assert row[3] == quantity(round(note.bevel, 1) + 0.0, "deg")
            _, _, left, right = under[row[4]]
            assert panel.face in (left, right)
            assert (right < 0) == (not note.neighbour)
            if note.neighbour:
                assert panel.mark in told[note.neighbour]["near"]
                fold = np.degrees(np.arccos(normals[left] @ normals[right]))
                assert float(row[2].rstrip("°")) == pytest.approx(fold, abs=0.051)
    for beam in parts.beams:
        assert [row[0] for row in told[beam.mark]["rows"]] == list(beam.nodes)
        assert told[beam.mark]["near"] == list(beam.neighbours)
    place = {spot.mark: sheet.name for sheet in sample().sheets for spot in sheet.placements}
    assert {mark: entry["sheet"] for mark, entry in told.items() if "sheet" in entry} == place


def test_explosion_lifts_panels_off_their_beams():
    """The way out of each panel leads away from the beams under it."""
    layers = model()["scenes"]["assembly"]["layers"]
    parts = sample().parts
    axes = [(decode(layer["axes"]).reshape(-1, 3) - 127) / 127 for layer in layers]
    out = dict(zip(layers[0]["marks"], axes[0], strict=True))
    assert np.allclose(np.linalg.norm(np.concatenate(axes), axis=1), 1, atol=0.01)
    assert layers[0]["lift"] > 0 == layers[1]["lift"] > layers[2]["lift"]
    rows = {beam.mark: beam for beam in parts.beams}
    for panel in parts.panels:
        beams = [rows[mark].solid.vertices.mean(0) for mark in model()["parts"][panel.mark]["near"]
                 if mark in rows]  # fmt: skip
        assert (panel.solid.vertices.mean(0) - np.mean(beams, axis=0)) @ out[panel.mark] > 0


def test_the_page_grows_with_the_parts_and_no_faster():
    """The bytes of sheets and views for twice the sheets are twice the bytes."""
    data = sample()
    flats = {p.mark: p.flat for p in (*data.parts.panels, *data.parts.beams)}
    for sheet in data.sheets:
        half = replace(sheet, placements=sheet.placements[: len(sheet.placements) // 2])
        rest = replace(sheet, placements=sheet.placements[len(sheet.placements) // 2 :])
        whole, one, two = (
            len(sheet_drawing(s, flats, data.engraving)) for s in (sheet, half, rest)
        )
        assert abs(whole - one - two) < 700

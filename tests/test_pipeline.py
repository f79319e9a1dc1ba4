"""The whole walk, as a user takes it: design file in, folder out."""

import csv
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path

import ezdxf
import numpy as np
import pytest

import phexfab
from phexfab.design import parse_design
from phexfab.errors import DesignError, NestingError, OffsetLimitError, PartError, PhexError
from phexfab.fabrication.polyhedra import volumes
from phexfab.mesh import read_mesh

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.toml"))
SMALL = """
title = "Small <test> & canopy"
[project]
author = "Someone"
date = 2026-05-01
[surface]
name = "{surface}"
scale = "2 m"
[lattice]
panel_size = {size}
[offset]
type = "{type}"
[panels]
thickness = 8
gap = 12
edges = "{edges}"
[beams]
ends = "{ends}"
[nodes]
kind = "{nodes}"
radius = 20
[nesting]
packer = "shelf"
"""
VARIANTS = {
    "face, square, mitred bars": dict(
        surface="scherk-1", size=1000, type="face", edges="square", ends="mitred", nodes="none"
    ),
    "edge, mitred, hubs": dict(
        surface="enneper", size=330, type="edge", edges="mitred", ends="hub", nodes="hub"
    ),
    "vertex, mitred, mitred bars": dict(
        surface="helicoid", size=1000, type="vertex", edges="mitred", ends="mitred", nodes="none"
    ),
}


def small(variant="edge, mitred, hubs", extra=""):
    return parse_design(SMALL.format(**VARIANTS[variant]) + extra, source="small.toml")


@pytest.fixture(scope="module", params=list(VARIANTS))
def delivered(request, tmp_path_factory):
    built = phexfab.build(small(request.param))
    folder = tmp_path_factory.mktemp("out") / "shell"
    built.write(folder)
    return built, folder


def test_all_checks_pass_and_are_reported(delivered):
    built, folder = delivered
    assert built.ok, [c for c in built.checks if not c.ok]
    report = json.loads((folder / "report.json").read_text())
    names = {row["name"] for row in report["checks"]}
    assert names >= {check.name for check in built.checks} and len(names) >= 19
    assert all(row["verdict"] == "pass" for row in report["checks"])
    for row in report["checks"]:
        assert set(row) >= {"name", "value", "limit", "unit", "sense", "verdict", "worst", "note"}
    assert report["versions"]["numpy"] == np.__version__


def test_meshes_are_written_to_the_last_digit(delivered):
    built, folder = delivered
    for name, mesh in (("shell.obj", built.shell.mesh), ("gauss.obj", built.shell.gauss)):
        back = read_mesh(folder / name)
        assert np.array_equal(back.vertices, mesh.vertices)
        assert np.array_equal(back.corners, mesh.corners)


def test_solids_read_back_valid_and_equal_the_parts_list(delivered):
    built, folder = delivered
    from build123d import import_step

    from phexfab.cad.brep import is_valid

    with (folder / "bom.csv").open(newline="") as file:
        rows = {row["mark"]: row for row in csv.DictReader(file)}
    tree = import_step(folder / "parts.step")
    found = {}

    def walk(node):
        for child in node.children:
            walk(child)
        if not node.children and node.label:
            found[node.label] = node

    walk(tree)
    assert set(found) == set(rows)
    exact = dict(
        zip(
            [p.mark for p in (*built.parts.panels, *built.parts.beams)],
            volumes([p.solid for p in (*built.parts.panels, *built.parts.beams)]),
            strict=True,
        )
    )
    exact |= {n.mark: n.volume for n in built.parts.nodes}
    for mark, shape in found.items():
        assert is_valid(shape.wrapped), mark
        assert abs(shape.volume / exact[mark] - 1) < 1e-9, mark
    numbers = json.loads((folder / "report.json").read_text())["figures"]
    assert numbers["panels"]["value"] == sum(row["kind"] == "panel" for row in rows.values())


def test_sheets_are_clean_and_hold_every_flat_part_once(delivered):
    built, folder = delivered
    flats = {p.mark: p.flat for p in (*built.parts.panels, *built.parts.beams)}
    lengths = []
    for path in sorted((folder / "sheets").glob("*.dxf")):
        drawing = ezdxf.readfile(path)
        assert not drawing.audit().errors and not drawing.audit().fixes
        assert drawing.header["$INSUNITS"] == 4
        for contour in drawing.modelspace().query('LWPOLYLINE[layer=="CUT"]'):
            assert contour.closed
            points = np.array([(x, y) for x, y, *_ in contour.get_points()])
            lengths.append(np.sort(np.linalg.norm(points - np.roll(points, -1, 0), axis=1)))
    wanted = []
    for flat in flats.values():
        edges = np.linalg.norm(flat.outline - np.roll(flat.outline, -1, 0), axis=1)
        wanted.append(np.sort(edges))
    assert len(lengths) == len(wanted)
    lengths.sort(key=lambda edges: (len(edges), *np.round(edges, 5)))
    wanted.sort(key=lambda edges: (len(edges), *np.round(edges, 5)))
    for a, b in zip(lengths, wanted, strict=True):
        assert np.abs(a - b).max() < 1e-6


def test_the_report_opens_offline(delivered):
    _, folder = delivered
    text = (folder / "report.html").read_text()
    assert "Small &lt;test&gt; &amp; canopy" in text
    assert not re.search(r"""(src|href)=["']https?://""", text)


def test_the_same_design_builds_the_same_bytes(delivered, tmp_path):
    built, folder = delivered
    again = phexfab.build(built.design)
    again.write(tmp_path / "again")
    first = {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}
    second = {
        p.relative_to(tmp_path / "again"): p.read_bytes()
        for p in (tmp_path / "again").rglob("*")
        if p.is_file()
    }
    assert set(first) == set(second)
    assert [name for name in first if first[name] != second[name]] == []


def test_a_failed_write_leaves_the_old_folder_whole(delivered, tmp_path, monkeypatch):
    built, folder = delivered
    target = tmp_path / "kept"
    shutil.copytree(folder, target)
    before = {p: p.read_bytes() for p in target.rglob("*") if p.is_file()}

    def broken(*_args, **_kwargs):
        raise OSError("disk full")

    monkeypatch.setattr("phexfab.delivery.formats.write_step", broken)
    with pytest.raises(OSError, match="disk full"):
        built.write(target)
    assert {p: p.read_bytes() for p in target.rglob("*") if p.is_file()} == before
    assert [p.name for p in tmp_path.iterdir()] == ["kept"]


def test_a_folder_of_somebody_elses_is_not_replaced(delivered, tmp_path):
    built, _ = delivered
    target = tmp_path / "thesis"
    target.mkdir()
    (target / "precious.txt").write_text("years of work")
    with pytest.raises(DesignError, match=r"precious\.txt"):
        built.write(target)
    assert (target / "precious.txt").read_text() == "years of work"


WRONG = {
    "closed = along u": ('[surface]\nname="catenoid"\nu="closed"\n', r"surface\.u.*closes along v"),
    "enneper does not close": ('[surface]\nname="enneper"\nv="closed"\n', "does not close"),
    "rectangle through an umbilic": (
        '[surface]\nname="enneper"\norder=2\nu=[-0.5,0.5]\nv=[-0.5,0.5]\n',
        "umbilic|branch|singular",
    ),
    "offset too large": (
        '[surface]\nname="enneper"\nscale=1000\n[offset]\ndistance=-900\n',
        r"offset\.distance = -900.*keep the distance between",
    ),
    "unknown surface": ('[surface]\nname="katenoid"\n', "catenoid"),
    "no order": ('[surface]\nname="catenoid"\norder=2\n', "order"),
    "too large panels": (
        '[surface]\nname="enneper"\nscale=1000\n[lattice]\npanel_size=2000\n'
        "[sheets.panels]\nlength=9000\nwidth=9000\n",
        r"no panel fits.*panel_size",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_designs_are_refused_with_a_remedy(case):
    text, message = WRONG[case]
    if "[lattice]" not in text:
        text += "[lattice]\npanel_size=100\n"
    with pytest.raises(PhexError, match=message):
        phexfab.build(parse_design(text, source="wrong.toml"))


def test_a_gap_too_large_names_the_panel_and_the_largest_gap():
    text = '[surface]\nname="richmond"\nscale=1000\n[lattice]\npanel_size=150\n[panels]\ngap=70\n'
    with pytest.raises(PartError, match=r"gap .* panel P\d+; at most \d"):
        phexfab.build(parse_design(text, source="gap.toml"))


def test_a_part_larger_than_its_sheet_is_a_failed_check_and_no_folder(tmp_path):
    design = small(extra="[sheets.beams]\nlength=400\nwidth=300\n")
    built = phexfab.build(design)
    failed = [check for check in built.checks if not check.ok]
    assert [check.name for check in failed] == ["beam_fits_sheet"]
    with pytest.raises(NestingError, match=r"B\d+"):
        built.write(tmp_path / "none")
    assert not list(tmp_path.iterdir())


def test_an_offset_on_the_far_side_is_refused_too():
    text = (
        '[surface]\nname="enneper"\nscale=1000\n[lattice]\npanel_size=100\n'
        "[offset]\ndistance=2000\n"
    )
    with pytest.raises(OffsetLimitError, match=r"offset\.distance = 2000 mm"):
        phexfab.build(parse_design(text, source="far.toml"))


def test_own_surface_by_expressions_equals_the_catalog():
    own = phexfab.build(
        parse_design(
            '[surface]\ng="z"\nheight_differential="z"\nscale=1000\nu=[-0.5,0.5]\nv=[-0.5,0.5]\n'
            "[lattice]\npanel_size=80\n",
            source="own.toml",
        )
    )
    named = phexfab.build(
        parse_design(
            '[surface]\nname="enneper"\nscale=1000\nu=[-0.5,0.5]\nv=[-0.5,0.5]\n'
            "[lattice]\npanel_size=80\n",
            source="named.toml",
        )
    )
    assert np.abs(own.shell.mesh.vertices - named.shell.mesh.vertices).max() < 1e-8


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_examples_pass_their_checks(path):
    built = phexfab.build(path)
    assert built.ok, [check for check in built.checks if not check.ok]


def test_the_pavilion_has_the_promised_size():
    built = phexfab.build(next(p for p in EXAMPLES if p.stem == "catenoid-pavilion"))
    size = np.ptp(built.shell.mesh.vertices, axis=0)
    assert np.allclose(size, [6000, 6000, 3000], atol=150)
    assert 290 <= len(built.parts.panels) <= 310


def test_the_kept_build_is_what_its_example_builds():
    kept = EXAMPLES[0].parents[1] / "exports" / "first-shell"
    built = phexfab.build(next(p for p in EXAMPLES if p.stem == "first-shell"))
    mesh = read_mesh(kept / "shell.obj")
    assert np.abs(mesh.vertices - built.shell.mesh.vertices).max() < 1e-9
    with (kept / "bom.csv").open(newline="") as file:
        marks = [row["mark"] for row in csv.DictReader(file)]
    assert marks == [part.mark for part in (*built.parts.panels, *built.parts.beams)]
    report = json.loads((kept / "report.json").read_text())
    assert {row["name"] for row in report["checks"]} == {check.name for check in built.checks}


@pytest.mark.parametrize("script", ["cadquery_shell.py", "build123d_shell.py"])
def test_the_scripts_run(script, tmp_path):
    path = EXAMPLES[0].parent / script
    root = EXAMPLES[0].parents[1]
    ran = subprocess.run(
        [sys.executable, str(path)], cwd=tmp_path, capture_output=True, text=True, check=False,
        env={**__import__("os").environ, "PYTHONPATH": str(root)},
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    assert any(tmp_path.rglob("*.st*p"))


def test_check_needs_no_kernel():
    code = (
        "import sys, phexfab;"
        f"results = phexfab.check({str(EXAMPLES[0])!r});"
        "assert len(results) > 15 and all(r.ok for r in results);"
        "loaded = {'OCP', 'cadquery', 'build123d'} & set(sys.modules);"
        "assert not loaded, loaded"
    )
    subprocess.run([sys.executable, "-c", code], check=True)

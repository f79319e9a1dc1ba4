"""Build.export and [output]: the files asked for, whole or not at all, and nothing else touched."""

import tomllib
from pathlib import Path
from typing import get_args

import pytest

import phexfab
from phexfab.cad.scale_model import ScaleModel
from phexfab.delivery import FORMATS, SUFFIXES
from phexfab.design.output import FileFormat
from phexfab.errors import DesignError

EXAMPLE = Path(__file__).parent.parent / "examples" / "first-shell.toml"


def design(**output):
    data = tomllib.loads(EXAMPLE.read_text("utf-8"))
    data["lattice"]["panel_size"] = 900
    data["nesting"] = {"packer": "shelf"}
    return phexfab.make_design({**data, "output": output})


@pytest.fixture(scope="module")
def built():
    return phexfab.build(design(scale="1:20", wall="1.5 mm"))


def tree(folder):
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file()}


def test_the_design_file_knows_the_formats_there_are():
    assert get_args(FileFormat) == tuple(FORMATS)
    for key in FORMATS:
        assert design(files=[key]).output.files == (key,)


def test_every_format_leaves_what_it_says(built, tmp_path):
    pytest.importorskip("ifcopenshell")
    for key, kind in FORMATS.items():
        written = built.export(tmp_path / key, key)
        assert sorted(path.name for path in written) == sorted(kind.names)
        files = [path for path in (tmp_path / key).rglob("*") if path.is_file()]
        assert files and all(
            path.suffix in (*kind.suffixes, ".mtl") or path.name in kind.inside for path in files
        )
        assert all(path.stat().st_size > 100 for path in files)
    assert tree(tmp_path / "3mf") == {
        "model-3mf/shell.3mf",
        "model-3mf/plate-1.3mf",
        "model-3mf/plates.csv",
    }


def test_a_file_s_ending_tells_its_format(built, tmp_path):
    for suffix in (".glb", ".STEP", ".stl", ".obj"):
        target = tmp_path / suffix[1:] / f"roof{suffix}"
        written = built.export(target)
        assert target in written
        assert {path.stem for path in written} == {"roof"}
    assert "mtllib roof.mtl" in (tmp_path / "obj" / "roof.obj").read_text("utf-8")
    built.export(tmp_path / "new.step", ["step242"])
    assert b"AP242" in (tmp_path / "new.step").read_bytes()[:600]


def test_the_model_s_scale_comes_from_the_design_or_the_call(built, tmp_path):
    title = (built.export(tmp_path / "a.stl")[0]).read_bytes()[:80]
    assert b"1:20" in title
    title = built.export(tmp_path / "b.stl", model=ScaleModel(50))[0].read_bytes()[:80]
    assert b"1:50" in title


@pytest.mark.parametrize(
    ("where", "formats", "message"),
    [
        ("folder", None, "name formats, some of step, "),
        ("folder", ["stp"], "no format 'stp'; did you mean step"),
        ("roof.glb", ["step"], "roof.glb is a file of the format glb, but step"),
        ("roof.glb", ["glb", "step"], "name a folder"),
    ],
)
def test_what_makes_no_sense_is_refused_before_anything_is_written(
    built, tmp_path, where, formats, message
):
    with pytest.raises(DesignError, match=message):
        built.export(tmp_path / where, formats)
    assert list(tmp_path.iterdir()) == []


def test_what_else_is_in_the_folder_stays(built, tmp_path):
    (tmp_path / "mine.txt").write_text("mine")
    (tmp_path / "parts.glb").write_text("old")
    built.export(tmp_path, ["glb", "stl"])
    built.export(tmp_path, ["glb", "stl"])
    assert (tmp_path / "mine.txt").read_text() == "mine"
    assert (tmp_path / "parts.glb").read_bytes()[:4] == b"glTF"
    assert {path.name for path in tmp_path.iterdir()} == {"mine.txt", "parts.glb", "model-stl"}
    (tmp_path / "model-stl" / "precious.txt").write_text("years of work")
    with pytest.raises(DesignError, match=r"precious\.txt"):
        built.export(tmp_path, "stl")
    assert (tmp_path / "model-stl" / "precious.txt").exists()


def test_a_failure_leaves_the_old_files(built, tmp_path, monkeypatch):
    built.export(tmp_path, ["step", "glb"])
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def broken(*_args, **_kwargs):
        raise OSError("disk full")

    monkeypatch.setattr("phexfab.delivery.formats.write_glb", broken)
    with pytest.raises(OSError, match="disk full"):
        built.export(tmp_path, ["step", "glb"])
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_build_writes_the_files_of_the_design(tmp_path, monkeypatch):
    monkeypatch.setattr("phexfab.delivery.folder.write_report", lambda *_: None)  # takes long
    made = phexfab.build(design(files=["glb", "dxf12", "stl"], scale=20))
    made.write(tmp_path / "out")
    names = {path.name for path in (tmp_path / "out").iterdir()}
    assert {"parts.step", "sheets", "report.json"} <= names
    assert {"parts.glb", "sheets-r12", "model-stl"} <= names
    alone = tmp_path / "alone"
    made.export(alone, ["glb", "dxf12", "stl"])
    for name in tree(alone):
        assert (alone / name).read_bytes() == (tmp_path / "out" / name).read_bytes(), name
    drawing = next((alone / "sheets-r12").iterdir()).read_text("ascii")
    assert "AC1009" in drawing[:400]


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("files", ["glb", "gbl"], r"output\.files.*no such choice"),
        ("scale", "20:1", r'output\.scale.*write "1:20"'),
        ("scale", -5, r'output\.scale.*write "1:20"'),
        ("bed", [220, 220], r"output\.bed.*\[220, 220, 250\]"),
        ("wall", 0, r"output\.wall.*greater than 0"),
    ],
)
def test_mistakes_in_the_design_are_named(key, value, message):
    with pytest.raises(DesignError, match=message):
        design(**{key: value})


def test_scales_and_sizes_are_read_with_units():
    output = design(scale="1 : 25", bed=["30 cm", 300, 400]).output
    assert (output.scale, output.bed) == (25.0, (300.0, 300.0, 400.0))
    assert design(scale=25).output.scale == 25.0
    assert design(files="glb").output.files == ("glb",)
    assert SUFFIXES[".stp"] == "step"

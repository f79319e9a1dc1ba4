"""The command line: what it prints where, and with which exit code it ends."""

import json
import os
import subprocess
import sys
import types
import webbrowser
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import phexfab
from phexfab.cad import doctor as cad_doctor
from phexfab.cad.doctor import Finding
from phexfab.cli import app, looking, starting, tables
from phexfab.cli.failures import CODES
from phexfab.cli.options import format_names, paths_like, surface_names
from phexfab.design import load_design
from phexfab.errors import MissingLibraryError, OffsetLimitError, PartError, SolveError
from phexfab.fabrication.parts import CheckResult
from phexfab.surface.catalog import catalog

DESIGN = '[surface]\nname = "catenoid"\n[lattice]\npanel_size = 600\n'
GOOD = CheckResult("planarity", 1e-15, 1e-12, "1", worst="P003")
VERBS = (
    "new", "check", "build", "export", "view", "compare", "inspect", "surfaces", "schema", "doctor",
)  # fmt: skip
BAD = CheckResult("panel mass", 81.25, 60.0, "kg", worst="P017", note="choose smaller panels")


class Pipeline(types.ModuleType):
    """Stands in for the walk: it hands out given checks and notes what it was asked."""

    def __init__(self, checks=(GOOD,), error=None):
        super().__init__("phexfab.pipeline")
        self.checks, self.error, self.asked, self.progress = checks, error, [], []

    def build(self, design, progress=None):
        self.asked.append(design)
        self.progress.append(progress)
        if self.error:
            raise self.error
        figures = {"panels": (304, ""), "nodes": (0, ""), "size x": (5928.0, "mm")}
        return types.SimpleNamespace(
            checks=self.checks,
            ok=all(check.ok for check in self.checks),
            figures=figures,
            write=self.write,
            export=self.export,
        )

    def export(self, directory, formats, progress=None):
        directory.mkdir(parents=True)
        (directory / f"parts.{formats[0]}").write_bytes(b"x" * 7)
        self.formats = formats
        return (directory / f"parts.{formats[0]}",)

    def write(self, directory, progress=None):
        self.progress.append(progress)
        (directory / "sheets").mkdir(parents=True)
        (directory / "parts.step").write_bytes(b"x" * 1500)
        (directory / "sheets" / "panels-01.dxf").write_bytes(b"x" * 20)


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    (tmp_path / "designs").mkdir()
    (tmp_path / "designs" / "house.toml").write_text(DESIGN)
    return tmp_path


@pytest.fixture
def walk(monkeypatch):
    def put(**options):
        made = Pipeline(**options)
        monkeypatch.setitem(sys.modules, "phexfab.pipeline", made)
        monkeypatch.setattr(phexfab, "pipeline", made, raising=False)
        return made

    return put


def run(*arguments, **options):
    return CliRunner().invoke(app, [str(word) for word in arguments], **options)


# -- exit codes and where things go ----------------------------------------------------------------


def test_build_writes_where_the_design_s_name_says(here, walk):
    walk()
    result = run("build", "designs/house.toml")
    assert result.exit_code == 0, result.output
    assert (here / "exports" / "house" / "parts.step").exists()
    for words in (
        "planarity",
        "≤ 1e-12",
        "P003",
        "exports/house: 304 panels\n",
        "parts.step",
        "1.5 kB",
    ):
        assert words in result.stdout
    assert "sheets/ (1 files)" in result.stdout
    assert result.stderr == ""


def test_build_writes_where_it_is_told_to(here, walk):
    walk()
    assert run("build", "designs/house.toml", "-o", "elsewhere").exit_code == 0
    assert (here / "elsewhere" / "parts.step").exists()
    assert not (here / "exports").exists()


def test_a_failed_check_is_code_1_and_the_files_are_there(here, walk):
    walk(checks=(GOOD, BAD))
    result = run("build", "designs/house.toml")
    assert result.exit_code == 1
    assert (here / "exports" / "house" / "parts.step").exists()
    for words in ("FAILED", "81.2 kg", "≤ 60 kg", "P017", "panel mass: choose smaller panels"):
        assert words in result.stdout
    assert result.stderr.strip() == "1 check failed: panel mass"


@pytest.mark.parametrize(("checks", "code"), [((GOOD,), 0), ((GOOD, BAD), 1), ((BAD, BAD), 1)])
def test_check_writes_nothing(here, walk, checks, code):
    walk(checks=checks)
    result = run("check", "designs/house.toml")
    assert result.exit_code == code
    assert "parts.step" not in result.output
    assert [path.name for path in here.iterdir()] == ["designs"]


@pytest.mark.parametrize("command", ["build", "check"])
def test_a_wrong_design_is_code_2_and_one_message(here, walk, command):
    asked = walk().asked
    (here / "bad.toml").write_text(DESIGN + '[panels]\nthickness = "8 kg"\ngapp = 3\n')
    result = run(command, "bad.toml")
    assert (result.exit_code, result.stdout, asked) == (2, "", [])
    assert result.stderr.startswith("bad.toml: 2 things are wrong\n")
    assert 'panels.thickness = "8 kg" (line 6)' in result.stderr
    assert "Traceback" not in result.stderr


@pytest.mark.parametrize("command", ["build", "check"])
@pytest.mark.parametrize(
    ("error", "code"),
    [
        (OffsetLimitError("offset.distance = -900: at most -420"), 2),
        (SolveError("the system is singular"), 2),
        (MissingLibraryError("OCP does not load; install it"), 3),
        (PermissionError(13, "Permission denied", "exports"), 3),
    ],
)
def test_errors_on_purpose_have_a_code_and_no_traceback(here, walk, command, error, code):
    walk(error=error)
    result = run(command, "designs/house.toml")
    assert (result.exit_code, result.stdout) == (code, "")
    assert str(error.args[-1]).split(":")[-1] in result.stderr
    assert result.stderr.startswith("designs/house.toml: " if code == 2 else "phexfab: ")
    assert "Traceback" not in result.stderr
    assert not (here / "exports").exists()


def test_a_mistake_of_our_own_keeps_its_traceback(here, walk):
    walk(error=ZeroDivisionError("a bug"))
    assert isinstance(run("check", "designs/house.toml").exception, ZeroDivisionError)


def test_stopping_it_is_not_a_failed_check(here, walk):
    walk(error=KeyboardInterrupt())
    assert run("check", "designs/house.toml").exit_code == 130


@pytest.mark.parametrize(
    "arguments",
    [
        ("build", "nowhere.toml"),
        ("build", "designs"),
        ("build",),
        ("build", "designs/house.toml", "-o", "designs/house.toml"),
        ("build", "designs/house.toml", "--frobnicate"),
        ("frobnicate",),
        (),
    ],
)
def test_wrong_words_on_the_command_line_are_code_2(here, walk, arguments):
    asked = walk().asked
    result = run(*arguments)
    assert (result.exit_code, asked) == (2, [])


def test_quick_asks_for_the_quick_packer_and_changes_nothing_else(here, walk):
    asked = walk().asked
    run("build", "designs/house.toml", "-o", "a")
    run("build", "designs/house.toml", "-o", "b", "--quick")
    plain, quick = (design.model_dump() for design in asked)
    assert (plain["nesting"].pop("packer"), quick["nesting"].pop("packer")) == ("spyrrow", "shelf")
    assert plain == quick
    assert asked[1].source == "designs/house.toml" and asked[1].text == DESIGN


# -- what it looks like ----------------------------------------------------------------------------


def test_it_is_quiet_where_nobody_watches(here, walk):
    made = walk()
    result = run("check", "designs/house.toml")
    assert made.progress == [None]
    assert result.stderr == "" and "\x1b" not in result.stdout


def test_it_reports_progress_on_a_terminal(here, walk, monkeypatch):
    made = walk()
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    monkeypatch.setenv("TERM", "xterm")

    build = made.build

    def reporting(design, progress=None):
        progress("panels [bold]", 1, 4)
        progress("panels [bold]", 4, 4)
        progress("nesting", 0, 0)
        return build(design, progress)

    made.build = reporting
    result = run("check", "designs/house.toml")
    assert result.exit_code == 0, result.output
    assert "nesting" in result.stderr
    assert "nesting" not in result.stdout


@pytest.mark.parametrize("columns", [24, 40, 60, 200])
def test_the_table_keeps_names_and_verdicts_on_any_terminal(here, walk, monkeypatch, columns):
    walk(checks=(GOOD, BAD))
    monkeypatch.setenv("COLUMNS", str(columns))
    result = run("check", "designs/house.toml")
    assert max(len(line) for line in result.stdout.splitlines()) <= columns
    assert result.stdout.count("FAILED") == 1
    for word in ("planarity", "1e-15", "P003", "P017", "60 kg"):
        assert word in result.stdout


def test_colours_are_left_out_when_not_wanted(here, walk, monkeypatch):
    walk(checks=(GOOD, BAD))
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    monkeypatch.setenv("TERM", "xterm-256color")
    assert "\x1b[32m" in run("check", "designs/house.toml").stdout
    monkeypatch.setenv("NO_COLOR", "1")
    plain = run("check", "designs/house.toml").stdout
    assert "\x1b[32m" not in plain and "\x1b[31m" not in plain and "FAILED" in plain


@pytest.mark.parametrize(
    ("value", "unit", "shown"),
    [(1.23456e-13, "1", "1.23e-13"), (81.25, "kg", "81.2 kg"), (-12345.6, "mm", "-12346 mm")],
)
def test_figures_are_short(value, unit, shown):
    assert tables.figure(value, unit) == shown


# -- the other commands ----------------------------------------------------------------------------


def test_surfaces_lists_the_whole_catalog(here, monkeypatch):
    monkeypatch.setenv("COLUMNS", "160")
    result = run("surfaces")
    assert result.exit_code == 0, result.output
    first = [line.split()[0] for line in result.stdout.splitlines() if line.strip()]
    assert [word for word in first if word in catalog] == list(catalog)
    (ring,) = [line for line in result.stdout.splitlines() if line.startswith("catenoid ")]
    assert ring.split()[1] == "v"


def test_the_doctor_s_verdict_is_an_exit_code(here, monkeypatch):
    well = Finding("OCP", True, "7.9.3")
    ill = Finding("cadquery", False, "does not load", "python -m pip install something")
    monkeypatch.setattr(cad_doctor, "doctor", lambda: [well])
    assert run("doctor").exit_code == 0
    monkeypatch.setattr(cad_doctor, "doctor", lambda: [well, ill])
    result = run("doctor")
    assert result.exit_code == 3
    assert "To repair it: python -m pip install something" in result.stdout
    monkeypatch.setattr(cad_doctor, "doctor", lambda: [well])
    monkeypatch.setattr(looking, "LIBRARIES", ("numpy", "no-such-library"))
    result = run("doctor")
    assert result.exit_code == 3
    assert "python -m pip install --upgrade no-such-library" in result.stdout


def test_version(here, monkeypatch):
    monkeypatch.setattr(looking, "version", lambda name: "1.2.3")
    assert run("--version").stdout == "phexfab 1.2.3\n"
    monkeypatch.setattr(looking, "version", lambda name: "")
    assert "not installed" in run("--version").stdout


def test_help_names_every_verb_and_the_exit_codes(monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    text = run("--help").output
    for word in (*VERBS, "--version", "Exit codes", *CODES.values()):
        assert word in text


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_has_examples_of_itself(monkeypatch, verb):
    monkeypatch.setenv("COLUMNS", "120")
    text = run(verb, "--help").output
    assert f" phexfab {verb}" in text.split("Examples:")[1]


@pytest.mark.parametrize("verb", VERBS)
def test_every_verb_speaks_json(verb):
    assert "--json" in run(verb, "--help").output


@pytest.mark.parametrize("size", ["0", "-3", "-3 cm"])
def test_a_starter_s_panels_have_a_size(here, size):
    result = run("new", "roof", "--panel-size", size)
    assert result.exit_code == 2
    assert "--panel-size" in result.output and "write for example 450" in result.output
    assert not (here / "roof.toml").exists()


def test_what_cannot_be_written_is_named_with_a_remedy(here):
    result = run("schema", "-o", "nowhere/x.json", "--json")
    assert result.exit_code == 3
    error = json.loads(result.stdout)["error"]
    assert (error["file"], error["problems"][0]["remedy"]) == ("nowhere/x.json", "check the path")
    assert run("schema", "-o", "x.json", "--json").exit_code == 0
    assert json.loads((here / "x.json").read_text(encoding="utf-8"))["title"]


def test_python_m_phexfab_is_the_same_command(tmp_path):
    bad = tmp_path / "bad.toml"
    bad.write_text("x = 1\n")
    ran = subprocess.run(
        [sys.executable, "-m", "phexfab", "check", str(bad)], capture_output=True, text=True
    )
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr.startswith(f"{bad}: 3 things are wrong\n  x = 1 (line 1): unknown key")


def test_the_manual_names_every_verb_and_exit_code():
    page = (Path(__file__).parent.parent / "docs" / "command-line.md").read_text(encoding="utf-8")
    rows = [line.split("|")[1:3] for line in page.splitlines() if line.startswith("| ")]
    assert {word.split()[0].strip("` ") for word, _ in rows} >= set(VERBS)
    assert {int(code): said.strip() for code, said in rows if code.strip().isdigit()} == CODES


# -- several designs -------------------------------------------------------------------------------


def test_one_wrong_design_does_not_stop_the_others(here, walk):
    walk()
    (here / "bad.toml").write_text(DESIGN + "[panels]\ngapp = 3\n")
    (here / "late.toml").write_text(DESIGN)
    result = run("build", "designs/house.toml", "bad.toml", "late.toml", "-o", "all")
    assert result.exit_code == 2
    assert sorted(path.name for path in (here / "all").iterdir()) == ["house", "late"]
    lines = result.stdout.splitlines()
    assert lines[0] == "ok     designs/house.toml  304 panels → all/house"
    assert lines[1] == "WRONG  bad.toml  one thing is wrong"
    assert lines[2] == "ok     late.toml  304 panels → all/late"
    assert "panels.gapp = 3 (line 6): unknown key" in result.stderr


@pytest.mark.parametrize(
    ("error", "code", "verdict"),
    [
        (MissingLibraryError("OCP does not load"), 3, "BROKEN"),
        (ZeroDivisionError("a bug"), 3, "BROKEN"),
        (SolveError("singular"), 2, "WRONG"),
    ],
)
def test_the_worst_exit_code_counts(here, walk, error, code, verdict):
    made = walk(checks=(BAD,))
    (here / "other.toml").write_text(DESIGN)
    build = made.build

    def failing(design, progress=None):
        if design.source == "other.toml":
            raise error
        return build(design, progress)

    made.build = failing
    result = run("check", "other.toml", "designs/house.toml")
    assert result.exit_code == code
    assert result.stdout.startswith(verdict)
    assert "FAILED designs/house.toml  304 panels; 1 check failed: panel mass" in result.stdout


def test_stopping_ends_a_batch(here, walk):
    made = walk(error=KeyboardInterrupt())
    (here / "other.toml").write_text(DESIGN)
    assert run("check", "other.toml", "designs/house.toml").exit_code == 130
    assert len(made.asked) == 1


def test_two_designs_do_not_share_a_folder(here, walk):
    asked = walk().asked
    (here / "house.toml").write_text(DESIGN)
    result = run("build", "house.toml", "designs/house.toml")
    assert (result.exit_code, asked) == (2, [])
    assert "different file names" in " ".join(result.stderr.replace("│", " ").split())


# -- machines --------------------------------------------------------------------------------------


def answer(*arguments):
    """Run a verb and return its exit code and its answer: one document, and it is JSON."""
    result = run(*arguments, "--json")
    return result.exit_code, json.loads(result.stdout)


def test_a_build_in_json(here, walk):
    walk(checks=(GOOD, BAD))
    code, said = answer("build", "designs/house.toml")
    (design,) = said["designs"]
    assert (code, said["exit_code"], design["exit_code"]) == (1, 1, 1)
    assert (design["design"], design["directory"]) == ("designs/house.toml", "exports/house")
    assert design["files"] == [
        {"path": "exports/house/parts.step", "bytes": 1500},
        {"path": "exports/house/sheets", "bytes": 20},
    ]
    assert design["figures"]["size x"] == {"value": 5928.0, "unit": "mm"}
    assert [check["verdict"] for check in design["checks"]] == ["pass", "fail"]
    assert design["checks"][1]["note"] == BAD.note and design["error"] is None


def test_numbers_that_json_does_not_know_are_null(here, walk):
    walk(checks=(CheckResult("planarity", float("nan"), np.float64(1e-12), "1"),))
    _, said = answer("check", "designs/house.toml")
    (check,) = said["designs"][0]["checks"]
    assert (check["value"], check["limit"], check["verdict"]) == (None, 1e-12, "fail")


def test_each_mistake_in_a_design_is_told_with_key_value_line_and_remedy(here, walk):
    walk()
    (here / "bad.toml").write_text(DESIGN + '[panels]\nthickness = "8 kg"\ngapp = 3\n')
    code, said = answer("check", "bad.toml")
    error = said["designs"][0]["error"]
    assert (code, error["kind"], error["file"]) == (2, "DesignError", "bad.toml")
    thickness, gap = error["problems"]
    assert (thickness["key"], thickness["value"], thickness["line"]) == (
        "panels.thickness",
        "8 kg",
        6,
    )
    assert thickness["remedy"] == 'write 8 or "8 mm"'
    assert (gap["key"], gap["value"], gap["remedy"]) == ("panels.gapp", 3, 'did you mean "gap"?')


@pytest.mark.parametrize(
    ("error", "told"),
    [
        (
            OffsetLimitError("offset.distance = -900 mm: edge 7 would flip; keep it above -420 mm"),
            {
                "key": "offset.distance",
                "value": "-900 mm",
                "text": "edge 7 would flip",
                "remedy": "keep it above -420 mm",
            },
        ),
        (
            PartError("beam B0593 is too short: 111.7 mm; choose larger panels"),
            {"part": "B0593", "key": None, "remedy": "choose larger panels"},
        ),
        (MissingLibraryError("OCP does not load; pip install it"), {"remedy": "pip install it"}),
        (PermissionError(13, "Permission denied", "exports"), {"text": "Permission denied"}),
    ],
)
def test_other_errors_are_taken_apart(here, walk, error, told):
    walk(error=error)
    _, said = answer("check", "designs/house.toml")
    found = said["designs"][0]["error"]
    (problem,) = found["problems"]
    assert told.items() <= problem.items()
    assert found["kind"] == type(error).__name__
    assert said["designs"][0]["exit_code"] == said["exit_code"] > 1


@pytest.mark.parametrize(
    "words",
    [
        ("chek", "x.toml"),
        ("check",),
        ("check", "designs/house.toml", "--frobnicate"),
        ("check", "designs/house.toml", "--quiet", "--verbose"),
        ("export", "designs/house.toml", "--format", "xyz"),
        ("inspect", "mesh.obj", "--gauss"),
        ("inspect", "mesh.obj"),
        ("compare", "nowhere.toml"),
        ("view", "nowhere"),
        ("new", "house", "--surface", "catnoid"),
        ("new", "no-folder/house"),
        ("new", "house", "--surface", "catenoid", "--periodic", "gyroid"),
        ("new", "house", "--method", "dupin"),
    ],
)
def test_a_wrong_command_line_is_answered_in_json_too(here, words):
    result = run(*words, "--json")
    said = json.loads(result.stdout)
    assert (result.exit_code, said["exit_code"]) == (2, 2)
    assert said["error"]["message"] and said["error"]["problems"][0]["text"]
    assert said["error"]["message"] in result.stderr
    assert list(here.iterdir()) == [here / "designs"]


def test_surfaces_and_doctor_in_json(here, monkeypatch):
    _, said = answer("surfaces")
    assert [entry["name"] for entry in said["surfaces"]] == list(catalog)
    assert said["surfaces"][1]["closes"] == "v" and "gyroid" in said["periodic"]
    ill = Finding("cadquery", False, "does not load", "python -m pip install something")
    monkeypatch.setattr(cad_doctor, "doctor", lambda: [ill])
    code, said = answer("doctor")
    assert (code, said["exit_code"]) == (3, 3)
    assert said["findings"][-1]["remedy"] == said["repair"] == ill.remedy


def test_quiet_says_what_is_wrong_and_nothing_else(here, walk):
    walk(checks=(GOOD, BAD))
    result = run("build", "designs/house.toml", "--quiet")
    assert (result.exit_code, result.stdout) == (1, "")
    assert result.stderr == "1 check failed: panel mass\n"


def test_verbose_tells_stages_figures_and_notes(here, walk):
    made = walk(checks=(CheckResult("planarity", 1e-15, 1e-12, "1", note="off the plane"), GOOD))
    build = made.build

    def reporting(design, progress=None):
        for stage in ("surface", "shell", "shell"):
            progress(stage, 0, 0)
        return build(design, progress)

    made.build = reporting
    result = run("check", "designs/house.toml", "-v")
    assert [line.split()[-1] for line in result.stderr.splitlines()] == ["surface", "shell"]
    assert "planarity: off the plane" in result.stdout
    assert "size x  5928 mm" in result.stdout


# -- export, view ----------------------------------------------------------------------------------


def test_export_asks_the_build_for_the_formats(here, walk):
    made = walk()
    code, said = answer("export", "designs/house.toml", "--format", "glb, step,glb", "-o", "out")
    assert code == 0
    assert said["designs"][0]["files"] == [{"path": "out/parts.glb", "bytes": 7}]
    assert made.formats == ["glb", "step"]


@pytest.fixture
def opened(here, monkeypatch):
    """Collect what a browser is asked to open, on a machine that has one."""
    asked = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(webbrowser, "open", lambda url: asked.append(url) or True)
    folder = here / "exports" / "house"
    folder.mkdir(parents=True)
    (folder / "report.html").write_text("<p>", encoding="utf-8")
    os.utime(here / "designs" / "house.toml", (0, 0))
    return asked


@pytest.mark.parametrize(
    "thing", ["designs/house.toml", "exports/house", "exports/house/report.html"]
)
def test_view_opens_the_report(here, opened, thing):
    result = run("view", thing)
    assert (result.exit_code, result.stderr) == (0, "")
    assert Path(result.stdout.strip()) == Path("exports/house/report.html")
    assert opened == [(here / "exports" / "house" / "report.html").as_uri()]


def test_view_without_a_display_says_where_the_report_is(here, opened, monkeypatch):
    monkeypatch.setattr(starting, "_has_display", lambda: False)
    result = run("view", "exports/house")
    assert (result.exit_code, opened) == (0, [])
    assert "report.html" in result.stdout and "yourself" in result.stderr
    assert run("view", "exports/house", "--no-open").stderr == ""


def test_view_says_what_is_missing_or_old(here, opened):
    (here / "designs" / "new.toml").write_text(DESIGN)
    result = run("view", "designs/new.toml")
    assert result.exit_code == 2
    assert "phexfab build designs/new.toml makes one" in result.stderr
    os.utime(here / "exports" / "house" / "report.html", (0, 0))
    os.utime(here / "designs" / "house.toml", (9, 9))
    assert "is newer than its report" in run("view", "designs/house.toml").stderr


# -- new -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", catalog)
def test_a_starter_of_every_surface_passes_all_checks_as_it_is(here, name):
    result = run("new", "shell", "--surface", name)
    assert result.exit_code == 0, result.output
    built = phexfab.build("shell.toml")
    assert built.ok and 40 < len(built.parts.panels) < 200
    assert built.design.surface.name == name and built.design.title == "Shell"


def circle(path, radius):
    turn = 2 * np.pi * np.arange(90) / 90
    points = np.column_stack(
        [radius * np.cos(turn), radius * np.sin(turn), radius / 8 * np.cos(2 * turn)]
    )
    np.savetxt(path, points, delimiter=",")


def test_a_starter_for_a_rim_names_it_from_where_it_stands(here):
    circle(here / "rim.csv", 3000.0)
    code, said = answer("new", "designs/canopy", "--rim", "rim.csv")
    assert (code, said["design"], said["failed_checks"]) == (0, "designs/canopy.toml", [])
    design = load_design("designs/canopy.toml")
    assert design.surface.rim == ("../rim.csv",)
    assert phexfab.build(design).ok


def test_a_starter_refuses_to_replace_a_design(here):
    assert run("new", "designs/house").exit_code == 2
    assert (here / "designs" / "house.toml").read_text() == DESIGN
    assert run("new", "designs/house.toml", "--force", "--panel-size", "50cm").exit_code == 0
    assert load_design("designs/house.toml").lattice.panel_size == 500


def test_a_starter_is_the_same_every_time(here):
    run("new", "a")
    first = (here / "a.toml").read_bytes()
    run("new", "a", "--force")
    assert (here / "a.toml").read_bytes() == first
    assert sorted(path.name for path in here.iterdir()) == [
        "a.toml",
        "designs",
        "phexfab-design.schema.json",
    ]


# -- completion ------------------------------------------------------------------------------------


def completions(*words):
    """Return what bash is offered after the given words, the last one begun."""
    environment = {
        **os.environ,
        "_PHEXFAB_COMPLETE": "complete_bash",
        "COMP_WORDS": " ".join(("phexfab", *words)),
        "COMP_CWORD": str(len(words)),
    }
    code = "from phexfab.cli import app; app(prog_name='phexfab')"
    ran = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True
    )
    return ran.stdout.split()


def test_a_shell_completes_verbs_and_names():
    assert completions("ch") == ["check"]
    assert completions("new", "roof", "--surface", "cat") == [
        "catenoid",
        "catenoid-helicoid",
        "catalan",
    ]


def test_what_files_are_completed_with(here):
    (here / "roof.toml").touch()
    (here / "roof.csv").touch()
    (here / ".hidden.toml").touch()
    assert paths_like("", ".toml") == ["designs/", "roof.toml"]
    assert paths_like("designs/h", ".toml") == ["designs/house.toml"]
    assert paths_like(f"{here}/ro", ".csv") == [f"{here}/roof.csv"]
    assert paths_like("nowhere/x", ".toml") == []


def test_formats_are_completed_one_after_the_other():
    assert format_names("gl") == ["glb"]
    assert "glb,step" in format_names("glb,st") and "glb,glb" not in format_names("glb,")
    assert list(dict(surface_names("cat"))) == ["catenoid", "catenoid-helicoid", "catalan"]

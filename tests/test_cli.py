"""The command line: what it prints where, and with which exit code it ends."""

import subprocess
import sys
import types

import pytest
from typer.testing import CliRunner

import phexfab
from phexfab import cli, cli_view
from phexfab.cad import doctor as cad_doctor
from phexfab.cad.doctor import Finding
from phexfab.cli import app
from phexfab.errors import MissingLibraryError, OffsetLimitError, SolveError
from phexfab.fabrication.parts import CheckResult
from phexfab.surface.catalog import catalog

DESIGN = '[surface]\nname = "catenoid"\n[lattice]\npanel_size = 600\n'
GOOD = CheckResult("planarity", 1e-15, 1e-12, "1", worst="P003")
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
        return types.SimpleNamespace(checks=self.checks, figures=figures, write=self.write)

    def check(self, design, progress=None):
        return self.build(design, progress).checks

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

    def check(design, progress=None):
        progress("panels [bold]", 1, 4)
        progress("panels [bold]", 4, 4)
        progress("nesting", 0, 0)
        return (GOOD,)

    made.check = check
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
    assert cli_view.figure(value, unit) == shown


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
    assert "cadquery: python -m pip install something" in result.stdout
    monkeypatch.setattr(cad_doctor, "doctor", lambda: [well])
    monkeypatch.setattr(cli, "LIBRARIES", ("numpy", "no-such-library"))
    result = run("doctor")
    assert result.exit_code == 3
    assert "no-such-library: python -m pip install --upgrade no-such-library" in result.stdout


def test_version(here, monkeypatch):
    monkeypatch.setattr(cli, "_version", lambda name: "1.2.3")
    assert run("--version").stdout == "phexfab 1.2.3\n"
    monkeypatch.setattr(cli, "_version", lambda name: "")
    assert "not installed" in run("--version").stdout


def test_help_names_every_command_and_the_exit_codes(monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")
    text = run("--help").output
    for word in (
        "build",
        "check",
        "compare",
        "inspect",
        "surfaces",
        "doctor",
        "--version",
        "Exit codes",
    ):
        assert word in text


def test_python_m_phexfab_is_the_same_command(tmp_path):
    bad = tmp_path / "bad.toml"
    bad.write_text("x = 1\n")
    ran = subprocess.run(
        [sys.executable, "-m", "phexfab", "check", str(bad)], capture_output=True, text=True
    )
    assert (ran.returncode, ran.stdout) == (2, "")
    assert ran.stderr.startswith(f"{bad}: 3 things are wrong\n  x = 1 (line 1): unknown key")

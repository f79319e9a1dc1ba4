"""What docs/tutorial.md prints is what phexfab prints: the design, the rim, checks, refusals."""

import re
from pathlib import Path

import pytest
from typer.testing import CliRunner

from phexfab import build, load_design, parse_design
from phexfab.cli import app

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "tutorial.md").read_text(encoding="utf-8")
RIM, GOOD, COARSE, DEEP, HEAVY = re.findall(r"```text\n(.*?)```", PAGE, re.DOTALL)
(LARGE,) = re.findall(r"Panels of (.+ m):", PAGE)
(DESIGN,) = re.findall(r"```toml\n(.*?)```", PAGE, re.DOTALL)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "rims").mkdir()
    (tmp_path / "rims" / "garden-roof.csv").write_text(RIM, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def checked(folder: Path, old: str = "", new: str = "") -> tuple[int, list[str]]:
    """Return the exit code and the lines that ``phexfab check`` prints, white space joined."""
    assert old in DESIGN
    (folder / "garden-roof.toml").write_text(DESIGN.replace(old, new), encoding="utf-8")
    ran = CliRunner().invoke(app, ["check", "garden-roof.toml"], env={"COLUMNS": "100"})
    return ran.exit_code, [" ".join(line.split()) for line in ran.output.splitlines()]


def printed(block: str) -> list[str]:
    lines = [" ".join(line.split()) for line in block.splitlines()]
    # The last digits of rounding errors, and where they are largest, depend on the machine.
    return [line for line in lines if line != "…" and not re.search(r"e-1\d ", line)]


def test_the_design_and_the_rim_are_those_of_the_example():
    assert (ROOT / "examples" / "rims" / "garden-roof.csv").read_text(encoding="utf-8") == RIM
    assert parse_design(DESIGN) == load_design(ROOT / "examples" / "garden-roof.toml")


def test_the_roof_can_be_built_and_is_checked_as_printed(folder):
    code, lines = checked(folder)
    assert code == 0 and len(printed(GOOD)) == 3
    assert [line for line in printed(GOOD) if line not in lines] == []
    assert re.search(r"^planarity +\S+e-1[56] .* ok$", GOOD, re.MULTILINE)
    parts = build("garden-roof.toml").parts
    assert f"all {len(parts.panels)} panels and {len(parts.beams)} flats" in PAGE


@pytest.mark.parametrize(
    "old, new, code, block",
    [
        ('"49 cm"', f'"{LARGE}"', 1, COARSE),
        ('"60 mm"', '"1.2 m"', 2, DEEP),
        ('"12 mm"', '"12 kg"', 2, HEAVY),
    ],
)
def test_what_is_broken_on_purpose_is_answered_as_printed(folder, old, new, code, block):
    found, lines = checked(folder, old, new)
    assert found == code
    said = " ".join(lines)
    for expected in printed(block) if code == 1 else [" ".join(printed(block))]:
        assert expected in said

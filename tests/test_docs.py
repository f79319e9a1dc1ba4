"""What the pages say about files and commands is true."""

import re
from pathlib import Path

import pytest

from phexfab.design import load_design, parse_design

ROOT = Path(__file__).parent.parent
# docs/project/ holds what the site is made from besides, see docs/conf.py.
MANUAL = [p for p in sorted((ROOT / "docs").rglob("*.md")) if p.parent.name != "project"]
PAGES = [*sorted(ROOT.glob("*.md")), *MANUAL]
LINK = re.compile(r"\]\(([^)#\s]+)[^)]*\)")
EXAMPLES = sorted((ROOT / "examples").glob("*.toml"))


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_link_to_a_file_leads_somewhere(page):
    targets = LINK.findall(page.read_text(encoding="utf-8"))
    local = [target for target in targets if not target.startswith(("http:", "https:", "mailto:"))]
    assert [target for target in local if not (page.parent / target).exists()] == []


def test_every_page_is_in_the_index():
    index = (ROOT / "docs" / "README.md").read_text(encoding="utf-8")
    linked = {(ROOT / "docs" / target).resolve() for target in LINK.findall(index)}
    pages = {page.resolve() for page in MANUAL}
    assert pages - linked == {(ROOT / "docs" / "README.md").resolve()}


def test_the_continuous_integration_runs_the_readme_s_commands():
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    script = (ROOT / ".ci" / "run").read_text(encoding="utf-8")
    install, test = (line.strip() for line in readme.splitlines() if line.startswith("    python"))
    for command in (*install.split(" && "), *test.split(" && ")):
        assert command.replace("install", "install --quiet") in " ".join(script.split())


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_examples_are_designs(path):
    design = load_design(path)
    assert design.title and design.surface.model_fields_set


def test_the_examples_show_every_offset_type_and_a_ring():
    designs = [load_design(path) for path in EXAMPLES]
    assert {design.offset.type for design in designs} == {"face", "edge", "vertex"}
    assert any("closed" in (design.surface.u, design.surface.v) for design in designs)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_designs_on_the_pages_are_right(page):
    for block in re.findall(r"```toml\n(.*?)```", page.read_text(encoding="utf-8"), re.DOTALL):
        assert parse_design(block, source=page.name).lattice.panel_size > 0

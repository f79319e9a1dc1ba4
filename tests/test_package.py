"""The package: what its names cost, where they come from, and what is shipped with it."""

import ast
import fnmatch
import importlib
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

import phexfab

ROOT = Path(__file__).parent.parent
PACKAGE = Path(phexfab.__path__[0])
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CITATION = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
HEAVY = {"numpy", "scipy", "pydantic", "shapely", "rich", "typer", "cadquery", "build123d", "OCP"}


def modules_after(statement):
    """Return the modules that a fresh interpreter has imported after a statement."""
    code = f"import sys\nbefore = set(sys.modules)\n{statement}\nprint(*set(sys.modules) - before)"
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return set(ran.stdout.split())


def test_importing_phexfab_imports_next_to_nothing():
    found = modules_after("import phexfab")
    assert {name.split(".")[0] for name in found} & HEAVY == set()
    assert {name for name in found if name.startswith("phexfab")} == {"phexfab"}


def test_a_name_brings_along_what_it_needs_and_no_more():
    found = modules_after("from phexfab import DesignError")
    assert {name for name in found if name.startswith("phexfab")} == {"phexfab", "phexfab.errors"}


def test_the_command_is_ready_without_the_mathematics():
    found = modules_after("from phexfab.cli import app")
    ours = {name for name in found if name.startswith("phexfab.")}
    assert {name.split(".")[1] for name in ours} == {"cli", "errors"}
    assert {name.split(".")[0] for name in found} & {"numpy", "scipy", "shapely"} == set()


def read_imports():
    """Return name -> module of what type checkers read in phexfab/__init__.py."""
    tree = ast.parse((PACKAGE / "__init__.py").read_text(encoding="utf-8"))
    (block,) = [node for node in tree.body if isinstance(node, ast.If)]
    assert ast.unparse(block.test) == "TYPE_CHECKING"
    return {alias.asname or alias.name: node.module for node in block.body for alias in node.names}


def test_names_come_from_where_type_checkers_think_they_do():
    asked = {name: f"phexfab.{place}" for name, place in phexfab._PLACES.items()}
    assert asked == read_imports()
    assert sorted(asked) == phexfab.__all__ == sorted(phexfab.__all__)


@pytest.mark.parametrize("name", phexfab.__all__)
def test_every_public_name_is_there(name):
    assert getattr(phexfab, name) is getattr(importlib.import_module(read_imports()[name]), name)
    assert name in dir(phexfab)


@pytest.mark.parametrize("room", sorted(phexfab._ROOMS))
def test_rooms_can_be_reached_by_their_names(room):
    assert getattr(phexfab, room) is importlib.import_module(f"phexfab.{room}")


def test_a_room_need_not_be_imported_first():
    assert "phexfab.design.units" in modules_after("import phexfab; phexfab.design.quantity")


def test_other_names_are_refused():
    with pytest.raises(AttributeError, match="has no attribute 'frobnicate'"):
        phexfab.frobnicate  # noqa: B018
    assert not hasattr(phexfab, "_private")


def test_a_star_brings_the_public_names_and_nothing_else():
    namespace = {}
    exec("from phexfab import *", namespace)
    assert sorted(set(namespace) - {"__builtins__"}) == phexfab.__all__


# -- what is said about it -------------------------------------------------------------------------


def test_there_is_one_version_and_it_is_semantic():
    assert re.fullmatch(r"\d+\.\d+\.\d+(-[0-9A-Za-z.-]+)?", phexfab.__version__)
    assert PROJECT["project"]["dynamic"] == ["version"]
    assert PROJECT["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "phexfab.__version__"}
    assert re.search(r"^version: (.*)$", CITATION, re.MULTILINE)[1] == phexfab.__version__


def test_the_changelog_begins_with_what_is_not_released():
    text = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    sections = re.findall(r"^## (.*)$", text, re.MULTILINE)
    assert sections[0] == "Unreleased"
    released = [re.fullmatch(r"(\d+\.\d+\.\d+) – \d{4}-\d\d-\d\d", title) for title in sections[1:]]
    assert all(released)


def test_the_citation_agrees_with_the_package():
    said = dict(re.findall(r"^([\w-]+): (.+)$", CITATION, re.MULTILINE))
    assert said["cff-version"] == "1.2.0" and said["type"] == "software" and said["message"]
    assert said["license"] == PROJECT["project"]["license"]
    for author in PROJECT["project"]["authors"]:
        assert f"  - name: {author['name']}\n" in CITATION


def test_all_that_the_package_reads_is_shipped():
    patterns = PROJECT["tool"]["setuptools"]["package-data"]["phexfab"]
    others = [
        path.relative_to(PACKAGE).as_posix()
        for path in PACKAGE.rglob("*")
        if path.is_file() and path.suffix not in (".py", ".pyc")
    ]
    assert [name for name in others if not any(fnmatch.fnmatch(name, p) for p in patterns)] == []
    assert all(any(fnmatch.fnmatch(name, p) for name in others) for p in patterns)

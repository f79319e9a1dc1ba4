"""The examples in docstrings give what they print, and every public verb and value has one."""

import doctest
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import phexfab

ROOT = Path(phexfab.__file__).parent
FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def modules_with_examples() -> list[str]:
    paths = [p for p in sorted(ROOT.rglob("*.py")) if ">>> " in p.read_text(encoding="utf-8")]
    return [".".join(p.relative_to(ROOT.parent).with_suffix("").parts) for p in paths]


def examples() -> dict[str, doctest.DocTest]:
    """Return the examples by the full name of what they stand in."""
    finder = doctest.DocTestFinder(exclude_empty=True)
    found = [
        test
        for module in modules_with_examples()
        for test in finder.find(import_module(module), globs={})
    ]
    return {test.name: test for test in found if test.examples}


EXAMPLES = examples()


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_examples_of_a_docstring_are_true(name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    said: list[str] = []
    with np.printoptions(precision=8, linewidth=75, suppress=False, legacy=False):
        doctest.DocTestRunner(optionflags=FLAGS).run(EXAMPLES[name], out=said.append)
    assert not said, "".join(said)


def test_every_public_verb_and_value_has_an_example():
    values = [getattr(phexfab, name) for name in phexfab.__all__]
    public = {
        f"{value.__module__}.{value.__qualname__}"
        for value in values
        if callable(value) and not (isinstance(value, type) and issubclass(value, Exception))
    }
    assert public - set(EXAMPLES) == set()

"""Every Python block of the pages runs as printed, and so do the scripts of the quickstart.

The blocks of a page run in order in one namespace, in a folder that has the examples. What a page
takes for granted is said in a comment that readers do not see, ``<!-- run first … -->``; a block
that needs a screen is marked ``<!-- not run: reason -->``.
"""

import contextlib
import io
import re
import shutil
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
BLOCK = re.compile(
    r"<!-- run first\n(?P<first>.*?)-->"
    r"|(?P<skip><!-- not run: .+? -->\n+)?```python\n(?P<code>.*?)```",
    re.DOTALL,
)


def blocks(page: Path) -> list[tuple[int, str]]:
    """Return line and code of what is to run on a page."""
    text = page.read_text(encoding="utf-8")
    found = []
    for match in BLOCK.finditer(text):
        code = match["first"] or match["code"]
        if not match["skip"]:
            found.append((text.count("\n", 0, match.start(match.lastgroup)) + 1, code))
    return found


@pytest.mark.parametrize(
    "page",
    [page for page in PAGES if "project" not in page.parts and blocks(page)],
    ids=lambda page: page.relative_to(ROOT).as_posix(),
)
def test_the_code_of_a_page_runs(page, tmp_path, monkeypatch):
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    namespace: dict[str, object] = {"__name__": "page"}
    with contextlib.redirect_stdout(io.StringIO()):
        for line, code in blocks(page):
            exec(compile("\n" * (line - 1) + code, str(page), "exec"), namespace)

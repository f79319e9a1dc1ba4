"""The manual as a site: python -m pip install ".[docs]" && python -m sphinx docs build/site

The pages are the Markdown files of this folder, the navigation is what README.md links to, section by
section; nothing has to be listed twice.
"""

from __future__ import annotations

import ast
import os
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sphinx.application import Sphinx

ROOT = Path(__file__).parent.parent
LINK = re.compile(r"\]\((\.\.?/[^)#\s]+|[^)#\s:]+)(#[^)\s]*)?\)")

project = "phexfab"
author = "The phexfab authors"
release = re.search(r'__version__ = "(.+)"', (ROOT / "phexfab/__init__.py").read_text())[1]
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
root_doc = "README"
exclude_patterns = ["img"]
suppress_warnings = ["myst.header"]
myst_heading_anchors = 3
myst_enable_extensions = ["attrs_inline"]
autodoc_typehints = "none"
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = False
html_theme = "furo"
html_title = f"phexfab {release}"
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#b3542e", "color-brand-content": "#b3542e"},
    "dark_css_variables": {"color-brand-primary": "#e08a63", "color-brand-content": "#e08a63"},
}


def reference() -> str:
    """Return the page of every public name, in the order of the house's rooms."""
    source = (ROOT / "phexfab" / "__init__.py").read_text(encoding="utf-8")
    rooms: dict[str, set[str]] = {}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("phexfab."):
            rooms.setdefault(node.module.split(".")[1], set()).update(a.name for a in node.names)
    lines = ["# The functions", "", "All that `import phexfab` hands out, by the rooms of the house."]
    for room, names in rooms.items():
        lines += ["", f"## {room}", "", "```{eval-rst}"]
        for name in sorted(names):
            lines += [f".. auto{kind(name)}:: phexfab.{name}", *options(name), ""]
        lines += ["```"]
    return "\n".join(lines) + "\n"


def kind(name: str) -> str:
    import phexfab

    value = getattr(phexfab, name)
    if isinstance(value, type):
        return "exception" if issubclass(value, BaseException) else "class"
    return "function" if callable(value) else "data"


def options(name: str) -> list[str]:
    return ["   :members:"] if kind(name) == "class" else []


def links_within(text: str, page: str) -> str:
    """Return a page whose links to pages of the repository's root lead to the site's copies."""

    def moved(link: re.Match[str]) -> str:
        path = Path(os.path.normpath(ROOT / "docs" / Path(page).parent / link[1]))
        if path.is_dir():
            path /= "report.html"
        if path.parent == ROOT and f"{path.stem.lower()}" in {"contributing", "changelog"}:
            path = ROOT / "docs" / "project" / path.name
        elif path == ROOT / "README.md":
            path = ROOT / "docs" / "README.md"
        elif not path.exists():
            return link[0]
        away = os.path.relpath(path, ROOT / "docs" / Path(page).parent)
        return f"]({Path(away).as_posix()}{link[2] or ''})"

    return LINK.sub(moved, text)


def navigation(index: str) -> str:
    """Return the hidden tables of contents: the pages that each section of the index links to."""
    blocks = []
    for section in re.split(r"^## ", index, flags=re.MULTILINE)[1:]:
        caption = section.splitlines()[0].strip()
        pages = [target for target in re.findall(r"^\| \[[^]]*\]\(([^)#]+\.md)\)", section, re.MULTILINE)]
        if pages:
            blocks += ["```{toctree}", ":hidden:", f":caption: {caption}", "", *pages, "```", ""]
    return "\n".join(blocks)


def read_page(app: Sphinx, page: str, source: list[str]) -> None:
    text = links_within(source[0], page)
    source[0] = f"{text}\n{navigation(text)}" if page == root_doc else text


def project_pages(app: Sphinx) -> None:
    """Write the pages that are made from the repository: the functions, changes, contributing."""
    folder = Path(app.srcdir) / "project"
    folder.mkdir(exist_ok=True)
    pages = {name: (ROOT / name).read_text("utf-8") for name in ("CONTRIBUTING.md", "CHANGELOG.md")}
    pages = {n: re.sub(r"\]\((?=[^)#:\s]+\))", "](../../", text) for n, text in pages.items()}
    pages["functions.md"] = reference()
    for name, text in pages.items():
        if not (folder / name).exists() or (folder / name).read_text("utf-8") != text:
            (folder / name).write_text(text, encoding="utf-8")


def front_door(app: Sphinx, failed: Exception | None) -> None:
    if not failed:
        page = '<!doctype html><meta http-equiv="refresh" content="0; url=README.html">'
        (Path(app.outdir) / "index.html").write_text(page, encoding="utf-8")


def setup(app: Sphinx) -> None:
    app.connect("builder-inited", project_pages)
    app.connect("source-read", read_page)
    app.connect("build-finished", front_door)

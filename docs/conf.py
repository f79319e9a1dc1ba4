"""The manual as a site: python -m pip install ".[docs]" && python -m sphinx docs build/site

The pages are the Markdown files of this folder, the navigation is what README.md links to, section
by section; nothing has to be listed twice.
"""

from __future__ import annotations

import ast
import os
import re
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from docutils import nodes
    from sphinx.application import Sphinx

ROOT = Path(__file__).parent.parent
ROOMS = {
    "pipeline": "The whole walk",
    "design": "Design files",
    "surface": "Smooth surfaces",
    "remesh": "Lattices",
    "minimal": "Minimal shells",
    "parallel": "Parallel meshes and offsets",
    "fabrication": "Parts and checks",
    "mesh": "Polygon meshes",
    "errors": "Errors",
}
DOORS = {
    "cadquery": "CadQuery",
    "build123d": "build123d",
    "plots": "Pictures",
    "testing": "Assertions",
}
MADE = ["project/functions", "project/CHANGELOG", "project/CONTRIBUTING"]
LINK = re.compile(r"\]\((\.\.?/[^)#\s]+|[^)#\s:]+)(#[^)\s]*)?\)")

project = "phexfab"
author = "The phexfab authors"
release = re.search(r'__version__ = "(.+)"', (ROOT / "phexfab/__init__.py").read_text())[1]
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_copybutton"]
root_doc = "README"
exclude_patterns = ["img"]
suppress_warnings = ["myst.header", "ref.python"]
myst_heading_anchors = 3
myst_enable_extensions = ["attrs_inline"]
autodoc_typehints = "none"
autodoc_member_order = "bysource"
default_role = "literal"
napoleon_google_docstring = False
napoleon_use_rtype = False
html_theme = "furo"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_title = f"phexfab {release}"
html_copy_source = False
html_show_sphinx = False
html_theme_options = {
    "light_css_variables": {"color-brand-primary": "#b3542e", "color-brand-content": "#b3542e"},
    "dark_css_variables": {"color-brand-primary": "#e08a63", "color-brand-content": "#e08a63"},
}


def reference() -> dict[str, str]:
    """Return the pages of every public name: an index, and one for each room of the house."""
    source = (ROOT / "phexfab" / "__init__.py").read_text(encoding="utf-8")
    rooms: dict[str, set[str]] = {}
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("phexfab."):
            rooms.setdefault(node.module.split(".")[1], set()).update(a.name for a in node.names)
    order = sorted(rooms, key=lambda room: [*ROOMS, room].index(room))
    parts = [(room, ROOMS.get(room, room), "phexfab", rooms[room]) for room in order]
    for door, title in DOORS.items():
        module = f"phexfab.{door}"
        parts.append((door, title, module, set(import_module(module).__all__)))
    index = ["# The functions", "", "What `import phexfab` hands out, and its side doors."]
    pages = {}
    for room, title, module, names in parts:
        head = title if module == "phexfab" else f"{title}: `{module}`"
        index += ["", f"## {head}", "", "| name | is for |", "|---|---|"]
        page = [f"# {head}", "", "```{eval-rst}", f".. currentmodule:: {module}", ""]
        for name in sorted(names, key=str.lower):
            value = getattr(import_module(module), name)
            said = "The named surfaces." if name == "catalog" else value.__doc__.strip()
            summary = said.splitlines()[0].replace("|", r"\|")
            index.append(f"| {{py:obj}}`{name} <{module}.{name}>` | {summary} |")
            page += directive(module, name, value)
        pages[f"functions-{room}.md"] = "\n".join([*page, "```"]) + "\n"
    tree = ["", "```{toctree}", ":hidden:", "", *(f"functions-{part[0]}" for part in parts), "```"]
    return {"functions.md": "\n".join([*index, *tree]) + "\n", **pages}


def directive(module: str, name: str, value: object) -> list[str]:
    """Return the lines that have autodoc describe a name."""
    kind, options = "data", ["   :no-value:"]
    if isinstance(value, type):
        kind = "exception" if issubclass(value, BaseException) else "class"
        pydantic = "   :exclude-members: model_config, model_post_init"
        options = ["   :members:", pydantic] if kind == "class" else []
    elif callable(value):
        kind, options = "function", []
    return [f".. auto{kind}:: {module}.{name}", *options, ""]


def links_within(text: str, page: str) -> str:
    """Return a page whose links to pages of the repository's root lead to the site's copies."""

    def moved(link: re.Match[str]) -> str:
        path = Path(os.path.normpath(ROOT / "docs" / Path(page).parent / link[1]))
        if path == ROOT / "examples":
            path = ROOT / "docs" / "gallery.md"
        elif path.is_dir():
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
        pages = list(dict.fromkeys(re.findall(r"\]\(([^)#:]+)\.md\)", section)))
        if caption == "Reference":
            pages = [page for page in pages if not page.startswith((root_doc, "project"))] + MADE
        if pages:
            blocks += ["```{toctree}", ":hidden:", f":caption: {caption}", "", *pages, "```", ""]
    return "\n".join(blocks)


def read_page(app: Sphinx, page: str, source: list[str]) -> None:
    text = links_within(source[0], page)
    source[0] = f"{text}\n{navigation(text)}" if page == root_doc else text


def keep_short_cells(app: Sphinx, doctree: nodes.document) -> None:
    """Mark short cells of tables, such as "≤ 1e-12", so that the style sheet keeps them whole."""
    from docutils import nodes

    for entry in doctree.findall(nodes.entry):
        if len(entry.astext()) <= 12:
            entry["classes"].append("short")


def name_fields(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]):
    """Have the attributes of a value listed as what they are: the parameters it is made from."""
    if what == "class" and "Parameters" not in lines:
        for k in range(len(lines) - 1):
            if lines[k] == "Attributes" and lines[k + 1].startswith("---"):
                lines[k : k + 2] = ["Parameters", "----------"]


def escape_bars(app: Sphinx, what: str, name: str, obj: object, options: object, lines: list[str]):
    """Keep |H| and the like in docstrings from being taken for a substitution."""
    for k, line in enumerate(lines):
        if not line.lstrip().startswith((">>>", "...")):
            quoted = re.split(r"(`+[^`]*`+)", line)
            quoted[::2] = [text.replace("|", r"\|") for text in quoted[::2]]
            lines[k] = "".join(quoted)


def project_pages(app: Sphinx) -> None:
    """Write the pages that are made from the repository: the functions, changes, contributing."""
    folder = Path(app.srcdir) / "project"
    folder.mkdir(exist_ok=True)
    pages = {name: (ROOT / name).read_text("utf-8") for name in ("CONTRIBUTING.md", "CHANGELOG.md")}
    pages = {n: re.sub(r"\]\((?=[^)#:\s]+\))", "](../../", text) for n, text in pages.items()}
    pages |= reference()
    for old in {page.name for page in folder.glob("*.md")} - set(pages):
        (folder / old).unlink()
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
    app.connect("doctree-read", keep_short_cells)
    app.connect("autodoc-process-docstring", name_fields, priority=100)
    app.connect("autodoc-process-docstring", escape_bars, priority=900)
    app.connect("build-finished", front_door)

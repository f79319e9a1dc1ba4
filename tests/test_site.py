"""The manual as a site: every page is in its navigation, it builds, and no link in it is dead."""

import importlib.util
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"


def configuration():
    spec = importlib.util.spec_from_file_location("site_conf", DOCS / "conf.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_every_page_is_in_the_navigation():
    conf = configuration()
    index = conf.links_within((DOCS / "README.md").read_text(encoding="utf-8"), "README")
    listed = re.findall(r"^[\w/-]+$", conf.navigation(index), re.MULTILINE)
    pages = {page.relative_to(DOCS).with_suffix("").as_posix() for page in DOCS.rglob("*.md")}
    written = {page for page in pages if not page.startswith("project/")} - {"README"}
    assert set(listed) == written | set(conf.MADE)
    assert len(listed) == len(set(listed))


def test_every_public_name_is_in_the_reference():
    import phexfab

    conf = configuration()
    listed = re.findall(r"auto\w+:: phexfab\.(\w+)$", "".join(conf.reference().values()), re.M)
    assert sorted(listed) == sorted(name for name in phexfab.__all__ if name[0] != "_")


class Page(HTMLParser):
    def __init__(self, path: Path):
        super().__init__()
        self.links, self.names = [], set()
        self.feed(path.read_text(encoding="utf-8"))

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.names |= {found[key] for key in ("id", "name") if found.get(key)}
        self.links += [found[key] for key in ("href", "src") if found.get(key)]


@pytest.mark.long
def test_the_site_builds_without_a_warning_and_without_dead_links(tmp_path):
    pytest.importorskip("sphinx")
    command = [sys.executable, "-m", "sphinx", "-W", "-q", "-E", str(DOCS), str(tmp_path)]
    ran = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    pages = {path.resolve(): Page(path) for path in tmp_path.rglob("*.html")}
    dead = []
    for path, page in pages.items():
        for link in map(urlsplit, page.links):
            if link.scheme or link.netloc or path.name == "search.html":
                continue
            target = (path.parent / unquote(link.path)).resolve() if link.path else path
            named = pages[target].names if link.fragment and target in pages else {link.fragment}
            if not target.exists() or unquote(link.fragment) not in named:
                dead.append(f"{path.name}: {link.geturl()}")
    assert dead == []

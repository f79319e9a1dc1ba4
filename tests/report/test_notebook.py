"""What a person sees of values: short lines at a prompt, a picture in a notebook."""

import base64
import io
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from PIL import Image

import phexfab
from phexfab.report import notebook

DESIGN = """
title = "Roof <A> & Söhne"
[surface]
name = "enneper"
scale = "3 m"
[lattice]
panel_size = 800
[beams]
ends = "hub"
[nodes]
kind = "hub"
"""


@pytest.fixture(scope="module")
def built():
    return phexfab.build(phexfab.parse_design(DESIGN))


def failing(built):
    limits = {"shortest_edge": 1e6}
    checks = tuple(replace(c, limit=limits.get(c.name, c.limit)) for c in built.checks)
    return replace(built, checks=checks)


def test_values_say_in_a_line_what_they_are(built):
    parts = built.parts
    counts = f"{len(parts.panels)} panels, {len(parts.beams)} beams, {len(parts.nodes)} nodes"
    name = "Roof <A> & Söhne"
    assert repr(built) == f"<Build '{name}': {counts}; {len(built.checks)} checks, all pass>"
    assert repr(failing(built)).endswith("checks, 1 failed: shortest_edge>")
    assert repr(parts) == f"<Parts: {counts}>"
    assert repr(built.shell.mesh).startswith(f"<PolyMesh: {built.shell.mesh.n_faces} faces, ")
    assert repr(built.shell) == f"<Shell: {len(built.shell.panels)} panels, edge offsets>"
    panel, beam, node = parts.panels[0], parts.beams[0], parts.nodes[0]
    assert repr(panel).startswith(f"<Panel {panel.mark}: ") and f"{panel.mass:.3g} kg" in repr(
        panel
    )
    assert repr(beam).startswith(f"<Beam {beam.mark}: {beam.nodes[0]}–{beam.nodes[1]}, ")
    assert repr(node).startswith(f"<Node {node.mark}: ⌀ {2 * node.cylinder.radius:g} × ")


class _Reader(HTMLParser):
    """Text, list items and the image of a page."""

    def __init__(self):
        super().__init__()
        self.said, self.items, self.image, self.open = "", [], "", []

    def handle_starttag(self, tag, attributes):
        if tag == "img":
            self.image = dict(attributes)["src"]
        else:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1] == "li":
            self.items.append(data)
        else:
            self.said += data


@pytest.mark.parametrize("wrong", [False, True])
def test_a_notebook_shows_picture_verdict_and_what_fails(built, monkeypatch, wrong):
    monkeypatch.setattr(notebook, "SIZE", (160, 100))
    page = _Reader()
    page.feed((failing(built) if wrong else built)._repr_html_())
    assert page.open == []
    assert page.said.startswith("'Roof <A> & Söhne': ")
    assert [item.split(":")[0] for item in page.items] == ["shortest_edge"] * wrong
    if wrong:
        assert re.search(r"limit 1e\+06, worst B\d+\. ", page.items[0])
    with Image.open(io.BytesIO(base64.b64decode(page.image.partition(",")[2]))) as picture:
        assert picture.size == (160, 100)

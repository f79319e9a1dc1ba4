"""A small build as the report gets it, and the page read back by Python's own parser."""

from functools import lru_cache
from html.parser import HTMLParser

import numpy as np

from phexfab.fabrication.bars import BeamSpec
from phexfab.fabrication.beams import beams
from phexfab.fabrication.marking import engraving
from phexfab.fabrication.nest import nest_all
from phexfab.fabrication.nodes import NodeSpec, nodes
from phexfab.fabrication.panels import PanelSpec, panels
from phexfab.fabrication.parts import CheckResult, Parts, Stock
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.report.data import ReportData
from phexfab.report.page import report_html
from phexfab.surface.catalog import surface

EVIL = """Pavilion </script><b onclick='x()'>&amp; "quoted" \u2028]]> --> ñ"""
VOID = {"meta", "img", "br", "input", "link", "hr"}


@lru_cache(maxsize=1)
def sample():
    """A patch of Enneper's surface with panels, beams, hubs, sheets and engraving."""
    smooth = surface("enneper").scaled(3000.0)
    shell = minimal_shell(smooth, lattice_on(smooth, 700.0), "edge")
    panel, node = PanelSpec(), NodeSpec(kind="hub")
    beam = BeamSpec(ends="hub", hub_radius=node.radius)
    parts = Parts(
        panels(shell, panel), beams(shell, beam, panel), nodes(shell, node, beam, panel)
    )
    flats = [part.flat for part in (*parts.panels, *parts.beams)]
    sheets = nest_all(flats, Stock(2500.0, 1500.0), packer="shelf").sheets
    return ReportData(
        title=EVIL,
        units="mm",
        shell=shell,
        parts=parts,
        sheets=sheets,
        engraving={flat.mark: engraving(flat) for flat in flats[: len(parts.panels)]},
        checks=(
            CheckResult("planarity", 2e-15, 1e-12, "1", "<=", parts.panels[0].mark, "all is well"),
            CheckResult("panel_mass", 61.5, 60.0, "kg", "<=", parts.panels[1].mark, "<i>heavy</i>"),
            CheckResult("clearance", float("nan"), 1.0, "mm", ">="),
        ),
        figures={"panels": (len(parts.panels), ""), "lattice <step>": (0.125, "")},
        histograms={
            "edge length": (np.array([1.0, 2.0, np.nan, np.inf]), "mm"),
            "constant": (np.full(5, 3.0), "deg"),
            "nothing": (np.zeros(0), "mm"),
        },
        versions={"phexfab": "0.1.0"},
        design_text="title = \"x\" # <script>alert('no')</script>",
    )


@lru_cache(maxsize=1)
def page_text():
    return report_html(sample())


class Page(HTMLParser):
    """Elements with their attributes, and the text inside each kind of element."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.elements, self.open, self.text, self.mismatched = [], [], {}, []
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        if not self.open or self.open[-1] != tag:
            self.mismatched.append((tag, list(self.open)))
        else:
            self.open.pop()

    def handle_data(self, data):
        for tag in set(self.open):
            self.text.setdefault(tag, []).append(data)

    def said(self, tag):
        return "".join(self.text.get(tag, []))


@lru_cache(maxsize=1)
def page():
    return Page(page_text())

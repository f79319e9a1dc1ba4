"""A small build as the report gets it, and the page read back by Python's own parser."""

from contextlib import ExitStack, contextmanager
from functools import lru_cache
from html.parser import HTMLParser
from unittest.mock import patch

import numpy as np

from phexfab.fabrication.bars import BeamSpec
from phexfab.fabrication.beams import beams
from phexfab.fabrication.nest import nest_all
from phexfab.fabrication.nodes import NodeSpec, nodes
from phexfab.fabrication.panels import PanelSpec, panels
from phexfab.fabrication.parts import CheckResult, Parts, Stock
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.report import page as page_module
from phexfab.report import stage as stage_module
from phexfab.report.data import ReportData
from phexfab.surface.catalog import surface

EVIL = """Pavilion </script><b onclick='x()'>&amp; "quoted" \u2028]]> --> ñ"""
VOID = {"meta", "img", "br", "input", "link", "hr"}


def strokes(flat):
    """Polylines of several lengths inside a part: a smaller contour and two ticks."""
    middle = flat.outline.mean(0)
    small = middle + 0.3 * (flat.outline - middle)
    return (small, small[:2] * [1.0, 0.99], np.array([middle, middle + np.array([0.0, 7.25])]))


def made(panel_size):
    """A patch of Enneper's surface with panels, beams and hubs; its sheets; its flat parts."""
    smooth = surface("enneper").scaled(3000.0)
    shell = minimal_shell(smooth, lattice_on(smooth, panel_size), "edge")
    panel, node = PanelSpec(), NodeSpec(kind="hub")
    beam = BeamSpec(ends="hub", hub_radius=node.radius)
    parts = Parts(panels(shell, panel), beams(shell, beam, panel), nodes(shell, node, beam, panel))
    flats = [part.flat for part in (*parts.panels, *parts.beams)]
    return shell, parts, nest_all(flats, Stock(2500.0, 1500.0), packer="shelf").sheets, flats


@lru_cache(maxsize=1)
def sample():
    """All that a page may have, and words that would break it."""
    shell, parts, sheets, flats = made(700.0)
    return ReportData(
        title=EVIL,
        units="mm",
        shell=shell,
        parts=parts,
        sheets=sheets,
        engraving={flat.mark: strokes(flat) for flat in flats[: len(parts.panels)]},
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
        notes=("the clock <ran> out",),
        versions={"phexfab": "0.1.0"},
        design_text="title = \"x\" # <script>alert('no')</script>",
    )


@contextmanager
def small_pictures():
    """Pictures of a sixth of the size: they take most of the time, and have tests of their own."""

    def smaller(figure):
        def draw(*args, size, **options):
            return figure(*args, size=(size[0] // 6, size[1] // 6), **options)

        return draw

    with ExitStack() as stack:
        for module, name in (
            (stage_module, "assembly_figure"),
            (page_module, "shell_figure"),
            (page_module, "gauss_figure"),
        ):
            stack.enter_context(patch.object(module, name, smaller(getattr(module, name))))
        yield


@lru_cache(maxsize=1)
def page_text():
    with small_pictures():
        return page_module.report_html(sample())


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

"""Two small builds for the tests of the doors: mitred panels under their beams, and hubs."""

import re
from functools import cache
from pathlib import Path

import phexfab

DOCS = Path(__file__).parents[2] / "docs"
MORE = {
    "mitred": {"panels": {"edges": "mitred", "side": "inside"}},
    "hubs": {
        "nodes": {"kind": "hub", "radius": 25, "material": "steel S235"},
        "beams": {"ends": "hub"},
        "panels": {"gap": 12, "material": "glass"},
    },
}


@cache
def small_build(name):
    return phexfab.build(
        phexfab.make_design(
            {
                "title": f"small {name}",
                "surface": {"name": "enneper", "scale": 2600, "u": [-0.7, 0.7], "v": [-0.6, 0.6]},
                "lattice": {"panel_size": 520},
                **MORE[name],
            }
        )
    )


def parts_by_family(build):
    made = build.parts
    return {"panels": made.panels, "beams": made.beams, "nodes": made.nodes}


def code_blocks(page):
    """The Python blocks of a page, in order."""
    text = (DOCS / page).read_text(encoding="utf-8")
    return re.findall(r"```python\n(.*?)```", text, re.DOTALL)


def run_block(block, folder, monkeypatch):
    """Run a block as printed in a folder and return its names."""
    monkeypatch.chdir(folder)
    names = {"__name__": "__main__"}
    exec(compile(block, "docs", "exec"), names)
    return names

"""A small shell with panels, beams and hubs, built once for all tests of exported files."""

import tomllib
from functools import cache
from pathlib import Path

import phexfab

ROOT = Path(__file__).parent.parent.parent


@cache
def sample_build():
    """The first example with hubs, and with a title that every format has to escape."""
    data = tomllib.loads((ROOT / "examples" / "first-shell.toml").read_text("utf-8"))
    data["title"] = "Schale <1> & Söhne"
    data["lattice"]["panel_size"] = 700
    data["beams"]["ends"] = "hub"
    data["nodes"] = {"kind": "hub", "radius": 25}
    data["nesting"] = {"packer": "shelf"}
    return phexfab.build(phexfab.make_design(data))


def all_parts(build):
    """Family and part by mark, in order."""
    return {
        part.mark: (family, part)
        for family in ("panels", "beams", "nodes")
        for part in getattr(build.parts, family)
    }

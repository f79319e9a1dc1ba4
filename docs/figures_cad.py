"""Make the pictures of cadquery.md and build123d.md: python docs/figures_cad.py

Both draw what the first block of the page makes; the second with a pin on every joint.
"""

from __future__ import annotations

import os
import re
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from phexfab.fabrication.parts import Cylinder, Material, Node
from phexfab.report.camera import View
from phexfab.report.figures import assembly_figure

DOCS = Path(__file__).parent
VIEW = View(azimuth=-62, elevation=27)
SIZE = (1400, 700)


def first_block(page: str) -> dict[str, Any]:
    """Run the first block of a page in a folder of its own and return its names."""
    text = (DOCS / page).read_text(encoding="utf-8")
    block = re.findall(r"```python\n(.*?)```", text, re.DOTALL)[0]
    names: dict[str, Any] = {}
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            exec(compile(block, page, "exec"), names)
        finally:
            os.chdir(before)
    return names


if __name__ == "__main__":
    parts = first_block("cadquery.md")["build"].parts
    assembly_figure(parts, DOCS / "img" / "cadquery.png", size=SIZE, view=VIEW, colours=128)

    names = first_block("build123d.md")
    pins = []
    for mark, joint in names["shell"].joints.items():
        place = joint.relative_location
        axis = np.array(tuple(names["b3d"].Plane(place).z_dir))
        pin = Cylinder(np.array(tuple(place.position)), axis, 14.0, 220.0)
        pins.append(Node(mark, 0, pin, Material("pin", 1.0), (), 0.0, 0.0))
    parts = replace(names["build"].parts, nodes=tuple(pins))
    assembly_figure(parts, DOCS / "img" / "build123d.png", size=SIZE, view=VIEW, colours=128)

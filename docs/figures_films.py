"""Make the pictures of films.md: python docs/figures_films.py [name ...]"""

from __future__ import annotations

import sys
from pathlib import Path

from phexfab.pipeline import build
from phexfab.report.camera import View
from phexfab.report.figures import assembly_figure

ROOT = Path(__file__).parent
VIEWS = {
    "four-corner-canopy": View(azimuth=-60, elevation=24),
    "three-lobed-roof": View(azimuth=-75, elevation=30),
    "five-lobed-roof": View(azimuth=-70, elevation=36),
    "ring-court": View(azimuth=-65, elevation=34),
    "schwarz-p-cell": View(azimuth=-60, elevation=22),
    "gyroid-cell": View(azimuth=-60, elevation=22),
}


def film_figure(name: str) -> None:
    """One of the examples, all its parts."""
    parts = build(ROOT.parent / "examples" / f"{name}.toml").parts
    target = ROOT / "img" / f"{name}.png"
    assembly_figure(parts, target, size=(1400, 860), view=VIEWS[name], colours=128)


if __name__ == "__main__":
    for name in sys.argv[1:] or VIEWS:
        film_figure(name)

"""Make the pictures of gallery.md and films.md: python docs/figures_gallery.py [name ...]"""

from __future__ import annotations

import sys
from pathlib import Path

from phexfab.pipeline import build
from phexfab.report.camera import View
from phexfab.report.figures import assembly_figure

ROOT = Path(__file__).parent
EXAMPLES = {path.stem: path for path in sorted((ROOT.parent / "examples").glob("*.toml"))}
VIEWS = {
    "four-corner-canopy": View(azimuth=-60, elevation=24),
    "l-shaped-canopy": View(azimuth=-50, elevation=34),
    "three-lobed-roof": View(azimuth=-75, elevation=30),
    "five-lobed-roof": View(azimuth=-70, elevation=36),
    "ring-court": View(azimuth=-65, elevation=34),
    "schwarz-p-cell": View(azimuth=-60, elevation=22),
    "gyroid-cell": View(azimuth=-60, elevation=22),
    "garden-roof": View(azimuth=-62, elevation=26),
}


FILMS = [name for name in VIEWS if name != "garden-roof"]
"""Those of films.md, where pictures are larger."""


def gallery_figure(name: str) -> None:
    """One of the examples, all its parts."""
    parts = build(EXAMPLES[name]).parts
    view = VIEWS.get(name, View(azimuth=-60, elevation=28))
    target = ROOT / "img" / "gallery" / f"{name}.png"
    target.parent.mkdir(exist_ok=True)
    assembly_figure(parts, target, size=(900, 620), view=view, colours=96)
    if name in FILMS:
        large = ROOT / "img" / target.name
        assembly_figure(parts, large, size=(1400, 860), view=view, colours=128)


if __name__ == "__main__":
    for name in sys.argv[1:] or EXAMPLES:
        gallery_figure(name)

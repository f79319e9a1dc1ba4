"""Make the pictures of the page on sheets: python docs/figures_sheets.py"""

from __future__ import annotations

from pathlib import Path

from phexfab.fabrication.marking import engraving
from phexfab.fabrication.nest import nest_all
from phexfab.pipeline import build
from phexfab.report.figures import sheet_figure

FOLDER = Path(__file__).parent / "img"
DESIGN = Path(__file__).parent.parent / "examples" / "catenoid-pavilion.toml"


def sheets_figures() -> None:
    """A sheet of panels and one of beams of the pavilion."""
    built = build(DESIGN)
    for family, made, which in (
        ("panels", built.parts.panels, 3),
        ("beams", built.parts.beams, 2),
    ):
        flats = {part.mark: part.flat for part in made}
        nested = nest_all(list(flats.values()), built.stocks[family], packer="shelf")
        sheet = nested.sheets[which]
        lines = {p.mark: engraving(flats[p.mark]) for p in sheet.placements}
        sheet_figure(sheet, flats, lines, FOLDER / f"sheet-{family}.png", width=1100)


if __name__ == "__main__":
    sheets_figures()

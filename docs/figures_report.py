"""Make the pictures of the pages on the report and on pictures: python docs/figures_report.py"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from PIL import Image

from phexfab.pipeline import Build, build
from phexfab.plots import plot_checks, plot_gauss, plot_sheet, plot_shell, poster

ROOT = Path(__file__).parent.parent
sys.path.insert(0, str(ROOT / "tests" / "report"))
from browser import browser  # noqa: E402 - the tests' own

FOLDER = ROOT / "docs" / "img"
DESIGN = ROOT / "examples" / "catenoid-pavilion.toml"


def report_figures(built: Build) -> None:
    """The pavilion's report on a desk and on a phone, by day and by night; needs a browser."""
    with tempfile.TemporaryDirectory() as made, browser() as tab:
        page = built.write(Path(made) / "build") / "report.html"
        for name, size, night, explode, at in (
            ("report", (1400, 900), False, 0.35, (490, 580)),
            ("report-phone", (390, 844), True, 0.0, (190, 540)),
        ):
            tab.show(*size, touch=night, dark=night)
            tab.open(page)
            tab.wait("globalThis.report")
            tab.js(f"report.explode({explode})")
            tab.touch([at]) if night else tab.click(*at)
            tab.js("new Promise((done) => setTimeout(done, 2000))")
            shot = Path(made) / "shot.png"
            shot.write_bytes(tab.picture())
            _shrink(shot, FOLDER / f"{name}.png", min(size[0], 1100))


def plots_figure(built: Build) -> None:
    """Four plots side by side."""
    figure, axes = plt.subplots(2, 2, figsize=(14, 9), layout="constrained")
    plot_shell(built, axes[0, 0], by="area", pixels=1200)
    plot_gauss(built, axes[0, 1])
    plot_sheet(built, 0, axes[1, 0])
    plot_checks(built, axes[1, 1])
    figure.savefig(FOLDER / "plots.png", dpi=100, metadata={"Software": None})
    plt.close(figure)


def poster_figure(built: Build) -> None:
    """The poster, a third as large."""
    with tempfile.TemporaryDirectory() as made:
        _shrink(poster(built, Path(made) / "poster.png"), FOLDER / "poster.png", 1100)


def _shrink(source: Path, target: Path, width: int) -> None:
    with Image.open(source) as image:
        size = (width, round(image.height * width / image.width))
        small = image.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    small.save(target, optimize=True)


if __name__ == "__main__":
    pavilion = build(DESIGN)
    plots_figure(pavilion)
    poster_figure(pavilion)
    report_figures(pavilion)

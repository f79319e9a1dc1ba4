"""The picture of a comparison: meshes side by side, and the table below them."""

from __future__ import annotations

import io
from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from phexfab.fabrication.parts import FAMILY_COLOURS
from phexfab.mesh.measures import area_vectors
from phexfab.mesh.polymesh import PolyMesh
from phexfab.report.camera import View
from phexfab.report.figures import render
from phexfab.report.scene import mesh_layer

INK, SOFT, BAND = "#1d2733", "#5f6f7e", "#f3f1ea"
_WIDE, _HIGH, _LINE = 760, 520, 27  # pixels of a picture, and of a line of the table
_DPI = 100


def comparison_figure(
    title: str,
    meshes: Sequence[tuple[str, PolyMesh]],
    table: Sequence[tuple[str, ...]],
    target: str | PathLike[str] | None = None,
    *,
    view: View | None = None,
) -> bytes:
    """Return a PNG of meshes side by side, seen alike, over a table, and write it where asked.

    Parameters
    ----------
    title : str
    meshes : sequence of (name, PolyMesh)
    table : sequence of tuples
        A label, and a text for each mesh.
    target : path, optional
    view : View, optional
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.patches import Rectangle
    from PIL import Image

    count = len(meshes)
    label = _WIDE // 2
    width, head = count * _WIDE, 90
    height = head + _HIGH + _LINE * (len(table) + 2)
    figure = Figure(figsize=(width / _DPI, height / _DPI), dpi=_DPI)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0, width), ylim=(height, 0))
    axes.set_axis_off()
    font = {"family": "DejaVu Sans", "color": INK}
    axes.text(24, 40, title, fontdict=font | {"size": 19, "weight": "bold"}, va="center")
    look = view or _view(meshes[-1][1])
    for k, (name, mesh) in enumerate(meshes):
        names = [f"face {f}" for f in range(mesh.n_faces)]
        layer = mesh_layer(name, mesh, names, np.tile(FAMILY_COLOURS["panels"], (mesh.n_faces, 1)))
        drawn = render((layer,), size=(_WIDE, _HIGH), view=look, ground=False)
        image = np.asarray(Image.open(io.BytesIO(drawn)))
        axes.imshow(
            image,
            extent=(k * _WIDE, (k + 1) * _WIDE, head + _HIGH, head),
            aspect="auto",
            interpolation="nearest",
        )
    axes.set(xlim=(0, width), ylim=(height, 0))

    column = (width - label) / count

    def line(y: float, texts: Sequence[str], weight: str = "normal") -> None:
        axes.text(24, y, texts[0], fontdict=font | {"size": 12, "color": SOFT}, va="center")
        for k, text in enumerate(texts[1:]):
            look = font | {"size": 12, "weight": weight}
            axes.text(label + (k + 0.6) * column, y, text, fontdict=look, ha="center", va="center")

    top = head + _HIGH + _LINE
    line(top, ("", *(name for name, _ in meshes)), "bold")
    for k, texts in enumerate(table):
        y = top + (k + 1) * _LINE
        if k % 2 == 0:
            axes.add_patch(Rectangle((12, y - _LINE / 2), width - 24, _LINE, color=BAND, lw=0))
        line(y, texts)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=_DPI, metadata={"Software": None})
    small = Image.open(io.BytesIO(buffer.getvalue())).convert("RGB")
    small = small.quantize(96, dither=Image.Dither.NONE)
    buffer = io.BytesIO()
    small.save(buffer, format="PNG", optimize=True)
    data = buffer.getvalue()
    if target is not None:
        Path(target).write_bytes(data)
    return data


def _view(mesh: PolyMesh) -> View:
    """Return a three-quarter view that looks down on a mesh a little more where it lies flat."""
    vectors = area_vectors(mesh)
    flatness = float(np.linalg.norm(vectors.sum(axis=0)) / np.linalg.norm(vectors, axis=1).sum())
    return View(elevation=24 + 14 * flatness)

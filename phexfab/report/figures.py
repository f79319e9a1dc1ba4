"""Pictures of shells, Gauss images, assemblies and sheets, as PNG.

The 3-D pictures come from a z-buffer of our own: panels are not convex and parts stand closely
behind one another, which painter's sorting gets wrong.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import PhexError
from phexfab.fabrication.layout import placed
from phexfab.fabrication.parts import FlatPart, Parts, Sheet
from phexfab.parallel.shell import Shell
from phexfab.report.camera import View
from phexfab.report.fields import PanelField, face_marks, gauss_mesh, panel_fields, shell_view
from phexfab.report.scene import (
    Layer,
    assembly_layers,
    gauss_layer,
    mesh_layer,
    sphere_layer,
)
from phexfab.report.shade import picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FloatArray = NDArray[np.float64]
Target = str | PathLike[str] | BinaryIO | None

_MANY = 250_000  # triangles from which fewer lights must do


def render(
    items: Sequence[Layer],
    target: Target = None,
    *,
    size: tuple[int, int] = (1600, 1000),
    view: View | None = None,
    supersample: int = 2,
    lights: int = 24,
    ground: bool = True,
    colours: int | None = None,
) -> bytes:
    """Return a shaded picture of layers as PNG, and write it where asked.

    Parameters
    ----------
    items : sequence of Layer
        Such as ``assembly_layers(parts)``.
    target : path or binary file, optional
        Where to write the bytes as well.
    size : (int, int)
        Width and height in pixels.
    view : View, optional
    supersample : int
        Samples per pixel along each axis; 3 for print.
    lights : int
        Directions of the sky that cast shadows; 0 for none.
    ground : bool
        Catch the shadow on a level ground.
    colours : int, optional
        Reduce the picture to so many colours, for a file a third as large.
    """
    image = picture(
        items,
        size,
        view or View(),
        supersample=supersample,
        lights=_affordable(lights, items),
        ground=ground,
    )
    return _png(image, target, colours)


def assembly_figure(
    parts: Parts,
    target: Target = None,
    *,
    size: tuple[int, int] = (1600, 1000),
    view: View | None = None,
    colours: int | None = None,
) -> bytes:
    """Return a picture of all parts in the colours of their families; see ``render``."""
    return render(assembly_layers(parts), target, size=size, view=view, colours=colours)


def shell_figure(
    shell: Shell,
    target: Target = None,
    *,
    field: str = "Gaussian curvature",
    size: tuple[int, int] = (1200, 900),
    view: View | None = None,
    colours: int | None = None,
) -> bytes:
    """Return a picture of M with its panels coloured by a field; see ``render``.

    Parameters
    ----------
    field : str
        A name of ``panel_fields``: a curvature, ``"Panel area"`` or ``"Mean edge"``.
    """
    layer = mesh_layer("shell", shell.mesh, face_marks(shell, ()), _field(shell, field).colours)
    return render(
        (layer,), target, size=size, view=view or shell_view(shell), ground=False, colours=colours
    )


def gauss_figure(
    shell: Shell,
    target: Target = None,
    *,
    field: str = "Gaussian curvature",
    size: tuple[int, int] = (1200, 900),
    view: View | None = None,
    colours: int | None = None,
) -> bytes:
    """Return a picture of S around a faint unit sphere, its faces coloured like those of M."""
    image = gauss_picture(shell, _field(shell, field).colours, size, view or shell_view(shell))
    return _png(image, target, colours)


def gauss_picture(
    shell: Shell, paint: FloatArray, size: tuple[int, int], view: View, relief: float = 1.0
) -> FloatArray:
    """Return an (height, width, 4) picture of S in (P, 3) colours; see ``shade.picture``."""
    layer = gauss_layer(gauss_mesh(shell), face_marks(shell, ()), paint)
    sphere = sphere_layer(96)
    framing = np.concatenate([sphere.vertices, layer.vertices])
    image: FloatArray = np.zeros((size[1], size[0], 4))
    # From far to near: S behind the sphere, the sphere as a haze, S in front of it.
    for layers, side, opacity in (
        ((layer,), "back", 1.0),
        ((sphere,), "both", 0.62),
        ((layer,), "front", 1.0),
    ):
        seen = picture(layers, size, view, lights=0, side=side, framing=framing, relief=relief)
        over = opacity * seen
        image = over + (1 - over[..., 3:]) * image
    return image


def sheet_figure(
    sheet: Sheet,
    flats: Mapping[str, FlatPart],
    engraving: Mapping[str, Sequence[FloatArray]] | None = None,
    target: Target = None,
    *,
    width: int = 1400,
) -> bytes:
    """Return a drawing of one sheet: contours, and engraving where it is given.

    Parameters
    ----------
    sheet : Sheet
    flats : mapping of mark to FlatPart
    engraving : mapping of mark to polylines, optional
        In the coordinates of the flat part.
    width : int
        In pixels; the height follows from the sheet.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    length, breadth = sheet.stock.length, sheet.stock.width
    border = 0.01 * length
    dpi = 100
    scale = width / (length + 2 * border)
    figure = Figure(figsize=(width / dpi, scale * (breadth + 2 * border) / dpi), dpi=dpi)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(-border, length + border), ylim=(-border, breadth + border))
    axes.set_axis_off()
    draw_sheet(axes, sheet, flats, engraving or {})
    buffer = io.BytesIO()
    # The library would write its own version into the file.
    figure.savefig(buffer, format="png", dpi=dpi, metadata={"Software": None})
    return _deliver(buffer.getvalue(), target)


def draw_sheet(
    axes: Axes,
    sheet: Sheet,
    flats: Mapping[str, FlatPart],
    engraving: Mapping[str, Sequence[FloatArray]],
    weight: float = 0.7,
) -> None:
    """Draw stock, contours and engraving into axes whose units are millimetres."""
    from matplotlib.collections import LineCollection, PolyCollection

    length, breadth = sheet.stock.length, sheet.stock.width
    frame = [[(0, 0), (length, 0), (length, breadth), (0, breadth)]]
    contours = [placed(flats[p.mark].outline, p) for p in sheet.placements]
    strokes = [placed(line, p) for p in sheet.placements for line in engraving.get(p.mark, ())]
    axes.add_collection(PolyCollection(frame, facecolors="white", edgecolors="#9aa3ab"))
    axes.add_collection(
        PolyCollection(contours, facecolors="#f0ebdd", edgecolors="#22303c", linewidths=weight)
    )
    axes.add_collection(LineCollection(strokes, colors="#b4552f", linewidths=0.85 * weight))


def _field(shell: Shell, name: str) -> PanelField:
    fields = {field.name: field for field in panel_fields(shell)}
    if name not in fields:
        raise PhexError(f"field {name!r} is unknown; choose one of {', '.join(fields) or 'none'}")
    return fields[name]


def _affordable(lights: int, items: Sequence[Layer]) -> int:
    """Return fewer lights for very many triangles: time stays in proportion to the parts."""
    total = sum(len(layer.triangles) for layer in items)
    return min(lights, max(8, lights * _MANY // max(total, 1)))


def _png(image: FloatArray, target: Target, colours: int | None) -> bytes:
    """Return a picture on white as PNG, without dates or versions in it."""
    from PIL import Image

    flat = image[..., :3] + (1 - image[..., 3:])
    pixels = (np.clip(flat, 0, 1) * 255 + 0.5).astype(np.uint8)
    drawn = Image.fromarray(pixels)
    if colours:
        drawn = drawn.quantize(colours, dither=Image.Dither.NONE)
    buffer = io.BytesIO()
    drawn.save(buffer, format="PNG", optimize=True)
    return _deliver(buffer.getvalue(), target)


def _deliver(data: bytes, target: Target) -> bytes:
    if target is not None:
        if isinstance(target, str | PathLike):
            Path(target).write_bytes(data)
        else:
            target.write(data)
    return data

"""A shell and its Gauss image in axes, hidden surfaces exact, coloured by what is asked for."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import PhexError
from phexfab.fabrication.parts import FAMILY_COLOURS
from phexfab.forming import panel_sizes
from phexfab.mesh.measures import planarity
from phexfab.minimal.shell import surface_distance
from phexfab.parallel.shell import Shell
from phexfab.plots.paper import INK, axes_or_new, plain, scale_bar
from phexfab.report.camera import Camera, View, fit_camera
from phexfab.report.fields import RAMP, PanelField, face_marks, gauss_mesh, panel_fields, shell_view
from phexfab.report.figures import gauss_picture
from phexfab.report.scene import Layer, assembly_layers, mesh_layer, sphere_layer
from phexfab.report.shade import picture
from phexfab.surface import MinimalSurface

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from phexfab.pipeline import Build

FloatArray = NDArray[np.float64]

SHORT = {
    "gaussian": "Gaussian curvature",
    "mean": "Mean curvature",
    "minimality": "|H|/√|K|",
    "area": "Panel area",
    "edge": "Mean edge",
}
"""Short names of the report's fields."""
NAMES = ("family", *SHORT, "size", "planarity", "sides", "deviation", "mass")
RELIEF = 0.4
MARGIN = 0.04  # of a picture, left free around what it shows
FLAT = 0.5  # degrees of the lens: parallel to a few parts in a thousand, so a scale bar holds


def plot_shell(
    thing: Build | Shell,
    ax: Axes | None = None,
    *,
    by: str | None = None,
    view: View | None = None,
    pixels: int = 1400,
    legend: bool = True,
) -> Axes:
    """Draw a shell, and return the axes.

    Parameters
    ----------
    thing : Build or Shell
    ax : matplotlib Axes, optional
        Where to draw; else in a new figure.
    by : str, optional
        What the colours say: ``"family"`` (all parts of a build, as made; the default for a
        build), ``"gaussian"`` (the default for a shell), ``"mean"``, ``"minimality"``, ``"area"``,
        ``"edge"``, ``"size"`` (mean distance to the neighbours' centres), ``"planarity"``,
        ``"sides"``, and for a build ``"deviation"`` (largest distance from the smooth surface)
        and ``"mass"``; or the full name of one of the report's fields.
    view : View, optional
        Where the eye stands. By default nearly parallel, onto the side of the normals.
    pixels : int
        Of the picture's longer side.
    legend : bool
        Add the colour bar or the families' names, and a scale bar.

    Returns
    -------
    matplotlib Axes
        Its units are millimetres in the plane that faces the eye; the shell's middle is at 0.

    Raises
    ------
    PhexError
        If ``by`` is unknown or asks for what a bare shell does not know.

    Examples
    --------
    >>> import phexfab as px
    >>> from phexfab.plots import plot_shell
    >>> smooth = px.minimal_surface("catenoid").scaled(1000)
    >>> shell = px.minimal_shell(smooth, px.lattice_on(smooth, 300))
    >>> plot_shell(shell, by="area", pixels=200).get_aspect()
    1.0
    """
    shell = thing if isinstance(thing, Shell) else thing.shell
    by = by or ("gaussian" if isinstance(thing, Shell) else "family")
    field = None if by == "family" else panel_field(thing, by)
    if field is not None:
        layers: tuple[Layer, ...] = (
            mesh_layer("panels", shell.mesh, face_marks(shell, ()), field.colours),
        )
    elif isinstance(thing, Shell):
        raise PhexError("by='family' needs a build: a bare shell has no parts")
    else:
        layers = assembly_layers(thing.parts)
    standard = shell_view(shell)
    look = view or View(standard.azimuth, standard.elevation, FLAT)
    ax = axes_or_new(ax, (9.0, 6.2))
    points = np.concatenate([layer.vertices[layer.triangles].reshape(-1, 3) for layer in layers])
    size = _shape(look, points, pixels)
    # Where colours are to be read off a scale, light and shade stay faint.
    lights, relief = (24, 1.0) if field is None else (0, RELIEF)
    image = picture(layers, size, look, lights=lights, relief=relief, margin=MARGIN)
    _show(ax, image, fit_camera(look, points, size, MARGIN))
    if legend:
        scale_bar(ax, 0.12 * float(np.diff(ax.get_xlim())[0]))
        if field is None:
            _families(ax, layers)
        else:
            _colour_bar(ax, field)
    return ax


def plot_gauss(
    thing: Build | Shell,
    ax: Axes | None = None,
    *,
    by: str = "gaussian",
    view: View | None = None,
    pixels: int = 900,
    legend: bool = True,
) -> Axes:
    """Draw the Gauss image around the unit sphere, and return the axes; see ``plot_shell``.

    The units of the axes are those of the sphere, whose radius is 1.
    """
    shell = thing if isinstance(thing, Shell) else thing.shell
    field = panel_field(thing, by)
    standard = shell_view(shell)
    look = view or View(standard.azimuth, standard.elevation, FLAT)
    ax = axes_or_new(ax, (6.0, 5.6))
    image = gauss_picture(shell, field.colours, (pixels, pixels), look, RELIEF)
    drawn = gauss_mesh(shell)
    framing = np.concatenate([sphere_layer(96).vertices, drawn.vertices[drawn.corners]])
    _show(ax, image, fit_camera(look, framing, (pixels, pixels), MARGIN))
    if legend:
        _colour_bar(ax, field)
    return ax


def panel_field(thing: Build | Shell, by: str) -> PanelField:
    """Return the number per panel that ``by`` names; see ``plot_shell``."""
    shell = thing if isinstance(thing, Shell) else thing.shell
    built = None if isinstance(thing, Shell) else thing
    if by == "size":
        return PanelField("Panel size", "mm", panel_sizes(shell))
    if by == "planarity":
        return PanelField("Corners off their plane", "mm", planarity(shell.mesh))
    if by == "sides":
        return PanelField("Sides", "1", shell.mesh.sides.astype(float))
    if by in ("deviation", "mass"):
        if built is None:
            raise PhexError(f"by={by!r} needs a build; a bare shell does not know it")
        if by == "mass":
            return PanelField("Panel mass", "kg", np.array([p.mass for p in built.parts.panels]))
        return PanelField("Distance from the smooth surface", "mm", _deviation(built))
    fields = {field.name: field for field in panel_fields(shell)}
    name = SHORT.get(by, by)
    if name not in fields:
        raise PhexError(
            f"by={by!r} is unknown; choose one of {', '.join(NAMES)}, or of {', '.join(fields)}"
        )
    return fields[name]


def _deviation(built: Build) -> FloatArray:
    """Return for each panel the largest distance of its corners from the smooth surface."""
    shell, smooth = built.shell, built.surface
    if smooth is None:
        raise PhexError("by='deviation' needs a smooth surface; this build is of a given mesh")
    if isinstance(smooth, MinimalSurface):
        away = np.abs(surface_distance(smooth, shell))
    else:
        points = shell.mesh.vertices
        away = np.linalg.norm(points - smooth.point(smooth.nearest(points)), axis=1)
    return np.asarray(np.maximum.reduceat(away[shell.mesh.corners], shell.mesh.starts[:-1]))


def _shape(view: View, points: FloatArray, longer: int) -> tuple[int, int]:
    """Return the width and height in pixels of a picture that points just fill."""
    extent = np.ptp(fit_camera(view, points, (longer, longer), MARGIN).project(points), axis=0)[:2]
    room = np.maximum(extent / extent.max(), 0.2) * longer
    return int(room[0]), int(room[1])


def _show(ax: Axes, image: FloatArray, camera: Camera) -> None:
    """Put a picture into axes so that lengths are true and the middle of what it shows is at 0."""
    straight = image.copy()
    cover = np.maximum(straight[..., 3:], 1e-9)
    straight[..., :3] = np.clip(straight[..., :3] / cover, 0, 1)
    tall, wide = image.shape[:2]
    (x, y), per_pixel = camera.centre, camera.distance / camera.scale
    bounds = np.array([-x, wide - x, y - tall, y]) * per_pixel
    ax.imshow(straight, extent=tuple(bounds), interpolation="antialiased")
    ax.set_aspect("equal")
    ax.set_axis_off()


def _colour_bar(ax: Axes, field: PanelField) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LinearSegmentedColormap, Normalize

    low, high = field.limits
    if not field.varies:  # rounding errors have no scale
        middle = (low + high) / 2
        low, high = middle - (abs(middle) or 1) / 2, middle + (abs(middle) or 1) / 2
    ramp = LinearSegmentedColormap.from_list("phexfab", RAMP)
    unit = "" if field.unit == "1" else f", {field.unit}"
    bar = ax.figure.colorbar(
        ScalarMappable(Normalize(low, high), ramp), ax=ax, shrink=0.62, aspect=32, pad=0.02
    )
    bar.outline.set_visible(False)
    bar.ax.tick_params(labelsize=8, colors=INK)
    bar.set_label(plain(field.name + unit), color=INK, size=9)


def _families(ax: Axes, layers: tuple[Layer, ...]) -> None:
    from matplotlib.patches import Patch

    patches = [
        Patch(facecolor=FAMILY_COLOURS[layer.family], edgecolor=INK, lw=0.5, label=text)
        for layer in layers
        for text in [f"{len(layer.marks)} {layer.family}"]
    ]
    ax.legend(handles=patches, loc="lower right", frameon=False, fontsize=9, labelcolor=INK)

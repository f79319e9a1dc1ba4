"""Starter designs: commented design files whose panels are sized after what they cover."""

from __future__ import annotations

import json
import math
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from phexfab.design import parse_design
from phexfab.errors import DesignError, PhexError
from phexfab.fabrication.part_checks import sheet_overhangs
from phexfab.fabrication.parts import Stock
from phexfab.pipeline import Build, Progress, build
from phexfab.schema import FILE

PANELS = 110
"""About how many panels a starter design has: enough to look like a shell, built in seconds."""
AREA = 16e6
"""mm² of a named surface: what fits a garden."""
CELL = 6000.0
"""mm, edge of a periodic surface's cubic cell."""
LARGEST = 800.0
"""mm: larger panels do not fit usual sheets."""
STOCKS = ((3000, 1500), (4000, 2050), (6000, 3210))
"""mm, usual sheets."""
TRIES = (1.0, 0.85, 0.7, 0.93, 0.78)
BORDERS = (
    'border = "keep"  # "drop" leaves the outermost faces out',
    'border = "drop"  # the outermost faces are left out: no planes were found to trim them with',
)
SMALL = 10.0
"""Polygons that are smaller than so many mm are taken to be in metres."""
"""Sizes over the first one: where a rim or a border meets a lattice badly, another will do."""
_STEPS = (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)
_FINE = (*np.arange(1.0, 2.0, 0.1), *np.arange(2.0, 5.0, 0.2), *np.arange(5.0, 10.0, 0.5))


@dataclass(frozen=True)
class Origin:
    """What a starter design is for: one source, and for free-form ones the method.

    Attributes
    ----------
    surface, periodic : str or None
        Names.
    rims : tuple of Path
    mesh, step : Path or None
    method : str or None
        For ``mesh`` and ``step``: a way to planar hexagons on a free-form surface.
    """

    surface: str | None = None
    rims: tuple[Path, ...] = ()
    mesh: Path | None = None
    step: Path | None = None
    periodic: str | None = None
    method: str | None = None


def starter(
    origin: Origin, target: Path, panel_size: float | None = None, progress: Progress | None = None
) -> tuple[str, Build]:
    """Return the text of a design file, and what it builds.

    Parameters
    ----------
    origin : Origin
    target : Path
        Where it will stand: paths in it start there.
    panel_size : float, optional
        mm; by default some hundred panels, of a size with which all checks pass.
    progress : callable, optional
        As for ``pipeline.build``.

    Raises
    ------
    DesignError, SurfaceError, MeshError
        If what it starts from cannot be read or does not exist, or nothing can be built from it.
    """
    lines, about, area = _source(origin, target)
    wished = min(math.sqrt(area / (0.866 * PANELS)), LARGEST)
    sizes = [panel_size] if panel_size else [_round(wished * factor, _FINE) for factor in TRIES]
    tries = [(lines, size) for size in sizes]
    if origin.method == "planarise":  # the panels are there: only their border can be had otherwise
        tries = [([*lines, border], sizes[0]) for border in BORDERS]
    made: list[tuple[str, Build]] = []
    wrong: PhexError | None = None
    for lines, size in tries:
        words = _words(origin, target, lines, about, size)
        try:
            built = build(parse_design(_text(words, STOCKS[-1]), source=str(target)), progress)
        except PhexError as error:
            wrong = wrong or error
            continue
        blanks = [panel.flat.blank for panel in built.parts.panels]
        fits = [s for s in STOCKS if sheet_overhangs(blanks, Stock(*s)).max() <= 0]
        made.append((_text(words, (*fits, STOCKS[-1])[0]), built))
        if built.ok:
            return made[-1]
    if made:
        return min(made, key=lambda one: sum(not check.ok for check in one[1].checks))
    raise wrong or DesignError(f"{about}: nothing can be built from it")


def _words(
    origin: Origin, target: Path, lines: list[str], about: str, size: float
) -> dict[str, str]:
    """Return what the template's blanks are filled with, all but the stock."""
    named = not (origin.rims or origin.mesh or origin.step or origin.periodic)
    return {
        "schema": FILE,
        "about": f"{about[0].upper()}{about[1:]}.",
        "file": target.name,
        "title": _quoted(target.stem.replace("-", " ").replace("_", " ").capitalize()),
        "source": "\n".join(lines),
        "size": f"{size:g}",
        # Edge offsets rest on circle packings, which not every lattice has.
        "offset": "edge" if named else "face",
        "thickness": _part(size / 120),
        "gap": _part(size / 50),
        "width": _part(size / 80),
        "height": _part(size / 10),
        "edge": _part(min(20.0, size / 20)),
        # A mesh from elsewhere may be far from planar: its vertices move as far as they must.
        "off": _part(max(25.0, size / (3 if origin.method == "planarise" else 12))),
        "rim": _part(max(25.0, size / (4 if origin.periodic else 8))),
        "mass": "60" if size < 500 else "100",
    }


def _text(words: dict[str, str], stock: tuple[float, float]) -> str:
    text = _TEMPLATE.format(**words, length=stock[0], sheet=stock[1])
    return "\n".join(map(_aligned, text.split("\n")))


def _source(origin: Origin, target: Path) -> tuple[list[str], str, float]:
    """Return the lines of [surface], what it is in words, and the area in mm²."""
    if origin.periodic is not None:
        return _periodic(origin.periodic)
    if origin.rims:
        return _rims(origin.rims, target)
    if origin.mesh is not None or origin.step is not None:
        return _given(origin, target)
    return _named(origin.surface or "catenoid")


def _named(name: str) -> tuple[list[str], str, float]:
    from phexfab.surface.catalog import catalog, surface

    made = surface(name)
    u0, u1, v0, v1 = (round(bound, 2) for bound in made.rectangle)
    u, v = np.meshgrid(np.linspace(u0, u1, 25), np.linspace(v0, v1, 25), indexing="ij")
    unit = _grid_area(made.point(made.parameter(u + 1j * v)))
    scale = _round(math.sqrt(AREA / unit))
    closed = made.period is not None
    lines = [
        f'name = "{name}"  # `phexfab surfaces` lists the others',
        f"scale = {scale:g}  # length of one unit of the surface",
        f"u = [{u0}, {u1}]  # the piece that is built",
        'v = "closed"  # all the way around' if closed else f"v = [{v0}, {v1}]",
    ]
    return lines, catalog[name].description, unit * scale**2


def _rims(rims: tuple[Path, ...], target: Path) -> tuple[list[str], str, float]:
    from phexfab.cad.rims import read_rims

    lengths = [rim.length for path in rims for rim in read_rims(path)]
    names = [_quoted(_beside(path, target)) for path in rims]
    value = names[0] if len(names) == 1 else f"[{', '.join(names)}]"
    lines = [
        f"rim = {value}  # CSV, DXF, STEP, BREP; paths start at this file",
        '# unit = "m"  # unit of its lengths, where the file does not say it',
        "# smooth_corners = 300  # radius by which corners are rounded; sharp when left out",
    ]
    # A round film has the area L²/4π. Many panels along a rim are cut: half the size serves better.
    area = 0.4 * max(lengths) ** 2 / (4 * math.pi)
    return lines, f"the soap film of {', '.join(path.name for path in rims)}", area


def _given(origin: Origin, target: Path) -> tuple[list[str], str, float]:
    key = "mesh" if origin.step is None else "step"
    path = origin.step or origin.mesh or Path()
    lines = [f"{key} = {_quoted(_beside(path, target))}  # paths start at this file"]
    if origin.method is None:
        return lines, f"the soap film {path.name}", _mesh_area(path)
    if key == "step":
        lines.append("# face = 1  # which one, where the file has several")
        area = _step_area(path)
    else:
        area = _cells(path) if origin.method == "planarise" else _mesh_area(path)
        if origin.method == "planarise" and area < PANELS * SMALL**2:
            lines.append(
                'unit = "m"  # of the mesh: its polygons are some millimetres wide without'
            )
            area *= 1e6
    lines += ["", "[mesh]", f'method = "{origin.method}"  # how planar hexagons are found']
    return lines, f"the surface {path.name} in planar hexagons", area


def _periodic(name: str) -> tuple[list[str], str, float]:
    from phexfab.surface.periodic.closed_forms import bonnet_angle

    bonnet_angle(name)  # refuses unknown names
    lines = [
        f'periodic = "{name}"',
        f"scale = {CELL:g}  # edge of the cubic cell",
        "cells = [1, 1, 1]  # how many along x, y and z",
    ]
    # Panels follow the curvature, which changes a lot along a cell: more of them are needed.
    return lines, f"one cell of {name}", 2.4 * CELL**2 / 3


def _quoted(text: str) -> str:
    """Return text as TOML writes it, which is as JSON does."""
    return json.dumps(text, ensure_ascii=False)


def _beside(path: Path, target: Path) -> str:
    """Return a path as the design file names it."""
    try:
        return Path(os.path.relpath(path, target.parent)).as_posix()
    except ValueError:  # another drive
        return path.absolute().as_posix()


def _mesh_area(path: Path) -> float:
    from phexfab.mesh.measures import signed_areas
    from phexfab.mesh.trimesh_io import read_triangles

    return float(signed_areas(read_triangles(path)).sum())


def _cells(path: Path) -> float:
    """Return an area for which panels come out as large as the polygons of a mesh are."""
    from phexfab.mesh.measures import signed_areas
    from phexfab.mesh.polygons import read_polygons

    return PANELS * float(np.median(np.abs(signed_areas(read_polygons(path)))))


def _step_area(path: Path) -> float:
    from phexfab.cad.freeform_faces import surfaces_of

    face = surfaces_of(path)[0]
    grid = np.stack(np.meshgrid(*(np.linspace(0, 1, 33),) * 2, indexing="ij"), axis=-1)
    return _grid_area(face.point(face.low + grid * face.width))


def _grid_area(points: NDArray[np.float64]) -> float:
    """Return the area of the quadrilaterals of a grid of points (m, n, 3)."""
    one, two = points[1:, 1:] - points[:-1, :-1], points[1:, :-1] - points[:-1, 1:]
    return float(0.5 * np.linalg.norm(np.cross(one, two), axis=-1).sum())


def _round(value: float, steps: tuple[float, ...] = _STEPS) -> float:
    """Return the largest round number up to a value."""
    power = 10.0 ** math.floor(math.log10(value))
    return float(f"{max(s * power for s in steps if s * power <= value * (1 + 1e-9)):.3g}")


def _aligned(line: str) -> str:
    """Return a line whose comment begins in one column with the others'."""
    said, mark, comment = line.partition("  # ")
    return f"{said:28}{mark}{comment}" if mark else line


def _part(value: float) -> str:
    return f"{_round(value):g}"


_TEMPLATE = """\
#:schema ./{schema}
# {about}
#
#   phexfab check {file}     does it work? a moment, no files
#   phexfab build {file}     solids, cut sheets, parts list, report
#   phexfab view {file}      look at the report
#
# Lengths are in mm, angles in degrees; other units stand in quotes: "45 cm", "1.5 in", "0.2 rad".
# Lines that begin with # are off. `phexfab schema` and the manual know all keys.
title = {title}

[project]
# author = "A. Architect"  # these go onto drawings and into STEP
# revision = "A"
# date = 2026-05-01

[surface]
{source}

[lattice]
panel_size = {size}  # between neighbouring panels' centres, in the median

[offset]
type = "{offset}"  # constant distance of "face", "edge" or "vertex" between the layers

[panels]
material = "aluminium"  # "glass", "HPL", "plywood" …; others with density = …
thickness = {thickness}
gap = {gap}  # joint between two panels
side = "outside"  # where the thickness lies: "outside", "inside", "centre"
edges = "square"  # or "mitred"

[beams]
kind = "flat"  # a flat bar on every edge, or "none"
material = "steel S355"
width = {width}
height = {height}
ends = "mitred"  # three bars meet in the node axis; "hub" stops before nodes.kind = "hub"

[nodes]
kind = "none"  # or "hub"

[sheets.panels]  # the stock that panels are cut from
length = {length}
width = {sheet}

[sheets.beams]
length = 3000
width = 1500

[nesting]
packer = "spyrrow"  # saves material; "shelf" takes a moment

[checks]
shortest_edge = {edge}  # limits: a check that fails is reported and does not stop a build
surface_distance = {off}
rim_distance = {rim}
panel_mass = {mass}  # kg

[output]
# files = ["glb", "3mf"]  # more files than the usual ones
"""

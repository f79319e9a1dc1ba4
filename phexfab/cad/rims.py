"""The front door for rims: files by their suffix, and CadQuery, build123d or kernel objects."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from phexfab.cad.doctor import require
from phexfab.cad.rims_brep import read_shape, shape_strands
from phexfab.cad.rims_dxf import dxf_strands
from phexfab.errors import DesignError
from phexfab.surface.rims.checks import checked, unit_factor
from phexfab.surface.rims.corners import CORNER_ANGLE, corner_points
from phexfab.surface.rims.join import JOIN, join_strands, size_of
from phexfab.surface.rims.rim import Rim
from phexfab.surface.rims.table import read_rim_csv

TABLES = (".csv", ".tsv", ".txt")
SHAPES = (".step", ".stp", ".brep", ".brp")


def read_rims(
    path: str | Path,
    *,
    unit: str | None = None,
    layer: str | Iterable[str] | None = None,
    corner_angle: float = CORNER_ANGLE,
    smooth: float | None = None,
    tolerance: float | None = None,
) -> tuple[Rim, ...]:
    """Return the rims in a file: closed curves in mm, checked.

    Parameters
    ----------
    path
        CSV (``.csv .tsv .txt``, see `read_rim_csv`), DXF, STEP (``.step .stp``) or BREP
        (``.brep .brp``). Curves may lie in any order and direction. In STEP and BREP files edges
        outside every face are the rims, or else the border of the faces.
    unit
        One of ``rim_checks.UNITS``; outranks what a table's header, a drawing ($INSUNITS) or a
        STEP file says. By default that, or else mm.
    layer
        Layers of a DXF drawing to read; by default all.
    corner_angle
        Degrees by which the tangent turns at a corner, see `rim_corners.sharp_joints`.
    smooth
        Round every corner within this length, mm (`Rim.smoothed`).
    tolerance
        mm within which ends of curves are one point; by default 1e-6 of the size, or what a STEP
        or BREP file's vertices say if that is more.

    Raises
    ------
    DesignError
        Naming the file and the place: open, crossing, touching, duplicate, badly scaled curves.
    MissingLibraryError
        If the library that reads the format is missing.
    """
    file = Path(path)
    suffix = file.suffix.lower()
    if layer is not None and suffix != ".dxf":
        raise DesignError(f"{file.name}: layer = {layer!r}, but only DXF drawings have layers")
    if suffix in TABLES:
        return read_rim_csv(file, unit=unit, corner_angle=corner_angle, smooth=smooth)
    if suffix == ".dxf":
        strands, found = dxf_strands(file, layer, unit)
        factor = unit_factor(found, file.name)
        reach = None if tolerance is None else tolerance / factor
        rims = join_strands(strands, file.name, reach, corner_angle)
        return checked([rim.scaled(factor) for rim in rims], found, file.name, smooth)
    if suffix in SHAPES:
        shape, stated = read_shape(file)
        used = unit or stated or "mm"
        # The kernel has converted STEP to mm by what the file states.
        factor = 1.0
        if unit is not None:
            factor = unit_factor(unit, file.name) / unit_factor(stated or "mm", file.name)
        return _of_shapes([shape], file.name, factor, used, corner_angle, smooth, tolerance)
    raise DesignError(
        f"{file.name}: rims are read from {', '.join([*TABLES, '.dxf', *SHAPES])} files"
    )


def rims_of(
    thing: Any,
    *,
    name: str = "rim",
    unit: str | None = None,
    corner_angle: float = CORNER_ANGLE,
    smooth: float | None = None,
    tolerance: float | None = None,
) -> tuple[Rim, ...]:
    """Return the rims in an object of a CAD library, or in points.

    Parameters
    ----------
    thing
        A CadQuery ``Workplane`` or shape (``Edge``, ``Wire``, ``Face``, ``Shell``, ...), a
        build123d shape, sketch or builder, an OpenCASCADE shape, a sequence of these, a `Rim`, or
        points (n, 3).
    name, unit, corner_angle, smooth, tolerance
        As in `read_rims`; without a unit it is mm.

    Raises
    ------
    DesignError
        As `read_rims`, and for objects that hold no curve.
    """
    if isinstance(thing, Rim):
        return checked([thing.scaled(unit_factor(unit or "mm", name))], unit or "mm", name, smooth)
    if isinstance(thing, np.ndarray):
        points = thing * unit_factor(unit or "mm", name)
        rim = Rim.through(points, corner_points(points, corner_angle).tolist(), name)
        return checked([rim], unit or "mm", name, smooth)
    shapes = shapes_in(thing)
    if not shapes:
        raise DesignError(
            f"{name}: {type(thing).__name__} holds no edges; give a wire, edges, or a face"
        )
    used = unit or "mm"
    factor = unit_factor(used, name)
    return _of_shapes(shapes, name, factor, used, corner_angle, smooth, tolerance)


def _of_shapes(
    shapes: list[Any],
    name: str,
    factor: float,
    unit: str,
    corner_angle: float,
    smooth: float | None,
    tolerance: float | None,
) -> tuple[Rim, ...]:
    strands, loosest = shape_strands(shapes, name)
    reach = max(JOIN * size_of(strands), loosest) if tolerance is None else tolerance / factor
    rims = [rim.scaled(factor) for rim in join_strands(strands, name, reach, corner_angle)]
    return checked(rims, unit, name, smooth)


def shapes_in(thing: Any) -> list[Any]:
    """Return the OpenCASCADE shapes inside a CAD object; none for what holds none."""
    require("OCP")
    from OCP.TopoDS import TopoDS_Shape

    if isinstance(thing, TopoDS_Shape):
        return [] if thing.IsNull() else [thing]
    wrapped = getattr(thing, "wrapped", None)
    if isinstance(wrapped, TopoDS_Shape):
        return shapes_in(wrapped)
    if hasattr(thing, "vals") and hasattr(thing, "ctx"):  # a CadQuery Workplane
        found = [shape for value in thing.vals() for shape in shapes_in(value)]
        pending = [*thing.ctx.pendingWires, *thing.ctx.pendingEdges]
        return found or [shape for value in pending for shape in shapes_in(value)]
    for builder in ("line", "sketch"):  # build123d's BuildLine and BuildSketch
        if getattr(thing, builder, None) is not None:
            return shapes_in(getattr(thing, builder))
    if isinstance(thing, Iterable) and not isinstance(thing, str | bytes):
        return [shape for value in thing for shape in shapes_in(value)]
    return []

"""Rims from DXF drawings: lines, arcs, polylines, ellipses and splines, kept exact."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.interpolate import make_interp_spline

from phexfab.errors import DesignError
from phexfab.surface.rims.curves import ellipse_arc, nurbs
from phexfab.surface.rims.join import Strand
from phexfab.surface.rims.pieces import Piece, line

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.entities import DXFEntity

CURVES = ("LINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE", "LWPOLYLINE", "POLYLINE")


def dxf_strands(
    path: Path, layer: str | Iterable[str] | None, unit: str | None
) -> tuple[list[Strand], str]:
    """Return the curves of a drawing's model space, in its unit, and the name of that unit.

    Blocks are taken apart. ``unit`` outranks the drawing's own ($INSUNITS); without either it is
    mm. A polyline's segments are strands of their own.

    Raises
    ------
    DesignError
        If the file is no DXF, its unit is none that rims take, a layer does not exist, or there is
        no curve on it.
    """
    import ezdxf
    from ezdxf.disassemble import recursive_decompose

    try:
        drawing = ezdxf.readfile(path)
    except (OSError, UnicodeDecodeError, ezdxf.DXFError) as error:
        raise DesignError(f"{path}: is no readable DXF file: {error}") from error
    wanted = None if layer is None else ({layer} if isinstance(layer, str) else set(layer))
    known = {entry.dxf.name.lower() for entry in drawing.layers}
    for name in sorted(wanted or ()):
        if name.lower() not in known:
            raise DesignError(
                f"{path.name}: there is no layer {name!r}; there are {', '.join(sorted(known))}"
            )
    lower = None if wanted is None else {name.lower() for name in wanted}
    strands: list[Strand] = []
    others: Counter[str] = Counter()
    for entity in recursive_decompose(drawing.modelspace()):
        kind = entity.dxftype()
        if lower is not None and entity.dxf.layer.lower() not in lower:
            others[f"{kind} on layer {entity.dxf.layer}"] += 1
        elif kind not in CURVES:
            others[kind] += 1
        else:
            strands += _strands(entity)
    if not strands:
        seen = ", ".join(f"{n} {kind}" for kind, n in sorted(others.items())) or "nothing"
        raise DesignError(
            f"{path.name}: there is no curve in model space"
            f"{'' if layer is None else f' on layer {layer!r}'}; found {seen}. Rims are read from "
            f"{', '.join(CURVES)}"
        )
    return strands, unit or _unit(drawing, path)


def _unit(drawing: Drawing, path: Path) -> str:
    names = {0: "mm", 1: "in", 2: "ft", 4: "mm", 5: "cm", 6: "m", 7: "km", 13: "um", 14: "dm"}
    code = int(drawing.header.get("$INSUNITS", 0))
    if code not in names:
        raise DesignError(
            f"{path.name}: its unit ($INSUNITS = {code}) is none that rims take; say unit = 'mm', "
            "or what it is"
        )
    return names[code]


def _strands(entity: DXFEntity) -> list[Strand]:
    """The strands of one entity, labelled by type and handle."""
    owner = entity.dxf.handle or "from a block"
    label = f"{entity.dxftype()} {owner}"
    if entity.dxftype() not in {"LWPOLYLINE", "POLYLINE"}:
        pieces = _pieces(entity)
        if len(pieces) == 1:
            return [Strand(pieces[0], label)]
        return [Strand(piece, f"{label}, span {k}") for k, piece in enumerate(pieces, 1)]
    found: list[Strand] = []
    polyline: Any = entity
    if entity.dxftype() == "POLYLINE" and not (polyline.is_2d_polyline or polyline.is_3d_polyline):
        raise DesignError(f"{label} is a mesh, no curve; put the rim on a layer and say layer")
    for k, segment in enumerate(polyline.virtual_entities(), 1):
        found += [Strand(piece, f"{label}, segment {k}") for piece in _pieces(segment)]
    # A polyline may be closed by its flag and by its last vertex at once.
    return [strand for strand in found if strand.piece.length > 0.0]


def _pieces(entity: Any) -> list[Piece]:
    from ezdxf.math import ConstructionEllipse

    dxf = entity.dxf
    kind = entity.dxftype()
    if kind == "LINE":
        return [line(np.array(dxf.start.xyz), np.array(dxf.end.xyz))]
    if kind in {"ARC", "CIRCLE"}:
        # Their centres are in the entity's own system of coordinates.
        frame = entity.ocs()
        centre, x, y = (
            np.array(frame.to_wcs(v).xyz) for v in (dxf.center, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))
        )
        start, end = (dxf.start_angle, dxf.end_angle) if kind == "ARC" else (0.0, 360.0)
        turn = (end - start) % 360.0 or 360.0
        first = np.radians(start)
        radius = abs(dxf.radius)
        return [ellipse_arc(centre, radius * x, radius * y, first, first + np.radians(turn))]
    if kind == "ELLIPSE":
        tool: ConstructionEllipse = entity.construction_tool()
        turn = (tool.end_param - tool.start_param) % (2.0 * np.pi)
        if turn < 1e-9 or turn > 2.0 * np.pi - 1e-9:
            turn = 2.0 * np.pi
        return [
            ellipse_arc(
                tool.center.xyz,
                tool.major_axis.xyz,
                tool.minor_axis.xyz,
                tool.start_param,
                tool.start_param + turn,
            )
        ]
    return _spline(entity)


def _spline(entity: Any) -> list[Piece]:
    if not len(entity.control_points):
        points = np.array([list(p) for p in entity.fit_points])
        if len(points) < 2:
            raise DesignError(f"SPLINE {entity.dxf.handle} has neither control nor fit points")
        if entity.closed:
            if np.any(points[0] != points[-1]):
                points = np.concatenate([points, points[:1]])
            steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
            at = np.concatenate([[0.0], np.cumsum(steps)])
            curve = make_interp_spline(at, points, k=3, bc_type="periodic")
            return nurbs(3, curve.t, curve.c)
    tool = entity.construction_tool()
    weights = tool.weights() if tool.is_rational else None
    return nurbs(tool.degree, tool.knots(), [p.xyz for p in tool.control_points], weights)

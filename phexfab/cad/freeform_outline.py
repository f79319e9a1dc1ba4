"""The outline of a CAD face, in the parameters of its surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from shapely import Polygon
from shapely.geometry.base import BaseGeometry

from phexfab.cad.doctor import require

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Face

FloatArray = NDArray[np.float64]

SAMPLES = 65
"""Points of each curved edge of an outline."""


def outline_of(face: TopoDS_Face) -> BaseGeometry | None:
    """Return the region of (u, v) that a face covers, None where it fills its box.

    In the parameters of ``phexfab.cad.freeform_faces.from_face``; curves are drawn as polylines of
    64 pieces.
    """
    require("OCP")
    from OCP.BRepAdaptor import BRepAdaptor_Curve2d
    from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert
    from OCP.BRepTools import BRepTools, BRepTools_WireExplorer
    from OCP.TopAbs import TopAbs_REVERSED, TopAbs_WIRE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    converted = TopoDS.Face(BRepBuilderAPI_NurbsConvert(face, True).Shape())
    u0, u1, v0, v1 = (float(b) for b in BRepTools.UVBounds_s(converted))
    loops: list[FloatArray] = []
    wires = TopExp_Explorer(converted, TopAbs_WIRE)
    while wires.More():
        edges = BRepTools_WireExplorer(TopoDS.Wire(wires.Current()), converted)
        parts: list[FloatArray] = []
        while edges.More():
            edge = edges.Current()
            curve = BRepAdaptor_Curve2d(edge, converted)
            t = np.linspace(curve.FirstParameter(), curve.LastParameter(), SAMPLES)
            part = np.array([(p.X(), p.Y()) for p in (curve.Value(float(s)) for s in t)])
            parts.append(part[::-1] if edge.Orientation() == TopAbs_REVERSED else part)
            edges.Next()
        if parts:
            loops.append(np.concatenate(parts))
        wires.Next()
    if not loops:
        return None
    outer, *holes = sorted((Polygon(loop).buffer(0) for loop in loops), key=lambda p: -p.area)
    region = outer
    for hole in holes:
        region = region.difference(hole)
    if region.area > (1 - 1e-6) * (u1 - u0) * (v1 - v0):
        return None
    return region

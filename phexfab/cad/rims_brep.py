"""Rims from OpenCASCADE shapes: the exact curves of edges, wires and the borders of faces."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from phexfab.cad.doctor import require
from phexfab.errors import DesignError
from phexfab.surface.rims.curves import ellipse_arc, nurbs
from phexfab.surface.rims.join import Strand
from phexfab.surface.rims.pieces import Piece, line

if TYPE_CHECKING:
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.TopoDS import TopoDS_Edge, TopoDS_Shape

FloatArray = NDArray[np.float64]


STEP_UNITS = {
    "MICROMETRE": "um",
    "MILLIMETRE": "mm",
    "CENTIMETRE": "cm",
    "DECIMETRE": "dm",
    "METRE": "m",
    "KILOMETRE": "km",
    "INCH": "in",
    "FOOT": "ft",
}


@contextmanager
def _silent() -> Iterator[None]:
    """Keep the kernel from printing: what is wrong with a file is said once, by us."""
    from OCP.Message import Message

    messenger = Message.DefaultMessenger_s()
    printers = list(messenger.Printers())
    for printer in printers:
        messenger.RemovePrinter(printer)
    try:
        yield
    finally:
        for printer in printers:
            messenger.AddPrinter(printer)


def read_shape(path: Path) -> tuple[TopoDS_Shape, str]:
    """Return all that a STEP or BREP file holds as one shape, and the unit that the file states.

    STEP shapes come converted to mm; the unit is "" if it is none of ours, and for BREP files.

    Raises
    ------
    DesignError
        If the file cannot be read, or is empty.
    """
    require("OCP")
    if not path.is_file():
        raise DesignError(f"{path}: there is no such file")
    if path.suffix.lower() in {".brep", ".brp"}:
        from OCP.BRep import BRep_Builder
        from OCP.BRepTools import BRepTools
        from OCP.TopoDS import TopoDS_Shape

        shape = TopoDS_Shape()
        if not BRepTools.Read_s(shape, str(path), BRep_Builder()) or shape.IsNull():
            raise DesignError(f"{path.name}: is no readable BREP file")
        return shape, ""
    from OCP.IFSelect import IFSelect_RetDone
    from OCP.STEPControl import STEPControl_Reader
    from OCP.TColStd import TColStd_SequenceOfAsciiString

    reader = STEPControl_Reader()
    with _silent():
        read = reader.ReadFile(str(path))
    if read != IFSelect_RetDone:
        raise DesignError(f"{path.name}: is no readable STEP file; export it anew, as AP214")
    lengths, angles, solid_angles = (TColStd_SequenceOfAsciiString() for _ in range(3))
    reader.FileUnits(lengths, angles, solid_angles)
    stated = lengths.Value(1).ToCString().upper() if lengths.Length() else ""
    reader.TransferRoots()
    shape = reader.OneShape()
    if shape.IsNull():
        raise DesignError(f"{path.name}: holds no shape; export edges, wires or a face")
    return shape, STEP_UNITS.get(stated, "")


def shape_strands(shapes: Iterable[TopoDS_Shape], what: str) -> tuple[list[Strand], float]:
    """Return the curves that are rims in shapes, and their vertices' greatest tolerance (mm).

    Edges outside every face are the rims; where there are none, the border of the faces: edges
    that belong to one face only (so the outer and the inner boundary of a single face).

    Raises
    ------
    DesignError
        If there is no edge, or the faces are closed up and have no border.
    """
    require("OCP")
    from OCP.BRep import BRep_Tool
    from OCP.TopAbs import TopAbs_EDGE, TopAbs_FACE, TopAbs_VERTEX
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    edges: list[TopoDS_Edge] = []
    uses: list[int] = []
    numbers: dict[Any, list[int]] = {}

    def number(edge: TopoDS_Edge) -> int:
        same = numbers.setdefault(hash(edge), [])
        for k in same:
            if edges[k].IsSame(edge):
                return k
        same.append(len(edges))
        edges.append(edge)
        uses.append(0)
        return len(edges) - 1

    def each(shape: TopoDS_Shape, kind: Any) -> Iterable[TopoDS_Shape]:
        explorer = TopExp_Explorer(shape, kind)
        while explorer.More():
            yield explorer.Current()
            explorer.Next()

    for shape in shapes:
        for edge in each(shape, TopAbs_EDGE):
            number(TopoDS.Edge(edge))
        for face in each(shape, TopAbs_FACE):
            for edge in each(face, TopAbs_EDGE):
                uses[number(TopoDS.Edge(edge))] += 1
    # Degenerated edges, such as a sphere's poles, are points.
    solid = [k for k, edge in enumerate(edges) if not BRep_Tool.Degenerated_s(edge)]
    chosen = [k for k in solid if uses[k] == 0] or [k for k in solid if uses[k] == 1]
    if not chosen:
        why = "has no edge" if not solid else "is closed: its faces have no border"
        raise DesignError(f"{what} {why}; give edges, a wire, or a face with a border")
    strands: list[Strand] = []
    loosest = 0.0
    for k in chosen:
        for vertex in each(edges[k], TopAbs_VERTEX):
            loosest = max(loosest, BRep_Tool.Tolerance_s(TopoDS.Vertex(vertex)))
        pieces = edge_pieces(edges[k])
        for part, piece in enumerate(pieces, 1):
            span = "" if len(pieces) == 1 else f", span {part}"
            strands.append(Strand(piece, f"edge {k + 1}{span}"))
    return strands, loosest


def edge_pieces(edge: TopoDS_Edge) -> list[Piece]:
    """Return the curve of an edge, exact: lines, conics and splines from their own data."""
    from OCP.BRepAdaptor import BRepAdaptor_Curve
    from OCP.GeomAbs import GeomAbs_CurveType as Kind

    curve = BRepAdaptor_Curve(edge)
    first, last = curve.FirstParameter(), curve.LastParameter()
    kind = curve.GetType()
    if kind == Kind.GeomAbs_Line:
        return [line(_xyz(curve.Value(first)), _xyz(curve.Value(last)))]
    if kind in {Kind.GeomAbs_Circle, Kind.GeomAbs_Ellipse}:
        round_: Any = curve.Circle() if kind == Kind.GeomAbs_Circle else curve.Ellipse()
        radii = (
            (round_.Radius(),) * 2
            if kind == Kind.GeomAbs_Circle
            else (round_.MajorRadius(), round_.MinorRadius())
        )
        frame = round_.Position()
        x, y = _xyz(frame.XDirection()), _xyz(frame.YDirection())
        return [ellipse_arc(_xyz(frame.Location()), radii[0] * x, radii[1] * y, first, last)]
    if kind == Kind.GeomAbs_BezierCurve:
        bezier = curve.Bezier()
        degree = bezier.Degree()
        knots = np.repeat([0.0, 1.0], degree + 1)
        return nurbs(degree, knots, *_net(bezier), first, last)
    if kind == Kind.GeomAbs_BSplineCurve:
        bspline: Any = curve.BSpline()
        if bspline.IsPeriodic():
            bspline = bspline.Copy()
            bspline.SetNotPeriodic()
        knots = np.repeat(
            [bspline.Knot(i) for i in range(1, bspline.NbKnots() + 1)],
            [bspline.Multiplicity(i) for i in range(1, bspline.NbKnots() + 1)],
        )
        degree = bspline.Degree()
        # A periodic curve may be used across its seam, outside one period.
        if knots[degree] - 1e-12 <= first and last <= knots[-degree - 1] + 1e-12:
            return nurbs(degree, knots, *_net(bspline), first, last)
    return [_evaluated(curve, first, last)]


def _xyz(thing: Any) -> FloatArray:
    return np.array([thing.X(), thing.Y(), thing.Z()])


def _net(curve: Any) -> tuple[FloatArray, FloatArray | None]:
    """Control points (n, 3) and weights (n,), None when not rational."""
    count = range(1, curve.NbPoles() + 1)
    poles = np.array([_xyz(curve.Pole(i)) for i in count])
    return poles, np.array([curve.Weight(i) for i in count]) if curve.IsRational() else None


def _evaluated(curve: BRepAdaptor_Curve, first: float, last: float) -> Piece:
    """The curve by the kernel's own evaluation, one parameter after another."""
    from OCP.GeomAbs import GeomAbs_CN
    from OCP.TColStd import TColStd_Array1OfReal

    width = last - first
    intervals = curve.NbIntervals(GeomAbs_CN)
    ends = TColStd_Array1OfReal(1, intervals + 1)
    curve.Intervals(ends, GeomAbs_CN)
    inner = [(ends.Value(i) - first) / width for i in range(2, intervals + 1)]

    def values(s: FloatArray, order: int) -> FloatArray:
        where = (first + s * width).tolist()
        if order == 0:
            return np.array([_xyz(curve.Value(u)) for u in where]).reshape(-1, 3)
        return np.array([_xyz(curve.DN(u, order)) for u in where]).reshape(-1, 3) * width**order

    return Piece(values, knots=tuple(inner))

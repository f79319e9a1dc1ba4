"""OpenCASCADE solids built face by face, corners and edges shared, nothing sewn.

Lofting or sewing searches for what the arrays already say: which faces share which edge. Handing
it to ``BRep_Builder`` is ten times faster, and planes stay planes. Only calls that OpenCASCADE 7.9
and 8.0 share are used.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from phexfab.cad.doctor import require
from phexfab.cad.faceted import TOLERANCE, Batch, batches
from phexfab.cad.tree import Geometry, families
from phexfab.fabrication.parts import Cylinder, Parts, Solid

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Shape, TopoDS_Solid


def to_shape(part: Geometry, mark: str = "solid") -> TopoDS_Solid:
    """Return a polyhedron or cylinder as an OpenCASCADE solid; see ``to_shapes``."""
    return to_shapes([part], [mark])[0]


def to_shapes(parts: Sequence[Geometry], marks: Sequence[str] | None = None) -> list[TopoDS_Solid]:
    """Return polyhedra and cylinders as OpenCASCADE solids, in order.

    Parameters
    ----------
    parts : sequence of Solid or Cylinder
        In mm. Faces must be planar to 1e-7 mm and may be non-convex.
    marks : sequence of str, optional
        Names for messages.

    Returns
    -------
    list of TopoDS_Solid
        Outward, of positive volume; every corner and edge is one shared vertex and edge.

    Raises
    ------
    PartError
        If a solid is open, warped, inside out or degenerate.
    MissingLibraryError
        If OpenCASCADE's Python wheel is missing or broken; the message says how to repair it.
    """
    require("OCP")
    names = list(marks) if marks is not None else [f"solid {i}" for i in range(len(parts))]
    shapes: list[TopoDS_Solid] = [None] * len(parts)
    places = [i for i, part in enumerate(parts) if isinstance(part, Solid)]
    solids = [part for part in parts if isinstance(part, Solid)]
    for batch in batches(solids, [names[i] for i in places]):
        for index, shape in zip(batch.index.tolist(), _polyhedra(batch), strict=True):
            shapes[places[index]] = shape
    for i, part in enumerate(parts):
        if isinstance(part, Cylinder):
            shapes[i] = _cylinder(part)
    return shapes


def _polyhedra(batch: Batch) -> list[TopoDS_Solid]:
    from OCP.BRep import BRep_Builder
    from OCP.Geom import Geom_Line, Geom_Plane
    from OCP.gp import gp_Dir, gp_Pnt
    from OCP.TopAbs import TopAbs_Orientation
    from OCP.TopoDS import (
        TopoDS_Edge,
        TopoDS_Face,
        TopoDS_Shell,
        TopoDS_Solid,
        TopoDS_Vertex,
        TopoDS_Wire,
    )

    reverse = TopAbs_Orientation.TopAbs_REVERSED
    builder = BRep_Builder()
    add = builder.Add
    ends = batch.topology.edges.tolist()
    sides = list(zip(batch.topology.faces, batch.topology.loops, strict=True))
    result = []
    for points, directions, lengths, normals in zip(
        batch.points.tolist(),
        batch.directions.tolist(),
        batch.lengths.tolist(),
        batch.normals.tolist(),
        strict=True,
    ):
        corners = [gp_Pnt(*p) for p in points]
        forward, backward = {}, {}
        for v in batch.topology.used:
            vertex = TopoDS_Vertex()
            builder.MakeVertex(vertex, corners[v], TOLERANCE)
            forward[v], backward[v] = vertex, vertex.Oriented(reverse)
        edges = []
        for (i, j), direction, length in zip(ends, directions, lengths, strict=True):
            edge = TopoDS_Edge()
            builder.MakeEdge(edge, Geom_Line(corners[i], gp_Dir(*direction)), TOLERANCE)
            add(edge, forward[i])
            add(edge, backward[j])
            builder.Range(edge, 0.0, length)
            edges.append((edge.Oriented(reverse), edge))
        shell = TopoDS_Shell()
        builder.MakeShell(shell)
        for (face_corners, loop), normal in zip(sides, normals, strict=True):
            face = TopoDS_Face()
            plane = Geom_Plane(corners[face_corners[0]], gp_Dir(*normal))
            builder.MakeFace(face, plane, TOLERANCE)
            wire = TopoDS_Wire()
            builder.MakeWire(wire)
            for number, along in loop:
                add(wire, edges[number][along])
            wire.Closed(True)
            add(face, wire)
            add(shell, face)
        shell.Closed(True)
        solid = TopoDS_Solid()
        builder.MakeSolid(solid)
        add(solid, shell)
        result.append(solid)
    return result


def _cylinder(cylinder: Cylinder) -> TopoDS_Solid:
    from OCP.BRepPrimAPI import BRepPrimAPI_MakeCylinder
    from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt

    base, axis = (np.asarray(v, float).tolist() for v in (cylinder.base, cylinder.axis))
    frame = gp_Ax2(gp_Pnt(*base), gp_Dir(*axis))
    return BRepPrimAPI_MakeCylinder(frame, float(cylinder.radius), float(cylinder.length)).Solid()


def solids_in(shape: TopoDS_Shape) -> list[TopoDS_Shape]:
    """Return the solids inside a shape, in its order."""
    require("OCP")
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    found = []
    explorer = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_SOLID)
    while explorer.More():
        found.append(explorer.Current())
        explorer.Next()
    return found


def volume(shape: TopoDS_Shape) -> float:
    """Return the signed volume of a shape in mm³, as OpenCASCADE integrates it."""
    require("OCP")
    from OCP.BRepGProp import BRepGProp
    from OCP.GProp import GProp_GProps

    properties = GProp_GProps()
    BRepGProp.VolumeProperties_s(shape, properties)
    return float(properties.Mass())


def is_valid(shape: TopoDS_Shape) -> bool:
    """Return True when OpenCASCADE's own check finds no fault and the volume is positive.

    The check alone is not enough: it passes a solid that is inside out.
    """
    require("OCP")
    from OCP.BRepCheck import BRepCheck_Analyzer

    return bool(BRepCheck_Analyzer(shape).IsValid()) and volume(shape) > 0


def verify_solids(parts: Parts, sample: int | None = 60) -> list[str]:
    """Build solids and return the marks of those that OpenCASCADE finds invalid.

    Parameters
    ----------
    parts : Parts
    sample : int or None
        How many parts to look at, spread evenly over each family and the same at every call: the
        check costs 2–3 ms a part. None looks at all.

    Returns
    -------
    list of str
        Empty when all is well, in the order of the parts list.

    Raises
    ------
    PartError
        If the arrays of a part already rule out a solid.
    MissingLibraryError
        If OpenCASCADE's Python wheel is missing or broken.
    """
    tree = families(parts)
    total = sum(len(family.members) for family in tree)
    bad = []
    for family in tree:
        count = len(family.members)
        wanted = count if sample is None else -(-sample * count // total)
        chosen = np.unique(
            np.linspace(0, count - 1, min(max(wanted, 0), count)).round().astype(int)
        )
        members = [family.members[i] for i in chosen.tolist()]
        shapes = to_shapes([g for _, g in members], [m for m, _ in members])
        bad += [
            mark for (mark, _), shape in zip(members, shapes, strict=True) if not is_valid(shape)
        ]
    return bad

"""Faces of CAD objects, STEP and BREP files as free-form surfaces, exact as NURBS."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import ArrayLike, NDArray
from shapely.geometry.base import BaseGeometry

from phexfab.cad.doctor import require
from phexfab.cad.rims_brep import read_shape
from phexfab.errors import SurfaceError
from phexfab.surface.freeform.nurbs import nurbs
from phexfab.surface.freeform.parametric import ParametricSurface

if TYPE_CHECKING:
    from OCP.TopoDS import TopoDS_Face, TopoDS_Shape


def from_face(thing: Any, *, name: str = "face") -> ParametricSurface:
    """Return the surface of the one face of a CAD object.

    Planes, quadrics, tori and swept surfaces become rational splines, exactly. The domain is the
    face's box in parameters; for an outline that cuts it see ``trimmed_surfaces_of``. The normal
    points as that of the face.

    Parameters
    ----------
    thing : object
        A CadQuery workplane or shape, a build123d object, or a shape of OpenCASCADE, with one face.
    name : str

    Raises
    ------
    SurfaceError
        If there is not exactly one face.
    """
    faces = faces_of(thing)
    if len(faces) != 1:
        raise SurfaceError(
            f"{name}: there are {len(faces)} faces; give one, or use surfaces_of for all"
        )
    return _surface(faces[0], name)


def surfaces_of(
    source: str | os.PathLike[str] | Any, *, name: str = "face"
) -> list[ParametricSurface]:
    """Return the surfaces of all faces of a STEP or BREP file or of a CAD object, in file order.

    Raises
    ------
    DesignError
        If the file cannot be read.
    SurfaceError
        If there is no face.
    """
    if isinstance(source, str | os.PathLike):
        path = Path(source)
        shape, _ = read_shape(path)
        faces, name = faces_of(shape), path.name
    else:
        faces = faces_of(source)
    if not faces:
        raise SurfaceError(f"{name}: has no face; export a face, a shell or a solid")
    return [_surface(face, f"{name}, face {k}") for k, face in enumerate(faces, 1)]


@dataclass(frozen=True, eq=False)
class TrimmedSurface:
    """The surface of a face and what of it the face covers.

    Attributes
    ----------
    surface : ParametricSurface
        On the face's box in parameters.
    outline : shapely geometry or None
        The face in (u, v); None where it fills its box.
    """

    surface: ParametricSurface
    outline: BaseGeometry | None

    def holds(self, u: ArrayLike) -> NDArray[np.bool_]:
        """Return (n,) whether parameters (n, 2) lie within the outline."""
        at = np.asarray(u, float).reshape(-1, 2)
        if self.outline is None:
            return np.ones(len(at), bool)
        return np.asarray(shapely.contains_xy(self.outline, at[:, 0], at[:, 1]))


def trimmed_surfaces_of(
    source: str | os.PathLike[str] | Any, *, name: str = "face"
) -> list[TrimmedSurface]:
    """Return the surfaces of all faces, as ``surfaces_of`` does, with their outlines.

    Raises
    ------
    DesignError, SurfaceError
        See ``surfaces_of``.
    """
    from phexfab.cad.freeform_outline import outline_of

    if isinstance(source, str | os.PathLike):
        shape, name = read_shape(Path(source))[0], Path(source).name
    else:
        shape = source
    faces = faces_of(shape)
    surfaces = surfaces_of(shape, name=name)
    return [
        TrimmedSurface(one, outline_of(face)) for one, face in zip(surfaces, faces, strict=True)
    ]


def faces_of(thing: Any) -> list[TopoDS_Face]:
    """Return the faces of a CAD object, each once, in its order."""
    require("OCP")
    from OCP.TopAbs import TopAbs_FACE
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopoDS import TopoDS

    found: list[TopoDS_Face] = []
    for shape in _shapes(thing):
        explorer = TopExp_Explorer(shape, TopAbs_FACE)
        while explorer.More():
            face = TopoDS.Face(explorer.Current())
            if not any(face.IsSame(other) for other in found):
                found.append(face)
            explorer.Next()
    return found


def _shapes(thing: Any) -> list[TopoDS_Shape]:
    from OCP.TopoDS import TopoDS_Shape

    if isinstance(thing, TopoDS_Shape):
        return [thing]
    wrapped = getattr(thing, "wrapped", None)
    if isinstance(wrapped, TopoDS_Shape):
        return [wrapped]
    if hasattr(thing, "vals"):  # a CadQuery workplane
        return [shape for value in thing.vals() for shape in _shapes(value)]
    if isinstance(thing, list | tuple):
        return [shape for value in thing for shape in _shapes(value)]
    raise SurfaceError(
        f"a {type(thing).__name__} holds no CAD shape; give a CadQuery or build123d object, or a "
        "shape of OpenCASCADE"
    )


def _surface(face: TopoDS_Face, name: str) -> ParametricSurface:
    from OCP.BRep import BRep_Tool
    from OCP.BRepBuilderAPI import BRepBuilderAPI_NurbsConvert
    from OCP.BRepTools import BRepTools
    from OCP.Geom import Geom_BSplineSurface, Geom_RectangularTrimmedSurface
    from OCP.GeomConvert import GeomConvert
    from OCP.TopAbs import TopAbs_REVERSED
    from OCP.TopoDS import TopoDS

    converted = TopoDS.Face(BRepBuilderAPI_NurbsConvert(face, True).Shape())
    bounds = tuple(float(b) for b in BRepTools.UVBounds_s(converted))
    geometry = BRep_Tool.Surface_s(converted)
    if isinstance(geometry, Geom_RectangularTrimmedSurface):
        geometry = geometry.BasisSurface()
    if not isinstance(geometry, Geom_BSplineSurface):
        geometry = GeomConvert.SurfaceToBSplineSurface_s(geometry)
    spline: Any = geometry.Copy()
    if spline.IsUPeriodic():
        spline.SetUNotPeriodic()
    if spline.IsVPeriodic():
        spline.SetVNotPeriodic()
    rows, columns = range(1, spline.NbUPoles() + 1), range(1, spline.NbVPoles() + 1)
    poles = [[(p.X(), p.Y(), p.Z()) for p in (spline.Pole(i, j) for j in columns)] for i in rows]
    weights = [[spline.Weight(i, j) for j in columns] for i in rows]
    u_knots = np.repeat(
        [spline.UKnot(i) for i in range(1, spline.NbUKnots() + 1)],
        [spline.UMultiplicity(i) for i in range(1, spline.NbUKnots() + 1)],
    )
    v_knots = np.repeat(
        [spline.VKnot(i) for i in range(1, spline.NbVKnots() + 1)],
        [spline.VMultiplicity(i) for i in range(1, spline.NbVKnots() + 1)],
    )
    degrees = (spline.UDegree(), spline.VDegree())
    low = (u_knots[degrees[0]], v_knots[degrees[1]])
    high = (u_knots[-degrees[0] - 1], v_knots[-degrees[1] - 1])
    domain = (
        max(bounds[0], low[0]),
        min(bounds[1], high[0]),
        max(bounds[2], low[1]),
        min(bounds[3], high[1]),
    )
    whole = (
        domain[1] - domain[0] > (1 - 1e-9) * (high[0] - low[0]),
        domain[3] - domain[2] > (1 - 1e-9) * (high[1] - low[1]),
    )
    net = np.array(poles)
    size = np.ptp(net.reshape(-1, 3), axis=0).max()
    closed = (
        whole[0] and bool(np.abs(net[0] - net[-1]).max() <= 1e-9 * size),
        whole[1] and bool(np.abs(net[:, 0] - net[:, -1]).max() <= 1e-9 * size),
    )
    return nurbs(
        net,
        (u_knots, v_knots),
        degrees,
        weights=np.array(weights),
        domain=domain,
        periodic=closed,
        flipped=converted.Orientation() == TopAbs_REVERSED,
        name=name,
    )

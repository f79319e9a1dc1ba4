"""From a shape of a CAD script to a build: what the CadQuery and build123d doors share."""

from __future__ import annotations

from collections.abc import Mapping
from os import PathLike
from typing import Any

from phexfab.cad.freeform_faces import faces_of
from phexfab.cad.rims import shapes_in
from phexfab.design import Design, load_design, make_design
from phexfab.errors import DesignError
from phexfab.pipeline import Build, build

DesignLike = Design | str | PathLike[str]


def build_on(
    thing: Any,
    panel_size: float | str | None = None,
    design: DesignLike | None = None,
    **tables: Mapping[str, Any] | str,
) -> Build:
    """Build the film of closed wires or edges, or a shell on a curved face.

    Parameters
    ----------
    thing : object of CadQuery or build123d
        Wires or edges that close are rims: the shell is the soap film that they span. A face is
        covered as it is, by the method that ``mesh`` names.
    panel_size : float or str
        Distance of neighbouring panels' centres, mm or with a unit.
    design : Design or path of a design file, optional
        Everything else, instead of tables; its surface gives way to the shape.
    **tables
        Tables of a design file, such as ``panels={"material": "glass", "thickness": 8}``, and its
        ``title``. On a face the method is ``mesh={"method": "dupin"}`` unless another is named.

    Raises
    ------
    DesignError
        If the shape is neither a rim nor one curved face, or the design is wrong.
    SurfaceError, LatticeError, SolveError, MeshError
        If there is no film or no shell; the message says what to change.
    """
    shapes = shapes_in(thing)
    if not shapes:
        raise DesignError(
            f"{type(thing).__name__} holds no shape; give a closed wire, edges that close, or a "
            "curved face"
        )
    faces = faces_of(shapes)
    if len(faces) > 1:
        raise DesignError(f"there are {len(faces)} faces; select one, or the wires of a boundary")
    if faces and _is_flat(faces[0]):
        raise DesignError(
            "the face is flat; select a curved face, or the wire of a boundary that is not flat"
        )
    given: dict[str, Any] = {"face": faces[0]} if faces else {"rims": shapes}
    if design is not None:
        if panel_size is not None or tables:
            wrong = ", ".join(["panel_size"] * (panel_size is not None) + sorted(tables))
            raise DesignError(f"the design says everything; leave out {wrong}, or the design")
        return build(design if isinstance(design, Design) else load_design(design), **given)
    if panel_size is None:
        raise DesignError("panel_size is missing; say how large panels are, such as 600 (mm)")
    source = {"step": "the face of the script"} if faces else {"rim": "the rim of the script"}
    data: dict[str, Any] = {"title": "Shell", **tables}
    data["surface"] = {**source, **data.get("surface", {})}
    data["lattice"] = {"panel_size": panel_size, **data.get("lattice", {})}
    if faces:
        data["mesh"] = {"method": "dupin", **data.get("mesh", {})}
        data["offset"] = {"type": "face", **data.get("offset", {})}
    return build(make_design(data), **given)


def _is_flat(face: Any) -> bool:
    from OCP.BRepAdaptor import BRepAdaptor_Surface
    from OCP.GeomAbs import GeomAbs_SurfaceType

    return bool(BRepAdaptor_Surface(face).GetType() == GeomAbs_SurfaceType.GeomAbs_Plane)

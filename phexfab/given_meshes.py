"""A polygon mesh from elsewhere as a shell: what ``mesh.method = "planarise"`` asks for."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import shapely
from numpy.typing import NDArray

from phexfab.cad.freeform_faces import TrimmedSurface, trimmed_surfaces_of
from phexfab.design import Design
from phexfab.design.load import file_of
from phexfab.design.messages import toml_value
from phexfab.errors import DesignError, MeshError, SurfaceError
from phexfab.mesh.polygons import import_polygons
from phexfab.mesh.polymesh import PolyMesh
from phexfab.mesh.trimesh_io import read_triangles
from phexfab.parallel.shell import Shell
from phexfab.remesh.panel_shell import panel_shell
from phexfab.remesh.planarity.held import held_vertices
from phexfab.remesh.planarity.nearest import MeshReference, Reference
from phexfab.remesh.planarity.planarise import CLOSENESS
from phexfab.surface.rims.checks import unit_factor

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Figures = Mapping[str, tuple[float | int | str, str]]
CAD = (".step", ".stp", ".brep", ".brp")
MESHES = (".obj", ".off", ".ply", ".stl", ".json")
ASTRAY = 0.25
"""Median distance of the vertices from a reference, over the mesh's diagonal, beyond which the two
do not belong together."""


@dataclass(frozen=True, eq=False)
class GivenShell:
    """A shell of the face type, how far its vertices are from where they should be, and figures.

    Attributes
    ----------
    shell : Shell
    deviation : (V,) float
        Distance of each vertex of ``shell.mesh`` from the reference along its normal, or without
        one from where it was, mm.
    figures : mapping of name to (value, unit)
    """

    shell: Shell
    deviation: FloatArray
    figures: Figures


@dataclass(frozen=True, eq=False)
class FacesReference:
    """The faces of a CAD file, each within its outline."""

    faces: tuple[TrimmedSurface, ...]

    def nearest(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return feet (n, 3), mm, and normals, of the face that is nearest to each point.

        A foot beyond an outline gives way to the point of the outline nearest to it in parameters.
        """
        feet, normals = np.zeros((len(points), 3)), np.zeros((len(points), 3))
        least = np.full(len(points), np.inf)
        for face in self.faces:
            u = face.surface.nearest(points)
            if face.outline is not None:
                ways = shapely.shortest_line(shapely.points(u), face.outline)
                u = shapely.get_coordinates(ways).reshape(-1, 2, 2)[:, 1]
            foot = face.surface.point(u)
            away = np.linalg.norm(points - foot, axis=1)
            nearer = away < least
            least[nearer], feet[nearer] = away[nearer], foot[nearer]
            normals[nearer] = face.surface.normal(u[nearer])
        return feet, normals


def given_shell(design: Design) -> GivenShell:
    """Return the mesh that ``surface.mesh`` names, made planar, as a shell.

    Raises
    ------
    DesignError
        If a file cannot be read, or the mesh, ``mesh.fixed`` or ``mesh.reference`` does not suit.
    SolveError
        If planar faces are not reached; the message names the worst place.
    """
    asked, source = design.mesh, f'surface.mesh = "{design.surface.mesh}"'
    path = file_of(design, "surface.mesh", str(design.surface.mesh))
    factor = 1.0 if design.surface.unit is None else unit_factor(design.surface.unit, path.name)
    mesh, report = import_polygons(
        path, weld_within=None if asked.weld is None else asked.weld / factor
    )
    if (mesh.sides == 3).all():
        raise DesignError(
            f"{source}: has triangles only; to planarise takes a mesh of panels, three at every "
            'node: take method = "dupin" or "conjugate" for hexagons on the surface that '
            "triangles stand for"
        )
    fixed = _fixed(design, mesh)
    mesh = replace(mesh, vertices=mesh.vertices * factor)
    reference = _reference(design, mesh, factor)
    try:
        made = panel_shell(
            mesh,
            border=asked.border,
            fixed=fixed,
            reference=reference,
            closeness=CLOSENESS if asked.closeness is None else asked.closeness,
            name=path.name,
        )
    except MeshError as error:  # of the mesh itself: what the file asks for cannot be
        held = f" with mesh.fixed = {toml_value(asked.fixed)}" if len(fixed) else ""
        raise DesignError(f"{source}{held}: {error}") from error
    found, deviation = made.planarised.report, made.moved
    figures: dict[str, tuple[float | int | str, str]] = {
        "method": ("planarise", ""),
        "vertices welded": (report.welded, ""),
        "faces turned": (len(report.turned), ""),
        "planarity before": (found.planarity_before, ""),
        "vertices moved, at most": (float(made.moved.max()), "mm"),
        "vertices moved, root mean square": (_rms(made.moved), "mm"),
    }
    if len(fixed):
        moved = made.moved[np.isin(made.vertices, fixed)]
        figures["fixed vertices"] = (len(moved), "")
        figures["fixed vertices moved, at most"] = (float(moved.max()), "mm")
    if reference is not None:
        before = _off(reference, mesh.vertices[made.vertices])
        deviation = _off(reference, made.shell.mesh.vertices)
        for when, away in (("before", before), ("now", deviation)):
            figures[f"off the reference {when}, at most"] = (float(away.max()), "mm")
            figures[f"off the reference {when}, root mean square"] = (_rms(away), "mm")
    figures["panels left out at the border"] = (mesh.n_faces - len(made.shell.panels), "")
    return GivenShell(made.shell, deviation, figures)


def _rms(lengths: FloatArray) -> float:
    return float(np.sqrt((lengths**2).mean()))


def _off(reference: Reference, points: FloatArray) -> FloatArray:
    """Return distances (n,) along the reference's normals: beyond its border it goes on flat."""
    foot, normal = reference.nearest(points)
    return np.abs(np.einsum("ij,ij->i", points - foot, normal))


def _fixed(design: Design, mesh: PolyMesh) -> IntArray:
    """Return the fixed vertices of the mesh as the file has it: its unit is that of the points."""
    asked = design.mesh.fixed
    if asked is None:
        return np.zeros(0, np.int64)
    try:
        return held_vertices(mesh, asked)
    except MeshError as error:
        raise DesignError(f"mesh.fixed = {toml_value(asked)}: {error}") from error


def _reference(design: Design, mesh: PolyMesh, factor: float) -> Reference | None:
    """Return what panels keep close to: the faces of a CAD file, or a mesh in the mesh's unit."""
    if design.mesh.reference is None:
        return None
    said = f'mesh.reference = "{design.mesh.reference}"'
    path = file_of(design, "mesh.reference", design.mesh.reference)
    ending = path.suffix.lower()
    if ending not in CAD + MESHES:
        raise DesignError(
            f'{said}: "{ending}" is no surface that can be read; give one of '
            f"{', '.join(CAD + MESHES)}"
        )
    try:
        found = _read(path, factor)
    except (DesignError, MeshError, SurfaceError) as error:
        raise DesignError(f"{said}: {error}") from error
    away = np.linalg.norm(found.nearest(mesh.vertices)[0] - mesh.vertices, axis=1)
    size = float(np.linalg.norm(np.ptp(mesh.vertices, axis=0)))
    if np.median(away) > ASTRAY * size:
        raise DesignError(
            f"{said}: half of the mesh's vertices are {np.median(away):.4g} mm and more from it, "
            f"and the mesh is {size:.4g} mm large; give both in one place and one unit "
            "(surface.unit is that of meshes, a STEP file has its own)"
        )
    return found


def _read(path: Path, factor: float) -> Reference:
    ending = path.suffix.lower()
    if ending in CAD:
        return FacesReference(tuple(trimmed_surfaces_of(path)))
    mesh = read_triangles(path) if ending == ".stl" else import_polygons(path)[0]
    return MeshReference(replace(mesh, vertices=mesh.vertices * factor))

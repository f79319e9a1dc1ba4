"""Shells on surfaces that need not be minimal, by the methods of the thesis' chapter 5.

The design's table ``[mesh]`` names the method; each leads to a shell of the face type whose
outermost lattice points, faces or border edges are its border planes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from phexfab.cad.freeform_faces import TrimmedSurface, trimmed_surfaces_of
from phexfab.design import Design
from phexfab.design.load import file_of
from phexfab.errors import DesignError, LatticeError, PhexError
from phexfab.given_meshes import given_shell
from phexfab.mesh.measures import mean_edge, planarity, signed_areas, simple_faces
from phexfab.mesh.polygons import import_polygons
from phexfab.mesh.polymesh import PolyMesh
from phexfab.mesh.trimesh_io import read_triangles
from phexfab.parallel.shell import Shell
from phexfab.remesh.conjugate.fields import field_family, plane_families
from phexfab.remesh.conjugate.sectors import ConjugateSectors, conjugate_sectors
from phexfab.remesh.coverage import Coverage, coverage
from phexfab.remesh.dupin.planar import dupin_hexagons
from phexfab.remesh.fewer_panels import (
    centre_distances,
    firm_mesh,
    firm_shell,
    pieces,
    without_panels,
)
from phexfab.remesh.panel_shell import panel_shell
from phexfab.remesh.survey.by_parallel_meshes import parallel_mesh_on
from phexfab.remesh.survey.power_diagram import power_diagram_on
from phexfab.remesh.survey.projective_dual import projective_dual_mesh
from phexfab.remesh.survey.support_function import support_function_mesh
from phexfab.remesh.triangulations.fields import smooth_rows
from phexfab.remesh.triangulations.valid import (
    Triangulation,
    prespecified_conjugation,
    progressive_conjugation,
)
from phexfab.surface.freeform.surface import FreeformSurface, mesh_surface
from phexfab.surface.rims.checks import unit_factor
from phexfab.surface.rims.rim import Rim

FloatArray = NDArray[np.float64]
Figures = Mapping[str, tuple[float | int | str, str]]
Made = TypeVar("Made")
CROSSING = {"refuse": "raise", "drop": "drop"}
PIECE = 0.1
"""Panels of a piece over those of the largest, below which it is left out."""
NOT_PLANAR = 1e-6
"""Planarity over the mean edge above which a mesh is not the planar one that a method needs."""


@dataclass(frozen=True, eq=False)
class FreeformShell:
    """A shell on a free-form surface.

    Attributes
    ----------
    surface : FreeformSurface or None
        None for a mesh from elsewhere, which has none.
    shell : Shell
        Of the face type.
    deviation : (V,) float
        Distance of each vertex of ``shell.mesh`` from the surface along its normal, or from where
        it was, mm.
    figures : mapping of name to (value, unit)
    """

    surface: FreeformSurface | None
    shell: Shell
    deviation: FloatArray
    figures: Figures


@dataclass(frozen=True, eq=False)
class _Patch:
    """A surface, the triangles it was given by, and the test of what its outline holds."""

    surface: FreeformSurface
    mesh: PolyMesh | None
    holds: Callable[[FloatArray], NDArray[np.bool_]] | None


def freeform_shell(design: Design, rims: Sequence[Rim] = (), face: Any = None) -> FreeformShell:
    """Return the shell that a design with a ``mesh.method`` asks for; rims are refused.

    A face of a CAD library is used in place of what ``surface.step`` names.

    Raises
    ------
    DesignError
        If a file cannot be read, or its mesh does not suit the method.
    SurfaceError, LatticeError, MeshError, SolveError
        If the method does not reach the surface; the message names the method, place and remedy.
    """
    method = design.mesh.method
    if method is None:
        raise DesignError('mesh.method is missing; add method = "dupin" below [mesh]')
    if rims:
        raise DesignError(
            f'mesh.method = "{method}": covers the surface that the design names, but rims are '
            "given in its place; a film between rims is minimal and has no mesh.method"
        )
    if method == "planarise":
        if face is not None:
            raise DesignError('mesh.method = "planarise": needs a mesh, but a face is given')
        made = given_shell(design)
        return FreeformShell(None, made.shell, made.deviation, made.figures)
    patch = _patch(design, face)
    try:
        shell, figures = METHODS[method](design, patch)
        shell, dropped = _within(shell, patch)
    except PhexError as error:
        raise type(error)(f'mesh.method = "{method}": {error}') from error
    if not len(shell.panels):
        raise LatticeError(
            f'mesh.method = "{method}": no panel of {design.lattice.panel_size:g} mm lies within '
            f"{patch.surface.name}; take a smaller lattice.panel_size"
        )
    away, over = _distances(patch.surface, shell.mesh.vertices)
    under = coverage(patch.surface, shell.mesh, holds=patch.holds)
    figures = {
        "method": (method, ""),
        **figures,
        "pieces": (pieces(shell), ""),
        "panels left out at the border": (dropped, ""),
        "panels reach over the border, at most": (float(over.max()), "mm"),
        "share of the surface covered": (under.share, ""),
        "deepest gap, from the nearest panel": (under.gaps[0].depth if under.gaps else 0.0, "mm"),
        "place of the deepest gap": (_place(under), "mm"),
    }
    return FreeformShell(patch.surface, shell, away, figures)


def _place(under: Coverage) -> str:
    if not under.gaps:
        return "none"
    return "[" + ", ".join(f"{x:.4g}" for x in under.gaps[0].place) + "]"


def _distances(surface: FreeformSurface, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far points (n, 3) are from a surface, and over its border in the tangent planes.

    A vertex of a whole panel may lie a little beyond the border, where only the tangent plane goes
    on; inside, the way to the nearest point is along the normal.
    """
    foot = surface.nearest(points)
    gap, normals = points - surface.point(foot), surface.normal(foot)
    away = np.einsum("ij,ij->i", gap, normals)
    over = np.linalg.norm(gap - away[:, None] * normals, axis=1)
    return np.abs(away), over


def _patch(design: Design, face: Any = None) -> _Patch:
    asked = design.surface
    if face is not None:
        given = trimmed_surfaces_of(face)
        if len(given) != 1:
            raise DesignError(f"{len(given)} faces are given; select one")
        return _trimmed(given[0])
    if asked.step is not None:
        path = file_of(design, "surface.step", asked.step)
        found = trimmed_surfaces_of(path)
        if asked.face is None and len(found) > 1:
            raise DesignError(
                f'surface.step = "{asked.step}": the file has {len(found)} faces; add face = 1, '
                f"or another number up to {len(found)}"
            )
        number = asked.face or 1
        if number > len(found):
            raise DesignError(
                f"surface.face = {number}: {path.name} has {len(found)} faces; take a number "
                f"from 1 to {len(found)}"
            )
        return _trimmed(found[number - 1])
    path = file_of(design, "surface.mesh", str(asked.mesh))
    mesh = _scaled(design, read_triangles(path), path)
    return _Patch(mesh_surface(mesh, name=path.name), mesh, None)


def _trimmed(one: TrimmedSurface) -> _Patch:
    return _Patch(one.surface, None, one.holds if one.outline is not None else None)


def _scaled(design: Design, mesh: PolyMesh, path: Path) -> PolyMesh:
    if design.surface.unit is None:
        return mesh
    return replace(mesh, vertices=mesh.vertices * unit_factor(design.surface.unit, path.name))


def _within(shell: Shell, patch: _Patch) -> tuple[Shell, int]:
    """Leave out panels that reach over the outline, and what hangs on by one edge."""
    count = len(shell.panels)
    if patch.holds is not None:
        inside = patch.holds(patch.surface.nearest(shell.mesh.vertices))
        whole = np.logical_and.reduceat(inside[shell.mesh.corners], shell.mesh.starts[:-1])
        shell = without_panels(shell, shell.panels[~whole])
    shell = firm_shell(shell, share=PIECE)
    return shell, count - len(shell.panels)


def _sized(make: Callable[[float], Made], sizes: Callable[[Made], FloatArray], size: float) -> Made:
    """Return what is made with the step for which the median of the sizes is nearly ``size``."""
    first = make(size)
    share = float(np.median(sizes(first))) / size
    return first if abs(share - 1) < 0.02 else make(size / share)


def _triangulation(design: Design, patch: _Patch) -> Triangulation:
    asked = design.mesh
    rows = smooth_rows(patch.surface, toward=asked.toward)

    def make(step: float) -> Triangulation:
        if asked.conjugation == "progressive":
            return progressive_conjugation(patch.surface, step, rows=rows)
        return prespecified_conjugation(patch.surface, step, rows=rows)

    def edges(made: Triangulation) -> FloatArray:
        corner = made.points[made.triangles]
        away = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2)
        return np.asarray(away.mean(axis=1))

    return _sized(make, edges, design.lattice.panel_size)


def _dupin(design: Design, patch: _Patch) -> tuple[Shell, Figures]:
    asked = design.mesh
    triangles = _triangulation(design, patch)
    made = dupin_hexagons(
        triangles, closeness=asked.closeness or 0.0, crossing=CROSSING[asked.crossing]
    )
    moved = made.planarised.report.motion_max
    return _panelled(design, patch, made.mesh), {
        "planarity of the Dupin centres": (made.planarised.report.planarity_before, ""),
        "Dupin centres moved, at most": (moved, "mm"),
        "crossing panels left out": (len(made.dropped), ""),
    }


def _conjugate(design: Design, patch: _Patch) -> tuple[Shell, Figures]:
    asked = design.mesh
    families = [field_family(smooth_rows(patch.surface, toward=asked.toward))]
    if asked.toward is None:
        families += plane_families(patch.surface)

    def make(size: float) -> ConjugateSectors:
        nonlocal families
        made = conjugate_sectors(
            patch.surface,
            families,
            size,
            closeness=asked.closeness or 0.0,
            crossing=CROSSING[asked.crossing],
        )
        families = list(dict.fromkeys(made.families))  # another size follows the same
        return made

    made = _sized(make, lambda one: centre_distances(one.mesh), design.lattice.panel_size)
    reports = [net.planarised.report for net in made.nets]
    return _panelled(design, patch, made.mesh), {
        "planarity of the brick layout": (max(one.planarity_before for one in reports), ""),
        "its vertices moved, at most": (max(one.motion_max for one in reports), "mm"),
        "rows follow": (made.families[0].name, ""),
        "crossing panels left out": (sum(len(net.dropped) for net in made.nets), ""),
    }


def _panelled(design: Design, patch: _Patch, mesh: PolyMesh) -> Shell:
    """Return the shell of a mesh's firm pieces."""
    kept = firm_mesh(mesh, share=PIECE)
    return panel_shell(kept, border=design.mesh.border, name=patch.surface.name).shell


def _tangent(design: Design, patch: _Patch) -> tuple[Shell, Figures]:
    made = _triangulation(design, patch)
    normals = patch.surface.normal(made.parameters)
    heights = np.einsum("ij,ij->i", normals, made.points)
    shell = Shell(normals, heights, np.ones(len(heights)), made.triangles, "face", made.points)
    if not len(shell.panels):
        raise LatticeError(
            f"{patch.surface.name}: no point has triangles all around; take smaller panels"
        )
    shell, dropped = _simple(shell, patch.surface.name, design.mesh.crossing)
    return shell, {"crossing panels left out": (dropped, "")}


def _simple(shell: Shell, name: str, crossing: str) -> tuple[Shell, int]:
    """Refuse faces that cross themselves or are inside out, or leave them out."""
    areas = signed_areas(shell.mesh, shell.normals[shell.panels])
    bad = np.flatnonzero(~simple_faces(shell.mesh) | ~(areas > 0))
    if not len(bad):
        return shell, 0
    if crossing == "refuse":
        place = shell.points[shell.panels[bad[0]]].round(1).tolist()
        raise LatticeError(
            f"{name}: {len(bad)} of {len(areas)} faces cross themselves, the first is {bad[0]} at "
            f'{place} mm; take method = "dupin", another conjugation or toward, a smaller '
            'lattice.panel_size, or leave such faces out with crossing = "drop"'
        )
    fewer = without_panels(shell, shell.panels[bad])
    return fewer, len(shell.panels) - len(fewer.panels)


def _duality(design: Design, patch: _Patch) -> tuple[Shell, Figures]:
    made = projective_dual_mesh(
        patch.surface,
        design.lattice.panel_size,
        centre=design.mesh.centre,
        turn=design.lattice.turn,
        row_ratio=design.lattice.row_ratio,
        mesh=patch.mesh,
    )
    place = ", ".join(f"{x:.4g}" for x in made.centre)
    return made.shell, {
        "centre of duality": (f"[{place}]", "mm"),
        "distortion of lengths by duality": (made.distortion, ""),
    }


def _support(design: Design, patch: _Patch) -> tuple[Shell, Figures]:
    shell = support_function_mesh(
        patch.surface,
        design.lattice.panel_size,
        turn=design.lattice.turn,
        row_ratio=design.lattice.row_ratio,
        mesh=patch.mesh,
    )
    return shell, {}


def _parallel(design: Design, patch: _Patch) -> tuple[Shell, Figures]:
    path = file_of(design, "mesh.start", str(design.mesh.start))
    start = import_polygons(path)[0]
    off = planarity(start) / mean_edge(start)
    if off.max() > NOT_PLANAR:
        raise DesignError(
            f'mesh.start = "{design.mesh.start}": face {int(off.argmax())} is {off.max():.1e} of '
            'an edge off its plane; make the mesh planar first, with method = "planarise"'
        )
    made = parallel_mesh_on(start, patch.surface, drop=True, mesh=patch.mesh)
    return made.shell, {"edges reversed": (made.reversed_edges, "")}


def _power(design: Design, patch: _Patch) -> tuple[Shell, Figures]:
    return power_diagram_on(patch.surface, design.lattice.panel_size), {}


METHODS: dict[str, Callable[[Design, _Patch], tuple[Shell, Figures]]] = {
    "dupin": _dupin,
    "conjugate": _conjugate,
    "tangent": _tangent,
    "duality": _duality,
    "support": _support,
    "parallel": _parallel,
    "power": _power,
}

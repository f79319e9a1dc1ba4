"""One surface, panelled three ways: triangles, planar quadrilaterals, planar hexagons.

All three carry panels of the same thickness on bars of the same section, cut from the same sheets,
so that what differs is what the number of sides makes different.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from phexfab.comparison import Comparison, Figure, Row
from phexfab.design import Design, load_design
from phexfab.errors import DesignError, NestingError, PartError
from phexfab.fabrication.bom import least_boxes
from phexfab.fabrication.inset import edge_directions, inset, inset_limits
from phexfab.fabrication.layout import sheet_yield
from phexfab.fabrication.nest import nest
from phexfab.fabrication.parts import EdgeNote, FlatPart, Material
from phexfab.forming import parameter_rectangle
from phexfab.mesh.measures import (
    corner_angles,
    edge_lengths,
    edges,
    face_centroids,
    face_normals,
    relative_planarity,
    signed_areas,
)
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.classify import classify_mesh
from phexfab.parallel.support import NodeTorsion, node_torsion, torsion_of_axes
from phexfab.pipeline import Build, DesignLike, build, stocks
from phexfab.remesh.panelings import (
    Paneling,
    covered_rectangle,
    quad_paneling,
    triangle_paneling,
)
from phexfab.surface import MinimalSurface

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

EQUAL = ("size", "deviation")
USABLE_TILT = 45.0  # degrees that node axes may lean off the normals and still be node axes
_ROUNDS = 6
_AROUND = (0.8, 0.87, 0.93, 1.07, 1.15, 1.25)
_REFLEX = 180 + 1e-6


def compare(design: DesignLike, equal: str = "size", *, packer: str = "shelf") -> Comparison:
    """Panel a design's surface with triangles, planar quads and planar hexagons, and measure them.

    The hexagons are the design's shell. The others cover as much of the same surface, about the
    same middle, with panels of the same mean area (``"size"``) or as many panels as bring them
    equally close to the surface (``"deviation"``).

    Parameters
    ----------
    design : Design or path of a design file
    equal : ``"size"`` or ``"deviation"``
    packer : ``"shelf"`` or ``"spyrrow"``
        How panels are nested: in rows, or densely in a minute or two.

    Returns
    -------
    Comparison
        Lengths of panels are those of their least rectangles, waste is 1 − area/rectangle or
        1 − area/sheets, the last sheet whole. Panels are cut square with the design's gap. Torsion
        is between the mid-planes at a member's two inner nodes: with area-weighted vertex normals
        as node axes for triangles and quads, with the Gauss image for hexagons; the best axes are
        those of ``best_axes``. Deviation is over corners, middles of edges and centroids of panels.
        Offset types are exact to 1e-9, with node axes near the normals; the error of the best
        offset is how far its Gauss image misses the unit sphere. The mass of members is that of
        the design's bars, whole from node to node.

    Raises
    ------
    DesignError
        If the design is wrong, or an option is unknown.
    SurfaceError, SolveError, PartError

    References
    ----------
    Thesis ch. 3.
    """
    if equal not in EQUAL:
        raise DesignError(f"equal = {equal!r}: choose one of {', '.join(EQUAL)}")
    if packer not in ("shelf", "spyrrow"):
        raise DesignError(f"packer = {packer!r}: choose 'shelf' or 'spyrrow'")
    asked = design if isinstance(design, Design) else load_design(design)
    if asked.surface.source != "named" or asked.surface.radius is not None:
        raise DesignError(
            f"{asked.name}: triangles and quads are laid out on a rectangle of curvature-line "
            "coordinates, which a film between rims does not have; compare a surface given by name "
            "or formula, without surface.radius"
        )
    built = build(asked)
    hexagons = _hexagons(built)
    makers = _makers(built, hexagons.mesh)
    find = _equal_size if equal == "size" else _equal_deviation
    all_three = {
        **{name: find(_smooth(built), make, hexagons) for name, make in makers.items()},
        "hexagons": hexagons,
    }
    return Comparison(
        built.design.name,
        equal,
        tuple(_measure(name, one, built, packer) for name, one in all_three.items()),
    )


# -- the three meshes ------------------------------------------------------------------------------


def _smooth(built: Build) -> MinimalSurface:
    if not isinstance(built.surface, MinimalSurface):
        raise DesignError(f"{built.design.name}: its surface is not minimal; compare one that is")
    return built.surface


def _hexagons(built: Build) -> Paneling:
    shell = built.shell
    # Of the first of a vertex' three planes, not their mean: it may lie across a seam.
    near = shell.parameters[shell.triangles[shell.used_vertices][:, 0]]
    return Paneling(shell.mesh, near)


Maker = Callable[[int, float], Paneling]


def _makers(built: Build, hexagons: PolyMesh) -> dict[str, Maker]:
    """Return what makes a mesh of about a number of panels that covers an area in mm²."""
    smooth, asked = _smooth(built), built.design.lattice
    rectangle, closed = parameter_rectangle(built.design, smooth)

    def triangles(count: int, area: float) -> Paneling:
        box = covered_rectangle(smooth, rectangle, area, closed=closed)
        return triangle_paneling(smooth, box, count, rows_along=asked.rows_along, closed=closed)

    def quads(count: int, area: float) -> Paneling:
        box = covered_rectangle(smooth, rectangle, area, closed=closed)
        return quad_paneling(smooth, box, count, closed=closed)

    return {"triangles": triangles, "quads": quads}


def _equal_size(smooth: MinimalSurface, make: Maker, like: Paneling) -> Paneling:
    """Return the mesh with the mean panel area of another one."""
    count, area = like.mesh.n_faces, float(signed_areas(like.mesh).sum())
    size = area / count
    made = make(count, area)
    for _ in range(3):
        # Whole rows and columns seldom make up the count: cover a little more or less instead.
        area *= size / float(signed_areas(made.mesh).mean())
        again = make(made.mesh.n_faces, area)
        if again.mesh.n_faces != made.mesh.n_faces:
            break
        made = again
    return made


def _equal_deviation(smooth: MinimalSurface, make: Maker, like: Paneling) -> Paneling:
    """Return the mesh whose largest deviation comes nearest to that of another one."""
    area, count = float(signed_areas(like.mesh).sum()), like.mesh.n_faces
    wanted = float(_deviation(smooth, like).max())
    tried: dict[int, tuple[float, int, Paneling]] = {}

    def attempt(panels: int) -> int:
        """Try a number of panels, and return the one that should be nearer."""
        made = make(panels, area)
        ratio = float(_deviation(smooth, made).max()) / wanted
        tried[panels] = abs(float(np.log(ratio))), made.mesh.n_faces, made
        return max(2, round(made.mesh.n_faces * ratio))  # it falls with the square of the size

    while count not in tried and len(tried) < _ROUNDS:
        count = attempt(count)
    # Rows and columns are whole numbers, so that deviation jumps: look around the best.
    best = min(tried.values(), key=lambda one: one[0])[1]
    for factor in _AROUND:
        panels = max(2, round(best * factor))
        if panels not in tried:
            attempt(panels)
    return min(tried.values(), key=lambda one: one[0])[2]


# -- what is measured ------------------------------------------------------------------------------


def _measure(name: str, one: Paneling, built: Build, packer: str) -> Row:
    mesh, design = one.mesh, built.design
    areas = signed_areas(mesh)
    area = float(areas.sum()) / 1e6
    pairs = edges(mesh)
    inner, valence = _inner_valence(mesh)
    length = float(edge_lengths(mesh).sum()) / 1e3
    flats = _flats(name, mesh, design)
    outlines = [flat.outline for flat in flats]
    boxes = least_boxes(outlines)
    cut = _polygon_areas(outlines)
    notes: list[str] = []
    waste, sheets = _nested(name, flats, design, packer, notes)
    hexagons = name == "hexagons"
    plain = node_torsion(mesh, built.shell.gauss if hexagons else None)
    best = plain if hexagons else node_torsion(mesh, axes="best")
    types, miss = _offsets(mesh)
    bar = design.beams
    member_mass = length * bar.width * bar.height * bar.density * 1e-6
    panel_mass = float(cut.sum()) * design.panels.thickness * design.panels.density * 1e-9
    if bar.kind == "none":
        member_mass = 0.0
        notes.append("the design has no beams: members weigh nothing")
    away = _deviation(_smooth(built), one)
    figures: dict[str, Figure] = {
        "panels": mesh.n_faces,
        "nodes": len(mesh.vertices),
        "members": len(pairs),
        "valence": float(valence[inner].mean()) if inner.any() else None,
        "covered_area": area,
        "panel_area": float(areas.mean()) / 1e6,
        "panel_length": float(boxes[:, 0].mean()),
        "longest_panel": float(boxes[:, 0].max()),
        "nonconvex_panels": _nonconvex(mesh),
        "member_length": length,
        "member_length_per_area": length / area,
        "nodes_per_area": len(mesh.vertices) / area,
        "box_waste": 100 * (1 - float(cut.sum()) / float(boxes.prod(axis=1).sum())),
        "nest_waste": waste,
        "sheets": sheets,
        "torsion": float(_inside(plain, inner).max()),
        "mean_torsion": float(_inside(plain, inner).mean()),
        "best_torsion": float(_inside(best, inner).max()),
        "planarity": float(relative_planarity(mesh).max()),
        "offset_types": ", ".join(types) or "none",
        "offset_miss": miss,
        "member_mass": member_mass,
        "panel_mass": panel_mass,
        "mass_per_area": (member_mass + panel_mass) / area,
        "deviation": float(away.max()),
        "mean_deviation": float(away.mean()),
    }
    return Row(name, mesh, figures, tuple(notes))


def _inner_valence(mesh: PolyMesh) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Return which vertices lie inside, and the number of edges at each."""
    n = len(mesh.vertices)
    valence = np.bincount(edges(mesh).ravel(), minlength=n)
    # Around an inner vertex there are as many faces as edges.
    return (np.bincount(mesh.corners, minlength=n) == valence) & (valence > 0), valence


def _inside(torsion: NodeTorsion, inner: NDArray[np.bool_]) -> FloatArray:
    """Return the torsion of members between inner nodes, of all members where there is none."""
    between = inner[torsion.edges].all(axis=1)
    return torsion.torsion[between] if between.any() else torsion.torsion


def _nonconvex(mesh: PolyMesh) -> int:
    reflex = np.maximum.reduceat(corner_angles(mesh), mesh.starts[:-1]) > _REFLEX
    return int(reflex.sum())


def _deviation(surface: MinimalSurface, one: Paneling) -> FloatArray:
    """Return the distances of corners, middles of edges and centroids to the surface, mm."""
    mesh, z = one.mesh, one.parameters
    pairs = edges(mesh)
    points = np.concatenate(
        [mesh.vertices, mesh.vertices[pairs].mean(axis=1), face_centroids(mesh)]
    )
    near = np.concatenate([z, z[pairs[:, 0]], z[mesh.corners[mesh.starts[:-1]]]])
    foot = surface.closest_parameter(points, near)
    return np.asarray(np.linalg.norm(surface.point(foot) - points, axis=1))


def _offsets(mesh: PolyMesh) -> tuple[list[str], float | None]:
    """Return the exact offset types, and the least miss of the unit sphere over all types.

    A parallel mesh that has shrunk to a point, or whose axes lie in the surface, is no offset.
    """
    if (mesh.sides == 3).all():
        return [], None  # parallel to a mesh of triangles are scaled copies only (thesis §4.1)
    found = classify_mesh(mesh, tolerance=1e-9)
    usable = {
        kind: fit.worst
        for kind, fit in found.fits.items()
        if torsion_of_axes(mesh, fit.gauss.vertices).tilt.max() <= USABLE_TILT
        and edge_lengths(fit.gauss).max() > 1e-6
    }
    exact = [kind for kind, worst in usable.items() if worst <= found.tolerance]
    return exact, min(usable.values()) if usable else None


def _flats(name: str, mesh: PolyMesh, design: Design) -> tuple[FlatPart, ...]:
    """Return the panels' contours, cut square with half the gap off every edge."""
    asked = design.panels
    normals = face_normals(mesh)
    begin, owner = mesh.starts[:-1], mesh.face_of_corner
    points = mesh.vertices[mesh.corners]
    local = points - points[begin][owner]
    x = points[mesh.next_corner][begin] - points[begin]
    x -= np.einsum("ij,ij->i", x, normals)[:, None] * normals
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(normals, x)
    flat = np.column_stack(
        [np.einsum("ij,ij->i", local, x[owner]), np.einsum("ij,ij->i", local, y[owner])]
    )
    each = np.full(len(flat), asked.gap / 2)
    room = inset_limits(flat, edge_directions(flat, mesh), np.full(len(flat), 0.5), mesh)
    if len(room) and not room.min() > asked.gap:
        raise PartError(
            f"panels.gap = {asked.gap:g} mm leaves nothing of {name} {int(room.argmin())}: at most "
            f"{room.min():.4g} mm, or choose larger panels"
        )
    contours = np.split(inset(flat, each, mesh), mesh.starts[1:-1])
    material = Material(asked.material, asked.density)
    return tuple(
        FlatPart(
            f"{name[0].upper()}{k + 1:05d}",
            contour,
            contour,
            (EdgeNote("", 0.0),) * len(contour),
            asked.thickness,
            material,
        )
        for k, contour in enumerate(contours)
    )


def _polygon_areas(polygons: Sequence[FloatArray]) -> FloatArray:
    def area(polygon: FloatArray) -> float:
        x, y = (polygon - polygon[0]).T
        return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))

    return np.array([area(polygon) for polygon in polygons])


def _nested(
    name: str, flats: Sequence[FlatPart], design: Design, packer: str, notes: list[str]
) -> tuple[float | None, int | None]:
    """Return the waste in per cent and the number of sheets; None where a panel is too large."""
    asked = design.nesting
    try:
        sheets = nest(
            flats,
            stocks(design)["panels"],
            seed=asked.seed,
            seconds=asked.seconds,
            packer=packer,
            notes=notes,
        )
    except NestingError as error:
        notes.append(f"{name} are not nested: {error}")
        return None, None
    return 100 * (1 - float(np.mean([sheet_yield(sheet, flats) for sheet in sheets]))), len(sheets)

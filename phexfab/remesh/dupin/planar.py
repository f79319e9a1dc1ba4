"""Planar hexagons from a triangulation of a surface: Dupin centres joined, then made planar."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import LatticeError, SolveError
from phexfab.mesh.measures import simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.dupin.hexagons import (
    PARABOLIC,
    crossing_message,
    dual_polygons,
    dupin_centres,
)
from phexfab.remesh.fewer_panels import reach
from phexfab.remesh.planarity.nearest import FreeformReference
from phexfab.remesh.planarity.planarise import Planarised, planarise
from phexfab.remesh.triangulations.valid import Triangulation

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

ROUNDS = 8  # of leaving out crossing faces
FLUNG = 4.0  # reach of a face over the median one, where tangent planes hardly meet


@dataclass(frozen=True, eq=False)
class DupinHexagons:
    """Planar hexagons dual to a triangulation, and how they came about.

    Attributes
    ----------
    mesh : PolyMesh
        Planar faces.
    start : PolyMesh
        The nearly planar mesh of Dupin centres, face by face the same.
    points : (F,) int
        The point of the triangulation that each face belongs to.
    planarised : Planarised
    crossing : (k,) int
        Faces that are not simple polygons, or reach four times as far as the median face; none
        unless they were to be kept.
    dropped : (d,) int
        Points of the triangulation whose faces were left out for that reason.
    """

    mesh: PolyMesh
    start: PolyMesh
    points: IntArray
    planarised: Planarised
    crossing: IntArray
    dropped: IntArray


def dupin_hexagons(
    triangulation: Triangulation,
    *,
    parabolic: float = PARABOLIC,
    rule: str = "flat",
    closeness: float = 0.0,
    crossing: str = "raise",
) -> DupinHexagons:
    """Return planar hexagons from a triangulation: Dupin centres, joined and made planar.

    Parameters
    ----------
    triangulation : Triangulation
    parabolic, rule
        See ``dupin_centres``.
    closeness : float
        What a square distance from the surface costs, over a square motion along it; 0: the nearest
        planar mesh.
    crossing : "raise", "drop" or "keep"
        What becomes of faces that cross themselves or are flung out: an error that names them, a
        mesh without them, or a mesh with them, numbered in ``crossing``.

    Raises
    ------
    LatticeError
        If faces cross themselves; the message names the first, its place, its curvatures and what
        it lacks. Also if dropping leaves no face, or an option is unknown.
    SolveError
        If planar faces are not reached.

    References
    ----------
    Thesis §5.1.4; Wang et al. 2008, "Hexagonal meshes with planar faces".
    """
    if crossing not in ("raise", "drop", "keep"):
        raise LatticeError(f'crossing = "{crossing}": "raise", "drop" or "keep"')
    surface = triangulation.surface
    centres = dupin_centres(triangulation, parabolic=parabolic, rule=rule)
    start, points = dual_polygons(triangulation, centres)
    near = FreeformReference(surface) if closeness > 0 else None
    dropped = np.zeros(0, np.int64)
    for _ in range(ROUNDS):
        made = planarise(
            start, keep_border=False, reference=near, closeness=closeness or 1.0, strict=False
        )
        far = reach(made.mesh, triangulation.points[points])
        bad = ~simple_faces(made.mesh) | (far > FLUNG * np.median(far))
        if not bad.any() or crossing != "drop":
            break
        dropped = np.concatenate([dropped, points[bad]])
        if bad.all():
            raise LatticeError(f"{surface.name}: every face crosses itself; take a smaller step")
        start, points = _without(start, bad), points[~bad]
    else:
        raise LatticeError(
            f"{surface.name}: after leaving out {len(dropped)} faces others still cross; "
            "take a smaller step or a part of the surface"
        )
    found = np.flatnonzero(bad)
    if len(found) and crossing == "raise":
        raise LatticeError(crossing_message(triangulation, points, found))
    if not made.report.converged:
        worst = made.report.worst_face
        raise SolveError(
            f"{surface.name}: face {worst} about "
            f"{triangulation.points[points[worst]].round(3).tolist()} stays "
            f"{made.planarity[worst]:.1e} of an edge from its plane; take a smaller step"
        )
    return DupinHexagons(made.mesh, start, points, made, found, np.sort(dropped))


def _without(mesh: PolyMesh, bad: BoolArray) -> PolyMesh:
    """Return a mesh without some faces and the vertices that only they have."""
    corner = ~bad[mesh.face_of_corner]
    used, slots = np.unique(mesh.corners[corner], return_inverse=True)
    starts = np.concatenate([[0], np.cumsum(mesh.sides[~bad])])
    return PolyMesh(mesh.vertices[used], slots.astype(np.int64), starts.astype(np.int64))

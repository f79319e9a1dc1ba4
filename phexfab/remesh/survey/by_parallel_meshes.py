"""Hexagons by parallel meshes: the planes of a given hexagon mesh, moved to touch another surface.

A planar hexagon mesh M₀ is needed to begin with. Meshes parallel to it have the same face normals,
so the heights of the one whose planes touch a surface are the surface's support function at those
normals: the surface must have K > 0 or K < 0 throughout, and M₀'s normals in its Gauss image. Edges
may be reversed on the way, and faces cross themselves.

References
----------
Thesis ch. 5, "Parallel meshes", §4.1; Pottmann, Liu, Wallner, Bobenko, Wang 2007, "Geometry of
multi-layer freeform structures for architecture".
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import MeshError
from phexfab.mesh.measures import signed_areas
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.edge_offset import touch_surface
from phexfab.parallel.pairs import ratios
from phexfab.parallel.shell import Shell
from phexfab.parallel.simple import shell_of_mesh
from phexfab.remesh.survey.patch import require_simple
from phexfab.remesh.survey.support_function import SupportFunction
from phexfab.surface.freeform.bending import FreeformSurface

BoolArray = NDArray[np.bool_]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class ParallelMesh:
    """The outcome of moving a mesh's planes onto a surface.

    Attributes
    ----------
    shell : Shell
        Its planes touch the surface.
    start : Shell
        The given mesh, without what was dropped, plane for plane parallel to ``shell``.
    faces : (F,) int
        The given mesh's face of every plane.
    """

    shell: Shell
    start: Shell
    faces: IntArray

    @property
    def reversed_edges(self) -> int:
        """Number of edges that run the other way than in the given mesh."""
        return int((ratios(self.start.mesh, self.shell.mesh) < 0).sum())


def parallel_mesh_on(
    start: Shell | PolyMesh,
    surface: FreeformSurface,
    *,
    drop: bool = False,
    mesh: PolyMesh | None = None,
    crossing: bool = False,
) -> ParallelMesh:
    """Return the mesh parallel to a given one whose face planes touch a surface.

    Parameters
    ----------
    start : Shell or PolyMesh
        With planar faces, three at every vertex inside. The faces at the border of a ``PolyMesh``
        become border planes; those within are the panels.
    surface : FreeformSurface
        With K > 0 or K < 0 throughout.
    drop : bool
        Drop the faces whose normals are not in the surface's Gauss image, instead of refusing them.
    mesh : PolyMesh, optional
        See ``phexfab.remesh.survey.patch.sample_patch``.
    crossing : bool
        Let faces that cross themselves pass.

    Raises
    ------
    SurfaceError
        If the surface has parabolic points, or no tangent plane with one of the normals.
    MeshError
        If the given mesh has no panel, or none is left.
    LatticeError
        If faces cross themselves.

    References
    ----------
    Thesis ch. 5.
    """
    given = shell_of_mesh(start, border="panels") if isinstance(start, PolyMesh) else start
    if not len(given.panels):
        raise MeshError("the given mesh has no face with neighbours all around, so no panel")
    support = SupportFunction.of(surface, mesh=mesh, method="the way by parallel meshes")
    faces = np.arange(len(given.normals))
    if drop:
        given, faces = _without(given, ~support.find(given.normals)[1])
        if not len(given.panels):
            raise MeshError(
                f"{surface.name}: no panel of the given mesh is left, its normals are not in the "
                "surface's Gauss image; turn the mesh, or take another one"
            )
    shell = touch_surface(given, support)
    # The given mesh may have been made for the other sign of curvature.
    if signed_areas(shell.mesh, shell.normals[shell.panels]).sum() < 0:
        shell = replace(shell, triangles=shell.triangles[:, ::-1])
        given = replace(given, triangles=given.triangles[:, ::-1])
    if not crossing:
        require_simple(
            shell,
            surface.name,
            "moving a mesh parallel to itself",
            "begin with a mesh of a surface that bends alike (K of the same sign, axes alike)",
        )
    return ParallelMesh(shell, given, faces)


def _without(shell: Shell, gone: BoolArray) -> tuple[Shell, IntArray]:
    """Return the shell without some planes, and the old number of every plane left."""
    panel = np.zeros(len(gone), bool)
    panel[shell.panels] = True
    triangles = shell.triangles[~gone[shell.triangles].any(axis=1)]
    n = len(gone)
    # A panel remains one while all of its triangles do.
    before = np.bincount(shell.triangles.ravel(), minlength=n)
    panel &= np.bincount(triangles.ravel(), minlength=n) == before
    triangles = triangles[panel[triangles].any(axis=1)]
    left, inverse = np.unique(triangles, return_inverse=True)
    return (
        Shell(
            shell.normals[left],
            shell.heights[left],
            shell.gauss_heights[left],
            inverse.reshape(-1, 3),
            shell.kind,
            shell.points[left],
        ),
        left,
    )

"""Which vertices of a mesh keep their place, told by places and not by numbers.

Vertices change their numbers when a mesh is welded, and differ from program to program; places are
what a drawing gives.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree

from phexfab.errors import MeshError
from phexfab.mesh.half_edges import border_loops
from phexfab.mesh.measures import mean_edge
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.planarity.hold import BorderCurve

IntArray = NDArray[np.int64]

WITHIN = 0.02
"""Most by which a given place may be off its vertex, over the mean edge."""


def held_vertices(mesh: PolyMesh, which: str | ArrayLike) -> IntArray:
    """Return the numbers of vertices that are named by what they are or where they are.

    Parameters
    ----------
    mesh : PolyMesh
    which : ``"corners"``, ``"border"`` or (k, 3) float
        The border's corners, at which it turns by more than 40° between stretches that do not; all
        its vertices; or the vertices nearest to these places, in the unit of the mesh.

    Returns
    -------
    (n,) int
        Ascending, each once.

    Raises
    ------
    MeshError
        If there is no border, it has no corner, or no vertex within 2 % of the mean edge of a
        place: the message names the place, the nearest vertex and how far it is.
    """
    if isinstance(which, str):
        if which not in ("corners", "border"):
            raise MeshError(f'"{which}" are no vertices; use "corners", "border" or points')
        loops = border_loops(mesh)
        if not loops:
            raise MeshError("the mesh is closed, it has no border; give points [[x, y, z], …]")
        found = np.concatenate(loops) if which == "border" else BorderCurve(mesh).corners
        if not len(found):
            raise MeshError(
                "the border has no corner between smooth stretches: whole hexagons leave it ragged "
                'or it is round; give points [[x, y, z], …], or "border" for all of it'
            )
        return np.unique(found)
    places = np.asarray(which, float).reshape(-1, 3)
    used = np.unique(mesh.corners)
    away, index = cKDTree(mesh.vertices[used]).query(places)
    size = mean_edge(mesh)
    bad = np.flatnonzero(~(away <= WITHIN * size))
    if len(bad):
        k = int(bad[np.argmax(away[bad])])
        near = mesh.vertices[used[index[k]]].round(3).tolist()
        raise MeshError(
            f"{len(bad)} of {len(places)} points have no vertex within {WITHIN:.0%} of an edge "
            f"({WITHIN * size:.3g}), worst {places[k].round(3).tolist()}: the nearest vertex is at "
            f"{near}, {away[k]:.4g} away; take places of vertices, in the unit of the mesh's file"
        )
    return np.unique(used[index])

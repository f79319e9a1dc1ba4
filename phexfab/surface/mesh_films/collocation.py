"""From least area on a mesh to the smooth film: every vertex on the minimal surface around it.

The triangles' least area puts vertices only to second order where the film is, with an error that
changes from vertex to vertex where the mesh does, so that curvatures taken from it need not
converge. Here each free vertex is asked to lie on the local minimal surface that is fitted to the
vertices around it, itself left out, the mean value property of a film. Newton on these equations
takes the vertices to the smooth film with the order of the local surfaces.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import SurfaceError
from phexfab.linalg import factorise
from phexfab.surface.mesh_films.atlas import Atlas, atlas_of_charts
from phexfab.surface.mesh_films.chart_fit import (
    Charts,
    fit,
    fit_or_lower,
    local_normal,
    start_charts,
)
from phexfab.surface.mesh_films.mirror import Held, reflected
from phexfab.surface.mesh_films.stencil import stencils, vertex_normals

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

STEPS = 16

SETTLED = 1e-6
"""Distance from the minimal surface around, over an edge, below which slow progress will do."""


@dataclass(frozen=True, eq=False)
class Collocated:
    """Vertices on the smooth film.

    Attributes
    ----------
    points : (n, 3) float, in mm
    atlas : Atlas
    moved : float
        The longest way of a vertex, mm.
    defect : float
        The largest distance left between a vertex and the minimal surface around it, over the
        mean length of its edges.
    steps : int
    """

    points: FloatArray
    atlas: Atlas
    moved: float
    defect: float
    steps: int
    rough: int


def collocate(
    points: FloatArray,
    triangles: IntArray,
    held: Held,
    name: str,
    near: Charts | None = None,
) -> Collocated:
    """Move the free vertices of a mesh of least area onto the smooth film.

    Parameters
    ----------
    points : (n, 3) float, in mm
    triangles : (m, 3) int
    held : Held
    name : str
    near : Charts, optional
        Those of the same mesh when its points were nearly the same, to start from.

    Raises
    ------
    SurfaceError
        If the mesh is too coarse for the film; the message names the place.
    """
    count = len(points)
    mesh = reflected(points, triangles, held)
    everywhere = mesh.points(points)
    stencil = stencils(everywhere, mesh.triangles, count)
    normals = vertex_normals(everywhere, mesh.triangles)
    charts = start_charts(everywhere, stencil, normals)
    if near is not None:
        charts = replace(near, origin=everywhere[:count], lift=np.zeros(count))
    # Sliding vertices move in their planes; by symmetry their charts' normals lie there already.
    free = np.flatnonzero(~held.fixed)
    rough = np.zeros(count, bool)
    start, worst, last, step_count = points, 0.0, np.inf, 0
    while True:
        if step_count:
            found = fit(charts, everywhere, stencil, through_vertex=False, low=rough)
        else:
            found, rough = fit_or_lower(charts, everywhere, stencil, through_vertex=False)
            free = free[~rough[free]]
        charts, influence = found.charts, found.influence
        top = local_normal(charts.coefficients[:, 0])
        rise = charts.lift * charts.scale * top[:, 2]
        size = np.abs(rise[free]) / stencil.size[free]
        worst = float(size.max(initial=0.0))
        if worst <= 1e-12 or (worst <= SETTLED and worst > 0.3 * last):
            break
        if step_count == STEPS and worst <= SETTLED:
            break
        if step_count == STEPS or worst > 2 * last:
            v = int(free[size.argmax()])
            raise SurfaceError(
                f"{name}: about {points[v].round(1).tolist()} the vertices do not settle on a "
                f"smooth film (off by {worst:.1e} of an edge); a finer mesh is needed there"
            )
        last = worst
        rows = np.repeat(np.arange(count), stencil.points.shape[1])
        weights = sp.csr_array(
            (influence.ravel(), (rows, mesh.source[stencil.points.ravel()])), shape=(count, count)
        )
        matrix = sp.eye_array(count, format="csr") - weights
        # The line of a vertex is its chart's normal, turned into space.
        lines = held.lines(np.einsum("ni,nij->nj", top, charts.frame))
        step = np.zeros(count)
        step[free] = factorise(matrix[free][:, free]).solve(rise[free])
        points = held.snapped(points + step[:, None] * lines)
        everywhere = mesh.points(points)
        charts = replace(charts, origin=everywhere[:count])
        step_count += 1
    charts = replace(charts, lift=np.zeros(count))
    final = fit(charts, everywhere, stencil, through_vertex=True, low=rough).charts
    whole = atlas_of_charts(name, final, stencil)
    moved = float(np.linalg.norm(points - start, axis=1).max(initial=0.0))
    return Collocated(points, whole, moved, worst, step_count, int(rough.sum()))

"""The three Gauss images of a lattice on a smooth minimal surface (thesis §4.4).

The Gauss image S decides the offset type: faces tangent to the unit sphere, edges tangent to it
(a Koebe mesh, from a circle packing), or vertices on it (from a hexagonal circle pattern). The
Gauss map of a minimal surface is conformal, and packings and patterns on a triangular lattice are
discrete conformal maps, so both are solved in the plane from the smooth radii and lifted.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import DesignError, SolveError
from phexfab.minimal.circles import CircleLaw, lay_out, solve_radii
from phexfab.minimal.sphere import (
    farthest_direction,
    lift_circles,
    rotation_to_north,
    stereographic,
)
from phexfab.parallel.rings import border_loops, face_rings
from phexfab.remesh.lattice import Lattice
from phexfab.surface.weierstrass import MinimalSurface
from phexfab.triangular import EQUILATERAL

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
KINDS = ("face", "edge", "vertex")
POLE_CLEARANCE = float(np.cos(np.radians(40)))


def gauss_image(
    surface: MinimalSurface, lattice: Lattice, parameters: ComplexArray, kind: str
) -> tuple[FloatArray, FloatArray]:
    """Return normals (F, 3) and heights (F,) of the Gauss image's face planes.

    Parameters
    ----------
    surface : MinimalSurface
    lattice : Lattice
    parameters : (F,) complex
        The surface's parameters z at the lattice points.
    kind : ``"face"``, ``"edge"`` or ``"vertex"``

    Raises
    ------
    DesignError
        For an unknown kind, or an edge type on a lattice that is not equilateral: a circle
        packing on a triangular lattice knows no other.
    SolveError
        If Newton fails, the pattern does not close around the ring, or the Gauss image covers
        the whole sphere.

    References
    ----------
    Thesis §4.4; Bobenko, Hoffmann, Springborn 2006.
    """
    if kind not in KINDS:
        raise DesignError(f"offset.type = {kind!r}: choose one of {', '.join(KINDS)}")
    normals = surface.normal(parameters)
    if kind == "face":
        return normals, np.ones(len(normals))
    if kind == "edge" and abs(lattice.row_ratio - EQUILATERAL) > 1e-9:
        raise DesignError(
            f"lattice.row_ratio = {lattice.row_ratio:g}: the edge type rests on a circle packing, "
            "which needs the equilateral lattice; leave row_ratio out, or choose offset.type = "
            '"face" or "vertex"'
        )
    # The surface's own chart where the normals stay clear of its pole: there the thesis' conformal
    # cases are exact.
    pole = np.array([0.0, 0.0, 1.0])
    if not lattice.closed and float((normals @ pole).max()) > POLE_CLEARANCE:
        pole = farthest_direction(normals)
    turn = rotation_to_north(pole)
    chart = stereographic(normals @ turn.T)
    # Conformal factor of w → chart: |dN| = √κ·… = |dw|·√κ, and |dN| = 2|dg|/(1 + |g|²).
    kappa = np.abs(surface.principal_curvatures(parameters)[..., 0]) * surface.scale
    stretch = np.sqrt(kappa) * (1 + np.abs(chart) ** 2) / 2
    tri = lattice.triangles
    if kind == "edge":
        law = CircleLaw(tri)
        logs = np.log(stretch * lattice.step / 2)
    else:
        crossing, radius = lattice_pattern(lattice)
        law = CircleLaw(tri, crossing)
        logs = np.log(stretch * radius)
    loops = border_loops(tri, face_rings(tri, len(normals))[0], len(normals))
    order = sorted(loops, key=lambda loop: float(np.abs(chart[loop]).mean()))
    logs = solve_radii(law, logs, holes=tuple(order[:-1]))
    centres, gap = lay_out(law, logs)
    if gap > 1e-8:
        raise SolveError(
            f"the circles do not close up around the ring (they miss by {gap:.1e} of a radius): "
            'this surface has no rotational symmetry; use offset.type = "face" for a closed ring'
        )
    # Similarity that fits the layout to the smooth Gauss map, in the least-squares sense.
    mean_c, mean_g = centres.mean(), chart.mean()
    factor = np.vdot(centres - mean_c, chart - mean_g) / np.vdot(centres - mean_c, centres - mean_c)
    fitted = mean_g + factor * (centres - mean_c)
    lifted, heights = lift_circles(fitted, np.abs(factor) * np.exp(logs))
    if heights.min() <= 0.0 or np.sum(lifted * (normals @ turn.T), axis=1).min() < 0.5:
        raise SolveError(
            f"the {kind}-type Gauss image strays from the smooth one; choose a finer lattice or a "
            "rectangle of parameters whose normals leave more of the sphere free"
        )
    return lifted @ turn, heights


def lattice_pattern(lattice: Lattice) -> tuple[FloatArray, float]:
    """Return crossing angles (V, 3) and radius of the circles around the lattice points.

    All circles have the circumradius of the lattice triangle, so three of them meet in every
    circumcentre; neighbours cross at π − 2A, A the angle opposite to their edge.
    """
    row = lattice.step
    apex = 2 * np.arctan2(0.5, lattice.row_ratio)
    base = (np.pi - apex) / 2
    radius = row / (2 * np.sin(apex))
    # Row edges are the first edge of upward and the second of downward triangles.
    crossing = np.full(lattice.triangles.shape, np.pi - 2 * base)
    upward = lattice.upward
    crossing[upward, 0] = np.pi - 2 * apex
    crossing[~upward, 1] = np.pi - 2 * apex
    return crossing, float(radius)

"""The three Gauss images of a lattice on a smooth minimal surface (thesis §4.4).

The Gauss image S decides the offset type: faces tangent to the unit sphere, edges tangent to it
(a Koebe mesh, from a circle packing), or vertices on it (from a hexagonal circle pattern). The
Gauss map of a minimal surface is conformal, and packings and patterns on a triangular lattice are
discrete conformal maps, so both are solved in the plane from the smooth radii and lifted.

Around an umbilic of order m the Gauss map winds m + 1 times, and so does the branched pattern; the
layout has several sheets there, and every circle is compared with its own smooth normal. Around
holes the pattern is made to close (``closing``). Where no plane has room, because the surface has
handles or its normals cover the sphere, circles are found on the sphere itself (``immersed``).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from phexfab.errors import DesignError, SolveError
from phexfab.minimal.circles import CircleLaw, cone_targets
from phexfab.minimal.closing import REMEDY, chart_angles, plain_borders, solve_closed
from phexfab.minimal.immersed import immersed_circles
from phexfab.minimal.sphere import (
    farthest_direction,
    lift_circles,
    rotation_to_north,
    stereographic,
)
from phexfab.parallel.rings import face_rings
from phexfab.remesh.lattice import Lattice
from phexfab.surface.weierstrass import MinimalSurface
from phexfab.triangular import EQUILATERAL

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
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
        If Newton fails, or the lattice does not wind around umbilics as the Gauss map does.

    References
    ----------
    Thesis §4.4; Bobenko, Hoffmann, Springborn 2006.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> on = px.lattice_on(surface, panel_size=500.0)
    >>> normals, heights = px.gauss_image(surface, on, surface.parameter(on.points), "edge")
    >>> normals.shape == (len(on.points), 3)
    True
    >>> bool(heights.max() < 1)  # planes of circles on the unit sphere
    True
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
    _require_regular(lattice, kind)
    tri = lattice.triangles
    targets = cone_targets(tri, len(normals))
    cycles = plain_borders(tri, len(normals))
    # The surface's own chart where the normals stay clear of its pole: there the thesis' conformal
    # cases are exact.
    pole = np.array([0.0, 0.0, 1.0])
    ring = lattice.closed and lattice.parameters is None
    if not ring and float((normals @ pole).max()) > POLE_CLEARANCE:
        pole = farthest_direction(normals)
    turn = rotation_to_north(pole)
    # Conformal factor of w → sphere: |dN| = √κ·… = |dw|·√κ.
    kappa = np.abs(surface.principal_curvatures(parameters)[..., 0]) * surface.scale
    law, radius = CircleLaw(tri), lattice.step / 2
    if kind == "vertex":
        crossing, radius = lattice_pattern(lattice)
        law = CircleLaw(tri, crossing)
    radii = np.sqrt(kappa) * radius
    if lattice.density is not None:
        with np.errstate(divide="ignore", invalid="ignore"):
            radii = radii / lattice.density
    branched = targets > 2 * np.pi
    if not cycles or _covers_pole(normals @ turn.T, lattice):
        # No plane has room for these circles: on the sphere itself.
        lifted, heights = immersed_circles(law, normals, _spread(radii, law, normals, branched))
        return _near_smooth(lifted, heights, normals, kind), heights
    chart = stereographic(normals @ turn.T)
    _require_branching(chart, lattice, targets)
    # … and on to the chart: |dN| = 2|dg|/(1 + |g|²).
    shrunk = radii * (1 + np.abs(chart) ** 2) / 2
    radii = _spread(shrunk, law, np.column_stack([chart.real, chart.imag]), branched)
    logs, centres, gap = solve_closed(law, np.log(radii), targets, cycles, chart)
    if gap > 1e-8:
        raise SolveError(
            f"the {kind}-type circles do not close up (they miss by {gap:.1e} of a radius); "
            f"choose a finer lattice, or {REMEDY}"
        )
    # Similarity that fits the layout to the smooth Gauss map, in the least-squares sense.
    mean_c, mean_g = centres.mean(), chart.mean()
    factor = np.vdot(centres - mean_c, chart - mean_g) / np.vdot(centres - mean_c, centres - mean_c)
    fitted = mean_g + factor * (centres - mean_c)
    lifted, heights = lift_circles(fitted, np.abs(factor) * np.exp(logs))
    return _near_smooth(lifted @ turn, heights, normals, kind), heights


def _near_smooth(
    found: FloatArray, heights: FloatArray, normals: FloatArray, kind: str
) -> FloatArray:
    """Return the normals that were found; refuse them far from the smooth ones."""
    if heights.min() <= 0.0 or np.sum(found * normals, axis=1).min() < 0.5:
        raise SolveError(
            f"the {kind}-type Gauss image strays from the smooth one; choose a finer lattice or a "
            f"smaller piece of the surface, or {REMEDY}"
        )
    return found


def _spread(
    radii: FloatArray, law: CircleLaw, places: FloatArray, branched: BoolArray
) -> FloatArray:
    """Return the radii, at umbilics (where the smooth ones vanish) and around them mended.

    Two circles of radii r, s whose centres are d apart cross at φ for d² = r² + s² + 2rs cos φ.
    Neighbours of an umbilic are so large that they meet each other, the umbilic's so that it meets
    them. Inside the lattice this is a start only; on its border these radii stay.
    """
    tri, n = law.triangles, len(radii)
    cosine = np.ones(tri.shape) if law.crossing is None else np.cos(law.crossing)
    tail, head = tri.ravel(), tri[:, [1, 2, 0]].ravel()
    usable = np.isfinite(radii) & (radii > 0) & ~branched

    def mean(place: IntArray, values: FloatArray) -> FloatArray:
        total = np.bincount(place, values, minlength=n)
        return np.asarray(total / np.maximum(np.bincount(place, minlength=n), 1))

    both = np.concatenate([tail, head]), np.concatenate([head, tail])
    near = usable[both[1]]
    level = mean(both[0][near], radii[both[1][near]])
    usable &= radii > 0.01 * level
    if usable.all():
        return radii
    distance = np.linalg.norm(places[tail] - places[head], axis=1)
    apex = ~usable[tri[:, [2, 0, 1]].ravel()] & usable[tail] & usable[head]
    equal = distance[apex] / np.sqrt(2 + 2 * cosine.ravel()[apex])
    pairs = np.concatenate([tail[apex], head[apex]])
    mended = mean(pairs, np.concatenate([equal, equal]))
    out = np.where(mended > 0, mended, radii)

    here, there = (end[usable[both[1]] & ~usable[both[0]]] for end in both)
    crossing = np.concatenate([cosine, cosine]).ravel()[usable[both[1]] & ~usable[both[0]]]
    s = out[there]
    root = np.sum((places[here] - places[there]) ** 2, axis=1) - s**2 * (1 - crossing**2)
    meeting = mean(here, np.sqrt(np.maximum(root, 0)) - s * crossing)
    return np.where(usable, out, np.clip(meeting, 0.1 * level, level))


def _require_regular(lattice: Lattice, kind: str) -> None:
    """Refuse the spacing functions of a graded rectangle: circles know no stretched lattice."""
    if lattice.parameters is not None:
        return
    up = lattice.triangles[lattice.upward]
    row = np.abs(lattice.points[up[:, 1]] - lattice.points[up[:, 0]]) / lattice.step
    # Around a ring an edge may cross the seam.
    if np.abs(row[row < 1.9] - 1).max(initial=0.0) > 1e-6:
        raise DesignError(
            f'offset.type = "{kind}" rests on circles, which need evenly spaced lattice rows; set '
            'lattice.evenness = 0, or choose offset.type = "face"'
        )


def _covers_pole(normals: FloatArray, lattice: Lattice) -> bool:
    """Return whether a Gauss image covers the north pole, which a chart must leave free."""
    a, b, c = (normals[lattice.triangles[:, k], :2] for k in range(3))
    high = normals[lattice.triangles, 2].min(axis=1) > 0.0
    sides = [p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0] for p, q in ((a, b), (b, c), (c, a))]
    over = high & ((np.min(sides, axis=0) >= 0) | (np.max(sides, axis=0) <= 0))
    return bool(over.any())


def _require_branching(chart: ComplexArray, lattice: Lattice, targets: FloatArray) -> None:
    """Refuse a lattice whose rings do not wind as often as the smooth Gauss map does.

    On a coarse lattice the smooth images of three neighbours may lie the wrong way around. Such a
    triangle takes one turn from the sum over its corners, 2π, and nothing is wrong with the
    lattice: so turns are counted over all faces that hang together by these triangles.
    """
    tri = lattice.triangles
    angle = chart_angles(tri, chart)
    panels = face_rings(tri, len(chart))[0]
    off = np.bincount(tri.ravel(), angle.ravel(), minlength=len(chart)) - targets
    turns = np.zeros(len(chart))
    turns[panels] = np.round(off[panels] / (2 * np.pi))
    lost = ~np.isfinite(off)
    turns[lost] = -1.0  # two neighbours with one normal
    over = tri[angle.sum(axis=1) < 0]
    links = coo_array(
        (np.ones(3 * len(over)), (over.ravel(), np.roll(over, 1, axis=1).ravel())),
        shape=(len(chart), len(chart)),
    )
    part = connected_components(links, directed=False)[1]
    total = np.bincount(part, turns) + np.bincount(part[over[:, 0]], minlength=part.max() + 1)
    # What hangs together with a border face, whose turns are not known, is left to the solution.
    open_part = np.zeros(len(total), bool)
    inside = np.zeros(len(chart), bool)
    inside[panels] = True
    open_part[part[over[~inside[over]]]] = True
    wrong = panels[(turns[panels] != 0) & (total != 0)[part[panels]] & ~open_part[part[panels]]]
    if len(wrong):
        face = int(wrong[0])
        asked = targets[face] / (2 * np.pi)
        found = max(asked + float(total[part[face]]), 0.0)
        raise SolveError(
            f"around face {face} of the lattice the Gauss map winds {found:.0f} times where the "
            f"lattice asks for {asked:.0f}: an umbilic is missing there, or the lattice is too "
            f"coarse; choose a finer lattice, or {REMEDY}"
        )


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

"""First triangle meshes between rims: discs, strips, domains with holes in plane or sphere."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull, Delaunay, QhullError, cKDTree

from phexfab.errors import SurfaceError
from phexfab.linalg import factorise
from phexfab.surface.mesh_films.area import stiffness
from phexfab.surface.mesh_films.strip import strip
from phexfab.surface.mesh_films.triangulated import border_loops
from phexfab.surface.rims.rim import Rim

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class StartMesh:
    """A mesh that the rims bound.

    Attributes
    ----------
    points : (n, 3) float, in mm
    triangles : (m, 3) int
        The first rim is run along in its own direction, its triangles on the left.
    rim_of : (n,) int
        The rim that a vertex lies on; -1 inside.
    parameter : (n,) float
        The parameter on that rim; nan inside.
    """

    points: FloatArray
    triangles: IntArray
    rim_of: IntArray
    parameter: FloatArray


def start_mesh(rims: tuple[Rim, ...], edge: float) -> StartMesh:
    """Return a first mesh between rims.

    One rim is filled by a disc, two are joined by a strip. Three and more are taken to the plane
    of least squares, or to a sphere about their middle, where they have to be apart.

    Parameters
    ----------
    rims : tuple of Rim
    edge : float
        Length of edges to aim at, mm.

    Raises
    ------
    SurfaceError
        If there is no rim, an edge length is unfit, or the rims lie in each other's way.
    """
    if not rims:
        raise SurfaceError("a film needs at least one rim")
    length = max(rim.length for rim in rims)
    if not 0 < edge <= length / 8:
        raise SurfaceError(
            f"edge = {edge:g} mm: for a longest rim of {length:.0f} mm take one between 0 and "
            f"{length / 8:.0f} mm"
        )
    samples = [_sampled(rim, edge) for rim in rims]
    if len(rims) == 1:
        return _oriented(_disc(rims[0], *samples[0], edge), samples)
    if len(rims) == 2:
        return _oriented(strip(samples, edge), samples)
    return _oriented(_holed(rims, samples, edge), samples)


def _sampled(rim: Rim, edge: float) -> tuple[FloatArray, FloatArray]:
    count = max(12, 3 * max(len(rim.corners), 1), int(np.ceil(rim.length / edge)))
    return rim.samples(count)


def _oriented(
    mesh: tuple[FloatArray, IntArray], samples: list[tuple[FloatArray, FloatArray]]
) -> StartMesh:
    """Name the rim vertices, which come first, rim by rim, and turn the mesh to the first rim."""
    points, triangles = mesh
    counts = [len(t) for t, _ in samples]
    rim_of = np.full(len(points), -1, np.int64)
    rim_of[: sum(counts)] = np.repeat(np.arange(len(counts)), counts)
    parameter = np.full(len(points), np.nan)
    parameter[: sum(counts)] = np.concatenate([t for t, _ in samples])
    follows = (triangles == 0) & (np.roll(triangles, -1, axis=1) == 1)
    if not follows.any():
        triangles = triangles[:, ::-1].copy()
    return StartMesh(points, triangles, rim_of, parameter)


# -- one rim -------------------------------------------------------------------------------------


def _disc(rim: Rim, t: FloatArray, points: FloatArray, edge: float) -> tuple[FloatArray, IntArray]:
    _, centre, normal = rim.planar()
    flat = (points - centre) @ _plane_axes(normal).T
    try:
        return _filled_plane([flat], [points], edge)
    except _NoPlaneError:
        # Not simple from above: the disc of the rim's own length.
        radius = rim.length / (2 * np.pi)
        angle = 2 * np.pi * rim.arc_length(t) / rim.length
        circle = radius * np.column_stack([np.cos(angle), np.sin(angle)])
        return _filled_plane([circle], [points], edge)


def _plane_axes(normal: FloatArray) -> FloatArray:
    other = np.eye(3)[np.abs(normal).argmin()]
    first = np.cross(other, normal)
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


class _NoPlaneError(Exception):
    """Curves cross in the plane."""


def _filled_plane(
    curves: list[FloatArray], points: list[FloatArray], edge: float
) -> tuple[FloatArray, IntArray]:
    """Triangulate the domain between plane curves, the largest outside, and lift it to space."""
    import shapely

    rings = [shapely.Polygon(curve) for curve in curves]
    outer = int(np.argmax([abs(ring.area) for ring in rings]))
    holes = [ring for k, ring in enumerate(rings) if k != outer]
    apart = all(ring.is_valid and ring.area > 0 for ring in rings)
    apart = apart and all(rings[outer].contains_properly(hole) for hole in holes)
    apart = apart and all(a.disjoint(b) for i, a in enumerate(holes) for b in holes[:i])
    if not apart:
        raise _NoPlaneError
    domain = shapely.Polygon(curves[outer], [np.asarray(hole.exterior.coords) for hole in holes])
    border = np.concatenate(curves)
    low, high = border.min(axis=0), border.max(axis=0)
    columns = np.arange(low[0], high[0] + edge, edge)
    rows = np.arange(low[1], high[1] + edge, edge * np.sqrt(3) / 2)
    x, y = np.meshgrid(columns, rows)
    x = x + 0.5 * edge * (np.arange(len(rows)) % 2)[:, None]
    grid = np.column_stack([x.ravel(), y.ravel()])
    shapely.prepare(domain)
    grid = grid[shapely.contains_xy(domain, grid[:, 0], grid[:, 1])]
    gap = shapely.distance(shapely.points(grid), domain.boundary) if len(grid) else np.zeros(0)
    everything = np.concatenate([border, grid[gap > 0.6 * edge]])
    triangles = Delaunay(everything).simplices.astype(np.int64)
    middle = everything[triangles].mean(axis=1)
    triangles = triangles[shapely.contains_xy(domain, middle[:, 0], middle[:, 1])]
    a, b, c = (everything[triangles[:, k]] for k in range(3))
    turn = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles[turn < 0] = triangles[turn < 0][:, ::-1]
    triangles = triangles[np.abs(turn) > 1e-6 * edge**2]
    _check_border(triangles, [len(curve) for curve in curves])
    flat = np.column_stack([everything, np.zeros(len(everything))])
    return _lifted(flat, triangles, np.concatenate(points)), triangles


def _check_border(triangles: IntArray, counts: list[int]) -> None:
    """Refuse a triangulation whose border is not exactly the curves."""
    found = [sorted(loop.tolist()) for loop in border_loops(triangles)]
    ends = np.concatenate([[0], np.cumsum(counts)])
    wanted = [list(range(a, b)) for a, b in pairwise(ends)]
    if found != wanted:
        raise SurfaceError(
            "the rims come so close to each other or to themselves that edges of the asked length "
            "cannot follow them; lower the edge length"
        )


def _lifted(flat: FloatArray, triangles: IntArray, rim_points: FloatArray) -> FloatArray:
    """Return space positions: given on the rims, harmonic on the flat mesh between them."""
    matrix = stiffness(flat, triangles)
    k = len(rim_points)
    out = np.empty((len(flat), 3))
    out[:k] = rim_points
    if len(flat) > k:
        out[k:] = factorise(matrix[k:][:, k:]).solve(-(matrix[k:][:, :k] @ rim_points))
    return out


# -- three rims and more -------------------------------------------------------------------------


def _holed(
    rims: tuple[Rim, ...], samples: list[tuple[FloatArray, FloatArray]], edge: float
) -> tuple[FloatArray, IntArray]:
    curves = [points for _, points in samples]
    everything = np.concatenate(curves)
    centre = everything.mean(axis=0)
    normal = np.linalg.svd(everything - centre, full_matrices=False)[2][2]
    try:
        flat = [(points - centre) @ _plane_axes(normal).T for points in curves]
        return _filled_plane(flat, curves, edge)
    except _NoPlaneError:
        pass
    centre = np.mean([curve.mean(axis=0) for curve in curves], axis=0)
    found = _filled_sphere(curves, centre, edge)
    if found is None:
        names = ", ".join(rim.name for rim in rims)
        raise SurfaceError(
            f"the rims {names} are neither apart in their common plane nor seen from their "
            "middle; give a mesh of the film as a start"
        )
    return found


def _filled_sphere(
    curves: list[FloatArray], centre: FloatArray, edge: float
) -> tuple[FloatArray, IntArray] | None:
    """Triangulate the sphere outside the caps that the rims cover, seen from a middle."""
    seen = [curve - centre for curve in curves]
    distance = [np.linalg.norm(ray, axis=1) for ray in seen]
    if min(d.min() for d in distance) < 1e-6 * max(d.max() for d in distance):
        return None
    rays = [ray / d[:, None] for ray, d in zip(seen, distance, strict=True)]
    poles = [ray.mean(axis=0) for ray in rays]
    if min(np.linalg.norm(pole) for pole in poles) < 0.05:
        return None
    poles = [pole / np.linalg.norm(pole) for pole in poles]
    # Spacing on the sphere: that of the rims, which are what has to be followed.
    chord = np.array([np.linalg.norm(np.diff(ray, axis=0), axis=1).mean() for ray in rays]).mean()
    fill = _spread(int(np.ceil(4 * np.pi / (chord**2 * np.sqrt(3) / 2))))
    keep = np.ones(len(fill), bool)
    caps = []
    for ray, pole in zip(rays, poles, strict=True):
        if (ray @ pole).min() <= 0.0:
            return None  # more than half the sphere away from the cap's own pole
        axes = _plane_axes(pole)
        outline = (ray @ axes.T) / (ray @ pole)[:, None]
        caps.append((outline, axes, pole))
        keep &= ~_covered(fill, *caps[-1])
        near, _ = cKDTree(ray).query(fill)
        keep &= near > 0.6 * chord
    for k, ray in enumerate(rays):
        if any(_covered(ray, *cap).any() for j, cap in enumerate(caps) if j != k):
            return None
    border = np.concatenate(rays)
    everything = np.concatenate([border, fill[keep]])
    try:
        triangles = ConvexHull(everything).simplices.astype(np.int64)
    except QhullError:
        return None
    corner = everything[triangles]
    outward = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    middle = corner.mean(axis=1)
    inward = (outward * middle).sum(1) < 0
    triangles[inward] = triangles[inward][:, ::-1]
    inside = np.zeros(len(triangles), bool)
    for cap in caps:
        inside |= _covered(middle / np.linalg.norm(middle, axis=1, keepdims=True), *cap)
    triangles = triangles[~inside]
    if (np.bincount(triangles.ravel(), minlength=len(everything)) == 0).any():
        return None
    _check_border(triangles, [len(curve) for curve in curves])
    return _lifted(everything, triangles, np.concatenate(curves)), triangles


def _spread(n: int) -> FloatArray:
    """Return n points evenly on the unit sphere, along a golden spiral."""
    k = np.arange(n) + 0.5
    z = 1 - 2 * k / n
    turn = np.pi * (1 + np.sqrt(5)) * k
    radius = np.sqrt(1 - z * z)
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), z])


def _covered(
    rays: FloatArray, outline: FloatArray, axes: FloatArray, pole: FloatArray
) -> NDArray[np.bool_]:
    """Return whether rays pass through a cap, given by its outline in the plane at its pole."""
    import shapely

    depth = rays @ pole
    with np.errstate(all="ignore"):
        place = (rays @ axes.T) / depth[:, None]
    polygon = shapely.Polygon(outline)
    shapely.prepare(polygon)
    ahead = depth > 0
    inside = np.zeros(len(rays), bool)
    inside[ahead] = shapely.contains_xy(polygon, place[ahead, 0], place[ahead, 1])
    return inside

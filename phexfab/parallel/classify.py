"""Is a mesh circular, conical, Koebe, quasi-circular; which offsets does it allow.

Residuals are per face, edge or vertex and free of scale, 0 where the property holds.

References
----------
Thesis §4.4, 5.3.1, 6.1–6.3; Pottmann et al. 2007, "Geometry of multi-layer freeform structures";
Liu et al. 2006, "Geometric modeling with conical meshes and developable surfaces".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.mesh.measures import edges, face_normals, relative_planarity
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.pairs import worst_edge
from phexfab.parallel.space import ParallelSpace, parallel_space
from phexfab.parallel.sphere_fit import SphereFit, fit_to_sphere, sphere_miss

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

_ONE_PLANE = 1e-12  # spread of normals that are one to rounding
_ONE_LINE = 1e-9  # sine of a cone's opening below which its planes share a line


def _flat(mesh: PolyMesh) -> tuple[FloatArray, FloatArray]:
    """Return corners (C, 2) in their faces' planes about the mean corner, and sizes (F,)."""
    normals = face_normals(mesh)
    points = mesh.vertices[mesh.corners]
    middle = np.add.reduceat(points, mesh.starts[:-1]) / mesh.sides[:, None]
    local = points - middle[mesh.face_of_corner]
    x = points[mesh.next_corner][mesh.starts[:-1]] - points[mesh.starts[:-1]]
    x = x - np.einsum("ij,ij->i", x, normals)[:, None] * normals
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(normals, x)
    owner = mesh.face_of_corner
    flat = np.column_stack(
        [np.einsum("ij,ij->i", local, x[owner]), np.einsum("ij,ij->i", local, y[owner])]
    )
    size = np.sqrt(np.add.reduceat((flat**2).sum(axis=1), mesh.starts[:-1]) / mesh.sides)
    return flat, size


def _least_squares(mesh: PolyMesh, rows: FloatArray, right: FloatArray) -> FloatArray:
    """Return (F, n) solutions of every face's system, one row (C, n) for each corner."""
    begin, owner = mesh.starts[:-1], mesh.face_of_corner
    normal = np.add.reduceat(rows[:, :, None] * rows[:, None, :], begin)
    inverse = np.linalg.pinv(normal, rcond=1e-13, hermitian=True)
    solution = np.zeros((mesh.n_faces, rows.shape[1]))
    for _ in range(2):  # once more for the digits that the normal equations lose
        rest = right - np.einsum("cj,cj->c", rows, solution[owner])
        solution += np.einsum("fij,fj->fi", inverse, np.add.reduceat(rows * rest[:, None], begin))
    return solution


def circularity(mesh: PolyMesh) -> FloatArray:
    """Return (F,) how far a face's corners are off a common circle, over the face's size.

    The largest difference of a corner's distance from the least-squares circle's centre to the
    radius; 0 for triangles.

    References
    ----------
    Thesis §4.4.1.
    """
    flat, size = _flat(mesh)
    flat = flat / size[mesh.face_of_corner][:, None]
    rows = np.column_stack([2 * flat, np.ones(len(flat))])
    circle = _least_squares(mesh, rows, (flat**2).sum(axis=1))
    centre = circle[:, :2]
    radius = np.sqrt(np.maximum(circle[:, 2] + (centre**2).sum(axis=1), 0.0))
    away = np.linalg.norm(flat - centre[mesh.face_of_corner], axis=1)
    return np.maximum.reduceat(np.abs(away - radius[mesh.face_of_corner]), mesh.starts[:-1])


def quasi_circularity(mesh: PolyMesh) -> FloatArray:
    """Return (F,) how far a face is from being parallel to a circular polygon, in degrees.

    For an even number of sides the corner angles with even and with odd number must have the same
    sum; parallel edges may be flipped, so it counts modulo 180°. Faces with an odd number of sides
    are always parallel to a circular polygon: 0. A disc whose faces are all quasi-circular has a
    vertex offset; around holes this is only necessary.

    References
    ----------
    Thesis §5.3.1, 6.1.
    """
    flat, _ = _flat(mesh)
    along = flat[mesh.next_corner] - flat
    angle = np.arctan2(along[:, 1], along[:, 0])
    place = np.arange(len(flat)) - mesh.starts[:-1][mesh.face_of_corner]
    total = np.add.reduceat(np.where(place % 2, -angle, angle), mesh.starts[:-1])
    off = np.abs(total - np.pi * np.round(total / np.pi))
    return np.where(mesh.sides % 2, 0.0, np.degrees(off))


def conicality(mesh: PolyMesh) -> FloatArray:
    """Return (V,) how far the planes at a vertex are from touching one cone of revolution.

    They do where their faces' unit normals make one angle with an axis, that is, lie on a circle of
    the sphere that is not a great circle. The measure is the largest distance of a normal to their
    least-squares plane, over the normals' mean distance from their mean; 1 where that plane goes
    through the sphere's centre: planes through one line have no cone and no common offset. Three
    planes or fewer touch one cone unless they share a line.

    At a vertex of four faces with corners below 180° it vanishes just where opposite corners have
    the same sum. Where a corner is greater the planes may touch a cone though sums differ.

    References
    ----------
    Thesis §4.4.3; Liu et al. 2006, sec. 3; Wang, Wallner, Liu 2007, "An angle criterion for conical
    mesh vertices".
    """
    order = np.argsort(mesh.corners, kind="stable")
    vertex = mesh.corners[order]
    normals = face_normals(mesh)[mesh.face_of_corner[order]]
    used, begin = np.unique(vertex, return_index=True)
    count = np.diff(np.append(begin, len(vertex)))
    owner = np.repeat(np.arange(len(used)), count)
    mean = np.add.reduceat(normals, begin) / count[:, None]
    local = normals - mean[owner]
    spread = np.add.reduceat(local[:, :, None] * local[:, None, :], begin)
    axis = np.linalg.eigh(spread)[1][:, :, 0]
    off = np.maximum.reduceat(np.abs(np.einsum("ij,ij->i", local, axis[owner])), begin)
    size = np.add.reduceat(np.linalg.norm(local, axis=1), begin) / count
    result = np.zeros(len(mesh.vertices))
    # Planes that agree to rounding touch every flat cone.
    some = (count > 3) & (size > _ONE_PLANE)
    result[used[some]] = off[some] / size[some]
    line = np.abs(np.einsum("ij,ij->i", mean, axis)) < _ONE_LINE
    result[used[line & (count > 2) & (size > _ONE_PLANE)]] = 1.0
    return result


@dataclass(frozen=True, eq=False)
class KoebeResidual:
    """How far a mesh is from a Koebe mesh, edges touching the unit sphere.

    Attributes
    ----------
    edges : (E,) float array
        Distance of each edge's line from the unit sphere.
    incircles : (F,) float array
        How far each face's edges are from touching one circle, over the face's size.
    touching : (E,) float array
        Distance of the points in which the incircles of an edge's two faces touch it, over its
        length; 0 on the border. Independent of where the sphere is.
    """

    edges: FloatArray
    incircles: FloatArray
    touching: FloatArray


def koebe_residual(mesh: PolyMesh) -> KoebeResidual:
    """Measure whether the edges touch the unit sphere, and the incircles each other.

    References
    ----------
    Thesis §4.4.2, 6.2.
    """
    flat, size = _flat(mesh)
    owner = mesh.face_of_corner
    flat = flat / size[owner][:, None]
    along = flat[mesh.next_corner] - flat
    length = np.linalg.norm(along, axis=1)
    along = along / length[:, None]
    outward = np.column_stack([along[:, 1], -along[:, 0]])
    height = np.einsum("ij,ij->i", flat, outward)
    circle = _least_squares(mesh, np.column_stack([outward, np.ones(len(flat))]), height)
    centre, radius = circle[owner, :2], circle[owner, 2]
    off = np.abs(np.einsum("ij,ij->i", outward, centre) + radius - height)
    place = np.einsum("ij,ij->i", centre - flat, along) / length  # 0 at the corner, 1 at the next
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    place = np.where(tail < head, place, 1 - place)
    pairs = edges(mesh)
    n = len(mesh.vertices)
    key = np.minimum(tail, head) * n + np.maximum(tail, head)
    edge = np.searchsorted(pairs[:, 0] * n + pairs[:, 1], key)
    least, most = np.full(len(pairs), np.inf), np.full(len(pairs), -np.inf)
    np.minimum.at(least, edge, place)
    np.maximum.at(most, edge, place)
    return KoebeResidual(
        sphere_miss(mesh, "edge"), np.maximum.reduceat(off, mesh.starts[:-1]), most - least
    )


@dataclass(frozen=True, eq=False)
class MeshClass:
    """Which offsets a mesh allows: how well a parallel mesh touches the unit sphere.

    Attributes
    ----------
    kind : str or None
        The type to take: of edge and vertex the one within the tolerance that fits better (edge
        when both do to rounding, as on rotational meshes), else face where it is within (for
        simple meshes it always is), else None.
    kinds : tuple of str
        All types within the tolerance.
    fits : dict
        ``SphereFit`` per type: the Gauss image S, its largest and mean miss.
    sine : float
        Largest sine between edges of M and of the three S. Rounding for planar faces; with printed
        digits it shows what the edges are off the planes' lines.
    planarity : float
        Largest planarity of a face over the mean edge.
    quasi_circular : float
        Largest angle defect of a face, degrees.
    conical : float
        Largest conicality of a vertex.
    tolerance : float
        What was used.
    dimension : int
        Of P(M), translations included.
    """

    kind: str | None
    kinds: tuple[str, ...]
    fits: dict[str, SphereFit]
    sine: float
    planarity: float
    quasi_circular: float
    conical: float
    tolerance: float
    dimension: int


def classify_mesh(
    mesh: PolyMesh, tolerance: float | None = None, space: ParallelSpace | None = None
) -> MeshClass:
    """Say which offset types a mesh allows, each with its Gauss image and residual.

    Parameters
    ----------
    mesh : PolyMesh
        Planar faces; any number of sides, any valence.
    tolerance : float, optional
        Largest miss of the unit sphere. By default 1e-11, or the mesh's own relative planarity
        where that is more: what is not known cannot be told apart, and on a fine mesh the three
        types differ by little.
    space : ParallelSpace, optional
        P(M) when it is at hand.

    References
    ----------
    Thesis §4.4, ch. 6.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=700.0), "edge")
    >>> px.classify_mesh(shell.mesh).kinds  # simple meshes always have a face offset
    ('edge', 'face')
    """
    flatness = float(relative_planarity(mesh).max())
    limit = max(1e-11, flatness) if tolerance is None else tolerance
    if space is None:
        space = parallel_space(mesh, tolerance=max(1e-8, 10 * flatness))
    fits = {kind: fit_to_sphere(space, kind) for kind in ("vertex", "edge", "face")}
    kinds = tuple(kind for kind, fit in fits.items() if fit.worst <= limit)
    # Below rounding nothing is better than another; ties go to the edge type, by name.
    best = sorted((max(fits[kind].mean, 1e-13), kind) for kind in kinds if kind != "face")
    kind = best[0][1] if best else ("face" if "face" in kinds else None)
    sine = max(worst_edge(mesh, fit.gauss)[0] for fit in fits.values())
    return MeshClass(
        kind,
        kinds,
        fits,
        sine,
        flatness,
        float(quasi_circularity(mesh).max()),
        float(conicality(mesh).max()),
        limit,
        space.dimension,
    )

"""Two meshes of the same faces: parallel or not, edge ratios, blends, offsets and Gauss images.

Everything here takes any pair of polygon meshes with the same ``corners`` and ``starts``; edges are
in the order of ``phexfab.mesh.measures.edges``.

References
----------
Thesis §4.1–4.3; Pottmann et al. 2007, "Geometry of multi-layer freeform structures", sec. 2–3.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import MeshError, OffsetLimitError
from phexfab.mesh.measures import edges, face_normals
from phexfab.mesh.polymesh import PolyMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

KINDS = ("vertex", "edge", "face")


def same_faces(mesh: PolyMesh, other: PolyMesh) -> bool:
    """Return whether two meshes have the same faces, corner by corner, and as many vertices."""
    return (
        len(mesh.vertices) == len(other.vertices)
        and np.array_equal(mesh.starts, other.starts)
        and np.array_equal(mesh.corners, other.corners)
    )


def require_same_faces(mesh: PolyMesh, other: PolyMesh) -> None:
    """Raise ``MeshError`` unless two meshes have the same faces; the message says what differs."""
    if same_faces(mesh, other):
        return
    raise MeshError(
        f"the two meshes do not correspond: {len(mesh.vertices)} vertices and {mesh.n_faces} faces "
        f"against {len(other.vertices)} and {other.n_faces}, corner by corner; export both from "
        "the same mesh, in the same order"
    )


def _edge_vectors(mesh: PolyMesh, pairs: IntArray) -> FloatArray:
    return np.asarray(mesh.vertices[pairs[:, 1]] - mesh.vertices[pairs[:, 0]])


def parallelism(mesh: PolyMesh, other: PolyMesh) -> FloatArray:
    """Return (E,) sines of the angle between corresponding edges.

    An edge without length is parallel to every other: its sine is 0.

    Raises
    ------
    MeshError
        If the meshes do not have the same faces.
    """
    require_same_faces(mesh, other)
    pairs = edges(mesh)
    one, two = _edge_vectors(mesh, pairs), _edge_vectors(other, pairs)
    lengths = np.linalg.norm(one, axis=1) * np.linalg.norm(two, axis=1)
    cross = np.linalg.norm(np.cross(one, two), axis=1)
    return np.divide(cross, lengths, out=np.zeros(len(pairs)), where=lengths > 0)


def worst_edge(mesh: PolyMesh, other: PolyMesh) -> tuple[float, tuple[int, int]]:
    """Return the largest sine between corresponding edges, and that edge's two vertices."""
    sines = parallelism(mesh, other)
    if not len(sines):
        raise MeshError("the mesh has no face, so no edge can be compared")
    worst = int(np.argmax(sines))
    i, j = edges(mesh)[worst]
    return float(sines[worst]), (int(i), int(j))


def is_parallel(mesh: PolyMesh, other: PolyMesh, tolerance: float = 1e-9) -> bool:
    """Return whether ``other`` is a member of P(M): the same faces, all edges parallel.

    Parameters
    ----------
    mesh, other : PolyMesh
    tolerance : float
        Largest sine of the angle between two corresponding edges. ``worst_edge`` names the worst.

    References
    ----------
    Thesis §4.1.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> px.is_parallel(shell.mesh, px.offset(shell, -90.0).mesh)
    True
    """
    return same_faces(mesh, other) and bool(
        (parallelism(mesh, other) <= tolerance).all()  # not a number is not parallel
    )


def ratios(mesh: PolyMesh, other: PolyMesh) -> FloatArray:
    """Return (E,) signed ratios of the edges of ``other`` to those of ``mesh``.

    Negative where the edge is flipped. Exact for parallel meshes; else the ratio of the
    projection onto M's edge.

    Raises
    ------
    MeshError
        If the faces differ, or an edge of ``mesh`` has no length.
    """
    require_same_faces(mesh, other)
    pairs = edges(mesh)
    one, two = _edge_vectors(mesh, pairs), _edge_vectors(other, pairs)
    square = np.einsum("ij,ij->i", one, one)
    if not square.all():
        i, j = pairs[int(np.argmin(square))]
        raise MeshError(f"edge {i}-{j} has no length, so no ratio; weld the mesh first")
    return np.asarray(np.einsum("ij,ij->i", one, two) / square)


def blend(
    members: Sequence[PolyMesh], weights: Sequence[float], tolerance: float = 1e-6
) -> PolyMesh:
    """Return the linear combination Σ wᵢ Mᵢ of parallel meshes, vertex by vertex.

    P(M) is a linear space, so any weights give another member; weights that sum to 1 keep the
    place and the size, others scale (the difference of two members is one, too).

    Parameters
    ----------
    members : meshes parallel to the first
    weights : as many numbers
    tolerance : float
        Largest sine allowed between the members' edges.

    Raises
    ------
    MeshError
        If there is no member, the numbers differ, or one is not parallel to the first.

    References
    ----------
    Thesis §4.1, fig. 4.2.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> half_way = px.blend([shell.mesh, px.offset(shell, -90.0).mesh], [0.5, 0.5])
    >>> print(f"{px.classify_pair(shell.mesh, half_way).distance:.1f} mm")
    -45.0 mm
    """
    if not members or len(members) != len(weights):
        raise MeshError(f"{len(members)} members and {len(weights)} weights: give one weight each")
    first = members[0]
    points = np.zeros_like(first.vertices)
    for number, (member, weight) in enumerate(zip(members, weights, strict=True)):
        sine, (i, j) = worst_edge(first, member)
        if not sine <= tolerance:
            raise MeshError(
                f"member {number} is not parallel to the first: edge {i}-{j} turns by a sine of "
                f"{sine:.1e}; raise the tolerance ({tolerance:.1e}) if that is meant"
            )
        points = points + weight * member.vertices
    return PolyMesh(points, first.corners, first.starts)


def flip_interval(ratio: FloatArray) -> tuple[float, float]:
    """Return the open interval of d in which no ratio c + d changes its sign.

    ``−min{c > 0} < d < min{|c| : c < 0}``, infinite where there is no such c. An edge without
    length in M (c = 0) leaves no interval: (0, 0).
    """
    low = -ratio[ratio >= 0].min(initial=np.inf)
    high = -ratio[ratio <= 0].max(initial=-np.inf)
    return float(low) + 0.0, float(high) + 0.0


def pair_interval(mesh: PolyMesh, gauss: PolyMesh) -> tuple[float, float]:
    """Return the open interval of distances d (mm) in which M + d·S flips no edge.

    Parameters
    ----------
    mesh : PolyMesh
        M, mm.
    gauss : PolyMesh
        S, parallel to M, unit length. Edges of S without length never flip and do not count.

    References
    ----------
    Thesis §4.2.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> px.pair_interval(shell.mesh, shell.gauss) == px.admissible_interval(shell)
    True
    """
    return flip_interval(_pair_ratios(mesh, gauss)[0])


def _pair_ratios(mesh: PolyMesh, gauss: PolyMesh) -> tuple[FloatArray, IntArray]:
    """Return the ratios M/S of the edges that have a length in S, and those edges."""
    require_same_faces(mesh, gauss)
    pairs = edges(mesh)
    m, s = _edge_vectors(mesh, pairs), _edge_vectors(gauss, pairs)
    square = np.einsum("ij,ij->i", s, s)
    some = square > 0
    return np.einsum("ij,ij->i", m, s)[some] / square[some], pairs[some]


def offset_pair(mesh: PolyMesh, gauss: PolyMesh, distance: float) -> PolyMesh:
    """Return the offset M + d·S of a mesh along any Gauss image parallel to it.

    Parameters
    ----------
    mesh : PolyMesh
        M, mm.
    gauss : PolyMesh
        S, same faces, unit length.
    distance : float
        d in mm, positive along the face normals.

    Raises
    ------
    OffsetLimitError
        If an edge would flip; the message names the edge and the admissible interval.
    MeshError
        If the faces differ.

    References
    ----------
    Thesis §4.2–4.3.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> below = px.offset_pair(shell.mesh, shell.gauss, -90.0)  # mm
    >>> bool(abs(below.vertices - px.offset(shell, -90.0).mesh.vertices).max() < 1e-9)
    True
    """
    ratio, pairs = _pair_ratios(mesh, gauss)
    low, high = flip_interval(ratio)
    if distance and not low < distance < high:
        over = np.where(ratio * (ratio + distance) <= 0, np.abs(ratio), np.inf)
        i, j = pairs[int(np.argmin(over))]
        raise OffsetLimitError(
            f"offset distance = {distance:g} mm: edge {i}-{j} would flip; keep the distance "
            f"between {low:.4g} and {high:.4g} mm"
        )
    return PolyMesh(mesh.vertices + distance * gauss.vertices, mesh.corners, mesh.starts)


def gauss_from_pair(mesh: PolyMesh, offset: PolyMesh, distance: float | None = None) -> PolyMesh:
    """Return the Gauss image S = (M′ − M)/d of an offset pair.

    Parameters
    ----------
    mesh, offset : PolyMesh
        M and M′, mm.
    distance : float, optional
        d in mm; without it the constant distance that ``classify_pair`` finds.

    Raises
    ------
    MeshError
        If the faces differ, or the distance is 0.

    References
    ----------
    Thesis §4.3.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> gauss = px.gauss_from_pair(shell.mesh, px.offset(shell, -90.0).mesh)
    >>> bool(abs(gauss.vertices - shell.gauss.vertices).max() < 1e-10)
    True
    """
    require_same_faces(mesh, offset)
    d = classify_pair(mesh, offset).distance if distance is None else distance
    if d == 0:
        raise MeshError("offset distance = 0 mm: a mesh and itself have no Gauss image")
    return PolyMesh((offset.vertices - mesh.vertices) / d, mesh.corners, mesh.starts)


@dataclass(frozen=True)
class PairClass:
    """What is constant between a mesh and its offset.

    Attributes
    ----------
    kind : str or None
        The type with the smallest spread when that is within the tolerance, else None.
    kinds : tuple of str
        All types within the tolerance (a pair can be of several).
    distance : float
        The constant distance of the best type, mm, positive along the face normals.
    distances, spreads : dict
        Per type: the mean distance in mm, and the largest deviation from it, over it.
    sine : float
        Largest sine between corresponding edges; ``edge`` is where.
    edge : (int, int)
    """

    kind: str | None
    kinds: tuple[str, ...]
    distance: float
    distances: dict[str, float]
    spreads: dict[str, float]
    sine: float
    edge: tuple[int, int]


def pair_distances(mesh: PolyMesh, offset: PolyMesh) -> dict[str, FloatArray]:
    """Return the distances of vertices (V,), edge lines (E,) and face planes (F,), mm.

    Face distances are signed along M's normals and are the mean over the corners; the others
    are lengths. Vertices that no face uses are left out.
    """
    require_same_faces(mesh, offset)
    step = offset.vertices - mesh.vertices
    pairs = edges(mesh)
    along = _edge_vectors(mesh, pairs)
    length = np.linalg.norm(along, axis=1, keepdims=True)
    along = np.divide(along, length, out=np.zeros_like(along), where=length > 0)
    middle = step[pairs].mean(axis=1)
    across = middle - np.einsum("ij,ij->i", middle, along)[:, None] * along
    height = np.einsum("ij,ij->i", step[mesh.corners], face_normals(mesh)[mesh.face_of_corner])
    return {
        "vertex": np.asarray(np.linalg.norm(step[np.unique(mesh.corners)], axis=1)),
        "edge": np.asarray(np.linalg.norm(across, axis=1)),
        "face": np.add.reduceat(height, mesh.starts[:-1]) / mesh.sides,
    }


def classify_pair(mesh: PolyMesh, offset: PolyMesh, tolerance: float = 1e-6) -> PairClass:
    """Say which distance is constant between a mesh and its offset, and how exactly.

    Parameters
    ----------
    mesh, offset : PolyMesh
        M and M′ of the same faces, mm.
    tolerance : float
        Largest spread of a constant distance, over the distance; also the largest sine between
        edges of a pair that counts as parallel.

    Raises
    ------
    MeshError
        If the faces differ, or the two meshes are one.

    References
    ----------
    Thesis §4.2, 4.4.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> pair = px.classify_pair(shell.mesh, px.offset(shell, -90.0).mesh)
    >>> print(pair.kind, f"{pair.distance:.3f} mm")
    face -90.000 mm
    """
    measured = pair_distances(mesh, offset)
    sine, edge = worst_edge(mesh, offset)
    side = -1.0 if measured["face"].sum() < 0 else 1.0
    distances = {kind: float(measured[kind].mean()) for kind in KINDS}
    distances["vertex"] *= side
    distances["edge"] *= side
    if not any(distances.values()):
        raise MeshError("the two meshes are the same, so there is no distance; give the offset")
    spreads = {}
    for kind in KINDS:
        mean = abs(float(measured[kind].mean()))
        largest = float(np.abs(np.abs(measured[kind]) - mean).max())
        if kind == "face":
            largest = float(np.abs(measured[kind] - distances[kind]).max())
        spreads[kind] = largest / mean if mean else np.inf
    kinds = tuple(kind for kind in KINDS if spreads[kind] <= tolerance and sine <= tolerance)
    best = min(KINDS, key=lambda kind: spreads[kind])
    return PairClass(
        best if best in kinds else None, kinds, distances[best], distances, spreads, sine, edge
    )

"""Polygon meshes from elsewhere made sound: welded, oriented, manifold, or refused by place."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from phexfab.errors import MeshError
from phexfab.mesh.half_edges import border_loops
from phexfab.mesh.io import same_place, weld
from phexfab.mesh.measures import mean_edge
from phexfab.mesh.polymesh import PolyMesh
from phexfab.mesh.trimesh_io import check_manifold

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SEAM = 0.02
"""Share of the mean edge below which vertices of borders are taken to belong together."""


@dataclass(frozen=True)
class ImportReport:
    """What was read and what was mended.

    Attributes
    ----------
    source : str
    vertices, faces : int
        Of the mesh as it is now.
    sides : tuple of (int, int)
        Numbers of sides, and how many faces have them.
    pieces, borders : int
        Connected parts, and border loops.
    welded, unused, corners_dropped : int
        Vertices that were joined to others; that no face used; corners that fell together with
        the one before.
    turned : tuple of int
        Faces that were oriented against their neighbours and now are not.
    """

    source: str
    vertices: int
    faces: int
    sides: tuple[tuple[int, int], ...]
    pieces: int
    borders: int
    welded: int
    unused: int
    corners_dropped: int
    turned: tuple[int, ...]

    @property
    def mended(self) -> bool:
        """Whether the mesh differs from what was read."""
        return bool(self.welded or self.unused or self.corners_dropped or self.turned)


def clean(
    mesh: PolyMesh,
    *,
    weld_within: float | None = None,
    turn: bool = True,
    name: str = "the mesh",
) -> tuple[PolyMesh, ImportReport]:
    """Return an oriented manifold mesh, and what was mended.

    Parameters
    ----------
    mesh : PolyMesh
    weld_within : float, optional
        Vertices nearer than this become one, mm. By default 1e-5 of the mean edge, or what six
        digits leave of the coordinates (`same_place`); then a seam left open is refused.
    turn : bool
        Turn faces that are oriented against the larger part of their piece; False refuses them.
    name : str
        For messages.

    Raises
    ------
    MeshError
        If the mesh has no faces or a coordinate is not finite; a face has a vertex twice; two
        faces have the same corners; more than two faces meet at an edge; a piece cannot be
        oriented, or ``turn`` is False and it is not; sheets touch at a vertex; or, with no
        ``weld_within`` given, border vertices nearly touch others. The message counts the places
        and names the first, with its face and coordinates.
    """
    if not mesh.n_faces:
        raise MeshError(f"{name}: the file has no faces")
    bad = np.flatnonzero(~np.isfinite(mesh.vertices).all(axis=1))
    if len(bad):
        raise MeshError(f"{name}: vertex {bad[0]} is {mesh.vertices[bad[0]]}, not finite")
    _refuse_repeated_corners(mesh, name)
    used = len(np.unique(mesh.corners))
    within = same_place(mesh) if weld_within is None else weld_within
    try:
        joined = weld(mesh, within)
    except MeshError as error:
        raise MeshError(f"{name}: {error}") from error
    _refuse_repeated_corners(joined, name)
    _refuse_repeated_faces(joined, name)
    left, right, against = _neighbours(joined, name)
    if weld_within is None:
        _refuse_seam(joined, name)
    pieces, turned = _turned(joined, left, right, against, name)
    if len(turned):
        if not turn:
            raise MeshError(
                f"{name}: {len(turned)} faces are oriented against their neighbours, first face "
                f"{turned[0]} at {_place(joined, int(turned[0]))}; turn them"
            )
        joined = _reversed(joined, turned)
    check_manifold(joined, name)
    sides, counts = np.unique(joined.sides, return_counts=True)
    return joined, ImportReport(
        source=name,
        vertices=len(joined.vertices),
        faces=joined.n_faces,
        sides=tuple((int(n), int(k)) for n, k in zip(sides, counts, strict=True)),
        pieces=pieces,
        borders=len(border_loops(joined)),
        welded=used - len(joined.vertices),
        unused=len(mesh.vertices) - used,
        corners_dropped=len(mesh.corners) - len(joined.corners),
        turned=tuple(int(f) for f in turned),
    )


def _place(mesh: PolyMesh, face: int) -> list[float]:
    """Return the mean corner of a face, for messages."""
    place: list[float] = mesh.polygon(face).mean(axis=0).round(3).tolist()
    return place


def _refuse_repeated_corners(mesh: PolyMesh, name: str) -> None:
    key = mesh.face_of_corner * len(mesh.vertices) + mesh.corners
    order = np.argsort(key, kind="stable")
    twice = order[1:][np.diff(key[order]) == 0]
    if len(twice):
        faces = np.unique(mesh.face_of_corner[twice])
        vertex = mesh.corners[twice[mesh.face_of_corner[twice] == faces[0]][0]]
        raise MeshError(
            f"{name}: {len(faces)} faces have a vertex more than once, first face {faces[0]} with "
            f"vertex {vertex} at {mesh.vertices[vertex].round(3).tolist()}; remove the repeated "
            "corners, or split the face there"
        )


def _refuse_repeated_faces(mesh: PolyMesh, name: str) -> None:
    for n in np.unique(mesh.sides):
        faces = np.flatnonzero(mesh.sides == n)
        corners = np.sort(mesh.corners[mesh.starts[faces][:, None] + np.arange(n)], axis=1)
        _, first, number = np.unique(corners, axis=0, return_index=True, return_inverse=True)
        original = faces[first[number.reshape(-1)]]
        again = np.flatnonzero(original != faces)
        if len(again):
            face, other = int(faces[again[0]]), int(original[again[0]])
            raise MeshError(
                f"{name}: {len(again)} faces have the same corners as another, first face {face} "
                f"as face {other} at {_place(mesh, face)}; remove one of them"
            )


def _refuse_seam(mesh: PolyMesh, name: str) -> None:
    """Refuse vertices of the border that nearly touch others and have no edge with them."""
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    n, low, high = len(mesh.vertices), np.minimum(tail, head), np.maximum(tail, head)
    edge, count = np.unique(low * n + high, return_counts=True)
    border = np.unique(np.concatenate(np.divmod(edge[count == 1], n)))
    reach = SEAM * mean_edge(mesh)
    pairs = cKDTree(mesh.vertices[border]).query_pairs(reach, output_type="ndarray")
    one, two = border[pairs].T if len(pairs) else (border[:0], border[:0])
    gap = np.linalg.norm(mesh.vertices[one] - mesh.vertices[two], axis=1)
    length = np.linalg.norm(mesh.vertices[head] - mesh.vertices[tail], axis=1)
    shortest = np.full(n, np.inf)  # at each vertex: near is what is near beside the edges there
    np.minimum.at(shortest, tail, length)
    np.minimum.at(shortest, head, length)
    seam = ~np.isin(np.minimum(one, two) * n + np.maximum(one, two), edge)
    seam &= gap < np.minimum(shortest[one], shortest[two]) / 3
    one, two, gap = one[seam], two[seam], gap[seam]
    if len(one):
        step = 10.0 ** (np.floor(np.log10(gap.max())) - 1)
        enough = float(np.ceil(1.05 * gap.max() / step) * step)
        raise MeshError(
            f"{name}: an open seam: {len(one)} pairs of border vertices are less than {SEAM:.0%} "
            f"of an edge apart, first {one[0]} and {two[0]} at "
            f"{mesh.vertices[one[0]].round(3).tolist()}, {gap[0]:.3g} apart, at most "
            f"{gap.max():.3g}; join them with mesh.weld (weld_within) = {enough:.3g} in the file's "
            "unit, or leave them with 0"
        )


def _neighbours(mesh: PolyMesh, name: str) -> tuple[IntArray, IntArray, NDArray[np.bool_]]:
    """Return the faces on both sides of each inner edge, and whether they are opposed."""
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    key = low * len(mesh.vertices) + high
    order = np.argsort(key, kind="stable")
    same = np.diff(key[order]) == 0
    crowd = np.flatnonzero(same[1:] & same[:-1])
    if len(crowd):
        at = order[crowd[0]]
        faces = np.unique(mesh.face_of_corner[key == key[at]]).tolist()
        place = mesh.vertices[[low[at], high[at]]].mean(axis=0).round(3).tolist()
        raise MeshError(
            f"{name}: {len(np.unique(key[order[crowd]]))} edges have more than two faces, first "
            f"the edge of vertices {low[at]} and {high[at]} at {place} with faces {faces}; part "
            "the sheets"
        )
    one, two = order[:-1][same], order[1:][same]
    return mesh.face_of_corner[one], mesh.face_of_corner[two], tail[one] == tail[two]


def _turned(
    mesh: PolyMesh, left: IntArray, right: IntArray, against: NDArray[np.bool_], name: str
) -> tuple[int, IntArray]:
    """Return the number of pieces, and the faces to be turned: the fewer of each piece."""
    n = mesh.n_faces
    # Node f is face f as it is, n + f the face turned; an edge links what fits together.
    ends = np.concatenate([left, left + n])
    others = np.concatenate([right + n * against, right + n * ~against])
    links = coo_array((np.ones(len(ends)), (ends, others)), shape=(2 * n, 2 * n))
    _, group = connected_components(links, directed=False)
    as_is, turned = group[:n], group[n:]
    closed = np.flatnonzero(as_is == turned)
    if len(closed):
        raise MeshError(
            f"{name}: {len(closed)} faces are on a piece with one side only (a Möbius band), "
            f"first face {closed[0]} at {_place(mesh, int(closed[0]))}; cut it open"
        )
    size = np.bincount(as_is, minlength=int(group.max()) + 1)
    # The larger of the two ways keeps its faces; of equal ones that of the first face.
    fewer = (size[as_is] < size[turned]) | ((size[as_is] == size[turned]) & (as_is > turned))
    return len(np.unique(np.minimum(as_is, turned))), np.flatnonzero(fewer)


def _reversed(mesh: PolyMesh, faces: IntArray) -> PolyMesh:
    """Return the mesh with some faces' corners in the opposite order, first corner kept."""
    flip = np.zeros(mesh.n_faces, bool)
    flip[faces] = True
    owner = mesh.face_of_corner
    place = np.arange(len(mesh.corners)) - mesh.starts[owner]
    back = mesh.starts[owner] + (mesh.sides[owner] - place) % mesh.sides[owner]
    corners = np.where(flip[owner], mesh.corners[back], mesh.corners)
    return PolyMesh(mesh.vertices, corners, mesh.starts)

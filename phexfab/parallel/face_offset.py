"""Constant face distance: vertex normals of a trivalent mesh by planes and by angles.

The vertex normal here is the vector w with N_i·w = 1 for all faces i at the vertex: moving the
vertex by d·w moves every face by d. Every mesh whose interior vertices have three faces has one,
so all of them have face offsets.

References
----------
Thesis §4.4.3, §6.3; Wang, Liu, Yan, Chan, Ling, Sun 2008, "Hexagonal meshes with planar faces".
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import DesignError, MeshError
from phexfab.linalg import factorise
from phexfab.mesh.measures import corner_angles, face_normals
from phexfab.mesh.polymesh import PolyMesh

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def normals_by_planes(normals: FloatArray) -> FloatArray:
    """Return (V, 3) vectors w with N_i·w = 1: where three planes shifted by 1 meet (method 1).

    It loses as many digits as the three normals have in common, and fails where they are equal.

    Parameters
    ----------
    normals : (V, 3, 3) unit normals of the three faces at each vertex

    Raises
    ------
    MeshError
        If three planes are parallel to one line; the message names the vertex.
    """
    try:
        return np.asarray(np.linalg.solve(normals, np.ones((len(normals), 3, 1)))[..., 0], float)
    except np.linalg.LinAlgError as error:
        worst = int(np.argmin(np.abs(np.linalg.det(normals))))
        raise MeshError(
            f"the faces at vertex {worst} of those given are coplanar: shifted planes do not "
            'meet in a point; use method "angles"'
        ) from error


def normals_by_angles(normals: FloatArray, angles: FloatArray) -> FloatArray:
    """Return (V, 3) vectors w with N_i·w = 1 from the interior angles (method 2).

    The thesis has ``N_v = Σ (tan β_i + tan γ_i) N_i``, ``β_i = ½(θ_i + θ_{i+1} − θ_{i−1})``,
    ``γ_i = ½(θ_i + θ_{i−1} − θ_{i+1})``. There ``β_i = γ_{i+1}``, and ``β_i + γ_i = θ_i``, so
    that over the common denominator cos·cos·cos it reads

        N_v ∝ Σ sin θ_i · cos ½(θ_{i+1} + θ_{i−1} − θ_i) · N_i,

    which has no poles at right angles. The angles keep all their digits where the faces become
    coplanar, and so does the result.

    Parameters
    ----------
    normals : (V, 3, 3) unit normals in the mesh's orientation
    angles : (V, 3) degrees
        Interior angles of the same faces, reflex ones above 180.

    Returns
    -------
    (V, 3) array; not a number where an angle is 0 or 180 and the faces are coplanar.
    """
    theta = np.radians(angles)
    half = theta.sum(axis=1, keepdims=True) / 2
    weight = np.sin(theta) * np.cos(half - theta)
    total = np.einsum("vi,vij->vj", weight, normals)
    reach = np.einsum("vij,vj->vi", normals, total).mean(axis=1, keepdims=True)
    with np.errstate(divide="ignore", invalid="ignore"):
        return total / reach


def face_offset_image(mesh: PolyMesh, method: str = "angles") -> PolyMesh:
    """Return the parallel mesh whose faces touch the unit sphere: the Gauss image of face offsets.

    Interior vertices have one choice. A border vertex with one or two faces has more; of all
    parallel meshes the one is taken whose border vertices lie closest to the sphere's points of
    contact, in the sense of least squares.

    Parameters
    ----------
    mesh : PolyMesh
        With planar faces, three at every interior vertex.
    method : ``"angles"`` or ``"planes"``
        See ``normals_by_angles`` and ``normals_by_planes``.

    Raises
    ------
    MeshError
        If more than three faces meet in a vertex (it is conical only by luck), or the faces at
        a vertex are coplanar and the method is ``"planes"``.
    DesignError
        For an unknown method.

    References
    ----------
    Thesis §6.3.
    """
    if method not in ("angles", "planes"):
        raise DesignError(f'method = {method!r}: use "angles" or "planes"')
    normals = face_normals(mesh)
    order = np.argsort(mesh.corners, kind="stable")
    count = np.bincount(mesh.corners, minlength=len(mesh.vertices))
    if count.max(initial=0) > 3:
        worst = int(np.argmax(count))
        raise MeshError(
            f"{count[worst]} faces meet in vertex {worst}; a face offset is certain only with "
            "three: ask for the nearest conical mesh instead"
        )
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    face = mesh.face_of_corner[order]
    image = np.zeros_like(mesh.vertices)
    three = np.flatnonzero(count == 3)
    at = first[three][:, None] + np.arange(3)
    if method == "angles":
        angles = corner_angles(mesh, normals)[order]
        image[three] = normals_by_angles(normals[face[at]], angles[at])
    else:
        image[three] = normals_by_planes(normals[face[at]])
    two = np.flatnonzero(count == 2)
    left, right = normals[face[first[two]]], normals[face[first[two] + 1]]
    total = left + right
    image[two] = total / np.einsum("ij,ij->i", total, left)[:, None]
    one = np.flatnonzero(count == 1)
    image[one] = normals[face[first[one]]]
    image = image + _border_slide(mesh, normals, image, two, left, right, one)
    return PolyMesh(image, mesh.corners, mesh.starts)


def face_offset(mesh: PolyMesh, distance: float, method: str = "angles") -> PolyMesh:
    """Return the parallel mesh whose faces are shifted by ``distance`` mm along their normals.

    Parameters
    ----------
    mesh : PolyMesh
        M, mm; at most three faces at every vertex, faces planar.
    distance : float, mm
        Positive along the face normals.
    method : ``"angles"`` or ``"planes"``
        See ``face_offset_image``.

    Raises
    ------
    MeshError, DesignError
        See ``face_offset_image``.

    References
    ----------
    Thesis §6.3.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> below = px.face_offset(shell.mesh, -90.0)  # mm
    >>> px.classify_pair(shell.mesh, below).kind
    'face'
    """
    image = face_offset_image(mesh, method)
    return PolyMesh(mesh.vertices + distance * image.vertices, mesh.corners, mesh.starts)


def _border_slide(
    mesh: PolyMesh,
    normals: FloatArray,
    image: FloatArray,
    two: IntArray,
    left: FloatArray,
    right: FloatArray,
    one: IntArray,
) -> FloatArray:
    """Return (V, 3) the least slide within their planes that makes border edges parallel.

    A vertex with two faces slides along their common line (one unknown), a vertex with a single
    face in its plane (two); every border edge asks for one equation.
    """
    n = len(mesh.vertices)
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    key, back = tail * n + head, head * n + tail
    border = np.flatnonzero(~np.isin(key, back))
    across = np.cross(
        normals[mesh.face_of_corner[border]],
        _unit(mesh.vertices[head[border]] - mesh.vertices[tail[border]]),
    )
    columns = np.full((n, 2), -1)
    basis = np.zeros((n, 2, 3))
    columns[two, 0] = np.arange(len(two))
    basis[two, 0] = _line(left, right)
    columns[one] = len(two) + np.arange(2 * len(one)).reshape(-1, 2)
    about = image[one]
    helper = np.eye(3)[np.abs(about).argmin(axis=1)]
    basis[one, 0] = _unit(np.cross(about, helper))
    basis[one, 1] = np.cross(about, basis[one, 0])
    rows, cols, values = [], [], []
    for end, sign in ((head[border], 1.0), (tail[border], -1.0)):
        for k in range(2):
            live = columns[end, k] >= 0
            rows.append(np.flatnonzero(live))
            cols.append(columns[end, k][live])
            values.append(sign * np.einsum("ej,ej->e", across, basis[end, k])[live])
    unknowns = len(two) + 2 * len(one)
    slide = np.zeros_like(image)
    if not unknowns:
        return slide
    where = (np.concatenate(rows), np.concatenate(cols))
    asked = sp.coo_matrix((np.concatenate(values), where), shape=(len(border), unknowns)).tocsr()
    gap = -np.einsum("ej,ej->e", across, image[head[border]] - image[tail[border]])
    # Least slide under the equations; the small block lets equations repeat each other.
    small = sp.identity(len(border)) * -1e-13
    system = sp.bmat([[sp.identity(unknowns), asked.T], [asked, small]])
    t = factorise(system).solve(np.concatenate([np.zeros(unknowns), gap]))[:unknowns]
    for k in range(2):
        live = columns[:, k] >= 0
        slide[live] += t[columns[live, k]][:, None] * basis[live, k]
    return slide


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True), float)


def _line(left: FloatArray, right: FloatArray) -> FloatArray:
    """Return the unit directions in which two planes meet; 0 where they are the same plane."""
    cross = np.cross(left, right)
    size = np.linalg.norm(cross, axis=1, keepdims=True)
    return np.divide(cross, size, out=np.zeros_like(cross), where=size > 1e-14)

"""The nearest mesh with a wanted offset property, for a mesh that has none.

First the Gauss image: corners s, face normals n and heights h are moved as little as possible onto
``n·s = h``, ``|n| = 1`` and the contact with the sphere (Newton on the constraints, each step the
least change that meets them to first order). Then M: the member of the new space of parallel meshes
nearest to the old M.

References
----------
Thesis §4.4, ch. 6; Pottmann et al. 2007, sec. 3–4.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import MeshError, SolveError
from phexfab.linalg import factorise
from phexfab.mesh.measures import edges, face_normals
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.nearest import nearest_member
from phexfab.parallel.simple import is_simple
from phexfab.parallel.space import parallel_space
from phexfab.parallel.sphere_fit import fit_to_sphere, sphere_miss

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class OffsetMesh:
    """A mesh with an offset property, near to one that has none.

    Attributes
    ----------
    kind : str
        ``"vertex"``, ``"edge"`` or ``"face"``.
    mesh : PolyMesh
        M′, mm, same faces as M.
    gauss : PolyMesh
        S, parallel to M′, touching the unit sphere.
    moved : (V,) float array, mm
        How far each vertex moved.
    miss : float
        Largest miss of the unit sphere by S.
    steps : int
        Newton steps taken.
    """

    kind: str
    mesh: PolyMesh
    gauss: PolyMesh
    moved: FloatArray
    miss: float
    steps: int


def nearest_offset_mesh(mesh: PolyMesh, kind: str, steps: int = 40) -> OffsetMesh:
    """Return a mesh with the wanted offset property close to a given simple mesh.

    Nearest in two stages, Gauss image then M, not jointly; on a mesh that almost has the property
    the difference is of second order.

    Parameters
    ----------
    mesh : PolyMesh
        M, mm, simple (three edges at every vertex), faces planar or nearly so.
    kind : ``"vertex"``, ``"edge"`` or ``"face"``
    steps : int
        Most Newton steps.

    Raises
    ------
    MeshError
        If the mesh is not simple, or the type is unknown.
    SolveError
        If no Gauss image of the type is found nearby.

    References
    ----------
    Thesis §4.4, ch. 6.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> found = px.nearest_offset_mesh(shell.mesh, "vertex")
    >>> print(f"vertices moved by up to {found.moved.max():.2f} mm")
    vertices moved by up to 0.46 mm
    """
    if not is_simple(mesh):
        raise MeshError(
            "the mesh is not simple: three edges must meet at every vertex; other meshes have too "
            "few parallel meshes to follow a new Gauss image"
        )
    start = fit_to_sphere(parallel_space(mesh), kind)
    gauss, taken = _onto_sphere(start.gauss, face_normals(mesh), kind, steps)
    moved = nearest_member(parallel_space(gauss), mesh)
    return OffsetMesh(
        kind,
        moved,
        gauss,
        np.asarray(np.linalg.norm(moved.vertices - mesh.vertices, axis=1)),
        float(sphere_miss(gauss, kind).max()),
        taken,
    )


def _onto_sphere(
    start: PolyMesh, normals: FloatArray, kind: str, steps: int
) -> tuple[PolyMesh, int]:
    """Return the mesh of the wanted type with planar faces near a start, and the steps taken."""
    n_v, n_f = len(start.vertices), start.n_faces
    height = np.einsum("ij,ij->i", start.vertices[start.corners], normals[start.face_of_corner])
    heights = np.add.reduceat(height, start.starts[:-1]) / start.sides
    x0 = np.concatenate([start.vertices.ravel(), normals.ravel(), heights])
    # Corners count; normals and heights follow them, with just enough weight to be determined.
    inertia = np.concatenate([np.ones(3 * n_v), np.full(4 * n_f, 1e-2)])
    pairs, x, taken = edges(start), x0, 0
    least, best, stalled = np.inf, x0, 0
    for _ in range(steps + 1):
        miss, jacobian = _constraints(start, pairs, kind, x)
        size = float(np.abs(miss).max())
        stalled = stalled + 1 if size > least / 2 else 0
        if size < least:
            least, best = size, x
        if size < 1e-15 or (stalled >= 2 and least < 1e-12) or stalled > 8:
            break
        n = len(miss)
        system = sp.bmat(
            [[sp.diags(inertia), jacobian.T], [jacobian, -1e-12 * sp.eye(n)]], format="csc"
        )
        right = np.concatenate([inertia * (x0 - x), -miss])
        taken += 1
        x = x + factorise(system).solve(right)[: len(x)]
    if least > 1e-10:
        raise SolveError(
            f"no Gauss image of the {kind} type was found near this mesh (miss {least:.1e}); ask "
            "for another type, or begin with a mesh that is nearer to a curvature-line layout"
        )
    return PolyMesh(best[: 3 * n_v].reshape(-1, 3), start.corners, start.starts), taken


def _constraints(
    mesh: PolyMesh, pairs: IntArray, kind: str, x: FloatArray
) -> tuple[FloatArray, Any]:
    n_v, n_f = len(mesh.vertices), mesh.n_faces
    s, normals = x[: 3 * n_v].reshape(-1, 3), x[3 * n_v : 3 * (n_v + n_f)].reshape(-1, 3)
    heights = x[3 * (n_v + n_f) :]
    corner, face = mesh.corners, mesh.face_of_corner
    columns = 3 * n_v + 4 * n_f
    begin_n, begin_h = 3 * n_v, 3 * (n_v + n_f)
    xyz = np.arange(3)

    def block(vectors: FloatArray, index: IntArray, begin: int) -> Any:
        place = (begin + 3 * index[:, None] + xyz).ravel()
        rows = np.arange(0, 3 * len(vectors) + 1, 3)
        return sp.csr_matrix((vectors.ravel(), place, rows), shape=(len(vectors), columns))

    n_c, all_f = len(corner), np.arange(n_f)
    minus_h = sp.csr_matrix(
        (np.full(n_c, -1.0), (np.arange(n_c), begin_h + face)), shape=(n_c, columns)
    )
    misses = [
        np.einsum("ij,ij->i", s[corner], normals[face]) - heights[face],
        (np.einsum("ij,ij->i", normals, normals) - 1) / 2,
    ]
    parts = [
        block(normals[face], corner, 0) + block(s[corner], face, begin_n) + minus_h,
        block(normals, all_f, begin_n),
    ]
    if kind == "vertex":
        misses.append((np.einsum("ij,ij->i", s, s) - 1) / 2)
        parts.append(block(s, np.arange(n_v), 0))
    elif kind == "face":
        misses.append(heights - 1)
        parts.append(sp.csr_matrix((np.ones(n_f), (all_f, begin_h + all_f)), shape=(n_f, columns)))
    else:
        i, j = pairs.T
        along = s[j] - s[i]
        place = -np.einsum("ij,ij->i", s[i], along) / np.einsum("ij,ij->i", along, along)
        foot = s[i] + place[:, None] * along
        misses.append((np.einsum("ij,ij->i", foot, foot) - 1) / 2)
        parts.append(block((1 - place)[:, None] * foot, i, 0) + block(place[:, None] * foot, j, 0))
    return np.concatenate(misses), sp.vstack(parts, format="csr")

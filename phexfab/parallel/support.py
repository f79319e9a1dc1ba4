"""Beams along the edges of a mesh: torsion in its nodes, support quads, heights of beams.

A beam's mid-plane contains its edge and should contain the node axes at both ends. A parallel
mesh provides such axes; without one the mid-planes at the two ends differ by the torsion.

References
----------
Thesis §3.1, §4.2, §4.4; Liu, Pottmann, Wallner, Yang, Wang 2006 (conical meshes); Pottmann, Liu,
Wallner, Bobenko, Wang 2007 (beams, node axes).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from phexfab.errors import MeshError
from phexfab.linalg import factorise
from phexfab.mesh.measures import area_vectors, edges, face_normals
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class NodeTorsion:
    """Torsion of a mesh with given node axes; edges in the order of ``mesh.measures.edges``.

    Attributes
    ----------
    edges : (E, 2) int
    torsion : (E,) float
        Degrees between the mid-planes at both ends of each beam, 0 to 90.
    off_axis : (E, 2) float
        Degrees between the axis at each end and the beam's one flat mid-plane, the bisector of
        the two.
    nodes : (V,) float
        The largest ``off_axis`` among the beams at each vertex; 0 where there is none.
    axes : (V, 3) float
        The unit node axes.
    tilt : (V,) float
        Degrees between each axis and the area-weighted vertex normal.
    """

    edges: IntArray
    torsion: FloatArray
    off_axis: FloatArray
    nodes: FloatArray
    axes: FloatArray
    tilt: FloatArray


@dataclass(frozen=True, eq=False)
class BeamHeights:
    """Heights of the support quads of a mesh pair; edges in the order of ``mesh.measures.edges``.

    Attributes
    ----------
    edges : (E, 2) int
    heights : (E,) float
        Distance of each edge from its parallel, mm: what a workshop cuts.
    ends : (E, 2) float
        Length of the quad's sides along the node axes at its two ends, mm.
    """

    edges: IntArray
    heights: FloatArray
    ends: FloatArray

    @property
    def spread(self) -> float:
        """(largest − smallest)/mean height over all beams; 0 for edge offsets."""
        return float(np.ptp(self.heights) / self.heights.mean())

    @property
    def slant(self) -> FloatArray:
        """(E,) (larger − smaller)/mean of each beam's two ends; 0 for vertex offsets."""
        return np.abs(self.ends[:, 0] - self.ends[:, 1]) / self.ends.mean(axis=1)


def vertex_normals(mesh: PolyMesh) -> FloatArray:
    """Return (V, 3) area-weighted unit vertex normals; 0 at vertices that no face uses."""
    total = np.zeros_like(mesh.vertices)
    np.add.at(total, mesh.corners, area_vectors(mesh)[mesh.face_of_corner])
    return _unit(total)


def torsion_of_axes(mesh: PolyMesh, axes: FloatArray) -> NodeTorsion:
    """Return the torsion of all beams for given (V, 3) node axes of any length."""
    pairs = edges(mesh)
    axes = _unit(np.asarray(axes, float))
    along = _unit(mesh.vertices[pairs[:, 1]] - mesh.vertices[pairs[:, 0]])
    # Normals of the mid-planes at both ends; atan2 keeps small angles exact.
    planes = _unit(np.cross(along[:, None], axes[pairs]))
    one, two = planes[:, 0], planes[:, 1]
    angle = np.arctan2(
        np.linalg.norm(np.cross(one, two), axis=1), np.abs(np.einsum("ij,ij->i", one, two))
    )
    same = np.sign(np.einsum("ij,ij->i", one, two))[:, None]
    middle = _unit(one + np.where(same < 0, -two, two))
    off = np.degrees(np.arcsin(np.minimum(np.abs(np.einsum("ei,eki->ek", middle, axes[pairs])), 1)))
    nodes = np.zeros(len(axes))
    np.maximum.at(nodes, pairs.ravel(), off.ravel())
    normals = vertex_normals(mesh)
    tilt = np.arctan2(
        np.linalg.norm(np.cross(axes, normals), axis=1), np.einsum("ij,ij->i", axes, normals)
    )
    return NodeTorsion(pairs, np.degrees(angle), off, nodes, axes, np.degrees(tilt))


def node_torsion(
    mesh: PolyMesh, gauss: PolyMesh | None = None, *, axes: str = "normals", pull: float = 0.1
) -> NodeTorsion:
    """Return the torsion of every beam of a mesh, with or without an offset mesh.

    Parameters
    ----------
    mesh : PolyMesh
        Any polygon mesh; triangles and faces that are not planar too.
    gauss : PolyMesh, optional
        Its Gauss image S, or M′ − M of an offset pair: the axes are the directions of its
        vertices, and there is no torsion where it is parallel. Give an offset mesh M′ as
        ``PolyMesh(other.vertices - mesh.vertices, mesh.corners, mesh.starts)``.
    axes : ``"normals"`` or ``"best"``
        Without a Gauss image: the area-weighted vertex normals, as one does who knows no better,
        or those of ``best_axes``.
    pull : float
        See ``best_axes``.

    References
    ----------
    Thesis §3.1, §4.2.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> print(f"{px.node_torsion(shell.mesh).torsion.max():.2f}°")  # vertex normals as axes
    6.35°
    >>> bool(px.node_torsion(shell.mesh, shell.gauss).torsion.max() < 1e-9)
    True
    """
    if gauss is not None:
        if not np.array_equal(gauss.corners, mesh.corners):
            raise MeshError("the Gauss image has other faces than the mesh; give both one order")
        return torsion_of_axes(mesh, gauss.vertices)
    if axes not in ("normals", "best"):
        raise MeshError(f'axes = {axes!r}: use "normals" or "best"')
    return torsion_of_axes(
        mesh, vertex_normals(mesh) if axes == "normals" else best_axes(mesh, pull)
    )


def best_axes(mesh: PolyMesh, pull: float = 0.1, *, rounds: int = 8) -> FloatArray:
    """Return (V, 3) unit node axes of least torsion that stay near the vertex normals.

    Minimises ``Σ ((a_i × a_j)·e)² + pull²·Σ |a − N|²`` over the edges' directions e and the
    vertices, by Gauss–Newton. Without the pull every mesh has axes free of torsion that are of no
    use: all parallel, or all through one point. A mesh with a parallel partner near its normals
    comes out nearly free of torsion; use the partner itself where it is known.

    Parameters
    ----------
    mesh : PolyMesh
    pull : float
        Weight of the deviation from the normals in radians against the torsion's sine.
    rounds : int
        Gauss–Newton steps.

    Raises
    ------
    SolveError
        If the normal equations are singular (``pull`` 0).
    """
    pairs = edges(mesh)
    i, j = pairs.T
    along = _unit(mesh.vertices[j] - mesh.vertices[i])
    normals = vertex_normals(mesh)
    n, m = len(normals), len(pairs)
    columns = (3 * pairs[:, :, None] + np.arange(3)).reshape(m, 6)
    rows = np.repeat(np.arange(m), 6)
    a = normals
    for _ in range(rounds):
        # (a_i × a_j)·e has the gradients a_j × e and e × a_i.
        slopes = np.hstack([np.cross(a[j], along), np.cross(along, a[i])])
        jacobian = sp.csr_matrix((slopes.ravel(), (rows, columns.ravel())), shape=(m, 3 * n))
        value = np.einsum("ij,ij->i", np.cross(a[i], a[j]), along)
        # Only directions count: a step along the axis itself is held back.
        block = pull**2 * np.eye(3) + a[:, :, None] * a[:, None, :]
        hold = sp.bsr_matrix((block, np.arange(n), np.arange(n + 1)), shape=(3 * n, 3 * n))
        right = -(jacobian.T @ value) - pull**2 * (a - normals).ravel()
        step = factorise((jacobian.T @ jacobian + hold).tocsc()).solve(right)
        a = _unit(a + step.reshape(n, 3))
    return a


def support_structure(mesh: PolyMesh, gauss: PolyMesh, depth: float) -> PolyMesh:
    """Return the support quads of a mesh pair: one for every edge, along the node axes.

    They are planar because edges of M and S are parallel. With a face-type S (conical axes) every
    quad's plane bisects the two faces it carries: it deviates from a right angle to each of them
    by half their bend, the least that is possible for both. See ``support_angles``.

    Parameters
    ----------
    mesh, gauss : PolyMesh
        M in mm and a parallel S.
    depth : float
        In mm along the normals, negative for beams beneath.

    Returns
    -------
    PolyMesh
        Vertices of M, then those of M + depth·S; face k is the quad (i, j, j′, i′) of edge k in
        the order of ``mesh.measures.edges``.

    References
    ----------
    Thesis §4.2, §4.4.3.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> from phexfab.mesh.measures import relative_planarity
    >>> quads = px.support_structure(shell.mesh, shell.gauss, -90.0)  # mm
    >>> quads.n_faces == len(shell.edges), bool(relative_planarity(quads).max() < 1e-11)
    (True, True)
    """
    _same(mesh, gauss)
    i, j = edges(mesh).T
    n = len(mesh.vertices)
    return PolyMesh(
        np.vstack([mesh.vertices, mesh.vertices + depth * gauss.vertices]),
        np.column_stack([i, j, j + n, i + n]).ravel(),
        4 * np.arange(len(i) + 1),
    )


def support_angles(mesh: PolyMesh, gauss: PolyMesh) -> tuple[IntArray, FloatArray]:
    """Return the inner edges and by how much their quads miss a right angle to both faces.

    The two angles of an edge add up to the bend between its faces. For a face-type S they are
    equal, and no plane through the edge does better for both; for the others their cosines are as
    the heights of S's two faces.

    Returns
    -------
    pairs : (E', 2) int
        Faces (left, right) of every edge with two faces, in the order of the left face's corners.
    angles : (E', 2) float
        Degrees between the quad's plane and the left and right face's normal; positive on ridges,
        negative in valleys, seen from the tip of the normals.
    """
    _same(mesh, gauss)
    n = len(mesh.vertices)
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    key, back = tail * n + head, head * n + tail
    order = np.argsort(key)
    slot = np.minimum(np.searchsorted(key[order], back), len(key) - 1)
    twin = np.where(key[order[slot]] == back, order[slot], -1)
    corner = np.flatnonzero((twin >= 0) & (tail < head))
    left, right = mesh.face_of_corner[corner], mesh.face_of_corner[twin[corner]]
    normals = face_normals(mesh)
    along = _unit(mesh.vertices[head[corner]] - mesh.vertices[tail[corner]])
    s = gauss.vertices[tail[corner]]
    upright = _unit(s - np.einsum("ij,ij->i", s, along)[:, None] * along)
    across = np.cross(upright, along)  # to the left face's side
    lean = np.column_stack(
        [
            np.arctan2(
                np.einsum("ij,ij->i", across, normals[f]),
                np.einsum("ij,ij->i", upright, normals[f]),
            )
            for f in (left, right)
        ]
    )
    return np.column_stack([left, right]), np.degrees(lean * np.array([1.0, -1.0]))


def pair_beam_heights(mesh: PolyMesh, gauss: PolyMesh, depth: float) -> BeamHeights:
    """Return the heights of the beams between M and M + depth·S; see ``beam_heights``."""
    _same(mesh, gauss)
    pairs = edges(mesh)
    along = _unit(mesh.vertices[pairs[:, 1]] - mesh.vertices[pairs[:, 0]])
    s = gauss.vertices[pairs]
    # From the nearer end: both lie on one line, and a long lever costs digits.
    ends = np.linalg.norm(s, axis=2)
    near = s[np.arange(len(s)), ends.argmin(axis=1)]
    heights = np.linalg.norm(np.cross(near, along), axis=1)
    return BeamHeights(pairs, abs(depth) * heights, abs(depth) * ends)


def beam_heights(shell: Shell, depth: float) -> BeamHeights:
    """Return the height of every beam of a shell between M and M + depth·S.

    An edge and its offset are parallel, so the height does not change along a beam. Over all
    beams it is constant for the edge type; for the face type it is depth/cos(bend/2), for the
    vertex type depth·√(1 − (edge of S / 2)²), so both vary with the square of the panels' size.

    Parameters
    ----------
    shell : Shell
    depth : float
        mm; its sign does not matter here.

    References
    ----------
    Thesis §4.4.2.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> print(f"{100 * px.beam_heights(shell, -90.0).spread:.2f} %")  # face type
    1.89 %
    >>> edge_type = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0), "edge")
    >>> bool(px.beam_heights(edge_type, -90.0).spread < 1e-12)
    True
    """
    return pair_beam_heights(shell.mesh, shell.gauss, depth)


def _unit(vectors: FloatArray) -> FloatArray:
    size = np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.divide(vectors, size, out=np.zeros_like(vectors), where=size > 0)


def _same(mesh: PolyMesh, gauss: PolyMesh) -> None:
    if not (
        np.array_equal(gauss.corners, mesh.corners) and gauss.vertices.shape == mesh.vertices.shape
    ):
        raise MeshError("the Gauss image has other faces than the mesh; give both one order")

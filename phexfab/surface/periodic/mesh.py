"""Triply periodic minimal surfaces as triangle meshes that lie on them exactly.

One patch of the tiling is triangulated in the uniformising parameter h, all others are images of
it. So points, normals, curvatures and principal directions are evaluations of closed forms.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree
from scipy.special import ellipj, ellipk

from phexfab.errors import SurfaceError
from phexfab.surface.holomorphic import ComplexArray
from phexfab.surface.periodic.border import Cut, cut_at_box
from phexfab.surface.periodic.closed_forms import PeriodicSurface, periodic_surface
from phexfab.surface.periodic.cut import Tiles, outer_edges

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

_MOST = 3_000_000
"""Most triangles that are made: about 2 GB at work."""


@dataclass(frozen=True, eq=False)
class PeriodicFilm:
    """The part of a periodic surface in and around a box of whole cells.

    The box has one corner at the origin and its edges along the axes.

    Attributes
    ----------
    name : str
    cell : float
        Edge of the cubic cell, in mm.
    cells : (nx, ny, nz)
        Numbers of cells in the box.
    points, normals : (n, 3) float
        Vertices, in mm, and unit normals; exact.
    triangles : (m, 3) int
        Counter-clockwise seen from the tips of the normals.
    directions : (n, 3) float
        Unit tangents of the lines of curvature −κ, each up to its sign; 0 at umbilics.
    curvatures : (n,) float
        κ >= 0 in 1/mm; the principal curvatures are −κ and κ.
    umbilics : (k,) int
        The flat points among the vertices: all there are in the mesh.
    orders : (k,) int
        Orders of the zeros of the Hopf differential there: 1.
    cut : Cut
        The film cut at the box, and the closed curves in which it meets the box.
    surface : PeriodicSurface
        In units of the cell; box and surface differ by `corner`.
    corner : (3,) float
        The surface's coordinates, in cells, of the corner of the box.
    octants, shifts, parameters : (m,) int, (m, 3) float, (m, 3) complex
        The image of the patch that each triangle is on, in cells and from the corner of the box,
        and h of its corners there.
    """

    name: str
    cell: float
    cells: tuple[int, int, int]
    points: FloatArray
    normals: FloatArray
    triangles: IntArray
    directions: FloatArray
    curvatures: FloatArray
    umbilics: IntArray
    orders: IntArray
    cut: Cut
    surface: PeriodicSurface
    corner: FloatArray
    octants: IntArray
    shifts: FloatArray
    parameters: ComplexArray

    @property
    def box(self) -> FloatArray:
        """Size of the box, (3,) in mm."""
        return self.cell * np.array(self.cells, float)

    def at(self, triangles: ArrayLike, weights: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return points and normals (..., 3) of the surface, over places in triangles.

        Parameters
        ----------
        triangles : (...) int
        weights : (..., 3) float
            Barycentric coordinates. They are taken in h, so that corners are met exactly and edges
            in the same place from both sides, but for edges between two patches.
        """
        t = np.asarray(triangles, np.int64)
        h = (self.parameters[t] * np.asarray(weights, float)).sum(-1)
        points = self.surface.place(self.octants[t], self.shifts[t], h)
        turned = self.surface.turns[self.octants[t]]
        normals = np.einsum("...ij,...j->...i", turned, self.surface.patch.normal(h))
        return self.cell * points, normals


def periodic_film(
    name: str,
    *,
    cell: float,
    cells: Sequence[int] = (1, 1, 1),
    edge_length: float,
    margin: float = 0.0,
    corner: Sequence[float] | None = None,
) -> PeriodicFilm:
    """Return the part of a periodic minimal surface in a box of cells, and a margin around it.

    Parameters
    ----------
    name : str
        "schwarz-p", "schwarz-d" or "gyroid".
    cell : float
        Edge of the cubic cell, in mm.
    cells : (nx, ny, nz)
        Numbers of cells along the axes.
    edge_length : float
        Mean edge of the triangles is at most this, in mm.
    margin : float
        The mesh reaches at least so far beyond the box, in mm, on all sides.
    corner : (3,) float, optional
        Where the box begins, in cells and in the coordinates of `PeriodicSurface`. By default the
        customary cell: P is cut through its necks, in mirror planes that it meets at right angles;
        D in straight lines, which pass through flat points; the gyroid, whose box has no special
        place, so that it stays in one piece and no flat point is on the cut.

    Raises
    ------
    SurfaceError
        If a size is impossible, or the surface touches a face of the box without crossing it.

    Examples
    --------
    >>> import phexfab as px
    >>> film = px.periodic_film("schwarz-p", cell=1000.0, edge_length=100.0)  # mm
    >>> len(film.umbilics), len(film.cut.borders)  # flat points, round openings
    (8, 6)
    """
    surface = periodic_surface(name)
    if not 0 < cell < np.inf:
        raise SurfaceError(f"{name}: the edge of the cubic cell must be positive, not {cell}")
    counts = tuple(cells)
    if len(counts) != 3 or any(
        isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 1 for n in counts
    ):
        raise SurfaceError(
            f"{name}: cells must be three whole numbers of at least 1, not {list(counts)}"
        )
    if not 0 < edge_length < np.inf:
        raise SurfaceError(f"{name}: the edge length must be positive, not {edge_length}")
    if not 0 <= margin < np.inf:
        raise SurfaceError(f"{name}: the margin must not be negative, but is {margin}")
    start = surface.corner if corner is None else np.asarray(corner, float)
    if start.shape != (3,) or not np.isfinite(start).all():
        raise SurfaceError(f"{name}: the corner of the box must be three numbers, not {corner}")
    size = np.array(counts, float)
    # The mean edge of the patch is nearly inverse to n, from above.
    n = max(2, int(np.ceil(2 * cell * _mean_edge(surface, *_hexagon(2)[:2]) / edge_length)))
    octants, shifts = _images(surface, start, size, (margin + 4 * edge_length) / cell)
    if len(octants) * 6 * n * n > _MOST:
        raise SurfaceError(
            f"{name}: edges of {edge_length:g} mm in {counts[0]} × {counts[1]} × {counts[2]} cells "
            f"of {cell:g} mm make more than {_MOST} triangles; choose longer edges or fewer cells"
        )
    h, three, rim = _hexagon(n)
    labels, points = _welded(surface, octants, shifts, h, rim)
    triangles = labels[:, three].reshape(-1, 3)
    keep = _kept(points, triangles, size, (margin + edge_length) / cell)
    used, index = np.unique(triangles[keep], return_inverse=True)
    triangles = index.reshape(-1, 3)
    points = points[used]

    # Each vertex is taken from one of the images that it is on.
    source = np.zeros(int(labels.max()) + 1, np.int64)
    source[labels.ravel()] = np.arange(labels.size)
    image, local = np.divmod(source[used], len(h))
    turns = surface.turns[octants[image]]
    patch = surface.patch
    curvatures = np.maximum(patch.principal_curvatures(h)[:, 1], 0.0)
    directions = np.zeros((len(h), 3))
    flat = h == 0
    curvatures[flat] = 0.0
    directions[~flat] = patch.principal_directions(h[~flat])[:, 0]
    normals = np.einsum("nij,nj->ni", turns, patch.normal(h)[local])
    umbilics = np.flatnonzero(flat[local])

    owner = np.repeat(np.arange(len(octants)), len(three))[keep]
    parameters = np.tile(h[three], (len(octants), 1))[keep]
    tiles = Tiles(
        points=points,
        normals=normals,
        on=np.zeros(len(points), np.int64),
        triangles=triangles,
        octants=octants[owner],
        shifts=shifts[owner],
        parameters=parameters,
    )
    return PeriodicFilm(
        name=name,
        cell=float(cell),
        cells=(int(counts[0]), int(counts[1]), int(counts[2])),
        points=cell * points,
        normals=normals,
        triangles=triangles,
        directions=np.einsum("nij,nj->ni", turns, directions[local]),
        curvatures=curvatures[local] / cell,
        umbilics=umbilics,
        orders=np.ones(len(umbilics), np.int64),
        cut=cut_at_box(surface, tiles, size, cell),
        surface=surface,
        corner=start,
        octants=tiles.octants,
        shifts=tiles.shifts,
        parameters=parameters,
    )


def _hexagon(n: int) -> tuple[ComplexArray, IntArray, BoolArray]:
    """Return the patch as six triangles of n² each about the flat point: h, triangles, its rim."""
    ring = np.repeat(np.arange(1, n + 1), np.arange(1, n + 1))
    step = np.arange(len(ring)) - ring * (ring - 1) // 2
    # Normals along a side run through a quarter of a great circle; in equal steps of the length
    # their angle is half the amplitude of Jacobi's functions of modulus 1/2. The middle of each
    # side is then a centre of symmetry of its vertices, so that neighbouring patches fit.
    angle = ellipj(2 * ellipk(0.25) * step / ring, 0.25)[3] / 2
    normal = np.column_stack([np.sin(angle), np.cos(angle), np.zeros(len(ring))])
    surface = periodic_surface("schwarz-d")
    edge = surface.parameter(np.zeros(len(ring), np.int64), normal, np.ones(len(ring), complex))
    sector = ring / n * edge
    h = np.concatenate([[0], *(sector * np.exp(1j * np.pi / 3 * k) for k in range(6))])
    count = len(ring)

    def vertex(k: int, i: IntArray, j: IntArray) -> IntArray:
        # Row i of sector k ends where that of the next one begins.
        last = j == i
        sectors, j = np.where(last, (k + 1) % 6, k), np.where(last, 0, j)
        return np.where(i == 0, 0, 1 + sectors * count + i * (i - 1) // 2 + j)

    inner = step < ring - 1
    parts = []
    for k in range(6):
        low = vertex(k, ring - 1, step)
        parts.append(np.column_stack([vertex(k, ring, step), vertex(k, ring, step + 1), low]))
        i, j = ring[inner], step[inner]
        beyond = np.column_stack([vertex(k, i, j + 1), vertex(k, i - 1, j + 1), low[inner]])
        parts.append(beyond)
    rim = np.concatenate([[False], np.tile(ring == n, 6)])
    return h, np.concatenate(parts), rim


def _mean_edge(surface: PeriodicSurface, h: ComplexArray, triangles: IntArray) -> float:
    corners = surface.patch.point(h)[triangles]
    return float(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1).mean())


def _images(
    surface: PeriodicSurface, start: FloatArray, size: FloatArray, reach: float
) -> tuple[IntArray, FloatArray]:
    """Return octants and shifts of the patches that come nearer than ``reach`` to the box."""
    extent = np.abs(surface.patch.point(_hexagon(8)[0])).max(axis=0) * 1.02
    octants, shifts = [], []
    for octant, centre in enumerate(surface.centres):
        around = np.abs(surface.turns[octant]) @ extent + reach
        for coset in surface.cosets:
            base = centre + coset - start
            low, high = np.ceil(-around - base), np.floor(size + around - base)
            ranges = [np.arange(a, b + 1) for a, b in zip(low, high, strict=True)]
            steps = np.array(list(itertools.product(*ranges))).reshape(-1, 3)
            octants.append(np.full(len(steps), octant))
            shifts.append(steps + coset - start)
    return np.concatenate(octants), np.concatenate(shifts)


def _welded(
    surface: PeriodicSurface,
    octants: IntArray,
    shifts: FloatArray,
    h: ComplexArray,
    rim: BoolArray,
) -> tuple[IntArray, FloatArray]:
    """Return vertex numbers (images, len(h)) of the welded mesh, and its points."""
    turned = np.einsum("oij,nj->oni", surface.turns, surface.patch.point(h))
    points = turned[octants] + (surface.centres[octants] + shifts)[:, None]
    where = np.flatnonzero(np.tile(rim, len(octants)))
    # Distances along the rim are never below 1e-6 of the cell: see _MOST.
    pairs = where[cKDTree(points.reshape(-1, 3)[where]).query_pairs(1e-9, output_type="ndarray")]
    total = points.shape[0] * points.shape[1]
    same = sp.csr_array((np.ones(len(pairs), np.int8), pairs.T), shape=(total, total))
    labels = connected_components(same, directed=False)[1].astype(np.int64)
    # Numbered in the order of the images, not of the search.
    _, first, labels = np.unique(labels, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), np.int64)
    rank[order] = np.arange(len(order))
    return rank[labels].reshape(len(octants), -1), points.reshape(-1, 3)[first[order]]


def _kept(points: FloatArray, triangles: IntArray, size: FloatArray, reach: float) -> IntArray:
    """Return the triangles near the box, without loose scraps or fans that meet in one vertex."""
    corners = points[triangles]
    low, high = corners.min(axis=1), corners.max(axis=1)
    keep = ((high >= -reach) & (low <= size + reach)).all(axis=1)
    for _ in range(64):
        rows = np.flatnonzero(keep)
        row, side = outer_edges(triangles[rows])
        starts = triangles[rows[row], side]
        pinched = np.bincount(starts, minlength=len(points)) > 1
        if not pinched.any():
            break
        keep |= pinched[triangles].any(axis=1)
    rows = np.flatnonzero(keep)
    i, j = triangles[rows].ravel(), np.roll(triangles[rows], -1, axis=1).ravel()
    links = sp.csr_array((np.ones(len(i), np.int8), (i, j)), shape=(len(points),) * 2)
    part = connected_components(links, directed=False)[1]
    inside = np.flatnonzero(((points > 0) & (points < size)).all(axis=1))
    near = np.intersect1d(inside, triangles[rows])
    return rows[np.isin(part[triangles[rows, 0]], part[near])]

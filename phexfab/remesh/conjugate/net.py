"""A network of two conjugate families of curves on a surface.

Rows and columns are traced, through the points of one base column and one base row; where they
meet are the net's points. A quad of the net is planar to second order in its size.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from phexfab.errors import LatticeError
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.conjugate.base import FINE, Base, most_steps
from phexfab.remesh.conjugate.fields import Fields
from phexfab.remesh.conjugate.trace import Curves, meet, trace
from phexfab.surface.freeform.surface import Bending, FreeformSurface

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class ConjugateNet:
    """Points in which rows (first index) and columns (second) of a conjugate net meet.

    Attributes
    ----------
    base : Base
    rows, columns : (n,), (m,) float
        Arc lengths, mm, at which rows begin on the base column, and columns on the base row.
    there : (n, m) bool
        Whether the two curves meet on the surface.
    points : (n, m, 3) float
        mm, not a number where there is none.
    parameters : (n, m, ·) float
    along, across : (n, m) float
        Arc length on the row, and on the column.
    tangents : (n, m, 2, 3) float
        Unit tangents of row and column.
    bending : Bending
        At the points, (n, m, ...).
    closed : (bool, bool)
        Whether rows close up, and columns.
    ends : dict of str to int
        How many ends of curves lie off the border, by reason.
    curves : (Curves, Curves)
        Rows and columns.
    """

    base: Base
    rows: FloatArray
    columns: FloatArray
    there: BoolArray
    points: FloatArray
    parameters: FloatArray
    along: FloatArray
    across: FloatArray
    tangents: FloatArray
    bending: Bending
    closed: tuple[bool, bool]
    ends: dict[str, int]
    curves: tuple[Curves, Curves]

    @property
    def surface(self) -> FreeformSurface:
        """The surface it lies on."""
        return self.base.fields.surface

    def turned(self) -> ConjugateNet:
        """Return the same net, its columns as rows."""
        return _met(self.base.turned(), self.columns, self.rows, self.curves[::-1])

    def curvatures(self) -> tuple[FloatArray, FloatArray]:
        """Return the (n, m) normal curvatures along rows and columns, 1/mm."""
        a, b = self.tangents[:, :, 0], self.tangents[:, :, 1]
        return self.bending.form(a, a), self.bending.form(b, b)

    def conjugacy(self) -> FloatArray:
        """Return (n, m) |II(a, b)| of the unit tangents over the greater |κ|; 0 is conjugate."""
        a, b = self.tangents[:, :, 0], self.tangents[:, :, 1]
        size = np.abs(self.bending.kappa).max(-1)
        return np.asarray(np.abs(self.bending.form(a, b)) / np.where(size > 0, size, 1.0))

    def every(self, share: int) -> ConjugateNet:
        """Return the net of every so-manieth row and column, from the first."""
        if share == 1:
            return self
        cut = (slice(None, None, share), slice(None, None, share))
        b = self.bending
        return replace(
            self, rows=self.rows[cut[0]], columns=self.columns[cut[1]], there=self.there[cut],
            points=self.points[cut], parameters=self.parameters[cut], along=self.along[cut],
            across=self.across[cut], tangents=self.tangents[cut],
            bending=Bending(b.normals[cut], b.kappa[cut], b.directions[cut]),
        )  # fmt: skip

    def umbilicity(self) -> FloatArray:
        """Return (n, m) |κ₁ − κ₂| over |κ₁| + |κ₂|: 0 at umbilics, 1 where K ≤ 0."""
        kappa = self.bending.kappa
        total = np.abs(kappa).sum(-1)
        return np.abs(kappa[..., 0] - kappa[..., 1]) / np.where(total > 0, total, np.inf)

    def quads(self, *, shortest: float = 0.0, clear: float = 0.0) -> PolyMesh:
        """Return the mesh of the net's quads, counter-clockwise about the surface's normal.

        Its largest piece, if it is in several.

        Parameters
        ----------
        shortest : float
            Quads with a shorter edge are left out, mm.
        clear : float
            So are those with a corner of less ``umbilicity``.

        Raises
        ------
        LatticeError
            If there is no quad.
        """
        n, m = self.there.shape
        j = np.arange(n if self.closed[1] else n - 1)[:, None]
        i = np.arange(m if self.closed[0] else m - 1)[None, :]
        up, right = (j + 1) % n, (i + 1) % m
        corner = [j * m + i, j * m + right, up * m + right, up * m + i]
        faces = np.stack([np.broadcast_to(c, (j.size, i.size)).ravel() for c in corner], axis=1)
        faces = faces[self.there.ravel()[faces].all(axis=1)]
        if shortest > 0 or clear > 0:
            corners = self.points.reshape(-1, 3)[faces]
            sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
            good = (sides >= shortest).all(axis=1)
            faces = faces[good & (self.umbilicity().ravel()[faces] >= clear).all(axis=1)]
        if not len(faces):
            raise LatticeError(f"{self.surface.name}: no quad fits; take a smaller spacing")
        return joined(self.surface, self.points.reshape(-1, 3), faces)[0]


def conjugate_net(base: Base, rows: ArrayLike, columns: ArrayLike) -> ConjugateNet:
    """Return the net of the curves that begin at arc lengths of the base column and row.

    Parameters
    ----------
    base : Base
    rows : (n,) increasing arc lengths on the base column
    columns : (m,) increasing arc lengths on the base row

    Raises
    ------
    LatticeError
        If there are fewer than two of either, or they lie beyond the base curves.

    Notes
    -----
    Where a row closes, ``columns`` begin with 0 and end before its length.
    """
    t, s = np.asarray(rows, float), np.asarray(columns, float)
    fields, step = base.fields, base.step
    for values, which, name in ((t, 1, "rows"), (s, 0, "columns")):
        low, high = base.reach(which)
        if len(values) < 2 or np.any(np.diff(values) <= 0):
            raise LatticeError(f"{fields.surface.name}: {name} must be two or more, increasing")
        if values[0] < low - 1e-9 * step or values[-1] > high + 1e-9 * step:
            raise LatticeError(
                f"{fields.surface.name}: {name} from {values[0]:.6g} to {values[-1]:.6g} mm lie "
                f"beyond the base curve, {low:.6g} to {high:.6g} mm"
            )
    most = most_steps(fields.surface, step)
    begun = [_begin(base, t, 1), _begin(base, s, 0)]
    signs = [_signs(base, begun[0], t, 1), _signs(base, begun[1], s, 0)]
    across = trace(fields, begun[0], 0, step, most, forward=base.closed(0), signs=signs[0])
    upward = trace(fields, begun[1], 1, step, most, forward=base.closed(1), signs=signs[1])
    return _met(base, t, s, (across, upward))


def _met(base: Base, t: FloatArray, s: FloatArray, curves: tuple[Curves, Curves]) -> ConjugateNet:
    """Return the net of rows and columns that are traced already."""
    fields, (across, upward) = base.fields, curves
    along, over, there = _crossings(base, across, upward, t, s)
    n, m = there.shape
    j, i = (a.ravel() for a in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    got = there.ravel()
    u = np.full((n * m, across.parameters.shape[-1]), np.nan)
    points = np.full((n * m, 3), np.nan)
    tangents = np.full((n * m, 2, 3), np.nan)
    jj, ii = j[got], i[got]
    p, right = across.at(jj, along.ravel()[got])
    q, up = upward.at(ii, over.ravel()[got])
    u[got] = fields.surface.nearest((p + q) / 2, across.nearby(jj, along.ravel()[got]))
    here = fields.at(u[got])
    ahead = (here.pair * np.stack([right, up], axis=1)).sum(-1)
    points[got] = here.points
    tangents[got] = here.pair * np.where(ahead < 0, -1.0, 1.0)[..., None]
    closed = (base.closed(0), base.closed(1))
    return ConjugateNet(
        base, t, s, there, points.reshape(n, m, 3), u.reshape(n, m, -1), along, over,
        tangents.reshape(n, m, 2, 3), _spread(here.bending, got, (n, m)), closed,
        _ends(fields, across, upward), curves,
    )  # fmt: skip


def joined(
    surface: FreeformSurface, points: FloatArray, faces: IntArray
) -> tuple[PolyMesh, IntArray, IntArray]:
    """Return the largest piece of faces (f, k), the vertices it uses, and its faces.

    Pieces hang together by edges. Faces run counter-clockwise about the surface's normal.
    """
    f, k = faces.shape
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=-1).reshape(-1, 2), axis=1)
    key = ends[:, 0] * len(points) + ends[:, 1]
    order = np.argsort(key, kind="stable")
    pair = np.flatnonzero(np.diff(key[order]) == 0)
    owner = np.repeat(np.arange(f), k)[order]
    link = coo_array((np.ones(len(pair)), (owner[pair], owner[pair + 1])), shape=(f, f))
    label = connected_components(link, directed=False)[1]
    kept = np.flatnonzero(label == np.bincount(label).argmax())
    used, corner = np.unique(faces[kept], return_inverse=True)
    corner = corner.reshape(len(kept), k)
    vertices = points[used]
    normal = surface.normal(surface.nearest(vertices[corner[0]].mean(axis=0)))
    ring = vertices[corner[0]] - vertices[corner[0, 0]]
    if np.cross(ring, np.roll(ring, -1, axis=0)).sum(axis=0) @ normal < 0:
        corner = corner[:, ::-1]
    starts = np.arange(0, corner.size + 1, k)
    mesh = PolyMesh(vertices, np.ascontiguousarray(corner).ravel().astype(np.int64), starts)
    return mesh, used, kept


def _signs(base: Base, u: FloatArray, values: FloatArray, which: int) -> FloatArray:
    """Return ±1, of the other family's fields at points of the base row (0) or column (1).

    Fields have directions up to sign, to both families the same one; so that all curves run the
    way of the base curve that they accompany.
    """
    curves, zero = (base.row, base.column), np.zeros(len(values), np.int64)

    def along(u: FloatArray, number: int, s: FloatArray) -> FloatArray:
        ahead = (base.fields.at(u).pair[:, number] * curves[number].at(zero[: len(s)], s)[1]).sum(1)
        return np.where(ahead < 0, -1.0, 1.0)

    origin = [base.row.parameters[:, base.row.origin], np.zeros(1)]
    hand = along(origin[0], 0, origin[1]) * along(origin[0], 1, origin[1])
    return along(u, which, values) * hand


def _begin(base: Base, values: FloatArray, which: int) -> FloatArray:
    """Return the parameters of points of the base row (0) or column (1)."""
    curve = (base.row, base.column)[which]
    zero = np.zeros(len(values), np.int64)
    points = curve.at(zero, values)[0]
    return base.fields.surface.nearest(points, curve.nearby(zero, values))


def _crossings(
    base: Base, rows: Curves, columns: Curves, t: FloatArray, s: FloatArray
) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return (n, m) arc lengths on rows and columns where they meet, and whether they do.

    From the base row outwards: where columns go on from the row before, the row's nearest sample
    is the guess.
    """
    n, m = len(t), len(s)
    along, over = np.full((n, m), np.nan), np.full((n, m), np.nan)
    there = np.zeros((n, m), bool)
    begin = int(np.argmin(np.abs(t)))
    all_columns = np.arange(m)
    for way in (1, -1):
        guess, height = s.copy(), np.full(m, 0.0)
        open_ = np.ones(m, bool)
        last = 0.0
        order = range(begin, n) if way == 1 else range(begin - 1, -1, -1)
        for j in order:
            i = all_columns[open_]
            ahead = height[i] + t[j] - last
            near = rows.nearest(j, columns.at(i, ahead)[0], guess[i])
            found = meet(rows, columns, np.full(len(i), j), i, near, ahead, base.step * FINE)
            good = found[2]
            along[j, i[good]], over[j, i[good]] = found[0][good], found[1][good]
            there[j, i[good]] = True
            guess[i[good]], height[i[good]] = found[0][good], found[1][good]
            height[i[~good]] += t[j] - last
            last = t[j]
    return along, over, there


def _spread(bending: Bending, got: BoolArray, shape: tuple[int, int]) -> Bending:
    """Return the bending of the points there are as a grid with holes."""

    def grid(values: FloatArray) -> FloatArray:
        out = np.full((len(got), *values.shape[1:]), np.nan)
        out[got] = values
        return out.reshape(*shape, *values.shape[1:])

    return Bending(grid(bending.normals), grid(bending.kappa), grid(bending.directions))


def _ends(fields: Fields, *families: Curves) -> dict[str, int]:
    why = np.concatenate([curves.ends.ravel() for curves in families])
    kinds, counts = np.unique(why[why > 0], return_counts=True)
    return {fields.reason(int(k)): int(c) for k, c in zip(kinds, counts, strict=True)}

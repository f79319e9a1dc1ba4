"""The triangular lattice in curvature-line coordinates on a mesh of any topology.

On a surface with holes, handles and umbilics w = ∫√Q is a function only up to half-turns and
translations. A lattice closes up everywhere when every umbilic is a lattice point and every
translation a lattice vector. So w̃ is sought, as near to w as possible, with such translations:

    minimise Σ_T ω_T · area_T · |∇w̃ − √Q_T|²,

first over real translations, one sparse solve that also shows how the energy grows with each of
them; then over whole ones, the nearest point of a lattice in that metric, for lattice steps and
row ratios near those asked for. Translations are integers from there on, so the result is closed
exactly.

The weight ω = 1 + (r/D)², D the distance from the nearest umbilic in w and r three lattice steps,
keeps w̃ near w up to a constant at umbilics. Without it a value prescribed at an umbilic of even
order makes a spike (a point has no capacity in the plane; with this weight it has), and around one
of odd order the correction, which grows with the square root of the distance, would outdo w
itself.

References
----------
Bommes, Zimmer, Kobbelt 2009, "Mixed-integer quadrangulation"; Kälberer, Nieser, Polthier 2007,
"QuadCover".
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.csgraph import dijkstra

from phexfab.errors import LatticeError
from phexfab.remesh.lattice import check_directions
from phexfab.remesh.mesh_lattices.cut_graph import Cut, cut_open
from phexfab.remesh.mesh_lattices.line_field import LineField, line_field
from phexfab.remesh.mesh_lattices.poisson import (
    SeamSystem,
    lattice_basis,
    roundings,
    umbilic_weights,
)
from phexfab.remesh.mesh_lattices.umbilics import edge_graph, lattice_step, with_umbilics
from phexfab.triangular import EQUILATERAL

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
ComplexArray = NDArray[np.complex128]

_RATIOS = 1 + np.linspace(-0.04, 0.04, 9)
_TRIALS = 8  # roundings that are tried in full


@dataclass(frozen=True, eq=False)
class Seamless:
    """A seamless parametrisation in lattice coordinates.

    A lattice vector (m, n) is ``step·((m + n/2) + i·row_ratio·n)`` in w̃, times i for rows along v.

    Attributes
    ----------
    given : LineField
        As given, and ``field``: with its umbilics made vertices.
    cut : Cut
    corners : (m, 3, 2) int64
        Lattice coordinates of the triangles' corners, in units of ``1/unit``.
    flip : (3m,) int, shift : (3m, 2) int64
        Across a half-edge the coordinates x become ``flip·x + shift`` (shift in units too).
    unit : int
        A power of two.
    step, row_ratio : float
        As rounded; step in √mm.
    rows_along : str
    strain : float
        Root mean square of ``|∇w̃ − √Q|/|√Q|``.
    """

    given: LineField
    field: LineField
    cut: Cut
    corners: IntArray
    flip: IntArray
    shift: IntArray
    unit: int
    step: float
    row_ratio: float
    rows_along: str
    strain: float


def seamless(
    points: ArrayLike,
    triangles: ArrayLike,
    normals: ArrayLike,
    directions: ArrayLike,
    curvatures: ArrayLike,
    *,
    panel_size: float,
    row_ratio: float = EQUILATERAL,
    rows_along: str = "u",
    kind: str = "face",
) -> Seamless:
    """Return coordinates on a mesh in which a lattice closes up around everything.

    Parameters
    ----------
    points : (n, 3), mm
    triangles : (m, 3) int
        Counter-clockwise about the normals, in one piece; border, holes and handles at will.
    normals, directions : (n, 3)
        Unit normals; tangents of the u-line (curvature −κ), of any sign.
    curvatures : (n,)
        κ >= 0 in 1/mm.
    panel_size : float
        Median distance of neighbouring panel centres, mm; changed by up to 15 %.
    row_ratio : float
        Row distance over step; changed by up to 4 % for kind ``"face"`` if that closes better.
    rows_along : ``"u"`` or ``"v"``
    kind : ``"face"``, ``"edge"`` or ``"vertex"``
        Offset type of the shell to be built.

    Raises
    ------
    MeshError
        If the mesh or its directions are malformed, or too coarse at an umbilic.
    LatticeError
        If no lattice of that size closes without folding over; the message names the place.
    """
    return next(
        closings(
            points,
            triangles,
            normals,
            directions,
            curvatures,
            panel_size=panel_size,
            row_ratio=row_ratio,
            rows_along=rows_along,
            kind=kind,
        )
    )


def closings(
    points: ArrayLike,
    triangles: ArrayLike,
    normals: ArrayLike,
    directions: ArrayLike,
    curvatures: ArrayLike,
    *,
    panel_size: float,
    row_ratio: float = EQUILATERAL,
    rows_along: str = "u",
    kind: str = "face",
) -> Iterator[Seamless]:
    """Yield coordinates in which a lattice closes up, the least strained first; see `seamless`.

    Raises
    ------
    MeshError, LatticeError
        As `seamless`, before anything is yielded.
    """
    if rows_along not in ("u", "v"):
        raise LatticeError(f"lattice.rows_along = {rows_along!r}: choose 'u' or 'v'")
    check_directions(row_ratio, 0.0)
    plain = line_field(points, triangles, normals, directions, curvatures)
    step = lattice_step(plain, panel_size, row_ratio)
    field = with_umbilics(plain, step)
    cut = cut_open(field)
    system = SeamSystem(field, cut, umbilic_weights(field, step))
    ratios = row_ratio * (_RATIOS if kind == "face" else np.ones(1))
    ratios = ratios[ratios > 0.55] if (ratios > 0.55).any() else np.array([row_ratio])
    folded: tuple[Seamless, IntArray] | None = None
    none = True
    for _, a, r, whole in roundings(system, step, row_ratio, ratios, rows_along)[:_TRIALS]:
        values = system.corners(whole @ lattice_basis(a, r, rows_along))
        done = _exact(plain, field, cut, values, whole, a, r, rows_along)
        bad = folds(done)
        if not len(bad):
            none = False
            yield done
        elif folded is None or len(bad) < len(folds(folded[0])):
            folded = (done, whole)
    if folded is None:
        return
    mended = _stiffened(*folded, system)
    bad = folds(mended)
    if not len(bad):
        yield mended
    elif none:
        raise LatticeError(_too_coarse(mended, bad, panel_size))


def folds(on: Seamless) -> IntArray:
    """Return the triangles that are folded over, or have no area, in lattice coordinates."""
    x = on.corners
    a, b = x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]
    return np.flatnonzero(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0] <= 0)


def _exact(
    given: LineField,
    field: LineField,
    cut: Cut,
    values: ComplexArray,
    whole: IntArray,
    step: float,
    row_ratio: float,
    rows_along: str,
) -> Seamless:
    """Put w̃ on a grid of binary fractions of a lattice step, where seams close exactly."""
    first, second = lattice_basis(step, row_ratio, rows_along)
    back = np.linalg.inv(np.array([[first.real, second.real], [first.imag, second.imag]]))
    flat = np.stack([values.real, values.imag], axis=-1) @ back.T
    extent = float(np.abs(flat - flat[:, :1]).max())
    unit = 2 ** int(28 - np.ceil(np.log2(max(extent, 1.0) + 1)))
    # Each vertex is rounded once; its copies follow by signs and whole translations.
    offsets = np.asarray(cut.whole @ whole, np.int64).reshape(-1, 2)
    vertex = field.triangles.ravel()
    own = (flat.reshape(-1, 2) - offsets) * cut.sign[:, None]
    at = np.zeros((len(field.points), 2))
    at[vertex] = own
    at[cut.fixed] = 0.0
    grid = np.rint(at * unit).astype(np.int64)
    corners = cut.sign[:, None] * grid[vertex] + offsets * unit
    shift = np.asarray(cut.shift @ whole, np.int64).reshape(-1, 2) * unit
    steps = field.steps * cut.signs[:, None]
    gap = np.roll(values, -1, axis=1) - values - steps
    strain = float(
        np.sqrt(
            (field.cotangents * np.abs(gap) ** 2).sum()
            / (field.cotangents * np.abs(steps) ** 2).sum()
        )
    )
    return Seamless(
        given,
        field,
        cut,
        corners.reshape(-1, 3, 2),
        cut.flip,
        shift,
        unit,
        step,
        row_ratio,
        rows_along,
        strain,
    )


def jacobians(on: Seamless) -> FloatArray:
    """Return (m, 2, 2) derivatives of w̃ by w in every triangle, both with real coordinates."""
    first, second = lattice_basis(on.step, on.row_ratio, on.rows_along)
    frame = np.array([[first.real, second.real], [first.imag, second.imag]])
    x = on.corners / on.unit @ frame.T
    steps = on.field.steps * on.cut.signs[:, None]
    source = np.stack([steps[:, 0], -steps[:, 2]], axis=1)
    source_2 = np.stack([source.real, source.imag], axis=1)
    image = np.stack([x[:, 1] - x[:, 0], x[:, 2] - x[:, 0]], axis=2)
    det = source_2[:, 0, 0] * source_2[:, 1, 1] - source_2[:, 0, 1] * source_2[:, 1, 0]
    inverse = np.empty_like(source_2)
    inverse[:, 0, 0], inverse[:, 1, 1] = source_2[:, 1, 1], source_2[:, 0, 0]
    inverse[:, 0, 1], inverse[:, 1, 0] = -source_2[:, 0, 1], -source_2[:, 1, 0]
    return np.asarray(image @ (inverse / det[:, None, None]))


def _stiffened(on: Seamless, whole: IntArray, system: SeamSystem) -> Seamless:
    """Repeat the solve with more weight where triangles are folded or strained most."""
    weights = system.weights.copy()
    basis = lattice_basis(on.step, on.row_ratio, on.rows_along)
    best, least = on, len(folds(on))
    now = on
    for _ in range(8):
        strain = np.linalg.norm(jacobians(now) - np.eye(2), axis=(1, 2))
        strain[folds(now)] = np.maximum(strain[folds(now)], 2.0)
        near = np.zeros(system.n)  # spread to the triangles beside
        np.maximum.at(near, on.field.triangles.ravel(), np.repeat(strain, 3))
        weights *= 1 + np.minimum(near[on.field.triangles].max(axis=1), 5.0) ** 2
        again = SeamSystem(on.field, on.cut, weights)
        values = again.corners(whole @ basis)
        now = _exact(
            on.given, on.field, on.cut, values, whole, on.step, on.row_ratio, on.rows_along
        )
        if len(folds(now)) < least:
            best, least = now, len(folds(now))
        if not least:
            break
    return best


def _too_coarse(on: Seamless, bad: IntArray, panel_size: float) -> str:
    """Say where the lattice folds over, beside which umbilics, and what size would do."""
    field = on.field
    place = field.points[field.triangles[bad]].mean(axis=(0, 1))
    text = (
        f"lattice.panel_size = {panel_size:g}: panels are too coarse near "
        f"({place[0]:.0f}, {place[1]:.0f}, {place[2]:.0f}) mm, where the lattice would fold over "
        f"({len(bad)} of {len(field.triangles)} triangles)"
    )
    if not len(field.cones):
        return text + f"; try {panel_size / 2:.3g} mm"
    away = np.linalg.norm(field.points[field.cones] - place, axis=1)
    order = np.argsort(away, kind="stable")[:2]
    names = " and ".join(
        "({:.0f}, {:.0f}, {:.0f})".format(*field.points[field.cones[k]]) for k in order
    )
    if len(order) < 2:
        return text + f", beside the umbilic at {names}; try {panel_size / 2:.3g} mm"
    apart = float(np.linalg.norm(np.subtract(*field.points[field.cones[order]])))
    graph = edge_graph(field, np.abs(field.edge_steps))
    steps = float(dijkstra(graph, indices=field.cones[order[0]])[field.cones[order[1]]]) / on.step
    size = panel_size * min(0.7, steps / 2)
    return text + (
        f", between the umbilics at {names}, which are {apart:.0f} mm or {steps:.1f} lattice steps "
        f"apart; about {size:.3g} mm would do"
    )

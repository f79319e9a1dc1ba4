"""Planar conformal hexagon meshes: one conformal hexagon, repeated by two commuting similarities.

For a conformal hexagon z₀…z₅ the similarities α: (z₄, z₅) → (z₂, z₁) and β: (z₃, z₄) → (z₁, z₀)
commute, and the images βᵏαˡ(zᵢ) fit together without gaps. They are both translations (case 1:
the mesh discretises z), or turn about one fixed point: α a rotation and β²α⁻¹ a dilation (case 2:
e^{az}), or neither (case 3: e^{(a+ib)z}). Of a circular hexagon all images are circular, and the
mesh has planar faces on the sphere, too.

References
----------
Thesis §5.3.2, §7.2.1; Müller 2011, "Conformal hexagonal meshes", Geom. Dedicata 154.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq

from phexfab.errors import MeshError
from phexfab.mesh.measures import edges
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.conformal.hexagons import circular_defect, conformal_defect

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
BoolArray = NDArray[np.bool_]

_TRANSLATION = 1e-12  # |factor − 1| below which a similarity has no use of its fixed point


@dataclass(frozen=True)
class Similarity:
    """z → factor·z + shift, orientation preserving."""

    factor: complex
    shift: complex

    @classmethod
    def between(cls, start: ComplexArray, end: ComplexArray) -> Similarity:
        """Return the one that takes two points (2,) to two others (2,)."""
        factor = (end[1] - end[0]) / (start[1] - start[0])
        return cls(complex(factor), complex(end[0] - factor * start[0]))

    @property
    def is_translation(self) -> bool:
        """Whether the factor is 1 up to rounding."""
        return abs(self.factor - 1) < _TRANSLATION

    @property
    def fixed_point(self) -> complex:
        """The point that stays; of a translation, infinity."""
        return complex(np.inf) if self.is_translation else self.shift / (1 - self.factor)

    def __call__(self, z: ArrayLike) -> ComplexArray:
        """Return the images of points."""
        return np.asarray(self.factor * np.asarray(z, complex) + self.shift)

    def after(self, other: Similarity) -> Similarity:
        """Return self ∘ other."""
        return Similarity(self.factor * other.factor, self.factor * other.shift + self.shift)


def similarities(hexagon: ArrayLike) -> tuple[Similarity, Similarity]:
    """Return α: (z₄, z₅) → (z₂, z₁) and β: (z₃, z₄) → (z₁, z₀) of a hexagon (6,) complex.

    They commute if the hexagon is conformal.
    """
    z = np.asarray(hexagon, complex)
    return (
        Similarity.between(z[[4, 5]], z[[2, 1]]),
        Similarity.between(z[[3, 4]], z[[1, 0]]),
    )


def orbit(
    alpha: Similarity, beta: Similarity, z: complex, rows: ArrayLike, columns: ArrayLike
) -> ComplexArray:
    """Return βᵏαˡ(z) for whole numbers k (rows) and l (columns), of any shape."""
    along, moved = _power(alpha, columns)
    across, lifted = _power(beta, rows)
    return np.asarray(across * (along * z + moved) + lifted, complex)


def _power(of: Similarity, times: ArrayLike) -> tuple[ComplexArray, ComplexArray]:
    """Return factors and shifts of powers; not about the fixed point, which may be far away."""
    n, d = np.asarray(times, float), of.factor - 1
    # numpy's own log1p of complex numbers loses digits near 0.
    size = 0.5 * np.log1p(d.real * (2 + d.real) + d.imag**2)
    logarithm = n * complex(size, np.arctan2(d.imag, 1 + d.real))
    grown = np.expm1(logarithm)
    return 1 + grown, of.shift * (grown / d if d else n)


@dataclass(frozen=True, eq=False)
class PlanarConformal:
    """A planar conformal mesh.

    Attributes
    ----------
    mesh : PolyMesh
        In the plane z = 0; face ``k·columns + l`` is βᵏαˡ of the hexagon, its corners in the
        hexagon's order where that runs counter-clockwise, else in the opposite one.
    alpha, beta : Similarity
    twice : (E,) bool
        The edges of ``phexfab.mesh.measures.edges(mesh)`` that have coefficient 2 in the dual:
        those between neighbours along α.
    case : int
        1, 2 or 3: see the module.
    columns, rows : int
    circular : bool
    """

    mesh: PolyMesh
    alpha: Similarity
    beta: Similarity
    twice: BoolArray
    case: int
    columns: int
    rows: int
    circular: bool

    @cached_property
    def points(self) -> ComplexArray:
        """(V,) the vertices as complex numbers."""
        return np.asarray(self.mesh.vertices[:, 0] + 1j * self.mesh.vertices[:, 1])

    def derived_quads(self, z: complex, m: ArrayLike, n: ArrayLike) -> ComplexArray:
        """Return α^{m−n}β^{2n}(z), which samples the discretised function at m + i·n·(aspect).

        In case 1 that is affine in m and n, in the others an exponential function.

        References
        ----------
        Thesis §7.2.1.
        """
        m, n = np.asarray(m), np.asarray(n)
        return orbit(self.alpha, self.beta, z, 2 * n, m - n)


def case_of(alpha: Similarity, beta: Similarity) -> int:
    """Return the thesis' case, 1, 2 or 3, of commuting similarities.

    Case 2 counts in either direction: one of α and β²α⁻¹ is a rotation, the other a dilation.
    (The thesis has β itself for the dilation, but its derived quads step by β²α⁻¹.)

    References
    ----------
    Thesis §7.2.1.
    """
    if alpha.is_translation and beta.is_translation:
        return 1
    a, c = np.log(alpha.factor), np.log(beta.factor**2 / alpha.factor)
    small = 1e-12 * (abs(a) + abs(c))
    rotates = abs(a.real) <= small and abs(c.imag) <= small
    dilates = abs(a.imag) <= small and abs(c.real) <= small
    return 2 if rotates or dilates else 3


def planar_conformal_mesh(
    hexagon: ArrayLike, columns: int, rows: int, *, closed: bool = False
) -> PlanarConformal:
    """Return the mesh βᵏαˡ(zᵢ), 0 ≤ k < rows, 0 ≤ l < columns, of a conformal hexagon.

    Parameters
    ----------
    hexagon : (6,) complex
        Conformal; circular if the mesh is to be, see ``conformal_hexagon`` and
        ``phexfab.remesh.conformal.hexagons.complete_hexagon``.
    columns, rows : int
        Hexagons along α and along β.
    closed : bool
        Join the last column to the first: α^columns must be the identity (``ring_tilt``).

    Raises
    ------
    MeshError
        If the hexagon is not conformal, has no area, or the ring does not close.

    References
    ----------
    Thesis §5.3.2.
    """
    z = np.asarray(hexagon, complex)
    miss = float(conformal_defect(z))
    if z.ndim != 1 or not miss <= 1e-9:
        raise MeshError(
            f"the hexagon's cross-ratios miss −1/2 by {miss:.1e}: α and β do not commute; make it "
            "with complete_hexagon or conformal_hexagon"
        )
    if columns < 1 or rows < 1:
        raise MeshError(f"columns = {columns}, rows = {rows}: at least one of each is needed")
    area = float(np.sum(np.imag(z.conj() * np.roll(z, -1))))
    if area == 0:
        raise MeshError("the hexagon has no area")
    alpha, beta = similarities(z)
    if closed:
        gap = abs(alpha.factor**columns - 1)
        if alpha.is_translation or not gap <= 1e-9:
            raise MeshError(
                f"α^{columns} is not the identity (off by {gap:.1e}): the ring does not close; "
                "take conformal_hexagon(ring_tilt(columns)) or closed = False"
            )
    around = columns if closed else columns + 1
    k, l = np.meshgrid(np.arange(rows + 1), np.arange(around), indexing="ij")
    # Two vertices for each cell: z4 of hexagon (k, l), and z1 of hexagon (k − 1, l − 1).
    one = orbit(alpha, beta, z[4], k, l)
    two = orbit(alpha, beta, z[1], k - 1, l - 1)
    points = np.concatenate([one.ravel(), two.ravel()])
    row, column = (
        x.ravel() for x in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    )

    def first(dk: int, dl: int) -> NDArray[np.int64]:
        return (row + dk) * around + (column + dl) % around

    second = (rows + 1) * around
    faces = np.column_stack(
        [
            first(1, 0),
            second + first(1, 1),
            first(0, 1),
            second + first(0, 1),
            first(0, 0),
            second + first(1, 0),
        ]
    )
    pairs = np.concatenate([faces[:, [1, 2]], faces[:, [4, 5]]])
    if area < 0:
        faces = faces[:, ::-1]
    used, corners = np.unique(faces.ravel(), return_inverse=True)
    place = np.column_stack([points.real, points.imag, np.zeros(len(points))])[used]
    mesh = PolyMesh(place, corners.reshape(-1).astype(np.int64), 6 * np.arange(len(faces) + 1))
    n = len(used)
    pairs = np.sort(np.searchsorted(used, pairs), axis=1)
    all_edges = edges(mesh)
    twice = np.isin(all_edges[:, 0] * n + all_edges[:, 1], pairs[:, 0] * n + pairs[:, 1])
    circular = bool(circular_defect(z) <= 1e-9)
    return PlanarConformal(mesh, alpha, beta, twice, case_of(alpha, beta), columns, rows, circular)


def on_sphere(
    planar: PlanarConformal, *, size: float = 1.0, about: complex | None = None
) -> PolyMesh:
    """Return the mesh on the unit sphere, by stereographic projection from the north pole.

    Cross-ratios stay, so it is conformal; its faces are planar because they are circular.

    Parameters
    ----------
    planar : PlanarConformal
    size : float
        Scale in the plane, before projecting.
    about : complex, optional
        The point of the plane that goes to the south pole: the fixed point of the similarities,
        or the middle in case 1.

    Raises
    ------
    MeshError
        If the mesh is not circular: its faces would not be planar.
    """
    if not planar.circular:
        raise MeshError(
            "the hexagon is not circular, so its images on the sphere are not planar; choose its "
            "four corners on a circle"
        )
    z = planar.points
    if about is None:
        far = planar.alpha if planar.beta.is_translation else planar.beta
        about = complex(z.mean()) if far.is_translation else far.fixed_point
    w = size * (z - about)
    power = np.abs(w) ** 2
    lifted = np.column_stack([2 * w.real, 2 * w.imag, power - 1]) / (power + 1)[:, None]
    # Seen from outside, the projection turns orientation around.
    turned = planar.mesh.corners.reshape(-1, 6)[:, ::-1].ravel()
    return PolyMesh(lifted, turned, planar.mesh.starts)


def conformal_hexagon(tilt: complex = 0.0) -> tuple[ComplexArray, complex, float]:
    """Return a circular conformal hexagon (6,), the centre and the radius of its circle.

    It is the image of the regular hexagon e^{iπk/3} under z → z/(1 − tilt·z), |tilt| < 1.
    """
    if not abs(tilt) < 1:
        raise MeshError(f"tilt = {tilt}: its modulus must be below 1")
    z = np.exp(1j * np.pi * np.arange(6) / 3)
    shrink = 1 / (1 - abs(tilt) ** 2)
    return z / (1 - tilt * z), np.conj(tilt) * shrink, float(shrink)


def ring_tilt(n: int) -> float:
    """Return the tilt whose mesh closes after ``n`` hexagons along α (thesis' case 2).

    For a real tilt α is a rotation and β²α⁻¹ a dilation; ``n`` rotations make a full turn.
    """
    if n < 5:
        raise MeshError(f"a conformal ring needs at least 5 hexagons around, not {n}")

    def miss(size: float) -> float:
        alpha, _ = similarities(conformal_hexagon(size)[0])
        return float(np.angle(alpha.factor) - 2 * np.pi / n)

    return float(brentq(miss, 1e-9, 0.9, xtol=1e-16, rtol=1e-15))

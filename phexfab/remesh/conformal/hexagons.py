"""Conformal hexagons: cross-ratio, multi-ratio, the dual, and the properties that describe them.

Points of the plane are complex numbers. A conformal hexagon z₀…z₅ consists of two quads on its
diagonal z₀z₃ with cross-ratio −1/2 each, as half the regular hexagon has. All functions take any
number of polygons at once, the corners along the last axis.

References
----------
Thesis §5.3.1, §5.3.3; Müller 2011, "Conformal hexagonal meshes", Geom. Dedicata 154.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import MeshError

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

DUAL_COEFFICIENTS = np.array([-1.0, 2.0, -1.0, -1.0, 2.0, -1.0])
"""Of the edges aₖ in the dual: ``aₖ* = cₖ aₖ/|aₖ|²``."""


def cross_ratio(quads: ArrayLike) -> ComplexArray:
    """Return (z₀−z₁)(z₂−z₃)/((z₁−z₂)(z₃−z₀)) of quads (..., 4) of complex numbers.

    Möbius invariant; real exactly where the four points lie on a circle or a line.
    """
    z = _polygons(quads, 4)
    return multi_ratio(z)


def multi_ratio(polygons: ArrayLike) -> ComplexArray:
    """Return (z₀−z₁)(z₂−z₃)…/((z₁−z₂)(z₃−z₄)…) of polygons (..., n), n even.

    Möbius invariant; real exactly where the polygon is quasi-circular.

    Raises
    ------
    MeshError
        If n is odd or below 4.
    """
    z = _polygons(polygons)
    n = z.shape[-1]
    if n < 4 or n % 2:
        raise MeshError(f"the multi-ratio needs an even number of corners, 4 or more, not {n}")
    # Factor by factor: whole products of long polygons leave the range of floating point.
    edges = z - np.roll(z, -1, axis=-1)
    return np.asarray(np.prod(edges[..., 0::2] / edges[..., 1::2], axis=-1), complex)


def spatial_cross_ratio(quads: ArrayLike) -> ComplexArray:
    """Return the cross-ratio of quads (..., 4, 3) in space, its imaginary part not negative.

    On any sphere or plane through the four points it is the complex cross-ratio there, up to
    conjugation. It is the real part and the length of the vector part of the product
    (p₀−p₁)(p₁−p₂)⁻¹(p₂−p₃)(p₃−p₀)⁻¹ of quaternions.

    References
    ----------
    Bobenko, Pinkall 1996, "Discrete isothermic surfaces", sec. 4.
    """
    p = np.asarray(quads, float)
    if p.shape[-2:] != (4, 3):
        raise MeshError(f"quads in space are arrays (..., 4, 3), not {p.shape}")
    e = p - np.roll(p, -1, axis=-2)
    over, under = e[..., 0::2, :], e[..., 1::2, :]
    size = np.sum(under * under, axis=-1)
    real = np.sum(over * under, axis=-1) / size
    vector = -np.cross(over, under) / size[..., None]
    (r, s), (v, w) = np.moveaxis(real, -1, 0), np.moveaxis(vector, -2, 0)
    length = np.linalg.norm(r[..., None] * w + s[..., None] * v + np.cross(v, w), axis=-1)
    return np.asarray(r * s - np.sum(v * w, axis=-1) + 1j * length, complex)


def circular_defect(polygons: ArrayLike) -> FloatArray:
    """Return the largest |sine| of the cross-ratios of four neighbours; 0 on a circle.

    Parameters
    ----------
    polygons : (..., n) complex, n ≥ 4
    """
    z = _polygons(polygons)
    four = np.stack([np.roll(z, -k, axis=-1) for k in range(4)], axis=-1)
    return np.asarray(_sine(cross_ratio(four)).max(axis=-1))


def quasi_circular_defect(polygons: ArrayLike) -> FloatArray:
    """Return the |sine| of the multi-ratio; 0 where a parallel polygon lies on a circle.

    Parameters
    ----------
    polygons : (..., n) complex, n even
    """
    return _sine(multi_ratio(polygons))


def circular_parallel(polygon: ArrayLike, tolerance: float = 1e-9) -> ComplexArray:
    """Return a polygon on the unit circle whose edges are parallel to those of a given one.

    Corners e^{iθₖ} have the edge direction φₖ where θₖ + θₖ₊₁ = 2φₖ + π (mod 2π), so the first
    corner gives all others. Of the polygons that there are (turn the first corner), this one has
    the largest scalar product of its edges with the given ones.

    Parameters
    ----------
    polygon : (n,) complex, n even

    Returns
    -------
    (n,) complex

    Raises
    ------
    MeshError
        If the polygon is not quasi-circular.

    References
    ----------
    Thesis §5.3.1, §6.1.
    """
    z = _polygons(polygon)
    miss = float(quasi_circular_defect(z))
    if not miss <= tolerance:
        raise MeshError(
            f"no polygon on a circle is parallel to this one: its multi-ratio {multi_ratio(z):.6g} "
            f"is not real (sine {miss:.1e})"
        )
    edges = np.roll(z, -1) - z
    unit = edges / np.abs(edges)
    # e^{iθₖ₊₁} = −uₖ² e^{−iθₖ}; beginning at 1, corner k of the family is fₖ t or fₖ / t.
    factors = np.ones(len(z), complex)
    for k in range(len(z) - 1):
        factors[k + 1] = -(unit[k] ** 2) / factors[k]
    even = np.arange(len(z)) % 2 == 0
    # Σ ēₖ (pₖ₊₁ − pₖ) = Σ pₖ (ēₖ₋₁ − ēₖ), real up to the defect: largest for t against its sum.
    weight = (np.roll(edges, 1) - edges).conj() * factors
    turn = np.conj(np.sum(weight[even]) + np.conj(np.sum(weight[~even])))
    turn = turn / abs(turn) if abs(turn) > 0 else 1.0
    return np.asarray(factors * np.where(even, turn, np.conj(turn)), complex)


def conformal_defect(hexagons: ArrayLike) -> FloatArray:
    """Return the larger |cross-ratio + 1/2| of z₀z₁z₂z₃ and z₀z₅z₄z₃; 0 where conformal.

    Parameters
    ----------
    hexagons : (..., 6) complex
    """
    z = _polygons(hexagons, 6)
    halves = np.stack([z[..., [0, 1, 2, 3]], z[..., [0, 5, 4, 3]]], axis=-2)
    return np.asarray(np.abs(cross_ratio(halves) + 0.5).max(axis=-1))


def complete_hexagon(z0: ArrayLike, z1: ArrayLike, z3: ArrayLike, z5: ArrayLike) -> ComplexArray:
    """Return the conformal hexagon (..., 6) with four given corners.

    Every conformal hexagon is made so. It is circular exactly where the four corners are.

    Raises
    ------
    MeshError
        If given corners coincide, or a corner comes out at infinity.
    """
    a, b, d, f = np.broadcast_arrays(*(np.asarray(x, complex) for x in (z0, z1, z3, z5)))

    def fourth(beside: ComplexArray) -> ComplexArray:
        # (a−p)(x−d) = −½(p−x)(d−a) for x, linear.
        across, along = a - beside, (d - a) / 2
        below = across - along
        size = np.abs(across) + np.abs(along)
        if np.any(np.abs(across) * np.abs(along) * np.abs(d - beside) == 0):
            raise MeshError("two of the given corners coincide: no cross-ratio is −1/2")
        if np.any(np.abs(below) <= 1e-14 * size):
            raise MeshError(
                "z1 or z5 is (3 z0 - z3)/2, for which a corner lies at infinity; move it"
            )
        return np.asarray((across * d - along * beside) / below, complex)

    return np.stack([a, b, fourth(b), d, fourth(f), f], axis=-1)


def dual_edges(hexagons: ArrayLike) -> ComplexArray:
    """Return the edge vectors (..., 6) of the duals, ``aₖ* = cₖ/conj(aₖ)``.

    The thesis prints cₖ/aₖ; only with the conjugate are the dual's edges and diagonal parallel to
    the hexagon's. They close exactly where 2aₖ and −aₖ do after inversion.
    """
    z = _polygons(hexagons, 6)
    edges = np.roll(z, -1, axis=-1) - z
    if not np.all(np.abs(edges) > 0):
        raise MeshError("an edge has no length, so the hexagon has no dual")
    return np.asarray(DUAL_COEFFICIENTS / edges.conj(), complex)


def dual_hexagon(hexagons: ArrayLike, tolerance: float = 1e-9) -> ComplexArray:
    """Return the duals (..., 6) of conformal hexagons, beginning at 0.

    Parameters
    ----------
    hexagons : (..., 6) complex
    tolerance : float
        For the gap of the dual, relative to its longest edge.

    Raises
    ------
    MeshError
        If the dual edges do not close.

    References
    ----------
    Thesis §5.3.3.
    """
    edges = dual_edges(hexagons)
    gap = np.abs(edges.sum(axis=-1)) / np.abs(edges).max(axis=-1)
    if not np.all(gap <= tolerance):
        worst = int(np.argmax(gap))
        raise MeshError(
            f"the dual of hexagon {worst} does not close (by {gap.ravel()[worst]:.1e} of its "
            "longest edge): it is not conformal"
        )
    return np.asarray(np.cumsum(edges, axis=-1) - edges, complex)


@dataclass(frozen=True, eq=False)
class HexagonProperties:
    """How far hexagons are from each property of §5.3.3; all scale-free, zero where it holds.

    Attributes
    ----------
    products : (...) array
        (i) a₀a₂/(a₁b) = −1/2 and a₃a₅/(a₄b) = 1/2 with b = z₀ − z₃.
    diagonal : (...) array
        (ii) z₀* − z₃* = 2b/|b|², by either way around.
    closes : (...) array
        (iii) The hexagon has a dual: the edges aₖ* sum to zero.
    dual_conformal : (...) array
        (iv) The dual is a conformal hexagon.
    crossed : (...) array
        (v) z₁* − z₃* = 3(z₀−z₂)/|z₀−z₂|² and its three companions.
    involution : (...) array
        (vi) The dual of the dual is the hexagon, up to translation.

    (i), (iv) and (v) are equivalent for all hexagons; (ii) too, unless one of the quads is a
    parallelogram. (iii) and (vi), read as they are printed, are one complex equation less: they
    follow from the others but hold for more hexagons, unless the duals of both quads are to close.
    """

    products: FloatArray
    diagonal: FloatArray
    closes: FloatArray
    dual_conformal: FloatArray
    crossed: FloatArray
    involution: FloatArray

    @property
    def worst(self) -> FloatArray:
        """The largest of the six."""
        return np.asarray(
            np.max(
                [
                    self.products,
                    self.diagonal,
                    self.closes,
                    self.dual_conformal,
                    self.crossed,
                    self.involution,
                ],
                axis=0,
            )
        )


def hexagon_properties(hexagons: ArrayLike) -> HexagonProperties:
    """Return how far hexagons (..., 6) are from the six properties of conformal hexagons.

    References
    ----------
    Thesis §5.3.3.
    """
    z = _polygons(hexagons, 6)
    a = np.roll(z, -1, axis=-1) - z
    b = z[..., 0] - z[..., 3]
    a0, a1, a2, a3, a4, a5 = np.moveaxis(a, -1, 0)
    products = np.maximum(np.abs(a0 * a2 / (a1 * b) + 0.5), np.abs(a3 * a5 / (a4 * b) - 0.5))
    star = dual_edges(z)
    one, other = -star[..., :3].sum(axis=-1), star[..., 3:].sum(axis=-1)
    diagonal = np.maximum(_off(one, b, 2), _off(other, b, 2))
    closes = np.abs(star.sum(axis=-1)) / np.abs(star).max(axis=-1)
    dual = np.cumsum(star, axis=-1) - star
    # Corners 4 and 5 from the other end, so that an open dual is not taken for a closed one.
    dual[..., 5] = -star[..., 5]
    dual[..., 4] = dual[..., 5] - star[..., 4]
    with np.errstate(divide="ignore", invalid="ignore"):
        dual_conformal = np.maximum(closes, conformal_defect(dual))
    crossed = np.max(
        [
            _off(dual[..., 1] - dual[..., 3], z[..., 0] - z[..., 2], 3),
            _off(dual[..., 2] - dual[..., 0], z[..., 3] - z[..., 1], 3),
            _off(dual[..., 5] - dual[..., 3], z[..., 0] - z[..., 4], 3),
            _off(dual[..., 4] - dual[..., 0], z[..., 3] - z[..., 5], 3),
        ],
        axis=0,
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        back = np.abs(DUAL_COEFFICIENTS / (np.roll(dual, -1, axis=-1) - dual).conj() - a)
    involution = back.max(axis=-1) / np.abs(a).max(axis=-1)
    return HexagonProperties(products, diagonal, closes, dual_conformal, crossed, involution)


def _off(dual: ComplexArray, vector: ComplexArray, factor: float) -> FloatArray:
    """Return how far ``dual`` is from factor·v/|v|², relative to that."""
    return np.asarray(np.abs(dual * vector.conj() / factor - 1))


def _sine(ratio: ComplexArray) -> FloatArray:
    return np.asarray(np.abs(ratio.imag) / np.abs(ratio))


def _polygons(points: ArrayLike, corners: int | None = None) -> ComplexArray:
    z = np.asarray(points, complex)
    if not z.ndim or (corners is not None and z.shape[-1] != corners):
        raise MeshError(
            f"the last axis holds the corners: {corners or 'some'} are needed, but the array is "
            f"{z.shape}"
        )
    return z

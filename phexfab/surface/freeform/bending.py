"""What every free-form surface offers, and how it bends at a point."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Domain = tuple[float, float, float, float]


@dataclass(frozen=True, eq=False)
class Bending:
    """Normals, principal curvatures and principal directions of points of a surface.

    Attributes
    ----------
    normals : (..., 3) float
        Unit normals.
    kappa : (..., 2) float
        Principal curvatures, 1/mm, the greater one first; positive where the surface bends towards
        its normal.
    directions : (..., 2, 3) float
        Unit principal directions, right-handed with the normal. At an umbilic any pair.
    """

    normals: FloatArray
    kappa: FloatArray
    directions: FloatArray

    @property
    def gauss(self) -> FloatArray:
        """(...) Gaussian curvature, 1/mm²."""
        return np.asarray(self.kappa[..., 0] * self.kappa[..., 1])

    @property
    def mean(self) -> FloatArray:
        """(...) mean curvature, 1/mm."""
        return np.asarray(0.5 * self.kappa.sum(-1))

    def flat(self, vectors: ArrayLike) -> FloatArray:
        """Return (..., 2) components of vectors (..., 3) along the principal directions."""
        return np.asarray(np.einsum("...kj,...j->...k", self.directions, np.asarray(vectors)))

    def lifted(self, components: ArrayLike) -> FloatArray:
        """Return the tangent vectors (..., 3) of components (..., 2)."""
        return np.asarray(np.einsum("...kj,...k->...j", self.directions, np.asarray(components)))

    def form(self, one: ArrayLike, other: ArrayLike) -> FloatArray:
        """Return the second fundamental form II(one, other) of vectors (..., 3), in mm² · 1/mm."""
        return np.asarray((self.flat(one) * self.kappa * self.flat(other)).sum(-1))

    @property
    def operator(self) -> FloatArray:
        """(..., 3, 3) shape operator in space: II(a, b) = a · operator · b, 0 on the normal."""
        return np.asarray(
            np.einsum("...ki,...k,...kj->...ij", self.directions, self.kappa, self.directions)
        )


class FreeformSurface(Protocol):
    """A surface to work on.

    Parameters ``u`` are (..., 2) numbers for parametric surfaces and (..., 3) points in space, near
    the surface, for implicit ones and meshes.
    """

    @property
    def name(self) -> str:
        """What messages call it."""
        ...

    @property
    def domain(self) -> Domain | None:
        """(u0, u1, v0, v1) of a parametric surface, None where parameters are points."""
        ...

    @property
    def periodic(self) -> tuple[bool, bool]:
        """Whether u and v close up."""
        ...

    @property
    def size(self) -> float:
        """Diagonal of its box, mm."""
        ...

    def point(self, u: ArrayLike) -> FloatArray:
        """Return the points (..., 3) in mm."""
        ...

    def normal(self, u: ArrayLike) -> FloatArray:
        """Return the unit normals (..., 3)."""
        ...

    def derivatives(self, u: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the first (..., 2, 3) and second (..., 3, 3: uu, uv, vv) derivatives."""
        ...

    def bending(self, u: ArrayLike) -> Bending:
        """Return normals, principal curvatures and principal directions."""
        ...

    def nearest(self, points: ArrayLike, guess: ArrayLike | None = None) -> FloatArray:
        """Return the parameters of the nearest points of the surface."""
        ...

    def inside(self, u: ArrayLike) -> BoolArray:
        """Return (...) True where u is not on, or beyond, the border."""
        ...

    def seeds(self, count: int) -> FloatArray:
        """Return about ``count`` parameters that cover the surface, none on its border."""
        ...


def bending_of(first: FloatArray, second: FloatArray, normals: FloatArray) -> Bending:
    """Return how a parametrised surface bends.

    Parameters
    ----------
    first : (..., 2, 3) float
    second : (..., 3, 3) float
        uu, uv, vv.
    normals : (..., 3) float
        Unit normals, of either side.
    """
    xu, xv = first[..., 0, :], first[..., 1, :]
    length = np.linalg.norm(xu, axis=-1)
    e1 = xu / length[..., None]
    e2 = np.cross(normals, e1)
    shear = (xv * e1).sum(-1)
    across = (xv * e2).sum(-1)
    l, m, n = np.moveaxis((second * normals[..., None, :]).sum(-1), -1, 0)
    # e1 = X_u / |X_u| and e2 = (X_v − shear/|X_u| X_u) / across: the form in that frame.
    slide = shear / length
    a = l / length**2
    b = (m - slide * l) / (length * across)
    c = (n - 2 * slide * m + slide**2 * l) / across**2
    return bending_in_frame(a, b, c, e1, e2, normals)


def bending_in_frame(
    a: FloatArray, b: FloatArray, c: FloatArray, e1: FloatArray, e2: FloatArray, normals: FloatArray
) -> Bending:
    """Return the bending for the second form a x² + 2b xy + c y² in an orthonormal frame e1, e2."""
    half, mean = 0.5 * (a - c), 0.5 * (a + c)
    root = np.hypot(half, b)
    angle = 0.5 * np.arctan2(b, half)[..., None]
    d1 = np.cos(angle) * e1 + np.sin(angle) * e2
    pair = np.stack([d1, np.cross(normals, d1)], axis=-2)
    return Bending(normals, np.stack([mean + root, mean - root], axis=-1), pair)

"""Two conjugate families of directions on a surface: one is given, the other follows.

Directions a and b are conjugate when II(a, b) = 0: the tangent plane, rolled along a curve in
direction a, turns about b. To a belongs b = n × S a, S the shape operator.

References
----------
Thesis §5.2; Liu, Pottmann, Wallner, Yang, Wang 2006, "Geometric modeling with conical meshes and
developable surfaces", sec. 2 (quads along conjugate curves are planar to second order).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import LatticeError
from phexfab.surface.freeform.bending import bending_of
from phexfab.surface.freeform.surface import Bending, FreeformSurface

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Directions = Callable[[FloatArray, Bending], FloatArray]
Free = Callable[[FloatArray], BoolArray]

UMBILIC = 0.01
"""|κ₁ − κ₂| over |κ₁| + |κ₂| below which principal directions count as undefined."""
FLAT = 1e-6
"""|κ₁| + |κ₂| times the surface's size, below which it counts as flat."""


@dataclass(frozen=True, eq=False)
class Family:
    """One family of curves, by its directions.

    Attributes
    ----------
    name : str
        What messages call it.
    directions : callable
        Points (k, 3) and their ``Bending`` to vectors (k, 3), of any length and either sign; they
        are brought into the tangent plane.
    principal : bool
        Whether it is undefined at umbilics.
    """

    name: str
    directions: Directions
    principal: bool = False


def principal_family(which: int = 0) -> Family:
    """Return the lines of the greater (0) or the smaller (1) signed principal curvature.

    Raises
    ------
    LatticeError
        If ``which`` is neither.
    """
    if which not in (0, 1):
        raise LatticeError(f"which = {which!r}: 0 for the greater principal curvature, 1")
    return Family(
        "the lines of curvature", lambda points, bending: bending.directions[:, which], True
    )


def field_family(field: ArrayLike | Directions) -> Family:
    """Return the curves along a field: one vector for all, or points and bending to vectors."""
    if callable(field):
        return Family("the curves along the field", field)
    vector = np.asarray(field, float)
    if vector.shape != (3,) or not np.linalg.norm(vector) > 0:
        raise LatticeError(f"field = {field!r}: a vector of three numbers, not zero, or a callable")
    return Family(
        f"the curves along {vector.tolist()}",
        lambda points, bending: np.broadcast_to(vector, points.shape),
    )


def plane_families(surface: FreeformSurface, count: int = 400) -> tuple[Family, Family]:
    """Return the curves in planes across the longest and the second longest extent of a surface."""
    points = surface.point(surface.seeds(count))
    axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2]

    def across(axis: FloatArray) -> Family:
        return Family(
            f"the curves in planes across {axis.round(3).tolist()}",
            lambda points, bending: np.cross(bending.normals, axis),
        )

    return across(axes[0]), across(axes[1])


def level_family(
    function: Callable[[FloatArray], FloatArray],
    gradient: Callable[[FloatArray], FloatArray] | None = None,
    *,
    reach: float = 1.0,
) -> Family:
    """Return the curves on which a function of points in space is constant.

    Parameters
    ----------
    function : callable
        (k, 3) points in mm to (k,) numbers.
    gradient : callable, optional
        (k, 3) points to (k, 3). Without it, differences of fourth order over ``reach`` mm.
    reach : float
    """

    def slope(points: FloatArray) -> FloatArray:
        if gradient is not None:
            return np.asarray(gradient(points), float)
        out = np.empty_like(points)
        for axis in range(3):
            e = reach * np.eye(3)[axis]
            near = function(points + e) - function(points - e)
            far = function(points + 2 * e) - function(points - 2 * e)
            out[:, axis] = (8 * near - far) / (12 * reach)
        return out

    return Family(
        "the level curves", lambda points, bending: np.cross(bending.normals, slope(points))
    )


def conjugate_direction(bending: Bending, direction: ArrayLike) -> FloatArray:
    """Return unit directions (..., 3) conjugate to tangent vectors (..., 3).

    Where S a vanishes (a flat principal direction) all directions are conjugate to it, and the
    one across it is returned.
    """
    a = np.asarray(direction, float)
    turned = bending.lifted(bending.kappa * bending.flat(a))
    size = np.linalg.norm(turned, axis=-1)
    limit = 1e-9 * np.abs(bending.kappa).max(-1) * np.linalg.norm(a, axis=-1)
    b = np.cross(bending.normals, np.where((size > limit)[..., None], turned, a))
    length = np.linalg.norm(b, axis=-1, keepdims=True)
    return np.divide(b, length, out=np.zeros_like(b), where=length > 0)


@dataclass(frozen=True, eq=False)
class Here:
    """Both directions at points: unit vectors, the second left of the first about ``bending``.

    ``why`` (k,): 0 where both are good, 1 where the first is undefined, 2 where they are too
    nearly parallel.
    """

    points: FloatArray
    bending: Bending
    jacobian: FloatArray
    pair: FloatArray  # (k, 2, 3)
    why: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Fields:
    """Both families on a surface.

    Attributes
    ----------
    surface : FreeformSurface
    family : Family
        Rows follow it, or columns if ``swapped``.
    swapped : bool
    least_angle : float
        Degrees between the families, below which a curve ends.
    free : callable, optional
        Which points (k, 3) curves may go to, as if the border were where it says no.
    """

    surface: FreeformSurface
    family: Family
    swapped: bool = False
    least_angle: float = 20.0
    free: Free | None = None

    def at(self, u: FloatArray) -> Here:
        """Return both directions at parameters (k, ·)."""
        points = self.surface.point(u)
        # A parameter of an implicit surface is a point near it: near enough is found once.
        first, second = self.surface.derivatives(points if self.surface.domain is None else u)
        normals = np.cross(first[:, 0], first[:, 1])
        normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        bending = bending_of(first, second, normals)
        a = np.asarray(self.family.directions(points, bending), float)
        a = a - np.einsum("ki,ki->k", a, normals)[:, None] * normals
        length = np.linalg.norm(a, axis=1)
        a = a / np.where(length > 0, length, 1.0)[:, None]
        total = np.abs(bending.kappa).sum(-1)
        gap = np.abs(bending.kappa[:, 0] - bending.kappa[:, 1])
        lost = ~(length > 0) | ~(total * self.surface.size > FLAT)
        if self.family.principal:
            lost |= gap <= UMBILIC * total
        b = conjugate_direction(bending, a)
        if self.swapped:
            a, b = b, a
        turn = np.einsum("ki,ki->k", np.cross(a, b), normals)
        b = b * np.where(turn < 0, -1.0, 1.0)[:, None]
        near = np.abs(turn) < np.sin(np.radians(self.least_angle))
        why = np.where(lost, 1, np.where(near, 2, 0))
        return Here(points, bending, first, np.stack([a, b], axis=1), why)

    def inside(self, u: FloatArray, points: FloatArray | None = None) -> BoolArray:
        """Return (k,) whether curves may go to parameters, of these points if they are known."""
        within = self.surface.inside(u)
        if self.free is None:
            return within
        return within & self.free(self.surface.point(u) if points is None else points)

    def forward(self, here: Here, vectors: FloatArray) -> FloatArray:
        """Return the parameters' rates (k, ·) along tangent vectors (k, 3)."""
        if self.surface.domain is None:
            return vectors
        gram = np.einsum("kij,klj->kil", here.jacobian, here.jacobian)
        right = np.einsum("kij,kj->ki", here.jacobian, vectors)
        return np.asarray(np.linalg.solve(gram, right[..., None])[..., 0])

    def placed(self, u: FloatArray) -> FloatArray:
        """Return parameters brought back: onto the surface, or into its period."""
        if self.surface.domain is None:
            return self.surface.point(u)
        low = np.array(self.surface.domain[::2])
        width = np.array(self.surface.domain[1::2]) - low
        return np.asarray(np.where(self.surface.periodic, low + (u - low) % width, u))

    def reason(self, why: int) -> str:
        """Return what a value of ``Here.why`` means."""
        if why == 1 and self.family.principal:
            return "principal directions are undefined (an umbilic or flat point)"
        if why == 1:
            return f"{self.family.name} have no direction, or the surface is flat"
        if why == 2:
            return (
                f"the families meet at less than {self.least_angle:g} degrees (an asymptotic "
                "direction is its own conjugate)"
            )
        return "a direction turns about a singular point"

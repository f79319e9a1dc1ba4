"""The classical surfaces, each with its Weierstrass data in closed form.

Every constructor returns a surface in its natural unit; the rectangles are chosen so that the
patch is embedded, of quiet proportions, and its panels differ in size by less than 1 : 2.5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from phexfab.errors import SurfaceError
from phexfab.surface.construct import associate
from phexfab.surface.holomorphic import ComplexArray
from phexfab.surface.lemniscate import arcsl, sl
from phexfab.surface.weierstrass import MinimalSurface, Rectangle

NullCurve = Callable[[ComplexArray], ComplexArray]


def _stack(x: ComplexArray, y: ComplexArray, z: ComplexArray) -> ComplexArray:
    return np.stack([x, y, z], -1)


def _whole(surface: str, key: str, value: object, low: int, high: int) -> int:
    if isinstance(value, bool) or not isinstance(value, int | np.integer):
        raise SurfaceError(f"{surface}: {key} must be a whole number, not {value!r}")
    if not low <= value <= high:
        raise SurfaceError(f"{surface}: {key} must be between {low} and {high}, not {value}")
    return int(value)


def _from_base(curve: NullCurve, base: complex) -> NullCurve:
    """Return the null curve shifted so that X(base) is the origin: the patch is then centred."""
    origin = curve(np.array(base, complex))
    return lambda z: curve(z) - origin


def _monomial(name: str, p: int, q: int, base: float, rectangle: Rectangle) -> MinimalSurface:
    """Return the surface with g = z^p and f = z^q, for which Q = p z^(p+q-1) is a monomial too."""

    def primitive(z: ComplexArray, k: int) -> ComplexArray:
        return z ** (k + 1) / (k + 1)

    def curve(z: ComplexArray) -> ComplexArray:
        low, high = primitive(z, q), primitive(z, q + 2 * p)
        return _stack(0.5 * (low - high), 0.5j * (low + high), primitive(z, p + q))

    k = p + q - 1
    half = 0.5 * (k + 2)
    factor, origin = np.sqrt(p) / half, base**half
    linear = k == 0
    return MinimalSurface(
        name=name,
        gauss_map=lambda z: z**p,
        gauss_map_derivative=lambda z: p * z ** (p - 1),
        form=lambda z: z**q,
        null_curve=_from_base(curve, base),
        base=base,
        to_curvature=lambda z: factor * ((z if linear else z**half) - origin),
        from_curvature=lambda w: (
            w / factor + origin if linear else (w / factor + origin) ** (1 / half)
        ),
        rectangle=rectangle,
        singular=() if linear and q >= 0 else (0.0,),
    )


def enneper(order: int = 1) -> MinimalSurface:
    """Return Enneper's surface g = z^n, f = 1; order n > 1 a patch beside its umbilic."""
    n = _whole("enneper", "order", order, 1, 12)
    if n == 1:
        return _monomial("enneper", 1, 0, 0.0, (-0.75, 0.75, -0.75, 0.75))
    # The base is where the curvature is largest, so that the panels vary least about it.
    base = ((n - 1) / (3 * n + 1)) ** (0.5 / n)
    reach = 2 * np.sqrt(n) / (n + 1) * base ** ((n + 1) / 2)
    box = (-0.6 * reach, 0.6 * reach, -0.9 * reach, 0.9 * reach)
    return _monomial(f"enneper of order {n}", n, 0, base, box)


def bour(order: int = 3) -> MinimalSurface:
    """Return Bour's surface g = z, f = z^(m-2), a patch beside its branch point of order m-2."""
    m = _whole("bour", "order", order, 3, 12)
    box = (-0.65 / m, 0.65 / m, -1.5 / m, 1.5 / m)
    return _monomial("bour" if m == 3 else f"bour of order {m}", 1, m - 2, 1.0, box)


def richmond(order: int = 1) -> MinimalSurface:
    """Return Richmond's surface g = z^(n+1), f = 1/z²: one planar end, one Enneper end."""
    n = _whole("richmond", "order", order, 1, 12)
    base = ((n + 2) / (3 * n + 2)) ** (0.5 / (n + 1))  # where the curvature is largest
    reach = 2 * np.sqrt(n + 1) / n * base ** (n / 2)
    box = (-0.3 * reach, 0.3 * reach, -0.4 * reach, 0.4 * reach)
    return _monomial("richmond" if n == 1 else f"richmond of order {n}", n + 1, -2, base, box)


def catenoid() -> MinimalSurface:
    """Return the catenoid g = e^z, dh = dz: x² + y² = cosh² z, closed under w -> w + 2πi."""
    return MinimalSurface(
        name="catenoid",
        gauss_map=np.exp,
        gauss_map_derivative=np.exp,
        form=lambda z: np.exp(-z),
        null_curve=lambda z: _stack(-np.cosh(z), 1j * np.sinh(z), z),
        to_curvature=lambda z: z,
        from_curvature=lambda w: w,
        period=2j * np.pi,
        # At u = ±1.19968 the film between the rims turns unstable, and the minimal solve singular.
        rectangle=(-1.0, 1.0, -np.pi, np.pi),
    )


def catenoid_helicoid(bonnet_angle: float = 45.0) -> MinimalSurface:
    """Return the catenoid bent towards the helicoid: 0° is the catenoid, 90° the helicoid."""
    turned = associate(catenoid(), bonnet_angle)
    if turned.period is not None:
        return turned
    name = "helicoid" if bonnet_angle == 90.0 else f"catenoid-helicoid at {bonnet_angle:g}°"
    return replace(turned, name=name, rectangle=(-1.0, 1.0, -1.0, 1.0))


def helicoid() -> MinimalSurface:
    """Return the helicoid, conjugate to the catenoid: x cos z = y sin z."""
    return catenoid_helicoid(90.0)


def scherk_1() -> MinimalSurface:
    """Return Scherk's doubly periodic surface g = z, f = 4/(1-z⁴): e^z cos x = cos y."""
    return MinimalSurface(
        name="scherk-1",
        gauss_map=lambda z: z,
        gauss_map_derivative=np.ones_like,
        form=lambda z: 4 / (1 - z**4),
        null_curve=lambda z: _stack(
            2 * np.arctan(z), 2j * np.arctanh(z), np.log1p(z * z) - np.log1p(-z * z)
        ),
        to_curvature=lambda z: 2 * arcsl(z),
        from_curvature=lambda w: sl(w / 2),
        rectangle=(-1.4, 1.4, -1.4, 1.4),
        singular=(1, 1j, -1, -1j),
    )


def scherk_2() -> MinimalSurface:
    """Return Scherk's singly periodic tower, conjugate to scherk-1: sin z = -sinh x sinh y."""
    return replace(associate(scherk_1(), 90.0), name="scherk-2", rectangle=(-1.0, 1.0, -1.6, 1.6))


def henneberg() -> MinimalSurface:
    """Return Henneberg's one-sided surface g = z, f = 2(1 - z⁻⁴), between two branch points."""
    base = complex(np.sqrt(0.5), np.sqrt(0.5))

    def curve(z: ComplexArray) -> ComplexArray:
        r = 1 / z
        return _stack(
            z - z**3 / 3 - r + r**3 / 3, 1j * (z + z**3 / 3 + r + r**3 / 3), z * z + r * r
        )

    return MinimalSurface(
        name="henneberg",
        gauss_map=lambda z: z,
        gauss_map_derivative=np.ones_like,
        form=lambda z: 2 * (1 - z**-4),
        null_curve=_from_base(curve, base),
        base=base,
        rectangle=(-0.6, 0.6, -0.6, 0.6),
        singular=(1, 1j, -1, -1j, 0),
    )


def catalan() -> MinimalSurface:
    """Return Catalan's surface, which has a cycloid as a geodesic; a patch about its crest."""

    def curve(z: ComplexArray) -> ComplexArray:
        return _stack(z - np.sin(z), 1 - np.cos(z), 4j * np.cos(z / 2))

    return MinimalSurface(
        name="catalan",
        gauss_map=lambda z: np.exp(-0.5j * z),
        gauss_map_derivative=lambda z: -0.5j * np.exp(-0.5j * z),
        form=lambda z: 1 - np.exp(1j * z),
        null_curve=_from_base(curve, -np.pi),
        base=-np.pi,
        rectangle=(-1.7, 1.7, -1.3, 1.3),
        singular=(0, -2 * np.pi),
    )


def jorge_meeks(ends: int = 4) -> MinimalSurface:
    """Return the k-noid of Jorge and Meeks: g = z^(k-1), f = 1/(z^k + 1)², k catenoidal ends."""
    k = _whole("jorge-meeks", "ends", ends, 3, 12)
    roots = np.exp(1j * np.pi * (2 * np.arange(k) + 1) / k)
    # Partial fractions A/(z-r)² + B/(z-r) of φ = P/(z^k+1)²; at a root z^k + 1 is
    # k r^(k-1) (z-r) (1 + (k-1)/(2r) (z-r) + …), and every B comes out real.
    high = roots ** (2 * k - 2)
    top = np.stack([0.5 * (1 - high), 0.5j * (1 + high), roots ** (k - 1)])
    slope = (k - 1) * np.stack(
        [-(roots ** (2 * k - 3)), 1j * roots ** (2 * k - 3), roots ** (k - 2)]
    )
    double = top / (k * k * high)
    simple = (slope - (k - 1) / roots * top) / (k * k * high)

    def curve(z: ComplexArray) -> ComplexArray:
        away = np.asarray(z, complex)[..., None] - roots
        return (1 / away) @ -double.T + np.log(-away / roots) @ simple.T

    factor, quarter = 2 * np.sqrt(k - 1) / k, np.pi / 4
    return MinimalSurface(
        name="trinoid" if k == 3 else f"jorge-meeks with {k} ends",
        gauss_map=lambda z: z ** (k - 1),
        gauss_map_derivative=lambda z: (k - 1) * z ** (k - 2),
        form=lambda z: (z**k + 1) ** -2.0,
        null_curve=_from_base(curve, 1.0),
        base=1.0,
        to_curvature=lambda z: factor * (np.arctan(z ** (k / 2)) - quarter),
        from_curvature=lambda w: np.tan(w / factor + quarter) ** (2 / k),
        rectangle=(-0.4 * factor, 0.4 * factor, -0.45 * factor, 0.45 * factor),
        singular=(0.0, *roots.tolist()),
    )


def trinoid() -> MinimalSurface:
    """Return the trinoid, the k-noid of Jorge and Meeks with three ends."""
    return jorge_meeks(3)

"""Surfaces of one's own: from callables, from text, and associates of any surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from phexfab.errors import SurfaceError
from phexfab.surface.expressions import Expression
from phexfab.surface.holomorphic import ComplexArray, ComplexMap, derivative, evaluate, show
from phexfab.surface.weierstrass import MinimalSurface, Rectangle

OWN_RECTANGLE: Rectangle = (-0.5, 0.5, -0.5, 0.5)


def from_weierstrass(
    g: ComplexMap,
    f: ComplexMap,
    *,
    name: str = "own surface",
    base: complex = 0.0,
    rectangle: Rectangle = OWN_RECTANGLE,
    scale: float = 1.0,
    gauss_map_derivative: ComplexMap | None = None,
    null_curve: Callable[[ComplexArray], Any] | None = None,
    radius: float = 0.05,
    singular: tuple[complex, ...] = (),
) -> MinimalSurface:
    """Return the surface with Gauss map g and form f, see `MinimalSurface`.

    Parameters
    ----------
    g, f : callable
        Analytic functions of complex arrays; 0/0 at removable points and poles are allowed.
    base : complex
        The parameter of w = 0 and, without a null curve, of X = 0.
    rectangle : (u0, u1, v0, v1)
        The rectangle in w that is built when the design names none.
    scale : float
        In mm.
    gauss_map_derivative : callable, optional
        g'; by default Cauchy's integral on a circle of ``radius``.
    null_curve, singular
        As in `MinimalSurface`.

    Raises
    ------
    SurfaceError
        If the base is an umbilic, a branch point or an end, or g is constant (a plane).

    Examples
    --------
    >>> import phexfab as px
    >>> own = px.from_weierstrass(lambda z: z**2, lambda z: 1 / z, base=0.6, scale=3000.0)
    >>> print(f"{own.gaussian_curvature(0.6):.2e} per mm²")
    -5.66e-07 per mm²
    >>> bool(abs(own.mean_curvature(0.6)) < 1e-15)
    True
    """
    slope = derivative(g, radius) if gauss_map_derivative is None else gauss_map_derivative
    surface = MinimalSurface(
        name=name,
        gauss_map=g,
        gauss_map_derivative=slope,
        form=f,
        null_curve=null_curve,
        base=complex(base),
        rectangle=rectangle,
        singular=tuple(complex(p) for p in singular),
    ).scaled(scale)
    q = surface.hopf(surface.base)
    size = np.abs(evaluate(f, np.array(surface.base))) * np.finfo(float).eps / radius
    if not np.isfinite(q) or np.abs(q) <= 16 * size:
        raise SurfaceError(
            f"{name}: the Hopf differential f g' is {show(complex(q))} at the base "
            f"z = {show(base)}: an umbilic, a branch point, an end, or a plane; choose a base "
            "at a regular point"
        )
    return surface


def from_height_differential(g: ComplexMap, dh: ComplexMap, **options: Any) -> MinimalSurface:
    """Return the surface with Gauss map g and height differential dh = f g dz.

    The third coordinate of the surface is Re ∫ dh.

    Parameters
    ----------
    g, dh : callable
        Analytic functions of complex arrays.
    **options
        As for `from_weierstrass`.

    Examples
    --------
    >>> import numpy as np
    >>> import phexfab as px
    >>> one = px.from_height_differential(lambda z: z**2, lambda z: z, base=0.6, scale=3000.0)
    >>> same = px.from_weierstrass(lambda z: z**2, lambda z: 1 / z, base=0.6, scale=3000.0)
    >>> bool(np.allclose(one.point(0.7), same.point(0.7)))
    True
    """
    return from_weierstrass(g, lambda z: evaluate(dh, z) / evaluate(g, z), **options)


def from_expressions(
    g: str, dh: str | None = None, f: str | None = None, **options: Any
) -> MinimalSurface:
    """Return a surface from text, as in a design file: ``from_expressions(g="z**2", dh="z")``.

    Parameters
    ----------
    g : str
        The Gauss map, see `Expression` for what may be written.
    dh, f : str
        The height differential dh = f g dz, or the form f: one of them.
    **options
        As for `from_weierstrass`; ``base`` may be an expression too.

    Raises
    ------
    SurfaceError
        If an expression is not allowed, or as `from_weierstrass`.
    """
    if (dh is None) == (f is None):
        raise SurfaceError("give either dh (the height differential) or f, and not both")
    gauss = Expression(g, "g")
    base = options.get("base", 0.0)
    if isinstance(base, str):
        options["base"] = complex(evaluate(Expression(base, "base"), np.zeros(())))
    options.setdefault("gauss_map_derivative", gauss.derivative)
    if f is not None:
        return from_weierstrass(gauss, Expression(f, "f"), **options)
    return from_height_differential(gauss, Expression(str(dh), "dh"), **options)


def unit(degrees: float) -> complex:
    """Return e^{i·degrees}, exact at the multiples of 90°."""
    quarters, rest = divmod(degrees, 90.0)
    turn = (1, 1j, -1, -1j)[int(quarters) % 4]
    return turn * complex(np.cos(np.radians(rest)), np.sin(np.radians(rest)))


def associate(surface: MinimalSurface, angle: float) -> MinimalSurface:
    """Return the associate surface f -> e^{iθ} f: isometric, same normals, curvature lines turned.

    Parameters
    ----------
    surface : MinimalSurface
    angle : float
        The Bonnet angle θ in degrees; 90 is the conjugate surface.

    Returns
    -------
    MinimalSurface
        Its w is e^{iθ/2} times the old one; its rectangle is the largest of the same proportions
        and centre on the surface that fits into the old one. A period survives only where the
        turned surface still closes, at multiples of 180°.

    Raises
    ------
    SurfaceError
        If the angle is not finite.

    References
    ----------
    Thesis ch. 2 (Bonnet transformation).

    Examples
    --------
    >>> import numpy as np
    >>> import phexfab as px
    >>> catenoid = px.minimal_surface("catenoid").scaled(1000.0)
    >>> helicoid = px.associate(catenoid, 90.0)
    >>> z = catenoid.parameter(0.3 + 0.2j)
    >>> bool(np.allclose(helicoid.normal(z), catenoid.normal(z)))
    True
    >>> bool(np.allclose(helicoid.first_form(z), catenoid.first_form(z)))  # an isometry
    True
    """
    if not np.isfinite(angle):
        raise SurfaceError(f"the Bonnet angle must be finite, not {angle}")
    turn, half = unit(angle), unit(angle / 2)
    old = surface
    curve, forward, backward = old.null_curve, old.to_curvature, old.from_curvature
    # √Q is principal at the base for every surface without closed form: keep to that branch.
    if forward is None:
        q = complex(old.hopf(old.base))
        half = complex(np.sqrt(turn * q) / np.sqrt(q))
    u0, u1, v0, v1 = old.rectangle
    a, b, c, s = (u1 - u0) / 2, (v1 - v0) / 2, abs(half.real), abs(half.imag)
    shrink, p, q = max(
        (min(a / (p * c + q * s), b / (p * s + q * c)), p, q) for p, q in ((a, b), (b, a))
    )
    middle = half * complex(u0 + u1, v0 + v1) / 2
    return replace(
        old,
        name=f"{old.name} turned by {angle:g}°" if angle else old.name,
        form=lambda z: turn * evaluate(old.form, z),
        null_curve=None if curve is None else lambda z: turn * np.asarray(curve(z)),
        to_curvature=None if forward is None else lambda z: half * evaluate(forward, z),
        from_curvature=None if backward is None else lambda w: evaluate(backward, w / half),
        period=old.period * half if old.period and not turn.imag else None,
        rectangle=(
            middle.real - shrink * p,
            middle.real + shrink * p,
            middle.imag - shrink * q,
            middle.imag + shrink * q,
        ),
    )

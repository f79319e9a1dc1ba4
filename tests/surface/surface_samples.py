"""Surfaces and parameters that the tests of this folder share, and derivatives of points alone."""

from functools import cache

import numpy as np

from phexfab.surface import associate, catalog, from_expressions, from_weierstrass, surface

SCALE = 2.5  # mm; no test may pass by taking the unit for 1

MAKERS = {name: (lambda name=name: surface(name)) for name in catalog} | {
    "enneper 2": lambda: surface("enneper", order=2),
    "enneper 5": lambda: surface("enneper", order=5),
    "bour 4": lambda: surface("bour", order=4),
    "richmond 3": lambda: surface("richmond", order=3),
    "jorge-meeks 6": lambda: surface("jorge-meeks", ends=6),
    "catenoid-helicoid 20": lambda: surface("catenoid-helicoid", bonnet_angle=20.0),
    "enneper at 30": lambda: surface("enneper", bonnet_angle=30.0),
    "henneberg at 100": lambda: surface("henneberg", bonnet_angle=100.0),
    "trinoid at 60": lambda: surface("trinoid", bonnet_angle=60.0),
    "own, text": lambda: from_expressions(
        g="z**3/3 + 0.4*z",
        dh="z*exp(z)",  # f is removable at 0
        base="0.3",
        rectangle=(-0.3, 0.3, -0.3, 0.3),
        singular=(0.4**0.5 * 1j, -(0.4**0.5) * 1j, 1.2**0.5 * 1j, -(1.2**0.5) * 1j),
    ),
    "own, callables": lambda: associate(from_weierstrass(lambda z: z / 2, np.cosh), 45.0),
    "own, g infinite": lambda: from_weierstrass(lambda z: 1 / z, lambda z: z * z),
}


@cache
def made(name):
    return MAKERS[name]().scaled(SCALE)


@cache
def spread(name):
    """Coordinates w all over the default rectangle, its corners and the middle included."""
    u0, u1, v0, v1 = made(name).rectangle
    random = np.random.default_rng(7).uniform(size=(2, 16))
    u, v = np.meshgrid(np.linspace(0, 1, 5), np.linspace(0, 1, 5))
    u, v = np.append(u, random[0]), np.append(v, random[1])
    return u0 + (u1 - u0) * u + 1j * (v0 + (v1 - v0) * v)


@cache
def parameters(name):
    """The z of those, and some more about the base, off the rectangle's lattice."""
    random = np.random.default_rng(8).uniform(-1, 1, (2, 12))
    base = made(name).base
    more = base + 0.4 * room(name, np.array([base])) * (random[0] + 1j * random[1])
    return np.append(made(name).parameter(spread(name)), more)


def room(name, z):
    """How far z is from the known singular points, 1 at most."""
    away = [np.abs(z - place) for place in made(name).singular]
    return np.minimum(1.0, np.min(away, axis=0)) if away else np.ones(np.shape(z))


FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])


def differences(point, z, step):
    """X_u, X_v, X_uu, X_uv, X_vv by differences of order eight of ``point`` alone.

    ``step`` is a number, or one per z.
    """
    h = np.broadcast_to(step, np.shape(z))[:, None]
    t = np.arange(-4, 5)
    grid = z[:, None, None] + (t[:, None] + 1j * t[None, :]) * h[..., None]
    x = point(grid)
    u, v = x[:, :, 4], x[:, 4]
    return (
        np.einsum("k,nkc->nc", FIRST, u) / h,
        np.einsum("k,nkc->nc", FIRST, v) / h,
        np.einsum("k,nkc->nc", SECOND, u) / h**2,
        np.einsum("j,k,njkc->nc", FIRST, FIRST, x) / h**2,
        np.einsum("k,nkc->nc", SECOND, v) / h**2,
    )


def forms(derivatives):
    """Both fundamental forms and the normal, from derivatives of the point."""
    xu, xv, xuu, xuv, xvv = derivatives
    normal = np.cross(xu, xv)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    first = np.stack([(xu * xu).sum(-1), (xu * xv).sum(-1), (xv * xv).sum(-1)], -1)
    second = np.stack([(x * normal).sum(-1) for x in (xuu, xuv, xvv)], -1)
    index = np.array([[0, 1], [1, 2]])
    return first[:, index], second[:, index], normal

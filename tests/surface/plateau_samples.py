"""Rims whose films are known, as exact curves."""

import numpy as np

from phexfab.surface.rims.rim import Rim

TURN = 2 * np.pi


def smooth_rim(point, *derivatives, name="rim", start=0.0, way=1):
    """A rim from functions of an angle."""
    return Rim.of(
        lambda t: point(way * TURN * (np.asarray(t) + start)),
        [
            lambda t, d=d, k=k: (way * TURN) ** (k + 1) * d(way * TURN * (np.asarray(t) + start))
            for k, d in enumerate(derivatives)
        ],
        name=name,
    )


def lobed(lobes, height=0.3, radius=1000.0, **where):
    """A circle that goes up and down so many times."""

    def at(order):
        def values(a):
            turned = a + order * np.pi / 2
            up = height * lobes**order * np.cos(lobes * a + order * np.pi / 2)
            return radius * np.stack([np.cos(turned), np.sin(turned), up], -1)

        return values

    return smooth_rim(at(0), at(1), at(2), **where)


def enneper_rim(radius=0.8, order=1):
    """The rim of a round patch of Enneper's surface, whose null curve is a polynomial."""

    def at(by):
        def values(a):
            z = radius * np.exp(1j * a)
            n = order
            terms = (
                [(0.5, 1), (-0.5 / (2 * n + 1), 2 * n + 1)],
                [
                    (0.5j, 1),
                    (0.5j / (2 * n + 1), 2 * n + 1),
                ],
                [(1 / (n + 1), n + 1)],
            )
            return 1000 * np.stack(
                [sum(c * (1j * k) ** by * z**k for c, k in term).real for term in terms], -1
            )

        return values

    return smooth_rim(at(0), at(1), at(2), name="enneper")


def helicoid_rim(width, twist):
    """The rim of X = (r cos φ, r sin φ, φ) over an ellipse of the (r, φ) plane."""

    def point(a):
        r, phi = width * np.cos(a), twist * np.sin(a)
        return 1000 * np.stack([r * np.cos(phi), r * np.sin(phi), phi], -1)

    def slope(a):
        r, phi = width * np.cos(a), twist * np.sin(a)
        by_r, by_phi = -width * np.sin(a), twist * np.cos(a)
        x = by_r * np.cos(phi) - r * np.sin(phi) * by_phi
        y = by_r * np.sin(phi) + r * np.cos(phi) * by_phi
        return 1000 * np.stack([x, y, by_phi], -1)

    return smooth_rim(point, slope)

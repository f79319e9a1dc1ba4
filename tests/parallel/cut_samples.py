"""Whole shells and borders on catalog surfaces, for the tests of cutting."""

from functools import cache

import numpy as np

from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.border import Border
from phexfab.surface.catalog import surface

TURN = np.linspace(0.0, 2 * np.pi, 1200, endpoint=False)


@cache
def whole(name="enneper", size=200.0, kind="face", closed=False):
    smooth = surface(name).scaled(5000.0)
    box = (-1.0, 1.0, -np.pi, np.pi) if closed else None
    return smooth, minimal_shell(
        smooth, lattice_on(smooth, size, rectangle=box, closed=closed), kind
    )


def border(smooth, w, corners=()):
    z = smooth.parameter(np.asarray(w))
    return Border(smooth.point(z), smooth.normal(z), np.array(corners, int))


def circle(radius, centre=0.0, turn=1):
    return centre + radius * np.exp(turn * 1j * TURN)


def polygon(corners, steps=300):
    """Return points (n,) on the sides of a polygon, and the indices of its corners."""
    corners = np.asarray(corners, complex)
    share = np.arange(steps) / steps
    sides = corners[:, None] * (1 - share) + np.roll(corners, -1)[:, None] * share
    return sides.ravel(), np.arange(len(corners)) * steps

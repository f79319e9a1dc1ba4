"""Circles on the sphere itself: against the plane's, and where no plane has room."""

import numpy as np
import pytest

from phexfab.errors import SolveError
from phexfab.minimal.circles import CircleLaw
from phexfab.minimal.gauss_image import gauss_image
from phexfab.minimal.immersed import _frames, _miss, _slope, immersed_circles
from phexfab.minimal.shell import lattice_on
from phexfab.surface.catalog import surface


def products(n, heights, tail, head):
    """The Lorentz product of neighbouring circles, −cos of the angle at which they cross."""
    sine = np.sqrt(1 - heights**2)
    flat = np.einsum("ij,ij->i", n[tail], n[head]) - heights[tail] * heights[head]
    return flat / (sine[tail] * sine[head])


def sample():
    made = surface("enneper").scaled(3000.0)
    on = lattice_on(made, 400.0)
    z = made.parameter(on.points)
    kappa = np.abs(made.principal_curvatures(z)[:, 0]) * made.scale
    return made, on, z, np.sqrt(kappa) * on.step / 2


def test_neighbours_touch_and_the_smooth_circles_are_near():
    made, on, z, radii = sample()
    normals = made.normal(z)
    n, heights = immersed_circles(CircleLaw(on.triangles), normals, radii)
    tail, head = on.triangles.ravel(), on.triangles[:, [1, 2, 0]].ravel()
    assert np.abs(products(n, heights, tail, head) + 1).max() < 1e-10
    assert np.linalg.norm(n - normals, axis=1).max() < 0.3 * radii.min()
    assert np.abs(np.arccos(heights) / radii - 1).max() < 0.2


def test_a_packing_of_the_plane_is_left_alone():
    """What the plane's packing gives solves the equations: no step is made from there."""
    made, on, z, _ = sample()
    n, heights = gauss_image(made, on, z, "edge")
    again, same = immersed_circles(CircleLaw(on.triangles), n, np.arccos(heights))
    assert np.abs(again - n).max() < 1e-9 and np.abs(same - heights).max() < 1e-9


def test_derivatives_against_differences():
    rng = np.random.default_rng(7)
    n = rng.normal(size=(6, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    logs = rng.normal(-1.0, 0.7, 6)
    tail, head, cosine = np.arange(5), np.arange(1, 6), rng.uniform(0, 1, 5)
    first, second = _frames(n)
    slope = _slope(n, logs, first, second, tail, head).toarray()
    sine, h = np.sin(2 * np.arctan(np.exp(logs))), 1e-6
    for column in range(18):
        values = []
        for step in (h, -h):
            there, grown = n.copy(), logs.copy()
            if column < 12:
                k = column // 2
                there[k] += step * sine[k] * (first, second)[column % 2][k]
                there[k] /= np.linalg.norm(there[k])
            else:
                grown[column - 12] += step
            values.append(_miss(there, grown, tail, head, cosine))
        difference = (values[0] - values[1]) / (2 * h)
        assert np.abs(difference - slope[:, column]).max() < 1e-6 * max(1, np.abs(difference).max())


def test_circles_that_cannot_close_are_refused():
    """Seven circles that all touch each other, a torus: 21 equations for 21 − 6 unknowns."""
    at = np.arange(7)
    triangles = np.concatenate(
        [
            np.column_stack([at, (at + 1) % 7, (at + 3) % 7]),
            np.column_stack([at, (at + 3) % 7, (at + 2) % 7]),
        ]
    )
    n = np.random.default_rng(1).normal(size=(7, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    with pytest.raises(SolveError, match=r'choose a finer lattice.*offset.type = "face"|singular'):
        immersed_circles(CircleLaw(triangles), n, np.full(7, 0.5))

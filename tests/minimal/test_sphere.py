"""Stereographic projection, rotations and lifted circles."""

import numpy as np
import pytest

from phexfab.minimal.sphere import (
    farthest_direction,
    lift_circles,
    rotation_to_north,
    stereographic,
)


def inverse(g):
    return (
        np.stack([2 * g.real, 2 * g.imag, np.abs(g) ** 2 - 1], -1) / (np.abs(g) ** 2 + 1)[..., None]
    )


def test_projection_inverts():
    rng = np.random.default_rng(0)
    g = rng.normal(size=50) + 1j * rng.normal(size=50)
    assert np.allclose(stereographic(inverse(g)), g, rtol=1e-12)


def test_lifted_circles_lie_in_their_planes():
    rng = np.random.default_rng(1)
    centre = rng.normal(size=20) + 1j * rng.normal(size=20)
    radius = rng.uniform(0.1, 0.5, 20)
    normals, heights = lift_circles(centre, radius)
    assert np.allclose(np.linalg.norm(normals, axis=1), 1, atol=1e-15)
    rim = inverse(centre[:, None] + radius[:, None] * np.exp(1j * np.linspace(0, 6, 7)))
    assert np.allclose(np.einsum("fki,fi->fk", rim, normals), heights[:, None], atol=1e-14)
    inside = inverse(centre)
    assert (np.einsum("fi,fi->f", inside, normals) > heights).all()


@pytest.mark.parametrize("z", [1.0, -1.0, 0.3])
def test_rotation_takes_a_direction_north(z):
    direction = np.array([np.sqrt(1 - z * z), 0, z])
    turn = rotation_to_north(direction)
    assert np.allclose(turn @ direction, [0, 0, 1], atol=1e-15)
    assert np.allclose(turn @ turn.T, np.eye(3), atol=1e-15) and np.linalg.det(turn) > 0


def test_farthest_direction_is_the_pole_of_a_cap():
    rng = np.random.default_rng(2)
    cap = inverse(0.4 * (rng.normal(size=300) + 1j * rng.normal(size=300)))
    far = farthest_direction(cap)
    assert np.max(cap @ far) < np.max(cap @ np.array([1.0, 0, 0]))

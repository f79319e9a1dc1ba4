"""Edge curvatures, and the quads' H and K that follow from them."""

import numpy as np
import pytest

from phexfab.errors import MeshError
from phexfab.mesh.measures import edges
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.curvature import pair_curvatures
from phexfab.parallel.edge_curvature import (
    edge_curvatures,
    quad_curvatures,
    quad_face_curvatures,
    twin_corners,
)
from phexfab.parallel.pairs import pair_interval, parallelism
from phexfab.surface.catalog import surface

SMOOTH = surface("enneper").scaled(1000.0)
SHELL = minimal_shell(SMOOTH, lattice_on(SMOOTH, 100.0), "edge")


def quad_pair(rows, columns, seed):
    """A quad mesh of revolution-like planes and a random member of P(M): a pair, both free.

    Vertices p_kl = (r_k cos a_l, r_k sin a_l, z_k) have planar trapezoids; so has every mesh whose
    r and z change with the same ratios, and whose angles are the same.
    """
    rng = np.random.default_rng(seed)
    angle = np.cumsum(rng.uniform(0.1, 0.3, columns))
    step = rng.uniform(0.1, 0.3, (rows - 1, 2))
    scale = rng.uniform(-2.0, 2.0, rows - 1)

    def mesh(start, steps):
        r, z = (start + np.concatenate([[[0, 0]], np.cumsum(steps, axis=0)])).T
        x, y = np.outer(r, np.cos(angle)), np.outer(r, np.sin(angle))
        points = np.stack([x, y, np.broadcast_to(z[:, None], x.shape)], axis=2).reshape(-1, 3)
        k, l = np.meshgrid(np.arange(rows - 1), np.arange(columns - 1), indexing="ij")
        c = (k * columns + l).ravel()
        return PolyMesh.from_faces(
            points, np.column_stack([c, c + 1, c + columns + 1, c + columns])
        )

    return mesh((1.0, 0.0), step), mesh((rng.uniform(-2, 2), 0.3), step * scale[:, None])


@pytest.mark.parametrize("seed", range(6))
def test_quads_agree_with_the_mixed_areas(seed):
    mesh, gauss = quad_pair(7, 9, seed)
    assert parallelism(mesh, gauss).max() < 1e-12
    mean, gaussian = quad_face_curvatures(mesh, gauss)
    found = pair_curvatures(mesh, gauss)
    size = np.abs(edge_curvatures(mesh, gauss)).max()
    assert np.abs(mean - found.mean).max() < 1e-12 * size
    assert np.abs(gaussian - found.gaussian).max() < 1e-12 * size**2
    assert np.abs(found.mean).min() > 1e-6 * size


def free_quads(n, seed):
    """Random planar quads, any shape, and parallel ones: two edge lengths free, two follow."""
    rng = np.random.default_rng(seed)
    e = np.zeros((n, 4, 2))
    e[:, :3] = rng.normal(size=(n, 3, 2))
    e[:, 3] = -e[:, :3].sum(axis=1)
    k = np.empty((n, 4))
    k[:, :2] = rng.normal(size=(n, 2))
    right = -(k[:, 0, None] * e[:, 0] + k[:, 1, None] * e[:, 1])
    k[:, 2:] = np.linalg.solve(np.stack([e[:, 2], e[:, 3]], axis=2), right[..., None])[..., 0]
    meshes = []
    for vectors in (e, k[..., None] * e):
        points = np.zeros((n, 4, 3))
        points[:, 1:, :2] = np.cumsum(vectors, axis=1)[:, :3]
        meshes.append(PolyMesh.from_faces(points.reshape(-1, 3), np.arange(4 * n).reshape(-1, 4)))
    return *meshes, k


def test_the_sign_of_the_printed_mean_curvature_is_the_other_one():
    """Thesis §7.1.1.2 as printed, on quads of any shape: K is right, H has the wrong sign."""
    mesh, gauss, k = free_quads(300, 1)
    found = pair_curvatures(mesh, gauss)
    a, b, c, d = k.T
    below = a + c - b - d
    good = (np.abs(found.areas) > 0.05) & (np.abs(below) > 0.05)
    assert good.sum() > 200
    printed = (a * c - b * d) / below
    printed_k = a * b * c * d / below * (1 / b + 1 / d - 1 / a - 1 / c)
    scale = np.abs(k).max(axis=1)
    assert np.abs(printed + found.mean)[good].max() < 1e-9
    assert np.abs((printed_k - found.gaussian) / scale**2)[good].max() < 1e-9
    mean, gaussian = quad_curvatures(k)
    assert np.abs(mean - found.mean)[good].max() < 1e-9
    assert np.abs((gaussian - found.gaussian) / scale**2)[good].max() < 1e-9


def test_a_round_cap_has_minus_the_edge_curvature():
    mesh, _ = quad_pair(4, 5, 0)
    gauss = PolyMesh(mesh.vertices / 250.0, mesh.corners, mesh.starts)
    assert np.abs(edge_curvatures(mesh, gauss) - 1 / 250.0).max() < 1e-15
    mean, gaussian = quad_face_curvatures(mesh, gauss)
    assert np.abs(mean + 1 / 250.0).max() < 1e-15
    assert np.abs(gaussian - 1 / 250.0**2).max() < 1e-18


def test_degenerate_quads():
    mean, gaussian = quad_curvatures(np.array([[0.0, 2.0, 0.0, 2.0], [1.0, 1.0, 2.0, 2.0]]))
    assert (mean[0], gaussian[0]) == (-1.0, 0.0)  # a cylinder
    assert np.isnan(mean[1]) and np.isnan(gaussian[1])
    with pytest.raises(MeshError, match="only quads"):
        quad_curvatures(np.ones((2, 6)))
    with pytest.raises(MeshError, match="face 0 has 6 sides"):
        quad_face_curvatures(SHELL.mesh, SHELL.gauss)


def test_the_offset_s_edges_are_scaled_by_one_plus_d_kappa():
    mesh, gauss = SHELL.mesh, SHELL.gauss
    k, d = edge_curvatures(mesh, gauss), -230.0
    moved = mesh.vertices + d * gauss.vertices
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    before, after = mesh.vertices[head] - mesh.vertices[tail], moved[head] - moved[tail]
    assert np.abs(after - (1 + d * k)[:, None] * before).max() < 1e-10
    limits = -1 / k[k > 0].max(), -1 / k[k < 0].min()
    assert limits == pytest.approx(pair_interval(mesh, gauss), rel=1e-12)


def test_both_sides_of_an_edge_agree():
    twin = twin_corners(SHELL.mesh)
    inner = np.flatnonzero(twin >= 0)
    assert (twin[twin[inner]] == inner).all()
    border = len(twin) - len(inner)
    assert len(inner) // 2 + border == len(edges(SHELL.mesh)) and border > 0
    k = edge_curvatures(SHELL.mesh, SHELL.gauss)
    assert np.abs(k[inner] - k[twin[inner]]).max() == 0


def test_a_disoriented_mesh_is_refused():
    mesh = PolyMesh.from_faces(np.eye(4, 3), [[0, 1, 2], [0, 1, 3]])
    with pytest.raises(MeshError, match="edge 0-1"):
        twin_corners(mesh)

"""Shells as planes: rings, edges, offsets, mixed areas by another route."""

import numpy as np
import pytest

from phexfab.errors import MeshError, OffsetLimitError
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.curvature import gaussian_curvatures, mean_curvatures, mixed_areas
from phexfab.parallel.offset import admissible_interval, offset
from phexfab.parallel.rings import face_rings
from phexfab.surface.catalog import surface

MADE = surface("enneper").scaled(1000.0)
SHELL = minimal_shell(MADE, lattice_on(MADE, 200.0), "edge")


def test_corners_run_counter_clockwise_and_edges_lie_between_their_faces():
    mesh, normals = SHELL.mesh, SHELL.normals[SHELL.panels]
    areas = mixed_areas(SHELL, mesh.vertices, mesh.vertices)
    assert areas.min() > 0
    for i, j, left, right in SHELL.edges:
        along = mesh.vertices[j] - mesh.vertices[i]
        assert abs(along @ normals[left]) < 1e-9
        if right >= 0:
            assert abs(along @ normals[right]) < 1e-9
            assert set((i, j)) <= set(mesh.face(right))
        face = list(mesh.face(left))
        assert face[(face.index(i) + 1) % len(face)] == j


def test_each_edge_once_and_euler():
    mesh = SHELL.mesh
    edges = {tuple(sorted(e[:2])) for e in SHELL.edges.tolist()}
    assert len(edges) == len(SHELL.edges)
    assert len(mesh.vertices) - len(edges) + mesh.n_faces == 1


def test_steiners_polynomial_per_face():
    """area(M + dS) = (1 − 2dH + d²K) area(M), with areas measured on the offset itself."""
    area = mixed_areas(SHELL, SHELL.mesh.vertices, SHELL.mesh.vertices)
    low, high = admissible_interval(SHELL)
    for d in np.linspace(0.9 * low, 0.9 * high, 5):
        moved = offset(SHELL, d)
        measured = mixed_areas(moved, moved.mesh.vertices, moved.mesh.vertices)
        h, k = mean_curvatures(SHELL), gaussian_curvatures(SHELL)
        assert np.allclose(measured, (1 - 2 * d * h + d * d * k) * area, rtol=1e-11)


def test_offsets_compose_and_are_refused_beyond_the_interval():
    twice = offset(offset(SHELL, 12.0), 7.5)
    assert np.allclose(twice.mesh.vertices, offset(SHELL, 19.5).mesh.vertices, atol=1e-9)
    _, high = admissible_interval(SHELL)
    with pytest.raises(OffsetLimitError, match=r"offset\.distance = .* keep the distance between"):
        offset(SHELL, high * 1.01)


def test_curvature_converges_to_the_smooth_surface():
    worst = []
    for size in (200.0, 100.0, 50.0):
        shell = minimal_shell(MADE, lattice_on(MADE, size), "edge")
        smooth = MADE.gaussian_curvature(shell.parameters[shell.panels])
        worst.append(np.median(np.abs(gaussian_curvatures(shell) / smooth - 1)))
    assert (-np.diff(np.log2(worst)) > 1.9).all()


def test_disoriented_triangles_are_refused():
    triangles = SHELL.triangles.copy()
    triangles[0] = triangles[0, ::-1]
    with pytest.raises(MeshError, match="directed edge"):
        face_rings(triangles, len(SHELL.normals))

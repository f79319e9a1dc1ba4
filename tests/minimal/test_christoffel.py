"""Discrete minimal by definition; Christoffel duals by splitting and by the linear solve."""

from pathlib import Path

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from phexfab.errors import MeshError
from phexfab.mesh.io import read_mesh, weld
from phexfab.mesh.measures import edges, face_normals, mean_edge, signed_areas
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.christoffel import (
    edge_classes,
    is_discrete_minimal,
    quad_dual_coefficients,
    split_coefficients,
    split_dual,
)
from phexfab.minimal.conformal import christoffel_dual, conformal_gauss_image, ring_tilt
from phexfab.minimal.dual_space import DualSpace
from phexfab.minimal.shell import minimal_shell
from phexfab.parallel.pairs import parallelism
from phexfab.parallel.rings import edge_faces
from phexfab.remesh.lattice import lattice
from phexfab.surface.catalog import surface

DATA = Path(__file__).parents[3] / "shared" / "data"
CASES = {
    "case 1, Enneper": {"columns": 14, "rows": 12, "size": 0.08},
    "case 2, catenoid": {"columns": 20, "rows": 9, "tilt": ring_tilt(20), "closed": True},
    "case 3, helicoid": {"columns": 14, "rows": 12, "tilt": 0.1 + 0.07j, "size": 0.7},
}
KINDS = ("face", "edge", "vertex")


def shell_on(name, step, kind, half=0.4):
    made = surface(name).scaled(1000.0)
    u0, u1, v0, v1 = made.rectangle
    u, v = (u0 + u1) / 2, (v0 + v1) / 2
    return minimal_shell(made, lattice((u - half, u + half, v - half, v + half), step), kind)


def distance(mesh, points):
    """Largest distance after the best scaling and translation, over the size."""
    x = mesh.vertices - mesh.vertices.mean(axis=0)
    y = points - points.mean(axis=0)
    scale = np.sum(x * y) / np.sum(y * y)
    return np.abs(x - scale * y).max() / np.abs(x).max()


def mixed(p, q):
    """Twice the mixed area of two polygons of the plane, from the definition by polarisation."""

    def twice(x):
        return x[:, 0] @ np.roll(x[:, 1], -1) - x[:, 1] @ np.roll(x[:, 0], -1)

    return (twice(p + q) - twice(p) - twice(q)) / 2


@pytest.mark.parametrize("kind", KINDS)
def test_the_definition_tells_a_minimal_pair(kind):
    shell = shell_on("scherk-1", 0.15, kind)
    found = is_discrete_minimal(shell.mesh, shell.gauss)
    assert found and found.worst < 1e-12 and found.sine < 1e-12
    panel = shell.panels[5]
    raised = shell.with_heights(shell.heights + 1.0 * (np.arange(len(shell.heights)) == panel))
    other = is_discrete_minimal(raised.mesh, shell.gauss)
    assert not other and other.worst > 1e-3 and other.sine < 1e-12
    ring = np.append(shell.rings[3][shell.mesh.face_of_corner == 5], panel)
    assert shell.panels[other.face] in ring
    # With −S it is as minimal; with a mesh that is not parallel it is not, whatever the areas say.
    turned = PolyMesh(-shell.gauss.vertices, shell.gauss.corners, shell.gauss.starts)
    assert is_discrete_minimal(shell.mesh, turned)
    bent = PolyMesh(shell.gauss.vertices[:, ::-1], shell.gauss.corners, shell.gauss.starts)
    assert not is_discrete_minimal(shell.mesh, bent, tolerance=np.inf)


def test_quad_duals_have_no_mixed_area_and_parallel_diagonals():
    rng = np.random.default_rng(0)
    quads = np.zeros((200, 4, 3))
    quads[:, :, :2] = rng.normal(size=(200, 4, 2))
    c = quad_dual_coefficients(quads, np.tile([0.0, 0.0, 1.0], (200, 1)))
    dual = np.cumsum(c[..., None] * (np.roll(quads, -1, axis=1) - quads), axis=1)
    assert np.abs(dual[:, 3]).max() < 1e-11  # it closes
    dual = np.roll(dual, 1, axis=1)
    for p, q in zip(quads[..., :2], dual[..., :2], strict=True):
        assert abs(mixed(p, q)) < 1e-11
        for one, two in (((0, 2), (1, 3)), ((1, 3), (0, 2))):
            a, b = p[one[1]] - p[one[0]], q[two[1]] - q[two[0]]
            cross = a[0] * b[1] - a[1] * b[0]
            assert abs(cross) < 1e-10 * np.linalg.norm(a) * np.linalg.norm(b) + 1e-12


@pytest.mark.parametrize("cut", range(3))
def test_every_hexagon_has_a_dual_for_every_cut(cut):
    """Also where the duals of neighbours do not fit together."""
    shell = shell_on("scherk-1", 0.2, "face")
    rough = shell.with_heights(
        shell.gauss_heights + 1e-3 * np.random.default_rng(cut).normal(size=len(shell.normals))
    ).mesh
    c = split_coefficients(rough, cut)
    steps = c[:, None] * (
        rough.vertices[rough.corners[rough.next_corner]] - rough.vertices[rough.corners]
    )
    for f, n in enumerate(face_normals(rough)):
        part = slice(rough.starts[f], rough.starts[f + 1])
        dual = np.cumsum(steps[part], axis=0)
        size = np.abs(dual).max()
        assert np.abs(dual[-1]).max() < 1e-11 * size
        x = np.linalg.svd(n[None])[2][1]
        frame = np.column_stack([x, np.cross(n, x)])
        polygon = (rough.polygon(f) - rough.polygon(f)[0]) @ frame
        assert abs(mixed(polygon, np.roll(dual, 1, axis=0) @ frame)) < 1e-11 * size * np.ptp(
            polygon
        )
    assert split_dual(rough, cut).residual > 1e-3


@pytest.mark.parametrize("case", CASES)
def test_splitting_gives_the_closed_form_dual_of_conformal_hexagons(case):
    shell, twice = conformal_gauss_image(**CASES[case])
    classes = edge_classes(shell.gauss)[edge_faces(shell)[0]]
    cut = int(classes[twice][0])
    assert (classes[twice] == cut).all() and not (classes[~twice] == cut).any()
    found = split_dual(shell.gauss, cut)
    assert found.residual < 1e-11
    assert distance(found.mesh, christoffel_dual(shell, twice)) < 1e-11
    assert is_discrete_minimal(found.mesh, shell.gauss)
    assert split_dual(shell.gauss).residual < 1e-11
    if case == "case 2, catenoid":  # the two other duals have a period, so they do not close
        others = [split_dual(shell.gauss, k) for k in {0, 1, 2} - {cut}]
        assert all(one.residuals.max() < 1e-11 and one.openings.max() > 0.1 for one in others)


@pytest.mark.parametrize("kind", KINDS)
def test_the_residual_of_splitting_falls_on_other_surfaces(kind):
    """Nearly compatible, and near M: a start for the exact solve."""
    residuals, moved = [], []
    for step in (0.2, 0.1, 0.05):
        shell = shell_on("catalan", step, kind)
        found = min(
            (split_dual(shell.gauss, cut) for cut in range(3)),
            key=lambda one: distance(one.mesh, shell.mesh.vertices),
        )
        residuals.append(found.residuals.max())
        moved.append(distance(found.mesh, shell.mesh.vertices))
    assert residuals[0] < 1e-4 and residuals[0] / residuals[-1] > 5
    assert moved[0] < 2e-3 and moved[0] / moved[-1] > 3


def test_quad_meshes_are_dualised_without_a_cut():
    """A catenoid of quads along curvature lines is a discrete isothermic, so a Koenigs net."""
    n, m = 8, 24
    a = np.arange(m) * 2 * np.pi / m
    # Circles whose quads have the same cross-ratio: a discrete Mercator net of the sphere.
    q = np.arange(n) - (n - 1) / 2
    rho = (1 / np.cos(np.pi / m) + np.tan(np.pi / m)) ** q
    x, y = np.outer(rho, np.cos(a)), np.outer(rho, np.sin(a))
    square = x * x + y * y
    points = np.stack([2 * x, 2 * y, square - 1], axis=2) / (1 + square)[..., None]
    k, l = np.meshgrid(np.arange(n - 1), np.arange(m), indexing="ij")
    after = (l + 1) % m
    faces = np.stack([k * m + l, k * m + after, (k + 1) * m + after, (k + 1) * m + l], axis=2)
    gauss = PolyMesh.from_faces(points.reshape(-1, 3), faces.reshape(-1, 4))
    found = split_dual(gauss)
    assert found.cut is None and found.residual < 1e-11
    assert is_discrete_minimal(found.mesh, gauss)
    radius = np.linalg.norm(found.mesh.vertices[:, :2], axis=1).reshape(n, m)
    assert radius.min(axis=1).argmin() in (n // 2 - 1, n // 2)  # it has a waist


def test_splitting_refuses_what_it_cannot_split():
    with pytest.raises(MeshError, match="face 0 has 3 sides"):
        split_dual(PolyMesh.from_faces(np.eye(3), [[0, 1, 2]]))
    shell = shell_on("scherk-1", 0.2, "face")
    with pytest.raises(MeshError, match="name the class"):
        split_coefficients(shell.gauss)
    kink = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]])
    with pytest.raises(MeshError, match="on a line"):
        split_dual(PolyMesh.from_faces(kink, [[0, 1, 2, 3]]))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["enneper", "scherk-1"])
def test_the_dual_space_has_a_dimension_for_every_border_plane(name, kind):
    """Against the null space of edge scales, computed densely: closing faces, no mixed area."""
    shell = shell_on(name, 0.2, kind)
    gauss = shell.gauss
    space = DualSpace.of(gauss)
    pairs = edges(gauss)
    tail, head = gauss.corners, gauss.corners[gauss.next_corner]
    order = np.searchsorted(
        pairs[:, 0] * 10**6 + pairs[:, 1], np.minimum(tail, head) * 10**6 + np.maximum(tail, head)
    )
    along = gauss.vertices[head] - gauss.vertices[tail]
    matrix = np.zeros((4 * gauss.n_faces, len(pairs)))
    normals = face_normals(gauss)[gauss.face_of_corner]
    volume = np.einsum("ij,ij->i", np.cross(gauss.vertices[tail], along), normals)
    for c, f in enumerate(gauss.face_of_corner):
        matrix[4 * f : 4 * f + 3, order[c]] += along[c]
        matrix[4 * f + 3, order[c]] += volume[c]
    values = np.linalg.svd(matrix, compute_uv=False)
    null = len(pairs) - np.count_nonzero(values > 1e-9 * values[0])
    assert space.dimension == null + 3  # and the translations
    assert space.dimension == np.count_nonzero(np.bincount(gauss.corners) == 1)


@pytest.mark.parametrize("kind", KINDS)
def test_members_of_the_dual_space_are_minimal(kind):
    shell = shell_on("scherk-1", 0.15, kind)
    space = DualSpace.of(shell.gauss)
    back = space.mesh(space.border_heights(shell.mesh))
    assert np.abs(back.vertices - shell.mesh.vertices).max() < 1e-9  # mm, of a metre
    rng = np.random.default_rng(0)
    border = rng.normal(size=space.dimension)
    member = space.mesh(border)
    assert is_discrete_minimal(member, shell.gauss, 1e-9)
    sum_of = sum(h * space.member(k).vertices for k, h in enumerate(border))
    assert np.abs(member.vertices - sum_of).max() < 1e-9 * np.abs(sum_of).max()
    shift = np.array([1.0, -2.0, 3.0])
    moved = PolyMesh(shell.mesh.vertices + shift, shell.mesh.corners, shell.mesh.starts)
    again = space.mesh(space.border_heights(moved))
    assert np.abs(again.vertices - moved.vertices).max() < 1e-9


def test_the_split_dual_is_made_exact_by_the_nearest_member():
    shell = shell_on("catalan", 0.1, "vertex")
    guess = split_dual(shell.gauss).mesh
    assert not is_discrete_minimal(guess, shell.gauss)
    space = DualSpace.of(shell.gauss)
    exact = space.nearest(guess)
    assert is_discrete_minimal(exact, shell.gauss)
    gap = np.linalg.norm(exact.vertices - guess.vertices)
    assert gap < 1e-3 * np.linalg.norm(guess.vertices - guess.vertices.mean(axis=0))
    for k in range(0, space.dimension, 7):  # no member is nearer
        for step in (1e-4, -1e-4):
            other = exact.vertices + step * space.member(k).vertices
            assert np.linalg.norm(other - guess.vertices) > gap
    assert np.abs(space.nearest(exact).vertices - exact.vertices).max() < 1e-11


def test_a_ring_has_a_dual_space_too():
    shell, twice = conformal_gauss_image(**CASES["case 2, catenoid"])
    space = DualSpace.of(shell.gauss)
    dual = PolyMesh(christoffel_dual(shell, twice), shell.gauss.corners, shell.gauss.starts)
    back = space.mesh(space.border_heights(dual))
    assert np.abs(back.vertices - dual.vertices).max() < 1e-10 * np.abs(dual.vertices).max()


def test_the_solve_refuses_what_is_not_simple():
    quads = PolyMesh.from_faces(
        np.array([[x, y, 0.0] for y in range(3) for x in range(3)]),
        [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8, 7]],
    )
    with pytest.raises(MeshError, match="vertex 4 has 4 faces"):
        DualSpace.of(quads)
    shell = shell_on("scherk-1", 0.2, "face")
    points = shell.gauss.vertices + 0.01 * np.random.default_rng(0).normal(
        size=shell.gauss.vertices.shape
    )
    with pytest.raises(MeshError, match="planarise"):
        DualSpace.of(PolyMesh(points, shell.gauss.corners, shell.gauss.starts))
    with pytest.raises(MeshError, match="border heights"):
        DualSpace.of(shell.gauss).mesh(np.zeros(2))


def rows_of(weight, row, vertex, n_rows, n_vertices):
    columns = (3 * vertex[:, None] + np.arange(3)).ravel()
    return sp.csr_matrix(
        (weight.ravel(), (np.repeat(row, 3), columns)), shape=(n_rows, 3 * n_vertices)
    )


def inscribed_dual(mesh, steps):
    """Gauss–Newton for a mesh with edges parallel, vertices on the sphere and no mixed areas."""
    pairs, n = edges(mesh), len(mesh.vertices)
    along = mesh.vertices[pairs[:, 1]] - mesh.vertices[pairs[:, 0]]
    along /= np.linalg.norm(along, axis=1)[:, None]
    one = np.cross(along, np.eye(3)[np.argmin(np.abs(along), axis=1)])
    one /= np.linalg.norm(one, axis=1)[:, None]
    k, normals, owner = len(pairs), face_normals(mesh), mesh.face_of_corner
    parallel = [
        rows_of(x, np.arange(k), pairs[:, 1], k, n) - rows_of(x, np.arange(k), pairs[:, 0], k, n)
        for x in (one, np.cross(along, one))
    ]
    p = mesh.vertices[mesh.corners]
    weight = np.cross(p[mesh.next_corner] - p[mesh.previous_corner], normals[owner]) / 4
    weight *= (mean_edge(mesh) / signed_areas(mesh))[owner][:, None]
    minimal = rows_of(weight, owner, mesh.corners, mesh.n_faces, n)
    s = np.zeros((n, 3))
    np.add.at(s, mesh.corners, normals[owner])
    s /= np.linalg.norm(s, axis=1)[:, None]
    for _ in range(steps):
        sphere = rows_of(s, np.arange(n), np.arange(n), n, n)
        jacobian = sp.vstack([*parallel, sphere, minimal]).tocsr()
        residual = jacobian @ s.ravel()
        residual[2 * k : 2 * k + n] = (np.sum(s * s, axis=1) - 1) / 2
        square = (jacobian.T @ jacobian + 1e-13 * sp.eye(3 * n)).tocsc()
        s = s - splu(square).solve(jacobian.T @ residual).reshape(-1, 3)
    return PolyMesh(s, mesh.corners, mesh.starts)


@pytest.mark.skipif(not DATA.exists(), reason="the public meshes of ../shared/data are not here")
@pytest.mark.parametrize(
    ("name", "limit", "steps"), [("enneper2", 2.4e-4, 24), ("catenoid3", 3e-5, 8)]
)
def test_public_meshes_are_discrete_minimal_of_vertex_type(name, limit, steps):
    """To the digits that are printed, about 1e-5 of an edge of M."""
    mesh = read_mesh(DATA / f"{name}.off")
    if name == "catenoid3":
        mesh = weld(mesh, 0.05)
        assert len(mesh.vertices) == 3400
    gauss = inscribed_dual(mesh, steps)
    assert np.abs(np.linalg.norm(gauss.vertices, axis=1) - 1).max() < 1e-5
    found = is_discrete_minimal(mesh, gauss, limit, parallel=2e-4)
    assert found, (found.worst, found.sine)
    assert found.sine == parallelism(mesh, gauss).max()


@pytest.mark.skipif(not DATA.exists(), reason="the public meshes of ../shared/data are not here")
def test_a_stretched_public_mesh_is_not_minimal():
    mesh = read_mesh(DATA / "enneper2.off")
    mesh = PolyMesh(mesh.vertices * [1.0, 1.02, 1.0], mesh.corners, mesh.starts)
    assert not is_discrete_minimal(mesh, inscribed_dual(mesh, 8), 2.4e-4, parallel=2e-4)

"""Mixed areas, Steiner's formula and curvatures, on random members of P(M) and against surfaces."""

import numpy as np
import pytest

from phexfab.errors import MeshError
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import lattice_on, minimal_shell, tangent_shell
from phexfab.parallel.curvature import (
    FaceCurvatures,
    face_fields,
    minimality,
    pair_curvatures,
    pair_mixed_areas,
    principal_curvatures,
    shell_curvatures,
)
from phexfab.remesh.lattice import lattice
from phexfab.surface.catalog import surface
from phexfab.triangular import EQUILATERAL

SMOOTH = surface("enneper").scaled(1000.0)
SHELL = minimal_shell(SMOOTH, lattice_on(SMOOTH, 100.0), "face")
NORMALS = SHELL.normals[SHELL.panels]
KINDS = ("face", "edge", "vertex")


def member(seed):
    """A random member of P(M), about the size of the Gauss image."""
    rng = np.random.default_rng(seed)
    heights = SHELL.gauss_heights + 0.02 * rng.normal(size=len(SHELL.normals))
    return SHELL.with_heights(heights).mesh


def area_by_shoelace(mesh, normals):
    """Oriented areas in coordinates of each face's plane, one face at a time."""
    found = []
    for f, n in enumerate(normals):
        x = np.linalg.svd(n[None])[2][1]
        y = np.cross(n, x)
        p = mesh.polygon(f) - mesh.polygon(f)[0]
        u, v = p @ x, p @ y
        found.append((u @ np.roll(v, -1) - v @ np.roll(u, -1)) / 2)
    return np.array(found)


def combine(a, p, b, q):
    return PolyMesh(a * p.vertices + b * q.vertices, p.corners, p.starts)


@pytest.mark.parametrize("seed", range(4))
def test_steiner_s_formula_at_random_distances(seed):
    m, s = member(seed), member(seed + 50)
    found = pair_curvatures(m, s, NORMALS)
    for d in np.random.default_rng(seed).normal(size=5):
        real = area_by_shoelace(combine(1, m, d, s), NORMALS)
        size = np.abs(found.areas) + np.abs(d * found.mixed) + d * d * np.abs(found.gauss_areas)
        assert np.abs(found.offset_areas(d) - real).max() < 1e-12 * size.max()
        factor = 1 - 2 * d * found.mean + d * d * found.gaussian
        assert np.abs(factor * found.areas - real).max() < 1e-12 * size.max()


@pytest.mark.parametrize("seed", range(4))
def test_the_mixed_area_is_symmetric_and_bilinear(seed):
    p, q, r = (member(seed + 10 * k) for k in range(3))
    a, b = np.random.default_rng(seed).normal(size=2)

    def area(one, two):
        return pair_mixed_areas(one, two, NORMALS)

    size = np.abs(area(p, p)).max() + np.abs(area(q, q)).max() + np.abs(area(r, r)).max()
    assert np.abs(area(p, q) - area(q, p)).max() < 1e-12 * size
    left = area(combine(a, p, b, q), r)
    assert np.abs(left - a * area(p, r) - b * area(q, r)).max() < 1e-12 * size
    assert np.abs(area(p, p) - area_by_shoelace(p, NORMALS)).max() < 1e-12 * size


@pytest.mark.parametrize("seed", range(4))
def test_principal_curvatures_have_mean_h_and_product_k(seed):
    found = pair_curvatures(member(seed), member(seed + 50), NORMALS)
    roots, real = principal_curvatures(found.mean, found.gaussian)
    scale = np.abs(roots).max(axis=1)
    assert np.abs((roots[:, 0] + roots[:, 1]) / 2 - found.mean).max() <= (1e-12 * scale).max()
    assert (np.abs(roots[:, 0] * roots[:, 1] - found.gaussian) <= 1e-12 * scale**2).all()
    assert (real == (found.mean**2 >= found.gaussian)).all()
    assert (np.isnan(found.principal).any(axis=1) == ~real).all()
    kept = found.principal[real]
    assert (kept[:, 0] >= kept[:, 1]).all()


def test_complex_principal_curvatures_are_a_conjugate_pair():
    roots, real = principal_curvatures(np.array([1.0, -2.0, 0.0]), np.array([5.0, 4.0, 0.0]))
    assert real.tolist() == [False, True, True]
    assert roots[0].tolist() == [1 + 2j, 1 - 2j]
    assert roots[1:].tolist() == [[-2, -2], [0, 0]]
    assert np.isnan(FaceCurvatures(*np.array([[1.0], [-1.0], [5.0]])).principal).all()


def test_convex_faces_have_real_principal_curvatures():
    """Minkowski's inequality: area(P, Q)² ≥ area(P) area(Q) for convex parallel polygons."""
    rng = np.random.default_rng(5)
    angle = np.sort(rng.uniform(0, 2 * np.pi, (400, 6)), axis=1)
    edge = np.stack([np.cos(angle), np.sin(angle)], axis=2)
    # Closing lengths: a positive combination exists where the directions surround the origin.
    keep = np.diff(np.c_[angle, angle[:, :1] + 2 * np.pi], axis=1).max(axis=1) < 0.8 * np.pi
    edge = edge[keep]
    meshes = []
    for _ in range(2):
        length = rng.uniform(1, 2, edge.shape[:2])
        for _ in range(2000):
            gap = np.einsum("fk,fkj->fj", length, edge)
            length = np.maximum(length - 0.1 * np.einsum("fj,fkj->fk", gap, edge), 0.2)
        vectors = length[..., None] * edge
        points = np.zeros((len(edge), 6, 3))
        points[:, 1:, :2] = np.cumsum(vectors, axis=1)[:, :5]
        closed = np.abs(vectors.sum(axis=1)).max(axis=1) < 1e-12
        meshes.append((points, closed))
    good = meshes[0][1] & meshes[1][1]
    assert good.sum() > 50
    faces = np.arange(6 * good.sum()).reshape(-1, 6)
    pair = [PolyMesh.from_faces(points[good].reshape(-1, 3), faces) for points, _ in meshes]
    found = pair_curvatures(*pair)
    assert (found.mean**2 - found.gaussian >= -1e-12).all()
    assert (found.mean < 0).all()


def test_turning_the_normals_over_changes_nothing():
    one, two = (pair_curvatures(SHELL.mesh, SHELL.gauss, sign * NORMALS) for sign in (1, -1))
    assert (one.mean == two.mean).all() and (one.gaussian == two.gaussian).all()
    assert (one.areas == -two.areas).all()


def test_normals_of_its_own_are_the_shell_s():
    one, two = pair_curvatures(SHELL.mesh, SHELL.gauss), shell_curvatures(SHELL)
    assert np.abs(one.gaussian / two.gaussian - 1).max() < 1e-12


def test_degenerate_faces():
    flat = FaceCurvatures(*np.array([[2.0, 2.0, 0.0], [0.0, 1.0, 1.0], [0.0, 0.0, 1.0]]))
    assert flat.minimality[:2].tolist() == [0.0, np.inf]
    assert np.isnan(flat.mean[2]) and np.isnan(flat.gaussian[2])


def test_other_faces_are_refused():
    other = PolyMesh(SHELL.mesh.vertices, np.roll(SHELL.mesh.corners, 1), SHELL.mesh.starts)
    with pytest.raises(MeshError, match="correspond"):
        pair_mixed_areas(SHELL.mesh, other)


def halved(name, kind, make=minimal_shell, times=4):
    """Shells on lattices of step a, a/2, …, all with a panel at the middle of the rectangle."""
    made = surface(name).scaled(1000.0)
    u0, u1, v0, v1 = made.rectangle
    middle, a = complex(u0 + u1, v0 + v1) / 2, 0.16
    rise = a * EQUILATERAL
    half = 4 * a, 4 * rise
    box = (
        middle.real - half[0],
        middle.real + half[0],
        middle.imag - half[1],
        middle.imag + half[1],
    )
    for k in range(times):
        yield made, make(made, lattice(box, a / 2**k), kind)


def rates(errors):
    return -np.diff(np.log2(errors))


def smooth_curvatures(made, shell, distance):
    """κ of the parallel surface at a distance is κ/(1 − dκ), at the point of every panel."""
    kappa = made.principal_curvatures(shell.parameters[shell.panels])
    return kappa / (1 - distance * kappa)


def errors_of(made, shell, distance):
    """(P, 3) errors of H, K and the principal curvatures of M + dS, in units of 1 m."""
    kappa = smooth_curvatures(made, shell, distance)
    found = shell_curvatures(shell.with_heights(shell.heights + distance * shell.gauss_heights))
    return np.column_stack(
        [
            np.abs(found.mean - kappa.mean(axis=1)) * 1e3,
            np.abs(found.gaussian - kappa.prod(axis=1)) * 1e6,
            np.abs(found.principal - np.sort(kappa, axis=1)[:, ::-1]).max(axis=1) * 1e3,
        ]
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["catenoid", "enneper"])
@pytest.mark.parametrize("distance", [0.0, 80.0, -60.0])
def test_curvatures_of_parallel_surfaces_converge_with_rate_two(name, kind, distance):
    """On discrete minimal surfaces, border panels included: in the maximum and in the mean."""
    worst, mean = [], []
    for made, shell in halved(name, kind):
        found = errors_of(made, shell, distance)
        worst.append(found.max(axis=0))
        mean.append(found.mean(axis=0))
    for table in (np.array(worst), np.array(mean)):
        if not distance:
            assert table[:, 0].max() < 1e-9  # H vanishes
        for errors in table.T[0 if distance else 1 :]:
            assert rates(errors)[-1] > 1.9, table


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["catenoid", "enneper"])
@pytest.mark.parametrize("distance", [0.0, 80.0])
def test_curvatures_of_tangent_planes_converge_with_rate_two_everywhere(name, kind, distance):
    """Before the solve, border panels included; H of the surface itself is not 0 then."""
    errors = np.array(
        [
            errors_of(made, shell, distance).max(axis=0)
            for made, shell in halved(name, kind, tangent_shell)
        ]
    )
    assert errors[0, 0] > 1e-6
    assert (-np.diff(np.log2(errors), axis=0)[-1] > 1.9).all(), errors


def torus_pair(n):
    """Quads inscribed in a torus along curvature lines, and their Gauss image inscribed in S²."""
    big, small = 3.0, 1.0
    t = np.linspace(-0.5, 1.2, n + 1)
    a = np.linspace(0, 1.5, n + 1)

    def mesh(r, z):
        x, y = np.outer(r, np.cos(a)), np.outer(r, np.sin(a))
        points = np.stack([x, y, np.broadcast_to(z[:, None], x.shape)], axis=2).reshape(-1, 3)
        k, l = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
        c = (k * (n + 1) + l).ravel()
        faces = np.column_stack([c, c + 1, c + n + 2, c + n + 1])
        return PolyMesh.from_faces(points, faces)

    m = mesh(big + small * np.cos(t), small * np.sin(t))
    middle = np.repeat((t[1:] + t[:-1]) / 2, n)
    across = np.cos(middle) / (big + small * np.cos(middle))
    return m, mesh(np.cos(t), np.sin(t)), across


def test_a_torus_of_quads_converges_with_rate_two():
    """Neither minimal nor parallel to it; outward normals, so curvatures are negative."""
    mean, gaussian = [], []
    for n in (8, 16, 32):
        m, s, across = torus_pair(n)
        found = pair_curvatures(m, s)
        mean.append(np.abs(found.mean + (1 + across) / 2).max())
        gaussian.append(np.abs(found.gaussian - across).max())
    assert rates(mean)[-1] > 1.9 and rates(gaussian)[-1] > 1.9


@pytest.mark.parametrize("kind", KINDS)
def test_totals_of_a_catenoid_converge_to_the_integrals(kind):
    """A ring |u| < U, and its parallel surface: ∫K = −4π tanh U; ∫H dA = d·4π tanh U; the area."""
    made = surface("catenoid").scaled(1000.0)
    rows, count, d = 4, 16, 250.0
    errors = []
    for k in range(3):
        n, m = rows * 2**k, count * 2**k
        step = 2 * np.pi / m
        rise = step * EQUILATERAL
        reach = (n + 1) / 2 * rise + 1e-9  # n rows of panels and a border row on either side
        on = lattice((-reach, reach, 0, 2 * np.pi), step, rows_along="v", period=2j * np.pi)
        shell = minimal_shell(made, on, kind)
        assert len(shell.panels) == n * m
        edge = n * rise / 2
        found = shell_curvatures(shell.with_heights(shell.heights + d * shell.gauss_heights))
        smooth_k = -4 * np.pi * np.tanh(edge)
        area = 2 * np.pi * 1e6 * (edge + np.sinh(2 * edge) / 2)
        assert edge == pytest.approx(rows * np.sqrt(3) * np.pi / count / 2, rel=1e-12)
        errors.append(
            [
                abs(found.total_gaussian / smooth_k - 1),
                abs(found.total_mean / (-d * smooth_k) - 1),
                abs(found.total_area / (area + d * d * smooth_k) - 1),
            ]
        )
    errors = np.array(errors)
    assert (errors[-1] < 1e-2).all()
    assert (-np.diff(np.log2(errors), axis=0)[-1] > 1.9).all(), errors


def test_the_fields_of_a_shell():
    fields = face_fields(SHELL)
    z = SHELL.parameters[SHELL.panels]
    for values, unit in fields.values():
        assert values.shape == (len(SHELL.panels),) and unit and np.isfinite(values).all()
    assert fields["Gaussian curvature"][1] == "1/m²"
    assert fields["Gaussian curvature"][0] == pytest.approx(
        SMOOTH.gaussian_curvature(z) * 1e6, rel=0.05
    )
    kappa = SMOOTH.principal_curvatures(z) * 1e3
    assert fields["First principal curvature"][0] == pytest.approx(kappa.max(axis=1), rel=0.05)
    assert (fields["|H|/√|K|"][0] == minimality(SHELL)).all()
    assert (fields["Largest edge curvature"][0] > 0).all()
    empty = SHELL.mesh.vertices[:0]
    none = PolyMesh(empty, np.zeros(0, np.int64), np.zeros(1, np.int64))
    assert pair_mixed_areas(none, none).shape == (0,)

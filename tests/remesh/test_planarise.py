"""The nearest planar mesh: planar by singular values, least in motion, guarded, held, honest."""

from dataclasses import replace

import numpy as np
import pytest

from phexfab.errors import MeshError, SolveError
from phexfab.mesh.half_edges import border_loops
from phexfab.mesh.measures import edge_lengths, face_normals, mean_edge, planarity, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import tangent_shell
from phexfab.remesh.lattice import lattice
from phexfab.remesh.planarity.hold import BorderCurve
from phexfab.remesh.planarity.nearest import MeshReference
from phexfab.remesh.planarity.planarise import planarise
from phexfab.remesh.planarity.rows import PlanarRows
from phexfab.surface import surface
from phexfab.surface.freeform.surface import implicit, parametric
from phexfab.triangular import EQUILATERAL


def off_planes(mesh):
    """The least singular value of every face's corners about their mean: 0 for planar ones."""
    return np.array(
        [np.linalg.svd(p - p.mean(axis=0))[1][2] for p in map(mesh.polygon, range(mesh.n_faces))]
    )


def noisy(mesh, share, seed=0):
    noise = np.random.default_rng(seed).normal(size=mesh.vertices.shape)
    return replace(mesh, vertices=mesh.vertices + share * mean_edge(mesh) * noise)


def hourglass(name="enneper", faces=200):
    smooth = surface(name).scaled(1000.0)
    u0, u1, v0, v1 = smooth.rectangle
    step = np.sqrt((u1 - u0) * (v1 - v0) / faces / EQUILATERAL)
    return tangent_shell(smooth, lattice(smooth.rectangle, step)).mesh


def quads(n=8, height=lambda x, y: 0.3 * x * x - 0.2 * y * y):
    """A grid of n × n quads over the unit square, 1000 mm wide."""
    x, y = np.meshgrid(np.linspace(-1, 1, n + 1), np.linspace(-1, 1, n + 1))
    points = 500.0 * np.column_stack([x.ravel(), y.ravel(), height(x, y).ravel()])
    index = np.arange((n + 1) ** 2).reshape(n + 1, n + 1)
    faces = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], -1)
    return PolyMesh.from_faces(points, faces.reshape(-1, 4))


def mixed():
    """Triangles, quads and hexagons: a quad grid, some faces split, some joined."""
    grid = quads(6)
    faces = [face.tolist() for face in grid.faces]
    out = []
    for k in range(0, 36, 2):
        a, b, c, d = faces[k]
        e, f = faces[k + 1][1], faces[k + 1][2]
        out += [
            [[a, b, c], [a, c, d], [b, e, f, c]],
            [[a, b, e, f, c, d]],
            [[a, b, c, d], [b, e, f, c]],
        ][k // 2 % 3]
    return PolyMesh.from_faces(grid.vertices, out)


@pytest.mark.parametrize("name", ["enneper", "catenoid"])
@pytest.mark.parametrize("share", [0.005, 0.02])
def test_noisy_hourglasses_become_planar_by_less_than_the_noise(name, share):
    exact = hourglass(name)
    mesh = noisy(exact, share)
    found = planarise(mesh)
    assert off_planes(found.mesh).max() < 1e-12 * mean_edge(mesh)
    assert simple_faces(found.mesh).all()
    assert (edge_lengths(found.mesh) >= 0.9 * edge_lengths(mesh)).all()
    # The exact mesh is one way out, so the nearest mesh is nearer; both squares are summed.
    assert (found.moved**2).sum() < ((exact.vertices - mesh.vertices) ** 2).sum()
    assert np.allclose(found.moved, np.linalg.norm(found.mesh.vertices - mesh.vertices, axis=1))
    assert np.array_equal(found.planarity, planarity(found.mesh) / mean_edge(mesh))
    assert found.mesh.corners is mesh.corners and found.report.converged


def test_the_motion_is_the_least_to_one_per_cent():
    mesh = noisy(hourglass(faces=60), 0.01)
    found = planarise(mesh, keep_border=False)
    # Independent: penalties 1, 10, … on planarity, dense Gauss–Newton, until motion settles.
    x, size = mesh.vertices / mean_edge(mesh), mean_edge(mesh)
    start = x.copy()
    for weight in 10.0 ** np.arange(1, 7):
        for _ in range(3):
            rows, right = [np.eye(x.size)], [(start - x).ravel()]
            for f in range(mesh.n_faces):
                corners = mesh.face(f)
                points = x[corners] - x[corners].mean(axis=0)
                left, _, axes = np.linalg.svd(points)
                # To first order the least singular value changes by u·δ·n; the other directions
                # in which heights may grow are those that u leaves free.
                basis = np.linalg.qr(
                    np.column_stack([np.ones(len(points)), left[:, :2]]), "complete"
                )
                free = basis[0][:, 3:]
                row = np.zeros((free.shape[1], len(x), 3))
                row[:, corners] = free.T[:, :, None] * axes[2]
                rows.append(weight * row.reshape(free.shape[1], -1))
                right.append(-weight * free.T @ (points @ axes[2]))
            step = np.linalg.lstsq(np.vstack(rows), np.concatenate(right), rcond=None)[0]
            x = x + step.reshape(-1, 3)
    least = np.linalg.norm(x - start) * size
    assert np.linalg.norm(found.moved) == pytest.approx(least, rel=0.01)


def test_faces_of_any_number_of_sides():
    mesh = noisy(mixed(), 0.02)
    assert set(mesh.sides.tolist()) == {3, 4, 6}
    found = planarise(mesh, keep_border=False)
    assert off_planes(found.mesh).max() < 1e-12 * mean_edge(mesh)
    assert found.report.planarity_before > 1e-3


@pytest.mark.parametrize("mesh", [hourglass(faces=60), mixed()], ids=["hexagons", "mixed"])
def test_rows_are_the_change_of_heights(mesh):
    # At a planar mesh the residual is linear in small motions, and its size is that of heights.
    mesh = planarise(mesh, keep_border=False).mesh
    rows = PlanarRows(mesh)
    at, jacobian, residual = rows.linearise(mesh.vertices)
    assert np.abs(residual).max() < 1e-12 * mean_edge(mesh)
    assert abs(jacobian @ jacobian.T).diagonal() == pytest.approx(np.ones(len(rows)), abs=1e-12)
    for k, columns in enumerate(at.bases):
        flat = np.einsum("nkf,nlf->fkl", columns, columns)
        assert np.abs(flat - np.eye(flat.shape[1])).max() < 1e-13, k
    move = np.random.default_rng(6).normal(size=mesh.vertices.shape)
    step = 1e-6 * mean_edge(mesh)
    heights = rows.heights(mesh.vertices + step * move)
    change = rows.residual(at, heights) / step
    assert np.abs(jacobian @ move.ravel() - change).max() < 1e-4
    assert np.linalg.norm(change) == pytest.approx(rows.size(heights) / step, rel=1e-4)


def test_what_is_planar_does_not_move():
    mesh = hourglass()
    found = planarise(mesh)
    assert found.steps == 0 and not found.moved.any()
    assert np.array_equal(found.mesh.vertices, mesh.vertices)
    triangles = PolyMesh.from_faces(
        np.random.default_rng(0).normal(size=(9, 3)), [[0, 1, 2], [3, 4, 5]]
    )
    assert not planarise(triangles).moved.any()


def test_a_flat_mesh_with_noise_has_equations_that_depend_on_each_other():
    flat = quads(6, lambda x, y: 0 * x)
    found = planarise(noisy(flat, 0.01), keep_border=False)
    assert off_planes(found.mesh).max() < 1e-12 * mean_edge(flat)


def test_moving_and_scaling_the_mesh_moves_and_scales_the_result():
    mesh = noisy(hourglass(faces=80), 0.01)
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    other = replace(mesh, vertices=0.01 * mesh.vertices @ turn + [50.0, -20.0, 30.0])
    one, two = planarise(mesh), planarise(other)
    expected = 0.01 * one.mesh.vertices @ turn + [50.0, -20.0, 30.0]
    assert np.abs(two.mesh.vertices - expected).max() < 1e-9 * mean_edge(mesh)


@pytest.mark.parametrize("as_mask", [True, False])
def test_fixed_vertices_stay_to_the_last_bit(as_mask):
    mesh = noisy(hourglass(), 0.01)
    keep = np.random.default_rng(1).choice(len(mesh.vertices), 40, replace=False)
    # No face with more than three fixed corners: those four may be off a plane.
    for f in range(mesh.n_faces):
        keep = np.setdiff1d(keep, np.intersect1d(keep, mesh.face(f))[2:])
    assert len(keep) > 20
    fixed = np.isin(np.arange(len(mesh.vertices)), keep) if as_mask else keep
    found = planarise(mesh, fixed=fixed)
    assert np.array_equal(found.mesh.vertices[keep], mesh.vertices[keep])
    assert (found.moved[np.setdiff1d(np.arange(len(mesh.vertices)), keep)] > 0).any()
    assert off_planes(found.mesh).max() < 1e-12 * mean_edge(mesh)


def round_border():
    """Quads on a bowl with a round border: rings about a middle polygon."""
    n, rings = 24, 5
    angle = 2 * np.pi * np.arange(n) / n
    r = np.linspace(0.3, 1.0, rings)[:, None]
    x, y = r * np.cos(angle), r * np.sin(angle)
    points = 1000.0 * np.stack([x, y, 0.4 * r**2 + 0.05 * r**3 * np.sin(2 * angle)], -1)
    index = np.arange(n * rings).reshape(rings, n)
    after = np.roll(index, -1, axis=1)
    faces = np.stack([index[:-1], index[1:], after[1:], after[:-1]], -1).reshape(-1, 4)
    return PolyMesh.from_faces(points.reshape(-1, 3), faces)


def test_the_border_glides_on_its_curve():
    mesh = round_border()
    free, held = planarise(mesh, keep_border=False), planarise(mesh)
    curve = BorderCurve(mesh)
    assert len(curve.vertices) == 48 and not len(curve.corners)
    size = mean_edge(mesh)
    assert curve.departure(free.mesh.vertices, mesh.vertices) > 1e-3 * size
    away = curve.departure(held.mesh.vertices, mesh.vertices)
    assert away < 0.02 * curve.departure(free.mesh.vertices, mesh.vertices)
    assert held.report.off_border == away
    assert off_planes(held.mesh).max() < 1e-12 * size


def test_corners_of_the_border_stay_and_ragged_borders_are_free():
    mesh = quads()
    curve = BorderCurve(mesh)
    assert sorted(curve.corners.tolist()) == [0, 8, 72, 80]
    assert len(curve.vertices) == 32
    assert not len(BorderCurve(hourglass()).corners)


def test_a_fixed_border_stays_to_the_last_bit():
    mesh = noisy(round_border(), 0.001)
    border = np.concatenate(border_loops(mesh))
    found = planarise(mesh, keep_border="fixed")
    assert np.array_equal(found.mesh.vertices[border], mesh.vertices[border])
    assert off_planes(found.mesh).max() < 1e-12 * mean_edge(mesh)


def test_a_reference_is_kept_close_to():
    mesh = noisy(quads(10), 0.03)
    smooth = quads(80)
    # A quarter larger, so that no vertex is beyond its border.
    smooth = replace(smooth, vertices=smooth.vertices * [1.25, 1.25, 1.25**2])
    triangles = smooth.corners.reshape(-1, 4)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    reference = PolyMesh.from_faces(smooth.vertices, triangles)

    def away(found):
        return np.linalg.norm(
            found.mesh.vertices - MeshReference(reference).nearest(found.mesh.vertices)[0], axis=1
        )

    alone = planarise(mesh, keep_border=False)
    close = planarise(mesh, keep_border=False, reference=reference)
    # The exact grid lies on the reference, so that both can be had.
    assert np.sqrt((away(close) ** 2).mean()) < 0.2 * np.sqrt((away(alone) ** 2).mean())
    assert close.report.off_reference == pytest.approx(away(close).max())
    assert off_planes(close.mesh).max() < 1e-12 * mean_edge(mesh)


def test_a_smooth_surface_as_reference():
    smooth = surface("enneper").scaled(1000.0)
    mesh = noisy(hourglass(faces=120), 0.02)
    alone, close = planarise(mesh), planarise(mesh, reference=smooth)
    assert off_planes(close.mesh).max() < 1e-12 * mean_edge(mesh)
    assert close.report.off_reference < 0.05 * mean_edge(mesh)
    assert close.report.motion_rms > alone.report.motion_rms


@pytest.mark.parametrize("kind", ["parametric", "implicit"])
def test_a_freeform_surface_as_reference(kind):
    # A sphere of 2 m about the origin: the distance from it is known without the surface.
    radius = 2000.0
    if kind == "parametric":
        dome = parametric(
            lambda x, y: (x, y, np.sqrt(radius**2 - x * x - y * y)), (-900, 900, -900, 900)
        )
    else:
        dome = implicit(
            lambda p: (p * p).sum(axis=-1) - radius**2,
            lambda p: 2 * p,
            lambda p: np.broadcast_to(2 * np.eye(3), (*p.shape[:-1], 3, 3)),
            ([-2100.0] * 3, [2100.0] * 3),
        )

    def away(found):
        return np.abs(np.linalg.norm(found.mesh.vertices, axis=1) - radius)

    mesh = quads(10, lambda x, y: np.sqrt(16 - x * x - y * y))  # of 500 mm, as its grid
    mesh = noisy(mesh, 0.03)
    alone = planarise(mesh, keep_border=False)
    close = planarise(mesh, keep_border=False, reference=dome)
    assert np.sqrt((away(close) ** 2).mean()) < 0.2 * np.sqrt((away(alone) ** 2).mean())
    assert close.report.off_reference == pytest.approx(away(close).max(), rel=1e-6)
    assert off_planes(close.mesh).max() < 1e-12 * mean_edge(mesh)


def test_nearest_points_of_a_mesh_are_no_farther_than_any_sample():
    rng = np.random.default_rng(3)
    mesh = PolyMesh.from_faces(rng.normal(size=(30, 3)), rng.permutation(30).reshape(10, 3))
    points = rng.normal(size=(50, 3)) * 2
    feet, normals = MeshReference(mesh).nearest(points)
    weights = rng.dirichlet([0.5, 0.5, 0.5], 4000)
    samples = (weights @ mesh.vertices[mesh.corners.reshape(-1, 3)]).reshape(-1, 3)
    gap = np.linalg.norm(feet - points, axis=1)
    nearest = np.linalg.norm(points[:, None] - samples, axis=2).min(axis=1)
    assert (gap <= nearest + 1e-12).all() and (nearest < gap + 0.1).all()
    own = face_normals(mesh)
    assert (np.abs(normals @ own.T).max(axis=1) > 1 - 1e-12).all()


def strained():
    """Bricks on a saddle, off planes only by curvature: edges shrink when nothing guards them."""
    n = 10
    x, y = np.meshgrid(np.linspace(-1, 1, 2 * n + 2), np.linspace(-1, 1, n + 1))
    points = 500.0 * np.column_stack([x.ravel(), y.ravel(), (0.5 * x * x - 0.5 * y * y).ravel()])
    index = np.arange(x.size).reshape(x.shape)
    faces = [
        [*index[j, a : a + 3], *index[j + 1, a : a + 3][::-1]]
        for j in range(n)
        for a in range(j % 2, 2 * n, 2)
    ]
    used, corners = np.unique(faces, return_inverse=True)
    return noisy(PolyMesh.from_faces(points[used], corners.reshape(-1, 6)), 0.04)


def test_edges_are_guarded():
    mesh = strained()
    before = edge_lengths(mesh)
    loose = planarise(mesh, shortest=0.0, strict=False)
    tight = planarise(mesh, shortest=0.9, strict=False)
    assert loose.report.edge_share < 0.85
    assert (edge_lengths(tight.mesh) / before).min() >= 0.9
    assert tight.report.short_edges == 0
    assert off_planes(tight.mesh).max() < 1e-12 * mean_edge(mesh)


def test_four_fixed_corners_off_a_plane_are_refused_by_name():
    mesh = noisy(quads(3), 0.02)
    with pytest.raises(MeshError, match=r"face 4 near \[.*has 4 fixed corners .* free one of"):
        planarise(mesh, fixed=mesh.face(4))


def test_a_vertex_returns_to_where_the_fixed_planes_meet():
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], float)
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    corners[3] += [0.1, 0.2, -0.1]
    found = planarise(PolyMesh.from_faces(corners, faces), fixed=[0, 1, 2, 4, 5, 6, 7])
    assert np.abs(found.mesh.vertices[3] - [0, 1, 1]).max() < 1e-12


def test_what_cannot_be_planar_is_named():
    # One vertex of two quads whose other corners are fixed in parallel planes.
    points = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 0.4]]
    mesh = PolyMesh.from_faces(points, [[0, 1, 2, 6], [3, 4, 5, 6]])
    fixed = [0, 1, 2, 3, 4, 5]
    with pytest.raises(SolveError, match=r"face [01] at \[.*\] stays .* mm off a plane"):
        planarise(mesh, fixed=fixed)
    found = planarise(mesh, fixed=fixed, strict=False)
    assert not found.report.converged and found.report.planarity_after > 1e-3
    assert np.array_equal(found.mesh.vertices[:6], mesh.vertices[:6])


def test_faces_that_would_cross_themselves_are_named():
    # The fourth corner is free to leave its place only for the line of two fixed planes.
    points = [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 1.0], [0, 4, 4], [-1, 4, 4], [1, -1, 1]]
    points += [[0.9, -1.0, 1.5], [1.1, -1.0, 1.5]]
    mesh = PolyMesh.from_faces(points, [[0, 1, 2, 3], [6, 7, 8, 3]])
    fixed = [0, 1, 2, 6, 7, 8]
    report = planarise(mesh, fixed=fixed, shortest=0.0, strict=False).report
    assert report.converged and report.crossing == (0,)
    with pytest.raises(SolveError, match="1 faces cross themselves once planar, first face 0"):
        planarise(mesh, fixed=fixed, shortest=0.0)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"shortest": 1.0}, "shortest = 1"),
        ({"shortest": -0.1}, "shortest = -0.1"),
        ({"closeness": -1.0}, "closeness = -1"),
        ({"tolerance": 0.0}, "tolerance = 0"),
        ({"keep_border": "loose"}, "keep_border = 'loose'"),
        ({"fixed": [81]}, "fixed names vertex 81, but vertices run from 0 to 80"),
        ({"fixed": [0.5]}, "fixed is float64"),
        ({"fixed": np.ones(3, bool)}, r"fixed has shape \(3,\)"),
        ({"reference": 3}, "reference = int"),
    ],
)
def test_wrong_options_are_named(options, said):
    with pytest.raises(MeshError, match=said):
        planarise(quads(), **options)


def test_no_faces_and_no_numbers_are_refused():
    with pytest.raises(MeshError, match="no face to planarise"):
        planarise(PolyMesh.from_faces(np.eye(3), []))
    broken = quads(2)
    broken.vertices[4] = np.nan
    with pytest.raises(MeshError, match="vertex 4 is"):
        planarise(broken)


@pytest.mark.long
@pytest.mark.parametrize("seed", range(20))
def test_random_meshes_with_noise(seed):
    rng = np.random.default_rng(seed)
    mesh = noisy(
        [hourglass("enneper", 300), hourglass("catenoid", 300), quads(14), mixed()][seed % 4],
        rng.uniform(0.001, 0.03),
        seed,
    )
    found = planarise(mesh, keep_border=False)
    assert off_planes(found.mesh).max() < 1e-12 * mean_edge(mesh)
    assert found.report.edge_share >= 0.9

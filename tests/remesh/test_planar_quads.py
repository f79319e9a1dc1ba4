"""Planar, circular and conical quads: the equations, subdivision, and exact meshes."""

import numpy as np
import pytest
from dupin_samples import bumpy_roof, graph, hypar, monkey_saddle, sphere_cap, torus

from phexfab.errors import MeshError, SolveError
from phexfab.mesh.measures import corner_angles, edges, relative_planarity, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.conjugate.fields import level_family, principal_family
from phexfab.remesh.coverage import coverage
from phexfab.remesh.quads.planar_quads import exact_quads, principal_quads, refined_quads
from phexfab.remesh.quads.rows import QuadRows, stars_of
from phexfab.remesh.quads.subdivide import subdivided


def grid(n, m, height):
    y, x = np.meshgrid(np.arange(m, dtype=float), np.arange(n, dtype=float))
    points = np.stack([x, y, height(x, y)], -1).reshape(-1, 3)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n - 1), np.arange(m - 1), indexing="ij"))
    at = i * m + j
    return PolyMesh.from_faces(points, np.stack([at, at + m, at + m + 1, at + 1], axis=1))


def dome():
    def height(x, y):
        return 3e3 * np.sqrt(1 - (x / 6e3) ** 2 - (y / 4e3) ** 2)

    return graph(height, 3800.0, 2400.0, "dome")


def circle_gap(quads):
    """Return the distance of fourth corners from the circle through the others, over the radius."""
    a, b, c, d = (quads[:, k] for k in range(4))
    u, v = b - a, c - a
    w = np.cross(u, v)
    square = (w**2).sum(1, keepdims=True)
    to = ((u**2).sum(1, keepdims=True) * np.cross(v, w)) + (
        (v**2).sum(1, keepdims=True) * np.cross(w, u)
    )
    centre = a + to / (2 * square)
    radius = np.linalg.norm(a - centre, axis=1)
    return np.abs(np.linalg.norm(d - centre, axis=1) - radius) / radius


def angle_gap(mesh):
    """Return, at inner vertices, how far sums of opposite angles differ, in degrees."""
    angle = corner_angles(mesh)
    vertices, faces = stars_of(mesh)
    sums = np.zeros(len(vertices))
    for k in range(4):
        corner = 4 * faces[:, k] + np.argmax(
            mesh.corners.reshape(-1, 4)[faces[:, k]] == vertices[:, None], axis=1
        )
        assert np.array_equal(mesh.corners[corner], vertices)
        sums += (-1) ** k * angle[corner]
    return np.abs(sums)


@pytest.mark.parametrize("kind", ["planar", "circular", "conical"])
def test_jacobians_are_the_derivatives(kind):
    rng = np.random.default_rng(2)
    mesh = grid(4, 5, lambda x, y: 0.2 * np.sin(x + 0.4 * y * y))
    rows = QuadRows(mesh, kind)
    parts = [rows._planar, getattr(rows, f"_{kind}")]
    step = rng.normal(size=mesh.vertices.shape)
    for part in parts:
        _, slope, vertices = part(mesh.vertices)
        h = 1e-5
        ahead, behind = (part(mesh.vertices + s * h * step)[0] for s in (1, -1))
        want = (ahead - behind) / (2 * h)
        got = np.einsum("nkj,nkj->n", slope, step[vertices])
        assert np.abs(got - want).max() < 1e-8 * (1 + np.abs(want).max())


def test_faces_run_around_their_vertex():
    mesh = grid(4, 4, lambda x, y: 0 * x)
    vertices, faces = stars_of(mesh)
    assert vertices.tolist() == [5, 6, 9, 10]
    quads = mesh.corners.reshape(-1, 4)
    for v, star in zip(vertices, faces, strict=True):
        assert all(v in quads[f] for f in star)
        for k in range(4):
            shared = np.intersect1d(quads[star[k]], quads[star[(k + 1) % 4]])
            assert len(shared) == 2


def test_subdivision_inserts_knots_of_the_bicubic_spline():
    mesh = grid(5, 6, lambda x, y: np.sin(x) * np.cos(2 * y))
    finer = subdivided(mesh)
    assert finer.n_faces == 4 * mesh.n_faces
    assert len(finer.vertices) == len(mesh.vertices) + len(edges(mesh)) + mesh.n_faces

    def doubled(p):
        out = np.zeros((2 * len(p) - 1, *p.shape[1:]))
        out[1::2] = (p[:-1] + p[1:]) / 2
        out[0], out[-1] = p[0], p[-1]
        out[2:-1:2] = (p[:-2] + 6 * p[1:-1] + p[2:]) / 8
        return out

    want = doubled(doubled(mesh.vertices.reshape(5, 6, 3)).transpose(1, 0, 2)).transpose(1, 0, 2)
    gap = np.linalg.norm(finer.vertices[:, None] - want.reshape(1, -1, 3), axis=2).min(axis=1)
    assert gap.max() < 1e-14


def test_subdivision_keeps_orientation_and_takes_any_polygon():
    hexagon = np.array([[np.cos(t), np.sin(t), 0.0] for t in np.arange(6) * np.pi / 3])
    finer = subdivided(PolyMesh.from_faces(hexagon, [range(6)]))
    assert finer.n_faces == 6
    assert np.allclose(finer.vertices[:6], hexagon)
    assert (corner_angles(finer, np.tile([0, 0, 1.0], (6, 1))) < 180).all()


CASES = {
    "sphere cap": (sphere_cap(), level_family(lambda p: p[:, 0]), 500.0),
    "ellipsoid": (dome(), principal_family(), 500.0),
    "torus": (torus(), principal_family(), 900.0),
    "hyperbolic paraboloid": (hypar(), principal_family(), 400.0),
    "monkey saddle": (monkey_saddle(), principal_family(), 400.0),
}


@pytest.mark.parametrize("kind", ["planar", "circular", "conical"])
@pytest.mark.parametrize("name", CASES)
def test_quads_are_exact(name, kind):
    surface, family, size = CASES[name]
    made = principal_quads(surface, size, kind, family=family, levels=1)
    mesh = made.mesh
    assert mesh.n_faces > 50
    assert made.exactness <= 1e-10
    assert relative_planarity(mesh).max() <= 1e-10
    assert simple_faces(mesh).all()
    quads = mesh.vertices[mesh.corners.reshape(-1, 4)]
    if kind == "circular":
        assert circle_gap(quads).max() < 1e-10
    if kind == "conical":
        assert angle_gap(mesh).max() < 1e-8
    away = mesh.vertices - surface.point(surface.nearest(mesh.vertices))
    assert np.linalg.norm(away, axis=1).max() < 0.3 * size


def test_a_roof_has_planar_and_circular_quads():
    roof = bumpy_roof()
    planar = principal_quads(roof, 600.0, family=level_family(lambda p: p[:, 0]))
    assert planar.planarity < 1e-12
    assert len(planar.levels) == 3
    circular = principal_quads(roof, 600.0, "circular", levels=0)
    quads = circular.mesh.vertices[circular.mesh.corners.reshape(-1, 4)]
    assert circle_gap(quads).max() < 1e-10


@pytest.mark.parametrize("levels", [0, 1])
def test_a_roof_with_umbilics_has_conical_quads_away_from_them(levels):
    roof = bumpy_roof()
    made = principal_quads(roof, 500.0, "conical", levels=levels)
    assert made.mesh.n_faces > 150 and made.exactness < 1e-10
    assert angle_gap(made.mesh).max() < 1e-8
    assert simple_faces(made.mesh).all()
    away = made.mesh.vertices - roof.point(roof.nearest(made.mesh.vertices))
    assert np.linalg.norm(away, axis=1).max() < 150.0
    # Nothing is left beside the places where both curvatures are alike.
    kappa = roof.bending(roof.seeds(20000)).kappa
    alike = (kappa[:, 0] - kappa[:, 1]) < 0.05 * np.abs(kappa).sum(axis=1)
    assert alike.any()
    under = coverage(roof, made.mesh, 20000)
    assert not under.covered[alike].any() and under.share > 0.3


def test_levels_quarter_faces_and_approach_planar():
    coarse = principal_quads(hypar(), 1200.0, levels=0)
    fine = refined_quads(coarse.mesh, hypar(), levels=2)
    assert fine.mesh.n_faces == 16 * coarse.mesh.n_faces
    assert simple_faces(fine.mesh).all()
    away = fine.mesh.vertices - hypar().point(hypar().nearest(fine.mesh.vertices))
    assert np.linalg.norm(away, axis=1).max() < 30.0


def test_a_planar_mesh_stays():
    flat = grid(4, 4, lambda x, y: 0.5 * x - y)
    made = exact_quads(flat, "planar")
    assert made.moved.max() < 1e-14


def test_other_meshes_are_refused():
    with pytest.raises(MeshError, match="face 0 has 3"):
        exact_quads(PolyMesh.from_faces(np.eye(3), [[0, 1, 2]]))
    with pytest.raises(MeshError, match="kind"):
        exact_quads(grid(3, 3, lambda x, y: x), "flat")
    with pytest.raises(MeshError, match="levels"):
        refined_quads(grid(3, 3, lambda x, y: x), levels=-1)
    ring = np.arange(10) * np.pi / 5
    star = np.column_stack([np.cos(ring), np.sin(ring), 0 * ring])
    points = np.vstack([star, [[0, 0, 0.3]]])
    faces = [[10, 2 * k, 2 * k + 1, (2 * k + 2) % 10] for k in range(5)]
    with pytest.raises(MeshError, match=r"vertex 10 .* 5 faces"):
        exact_quads(PolyMesh.from_faces(points, faces), "conical")


def test_a_crumpled_mesh_is_named():
    rng = np.random.default_rng(1)
    mesh = grid(6, 6, lambda x, y: rng.normal(size=x.shape))
    with pytest.raises(SolveError, match=r"quads .*(worst|first face)"):
        exact_quads(mesh, "circular")

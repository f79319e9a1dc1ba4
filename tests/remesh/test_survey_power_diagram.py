"""Power diagrams on ellipsoids: the picture from the pole is the diagram, the rest is refused."""

import numpy as np
import pytest

from phexfab.errors import LatticeError, MeshError, SurfaceError
from phexfab.mesh.measures import corner_angles, face_normals, relative_planarity, simple_faces
from phexfab.remesh.survey.power_diagram import (
    EllipsoidFrame,
    ellipsoid_of,
    hexagon_sites,
    power_cells,
    power_diagram_mesh,
    power_diagram_on,
    power_planes,
    stereographic,
)
from phexfab.surface.freeform.surface import parametric

AXES = np.array([1500.0, 1000.0, 700.0])


def ellipsoid(half=0.55, turn=None, centre=(0.0, 0.0, 0.0), side=1):
    matrix = np.eye(3) if turn is None else turn

    def place(x, y):
        local = np.stack([x, y, np.sqrt(1 - x * x - y * y)], -1) * AXES
        return local @ matrix.T + np.asarray(centre)

    return parametric(place, (-half, half, -half, half), name="ellipsoid", flipped=side < 0)


def random_turn(seed):
    q = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))[0]
    return q * np.sign(np.linalg.det(q))


def powers(x, sites, weights):
    return np.abs(x[:, None] - sites) ** 2 - weights


@pytest.mark.parametrize("weighted", [False, True])
def test_three_cells_meet_where_their_powers_are_equal_and_least(weighted):
    rng = np.random.default_rng(2)
    sites = hexagon_sites(1.0, 0.15)[0]
    sites = sites + 0.03 * (rng.normal(size=len(sites)) + 1j * rng.normal(size=len(sites)))
    weights = 0.003 * rng.normal(size=len(sites)) if weighted else np.zeros(len(sites))
    triangles = power_cells(sites, weights)
    a, b, c = sites[triangles].T
    assert (((b - a).conj() * (c - a)).imag > 0).all()
    # The power centre, from the two equations written out.
    d, e = b - a, c - a
    p = np.abs(sites) ** 2 - weights
    rows = 2 * np.stack([np.stack([d.real, d.imag], -1), np.stack([e.real, e.imag], -1)], 1)
    right = np.stack(
        [p[triangles[:, 1]] - p[triangles[:, 0]], p[triangles[:, 2]] - p[triangles[:, 0]]], -1
    )
    x = np.linalg.solve(rows, right[..., None])[..., 0] @ [1, 1j]
    value = powers(x, sites, weights)
    own = np.take_along_axis(value, triangles, axis=1)
    scale = np.abs(x) ** 2 + 10
    assert (np.ptp(own, axis=1) / scale).max() < 1e-9
    assert ((own.min(axis=1) - value.min(axis=1)) / scale).max() < 1e-9
    # The circle's planes meet on the ray from the pole through the power centre.
    normals, heights = power_planes(sites, weights)
    vertex = np.linalg.solve(normals[triangles], heights[triangles][..., None])[..., 0]
    near = np.abs(x) < 10
    assert np.abs(stereographic_of_point(vertex) - x)[near].max() < 1e-6


def stereographic_of_point(points):
    """Central projection from (0, 0, 1) to the plane of the equator, of any points."""
    return (points[:, 0] + 1j * points[:, 1]) / (1 - points[:, 2])


def test_planes_carry_the_lifted_circles():
    rng = np.random.default_rng(3)
    sites, radii = rng.normal(size=20) + 1j * rng.normal(size=20), rng.uniform(0.1, 0.5, 20)
    normals, heights = power_planes(sites, radii**2)
    on = sites[:, None] + radii[:, None] * np.exp(1j * np.linspace(0, 6, 7))
    power = np.abs(on) ** 2
    sphere = np.stack([2 * on.real, 2 * on.imag, power - 1], -1) / (power + 1)[..., None]
    assert np.abs(stereographic(sphere) - on).max() < 1e-12
    assert np.abs(np.einsum("fkj,fj->fk", sphere, normals) - heights[:, None]).max() < 1e-14
    assert np.abs(power_planes(sites)[1] - 1).max() < 1e-15  # weight 0: tangent


@pytest.mark.parametrize("weight", [0.0, 0.004, -0.01])
def test_lattice_sites_give_convex_planar_hexagons(weight):
    sites, panels = hexagon_sites(0.8, 0.09)
    frame = EllipsoidFrame.of(*AXES)
    shell = power_diagram_mesh(frame, sites, np.full(len(sites), weight), panels=panels)
    mesh = shell.mesh
    assert mesh.n_faces == panels.sum()
    assert (mesh.sides == 6).all()
    assert relative_planarity(mesh).max() < 1e-12
    assert simple_faces(mesh).all()
    assert corner_angles(mesh).max() < 180
    # Outward, and every vertex behind every plane: a convex surface.
    assert np.abs(face_normals(mesh) - shell.normals[shell.panels]).max() < 1e-9
    used = shell.normals[shell.panels] @ mesh.vertices.T
    assert (used - shell.heights[shell.panels][:, None]).max() < 1e-9
    # Seen from the pole: corners are power centres of the three sites.
    on_sphere = frame.on_sphere(mesh.vertices)
    x = stereographic_of_point(on_sphere)
    value = powers(x, sites, weight)
    least = np.sort(value, axis=1)
    assert (least[:, 2] - least[:, 0]).max() < 1e-11
    assert (least[:, 3] - least[:, 2]).min() > 1e-3


def test_weight_nought_touches_the_ellipsoid():
    sites, panels = hexagon_sites(0.7, 0.1)
    shell = power_diagram_mesh(EllipsoidFrame.of(*AXES), sites, panels=panels)
    exact = np.linalg.norm(shell.normals * AXES, axis=1)
    assert np.abs(shell.heights - exact).max() < 1e-9
    assert np.abs(np.sum((shell.points / AXES) ** 2, axis=1) - 1).max() < 1e-13


@pytest.mark.parametrize("side", [1, -1])
def test_a_part_of_an_ellipsoid_is_recognised_and_covered(side):
    turn, centre = random_turn(5), np.array([300.0, -200.0, 5000.0])
    surface = ellipsoid(turn=turn, centre=centre, side=side)
    frame = ellipsoid_of(surface)
    assert np.abs(frame.centre - centre).max() < 1e-4
    form = np.linalg.inv(frame.axes @ frame.axes.T)
    assert np.abs(form - turn @ np.diag(AXES**-2.0) @ turn.T).max() < 1e-6 * 700.0**-2
    shell = power_diagram_on(surface, 110.0)
    mesh = shell.mesh
    assert mesh.n_faces > 120
    assert (mesh.sides == 6).all()
    assert relative_planarity(mesh).max() < 1e-12
    assert simple_faces(mesh).all()
    outward = np.einsum("ij,ij->i", shell.points - centre, shell.normals)
    assert outward.min() > 0
    assert np.abs(outward - np.linalg.norm(shell.normals @ turn * AXES, axis=1)).max() < 1e-3
    # Points of contact lie on the part, up to half a sample.
    u = surface.nearest(shell.points)
    assert np.linalg.norm(surface.point(u) - shell.points, axis=1).max() < 1.0
    # Panels as large as asked for.
    areas = np.linalg.norm(
        shell.mesh.vertices[shell.mesh.corners[::6]] - mesh.vertices[mesh.corners[3::6]], axis=1
    )
    assert 0.7 * 110 < np.median(areas) * np.sqrt(3) / 2 < 1.4 * 110


@pytest.mark.parametrize(
    ("surface", "what"),
    [
        (
            parametric(
                lambda u, v: (
                    (1000 + 300 * np.cos(v)) * np.cos(u),
                    (1000 + 300 * np.cos(v)) * np.sin(u),
                    300 * np.sin(v),
                ),
                (0, 1, -1, 1),
                name="torus",
            ),
            "is no quadric",
        ),
        (
            parametric(
                lambda x, y: (
                    1000 * np.cosh(y) * np.cos(x),
                    1000 * np.cosh(y) * np.sin(x),
                    800 * np.sinh(y),
                ),
                (0, 1, -1, 1),
                name="hyperboloid",
            ),
            "no ellipsoid",
        ),
        (
            parametric(lambda x, y: (x, y, x * y / 1000), (-800, 800, -800, 800), name="saddle"),
            "no ellipsoid",
        ),
        (
            parametric(
                lambda x, y: (x, y, (x**3 - 3 * x * y * y) / 1e6),
                (-500, 500, -500, 500),
                name="monkey",
            ),
            "no quadric",
        ),
    ],
    ids=["torus", "hyperboloid", "hyperbolic paraboloid", "monkey saddle"],
)
def test_other_surfaces_are_refused(surface, what):
    with pytest.raises(SurfaceError, match=what) as raised:
        power_diagram_on(surface, 80.0)
    assert surface.name in str(raised.value)


def test_cells_that_are_no_hexagons_are_named():
    rng = np.random.default_rng(7)
    sites = rng.uniform(-1, 1, 80) + 1j * rng.uniform(-1, 1, 80)
    frame = EllipsoidFrame.of(*AXES)
    with pytest.raises(MeshError, match="are no hexagons"):
        power_diagram_mesh(frame, sites)
    shell = power_diagram_mesh(frame, sites, hexagons=False)
    assert set(shell.mesh.sides) > {5, 6}
    assert relative_planarity(shell.mesh).max() < 1e-12
    assert simple_faces(shell.mesh).all()
    # A lattice without a mask finds its panels, too; the ragged border is not among them.
    lattice, panels = hexagon_sites(0.8, 0.1)
    found = power_diagram_mesh(frame, lattice, hexagons=False)
    assert panels.sum() <= len(found.panels) < len(lattice)


def test_impossible_sites_are_refused():
    sites, panels = hexagon_sites(0.5, 0.1)
    weights = np.zeros(len(sites))
    weights[10] = -1.0
    with pytest.raises(MeshError, match=r"1 of \d+ sites have no power cell, the first is 10 "):
        power_diagram_mesh(EllipsoidFrame.of(*AXES), sites, weights, panels=panels)
    with pytest.raises(MeshError, match="is unbounded"):
        power_diagram_mesh(EllipsoidFrame.of(*AXES), sites, panels=np.ones(len(sites), bool))
    with pytest.raises(MeshError, match="span no area"):
        power_cells(np.arange(5) + 0j)
    with pytest.raises(MeshError, match="at least 4"):
        power_cells([0, 1, 1j])
    with pytest.raises(LatticeError, match="twice the step"):
        hexagon_sites(0.1, 0.09)
    with pytest.raises(SurfaceError, match="must be positive"):
        EllipsoidFrame.of(1.0, 0.0, 1.0)


def test_a_turned_frame_is_the_same_ellipsoid():
    frame = EllipsoidFrame.of(*AXES).turned([1.0, 2.0, 0.5])
    assert np.abs(frame.axes @ frame.axes.T - np.diag(AXES**2)).max() < 1e-6
    south = frame.centre - frame.axes[:, 2]
    assert np.linalg.norm(np.cross(south, [1.0, 2.0, 0.5])) < 1e-9 * np.linalg.norm(south)
    assert south @ [1.0, 2.0, 0.5] > 0


def test_a_belt_is_projected_from_its_hole():
    def point(u, v):
        return 6e3 * np.cos(v) * np.cos(u), 4e3 * np.cos(v) * np.sin(u), 3e3 * np.sin(v)

    box = (0.0, 2 * np.pi, -1.0, 1.0)
    belt = parametric(point, box, periodic=(True, False), name="belt")
    shell = power_diagram_on(belt, 700.0)
    mesh = shell.mesh
    # Faces are about as many as hexagons of that size have room on the belt.
    patch = belt.derivatives(belt.seeds(4000))[0]
    area = np.linalg.norm(np.cross(patch[:, 0], patch[:, 1]), axis=1).mean() * 4 * np.pi
    assert 0.6 < mesh.n_faces * 700.0**2 * np.sqrt(0.75) / area < 1.2
    middle = np.array([mesh.polygon(f).mean(axis=0) for f in range(mesh.n_faces)])
    assert np.abs(middle[:, 2]).max() < 3e3 * np.sin(1.0) + 350.0
    whole = parametric(
        point, (0.0, 2 * np.pi, -1.57, 1.57), periodic=(True, False), name="whole ellipsoid"
    )
    with pytest.raises(SurfaceError, match="leaves no hole"):
        power_diagram_on(whole, 700.0)

"""The associate family of discrete minimal surfaces: what closes, and what is kept."""

import numpy as np
import pytest

from phexfab.errors import MeshError
from phexfab.mesh.measures import relative_planarity
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.associate import associate, associate_pair, conjugate, conjugate_edges
from phexfab.minimal.christoffel import split_dual
from phexfab.minimal.conformal import christoffel_dual, conformal_gauss_image
from phexfab.minimal.shell import lattice_on, minimal_shell, tangent_shell
from phexfab.parallel.curvature import pair_curvatures, pair_mixed_areas
from phexfab.parallel.edge_curvature import edge_vectors
from phexfab.remesh.lattice import lattice
from phexfab.surface.catalog import surface
from phexfab.surface.construct import associate as smooth_associate
from phexfab.triangular import EQUILATERAL

KINDS = ("face", "edge", "vertex")
STEPS = (0.16, 0.08, 0.04, 0.02)
SMOOTH = surface("scherk-1").scaled(1000.0)


def shell_of(kind, step=0.12, make=minimal_shell, made=SMOOTH):
    """On a rectangle that is the same for all of STEPS."""
    half = 0.48, 0.64 * EQUILATERAL
    return make(made, lattice((-half[0], half[0], -half[1], half[1]), step), kind)


def feet(shell):
    """(C, 3) feet of the perpendiculars from the origin to the edges' lines of S."""
    s, along = shell.gauss.vertices[shell.gauss.corners], edge_vectors(shell.gauss)
    ratio = np.einsum("ij,ij->i", s, along) / np.einsum("ij,ij->i", along, along)
    return s - ratio[:, None] * along


@pytest.mark.parametrize("kind", KINDS)
def test_the_conjugate_closes_exactly_where_h_vanishes(kind):
    """Σ s × Δm = 2 area(M_f, S_f) n_f around every face, minimal or not, for every type."""
    for make in (tangent_shell, minimal_shell):
        shell = shell_of(kind, make=make)
        mesh = shell.mesh
        opening = np.add.reduceat(conjugate_edges(mesh, shell.gauss), mesh.starts[:-1])
        normals = shell.normals[shell.panels]
        area = pair_mixed_areas(mesh, shell.gauss, normals)
        size = np.linalg.norm(edge_vectors(mesh), axis=1).mean()
        assert np.abs(opening - 2 * area[:, None] * normals).max() < 1e-12 * size
    with pytest.raises(MeshError, match="not discrete minimal"):
        conjugate(shell_of(kind, make=tangent_shell).mesh, shell.gauss)


@pytest.mark.parametrize("angle", [20.0, 90.0, 211.0])
def test_the_koebe_family_is_isometric(angle):
    """Bobenko, Hoffmann, Springborn: edges turn by θ about the normals in which they touch."""
    shell = shell_of("edge")
    before, after = edge_vectors(shell.mesh), edge_vectors(associate(shell, angle))
    lengths = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    assert np.abs(lengths[1] / lengths[0] - 1).max() < 1e-11
    normal = feet(shell)
    assert np.abs(np.linalg.norm(normal, axis=1) - 1).max() < 1e-12
    t = np.radians(angle)
    turned = np.cos(t) * before + np.sin(t) * np.cross(normal, before)
    assert np.abs(after - turned).max() < 1e-11 * lengths[0].mean()


@pytest.mark.parametrize("kind", ["face", "vertex"])
def test_other_types_change_lengths_by_second_order_as_told(kind):
    angle, worst = np.radians(37.0), []
    for step in STEPS:
        shell = shell_of(kind, step)
        ratio = np.linalg.norm(edge_vectors(associate(shell, 37.0)), axis=1) / np.linalg.norm(
            edge_vectors(shell.mesh), axis=1
        )
        far = np.linalg.norm(feet(shell), axis=1)
        told = np.sqrt(np.cos(angle) ** 2 + far**2 * np.sin(angle) ** 2)
        assert np.abs(ratio - told).max() < 1e-10
        worst.append(np.abs(ratio - 1).max())
    assert -np.diff(np.log2(worst))[-1] > 1.9
    assert worst[-1] > 1e-6  # and no identity


@pytest.mark.parametrize("kind", KINDS)
def test_edges_stay_perpendicular_to_their_normals(kind):
    shell = shell_of(kind)
    edge = edge_vectors(associate(shell, 63.0))
    normal = feet(shell)
    cosine = np.einsum("ij,ij->i", edge, normal) / np.linalg.norm(edge, axis=1)
    assert np.abs(cosine).max() < 1e-12


@pytest.mark.parametrize("kind", KINDS)
def test_the_conjugate_has_planar_stars_and_no_planar_faces(kind):
    shell = shell_of(kind)
    other = conjugate(shell.mesh, shell.gauss)
    edge, s = edge_vectors(other), shell.gauss.vertices
    size = np.linalg.norm(edge, axis=1)
    for end in (other.corners, other.corners[other.next_corner]):
        assert np.abs(np.einsum("ij,ij->i", edge, s[end]) / size).max() < 1e-12
    assert relative_planarity(other).max() > 0.01
    assert relative_planarity(associate(shell, 180.0)).max() < 1e-12


def test_the_vertex_type_stays_minimal_and_the_others_nearly():
    for kind in KINDS:
        worst = []
        for step in STEPS:
            shell = shell_of(kind, step)
            normals = shell.normals[shell.panels]
            turned = associate(shell, 50.0)
            # Area vectors along the old normals: the faces of M_θ are not planar.
            worst.append(pair_curvatures(turned, shell.gauss, normals).minimality.max())
        if kind == "vertex":
            assert max(worst) < 1e-11
        else:
            assert worst[-1] > 1e-9 and -np.diff(np.log2(worst))[-1] > 1.8


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("angle", [40.0, 90.0, -70.0])
def test_it_converges_to_the_smooth_associate_surface(kind, angle):
    """Mean corner of every panel against the point of the smooth surface, rate 2."""
    made = surface("enneper").scaled(1000.0)
    smooth, worst = smooth_associate(made, angle), []
    for step in STEPS:
        shell = shell_of(kind, step, made=made)
        mesh = associate(shell, angle)
        middle = np.add.reduceat(mesh.vertices[mesh.corners], mesh.starts[:-1])
        middle /= mesh.sides[:, None]
        gap = middle - smooth.point(shell.parameters[shell.panels])
        worst.append(np.linalg.norm(gap - gap.mean(axis=0), axis=1).max())
    assert -np.diff(np.log2(worst))[-1] > 1.85, worst
    assert worst[-1] < 2.0  # mm


@pytest.mark.parametrize("angle", [30.0, 90.0])
def test_conformal_hexagons_have_the_discrete_weierstrass_family(angle):
    """Edges Re(e^{iθ} c (1 − gh, i(1 + gh), g + h)/(h − g)), c = 2 or −1, from g to h."""
    shell, twice = conformal_gauss_image(10, 8, tilt=0.1 + 0.07j, size=0.7)
    mesh = PolyMesh(christoffel_dual(shell, twice), shell.gauss.corners, shell.gauss.starts)
    found = associate_pair(mesh, shell.gauss, angle)
    i, j = shell.edges[:, 0], shell.edges[:, 1]
    s = shell.gauss.vertices
    z = (s[:, 0] + 1j * s[:, 1]) / (1 - s[:, 2])
    g, h = z[i], z[j]
    form = np.column_stack([1 - g * h, 1j * (1 + g * h), g + h]) / (h - g)[:, None]
    form = np.where(twice, 2.0, -1.0)[:, None] * form
    turned = np.exp(1j * np.radians(angle)) * form
    edge = found.vertices[j] - found.vertices[i]
    plain = mesh.vertices[j] - mesh.vertices[i]
    scale = np.sum(plain * form.real) / np.sum(form.real**2)
    assert np.abs(plain - scale * form.real).max() < 1e-11 * np.abs(plain).max()
    assert np.abs(edge - scale * turned.real).max() < 1e-10 * np.abs(edge).max()


def test_the_three_cuts_of_hexagons_are_120_degrees_apart():
    """The duals by splitting (thesis §7.2.2) against the family, to second order."""
    worst = []
    for step in STEPS[:3]:
        shell = shell_of("vertex", step, made=surface("enneper").scaled(1000.0))
        duals = [split_dual(shell.gauss, cut) for cut in range(3)]
        assert max(one.residual for one in duals) < 1e-10
        gaps = np.full((3, 3), np.inf)
        for row, one in enumerate(duals):
            x = one.mesh.vertices - one.mesh.vertices.mean(axis=0)
            x = np.add.reduceat(x[one.mesh.corners], one.mesh.starts[:-1])
            for column, angle in enumerate((0.0, 120.0, 240.0)):
                other = associate(shell, angle).vertices
                y = np.add.reduceat(
                    (other - other.mean(axis=0))[one.mesh.corners], one.mesh.starts[:-1]
                )
                scale = np.sum(x * y) / np.sum(x * x)
                gaps[row, column] = np.abs(scale * x - y).max() / np.abs(y).max()
        assert sorted(gaps.argmin(axis=1)) == [0, 1, 2]
        worst.append(gaps.min(axis=1).max())
    assert worst[0] < 1e-2 and -np.diff(np.log2(worst))[-1] > 1.6


def test_the_family_is_a_circle():
    shell = shell_of("edge")
    assert (associate(shell, 0.0).vertices == shell.mesh.vertices).all()
    assert (associate(shell, 180.0).vertices == -shell.mesh.vertices).all()
    one, two = associate(shell, 30.0), associate(shell, 390.0)
    assert np.abs(one.vertices - two.vertices).max() < 1e-9
    three = [associate(shell, a).vertices for a in (10.0, 130.0, 250.0)]
    assert np.abs(sum(three)).max() < 1e-9


def test_a_closed_catenoid_is_refused_with_the_helicoid_s_pitch():
    made = surface("catenoid").scaled(1000.0)
    on = lattice_on(made, 300.0, rectangle=(-0.6, 0.6, 0, 2 * np.pi), rows_along="v", closed=True)
    shell = minimal_shell(made, on, "edge")
    with pytest.raises(MeshError, match="does not close around the ring") as caught:
        associate(shell, 45.0)
    text = str(caught.value)
    period = np.array(text[text.index("(") + 1 : text.index(")")].split(","), float)
    assert np.abs(period[:2]).max() < 1e-6
    assert abs(period[2]) == pytest.approx(2 * np.pi * 1000.0, rel=0.02)
    with pytest.raises(MeshError, match="finite"):
        associate(shell, np.nan)

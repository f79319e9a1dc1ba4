"""Planar conformal meshes from two similarities, their images on the sphere, Christoffel duals."""

import numpy as np
import pytest

from phexfab.errors import MeshError
from phexfab.mesh.measures import edges, face_normals, mean_edge, planarity, simple_faces
from phexfab.minimal.christoffel import is_discrete_minimal
from phexfab.parallel.pairs import parallelism
from phexfab.remesh.conformal.dual import (
    christoffel_dual,
    conformality,
    face_cross_ratios,
)
from phexfab.remesh.conformal.hexagons import circular_defect, complete_hexagon, conformal_defect
from phexfab.remesh.conformal.planar import (
    Similarity,
    case_of,
    conformal_hexagon,
    on_sphere,
    orbit,
    planar_conformal_mesh,
    ring_tilt,
    similarities,
)


def symmetric_hexagon(p):
    """Edges p, 1, q, −p, −1, −q with 2pq = p + 1 + q: conformal, and both maps translations."""
    q = (p + 1) / (2 * p - 1)
    return np.cumsum([0, p, 1, q, -p, -1])


# (hexagon, columns, rows, closed, case)
MESHES = {
    "case 1": (conformal_hexagon(0.0)[0], 7, 6, False, 1),
    "case 1, not circular": (symmetric_hexagon(0.6 - 1.0j), 5, 4, False, 1),
    "case 2, ring": (conformal_hexagon(ring_tilt(12))[0], 12, 5, True, 2),
    "case 2, open": (conformal_hexagon(ring_tilt(20))[0], 11, 7, False, 2),
    "case 2, the other way": (conformal_hexagon(0.12j)[0], 8, 6, False, 2),
    "case 3": (conformal_hexagon(0.1 + 0.07j)[0], 9, 7, False, 3),
    "case 3, circular": (
        complete_hexagon(*np.exp(1j * np.array([0.02, 1.03, 3.2, 5.3]))),
        6,
        5,
        False,
        3,
    ),
    "case 3, not circular": (complete_hexagon(1, 0.5 + 0.9j, -1.02, 0.5 - 0.8j), 6, 5, False, 3),
}


def made(name):
    hexagon, columns, rows, closed, _ = MESHES[name]
    return planar_conformal_mesh(hexagon, columns, rows, closed=closed)


@pytest.fixture(params=MESHES)
def name(request):
    return request.param


def test_the_case_and_whether_faces_are_circular(name):
    found = made(name)
    assert found.case == MESHES[name][-1]
    assert found.circular == ("not circular" not in name)


def test_the_two_similarities_commute(name):
    alpha, beta = similarities(MESHES[name][0])
    one, other = alpha.after(beta), beta.after(alpha)
    assert abs(one.factor - other.factor) < 1e-14
    assert abs(one.shift - other.shift) < 1e-13
    z = np.asarray(MESHES[name][0], complex)
    assert np.abs(alpha(z[[4, 5]]) - z[[2, 1]]).max() < 1e-14
    assert np.abs(beta(z[[3, 4]]) - z[[1, 0]]).max() < 1e-14
    if not alpha.is_translation:
        # One fixed point, unless they are translations.
        assert abs(alpha.fixed_point - beta.fixed_point) < 1e-11 * abs(alpha.fixed_point) + 1e-12


def test_similarities_of_other_hexagons_do_not_commute():
    z = MESHES["case 3"][0] + np.array([0.1, 0, 0, 0, 0, 0])
    alpha, beta = similarities(z)
    one, other = alpha.after(beta), beta.after(alpha)
    assert abs(one.shift - other.shift) > 1e-3
    with pytest.raises(MeshError, match="do not commute"):
        planar_conformal_mesh(z, 3, 3)


def test_every_face_is_an_image_of_the_hexagon_and_there_are_no_gaps(name):
    hexagon, columns, rows, closed, _ = MESHES[name]
    found = made(name)
    mesh = found.mesh
    assert mesh.n_faces == columns * rows
    # Applied one after the other, not as powers.
    row = np.asarray(hexagon, complex)
    for k in range(rows):
        image = row
        for l in range(columns):
            face = found.points[mesh.face(k * columns + l)]
            apart = np.abs(face[:, None] - image)
            assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-10
            image = found.alpha(image)
        row = found.beta(row)
    assert simple_faces(mesh).all()
    assert (face_normals(mesh)[:, 2] > 0.999).all()
    euler = len(mesh.vertices) - len(edges(mesh)) + mesh.n_faces
    assert euler == (0 if closed else 1)
    # The border runs around the area of the faces: no gaps, no overlaps.
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    pairs = set(zip(tail, head, strict=True))
    border = np.array([(a, b) for a, b in pairs if (b, a) not in pairs])
    z = found.points
    total = np.sum((z[tail].conj() * z[head]).imag)
    around = np.sum((z[border[:, 0]].conj() * z[border[:, 1]]).imag)
    assert total == pytest.approx(around, rel=1e-12)


def test_every_face_is_a_conformal_hexagon(name):
    found = made(name)
    assert conformality(found.mesh, found.twice).max() < 1e-11
    # By hand, whichever corner the face begins with.
    faces = found.points[found.mesh.corners.reshape(-1, 6)]
    turned = np.min([conformal_defect(np.roll(faces, s, axis=1)) for s in range(6)], axis=0)
    assert turned.max() < 1e-11
    if found.circular:
        assert circular_defect(faces).max() < 1e-11
    # An edge of coefficient 2 lies between neighbours along α, or on the border.
    columns, rows, closed = MESHES[name][1:4]
    assert found.twice.sum() == rows * (columns + (0 if closed else 1))


def test_powers_are_exact_for_similarities_that_hardly_turn():
    for tilt in (1e-7, 1e-10 + 1e-10j, 1e-13j):
        alpha, beta = similarities(conformal_hexagon(tilt)[0])
        z = 0.3 + 0.2j
        for _ in range(5):
            z = alpha(z)
        for _ in range(7):
            z = beta(z)
        assert abs(orbit(alpha, beta, 0.3 + 0.2j, 7, 5) - z) < 1e-13
    assert orbit(Similarity(1, 2), Similarity(1, 1j), 0, [1, 2], [3, -1]) == pytest.approx(
        np.array([6 + 1j, -2 + 2j])
    )


def test_derived_quads_sample_z_and_exponentials():
    m, n = np.meshgrid(np.arange(-2, 4), np.arange(-2, 3))
    flat = made("case 1").derived_quads(0.2 + 0.1j, m, n)
    steps = np.diff(flat, axis=1)[0, 0], np.diff(flat, axis=0)[0, 0]
    assert np.abs(flat - flat[2, 2] - steps[0] * m - steps[1] * n).max() < 1e-13
    # The two directions are at right angles, as those of m + in are.
    assert abs((steps[0] * np.conj(steps[1])).real) < 1e-13
    for name in ("case 2, ring", "case 3"):
        found = made(name)
        quads = found.derived_quads(2.0 + 0.5j, m, n) - found.alpha.fixed_point
        assert np.abs(quads[:, 1:] / quads[:, :-1] - quads[0, 1] / quads[0, 0]).max() < 1e-12
        assert np.abs(quads[1:] / quads[:-1] - quads[1, 0] / quads[0, 0]).max() < 1e-12
        a, c = np.log(quads[0, 1] / quads[0, 0]), np.log(quads[1, 0] / quads[0, 0])
        if found.case == 2:
            assert max(abs(a.real), abs(c.imag)) < 1e-12
        else:
            assert min(abs(a.real), abs(a.imag), abs(c.real), abs(c.imag)) > 1e-3


@pytest.mark.parametrize("name", [n for n in MESHES if "not circular" not in n])
def test_on_the_sphere_faces_are_planar_and_the_dual_is_minimal(name):
    found = made(name)
    size = 0.5 / np.abs(found.points).max()
    gauss = on_sphere(found, size=size)
    assert np.abs(np.linalg.norm(gauss.vertices, axis=1) - 1).max() < 1e-14
    assert planarity(gauss).max() < 1e-13 * mean_edge(gauss)
    assert conformality(gauss, found.twice).max() < 1e-10
    outwards = face_normals(gauss) * gauss.vertices[gauss.corners[::6]]
    assert (outwards.sum(axis=1) > 0).all()
    dual = christoffel_dual(gauss, found.twice)
    assert parallelism(dual, gauss).max() < 1e-9
    assert planarity(dual).max() < 1e-10 * mean_edge(dual)
    assert is_discrete_minimal(dual, gauss, 1e-9)


def test_the_dual_of_the_dual_is_the_mesh(name):
    found = made(name)
    dual = christoffel_dual(found.mesh, found.twice)
    assert conformality(dual, found.twice).max() < 1e-9
    back = christoffel_dual(dual, found.twice).vertices
    own = found.mesh.vertices
    assert np.abs((back - back[0]) - (own - own[0])).max() < 1e-9 * np.abs(own - own[0]).max()


def test_case_of_names_pure_turns_and_stretches():
    turn, grow = Similarity(np.exp(0.3j), 0), Similarity(1.2 * np.exp(0.15j), 0)
    assert case_of(turn, grow) == 2
    assert case_of(Similarity(1.1, 0), Similarity(np.sqrt(1.1) * np.exp(0.2j), 0)) == 2
    assert case_of(Similarity(1.1 * np.exp(0.1j), 0), grow) == 3
    assert case_of(Similarity(1, 1), Similarity(1, 1j)) == 1


def test_what_cannot_be_made_is_refused():
    hexagon = conformal_hexagon(0.1)[0]
    with pytest.raises(MeshError, match="is not the identity"):
        planar_conformal_mesh(hexagon, 12, 3, closed=True)
    with pytest.raises(MeshError, match="at least one"):
        planar_conformal_mesh(hexagon, 0, 3)
    with pytest.raises(MeshError, match="not circular"):
        on_sphere(made("case 3, not circular"))
    found = made("case 1")
    with pytest.raises(MeshError, match="opposite ones are needed"):
        face_cross_ratios(found.mesh, ~found.twice)
    moved = found.mesh.vertices.copy()
    moved[20] += [0.05, 0.0, 0.0]
    broken = type(found.mesh)(moved, found.mesh.corners, found.mesh.starts)
    with pytest.raises(MeshError, match="does not close"):
        christoffel_dual(broken, found.twice)
    with pytest.raises(MeshError, match="modulus"):
        conformal_hexagon(1.0)
    with pytest.raises(MeshError, match="at least 5"):
        ring_tilt(4)

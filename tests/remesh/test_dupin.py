"""Dupin duality: the equivalences of §5.1.3 on random stars, conics, ideal triangles."""

import numpy as np
import pytest

from phexfab.errors import LatticeError
from phexfab.remesh.dupin.duality import (
    centre_is_inside,
    corners_on_both_branches,
    directions_in_both_ranges,
    dupin_centre,
    dupin_conic,
    dupin_indicatrix,
    free_of_conjugate_pairs,
    star_hexagon,
    star_is_valid,
    validity,
)
from phexfab.remesh.dupin.ideal import (
    QUASI_REGULAR,
    REGULAR,
    affine_distance,
    ideal_centres,
    ideal_construction,
    ideal_triangle,
)

COUNT = 10_000


def stars(sign, seed=0):
    rng = np.random.default_rng(seed)
    kappa = np.stack([rng.uniform(0.1, 3, COUNT), sign * rng.uniform(0.1, 3, COUNT)], axis=1)
    return rng.normal(size=(COUNT, 3, 2)), kappa * rng.choice([-1, 1], COUNT)[:, None]


def test_elliptic_conditions_are_equivalent():
    triangles, kappa = stars(1)
    valid = star_is_valid(triangles, kappa)
    assert 0.1 < valid.mean() < 0.9
    assert (centre_is_inside(triangles, kappa) == valid).all()
    assert (free_of_conjugate_pairs(triangles, kappa) == valid).all()
    assert ((validity(triangles, kappa) > 0) == valid).all()


def test_hyperbolic_conditions_are_equivalent():
    triangles, kappa = stars(-1)
    valid = star_is_valid(triangles, kappa)
    assert 0.1 < valid.mean() < 0.9
    assert (corners_on_both_branches(triangles, kappa) == valid).all()
    assert (directions_in_both_ranges(triangles, kappa) == valid).all()
    assert ((validity(triangles, kappa) > 0) == valid).all()


def crossing_free(polygons):
    """Whether polygons (n, 6, 2) are simple: every two edges, by the sides their ends are on."""

    def side(a, b, c):
        one, two = b - a, c - a
        return np.sign(one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0])

    good = np.ones(len(polygons), bool)
    ends = [(polygons[:, k], polygons[:, (k + 1) % 6]) for k in range(6)]
    for i in range(6):
        for j in range(i + 2, 6 if i else 5):
            (a, b), (c, d) = ends[i], ends[j]
            good &= ~((side(a, b, c) != side(a, b, d)) & (side(c, d, a) != side(c, d, b)))
    return good


def faces_of_tangent_planes(triangles, kappa):
    """The faces in the tangent plane of the middle, of all seven points on the paraboloid."""
    o, a, b = (triangles[:, k] for k in range(3))
    around = [a, b, b - a + o, 2 * o - a, 2 * o - b, a - b + o]
    corners = []
    for k in range(6):
        points = np.stack([o, around[k], around[(k + 1) % 6]], axis=1)
        planes = np.concatenate([-kappa[:, None] * points, np.ones((COUNT, 3, 1))], axis=2)
        height = -0.5 * (kappa[:, None] * points**2).sum(-1)
        corners.append(np.linalg.solve(planes, height[..., None])[:, :2, 0])
    return np.stack(corners, axis=1)


@pytest.mark.parametrize("sign", [1, -1])
def test_conditions_decide_whether_tangent_planes_of_a_whole_star_cut_a_simple_face(sign):
    triangles, kappa = stars(sign, 11)
    simple = crossing_free(faces_of_tangent_planes(triangles, kappa))
    assert 0.1 < simple.mean() < 0.9
    conditions = (
        (star_is_valid, centre_is_inside, free_of_conjugate_pairs)
        if sign > 0
        else (star_is_valid, corners_on_both_branches, directions_in_both_ranges)
    )
    for condition in conditions:
        assert (condition(triangles, kappa) == simple).all()
    assert ((validity(triangles, kappa) > 0) == simple).all()


def test_no_pair_of_conjugate_directions_encloses_the_edges_of_a_valid_triangle():
    triangles, kappa = stars(1, 12)
    valid = star_is_valid(triangles, kappa)
    edge = np.roll(triangles, -1, axis=1) - triangles
    # Where the ellipse is the unit circle conjugate means at right angles: pairs (t, t + 90).
    flat = edge * np.sqrt(np.abs(kappa))[:, None]
    angle = np.degrees(np.arctan2(flat[..., 1], flat[..., 0])) % 180
    enclosed = np.zeros(COUNT, bool)
    for t in np.arange(0.0, 90.0, 0.25):
        first = ((angle - t) % 180 < 90).sum(axis=1)
        enclosed |= (first == 0) | (first == 3)
    assert not (enclosed & valid).any()
    # Those that are not valid have such a pair, unless it lies between the sampled ones.
    assert (enclosed | valid).mean() > 0.995
    assert (np.abs(validity(triangles, kappa)[~(enclosed | valid)]) < 0.05).all()


@pytest.mark.parametrize("sign", [1, -1])
def test_the_star_does_not_depend_on_the_fundamental_triangle(sign):
    triangles, kappa = stars(sign, 1)
    valid = star_is_valid(triangles, kappa)
    margin = validity(triangles, kappa)
    for other in (np.roll(triangles, 1, axis=1), triangles[:, ::-1], -triangles + 3.0):
        assert (star_is_valid(other, kappa) == valid).all()
        off = np.abs(validity(other, kappa) - margin) / (1 + margin**2)
        assert off.max() < 1e-9


@pytest.mark.parametrize("sign", [1, -1])
def test_the_centre_is_where_tangent_planes_meet(sign):
    triangles, kappa = stars(sign, 2)
    # of the paraboloid z = ½ (κ₁x² + κ₂y²): z = κ∘p · x − ½ κ·p²
    slope = kappa[:, None] * triangles
    height = -0.5 * (kappa[:, None] * triangles**2).sum(-1)
    planes = np.concatenate([-slope, np.ones((COUNT, 3, 1))], axis=2)
    meet = np.linalg.solve(planes, height[..., None])[..., 0]
    scale = 1 + np.abs(meet[:, :2]).max(axis=1)
    assert (np.abs(dupin_centre(triangles, kappa) - meet[:, :2]).max(axis=1) / scale).max() < 1e-8


@pytest.mark.parametrize("sign", [1, -1])
def test_the_conic_passes_the_corners(sign):
    triangles, kappa = stars(sign, 3)
    conic = dupin_conic(triangles, kappa)
    for k in range(3):
        assert np.abs(conic.value(triangles[:, k]) / (1 + np.abs(conic.level))).max() < 1e-12


@pytest.mark.parametrize("sign", [1, -1])
def test_ideal_triangles_have_their_centre_at_the_ideal_place(sign):
    corners, kappa = stars(sign, 4)
    triangles = ideal_triangle(corners[:, 0], corners[:, 1], kappa)
    size = np.abs(triangles - triangles.mean(axis=1, keepdims=True)).max(axis=(1, 2))
    place = ideal_centres(triangles)[:, 0 if sign > 0 else 3]
    off = np.abs(dupin_centre(triangles, kappa) - place).max(axis=1) / size
    assert np.median(off) < 1e-15 and off.max() < 1e-9
    margin = np.abs(validity(triangles, kappa) - 1)
    assert np.median(margin) < 1e-14 and margin.max() < 1e-8
    assert star_is_valid(triangles, kappa).all()
    # the apex is on the left
    one, two = (triangles[:, k] - triangles[:, 0] for k in (1, 2))
    assert (one[:, 0] * two[:, 1] - one[:, 1] * two[:, 0] > 0).all()


@pytest.mark.parametrize(("sign", "model", "other"), [(1, REGULAR, 0), (-1, QUASI_REGULAR, 1)])
def test_ideal_hexagons_are_affine_to_their_model(sign, model, other):
    corners, kappa = stars(sign, 5)
    hexagons = star_hexagon(ideal_triangle(corners[:, 0], corners[:, 1], kappa), kappa)
    assert affine_distance(hexagons, model).max() < 1e-9
    assert affine_distance(hexagons, (QUASI_REGULAR, REGULAR)[other]).min() > 0.05
    centre = hexagons.mean(axis=1, keepdims=True)
    assert np.abs(hexagons[:, :3] + hexagons[:, 3:] - 2 * centre).max() < 1e-6


def test_the_models_have_the_angles_of_the_thesis():
    for model, wanted in ((REGULAR, [120] * 6), (QUASI_REGULAR, [60, 60, 240, 60, 60, 240])):
        onward, back = np.roll(model, -1, axis=0) - model, np.roll(model, 1, axis=0) - model
        cross = onward[:, 0] * back[:, 1] - onward[:, 1] * back[:, 0]
        angles = np.degrees(np.arctan2(cross, (onward * back).sum(1))) % 360
        assert np.abs(angles - wanted).max() < 1e-12


@pytest.mark.parametrize("sign", [1, -1])
def test_the_construction_is_that_of_the_figure(sign):
    corners, kappa = stars(sign, 6)
    a, b = corners[:, 0], corners[:, 1]
    made = ideal_construction(a, b, kappa)
    d, e = made.parallelogram[:, 0] - made.middle, made.parallelogram[:, 1] - made.middle
    scale = np.abs(kappa).max(1) * (d**2).sum(1) + np.abs(kappa).max(1) * (e**2).sum(1)
    if sign > 0:  # MD and ME are conjugate
        assert (np.abs((kappa * d * e).sum(1)) / scale).max() < 1e-13
    else:  # MD and ME are asymptotic
        assert (np.abs((kappa * d * d).sum(1)) / scale).max() < 1e-13
        assert (np.abs((kappa * e * e).sum(1)) / scale).max() < 1e-13
    rise = made.parallelogram[:, 0] - a
    assert (np.abs((kappa * rise * (b - a)).sum(1)) / scale).max() < 1e-12  # AD conjugate to AB
    reach = np.linalg.norm(made.apex - made.middle, axis=1)
    assert np.abs(reach / np.linalg.norm(rise, axis=1) - np.sqrt(3)).max() < 1e-12


@pytest.mark.parametrize(
    ("kappa", "count"), [((2.0, 0.5), 1), ((-2.0, -0.5), 1), ((2.0, -0.5), 4), ((0.0, 3.0), 2)]
)
def test_the_indicatrix_satisfies_its_equation(kappa, count):
    curves = dupin_indicatrix(kappa)
    assert len(curves) == count
    for curve in curves:
        assert np.abs(np.abs((np.array(kappa) * curve**2).sum(1)) - 1).max() < 1e-12


def test_a_planar_point_has_no_indicatrix():
    with pytest.raises(LatticeError, match="planar point"):
        dupin_indicatrix((0.0, 0.0))


def test_an_affine_image_is_recognised_in_space():
    rng = np.random.default_rng(7)
    image = np.roll(REGULAR, 2, axis=0) @ rng.normal(size=(2, 3)) + rng.normal(size=3)
    assert affine_distance(image) < 1e-14
    assert affine_distance(image, QUASI_REGULAR) > 0.05

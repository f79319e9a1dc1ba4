"""Overlaps and distances of solids against boxes known by hand and manifold3d on all pairs."""

from itertools import combinations

import numpy as np
import pytest
import shapely
from parts_samples import as_manifold, sample

from phexfab.errors import PartError
from phexfab.fabrication import clash
from phexfab.fabrication.bars import BeamSpec
from phexfab.fabrication.beams import beams
from phexfab.fabrication.clash import as_prism, box_pairs, clashes, triangulations
from phexfab.fabrication.clearance import clearances, segment_distances
from phexfab.fabrication.convex import convex_cells, parted
from phexfab.fabrication.nodes import NodeSpec, nodes
from phexfab.fabrication.panels import PanelSpec, panels
from phexfab.fabrication.parts import Cylinder, Solid
from phexfab.fabrication.polyhedra import prism_faces, volumes

SQUARE = [[0, 0], [1, 0], [1, 1], [0, 1]]
U_SHAPE = [[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]]


def prism(polygon, low, high, shift=(0, 0, 0), taper=0.0, turn=None):
    """A prism-like solid on a counter-clockwise polygon; the upper cap grows by the taper."""
    flat = np.asarray(polygon, float)
    middle = flat.mean(axis=0)
    lower = np.column_stack([flat, np.full(len(flat), float(low))])
    upper = np.column_stack(
        [middle + (1 + taper) * (flat - middle), np.full(len(flat), float(high))]
    )
    points = np.concatenate([lower, upper])
    if turn is not None:
        points = points @ turn.T
    return Solid(points + np.asarray(shift, float), prism_faces(len(flat)))


def box(low, high):
    (x0, y0, z0), (x1, y1, z1) = low, high
    return prism([[x0, y0], [x1, y0], [x1, y1], [x0, y1]], z0, z1)


def rotation(rng):
    q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return q * np.linalg.det(q)


def star(rng, n):
    angle = 2 * np.pi * (np.arange(n) + rng.uniform(0, 0.8, n)) / n
    radius = rng.uniform(0.3, 1.5, n)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def soup(count, spread, seed):
    """Non-convex prisms, tapered or not, and boxes, thrown into a cube."""
    rng = np.random.default_rng(seed)
    made = []
    for _ in range(count):
        n = int(rng.integers(3, 9))
        shift = spread * rng.uniform(-1, 1, 3)
        taper = float(rng.choice([0.0, 0.2]))
        made.append(prism(star(rng, n), 0, rng.uniform(0.1, 1), shift, taper, rotation(rng)))
    return made


def names(solids):
    return [f"S{k}" for k in range(len(solids))]


def test_two_boxes_tell_pair_volume_and_place():
    solids = [box((0, 0, 0), (2, 2, 2)), box((5, 5, 5), (6, 6, 6)), box((1, 1, 1), (3, 4, 1.5))]
    (found,) = clashes(solids, ["A", "B", "C"])
    assert (found.mark_a, found.mark_b) == ("A", "C")
    assert found.volume == pytest.approx(0.5, rel=1e-12)
    assert found.place == pytest.approx((1.5, 1.5, 1.25), rel=1e-12)
    assert found.relative == pytest.approx(0.5 / 3.0, rel=1e-12)


def test_boxes_that_touch_do_not_clash_and_a_hair_deeper_they_do():
    one = box((0, 0, 0), (1, 1, 1))
    for low in ((1, 0.3, 0), (1, 1, 0), (1, 1, 1)):  # by a face, an edge, a corner
        assert clashes([one, box(low, np.add(low, 1))], list("AB")) == []
    deeper = box((1 - 1e-4, 0.3, 0), (2, 1.3, 1))
    (found,) = clashes([one, deeper], list("AB"))
    assert found.volume == pytest.approx(0.7e-4, rel=1e-6)
    assert clashes([one, deeper], list("AB"), tolerance=1e-3) == []


def test_a_tongue_in_a_groove_clashes_only_when_too_wide():
    """Hulls overlap here: only a non-convex treatment is right."""
    groove = prism(U_SHAPE, 0, 1)
    fits = box((1, 1, 0), (2, 4, 1))
    assert clashes([groove, fits], list("AB")) == []
    wide = box((1, 1, 0), (2.25, 4, 1))
    (found,) = clashes([groove, wide], list("AB"))
    assert found.volume == pytest.approx(0.25 * 2, rel=1e-12)
    assert found.place == pytest.approx((2.125, 2, 0.5), rel=1e-12)


def test_a_solid_inside_another_clashes_with_all_of_its_volume():
    (found,) = clashes([box((0, 0, 0), (9, 9, 9)), box((4, 4, 4), (5, 5, 5))], list("AB"))
    assert found.relative == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("seed", range(4))
def test_all_pairs_of_a_soup_agree_with_manifold(seed):
    solids = soup(60, 2.5, seed)
    bodies = [as_manifold(solid) for solid in solids]
    wanted = {}
    for i, j in combinations(range(len(solids)), 2):
        volume = (bodies[i] ^ bodies[j]).volume()
        if volume > 1e-9 * min(bodies[i].volume(), bodies[j].volume()):
            wanted[f"S{i}", f"S{j}"] = volume
    found = {(c.mark_a, c.mark_b): c.volume for c in clashes(solids, names(solids))}
    assert len(wanted) > 30
    assert list(found) == list(wanted)
    assert np.allclose(list(found.values()), list(wanted.values()), rtol=1e-9)


def test_cylinders():
    upright = Cylinder(np.zeros(3), np.array([0, 0, 1.0]), 10.0, 100.0)
    away = box((10, -5, 20), (60, 5, 80))  # touches along a line
    above = box((-50, -50, 100), (50, 50, 108))
    beside = Cylinder(np.array([0, 20.0, 0]), np.array([0, 0, 2.0]), 10.0, 100.0)
    assert clashes([upright, away, above, beside], list("ABCD")) == []
    bar = box((-50, -2, 40), (50, 2, 44))
    (found,) = clashes([bar, upright], list("AB"))
    # Chords of a circle: the cut is the slab's part of the disc times its height.
    half = 10.0 * np.arcsin(0.2) * 10.0 + 2 * np.sqrt(96.0)
    assert found.volume == pytest.approx(2 * half * 4, rel=2e-3)
    assert found.volume < 2 * half * 4  # the prism is inscribed
    assert found.place == pytest.approx((0, 0, 42), abs=1e-9)


def test_the_prism_of_a_cylinder_is_inscribed():
    axis = np.array([1.0, 2.0, -0.5])
    cylinder = Cylinder(np.array([3.0, 4.0, 5.0]), axis / np.linalg.norm(axis), 7.0, 30.0)
    made = as_prism(cylinder)
    along = (made.vertices - cylinder.base) @ cylinder.axis
    out = np.linalg.norm(made.vertices - cylinder.base - along[:, None] * cylinder.axis, axis=1)
    assert np.allclose(out, 7.0)
    assert np.allclose(np.sort(along), [0.0] * 64 + [30.0] * 64)
    assert volumes([made])[0] == pytest.approx(32 * np.sin(np.pi / 32) * 49 * 30, rel=1e-12)


def test_a_solid_that_is_not_closed_is_named():
    whole = box((0, 0, 0), (2, 2, 2))
    lidless = Solid(whole.vertices + 1.0, whole.faces[:-1])
    with pytest.raises(PartError, match="P007: its solid is not closed"):
        clashes([whole, lidless], ["P006", "P007"])


def test_nothing_clashes_with_nothing():
    assert clashes([], []) == []
    assert clashes([box((0, 0, 0), (1, 1, 1))], ["A"]) == []


def test_box_pairs_are_all_overlapping_boxes():
    rng = np.random.default_rng(8)
    low = rng.integers(0, 12, (150, 3)).astype(float)
    high = low + rng.integers(1, 4, (150, 3))
    wanted = [
        (i, j)
        for i, j in combinations(range(150), 2)
        if (low[i] <= high[j]).all() and (low[j] <= high[i]).all()
    ]
    assert [tuple(pair) for pair in box_pairs(low, high).tolist()] == wanted


def is_parted(one, two, tolerance=1e-6):
    first, second = convex_cells([one]), convex_cells([two])
    assert len(first) == len(second) == 1
    nil = np.zeros(1, int)
    answers = [parted(first[0], nil, second[0], nil, tolerance)[0]]
    answers += [parted(second[0], nil, first[0], nil, tolerance)[0]]
    assert answers[0] == answers[1]
    return bool(answers[0])


def test_edges_that_cross_are_parted_by_a_plane_along_both():
    """Two roofs, ridge over ridge at right angles: no plane of a face parts them."""
    roof = [[-9, -9, -9], [9, -9, -9], [9, 9, -9], [-9, 9, -9], [-9, 0, 0], [9, 0, 0]]
    faces = ((3, 2, 1, 0), (0, 1, 5, 4), (2, 3, 4, 5), (1, 2, 5), (3, 0, 4))
    below = Solid(np.array(roof, float), faces)
    over = below.vertices[:, [1, 0, 2]] * np.array([1, 1, -1.0])
    assert volumes([Solid(over, faces)])[0] > 0
    for lift, wanted in ((1e-3, True), (0.0, True), (-1e-3, False)):
        assert is_parted(below, Solid(over + np.array([0, 0, lift]), faces)) == wanted
    assert is_parted(below, Solid(over - np.array([0, 0, 1e-3]), faces), tolerance=2e-3)


@pytest.mark.parametrize("gap", [0.001, 0.0, -0.001])
def test_cylinders_are_parted_exactly(gap):
    def cylinder(base, axis, radius=10.0, length=50.0):
        return Cylinder(np.array(base, float), np.array(axis, float), radius, length)

    upright = cylinder((0, 0, 0), (0, 0, 1))
    clear = gap >= 0
    assert is_parted(upright, box((10 + gap, -5, 10), (20, 5, 40))) == clear
    assert is_parted(upright, cylinder((-25, 20 + gap, 25), (1, 0, 0))) == clear
    assert is_parted(upright, cylinder((0, 0, 50 + gap), (0, 0, 1))) == clear
    # The rim of a leaning one, sine 0.6, against a wall: 30 along, then 8 across.
    leaning = cylinder((0, 0, 0), (0.6, 0.0, 0.8))
    assert is_parted(leaning, box((38 + gap, -99, -99), (60, 99, 99))) == clear


def test_cells_cover_a_non_convex_solid():
    """Every inner point lies in the hull of some cell, whatever the fan looks like."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        solid = prism(star(rng, 9), 0, 1, taper=0.3)
        cells = convex_cells([solid])
        polygon = shapely.Polygon(solid.vertices[:9, :2])
        seen = 0
        for x, y, z in rng.uniform([-2, -2, 0], [2, 2, 1], (200, 3)):
            middle = solid.vertices[:9, :2].mean(axis=0)
            if polygon.contains(shapely.Point(middle + ([x, y] - middle) / (1 + 0.3 * z))):
                seen += 1
                hulls = [cell.normals @ [x, y, z] <= cell.support + 1e-12 for cell in cells]
                assert any(inside.all(axis=1).any() for inside in hulls)
        assert seen > 5


@pytest.mark.parametrize(
    "polygon",
    [
        U_SHAPE,
        [[0, 0], [2, -1], [0.5, 0], [2, 1]],  # reflex at corner 2: cut from 0 to 2
        [[2, 1], [0, 0], [2, -1], [0.5, 0]],  # reflex at corner 3: cut from 1 to 3
    ],
)
def test_triangles_fill_non_convex_faces(polygon):
    solid = prism(polygon, 0, 1)
    (triangles,) = triangulations([solid])
    a, b, c = solid.vertices[triangles].transpose(1, 0, 2)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    flat = shapely.Polygon(polygon)
    # Triangles that overlap or stick out would add up to more than the surface.
    assert area == pytest.approx(2 * flat.area + flat.length, rel=1e-12)


@pytest.mark.parametrize("kind", ["face", "edge", "vertex"])
@pytest.mark.parametrize(("edges", "gap"), [("square", 6.0), ("mitred", 6.0), ("mitred", 0.0)])
def test_planes_alone_clear_a_shell_s_parts(kind, edges, gap, monkeypatch):
    """Panels interlock, they and mitred bars touch, yet no boolean is needed to see all is well."""
    shell = sample(kind)
    panel, bar = PanelSpec(edges=edges, gap=gap), BeamSpec(ends="mitred")
    parts = [*panels(shell, panel), *beams(shell, bar, panel)]
    intersected = []
    build = clash._manifolds

    def watched(solids, marks):
        intersected.extend(marks)
        return build(solids, marks)

    monkeypatch.setattr(clash, "_manifolds", watched)
    assert clashes([part.solid for part in parts], [part.mark for part in parts]) == []
    assert intersected == []
    assert len(clashes([parts[0].solid, parts[0].solid], ["A", "B"])) == 1
    assert intersected == ["A", "B"]


def test_hubs_in_a_shell_are_clear_and_a_thick_one_is_found():
    shell = sample("edge")
    panel, bar = PanelSpec(), BeamSpec(ends="hub", hub_radius=30.0)
    bars, hubs = beams(shell, bar, panel), nodes(shell, NodeSpec("hub", 30.0), bar, panel)
    solids = [part.solid for part in bars] + [hub.cylinder for hub in hubs]
    marks = [part.mark for part in (*bars, *hubs)]
    assert clashes(solids, marks) == []
    thin = hubs[5].cylinder
    solids[len(bars) + 5] = Cylinder(thin.base, thin.axis, 40.0, thin.length)
    found = clashes(solids, marks)
    # The beams end 1 mm from the hub of radius 30.
    assert {c.mark_a for c in found} == set(hubs[5].neighbours)
    assert {c.mark_b for c in found} == {hubs[5].mark}


def test_distances_of_boxes_known_by_hand():
    one = box((0, 0, 0), (1, 1, 1))
    others = [
        box((3, 0.2, 0.2), (4, 0.8, 0.8)),  # face against face
        box((2, 3, 0), (4, 4, 1)),  # edge against edge
        box((2, 2, 3), (4, 4, 4)),  # corner against corner
        box((1, 0, 0), (2, 1, 1)),  # touching
        box((0.5, 0.5, 0.5), (2, 2, 2)),  # crossing
        box((-1, 0.4, 0.4), (2, 0.6, 0.6)),  # right through
    ]
    pairs = [[0, k + 1] for k in range(len(others))]
    wanted = [2.0, np.sqrt(1 + 4), np.sqrt(1 + 1 + 4), 0.0, 0.0, 0.0]
    found = clearances([one, *others], np.array(pairs))
    assert np.allclose(found, wanted, atol=1e-15)


def test_a_corner_over_a_non_convex_face():
    """Over the notch of the U its walls are nearest, not the face that the hull would have."""
    groove = prism(U_SHAPE, 0, 10)
    corner = [[0, 0, 0], [0.2, 0.2, 0.7], [0.2, -0.1, 0.7], [-0.2, 0.1, 0.7]]
    faces = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))
    over_bottom = Solid(np.array(corner) @ np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]]), faces)
    in_notch = Solid(over_bottom.vertices + np.array([1.5, 1.3, 5.0]), faces)
    beside = Solid(over_bottom.vertices + np.array([0.5, 3.5, 5.0]), faces)
    low = np.abs(in_notch.vertices[:, 1] - 1.0).min()
    found = clearances([groove, in_notch, beside], np.array([[0, 1], [2, 0]]))
    assert found[0] == pytest.approx(min(low, (in_notch.vertices[:, 0] - 1).min(), 0.3), rel=1e-12)
    assert found[1] == pytest.approx((beside.vertices[:, 1] - 3.0).min(), rel=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_distances_in_a_soup_agree_with_manifold(seed):
    solids = soup(30, 3.0, 100 + seed)
    bodies = [as_manifold(solid) for solid in solids]
    pairs = np.array(list(combinations(range(len(solids)), 2)))
    volumes_ = np.array([(bodies[i] ^ bodies[j]).volume() for i, j in pairs.tolist()])
    wanted = np.array([bodies[i].min_gap(bodies[j], 100.0) for i, j in pairs.tolist()])
    found = clearances(solids, pairs)
    apart = volumes_ == 0
    assert apart.sum() > 200 and (~apart).sum() > 5
    assert np.allclose(found[apart], wanted[apart], atol=1e-9)
    assert (found[volumes_ > 1e-9] == 0).all()


def test_distances_do_not_lose_digits_far_from_the_origin():
    one, two = box((0, 0, 0), (1, 1, 1)), box((1.5, 0, 0), (2, 1, 1))
    far = [Solid(solid.vertices + 2.0**20, solid.faces) for solid in (one, two)]
    assert clearances(far, np.array([[0, 1]])) == [0.5]


def test_segments_parallel_crossing_and_without_length():
    p = np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0], [1, 1, 1]], float)
    q = np.array([[4, 0, 0], [4, 0, 0], [4, 0, 0], [4, 0, 0], [1, 1, 1]], float)
    r = np.array([[1, 2, 0], [6, 1, 0], [2, -1, 3], [7, 3, 3], [1, 1, 4]], float)
    s = np.array([[9, 2, 0], [9, 1, 0], [2, 1, 3], [9, 3, 9], [1, 1, 4]], float)
    wanted = [2, np.sqrt(5), 3, np.sqrt(9 + 9 + 9), 3]
    assert np.allclose(segment_distances(p, q, r, s), wanted)
    assert np.allclose(segment_distances(r, s, q, p), wanted)


def test_mitred_panels_stand_exactly_the_gap_apart():
    shell = sample("edge")
    made = panels(shell, PanelSpec(edges="mitred", gap=7.0))
    inner = shell.edges[shell.edges[:, 3] >= 0]
    found = clearances([panel.solid for panel in made], inner[:, 2:])
    assert np.allclose(found, 7.0, atol=1e-9)

"""Panels: exact solids on the faces of M, and flat patterns that say the same."""

import numpy as np
import pytest
import shapely
from parts_samples import KINDS, as_manifold, face_normal, largest_overlap, sample
from shapely import Polygon

from phexfab.errors import DesignError, PartError
from phexfab.fabrication.panels import EDGES, SIDES, PanelSpec, largest_gaps, panels
from phexfab.fabrication.polyhedra import is_closed, solid_planarity

LEVELS = {"outside": (0.0, 8.0), "inside": (-8.0, 0.0), "centre": (-4.0, 4.0)}
ALL = [(kind, side, edges) for kind in KINDS for side in SIDES for edges in EDGES]
GAP = 6.0


def made(kind, side="outside", edges="square", closed=True):
    shell = sample(kind, closed)
    return shell, panels(shell, PanelSpec(8.0, GAP, side, edges))


def caps(panel):
    """Corner points of the lower and the upper cap."""
    n = len(panel.flat.outline)
    return panel.solid.vertices[:n], panel.solid.vertices[n:]


def outline_cap(panel, side):
    return caps(panel)[1 if side == "inside" else 0]


def node_planes(shell, f):
    """Points and inward unit normals of the node planes of a face, from M and S alone."""
    face = shell.mesh.face(f)
    m, s = shell.mesh.vertices[face], shell.gauss.vertices[face]
    inward = np.cross(s, np.roll(m, -1, axis=0) - m)
    return m, inward / np.linalg.norm(inward, axis=1, keepdims=True)


@pytest.mark.parametrize(("kind", "side", "edges"), ALL)
def test_solids_are_closed_planar_and_as_large_as_they_say(kind, side, edges):
    shell, found = made(kind, side, edges)
    assert [panel.face for panel in found] == list(range(shell.mesh.n_faces))
    assert all(is_closed(panel.solid) for panel in found)
    assert solid_planarity([panel.solid for panel in found]).max() <= 1e-9
    for panel in found:
        volume = as_manifold(panel.solid).volume()
        assert panel.volume == pytest.approx(volume, rel=1e-12)
        assert panel.volume > 0
        assert panel.mass == pytest.approx(volume * 1e-9 * 7850, rel=1e-12)
        assert panel.area == pytest.approx(Polygon(panel.flat.outline).area, rel=1e-12)


@pytest.mark.parametrize(("kind", "side", "edges"), ALL)
def test_caps_lie_in_planes_parallel_to_the_face_of_m(kind, side, edges):
    shell, found = made(kind, side, edges)
    for panel in found:
        face = shell.panels[panel.face]
        for points, level in zip(caps(panel), LEVELS[side], strict=True):
            height = points @ shell.normals[face] - shell.heights[face]
            np.testing.assert_allclose(height, level, atol=1e-9)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("kind", KINDS)
def test_square_panels_are_the_face_set_back_by_half_the_gap(kind, side):
    shell, found = made(kind, side)
    for panel in found:
        low, high = caps(panel)
        normal = shell.normals[shell.panels[panel.face]]
        np.testing.assert_allclose(high - low, 8.0 * np.tile(normal, (len(low), 1)), atol=1e-9)
        corners = shell.mesh.polygon(panel.face)
        x = corners[1] - corners[0]
        x /= np.linalg.norm(x)
        y = np.cross(normal, x)
        drawn = Polygon((corners - corners[0]) @ np.column_stack([x, y]))
        expected = drawn.buffer(-GAP / 2, join_style="mitre", mitre_limit=100)
        found_here = Polygon((low - corners[0]) @ np.column_stack([x, y]))
        assert found_here.symmetric_difference(expected).area < 1e-6
        assert expected.area < drawn.area
        np.testing.assert_array_equal(panel.flat.blank, panel.flat.outline)
        assert all(note.bevel == 0.0 for note in panel.flat.edges)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("kind", KINDS)
def test_mitred_sides_are_parallel_to_the_node_planes_and_the_gap_is_exact(kind, side):
    shell, found = made(kind, side, "mitred")
    for panel in found:
        low, high = caps(panel)
        anchors, inward = node_planes(shell, panel.face)
        for points in (low, np.roll(low, -1, axis=0), high, np.roll(high, -1, axis=0)):
            away = np.einsum("ij,ij->i", points - anchors, inward)
            np.testing.assert_allclose(away, GAP / 2, atol=1e-9)
    normals = {}
    for panel in found:
        face = shell.mesh.face(panel.face)
        for k, (i, j) in enumerate(zip(face, np.roll(face, -1), strict=True)):
            normals[i, j] = face_normal(panel.solid.vertices[list(panel.solid.faces[k + 2])])
    shared = [(i, j) for i, j in normals if (j, i) in normals]
    assert len(shared) > 100
    worst = max(np.linalg.norm(normals[i, j] + normals[j, i]) for i, j in shared)
    assert worst <= 1e-10


@pytest.mark.parametrize(("kind", "side", "edges"), ALL)
def test_flat_patterns_are_the_cap_seen_from_outside(kind, side, edges):
    """Same lengths, same turning sense: a mirrored pattern would fail."""
    shell, found = made(kind, side, edges)
    for panel in found:
        flat, space = panel.flat.outline, outline_cap(panel, side)
        normal = shell.normals[shell.panels[panel.face]]
        for step in (1, 2):
            np.testing.assert_allclose(
                np.linalg.norm(np.roll(flat, -step, axis=0) - flat, axis=1),
                np.linalg.norm(np.roll(space, -step, axis=0) - space, axis=1),
                atol=1e-9,
            )
        a, b = flat[1] - flat[0], flat[2] - flat[1]
        turned = np.cross(space[1] - space[0], space[2] - space[1]) @ normal
        assert a[0] * b[1] - a[1] * b[0] == pytest.approx(turned, abs=1e-6)
        polygon = Polygon(flat)
        assert polygon.is_valid
        assert polygon.exterior.is_ccw
        assert abs(polygon.centroid.x) < 1e-9
        assert abs(polygon.centroid.y) < 1e-9


def test_panels_are_drawn_along_their_longest_direction():
    _, found = made("face")
    # Second moments by summing over a fine grid of points.
    for panel in found[::17]:
        box = np.ptp(panel.flat.outline, axis=0)
        x, y = np.meshgrid(*(np.linspace(-s, s, 400) for s in box))
        inside = shapely.contains_xy(Polygon(panel.flat.outline), x, y)
        assert (x[inside] ** 2).mean() >= (y[inside] ** 2).mean()
        assert abs((x * y)[inside].mean()) < 2e-3 * (x[inside] ** 2).mean()


@pytest.mark.parametrize("edges", EDGES)
@pytest.mark.parametrize("closed", [True, False])
def test_every_edge_names_the_panel_beyond_it(edges, closed):
    shell, found = made("face", "outside", edges, closed)
    owner = {}
    for panel in found:
        face = shell.mesh.face(panel.face)
        for i, j in zip(face, np.roll(face, -1), strict=True):
            owner[int(i), int(j)] = panel.mark
    blank = 0
    for panel in found:
        face = shell.mesh.face(panel.face)
        assert len(panel.flat.edges) == len(face)
        for note, i, j in zip(panel.flat.edges, face, np.roll(face, -1), strict=True):
            assert note.neighbour == owner.get((int(j), int(i)), "")
            blank += note.neighbour == ""
    assert blank > 0


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("kind", KINDS)
def test_bevels_are_the_angles_of_the_solid(kind, side):
    """From the solid: angle of the side against a square cut, and which cap reaches further."""
    _, found = made(kind, side, "mitred")
    signs = set()
    for panel in found:
        here = outline_cap(panel, side)
        there = caps(panel)[0 if side == "inside" else 1]
        up = face_normal(here)
        for k, note in enumerate(panel.flat.edges):
            normal = face_normal(panel.solid.vertices[list(panel.solid.faces[k + 2])])
            assert np.degrees(np.arcsin(abs(normal @ up))) == pytest.approx(
                abs(note.bevel), abs=1e-9
            )
            outward = np.cross(here[(k + 1) % len(here)] - here[k], up)
            further = (there[k] - here[k]) @ outward
            assert np.sign(further) == np.sign(note.bevel)
            signs.add(np.sign(note.bevel))
    assert signs == {-1.0, 1.0}


@pytest.mark.parametrize("side", SIDES)
def test_blanks_hold_the_whole_panel_and_little_more(side):
    _, found = made("edge", side, "mitred")
    for panel in found:
        here = outline_cap(panel, side)
        flat = panel.flat.outline
        # The rigid motion that drew the outline, from three of its corners.
        x = np.linalg.lstsq(np.diff(flat[:3], axis=0), np.diff(here[:3], axis=0), rcond=None)[0]
        drawn = (panel.solid.vertices - here[0]) @ x.T + flat[0]
        n = len(flat)
        blank = Polygon(panel.flat.blank)
        assert blank.is_valid
        assert blank.exterior.is_ccw
        sides = [Polygon(drawn[[k, (k + 1) % n, (k + 1) % n + n, k + n]]) for k in range(n)]
        whole = shapely.union_all([Polygon(drawn[:n]), Polygon(drawn[n:])])
        assert blank.buffer(1e-7).covers(whole)
        assert all(blank.buffer(1e-7).covers(piece.buffer(0)) for piece in sides)
        assert blank.area - whole.area < 3.0 * n  # mm²: only notches at corners
        reach = shapely.distance(blank.exterior, shapely.points(drawn))
        assert reach.max() < 8.0


@pytest.mark.parametrize("edges", EDGES)
@pytest.mark.parametrize("side", SIDES)
def test_no_two_panels_overlap(side, edges):
    _, found = made("face", side, edges)
    worst, looked = largest_overlap([as_manifold(panel.solid) for panel in found])
    assert looked > len(found)
    assert worst <= 1e-6 * min(panel.volume for panel in found)


@pytest.mark.parametrize("edges", EDGES)
def test_the_largest_gap_is_where_polygons_break(edges):
    shell = sample("face")
    limit = largest_gaps(shell, PanelSpec(8, 0, edges=edges)).min()
    just = panels(shell, PanelSpec(8, limit * (1 - 1e-6), edges=edges))
    assert min(shapely.is_valid(Polygon(panel.flat.outline)) for panel in just)
    with pytest.raises(PartError, match="too large"):
        panels(shell, PanelSpec(8, limit * (1 + 1e-6), edges=edges))


def test_a_gap_that_is_too_large_is_refused_by_name_and_the_advice_works():
    shell = sample("face")
    with pytest.raises(PartError, match=r"gap 300 mm is too large for panel P\d{3}; at most") as e:
        panels(shell, PanelSpec(8, 300))
    text = str(e.value)
    most = float(text.split("at most ")[1].split(" mm")[0])
    name = text.split("panel ")[1][:4]
    assert len(panels(shell, PanelSpec(8, most))) == shell.mesh.n_faces
    worst = int(np.argmin(largest_gaps(shell, PanelSpec(8, 0))))
    assert name == panels(shell, PanelSpec(8, 1))[worst].mark


def test_a_thickness_that_closes_a_mitred_panel_is_refused():
    with pytest.raises(PartError, match="thickness 20000 mm is too large for the mitred panel P"):
        panels(sample("face"), PanelSpec(20000, 1, "inside", "mitred"))


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"thickness": -8}, "thickness is -8 mm"),
        ({"thickness": float("nan")}, "thickness is nan"),
        ({"gap": -1}, "gap is -1 mm"),
        ({"side": "top"}, "side is 'top'; choose one of outside"),
        ({"edges": "round"}, "edges is 'round'; choose one of square"),
    ],
)
def test_wrong_specifications_are_refused(wrong, message):
    with pytest.raises(DesignError, match=message):
        PanelSpec(**wrong)


def test_the_same_shell_gives_the_same_bytes():
    first = panels(sample("vertex"), PanelSpec(8, 6, edges="mitred"))
    second = panels(sample("vertex"), PanelSpec(8, 6, edges="mitred"))
    for a, b in zip(first, second, strict=True):
        assert a.solid.vertices.tobytes() == b.solid.vertices.tobytes()
        assert a.flat.outline.tobytes() == b.flat.outline.tobytes()
        assert a.flat.edges == b.flat.edges

"""Bars: they stand in the node planes, meet in the node axes and touch nothing."""

import numpy as np
import pytest
import shapely
from parts_samples import KINDS, as_manifold, face_normal, largest_overlap, sample, unit
from shapely import MultiPoint, Polygon

from phexfab.errors import DesignError, PartError
from phexfab.fabrication.bars import BeamSpec, beam_drop
from phexfab.fabrication.beams import beams
from phexfab.fabrication.marks import beam_marks, node_marks, panel_marks
from phexfab.fabrication.panels import SIDES, PanelSpec, panels
from phexfab.fabrication.polyhedra import is_closed, solid_planarity

WIDTH, HEIGHT = 10.0, 90.0
ENDS = ("mitred", "hub")
ALL = [(kind, side, ends) for kind in KINDS for side in SIDES for ends in ENDS]


def made(kind="face", side="outside", ends="mitred", closed=True, **more):
    shell = sample(kind, closed)
    panel = PanelSpec(8.0, 6.0, side)
    return shell, beams(shell, BeamSpec(WIDTH, HEIGHT, ends, **more), panel), panel


def downward(side):
    """+1 where bars stand along the normals."""
    return 1.0 if side == "inside" else -1.0


class Bar:
    """A bar read from its solid and from M and S, by routes of its own."""

    def __init__(self, shell, beam, side):
        i, j, *self.sides = shell.edges[beam.edge]
        m, s = shell.mesh.vertices, shell.gauss.vertices
        self.m, self.s = m[[i, j]], s[[i, j]]
        self.vertices, self.nodes = beam.solid.vertices, (int(i), int(j))
        self.along = unit(m[j] - m[i])
        across = np.cross(s[i], self.along)  # the node plane's normal, from one axis only
        self.left = unit(across)
        self.up = np.cross(self.along, self.left)
        n = len(self.vertices) // 2
        lower, upper = self.vertices[:n], self.vertices[n:]
        self.top, self.bottom = (upper, lower) if downward(side) < 0 else (lower, upper)
        self.down = downward(side) * self.up
        self.faces = [self.vertices[list(face)] for face in beam.solid.faces]

    def ends(self, end):
        """The end faces at vertex i (0) or j (1)."""
        inward = self.along if end == 0 else -self.along
        return [
            f
            for f in self.faces[2:]
            if face_normal(f) @ inward < -0.05 and abs(face_normal(f) @ self.left) < 1 - 1e-9
        ]


@pytest.mark.parametrize(("kind", "side", "ends"), ALL)
def test_solids_are_closed_planar_and_as_large_as_they_say(kind, side, ends):
    shell, found, _ = made(kind, side, ends)
    assert [beam.edge for beam in found] == list(range(len(shell.edges)))
    assert all(is_closed(beam.solid) for beam in found)
    assert solid_planarity([beam.solid for beam in found]).max() <= 1e-9
    for beam in found:
        volume = as_manifold(beam.solid).volume()
        assert beam.volume == pytest.approx(volume, rel=1e-12)
        assert beam.volume > 0
        assert beam.mass == pytest.approx(volume * 1e-9 * 7850, rel=1e-12)


@pytest.mark.parametrize(("kind", "side", "ends"), ALL)
def test_the_middle_plane_holds_both_node_axes_and_width_and_height_are_exact(kind, side, ends):
    shell, found, _ = made(kind, side, ends)
    for beam in found:
        bar = Bar(shell, beam, side)
        sides = [f for f in bar.faces[2:] if abs(face_normal(f) @ bar.left) > 1 - 1e-9]
        assert len(sides) == 2
        for face in sides:
            normal = face_normal(face)
            for m, s in zip(bar.m, bar.s, strict=True):
                assert np.degrees(np.arcsin(abs(normal @ unit(s)))) <= 1e-9
                np.testing.assert_allclose((face - m) @ normal, WIDTH / 2, atol=1e-9)
        normal = face_normal(bar.faces[0])
        np.testing.assert_allclose(abs(normal @ bar.up), 1.0, atol=1e-12)
        np.testing.assert_allclose((bar.bottom - bar.top[0]) @ bar.down, HEIGHT, atol=1e-9)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("kind", KINDS)
def test_top_lines_are_the_edges_of_one_parallel_mesh(kind, side):
    shell, found, panel = made(kind, side)
    drop = beam_drop(shell, BeamSpec(WIDTH, HEIGHT), panel)
    assert drop > 0
    moved = shell.with_heights(shell.heights + downward(side) * drop * shell.gauss_heights)
    for beam in found:
        bar = Bar(shell, beam, side)
        tips = moved.mesh.vertices[list(bar.nodes)]
        middle = (bar.top @ bar.left).mean() - bar.m[0] @ bar.left
        assert abs((tips - bar.m[0]) @ bar.left).max() < 1e-9
        assert abs(middle) < WIDTH
        np.testing.assert_allclose((bar.top - tips[0]) @ bar.down, 0.0, atol=1e-9)
        assert beam.length == pytest.approx(np.linalg.norm(tips[1] - tips[0]), abs=1e-9)


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("kind", KINDS)
def test_mitred_bars_share_their_end_planes_and_meet_in_the_axis(kind, closed):
    """Every end plane holds the node axis and is the end plane of a neighbour too."""
    shell, found, _ = made(kind, closed=closed)
    planes = {}
    three = 0
    for beam in found:
        bar = Bar(shell, beam, "outside")
        for end in (0, 1):
            axis = unit(bar.s[end])
            faces = bar.ends(end)
            for face in faces:
                normal = face_normal(face)
                np.testing.assert_allclose((face - bar.m[end]) @ normal, 0, atol=1e-9)
                assert abs(normal @ axis) <= 1e-11
                planes.setdefault(bar.nodes[end], []).append((beam.mark, normal))
            if len(faces) == 2:
                three += 1
                on_axis = np.cross(bar.vertices - bar.m[end], axis)
                assert np.sum(np.linalg.norm(on_axis, axis=1) < 1e-9) == 2
    assert three > 100
    for met in planes.values():
        for mark, normal in met:
            back = [np.linalg.norm(normal + n) for other, n in met if other != mark]
            assert min(back) <= 1e-9


@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("kind", ["face", "vertex"])
def test_nothing_overlaps(kind, side, ends):
    shell, found, panel = made(kind, side, ends)
    plates = panels(shell, panel)
    worst, looked = largest_overlap([as_manifold(part.solid) for part in (*plates, *found)])
    assert looked > 2 * len(found)
    assert worst <= 1e-6 * min(part.volume for part in (*plates, *found))


def test_nothing_overlaps_when_panels_have_no_gap():
    shell, found, _ = made("edge")
    plates = panels(shell, PanelSpec(8.0, 0.0, edges="mitred"))
    worst, _ = largest_overlap([as_manifold(part.solid) for part in (*plates, *found)])
    assert worst <= 1e-6 * min(part.volume for part in (*plates, *found))


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("kind", KINDS)
def test_the_drop_is_the_least_that_keeps_bars_below_panels(kind, side):
    """Some bar's top corner just touches an underside plane, and none passes one."""
    shell, found, _ = made(kind, side)
    under = {"outside": 0.0, "inside": 0.0, "centre": 4.0}[side]
    highest = []
    for beam in found:
        bar = Bar(shell, beam, side)
        for p, lateral in zip(bar.sides, (1, -1), strict=True):
            if p < 0:
                continue
            normal = -downward(side) * shell.normals[shell.panels[p]]
            own = bar.top[lateral * ((bar.top - bar.m[0]) @ bar.left) > -1e-9]
            highest.append(((own - bar.m[0]) @ normal).max() + under)
    assert max(highest) == pytest.approx(0.0, abs=1e-9)


def test_a_seat_is_kept_at_every_bar():
    """Measured across the top, from each corner and the middle up to the panel's plane."""
    shell, found, _ = made("vertex", seat=5.0)
    free = []
    for beam in found:
        bar = Bar(shell, beam, "outside")
        height = (bar.top[0] - bar.m[0]) @ bar.up
        for p, lateral in zip(bar.sides, (1, -1), strict=True):
            if p >= 0:
                normal = shell.normals[shell.panels[p]]
                corner = -lateral * WIDTH / 2 * (normal @ bar.left) / (normal @ bar.up)
                free.append(min(corner, 0.0) - height)
    assert min(free) == pytest.approx(5.0, abs=1e-9)


@pytest.mark.parametrize("closed", [True, False])
def test_mitres_and_slopes_are_the_angles_of_the_solid(closed):
    """Against each end face's own normal; positive where the side is shorter than the middle."""
    shell, found, _ = made("edge", closed=closed)
    faces = 0
    for beam in found:
        bar = Bar(shell, beam, "outside")
        for end in (0, 1):
            axis = unit(bar.s[end])
            square = unit(np.cross(axis, bar.left))  # normal of a cut square to the middle plane
            inward = bar.along if end == 0 else -bar.along
            square *= np.sign(square @ inward)
            for face in bar.ends(end):
                normal = face_normal(face)
                angle = np.degrees(np.arccos(np.clip(-normal @ square, -1, 1)))
                lateral = (face - bar.m[end]) @ bar.left
                for which, sign in ((0, 1), (1, -1)):
                    if (sign * lateral).max() < 1e-6:
                        continue
                    faces += 1
                    tip = face[np.argmax(sign * lateral)]
                    step = tip - bar.m[end]
                    flat = step - (step @ axis) * axis
                    recessed = flat @ square
                    assert beam.mitres[end][which] == pytest.approx(
                        np.sign(recessed) * angle, abs=2e-6
                    )
            lean = np.degrees(np.arccos(np.clip(axis @ bar.up, -1, 1)))
            assert abs(beam.slopes[end]) == pytest.approx(lean, abs=2e-6)
            # A slope is positive where the axis leads outward on the way down.
            assert np.sign(beam.slopes[end]) == np.sign(axis @ inward)
    assert faces == 4 * len(found)


def test_mitres_around_a_node_complete_each_other():
    """At every node the half angles add up to a full turn: 90° − mitre, twice per bar, 360°."""
    shell, found, _ = made("face")
    total = {}
    for beam in found:
        for mark, pair in zip(beam.nodes, beam.mitres, strict=True):
            total[mark] = total.get(mark, 0.0) + sum(90.0 - angle for angle in pair)
    assert len(total) == len(shell.mesh.vertices)
    np.testing.assert_allclose(list(total.values()), 360.0, atol=1e-9)


@pytest.mark.parametrize(("kind", "side", "ends"), ALL)
def test_the_flat_pattern_is_the_silhouette_of_the_solid(kind, side, ends):
    shell, found, _ = made(kind, side, ends)
    for beam in found:
        bar = Bar(shell, beam, side)
        flat = np.column_stack([bar.vertices @ bar.along, -bar.vertices @ bar.down])
        hull = MultiPoint(flat - flat.min(axis=0)).convex_hull
        outline = Polygon(beam.flat.outline)
        assert outline.is_valid
        assert outline.exterior.is_ccw
        assert outline.symmetric_difference(hull).area < 1e-6
        assert shapely.hausdorff_distance(outline, hull) < 1e-9
        np.testing.assert_allclose(np.ptp(beam.flat.outline[:, 1]), HEIGHT, atol=1e-9)
        assert beam.flat.thickness == WIDTH
        np.testing.assert_array_equal(beam.flat.blank, beam.flat.outline)
        assert [note.neighbour for note in beam.flat.edges] == [
            "",
            beam.nodes[1],
            "",
            beam.nodes[0],
        ]


@pytest.mark.parametrize("side", SIDES)
def test_end_bevels_belong_to_the_side_that_faces_the_viewer(side):
    """x runs along the bar and y up to the panels, so the viewer stands on x × y."""
    shell, found, _ = made("face", side)
    for beam in found:
        bar = Bar(shell, beam, side)
        towards = np.cross(bar.along, -bar.down)
        for end, note in ((0, beam.flat.edges[3]), (1, beam.flat.edges[1])):
            inward = bar.along if end == 0 else -bar.along
            top = bar.top[np.abs((bar.top - bar.m[end]) @ bar.along) < beam.length / 2]
            seen = top[np.argmax(top @ towards)]
            axis = unit(bar.s[end])
            step = seen - bar.m[end]
            flat = step - (step @ axis) * axis
            # Recessed on the viewer's side: the part is larger away from the drawing.
            recess = (flat @ inward) / np.sqrt(1 - (axis @ inward) ** 2)
            assert np.tan(np.radians(note.bevel)) == pytest.approx(recess / (WIDTH / 2), abs=1e-9)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("radius", [5.0, 40.0])
def test_hub_ends_are_square_and_clear_of_hub_and_neighbours(side, radius):
    shell, found, _ = made("vertex", side, "hub", hub_radius=radius, hub_clearance=2.0)
    nearest = []
    for beam in found:
        bar = Bar(shell, beam, side)
        assert beam.mitres == ((0.0, 0.0), (0.0, 0.0))
        for end in (0, 1):
            (face,) = bar.ends(end)
            axis = unit(bar.s[end])
            normal = face_normal(face)
            assert abs(normal @ axis) < 1e-11
            assert abs(normal @ bar.left) < 1e-11
            distance = (bar.m[end] - face) @ normal
            assert np.ptp(distance) < 1e-9
            nearest.append(distance[0])
    assert min(nearest) >= radius + 2.0 - 1e-9
    # A large hub alone decides; a small one leaves it to the sharp corners between bars.
    assert (max(nearest) > radius + 2.0 + 1e-6) == (radius < 10)


@pytest.mark.parametrize("closed", [True, False])
def test_neighbours_are_those_of_the_mesh(closed):
    shell, found, _ = made("face", closed=closed)
    assert [beam.mark for beam in found] == list(beam_marks(shell))
    names, points, plates = beam_marks(shell), node_marks(shell), panel_marks(shell)
    for beam, (i, j, left, right) in zip(found, shell.edges.tolist(), strict=True):
        assert beam.nodes == (points[i], points[j])
        ends = {i, j}
        carried = {plates[f] for f in (left, right) if f >= 0}
        met = {
            names[e]
            for e, other in enumerate(shell.edges[:, :2].tolist())
            if e != beam.edge and ends & set(other)
        }
        assert set(beam.neighbours) == carried | met
        assert len(beam.neighbours) == len(carried) + len(met)
        for f in (left, right):
            if f >= 0:
                assert ends <= set(shell.mesh.face(f).tolist())


def test_a_border_node_of_two_bars_has_one_end_face_each():
    shell, found, _ = made("face")
    valence = np.bincount(shell.edges[:, :2].ravel())
    assert {2, 3} == set(valence)
    for beam in found:
        corners = [2 if valence[v] == 2 else 3 for v in shell.edges[beam.edge, :2]]
        assert len(beam.solid.vertices) == 2 * sum(corners)


@pytest.mark.parametrize(
    ("spec", "reason"),
    [
        (BeamSpec(width=600.0), "for 600 mm wide bars; choose narrower"),
        (BeamSpec(ends="hub", hub_radius=400.0), "for hubs of radius 400 mm; choose smaller hubs"),
        (BeamSpec(height=5000.0), "at the bottom 5000 mm below"),
    ],
)
def test_bars_whose_ends_cross_are_refused_by_name(spec, reason):
    with pytest.raises(PartError, match=r"beam B\d{3} is too short") as error:
        beams(sample("face"), spec, PanelSpec())
    assert reason in str(error.value)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"width": 0}, "beam width is 0 mm"),
        ({"height": float("inf")}, "beam height is inf"),
        ({"seat": -1}, "beam seat is -1 mm"),
        ({"ends": "welded"}, "ends is 'welded'; choose one of mitred, hub"),
    ],
)
def test_wrong_specifications_are_refused(wrong, message):
    with pytest.raises(DesignError, match=message):
        BeamSpec(**wrong)

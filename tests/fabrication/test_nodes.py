"""Hubs: on the node axis, as deep as their bars, touching neither bars nor panels."""

import math

import numpy as np
import pytest
from parts_samples import KINDS, as_manifold, largest_overlap, sample, unit

from phexfab.errors import DesignError, PartError
from phexfab.fabrication.bars import BeamSpec, beam_drop
from phexfab.fabrication.beams import beams
from phexfab.fabrication.marks import marks, node_marks
from phexfab.fabrication.nodes import NodeSpec, nodes
from phexfab.fabrication.panels import SIDES, PanelSpec, panels
from phexfab.fabrication.parts import Solid
from phexfab.fabrication.polyhedra import prism_faces

HUB = NodeSpec("hub", 30.0)
BARS = BeamSpec(ends="hub", hub_radius=30.0, hub_clearance=1.0)


def made(kind, side, closed=True, bars=BARS):
    shell, panel = sample(kind, closed), PanelSpec(8.0, 6.0, side)
    return shell, nodes(shell, HUB, bars, panel), panel


def around(cylinder, n=48):
    """A prism around the cylinder, so that nothing of the cylinder is missed."""
    x = unit(np.cross(cylinder.axis, np.eye(3)[np.argmin(np.abs(cylinder.axis))]))
    y = np.cross(cylinder.axis, x)
    turn = 2 * np.pi * np.arange(n) / n
    rim = np.outer(np.cos(turn), x) + np.outer(np.sin(turn), y)
    base = cylinder.base + rim * cylinder.radius / np.cos(np.pi / n)
    return Solid(np.vstack([base, base + cylinder.length * cylinder.axis]), prism_faces(n))


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("kind", KINDS)
def test_hubs_stand_on_their_axes(kind, side):
    shell, found, _ = made(kind, side)
    assert [node.mark for node in found] == list(node_marks(shell))
    for node in found:
        m, s = shell.mesh.vertices[node.vertex], shell.gauss.vertices[node.vertex]
        cylinder = node.cylinder
        towards_panels = -1.0 if side == "inside" else 1.0
        np.testing.assert_allclose(cylinder.axis, towards_panels * unit(s), atol=1e-14)
        assert np.linalg.norm(np.cross(cylinder.base - m, cylinder.axis)) < 1e-9
        assert node.volume == pytest.approx(math.pi * 900.0 * cylinder.length, rel=1e-14)
        assert node.mass == pytest.approx(node.volume * 7850e-9, rel=1e-14)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("radius", [0.5, 30.0])
def test_hubs_reach_from_the_bars_bottoms_to_the_panels(kind, side, radius):
    """A wide hub is stopped by the panels above its rim, a slender one ends at the bars' tops."""
    shell, panel = sample(kind), PanelSpec(8.0, 6.0, side)
    found = nodes(shell, NodeSpec("hub", radius), BARS, panel)
    bars = beams(shell, BARS, panel)
    by_mark = {bar.mark: bar for bar in bars}
    drop = beam_drop(shell, BARS, panel)
    under = 4.0 if side == "centre" else 0.0
    side_of_panels = -1.0 if side == "inside" else 1.0
    by_the_rim = 0
    for node in found:
        m, s = shell.mesh.vertices[node.vertex], shell.gauss.vertices[node.vertex]
        axis, base, length = node.cylinder.axis, node.cylinder.base, node.cylinder.length
        deepest = np.inf
        for mark in node.neighbours:
            vertices = by_mark[mark].solid.vertices
            near = np.linalg.norm(vertices - m, axis=1) < 150.0
            assert near.sum() >= 4
            deepest = min(deepest, ((vertices[near] - m) @ axis).min())
        assert (base - m) @ axis == pytest.approx(deepest, abs=1e-9)
        top = (base - m) @ axis + length
        # Room left above: to the bars' tops, and from the rim's highest point to each panel.
        room = [-drop * np.linalg.norm(s) - top]
        for f in range(shell.mesh.n_faces):
            if node.vertex in shell.mesh.face(f):
                normal = side_of_panels * shell.normals[shell.panels[f]]
                rim = top * axis + radius * unit(normal - (normal @ axis) * axis)
                room.append(-under - rim @ normal)
        assert min(room) == pytest.approx(0.0, abs=1e-9)
        by_the_rim += int(np.argmin(room) > 0)
    assert by_the_rim == (len(found) if radius == 30.0 else 0)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("kind", ["face", "edge"])
def test_hubs_touch_nothing(kind, side):
    shell, found, panel = made(kind, side)
    solids = [part.solid for part in (*panels(shell, panel), *beams(shell, BARS, panel))]
    hubs = [around(node.cylinder) for node in found]
    worst, looked = largest_overlap([as_manifold(solid) for solid in solids + hubs])
    assert looked > len(found)
    assert worst <= 1e-3  # mm³, of hubs some 250,000 mm³


def test_a_hub_knows_its_bars():
    shell, found, _ = made("face", "outside", closed=False)
    names = [bar.mark for bar in beams(shell, BARS, PanelSpec(8.0, 6.0))]
    for node in found:
        expected = {
            names[e] for e, edge in enumerate(shell.edges[:, :2].tolist()) if node.vertex in edge
        }
        assert set(node.neighbours) == expected
        assert len(node.neighbours) == len(expected) in (2, 3)


def test_no_hubs_unless_asked_for():
    assert nodes(sample("face"), NodeSpec(), BeamSpec(), PanelSpec()) == ()


def test_bars_must_leave_room_for_the_hub():
    shell = sample("face")
    with pytest.raises(DesignError, match="ends = mitred"):
        nodes(shell, HUB, BeamSpec(), PanelSpec())
    with pytest.raises(DesignError, match="hub radius 20 mm"):
        nodes(shell, HUB, BeamSpec(ends="hub", hub_radius=20.0), PanelSpec())


def test_hubs_that_touch_are_refused_by_name():
    shell = sample("face")
    wide = BeamSpec(ends="hub", hub_radius=400.0)
    with pytest.raises(PartError, match=r"hubs N\d{3} and N\d{3} touch"):
        nodes(shell, NodeSpec("hub", 400.0), wide, PanelSpec())


def test_hubs_so_long_that_they_cross_are_refused():
    tall = BeamSpec(height=9000.0, ends="hub", hub_radius=10.0)
    with pytest.raises(PartError, match=r"touch: their axes come within 0\.0 mm"):
        nodes(sample("face"), NodeSpec("hub", 10.0), tall, PanelSpec())


def test_the_advice_on_touching_hubs_is_the_limit():
    shell = sample("face")

    def attempt(radius):
        spec = BeamSpec(ends="hub", hub_radius=radius, hub_clearance=0.0)
        return nodes(shell, NodeSpec("hub", radius), spec, PanelSpec())

    # The extent of hubs depends a little on their radius, so close in on the limit.
    low, high = 30.0, 400.0
    for _ in range(30):
        middle = (low + high) / 2
        try:
            attempt(middle)
            low = middle
        except PartError:
            high = middle
    found = attempt(low)
    nearest = np.inf
    for i, j in shell.edges[:, :2]:
        a, b = found[i].cylinder, found[j].cylinder
        t = np.linspace(0, 1, 200)[:, None]
        p, q = a.base + t * a.length * a.axis, b.base + t * b.length * b.axis
        nearest = min(nearest, np.linalg.norm(p[:, None] - q[None], axis=2).min())
    assert nearest == pytest.approx(2 * low, rel=1e-3)


def test_a_hub_without_length_is_refused():
    with pytest.raises(PartError, match=r"hub N\d{3} has no length left"):
        nodes(
            sample("face"),
            NodeSpec("hub", 100.0),
            BeamSpec(height=2.0, ends="hub", hub_radius=100.0),
            PanelSpec(),
        )


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"kind": "ball"}, "node kind is 'ball'; choose one of none, hub"),
        ({"radius": 0}, "node radius is 0 mm"),
    ],
)
def test_wrong_specifications_are_refused(wrong, message):
    with pytest.raises(DesignError, match=message):
        NodeSpec(**wrong)


def test_marks_sort_like_numbers():
    assert marks("P", 2) == ("P001", "P002")
    assert marks("B", 1234)[8] == "B0009"
    for count in (9, 100, 1234):
        assert list(marks("N", count)) == sorted(marks("N", count))
        assert len(set(marks("N", count))) == count

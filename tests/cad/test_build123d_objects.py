"""phexfab in build123d: objects, placement, builders, joints, places, round trips, the page."""

import math

import build123d as b3d
import numpy as np
import pytest
from cad_builds import code_blocks, parts_by_family, run_block, small_build
from xcaf_reader import read_leaves

from phexfab.build123d import PhexPart, PhexShell, locations, phex_build
from phexfab.cad.brep import is_valid, volume
from phexfab.cad.tags import face_tags, frames
from phexfab.errors import DesignError, PartError
from phexfab.fabrication.parts import FAMILY_COLOURS

CENTER = (b3d.Align.CENTER,) * 3


@pytest.fixture(scope="module")
def build():
    return small_build("hubs")


@pytest.fixture(scope="module")
def shell(build):
    return PhexShell(build)


def all_parts(build):
    return [(f, part) for f, own in parts_by_family(build).items() for part in own]


def assert_placed(placed, build, move):
    """Every part of a shell stands where ``move`` takes its exact centre of gravity."""
    unmoved = PhexShell(build)
    for _, part in all_parts(build):
        before, after = unmoved.part(part.mark).center(), placed.part(part.mark).center()
        assert tuple(after) == pytest.approx(move(np.array(tuple(before))), abs=1e-6)
    whole = placed.bounding_box(optimal=False)
    own = [placed.part(p.mark).bounding_box(optimal=False) for _, p in all_parts(build)]
    assert tuple(whole.max) == pytest.approx(np.max([tuple(b.max) for b in own], axis=0), abs=1e-3)


def corners(shape):
    box = shape.bounding_box()
    return tuple(box.min), tuple(box.max)


def test_the_tree_as_a_viewer_walks_it(build, shell):
    """Labels, colours and children, from the root to every part, as ocp_vscode shows them."""
    assert isinstance(shell, b3d.BasePartObject) and isinstance(shell, b3d.Part)
    assert shell.label == build.design.name
    walked = []

    def walk(node, path):
        if node.children:
            for child in node.children:
                assert child.parent is node
                walk(child, (*path, node.label))
        else:
            walked.append((path, node.label, tuple(node.color)[:3], node.volume))

    walk(shell, ())
    exact = all_parts(build)
    assert len(walked) == len(exact)
    for (path, label, colour, size), (family, part) in zip(walked, exact, strict=True):
        assert (path, label) == ((shell.label, family), part.mark)
        assert colour == pytest.approx(FAMILY_COLOURS[family], abs=1e-3)
        assert size == pytest.approx(part.volume, rel=1e-9)
    assert shell.volume == pytest.approx(sum(part.volume for _, part in exact), rel=1e-9)


def test_algebra_moves_the_tree_as_a_whole(build, shell):
    placed = b3d.Pos(100, -200, 5000) * b3d.Rot(0, 0, 90) * shell
    assert type(placed) is PhexShell and len(placed.joints) == len(shell.joints)

    def move(p):
        return np.array([100 - p[1], -200 + p[0], 5000 + p[2]])

    assert_placed(placed, build, move)
    for mark, joint in shell.joints.items():
        before, after = joint.location.position, placed.joints[mark].location.position
        assert tuple(after) == pytest.approx(move(np.array(tuple(before))), abs=1e-6)
        assert placed.joints[mark].parent is placed
    assert_placed(shell, build, lambda p: p)  # the original stays


def test_rotation_and_align(build):
    turned = PhexShell(build, rotation=(0, 0, 90))
    assert_placed(turned, build, lambda p: np.array([-p[1], p[0], p[2]]))
    low = PhexShell(build, align=(b3d.Align.MIN, b3d.Align.CENTER, b3d.Align.MAX))
    first, last = corners(low)
    assert (first[0], first[1] + last[1], last[2]) == pytest.approx((0, 0, 0), abs=1e-3)
    offset = np.array(tuple(low.part("P001").center() - PhexShell(build).part("P001").center()))
    assert_placed(low, build, lambda p: p + offset)
    first, last = corners(PhexShell(build, rotation=(0, 0, 90), align=b3d.Align.MIN))
    assert (last[0], first[1], first[2]) == pytest.approx((0, 0, 0), abs=1e-3)


def test_chosen_parts(build):
    some = PhexShell(build, ["P001", "nodes"])
    assert [leaf.label for leaf in some.leaves] == ["P001", *(n.mark for n in build.parts.nodes)]
    with pytest.raises(PartError, match="no part 'P9'"):
        PhexShell(build, "P9")
    with pytest.raises(PartError, match="no part 'P002' in small hubs"):
        some.part("P002")
    bare = PhexShell(build.parts)
    assert bare.label == "shell" and bare.joints == {}


def test_joints_stand_at_the_nodes(build, shell):
    exact = {frame.mark: frame for frame in frames(build)}
    assert set(shell.joints) == set(exact)
    for mark, joint in shell.joints.items():
        assert type(joint) is b3d.RigidJoint and joint.label == mark
        plane = b3d.Plane(joint.location)
        assert tuple(plane.origin) == pytest.approx(tuple(exact[mark].origin), abs=1e-9)
        assert tuple(plane.z_dir) == pytest.approx(tuple(exact[mark].z), abs=1e-9)
        assert tuple(plane.x_dir) == pytest.approx(tuple(exact[mark].x), abs=1e-9)


def test_a_part_connects_to_a_node(build):
    shell = b3d.Pos(0, 0, 1000) * PhexShell(build, "nodes")
    post = b3d.Cylinder(20, 500, align=(b3d.Align.CENTER, b3d.Align.CENTER, b3d.Align.MAX))
    shell.joints["N003"].connect_to(b3d.RigidJoint("head", post, b3d.Location()))
    frame = frames(build, "N003")[0]
    foot = frame.origin - 250 * frame.z + [0, 0, 1000]
    assert tuple(post.center()) == pytest.approx(tuple(foot), abs=1e-6)


def test_faces_by_tag(build):
    shell = b3d.Pos(0, 0, 300) * PhexShell(build)
    below = build.design.panels.side != "inside"
    for part in (*build.parts.panels[:3], *build.parts.beams[:3]):
        for face, tags in zip(part.solid.faces, face_tags(part, below), strict=True):
            middle = part.solid.vertices[list(face)].mean(axis=0) + np.array([0, 0, 300])
            for tag in tags:
                found = shell.tagged(part.mark, tag)
                same = shell.tagged(part.mark, tag.replace("_", "-"))
                pairs = zip(same, found, strict=True)
                assert all((one.center() - two.center()).length < 1e-9 for one, two in pairs)
                centres = [np.mean([tuple(v) for v in f.vertices()], axis=0) for f in found]
                assert min(np.linalg.norm(c - middle) for c in centres) < 1e-6
    (side,) = shell.tagged("N001", "side")
    assert side.geom_type == b3d.GeomType.CYLINDER


def test_a_single_part_at_the_origin(build, shell):
    for _, part in all_parts(build)[::5]:
        made = PhexPart(build, part.mark)
        assert made.label == part.mark and made.metadata["mass"] == part.mass
        assert made.volume == pytest.approx(part.volume, rel=1e-9)
        assert made.color is not None
        back = made.place * made
        assert type(back) is PhexPart
        assert (back.center() - shell.part(part.mark).center()).length < 1e-6
        for mark, joint in back.joints.items():
            away = joint.location.position - shell.joints[mark].location.position
            assert away.length < 1e-6
    panel = PhexPart(build, "P002")
    (top,) = panel.tagged("top")
    assert tuple(top.normal_at()) == pytest.approx((0, 0, 1), abs=1e-9)
    assert tuple(top.center())[2] == pytest.approx(0, abs=1e-9)
    assert len(panel.joints) == len(build.parts.panels[1].flat.outline)
    beam = PhexPart(build, "B005")
    assert tuple(beam.joints) == build.parts.beams[4].nodes
    width = np.ptp(corners(beam), axis=0)[1]
    assert width == pytest.approx(build.design.beams.width, abs=1e-3)
    first, second = (joint.location.position.X for joint in beam.joints.values())
    assert first < 0 < second
    turned = PhexPart(build, "B005", rotation=(0, 90, 0), align=CENTER)
    assert turned.bounding_box().center().length < 1e-3
    with pytest.raises(PartError, match="no part 'X1'"):
        PhexPart(build, "X1")


def test_builders_take_parts_up(build):
    panel = next(p for p in build.parts.panels if p.mark == "P002")
    with b3d.BuildPart() as drilled:
        with b3d.Locations((0, 0, 500), (2000, 0, 500)):
            PhexPart(build, "P002")
        with b3d.Locations((2000, 0, 500)):
            b3d.Cylinder(6, 100, mode=b3d.Mode.SUBTRACT)
    hole = math.pi * 36 * build.design.panels.thickness
    assert len(drilled.part.solids()) == 2
    assert drilled.part.volume == pytest.approx(2 * panel.volume - hole, rel=1e-9)


def test_builders_take_a_shell_up_and_leave_its_tree(build):
    total = sum(part.volume for part in build.parts.panels)
    with b3d.BuildPart() as cover, b3d.Locations((0, 0, 700)):
        shell = PhexShell(build, "panels")
    assert cover.part.volume == pytest.approx(total, rel=1e-9)
    assert len(cover.part.solids()) == len(build.parts.panels)
    assert corners(cover.part)[0] == pytest.approx(corners(shell)[0], abs=1e-3)
    rise = shell.part("P001").center() - PhexShell(build, "P001").part("P001").center()
    assert tuple(rise) == pytest.approx((0, 0, 700), abs=1e-6)
    with b3d.BuildPart() as private:
        b3d.Box(1, 1, 1)
        PhexShell(build, "panels", mode=b3d.Mode.PRIVATE)
    assert private.part.volume == pytest.approx(1)
    with b3d.BuildPart() as cut:
        b3d.Box(9000, 9000, 9000)
        PhexShell(build, "panels", mode=b3d.Mode.SUBTRACT)
    assert cut.part.volume == pytest.approx(9000.0**3 - total, rel=1e-12)
    with pytest.raises(RuntimeError), b3d.BuildSketch():
        PhexShell(build)


def test_places_for_ones_own_parts(build):
    for family in ("nodes", "panels", "beams"):
        found = locations(build, family)
        for frame in frames(build, family):
            box = found[frame.mark] * b3d.Box(10, 20, 30, align=(b3d.Align.MIN,) * 3)
            centre = frame.origin + 5 * frame.x + 10 * np.cross(frame.z, frame.x) + 15 * frame.z
            assert tuple(box.center()) == pytest.approx(tuple(centre), abs=1e-6)


def test_a_face_is_covered_and_wrong_things_are_refused():
    heights = [[0, 300, 0], [-300, 0, -300], [0, 300, 0]]
    grid = [[(1000 * i, 1000 * j, z) for j, z in enumerate(row)] for i, row in enumerate(heights)]
    face = b3d.Face.make_surface_from_array_of_points([[b3d.Vector(*p) for p in r] for r in grid])
    build = phex_build(face, 450, panels={"thickness": 6})
    assert build.design.mesh.method == "dupin" and len(build.parts.panels) > 5
    for panel in PhexShell(build, "panels").solids():
        assert panel.distance_to(face) < 450 / 8
    with pytest.raises(DesignError, match="there are 6 faces"):
        phex_build(b3d.Box(1, 1, 1), 5)
    with pytest.raises(DesignError, match="the face is flat"):
        phex_build(b3d.Rectangle(10, 10), 5)
    with pytest.raises(DesignError, match="str holds no shape"):
        phex_build("rim.csv", 5)


@pytest.mark.parametrize("name", ["mitred", "hubs"])
def test_the_tree_survives_step(name, tmp_path):
    """Labels, hierarchy, colours and volumes of all parts, moved, read by XCAF."""
    build = small_build(name)
    shell = b3d.Pos(0, 0, 1000) * PhexShell(build, rotation=(0, 0, 30))
    b3d.export_step(shell, tmp_path / "a.step")
    _, leaves = read_leaves(tmp_path / "a.step")
    exact = all_parts(build)
    assert len(leaves) == len(exact)
    for leaf, (family, part) in zip(leaves, exact, strict=True):
        assert (leaf.part, leaf.instance) == (part.mark, part.mark)
        assert leaf.path[-2:] == (build.design.name, family)
        assert leaf.colour == pytest.approx(FAMILY_COLOURS[family], abs=2e-3)
        assert volume(leaf.shape) == pytest.approx(part.volume, rel=1e-9)
        assert is_valid(leaf.shape)
    again = {leaf.label: leaf for leaf in b3d.import_step(tmp_path / "a.step").leaves}
    for family, part in exact:
        leaf = again[part.mark]
        assert leaf.volume == pytest.approx(part.volume, rel=1e-9)
        assert tuple(leaf.color)[:3] == pytest.approx(FAMILY_COLOURS[family], abs=2e-3)
        place = b3d.Solid(leaf.wrapped).moved(leaf.parent.global_location)
        assert (place.center() - shell.part(part.mark).center()).length < 1e-4


def test_the_quickstart_runs_as_printed_in_ten_lines(tmp_path, monkeypatch):
    first = code_blocks("build123d.md")[0]
    assert len([line for line in first.splitlines() if line.strip()]) <= 10
    names = run_block(first, tmp_path, monkeypatch)
    assert names["build"].ok
    assert len(read_leaves(tmp_path / "canopy.step")[1]) == len(all_parts(names["build"]))

"""phexfab in CadQuery: methods, tags, selectors, places, round trips, notebooks, the page."""

import itertools
import math

import cadquery as cq
import numpy as np
import pytest
from cad_builds import code_blocks, parts_by_family, run_block, small_build
from xcaf_reader import read_leaves

import phexfab.cadquery as door
from phexfab.cad.brep import is_valid, volume
from phexfab.cad.tags import face_tags, frames
from phexfab.cadquery import Family, Mark, Tag
from phexfab.errors import DesignError, PartError, PhexError, SurfaceError
from phexfab.fabrication.parts import FAMILY_COLOURS


@pytest.fixture(scope="module")
def build():
    return small_build("mitred")


@pytest.fixture(scope="module")
def hubs():
    return small_build("hubs")


@pytest.fixture(scope="module")
def parts(build):
    return cq.Workplane().phexParts(build)


def normal_and_centre(part, tag, below):
    """Of the one face with a tag, from the arrays."""
    for face, tags in zip(part.solid.faces, face_tags(part, below), strict=True):
        if tag in tags:
            corners = part.solid.vertices[list(face)]
            turned = np.roll(corners, -1, axis=0) - corners[0]
            area = np.cross(corners - corners[0], turned).sum(0)
            return area / np.linalg.norm(area), corners


def test_only_new_names_are_added(monkeypatch):
    door._install()  # a second time changes nothing
    assert cq.Workplane.phexParts is door.phexParts and cq.Assembly.phexAdd is door.phexAdd
    monkeypatch.setattr(cq.Workplane, "phexShell", math.sqrt)
    with pytest.raises(PhexError, match="already comes from math"):
        door._install()
    assert cq.Workplane.phexShell is math.sqrt
    for name in [n for n in dir(door) if n.startswith("phex")]:
        assert getattr(door, name).__doc__


def test_all_parts_are_on_the_stack_and_tagged(build, parts):
    families = parts_by_family(build)
    marks = [part.mark for own in families.values() for part in own]
    assert [solid.label for solid in parts.vals()] == marks
    for family, own in families.items():
        if own:
            tagged = parts.solids(tag=family)
            assert tagged.size() == len(own)
        for part in own:
            (solid,) = parts.solids(tag=part.mark).vals()
            assert solid.Volume() == pytest.approx(part.volume, rel=1e-9)


@pytest.mark.parametrize("name", ["mitred", "hubs"])
def test_every_tagged_face_is_the_one_that_the_arrays_say(name):
    """All faces of all parts, in the assembly: its plane's normal, and each corner."""
    build = small_build(name)
    below = build.design.panels.side != "inside"
    assembly = build.to_cadquery()
    for part in (*build.parts.panels, *build.parts.beams):
        family = "panels" if part.mark[0] == "P" else "beams"
        held = assembly.objects[f"{family}/{part.mark}"].obj
        names = {tag for tags in face_tags(part, below) for tag in tags}
        for tag in (n for n in names if not n.startswith(("end", "to_"))):
            normal, corners = normal_and_centre(part, tag, below)
            (face,) = held.faces(tag=tag).vals()
            (same,) = held.faces(tag=tag.replace("_", "-")).vals()
            assert face.isSame(same)
            assert face.normalAt().toTuple() == pytest.approx(tuple(normal), abs=1e-9)
            found = np.array([v.toTuple() for v in face.Vertices()])
            away = np.linalg.norm(found[:, None] - corners, axis=2)
            assert len(found) == len(corners) and away.min(axis=0).max() < 1e-6
        for edge in held.edges(tag="top_side_1" if family == "panels" else "top_left").vals():
            side = held.faces(tag="side_1" if family == "panels" else "left").val()
            top = held.faces(tag="top").val()
            for face in (side, top):
                assert any(edge.isSame(other) for other in face.Edges())
    for node in build.parts.nodes:
        held = assembly.objects[f"nodes/{node.mark}"].obj
        assert held.faces(tag="side").val().geomType() == "CYLINDER"
        top, bottom = (held.faces(tag=tag).val().Center() for tag in ("top", "bottom"))
        assert (top - bottom).toTuple() == pytest.approx(
            tuple(node.cylinder.axis * node.cylinder.length), abs=1e-6
        )
        assert held.edges(tag="top_side").val().geomType() == "CIRCLE"


def test_selectors_by_mark_family_and_tag(build, parts):
    panels, beams = build.parts.panels, build.parts.beams
    assert parts.solids(Family("panels")).size() == len(panels)
    two = parts.solids(Mark("P001", "B003")).vals()
    assert [s.Volume() for s in two] == pytest.approx([panels[0].volume, beams[2].volume])
    sides = parts.faces(Mark("P002")).size()
    assert sides == len(panels[1].solid.faces)
    assert parts.edges(Mark("P002")).size() == 3 * len(panels[1].flat.outline)
    tops = parts.faces(Family("panels") & Tag("top"))
    assert tops.size() == len(panels)
    assert parts.faces(Tag("top") - Family("panels")).size() == len(beams)
    assert parts.faces((Family("panels") & Tag("top")) - Mark("P001")).size() == len(panels) - 1
    assert parts.edges(Tag("bottom_left")).size() == len(beams)
    assert parts.faces(Tag("side-1")).size() == parts.faces(Tag("side_1")).size() == len(panels)
    assert parts.faces(tag="mitre-1").size() == parts.faces(tag="mitre_1").size() >= len(beams)
    assert parts.solids(Mark("P999")).size() == 0 and parts.solids(Tag("top")).size() == 0
    assert cq.Workplane().box(1, 1, 1).solids(Mark("P001")).size() == 0


def test_selectors_know_parts_that_were_moved_and_cut(build):
    stack = cq.Workplane().phexParts(build, ["P003", "P004"])
    moved = stack.newObject(
        [s.moved(cq.Location((0, 0, 900), (1, 1, 0), 40)) for s in stack.vals()]
    )
    assert moved.solids(Mark("P004")).size() == 1
    above = moved.faces(Mark("P004") & Tag("top")).val().Center()
    place = stack.faces(Mark("P004") & Tag("top")).val().Center()
    expected = cq.Vertex.makeVertex(*place.toTuple()).moved(cq.Location((0, 0, 900), (1, 1, 0), 40))
    assert (above - expected.Center()).Length < 1e-6

    panel = stack.solids(tag="P003").faces(Mark("P003") & Tag("top"))
    drilled = panel.workplane(centerOption="CenterOfMass").hole(12)
    (solid,) = drilled.solids(Mark("P003")).vals()
    thick = build.design.panels.thickness
    assert solid.Volume() == pytest.approx(build.parts.panels[2].volume - math.pi * 36 * thick)
    (top,) = drilled.faces(Tag("top")).vals()
    assert len(top.innerWires()) == 1
    wall = drilled.faces("%CYLINDER")
    assert wall.size() == 1 and wall.faces(Family("panels")).size() == 0


def test_the_stack_keeps_its_parts_known():
    """Nobody but the stack holds the build here."""
    import gc

    import phexfab

    stack = cq.Workplane().phexParts(
        phexfab.build(small_build("hubs").design.model_copy(update={"title": "another"}))
    )
    gc.collect()
    assert stack.solids(Mark("P001")).size() == 1


def test_copies_at_points(build):
    copies = cq.Workplane("XZ").pushPoints([(0, 0), (7000, 0)]).phexCopies(build, "beams")
    first, second = (shape.Center() for shape in copies.vals())
    assert (second - first).toTuple() == pytest.approx((7000, 0, 0), abs=1e-6)
    assert copies.val().Volume() == pytest.approx(sum(b.volume for b in build.parts.beams))
    assert copies.solids(Mark("B001")).size() == 2


@pytest.mark.parametrize("plane", ["XY", "XZ", "left"])
@pytest.mark.parametrize("family", ["nodes", "panels", "beams"])
def test_places_for_eachpoint(hubs, plane, family):
    """A pin 10 × 20 × 30 at every place: its corner at the origin, its edges along the axes."""
    pin = cq.Solid.makeBox(10, 20, 30)
    found = cq.Workplane(plane).phexLocations(hubs, family).eachpoint(pin, True).vals()
    exact = frames(hubs, family)
    assert len(found) == len(exact) > 5
    for box, frame in zip(found, exact, strict=True):
        y = np.cross(frame.z, frame.x)
        centre = frame.origin + 5 * frame.x + 10 * y + 15 * frame.z
        assert box.Center().toTuple() == pytest.approx(tuple(centre), abs=1e-6)
        for axis, length in ((frame.x, 10), (y, 20), (frame.z, 30)):
            along = [edge.tangentAt().dot(cq.Vector(*axis)) for edge in box.Edges()]
            own = [e for e, c in zip(box.Edges(), along, strict=True) if abs(abs(c) - 1) < 1e-9]
            assert [e.Length() for e in own] == pytest.approx([length] * 4)


def test_functions_for_invoke_do_the_same(build):
    by_method = cq.Workplane().phexParts(build, "P002").val()
    by_invoke = cq.Workplane().invoke(door.phex_parts(build, "P002")).val()
    assert by_method.wrapped.IsSame(by_invoke.wrapped)
    places = cq.Workplane().invoke(door.phex_locations(build, "panels"))
    assert places.size() == len(build.parts.panels)
    assert cq.Workplane().invoke(door.phex_copies(build, "panels")).size() == 1
    assert [type(place) for place in door.locations(build, "P001")] == [cq.Location]


def saddle():
    heights = [[0, 300, 0], [-300, 0, -300], [0, 300, 0]]
    grid = [
        [cq.Vector(1000 * i, 1000 * j, z) for j, z in enumerate(r)] for i, r in enumerate(heights)
    ]
    return cq.Workplane(cq.Face.makeSplineApprox(grid))


def test_a_face_on_the_stack_is_covered():
    face = saddle()
    stack = face.phexShell(450, panels={"thickness": 6, "material": "copper"})
    panels = stack.solids(Family("panels"))
    assert panels.size() > 5
    for solid in panels.vals():
        assert solid.distance(face.val()) < 450 / 8
    build = face.phexBuild(450, title="Saddle")
    assert build.design.mesh.method == "dupin" and build.design.offset.type == "face"
    assert len(build.parts.panels) == panels.size()


def test_what_is_on_the_stack_is_refused_with_a_remedy(build):
    box = cq.Workplane().box(10, 10, 10)
    with pytest.raises(DesignError, match="there are 6 faces; select one"):
        box.phexBuild(5)
    with pytest.raises(DesignError, match="the face is flat; select a curved face, or the wire"):
        box.faces(">Z").phexBuild(5)
    with pytest.raises(DesignError, match="holds no shape; give a closed wire"):
        cq.Workplane().phexBuild(5)
    with pytest.raises(DesignError, match="panel_size is missing"):
        saddle().phexBuild()
    with pytest.raises(DesignError, match="leave out panel_size, panels, or the design"):
        saddle().phexBuild(500, build.design, panels={"thickness": 5})
    with pytest.raises(DesignError, match=r"mesh\.method is missing"):
        saddle().phexBuild(design=build.design)
    with pytest.raises(DesignError, match=r"panels\.thick"):
        saddle().phexBuild(500, panels={"thick": 5})
    with pytest.raises((DesignError, SurfaceError), match=r"open|close"):
        cq.Workplane().polyline([(0, 0, 0), (1000, 0, 300), (1000, 1000, 0)]).phexBuild(200)
    with pytest.raises(PartError, match="no part 'P9'"):
        cq.Workplane().phexParts(build, "P9")
    with pytest.raises(PartError, match="Workplane holds no parts"):
        cq.Workplane().phexParts(box)


def test_an_assembly_within_an_assembly(build):
    site = cq.Assembly(name="site").add(cq.Workplane().box(9000, 9000, 10), name="slab")
    site.phexAdd(build, loc=cq.Location((0, 0, 3000))).phexAdd(build, ["P001"], name="spare")
    assert [child.name for child in site.children] == ["slab", "small mitred", "spare"]
    heights = [c.toCompound().BoundingBox().center.z for c in site.children[1:]]
    alone = build.to_cadquery()
    assert heights[0] - alone.toCompound().BoundingBox().center.z == pytest.approx(3000)
    assert site.objects["spare/panels/P001"].metadata["material"] == build.design.panels.material
    with pytest.raises(ValueError, match="spare is already"):
        site.phexAdd(build, name="spare")


def test_constraints_by_tag(build):
    """A bracket goes onto the top of a panel by a query."""
    bracket = cq.Workplane().box(60, 60, 4)
    bracket.faces("<Z").tag("foot")
    site = (
        cq.Assembly(name="site").phexAdd(build, ["P002"], name="shell").add(bracket, name="bracket")
    )
    site.constrain("shell/panels/P002?top", "bracket?foot", "Plane").solve()
    top = build.to_cadquery().objects["panels/P002"].obj.faces(tag="top").val()
    foot = site.objects["bracket"].toCompound().Faces()
    (touching,) = [f for f in foot if f.normalAt().dot(top.normalAt()) < -1 + 1e-4]
    assert (touching.Center() - top.Center()).Length < 0.5


@pytest.mark.parametrize("name", ["mitred", "hubs"])
def test_the_tree_survives_step(name, tmp_path):
    """Names at both levels, hierarchy, colours, volumes of all parts, read by XCAF."""
    build = small_build(name)
    build.to_cadquery().export(str(tmp_path / "a.step"))
    root, leaves = read_leaves(tmp_path / "a.step")
    exact = [(f, part) for f, own in parts_by_family(build).items() for part in own]
    assert root == build.design.name and len(leaves) == len(exact)
    for leaf, (family, part) in zip(leaves, exact, strict=True):
        assert (leaf.part, leaf.instance, leaf.path) == (part.mark, part.mark, (root, family))
        assert leaf.colour == pytest.approx(FAMILY_COLOURS[family], abs=2e-3)
        assert volume(leaf.shape) == pytest.approx(part.volume, rel=1e-9)
        assert is_valid(leaf.shape)
    text = (tmp_path / "a.step").read_text()
    for family, own in parts_by_family(build).items():
        assert not own or f"'{getattr(build.design, family).material}'" in text


def test_cadquery_reads_its_own_export(hubs, tmp_path):
    hubs.to_cadquery().export(str(tmp_path / "a.step"))
    again = cq.Assembly.importStep(str(tmp_path / "a.step"))
    shapes = {name.rsplit("/", 1)[-1]: shape for shape, name, _, _ in again}
    for part in itertools.chain(*parts_by_family(hubs).values()):
        assert shapes[part.mark].Volume() == pytest.approx(part.volume, rel=1e-9)


def test_notebooks_editor_and_headless_pictures(build, tmp_path):
    from cadquery import cqgi
    from cadquery.vis import show

    assembly = build.to_cadquery()
    for shown in (assembly, cq.Workplane().phexParts(build, "P001")):
        assert "vtk" in shown._repr_javascript_()
    script = (
        "import phexfab, phexfab.cadquery\n"
        "from phexfab.selftest import DESIGN\n"
        "build = phexfab.build(phexfab.make_design(DESIGN))\n"
        "show_object(build.to_cadquery(), name='shell')\n"
    )
    ran = cqgi.parse(script).build()
    assert ran.success, ran.exception
    (shown,) = ran.results
    assert type(shown.shape) is cq.Assembly
    path = tmp_path / "shell.png"
    show(
        assembly,
        *door.locations(build),
        screenshot=str(path),
        interact=False,
        width=300,
        height=200,
    )
    assert path.stat().st_size > 2000


def test_the_quickstart_runs_as_printed_in_ten_lines(tmp_path, monkeypatch):
    first = code_blocks("cadquery.md")[0]
    assert len([line for line in first.splitlines() if line.strip()]) <= 10
    names = run_block(first, tmp_path, monkeypatch)
    assert names["build"].ok
    assert len(read_leaves(tmp_path / "canopy.step")[1]) == len(names["shell"].objects) - 3

"""The STEP file as text: grammar, references, names, geometry, bytes. No kernel involved."""

import re
from dataclasses import replace

import numpy as np
import pytest
from cad_samples import exact_volume, geometries, panel, prism_faces, sample_parts
from part21_reader import Name, decode, names_in, parse

from phexfab.cad.part21 import numbers, quote, references
from phexfab.cad.step import StepHeader, write_step
from phexfab.errors import DesignError, PartError
from phexfab.fabrication.parts import Cylinder, Parts, Solid

# What an attribute may refer to, for each entity of the solids and of the product structure.
SCHEMA = {
    "VERTEX_POINT": ["CARTESIAN_POINT"],
    "VECTOR": ["DIRECTION"],
    "LINE": ["CARTESIAN_POINT", "VECTOR"],
    "CIRCLE": ["AXIS2_PLACEMENT_3D"],
    "EDGE_CURVE": ["VERTEX_POINT", "VERTEX_POINT", "LINE|CIRCLE"],
    "ORIENTED_EDGE": ["EDGE_CURVE"],
    "EDGE_LOOP": ["ORIENTED_EDGE", ...],
    "FACE_OUTER_BOUND": ["EDGE_LOOP"],
    "FACE_BOUND": ["EDGE_LOOP"],
    "AXIS2_PLACEMENT_3D": ["CARTESIAN_POINT", "DIRECTION", "DIRECTION"],
    "PLANE": ["AXIS2_PLACEMENT_3D"],
    "CYLINDRICAL_SURFACE": ["AXIS2_PLACEMENT_3D"],
    "ADVANCED_FACE": ["FACE_OUTER_BOUND|FACE_BOUND", "PLANE|CYLINDRICAL_SURFACE"],
    "CLOSED_SHELL": ["ADVANCED_FACE", ...],
    "MANIFOLD_SOLID_BREP": ["CLOSED_SHELL"],
    "STYLED_ITEM": ["PRESENTATION_STYLE_ASSIGNMENT", "MANIFOLD_SOLID_BREP"],
    "PRODUCT": ["PRODUCT_CONTEXT"],
    "PRODUCT_DEFINITION_FORMATION": ["PRODUCT"],
    "PRODUCT_DEFINITION": ["PRODUCT_DEFINITION_FORMATION", "PRODUCT_DEFINITION_CONTEXT"],
    "PRODUCT_DEFINITION_SHAPE": ["PRODUCT_DEFINITION|NEXT_ASSEMBLY_USAGE_OCCURRENCE"],
    "NEXT_ASSEMBLY_USAGE_OCCURRENCE": ["PRODUCT_DEFINITION", "PRODUCT_DEFINITION"],
    "SHAPE_DEFINITION_REPRESENTATION": [
        "PRODUCT_DEFINITION_SHAPE",
        "SHAPE_REPRESENTATION|ADVANCED_BREP_SHAPE_REPRESENTATION",
    ],
    "ITEM_DEFINED_TRANSFORMATION": ["AXIS2_PLACEMENT_3D", "AXIS2_PLACEMENT_3D"],
    "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION": [
        "REPRESENTATION_RELATIONSHIP\\+REPRESENTATION_RELATIONSHIP_WITH_TRANSFORMATION"
        "\\+SHAPE_REPRESENTATION_RELATIONSHIP",
        "PRODUCT_DEFINITION_SHAPE",
    ],
    "PRODUCT_RELATED_PRODUCT_CATEGORY": ["PRODUCT", ...],
    "PRESENTATION_LAYER_ASSIGNMENT": ["MANIFOLD_SOLID_BREP", ...],
}
ROOTS = {
    "PRESENTATION_LAYER_ASSIGNMENT",
    "APPLICATION_PROTOCOL_DEFINITION",
    "SHAPE_DEFINITION_REPRESENTATION",
    "CONTEXT_DEPENDENT_SHAPE_REPRESENTATION",
    "PRODUCT_RELATED_PRODUCT_CATEGORY",
    "MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION",
}


@pytest.fixture(scope="module")
def parts():
    return sample_parts()


@pytest.fixture(scope="module")
def text(parts, tmp_path_factory):
    header = StepHeader("ring", "a shell", "Jo", "Works", timestamp="2024-05-06T07:08:09")
    path = tmp_path_factory.mktemp("step") / "parts.step"
    return write_step(parts, path, header).read_text("ascii")


@pytest.fixture(scope="module")
def entities(text):
    return parse(text)[1]


def of_kind(entities, kind):
    return [entity for entity in entities.values() if entity.kind == kind]


def test_header_says_what_it_was_given(text):
    heads, _ = parse(text)
    assert heads["FILE_DESCRIPTION"] == (("a shell",), "2;1")
    assert heads["FILE_NAME"][:4] == ("ring", "2024-05-06T07:08:09", ("Jo",), ("Works",))
    assert heads["FILE_SCHEMA"][0][0].startswith("AUTOMOTIVE_DESIGN")


def test_every_reference_resolves_and_nothing_is_left_over(entities):
    assert list(entities) == list(range(1, len(entities) + 1))
    used = {name for entity in entities.values() for name in names_in(entity)}
    assert used <= set(entities)
    assert {entities[n].kind for n in set(entities) - used} == ROOTS


def test_attributes_refer_to_the_kinds_that_the_schema_asks_for(entities):
    seen = set()
    for number, entity in entities.items():
        wanted = SCHEMA.get(entity.kind)
        if wanted is None:
            continue
        seen.add(entity.kind)
        found = [entities[n].kind for n in names_in(entity)]
        if wanted[-1] is ...:
            wanted = [wanted[0]] * len(found)
        assert len(found) == len(wanted), f"#{number}"
        for kind, allowed in zip(found, wanted, strict=True):
            assert re.fullmatch(allowed, kind), f"#{number}"
    assert seen == set(SCHEMA)


def test_marks_stand_at_product_instance_and_brep_level(entities, parts):
    marks = set(geometries(parts))
    products = [e.args[:2] for e in of_kind(entities, "PRODUCT")]
    assert sorted(products) == sorted((m, m) for m in marks | {"ring", "panels", "beams", "nodes"})
    usages = [e.args[:2] for e in of_kind(entities, "NEXT_ASSEMBLY_USAGE_OCCURRENCE")]
    assert sorted(usages) == sorted((m, m) for m in marks | {"panels", "beams", "nodes"})
    assert sorted(e.args[0] for e in of_kind(entities, "MANIFOLD_SOLID_BREP")) == sorted(marks)


def test_every_solid_lies_on_the_layer_of_its_family(entities, parts):
    layers = {
        layer.args[0]: [entities[item.id].args[0] for item in layer.args[2]]
        for layer in of_kind(entities, "PRESENTATION_LAYER_ASSIGNMENT")
    }
    assert layers == {
        name: [part.mark for part in getattr(parts, name)] for name in ("panels", "beams", "nodes")
    }


def test_ap242_differs_in_what_it_calls_itself_only(parts, text, tmp_path):
    header = StepHeader(
        "ring", "a shell", "Jo", "Works", timestamp="2024-05-06T07:08:09", schema="AP242"
    )
    other = write_step(parts, tmp_path / "x.step", header).read_text("ascii")
    pairs = zip(text.splitlines(), other.splitlines(), strict=True)
    changed = [new for old, new in pairs if old != new]
    assert [line.split("(")[0] for line in changed] == [
        "FILE_SCHEMA",
        "#6=APPLICATION_CONTEXT",
        "#12=APPLICATION_PROTOCOL_DEFINITION",
    ]
    assert all("managed_model_based_3d_engineering" in re.sub(" ", "_", line.lower())
               for line in changed)  # fmt: skip


def test_an_unknown_schema_is_refused(parts, tmp_path):
    with pytest.raises(DesignError, match=r"AP203.*AP214, AP242"):
        write_step(parts, tmp_path / "x.step", StepHeader(schema="AP203"))
    assert list(tmp_path.iterdir()) == []


def product_name(entities, definition):
    formation = entities[entities[definition.id].args[2].id]
    return entities[formation.args[2].id].args[1]


def test_tree_is_root_families_parts(entities, parts):
    parent = {}
    for usage in of_kind(entities, "NEXT_ASSEMBLY_USAGE_OCCURRENCE"):
        child = product_name(entities, usage.args[4])
        assert child == usage.args[1]
        parent[child] = product_name(entities, usage.args[3])
    for family in ("panels", "beams", "nodes"):
        assert parent.pop(family) == "ring"
        for part in getattr(parts, family):
            assert parent.pop(part.mark) == family
    assert not parent


def test_product_of_a_part_shows_the_brep_of_that_name(entities):
    count = 0
    for link in of_kind(entities, "SHAPE_DEFINITION_REPRESENTATION"):
        shape, representation = (entities[a.id] for a in link.args)
        name = product_name(entities, shape.args[2])
        assert representation.args[0] == name
        if representation.kind == "ADVANCED_BREP_SHAPE_REPRESENTATION":
            assert entities[representation.args[1][1].id].args[0] == name
            count += 1
    assert count == len(of_kind(entities, "MANIFOLD_SOLID_BREP"))


def test_units_are_millimetres_and_radians_with_an_uncertainty(entities):
    (context,) = (e for e in entities.values() if e.kind.startswith("GEOMETRIC_REPRESENTATION"))
    assert context.args[0] == (3,)
    units = [entities[name.id] for name in context.args[2][0]]
    assert ("LENGTH_UNIT+NAMED_UNIT+SI_UNIT", (".MILLI.", ".METRE.")) in [
        (u.kind, u.args[2]) for u in units
    ]
    assert ("NAMED_UNIT+PLANE_ANGLE_UNIT+SI_UNIT", ("$", ".RADIAN.")) in [
        (u.kind, u.args[2]) for u in units
    ]
    uncertainty = entities[context.args[1][0][0].id]
    assert uncertainty.args[0].args == (1e-7,)
    assert uncertainty.args[1] in context.args[2][0]


def test_three_colours_and_one_style_per_solid(entities, parts):
    assert len(of_kind(entities, "COLOUR_RGB")) == 3
    solid_style = {}
    for item in of_kind(entities, "STYLED_ITEM"):
        solid = entities[item.args[2].id].args[0]
        assert solid not in solid_style
        solid_style[solid] = item.args[1][0].id
    for family in ("panels", "beams", "nodes"):
        marks = [p.mark for p in getattr(parts, family)]
        assert len({solid_style.pop(mark) for mark in marks}) == 1
    assert not solid_style


class Geometry:
    """Solids as the file tells them, straight from its text."""

    def __init__(self, entities):
        self.entities = entities

    def __getitem__(self, name):
        return self.entities[name.id]

    def point(self, name):
        return np.array(self[name].args[1])

    def corner(self, vertex):
        return self.point(self[vertex].args[1])

    def frame(self, name):
        _, origin, axis, side = self[name].args
        return self.point(origin), self.point(axis), self.point(side)

    def faces(self, solid):
        shell = self[solid.args[1]]
        return [self[name] for name in shell.args[1]]

    def sides(self, face):
        loop = self[self[face.args[1][0]].args[1]]
        for name in loop.args[1]:
            edge = self[name]
            yield edge.args[3].id, self[edge.args[3]], edge.args[4] == ".T."


def test_polyhedra_in_the_file_are_closed_planar_and_of_the_exact_volume(entities, parts):
    geometry = Geometry(entities)
    expected = geometries(parts)
    count = 0
    for solid in of_kind(entities, "MANIFOLD_SOLID_BREP"):
        part = expected[solid.args[0]]
        if isinstance(part, Cylinder):
            continue
        count += 1
        uses = {}
        middle = part.vertices.mean(axis=0)
        volume = 0.0
        for face in geometry.faces(solid):
            origin, axis, side = geometry.frame(geometry[face.args[2]].args[1])
            corners = []
            for number, edge, along in geometry.sides(face):
                uses.setdefault(number, []).append(along)
                ends = [geometry.corner(edge.args[k]) for k in (1, 2)]
                start, vector = geometry[edge.args[3]].args[1:]
                direction = geometry.point(geometry[vector].args[1])
                assert geometry.point(start) == pytest.approx(ends[0], abs=0)
                span = ends[1] - ends[0]
                assert direction * np.linalg.norm(span) == pytest.approx(span, abs=1e-8)
                corners.append(ends if along else ends[::-1])
            for (_, end), (start, _) in zip(corners, corners[1:] + corners[:1], strict=True):
                assert end == pytest.approx(start, abs=0)
            points = np.array([start for start, _ in corners])
            assert np.abs((points - origin) @ axis).max() < 1e-8
            assert abs(axis @ side) < 1e-9
            points -= middle
            area = 0.5 * np.cross(points, np.roll(points, -1, axis=0)).sum(axis=0)
            assert area @ axis == pytest.approx(np.linalg.norm(area), rel=1e-12)  # outward
            volume += points[0] @ area / 3
        assert all(sorted(along) == [False, True] for along in uses.values())
        assert volume == pytest.approx(exact_volume(part), rel=1e-9)
    assert count == len(parts.panels) + len(parts.beams)


def test_cylinders_in_the_file_have_the_axis_and_radius_of_the_hub(entities, parts):
    geometry = Geometry(entities)
    hubs = {node.mark: node.cylinder for node in parts.nodes}
    for solid in of_kind(entities, "MANIFOLD_SOLID_BREP"):
        hub = hubs.pop(solid.args[0], None)
        if hub is None:
            continue
        wall, *caps = geometry.faces(solid)
        surface = geometry[wall.args[2]]
        origin, axis, side = geometry.frame(surface.args[1])
        assert surface.args[2] == pytest.approx(hub.radius, abs=1e-10)
        assert origin == pytest.approx(hub.base, abs=1e-9)
        assert axis == pytest.approx(hub.axis, abs=1e-11)
        assert abs(side @ axis) < 1e-11
        centres = []
        for cap in caps:
            centre, normal, _ = geometry.frame(geometry[cap.args[2]].args[1])
            ((_, rim, along),) = geometry.sides(cap)
            # Counter-clockwise about the outward normal: along the circle on top, against it below.
            assert along == (normal @ axis > 0)
            ring_centre, _, _ = geometry.frame(geometry[rim.args[3]].args[1])
            assert ring_centre == pytest.approx(centre, abs=0)
            seam = geometry.corner(rim.args[1]) - centre
            assert np.linalg.norm(seam) == pytest.approx(hub.radius, abs=1e-9)
            centres.append(centre)
        assert centres[1] - centres[0] == pytest.approx(hub.length * hub.axis, abs=1e-8)
    assert not hubs


def test_same_parts_give_the_same_bytes(tmp_path, parts, monkeypatch):
    monkeypatch.delenv("SOURCE_DATE_EPOCH", raising=False)
    first = write_step(parts, tmp_path / "a.step").read_bytes()
    assert write_step(sample_parts(), tmp_path / "b.step").read_bytes() == first
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    dated = write_step(parts, tmp_path / "c.step").read_bytes()
    assert dated.replace(b"2023-11-14T22:13:20", b"1970-01-01T00:00:00") == first != dated
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    with pytest.raises(DesignError, match="SOURCE_DATE_EPOCH is 'yesterday'"):
        write_step(parts, tmp_path / "d.step")


def test_rounding_noise_of_another_machine_does_not_show(tmp_path):
    # Corners on a grid of 1e-3 mm lie far from where rounding to 1e-10 flips.
    outline = np.array([[0.0, 0], [431.007, 0], [400, 300.125], [180.5, 90], [0, 300]])
    prism = np.vstack([np.c_[outline, np.zeros(5)], np.c_[outline, np.full(5, 8.0)]])
    noise = np.random.default_rng(1).uniform(-2e-11, 2e-11, prism.shape)

    def file(name, vertices):
        parts = Parts((panel("P001", Solid(vertices, prism_faces(5))),))
        return write_step(parts, tmp_path / name).read_bytes()

    assert file("a.step", prism) == file("b.step", prism + noise)


def test_numbers_are_part_21_reals():
    values = np.array([0.0, 1.0, -3.25, 1e-10, -2.5e-7, 9.9e-5, 1e-4, 12345.0123456789, -1e15])
    texts = [str(v) for v in numbers(values)]
    assert all(re.fullmatch(r"-?\d+\.\d*", t) for t in texts)
    assert [float(t) for t in texts] == values.tolist()


@pytest.mark.parametrize(
    "name",
    ["", "plain", "it's", "back\\slash", "Überdachung – Süd", "屋根", "tab\tline\n", "𝛼 100 %"],
)
def test_any_name_survives(tmp_path, name):
    assert decode(quote(name)) == name
    path = write_step(sample_parts(2, 1, 0), tmp_path / "x.step", StepHeader(name))
    heads, entities = parse(path.read_text("ascii"))
    assert heads["FILE_NAME"][0] == name
    assert name in {e.args[1] for e in of_kind(entities, "PRODUCT")}


def test_references_break_long_lists():
    text = references(list(range(1, 40)))
    assert re.sub(r"\s", "", text) == "(" + ",".join(f"#{i}" for i in range(1, 40)) + ")"
    assert max(map(len, text.splitlines())) < 120


def test_families_without_members_are_left_out(tmp_path):
    parts = replace(sample_parts(), beams=(), nodes=())
    _, entities = parse(write_step(parts, tmp_path / "x.step").read_text("ascii"))
    names = {e.args[0] for e in of_kind(entities, "PRODUCT")}
    assert names == {"shell", "panels"} | {p.mark for p in parts.panels}
    styles = of_kind(entities, "MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION")
    assert len(styles[0].args[1]) == len(parts.panels)
    assert all(isinstance(name, Name) for name in styles[0].args[1])


def test_more_parts_than_fit_one_chunk(tmp_path, monkeypatch):
    parts = sample_parts(9, 0, 5)
    whole = write_step(parts, tmp_path / "a.step").read_bytes()
    monkeypatch.setattr("phexfab.cad.step._CHUNK", 2)
    assert write_step(parts, tmp_path / "b.step").read_bytes() == whole


def test_a_failure_leaves_the_old_file_and_no_draft(tmp_path):
    parts = sample_parts()
    path = write_step(parts, tmp_path / "parts.step")
    before = path.read_bytes()
    last = parts.nodes[-1]
    bad = replace(last, cylinder=replace(last.cylinder, radius=0.0))
    with pytest.raises(PartError, match=last.mark):
        write_step(replace(parts, nodes=(*parts.nodes[:-1], bad)), path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]

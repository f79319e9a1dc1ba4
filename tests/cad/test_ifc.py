"""IFC4, checked against the schema and read by ifcopenshell's geometry engine."""

import io
import sys

import numpy as np
import pytest
from export_samples import all_parts, sample_build

from phexfab.cad.ifc import write_ifc
from phexfab.cad.step import StepHeader
from phexfab.errors import MissingLibraryError
from phexfab.fabrication.parts import FAMILY_COLOURS

HEADER = StepHeader("Schale <1> & Söhne", author="Jo", timestamp="2026-05-01T00:00:00")
CLASSES = {"panels": "IfcPlate", "beams": "IfcMember", "nodes": "IfcDiscreteAccessory"}


def test_without_ifcopenshell_the_message_says_how_to_install_it(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "ifcopenshell", None)
    with pytest.raises(MissingLibraryError, match=r'pip install "phexfab\[ifc\]"'):
        write_ifc(sample_build().parts, tmp_path / "a.ifc")
    assert list(tmp_path.iterdir()) == []


ifcopenshell = pytest.importorskip("ifcopenshell")


@pytest.fixture(scope="module")
def built():
    return sample_build()


@pytest.fixture(scope="module")
def path(built, tmp_path_factory):
    return write_ifc(built.parts, tmp_path_factory.mktemp("ifc") / "a.ifc", HEADER)


@pytest.fixture(scope="module")
def model(path):
    return ifcopenshell.open(path)


@pytest.fixture(scope="module")
def elements(model):
    return {e.Name: e for kind in CLASSES.values() for e in model.by_type(kind)}


def test_it_keeps_the_rules_of_the_schema(model):
    import ifcopenshell.validate

    log = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(model, log)
    assert log.statements == []
    assert model.schema == "IFC4"


def test_every_part_is_an_element_of_its_class_with_its_mark(built, elements):
    parts = all_parts(built)
    assert set(elements) == set(parts)
    for mark, (family, _) in parts.items():
        assert elements[mark].is_a() == CLASSES[family]
        assert elements[mark].Tag == mark


def test_the_tree_runs_from_the_project_to_the_parts(built, elements):
    import ifcopenshell.util.element as util

    for mark, (family, _) in all_parts(built).items():
        way = [elements[mark]]
        while (above := util.get_aggregate(way[-1]) or util.get_container(way[-1])) is not None:
            way.append(above)
        assert [thing.is_a() for thing in way[1:]] == [
            "IfcElementAssembly", "IfcElementAssembly", "IfcBuildingStorey", "IfcBuilding",
            "IfcSite", "IfcProject",
        ]  # fmt: skip
        assert [thing.Name for thing in way[1:3]] == [family, HEADER.name]
        assert way[-1].Name == HEADER.name


def test_shapes_have_the_exact_volume(built, model):
    """The reader's own shapes, not its triangles: a hub is a cylinder there, a face is whole."""
    import ifcopenshell.geom
    from OCP.BRep import BRep_Builder
    from OCP.BRepGProp import BRepGProp
    from OCP.BRepTools import BRepTools
    from OCP.GProp import GProp_GProps
    from OCP.TopoDS import TopoDS_Shape

    parts = all_parts(built)
    settings = ifcopenshell.geom.settings()
    settings.set("iterator-output", ifcopenshell.ifcopenshell_wrapper.SERIALIZED)
    seen = set()
    for shape in ifcopenshell.geom.iterator(settings, model, 1):
        mark = model.by_id(shape.id).Name
        solid, measured = TopoDS_Shape(), GProp_GProps()
        BRepTools.Read_s(solid, io.BytesIO(shape.geometry.brep_data.encode()), BRep_Builder())
        BRepGProp.VolumeProperties_s(solid, measured, 1e-12)
        family, part = parts[mark]
        # Corners are written to 1e-7 mm, the thinnest part is 8 mm; hubs are written as they are.
        error = 1e-12 if family == "nodes" else 2e-8
        assert measured.Mass() * 1e9 == pytest.approx(part.volume, rel=error), mark
        seen.add(mark)
    assert seen == set(parts)


def test_parts_stand_in_their_places(built, model):
    import ifcopenshell.geom

    parts = all_parts(built)
    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    settings.set("mesher-angular-deflection", 0.1)
    seen = set()
    for shape in ifcopenshell.geom.iterator(settings, model, 1):
        mark = model.by_id(shape.id).Name
        family, part = parts[mark]
        points = np.reshape(shape.geometry.verts, (-1, 3)) * 1000
        if family != "nodes":
            wanted = part.solid.vertices
            assert np.allclose(points.min(axis=0), wanted.min(axis=0), rtol=0, atol=1e-4)
            assert np.allclose(points.max(axis=0), wanted.max(axis=0), rtol=0, atol=1e-4)
        else:
            middle = part.cylinder.base + part.cylinder.axis * part.cylinder.length / 2
            found = (points.min(axis=0) + points.max(axis=0)) / 2
            assert np.allclose(found, middle, rtol=0, atol=0.1)
        seen.add(mark)
    assert seen == set(parts)


def test_hubs_are_true_circles(built, elements):
    for node in built.parts.nodes:
        (body,) = elements[node.mark].Representation.Representations
        (solid,) = body.Items
        assert solid.SweptArea.Radius == node.cylinder.radius
        assert solid.Depth == node.cylinder.length


def test_property_and_quantity_sets_are_the_standard_ones(built, elements):
    import ifcopenshell.util.element as util
    import ifcopenshell.util.pset

    templates = ifcopenshell.util.pset.get_template("IFC4")
    for mark, (family, part) in all_parts(built).items():
        sets = util.get_psets(elements[mark])
        for name, values in sets.items():
            if not name.startswith("Phexfab_"):
                assert name in templates.get_applicable_names(CLASSES[family])
                template = templates.get_by_name(name)
                known = {one.Name for one in template.HasPropertyTemplates}
                assert set(values) - {"id"} <= known
        standard = {
            "panels": "Pset_PlateCommon",
            "beams": "Pset_MemberCommon",
            "nodes": "Pset_ElementComponentCommon",
        }[family]
        amounts = {
            "panels": "Qto_PlateBaseQuantities",
            "beams": "Qto_MemberBaseQuantities",
            "nodes": "Phexfab_Quantities",
        }[family]
        assert sets[standard]["Reference"] == sets["Phexfab_Part"]["Mark"] == mark
        assert sets[amounts]["NetVolume"] == pytest.approx(part.volume / 1e9, rel=1e-12)
        assert sets[amounts]["NetWeight"] == pytest.approx(part.mass, rel=1e-12)
        if family == "panels":
            assert sets[amounts]["NetArea"] == pytest.approx(part.area / 1e6, rel=1e-12)
            assert sets[amounts]["Width"] == 12.0
            around = [note.neighbour for note in part.flat.edges if note.neighbour]
            assert sets["Phexfab_Part"].get("Neighbours", []) == around
        elif family == "beams":
            assert sets[amounts]["Length"] == sets[standard]["Span"] == part.length
            assert sets["Phexfab_Part"]["Nodes"] == list(part.nodes)


def test_materials_layers_types_and_colours(built, model, elements):
    import ifcopenshell.util.element as util

    for mark, (family, part) in all_parts(built).items():
        made = part.material if family == "nodes" else part.flat.material
        substance = util.get_material(elements[mark])
        assert substance.Name == made.name
        density = util.get_psets(substance)["Pset_MaterialCommon"]["MassDensity"]
        assert density == made.density
        assert util.get_type(elements[mark]).is_a() == CLASSES[family] + "Type"
        (body,) = elements[mark].Representation.Representations
        (item,) = body.Items
        (layer,) = item.LayerAssignment
        assert layer.Name == family
        (styled,) = item.StyledByItem
        colour = styled.Styles[0].Styles[0].SurfaceColour
        assert (colour.Red, colour.Green, colour.Blue) == FAMILY_COLOURS[family]


def test_units_are_mm_square_metres_cubic_metres_kg_and_degrees(model):
    import ifcopenshell.util.unit as util

    assert util.calculate_unit_scale(model) == 1e-3
    for kind, scale in (("AREAUNIT", 1), ("VOLUMEUNIT", 1), ("PLANEANGLEUNIT", np.pi / 180)):
        assert util.calculate_unit_scale(model, kind) == pytest.approx(scale)


def test_the_same_design_gives_the_same_bytes_and_identifiers(built, path, model, tmp_path):
    again = write_ifc(built.parts, tmp_path / "b.ifc", HEADER)
    assert again.read_bytes() == path.read_bytes()
    assert b"2026-05-01T00:00:00" in path.read_bytes()
    ids = [entity.GlobalId for entity in model.by_type("IfcRoot")]
    assert len(set(ids)) == len(ids)
    other = ifcopenshell.open(
        write_ifc(built.parts, tmp_path / "c.ifc", StepHeader("another design"))
    )
    assert not set(ids) & {entity.GlobalId for entity in other.by_type("IfcRoot")}

"""The parts as CadQuery and build123d objects, and the plugin."""

import math
from types import SimpleNamespace

import pytest
from cad_samples import exact_volume, geometries, sample_parts

from phexfab.cad.build123d import to_build123d
from phexfab.cad.cadquery import phex_parts, solids, to_cadquery
from phexfab.errors import PartError, PhexError
from phexfab.fabrication.parts import FAMILY_COLOURS


@pytest.fixture(scope="module")
def parts():
    return sample_parts(5, 4, 3)


@pytest.fixture(scope="module")
def build(parts):
    """Stands in for a build: anything with ``parts``."""
    return SimpleNamespace(parts=parts)


def test_cadquery_assembly_is_a_tree_of_solids_named_by_mark(parts):
    import cadquery as cq

    assembly = to_cadquery(parts, "ring")
    exact = geometries(parts)
    assert assembly.name == "ring"
    assert [branch.name for branch in assembly.children] == ["panels", "beams", "nodes"]
    leaves = [leaf for branch in assembly.children for leaf in branch.children]
    assert [leaf.name for leaf in leaves] == list(exact)
    for leaf in leaves:
        assert type(leaf.obj) is cq.Solid
        assert leaf.obj.isValid()
        assert leaf.obj.Volume() == pytest.approx(exact_volume(exact[leaf.name]), rel=1e-10)
        assert leaf.color.toTuple()[:3] == pytest.approx(FAMILY_COLOURS[leaf.parent.name], abs=1e-3)


def test_cadquery_solids_by_mark_and_family(parts, build):
    assert len(solids(build)) == 12
    assert len(solids(parts, ["panels", "P001", "N002"])) == 6
    (one,) = solids(build, "B003")
    assert one.Volume() == pytest.approx(exact_volume(geometries(parts)["B003"]), rel=1e-10)
    with pytest.raises(PartError, match="no part 'X1'; marks run from P001 to N003"):
        solids(parts, "X1")
    with pytest.raises(PartError, match="int holds no parts"):
        solids(3)


def test_parts_on_a_workplane_are_ready_for_selectors(parts, build):
    import cadquery as cq

    stack = cq.Workplane().invoke(phex_parts(build, "P001"))
    assert stack.size() == 1
    assert stack.faces().size() == 8
    box = stack.val().BoundingBox()
    low = geometries(parts)["P001"].vertices.min(axis=0)
    assert (box.xmin, box.ymin, box.zmin) == pytest.approx(tuple(low), abs=1e-5)


def test_plugin_adds_methods_and_replaces_none(build):
    import cadquery as cq

    import phexfab.cad.cadquery_plugin as plugin

    assert cq.Workplane.phexParts is plugin.phexParts
    assert cq.Workplane().phexParts(build, "beams").size() == 4
    plugin._install()  # a second time changes nothing
    copies = cq.Workplane("XZ").pushPoints([(0, 0), (7000, 0)]).phexShell(build, "nodes")
    assert copies.size() == 2
    first, second = (shape.Center() for shape in copies.vals())
    assert (second - first).toTuple() == pytest.approx((7000, 0, 0), abs=1e-6)
    hubs = sum(exact_volume(n.cylinder) for n in build.parts.nodes)
    assert copies.val().Volume() == pytest.approx(hubs, rel=1e-10)


def test_plugin_refuses_to_replace_a_foreign_method(monkeypatch):
    import cadquery as cq

    import phexfab.cad.cadquery_plugin as plugin

    monkeypatch.setattr(cq.Workplane, "phexShell", math.sqrt)
    with pytest.raises(PhexError, match="already comes from math"):
        plugin._install()
    assert cq.Workplane.phexShell is math.sqrt


def test_build123d_compound_is_a_labelled_coloured_tree(parts):
    import build123d as b3d

    compound = to_build123d(parts, "ring")
    exact = geometries(parts)
    assert type(compound) is b3d.Compound and compound.label == "ring"
    assert [branch.label for branch in compound.children] == ["panels", "beams", "nodes"]
    leaves = [leaf for branch in compound.children for leaf in branch.children]
    assert [leaf.label for leaf in leaves] == list(exact)
    for leaf in leaves:
        assert type(leaf) is b3d.Solid
        assert leaf.is_valid
        assert leaf.volume == pytest.approx(exact_volume(exact[leaf.label]), rel=1e-10)
        assert tuple(leaf.color)[:3] == pytest.approx(FAMILY_COLOURS[leaf.parent.label], abs=1e-3)
    assert compound.volume == pytest.approx(sum(map(exact_volume, exact.values())), rel=1e-10)


def test_build123d_finds_and_cuts_a_part_by_its_mark(parts):
    import build123d as b3d

    compound = to_build123d(parts)
    (panel,) = [s for s in compound.descendants if s.label == "P003"]
    face = panel.faces().sort_by(b3d.SortBy.AREA)[-1]
    drill = b3d.Plane(face) * b3d.Cylinder(5, 100)
    assert (panel - drill).volume == pytest.approx(panel.volume - math.pi * 25 * 8, rel=1e-9)

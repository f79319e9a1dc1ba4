"""The parts as CadQuery and build123d objects: names, colours, volumes, metadata."""

import math
from types import SimpleNamespace

import pytest
from cad_samples import exact_volume, geometries, sample_parts

from phexfab.cad.build123d import to_build123d
from phexfab.cad.cadquery import solids, to_cadquery
from phexfab.cad.tree import metadata
from phexfab.errors import PartError
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
    known = {part.mark: part for part in (*parts.panels, *parts.beams, *parts.nodes)}
    for leaf in leaves:
        solid = leaf.obj.val()
        assert type(solid) is cq.Solid and leaf.obj.size() == 1 and solid.label == leaf.name
        assert solid.isValid()
        assert solid.Volume() == pytest.approx(exact_volume(exact[leaf.name]), rel=1e-10)
        assert leaf.metadata == metadata(known[leaf.name])
        assert (leaf.material.name, leaf.material.density) == ("steel", 7.85)
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


def test_a_solid_that_is_moved_leaves_the_others_alone(parts):
    import cadquery as cq

    (first,), (second,) = solids(parts, "P001"), solids(parts, "P001")
    place = second.Center()
    first.move(cq.Location((0, 0, 500)))
    assert (first.Center() - second.Center()).toTuple() == pytest.approx((0, 0, 500), abs=1e-6)
    assert (solids(parts, "P001")[0].Center() - place).Length == 0


def test_chosen_parts_only(parts):
    assembly = to_cadquery(parts, names=["N002", "P001"])
    assert [branch.name for branch in assembly.children] == ["panels", "nodes"]
    assert [leaf.name for b in assembly.children for leaf in b.children] == ["P001", "N002"]
    compound = to_build123d(parts, names="beams")
    assert [leaf.label for leaf in compound.leaves] == ["B001", "B002", "B003", "B004"]
    for make in (to_cadquery, to_build123d):
        with pytest.raises(PartError, match="no part 'P9'"):
            make(parts, names=["P001", "P9"])


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
        assert leaf.is_valid and leaf.metadata["mark"] == leaf.label
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

"""What OpenCASCADE reads back from our STEP file, and from CadQuery's export of the same parts."""

import pytest
from cad_samples import exact_volume, geometries, sample_parts
from export_samples import sample_build
from xcaf_reader import read_leaves

from phexfab.cad.brep import is_valid, volume
from phexfab.cad.cadquery import to_cadquery
from phexfab.cad.step import StepHeader, write_step
from phexfab.fabrication.parts import FAMILY_COLOURS


@pytest.fixture(scope="module")
def parts():
    return sample_parts(8, 7, 6, seed=11)


@pytest.fixture(scope="module", params=["AP214", "AP242"])
def ours(request, parts, tmp_path_factory):
    path = tmp_path_factory.mktemp("read") / "parts.step"
    return read_leaves(write_step(parts, path, StepHeader("Schale Süd", schema=request.param)))


def test_every_part_comes_back_once_in_its_family_under_its_mark(parts, ours):
    root, leaves = ours
    assert root == "Schale Süd"
    expected = [
        (p.mark, p.mark, (root, family))
        for family in ("panels", "beams", "nodes")
        for p in getattr(parts, family)
    ]
    assert [(leaf.part, leaf.instance, leaf.path) for leaf in leaves] == expected


def test_every_solid_is_valid_and_of_the_exact_volume(parts, ours):
    from OCP.TopAbs import TopAbs_ShapeEnum

    exact = geometries(parts)
    for leaf in ours[1]:
        assert leaf.shape.ShapeType() == TopAbs_ShapeEnum.TopAbs_SOLID
        assert is_valid(leaf.shape), leaf.part
        assert volume(leaf.shape) == pytest.approx(exact_volume(exact[leaf.part]), rel=1e-9)


def test_colours_are_those_of_the_families(ours):
    for leaf in ours[1]:
        assert leaf.colour == pytest.approx(FAMILY_COLOURS[leaf.path[1]], abs=2e-3)


def test_layers_are_the_families(ours):
    for leaf in ours[1]:
        assert leaf.layers == (leaf.path[1],), leaf.part


@pytest.mark.parametrize("schema", ["AP214", "AP242"])
def test_no_complaint_while_loading(parts, tmp_path, schema):
    from OCP.IFSelect import IFSelect_ReturnStatus
    from OCP.STEPControl import STEPControl_Reader

    reader = STEPControl_Reader()
    path = write_step(parts, tmp_path / "x.step", StepHeader(schema=schema))
    assert reader.ReadFile(str(path)) == IFSelect_ReturnStatus.IFSelect_RetDone
    checks = reader.WS().ModelCheckList()
    checks.Start()
    messages = []
    while checks.More():
        check = checks.Value()
        messages += [check.CFail(k) for k in range(1, check.NbFails() + 1)]
        messages += [check.CWarning(k) for k in range(1, check.NbWarnings() + 1)]
        checks.Next()
    assert messages == []


def test_cadquerys_export_of_the_same_parts_agrees(tmp_path):
    parts = sample_build().parts
    root, own = read_leaves(write_step(parts, tmp_path / "ours.step", StepHeader("Shell")))
    to_cadquery(parts, "Shell").export(str(tmp_path / "cadquery.step"))
    other, theirs = read_leaves(tmp_path / "cadquery.step")
    assert root == other == "Shell"
    assert [leaf.part for leaf in own] == [leaf.part for leaf in theirs]
    for one, two in zip(own, theirs, strict=True):
        assert one.path[1:] == two.path[1:]
        assert one.colour == pytest.approx(two.colour, abs=2e-3)
        assert volume(one.shape) == pytest.approx(volume(two.shape), rel=1e-9)

"""OpenCASCADE solids from arrays: valid, closed, outward, shared, and of the exact volume."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from cad_samples import exact_volume, geometries, panel, panel_solid, prism_faces, sample_parts

from phexfab.cad.brep import is_valid, to_shape, to_shapes, verify_solids, volume
from phexfab.errors import PartError
from phexfab.fabrication.parts import Cylinder, Parts, Solid


@pytest.fixture(scope="module")
def built():
    named = geometries(sample_parts())
    return {
        mark: (part, shape)
        for (mark, part), shape in zip(
            named.items(), to_shapes(list(named.values()), list(named)), strict=True
        )
    }


def subshapes(shape, kind):
    """Distinct sub-shapes of a kind, and how often they are met in all."""
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer

    found, count = [], 0
    explorer = TopExp_Explorer(shape, getattr(TopAbs_ShapeEnum, f"TopAbs_{kind}"))
    while explorer.More():
        current = explorer.Current()
        count += 1
        if not any(current.IsSame(other) for other in found):
            found.append(current)
        explorer.Next()
    return found, count


def test_every_solid_is_valid_and_of_the_exact_volume(built):
    for mark, (part, shape) in built.items():
        assert is_valid(shape), mark
        assert volume(shape) == pytest.approx(exact_volume(part), rel=1e-10), mark


def test_corners_and_edges_are_shared(built):
    for mark, (part, shape) in built.items():
        if isinstance(part, Cylinder):
            continue
        faces, _ = subshapes(shape, "FACE")
        edges, uses = subshapes(shape, "EDGE")
        corners, _ = subshapes(shape, "VERTEX")
        sides = sum(map(len, part.faces))
        assert (len(faces), uses) == (len(part.faces), sides), mark
        assert len(edges) == sides // 2
        assert len(corners) == len(part.vertices)


def test_no_tolerance_exceeds_the_kernels_own(built):
    from OCP.BRep import BRep_Tool
    from OCP.TopoDS import TopoDS

    for _, shape in built.values():
        for kind, cast in (("FACE", TopoDS.Face), ("EDGE", TopoDS.Edge), ("VERTEX", TopoDS.Vertex)):
            assert max(BRep_Tool.Tolerance_s(cast(s)) for s in subshapes(shape, kind)[0]) <= 1e-7


def test_faces_are_planes_and_hubs_are_cylinders(built):
    from OCP.BRep import BRep_Tool
    from OCP.TopoDS import TopoDS

    for part, shape in built.values():
        kinds = [
            BRep_Tool.Surface_s(TopoDS.Face(f)).DynamicType().Name()
            for f in subshapes(shape, "FACE")[0]
        ]
        if isinstance(part, Cylinder):
            assert sorted(kinds) == ["Geom_CylindricalSurface", "Geom_Plane", "Geom_Plane"]
        else:
            assert set(kinds) == {"Geom_Plane"}


def test_points_inside_and_outside_are_told_apart(built):
    """The notch of a non-convex panel is outside, its arms are inside."""
    from OCP.BRepClass3d import BRepClass3d_SolidClassifier
    from OCP.gp import gp_Pnt
    from OCP.TopAbs import TopAbs_State

    part, shape = built["P001"]
    v = part.vertices
    middle = v.mean(axis=0)
    tips, notch = (v[0] + v[1] + v[6] + v[7]) / 4, (v[1] + v[3] + v[7] + v[9]) / 4
    notch = middle + 0.9 * (notch - middle)
    assert np.linalg.norm(notch - middle) > 110 * 1.1 * 1.03
    for point, state in (
        (middle, TopAbs_State.TopAbs_IN),
        (middle + 0.3 * (tips - middle), TopAbs_State.TopAbs_IN),
        (notch, TopAbs_State.TopAbs_OUT),
        (middle + 2 * (tips - middle), TopAbs_State.TopAbs_OUT),
    ):
        found = BRepClass3d_SolidClassifier(shape, gp_Pnt(*point.tolist()), 1e-7).State()
        assert found == state


def test_booleans_accept_the_solids(built):
    """Drilling through the middle takes π r² t: the solids are fit for use, not only for show."""
    from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut

    part, shape = built["P001"]
    lower, upper = part.vertices[:6].mean(axis=0), part.vertices[6:].mean(axis=0)
    rows = part.vertices[1:3] - part.vertices[0]
    normal = np.cross(rows[0], rows[1])
    normal *= np.sign(normal @ (upper - lower)) / np.linalg.norm(normal)
    drill = to_shape(Cylinder(lower - 10 * normal, normal, 6.0, 30.0))
    rest = BRepAlgoAPI_Cut(shape, drill).Shape()
    removed = volume(shape) - volume(rest)
    assert removed == pytest.approx(np.pi * 36 * 8.0, rel=1e-9)


def test_far_from_the_origin_and_with_unused_corners():
    solid = panel_solid(np.random.default_rng(3), reach=1e5)
    stray = Solid(np.vstack([solid.vertices, [[0.0, 0.0, 0.0]]]), solid.faces)
    assert is_valid(to_shape(stray))
    assert volume(to_shape(stray)) == pytest.approx(exact_volume(solid), rel=1e-8)


def test_bad_solids_are_refused_by_mark():
    solid = panel_solid(np.random.default_rng(3))
    flipped = Solid(solid.vertices, tuple(face[::-1] for face in solid.faces))
    with pytest.raises(PartError, match=r"^P009: .*inside out"):
        to_shape(flipped, "P009")
    with pytest.raises(PartError, match=r"^solid 1: "):
        to_shapes([solid, flipped])


def test_is_valid_refuses_what_the_kernel_lets_pass():
    shape = to_shape(panel_solid(np.random.default_rng(3)))
    from OCP.BRepCheck import BRepCheck_Analyzer

    turned = shape.Reversed()
    assert BRepCheck_Analyzer(turned).IsValid()
    assert not is_valid(turned)


def crossing_solid():
    """A prism on a figure of eight of positive area: closed and planar, but no solid."""
    eight = np.array([[0.0, 0], [300, 0], [300, 300], [100, -50], [0, 300]])
    return Solid(
        np.vstack([np.c_[eight, np.zeros(5)], np.c_[eight, np.full(5, 8.0)]]), prism_faces(5)
    )


def test_verify_names_what_only_the_kernel_sees():
    parts = sample_parts()
    assert verify_solids(parts) == verify_solids(parts, None) == []
    panels = (*parts.panels[:3], panel("P999", crossing_solid()), *parts.panels[4:])
    assert verify_solids(replace(parts, panels=panels), None) == ["P999"]


def test_the_sample_is_spread_over_each_family():
    good = panel_solid(np.random.default_rng(3))
    bad = crossing_solid()
    panels = tuple(panel(f"P{k:02d}", bad if k % 9 == 0 else good) for k in range(28))
    assert verify_solids(Parts(panels), 4) == ["P00", "P09", "P18", "P27"]
    assert verify_solids(Parts(panels), 1) == ["P00"]


def test_the_kernel_is_loaded_only_when_it_is_needed():
    code = (
        "import sys; sys.path.insert(0, 'tests/cad');"
        "import phexfab.cad.brep, phexfab.cad.step, phexfab.cad.cadquery, phexfab.cad.build123d,"
        "phexfab.cad.doctor, cad_samples;"
        "''.join(phexfab.cad.step.step_text(cad_samples.sample_parts()));"
        "print(sorted({'OCP', 'cadquery', 'build123d', 'vtk'} & set(sys.modules)))"
    )
    code = code.replace("'tests/cad'", repr(__file__.rpartition("/")[0]))
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"

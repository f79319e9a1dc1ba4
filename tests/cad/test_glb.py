"""GLB, read by trimesh and by OpenCASCADE: every part at its place, in its family, to scale."""

import numpy as np
import pytest
from export_samples import all_parts, sample_build

from phexfab.cad.glb import glb_bytes, write_glb
from phexfab.fabrication.parts import FAMILY_COLOURS

trimesh = pytest.importorskip("trimesh")


@pytest.fixture(scope="module")
def built():
    return sample_build()


@pytest.fixture(scope="module")
def path(built, tmp_path_factory):
    return write_glb(built.parts, tmp_path_factory.mktemp("glb") / "a.glb", built.design.name)


@pytest.fixture(scope="module")
def scene(path):
    return trimesh.load(path, process=False)


def test_every_part_is_a_closed_mesh_of_its_volume_in_metres(built, scene):
    parts = all_parts(built)
    assert set(scene.geometry) == set(parts)
    for mark, mesh in scene.geometry.items():
        solid = mesh.copy()
        solid.merge_vertices(merge_norm=True)
        assert solid.is_watertight and solid.is_winding_consistent, mark
        assert solid.volume == pytest.approx(parts[mark][1].volume * 1e-9, rel=2e-5), mark


def test_parts_stand_where_they_stand_in_the_shell_with_y_up(built, scene):
    for mark, (family, part) in all_parts(built).items():
        if family == "nodes":
            continue
        matrix, name = scene.graph[mark]
        corners = trimesh.transform_points(scene.geometry[name].vertices, matrix)
        x, y, z = part.solid.vertices.T / 1000
        wanted = np.column_stack([x, z, -y])
        assert np.allclose(corners.min(axis=0), wanted.min(axis=0), rtol=0, atol=1e-6)
        assert np.allclose(corners.max(axis=0), wanted.max(axis=0), rtol=0, atol=1e-6)


def test_the_tree_is_design_families_parts(built, scene):
    parents = scene.graph.transforms.parents
    for mark, (family, _) in all_parts(built).items():
        assert parents[mark] == family
        assert parents[family] == built.design.name


def test_normals_point_out_of_flat_faces(scene):
    mesh = scene.geometry["P001"]
    corners = mesh.vertex_normals[mesh.faces]
    assert np.allclose(corners, mesh.face_normals[:, None], rtol=0, atol=1e-4)


def test_colours_come_back_as_srgb(built, scene):
    for mark, (family, part) in all_parts(built).items():
        material = scene.geometry[mark].visual.material
        linear = np.array(material.baseColorFactor[:3], float)
        linear = linear / 255 if linear.max() > 1 else linear
        srgb = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
        # trimesh keeps eight bits of the linear colour
        assert srgb == pytest.approx(FAMILY_COLOURS[family], abs=8e-3)
        made = part.material if family == "nodes" else part.flat.material
        assert material.name == f"{family}: {made.name}"


def test_extras_say_what_the_parts_list_says(built, scene):
    for mark, (family, part) in all_parts(built).items():
        extras = scene.graph.transforms.edge_data[family, mark]["metadata"]
        assert (extras["mark"], extras["family"], extras["mass"]) == (mark, family, part.mass)
        assert extras["volume"] == part.volume


def test_opencascade_reads_it_in_millimetres_with_names(built, path):
    pytest.importorskip("OCP")
    from OCP.BRep import BRep_Tool
    from OCP.Message import Message_ProgressRange
    from OCP.RWGltf import RWGltf_CafReader
    from OCP.RWMesh import RWMesh_CoordinateSystem
    from OCP.TCollection import TCollection_AsciiString, TCollection_ExtendedString
    from OCP.TDataStd import TDataStd_Name
    from OCP.TDF import TDF_Label, TDF_LabelSequence
    from OCP.TDocStd import TDocStd_Document
    from OCP.TopAbs import TopAbs_ShapeEnum
    from OCP.TopExp import TopExp_Explorer
    from OCP.TopLoc import TopLoc_Location
    from OCP.TopoDS import TopoDS
    from OCP.XCAFDoc import XCAFDoc_DocumentTool, XCAFDoc_ShapeTool

    document = TDocStd_Document(TCollection_ExtendedString("glb"))
    reader = RWGltf_CafReader()
    reader.SetDocument(document)
    reader.SetSystemLengthUnit(0.001)
    reader.SetSystemCoordinateSystem(RWMesh_CoordinateSystem.RWMesh_CoordinateSystem_Zup)
    assert reader.Perform(TCollection_AsciiString(str(path)), Message_ProgressRange())
    shapes = XCAFDoc_DocumentTool.ShapeTool_s(document.Main())

    def name(label):
        attribute = TDataStd_Name()
        assert label.FindAttribute(TDataStd_Name.GetID_s(), attribute)
        return attribute.Get().ToExtString()

    found = {}

    def walk(label):
        target = TDF_Label()
        if not XCAFDoc_ShapeTool.GetReferredShape_s(label, target):
            target = label
        children = TDF_LabelSequence()
        XCAFDoc_ShapeTool.GetComponents_s(target, children, False)
        for k in range(1, children.Length() + 1):
            walk(children.Value(k))
        if not children.Length():
            found[name(label)] = XCAFDoc_ShapeTool.GetShape_s(target)

    roots = TDF_LabelSequence()
    shapes.GetFreeShapes(roots)
    for k in range(1, roots.Length() + 1):
        walk(roots.Value(k))
    parts = all_parts(built)
    assert set(found) == set(parts)
    for mark, shape in found.items():
        total = 0.0
        faces = TopExp_Explorer(shape, TopAbs_ShapeEnum.TopAbs_FACE)
        while faces.More():
            face = getattr(TopoDS, "Face", None) or TopoDS.Face_s
            face = face(faces.Current())
            mesh = BRep_Tool.Triangulation_s(face, TopLoc_Location())
            for k in range(1, mesh.NbTriangles() + 1):
                corners = [mesh.Node(i) for i in mesh.Triangle(k).Get()]
                a, b, c = (np.array([p.X(), p.Y(), p.Z()]) for p in corners)
                total += a @ np.cross(b, c) / 6
            faces.Next()
        assert total == pytest.approx(parts[mark][1].volume, rel=2e-5), mark


def test_the_same_parts_give_the_same_bytes(built, path):
    assert glb_bytes(built.parts, built.design.name) == path.read_bytes()

"""The shell coloured by curvature, as PLY and OBJ, read by trimesh and by plain words."""

import numpy as np
import pytest
from export_samples import sample_build

from phexfab.parallel.curvature import shell_curvatures

trimesh = pytest.importorskip("trimesh")


@pytest.fixture(scope="module")
def built():
    return sample_build()


@pytest.fixture(scope="module")
def folder(built, tmp_path_factory):
    folder = tmp_path_factory.mktemp("coloured")
    built.export(folder, ["ply", "obj"])
    return folder


@pytest.fixture(scope="module")
def curvature(built):
    return shell_curvatures(built.shell).gaussian * 1e6  # 1/m²


def face_areas(mesh):
    fans = [mesh.polygon(f) - mesh.polygon(f)[0] for f in range(mesh.n_faces)]
    return np.array([np.linalg.norm(np.cross(p[1:-1], p[2:]).sum(axis=0)) / 2 for p in fans])


def test_ply_has_every_panel_with_its_numbers(built, folder, curvature):
    mesh = trimesh.load(folder / "curvature.ply", process=False)
    faces = mesh.metadata["_ply_raw"]["face"]["data"]
    part = np.asarray(faces["part"]).ravel()
    assert sorted(set(part.tolist())) == list(range(built.shell.mesh.n_faces))
    found = np.asarray(faces["gaussian_curvature"]).ravel()
    assert np.allclose(found, curvature[part], rtol=1e-6)
    flat = np.asarray(faces["planarity"]).ravel()
    assert (flat < 1e-3).all()
    assert np.allclose(np.bincount(part, mesh.area_faces), face_areas(built.shell.mesh), rtol=1e-12)


def test_ply_says_units_and_marks(built, folder):
    head = (folder / "curvature.ply").read_bytes().split(b"end_header")[0].decode("ascii")
    assert "coordinates in mm" in head
    assert "comment gaussian_curvature in 1/m2\n" in head
    for k, panel in enumerate(built.parts.panels):
        assert f"comment part {k} {panel.mark}\n" in head


def test_colours_follow_the_curvature_on_corners_and_faces(folder, curvature):
    mesh = trimesh.load(folder / "curvature.ply", process=False)
    raw = mesh.metadata["_ply_raw"]
    part = np.asarray(raw["face"]["data"]["part"]).ravel()
    on_faces = np.column_stack([np.ravel(raw["face"]["data"][c]) for c in ("red", "green", "blue")])
    corners = np.column_stack(
        [np.ravel(raw["vertex"]["data"][c]) for c in ("red", "green", "blue")]
    )
    assert (corners[mesh.faces] == on_faces[:, None]).all()
    # from blue (low) to red (high)
    low, high = on_faces[part == curvature.argmin()][0], on_faces[part == curvature.argmax()][0]
    assert low[2] > low[0] and high[0] > high[2]


def test_obj_has_a_group_and_a_class_for_every_panel(built, folder, curvature):
    groups, points, faces = {}, [], []
    for line in (folder / "curvature.obj").read_text("utf-8").splitlines():
        word, *rest = line.split()
        if word == "v":
            points.append([float(x) for x in rest])
        elif word == "g":
            mark = rest[0]
        elif word == "usemtl":
            groups[mark] = rest[0]
        elif word == "f":
            faces.append((mark, [int(k) - 1 for k in rest]))
    assert list(groups) == [panel.mark for panel in built.parts.panels]
    points = np.array(points)
    areas = dict.fromkeys(groups, 0.0)
    for mark, (a, b, c) in faces:
        p, q, r = points[[a, b, c], :3]
        areas[mark] += np.linalg.norm(np.cross(q - p, r - p)) / 2
    assert np.allclose(list(areas.values()), face_areas(built.shell.mesh), rtol=1e-12)
    text = (folder / "curvature.mtl").read_text("ascii")
    colours = {}
    for block in text.split("newmtl ")[1:]:
        name, *lines = block.splitlines()
        colours[name] = [float(x) for x in lines[0].split()[1:]]
    assert set(colours) == set(groups.values()) and len(colours) <= 9
    order = np.argsort(curvature)
    classes = [int(groups[built.parts.panels[k].mark].rsplit("_", 1)[1]) for k in order]
    assert classes == sorted(classes)


def test_trimesh_reads_the_obj_with_its_materials(built, folder):
    scene = trimesh.load(folder / "curvature.obj", process=False, group_material=True)
    meshes = list(scene.geometry.values()) if hasattr(scene, "geometry") else [scene]
    assert sum(mesh.area for mesh in meshes) == pytest.approx(
        face_areas(built.shell.mesh).sum(), rel=1e-9
    )


def test_the_same_bytes_again(built, folder, tmp_path):
    built.export(tmp_path, ["obj", "ply"])
    for path in folder.iterdir():
        assert (tmp_path / path.name).read_bytes() == path.read_bytes()

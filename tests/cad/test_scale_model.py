"""The scale model: closed, as thick as the printer's wall, on its bed; 3MF and STL of it."""

import csv
import zipfile
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from export_samples import sample_build

from phexfab.cad.model_plates import ENGRAVED, panel_plates, write_listing
from phexfab.cad.scale_model import ScaleModel, printed_shell
from phexfab.cad.stl import write_stl
from phexfab.cad.three_mf import write_3mf
from phexfab.cad.triangles import Body, require_closed
from phexfab.errors import PartError
from phexfab.fabrication.parts import Parts

trimesh = pytest.importorskip("trimesh")
SPEC = ScaleModel(25)


@pytest.fixture(scope="module")
def built():
    return sample_build()


@pytest.fixture(scope="module")
def whole(built):
    return printed_shell(built.shell, built.parts, SPEC)[0]


@pytest.fixture(scope="module")
def plates(built):
    return panel_plates(built.parts.panels, SPEC, 25)


def mesh_of(body):
    return trimesh.Trimesh(body.points, body.triangles, process=False)


def thickness(mesh, points, directions):
    """Distance between the two outermost surfaces that lines through points cross."""
    a, b, c = np.moveaxis(mesh.triangles, 1, 0)
    out = []
    for p, d in zip(points, directions, strict=True):
        h = np.cross(d, c - a)
        det = np.einsum("ij,ij->i", b - a, h)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = p - a
            u = np.einsum("ij,ij->i", s, h) / det
            q = np.cross(s, b - a)
            v = q @ d / det
            t = np.einsum("ij,ij->i", c - a, q) / det
        hit = (u > 1e-9) & (v > 1e-9) & (u + v < 1 - 1e-9)
        out.append(np.ptp(t[hit & (np.abs(t) < 10)]))
    return np.array(out)


def test_the_whole_shell_is_one_closed_solid_in_the_middle_of_the_bed(whole):
    mesh = mesh_of(whole)
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.is_volume
    assert mesh.body_count == 1
    low, high = mesh.bounds
    assert low[2] == 0
    assert (low + high)[:2] / 2 == pytest.approx((110, 110), abs=1e-3)


def test_panels_of_the_model_are_as_thick_as_the_wall(built):
    shell = built.shell
    bare, _ = printed_shell(shell, Parts(built.parts.panels), SPEC)
    middles = np.array([shell.mesh.polygon(f).mean(axis=0) for f in range(shell.mesh.n_faces)])
    normals = shell.normals[shell.panels]
    # The model is the shell made smaller and moved; the skin lies where the panels lie, inside.
    inner = shell.mesh.vertices - 25 * SPEC.wall * shell.gauss.vertices
    corner = np.concatenate([shell.mesh.vertices, inner]).min(axis=0) / 25
    points = middles / 25 - corner + bare.points.min(axis=0) - SPEC.wall / 2 * normals
    found = thickness(mesh_of(bare), points, normals)
    assert found == pytest.approx(np.full(len(found), SPEC.wall), abs=1e-3)


def test_beams_become_ribs(built, whole):
    bare, _ = printed_shell(built.shell, Parts(built.parts.panels), SPEC)
    ribs = mesh_of(whole).volume - mesh_of(bare).volume
    depth = built.figures["beam drop"][0] + built.design.beams.height
    length = sum(beam.length for beam in built.parts.beams)
    assert ribs == pytest.approx(1.2 * depth * length / 25**2, rel=0.1)


def test_thick_parts_keep_their_own_thickness(built):
    thick = ScaleModel(5, bed=(1000, 1000, 1000), wall=0.8)  # 12 mm are 2.4 mm at 1:5
    body, _ = printed_shell(built.shell, Parts(built.parts.panels), thick)
    area = sum(
        np.linalg.norm(np.cross(p[1:-1] - p[0], p[2:] - p[0]).sum(axis=0)) / 2
        for p in (built.shell.mesh.polygon(f) for f in range(built.shell.mesh.n_faces))
    )
    assert mesh_of(body).volume == pytest.approx(area / 25 * 2.4, rel=0.02)


def test_without_a_scale_it_is_fitted_to_the_bed(built):
    body, scale = printed_shell(built.shell, built.parts, ScaleModel(bed=(120, 120, 120)))
    assert scale == 25
    assert (np.ptp(body.points, axis=0) <= 120).all()
    body, scale = printed_shell(built.shell, built.parts, ScaleModel(bed=(400, 400, 400)))
    assert scale == 10


def test_a_narrow_bed_takes_the_model_turned():
    built = sample_build()
    size = np.ptp(printed_shell(built.shell, built.parts, SPEC)[0].points, axis=0)
    assert size[0] != pytest.approx(size[1], abs=1)
    long, short = max(size[:2]) + 1e-3, min(size[:2]) + 1e-3
    for bed in ((long, short, 200), (short, long, 200)):
        body, _ = printed_shell(built.shell, built.parts, ScaleModel(25, bed))
        assert (np.ptp(body.points, axis=0)[:2] <= bed[:2]).all()
        assert (body.points.min(axis=0) >= -1e-9).all()


def test_what_does_not_fit_the_bed_is_refused_with_a_scale_that_does(built):
    with pytest.raises(PartError, match=r"1:10 .*larger than the bed.*1:(\d+)") as refused:
        printed_shell(built.shell, built.parts, ScaleModel(10))
    scale = float(str(refused.value).split("scale of 1:")[1].split(",")[0])
    printed_shell(built.shell, built.parts, ScaleModel(scale))
    with pytest.raises(PartError, match=r"P\d+ of a model at 1:2 .*bed leaves 210 × 210 mm"):
        panel_plates(built.parts.panels, SPEC, 2)


def test_a_wall_that_folds_the_shell_is_refused_with_one_that_does_not(built):
    with pytest.raises(PartError, match=r"flip beyond .*wall below") as refused:
        printed_shell(built.shell, built.parts, ScaleModel(25, wall=80))
    wall = float(str(refused.value).split("wall below ")[1].split(" mm")[0])
    assert 0 < wall < 80
    with pytest.raises(PartError, match="wall is 0"):
        ScaleModel(wall=0)


def test_every_panel_lies_once_on_a_plate_apart_from_the_others(built, plates):
    import shapely

    assert [plate.number for plate in plates] == list(range(1, len(plates) + 1))
    laid = [body.mark for plate in plates for body in plate.panels]
    assert laid == [panel.mark for panel in built.parts.panels]
    for plate in plates:
        hulls = [
            shapely.MultiPoint(body.points[:, :2]).convex_hull for body in plate.panels
        ]  # fmt: skip
        for k, hull in enumerate(hulls):
            assert shapely.box(5, 5, 215, 215).buffer(1e-3).contains(hull)
            assert all(hull.distance(other) > 2.9 for other in hulls[k + 1 :])


def test_panels_are_to_scale_and_carry_an_engraved_mark(built, plates):
    import manifold3d

    flats = {panel.mark: panel.flat for panel in built.parts.panels}
    for plate in plates:
        for body in plate.panels:
            mesh = mesh_of(body)
            assert mesh.is_watertight and mesh.is_winding_consistent
            assert mesh.bounds[0, 2] == 0 and mesh.bounds[1, 2] == pytest.approx(1.2 + ENGRAVED)
            solid = manifold3d.Manifold(
                manifold3d.Mesh(body.points.astype(np.float32), body.triangles.astype(np.uint32))
            )
            x, y = np.asarray(flats[body.mark].outline).T / 25
            area = abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
            assert solid.slice(0.1).area() == pytest.approx(area, rel=1e-4)
            groove = area - solid.slice(1.2 + ENGRAVED / 2).area()
            assert groove == 0 if body.mark in plate.unmarked else groove > 1.0
            assert mesh.volume == pytest.approx(area * 1.6 - groove * ENGRAVED, rel=1e-4)
    assert not any(plate.unmarked for plate in plates)


def test_marks_read_rightly_from_above(built, plates):
    """The groove of a P has its bowl on the right: a mirrored one would have it on the left."""
    import manifold3d
    import shapely

    body = plates[0].panels[0]
    solid = manifold3d.Manifold(
        manifold3d.Mesh(body.points.astype(np.float32), body.triangles.astype(np.uint32))
    )
    groove = solid.slice(0.1) - solid.slice(1.2 + ENGRAVED / 2)
    letters = [shapely.Polygon(ring) for ring in groove.to_polygons()]
    first = min((p for p in letters if p.area > 0.5), key=lambda letter: letter.bounds[0])
    x0, _, x1, _ = first.bounds
    left = first.intersection(shapely.box(x0, -1e3, x0 + 0.3 * (x1 - x0), 1e3)).bounds
    right = first.intersection(shapely.box(x1 - 0.3 * (x1 - x0), -1e3, x1, 1e3)).bounds
    assert left[3] - left[1] > 1.3 * (right[3] - right[1])


def test_too_small_a_panel_is_named_though_not_engraved(built):
    plates = panel_plates(built.parts.panels, replace(SPEC, scale=150), 150)
    bare = [mark for plate in plates for mark in plate.unmarked]
    assert bare
    assert {body.mark for plate in plates for body in plate.panels} >= set(bare)


@pytest.mark.parametrize("scale", [25, 150])
def test_the_listing_finds_every_panel_on_its_plate(built, tmp_path, scale):
    plates = panel_plates(built.parts.panels, replace(SPEC, scale=scale), scale)
    write_listing(plates, tmp_path / "plates.csv")
    with (tmp_path / "plates.csv").open(encoding="utf-8", newline="") as file:
        found = list(csv.DictReader(file))
    assert [row["mark"] for row in found] == [panel.mark for panel in built.parts.panels]
    for plate in plates:
        rows: dict[int, list[dict[str, str]]] = {}
        for line in (line for line in found if int(line["plate"]) == plate.number):
            rows.setdefault(int(line["row"]), []).append(line)
        boxes = {b.mark: (b.points.min(axis=0), b.points.max(axis=0)) for b in plate.panels}
        assert list(rows) == list(range(1, len(rows) + 1))
        behind = 0.0
        for lines in rows.values():
            assert [int(line["place"]) for line in lines] == list(range(1, len(lines) + 1))
            own = [boxes[line["mark"]] for line in lines]
            for (_, high), (low, _) in pairwise(own):
                assert low[0] > high[0]  # each stands right of the one before it
            assert min(low[1] for low, _ in own) > behind  # behind all of the row before
            behind = max(high[1] for _, high in own)
            for line, (low, high) in zip(lines, own, strict=True):
                middle = (low + high)[:2] / 2
                assert [float(line["x"]), float(line["y"])] == pytest.approx(middle, abs=0.051)
        bare = (line["mark"] for own in rows.values() for line in own if line["engraved"] == "no")
        assert tuple(bare) == plate.unmarked


def test_an_open_mesh_is_refused():
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    require_closed(Body("t", points, faces))
    with pytest.raises(PartError, match="do not close"):
        require_closed(Body("t", points, faces[:3]))
    with pytest.raises(PartError, match="inside out"):
        require_closed(Body("t", points, faces[:, ::-1]))


META = {"Title": "Schale <1> & Söhne, plate 1", "Designer": "", "Application": "phexfab"}


@pytest.fixture(scope="module")
def packed(plates, tmp_path_factory):
    path = tmp_path_factory.mktemp("3mf") / "plate.3mf"
    return write_3mf(plates[0].panels, path, META, ("HPL <white>", (0.88, 0.83, 0.71)))


def test_3mf_by_trimesh(plates, packed):
    pytest.importorskip("lxml")
    pytest.importorskip("networkx")
    scene = trimesh.load(packed)
    assert scene.units in ("millimeter", "mm")
    assert sorted(scene.geometry) == sorted(body.mark for body in plates[0].panels)
    for body in plates[0].panels:
        mesh = scene.geometry[body.mark]
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(body.volume, rel=1e-9)
        assert np.allclose(mesh.bounds, [body.points.min(axis=0), body.points.max(axis=0)])


def test_3mf_by_the_consortiums_own_reader(plates, packed):
    lib3mf = pytest.importorskip("lib3mf")
    model = lib3mf.get_wrapper().CreateModel()
    reader = model.QueryReader("3mf")
    reader.SetStrictModeActive(True)
    reader.ReadFromFile(str(packed))
    assert reader.GetWarningCount() == 0
    assert model.GetUnit() == lib3mf.ModelUnit.MilliMeter
    found = {}
    objects = model.GetMeshObjects()
    while objects.MoveNext():
        one = objects.GetCurrentMeshObject()
        assert one.IsManifoldAndOriented() and one.IsValid()
        assert one.GetName() == one.GetPartNumber()
        points = np.array([list(v.Coordinates) for v in one.GetVertices()])
        corners = points[np.array([list(t.Indices) for t in one.GetTriangleIndices()])]
        a, b, c = np.moveaxis(corners, 1, 0)
        found[one.GetName()] = np.einsum("ij,ij->", a, np.cross(b, c)) / 6
    assert found == {
        body.mark: pytest.approx(body.volume, rel=1e-4) for body in plates[0].panels
    }  # single precision there
    items = model.GetBuildItems()
    assert items.Count() == len(plates[0].panels)
    materials = model.GetBaseMaterialGroups()
    assert materials.MoveNext()
    group = materials.GetCurrentBaseMaterialGroup()
    (number,) = group.GetAllPropertyIDs()
    assert group.GetName(number) == "HPL <white>"
    colour = group.GetDisplayColor(number)
    assert (colour.Red, colour.Green, colour.Blue) == (224, 212, 181)
    entries = model.GetMetaDataGroup()
    values = {
        entries.GetMetaData(k).GetName(): entries.GetMetaData(k).GetValue()
        for k in range(entries.GetMetaDataCount())
    }
    assert values == {"Title": META["Title"], "Application": "phexfab"}


def test_3mf_is_the_same_bytes_again(plates, packed, tmp_path):
    again = write_3mf(
        plates[0].panels, tmp_path / "x.3mf", META, ("HPL <white>", (0.88, 0.83, 0.71))
    )
    assert again.read_bytes() == packed.read_bytes()
    with zipfile.ZipFile(packed) as archive:
        assert {entry.date_time[0] for entry in archive.infolist()} == {1980}


def test_stl_by_trimesh(plates, whole, tmp_path):
    mesh = trimesh.load(write_stl([whole], tmp_path / "shell.stl", "Söhne"))
    assert mesh.is_watertight and mesh.is_volume
    assert mesh.volume == pytest.approx(whole.volume, rel=1e-4)
    mesh = trimesh.load(write_stl(plates[0].panels, tmp_path / "plate.stl"))
    assert mesh.is_watertight
    assert mesh.body_count == len(plates[0].panels)
    pieces = sorted(piece.volume for piece in mesh.split())
    assert pieces == pytest.approx(sorted(b.volume for b in plates[0].panels), rel=1e-3)

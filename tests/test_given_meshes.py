"""Meshes from elsewhere by the design file: what is held, what is kept close to, what helps.

Parts are read back from STEP by the kernel and from DXF by ezdxf, and held against the file's own
numbers and the formula of the surface.
"""

import re
from itertools import combinations, pairwise

import cadquery as cq
import ezdxf
import numpy as np
import pytest
from scipy.spatial import Voronoi
from shapely import Polygon, box

import phexfab
from phexfab.design import parse_design
from phexfab.errors import DesignError
from phexfab.fabrication.limits import KINDS
from phexfab.forming import form
from phexfab.mesh.io import write_mesh
from phexfab.mesh.polygons import read_polygons
from phexfab.mesh.polymesh import PolyMesh

SIZE, RADIUS, TOP = 700.0, 8000.0, 900.0
GAP = 10.0


def honeycomb(rings):
    i, j = (a.ravel() for a in np.meshgrid(*2 * [np.arange(-rings, rings + 1)]))
    near = np.abs(i + j) <= rings
    return SIZE * np.column_stack([i + j / 2, j * np.sqrt(0.75)])[near]


def tangent(sites, x):
    """Height above x of the planes that touch z = TOP − |x|²/2R above sites."""
    x = np.asarray(x)
    return TOP - (2 * (sites * x).sum(axis=-1) - (sites * sites).sum(axis=-1)) / (2 * RADIUS)


def cells(sites, inner, cut=None):
    """The tangent planes above Voronoi cells, exactly planar; faces and vertices."""
    diagram = Voronoi(sites)
    number, points, faces = {}, [], []
    for k in np.flatnonzero(inner):
        cell = Polygon(diagram.vertices[diagram.regions[diagram.point_region[k]]]).convex_hull
        cell = cell if cut is None else cell.intersection(cut)
        if cell.area < 1:
            continue
        face = []
        for at in np.array(cell.normalize().exterior.coords)[-1:0:-1]:
            key = tuple(at.round(3))
            if key not in number:
                number[key] = len(points)
                points.append([*at, tangent(sites[k], at)])
            face.append(number[key])
        faces.append(face)
    return PolyMesh.from_faces(np.array(points), faces)


def dome(rings, cut=None):
    sites = honeycomb(rings + 2)
    x, y = sites.T
    steps = np.maximum.reduce(
        [np.abs(y), np.abs(np.sqrt(3) * x + y) / 2, np.abs(np.sqrt(3) * x - y) / 2]
    )
    return cells(sites, steps < (rings + 0.5) * SIZE * np.sqrt(0.75), cut)


def noisy(mesh, size=4.0, still=()):
    shift = size * np.random.default_rng(7).normal(size=mesh.vertices.shape)
    shift[list(still)] = 0.0
    return PolyMesh(mesh.vertices + shift, mesh.corners, mesh.starts)


def middle_face(mesh):
    centres = [mesh.polygon(f)[:, :2].mean(axis=0) for f in range(mesh.n_faces)]
    return int(np.linalg.norm(centres, axis=1).argmin())


BOX = box(-1900, -1500, 2000, 1700)
MESHES = {"dome": dome(2), "cut": dome(4, BOX)}
HELD = middle_face(MESHES["dome"])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("meshes")
    write_mesh(noisy(MESHES["dome"], still=MESHES["dome"].face(HELD)), path / "dome.obj")
    write_mesh(noisy(MESHES["cut"]), path / "cut.obj")
    write_mesh(MESHES["dome"], path / "exact.off")
    mesh = read_polygons(path / "dome.obj")
    write_mesh(PolyMesh(mesh.vertices / 1000, mesh.corners, mesh.starts), path / "metres.obj")
    save_faces(path / "roof.step", 1)
    save_faces(path / "halves.step", 2)
    return path


def save_faces(path, count):
    """The paraboloid as one face, or in parts that meet at x = 0."""
    ends = np.linspace(-4000.0, 4000.0, count + 1)
    faces = []
    for low, high in pairwise(ends):
        xs, ys = np.linspace(low, high, 9), np.linspace(-4000.0, 4000.0, 9)
        points = [[cq.Vector(x, y, TOP - (x * x + y * y) / (2 * RADIUS)) for y in ys] for x in xs]
        faces.append(cq.Face.makeSplineApprox(points, tol=1e-4, minDeg=3, maxDeg=5))
    cq.exporters.export(cq.Workplane(obj=cq.Compound.makeCompound(faces)), str(path))


def design(folder, mesh, more="", rest="", unit=""):
    return parse_design(
        f'[surface]\nmesh = "{mesh}"\n{unit}\n[mesh]\nmethod = "planarise"\n{more}\n[lattice]\n'
        f"panel_size = {SIZE:g}\n[panels]\ngap = {GAP:g}\n{rest}\n"
        '[nesting]\npacker = "shelf"\n',
        source=str(folder / "house.toml"),
    )


def formed(folder, mesh, more="", **others):
    return form(design(folder, mesh, more, **others), lambda *_: None)


def places(points):
    return "[" + ", ".join("[" + ", ".join(f"{x:.2f}" for x in p) + "]" for p in points) + "]"


# -- fixed vertices --------------------------------------------------------------------------------


def panel_planes(path):
    """Points and normals of the two large faces of every solid, by the kernel."""
    found = []
    for solid in cq.importers.importStep(str(path)).solids().vals():
        faces = sorted(solid.Faces(), key=lambda face: -face.Area())[:2]
        found.append([(face.Center().toTuple(), face.normalAt().toTuple()) for face in faces])
    return np.array(found)  # (solids, 2, [point, normal], 3)


def test_a_panel_whose_corners_are_held_is_made_as_it_was_drawn(folder, tmp_path):
    mesh = MESHES["dome"]
    drawn = mesh.polygon(HELD)
    asked = design(folder, "dome.obj", f"fixed = {places(drawn)}", '[beams]\nkind = "none"')
    built = phexfab.build(asked)
    assert built.figures["fixed vertices"][0] == 6
    assert built.figures["fixed vertices moved, at most"][0] < 1e-9
    assert built.figures["vertices moved, at most"][0] > 1.0
    made = built.write(tmp_path / "out")
    # STEP: of all panels just one has all six places in the plane of one of its faces.
    planes = panel_planes(made / "parts.step")
    assert len(planes) == mesh.n_faces
    off = np.abs(np.einsum("sfcx,sfx->sfc", drawn - planes[:, :, :1], planes[:, :, 1]))
    assert (off.max(axis=2).min(axis=1) < 1e-6).sum() == 1
    # At each corner three panels meet: their planes pass through the place in the file.
    assert ((off.min(axis=1) < 1e-6).sum(axis=0) == 3).all()
    # DXF: one outline is that hexagon less half the gap on every side, corner for corner.
    normal = np.linalg.svd(drawn - drawn.mean(axis=0))[2][2]
    frame = np.linalg.svd(normal[None])[2][1:]
    want = Polygon((drawn - drawn.mean(axis=0)) @ frame.T)
    want = shape(np.array(want.buffer(-GAP / 2, join_style="mitre").exterior.coords)[:-1])
    misses = [np.abs(shape(ring) - want).max() for ring in outlines(made) if len(ring) == 6]
    assert len(misses) == mesh.n_faces and sorted(misses)[0] < 1e-5 < 0.1 < sorted(misses)[1]


def shape(ring):
    """All distances of corners, in ascending order: the same for congruent outlines."""
    return np.sort([np.linalg.norm(a - b) for a, b in combinations(ring, 2)])


def outlines(made):
    for path in sorted((made / "sheets").glob("*PANELS*.dxf")):
        for entity in ezdxf.readfile(path).modelspace().query('*[layer=="CUT"]'):
            yield np.array([(x, y) for x, y, *_ in entity.get_points()])


def test_corners_of_the_border_stay(folder):
    given = read_polygons(folder / "cut.obj").vertices
    low, high = given[:, :2].min(axis=0), given[:, :2].max(axis=0)
    corners = [
        given[np.linalg.norm(given[:, :2] - (x, y), axis=1).argmin()]
        for x in (low[0], high[0])
        for y in (low[1], high[1])
    ]
    free, held = formed(folder, "cut.obj"), formed(folder, "cut.obj", 'fixed = "corners"')
    for found, most in ((free, np.inf), (held, 1e-9)):
        vertices = found.shell.mesh.vertices
        away = [np.linalg.norm(vertices - corner, axis=1).min() for corner in corners]
        assert max(away) < most
    assert (
        max(np.linalg.norm(free.shell.mesh.vertices - corner, axis=1).min() for corner in corners)
        > 1e-3
    )
    assert held.figures["fixed vertices"] == (4, "")


def level():
    """Vertices of z = −y²/2R − x²(y + 1500)/c, which holds the line y = −1500, in the box."""
    mesh = MESHES["cut"]
    x, y, _ = mesh.vertices.T
    z = -y * y / (2 * RADIUS) - x * x * (y + 1500) / 3e7
    side = np.flatnonzero(np.abs(y + 1500) < 1e-9)
    points = np.column_stack([x, y, z])
    return PolyMesh(points, mesh.corners, mesh.starts), side[np.argsort(x[side])]


def test_a_straight_border_becomes_one_plane_and_holds_its_end(tmp_path):
    mesh, side = level()
    write_mesh(mesh, tmp_path / "level.obj")
    end = mesh.vertices[side[-1]]
    made = formed(tmp_path, "level.obj", f"fixed = {places([end])}").shell.mesh.vertices
    assert np.linalg.norm(made - end, axis=1).min() < 1e-6
    near = made[np.abs(made[:, 1] + 1500) < 60]  # within the plane panels bend off the line
    assert len(near) == len(side)
    sizes = np.linalg.svd(near - near.mean(axis=0), compute_uv=False)
    assert sizes[2] < 1e-7 < 1.0 < sizes[1]


def test_within_a_straight_border_nothing_can_be_held(tmp_path):
    mesh, side = level()
    write_mesh(mesh, tmp_path / "level.obj")
    held = places(mesh.vertices[side[[2, 4]]])
    with pytest.raises(DesignError, match=r"2 fixed vertices \(mesh.fixed\) .*straight.* its ends"):
        formed(tmp_path, "level.obj", f"fixed = {held}")


def test_a_planar_mesh_with_nearly_straight_sides_stays_as_it_is(tmp_path):
    flat = MESHES["cut"].vertices * [1, 1, 0.01]  # sides bend by less than a thousandth
    write_mesh(PolyMesh(flat, MESHES["cut"].corners, MESHES["cut"].starts), tmp_path / "flat.obj")
    inside = flat[np.argsort(np.linalg.norm(flat[:, :2], axis=1))[:3]]
    made = formed(tmp_path, "flat.obj", f"fixed = {places(inside)}")
    # The planes of the sides, plumb in the file, are made upright: 2.5 mm times their tilt.
    assert made.figures["vertices moved, at most"][0] < 0.02
    assert made.figures["fixed vertices moved, at most"][0] < 1e-6
    assert made.figures["panels left out at the border"] == (0, "")


def test_points_and_reference_are_in_the_unit_of_the_mesh(folder):
    drawn = MESHES["dome"].polygon(HELD)
    write_mesh(
        PolyMesh(MESHES["dome"].vertices / 1000, MESHES["dome"].corners, MESHES["dome"].starts),
        folder / "metres.off",
    )
    one = formed(folder, "dome.obj", f'fixed = {places(drawn)}\nreference = "exact.off"')
    points = "[" + ", ".join(str((p / 1000).tolist()) for p in drawn) + "]"
    more = f'fixed = {points}\nreference = "metres.off"'
    other = formed(folder, "metres.obj", more, unit='unit = "m"')
    assert other.figures["fixed vertices moved, at most"][0] < 1e-9
    assert np.abs(one.shell.mesh.vertices - other.shell.mesh.vertices).max() < 1e-4


# -- a reference -----------------------------------------------------------------------------------


def plane_misses(folder, more, out):
    """How far the corners of the panels' solids are off the tangent planes of the formula."""
    asked = design(folder, "dome.obj", more, '[beams]\nkind = "none"')
    built = phexfab.build(asked)
    made = built.write(out)
    sites, worst = honeycomb(4), []
    for solid in cq.importers.importStep(str(made / "parts.step")).solids().vals():
        points = np.array([v.toTuple() for v in solid.Vertices()])
        site = sites[np.linalg.norm(sites - points[:, :2].mean(axis=0), axis=1).argmin()]
        steep = np.sqrt(1 + (site @ site) / RADIUS**2)
        height = (points[:, 2] - tangent(site, points[:, :2])) / steep
        low = np.sort(height)[: len(points) // 2]  # the side of the sheet on the planes of M
        worst.append(np.abs(low).max())
    return built, np.array(worst), made


def test_panels_keep_close_to_a_mesh(folder, tmp_path):
    free, far, _ = plane_misses(folder, "", tmp_path / "free")
    more = 'reference = "exact.off"\ncloseness = 1e4'
    built, near, made = plane_misses(folder, more, tmp_path / "near")
    # Vertices come near the faces, and with them the panels near the planes of the formula.
    assert len(near) == MESHES["dome"].n_faces and np.median(near) < np.median(far) / 4
    after = built.figures["off the reference now, at most"][0]
    assert after < built.figures["off the reference before, at most"][0] / 10
    check = {c.name: c.value for c in built.checks}["surface_distance"]
    assert check == pytest.approx(after) and "off the reference now, at most" not in free.figures
    assert len(list(outlines(made))) == len(near)
    # Each flat outline is as large as the face of its solid, so that sheets show what is near.
    solids = cq.importers.importStep(str(made / "parts.step")).solids().vals()
    faces = [max(face.Area() for face in solid.Faces()) for solid in solids]
    assert np.sort(faces) == pytest.approx(np.sort([Polygon(o).area for o in outlines(made)]))


@pytest.mark.parametrize("file", ["roof.step", "halves.step"])
def test_panels_keep_close_to_faces_of_a_step_file(folder, file):
    free, near = formed(folder, "dome.obj"), formed(folder, "dome.obj", f'reference = "{file}"')

    def off(found):  # of z = TOP − r²/2R, by its formula: |f|/|grad f| to first order
        x, y, z = found.shell.mesh.vertices.T
        return np.abs(z - TOP + (x * x + y * y) / (2 * RADIUS)) / np.hypot(
            1, np.hypot(x, y) / RADIUS
        )

    most = near.figures["off the reference now, at most"][0]
    assert off(near).max() < off(free).max() / 5
    assert most == pytest.approx(off(near).max(), rel=0.02, abs=1e-3)
    assert near.deviation.max() == most
    exact = formed(folder, "dome.obj", f'reference = "{file}"\ncloseness = 0')
    assert np.abs(exact.shell.mesh.vertices - free.shell.mesh.vertices).max() < 1e-6
    assert exact.deviation.max() == pytest.approx(off(free).max(), rel=0.02)


# -- what is refused -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("mesh", "more", "words"),
    [
        ("dome.obj", "fixed = [0, 17]", "mesh.fixed = [0, 17].*not numbers.*welded; write"),
        ("dome.obj", 'fixed = "corner"', 'mesh.fixed = "corner".*"corners", "border" or points'),
        ("dome.obj", "fixed = [[0, 0]]", "mesh.fixed.*three coordinates"),
        ("dome.obj", "fixed = []", "mesh.fixed = .*vertices or their places"),
        (
            "dome.obj",
            "fixed = [[0, 0, 900], [5000, 0, 0]]",
            "mesh.fixed = .*2 of 2 points have no vertex within 2%.*worst [5000.0, 0.0, 0.0]: "
            "the nearest vertex is at",
        ),
        ("dome.obj", 'fixed = "corners"', 'mesh.fixed = "corners": .*ragged.*give points'),
        ("dome.obj", 'fixed = "border"', "mesh.fixed.*has 4 fixed corners.*off a plane; free one"),
        ("cut.obj", 'fixed = "border"', "mesh.fixed.*stretch of the border.*three of them"),
        ("cut.obj", 'fixed = "corners"\nborder = "drop"', "4 of 4 fixed.*(mesh.fixed).*fix others"),
        ("dome.obj", 'reference = "no.step"', 'mesh.reference = "no.step": there is no such file'),
        ("dome.obj", 'reference = "house.txt"', 'mesh.reference = "house.txt": ".txt".*.step'),
        ("dome.obj", 'reference = "empty.obj"', 'mesh.reference = "empty.obj": .*no faces'),
        ("dome.obj", 'reference = "bad.step"', 'mesh.reference = "bad.step": .*no readable STEP'),
        ("dome.obj", 'reference = "metres.obj"', 'mesh.reference = "metres.obj": half.*one unit'),
        ("dome.obj", "closeness = 3", "mesh.closeness = 3.*add reference"),
    ],
)
def test_what_cannot_be_held_is_named_with_a_remedy(folder, mesh, more, words):
    for name in ("house.txt", "empty.obj", "bad.step"):
        (folder / name).write_text("nothing\n")
    pattern = re.escape(words).replace(r"\.\*", ".*")
    with pytest.raises(DesignError, match=re.compile(pattern, re.DOTALL)):
        formed(folder, mesh, more)


def test_four_corners_of_a_face_off_a_plane_are_named_by_place(folder):
    mesh = read_polygons(folder / "dome.obj")
    other = (HELD + 1) % mesh.n_faces
    with pytest.raises(
        DesignError, match=r"has 6 fixed corners that .* off a plane; free one .*at"
    ):
        formed(folder, "dome.obj", f"fixed = {places(mesh.polygon(other))}")


def test_other_methods_do_not_take_them():
    text = '[surface]\nstep = "a.step"\n[mesh]\nmethod = "dupin"\n{}\n[lattice]\npanel_size = 600\n'
    for line in ('fixed = "corners"', 'reference = "b.step"'):
        with pytest.raises(DesignError, match=f'mesh.{line}.*belongs to mesh.method = "planarise"'):
            parse_design(text.format(line))


# -- remedies --------------------------------------------------------------------------------------


def test_what_a_given_mesh_is_told_exists_there_and_helps(tmp_path):
    """Cells of scattered sites have sharp corners; relaxed as the remedy says they pass."""
    sites = honeycomb(4)
    apart = sites + np.random.default_rng(2).uniform(-0.42, 0.42, sites.shape) * SIZE
    inner = np.linalg.norm(sites, axis=1) < 2.2 * SIZE
    write_mesh(cells(apart, inner), tmp_path / "wild.obj")
    for _ in range(12):  # Lloyd's method: edges become even, angles about 120°
        diagram = Voronoi(apart)
        for k in np.flatnonzero(np.linalg.norm(sites, axis=1) < 3.2 * SIZE):
            region = diagram.vertices[diagram.regions[diagram.point_region[k]]]
            apart[k] = np.array(Polygon(region).convex_hull.centroid.coords)[0]
    write_mesh(cells(apart, inner), tmp_path / "even.obj")
    limits = (
        "[checks]\nbeam_angle = 75\nmitre_angle = 50\nshortest_edge = 100\nsurface_distance = 60"
    )
    names = {"beam_angle", "mitre_angle", "shortest_edge"}
    wild, even = (
        {c.name: c for c in phexfab.check(design(tmp_path, name, "", limits)) if not c.ok}
        for name in ("wild.obj", "even.obj")
    )
    assert names <= set(wild) and not names & set(even)
    for check in wild.values():
        assert "Remedy" in check.note
        for word in ("row ratio", "rectangle", "lattice", "rows", "panel size"):
            assert word not in check.note.partition("Remedy")[2], check.note
    assert "hub" in wild["mitre_angle"].note and "120°" in wild["beam_angle"].note


def test_remedies_for_meshes_and_covered_surfaces_name_no_lattice():
    for name, kind in KINDS.items():
        if name in ("minimality", "rim_distance", "rim_corner", "rim_beam_angle", "rim_mitre"):
            continue  # of films with a rim only
        for origin in ("given", "covered"):
            said = kind.remedy_for(origin)
            assert said and not re.search(r"row ratio|rectangle|coarsen|lattice", said), name
    assert "row ratio" in KINDS["beam_angle"].remedy_for("lattice")

"""Every method of chapter 5 from the design file to planar panels with face offsets."""

import re
from pathlib import Path

import cadquery as cq
import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import Voronoi
from shapely import Polygon, box

import phexfab
from phexfab.design import parse_design
from phexfab.errors import DesignError, LatticeError, MeshError, PhexError, SurfaceError
from phexfab.fabrication.geometry_checks import check_geometry
from phexfab.forming import form
from phexfab.mesh.half_edges import twins
from phexfab.mesh.io import write_mesh
from phexfab.mesh.measures import face_normals, simple_faces
from phexfab.mesh.polygons import read_polygons
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.offset import node_axes, offset
from phexfab.parallel.simple import is_simple
from phexfab.remesh.fewer_panels import firm_faces, firm_shell, without_panels
from phexfab.remesh.panel_shell import panel_shell
from phexfab.remesh.planarity.planarise import planarise

EXAMPLES = Path(__file__).parents[1] / "examples"


def bowl(x, y):
    return -(x * x / 1.3 + y * y) / 22000


def saddle(x, y):
    return (x * x / 1.3 - y * y) / 22000 + 100 * np.sin(x / 4000)


def monkey(x, y):
    return (x**3 - 3 * x * y * y) / 3e7


def wave(x, y):
    return -(y * y) / 12000 + 200 * np.cos(x / 2600)


def save_face(path, height, width=5000.0, depth=4000.0):
    xs, ys = np.linspace(-width, width, 9), np.linspace(-depth, depth, 9)
    points = [[cq.Vector(x, y, float(height(x, y))) for y in ys] for x in xs]
    face = cq.Face.makeSplineApprox(points, tol=1e-3, minDeg=3, maxDeg=5)
    cq.exporters.export(cq.Workplane(obj=face), str(path))


def save_triangles(path, height, n=25):
    x, y = np.meshgrid(np.linspace(-5000, 5000, n), np.linspace(-4000, 4000, n), indexing="ij")
    k = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    corners = np.concatenate(
        [np.stack([k, k + n, k + n + 1], 1), np.stack([k, k + n + 1, k + 1], 1)]
    )
    points = np.column_stack([x.ravel(), y.ravel(), height(x, y).ravel()])
    write_mesh(PolyMesh.from_faces(points, corners), path)


def dome_faces(cut=None, noise=0.0, hole=False, size=700.0, reach=3200.0):
    """Tangent planes of a paraboloid above a honeycomb: exactly planar; perhaps cut to a box."""
    i, j = (a.ravel() for a in np.meshgrid(np.arange(-9, 10), np.arange(-9, 10)))
    sites = size * np.column_stack([i + (j % 2) / 2, j * np.sqrt(0.75)])
    sites = sites[np.linalg.norm(sites, axis=1) < 5200]
    cells = Voronoi(sites)
    number, points, faces = {}, [], []
    for s, region in zip(sites, cells.point_region, strict=True):
        ring = cells.regions[region]
        inner = np.linalg.norm(s) < reach and not (hole and np.linalg.norm(s) < 1)
        if not inner or -1 in ring:
            continue
        cell = Polygon(cells.vertices[ring])
        if cut is not None:
            cell = cell.intersection(cut)
            if cell.area < 1:
                continue
        face = []
        for x, y in np.array(cell.normalize().exterior.coords)[-1:0:-1]:
            key = (round(x, 3), round(y, 3))
            if key not in number:
                number[key] = len(points)
                points.append([x, y, 900 - (2 * np.dot(s, (x, y)) - s @ s) / 16000])
            face.append(number[key])
        faces.append(face)
    moved = np.array(points) + noise * np.random.default_rng(3).normal(size=(len(points), 3))
    return PolyMesh.from_faces(moved, faces)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("surfaces")
    for name, height in (("bowl", bowl), ("saddle", saddle), ("wave", wave)):
        save_face(path / f"{name}.step", height)
    save_triangles(path / "bowl.obj", bowl)
    save_face(path / "monkey.step", monkey, 3000.0, 3000.0)
    shrink = cq.Matrix([[1, 0, 0, 0], [0, 0.8, 0, 0], [0, 0, 0.7, 0]])
    solid = cq.Workplane().sphere(8000).val().transformGeometry(shrink)
    block = cq.Workplane().box(6000, 6000, 5000).translate((-8000, 500, 300)).val()
    cq.exporters.export(cq.Workplane(obj=solid.intersect(block)), str(path / "ellipsoid.step"))
    write_mesh(dome_faces(noise=5.0), path / "noisy.obj")
    write_mesh(planarise(dome_faces()).mesh, path / "planar.obj")
    return path


def design(folder, surface, method, more="", size=800, rest=""):
    kind = "step" if surface.endswith(".step") else "mesh"
    return parse_design(
        f'[surface]\n{kind} = "{surface}"\n{rest}[mesh]\nmethod = "{method}"\n{more}\n[lattice]\n'
        f'panel_size = {size}\n[offset]\ntype = "face"\n[nesting]\npacker = "shelf"\n',
        source=str(folder / "house.toml"),
    )


WAYS = [
    ("wave.step", "dupin", "toward = [1, 0, 0]"),
    ("saddle.step", "dupin", 'conjugation = "progressive"\nborder = "drop"'),
    ("bowl.step", "dupin", "closeness = 1"),
    ("bowl.obj", "dupin", ""),
    ("saddle.step", "conjugate", ""),
    ("bowl.step", "conjugate", 'border = "drop"'),
    ("saddle.step", "tangent", ""),
    ("bowl.step", "tangent", 'conjugation = "progressive"'),
    ("saddle.step", "duality", ""),
    ("bowl.step", "duality", "centre = [0, 0, -14000]"),
    ("saddle.step", "support", ""),
    ("bowl.obj", "support", ""),
    ("bowl.step", "parallel", 'start = "planar.obj"'),
    ("noisy.obj", "planarise", ""),
    ("noisy.obj", "planarise", 'border = "drop"'),
]


@pytest.mark.parametrize(("surface", "method", "more"), WAYS)
def test_a_method_gives_planar_simple_panels_with_face_offsets(folder, surface, method, more):
    asked = design(folder, surface, method, more)
    formed = form(asked, lambda *_: None)
    shell, mesh = formed.shell, formed.shell.mesh
    assert shell.kind == "face" and mesh.n_faces >= 30 and is_simple(mesh)
    assert simple_faces(mesh).all()
    length = np.linalg.norm(np.diff(mesh.vertices[shell.edges[:, :2]], axis=1)[:, 0], axis=1)
    moved = offset(shell, -90.0).mesh.vertices - mesh.vertices
    for f in range(mesh.n_faces):
        flat = mesh.polygon(f) - mesh.polygon(f).mean(axis=0)
        normal = np.linalg.svd(flat)[2][2]
        assert np.abs(flat @ normal).max() <= 1e-10 * length.mean()
        # every corner of the offset panel lies 90 mm behind the panel's plane
        assert np.abs(np.abs(moved[mesh.face(f)] @ normal) - 90.0).max() < 1e-7
    # Both node axes of a beam lie in one plane with it.
    ends = shell.edges[:, :2]
    along = (mesh.vertices[ends[:, 1]] - mesh.vertices[ends[:, 0]]) / length[:, None]
    axes = node_axes(shell)
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    volume = np.einsum("ei,ei->e", along, np.cross(axes[ends[:, 0]], axes[ends[:, 1]]))
    assert np.abs(volume).max() < 1e-9
    assert formed.deviation is not None and formed.deviation.shape == (len(mesh.vertices),)
    assert formed.deviation.max() < 25


@pytest.mark.parametrize("method", ["dupin", "conjugate", "tangent", "support", "duality"])
def test_panels_have_the_size_asked_for(folder, method):
    formed = form(design(folder, "saddle.step", method, size=750), lambda *_: None)
    shell = formed.shell
    panels, starts, _, beyond = shell.rings
    own = np.repeat(panels, np.diff(starts))
    inner = np.isin(beyond, panels)
    away = np.linalg.norm(shell.points[beyond] - shell.points[own], axis=1)[inner]
    assert np.median(away) == pytest.approx(750, rel=0.12)


def test_panels_on_a_trimmed_ellipsoid_stay_within_its_outline(folder):
    text = design(folder, "ellipsoid.step", "power", size=600, rest="face = 1\n")
    shells = []
    for k in range(1, 7):  # the box adds planes, which are no ellipsoids
        asked = text.model_copy(update={"surface": text.surface.model_copy(update={"face": k})})
        asked = asked.read_from(str(folder / "house.toml"), "")
        try:
            shells.append(form(asked, lambda *_: None).shell)
        except PhexError:
            continue
    (shell,) = shells
    low, high = shell.mesh.vertices.min(axis=0), shell.mesh.vertices.max(axis=0)
    # The block reaches from −2500 to 3500 in y and −2200 to 2800 in z: no panel leaves it by more
    # than its planes' distance from the surface, few stay away by two panels.
    assert low[1] > -2510 and high[1] < 3510 and low[2] > -2210 and high[2] < 2810
    assert low[1] < -1300 and high[1] > 2300 and low[2] < -1000 and high[2] > 1600
    # Tangent planes of x²/a² + y²/b² + z²/c² = 1: h² = Σ (a n)².
    half = np.array([8000.0, 6400.0, 5600.0])
    heights = np.linalg.norm(shell.normals * half, axis=1)
    assert np.abs(heights / np.abs(shell.heights) - 1).max() < 1e-7


@pytest.mark.parametrize("method", ["conjugate", "dupin"])
def test_pieces_about_a_flat_point_are_all_panels_of_the_shell(folder, method):
    formed = form(design(folder, "monkey.step", method, size=500), lambda *_: None)
    mesh = formed.shell.mesh
    beyond = twins(mesh)
    inner = np.flatnonzero(beyond >= 0)
    pairs = np.column_stack([mesh.face_of_corner[inner], mesh.face_of_corner[beyond[inner]]])
    links = coo_array((np.ones(len(pairs)), pairs.T), shape=(mesh.n_faces,) * 2)
    count, piece = connected_components(links, directed=False)
    sizes = np.bincount(piece)
    assert count >= 2 and formed.figures["pieces"] == (count, "")
    assert sizes.min() >= 0.1 * sizes.max()
    # A vertex belongs to one piece; together they lie on more than one side of the flat point.
    owner = np.unique(np.column_stack([mesh.corners, piece[mesh.face_of_corner]]), axis=0)
    assert len(owner) == len(mesh.vertices)
    assert formed.figures["share of the surface covered"][0] > 0.45
    assert simple_faces(mesh).all()
    assert all(
        check.ok
        for check in check_geometry(formed.shell, minimal=False)
        if check.name in ("planarity", "parallelism", "simple_faces")
    )


def test_a_free_form_shell_is_built_to_step_and_dxf(folder, tmp_path):
    write_mesh(dome_faces(noise=3.0, reach=1300.0), folder / "small.obj")
    built = phexfab.build(design(folder, "small.obj", "planarise", size=700))
    assert built.ok and built.surface is None
    assert "minimality" not in {check.name for check in built.checks}
    assert {"planarity", "surface_distance", "offset_spread"} <= {c.name for c in built.checks}
    made = built.write(tmp_path / "out")
    step = (made / "parts.step").read_text()
    assert step.count("MANIFOLD_SOLID_BREP(") == len(built.parts.panels) + len(built.parts.beams)
    assert len(list((made / "sheets").glob("*.dxf"))) > 1


def test_the_roof_bends_both_ways():
    found = form(phexfab.load_design(EXAMPLES / "freeform-roof.toml"), lambda *_: None)
    gauss = found.surface.bending(found.surface.nearest(found.shell.points)).gauss
    assert gauss.min() < 0 < gauss.max()


# -- the border ------------------------------------------------------------------------------------


def test_whole_panels_of_a_cut_dome_end_in_upright_planes():
    mesh = dome_faces(cut=box(-2100, -1700, 2300, 1900))
    made = panel_shell(mesh)
    shell = made.shell
    assert len(shell.panels) == mesh.n_faces  # none is lost
    assert made.moved.max() < 1e-6  # planar as it came
    extra = shell.normals[mesh.n_faces :]
    assert len(extra) == 4 and np.abs(extra[:, 2]).max() < 1e-9
    # Face offsets keep the sides nearly where they are, as the axes stand nearly upright there.
    normals = face_normals(shell.mesh)
    axes = node_axes(shell)
    total = np.zeros_like(axes)
    np.add.at(total, shell.mesh.corners, normals[shell.mesh.face_of_corner])
    cosine = np.einsum("ij,ij->i", axes, total)
    cosine /= np.linalg.norm(axes, axis=1) * np.linalg.norm(total, axis=1)
    assert np.degrees(np.arccos(cosine.min())) < 25


def test_kept_panels_of_a_ragged_border_move_little():
    mesh = dome_faces()
    made = panel_shell(mesh)
    assert len(made.shell.panels) == mesh.n_faces
    assert made.moved.max() < 60  # the runs of four vertices are brought into planes
    fewer = panel_shell(mesh, border="drop")
    assert len(fewer.shell.panels) < mesh.n_faces and fewer.moved.max() < 1e-6


def test_a_hole_without_a_free_corner_asks_for_drop():
    mesh = dome_faces(hole=True)
    said = r'1 borders two faces meet, first the border of 6 edges around \[.*take border = "drop"'
    with pytest.raises(MeshError, match=said):
        panel_shell(mesh)
    assert len(panel_shell(mesh, border="drop").shell.panels) > 0


def test_leaving_out_panels(folder):
    shell = form(design(folder, "bowl.step", "support"), lambda *_: None).shell
    middle = shell.panels[np.linalg.norm(shell.points[shell.panels, :2], axis=1).argmin()]
    fewer = without_panels(shell, [middle])
    assert len(fewer.panels) == len(shell.panels) - 3  # a hole is three panels that meet
    gap = np.linalg.norm(fewer.points[fewer.panels] - shell.points[middle], axis=1)
    assert gap.min() > 0
    half = shell.panels[np.abs(shell.points[shell.panels, 0]) < 700]
    piece = firm_shell(without_panels(shell, half))
    side = piece.points[piece.panels, 0]
    assert (side > 0).all() or (side < 0).all()


def test_strips_of_single_faces_are_not_firm():
    # 0-1-2 is a triangle of faces, 3 and 4 hang on it, 5 and 6 are another piece.
    pairs = np.array([[0, 1], [1, 2], [2, 0], [2, 3], [3, 4], [5, 6]])
    both = np.concatenate([pairs, pairs[:, ::-1]])
    assert firm_faces(both, 7).tolist() == [True] * 3 + [False] * 4
    more = np.concatenate([both, [[5, 7], [7, 5], [6, 7], [7, 6]]])  # two triangles of faces
    apart = np.array([[f, 10 * f] for f in range(8)])
    kept = firm_faces(more, 8, places=apart, share=0.5)
    assert kept.tolist() == [True] * 3 + [False] * 2 + [True] * 3
    assert firm_faces(more, 8, places=apart, share=1.1).sum() == 3
    touching = np.concatenate([apart, [[1, 99], [6, 99]]])
    assert firm_faces(more, 8, places=touching, share=0.5).sum() == 3
    strip = np.array([[0, 1], [1, 0], [1, 2], [2, 1], [3, 4], [4, 3]])
    assert firm_faces(strip, 5).tolist() == [True] * 3 + [False] * 2


# -- what is refused -------------------------------------------------------------------------------


def test_what_is_left_out_suits_the_method():
    plain = STEP + '[mesh]\nmethod = "dupin"\n[lattice]\npanel_size = 600\n'
    found = parse_design(plain, source="house.toml")
    assert found.offset.type == "face" and found.checks.parallelism == 1e-9
    given = parse_design(plain + "[checks]\nparallelism = 1e-7\n", source="house.toml")
    assert given.checks.parallelism == 1e-7 and given.offset.type == "face"
    minimal = parse_design('[surface]\nname = "enneper"\n' + SIZE.split("[offset]")[0])
    assert minimal.offset.type == "edge" and minimal.checks.parallelism is None
    # Nor is it asked for where something else is wrong.
    said = refusal(plain.replace("dupin", "parallel"))
    assert "mesh.start" in said and "offset" not in said


def test_triangles_are_no_panels_to_planarise(folder):
    with pytest.raises(DesignError, match=r'bowl.obj": has triangles only.*method = "dupin"'):
        form(design(folder, "bowl.obj", "planarise"), lambda *_: None)


def refusal(text):
    with pytest.raises(DesignError) as error:
        parse_design(text, source="house.toml")
    return str(error.value)


STEP = '[surface]\nstep = "a.step"\n'
SIZE = '[lattice]\npanel_size = 600\n[offset]\ntype = "face"\n'


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (STEP + SIZE, ["mesh.method", 'add method = "dupin"']),
        (
            STEP + '[mesh]\nmethod = "dupin"\n' + SIZE.replace("face", "edge"),
            ['offset.type = "edge"', "face offsets only", 'write type = "face"'],
        ),
        (
            '[surface]\nname = "enneper"\n[mesh]\nmethod = "dupin"\n' + SIZE,
            ['mesh.method = "dupin"', "belongs to a free-form surface"],
        ),
        (STEP + '[mesh]\nmethod = "planarise"\n' + SIZE, ["mesh.method", 'mesh = "panels.obj"']),
        (
            '[surface]\nmesh = "a.obj"\n[mesh]\nmethod = "power"\n' + SIZE,
            ["mesh.method", "ellipsoids only"],
        ),
        (STEP + '[mesh]\nmethod = "parallel"\n' + SIZE, ["mesh.start", "add start"]),
        (
            STEP + '[mesh]\nmethod = "support"\ncrossing = "drop"\n' + SIZE,
            ['mesh.crossing = "drop"', 'belongs to mesh.method = "dupin"'],
        ),
        (STEP + '[mesh]\ntoward = [1, 0, 0]\nmethod = "power"\n' + SIZE, ["mesh.toward"]),
        (STEP + '[mesh]\ntoward = 3\nmethod = "dupin"\n' + SIZE, ["three numbers are needed"]),
        (STEP + '[mesh]\nmethod = "dupine"\n' + SIZE, ['did you mean "dupin"']),
        (
            STEP + '[mesh]\nmethod = "dupin"\n' + SIZE.replace("600", "600\nturn = 20"),
            ["lattice.turn = 20", "leave it out"],
        ),
        (
            STEP + '[mesh]\nmethod = "dupin"\n[border]\ndirection = "plumb"\n' + SIZE,
            ['border.direction = "plumb"', "minimal surfaces"],
        ),
        (
            STEP + "face = 0\n" + '[mesh]\nmethod = "dupin"\n' + SIZE,
            ["surface.face = 0", "at least 1"],
        ),
        (STEP + 'scale = 3\n[mesh]\nmethod = "dupin"\n' + SIZE, ["surface.scale", "own size"]),
        ('[surface]\nrim = "a.csv"\nface = 2\n' + SIZE, ["surface.face = 2", "belongs to step"]),
        (
            '[surface]\nstep = "a.step"\nmesh = "a.obj"\n[mesh]\nmethod = "dupin"\n' + SIZE,
            ["several surfaces are given"],
        ),
    ],
)
def test_keys_that_do_not_go_together(text, words):
    message = refusal(text)
    for word in words:
        assert word in message, message


@pytest.mark.parametrize(
    ("surface", "method", "more", "error", "words"),
    [
        ("wave.step", "support", "", SurfaceError, 'mesh.method = "support".*parabolic'),
        ("wave.step", "duality", "", SurfaceError, 'mesh.method = "duality".*parabolic'),
        ("bowl.step", "power", "", SurfaceError, "ellipsoids only"),
        ("bowl.step", "parallel", 'start = "noisy.obj"', DesignError, "mesh.start.*planarise"),
        (
            "bowl.step",
            "parallel",
            'start = "no.obj"',
            DesignError,
            'mesh.start = "no.obj": there is no',
        ),
        ("no.step", "dupin", "", DesignError, 'surface.step = "no.step": there is no such file'),
        ("ellipsoid.step", "dupin", "", DesignError, "has 6 faces; add face = 1"),
        ("quads.obj", "planarise", "", DesignError, "surface.mesh.*vertices inside.*with 4"),
        ("noisy.obj", "dupin", "", PhexError, "noisy.obj.*corners"),
    ],
)
def test_a_surface_that_does_not_suit_the_method(folder, surface, method, more, error, words):
    x, y = np.meshgrid(np.arange(4.0) * 800, np.arange(4.0) * 800, indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), bowl(x, y).ravel()])
    quads = [[k, k + 4, k + 5, k + 1] for k in range(12) if k % 4 < 3]
    write_mesh(PolyMesh.from_faces(points, quads), folder / "quads.obj")
    with pytest.raises(error, match=re.compile(words, re.DOTALL)):
        form(design(folder, surface, method, more), lambda *_: None)


def test_a_face_number_beyond_the_file(folder):
    asked = design(folder, "bowl.step", "dupin", rest="face = 3\n")
    with pytest.raises(DesignError, match=r"surface.face = 3: bowl.step has 1 faces"):
        form(asked, lambda *_: None)


def test_panels_too_large_for_the_surface(folder):
    save_face(folder / "small.step", bowl, 900.0, 900.0)
    with pytest.raises(LatticeError, match="smaller"):
        form(design(folder, "small.step", "tangent", size=1400), lambda *_: None)


def test_rims_in_place_of_a_free_form_surface_are_refused(folder):
    rim = 3000 * np.column_stack([np.cos(np.arange(12)), np.sin(np.arange(12)), np.zeros(12)])
    with pytest.raises(DesignError, match="rims are"):
        phexfab.build(
            design(folder, "bowl.step", "dupin"), rims=rim[np.argsort(np.arange(12) % (2 * np.pi))]
        )


def test_lengths_of_a_mesh_in_another_unit(folder):
    mesh = read_polygons(folder / "noisy.obj")
    write_mesh(PolyMesh(mesh.vertices / 1000, mesh.corners, mesh.starts), folder / "metres.obj")
    one = form(design(folder, "noisy.obj", "planarise"), lambda *_: None)
    other = form(
        design(folder, "metres.obj", "planarise", "weld = 0.1", rest='unit = "m"\n'),
        lambda *_: None,
    )
    assert np.abs(one.shell.mesh.vertices - other.shell.mesh.vertices).max() < 1e-5

"""The walk from a design to a cut shell: borders, free sides, meshes, periodic pieces, refusals."""

import sys
from pathlib import Path

import ezdxf
import numpy as np
import pytest
from scipy.spatial import cKDTree

from phexfab.design.load import make_design
from phexfab.errors import DesignError, LatticeError, MeshError, PhexError, SurfaceError
from phexfab.fabrication.geometry_checks import bad_faces, node_axis_torsion
from phexfab.forming import form, panel_sizes
from phexfab.mesh.measures import relative_planarity, signed_areas
from phexfab.minimal.sphere import rotation_to_north
from phexfab.parallel.curvature import minimality
from phexfab.parallel.offset import admissible_interval
from phexfab.parallel.slivers import Patchwork
from phexfab.pipeline import build
from phexfab.surface.periodic.mesh import periodic_film
from phexfab.surface.rims.inward import inward_corners, rounded_inward
from phexfab.surface.rims.rim import Rim

TURN = 2 * np.pi * np.arange(160) / 160
ANY_RIM = {"rim_distance": 1e4, "rim_corner": 0.0, "rim_beam_angle": 0.0, "offset_interval": 1.0}
"""With these limits the first cut does."""


def asked(surface, panel_size=500.0, kind="face", source="design", **tables):
    return make_design(
        {
            "surface": surface,
            "lattice": {"panel_size": panel_size},
            "offset": {"type": kind},
            "panels": {"gap": 4.0, "thickness": 4.0},
            "beams": {"kind": "none"},
            "sheets": {"panels": {"length": 9000.0, "width": 6000.0}},
        }
        | tables,
        source=str(source),
    )


def formed(design, rims=()):
    """The form, with what every shell promises."""
    found = form(design, lambda stage, done, total: None, rims)
    for one in (found.shell, found.shell.whole):
        assert relative_planarity(one.mesh).max() <= 1e-12
        assert minimality(one).max() <= 1e-10
    assert not bad_faces(found.shell).any()
    assert node_axis_torsion(found.shell).max() <= 1e-6
    return found


def points_of(lobes, size=6000.0, height=0.15):
    return size * np.stack([np.cos(TURN), np.sin(TURN), height * np.cos(lobes * TURN)], axis=1)


def inline(lobes, **more):
    return {"rim": points_of(lobes, **more).tolist()}


def saddle_half(size=6000.0):
    """Half of a saddle's rim, closed by a curve in the plane y = 0: sides 0 (rim) and 1 (plane)."""
    angle = np.linspace(0, np.pi, 81)
    half = size * np.stack([np.cos(angle), np.sin(angle), 0.2 * np.cos(2 * angle)], axis=1)
    x = np.linspace(-1, 1, 41)[1:-1]
    mirror = size * np.stack([x, 0 * x, 0.2 * x**2 + 0.04 * (1 - x**2)], axis=1)
    return np.vstack([half, mirror]), [0, 80]


# -- cut borders -----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["face", "edge", "vertex"])
def test_the_border_lies_in_the_rim_planes_near_the_rim(kind):
    found = formed(asked(inline(3), 600.0, kind))
    shell = found.shell
    rim = np.flatnonzero(shell.parents < 0)
    table, vertices = shell.triangles[shell.used_vertices], shell.mesh.vertices
    cut = np.isin(table, rim)
    assert np.array_equal(cut.any(axis=1), shell.rim_vertices)
    row, column = np.nonzero(cut)
    plane = table[row, column]
    off = np.einsum("ij,ij->i", shell.normals[plane], vertices[row]) - shell.heights[plane]
    assert np.abs(off).max() < 1e-8
    # The given curve, finely sampled, against finely sampled border edges: either way.
    border = shell.edges[shell.edges[:, 3] < 0]
    share = np.linspace(0, 1, 60)[:, None, None]
    built = (vertices[border[:, 0]] * (1 - share) + vertices[border[:, 1]] * share).reshape(-1, 3)
    fine = np.linspace(0, 2 * np.pi, 6000, endpoint=False)
    given = 6000.0 * np.stack([np.cos(fine), np.sin(fine), 0.15 * np.cos(3 * fine)], axis=1)
    worst = max(
        float(cKDTree(given).query(built)[0].max()), float(cKDTree(built).query(given)[0].max())
    )
    assert worst <= found.rim_distance + 4.0
    assert worst > 0.5 * found.rim_distance
    assert found.rim_distance < 0.06 * 600


def test_the_area_of_panels_goes_to_that_of_the_film():
    off = []
    for panel_size in (1200.0, 425.0):
        found = formed(asked(inline(3), panel_size, checks=ANY_RIM))
        film = found.figures["film area"][0]
        off.append(abs(signed_areas(found.shell.mesh).sum() / 1e6 / film - 1))
    # What is left at small panels is the rim's: no edge there is shorter than the checks allow.
    assert off[0] < 4e-3 and off[1] < 0.4 * off[0], off


def test_plumb_cuts_stand_plumb():
    found = formed(asked(inline(3), 600.0, border={"direction": "plumb"}))
    planes = found.shell.normals[found.shell.parents < 0]
    assert np.abs(planes[:, 2]).max() < 1e-12


def test_panels_keep_the_size_that_was_asked_for():
    sizes = panel_sizes(formed(asked(inline(2), 500.0)).shell)
    assert np.median(sizes) == pytest.approx(500.0, rel=0.2)


def test_a_design_ends_in_parts_and_checks():
    made = build(asked(inline(2, size=4000.0), 700.0, checks={"rim_distance": 60.0}))
    names = {check.name for check in made.checks if not check.ok}
    assert not names & {"planarity", "minimality", "simple_faces", "rim_distance", "parallelism"}
    assert len(made.parts.panels) == len(made.shell.panels)


# -- other films -----------------------------------------------------------------------------------


def test_a_free_side_ends_in_its_plane_at_a_right_angle():
    points, corners = saddle_half()
    rim = Rim.through(points, corners=corners)
    found = formed(asked({"rim": points.tolist(), "free": [1]}, 600.0), [rim])
    shell = found.shell
    low = np.abs(shell.mesh.vertices[:, 1]) < 1e-6
    assert low.sum() > 10 and shell.mesh.vertices[:, 1].min() > -1e-6
    # The film's normals lie in the mirror plane.
    beside = shell.points[shell.panels][np.argsort(shell.points[shell.panels][:, 1])[:5]]
    assert beside[:, 1].min() > -400.0
    z = shell.parameters[shell.panels][np.abs(shell.points[shell.panels][:, 1]) < 300.0]
    feet = found.surface.point(z)
    normals = found.surface.normal(z)
    assert np.abs(normals[:, 1]).max() < 0.1 * max(1.0, np.abs(feet[:, 1]).max() / 300.0)


def obj(path, vertices, triangles):
    lines = [f"v {x:.9f} {y:.9f} {z:.9f}" for x, y, z in vertices.tolist()]
    lines += [f"f {a} {b} {c}" for a, b, c in (triangles + 1).tolist()]
    Path(path).write_text("\n".join(lines) + "\n")


def stl(path, vertices, triangles):
    lines = ["solid film"]
    for corners in vertices[triangles].tolist():
        lines.append("facet normal 0 0 0\nouter loop")
        lines += [f"vertex {x:.9e} {y:.9e} {z:.9e}" for x, y, z in corners]
        lines.append("endloop\nendfacet")
    Path(path).write_text("\n".join([*lines, "endsolid film"]) + "\n")


def catenoid_mesh(waist=4.0, around=64, up=17):
    """In metres."""
    u = np.linspace(-0.5, 0.5, up)
    angle = 2 * np.pi * np.arange(around) / around
    grid = np.stack(
        [
            waist * np.cosh(u)[:, None] * np.cos(angle),
            waist * np.cosh(u)[:, None] * np.sin(angle),
            np.broadcast_to(waist * u[:, None], (up, around)),
        ],
        axis=-1,
    ).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(up - 1), np.arange(around), indexing="ij")
    a, b = i * around + j, i * around + (j + 1) % around
    one, two = np.stack([a, b, b + around], -1), np.stack([a, b + around, a + around], -1)
    return grid, np.concatenate([one.reshape(-1, 3), two.reshape(-1, 3)])


@pytest.mark.parametrize(("name", "write"), [("film.obj", obj), ("film.stl", stl)])
def test_an_annulus_from_a_mesh_file(tmp_path, name, write):
    write(tmp_path / name, *catenoid_mesh())
    design = asked({"mesh": name, "unit": "m"}, 600.0, source=tmp_path / "design.toml")
    found = formed(design)
    x, y, z = found.shell.mesh.vertices.T
    assert np.abs(np.hypot(x, y) - 4000.0 * np.cosh(z / 4000.0)).max() < 60.0
    assert np.ptp(z) == pytest.approx(4000.0, rel=0.02)
    assert found.rim_distance < 0.12 * 600


def test_a_cell_with_six_openings_cannot_be_continued_as_a_film_of_its_rims(tmp_path):
    """Its openings are as far apart as they can be: a film of wider ones would pinch."""
    cut = periodic_film("schwarz-p", cell=6.0, edge_length=0.3).cut
    obj(tmp_path / "cell.obj", cut.points, cut.triangles)
    design = asked({"mesh": "cell.obj", "unit": "m"}, 520.0, source=tmp_path / "design.toml")
    found = refusal(design, kind=SurfaceError)
    assert found.startswith("cell.obj") and "rims" in found


@pytest.mark.parametrize("order", [2, 3, 4])
def test_a_round_piece_of_enneper_with_its_umbilic(order):
    kind = ("face", "edge", "vertex")[order - 2]
    design = asked({"name": "enneper", "order": order, "radius": 0.8, "scale": 4000.0}, 300.0, kind)
    sides = formed(design).shell.whole.mesh.sides
    assert sorted(set(sides.tolist())) == [6, 3 * (order + 1)]


PERIODIC = [
    ("schwarz-p", 6000.0, (1, 1, 1), 520.0),
    ("schwarz-p", 6000.0, (2, 1, 1), 650.0),
    ("schwarz-d", 8000.0, (1, 1, 1), 560.0),
    ("gyroid", 6000.0, (1, 1, 1), 520.0),
]


@pytest.mark.parametrize(
    ("name", "scale", "cells", "panel_size"),
    [
        case
        if case[2] == (1, 1, 1) and case[0] != "schwarz-d"
        else pytest.param(*case, marks=pytest.mark.long)
        for case in [*PERIODIC, ("gyroid", 6000.0, (2, 1, 1), 520.0)]
    ],
)
def test_cells_of_periodic_surfaces(name, scale, cells, panel_size):
    surface = {"periodic": name, "scale": scale, "cells": list(cells)}
    shell = formed(asked(surface, panel_size, checks=ANY_RIM)).shell
    inside = np.isin(shell.whole.panels, shell.parents)
    assert (shell.whole.mesh.sides[inside] == 9).sum() >= 8
    # P's mirror planes and D's lines are met exactly; the gyroid's slanting sides step aside.
    off = 120.0 if name == "gyroid" else 1e-6
    assert shell.mesh.vertices.min() > -off
    assert (shell.mesh.vertices.max(axis=0) < scale * np.array(cells) + off).all()


@pytest.mark.parametrize("kind", ["edge", "vertex"])
def test_circles_on_a_cell_that_covers_the_sphere(kind):
    """Normals of a P cell take every direction twice: no plane has room for its circles."""
    shell = formed(asked({"periodic": "schwarz-p", "scale": 6000.0}, 520.0, kind)).shell
    image = shell.whole.gauss
    corners = image.vertices[image.corners]
    side = image.vertices[image.corners[image.next_corner]] - corners
    edge = np.linalg.norm(np.cross(corners, side), axis=1) / np.linalg.norm(side, axis=1)
    distance = edge if kind == "edge" else np.linalg.norm(corners, axis=1)
    assert np.abs(distance - 1).max() < 1e-11
    normals = shell.whole.normals[shell.whole.panels]
    assert (normals.min(axis=0) < -0.95).all() and (normals.max(axis=0) > 0.95).all()


def test_a_gyroid_cell_is_cut_near_its_box_with_room_for_bars():
    beams = {"kind": "flat", "height": 50.0, "width": 8.0}
    found = formed(asked({"periodic": "gyroid", "scale": 6000.0}, 400.0, beams=beams))
    shell = found.shell
    low, high = admissible_interval(shell)
    assert low < -54.0 and high > 4.0
    border = shell.edges[shell.edges[:, 3] < 0, 0]
    ends = shell.mesh.vertices[border]
    # Off the faces by the bars' slide along their slant, 35° at most, and the shortest edge.
    assert np.minimum(np.abs(ends), np.abs(ends - 6000.0)).min(axis=1).max() < 120.0
    assert found.rim_distance < 120.0
    assert found.surface is not None and found.figures["shortest edge at the rim"][0] > 20.0


def test_whole_panels_end_within_half_a_panel_of_the_rim():
    design = asked(inline(3), 500.0, "edge", border={"panels": "whole"})
    found = formed_whole(design)
    off = found.figures["whole panels end off the rim, at most"][0]
    assert 0.1 * 500.0 < off < 1.0 * 500.0 and found.rim_distance is None
    middles = found.shell.points[found.shell.panels]
    assert np.linalg.norm(middles[:, :2], axis=1).max() < 6000.0 + 1.0
    # Nearly all of the film is there.
    area = signed_areas(found.shell.mesh).sum() / 1e6
    assert area == pytest.approx(found.figures["film area"][0], rel=0.06)
    # No panel hangs on by one edge.
    edges = found.shell.edges
    inner = edges[edges[:, 3] >= 0]
    assert np.bincount(inner[:, 2:].ravel(), minlength=len(found.shell.panels)).min() >= 2


def formed_whole(design):
    found = form(design, lambda stage, done, total: None)
    assert relative_planarity(found.shell.mesh).max() <= 1e-12
    assert minimality(found.shell).max() <= 1e-10
    assert not bad_faces(found.shell).any()
    return found


def test_a_film_on_a_mesh_says_that_sizes_are_not_evened_out():
    lattice = {"panel_size": 600.0, "evenness": 1.0}
    surface = {"periodic": "schwarz-p", "scale": 6000.0}
    said = form(asked(surface, lattice=lattice), lambda *_: None).figures
    assert said["panel sizes evened out"][0].startswith("no:")


def test_an_inward_corner_is_rounded_and_the_others_stay_sharp():
    corners = np.array([(0, 0), (9, 0), (9, 5), (4.5, 5), (4.5, 10), (0, 10)]) * 1000.0
    high = np.array([0, 900, 200, 700, 0, 1000.0])
    ring = np.column_stack([corners, high])
    share = np.arange(12)[:, None] / 12
    points = np.concatenate(
        [a * (1 - share) + b * share for a, b in zip(ring, np.roll(ring, -1, 0), strict=True)]
    )
    rim = Rim.through(points, corners=list(range(0, 72, 12)))
    assert inward_corners(rim).tolist() == [3]
    back = rim.reversed()
    there = back.point(back.corners[inward_corners(back)])
    assert np.abs(there - ring[3]).max() < 1e-6
    assert inward_corners(rim, hole=True).tolist() == [0, 1, 2, 4, 5]
    (rounded,) = rounded_inward([rim], 1500.0)
    assert len(rounded.corners) == 5
    t = rim.corners[[0, 1, 2, 4, 5]]
    kept = cKDTree(rounded.point(rounded.corners)).query(rim.point(t))[0]
    assert kept.max() < 1e-6
    away = cKDTree(rounded.samples(4000)[1]).query(ring[3])[0]
    turn = np.radians(rim.turning(rim.corners[3]))
    stated = 1500 * np.sin(turn / 2) * (1 - 11 / 32 * turn / np.tan(turn / 2))
    assert away == pytest.approx(stated, rel=1e-3)


# -- refusals --------------------------------------------------------------------------------------


def refusal(design, rims=(), kind=PhexError):
    with pytest.raises(kind) as caught:
        form(design, lambda stage, done, total: None, rims)
    text = str(caught.value)
    assert "\n" not in text and len(text) > 30
    return text


def test_missing_and_unknown_files(tmp_path):
    source = tmp_path / "design.toml"
    (tmp_path / "rim.xyz").write_text("0 0 0\n")
    (tmp_path / "film.vtk").write_text("nothing\n")
    assert "gone.csv" in refusal(asked({"rim": "gone.csv"}, source=source), kind=DesignError)
    assert "rim.xyz" in refusal(asked({"rim": "rim.xyz"}, source=source), kind=DesignError)
    assert "gone.obj" in refusal(asked({"mesh": "gone.obj"}, source=source))
    assert "film.vtk" in refusal(asked({"mesh": "film.vtk"}, source=source))


def test_an_open_rim_names_its_ends(tmp_path):
    drawing = ezdxf.new()
    drawing.units = ezdxf.units.MM
    drawing.modelspace().add_polyline3d(points_of(2)[:100].tolist())
    drawing.saveas(tmp_path / "rim.dxf")
    found = refusal(asked({"rim": "rim.dxf"}, source=tmp_path / "d.toml"), kind=DesignError)
    assert "rim.dxf" in found and "6000" in found


def test_wrong_keys_are_named():
    with pytest.raises(DesignError, match=r"surface\.unit"):
        asked({"rim": "rim.csv", "unit": "mile"})
    assert "schwarz-q" in refusal(asked({"periodic": "schwarz-q"}))
    points, corners = saddle_half()
    rim = Rim.through(points, corners=corners)
    found = refusal(asked({"rim": points.tolist(), "free": [5]}), [rim])
    assert "5" in found and "side" in found


def test_rings_too_far_apart_say_at_which_distance_a_film_exists():
    circle = 3000.0 * np.stack([np.cos(TURN), np.sin(TURN), 0 * TURN], axis=1)
    rims = [Rim.through(circle), Rim.through(circle + np.array([0, 0, 6000.0]))]
    found = refusal(asked({"rim": circle.tolist()}, 500.0), rims, SurfaceError)
    # Equal rings bound a catenoid up to 1.32549 times their radius.
    assert "too far apart" in found
    limit = float(found.split("centres ")[1].split(" mm")[0])
    assert limit == pytest.approx(1.32549 * 3000.0, rel=0.02)


def test_a_plane_rim_has_no_curvature_lines():
    assert "plane" in refusal(asked(inline(2, height=0.0), 500.0), kind=PhexError)


def test_panels_too_large_for_the_film_are_refused():
    found = refusal(asked(inline(3, size=1500.0), 2500.0))
    assert "panel" in found


# -- what was wrong once ---------------------------------------------------------------------------


@pytest.mark.parametrize("tilt", [0.0, 1e-15, 1e-9, 1e-5, 1e-3, 1.0, 3.0])
def test_a_turn_to_the_north_is_a_rotation_near_the_south_pole_too(tilt):
    direction = np.array([np.sin(tilt), 0.0, -np.cos(tilt)])
    turn = rotation_to_north(direction)
    assert np.abs(turn @ turn.T - np.eye(3)).max() < 4 * sys.float_info.epsilon
    assert np.linalg.det(turn) == pytest.approx(1.0)
    assert np.abs(turn @ direction - [0, 0, 1]).max() < 1e-15


def test_a_copy_of_a_copied_rim_plane_is_one_of_the_plane_given():
    normals = np.eye(3)
    patch = Patchwork(normals, np.zeros(3), np.array([[0, 1, 2]]), 1)
    first = patch.split_plane(2)
    assert first == 3 and patch.split_plane(first) == 4
    assert patch.copies == [2, 2]


def test_error_kinds_of_films_stay_what_they_are():
    """Lattices that cannot be are design errors, cuts that cannot be mesh errors."""
    assert issubclass(LatticeError, DesignError) and not issubclass(MeshError, DesignError)

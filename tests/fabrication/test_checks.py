"""Every check passes on a good shell, fails on one that breaks it, and names the right part."""

import re
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import shapely
from parts_samples import as_manifold, sample

from phexfab.errors import DesignError, MeshError
from phexfab.fabrication.bars import BeamSpec
from phexfab.fabrication.beams import beams
from phexfab.fabrication.checks import KINDS, Limits, check_geometry, check_parts, measure
from phexfab.fabrication.marks import beam_marks, node_marks, panel_marks
from phexfab.fabrication.nodes import NodeSpec, nodes
from phexfab.fabrication.panels import PanelSpec, panels
from phexfab.fabrication.part_checks import contour_corners, neighbour_pairs, sheet_overhangs
from phexfab.fabrication.parts import Parts, Solid, Stock
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.offset import admissible_interval, node_axes

KINDS_OF_OFFSET = ("face", "edge", "vertex")
STOCKS = {"panels": Stock(3000, 1500), "beams": Stock(3000, 1500)}


def all_parts(shell, edges="mitred", ends="hub"):
    panel, bar = PanelSpec(edges=edges), BeamSpec(ends=ends)
    hubs = nodes(shell, NodeSpec("hub" if ends == "hub" else "none"), bar, panel)
    return Parts(panels(shell, panel), beams(shell, bar, panel), hubs)


def with_vertices(shell, which, vertices):
    """The shell with other corners of M or S, as if its planes did not meet where they should."""
    made = replace(shell)
    old = getattr(shell, which)
    made.__dict__[which] = PolyMesh(vertices, old.corners, old.starts)
    return made


def moved(shell, vertex, by, which="mesh"):
    vertices = getattr(shell, which).vertices.copy()
    vertices[vertex] += by
    return with_vertices(shell, which, vertices)


def by_name(results):
    found = {result.name: result for result in results}
    assert len(found) == len(results)
    return found


def geometry(shell, limits=None, **options):
    return by_name(check_geometry(shell, limits, **options))


def failed(results):
    return {name for name, result in results.items() if not result.ok}


def inner_vertex(shell):
    """A vertex with three panels around it."""
    count = np.bincount(shell.mesh.corners)
    return int(np.flatnonzero(count == 3)[5])


def faces_at(shell, vertex):
    mesh = shell.mesh
    return {panel_marks(shell)[f] for f in mesh.face_of_corner[mesh.corners == vertex]}


def edges_at(shell, vertex):
    return {
        beam_marks(shell)[e] for e in np.flatnonzero((shell.edges[:, :2] == vertex).any(axis=1))
    }


@pytest.mark.parametrize("kind", KINDS_OF_OFFSET)
@pytest.mark.parametrize("closed", [True, False])
def test_an_exact_shell_and_its_parts_pass_every_check(kind, closed):
    shell = sample(kind, closed)
    distance = np.zeros(len(shell.mesh.vertices))
    results = geometry(shell, surface_distance=distance, offset_distance=-60.0, rim_distance=3.0)
    results |= by_name(check_parts(all_parts(shell), shell, stocks=STOCKS))
    assert failed(results) == set()
    assert {field.name for field in fields(Limits)} == set(KINDS)
    assert set(KINDS) - set(results) == {"rim_corner", "rim_beam_angle", "rim_mitre"}
    for name, result in results.items():
        assert (result.unit, result.sense) == (KINDS[name].unit, KINDS[name].sense)
        assert result.limit == getattr(Limits(), name)
        assert "Remedy" not in result.note


def test_limits_come_from_the_design():
    shell = sample()
    longest = geometry(shell, Limits(shortest_edge=1e4))["shortest_edge"]
    assert not longest.ok and longest.limit == 1e4
    assert "Remedy: choose larger panels" in longest.note


@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_limits_that_are_none_are_refused(value):
    with pytest.raises(DesignError, match=r"checks\.panel_mass = .* in kg"):
        Limits(panel_mass=value)


def test_a_shell_without_panels_is_refused():
    shell = sample(closed=False)
    empty = replace(shell, triangles=shell.triangles[:1])
    with pytest.raises(MeshError, match="no panel"):
        check_geometry(empty)


def test_planarity_names_a_bent_face():
    shell = sample()
    face = 7
    vertex = int(shell.mesh.face(face)[2])
    bent = moved(shell, vertex, 0.01 * shell.normals[shell.panels[face]])
    results = geometry(bent)
    assert {"planarity", "planarity_mm"} <= failed(results)
    assert results["planarity"].worst in faces_at(shell, vertex)
    local = bent.mesh.polygon(face) - bent.mesh.polygon(face).mean(axis=0)
    own = np.abs(local @ np.linalg.svd(local)[2][2]).max()
    assert results["planarity_mm"].value >= own * (1 - 1e-6)
    ends = shell.mesh.vertices[shell.edges[:, :2]]
    mean = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean()
    ratio = results["planarity_mm"].value / results["planarity"].value
    assert ratio == pytest.approx(mean, rel=1e-6)


def test_parallelism_and_torsion_name_an_edge_turned_out_of_its_plane():
    shell = sample("edge")
    vertex = inner_vertex(shell)
    aside = np.cross(node_axes(shell)[vertex], [1.0, 2.0, 3.0])
    results = geometry(moved(shell, vertex, 0.05 * aside / np.linalg.norm(aside)))
    assert {"parallelism", "node_axis_torsion"} <= failed(results)
    assert results["parallelism"].worst in edges_at(shell, vertex)
    e = shell.edges[(shell.edges[:, :2] == vertex).any(axis=1), :2]
    touched = {node_marks(shell)[v] for v in e.ravel()}
    assert results["node_axis_torsion"].worst in touched
    said = re.search(r"at beam (B\d+)", results["node_axis_torsion"].note).group(1)
    assert said in edges_at(shell, vertex)


def test_torsion_is_the_angle_that_a_twisted_axis_makes():
    shell = sample("vertex")
    row = 11
    i, j = shell.edges[row, :2]
    along = shell.gauss.vertices[j] - shell.gauss.vertices[i]
    middle = shell.gauss.vertices[[i, j]].mean(axis=0)
    across = np.cross(along, middle)
    across /= np.linalg.norm(across)
    # Both ends turned by opposite small angles: each axis leaves the mean mid-plane by half a turn
    # of the difference.
    vertices = shell.gauss.vertices.copy()
    vertices[i] += 0.01 * np.linalg.norm(vertices[i]) * across
    vertices[j] -= 0.01 * np.linalg.norm(vertices[j]) * across
    results = geometry(with_vertices(shell, "gauss", vertices), Limits(node_axis_torsion=0.5))
    assert "node_axis_torsion" in failed(results)
    assert results["node_axis_torsion"].value == pytest.approx(np.degrees(0.01), rel=0.2)


def mixed_by_polarisation(shell, f):
    """area(M, S) = (area(M + λS) − area(M − λS)) / 4λ of one face, areas from shapely."""
    normal = shell.normals[shell.panels[f]]
    x = np.cross(normal, np.eye(3)[np.abs(normal).argmin()])
    frame = np.column_stack([x, np.cross(normal, x)]) / np.linalg.norm(x)
    m, s = shell.mesh.polygon(f) @ frame, shell.gauss.polygon(f) @ frame
    m, s = m - m[0], s - s[0]
    scale = 0.3 * np.abs(m).max() / np.abs(s).max()

    def area(points):
        ring = shapely.Polygon(points)
        return ring.area if shapely.LinearRing(points).is_ccw else -ring.area

    mixed = (area(m + scale * s) - area(m - scale * s)) / (4 * scale)
    return abs(mixed) / np.sqrt(abs(area(m) * area(s)))


@pytest.mark.parametrize("kind", KINDS_OF_OFFSET)
def test_minimality_names_a_lifted_face(kind):
    shell = sample(kind)
    lifted = shell.heights.copy()
    lifted[shell.panels[20]] += 1.0
    broken = shell.with_heights(lifted)
    result = geometry(broken)["minimality"]
    assert not result.ok
    wanted = [mixed_by_polarisation(broken, f) for f in range(shell.mesh.n_faces)]
    assert result.worst == panel_marks(shell)[int(np.argmax(wanted))]
    assert result.value == pytest.approx(max(wanted), rel=1e-6)


@pytest.mark.parametrize("kind", KINDS_OF_OFFSET)
def test_offset_constancy_and_spread_name_what_leaves_the_sphere(kind):
    shell = sample(kind)
    face = 20
    heights = shell.gauss_heights.copy()
    heights[shell.panels[face]] += 1e-6
    results = geometry(replace(shell, gauss_heights=heights), offset_distance=80.0)
    corners = shell.mesh.face(face)
    near = {
        "face": {panel_marks(shell)[face]},
        "edge": set().union(*(edges_at(shell, v) for v in corners)),
        "vertex": {node_marks(shell)[v] for v in corners},
    }[kind]
    for name in ("offset_constancy", "offset_spread"):
        assert not results[name].ok
        assert results[name].worst in near
        assert 1e-7 < results[name].value < 1e-5
    if kind == "face":
        assert results["offset_spread"].value == pytest.approx(1e-6, rel=1e-4)


@pytest.mark.parametrize("kind", KINDS_OF_OFFSET)
@pytest.mark.parametrize("side", [0, 1])
def test_the_offset_interval_names_the_edge_that_vanishes_first(kind, side):
    shell = sample(kind)
    end = admissible_interval(shell)[side]
    inside = geometry(shell, offset_distance=0.85 * end)["offset_interval"]
    outside = geometry(shell, offset_distance=0.95 * end)["offset_interval"]
    assert inside.ok and not outside.ok
    assert outside.value == pytest.approx(0.95, rel=1e-12)
    edge = beam_marks(shell).index(outside.worst)
    at_end = shell.with_heights(shell.heights + end * shell.gauss_heights).mesh
    i, j = shell.edges[edge, :2]
    length = np.linalg.norm(at_end.vertices[i] - at_end.vertices[j])
    assert length < 1e-9 * abs(end)


def test_simple_faces_names_a_face_that_crosses_itself():
    shell = sample()
    face = 3
    # Corners 0 and 3 are reflex: the edges from 0 and to 3 cross when 1 and 2 are exchanged.
    a, b = shell.mesh.face(face)[[1, 2]]
    vertices = shell.mesh.vertices.copy()
    vertices[[a, b]] = vertices[[b, a]]
    result = geometry(with_vertices(shell, "mesh", vertices))["simple_faces"]
    assert not result.ok
    others = sum(bool({a, b} & set(f.tolist())) for f in shell.mesh.faces)
    assert 1 <= result.value <= others
    assert result.worst in faces_at(shell, a) | faces_at(shell, b)


def test_simple_faces_names_faces_that_lie_inside_out():
    shell = sample()
    mirrored = with_vertices(shell, "mesh", shell.mesh.vertices * [1.0, 1.0, -1.0])
    result = geometry(mirrored)["simple_faces"]
    assert not result.ok and result.value > 0


def test_the_shortest_edge_is_named():
    shell = sample()
    i, j = shell.edges[30, :2]
    m = shell.mesh.vertices
    short = moved(shell, j, 0.96 * (m[i] - m[j]))
    result = geometry(short)["shortest_edge"]
    assert not result.ok
    assert result.worst == beam_marks(shell)[30]
    assert result.value == pytest.approx(0.04 * np.linalg.norm(m[i] - m[j]), rel=1e-9)


@pytest.mark.parametrize("closed", [True, False])
def test_beam_angles_are_those_seen_along_the_node_axis(closed):
    shell = sample("edge", closed)
    axes, least = node_axes(shell), {}
    for v in range(len(axes)):
        ends = shell.edges[(shell.edges[:, :2] == v).any(axis=1), :2]
        rays = [shell.mesh.vertices[k] - shell.mesh.vertices[v] for k in ends[ends != v]]
        rays = [ray - (ray @ axes[v]) * axes[v] for ray in rays]
        cosines = [
            a @ b / np.linalg.norm(a) / np.linalg.norm(b)
            for k, a in enumerate(rays)
            for b in rays[:k]
        ]
        least[v] = np.degrees(np.arccos(max(cosines)))
    assert np.allclose(measure(shell)["beam_angle"], list(least.values()), atol=1e-6)
    worst = min(least, key=least.get)
    result = geometry(shell, Limits(beam_angle=least[worst] + 1.0))["beam_angle"]
    assert not result.ok
    assert least[node_marks(shell).index(result.worst)] == pytest.approx(least[worst], abs=1e-6)


def test_the_distance_from_the_surface_names_the_vertex_and_does_not_pass_without_a_number():
    shell = sample()
    distance = np.full(len(shell.mesh.vertices), 3.0)
    distance[9] = -30.0
    result = geometry(shell, surface_distance=distance)["surface_distance"]
    assert (result.ok, result.value, result.worst) == (False, 30.0, node_marks(shell)[9])
    distance[4] = np.nan
    result = geometry(shell, Limits(surface_distance=1e9), surface_distance=distance)
    assert not result["surface_distance"].ok
    assert result["surface_distance"].worst == node_marks(shell)[4]
    with pytest.raises(MeshError, match="surface_distance has 3 values"):
        geometry(shell, surface_distance=np.zeros(3))


def test_nothing_passes_that_is_not_a_number():
    shell = sample()
    nowhere = with_vertices(shell, "mesh", np.full_like(shell.mesh.vertices, np.nan))
    results = geometry(nowhere, offset_distance=50.0)
    of_s_alone = {"offset_constancy"}
    assert failed(results) == set(results) - of_s_alone


def test_an_edge_without_length_fails_and_does_not_pass_as_parallel():
    shell = sample()
    i, j = shell.edges[30, :2]
    m = shell.mesh.vertices
    results = geometry(moved(shell, j, m[i] - m[j]))
    for name in ("parallelism", "shortest_edge", "node_axis_torsion"):
        assert not results[name].ok
    assert results["parallelism"].worst == results["shortest_edge"].worst == beam_marks(shell)[30]


def test_measures_for_histograms():
    shell = sample()
    found = measure(shell)
    inner = shell.edges[:, 3] >= 0
    assert len(found["edge_length"]) == len(shell.edges)
    assert len(found["dihedral_angle"]) == inner.sum()
    assert len(found["corner_angle"]) == len(shell.mesh.corners)
    assert ((found["corner_angle"] > 180).sum()) == 2 * shell.mesh.n_faces
    cosine = np.cos(np.radians(found["dihedral_angle"]))
    pairs = shell.normals[shell.panels][shell.edges[inner, 2:]]
    assert np.allclose(cosine, (pairs[:, 0] * pairs[:, 1]).sum(axis=1))
    total = sum(shapely_area(shell, f) for f in range(shell.mesh.n_faces))
    assert found["panel_area"].sum() == pytest.approx(total, rel=1e-9)


def shapely_area(shell, f):
    points = shell.mesh.polygon(f) - shell.mesh.polygon(f)[0]
    x, y = np.linalg.svd(points)[2][:2]
    return shapely.Polygon(np.column_stack([points @ x, points @ y])).area


# Parts


def parts_with(parts, **changed):
    return replace(parts, **changed)


def part_results(parts, shell, limits=None):
    return by_name(check_parts(parts, shell, limits, stocks=STOCKS))


def test_the_heaviest_panel_is_named():
    shell = sample()
    parts = all_parts(shell)
    heavy = list(parts.panels)
    heavy[12] = replace(heavy[12], mass=61.0)
    result = part_results(replace(parts, panels=tuple(heavy)), shell)["panel_mass"]
    assert (result.ok, result.value, result.worst) == (False, 61.0, heavy[12].mark)


def test_the_sharpest_corner_is_named():
    shell = sample()
    parts = all_parts(shell)
    sharp = list(parts.panels)
    outline = np.array([[0, 0], [300, 0], [300, 90]], float)
    sharp[4] = replace(sharp[4], flat=replace(sharp[4].flat, outline=outline))
    result = part_results(replace(parts, panels=tuple(sharp)), shell)["sharpest_corner"]
    assert (result.ok, result.worst) == (False, sharp[4].mark)
    assert result.value == pytest.approx(np.degrees(np.arctan(0.3)))


def test_reflex_corners_are_not_sharp():
    chevron = np.array([[0, 0], [40, -30], [10, 0], [40, 30]], float)
    sharp = 2 * np.degrees(np.arctan(0.75))
    inner = np.degrees(np.arctan2(30, 30) - np.arctan2(30, 40))
    angles, starts = contour_corners([chevron, chevron])
    assert starts.tolist() == [0, 4]
    assert angles.min() == pytest.approx(min(sharp, inner)) and angles[2] > 180


def test_a_panel_pushed_towards_its_neighbour_loses_clearance_and_then_clashes():
    shell = sample()
    parts = all_parts(shell)
    row = int(np.flatnonzero(shell.edges[:, 3] >= 0)[40])
    i, j, left, right = shell.edges[row].tolist()
    across = np.cross(
        shell.normals[shell.panels[left]], shell.mesh.vertices[j] - shell.mesh.vertices[i]
    )
    across /= np.linalg.norm(across)  # into the left panel

    def pushed(by):
        made = list(parts.panels)
        solid = made[right].solid
        made[right] = replace(made[right], solid=Solid(solid.vertices + by * across, solid.faces))
        return replace(parts, panels=tuple(made))

    pair = ", ".join(sorted([parts.panels[left].mark, parts.panels[right].mark]))
    near = part_results(pushed(5.3), shell)
    assert failed(near) == {"panel_clearance"}
    assert near["panel_clearance"].worst == pair
    assert 0.0 < near["panel_clearance"].value < 1.0
    bodies = [as_manifold(parts_.solid) for parts_ in pushed(5.3).panels]
    wanted = bodies[left].min_gap(bodies[right], 10.0)
    assert near["panel_clearance"].value == pytest.approx(wanted, abs=1e-9)

    deep = part_results(pushed(12.0), shell)
    assert {"panel_clearance", "interpenetration"} <= failed(deep)
    assert deep["panel_clearance"].value == 0.0
    result = deep["interpenetration"]
    bodies = [as_manifold(parts_.solid) for parts_ in pushed(12.0).panels]
    overlaps = {
        (a, b): (bodies[a] ^ bodies[b]).volume()
        for a, b in neighbour_pairs(parts.panels, shell).tolist()
    }
    a, b = max(
        overlaps, key=lambda k: overlaps[k] / min(bodies[k[0]].volume(), bodies[k[1]].volume())
    )
    smaller = min(bodies[a].volume(), bodies[b].volume())
    assert result.worst == f"{parts.panels[a].mark}, {parts.panels[b].mark}"
    assert result.value == pytest.approx(overlaps[a, b] / smaller, rel=1e-6)
    assert (
        f"{result.worst.replace(', ', ' and ')} overlap by {overlaps[a, b]:.3g} mm³" in result.note
    )
    place = [float(x) for x in re.search(r"at \((.*?)\)", result.note).group(1).split(",")]
    inside = np.array((bodies[a] ^ bodies[b]).bounding_box())
    assert (inside[:3] - 1 <= place).all() and (place <= inside[3:] + 1).all()


def test_beams_and_hubs_that_overlap_are_found():
    shell = sample()
    parts = all_parts(shell)
    grown = list(parts.nodes)
    grown[8] = replace(grown[8], cylinder=replace(grown[8].cylinder, radius=45.0))
    result = part_results(replace(parts, nodes=tuple(grown)), shell)["interpenetration"]
    assert not result.ok
    beam, hub = result.worst.split(", ")
    assert hub == grown[8].mark and beam in grown[8].neighbours
    assert f"{len(grown[8].neighbours)} pairs in all" in result.note


def test_mitres_beyond_the_limit_name_their_beam():
    shell = sample()
    parts = all_parts(shell, ends="mitred")
    assert failed(part_results(parts, shell)) == set()
    steep = max(parts.beams, key=lambda beam: np.abs(beam.mitres).max())
    limit = np.abs(steep.mitres).max() - 1e-9
    result = part_results(parts, shell, Limits(mitre_angle=limit))["mitre_angle"]
    assert (result.ok, result.worst) == (False, steep.mark)


def test_blanks_that_do_not_fit_name_the_largest():
    shell = sample()
    parts = all_parts(shell)
    small = {"panels": Stock(420, 420), "beams": Stock(3000, 100)}
    results = by_name(check_parts(parts, shell, stocks=small))
    assert {"panel_fits_sheet", "beam_fits_sheet"} <= failed(results)
    worst = results["panel_fits_sheet"]
    over = [sheet_overhangs([panel.flat.blank], small["panels"])[0] for panel in parts.panels]
    assert worst.worst == parts.panels[int(np.argmax(over))].mark
    # A beam is 90 mm high and 80 mm are left inside the margins.
    assert results["beam_fits_sheet"].value == pytest.approx(10.0, abs=0.5)


def test_overhang_of_blanks_known_by_hand():
    turn = np.radians(33.3)
    turned = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    rectangle = np.array([[0, 0], [100, 0], [100, 40], [0, 40]], float) @ turned.T
    assert sheet_overhangs([rectangle], Stock(140, 70, margin=10)) == pytest.approx([-10.0])
    assert sheet_overhangs([rectangle], Stock(110, 55, margin=10)) == pytest.approx([10.0])
    # Askew: a needle of 110 fits a square of 80, whose diagonal is 113.
    needle = np.array([[0, 0], [110, 0], [110, 1], [0, 1]], float)
    assert sheet_overhangs([needle], Stock(100, 100, margin=10))[0] < 0
    assert sheet_overhangs([1.1 * needle], Stock(100, 100, margin=10))[0] > 0


def test_families_that_are_not_made_are_not_checked():
    shell = sample()
    parts = all_parts(shell)
    alone = by_name(check_parts(Parts(parts.panels), shell))
    assert set(alone) == {"panel_mass", "sharpest_corner", "panel_clearance", "interpenetration"}
    assert check_parts(Parts(()), shell) == []


def test_the_page_on_checks_tells_every_limit():
    page = Path(__file__).parents[2] / "docs" / "checks.md"
    rows = re.findall(r"^\| `(\w+)` \|.*\| (≤|≥) (\S+) *(\S*) \|", page.read_text("utf-8"), re.M)
    told = {name: (sense, float(limit), unit) for name, sense, limit, unit in rows}
    senses, units = {"<=": "≤", ">=": "≥"}, {"1": "", "deg": "°"}
    assert told == {
        name: (senses[kind.sense], getattr(Limits(), name), units.get(kind.unit, kind.unit))
        for name, kind in KINDS.items()
    }

"""Lattices traced on meshes of any topology, up to the exact shells they give."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from mesh_samples import (
    catenoid,
    enneper,
    exact,
    many_umbilics,
    oriented,
    sampled,
    schwarz_p,
)

import phexfab as px
from phexfab.errors import LatticeError, MeshError
from phexfab.mesh.measures import simple_faces
from phexfab.minimal.laplacian import solve_minimal
from phexfab.parallel.curvature import minimality
from phexfab.parallel.rings import border_loops, face_rings
from phexfab.parallel.shell import Shell
from phexfab.remesh.mesh_lattices.points import lattice_points
from phexfab.remesh.mesh_lattices.seamless import seamless
from phexfab.remesh.mesh_lattices.trace import mesh_lattice, traced

FIVE = 0.55 * np.exp(2j * np.pi * (np.arange(5) / 5 + 0.05))


def shell_on(sample, lattice):
    points, normals = exact(sample, lattice)
    heights = np.einsum("ij,ij->i", points, normals)
    ones = np.ones(len(points))
    triangles = lattice.lattice.triangles
    return solve_minimal(
        Shell(normals, heights, ones, triangles, "face", points, lattice.lattice.step)
    )


def euler(triangles):
    edges = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    )
    return len(np.unique(triangles)) - len(np.unique(edges, axis=0)) + len(triangles)


CASES = {
    "ring": (catenoid, 200.0, {}, 0, {}),
    "ring, rows along v": (catenoid, 150.0, {"rows_along": "v"}, 0, {}),
    "no umbilic": (lambda: enneper(1, rings=24), 80.0, {}, 1, {}),
    "order 1": (lambda: enneper(2, rings=24), 80.0, {}, 1, {9: 1}),
    "order 2": (lambda: enneper(3, rings=24), 80.0, {}, 1, {12: 1}),
    "order 3": (lambda: enneper(4, rings=24), 80.0, {}, 1, {15: 1}),
    "order 1 off the vertices": (
        lambda: enneper(2, rings=24, centre=0.013 + 0.006j),
        80.0,
        {"rows_along": "v"},
        1,
        {9: 1},
    ),
    "two": (lambda: many_umbilics([0.4, -0.35 + 0.1j], rings=30), 40.0, {}, 1, {9: 2}),
    "three": (
        lambda: many_umbilics([0.5, -0.35 + 0.3j, -0.2 - 0.5j], rings=30),
        40.0,
        {},
        1,
        {9: 3},
    ),
    "five": (lambda: many_umbilics(FIVE, rings=30), 20.0, {"kind": "edge"}, 1, {9: 5}),
    "mixed orders": (
        lambda: many_umbilics([0.45, 0.45, -0.4 + 0.2j], rings=30),
        30.0,
        {},
        1,
        {9: 1, 12: 1},
    ),
    "cell": (lambda: schwarz_p(10), 50.0, {}, -4, {9: 8}),
    "cell, rows along v": (lambda: schwarz_p(10), 70.0, {"rows_along": "v"}, -4, {9: 8}),
    "ring of four cells": (lambda: schwarz_p(8, (2, 2, 1)), 80.0, {}, -16, {9: 32}),
}


@pytest.mark.parametrize("name", CASES)
def test_shells_are_exact_whatever_the_topology(name):
    make, size, options, characteristic, odd = CASES[name]
    sample = make()
    lattice = mesh_lattice(*sample.arrays, panel_size=size, **options)
    triangles = lattice.lattice.triangles
    assert euler(sample.triangles) == euler(triangles) == characteristic
    shell = shell_on(sample, lattice)
    assert simple_faces(shell.mesh).all()
    assert minimality(shell).max() <= 1e-10
    sides = Counter(shell.mesh.sides.tolist())
    assert {n: k for n, k in sides.items() if n != 6} == odd
    # Two sided borders: as many loops of border planes as the mesh has rims.
    loops = border_loops(triangles, shell.panels, len(shell.normals))
    rims = {0: 2, 1: 1, -4: 6, -16: 16}[characteristic]
    assert len(loops) == rims
    # Only faces that touch a panel.
    is_panel = np.isin(np.arange(len(shell.normals)), shell.panels)
    assert is_panel[triangles].any(axis=1).all()
    assert np.array_equal(np.unique(triangles), np.arange(len(lattice.face)))
    # The umbilics' panels are those with more sides.
    rings = dict(zip(shell.panels.tolist(), shell.mesh.sides.tolist(), strict=True))
    found = [rings[f] for f in lattice.umbilics.tolist() if f in rings]
    assert sorted(found) == sorted(np.repeat(list(odd), list(odd.values())).tolist())
    assert [3 * (m + 2) for m in lattice.orders.tolist()] == [
        rings.get(f, 3 * (m + 2))
        for f, m in zip(lattice.umbilics.tolist(), lattice.orders.tolist(), strict=True)
    ]


@pytest.mark.parametrize("rows_along", ["u", "v"])
def test_first_edges_run_along_the_rows(rows_along):
    sample = schwarz_p(10)
    lattice = mesh_lattice(*sample.arrays, panel_size=40.0, rows_along=rows_along)
    x = lattice.on_mesh(sample.points, sample.triangles)
    triangles = lattice.lattice.triangles
    assert lattice.lattice.upward.all()
    field_at = sample.triangles[lattice.face, lattice.barycentric.argmax(axis=1)]
    d, n = sample.directions[field_at], sample.normals[field_at]
    along = d if rows_along == "u" else np.cross(n, d)
    edge = x[triangles[:, 1]] - x[triangles[:, 0]]
    edge /= np.linalg.norm(edge, axis=1)[:, None]
    away = np.isin(triangles, lattice.umbilics).any(axis=1)
    cosine = np.abs(np.einsum("ij,ij->i", edge, along[triangles[:, 0]]))[~away]
    assert np.degrees(np.arccos(np.minimum(cosine, 1))).max() < 25  # a chord, at its end
    area = np.cross(
        x[triangles[:, 1]] - x[triangles[:, 0]], x[triangles[:, 2]] - x[triangles[:, 0]]
    )
    assert (np.einsum("ij,ij->i", area, n[triangles[:, 0]]) > 0).all()


def test_the_ring_is_the_rectangles_lattice():
    # The same catenoid, remeshed in closed form: as many panels go around.
    sample = catenoid()
    lattice = mesh_lattice(*sample.arrays, panel_size=200.0)
    known = px.lattice_on(sample.surface, 200.0, closed=True)
    period = abs(sample.surface.period) * np.sqrt(sample.surface.scale)
    rows = period / (lattice.lattice.step * lattice.lattice.row_ratio)
    columns = period / lattice.lattice.step
    whole = rows if abs(sample.surface.period.imag) > 0 else columns
    assert abs(whole - 2 * round(whole / 2)) < 0.03  # rows are stacked in pairs; chords are short
    assert lattice.lattice.closed
    assert lattice.lattice.step == pytest.approx(known.step * np.sqrt(1000.0), rel=0.2)
    assert lattice.turn < 0.5
    assert np.allclose(lattice.density, 1, atol=1e-3)


def test_neighbours_are_as_far_apart_as_asked():
    sample = many_umbilics([0.4, -0.35 + 0.1j], rings=40)
    lattice = mesh_lattice(*sample.arrays, panel_size=30.0)
    x, _ = exact(sample, lattice)
    t = lattice.lattice.triangles
    pairs = np.unique(np.sort(np.concatenate([t[:, [0, 1]], t[:, [1, 2]], t[:, [2, 0]]])), axis=0)
    length = np.linalg.norm(x[pairs[:, 0]] - x[pairs[:, 1]], axis=1)
    assert np.median(length) == pytest.approx(30.0, rel=0.2)


def test_density_is_what_lattice_edges_measure():
    sample = schwarz_p(12)
    lattice = mesh_lattice(*sample.arrays, panel_size=30.0)
    x = lattice.on_mesh(sample.points, sample.triangles)
    kappa = lattice.on_mesh(sample.curvatures, sample.triangles)
    t = lattice.lattice.triangles
    plain = ~np.isin(t, lattice.umbilics).any(axis=1)
    a, b, c = (x[t[plain, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2 * kappa[t[plain]].mean(axis=1)
    cell = lattice.lattice.step**2 * lattice.lattice.row_ratio / 2
    density = lattice.density[t[plain]].mean(axis=1)
    assert np.median(np.abs(np.sqrt(cell / area) / density - 1)) < 0.02


def test_places_lie_on_the_mesh_given():
    sample = many_umbilics([0.4, -0.35 + 0.1j], rings=30)
    lattice = mesh_lattice(*sample.arrays, panel_size=40.0)
    assert lattice.barycentric.min() >= 0
    assert np.allclose(lattice.barycentric.sum(axis=1), 1)
    assert lattice.face.max() < len(sample.triangles)
    z = lattice.on_mesh(sample.z, sample.triangles)
    umbilics = np.sort_complex(z[lattice.umbilics])
    assert np.abs(umbilics - np.sort_complex([0.4, -0.35 + 0.1j])).max() < 0.004
    gaps = np.abs(z[:, None] - z)[np.triu_indices(len(z), 1)]
    assert gaps.min() > 0.01  # no point twice


def grid_sample(size=12, part=2):
    """Enneper's patch on a mesh whose every ``part``-th vertex is a lattice point."""
    j, i = np.meshgrid(np.arange(-size, size + 1), np.arange(-size, size + 1))
    i, j = i.ravel(), j.ravel()
    z = 0.03 * ((i + j / 2) + 1j * np.sqrt(0.75) * j)
    keep = np.abs(z) < 0.03 * (size - 1)
    i, j, z = i[keep], j[keep], z[keep]
    number = {(a, b): k for k, (a, b) in enumerate(zip(i.tolist(), j.tolist(), strict=True))}
    faces = []
    for (a, b), k in number.items():
        for ends in (((a + 1, b), (a, b + 1)), ((a, b + 1), (a - 1, b + 1))):
            if all(e in number for e in ends):
                faces.append([k, *(number[e] for e in ends)])
    tri = oriented(z, np.array(faces))
    used = np.unique(tri)
    tri = np.searchsorted(used, tri)
    sample = sampled(px.minimal_surface("enneper").scaled(1000.0), z[used], tri)
    return sample, np.column_stack([i, j])[used], part


@pytest.mark.parametrize("offset", [(0, 0), (1, 0), (1, 1)])
def test_ties_on_edges_and_vertices_count_once(offset):
    # Corners exactly on lattice points, or all lattice points in the middle of edges.
    sample, ij, part = grid_sample()
    on = seamless(*sample.arrays, panel_size=60.0)
    shifted = ij * (on.unit // part) + np.array(offset) * (on.unit // part // 2)
    on = replace(on, corners=shifted[sample.triangles])
    found = lattice_points(on)
    at = found.at[found.first]
    assert len(np.unique(at, axis=0)) == len(at)
    # Independent: all lattice points in the union of triangles, by brute force.
    corner = shifted[sample.triangles] / on.unit
    want = set()
    span = np.arange(-9, 10)
    for m in span:
        for n in span:
            rel = corner - np.array([m, n])
            side = [
                rel[:, k, 0] * rel[:, (k + 1) % 3, 1] - rel[:, k, 1] * rel[:, (k + 1) % 3, 0]
                for k in range(3)
            ]
            if (np.min(side, axis=0) >= 0).any():
                want.add((int(m), int(n)))
    assert {tuple(p) for p in at.tolist()} == want
    made = traced(on)
    panels, starts, *_ = face_rings(made.lattice.triangles, len(made.face))
    assert (np.diff(starts) == 6).all()
    six = np.array([[1, 0], [0, 1], [-1, 1], [-1, 0], [0, -1], [1, -1]])

    def surrounded(points):
        return {p for p in points if all((p[0] + a, p[1] + b) in points for a, b in six.tolist())}

    used = np.unique(np.round(made.lattice.points / on.step, 6))
    panel = np.round(made.lattice.points[panels] / on.step, 6)
    as_whole = {
        (round(float(p.real - n / 2)), n)
        for p in panel
        for n in [round(float(p.imag / on.row_ratio))]
    }
    assert len(used) == len(made.face)
    assert surrounded(surrounded(want)) <= as_whole <= surrounded(want)


def test_refusals_name_size_and_remedy():
    with pytest.raises(LatticeError, match=r"panel_size = 900: .*smaller panels"):
        mesh_lattice(*enneper(1, rings=10).arrays, panel_size=900.0)
    with pytest.raises(LatticeError, match=r"panel_size = 700: .*smaller panels"):
        mesh_lattice(*catenoid(width=0.3).arrays, panel_size=700.0)


def test_a_hole_smaller_than_a_panel_is_not_closed_over():
    sample = enneper(1, rings=30)
    centre = np.abs(sample.z[sample.triangles].mean(axis=1) - 0.31 - 0.07j)
    open_ = sample.triangles[centre > 0.015]
    p, _, n, d, k = sample.arrays
    assert euler(open_) == 0
    for same in (True, False):
        with pytest.raises(LatticeError, match=r"close a hole|smaller than a panel"):
            mesh_lattice(p, open_, n, d, k, panel_size=150.0, same_topology=same)


def test_a_margin_may_have_necks_that_panels_leave_out():
    # A ring cut through but for a neck a panel wide.
    sample = catenoid(n=120, rows=40)
    angle = np.mod(np.angle(sample.points[:, 0] + 1j * sample.points[:, 1]), 2 * np.pi)
    height = sample.points[:, 2]
    gone = ((angle > 1.0) & (angle < 1.5) & (np.abs(height) > 60))[sample.triangles].all(axis=1)
    p, t, n, d, k = sample.arrays
    used, t = np.unique(t[~gone], return_inverse=True)
    arrays = (p[used], t.reshape(-1, 3), n[used], d[used], k[used])
    assert euler(arrays[1]) == 0
    with pytest.raises(LatticeError, match=r"leave out a neck"):
        mesh_lattice(*arrays, panel_size=150.0)
    lattice = mesh_lattice(*arrays, panel_size=150.0, same_topology=False)
    assert euler(lattice.lattice.triangles) == 1
    assert not lattice.lattice.closed


@pytest.mark.long
@pytest.mark.parametrize("seed", range(60))
def test_any_umbilics_give_a_valid_shell_or_a_refusal(seed):
    rng = np.random.default_rng(seed)
    k = int(rng.integers(1, 6))
    zeros = rng.uniform(0.1, 0.9, k) * np.exp(2j * np.pi * rng.uniform(size=k))
    sample = many_umbilics(zeros, rings=30, tilt=0.4)
    size = float(np.exp(rng.uniform(np.log(20), np.log(120))))
    try:
        lattice = mesh_lattice(*sample.arrays, panel_size=size, rows_along="uv"[seed % 2])
    except (LatticeError, MeshError) as error:
        assert "panel" in str(error) or "mesh" in str(error)
        return
    shell = shell_on(sample, lattice)
    assert simple_faces(shell.mesh).all()
    # Rounding only: fine panels on a nearly flat film of a metre.
    assert minimality(shell).max() <= 1e-9

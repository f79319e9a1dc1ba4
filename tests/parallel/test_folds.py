"""Flat sides that fold: planes meet in upright lines, vertices keep away, the side stays near."""

import numpy as np
import pytest
from cut_samples import border, polygon, whole

from phexfab.parallel.cut import cut_shell
from phexfab.parallel.fence import build_fence
from phexfab.parallel.folds import Wanted, flat_sides, fold
from phexfab.parallel.stations import place_stations
from phexfab.parallel.walk import Ground

DEPTH = (70.0, 5.0)


def catenoid_window(shift=0.0):
    """A piece of a catenoid between two planes z = ± and two planar meridians."""
    smooth, shell = whole("catenoid", 300.0)
    w, corners = polygon(
        [-0.6 - 0.9j + shift, 0.63 - 0.9j + shift, 0.63 + 0.93j + shift, -0.6 + 0.93j + shift]
    )
    return smooth, shell, border(smooth, w, corners)


def test_planes_of_a_folded_side_meet_in_its_upright_lines():
    _, shell, one = catenoid_window()
    ground = Ground.of(shell)
    start = place_stations(ground.finder, one, 10.0, 250.0, 20.0)
    sides = flat_sides(ground, one, start, Wanted(20.0, DEPTH, 250.0))
    assert sides
    made = fold(shell, ground, one, start, sides)
    fence = build_fence(one, made, 20.0)
    given = np.isfinite(made.planes[:, 3])
    inner = np.flatnonzero(given & np.roll(given, 1) & ~made.fixed)
    assert len(inner) > 3
    normals = one.at(made.along)[1]
    for k in inner.tolist():
        side = next(s for s in sides if 0 < (made.along[k] - s.start) % one.length < s.length)
        n = side.plane[:3]
        line = normals[k] - (normals[k] @ n) * n
        line /= np.linalg.norm(line)
        # Seen along the plane's normal the ruling is the film's normal.
        seen = fence.rulings[k] - (fence.rulings[k] @ n) * n
        assert np.linalg.norm(np.cross(seen / np.linalg.norm(seen), line)) < 1e-7
        # The station lies in both planes, in the film, and not far from the side.
        for j in (k - 1, k):
            assert fence.points[k] @ made.planes[j, :3] == pytest.approx(
                made.planes[j, 3], abs=1e-6
            )
        assert abs(made.aside[k] @ normals[k]) < 1e-6
        assert abs(made.aside[k] @ n) <= 2 * 20.0 + max(DEPTH) + 1e-9


def test_vertices_keep_away_from_folded_planes_in_all_offsets():
    """Some pass through the flat planes within the depth; most of these no longer do."""
    _, shell, one = catenoid_window()
    ground = Ground.of(shell)
    start = place_stations(ground.finder, one, 10.0, 250.0, 20.0)
    sides = flat_sides(ground, one, start, Wanted(20.0, DEPTH, 250.0))
    made = fold(shell, ground, one, start, sides)

    def close(stations):
        fence = build_fence(one, stations, 20.0)
        begin = fence.points
        chord = np.roll(begin, -1, axis=0) - begin
        count = 0
        for k in np.flatnonzero(np.isfinite(stations.planes[:, 3])).tolist():
            n, h = stations.planes[k, :3], stations.planes[k, 3]
            share = (shell.mesh.vertices - begin[k]) @ chord[k] / (chord[k] @ chord[k])
            away = shell.mesh.vertices @ n - h
            slide = shell.gauss.vertices @ n
            ends = np.stack([away, away - DEPTH[0] * slide, away + DEPTH[1] * slide])
            near = (share > 0) & (share < 1) & (np.abs(away) < 120)
            across = np.abs(np.cross(shell.mesh.vertices - begin[k], chord[k])).max(axis=1)
            near &= across < 400 * np.linalg.norm(chord[k])
            count += int((near & (ends.min(axis=0) < 10) & (ends.max(axis=0) > -10)).sum())
        return count

    assert close(start) > 0
    assert close(made) < close(start) / 3


def test_a_cut_that_needs_no_fold_stays_flat():
    _, shell, one = catenoid_window()
    plain = cut_shell(shell, [one], shortest_edge=0.0)
    assert plain.report.ways == ("flat",)

"""Designs whose rims are flat or straight sides that the film crosses at a slant: they fold."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from phexfab import build, make_design
from phexfab.minimal.shell import surface_distance
from phexfab.parallel.offset import admissible_interval
from phexfab.surface.periodic.mesh import periodic_film

BARS = {"width": 8, "height": 50}
STRAY = 130.0
"""Folds stray by 2 · 20 mm and the depth of bars, 62 mm, at 35.5° to the film: 125 mm."""


def periodic(name, size, kind, cells=(1, 1, 1)):
    return make_design(
        {
            "surface": {"periodic": name, "scale": "6 m", "cells": list(cells)},
            "lattice": {"panel_size": size},
            "offset": {"type": kind},
            "beams": BARS,
            "checks": {"rim_distance": STRAY},
        }
    )


@pytest.fixture(scope="module")
def gyroid():
    return build(periodic("gyroid", 390.0, "edge"))


def test_a_gyroid_of_edge_type_is_cut_and_keeps_every_limit(gyroid):
    assert gyroid.ok, [one.name for one in gyroid.checks if not one.ok]
    low, high = admissible_interval(gyroid.shell)
    assert low < -BARS["height"] and high > 4
    assert gyroid.figures["cut off the normals, at most"][0] < 60


def test_the_distance_from_a_film_of_many_charts_is_that_of_a_fine_mesh(gyroid):
    """Around flat points a circle's normal may be one that another chart has far away."""
    fine = periodic_film("gyroid", cell=6000.0, cells=(1, 1, 1), edge_length=60.0, margin=600.0)
    vertices = gyroid.shell.mesh.vertices
    away, near = cKDTree(fine.points).query(vertices)
    height = np.einsum("ij,ij->i", vertices - fine.points[near], fine.normals[near])
    # A tangent plane misses the film by κ/2 times the square of the way along it.
    slack = 0.5 * fine.curvatures.max() * away**2 + 0.2
    measured = surface_distance(gyroid.surface, gyroid.shell)
    assert (np.abs(measured - np.abs(height)) < slack).all()
    assert measured.max() < 25.0


def test_a_canopy_with_straight_eaves_has_room_for_its_bars():
    corners = [[0, 0, 0], [12000, 0, 2500], [12000, 9000, 0], [0, 9000, 2500]]
    made = build(
        make_design(
            {
                "surface": {"rim": [corners]},
                "lattice": {"panel_size": 600.0},
                "beams": {"width": 8, "height": 60},
                "checks": {"rim_distance": 70},
            }
        )
    )
    assert made.ok, [one.name for one in made.checks if not one.ok]


@pytest.mark.long
@pytest.mark.parametrize(("name", "size"), [("schwarz-d", 400.0), ("gyroid", 400.0)])
def test_two_cells_are_cut(name, size):
    made = build(periodic(name, size, "face", (2, 1, 1)))
    assert made.ok, [one.name for one in made.checks if not one.ok]

"""Volumes, areas and centroids of polyhedra are exact, non-convex ones too."""

import numpy as np
import pytest
from parts_samples import as_manifold, sample

from phexfab.fabrication.panels import PanelSpec, panels
from phexfab.fabrication.parts import Solid
from phexfab.fabrication.polyhedra import (
    centroids,
    is_closed,
    outward,
    prism_faces,
    solid_planarity,
    surface_areas,
    volumes,
)

BOX = np.array([[0, 0], [2, 0], [2, 3], [0, 3]], float)
ELL = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]], float)  # area 6, reflex at (1, 1)


def prism(polygon, height):
    flat = np.column_stack([polygon, np.zeros(len(polygon))])
    return Solid(np.vstack([flat, flat + np.array([0, 0, height])]), prism_faces(len(polygon)))


def moved(solid, seed):
    """Turned at random and taken far from the origin."""
    rng = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turn *= np.sign(np.linalg.det(turn))
    return Solid(solid.vertices @ turn.T + rng.normal(size=3) * 1000, solid.faces), turn


def test_known_volumes_areas_and_centroids():
    box, ell = prism(BOX, 5.0), prism(ELL, 2.0)
    tetra = Solid(np.vstack([np.zeros(3), np.eye(3)]), ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)))
    many = [box, ell, tetra, box]
    np.testing.assert_allclose(volumes(many), [30, 12, 1 / 6, 30], rtol=1e-15)
    slant = 1.5 + np.sqrt(3) / 2
    np.testing.assert_allclose(surface_areas(many), [62, 12 + 28, slant, 62], rtol=1e-15)
    # The ell is a 4×1 and a 1×2 rectangle.
    middle = (4 * np.array([2, 0.5]) + 2 * np.array([0.5, 2])) / 6
    np.testing.assert_allclose(
        centroids(many), [[1, 1.5, 2.5], [*middle, 1], [0.25] * 3, [1, 1.5, 2.5]], rtol=1e-14
    )


@pytest.mark.parametrize("seed", range(5))
def test_measures_do_not_depend_on_the_place(seed):
    ell = prism(ELL, 2.0)
    there, turn = moved(ell, seed)
    assert volumes([there])[0] == pytest.approx(12, rel=1e-11)
    assert surface_areas([there])[0] == pytest.approx(40, rel=1e-11)
    offset = there.vertices[0] - turn @ ell.vertices[0]
    np.testing.assert_allclose(centroids([there]), centroids([ell]) @ turn.T + offset, atol=1e-9)
    assert solid_planarity([there])[0] < 1e-11


def test_volume_agrees_with_manifold_on_panels():
    solids = [panel.solid for panel in panels(sample("vertex"), PanelSpec(8, 6, edges="mitred"))]
    expected = [as_manifold(solid).volume() for solid in solids]
    np.testing.assert_allclose(volumes(solids), expected, rtol=1e-12)
    expected = [as_manifold(solid).surface_area() for solid in solids]
    np.testing.assert_allclose(surface_areas(solids), expected, rtol=1e-12)


def test_an_inside_out_solid_is_turned():
    ell = prism(ELL, 2.0)
    inside_out = Solid(ell.vertices, tuple(face[::-1] for face in ell.faces))
    assert volumes([inside_out])[0] == pytest.approx(-12)
    assert volumes([outward(inside_out)])[0] == pytest.approx(12)
    assert outward(ell) is ell


def test_a_raised_corner_is_seen():
    ell = prism(ELL, 2.0)
    vertices = ell.vertices.copy()
    vertices[7] += [0, 0, 1e-3]
    warp = solid_planarity([Solid(vertices, ell.faces)])[0]
    assert 1e-4 < warp < 1e-3


def test_a_missing_or_turned_face_is_not_closed():
    ell = prism(ELL, 2.0)
    assert is_closed(ell)
    assert not is_closed(Solid(ell.vertices, ell.faces[1:]))
    assert not is_closed(Solid(ell.vertices, (ell.faces[0][::-1], *ell.faces[1:])))


def test_nothing_has_no_measure():
    assert volumes([]).shape == surface_areas([]).shape == (0,)
    assert centroids([]).shape == (0, 3)

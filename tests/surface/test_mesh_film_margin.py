"""Films that go on beyond their rims stay the same films."""

import numpy as np
import pytest
from scipy.optimize import brentq

from phexfab.errors import SurfaceError
from phexfab.surface.mesh_films.film_area import heights_over
from phexfab.surface.mesh_films.margin import mesh_film_with_margin
from phexfab.surface.mesh_films.mesh_film import mesh_film
from phexfab.surface.rims.rim import Rim

R = 1000.0


def circle(height, radius=R, way=1):
    def at(t, turn=0.0):
        angle = way * 2 * np.pi * np.asarray(t) + turn
        return radius * np.stack([np.cos(angle), np.sin(angle), 0 * angle], -1)

    return Rim.of(
        lambda t: at(t) + np.array([0, 0, height]),
        lambda t: way * 2 * np.pi * at(t, np.pi / 2),
        name=f"circle at {height:g}",
    )


@pytest.mark.parametrize("way", [1, -1])
def test_a_catenoid_goes_on_as_the_catenoid(way):
    film = mesh_film((circle(-400), circle(400, way=way)), 120.0)
    rough = mesh_film_with_margin(film, 150.0, corrections=0)
    wide = mesh_film_with_margin(film, 150.0)
    assert wide.off_rim < 0.05 and wide.off_rim < 0.1 * rough.off_rim
    assert wide.rims is film.rims and len(wide.border_loops()) == 2
    neck = brentq(lambda a: a * np.cosh(0.4 / a) - 1, 0.56, 1.0) * R
    x, y, z = wide.points.T
    assert np.abs(np.hypot(x, y) - neck * np.cosh(z / neck)).max() < 0.3
    # The border lies the margin beyond, measured along the meridian neck·sinh(z/neck).
    beyond = neck * (np.sinh(wide.border[1].point(0.0)[2] / neck) - np.sinh(400 / neck))
    assert beyond == pytest.approx(150.0, rel=0.02)


def lobed(lobes, amplitude, radius=5000.0):
    def at(t):
        a = 2 * np.pi * np.asarray(t)
        return np.stack([radius * np.cos(a), radius * np.sin(a), amplitude * np.cos(lobes * a)], -1)

    def slope(t):
        a = 2 * np.pi * np.asarray(t)
        rise = -lobes * amplitude * np.sin(lobes * a)
        return 2 * np.pi * np.stack([-radius * np.sin(a), radius * np.cos(a), rise], -1)

    return Rim.of(at, slope, name=f"{lobes} lobes")


def test_a_disc_goes_on_smoothly_and_passes_through_its_rim():
    film = mesh_film((lobed(3, 1200.0),), 450.0)
    wide = mesh_film_with_margin(film, 600.0)
    height, _ = heights_over(wide.atlas, film.rims[0].samples(200)[1])
    assert np.abs(height).max() < 0.05 and wide.off_rim < 0.05
    inside, own = heights_over(wide.atlas, film.points)
    assert np.abs(inside).max() < 0.5
    normals = film.surface.normal(film.atlas.parameter_of_vertex(np.arange(len(film.points))))
    assert (normals * own).sum(1).min() > 1 - 1e-5


def test_corners_go_on_to_corners():
    corners = [[0, 0, 0], [12000, 0, 2000], [12000, 9000, 500], [0, 9000, 2500]]
    film = mesh_film((Rim.through(corners, corners=range(4)),), 700.0)
    wide = mesh_film_with_margin(film, 700.0)
    assert len(wide.border[0].corners) == 4 and wide.off_rim < 5.0
    gap = np.linalg.norm(
        wide.border[0].point(wide.border[0].corners)[:, None] - np.array(corners), axis=2
    )
    assert (np.abs(gap.min(axis=1) - 700 * np.sqrt(2)) < 120).all()


def test_a_re_entrant_corner_has_a_film():
    corners = [[0, 0, 0], [12, 0, 1], [12, 5, 0], [5, 5, 1.5], [5, 9, 0], [0, 9, 1]]
    for edge in (800.0, 500.0, 300.0):
        film = mesh_film((Rim.through(1000 * np.array(corners), corners=range(6)),), edge)
        assert film.unstable == 0 and film.defect <= 1e-6
        assert 0 < film.rough < 20  # about the corner only


def test_margins_that_cannot_be_are_refused():
    film = mesh_film((circle(-400), circle(400)), 150.0)
    for margin in (0.0, -1.0, 5000.0, np.nan):
        with pytest.raises(SurfaceError, match="margin ="):
            mesh_film_with_margin(film, margin)
    near = mesh_film((circle(-650), circle(650)), 150.0)
    with pytest.raises(SurfaceError, match="still exists"):
        mesh_film_with_margin(near, 500.0)

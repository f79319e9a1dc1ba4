"""The catalog: every name works, and what does not exist is refused with what does."""

import numpy as np
import pytest

import phexfab
from phexfab.errors import SurfaceError
from phexfab.surface import catalog, surface


@pytest.mark.parametrize("name", list(catalog))
def test_every_entry_makes_the_surface_of_its_name(name):
    entry, smooth = catalog[name], surface(name)
    assert entry.name == name and smooth.name.startswith(name.split("-")[0])
    assert entry.description and entry.source.endswith(")")
    assert "bonnet_angle" in entry.options
    assert surface(name, **entry.options).rectangle == smooth.rectangle
    u0, u1, v0, v1 = smooth.rectangle
    assert u0 < u1 and v0 < v1


@pytest.mark.parametrize("name", list(catalog))
def test_panels_differ_in_size_by_less_than_one_to_two_and_a_half(name):
    smooth = surface(name)
    u0, u1, v0, v1 = smooth.rectangle
    w = np.linspace(u0, u1, 41)[:, None] + 1j * np.linspace(v0, v1, 41)
    size = smooth.principal_curvatures(smooth.parameter(w))[..., 1] ** -0.5
    assert size.max() / size.min() < 2.5


@pytest.mark.parametrize("name", list(catalog))
def test_the_default_patch_does_not_meet_itself(name):
    """Points that are far apart in the rectangle are apart in space."""
    smooth = surface(name)
    u0, u1, v0, v1 = smooth.rectangle
    n = 25
    closed = smooth.period is not None
    v = np.linspace(v0, v1, n, endpoint=not closed)
    w = (np.linspace(u0, u1, n)[:, None] + 1j * v).ravel()
    x = smooth.point(smooth.parameter(w))
    step = max(u1 - u0, v1 - v0) / n
    kappa = smooth.principal_curvatures(smooth.parameter(w))[:, 1]
    apart = w[:, None] - w[None]
    if closed:
        apart = apart.real + 1j * ((apart.imag + np.pi) % (2 * np.pi) - np.pi)
    distance = np.linalg.norm(x[:, None] - x[None], axis=2)
    far = np.abs(apart) > 4 * step
    assert distance[far].min() > step / np.sqrt(kappa.max())


def test_the_public_name():
    assert phexfab.minimal_surface is surface
    assert phexfab.surface.minimal_surface is surface  # the package, not the function
    assert "minimal_surface" in phexfab.__all__ and "surface" not in phexfab.__all__


@pytest.mark.parametrize(
    ("name", "options", "words"),
    [
        ("katenoid", {}, "there is no surface 'katenoid'; did you mean 'catenoid'?"),
        ("gyroid", {}, "the catalog has enneper, catenoid, helicoid"),
        ("enneper", {"ordre": 2}, "enneper has no option 'ordre'; did you mean 'order'?"),
        ("catenoid", {"order": 2}, "catenoid has no option 'order'"),
        ("enneper", {"order": 0}, "enneper: order must be between 1 and 12, not 0"),
        ("enneper", {"order": 1.5}, "enneper: order must be a whole number, not 1.5"),
        ("enneper", {"order": True}, "enneper: order must be a whole number, not True"),
        ("bour", {"order": 2}, "bour: order must be between 3 and 12, not 2"),
        ("richmond", {"order": 13}, "richmond: order must be between 1 and 12, not 13"),
        ("jorge-meeks", {"ends": 2}, "jorge-meeks: ends must be between 3 and 12, not 2"),
        ("enneper", {"bonnet_angle": "30"}, "bonnet_angle must be a number of degrees, not '30'"),
        ("enneper", {"bonnet_angle": np.inf}, "the Bonnet angle must be finite, not inf"),
    ],
)
def test_mistakes_are_named(name, options, words):
    with pytest.raises(SurfaceError) as caught:
        surface(name, **options)
    assert words in str(caught.value)

"""Rectangles with umbilics, branch points and ends are refused by name and place; others pass."""

import numpy as np
import pytest
from surface_samples import MAKERS, made

from phexfab.errors import SurfaceError
from phexfab.surface import check_rectangle, from_expressions, from_weierstrass, surface
from phexfab.surface.holomorphic import show


def refusal(smooth, u, v):
    with pytest.raises(SurfaceError) as caught:
        check_rectangle(smooth, u, v)
    message = str(caught.value)
    assert message.startswith(f"{smooth.name}: the rectangle u = ")
    return message


def around(w, reach=0.1):
    return (w.real - reach, w.real + reach), (w.imag - 1.1 * reach, w.imag + 0.9 * reach)


@pytest.mark.parametrize("name", list(MAKERS))
def test_the_catalog_s_rectangles_are_good(name):
    u0, u1, v0, v1 = made(name).rectangle
    check_rectangle(made(name), (u0, u1), (v0, v1))


@pytest.mark.parametrize("order", [2, 5, 12])
def test_so_are_those_of_other_orders(order):
    options = [("enneper", {"order": order}), ("richmond", {"order": order})]
    options += [("bour", {"order": max(3, order)}), ("jorge-meeks", {"ends": max(3, order)})]
    for name, given in options:
        u0, u1, v0, v1 = surface(name, **given).rectangle
        check_rectangle(surface(name, **given), (u0, u1), (v0, v1))


# Surface, options, place in z and in w, what is there.
PLACES = [
    ("enneper", {"order": 3}, 0, "an umbilic", "a zero of order 2"),
    ("enneper", {"order": 2}, 0, "an umbilic", "a zero of order 1"),
    ("bour", {}, 0, "a branch point", "a zero of order 1"),
    ("trinoid", {}, 0, "an umbilic", "a zero of order 1"),
    ("jorge-meeks", {"ends": 5}, 0, "an umbilic", "a zero of order 3"),
    ("richmond", {}, 0, "an end", "a pole of order 1"),
    ("scherk-1", {}, 1, "an end", "a pole of order 1"),
    ("scherk-1", {}, -1j, "an end", "a pole of order 1"),
    ("scherk-2", {}, 1j, "an end", "a pole of order 1"),
    ("catalan", {}, 0, "a branch point", "a zero of order 1"),
    ("catalan", {}, -2 * np.pi, "a branch point", "a zero of order 1"),
    ("henneberg", {}, 1, "a branch point", "a zero of order 1"),
    ("henneberg", {}, 1j, "a branch point", "a zero of order 1"),
]


@pytest.mark.parametrize(("name", "options", "place", "kind", "order"), PLACES)
@pytest.mark.parametrize("side", ["around", "touching"])
def test_singular_places_are_named(name, options, place, kind, order, side):
    smooth = surface(name, **options)
    close = smooth.base + (place - smooth.base) * (1 - 1e-10)
    w = complex(smooth.curvature_coordinates(close))
    if side == "around":
        u, v = around(w)
    else:  # the singular point is a corner, the one farthest from w = 0
        inward = -np.sign(w.real), -np.sign(w.imag)
        u = tuple(sorted((w.real, w.real + 0.15 * (inward[0] or 1))))
        v = tuple(sorted((w.imag, w.imag + 0.15 * (inward[1] or 1))))
    message = refusal(smooth, u, v)
    assert order in message
    assert f"z = {show(place)}" in message
    if "cannot be reached" not in message:
        assert kind in message
        told = message.split(", w = ")[1].split(" ")[0].replace("i", "j")
        assert abs(complex(told) - w) < 0.01


def test_henneberg_through_its_branch_point():
    message = refusal(surface("henneberg"), (-0.2, 1.2), (-1.2, 0.2))
    assert "z = 1," in message and "a zero of order 1" in message


def test_the_trinoid_through_an_end():
    """Its ends are at w = ±∞ in v; the rectangle comes so near that nothing can be built."""
    assert "an end at z = 0.5" in refusal(surface("trinoid"), (-0.3, 0.3), (-10, 10))


def test_an_end_that_the_coordinates_do_not_feel():
    """f has a double pole where g' has a double zero: Q is 3 all over, w = √3 z."""
    own = from_expressions(g="(z - 0.3)**3", f="(z - 0.3)**-2", name="mine")
    message = refusal(own, (-0.1, 1.0), (-0.4, 0.4))
    assert "an end at z = 0.3" in message
    check_rectangle(own, (-0.1, 0.1), (-0.1, 0.1))


def test_where_the_parameter_is_infinite():
    """Scherk's surface is regular where g is infinite, but z does not reach it."""
    corner = 2 * 1.3110287771460598
    message = refusal(surface("scherk-1"), (2.5, 2.7), (2.5, 2.7))
    assert "does not reach" in message
    told = message.split(", w = ")[1].split(" ")[0].replace("i", "j")
    assert abs(complex(told) - corner * (1 + 1j)) < 1e-3


UMBILIC = np.sqrt(0.4)


@pytest.mark.parametrize("how", ["text", "callables"])
def test_an_umbilic_that_nobody_declared(how):
    """g = z³ - 1.2 z has g' = 0 at z = ±√0.4, at w = ±0.544i."""
    own = (
        from_expressions(g="z**3 - 1.2*z", f="1", name="mine")
        if how == "text"
        else from_weierstrass(lambda z: z**3 - 1.2 * z, np.ones_like, name="mine")
    )
    # w = ∫ √(3(z² - 0.4)) dz, by hand: ± i √3 · 0.4 · π/4.
    w = 0.1 * np.pi * np.sqrt(3) * 1j
    for u, v in ((-0.1, 0.1), (0.45, 0.65)), ((-0.5, 0.5), (-0.5, 0.6)):
        message = refusal(own, u, v)
        assert "contains an umbilic at z = 0.632456," in message
        told = message.split(", w = ")[1].split(" ")[0].replace("i", "j")
        assert abs(complex(told) - w) < 1e-3
    check_rectangle(own, (-0.5, 0.5), (-0.5, 0.5))
    check_rectangle(own, (0.1, 0.5), (0.3, 0.5))


def test_a_rectangle_behind_a_singular_point_is_torn():
    """Seen from w = 0 its parts lie on different sides of the umbilic: two sheets."""
    smooth = surface("enneper", order=2)
    umbilic = complex(smooth.curvature_coordinates(0)).real
    message = refusal(smooth, (umbilic - 1.2, umbilic - 0.4), (-0.3, 0.3))
    assert "is torn near w = " in message
    check_rectangle(smooth, (umbilic - 1.2, umbilic - 0.4), (0.2, 0.7))


@pytest.mark.parametrize(
    ("name", "u", "v"),
    [
        ("enneper", (-9.0, 14.0), (-3.0, 8.0)),
        ("catenoid", (-2.0, 3.0), (-30.0, 30.0)),
        ("scherk-1", (-1.5, 1.5), (-0.5, 2.0)),
        ("trinoid", (-0.05, 0.05), (-1.5, 1.5)),
        ("catalan", (-2.2, 2.2), (-3.0, 3.0)),
        ("henneberg", (-0.7, 0.7), (-0.7, 0.7)),
        ("richmond", (-1.0, 2.0), (-3.0, 3.0)),
    ],
)
def test_larger_rectangles_without_singular_points_pass(name, u, v):
    check_rectangle(surface(name), u, v)


@pytest.mark.parametrize("u", [(0.2, 0.2), (0.3, -0.3), (0.0, np.nan), (-np.inf, 0.0)])
def test_an_empty_rectangle_is_refused(u):
    assert "is empty; give each side from smaller to larger" in refusal(
        surface("enneper"), u, (-0.1, 0.1)
    )

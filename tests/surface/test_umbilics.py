"""Umbilics: all of them, to rounding, with their orders; branch points and ends refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from phexfab.errors import SurfaceError
from phexfab.surface import from_weierstrass, surface
from phexfab.surface.domain import Disc
from phexfab.surface.umbilics import branch_order, hopf_zeros, umbilics

P = np.polynomial.polynomial
UNIT = Disc()


def polynomial(zeros):
    return lambda z: np.prod([z - zero for zero in zeros], axis=0)


def assert_found(found, zeros, orders, tolerance):
    assert len(found) == len(zeros)
    for zero, order in zip(zeros, orders, strict=True):
        k = np.abs(found.places - zero).argmin()
        assert abs(found.places[k] - zero) <= tolerance
        assert found.orders[k] == order


@pytest.mark.parametrize("order", [1, 2, 3, 4, 6, 12])
def test_enneper_has_one_umbilic_of_one_order_less(order):
    found = umbilics(surface("enneper", order=order), UNIT)
    zeros = [] if order == 1 else [0.0]
    assert_found(found, zeros, [order - 1] * len(zeros), 1e-15)


@settings(max_examples=60, deadline=None)
@given(
    places=st.lists(
        st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=1, max_size=8, unique=True
    ),
    orders=st.lists(st.integers(1, 3), min_size=8, max_size=8),
    turn=st.floats(0, 6.3),
)
def test_zeros_of_polynomials(places, orders, turn):
    zeros = np.array([complex(x, y) / 10 * np.exp(1j * turn) for x, y in places])
    orders = np.array(orders[: len(zeros)])
    near = np.abs(np.abs(zeros) - 1) < 1e-3
    zeros, orders = zeros[~near], orders[~near]
    if not len(zeros):
        return
    inside = np.abs(zeros) < 1
    found = hopf_zeros(polynomial(np.repeat(zeros, orders)), UNIT)
    assert_found(found, zeros[inside], orders[inside], 1e-11)


@pytest.mark.parametrize("gap", [1e-2, 1e-4, 1e-6])
def test_neighbours_are_told_apart(gap):
    zeros = [0.3, 0.3 + gap, -0.2j]
    assert_found(hopf_zeros(polynomial(zeros), UNIT), zeros, [1, 1, 1], 1e-3 * gap)


def test_what_rounding_cannot_tell_apart_is_one():
    found = hopf_zeros(polynomial([0.3, 0.3 + 1e-10, -0.2j]), UNIT)
    assert_found(found, [-0.2j, 0.3], [1, 2], 1e-9)


def test_zeros_of_a_transcendental_function():
    found = hopf_zeros(lambda z: np.sin(z) * np.exp(z), Disc(0.5, 7.0))
    assert_found(found, np.pi * np.array([-2, -1, 0, 1, 2]), [1] * 5, 1e-13)


def test_the_domain_decides():
    zeros = [0.2, 0.9j, 1.0000001, -0.5]
    found = hopf_zeros(polynomial(zeros), Disc(0, 1, ((-0.5, 0.1),)))
    assert_found(found, [0.2, 0.9j], [1, 1], 1e-14)


def test_a_zero_on_the_border_belongs_to_the_domain():
    assert_found(hopf_zeros(polynomial([1.0, 0.25j]), UNIT), [1.0, 0.25j], [1, 1], 1e-13)


def test_a_ring_may_have_a_pole_in_its_hole():
    found = hopf_zeros(lambda z: (z - 0.7) / z**3, Disc(0, 1, ((0, 0.3),)))
    assert_found(found, [0.7], [1], 1e-14)


def test_branch_points_are_refused_with_place_and_order():
    for order in (3, 4):
        with pytest.raises(SurfaceError, match=rf"z = 0 is a branch point of order {order - 2} "):
            umbilics(surface("bour", order=order), UNIT)


def test_the_order_of_a_branch_point_is_that_of_the_null_curve():
    # g has a pole of order 1 at 0 and f a zero of order 2 + b: φ vanishes to order b there.
    for b in (0, 1, 2):
        made = from_weierstrass(lambda z: 1 / z, lambda z, b=b: z ** (2 + b), base=0.5)
        assert branch_order(made, 0.0) == b
    assert branch_order(surface("enneper", order=4), 0.0) == 0


def test_ends_are_refused():
    with pytest.raises(SurfaceError, match=r"a pole of order \d of the Hopf .* at z = -?1"):
        umbilics(surface("trinoid"), Disc(0, 1.3))
    assert_found(umbilics(surface("trinoid"), Disc(0, 0.9)), [0], [1], 1e-12)


def test_planes_are_refused():
    with pytest.raises(SurfaceError, match="the film is a plane"):
        hopf_zeros(np.zeros_like, UNIT)


@pytest.mark.parametrize(
    ("domain", "message"),
    [
        ((0, -1.0), "radius must be positive"),
        ((0, 1.0, ((0.9, 0.2),)), "does not lie inside"),
        ((0, 1.0, ((0.1, 0.2), (-0.1, 0.1))), "touch"),
    ],
)
def test_impossible_domains(domain, message):
    with pytest.raises(SurfaceError, match=message):
        Disc(*domain)


@pytest.mark.parametrize("gap", [1e-5, 3e-6, 3e-7, 1e-7, 3e-8, 1e-9])
@pytest.mark.parametrize("place", [0.0, 0.3 + 0.2j, 0.5j])
@pytest.mark.parametrize("towards", [1.0, np.exp(0.7j)])
@pytest.mark.parametrize("count", [2, 3])
def test_zeros_are_counted_however_near_they_are(gap, place, towards, count):
    zeros = place + gap * towards * np.arange(count)
    powers = P.polyfromroots(zeros)  # whose sum rounds to about 1e-16
    found = hopf_zeros(lambda z: P.polyval(z, powers), UNIT)
    assert found.orders.sum() == count
    # Rounding moves a zero of order n by about eps^(1/n).
    away = np.abs(found.places[:, None] - zeros).min(axis=1)
    assert away.max() <= 2 * count * gap + 1e-15 ** (1 / count)

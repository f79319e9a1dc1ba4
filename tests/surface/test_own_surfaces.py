"""Surfaces of one's own equal the catalog's; removable points are filled in; text is checked."""

import numpy as np
import pytest
from surface_samples import parameters, spread

from phexfab.errors import SurfaceError
from phexfab.surface import (
    from_expressions,
    from_height_differential,
    from_weierstrass,
    surface,
)
from phexfab.surface.expressions import FUNCTIONS, Expression

TEXT = {
    "enneper": {"g": "z", "f": "1"},
    "catenoid": {"g": "exp(z)", "dh": "1"},
    "helicoid": {"g": "exp(z)", "dh": "i"},
    "scherk-1": {"g": "z", "f": "4/(1 - z**4)"},
    "scherk-2": {"g": "z", "dh": "4*I*z/(1 - z**4)"},
    "henneberg": {"g": "z", "f": "2*(1 - z**-4)", "base": "(1 + 1j)/sqrt(2)"},
    "catalan": {"g": "exp(-z*i/2)", "f": "1 - e**(i*z)", "base": "-pi"},
    "bour": {"g": "z", "dh": "z**2"},
    "richmond": {"g": "z**2", "f": "1/z**2"},
    "trinoid": {"g": "z**2", "f": "(z**3 + 1)**-2", "base": "1"},
    "jorge-meeks": {"g": "z**3", "dh": "z**3/(z**4 + 1)**2", "base": "1"},
}


@pytest.mark.parametrize("name", list(TEXT))
def test_expressions_give_the_catalog_s_surfaces(name):
    known = surface(name)
    own = from_expressions(**{"base": known.base} | TEXT[name])
    z, w = parameters(name), spread(name)
    assert own.base == pytest.approx(known.base, abs=1e-15)
    shift = known.point(known.base)
    assert np.allclose(own.point(z) + shift, known.point(z), rtol=1e-12, atol=1e-12)
    assert np.allclose(own.normal(z), known.normal(z), atol=1e-14)
    assert np.allclose(own.second_form(z), known.second_form(z), rtol=1e-11, atol=1e-11)
    # The closed form may have chosen the other root at the base.
    own_w, known_w = own.curvature_coordinates(z), known.curvature_coordinates(z)
    sign = np.sign((own_w * known_w.conj()).real[np.abs(known_w) > 0.01]).mean()
    assert abs(sign) == 1 and np.allclose(own_w, sign * known_w, atol=1e-12)
    assert np.allclose(own.parameter(sign * w), known.parameter(w), atol=1e-11)


def test_callables_need_no_derivative():
    known = surface("scherk-1")
    z = parameters("scherk-1")
    z = z[np.abs(z) < 0.8]
    for own in (
        from_weierstrass(lambda z: z, lambda z: 4 / (1 - z**4), scale=3.0),
        from_height_differential(lambda z: z, lambda z: 4 * z / (1 - z**4), scale=3.0),
    ):
        assert np.allclose(own.point(z), known.scaled(3.0).point(z), atol=1e-12)
        assert np.allclose(own.gaussian_curvature(z) * 9, known.gaussian_curvature(z), rtol=1e-9)
        assert np.allclose(own.parameter(0.4 + 0.3j), known.parameter(0.4 + 0.3j), atol=1e-12)
    assert len(z) > 20


def test_a_constant_may_be_a_plain_number():
    own = from_weierstrass(lambda z: z, lambda z: 1.0)
    z = parameters("enneper")
    assert np.allclose(own.point(z), surface("enneper").point(z), atol=1e-14)


@pytest.mark.parametrize(
    ("options", "z"),
    [
        ({"g": "sin(z)", "dh": "z"}, 0.0),  # f = z/sin z
        ({"g": "sin(z)/z", "f": "1", "base": "1"}, 0.0),
        ({"g": "z + z**2", "dh": "z*(z + 1)"}, -1.0),  # f = dh/g is 0/0 twice
        ({"g": "1/z", "f": "z**2", "base": "0.5"}, 0.0),  # g has a pole, the surface none
        ({"g": "1/z", "dh": "z", "base": "0.5"}, 0.0),
        ({"g": "1/sin(z)", "dh": "sin(z)", "base": "0.5"}, 0.0),
    ],
    ids=str,
)
def test_removable_points_are_the_limits_of_their_neighbours(options, z):
    """Harmonic and analytic functions are the mean over a small circle."""
    own = from_expressions(**options)
    circle = z + 0.02 * np.exp(2j * np.pi * np.arange(16) / 16)
    assert np.allclose(own.tangent(z), own.tangent(circle).mean(0), atol=1e-13)
    assert np.allclose(own.point(z), own.point(circle).mean(0), atol=1e-13)
    assert np.allclose(own.hopf(z), own.hopf(circle).mean(0), atol=1e-13)
    assert np.allclose(own.normal(z), own.normal(z + 1e-7), atol=1e-6)
    beside = own.second_form(z + 1e-7 * np.array([1, 1j]))
    assert np.abs(own.second_form(z) - beside).max() < 1e-6


@pytest.mark.parametrize(
    ("g", "f", "base", "value"),
    [("z**2", "1", 0.0, "0"), ("1", "1", 0.0, "0"), ("z", "1/z", 0.0, "inf"), ("z", "z", 0.0, "0")],
)
def test_a_base_that_is_singular_is_refused(g, f, base, value):
    with pytest.raises(SurfaceError) as caught:
        from_expressions(g=g, f=f, base=base, name="mine")
    words = f"mine: the Hopf differential f g' is {value} at the base z = 0"
    assert words in str(caught.value)


def test_a_plane_is_refused_when_the_derivative_is_numerical_too():
    with pytest.raises(SurfaceError, match="or a plane"):
        from_weierstrass(lambda z: 0.3 + 0 * z, np.exp)


@pytest.mark.parametrize("options", [{}, {"dh": "z", "f": "1"}])
def test_one_of_dh_and_f_is_needed(options):
    with pytest.raises(SurfaceError, match=r"either dh .* or f, and not both"):
        from_expressions(g="z", **options)


@pytest.mark.parametrize(
    ("text", "function"),
    [
        ("z**2 * exp(-z)", lambda z: z**2 * np.exp(-z)),
        ("(1 - z**4)**-1", lambda z: 1 / (1 - z**4)),
        ("sin(z)/cos(z) - tan(z) + z", lambda z: z),
        ("cosh(z)**2 - sinh(z)**2 + tanh(z)", lambda z: 1 + np.tanh(z)),
        ("sqrt(z)*log(z)", lambda z: np.sqrt(z) * np.log(z)),
        ("z**z", lambda z: np.exp(z * np.log(z))),
        ("2**z + z**0.5", lambda z: np.exp(z * np.log(2)) + np.sqrt(z)),
        ("-+z/(3 - 2e-1*i) + 0.5j", lambda z: -z / (3 - 0.2j) + 0.5j),
        ("pi*z + e", lambda z: np.pi * z + np.e),
    ],
)
def test_expressions_and_their_derivatives(text, function):
    z = np.array([0.7 + 0.2j, 1.3 - 0.4j, 0.4 + 1.1j])
    circle = 0.1 * np.exp(2j * np.pi * np.arange(32) / 32)
    made = Expression(text)
    assert np.allclose(made(z), function(z), rtol=1e-14)
    slope = (function(z[:, None] + circle) / circle).mean(1)
    assert np.allclose(made.derivative(z), slope, rtol=1e-13)


@pytest.mark.parametrize("name", list(FUNCTIONS))
def test_every_function_has_its_own_derivative(name):
    z = np.array([0.7 + 0.2j, 1.3 - 0.4j])
    circle = 0.1 * np.exp(2j * np.pi * np.arange(32) / 32)
    slope = (getattr(np, name)(z[:, None] + circle) / circle).mean(1)
    assert np.allclose(Expression(f"{name}(z)").derivative(z), slope, rtol=1e-12)


def test_powers_are_exact_at_zero():
    zero = np.zeros(1, complex)
    assert Expression("z**3").derivative(zero) == 0 == Expression("z**2")(zero)
    assert Expression("z**1").derivative(zero) == 1 == Expression("z**0")(zero)
    assert Expression("sqrt(0)*z").derivative(zero) == 0


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("__import__('os').system('true')", "__import__('os').system('true')"),
        ("__import__('os')", "the function '__import__'"),
        ("eval('z')", "the function 'eval'"),
        ("z.real", "'z.real' (Attribute)"),
        ("exp.__class__", "(Attribute)"),
        ("().__class__.__bases__", "(Attribute)"),
        ("x + 1", "the name 'x'"),
        ("exp + z", "the name 'exp'"),
        ("foo(z)", "the function 'foo' is not allowed; the functions are exp, log"),
        ("exp(z, z)", "exp() of more or less than one value"),
        ("exp()", "exp() of more or less than one value"),
        ("exp(x=z)", "exp() of more or less than one value"),
        ("z^2", "the operator BitXor"),
        ("z // 2", "the operator FloorDiv"),
        ("z @ z", "the operator MatMult"),
        ("~z", "(UnaryOp)"),
        ("lambda: z", "(Lambda)"),
        ("[z for z in z]", "(ListComp)"),
        ("z if z else 1", "(IfExp)"),
        ("z < 1", "(Compare)"),
        ("z[0]", "(Subscript)"),
        ("f'{z}'", "(JoinedStr)"),
        ("(z := 2)", "(NamedExpr)"),
        ("'z'", ": 'z' is not allowed; write numbers"),
        ("True", "True"),
        ("None", "None"),
    ],
)
def test_what_is_not_on_the_list_is_refused_by_name(text, named):
    with pytest.raises(SurfaceError) as caught:
        from_expressions(g="z", dh=text)
    message = str(caught.value)
    assert message.startswith("dh = ") and "is not allowed" in message
    assert named in message


@pytest.mark.parametrize("text", ["z +", "import os", "z; z", "exp(z", "z = 1", "2z"])
def test_what_is_no_expression_is_refused(text):
    with pytest.raises(SurfaceError, match=r"^g = .* is not an expression: "):
        from_expressions(g=text, dh="z")


@pytest.mark.parametrize("text", ["", "  ", 3, None])
def test_an_expression_must_be_text(text):
    with pytest.raises(SurfaceError, match="must be an expression in z such as"):
        Expression(text, "g")


@pytest.mark.parametrize("text", ["z+" * 1001 + "z", "(" * 900 + "z" + ")" * 900, "-" * 1500 + "z"])
def test_long_and_deep_texts_are_refused(text):
    with pytest.raises(SurfaceError, match=r"characters; at most|is not an expression"):
        Expression(text, "g")


def test_a_huge_power_takes_no_time_and_runs_to_infinity():
    assert not np.isfinite(Expression("9**9**9**9 * z")(np.ones(1, complex)))

"""Analytic functions written in a design file, with their exact derivatives.

An expression such as ``"z**2 * exp(-z)"`` is parsed, checked against a short list of what is
allowed, and evaluated on dual numbers (value, derivative). Nothing is ever executed by Python's
own evaluator.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable

import numpy as np

from phexfab.errors import SurfaceError
from phexfab.surface.holomorphic import ComplexArray

Dual = tuple[ComplexArray, ComplexArray]

CONSTANTS: dict[str, complex] = {
    "pi": np.pi + 0j,
    "e": np.e + 0j,
    "i": 1j,
    "I": 1j,
    "j": 1j,
}

FUNCTIONS: dict[str, tuple[Callable, Callable]] = {
    "exp": (np.exp, np.exp),
    "log": (np.log, lambda z: 1 / z),
    "sqrt": (np.sqrt, lambda z: 0.5 / np.sqrt(z)),
    "sin": (np.sin, np.cos),
    "cos": (np.cos, lambda z: -np.sin(z)),
    "tan": (np.tan, lambda z: 1 / np.cos(z) ** 2),
    "sinh": (np.sinh, np.cosh),
    "cosh": (np.cosh, np.sinh),
    "tanh": (np.tanh, lambda z: 1 / np.cosh(z) ** 2),
}

OPERATORS: dict[type, str] = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.Pow: "**",
}

LONGEST = 2000


class Expression:
    """An analytic function of z, from text.

    Parameters
    ----------
    text : str
        Numbers, ``z``, ``i`` (also ``I`` or ``j``), ``pi``, ``e``, the operators ``+ - * / **``,
        parentheses and the functions exp, log, sqrt, sin, cos, tan, sinh, cosh, tanh (principal
        branches).
    key : str
        What the text is called in messages.

    Raises
    ------
    SurfaceError
        If the text is not such an expression; the message names what is not allowed.
    """

    def __init__(self, text: str, key: str = "expression") -> None:
        self.text, self.key = text, key
        if not isinstance(text, str) or not text.strip():
            raise SurfaceError(f'{key} must be an expression in z such as "z**2", not {text!r}')
        if len(text) > LONGEST:
            raise SurfaceError(f"{key} has {len(text)} characters; at most {LONGEST} are read")
        try:
            self._tree = ast.parse(text.strip(), mode="eval").body
            self._check(self._tree)
        except (SyntaxError, ValueError, RecursionError, MemoryError) as error:
            if isinstance(error, SurfaceError):
                raise
            said = getattr(error, "msg", None) or error  # without Python's own file and line
            raise SurfaceError(f"{key} = {text[:80]!r} is not an expression: {said}") from error

    def __call__(self, z: ComplexArray) -> ComplexArray:
        """Return the value at ``z``."""
        with np.errstate(all="ignore"):
            return self._evaluate(self._tree, np.asarray(z, complex))[0]

    def derivative(self, z: ComplexArray) -> ComplexArray:
        """Return the exact derivative at ``z``."""
        with np.errstate(all="ignore"):
            return self._evaluate(self._tree, np.asarray(z, complex))[1]

    def __repr__(self) -> str:
        return f"Expression({self.text!r})"

    def _refuse(self, what: str, remedy: str) -> SurfaceError:
        return SurfaceError(f"{self.key} = {self.text[:80]!r}: {what} is not allowed; {remedy}")

    def _check(self, node: ast.expr) -> None:
        """Refuse by name whatever is not on the lists above."""
        match node:
            case ast.Constant(value=bool() | None | str() | bytes()):
                raise self._refuse(repr(node.value), "write numbers such as 2 or 0.5")
            case ast.Constant(value=int() | float() | complex()):
                return
            case ast.Name(id=name):
                if name != "z" and name not in CONSTANTS:
                    known = ", ".join(["z", *CONSTANTS])
                    hint = f"write {name}(...)" if name in FUNCTIONS else f"the names are {known}"
                    raise self._refuse(f"the name {name!r}", hint)
            case ast.UnaryOp(op=ast.UAdd() | ast.USub(), operand=operand):
                self._check(operand)
            case ast.BinOp(left=left, op=op, right=right):
                if type(op) not in OPERATORS:
                    hint = "use ** for powers" if isinstance(op, ast.BitXor) else "use + - * / **"
                    raise self._refuse(f"the operator {type(op).__name__}", hint)
                self._check(left)
                self._check(right)
            case ast.Call(func=ast.Name(id=name), args=[argument], keywords=[]):
                if name not in FUNCTIONS:
                    known = ", ".join(FUNCTIONS)
                    raise self._refuse(f"the function {name!r}", f"the functions are {known}")
                self._check(argument)
            case ast.Call(func=ast.Name(id=name)) if name in FUNCTIONS:
                raise self._refuse(f"{name}() of more or less than one value", "give it one value")
            case _:
                piece = ast.unparse(node)[:40]
                raise self._refuse(
                    f"{piece!r} ({type(node).__name__})",
                    "write numbers, z, + - * / ** and functions",
                )

    def _evaluate(self, node: ast.expr, z: ComplexArray) -> Dual:
        match node:
            case ast.Constant(value=value):
                return _constant(_number(value), z)
            case ast.Name(id="z"):
                return z, np.ones_like(z)
            case ast.Name(id=name):
                return _constant(CONSTANTS[name], z)
            case ast.UnaryOp(op=op, operand=operand):
                a, da = self._evaluate(operand, z)
                return (-a, -da) if isinstance(op, ast.USub) else (a, da)
            case ast.Call(func=ast.Name(id=name), args=[argument]):
                a, da = self._evaluate(argument, z)
                function, slope = FUNCTIONS[name]
                # A constant inside keeps derivative 0 even where the slope is infinite.
                return function(a), np.where(da == 0, 0.0, slope(a) * da)
            case ast.BinOp(left=left, op=op, right=right):
                return _combine(type(op), self._evaluate(left, z), self._evaluate(right, z))
        raise self._refuse(type(node).__name__, "see the help for surfaces")


def _number(value: object) -> complex:
    """Return a literal as a complex number; whole numbers too large for a float are infinite."""
    try:
        return complex(value)  # type: ignore[call-overload]
    except OverflowError:
        return complex(np.inf)


def _constant(value: complex, z: ComplexArray) -> Dual:
    return np.full_like(z, value), np.zeros_like(z)


def _combine(op: type, left: Dual, right: Dual) -> Dual:
    (a, da), (b, db) = left, right
    if op in (ast.Add, ast.Sub):
        sign = operator.add if op is ast.Add else operator.sub
        return sign(a, b), sign(da, db)
    if op is ast.Mult:
        return a * b, da * b + a * db
    if op is ast.Div:
        return a / b, (da - a / b * db) / b
    if not db.any():  # a power with a constant exponent: exact at zero too
        slope = np.where(b == 0, 0.0, b * _power(a, b - 1))
        return _power(a, b), np.where(da == 0, 0.0, slope * da)
    value = np.exp(b * np.log(a))
    return value, value * (db * np.log(a) + b * da / a)


def _power(a: ComplexArray, b: ComplexArray) -> ComplexArray:
    """Return a**b for a constant array b, by multiplication when it is a small whole number."""
    exponent = complex(b.flat[0]) if b.size else 1.0 + 0j
    whole = round(exponent.real) if np.isfinite(exponent.real) else 0
    if exponent == whole and abs(whole) <= 64:
        result = np.ones_like(a)
        square, left = a, abs(whole)
        while left:
            result = result * square if left & 1 else result
            square, left = square * square, left >> 1
        return result if whole >= 0 else 1 / result
    return np.power(a, exponent)

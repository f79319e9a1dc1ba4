"""Quantities with units, as people write them: ``8``, ``"8 mm"``, ``"1.5 in"``, ``"30 deg"``.

Inside phexfab a length is in mm, an angle in degrees, a mass in kg, a density in kg/m³ and a time
in seconds; a bare number means that unit. Conversion is done in rational numbers, so that
``"0.8 cm"`` is the same float as ``8``.
"""

from __future__ import annotations

import math
import re
from fractions import Fraction

from phexfab.errors import DesignError

_DEGREES_PER_RADIAN = Fraction(180 / math.pi)

# Kind of quantity -> unit -> how many base units it holds; the base unit comes first.
UNITS: dict[str, dict[str, Fraction]] = {
    "length": {
        "mm": Fraction(1),
        "cm": Fraction(10),
        "m": Fraction(1000),
        "um": Fraction(1, 1000),
        "µm": Fraction(1, 1000),
        "in": Fraction(254, 10),
        "ft": Fraction(3048, 10),
    },
    "angle": {
        "deg": Fraction(1),
        "°": Fraction(1),
        "rad": _DEGREES_PER_RADIAN,
        "gon": Fraction(9, 10),
    },
    "mass": {
        "kg": Fraction(1),
        "g": Fraction(1, 1000),
        "t": Fraction(1000),
        "lb": Fraction(45359237, 100000000),
    },
    "density": {
        "kg/m3": Fraction(1),
        "kg/m³": Fraction(1),
        "g/cm3": Fraction(1000),
        "g/cm³": Fraction(1000),
        "t/m3": Fraction(1000),
        "t/m³": Fraction(1000),
        "lb/ft3": Fraction(45359237, 100000000) / Fraction(3048, 10000) ** 3,
    },
    "time": {"s": Fraction(1), "min": Fraction(60), "h": Fraction(3600)},
    "number": {},
}
EXAMPLES = {
    "length": '8 or "8 mm"',
    "angle": '30 or "30 deg"',
    "mass": '20 or "20 kg"',
    "density": '7850 or "7850 kg/m3"',
    "time": '20 or "20 s"',
    "number": "a number without a unit, such as 0.5",
}
_KIND_OF = {unit: kind for kind, table in UNITS.items() for unit in table}
_NUMBER = re.compile(r"([+-]?(?:\d[\d_]*\.?\d*|\.\d+)(?:[eE][+-]?\d{1,3})?)\s*(.*)", re.DOTALL)


def _article(kind: str) -> str:
    return f"an {kind}" if kind[0] in "aeiou" else f"a {kind}"


def quantity(value: object, kind: str) -> float:
    """Return a quantity in phexfab's unit for its kind.

    Parameters
    ----------
    value : int, float or str
        A bare number (mm, degrees, kg, kg/m³, s) or a string of a number and a unit.
    kind : str
        A key of ``UNITS``: ``length``, ``angle``, ``mass``, ``density``, ``time`` or ``number``.

    Raises
    ------
    DesignError
        If it is no number, the unit is unknown, or it belongs to another kind of quantity; the
        message says what to write instead.

    Examples
    --------
    >>> from phexfab.design.units import quantity
    >>> quantity("0.8 cm", "length"), quantity(8, "length")
    (8.0, 8.0)
    >>> quantity("8 kg", "length")
    Traceback (most recent call last):
    ...
    phexfab.errors.DesignError: "8 kg" is a mass, but a length is needed; write 8 or "8 mm"
    """
    remedy = f"write {EXAMPLES[kind]}"
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        raise DesignError(f"{_article(kind)} is needed; {remedy}")
    if isinstance(value, int | float):
        return _finite(float(value) if abs(value) < 1e300 else math.inf, remedy)
    if kind == "number":
        raise DesignError(f"a bare number is needed, not text; {remedy}")
    match = _NUMBER.fullmatch(value.strip())
    if match is None:
        raise DesignError(f'"{value}" does not begin with a number; {remedy}')
    digits, unit = match[1].replace("_", ""), match[2].strip()
    if unit.startswith(","):
        raise DesignError(f'"{value}" has a comma; write decimals with a point')
    table = UNITS[kind]
    if unit and unit not in table:
        known = ", ".join(table)
        if unit in _KIND_OF:
            other = _article(_KIND_OF[unit])
            raise DesignError(f'"{value}" is {other}, but {_article(kind)} is needed; {remedy}')
        raise DesignError(f'"{unit}" is no unit of {kind}; use one of {known}')
    number = _finite(float(digits), remedy)
    factor = table[unit] if unit else Fraction(1)
    # Only numbers of sensible size reach the rationals: 1e300 would be a very long integer.
    if not 1e-30 < abs(number) < 1e30:
        return number * float(factor)
    return float(Fraction(digits) * factor)


def _finite(number: float, remedy: str) -> float:
    if not math.isfinite(number):
        raise DesignError(f"not a finite number; {remedy}")
    return number

"""Numbers and words as a reader expects them."""

from __future__ import annotations

import math
from html import escape

_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_THIN = "\u202f"  # narrow, and the line does not break there


def number(value: float | int | str, digits: int = 4) -> str:
    """Return a value with some significant digits, thousands apart, powers of ten raised."""
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "yes" if value else "no"
    if math.isnan(value):
        return "not a number"
    if math.isinf(value):
        return "∞" if value > 0 else "−∞"
    if float(value).is_integer() and abs(value) < 10**7:
        return _minus(f"{int(value):,}")
    if not 1e-3 <= abs(value) < 1e7:
        mantissa, exponent = f"{value:.{max(digits - 2, 1)}e}".split("e")
        mantissa = mantissa.rstrip("0").rstrip(".")
        return _minus(f"{mantissa} × 10{str(int(exponent)).translate(_SUPERSCRIPT)}")
    whole = len(str(int(abs(value)))) if abs(value) >= 1 else 0
    zeros = 0 if whole else -math.floor(math.log10(abs(value))) - 1
    shown = f"{value:,.{max(digits - whole + zeros, 0)}f}"
    if "." in shown:
        shown = shown.rstrip("0").rstrip(".")
    return _minus(shown)


def quantity(value: float | int | str, unit: str, digits: int = 4) -> str:
    """Return a number with its unit; ``"1"`` and ``""`` mean none."""
    shown = number(value, digits)
    if unit in ("", "1") or (isinstance(value, float) and math.isnan(value)):
        return shown
    if unit == "deg":  # beside a raised exponent the sign would read as one more digit
        return f"{shown}{_THIN}°" if "×" in shown else f"{shown}°"
    return f"{shown}{_THIN}{unit}"


def label(name: str) -> str:
    """Return a name with spaces for underscores and a capital first letter, as HTML."""
    words = name.replace("_", " ").strip()
    return escape(words[:1].upper() + words[1:])


def _minus(shown: str) -> str:
    if shown.startswith("-"):
        shown = "−" + shown[1:]
    groups = shown.split(",")
    # Four digits read well as they are.
    if len(groups) == 2 and len(groups[0].lstrip("−")) == 1:
        return "".join(groups)
    return _THIN.join(groups)

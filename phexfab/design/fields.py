"""What the tables of the design file are made of: the kinds of value that a key can hold."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    GetJsonSchemaHandler,
    WithJsonSchema,
)

from phexfab.design.units import UNITS, quantity
from phexfab.errors import DesignError
from phexfab.triangular import EQUILATERAL


class Section(BaseModel):
    """A table of the design file: frozen, typed strictly, unknown keys refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True)


def otherwise(words: str) -> dict[str, Any]:
    """Say in words what holds where a key is left out, for the manual and for editors."""
    return {"x-default": words}


def _of_kind(kind: str) -> BeforeValidator:
    return BeforeValidator(lambda value: quantity(value, kind))


@dataclass(frozen=True)
class _Written:
    """How a quantity may be written, for the JSON Schema: a number, or text with a unit."""

    kind: str

    def __get_pydantic_json_schema__(
        self, core: Any, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        number = dict(handler(core))
        # Pydantic leaves limits that stand outside the function that reads units as they are.
        for ours, theirs in _BOUNDS.items():
            if ours in number:
                number[theirs] = number.pop(ours)
        units = "|".join(UNITS[self.kind])
        if not units:
            return number
        low = number.get("minimum", number.get("exclusiveMinimum", -1))
        sign = "[+]?" if low >= 0 else "[+-]?"
        digits = r"([0-9][0-9_]*\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,3})?"
        text = {"type": "string", "pattern": rf"^\s*{sign}{digits}\s*({units})?\s*$"}
        return {"anyOf": [number, text], "x-unit": next(iter(UNITS[self.kind]))}


_BOUNDS = {"gt": "exclusiveMinimum", "ge": "minimum", "le": "maximum"}


def _row_ratio(value: object) -> object:
    """Take 0.866 for the equilateral lattice: circle packings need it to the last digit."""
    number = quantity(value, "number")
    return EQUILATERAL if abs(number - EQUILATERAL) < 5e-4 else number


def _pair(value: object) -> tuple[float, float]:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise DesignError("two numbers are needed; write [0.0, 1.0]")
    return quantity(value[0], "number"), quantity(value[1], "number")


def _range(value: object) -> object:
    """Take ``[from, to]`` or ``"closed"``; None leaves it to the catalog."""
    if value is None or value == "closed":
        return value
    if isinstance(value, str):
        raise DesignError('a range of parameters is needed; write [from, to] or "closed"')
    low, high = _pair(value)
    if not low < high:
        raise DesignError(f"the range is empty; write the smaller number first: [{high}, {low}]")
    return low, high


def _iso_date(value: object) -> object:
    """Take a TOML date, or an ISO string for it."""
    if isinstance(value, datetime.datetime):
        return value.date()
    if isinstance(value, str):
        try:
            return datetime.date.fromisoformat(value)
        except ValueError:
            raise DesignError("not a date; write it as 2026-05-01") from None
    return value


def _rims(value: object) -> object:
    """Take a file, a list of files, a list of points, or a list of lists of points."""
    if value is None or isinstance(value, str):
        return value if value is None else (value,)
    wanted = 'a file, several files, or points are needed; write rim = "rim.csv"'
    if not isinstance(value, list | tuple) or not value:
        raise DesignError(wanted)
    if all(isinstance(item, str) for item in value):
        return tuple(value)
    loops = value if _is_loop(value[0]) else [value]
    if not all(_is_loop(loop) for loop in loops):
        raise DesignError(f"{wanted}, or points [[x, y, z], …]")
    return tuple(
        tuple(tuple(quantity(number, "number") for number in point) for point in loop)
        for loop in loops
    )


def _is_loop(value: object) -> bool:
    return isinstance(value, list | tuple) and all(
        isinstance(point, list | tuple) and len(point) == 3 for point in value
    )


POINTS = {
    "type": "array",
    "items": {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3},
    "minItems": 1,
}
Length = Annotated[float, _of_kind("length"), _Written("length")]
Positive = Annotated[float, _of_kind("length"), Field(gt=0), _Written("length")]
Ratio = Annotated[float, _of_kind("number"), Field(ge=0), _Written("number")]
Degrees = Annotated[float, _of_kind("angle"), Field(ge=0), _Written("angle")]
Mass = Annotated[float, _of_kind("mass"), Field(ge=0), _Written("mass")]
Distance = Annotated[float, _of_kind("length"), Field(ge=0), _Written("length")]
Angle = Annotated[float, _of_kind("angle"), _Written("angle")]
Density = Annotated[float, _of_kind("density"), Field(gt=0), _Written("density")]
Seconds = Annotated[float, _of_kind("time"), Field(gt=0), _Written("time")]
Pair = Annotated[tuple[float, float], BeforeValidator(_pair)]
Range = Annotated[tuple[float, float] | Literal["closed"] | None, BeforeValidator(_range)]
Share = Annotated[float, _of_kind("number"), Field(ge=0, le=1), _Written("number")]
Point = tuple[float, float, float]
Rims = Annotated[
    tuple[str, ...] | tuple[tuple[Point, ...], ...] | None,
    BeforeValidator(_rims),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "string"},
                {"type": "array", "items": {"type": "string"}, "minItems": 1},
                POINTS,
                {"type": "array", "items": POINTS, "minItems": 1},
            ]
        }
    ),
]
LengthUnit = Literal["mm", "cm", "m", "um", "in", "ft"]
RowRatio = Annotated[float, BeforeValidator(_row_ratio), Field(gt=0.5), _Written("number")]
Date = Annotated[datetime.date | None, BeforeValidator(_iso_date)]

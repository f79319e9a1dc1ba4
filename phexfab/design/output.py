"""The table ``[output]``: which further files a build writes, and how large its scale model is."""

from __future__ import annotations

import re
from typing import Annotated, Literal, get_args

from pydantic import BeforeValidator, Field, WithJsonSchema

from phexfab.design.fields import Positive, Section, otherwise
from phexfab.design.units import quantity
from phexfab.errors import DesignError

FileFormat = Literal[
    "step", "step242", "glb", "ifc", "3mf", "stl", "obj", "ply", "dxf", "dxf12"
]  # the keys of phexfab.delivery.FORMATS


def _files(value: object) -> object:
    if isinstance(value, str):
        value = (value,)
    return tuple(dict.fromkeys(value)) if isinstance(value, list | tuple) else value


def _scale(value: object) -> object:
    """Take ``"1:20"`` or ``20``; None fits the model to the printer."""
    if value is None:
        return None
    ratio = re.fullmatch(r"\s*1\s*:\s*([0-9.]+)\s*", value) if isinstance(value, str) else None
    number = quantity(float(ratio[1]) if ratio else value, "number")
    if not number > 0:
        raise DesignError('a scale is needed; write "1:20"')
    return number


def _bed(value: object) -> tuple[float, ...]:
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise DesignError("three lengths are needed; write [220, 220, 250]")
    sizes = tuple(quantity(size, "length") for size in value)
    if not min(sizes) > 0:
        raise DesignError("a length is not above 0 mm; write [220, 220, 250]")
    return sizes


_LENGTH = {"anyOf": [{"type": "number", "exclusiveMinimum": 0}, {"type": "string"}]}
_NAME = {"type": "string", "enum": list(get_args(FileFormat))}
Files = Annotated[
    tuple[FileFormat, ...],
    BeforeValidator(_files),
    WithJsonSchema({"anyOf": [{"type": "array", "items": _NAME}, _NAME]}),
]
Scale = Annotated[
    float | None,
    BeforeValidator(_scale),
    WithJsonSchema(
        {
            "anyOf": [
                {"type": "number", "exclusiveMinimum": 0},
                {"type": "string", "pattern": r"^\s*1\s*:\s*[0-9.]+\s*$"},
            ]
        }
    ),
]
Bed = Annotated[
    tuple[float, float, float],
    BeforeValidator(_bed),
    WithJsonSchema({"type": "array", "items": _LENGTH, "minItems": 3, "maxItems": 3}),
]


class Output(Section):
    """What the files look like, and which a build writes besides those it always writes."""

    files: Files = Field(
        default=(),
        description="further files; parts.step and the cut sheets are always written",
        examples=['["glb", "ifc", "3mf"]', '"glb"'],
    )
    dxf_version: Literal["R2010", "R12"] = Field(
        default="R2010", description="of the cut sheets; R12 for old machines",
        examples=['"R2010"', '"R12"'],
    )  # fmt: skip
    scale: Scale = Field(
        default=None,
        description="of the model for 3D printers (3mf, stl)",
        examples=['"1:20"', "50"],
        json_schema_extra=otherwise("the largest usual scale that fits the printer"),
    )
    bed: Bed = Field(
        default=(220.0, 220.0, 250.0),
        description="what the printer can print: length, width, height",
        examples=["[220, 220, 250]"],
    )
    wall: Positive = Field(
        default=1.2, description="least thickness that the printer is asked for",
        examples=["1.2", '"0.8 mm"'],
    )  # fmt: skip

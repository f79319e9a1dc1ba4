"""The table [mesh]: how a surface that need not be minimal is covered with planar hexagons."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from phexfab.design.fields import Distance, Point, Ratio, Section
from phexfab.design.units import quantity
from phexfab.errors import DesignError

Method = Literal[
    "planarise", "dupin", "conjugate", "tangent", "duality", "support", "parallel", "power"
]


def _point(value: object) -> object:
    """Take ``[x, y, z]``; None leaves it to the method."""
    if value is None:
        return None
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise DesignError("three numbers are needed; write [0, 0, 1]")
    return tuple(quantity(number, "number") for number in value)


Place = Annotated[Point | None, BeforeValidator(_point)]


class Mesh(Section):
    """The way to planar hexagons on a free-form surface; without a method, a minimal surface."""

    method: Method | None = Field(
        default=None,
        description="how planar hexagons are found on surface.step or surface.mesh",
        examples=['"dupin"', '"planarise"'],
    )
    conjugation: Literal["pre-specified", "progressive"] = Field(
        default="pre-specified",
        description="with dupin or tangent: rows follow a smooth field, or what ideal triangles "
        "make of them",
        examples=['"pre-specified"', '"progressive"'],
    )
    toward: Place = Field(
        default=None,
        description="with dupin, tangent or conjugate: direction that rows take where the "
        "curvature leaves it open",
        examples=["[1, 0, 0]"],
    )
    crossing: Literal["refuse", "drop"] = Field(
        default="refuse",
        description="with dupin, tangent or conjugate: what becomes of faces that cross themselves",
        examples=['"refuse"', '"drop"'],
    )
    closeness: Ratio = Field(
        default=0.0,
        description="with dupin or conjugate: cost of a square distance from the surface over a "
        "square motion along it",
        examples=["1"],
    )
    border: Literal["keep", "drop"] = Field(
        default="keep",
        description="with planarise, dupin or conjugate: the outermost faces are panels, or are "
        "left out",
        examples=['"keep"', '"drop"'],
    )
    weld: Distance | None = Field(
        default=None,
        description="with planarise: vertices nearer than this become one",
        examples=["0.1"],
    )
    centre: Place = Field(
        default=None,
        description="with duality: its centre, on no tangent plane of the surface",
        examples=["[0, 0, -9000]"],
    )
    start: str | None = Field(
        default=None,
        description="with parallel: file of the planar hexagon mesh whose planes are moved",
        examples=['"hexagons.obj"'],
    )

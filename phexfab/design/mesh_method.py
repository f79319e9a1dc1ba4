"""The table [mesh]: how a surface that need not be minimal is covered with planar hexagons."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema

from phexfab.design.fields import POINTS, Distance, Point, Ratio, Section, otherwise
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


def _fixed(value: object) -> object:
    """Take ``"corners"``, ``"border"`` or points; vertices have no numbers that last."""
    if value is None or value in _NAMED:
        return value
    wanted = 'write "corners", "border" or points [[0, 0, 3000], …]'
    if isinstance(value, str):
        raise DesignError(f'"{value}" are no vertices; {wanted}')
    if not isinstance(value, list | tuple) or not value:
        raise DesignError(f"vertices or their places are needed; {wanted}")
    if all(isinstance(item, int | float) for item in value):
        raise DesignError(
            "vertices have places here, not numbers, which change as soon as a mesh is welded; "
            f"{wanted}"
        )
    if not all(isinstance(item, list | tuple) and len(item) == 3 for item in value):
        raise DesignError(f"a point has three coordinates; {wanted}")
    return tuple(tuple(quantity(number, "number") for number in point) for point in value)


_NAMED = ("corners", "border")
Place = Annotated[Point | None, BeforeValidator(_point)]
Fixed = Annotated[
    Literal["corners", "border"] | tuple[Point, ...] | None,
    BeforeValidator(_fixed),
    WithJsonSchema({"anyOf": [{"type": "string", "enum": list(_NAMED)}, POINTS]}),
]


class Mesh(Section):
    """The way to planar hexagons on a free-form surface; without a method, a minimal surface."""

    method: Method | None = Field(
        default=None,
        description="how planar hexagons are found on `surface.step` or `surface.mesh`",
        examples=['"dupin"', '"planarise"'],
    )
    conjugation: Literal["pre-specified", "progressive"] = Field(
        default="pre-specified",
        description="with `dupin`, `tangent`: `pre-specified`: rows of panels follow a smooth "
        "field of "
        "directions; `progressive`: each row is what ideal triangles on the row before make of it",
        examples=['"pre-specified"', '"progressive"'],
    )
    toward: Place = Field(
        default=None,
        description="with `dupin`, `tangent`, `conjugate`: the direction [x, y, z] that rows take "
        "where "
        "the curvature leaves it open",
        examples=["[1, 0, 0]"],
        json_schema_extra=otherwise("the surface's lines of u"),
    )
    crossing: Literal["refuse", "drop"] = Field(
        default="refuse",
        description="with `dupin`, `tangent`, `conjugate`: a face that crosses itself: `refuse` "
        "is an "
        "error that names it, `drop` leaves it out",
        examples=['"refuse"', '"drop"'],
    )
    closeness: Ratio | None = Field(
        default=None,
        description="with `dupin`, `conjugate`: what a square distance from the surface costs, "
        "over a square motion along it; with `planarise` and `reference` likewise from that",
        examples=["1"],
        json_schema_extra=otherwise("0; with `reference` 100"),
    )
    reference: str | None = Field(
        default=None,
        description="with `planarise`: the file of a surface that panels keep close to: STEP or "
        "BREP, all its faces, or a mesh (OBJ, OFF, PLY, STL or COMPAS JSON) in the unit of "
        "`surface.mesh`",
        examples=['"roof.step"'],
    )
    fixed: Fixed = Field(
        default=None,
        description="with `planarise`: vertices that keep their place: the border's `corners`, all "
        "of the `border`, or those at points [[x, y, z], …] in the unit of `surface.mesh`, within "
        "2 % of an edge",
        examples=['"corners"', "[[0, 0, 3000], [6000, 0, 2400]]"],
    )
    border: Literal["keep", "drop"] = Field(
        default="keep",
        description="with `planarise`, `dupin`, `conjugate`: `keep`: the outermost faces are "
        "panels, and "
        "the few border edges that one plane cuts are brought into it; `drop`: they are left out",
        examples=['"keep"', '"drop"'],
    )
    weld: Distance | None = Field(
        default=None,
        description="with `planarise`: vertices nearer than this become one",
        examples=["0.1"],
        json_schema_extra=otherwise("1e-5 of an edge"),
    )
    centre: Place = Field(
        default=None,
        description="with `duality`: its centre [x, y, z], which lies on no tangent plane",
        examples=["[0, 0, -9000]"],
        json_schema_extra=otherwise("the least distorting"),
    )
    start: str | None = Field(
        default=None,
        description="with `parallel`: the file of the planar hexagon mesh whose planes are moved",
        examples=['"hexagons.obj"'],
    )

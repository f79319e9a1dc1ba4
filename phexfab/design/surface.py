"""The tables [surface] and [border]: the smooth film, its piece that is built, and its cut rim."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, field_validator

from phexfab.design.fields import (
    Angle,
    Distance,
    LengthUnit,
    Pair,
    Positive,
    Range,
    Ratio,
    Rims,
    Section,
    Share,
    otherwise,
)


class Surface(Section):
    """The smooth surface and the piece of it that is built."""

    name: str | None = Field(
        default=None,
        description="a surface of the catalog; `phexfab surfaces` lists them with their options",
        examples=['"catenoid"', '"enneper"'],
    )
    order: int | None = Field(
        default=None,
        ge=1,
        description="order, where a surface comes in orders (`enneper`, `bour`, `richmond`)",
        examples=["2"],
        json_schema_extra=otherwise("the surface's"),
    )
    ends: int | None = Field(
        default=None,
        ge=3,
        description="number of ends of `jorge-meeks`",
        examples=["5"],
        json_schema_extra=otherwise("4"),
    )
    bonnet_angle: Angle | None = Field(
        default=None,
        description="turns the surface into an associate one; 90° is the conjugate surface",
        examples=["90", '"0.5 rad"'],
        json_schema_extra=otherwise("0"),
    )
    g: str | None = Field(
        default=None,
        description="instead of `name`, a surface of one's own: its Gauss map as a formula in z",
        examples=['"z"', '"z**2"'],
    )
    height_differential: str | None = Field(
        default=None,
        description="with `g`: dh/dz; the height of the surface is Re ∫ dh",
        examples=['"z"', '"1/z"'],
    )
    base: Pair = Field(
        default=(0.0, 0.0),
        description="with `g`: the point z, as [re, im], where the coordinates u and v are 0; not "
        "an "
        "umbilic",
        examples=["[1, 0]"],
    )
    scale: Positive = Field(
        1000.0, description="length of one unit of the surface", examples=["2200", '"2.2 m"']
    )
    rim: Rims = Field(
        default=None,
        description="a soap film: its rim as a file (CSV, DXF, STEP, BREP), several files, a list "
        "of points [[x, y, z], …] or a list of such lists; paths start at the design file",
        examples=['"rim.csv"', '["outer.dxf", "inner.dxf"]', "[[0, 0, 0], [6000, 0, 900], …]"],
    )
    unit: LengthUnit | None = Field(
        default=None,
        description="with `rim` or `mesh`: unit of their lengths",
        examples=['"m"'],
        json_schema_extra=otherwise("what the file says, or mm"),
    )
    layer: str | None = Field(
        default=None, description="with `rim`: the DXF layer it is drawn on", examples=['"RIM"']
    )
    corner_angle: Angle | None = Field(
        default=None,
        description="with `rim`: the turn beyond which it has a corner",
        examples=["20"],
        json_schema_extra=otherwise("20"),
    )
    smooth_corners: Distance | None = Field(
        default=None,
        description="with `rim`: radius by which its corners are rounded; sharp when left out",
        examples=["300"],
    )
    smooth_inward: Distance | None = Field(
        default=None,
        description="with `rim`: radius by which corners that turn inwards are rounded, beyond "
        "which a film cannot go on; others stay sharp",
        examples=['"1.5 m"'],
    )
    free: tuple[int, ...] = Field(
        default=(),
        strict=False,
        description="with `rim`: numbers of sides (0 begins at the first corner) that slide in the "
        "plane in which they are drawn; the film meets that plane at a right angle",
        examples=["[1, 3]"],
        json_schema_extra=otherwise("none"),
    )
    mesh: str | None = Field(
        default=None,
        description="a soap film as a triangle mesh: OBJ, OFF, PLY or STL; its border is the rim. "
        "With `mesh.method` a free-form surface given as triangles; with `planarise` a polygon "
        "mesh: "
        "OBJ, OFF, PLY or COMPAS JSON",
        examples=['"film.obj"'],
    )
    step: str | None = Field(
        default=None,
        description="a free-form surface: the STEP or BREP file of a face; needs `mesh.method`",
        examples=['"roof.step"'],
    )
    face: int | None = Field(
        default=None,
        ge=1,
        description="with `step`: the number of the face, from 1, where the file has several",
        examples=["2"],
    )
    periodic: str | None = Field(
        default=None,
        description="a triply periodic surface; `scale` is the edge of its cubic cell",
        examples=['"schwarz-p"', '"gyroid"'],
    )
    cells: tuple[int, int, int] = Field(
        default=(1, 1, 1),
        strict=False,
        description="with `periodic`: how many cells along x, y and z",
        examples=["[2, 2, 1]"],
    )
    radius: Ratio | None = Field(
        default=None,
        description="instead of `u` and `v`: the round piece of the surface with |z − centre| ≤ "
        "radius, umbilics and all",
        examples=["0.9"],
    )
    centre: Pair = Field(
        default=(0.0, 0.0),
        description="with `radius`: the middle of that piece, as [re, im]",
        examples=["[0, 0]"],
    )
    u: Range = Field(
        default=None,
        description='`[from, to]` in curvature-line coordinates, or `"closed"`',
        examples=["[-0.8, 0.8]", '"closed"'],
        json_schema_extra=otherwise("the catalog's"),
    )
    v: Range = Field(
        default=None,
        description="likewise, across",
        examples=["[-1.0, 1.0]", '"closed"'],
        json_schema_extra=otherwise("the catalog's"),
    )

    @field_validator("free", "cells", mode="before")
    @classmethod
    def _whole_numbers(cls, value: object) -> object:
        return tuple(value) if isinstance(value, list) else value

    @property
    def source(self) -> str:
        """What it comes from: ``rim``, ``mesh``, ``periodic``, ``step`` or ``named``."""
        for way in ("rim", "mesh", "periodic", "step"):
            if getattr(self, way) is not None:
                return way
        return "named"


class Border(Section):
    """How the shell ends at a rim: panels are cut there in their own plane, or left whole."""

    panels: Literal["cut", "whole"] = Field(
        default="cut",
        description="`cut`: the rim cuts panels; `whole`: the shell ends in whole panels, those "
        "whose middle lies within the rim",
        examples=['"cut"', '"whole"'],
    )
    direction: Literal["normal", "plumb"] = Field(
        default="normal",
        description="`normal`: cuts follow the shell's normals as nearly as straight beams allow; "
        "`plumb`: they stand vertical",
        examples=['"normal"', '"plumb"'],
    )
    sagitta: Positive | None = Field(
        default=None,
        description="most by which a straight cut may leave the rim; larger means fewer, longer "
        "cuts",
        examples=["10"],
        json_schema_extra=otherwise("0.04 of a panel"),
    )
    sliver: Share = Field(
        default=0.05,
        description="cut panels below this share of a median panel go to a neighbour, or are left "
        "out",
        examples=["0.05"],
    )
    sliver_width: Distance | None = Field(
        default=None,
        description="likewise when they reach less far in from the rim",
        examples=["30"],
        json_schema_extra=otherwise("0.08 of a panel"),
    )

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
)


class Surface(Section):
    """The smooth surface and the piece of it that is built."""

    name: str | None = Field(
        default=None, description="a surface of the catalog", examples=['"catenoid"', '"enneper"']
    )
    order: int | None = Field(
        default=None, ge=1, description="order of a surface that comes in orders", examples=["2"]
    )
    ends: int | None = Field(
        default=None, ge=3, description="number of a k-noid's ends", examples=["5"]
    )
    bonnet_angle: Angle | None = Field(
        default=None, description="member of the associate family", examples=["90", '"0.5 rad"']
    )
    g: str | None = Field(
        default=None,
        description="a surface of one's own: the Gauss map g(z)",
        examples=['"z"', '"z**2"'],
    )
    height_differential: str | None = Field(
        default=None,
        description="with g: dh/dz, the height differential",
        examples=['"z"', '"1/z"'],
    )
    base: Pair = Field(
        default=(0.0, 0.0),
        description="with g: the point z where w = 0, [re, im]",
        examples=["[1, 0]"],
    )
    scale: Positive = Field(
        1000.0, description="length of one unit of the surface", examples=["2200", '"2.2 m"']
    )
    rim: Rims = Field(
        default=None,
        description="a soap film: the file of its rim, or several, or the rim's points",
        examples=['"rim.csv"', '["outer.dxf", "inner.dxf"]', "[[0, 0, 0], [6000, 0, 900], …]"],
    )
    unit: LengthUnit | None = Field(
        default=None,
        description="with rim or mesh: unit of their lengths; what the file says, or mm",
        examples=['"m"'],
    )
    layer: str | None = Field(
        default=None, description="with rim: the DXF layer it is on", examples=['"RIM"']
    )
    corner_angle: Angle | None = Field(
        default=None,
        description="with rim: it has a corner where it turns by more than this",
        examples=["20"],
    )
    smooth_corners: Distance | None = Field(
        default=None, description="with rim: radius by which corners are rounded", examples=["300"]
    )
    free: tuple[int, ...] = Field(
        default=(),
        strict=False,
        description="with rim: numbers of its sides, from 0 at the first corner, that slide in "
        "the plane in which they are drawn; the film meets it at a right angle",
        examples=["[1, 3]"],
    )
    mesh: str | None = Field(
        default=None,
        description="a soap film given as a triangle mesh: OBJ, OFF, PLY or STL; with mesh.method "
        "a free-form surface given so, or polygons to be made planar",
        examples=['"film.obj"'],
    )
    step: str | None = Field(
        default=None,
        description="a free-form surface: the STEP or BREP file of its face; see mesh.method",
        examples=['"roof.step"'],
    )
    face: int | None = Field(
        default=None,
        ge=1,
        description="with step: number of the face, from 1, where the file has several",
        examples=["2"],
    )
    periodic: str | None = Field(
        default=None,
        description="a triply periodic surface; scale is the edge of its cubic cell",
        examples=['"schwarz-p"', '"gyroid"'],
    )
    cells: tuple[int, int, int] = Field(
        default=(1, 1, 1),
        strict=False,
        description="with periodic: number of cells along x, y and z",
        examples=["[2, 2, 1]"],
    )
    radius: Ratio | None = Field(
        default=None,
        description="instead of u and v: the piece |z − centre| ≤ radius, umbilics and all",
        examples=["0.9"],
    )
    centre: Pair = Field(
        default=(0.0, 0.0), description="with radius: [re, im]", examples=["[0, 0]"]
    )
    u: Range = Field(
        default=None,
        description="curvature-line coordinates from, to; the catalog's when left out",
        examples=["[-0.8, 0.8]", '"closed"'],
    )
    v: Range = Field(
        default=None, description="likewise, across", examples=["[-1.0, 1.0]", '"closed"']
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
    """How the shell ends at a rim: panels are cut there in their own plane."""

    direction: Literal["normal", "plumb"] = Field(
        default="normal",
        description="cuts follow the shell's normals, or stand plumb",
        examples=['"normal"', '"plumb"'],
    )
    sagitta: Positive | None = Field(
        default=None,
        description="most by which a straight cut may leave the rim; fewer, longer cuts if larger",
        examples=["10"],
    )
    sliver: Share = Field(
        default=0.05,
        description="cut panels below this share of a median panel go to a neighbour or are left "
        "out",
        examples=["0.05"],
    )
    sliver_width: Distance | None = Field(
        default=None,
        description="likewise when they reach less far in than this",
        examples=["30"],
    )

"""The design file as a value: one frozen model per table, one field per key.

Every field says in ``description`` what it means and in ``examples`` what one may write; the
messages about wrong files and the tests of the manual are made from that. Rules that hold between
keys are in ``rules``.
"""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from pathlib import PurePath
from typing import Any, Literal

from pydantic import (
    Field,
    PrivateAttr,
    ValidationInfo,
    field_validator,
    model_validator,
)

from phexfab.design.checks import Checks
from phexfab.design.fields import (
    Angle,
    Date,
    Density,
    Distance,
    Length,
    Positive,
    RowRatio,
    Seconds,
    Section,
    Share,
    otherwise,
)
from phexfab.design.materials import MATERIALS, known_density
from phexfab.design.mesh_method import Mesh
from phexfab.design.mesh_rules import with_methods
from phexfab.design.output import Output
from phexfab.design.rules import RuleBreach, broken_rules
from phexfab.design.surface import Border, Surface
from phexfab.design.units import quantity
from phexfab.errors import DesignError
from phexfab.triangular import EQUILATERAL


class _Made(Section):
    """What parts made of a material have in common: a density that may be left out."""

    @field_validator("density", mode="before", check_fields=False)
    @classmethod
    def _density_of_known_material(cls, value: object, info: ValidationInfo) -> object:
        if value is not None:
            return quantity(value, "density")
        name = info.data.get("material")
        if name is None:  # the material itself is wrong and reported on its own
            return 1.0
        density = known_density(name)
        if density is None:
            near = difflib.get_close_matches(name.lower(), [m.lower() for m in MATERIALS], 1, 0.7)
            hint = f'did you mean material = "{near[0]}"? ' if near else ""
            raise DesignError(
                f'the density of "{name}" is not known; {hint}add density = … in kg/m3, or take '
                f"one of {', '.join(MATERIALS)}"
            )
        return density


class Project(Section):
    """Whose drawing it is; written into the headers of STEP and DXF and on the sheets."""

    author: str = Field(default="", description="who made the design", examples=['"A. Architect"'])
    organisation: str = Field(default="", description="office or firm", examples=['"Office"'])
    revision: str = Field(default="", description="revision of the design", examples=['"B"'])
    date: Date = Field(
        default=None,
        description="date of the design; the files carry it, never the day of the build, so that "
        "the same design gives the same bytes",
        examples=["2026-05-01"],
    )


class Lattice(Section):
    """How the surface is divided into hexagons."""

    panel_size: Positive = Field(
        description="distance between neighbouring panels' centres: the median over the surface, "
        "panels are smaller where it bends more",
        examples=["600", '"0.6 m"'],
    )
    rows_along: Literal["u", "v"] = Field(
        default="v",
        description="coordinate that the rows of panels follow",
        examples=['"u"', '"v"'],
    )
    row_ratio: RowRatio = Field(
        default=EQUILATERAL,
        description="distance of rows / distance of panels in a row; 0.866 is equilateral",
        examples=["0.866", "1.1"],
    )
    turn: Angle = Field(
        default=0.0,
        description="angle by which rows are turned off the principal direction; not on films",
        examples=["4"],
    )
    evenness: Share = Field(
        default=0.0,
        description="0 keeps the size that the curvature gives, 1 makes panels as even as they "
        "can be without losing validity; without effect on films of several rims, of meshes and "
        "on periodic ones, which say so in the report",
        examples=["0", "0.8"],
    )


class Offset(Section):
    """Which distance between the two layers of the shell is constant."""

    type: Literal["face", "edge", "vertex"] = Field(
        default="edge",
        description="`face`: distance of face planes (double skins); `edge`: distance of edges "
        "(beams of one height meet evenly); `vertex`: distance of vertices (connectors of one "
        "length); with `mesh.method` it is `face` by itself",
        examples=['"face"', '"edge"', '"vertex"'],
    )
    distance: Length | None = Field(
        default=None,
        description="offset that must be free of flipped edges, positive along the normals",
        json_schema_extra=otherwise("the structural depth"),
        examples=["-98", '"-9.8 cm"'],
    )


class Panels(_Made):
    """The panels: one per hexagon."""

    material: str = Field(default="HPL", description="name for the parts list", examples=['"HPL"'])
    density: Density = Field(
        default=None,
        validate_default=True,
        description="may be left out for the materials that are known",
        examples=["1350"],
        json_schema_extra=otherwise("the material's"),
    )
    thickness: Positive = Field(default=8.0, description="of the sheet", examples=["8", '"8 mm"'])
    gap: Distance = Field(
        default=10.0,
        description="joint between two panels; half a `panel_size` leaves nothing of a median "
        "panel",
        examples=["10"],
    )
    side: Literal["outside", "inside", "centre"] = Field(
        default="outside",
        description="where the thickness lies: `outside` is where the face normals point, `inside` "
        "the other side, `centre` half and half",
        examples=['"outside"', '"inside"'],
    )
    edges: Literal["square", "mitred"] = Field(
        default="square",
        description="`square` for laser and waterjet; `mitred` along the planes through the node "
        "axes",
        examples=['"square"', '"mitred"'],
    )


class Beams(_Made):
    """The flat bars that stand on the edges of the shell."""

    kind: Literal["flat", "none"] = Field(
        default="flat",
        description="flat bars on every edge, or `none`",
        examples=['"flat"', '"none"'],
    )
    material: str = Field(
        default="steel S355", description="name for the parts list", examples=['"steel S355"']
    )
    density: Density = Field(
        default=None,
        validate_default=True,
        description="may be left out for the materials that are known",
        examples=["7850"],
        json_schema_extra=otherwise("the material's"),
    )
    width: Positive = Field(default=10.0, description="thickness of the bar", examples=["10"])
    height: Positive = Field(
        default=90.0, description="height of the bar, standing", examples=["90"]
    )
    seat: Distance = Field(
        default=0.0,
        description="least height kept free between beams and panels, for a gasket or cleat",
        examples=["3"],
    )
    ends: Literal["mitred", "hub"] = Field(
        default="mitred",
        description="`mitred`: three bars meet in the node axis; `hub`: cut back from a hub",
        examples=['"mitred"', '"hub"'],
    )


class Nodes(_Made):
    """The hubs on the node axes."""

    kind: Literal["none", "hub"] = Field(
        default="none",
        description='`hub` puts a round hub on every node axis; beams then need `ends = "hub"`',
        examples=['"none"', '"hub"'],
    )
    material: str = Field(
        default="steel S355", description="name for the parts list", examples=['"steel S355"']
    )
    density: Density = Field(
        default=None,
        validate_default=True,
        description="may be left out for the materials that are known",
        examples=["7850"],
        json_schema_extra=otherwise("the material's"),
    )
    radius: Positive = Field(default=30.0, description="of the hub", examples=["30"])
    clearance: Distance = Field(
        default=2.0, description="between the hub and the end of a beam", examples=["2"]
    )


class StockSheet(Section):
    """A stock sheet."""

    length: Positive = Field(default=3000.0, description="of the sheet", examples=["3000", '"3 m"'])
    width: Positive = Field(default=1500.0, description="of the sheet", examples=["1500"])
    margin: Distance = Field(
        default=10.0, description="kept free along the border", examples=["10"]
    )
    spacing: Distance = Field(
        default=8.0, description="between parts, kerf included", examples=["8"]
    )


class Sheets(Section):
    """The stock that panels and beams are cut from."""

    panels: StockSheet = Field(
        default_factory=StockSheet, description="The stock that panels are cut from."
    )
    beams: StockSheet = Field(
        default_factory=StockSheet, description="The stock that beams are cut from."
    )


class Nesting(Section):
    """How parts are laid out on the sheets."""

    packer: Literal["spyrrow", "shelf"] = Field(
        default="spyrrow",
        description="`spyrrow` saves material; `shelf` takes a moment (`phexfab build --quick`)",
        examples=['"spyrrow"', '"shelf"'],
    )
    seconds: Seconds = Field(
        default=20.0, description="most time for each material", examples=["60"]
    )
    seed: int = Field(default=0, ge=0, description="of the packer's random numbers", examples=["1"])


class Design(Section):
    """A whole design file.

    Hashable and comparable; ``model_dump()`` gives plain values and ``model_validate`` takes them
    back. ``source`` and ``text`` tell where it was read from and what stood there.

    Examples
    --------
    >>> import phexfab as px
    >>> keys = {"surface": {"name": "catenoid"}, "lattice": {"panel_size": "45 cm"}}
    >>> design = px.make_design(keys)
    >>> design.lattice.panel_size, design.panels.thickness, design.offset.type
    (450.0, 8.0, 'edge')
    >>> design == px.make_design(keys)
    True
    """

    title: str = Field(
        default="",
        description="title of the project",
        examples=['"Catenoid pavilion"'],
        json_schema_extra=otherwise("the file's name"),
    )
    project: Project = Field(default_factory=Project)
    surface: Surface
    mesh: Mesh = Field(default_factory=Mesh)
    border: Border = Field(default_factory=Border)
    lattice: Lattice
    offset: Offset = Field(default_factory=Offset)
    panels: Panels = Field(default_factory=Panels)
    beams: Beams = Field(default_factory=Beams)
    nodes: Nodes = Field(default_factory=Nodes)
    sheets: Sheets = Field(default_factory=Sheets)
    nesting: Nesting = Field(default_factory=Nesting)
    checks: Checks = Field(default_factory=Checks)
    output: Output = Field(default_factory=Output)

    _source: str = PrivateAttr("")
    _text: str = PrivateAttr("")

    @model_validator(mode="before")
    @classmethod
    def _defaults_of_methods(cls, data: Any) -> Any:
        return with_methods(data) if isinstance(data, Mapping) else data

    @model_validator(mode="after")
    def _rules(self) -> Design:
        problems = broken_rules(self.sections())
        if problems:
            raise RuleBreach(problems)
        return self

    def __eq__(self, other: object) -> bool:
        """Designs are equal when they ask for the same, wherever they were read from."""
        return isinstance(other, Design) and dict(self.sections()) == dict(other.sections())

    def __hash__(self) -> int:
        return hash(tuple(self.sections().values()))

    def sections(self) -> Mapping[str, Any]:
        """Return the tables by name."""
        return {name: getattr(self, name) for name in type(self).model_fields}

    @property
    def source(self) -> str:
        """The file it was read from, or ""."""
        return self._source

    @property
    def text(self) -> str:
        """The text of the design file, or ""."""
        return self._text

    @property
    def name(self) -> str:
        """The title, or else the file's name without its ending."""
        return self.title or PurePath(self._source).stem or "shell"

    def read_from(self, source: str, text: str) -> Design:
        """Return the same design with a note of where it came from."""
        copy = self.model_copy()
        copy._source, copy._text = source, text
        return copy

"""The design file: what a user may ask for, validated. One frozen value, ``Design``."""

from phexfab.design.checks import Checks
from phexfab.design.load import load_design, make_design, parse_design
from phexfab.design.materials import MATERIALS
from phexfab.design.mesh_method import Mesh
from phexfab.design.model import (
    Beams,
    Design,
    Lattice,
    Nesting,
    Nodes,
    Offset,
    Panels,
    Project,
    Sheets,
    StockSheet,
    Surface,
)
from phexfab.design.output import Output
from phexfab.design.units import quantity

__all__ = [
    "MATERIALS",
    "Beams",
    "Checks",
    "Design",
    "Lattice",
    "Mesh",
    "Nesting",
    "Nodes",
    "Offset",
    "Output",
    "Panels",
    "Project",
    "Sheets",
    "StockSheet",
    "Surface",
    "load_design",
    "make_design",
    "parse_design",
    "quantity",
]

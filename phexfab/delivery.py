"""The folder that a build leaves: every file of it, whole or not at all."""

from __future__ import annotations

import json
import shutil
import tempfile
from collections.abc import Callable
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

from phexfab.cad.brep import verify_solids
from phexfab.cad.step import StepHeader, write_step
from phexfab.errors import DesignError, PartError
from phexfab.fabrication.bom import bom_rows, write_bom
from phexfab.fabrication.parts import FlatPart, Sheet
from phexfab.mesh.io import write_obj

if TYPE_CHECKING:
    from phexfab.pipeline import Build

Progress = Callable[[str, int, int], None]
LAYOUT = "layout.json"
LIBRARIES = (
    "phexfab", "numpy", "scipy", "shapely", "manifold3d", "ezdxf", "spyrrow", "cadquery",
    "cadquery-ocp", "build123d",
)  # fmt: skip

"""phexfab: from a named minimal surface to a shell that a workshop can build.

``build`` walks from a design file to parts and checks; everything on the way is a plain value and
can be had on its own: ``minimal_surface`` → ``lattice_on`` → ``minimal_shell`` → ``offset`` →
``panels``, ``beams``, ``nodes``. No CAD kernel is loaded until an adapter is called.
"""

from phexfab.design import Design, load_design, make_design, parse_design
from phexfab.errors import (
    DesignError,
    LatticeError,
    MeshError,
    MissingLibraryError,
    NestingError,
    OffsetLimitError,
    PartError,
    PhexError,
    SolveError,
    SurfaceError,
)
from phexfab.fabrication.bars import BeamSpec
from phexfab.fabrication.beams import beams
from phexfab.fabrication.checks import Limits, check_geometry, check_parts
from phexfab.fabrication.nodes import NodeSpec, nodes
from phexfab.fabrication.panels import PanelSpec, panels
from phexfab.fabrication.parts import CheckResult, FlatPart, Material, Parts, Solid, Stock
from phexfab.mesh import PolyMesh, read_mesh, write_mesh
from phexfab.minimal.gauss_image import gauss_image
from phexfab.minimal.laplacian import solve_minimal
from phexfab.minimal.shell import lattice_on, minimal_shell, surface_distance
from phexfab.parallel.offset import admissible_interval, node_axes, offset
from phexfab.parallel.shell import Shell
from phexfab.pipeline import Build, build, check
from phexfab.remesh.lattice import Lattice, lattice
from phexfab.surface import (
    MinimalSurface,
    associate,
    catalog,
    from_height_differential,
    from_weierstrass,
    minimal_surface,
)

__version__ = "0.1.0"

__all__ = [
    "BeamSpec",
    "Build",
    "CheckResult",
    "Design",
    "DesignError",
    "FlatPart",
    "Lattice",
    "LatticeError",
    "Limits",
    "Material",
    "MeshError",
    "MinimalSurface",
    "MissingLibraryError",
    "NestingError",
    "NodeSpec",
    "OffsetLimitError",
    "PanelSpec",
    "PartError",
    "Parts",
    "PhexError",
    "PolyMesh",
    "Shell",
    "Solid",
    "SolveError",
    "Stock",
    "SurfaceError",
    "admissible_interval",
    "associate",
    "beams",
    "build",
    "catalog",
    "check",
    "check_geometry",
    "check_parts",
    "from_height_differential",
    "from_weierstrass",
    "gauss_image",
    "lattice",
    "lattice_on",
    "load_design",
    "make_design",
    "minimal_shell",
    "minimal_surface",
    "node_axes",
    "nodes",
    "offset",
    "panels",
    "parse_design",
    "read_mesh",
    "solve_minimal",
    "surface_distance",
    "write_mesh",
]

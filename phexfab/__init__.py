"""phexfab: from a boundary curve or a named minimal surface to a shell that a workshop can build.

``build`` walks from a design file to parts and checks; everything on the way is a plain value and
can be had on its own: ``minimal_surface`` → ``lattice_on`` → ``minimal_shell`` → ``offset`` →
``panels``, ``beams``, ``nodes``; from a boundary curve ``Rim`` → ``plateau`` → ``grow_lattice`` →
``minimal_shell`` → ``cut_shell``. No CAD kernel is loaded until an adapter is called.
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
from phexfab.minimal.christoffel import is_discrete_minimal, split_dual
from phexfab.minimal.dual_space import DualSpace
from phexfab.minimal.gauss_image import gauss_image
from phexfab.minimal.laplacian import solve_minimal
from phexfab.minimal.shell import lattice_on, minimal_shell, surface_distance
from phexfab.parallel.border import Border
from phexfab.parallel.classify import classify_mesh
from phexfab.parallel.curvature import pair_curvatures
from phexfab.parallel.cut import cut_shell
from phexfab.parallel.edge_offset import edge_offset_mesh
from phexfab.parallel.face_offset import face_offset
from phexfab.parallel.nearest import admissible_member, deform, nearest_member
from phexfab.parallel.offset import admissible_interval, node_axes, offset
from phexfab.parallel.pairs import (
    blend,
    classify_pair,
    gauss_from_pair,
    is_parallel,
    offset_pair,
    pair_interval,
)
from phexfab.parallel.shell import Shell
from phexfab.parallel.simple import shell_of_mesh
from phexfab.parallel.space import parallel_space
from phexfab.parallel.support import beam_heights, node_torsion, support_structure
from phexfab.parallel.to_offset import nearest_offset_mesh
from phexfab.parallel.vertex_offset import inscribed_parallel
from phexfab.pipeline import Build, build, check
from phexfab.remesh.lattice import Lattice, lattice
from phexfab.remesh.mesh_lattices.trace import mesh_lattice
from phexfab.remesh.seamless.grow import grow_lattice
from phexfab.surface import (
    MinimalSurface,
    associate,
    catalog,
    from_height_differential,
    from_weierstrass,
    minimal_surface,
)
from phexfab.surface.disc_films.extension import film_with_margin
from phexfab.surface.disc_films.plateau import plateau
from phexfab.surface.domain import Disc
from phexfab.surface.mesh_films.atlas import atlas_surface
from phexfab.surface.mesh_films.mesh_film import film_of_mesh, mesh_film
from phexfab.surface.periodic.mesh import periodic_film
from phexfab.surface.rims.rim import Rim
from phexfab.surface.umbilics import umbilics

__version__ = "0.1.0"

__all__ = [
    "BeamSpec",
    "Border",
    "Build",
    "CheckResult",
    "Design",
    "DesignError",
    "Disc",
    "DualSpace",
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
    "Rim",
    "Shell",
    "Solid",
    "SolveError",
    "Stock",
    "SurfaceError",
    "admissible_interval",
    "admissible_member",
    "associate",
    "atlas_surface",
    "beam_heights",
    "beams",
    "blend",
    "build",
    "catalog",
    "check",
    "check_geometry",
    "check_parts",
    "classify_mesh",
    "classify_pair",
    "cut_shell",
    "deform",
    "edge_offset_mesh",
    "face_offset",
    "film_of_mesh",
    "film_with_margin",
    "from_height_differential",
    "from_weierstrass",
    "gauss_from_pair",
    "gauss_image",
    "grow_lattice",
    "inscribed_parallel",
    "is_discrete_minimal",
    "is_parallel",
    "lattice",
    "lattice_on",
    "load_design",
    "make_design",
    "mesh_film",
    "mesh_lattice",
    "minimal_shell",
    "minimal_surface",
    "nearest_member",
    "nearest_offset_mesh",
    "node_axes",
    "node_torsion",
    "nodes",
    "offset",
    "offset_pair",
    "pair_curvatures",
    "pair_interval",
    "panels",
    "parallel_space",
    "parse_design",
    "periodic_film",
    "plateau",
    "read_mesh",
    "shell_of_mesh",
    "solve_minimal",
    "split_dual",
    "support_structure",
    "surface_distance",
    "umbilics",
    "write_mesh",
]

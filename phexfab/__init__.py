"""phexfab: from a boundary curve or a named minimal surface to a shell that a workshop can build.

``build`` walks from a design file to parts and checks; everything on the way is a plain value and
can be had on its own: ``minimal_surface`` → ``lattice_on`` → ``minimal_shell`` → ``offset`` →
``panels``, ``beams``, ``nodes``; from a boundary curve ``Rim`` → ``plateau`` → ``grow_lattice`` →
``minimal_shell`` → ``cut_shell``. No CAD kernel is loaded until an adapter is called.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
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

# Where each public name lives: it is imported when it is first asked for (PEP 562), so that
# `import phexfab` costs next to nothing. The imports above are what type checkers and editors read.
_PLACES = {
    "BeamSpec": "fabrication.bars",
    "Border": "parallel.border",
    "Build": "pipeline",
    "CheckResult": "fabrication.parts",
    "Design": "design",
    "DesignError": "errors",
    "Disc": "surface.domain",
    "DualSpace": "minimal.dual_space",
    "FlatPart": "fabrication.parts",
    "Lattice": "remesh.lattice",
    "LatticeError": "errors",
    "Limits": "fabrication.checks",
    "Material": "fabrication.parts",
    "MeshError": "errors",
    "MinimalSurface": "surface",
    "MissingLibraryError": "errors",
    "NestingError": "errors",
    "NodeSpec": "fabrication.nodes",
    "OffsetLimitError": "errors",
    "PanelSpec": "fabrication.panels",
    "PartError": "errors",
    "Parts": "fabrication.parts",
    "PhexError": "errors",
    "PolyMesh": "mesh",
    "Rim": "surface.rims.rim",
    "Shell": "parallel.shell",
    "Solid": "fabrication.parts",
    "SolveError": "errors",
    "Stock": "fabrication.parts",
    "SurfaceError": "errors",
    "admissible_interval": "parallel.offset",
    "admissible_member": "parallel.nearest",
    "associate": "surface",
    "atlas_surface": "surface.mesh_films.atlas",
    "beam_heights": "parallel.support",
    "beams": "fabrication.beams",
    "blend": "parallel.pairs",
    "build": "pipeline",
    "catalog": "surface",
    "check": "pipeline",
    "check_geometry": "fabrication.checks",
    "check_parts": "fabrication.checks",
    "classify_mesh": "parallel.classify",
    "classify_pair": "parallel.pairs",
    "cut_shell": "parallel.cut",
    "deform": "parallel.nearest",
    "edge_offset_mesh": "parallel.edge_offset",
    "face_offset": "parallel.face_offset",
    "film_of_mesh": "surface.mesh_films.mesh_film",
    "film_with_margin": "surface.disc_films.extension",
    "from_height_differential": "surface",
    "from_weierstrass": "surface",
    "gauss_from_pair": "parallel.pairs",
    "gauss_image": "minimal.gauss_image",
    "grow_lattice": "remesh.seamless.grow",
    "inscribed_parallel": "parallel.vertex_offset",
    "is_discrete_minimal": "minimal.christoffel",
    "is_parallel": "parallel.pairs",
    "lattice": "remesh.lattice",
    "lattice_on": "minimal.shell",
    "load_design": "design",
    "make_design": "design",
    "mesh_film": "surface.mesh_films.mesh_film",
    "mesh_lattice": "remesh.mesh_lattices.trace",
    "minimal_shell": "minimal.shell",
    "minimal_surface": "surface",
    "nearest_member": "parallel.nearest",
    "nearest_offset_mesh": "parallel.to_offset",
    "node_axes": "parallel.offset",
    "node_torsion": "parallel.support",
    "nodes": "fabrication.nodes",
    "offset": "parallel.offset",
    "offset_pair": "parallel.pairs",
    "pair_curvatures": "parallel.curvature",
    "pair_interval": "parallel.pairs",
    "panels": "fabrication.panels",
    "parallel_space": "parallel.space",
    "parse_design": "design",
    "periodic_film": "surface.periodic.mesh",
    "plateau": "surface.disc_films.plateau",
    "read_mesh": "mesh",
    "shell_of_mesh": "parallel.simple",
    "solve_minimal": "minimal.laplacian",
    "split_dual": "minimal.christoffel",
    "support_structure": "parallel.support",
    "surface_distance": "minimal.shell",
    "umbilics": "surface.umbilics",
    "write_mesh": "mesh",
}

_ROOMS = frozenset(
    ("cad", "design", "errors", "fabrication", "mesh", "minimal", "parallel", "pipeline", "plots",
     "remesh", "report", "surface", "testing")
)  # fmt: skip

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


def __getattr__(name: str) -> Any:
    """Return a public name, or a room of phexfab, importing it on the way."""
    if name in _PLACES:
        value = getattr(import_module(f"phexfab.{_PLACES[name]}"), name)
    elif name in _ROOMS:
        value = import_module(f"phexfab.{name}")
    else:
        raise AttributeError(f"module 'phexfab' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """Return the public names, for help and completion."""
    return sorted({*globals(), *__all__, *_ROOMS})

"""Surfaces that are not minimal: point, normal, shape operator and nearest point, one contract.

Four makers return such surfaces: ``parametric`` (any callable), ``nurbs``, ``implicit`` and
``mesh_surface``; ``phexfab.cad.freeform_faces`` takes faces of CAD objects and STEP files.
"""

from __future__ import annotations

from phexfab.surface.freeform.bending import Bending, FreeformSurface
from phexfab.surface.freeform.implicit import ImplicitSurface, implicit
from phexfab.surface.freeform.mesh import mesh_surface
from phexfab.surface.freeform.nurbs import nurbs
from phexfab.surface.freeform.parametric import ParametricSurface, parametric

__all__ = [
    "Bending",
    "FreeformSurface",
    "ImplicitSurface",
    "ParametricSurface",
    "implicit",
    "mesh_surface",
    "nurbs",
    "parametric",
]

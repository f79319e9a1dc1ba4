"""Smooth minimal surfaces: Weierstrass data, curvature-line coordinates, the catalog."""

from phexfab.surface.catalog import CatalogEntry, catalog, minimal_surface, surface
from phexfab.surface.construct import (
    associate,
    from_expressions,
    from_height_differential,
    from_weierstrass,
)
from phexfab.surface.rectangle import check_rectangle
from phexfab.surface.weierstrass import MinimalSurface

__all__ = [
    "CatalogEntry",
    "MinimalSurface",
    "associate",
    "catalog",
    "check_rectangle",
    "from_expressions",
    "from_height_differential",
    "from_weierstrass",
    "minimal_surface",
    "surface",
]

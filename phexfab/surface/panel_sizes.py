"""How large the panels of a film will be along its rims: they measure step/√κ."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.surface.disc_films.plateau import DiscFilm
from phexfab.surface.domain import Disc
from phexfab.surface.mesh_films.mesh_film import MeshFilm

FloatArray = NDArray[np.float64]

SIZES = (0.7, 2.5)
"""Margins follow the size of panels at the rim, within these shares of the median panel."""
DISC_EDGE = 0.999
"""Share of a film's disc that is used: at its very edge a film with corners is inaccurate."""


def sizes_along_disc(film: DiscFilm) -> FloatArray:
    """Return how large panels are along the boundary (N,), over the median panel."""
    disc = Disc(0.0, DISC_EDGE)
    grid, circle = disc.grid(), DISC_EDGE * np.exp(1j * film.angles)
    kappa = np.abs(film.surface.principal_curvatures(grid)[:, 0])
    panels = film.surface.conformal_factor(grid) ** 2 * kappa
    order = np.argsort(kappa)
    middle = kappa[order[np.searchsorted(np.cumsum(panels[order]), panels.sum() / 2)]]
    with np.errstate(all="ignore"):
        sizes = np.sqrt(middle / np.abs(film.surface.principal_curvatures(circle)[:, 0]))
    return np.clip(np.nan_to_num(sizes, nan=1.0), *SIZES)


def sizes_at_rims(film: MeshFilm) -> list[float]:
    """Return how large panels are at each rim, over the median panel."""
    atlas = film.atlas
    kappa = np.abs(
        film.surface.principal_curvatures(atlas.parameter_of_vertex(np.arange(len(film.points))))[
            :, 0
        ]
    )
    corners = film.points[film.triangles]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    panels = np.bincount(film.triangles.ravel(), np.repeat(areas, 3), len(kappa)) * kappa
    order = np.argsort(kappa)
    middle = order[np.searchsorted(np.cumsum(panels[order]), panels.sum() / 2)]
    with np.errstate(divide="ignore"):
        sizes = np.sqrt(kappa[middle] / kappa)
    return [
        float(np.clip(np.quantile(sizes[film.rim_of == k], 0.9), *SIZES))
        for k in range(len(film.rims))
    ]

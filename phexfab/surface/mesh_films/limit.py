"""How far rims may be apart for a film between them to exist."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import SurfaceError
from phexfab.surface.mesh_films.descent import PinchError, descend
from phexfab.surface.mesh_films.mirror import held_border
from phexfab.surface.mesh_films.start import start_mesh
from phexfab.surface.rims.rim import Rim

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class FilmLimit:
    """The last film before it pinches, when the rims are moved together as they are.

    Attributes
    ----------
    share : float
        Of the ways between the rims' centres and their common middle.
    distance : float
        Of the centres of two rims, mm; the mean from the middle for more.
    """

    share: float
    distance: float


def film_limit(rims: tuple[Rim, ...], *, samples: int = 48, tolerance: float = 1e-3) -> FilmLimit:
    """Return how far apart rims may be, by bisection.

    Each rim is moved along the straight line between its centre and the middle of all centres,
    without turning it.

    Parameters
    ----------
    rims : tuple of Rim
        Two at least.
    samples : int
        Edges along the longest rim. The error of the limit falls with its square.
    tolerance : float
        Where bisection ends, relative to the present ways.

    Raises
    ------
    SurfaceError
        If there are fewer than two rims, their centres coincide, or no film exists however near
        they are.
    """
    if len(rims) < 2:
        raise SurfaceError("a limit of distance needs at least two rims")
    centres = np.array([rim.samples(256)[1].mean(axis=0) for rim in rims])
    ways = centres - centres.mean(axis=0)
    reach = float(np.linalg.norm(ways, axis=1).mean())
    edge = max(rim.length for rim in rims) / samples
    if reach < 1e-6 * edge:
        raise SurfaceError("the rims have a common centre; moving them together changes nothing")

    def exists(share: float) -> bool:
        moved = tuple(rim.moved((share - 1.0) * way) for rim, way in zip(rims, ways, strict=True))
        try:
            mesh = start_mesh(moved, edge)
            held = held_border(mesh.points, mesh.triangles, ())
            descend(mesh.points, mesh.triangles, held, name="film")
        except SurfaceError as error:
            if not isinstance(error, PinchError):
                raise
            return False
        return True

    high = 1.0
    while exists(high):
        high *= 1.5
        if high > 1e3:
            raise SurfaceError("the film exists however far the rims are apart")
    low = high
    while not exists(low):
        high, low = low, 0.7 * low
        if low < 1e-2:
            raise SurfaceError("no film of this topology exists however near the rims are")
    while high - low > tolerance * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if exists(middle) else (low, middle)
    distance = reach * low * (2.0 if len(rims) == 2 else 1.0)
    return FilmLimit(low, distance)

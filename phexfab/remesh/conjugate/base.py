"""The base row and column of a conjugate net: two curves through a seed, and where it lies."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from phexfab.errors import LatticeError
from phexfab.remesh.conjugate.fields import Family, Fields, Free
from phexfab.remesh.conjugate.trace import Curves, trace
from phexfab.surface.freeform.surface import FreeformSurface

FloatArray = NDArray[np.float64]

FINE = 4  # steps of tracing per spacing
MOST = 4000


@dataclass(frozen=True, eq=False)
class Base:
    """The base row and column, through the seed."""

    fields: Fields
    row: Curves
    column: Curves

    @property
    def step(self) -> float:
        """mm between samples of curves."""
        return self.row.step

    def turned(self) -> Base:
        """Return the same two curves, the column as the row."""
        fields = replace(self.fields, swapped=not self.fields.swapped)
        return Base(fields, self.column, self.row)

    def reach(self, which: int) -> tuple[float, float]:
        """Return the least and greatest arc length of the base row (0) or column (1)."""
        curve = (self.row, self.column)[which]
        if curve.closed[0] > 0:
            return 0.0, float(curve.closed[0])
        return float(curve.low()[0]), float(curve.high()[0])

    def closed(self, which: int) -> bool:
        """Return whether the base row (0) or column (1) closes."""
        return bool((self.row, self.column)[which].closed[0] > 0)


def base_curves(
    surface: FreeformSurface,
    family: Family,
    spacing: float,
    *,
    seed: ArrayLike | None = None,
    swapped: bool = False,
    least_angle: float = 20.0,
    free: Free | None = None,
) -> Base:
    """Return the row and the column through a seed.

    Parameters
    ----------
    surface : FreeformSurface
    family : Family
        Rows follow it, and columns are conjugate to it.
    spacing : float
        About how far apart curves will be, mm; sets the step of tracing.
    seed : array_like, optional
        Parameters of a point of the surface; without it the middle of the surface is taken, or
        what of ``surface.seeds`` is nearest to it and regular.
    swapped : bool
        Columns follow the family, and rows are conjugate to it.
    least_angle : float
        Degrees between the families, below which curves end.
    free : callable, optional
        Which points (k, 3) curves may go to; they end where it says no.

    Raises
    ------
    LatticeError
        If the spacing is out of range, or the directions are not defined at the seed; the message
        names the place.
    """
    if not (np.isfinite(spacing) and 0 < spacing < surface.size):
        raise LatticeError(
            f"{surface.name}: spacing = {spacing:g} mm must lie between 0 and the surface's size, "
            f"{surface.size:.6g} mm"
        )
    step = spacing / FINE
    most = most_steps(surface, step)
    fields = Fields(surface, family, swapped, least_angle, free)
    u = _middle(fields) if seed is None else np.asarray(seed, float).reshape(1, -1)
    here = fields.at(u)
    if here.why[0]:
        raise LatticeError(
            f"{surface.name}: at {here.points[0].round(3).tolist()} "
            f"{fields.reason(int(here.why[0]))}; seed the net elsewhere, or give another family"
        )
    return Base(fields, trace(fields, u, 0, step, most), trace(fields, u, 1, step, most))


def most_steps(surface: FreeformSurface, step: float) -> int:
    """Return after how many steps a curve that neither ends nor closes is cut off."""
    return int(min(MOST, np.ceil(4 * surface.size / step)))


def even(base: Base, spacing: float, which: int, *, multiple: int = 1) -> FloatArray:
    """Return arc lengths at equal distances on the base row (0) or column (1).

    From end to end, or around; the distance is the nearest to ``spacing`` that divides the curve a
    multiple of ``multiple`` times.
    """
    low, high = base.reach(which)
    least = 4 if base.closed(which) else 1
    count = multiple * max(-(-least // multiple), round((high - low) / spacing / multiple))
    every = np.linspace(low, high, count + 1)
    return np.asarray(every[:-1] if base.closed(which) else every)


def _middle(fields: Fields) -> FloatArray:
    """Return (1, ·) parameters of the regular seed nearest to the middle of the surface."""
    u = fields.surface.seeds(400)
    here = fields.at(u)
    good = here.why == 0
    if not good.any():
        raise LatticeError(
            f"{fields.surface.name}: nowhere on it are conjugate families defined: "
            f"{fields.reason(int(here.why[0]))}; give a field or a function"
        )
    # Places with regular ones all around come first: where the net can grow to all sides.
    points = here.points[good]
    centre = here.points.mean(axis=0)
    spread = np.linalg.norm(here.points - centre, axis=1).mean()
    lonely = np.zeros(len(points))
    if not good.all():
        bad = here.points[~good]
        away = np.linalg.norm(points[:, None] - bad[None], axis=2).min(axis=1)
        lonely = np.maximum(0.0, 0.3 * spread - away)
    return u[good][[int((np.linalg.norm(points - centre, axis=1) + 4 * lonely).argmin())]]

"""From a smooth minimal surface and a lattice on it to the discrete minimal surface."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import LatticeError
from phexfab.minimal.gauss_image import gauss_image
from phexfab.minimal.laplacian import solve_minimal
from phexfab.parallel.shell import Shell
from phexfab.remesh.lattice import Lattice, lattice
from phexfab.surface.weierstrass import MinimalSurface
from phexfab.triangular import EQUILATERAL, mean_distance

FloatArray = NDArray[np.float64]


def tangent_shell(surface: MinimalSurface, on: Lattice, kind: str = "face") -> Shell:
    """Return the start of the minimal solve: planes tangent to the surface, normals from S.

    Parameters
    ----------
    surface : MinimalSurface
    on : Lattice
        In the surface's curvature-line coordinates.
    kind : ``"face"``, ``"edge"`` or ``"vertex"``
        Offset type, see ``gauss_image``.

    Raises
    ------
    SurfaceError, SolveError, DesignError
    """
    z = surface.parameter(on.points)
    normals, gauss_heights = gauss_image(surface, on, z, kind)
    if kind != "face":
        z = surface.parameter_of_normal(normals, z)
    points = surface.point(z)
    heights = np.einsum("ij,ij->i", points, normals)
    return Shell(normals, heights, gauss_heights, on.triangles, kind, points, on.step, z)


def minimal_shell(surface: MinimalSurface, on: Lattice, kind: str = "face") -> Shell:
    """Return the discrete minimal surface M with its Gauss image S, as one shell.

    Border planes are tangent to the smooth surface; all panels have H_f = 0 to rounding.

    Parameters
    ----------
    surface : MinimalSurface
    on : Lattice
    kind : ``"face"``, ``"edge"`` or ``"vertex"``

    Raises
    ------
    SurfaceError
        If the lattice reaches a singular point of the surface.
    SolveError
        If the Gauss image or the minimal system cannot be solved.

    References
    ----------
    Thesis §7.2.2.
    """
    return solve_minimal(tangent_shell(surface, on, kind))


def lattice_on(
    surface: MinimalSurface,
    panel_size: float,
    *,
    rectangle: tuple[float, float, float, float] | None = None,
    row_ratio: float = EQUILATERAL,
    rows_along: str = "u",
    turn: float = 0.0,
    closed: bool = False,
) -> Lattice:
    """Return the lattice whose panels have a given size in mm.

    Parameters
    ----------
    surface : MinimalSurface
    panel_size : float
        Mean distance of neighbouring panel centres, median over the surface, mm. A panel measures
        step/√κ, so sizes vary with the curvature κ.
    rectangle : (u0, u1, v0, v1), optional
        In curvature-line coordinates; the surface's default otherwise.
    row_ratio, rows_along, turn
        See ``lattice``.
    closed : bool
        Close the lattice under the surface's period.

    Raises
    ------
    LatticeError
        If the surface has no period to close under, or no panel fits.
    """
    box = surface.rectangle if rectangle is None else rectangle
    if closed and surface.period is None:
        raise LatticeError(
            f"the surface {surface.name!r} does not close: give a range of parameters instead of "
            '"closed"'
        )
    u, v = np.meshgrid(np.linspace(box[0], box[1], 33), np.linspace(box[2], box[3], 33))
    kappa = np.abs(surface.principal_curvatures(surface.parameter(u + 1j * v))[..., 0])
    stretch = float(np.median(np.sqrt(surface.scale / kappa)))  # mm per unit of w
    step = panel_size / (stretch * mean_distance(row_ratio))
    return lattice(
        box,
        step,
        row_ratio=row_ratio,
        rows_along=rows_along,
        turn=turn,
        period=surface.period if closed else None,
    )


def surface_distance(surface: MinimalSurface, shell: Shell) -> FloatArray:
    """Return the distance of every vertex of M from the smooth surface, mm.

    Parameters
    ----------
    surface : MinimalSurface
    shell : Shell
        Made on that surface, so that its parameters are known.
    """
    triangles = shell.triangles[shell.used_vertices]
    # Not the mean of the three: a triangle may lie across the seam of a closed lattice.
    guess = shell.parameters[triangles[:, 0]]
    foot = surface.closest_parameter(shell.mesh.vertices, guess)
    return np.linalg.norm(surface.point(foot) - shell.mesh.vertices, axis=1)

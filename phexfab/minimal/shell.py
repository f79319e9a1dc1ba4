"""From a smooth minimal surface and a lattice on it to the discrete minimal surface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import LatticeError, SurfaceError
from phexfab.minimal.border import smooth_border
from phexfab.minimal.gauss_image import gauss_image
from phexfab.minimal.grading import grading
from phexfab.minimal.laplacian import MinimalSolver
from phexfab.parallel.shell import Shell
from phexfab.remesh.lattice import Lattice, lattice
from phexfab.surface.weierstrass import MinimalSurface
from phexfab.triangular import EQUILATERAL, mean_distance

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]


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
    z = surface.parameter(on.points) if on.parameters is None else on.parameters
    normals, gauss_heights = gauss_image(surface, on, z, kind)
    if kind != "face" and on.parameters is None:
        z = surface.parameter_of_normal(normals, z)
    elif kind != "face":
        z = _nearby_parameters(surface, on, normals, z)
    points = surface.point(z)
    heights = np.einsum("ij,ij->i", points, normals)
    return Shell(normals, heights, gauss_heights, on.triangles, kind, points, on.step, z)


def _nearby_parameters(
    surface: MinimalSurface, on: Lattice, normals: FloatArray, z: ComplexArray
) -> ComplexArray:
    """Return the parameters with these normals where Newton finds them close by, else ``z``.

    At an umbilic the Gauss map is branched and has no inverse. Only heights of border planes
    matter, those of panels are found by the minimal solve; and ``X·n`` at a point X whose normal is
    off by a small angle misses the tangent plane by the square of that angle only.
    """
    reach = np.zeros(len(z))
    tail, head = on.triangles.ravel(), on.triangles[:, [1, 2, 0]].ravel()
    here = surface.point(z)
    for a, b in ((tail, head), (head, tail)):
        np.maximum.at(reach, a, np.linalg.norm(here[a] - here[b], axis=1))
    found = _each(surface.parameter_of_normal, normals, z)
    # From an umbilic Newton may leap out of all bounds, where a point takes seconds to integrate.
    away = np.abs(np.stack([found, z]) - z.mean())
    good = np.flatnonzero(np.isfinite(found) & (away[0] <= 2 * away[1].max()))

    def distance(place: FloatArray, there: ComplexArray) -> FloatArray:
        return np.asarray(np.linalg.norm(surface.point(there) - place, axis=1), float)

    for share in (1.0, 0.25, 0.5, 0.75):  # on an atlas, not by way of other charts
        way = z[good] + share * (found[good] - z[good])
        with np.errstate(all="ignore"):
            far = _each(distance, here[good], way).real
        good = good[far < reach[good]]
    near = good
    out = z.copy()
    out[near] = found[near]
    return out


def _each(
    solve: Callable[[FloatArray, ComplexArray], NDArray[Any]],
    targets: FloatArray,
    guess: ComplexArray,
) -> ComplexArray:
    """Return solutions for all targets, not numbers for those (few) at which ``solve`` gives up.

    A batch that fails is halved, so that one target does no harm to the others.
    """
    found = np.full(len(guess), complex(np.nan, np.nan))
    todo = [np.arange(len(guess))]
    while todo:
        batch = todo.pop()
        if not len(batch):
            continue
        try:
            found[batch] = solve(targets[batch], guess[batch])
        except SurfaceError:
            if len(batch) > 1:
                todo += [batch[: len(batch) // 2], batch[len(batch) // 2 :]]
    return found


def minimal_shell(surface: MinimalSurface, on: Lattice, kind: str = "face") -> Shell:
    """Return the discrete minimal surface M with its Gauss image S, as one shell.

    All panels have H_f = 0 to rounding. Border planes are tangent to the smooth surface but for a
    smooth correction of second order, see ``smooth_border``.

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

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0), "edge")
    >>> shell.mesh.n_faces, int(shell.mesh.sides.max())
    (27, 6)
    >>> bool(px.is_discrete_minimal(shell.mesh, shell.gauss))
    True
    """
    return solved_shell(surface, on, kind)[0]


def solved_shell(
    surface: MinimalSurface, on: Lattice, kind: str = "face"
) -> tuple[Shell, int | None]:
    """Return ``minimal_shell`` and the film's number of unstable directions, where it is known."""
    start = tangent_shell(surface, on, kind)
    solver = MinimalSolver.of(start)
    border = smooth_border(start, on, solver, surface.period)
    return start.with_heights(solver.solve(border)), solver.index


def lattice_on(
    surface: MinimalSurface,
    panel_size: float,
    *,
    rectangle: tuple[float, float, float, float] | None = None,
    row_ratio: float = EQUILATERAL,
    rows_along: str = "u",
    turn: float = 0.0,
    closed: bool = False,
    evenness: float = 0.0,
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
    evenness : float
        0 for even spacing in w, the sizes then follow the curvature; up to 1 for panels as even in
        size as spacing functions along both families of curvature lines can make them (see
        ``grading``). Above 0 for the face type only: circles know no stretched lattice.

    Raises
    ------
    LatticeError
        If the surface has no period to close under, no panel fits, ``evenness`` is not in [0, 1],
        or a graded lattice is turned.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("catenoid").scaled(2000.0)  # mm
    >>> on = px.lattice_on(surface, panel_size=450.0, closed=True)
    >>> on.closed, len(px.minimal_shell(surface, on).panels)
    (True, 270)
    """
    box = surface.rectangle if rectangle is None else rectangle
    if closed and surface.period is None:
        raise LatticeError(
            f"the surface {surface.name!r} does not close: give a range of parameters instead of "
            '"closed"'
        )
    if not 0 <= evenness <= 1:
        raise LatticeError(f"lattice.evenness = {evenness:g}: choose a number from 0 to 1")
    if evenness and turn:
        raise LatticeError(
            f"lattice.evenness = {evenness:g}, lattice.turn = {turn:g}°: a lattice that is graded "
            "follows the curvature lines; set one of them to 0"
        )
    side_u, side_v = np.linspace(box[0], box[1], 33), np.linspace(box[2], box[3], 33)
    u, v = np.meshgrid(side_u, side_v)
    kappa = np.abs(surface.principal_curvatures(surface.parameter(u + 1j * v))[..., 0])
    stretch = np.sqrt(surface.scale / kappa)  # mm per unit of w
    period = surface.period if closed else None
    options: dict[str, Any] = {"row_ratio": row_ratio, "rows_along": rows_along, "period": period}
    if not evenness:
        step = panel_size / (float(np.median(stretch)) * mean_distance(row_ratio))
        return lattice(box, step, turn=turn, **options)
    around = None if period is None else "v" if abs(period.imag) > abs(period.real) else "u"
    spacing = grading(
        side_u,
        side_v,
        stretch,
        evenness,
        row_ratio=row_ratio,
        rows_along=rows_along,
        closed=around,
    )
    step = panel_size / float(np.median(spacing.sizes(stretch, rows_along)))
    made = lattice(box, step, **options | {"row_ratio": spacing.row_ratio})
    return replace(made, points=spacing.place(made.points))


def surface_distance(surface: MinimalSurface, shell: Shell) -> FloatArray:
    """Return the distance of every vertex of M from the smooth surface, mm.

    Parameters
    ----------
    surface : MinimalSurface
    shell : Shell
        Made on that surface, so that its parameters are known.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> print(f"{px.surface_distance(surface, shell).max():.1f} mm")
    7.9 mm
    >>> finer = px.minimal_shell(surface, px.lattice_on(surface, panel_size=250.0))
    >>> print(f"{px.surface_distance(surface, finer).max():.1f} mm")  # falls with the square
    1.9 mm
    """
    triangles = shell.triangles[shell.used_vertices]
    vertices = shell.mesh.vertices
    # Not the mean of the three: a triangle may lie across the seam of a closed lattice, and each of
    # them in another chart of a film.
    foot = np.full(len(vertices), complex(np.nan, np.nan))
    for k in range(3):
        lost = np.flatnonzero(~np.isfinite(foot))
        if len(lost):
            guess = shell.parameters[triangles[lost, k]]
            foot[lost] = _each(surface.closest_parameter, vertices[lost], guess)
    lost = np.flatnonzero(~np.isfinite(foot))
    if len(lost):  # say why
        surface.closest_parameter(vertices[lost[:1]], shell.parameters[triangles[lost[:1], 0]])
    return np.linalg.norm(surface.point(foot) - vertices, axis=1)

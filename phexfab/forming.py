"""Form-finding: from the surface that a design asks for to the shell that is built.

A named surface on a rectangle goes straight to its lattice. Everything else is a *film*: a smooth
surface that reaches a little beyond its rims, a lattice closed up around its umbilics, the exact
minimal shell on all of it, and a cut along the rims. Where that cut misses a limit, other cuts and
other places of the lattice on the same film are tried (``phexfab.fitting``).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phexfab.design import Design
from phexfab.ending import Ending, ended, require_room
from phexfab.errors import (
    DesignError,
    LatticeError,
    MeshError,
    PhexError,
    SolveError,
    SurfaceError,
)
from phexfab.films import Film, film_of, film_within, smooth_surface
from phexfab.fitting import fitted
from phexfab.freeform_shells import freeform_shell
from phexfab.minimal.shell import lattice_on, solved_shell
from phexfab.parallel.shell import Shell
from phexfab.placing import Placement, lattice_at
from phexfab.remesh.lattice import Lattice
from phexfab.surface import MinimalSurface, check_rectangle
from phexfab.surface.disc_films.plateau import DiscFilm
from phexfab.surface.freeform.surface import FreeformSurface
from phexfab.surface.mesh_films.mesh_film import MeshFilm
from phexfab.surface.rims.inward import inward_radius
from phexfab.surface.rims.rim import Rim

FloatArray = NDArray[np.float64]
Figures = Mapping[str, tuple[float | int | str, str]]
Progress = Callable[[str, int, int], None]
TRIES = (
    (1.0, 1.0),
    (1.4, 1.0),
    (1.4, 0.95),
    (1.9, 1.0),
    (1.9, 1.06),
    (1.4, 0.9),
    (0.75, 1.0),
    (0.75, 0.93),
)
"""How far a film reaches beyond its rims and how large panels are, over what is wished for.

The first that gives a shell which ends at its rims is taken. A rim that a film can hardly be
continued beyond needs a narrow margin, one that large panels lie along a wide one; and where a
shell cannot be cut at all, another lattice will do.
"""

INWARD, ROUNDING = 4.4, 6.0
"""Radius, in panels, with which a rim may turn inwards, and of the rounding of a right angle that
leaves so much. A film ends about half that radius beyond such a rim: panels there need theirs."""


@dataclass(frozen=True, eq=False)
class Form:
    """A shell with what it was made from.

    Attributes
    ----------
    surface : MinimalSurface, FreeformSurface or None
        The smooth surface, in mm; None for a mesh from elsewhere.
    shell : Shell
        What is built; a cut shell knows what it was cut from (``shell.whole``).
    index : int or None
        Number of unstable directions of the film.
    rim_distance : float or None
        Largest distance between the given rims and the shell's border, mm; None without rims.
    figures : mapping of name to (value, unit)
        What the form alone can tell, for the report.
    deviation : (V,) array or None
        Distance of the shell's vertices from a surface that is not minimal, mm; see
        ``phexfab.freeform_shells``.
    """

    surface: MinimalSurface | FreeformSurface | None
    shell: Shell
    index: int | None
    rim_distance: float | None
    figures: Figures
    deviation: FloatArray | None = None


def form(design: Design, say: Progress, rims: Sequence[Rim] = (), face: Any = None) -> Form:
    """Return the shell that a design asks for.

    Parameters
    ----------
    design : Design
    say : callable
        Called with a stage's name, steps done and steps in all (0 where unknown).
    rims : sequence of Rim
        Used in place of the files or points that ``surface.rim`` names.
    face : optional
        Face of a CAD library in place of the one that ``surface.step`` names.

    Raises
    ------
    DesignError, SurfaceError, LatticeError, SolveError, MeshError
        Each says what is impossible, where, and what to change.
    """
    if design.mesh.method is not None or face is not None:
        made = freeform_shell(design, rims, face)
        return Form(made.surface, made.shell, None, None, made.figures, made.deviation)
    if design.surface.source == "named" and design.surface.radius is None and not rims:
        return _on_rectangle(design, say)
    say("surface", 0, 0)
    within = film_within(design, rims)
    failed: PhexError | None = None
    too_far = np.inf
    slow = design.surface.source == "periodic"
    films: dict[float, Film] = {}
    for reach, size in TRIES[:4] if slow else TRIES:
        if reach >= too_far:
            continue
        say("surface", 0, 0)
        try:
            if reach not in films:
                films[reach] = film_of(design, within, reach)
            film, lattice = _laid(design, within, reach, films[reach], Placement(size))
            films[reach] = film
            say("shell", 0, 0)
            whole, index = solved_shell(film.surface, lattice, design.offset.type)
            first = ended(design, film, whole)
        except SurfaceError as error:  # it cannot be continued that far
            failed, too_far = failed or error, min(too_far, reach)
        except MeshError as error:  # the shell ends before its rim, or cannot be cut there
            failed = failed or error
        except (LatticeError, SolveError) as error:
            failed = failed or error
            if isinstance(within, MeshFilm) or slow:
                break  # what a wider margin does not change, and long in the making
        else:
            try:
                return _formed(design, within, film, Placement(size), whole, index, first)
            except MeshError as error:  # no cut leaves room
                failed = error
                break
    assert failed is not None
    if _turns_inwards(design, within):
        size = design.lattice.panel_size
        raise type(failed)(
            f"{failed}; where a rim turns inwards, a film goes on the farther the larger the "
            f"radius: give it {INWARD * size:.0f} mm or more, with surface.smooth_inward = "
            f"{ROUNDING * size:.0f} where it is a right angle, or choose smaller panels"
        ) from failed
    raise failed


def _turns_inwards(design: Design, within: DiscFilm | MeshFilm | None) -> bool:
    """Return whether the rim turns inwards more tightly than a film can well go on beyond."""
    tight = INWARD * design.lattice.panel_size
    return isinstance(within, DiscFilm) and inward_radius(within.rim) < tight


def _laid(
    design: Design,
    within: DiscFilm | MeshFilm | None,
    reach: float,
    film: Film,
    placement: Placement,
) -> tuple[Film, Lattice]:
    """Return the film, on a finer mesh where this one is too coarse, and a lattice on it."""
    finer = 0
    while True:
        try:
            return film, lattice_at(design, film, placement)
        except MeshError:  # too coarse where the margin ends near an umbilic
            if not film.finer:
                raise
            finer += 1
            film = film_of(design, within, reach, finer)


def _formed(
    design: Design,
    within: DiscFilm | MeshFilm | None,
    film: Film,
    placement: Placement,
    whole: Shell,
    index: int | None,
    first: Ending,
) -> Form:
    """Return the form whose rim fits best."""
    fit = fitted(design, film, placement, whole, index, first)
    if design.border.panels == "cut":
        require_room(design, fit.ending.shell)
    figures = {**film.figures, **fit.ending.figures, **fit.figures}
    if _turns_inwards(design, within):
        figures["film off a rim that turns inwards, at most"] = (film.rim_distance, "mm")
        wide = ROUNDING * design.lattice.panel_size
        figures["surface.smooth_inward that suits right angles"] = (wide, "mm")
    return Form(film.surface, fit.ending.shell, fit.index, fit.ending.rim_distance, figures)


def _on_rectangle(design: Design, say: Progress) -> Form:
    say("surface", 0, 0)
    smooth = smooth_surface(design)
    say("shell", 0, 0)
    rectangle, closed = parameter_rectangle(design, smooth)
    u, v = rectangle[:2], rectangle[2:]
    try:
        check_rectangle(smooth, u, v)
    except SurfaceError as error:
        where = f"u = [{u[0]:.4g}, {u[1]:.4g}], v = [{v[0]:.4g}, {v[1]:.4g}]"
        raise DesignError(f"surface.u, surface.v: {where}: {error}") from error
    asked = design.lattice
    lattice = lattice_on(
        smooth,
        asked.panel_size,
        rectangle=rectangle,
        row_ratio=asked.row_ratio,
        rows_along=asked.rows_along,
        turn=asked.turn,
        closed=closed,
        evenness=asked.evenness,
    )
    shell, index = solved_shell(smooth, lattice, design.offset.type)
    return Form(smooth, shell, index, None, {})


def parameter_rectangle(
    design: Design, surface: MinimalSurface
) -> tuple[tuple[float, float, float, float], bool]:
    """Return the rectangle (u0, u1, v0, v1) of a design, and whether it closes."""
    u0, u1, v0, v1 = surface.rectangle
    asked = design.surface
    closed = "closed" in (asked.u, asked.v)
    if closed:
        period = surface.period
        if period is None:
            way = "u" if asked.u == "closed" else "v"
            raise DesignError(
                f'surface.{way} = "closed": {surface.name} does not close; write a range '
                f"{way} = [from, to] instead"
            )
        around = "v" if abs(period.imag) > abs(period.real) else "u"
        if getattr(asked, around) != "closed":
            raise DesignError(
                f'surface.{"u" if around == "v" else "v"} = "closed": {surface.name} closes along '
                f'{around}; write {around} = "closed"'
            )
    if isinstance(asked.u, tuple):
        u0, u1 = asked.u
    if isinstance(asked.v, tuple):
        v0, v1 = asked.v
    if closed and surface.period is not None:
        half = abs(surface.period) / 2
        if asked.v == "closed":
            v0, v1 = -half, half
        else:
            u0, u1 = -half, half
    return (u0, u1, v0, v1), closed


def panel_sizes(shell: Shell) -> FloatArray:
    """Return for each panel the mean distance of its centre from its neighbours', mm.

    A cut panel's is that from before the cut.
    """
    before = shell if shell.whole is None else shell.whole
    panels, starts, _, beyond = before.rings
    own = np.repeat(panels, np.diff(starts))
    away = np.linalg.norm(before.points[beyond] - before.points[own], axis=1)
    sizes = np.add.reduceat(away, starts[:-1]) / np.diff(starts)
    if shell.whole is None:
        return sizes
    return np.asarray(sizes[np.searchsorted(panels, shell.parents[shell.panels])])

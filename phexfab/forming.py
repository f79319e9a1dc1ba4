"""Form-finding: from the surface that a design asks for to the shell that is built.

A named surface on a rectangle goes straight to its lattice. Everything else is a *film*: a smooth
surface that reaches a little beyond its rims, a lattice closed up around its umbilics, the exact
minimal shell on all of it, and a cut along the rims.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phexfab.design import Design
from phexfab.errors import (
    DesignError,
    LatticeError,
    MeshError,
    PhexError,
    SolveError,
    SurfaceError,
)
from phexfab.fabrication.checks import Limits
from phexfab.fabrication.geometry_checks import bad_faces
from phexfab.fabrication.panels import PanelSpec, largest_gaps
from phexfab.fabrication.parts import Material
from phexfab.films import Film, film_of, film_within, smooth_surface
from phexfab.freeform_shells import freeform_shell
from phexfab.mesh.measures import signed_areas
from phexfab.minimal.shell import lattice_on, solved_shell
from phexfab.parallel.border import place
from phexfab.parallel.cut import CutReport, cut_shell
from phexfab.parallel.offset import admissible_interval
from phexfab.parallel.shell import Shell
from phexfab.parallel.within import border_distance, panels_within
from phexfab.remesh.fewer_panels import firm_shell, without_panels
from phexfab.surface import MinimalSurface, check_rectangle
from phexfab.surface.freeform.surface import FreeformSurface
from phexfab.surface.mesh_films.mesh_film import MeshFilm
from phexfab.surface.rims.rim import Rim

FloatArray = NDArray[np.float64]
Figures = Mapping[str, tuple[float | int | str, str]]
Progress = Callable[[str, int, int], None]
PLUMB = np.array([0.0, 0.0, 1.0])
SPARE = 1.15  # factor on the depth of panels and bars in which no edge at the rim is to vanish
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

A rim that a film can hardly be continued beyond needs a narrow margin, one that large panels lie
along a wide one; and where a rim meets a lattice badly, another one will do.
"""


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
    for reach, size in TRIES[:4] if slow else TRIES:
        if reach >= too_far:
            continue
        say("surface", 0, 0)
        lattice = design.lattice.model_copy(update={"panel_size": size * design.lattice.panel_size})
        tried = design.model_copy(update={"lattice": lattice})
        try:
            film = film_of(tried, within, reach)
            say("shell", 0, 0)
            whole, index = solved_shell(film.surface, film.lattice, design.offset.type)
            return _ended(tried, film, whole, index)
        except SurfaceError as error:  # it cannot be continued that far
            failed, too_far = failed or error, min(too_far, reach)
        except MeshError as error:  # the shell ends before its rim, or cannot be cut there
            failed = failed or error
        except (LatticeError, SolveError) as error:
            failed = failed or error
            if isinstance(within, MeshFilm) or slow:
                break  # what a wider margin does not change, and long in the making
    assert failed is not None
    raise failed


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


def _ended(design: Design, film: Film, whole: Shell, index: int | None) -> Form:
    """Return the form of a shell that ends at its rims, as the design asks."""
    if design.border.panels == "whole":
        shell, off, figures = _in_whole_panels(design, film, whole)
    else:
        shell, off, figures = _cut(design, film, whole)
    crossed = bad_faces(shell)
    if crossed.any():
        spot = shell.points[shell.panels[np.argmax(crossed)]]
        raise MeshError(
            f"the panel at {place(spot)} would cross itself: panels of "
            f"{design.lattice.panel_size:.4g} mm are too large for the film there; choose a "
            "smaller lattice.panel_size"
        )
    # Whose rim is given sees it from above; a named surface has the side that its formula says.
    if film.upright and faces_down(shell):
        shell = shell.turned_over()
    if design.border.panels == "cut":
        _require_room(design, shell)
    return Form(film.surface, shell, index, off, {**film.figures, **figures})


def _require_room(design: Design, shell: Shell) -> None:
    """Refuse a cut that leaves no room for panels or bars: another one may do better."""
    below, above = _depth(design)
    low, high = admissible_interval(shell)
    gap, gaps = design.panels.gap, largest_gaps(shell, panel_spec(design))
    remedy = 'choose another lattice.panel_size, or border.panels = "whole"'
    if -below < low or high < above:
        raise MeshError(
            f"the rim leaves edges that vanish {min(-low, high):.0f} mm off the shell, within the "
            f"depth of panels and bars; {remedy}, or lower bars"
        )
    if gaps.min() <= gap:
        spot = shell.mesh.polygon(int(gaps.argmin())).mean(axis=0)
        raise MeshError(
            f"the rim leaves a panel at {place(spot)} that is too small for a gap of "
            f"{gap:g} mm; {remedy}, or a smaller panels.gap"
        )


def panel_spec(design: Design) -> PanelSpec:
    """Return what panels are to be like."""
    p = design.panels
    return PanelSpec(p.thickness, p.gap, p.side, p.edges, Material(p.material, p.density))


def _in_whole_panels(
    design: Design, film: Film, whole: Shell
) -> tuple[Shell, float | None, Figures]:
    """Return the panels whose middle lies within the rims; they end off the rim by design."""
    kept = panels_within(whole, film.borders)
    shell = firm_shell(without_panels(whole, whole.panels[~kept]))
    size = design.lattice.panel_size
    off = border_distance(shell, film.borders, size / 16) + film.rim_distance
    return shell, None, {"whole panels end off the rim, at most": (off, "mm")}


def _cut(design: Design, film: Film, whole: Shell) -> tuple[Shell, float | None, Figures]:
    asked = design.border
    below, above = (SPARE * depth for depth in _depth(design))
    made = cut_shell(
        whole,
        film.borders,
        sliver_share=asked.sliver,
        sliver_width=asked.sliver_width,
        shortest_edge=_shortest_edge(design),
        depth=(above, below) if film.upright and faces_down(whole) else (below, above),
        sagitta=asked.sagitta,
        direction=PLUMB if asked.direction == "plumb" else None,
    )
    return (
        made.shell,
        made.report.rim_distance + film.rim_distance,
        _cut_figures(made.report),
    )


def _depth(design: Design) -> tuple[float, float]:
    """How deep panels and bars reach below and above M, mm: no edge at the rim may vanish there."""
    panel, bars = design.panels, 0.0
    if design.beams.kind == "flat":
        bars = design.beams.height + design.beams.seat + design.beams.width / 2
    below = {"outside": 0.0, "inside": 1.0, "centre": 0.5}[panel.side] * panel.thickness
    above = panel.thickness - below
    if panel.side == "inside":
        above += bars
    else:
        below += bars
    if design.offset.distance is not None:
        below, above = max(below, -design.offset.distance), max(above, design.offset.distance)
    return below, above


def _shortest_edge(design: Design) -> float:
    """The shortest edge to leave at the rim, mm: something of every beam, and of every panel."""
    least = [Limits(**design.checks.limits()).shortest_edge, 2.0 * design.panels.gap]
    if design.nodes.kind == "hub":
        least.append(2.0 * (design.nodes.radius + design.nodes.clearance) + 40.0)
    return max(least)


def faces_down(shell: Shell) -> bool:
    """Return whether the normals of a shell point down rather than up, weighted by area."""
    areas = signed_areas(shell.mesh, shell.normals[shell.panels])
    return bool(areas @ shell.normals[shell.panels, 2] < 0)


def _cut_figures(report: CutReport) -> Figures:
    return {
        "panels cut by the rim": (report.cut, ""),
        "slivers merged": (report.merged, ""),
        "slivers left out": (report.dropped, ""),
        "slivers kept": (report.kept, ""),
        "cut off the normals, at most": (report.ruling_angle, "deg"),
        "shortest edge at the rim": (report.shortest_edge, "mm"),
    }


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

"""Where a shell ends: in whole panels, or cut along the rims of its film, as a design asks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from phexfab.design import Design
from phexfab.errors import MeshError
from phexfab.fabrication.bars import BeamSpec
from phexfab.fabrication.checks import Limits
from phexfab.fabrication.geometry_checks import bad_faces
from phexfab.fabrication.nodes import NodeSpec
from phexfab.fabrication.panels import PanelSpec, largest_gaps
from phexfab.fabrication.parts import Material
from phexfab.fabrication.rim_fit import rim_lacks
from phexfab.films import Film
from phexfab.mesh.measures import signed_areas
from phexfab.parallel.border import place
from phexfab.parallel.cut import CutReport, cut_shell
from phexfab.parallel.offset import admissible_interval
from phexfab.parallel.shell import Shell
from phexfab.parallel.within import border_distance, panels_within
from phexfab.remesh.fewer_panels import firm_shell, without_panels

FloatArray = NDArray[np.float64]
Figures = Mapping[str, tuple[float | int | str, str]]
PLUMB = np.array([0.0, 0.0, 1.0])
SPARE = 1.15  # factor on the depth of panels and bars in which no edge at the rim is to vanish


@dataclass(frozen=True)
class Knife:
    """How a cut differs from the first one.

    Attributes
    ----------
    room : float
        Factor on the shortest edge and on the depth in which none is to vanish.
    sagitta : float, mm, optional
        How far chords may stay off the rim, where the design leaves that open.
    sliver : float, mm, optional
        How far in a piece has to reach, where the design leaves that open.
    """

    room: float = 1.0
    sagitta: float | None = None
    sliver: float | None = None

    def __str__(self) -> str:
        """Return it in words; nothing for the first cut."""
        said = []
        if self.room != 1.0:
            said.append(f"cut with {self.room:g} times the room for edges")
        if self.sagitta is not None:
            said.append(f"cut in chords within {self.sagitta:g} mm of the rim")
        if self.sliver is not None:
            said.append(f"slivers down to {self.sliver:g} mm kept")
        return ", ".join(said)


FIRST = Knife()


@dataclass(frozen=True, eq=False)
class Ending:
    """A shell that ends at its rims.

    Attributes
    ----------
    shell : Shell
    rim_distance : float or None
        Largest distance between the given rims and the border, mm; None for whole panels.
    figures : mapping of name to (value, unit)
    lacks : mapping of str to float
        Limits at the rim that are missed, see ``rim_lacks``.
    """

    shell: Shell
    rim_distance: float | None
    figures: Figures
    lacks: Mapping[str, float] = field(default_factory=dict)


def ended(design: Design, film: Film, whole: Shell, knife: Knife = FIRST) -> Ending:
    """Return a shell that ends at the film's rims, as a design asks.

    Parameters
    ----------
    design : Design
    film : Film
    whole : Shell
        On all of the film.
    knife : Knife

    Raises
    ------
    MeshError
        If the shell ends before its rim, cannot be cut there, or a panel would cross itself.
    """
    if design.border.panels == "whole":
        shell, off, figures = _in_whole_panels(design, film, whole)
    else:
        shell, off, figures = _cut(design, film, whole, knife)
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
    if design.border.panels == "whole":
        return Ending(shell, off, figures)
    beam = None if design.beams.kind == "none" else beam_spec(design)
    lacks = rim_lacks(shell, limits_of(design), panel_spec(design), beam, depth_of(design), off)
    return Ending(shell, off, figures, lacks)


def require_room(design: Design, shell: Shell) -> None:
    """Refuse a cut that leaves no room for panels or bars.

    Raises
    ------
    MeshError
    """
    below, above = depth_of(design)
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


def limits_of(design: Design) -> Limits:
    """Return what checks are held against."""
    return Limits(**design.checks.limits())


def panel_spec(design: Design) -> PanelSpec:
    """Return what panels are to be like."""
    p = design.panels
    return PanelSpec(p.thickness, p.gap, p.side, p.edges, Material(p.material, p.density))


def beam_spec(design: Design) -> BeamSpec:
    """Return what beams are to be like."""
    b, n = design.beams, design.nodes
    material = Material(b.material, b.density)
    return BeamSpec(b.width, b.height, b.ends, b.seat, n.radius, n.clearance, material)


def node_spec(design: Design) -> NodeSpec:
    """Return what nodes are to be like."""
    n = design.nodes
    return NodeSpec(n.kind, n.radius, Material(n.material, n.density))


def _in_whole_panels(
    design: Design, film: Film, whole: Shell
) -> tuple[Shell, float | None, Figures]:
    """Return the panels whose middle lies within the rims; they end off the rim by design."""
    kept = panels_within(whole, film.borders)
    shell = firm_shell(without_panels(whole, whole.panels[~kept]))
    size = design.lattice.panel_size
    off = border_distance(shell, film.borders, size / 16) + film.rim_distance
    return shell, None, {"whole panels end off the rim, at most": (off, "mm")}


def _cut(
    design: Design, film: Film, whole: Shell, knife: Knife
) -> tuple[Shell, float | None, Figures]:
    asked = design.border
    below, above = (SPARE * knife.room * depth for depth in depth_of(design))
    made = cut_shell(
        whole,
        film.borders,
        sliver_share=asked.sliver,
        sliver_width=knife.sliver if asked.sliver_width is None else asked.sliver_width,
        shortest_edge=knife.room * _shortest_edge(design),
        depth=(above, below) if film.upright and faces_down(whole) else (below, above),
        sagitta=knife.sagitta if asked.sagitta is None else asked.sagitta,
        direction=PLUMB if asked.direction == "plumb" else None,
    )
    return (
        made.shell,
        made.report.rim_distance + film.rim_distance,
        _cut_figures(made.report),
    )


def depth_of(design: Design) -> tuple[float, float]:
    """Return how deep panels and bars reach below and above M, mm: no edge may vanish there."""
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
    least = [limits_of(design).shortest_edge, 2.0 * design.panels.gap]
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

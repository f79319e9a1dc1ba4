"""How well a shell's border suits what is made of it: limits that a cut misses, before any part is.

Where a rim happens to cross the lattice decides on edges, corners and room along it. All of that is
measured here from the shell alone, in a fraction of the time that parts and their checks take, so
that several cuts can be compared.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import PartError
from phexfab.fabrication.bars import BeamSpec
from phexfab.fabrication.beams import lay_bars, spare_lengths
from phexfab.fabrication.geometry_checks import beam_angles, edge_lengths
from phexfab.fabrication.limits import Limits
from phexfab.fabrication.panels import PanelSpec, largest_gaps
from phexfab.mesh.measures import corner_angles
from phexfab.parallel.offset import admissible_interval
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]

ROOMLESS = ("depth", "gap", "bars")
"""What parts cannot be made without: edges that last, panels wider than their gaps, long bars."""


MOST = 10.0
"""What counts for a miss without a measure."""


def rim_lacks(
    shell: Shell,
    limits: Limits,
    panel: PanelSpec,
    beam: BeamSpec | None,
    depth: tuple[float, float],
    rim_distance: float | None = None,
) -> dict[str, float]:
    """Return by how much a cut shell misses each limit that its cut decides on.

    Parameters
    ----------
    shell : Shell
    limits : Limits
    panel : PanelSpec
    beam : BeamSpec or None
        None where no bars are made.
    depth : (below, above), mm
        Of the structure: no edge may vanish in it.
    rim_distance : float, mm, optional
        Between the rims and the shell's border.

    Returns
    -------
    dict of str to float
        Only what is missed, with the logarithm of limit over value, above 0: the checks
        ``shortest_edge``, ``rim_beam_angle``, ``rim_corner``, ``rim_mitre``, ``rim_distance`` and
        ``offset_interval``, and those of ``ROOMLESS``: edges vanish within the depth, panels are
        too small for the gap, or bars too short for their ends.

    Examples
    --------
    >>> import numpy as np
    >>> import phexfab as px
    >>> from phexfab.fabrication.rim_fit import rim_lacks
    >>> film = px.minimal_surface("enneper").scaled(5000.0)  # mm
    >>> whole = px.minimal_shell(film, px.lattice_on(film, panel_size=500.0))
    >>> z = film.parameter(0.4 * np.exp(2j * np.pi * np.arange(400) / 400))
    >>> made = px.cut_shell(whole, [px.Border(film.point(z), film.normal(z), [])])
    >>> lacks = rim_lacks(
    ...     made.shell,
    ...     px.Limits(rim_distance=1.0),
    ...     px.PanelSpec(),
    ...     None,
    ...     (0.0, 8.0),
    ...     made.report.rim_distance,
    ... )
    >>> "rim_distance" in lacks, "gap" in lacks
    (True, False)
    """
    at_rim = shell.rim_vertices
    found: dict[str, float] = {}

    def least(name: str, value: float, wanted: float) -> None:
        if not value >= wanted:
            found[name] = _ratio(wanted, value)

    def most(name: str, value: float, allowed: float) -> None:
        if not value <= allowed:
            found[name] = _ratio(value, allowed)

    touching = at_rim[shell.edges[:, :2]].any(axis=1)
    if touching.any():
        corners = corner_angles(shell.mesh, shell.normals[shell.panels])
        angles = beam_angles(shell)[at_rim]
        least("shortest_edge", edge_lengths(shell)[touching].min(), limits.shortest_edge)
        least("rim_beam_angle", angles.min(), limits.rim_beam_angle)
        least("rim_corner", corners[at_rim[shell.mesh.corners]].min(), limits.rim_corner)
    if rim_distance is not None:
        most("rim_distance", rim_distance, limits.rim_distance)
    low, high = admissible_interval(shell)
    share = max(depth[0] / -low, depth[1] / high)
    if share >= 1.0:
        found["depth"] = _ratio(share, 1.0)
    most("offset_interval", share, limits.offset_interval)
    try:
        gap = float(largest_gaps(shell, panel).min())
        bars = None if beam is None or not len(shell.edges) else lay_bars(shell, beam, panel)
    except PartError:  # an edge that no part can end at
        return found | dict.fromkeys(ROOMLESS, MOST)
    if gap <= panel.gap:
        found["gap"] = _ratio(panel.gap, gap)
    if bars is not None and beam is not None:
        rest, top = spare_lengths(bars)
        if not rest.min() > 0.0:
            worst = int(rest.argmin())
            found["bars"] = _ratio(top[worst] - rest[worst], top[worst])
        if touching.any() and beam.ends == "mitred":
            ends = at_rim[shell.edges[:, :2]]
            turns = np.degrees(np.stack([bars.ends.left[ends], bars.ends.right[ends]]))
            most("rim_mitre", float(np.abs(90.0 - turns / 2.0).max()), limits.rim_mitre)
    return found


def lack_cost(lacks: Mapping[str, float]) -> tuple[int, int, float]:
    """Return what cuts are ranked by: room that is missing, limits missed, and how far.

    Examples
    --------
    >>> from phexfab.fabrication.rim_fit import lack_cost
    >>> lack_cost({}) < lack_cost({"rim_corner": 0.3, "rim_mitre": 0.01}) < lack_cost({"gap": 0.1})
    True
    """
    roomless = sum(name in ROOMLESS for name in lacks)
    return roomless, len(lacks) - roomless, sum(lacks.values())


def _ratio(large: float, small: float) -> float:
    """Return the logarithm of a ratio, bounded: what has no size at all misses most."""
    if not (large > 0.0 and small > 0.0):
        return MOST
    return float(np.clip(np.log(large / small), 1e-9, MOST))

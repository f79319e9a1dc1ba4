"""Checks of the parts that are made: sizes, angles, masses, clearances and overlaps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from phexfab.fabrication.clash import clashes
from phexfab.fabrication.clearance import clearances
from phexfab.fabrication.limits import Limits, Origin, verdict
from phexfab.fabrication.parts import CheckResult, Cylinder, Panel, Parts, Solid, Stock
from phexfab.mesh.measures import corner_angles
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]


def check_parts(
    parts: Parts,
    shell: Shell,
    limits: Limits | None = None,
    *,
    stocks: Mapping[str, Stock] | None = None,
    origin: Origin = "lattice",
) -> list[CheckResult]:
    """Return the checks of all parts, each with the mark of the worst; families not made have none.

    Parameters
    ----------
    parts : Parts
    shell : Shell
        Tells which panels are neighbours.
    limits : Limits, optional
    stocks : mapping of ``"panels"`` and ``"beams"`` to Stock, optional
        The stock sheets that the blanks must fit.
    origin : ``"lattice"``, ``"given"`` or ``"covered"``
        What the panels come from: a lattice on a minimal surface, a mesh that was given, or a
        method that covers a free-form surface. Remedies are for that.

    Raises
    ------
    PartError
        If a solid that has to be intersected is not closed; the message names its mark.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> parts = px.Parts(px.panels(shell, px.PanelSpec(thickness=8)))
    >>> for result in px.check_parts(parts, shell):
    ...     print(result.name, f"{result.value:.3g} {result.unit}", result.ok)
    panel_mass 16.5 kg True
    sharpest_corner 54.2 deg True
    panel_clearance 2.01 mm True
    interpenetration 0 1 True
    """
    limits, stocks = limits or Limits(), stocks or {}
    judge = partial(verdict, origin=origin)
    results = []
    panels, beams = parts.panels, parts.beams
    if panels:
        marks = [panel.mark for panel in panels]
        if "panels" in stocks:
            over = sheet_overhangs([panel.flat.blank for panel in panels], stocks["panels"])
            results.append(judge("panel_fits_sheet", limits, over, marks))
        mass = np.array([panel.mass for panel in panels])
        results.append(judge("panel_mass", limits, mass, marks))
        corners, starts = contour_corners([panel.flat.outline for panel in panels])
        at_rim = rim_corners(panels, shell)
        for name, kept in (("sharpest_corner", ~at_rim), ("rim_corner", at_rim)):
            if kept.any():
                sharpest = np.minimum.reduceat(np.where(kept, corners, 360.0), starts)
                results.append(judge(name, limits, sharpest, marks))
        pairs = neighbour_pairs(panels, shell)
        if len(pairs):
            gaps = clearances([panel.solid for panel in panels], pairs)
            names = [f"{marks[i]}, {marks[j]}" for i, j in pairs.tolist()]
            results.append(judge("panel_clearance", limits, gaps, names))
    if beams:
        marks = [beam.mark for beam in beams]
        mitres = np.abs([beam.mitres for beam in beams]).max(axis=2)
        ends = shell.rim_vertices[shell.edges[[beam.edge for beam in beams], :2]]
        for name, kept in (("mitre_angle", ~ends), ("rim_mitre", ends)):
            if kept.any():
                worst = np.where(kept, mitres, 0.0).max(axis=1)
                results.append(judge(name, limits, worst, marks))
        if "beams" in stocks:
            over = sheet_overhangs([beam.flat.blank for beam in beams], stocks["beams"])
            results.append(judge("beam_fits_sheet", limits, over, marks))
    if panels or beams or parts.nodes:
        results.append(_interpenetration(parts, limits))
    return results


def neighbour_pairs(panels: Sequence[Panel], shell: Shell) -> IntArray:
    """Return (n, 2) indices into ``panels`` of those that share an edge of the shell."""
    index = np.full(shell.mesh.n_faces, -1)
    index[[panel.face for panel in panels]] = np.arange(len(panels))
    left, right = shell.edges[:, 2:].T
    inner = right >= 0
    pairs = np.column_stack([index[left[inner]], index[right[inner]]])
    # Two panels that share several edges are one pair.
    return np.unique(pairs[(pairs >= 0).all(axis=1)], axis=0)


def rim_corners(panels: Sequence[Panel], shell: Shell) -> NDArray[np.bool_]:
    """Return True for every corner of the panels' outlines, in order, that a rim plane cuts."""
    mesh, found = shell.mesh, []
    for panel in panels:
        corners = mesh.corners[mesh.starts[panel.face] : mesh.starts[panel.face + 1]]
        here, sides = shell.rim_vertices[corners], len(panel.flat.outline)
        # An outline with other corners than its face has been changed by hand.
        found.append(here if len(here) == sides else np.zeros(sides, bool))
    return np.concatenate(found)


def contour_corners(outlines: Sequence[FloatArray]) -> tuple[FloatArray, IntArray]:
    """Return the interior angles in degrees of counter-clockwise contours, and where each starts.

    All angles stand in one array, in order.
    """
    sides = np.array([len(outline) for outline in outlines])
    flat = np.concatenate(list(outlines))
    starts = np.concatenate([[0], np.cumsum(sides)])
    mesh = PolyMesh(np.column_stack([flat, np.zeros(len(flat))]), np.arange(len(flat)), starts)
    up = np.broadcast_to([0.0, 0.0, 1.0], (len(sides), 3))
    return corner_angles(mesh, up), starts[:-1]


def sheet_overhangs(blanks: Sequence[FloatArray], stock: Stock) -> FloatArray:
    """Return by how many mm each blank exceeds the stock inside its margins; below 0 it fits.

    A blank is turned along every line between two of its corners, among which are the sides of its
    smallest rectangle, and in steps of a degree, so that a long blank may lie askew; the turn with
    the least excess counts.
    """
    room = np.sort([stock.length - 2 * stock.margin, stock.width - 2 * stock.margin])
    sides = np.array([len(blank) for blank in blanks])
    least = np.empty(len(blanks))
    steps = np.radians(np.arange(180.0))
    for n in np.unique(sides):
        rows = np.flatnonzero(sides == n)
        i, j = np.triu_indices(n, 1)
        for part in np.array_split(rows, 1 + len(rows) * n * (len(i) + 180) // 2_000_000):
            points = np.stack([blanks[k] for k in part.tolist()])
            chord = points[:, j] - points[:, i]
            turn = np.arctan2(chord[..., 1], chord[..., 0])
            turn = np.concatenate([turn, np.broadcast_to(steps, (len(part), 180))], axis=1)
            along = np.stack([np.cos(turn), np.sin(turn)], axis=2)
            across = np.stack([-along[..., 1], along[..., 0]], axis=2)
            columns = points.transpose(0, 2, 1)
            extents = np.sort([np.ptp(axis @ columns, axis=2) for axis in (along, across)], axis=0)
            over = np.maximum(extents[0] - room[0], extents[1] - room[1])
            least[part] = over.min(axis=1)
    return least


def _interpenetration(parts: Parts, limits: Limits) -> CheckResult:
    made: list[tuple[str, Solid | Cylinder]] = [(p.mark, p.solid) for p in parts.panels]
    made += [(beam.mark, beam.solid) for beam in parts.beams]
    made += [(node.mark, node.cylinder) for node in parts.nodes]
    marks, solids = zip(*made, strict=True)
    found = clashes(solids, marks)
    if not found:
        return verdict("interpenetration", limits, np.zeros(1), [""])
    worst = max(found, key=lambda clash: clash.relative)
    place = ", ".join(f"{x:.0f}" for x in worst.place)
    detail = (
        f"{worst.mark_a} and {worst.mark_b} overlap by {worst.volume:.3g} mm³ at ({place}), "
        f"{len(found)} pairs in all"
    )
    pair = f"{worst.mark_a}, {worst.mark_b}"
    return verdict("interpenetration", limits, np.array([worst.relative]), [pair], detail)

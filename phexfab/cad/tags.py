"""Names of the faces of parts, and frames on panels, beams and nodes; no kernel is needed.

Everywhere here *top* is the side away from the beams and *bottom* the side on them, whichever way
the normals point: panels stand with their bottoms on the tops of beams.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phexfab.cad.tree import Part
from phexfab.errors import PartError
from phexfab.fabrication.beams import beams_at_nodes
from phexfab.fabrication.drawn import draw_faces
from phexfab.fabrication.frames import edge_frames
from phexfab.fabrication.marks import node_marks
from phexfab.fabrication.parts import Node, Panel, Parts
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]
Tags = tuple[tuple[str, ...], ...]

SQUARE = 1e-9
"""Degrees of bevel below which an edge is cut square."""


def plain_tag(name: str) -> str:
    """Return a tag as it is kept: ``mitre-1`` and ``mitre_1`` are the same."""
    return name.replace("-", "_")


def beams_below(parts: Parts) -> bool:
    """Return whether beams stand against the normals, below the panels; True without beams."""
    panels = {panel.mark: panel for panel in parts.panels}
    for beam in parts.beams:
        for panel in (panels[mark] for mark in beam.neighbours if mark in panels):
            lower, upper = np.split(panel.solid.vertices, 2)
            normal = upper.mean(axis=0) - lower.mean(axis=0)
            away = beam.solid.vertices.mean(axis=0) - panel.solid.vertices.mean(axis=0)
            return bool(away @ normal < 0.0)
    return True


def face_tags(part: Part, below: bool = True) -> Tags:
    """Return the tags of every face of a part, in the order of its solid's faces.

    Parameters
    ----------
    part : Panel, Beam or Node
        Faces of a hub are its side, its top and its bottom.
    below : bool
        Whether beams stand below the panels, see ``beams_below``.

    Returns
    -------
    tuple of tuple of str
        ``top``, ``bottom``. Panels: ``side_k`` along edge k of the flat pattern, from 1; the same
        face is ``mitre_k`` where it is bevelled and ``to_P002`` where it faces that panel. Beams:
        ``left`` and ``right`` seen from the tips of the normals from their first node to their
        second; ``end_1``, ``to_N001`` and so on at the nodes; ``mitre_1 mitre_2`` left and right
        at the first node, ``mitre_3 mitre_4`` at the second, both on one face of an end that is
        one plane. Nodes: ``side``. Letters, digits and ``_`` only, as in CadQuery's queries of
        assemblies; ``-`` may stand for ``_`` everywhere else.
    """
    if isinstance(part, Node):
        return (("side",), ("top",), ("bottom",))
    caps: Tags = (("bottom",), ("top",)) if below else (("top",), ("bottom",))
    if isinstance(part, Panel):
        sides: list[tuple[str, ...]] = []
        for k, edge in enumerate(part.flat.edges, 1):
            mitre = (f"mitre_{k}",) if abs(edge.bevel) > SQUARE else ()
            facing = (f"to_{edge.neighbour}",) if edge.neighbour else ()
            sides.append((f"side_{k}", *mitre, *facing))
        return (*caps, *sides)
    corners = part.solid.vertices[: len(part.solid.vertices) // 2]
    run = np.roll(corners, -1, axis=0) - corners
    run /= np.linalg.norm(run, axis=1, keepdims=True)
    # Corners run i left, (i axis,) i right, j right, (j axis,) j left: the last side is the left
    # one, and the one that runs against it the right one.
    right = 1 + int(np.argmin(run[1:-1] @ run[-1]))
    first = _end(1, part.nodes[0], ("mitre_1", "mitre_2"), right)
    second = _end(2, part.nodes[1], ("mitre_4", "mitre_3"), len(run) - 2 - right)
    return (*caps, *first, ("right",), *second, ("left",))


def _end(number: int, node: str, mitres: tuple[str, str], count: int) -> list[tuple[str, ...]]:
    common = (f"end_{number}", *((f"to_{node}",) if node else ()))
    if count == 1:
        return [(*common, *mitres)]
    return [(*common, mitre) for mitre in mitres]


@dataclass(frozen=True, eq=False)
class Frame:
    """A right-handed frame on a part: mark, origin (3,) in mm, unit directions x and z (3,)."""

    mark: str
    origin: FloatArray
    x: FloatArray
    z: FloatArray


def frames(source: Any, names: Sequence[str] | str = "nodes") -> list[Frame]:
    """Return frames on panels, beams or nodes of a build, in the order of the parts list.

    Parameters
    ----------
    source : a build: anything with ``parts`` and ``shell``
    names : str or sequence of str
        ``panels``, ``beams``, ``nodes``, marks, or several of these. All vertices of the shell are
        nodes, whether a hub stands there or not.

    Returns
    -------
    list of Frame
        z points away from the beams, out of the tops of panels and beams and along the node axis.
        A panel's origin is on its top above the centroid of the shell's face, x along its longest
        direction, as in its flat pattern. A beam's is on its top, halfway between the nodes, x
        from its first node to its second. A node's is the vertex of the shell, x along the first
        of its beams as seen along the axis.

    Raises
    ------
    PartError
        If a name is neither a family nor a mark, or the source has no shell.
    """
    parts, shell = getattr(source, "parts", None), getattr(source, "shell", None)
    if not isinstance(parts, Parts) or not isinstance(shell, Shell):
        raise PartError(f"{type(source).__name__} has no shell and parts; give a build")
    wanted = (names,) if isinstance(names, str) else tuple(names)
    made = {"panels": _on_panels, "beams": _on_beams, "nodes": _on_nodes}
    letters = {"P": "panels", "B": "beams", "N": "nodes"}
    needed = {letters.get(name[:1], name) if name not in made else name for name in wanted}
    by_family = {family: make(shell, parts) for family, make in made.items() if family in needed}
    by_mark = {frame.mark: frame for own in by_family.values() for frame in own}
    chosen: dict[str, Frame] = {}
    for name in wanted:
        if name not in by_family and name not in by_mark:
            raise PartError(
                f"there is no {name!r} to place things on; name panels, beams, nodes, or a mark"
            )
        own = by_family.get(name) or [by_mark[name]]
        chosen |= {frame.mark: frame for frame in own}
    return list(chosen.values())


def _cap(vertices: FloatArray, below: bool) -> FloatArray:
    """Return the corners of a prism-like solid's top."""
    lower, upper = np.split(vertices, 2)
    return upper if below else lower


def _on_panels(shell: Shell, parts: Parts) -> list[Frame]:
    drawn, below = draw_faces(shell), beams_below(parts)
    found = []
    for panel in parts.panels:
        origin, normal = drawn.origin[panel.face], drawn.normal[panel.face]
        level = (_cap(panel.solid.vertices, below).mean(axis=0) - origin) @ normal
        z = normal if below else -normal
        found.append(Frame(panel.mark, origin + level * normal, drawn.x[panel.face], z))
    return found


def _on_beams(shell: Shell, parts: Parts) -> list[Frame]:
    below = beams_below(parts)
    tips = shell.edges[[beam.edge for beam in parts.beams], :2]
    across = edge_frames(shell, tips[:, 0], tips[:, 1])
    middle = shell.mesh.vertices[tips].mean(axis=1)
    found = []
    for beam, centre, x, up in zip(parts.beams, middle, across.along, across.up, strict=True):
        level = (_cap(beam.solid.vertices, below).mean(axis=0) - centre) @ up
        found.append(Frame(beam.mark, centre + level * up, x, up if below else -up))
    return found


def _on_nodes(shell: Shell, parts: Parts) -> list[Frame]:
    points, axes = shell.mesh.vertices, shell.gauss.vertices
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    if not beams_below(parts):
        axes = -axes
    found = []
    for v, (mark, around) in enumerate(zip(node_marks(shell), beams_at_nodes(shell), strict=True)):
        i, j = shell.edges[around[0], :2]
        x = points[j if i == v else i] - points[v]
        x = x - (x @ axes[v]) * axes[v]
        found.append(Frame(mark, points[v], x / np.linalg.norm(x), axes[v]))
    return found

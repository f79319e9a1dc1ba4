"""Nodes: nothing, or a cylindrical hub on the node axis."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import DesignError, PartError
from phexfab.fabrication.bars import BeamSpec, down
from phexfab.fabrication.beams import Bars, beams_at_nodes, lay_bars
from phexfab.fabrication.marks import beam_marks, node_marks
from phexfab.fabrication.panels import PanelSpec
from phexfab.fabrication.parts import Cylinder, Material, Node
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]

KINDS = ("none", "hub")


@dataclass(frozen=True)
class NodeSpec:
    """What stands at the nodes.

    Attributes
    ----------
    kind : {"none", "hub"}
    radius : float, mm
        Of the hub; the bars must be cut back from it (``BeamSpec.ends="hub"``).
    material : Material

    Raises
    ------
    DesignError
        If a size or a name is impossible; the message names it.

    Examples
    --------
    >>> import phexfab as px
    >>> px.NodeSpec("hub", radius=30.0).material.name
    'steel'
    >>> px.NodeSpec("ball")
    Traceback (most recent call last):
        ...
    phexfab.errors.DesignError: node kind is 'ball'; choose one of none, hub
    """

    kind: str = "none"
    radius: float = 30.0
    material: Material = Material("steel", 7850.0)  # noqa: RUF009 - a frozen value

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise DesignError(f"node kind is {self.kind!r}; choose one of {', '.join(KINDS)}")
        if not (math.isfinite(self.radius) and self.radius > 0.0):
            raise DesignError(f"node radius is {self.radius:g} mm; give a radius above 0 mm")


def nodes(shell: Shell, spec: NodeSpec, beam: BeamSpec, panel: PanelSpec) -> tuple[Node, ...]:
    """Return a hub for every vertex of the shell's mesh, or nothing where no hubs are asked for.

    Parameters
    ----------
    shell : Shell
    spec : NodeSpec
    beam : BeamSpec
        The bars that meet at the hubs.
    panel : PanelSpec
        The panels above them.

    Returns
    -------
    tuple of Node
        The cylinder's base is its end away from the panels and its axis points to them. It reaches
        from the deepest bottom corner of its bars up to the point of the axis where the bars' tops
        meet, or lower where its rim would come closer to a panel's underside than the seat.

    Raises
    ------
    DesignError
        If the bars are not cut back far enough for the hub.
    PartError
        If the hubs of neighbouring nodes touch, or one has no length; the message names them.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> bar = px.BeamSpec(ends="hub", hub_radius=30)
    >>> hubs = px.nodes(shell, px.NodeSpec("hub", radius=30), bar, px.PanelSpec())
    >>> len(hubs), hubs[0].mark
    (75, 'N001')
    >>> px.nodes(shell, px.NodeSpec(), px.BeamSpec(), px.PanelSpec())  # mitred bars: no hubs
    ()
    """
    if spec.kind == "none" or len(shell.edges) == 0:
        return ()
    if beam.ends != "hub" or beam.hub_radius < spec.radius:
        raise DesignError(
            f"hubs of radius {spec.radius:g} mm need beams with ends = hub and a hub radius of at "
            f"least that; the beams have ends = {beam.ends}, hub radius {beam.hub_radius:g} mm"
        )
    bars = lay_bars(shell, beam, panel)
    axis, high, low = _extents(shell, spec, beam, panel, bars)
    names = node_marks(shell)
    length = high - low
    if np.any(length <= 0.0):
        worst = int(np.argmin(length))
        raise PartError(
            f"hub {names[worst]} has no length left below the panels; make it thinner than "
            f"{2.0 * spec.radius:g} mm or the beams higher than {beam.height:g} mm"
        )
    base = shell.mesh.vertices + low[:, None] * axis
    _refuse_touching(shell, spec, names, base, base + length[:, None] * axis)

    marks = beam_marks(shell)
    area = math.pi * spec.radius**2
    made = []
    for v, (name, around) in enumerate(zip(names, beams_at_nodes(shell), strict=True)):
        size = float(area * length[v])
        made.append(
            Node(
                mark=name,
                vertex=v,
                cylinder=Cylinder(base[v], axis[v], spec.radius, float(length[v])),
                material=spec.material,
                neighbours=tuple(marks[e] for e in around),
                volume=size,
                mass=size * spec.material.density * 1e-9,
            )
        )
    return tuple(made)


def _extents(
    shell: Shell, spec: NodeSpec, beam: BeamSpec, panel: PanelSpec, bars: Bars
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the axes towards the panels, and how far hubs reach along them from M: top, bottom."""
    side = down(panel)
    mesh, s = shell.mesh, shell.gauss.vertices
    axis = -side * s / np.linalg.norm(s, axis=1, keepdims=True)

    # A rim of radius r about the axis, t along it, stays below n·x = -τ when
    # t·cos α + r·sin α <= -τ, α the angle between axis and n.
    under = panel.levels[0] if side < 0.0 else -panel.levels[1]
    vertex = mesh.corners
    normal = -side * shell.normals[shell.panels][mesh.face_of_corner]
    cosine = np.einsum("ij,ij->i", normal, axis[vertex])
    sine = np.linalg.norm(np.cross(normal, axis[vertex]), axis=1)
    rim = (under - beam.seat - spec.radius * sine) / cosine
    high = np.full(len(s), np.inf)
    np.minimum.at(high, vertex, rim)

    tips = shell.edges[:, :2].ravel()
    tops = np.einsum("ni,ni->n", bars.top.reshape(-1, 3) - mesh.vertices[tips], axis[tips])
    np.minimum.at(high, tips, tops)
    # A bar's end runs into the bar at right angles to its node plane: both bottom corners are
    # equally deep.
    inward = bars.frames.along[:, None] * np.array([1.0, -1.0])[:, None]
    corner = bars.top + bars.fall + bars.ends.cut_left[..., None] * inward
    bottoms = np.einsum("ni,ni->n", corner.reshape(-1, 3) - mesh.vertices[tips], axis[tips])
    low = np.full(len(s), np.inf)
    np.minimum.at(low, tips, bottoms)
    return axis, high, low


def _refuse_touching(
    shell: Shell, spec: NodeSpec, names: tuple[str, ...], base: FloatArray, top: FloatArray
) -> None:
    """Raise PartError where the axes of neighbouring hubs come within two radii.

    A cylinder lies within its radius of its axis, so hubs whose axes keep two radii apart are
    clear of each other.
    """
    i, j = shell.edges[:, 0], shell.edges[:, 1]
    between = _segment_distance(base[i], top[i], base[j], top[j])
    worst = int(np.argmin(between))
    if between[worst] <= 2.0 * spec.radius:
        raise PartError(
            f"hubs {names[i[worst]]} and {names[j[worst]]} touch: their axes come within "
            f"{between[worst]:.1f} mm; make their radius {spec.radius:g} mm smaller than "
            f"{between[worst] / 2.0:.1f} mm or the panels larger"
        )


def _segment_distance(a: FloatArray, b: FloatArray, c: FloatArray, d: FloatArray) -> FloatArray:
    """Return the (n,) distances between coplanar segments ab and cd."""

    def to_segment(p: FloatArray, q: FloatArray, r: FloatArray) -> FloatArray:
        along = r - q
        t = np.einsum("ij,ij->i", p - q, along) / np.einsum("ij,ij->i", along, along)
        nearest = q + np.clip(t, 0.0, 1.0)[:, None] * along
        return np.asarray(np.linalg.norm(p - nearest, axis=1))

    ends = [to_segment(a, c, d), to_segment(b, c, d), to_segment(c, a, b), to_segment(d, a, b)]
    normal = np.cross(b - a, c - a) + np.cross(b - a, d - a) + np.cross(d - c, a - c)

    def turn(p: FloatArray, q: FloatArray, r: FloatArray) -> FloatArray:
        return np.asarray(np.einsum("ij,ij->i", np.cross(q - p, r - p), normal))

    crossing = (turn(a, b, c) * turn(a, b, d) < 0.0) & (turn(c, d, a) * turn(c, d, b) < 0.0)
    return np.where(crossing, 0.0, np.minimum.reduce(ends))

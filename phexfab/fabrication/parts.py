"""The parts of a shell as plain values: solids, panels, beams, nodes and their flat patterns.

Lengths are in mm, angles in degrees, masses in kg, densities in kg/m³. No value here holds a CAD
object; ``phexfab.cad`` turns them into one.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

FAMILY_COLOURS: dict[str, tuple[float, float, float]] = {
    "panels": (0.88, 0.83, 0.71),
    "beams": (0.36, 0.43, 0.50),
    "nodes": (0.78, 0.40, 0.20),
}
"""Red, green, blue in 0…1 of each family, in every model and picture."""


@dataclass(frozen=True)
class Material:
    """What a family of parts is made of.

    Attributes
    ----------
    name : str
        For the parts list and the sheets.
    density : float, kg/m³

    Examples
    --------
    >>> import phexfab as px
    >>> px.PanelSpec(thickness=10, material=px.Material("glass", 2500.0)).material.density
    2500.0
    """

    name: str
    density: float


@dataclass(frozen=True, eq=False)
class Solid:
    """A closed polyhedron with planar faces.

    Attributes
    ----------
    vertices : (n, 3) array, mm
    faces : tuple of index tuples
        Each face counter-clockwise seen from outside; faces may be non-convex but are simple.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> solid = px.panels(shell, px.PanelSpec())[0].solid
    >>> len(solid.vertices), len(solid.faces)  # a plate of six sides
    (12, 8)
    """

    vertices: FloatArray
    faces: tuple[tuple[int, ...], ...]


@dataclass(frozen=True, eq=False)
class Cylinder:
    """A solid right circular cylinder: centre of its base, unit axis, radius and length in mm."""

    base: FloatArray
    axis: FloatArray
    radius: float
    length: float


@dataclass(frozen=True)
class EdgeNote:
    """What the shop must know about one edge of a flat pattern.

    Attributes
    ----------
    neighbour : str
        Mark of the part beyond that edge, or "" on the border.
    bevel : float
        Degrees between the edge's face and a square cut; positive where the part is larger on
        the side away from the drawing. 0 is square.
    far_bevel : float, optional
        Where the edge is cut to a ridge in the middle of the thickness (a mitred bar's end):
        the bevel of the face on the far side, in the same sense seen from there.
    """

    neighbour: str
    bevel: float
    far_bevel: float | None = None


@dataclass(frozen=True, eq=False)
class FlatPart:
    """The flat pattern of a part that is cut from sheet.

    Attributes
    ----------
    mark : str
    outline : (n, 2) array, mm
        The contour to cut, counter-clockwise, usually non-convex.
    blank : (m, 2) array, mm
        Counter-clockwise contour of all material that the part needs, bevels included; equal to
        ``outline`` for square edges. Nesting keeps blanks apart, the drawing shows the outline.
    edges : tuple of EdgeNote
        One per outline edge, edge ``i`` from corner ``i`` to ``i + 1``.
    thickness : float, mm
    material : Material

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> flat = px.panels(shell, px.PanelSpec())[0].flat
    >>> flat.mark, len(flat.outline), flat.thickness
    ('P001', 6, 8.0)
    """

    mark: str
    outline: FloatArray
    blank: FloatArray
    edges: tuple[EdgeNote, ...]
    thickness: float
    material: Material


@dataclass(frozen=True, eq=False)
class Panel:
    """A planar panel.

    Attributes
    ----------
    mark : str
        Part mark, such as ``P017``.
    face : int
        Face of the shell's mesh (``shell.mesh``) that it covers.
    solid : Solid
    flat : FlatPart
    area : float
        Of the cut contour, mm².
    volume : float
        Exact, mm³.
    mass : float
        kg.
    """

    mark: str
    face: int
    solid: Solid
    flat: FlatPart
    area: float
    volume: float
    mass: float

    def __repr__(self) -> str:
        made = f"{self.flat.thickness:g} mm {self.flat.material.name}"
        return f"<Panel {self.mark}: {made}, {self.area / 1e6:.3g} m², {self.mass:.3g} kg>"


@dataclass(frozen=True, eq=False)
class Beam:
    """A flat bar standing on one edge of the shell.

    Attributes
    ----------
    mark : str
        Part mark, such as ``B017``.
    edge : int
        Row of ``shell.edges``.
    nodes : (str, str)
        Node marks at its two ends (also where no hub is made).
    neighbours : tuple of str
        Marks of the panels it carries and of the beams that meet its ends.
    solid : Solid
    flat : FlatPart
        Lying on its side: outline is the silhouette seen along its width.
    length : float
        Between the two node axes along the top, mm.
    mitres : ((float, float), (float, float))
        At each end, degrees of the two end faces (left and right of the mid-plane) against a cut
        square to the mid-plane; 0 is square.
    slopes : (float, float)
        At each end, degrees between the node axis and the normal of the top, in the mid-plane.
    volume, mass : float
        mm³, kg.
    """

    mark: str
    edge: int
    nodes: tuple[str, str]
    neighbours: tuple[str, ...]
    solid: Solid
    flat: FlatPart
    length: float
    mitres: tuple[tuple[float, float], tuple[float, float]]
    slopes: tuple[float, float]
    volume: float
    mass: float

    def __repr__(self) -> str:
        ends = "–".join(filter(None, self.nodes)) or "free"
        return f"<Beam {self.mark}: {ends}, {self.length:.1f} mm, {self.mass:.3g} kg>"


@dataclass(frozen=True, eq=False)
class Node:
    """A hub on a node axis: mark, vertex of the shell's mesh, its cylinder and what meets there."""

    mark: str
    vertex: int
    cylinder: Cylinder
    material: Material
    neighbours: tuple[str, ...]
    volume: float
    mass: float

    def __repr__(self) -> str:
        size = f"⌀ {2 * self.cylinder.radius:g} × {self.cylinder.length:g} mm"
        return f"<Node {self.mark}: {size}, {self.mass:.3g} kg>"


@dataclass(frozen=True, eq=False)
class Parts:
    """Everything that is made for one shell, in the order of the parts list.

    Attributes
    ----------
    panels : tuple of Panel
    beams : tuple of Beam
    nodes : tuple of Node
        Empty where bars are mitred and no hubs are asked for.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> parts = px.Parts(px.panels(shell, px.PanelSpec()))
    >>> len(parts.panels), len(parts.beams), len(parts.nodes)
    (27, 0, 0)
    """

    panels: tuple[Panel, ...]
    beams: tuple[Beam, ...] = ()
    nodes: tuple[Node, ...] = ()

    def __repr__(self) -> str:
        counts = f"{len(self.panels)} panels, {len(self.beams)} beams, {len(self.nodes)} nodes"
        return f"<Parts: {counts}>"


@dataclass(frozen=True)
class Stock:
    """A stock sheet.

    Attributes
    ----------
    length, width : float, mm
    margin : float, mm
        Kept free along its border.
    spacing : float, mm
        Kept between parts, the kerf included.

    Examples
    --------
    >>> import phexfab as px
    >>> px.Stock(3000, 1500, margin=15)
    Stock(length=3000, width=1500, margin=15, spacing=8.0)
    """

    length: float
    width: float
    margin: float = 10.0
    spacing: float = 8.0


@dataclass(frozen=True)
class Placement:
    """Where a flat part lies on its sheet: rotate by ``angle`` degrees, then move by (x, y) mm."""

    mark: str
    angle: float
    x: float
    y: float


@dataclass(frozen=True)
class Sheet:
    """One stock sheet with the parts nested on it; the origin is its lower left corner."""

    name: str
    stock: Stock
    thickness: float
    material: Material
    placements: tuple[Placement, ...] = field(default=())


@dataclass(frozen=True)
class CheckResult:
    """One fabrication or geometry check.

    Attributes
    ----------
    name : str
        Such as ``planarity``.
    value, limit : float
    unit : str
        ``"1"`` for ratios, else ``mm``, ``deg``, ``kg``.
    sense : str
        ``"<="`` when the value may not exceed the limit, ``">="`` when it may not fall below.
    worst : str
        Mark of the worst part, or "" where there is none.
    note : str
        What was measured, in a few words, and what to change when it fails.

    Examples
    --------
    >>> import phexfab as px
    >>> px.CheckResult("shortest_edge", 17.5, 20.0, "mm", ">=", worst="B014").ok
    False
    """

    name: str
    value: float
    limit: float
    unit: str
    sense: str = "<="
    worst: str = ""
    note: str = ""

    @property
    def ok(self) -> bool:
        """True when the value keeps its limit; a value that is not a number fails."""
        value, limit = float(self.value), float(self.limit)
        return bool(value <= limit if self.sense == "<=" else value >= limit)

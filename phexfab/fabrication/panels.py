"""Panels: the faces of M, set back for the joint and given a thickness.

Both kinds of edge are insets of the face polygon, edge by edge. A square edge moves in by half the
gap. A mitred edge is cut by the node plane moved in by half the gap; at height z above the face
the cut is ``(gap/2 − z·sin β)/cos β`` in from the edge, β the angle between the face normal and
the node plane. Insets keep edge directions, so every side of a panel is planar by construction.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import shapely
from numpy.typing import NDArray

from phexfab.errors import DesignError, PartError
from phexfab.fabrication.drawn import DrawnFaces, area_and_centroid, draw_faces
from phexfab.fabrication.inset import corner_shifts, inset_limits
from phexfab.fabrication.marks import panel_marks
from phexfab.fabrication.parts import EdgeNote, FlatPart, Material, Panel, Solid
from phexfab.fabrication.polyhedra import prism_faces, volumes
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]

SIDES = ("outside", "inside", "centre")
EDGES = ("square", "mitred")


@dataclass(frozen=True)
class PanelSpec:
    """How panels are made.

    Attributes
    ----------
    thickness : float, mm
    gap : float, mm
        Width of the joint between neighbours: square edges stand ``gap/2`` inside the face's edges,
        measured in the face; mitred edges of neighbours are parallel planes ``gap`` apart.
    side : {"outside", "inside", "centre"}
        Where the thickness lies, seen from the faces of M: outside is along the normals.
    edges : {"square", "mitred"}
        Cut square to the panel (laser, waterjet), or along the node planes.
    material : Material

    Raises
    ------
    DesignError
        If a size or a name is impossible; the message names it.

    Examples
    --------
    >>> import phexfab as px
    >>> px.PanelSpec(thickness=8, gap=6, edges="mitred").side
    'outside'
    >>> px.PanelSpec(thickness=-8)
    Traceback (most recent call last):
        ...
    phexfab.errors.DesignError: panel thickness is -8 mm; give a thickness above 0 mm
    """

    thickness: float = 8.0
    gap: float = 6.0
    side: str = "outside"
    edges: str = "square"
    material: Material = Material("steel", 7850.0)  # noqa: RUF009 - a frozen value

    def __post_init__(self) -> None:
        if not (math.isfinite(self.thickness) and self.thickness > 0.0):
            raise DesignError(
                f"panel thickness is {self.thickness:g} mm; give a thickness above 0 mm"
            )
        if not (math.isfinite(self.gap) and self.gap >= 0.0):
            raise DesignError(f"panel gap is {self.gap:g} mm; give a gap of 0 mm or more")
        if self.side not in SIDES:
            raise DesignError(f"panel side is {self.side!r}; choose one of {', '.join(SIDES)}")
        if self.edges not in EDGES:
            raise DesignError(f"panel edges is {self.edges!r}; choose one of {', '.join(EDGES)}")

    @property
    def levels(self) -> tuple[float, float]:
        """Heights in mm of the lower and the upper cap above the face of M, along its normal."""
        t = self.thickness
        return {"outside": (0.0, t), "inside": (-t, 0.0), "centre": (-t / 2.0, t / 2.0)}[self.side]


def _setback(faces: DrawnFaces, spec: PanelSpec, level: float, gap: float) -> FloatArray:
    """Return the (C,) distances that edges move in at a height above the face."""
    if spec.edges == "square":
        return np.full(len(faces.points), gap / 2.0)
    distances: FloatArray = (gap / 2.0 - level * faces.sine) / faces.cosine
    return distances


def _contours(
    faces: DrawnFaces, spec: PanelSpec, gap: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the (C, 2) corners of the lower cap, the upper cap and the blank.

    The blank takes the outermost of both caps edge by edge. That is more than their union: where a
    corner's two edges lean opposite ways the slanted sides fill the notch between.
    """
    lower, upper = (_setback(faces, spec, level, gap) for level in spec.levels)
    low, high, blank = (
        faces.points + corner_shifts(faces.directions, distances, faces.mesh)
        for distances in (lower, upper, np.minimum(lower, upper))
    )
    return low, high, blank


def largest_gaps(shell: Shell, spec: PanelSpec) -> FloatArray:
    """Return, for every panel, the gap in mm at which an edge or its waist vanishes.

    Everything but ``spec.gap`` is as specified; 0 where the thickness alone already reverses an
    edge. Gaps below the smallest of these values give simple panels.

    Parameters
    ----------
    shell : Shell
    spec : PanelSpec
    """
    return _gap_limits(draw_faces(shell), spec)


def _gap_limits(faces: DrawnFaces, spec: PanelSpec) -> FloatArray:
    speed = 0.5 / (np.ones(len(faces.points)) if spec.edges == "square" else faces.cosine)
    # Square edges have the same contour at every height.
    contours = _contours(faces, spec, 0.0)[: 1 if spec.edges == "square" else 3]
    limits = [inset_limits(points, faces.directions, speed, faces.mesh) for points in contours]
    smallest: FloatArray = np.min(limits, axis=0)
    return smallest


def panels(shell: Shell, spec: PanelSpec) -> tuple[Panel, ...]:
    """Return the panels of a shell, one for each face of its mesh, in order.

    Parameters
    ----------
    shell : Shell
    spec : PanelSpec

    Returns
    -------
    tuple of Panel
        The flat pattern shows the cap that lies in the face of M (the lower one where the panel is
        centred on it), seen from the tip of the normal, its centroid at 0 and x along its longest
        direction; edge ``k`` is edge ``k`` of the face. A bevel is positive where the other cap
        reaches further out. The solid's corners are the lower cap and then the upper one.

    Raises
    ------
    PartError
        If a gap or thickness leaves no simple polygon; the message names the panel for which least
        is possible, and how much.

    References
    ----------
    Thesis §4.2: the node planes of a mesh with a constant-distance offset.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> glass = px.PanelSpec(thickness=8, gap=6, material=px.Material("glass", 2500.0))
    >>> plates = px.panels(shell, glass)
    >>> print(len(plates), plates[0].mark, f"{plates[0].mass:.2f} kg")
    27 P001 4.55 kg
    >>> px.panels(shell, px.PanelSpec(gap=400))
    Traceback (most recent call last):
        ...
    phexfab.errors.PartError: gap 400 mm is too large for panel P...; at most 187.1 mm. Make the
        gap smaller or the panels larger
    """
    mesh = shell.mesh
    if mesh.n_faces == 0:
        return ()
    names = panel_marks(shell)
    faces = draw_faces(shell)
    _refuse_impossible(faces, spec, names)

    low, high, blank = _contours(faces, spec, spec.gap)
    level_low, level_high = spec.levels
    bottom, top = faces.in_space(low, level_low), faces.in_space(high, level_high)
    inside = spec.side == "inside"
    outline = high if inside else low
    areas, centres = area_and_centroid(outline, mesh)
    outline = outline - centres[mesh.face_of_corner]
    blank = blank - centres[mesh.face_of_corner]

    bevels = np.zeros(len(mesh.corners))
    if spec.edges == "mitred":
        bevels = np.degrees(np.arctan2(faces.sine, faces.cosine)) * (-1.0 if inside else 1.0)
    _, _, _, beyond = shell.rings
    index = np.full(len(shell.normals), -1)
    index[shell.panels] = np.arange(mesh.n_faces)
    marks = np.array([*names, ""], object)[index[beyond]].tolist()
    notes = [EdgeNote(mark, bevel) for mark, bevel in zip(marks, bevels.tolist(), strict=True)]

    bounds = mesh.starts.tolist()
    runs = list(pairwise(bounds))
    solids = [Solid(np.concatenate([bottom[a:b], top[a:b]]), prism_faces(b - a)) for a, b in runs]
    sizes = volumes(solids)
    if np.any(sizes <= 0.0):
        worst = int(np.argmin(sizes))
        raise PartError(f"panel {names[worst]} has no volume; its face of the mesh is degenerate")
    masses = (sizes * (spec.material.density * 1e-9)).tolist()
    made = []
    for f, (a, b) in enumerate(runs):
        flat = FlatPart(
            names[f],
            outline[a:b],
            outline[a:b] if spec.edges == "square" else blank[a:b],
            tuple(notes[a:b]),
            spec.thickness,
            spec.material,
        )
        made.append(
            Panel(names[f], f, solids[f], flat, float(areas[f]), float(sizes[f]), masses[f])
        )
    return tuple(made)


def _refuse_impossible(faces: DrawnFaces, spec: PanelSpec, names: tuple[str, ...]) -> None:
    """Raise PartError unless every contour at the wanted gap is a simple polygon."""
    _refuse_crossed(faces, spec, names, 0.0)
    limits = _gap_limits(faces, spec)
    worst = int(np.argmin(limits))
    if spec.gap >= limits[worst]:
        most = limits[worst]
        places = 1 if most >= 1.0 else 4
        floor = math.floor(most * 10**places) / 10**places
        raise PartError(
            f"gap {spec.gap:g} mm is too large for panel {names[worst]}; at most {floor:g} mm. "
            "Make the gap smaller or the panels larger"
        )
    _refuse_crossed(faces, spec, names, spec.gap)


def _refuse_crossed(faces: DrawnFaces, spec: PanelSpec, names: tuple[str, ...], gap: float) -> None:
    """Raise PartError if a contour at this gap has a reversed edge or crosses itself."""
    mesh = faces.mesh
    for points in _contours(faces, spec, gap)[: 1 if spec.edges == "square" else 3]:
        edge = points[mesh.next_corner] - points
        bad = np.zeros(mesh.n_faces, bool)
        bad[mesh.face_of_corner[np.einsum("ij,ij->i", edge, faces.directions) <= 0.0]] = True
        order = np.append(np.arange(len(points)), mesh.starts[:-1])
        ring = np.append(mesh.face_of_corner, np.arange(mesh.n_faces))
        sort = np.argsort(ring, kind="stable")
        rings = shapely.linearrings(points[order[sort]], indices=ring[sort])
        bad |= ~shapely.is_valid(shapely.polygons(rings))
        if bad.any():
            name = names[int(np.argmax(bad))]
            if spec.edges == "square":
                raise PartError(
                    f"panel {name} at gap {gap:g} mm is no simple polygon; its face of the mesh "
                    "crosses itself: change the lattice"
                )
            raise PartError(
                f"thickness {spec.thickness:g} mm is too large for the mitred panel {name} at gap "
                f"{gap:g} mm: its contour crosses itself. Make it thinner or cut its edges square"
            )

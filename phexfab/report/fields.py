"""What the panels of a shell are coloured by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.curvature import face_fields
from phexfab.parallel.shell import Shell
from phexfab.report.camera import View

FloatArray = NDArray[np.float64]

RAMP = ("#4f86a3", "#86b3bb", "#c6d8c6", "#efe5c4", "#e7bd8f", "#cc7f57")
"""Colours from low to high: lightness rises and falls, so the middle stays the palest."""
NEUTRAL = "#d9d6cf"


@dataclass(frozen=True, eq=False)
class PanelField:
    """One number per panel: name, unit, (P,) values and the finite range they span."""

    name: str
    unit: str
    values: FloatArray

    @property
    def limits(self) -> tuple[float, float]:
        """Smallest and largest finite value; (0, 0) where there is none."""
        finite = self.values[np.isfinite(self.values)]
        return (float(finite.min()), float(finite.max())) if len(finite) else (0.0, 0.0)

    @property
    def varies(self) -> bool:
        """False where the values differ by no more than rounding errors."""
        low, high = self.limits
        return high - low > 1e-9 * max(abs(low), abs(high))

    @property
    def positions(self) -> FloatArray:
        """(P,) place of each value on the colour ramp, 0 to 1; NaN where it is not finite."""
        low, high = self.limits
        if not self.varies:  # such a field is one colour
            return np.where(np.isfinite(self.values), 0.5, np.nan)
        place = (self.values - low) / (high - low)
        return np.where(np.isfinite(self.values), place, np.nan)

    @property
    def colours(self) -> FloatArray:
        """(P, 3) colours, 0 to 1."""
        place = self.positions
        stops = np.array([_rgb(code) for code in RAMP])
        at = np.linspace(0, 1, len(stops))
        mixed = np.column_stack([np.interp(place, at, stops[:, k]) for k in range(3)])
        return np.where(np.isfinite(place)[:, None], mixed, _rgb(NEUTRAL))


def panel_fields(shell: Shell) -> tuple[PanelField, ...]:
    """Return the curvatures of every panel of M, its area and its mean edge."""
    mesh = shell.mesh
    if mesh.n_faces == 0:
        return ()
    tail, head = mesh.vertices[mesh.corners], mesh.vertices[mesh.corners[mesh.next_corner]]
    begin = mesh.starts[:-1]
    edge = np.add.reduceat(np.linalg.norm(head - tail, axis=1), begin) / mesh.sides
    origin = tail[begin][mesh.face_of_corner]
    area = np.add.reduceat(np.cross(tail - origin, head - origin), begin)
    with np.errstate(divide="ignore", invalid="ignore"):
        curvatures = face_fields(shell)
    return (
        *(PanelField(name, unit, values) for name, (values, unit) in curvatures.items()),
        PanelField("Panel area", "m²", np.linalg.norm(area, axis=1) / 2e6),
        PanelField("Mean edge", "mm", edge),
    )


def shell_view(shell: Shell) -> View:
    """Return a three-quarter view of a shell, onto the side its normals point to.

    M and its Gauss image have the same normals, so the same view shows both.
    """
    mean = shell.normals[shell.panels].mean(0) if len(shell.panels) else np.zeros(3)
    standard = View()
    if np.linalg.norm(mean) < 0.25:  # closed around: any side will do
        return standard
    flat = np.hypot(mean[0], mean[1])
    elevation = float(np.clip(np.degrees(np.arctan2(mean[2], flat)), 14, 48))
    if flat < 0.1 * np.linalg.norm(mean):
        return View(standard.azimuth, elevation)
    return View(float(np.degrees(np.arctan2(mean[1], mean[0]))) - 28, elevation)


def gauss_mesh(shell: Shell) -> PolyMesh:
    """Return the faces of S to be drawn, one for each panel.

    A face of S that a rim plane cuts is bounded by nothing but that plane's height, and may reach
    far beyond the sphere; the face of the panel before the cut is drawn for it.
    """
    before = shell.whole
    if before is None:
        return shell.gauss
    faces = np.searchsorted(before.panels, shell.parents[shell.panels])
    gauss = before.gauss
    corners = [gauss.corners[gauss.starts[f] : gauss.starts[f + 1]].tolist() for f in faces]
    return PolyMesh.from_faces(gauss.vertices, corners)


def face_marks(shell: Shell, marks: Sequence[tuple[int, str]]) -> tuple[str, ...]:
    """Return the panel mark of each face of a shell's mesh, ``face 12`` where there is none."""
    names = [f"face {f}" for f in range(shell.mesh.n_faces)]
    for face, mark in marks:
        names[face] = mark
    return tuple(names)


def _rgb(code: str) -> tuple[float, ...]:
    return tuple(int(code[k : k + 2], 16) / 255 for k in (1, 3, 5))

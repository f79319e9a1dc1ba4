"""A fence: planes through the chords of a border that cross the film at about right angles.

Planes of neighbouring chords meet in a line through the station between them, the *ruling*; it is
the node axis there. Two planes that merely contain the film's normal would meet in a line that
leans far over, by the border's geodesic torsion against its small turn. So all planes are turned
about their chords together, one angle each, such that the rulings come as near as possible to the
normals: a chain of planar quads along the border, a discrete developable surface.

References
----------
Pottmann, Liu, Wallner, Bobenko, Wang 2007, "Geometry of multi-layer freeform structures for
architecture", sec. 3 (node axes, planar quads along a polyline); Liu, Pottmann, Wallner, Yang, Wang
2006, "Geometric modeling with conical meshes and developable surfaces" (planar quads as strips).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.linalg import eigh

from phexfab.errors import MeshError, SolveError
from phexfab.linalg import factorise
from phexfab.parallel.border import Border, place

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

FLAT = 36.5
"""Degrees that one plane for a whole side may lean from the film's normals."""

STEEP = 60.0
"""Degrees between a ruling or plane and a normal that are refused."""

UPRIGHT = 1.5
"""Weight of a plane's lean about its chord against a ruling's lean along the border.

Where an edge of the mesh crosses the plane at an angle, the axis there leans by the plane's lean
over the angle's sine: leaning planes cost more than leaning rulings.
"""


@dataclass(frozen=True, eq=False)
class Stations:
    """Where a border turns.

    Attributes
    ----------
    along : (m,) mm
        Along the border, ascending; empty where one plane takes the whole border.
    aside : (m, 3) mm
        By how much a station stands beside the border.
    fixed : (m,) bool
        Corners: they do not move along the border.
    planes : (m, 4), or (1, 4) where there is no station
        Normal (outward) and height of a plane that is given, rows of nan where it is to be fitted;
        row k is for the chord from station k to the next.
    """

    along: FloatArray
    aside: FloatArray
    fixed: BoolArray
    planes: FloatArray


@dataclass(frozen=True, eq=False)
class Fence:
    """The rim planes of one border.

    Attributes
    ----------
    border : Border
    stations : Stations
    points : (m, 3) mm
        The stations.
    rulings : (m, 3) unit
        Lines through the stations in which neighbouring planes meet, on the normals' side.
    normals : (k, 3) unit, heights : (k,) mm
        The planes, outward; plane k from station k to the next one. k = m, or 1 without stations.
    angle : float
        Largest angle, degrees, between a ruling, or a plane, and the film's normal.
    way : str
        How the planes were found: ``"fitted"``, ``"apex"``, ``"direction"``, ``"flat"`` or
        ``"folded"``.
    """

    border: Border
    stations: Stations
    points: FloatArray
    rulings: FloatArray
    normals: FloatArray
    heights: FloatArray
    angle: float
    way: str


def flat_plane(border: Border, start: float, end: float) -> FloatArray | None:
    """Return normal and height (4,) of the plane of a planar side that crosses the film steeply.

    None where the side is not planar, is straight (it lies in many planes), or lies in a plane
    that leans more than 36.5° from the film's normals.
    """
    along = border.between(start, end, border.length / 4000)
    points, normals = border.at(along)
    middle = points.mean(axis=0)
    _, size, axes = np.linalg.svd(points - middle, full_matrices=False)
    flat = 1e-7 * np.sqrt(len(points)) * border.length
    if size[2] > flat or size[1] <= 100 * flat:
        return None
    normal = axes[2]
    if np.abs(normals @ normal).max() > np.sin(np.radians(FLAT)):
        return None
    tangents = np.diff(points, axis=0)
    if (
        np.einsum(
            "ij,ij->",
            np.cross(tangents, normals[:-1]),
            normal[None, :].repeat(len(tangents), axis=0),
        )
        < 0
    ):
        normal = -normal
    return np.append(normal, normal @ middle)


def build_fence(
    border: Border, stations: Stations, spacing: float, direction: FloatArray | None = None
) -> Fence:
    """Return the planes of a border for given stations.

    Parameters
    ----------
    border : Border
    stations : Stations
    spacing : float
        Of the samples at which normals are compared, mm.
    direction : (3,), optional
        All rulings are parallel to it (a plumb cut).

    Raises
    ------
    MeshError
        If a ruling or plane would lean more than 60° from the film's normal; the message names
        the place.
    """
    if not len(stations.along):
        plane = stations.planes[0]
        _, normals = border.at(border.between(0.0, 0.0, spacing))
        tilt = float(np.degrees(np.arcsin(np.abs(normals @ plane[:3]).max())))
        nothing = np.zeros((0, 3))
        return Fence(border, stations, nothing, nothing, plane[None, :3], plane[3:], tilt, "flat")
    chords = _Chords.of(border, stations, spacing)
    if direction is not None:
        found = [("direction", chords.through(np.append(direction, 0.0)))]
    else:
        apex = chords.through(chords.apex())
        # Where straight sides meet in sharp corners turning planes may do harm: then they are not.
        starts = [chords.fit(chords.upright), chords.fit(apex), chords.upright]
        found = [*(("fitted", one) for one in starts), ("apex", apex)]
    best = min(found, key=lambda one: round(float(chords.leans(one[1])[0].max()), 6))
    way, normals = best
    lean, rulings = chords.leans(normals)
    if np.isfinite(stations.planes[:, 3]).all():
        way = "flat" if stations.fixed.all() else "folded"
    worst = int(lean.argmax())
    m = len(stations.along)
    if not lean[worst] <= STEEP:
        spot = chords.points[worst % m]
        remedy = (
            f"direction = {np.array2string(np.asarray(direction), precision=3)} lies too near the "
            "film there: choose another"
            if direction is not None
            else "the film twists too much along a border that is too straight there: round or "
            "straighten the border, put a corner there, choose a direction for the cut, or end in "
            'whole panels (border.panels = "whole")'
        )
        raise MeshError(
            f"the cut would lean {lean[worst]:.0f}° from the film's normal at {place(spot)}, more "
            f"than {STEEP:.0f}°; {remedy}"
        )
    given = np.isfinite(stations.planes[:, 3])
    heights = np.where(given, stations.planes[:, 3], np.einsum("ij,ij->i", normals, chords.points))
    return Fence(
        border, stations, chords.points, rulings, normals, heights, float(lean[worst]), way
    )


@dataclass(frozen=True, eq=False)
class _Chords:
    """Chords between stations with their frames: along, outward, upright (mean normal)."""

    points: FloatArray
    station_normals: FloatArray
    along: FloatArray
    outward: FloatArray
    up: FloatArray
    given: FloatArray
    samples: FloatArray
    sample_chord: IntArray

    @classmethod
    def of(cls, border: Border, stations: Stations, spacing: float) -> _Chords:
        s = stations.along
        points, normals = border.at(s)
        m = len(s)
        points = points + stations.aside
        ends = np.append(s[1:], s[0] + border.length)
        stops = [border.between(a, b, spacing) for a, b in zip(s, ends, strict=True)]
        owner = np.repeat(np.arange(m), [len(row) for row in stops])
        samples = border.at(np.concatenate(stops))[1]
        chord = np.roll(points, -1, axis=0) - points
        along = chord / np.linalg.norm(chord, axis=1, keepdims=True)
        mean = np.zeros((m, 3))
        np.add.at(mean, owner, samples)
        outward = np.cross(along, mean)
        outward /= np.linalg.norm(outward, axis=1, keepdims=True)
        up = np.cross(outward, along)
        return cls(points, normals, along, outward, up, stations.planes[:, :3], samples, owner)

    @property
    def upright(self) -> FloatArray:
        return self.fixed(self.outward)

    def fixed(self, normals: FloatArray) -> FloatArray:
        given = np.isfinite(self.given[:, :1])
        return np.where(given, self.given, normals)

    def apex(self) -> FloatArray:
        """Return the homogeneous point (4,) through which lines pass nearest to the normals.

        Least squares of ``|(a − w·P) × N|² / |a − w·P|²``, reweighted.
        """
        middle = self.points.mean(axis=0)
        size = float(np.abs(self.points - middle).max())
        local = (self.points - middle) / size
        rows = np.concatenate(
            [np.broadcast_to(np.eye(3), (len(local), 3, 3)), -local[:, :, None]], axis=2
        )
        n = self.station_normals
        across = np.eye(3) - n[:, :, None] * n[:, None, :]
        weight = np.ones(len(local))
        found = np.array([0.0, 0.0, 0.0, 1.0])
        for _ in range(8):
            scaled = rows * weight[:, None, None]
            far = np.einsum("nij,nik->jk", scaled, rows)
            near = np.einsum("nij,nil,nlk->jk", scaled, across, rows)
            found = eigh(near, far + 1e-12 * np.trace(far) * np.eye(4))[1][:, 0]
            square = np.sum((rows @ found) ** 2, axis=1)
            weight = 1 / np.maximum(square, 1e-6 * square.max())
        # Back to mm: a/w in local units.
        return np.append(size * found[:3] + middle * found[3], found[3])

    def through(self, apex: FloatArray) -> FloatArray:
        """Return the plane normals (m, 3) for rulings through a homogeneous point."""
        rulings = apex[:3] - apex[3] * self.points
        rulings = rulings / np.linalg.norm(rulings, axis=1, keepdims=True)
        normals = np.cross(self.along, rulings)
        size = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = np.divide(normals, size, out=self.outward.copy(), where=size > 1e-9)
        flip = np.einsum("ij,ij->i", normals, self.outward) < 0
        return self.fixed(np.where(flip[:, None], -normals, normals))

    def leans(self, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return (2m,) degrees of rulings, then planes, off the normals; and (m, 3) rulings."""
        rulings = np.cross(np.roll(normals, 1, axis=0), normals)
        size = np.linalg.norm(rulings, axis=1, keepdims=True)
        rulings = np.divide(rulings, size, out=self.along.copy(), where=size > 1e-12)
        cosine = np.einsum("ij,ij->i", rulings, self.station_normals)
        rulings = np.where(cosine[:, None] < 0, -rulings, rulings)
        sine = np.linalg.norm(np.cross(rulings, self.station_normals), axis=1)
        planes = np.zeros(len(normals))
        tilt = np.abs(np.einsum("ij,ij->i", normals[self.sample_chord], self.samples))
        np.maximum.at(planes, self.sample_chord, np.minimum(tilt, 1.0))
        return np.degrees(
            np.concatenate([np.arctan2(sine, np.abs(cosine)), np.arcsin(planes)])
        ), rulings

    def fit(self, start: FloatArray) -> FloatArray:
        """Return planes turned about their chords: upright, with rulings near the normals.

        Gauss–Newton on ``UPRIGHT·θ`` of every plane and ``(n₋ × n₊) × N`` over the turn of the
        border at every station, which is linear but for small terms.
        """
        m = len(self.points)
        free = ~np.isfinite(self.given[:, 0])
        angle = np.arctan2(
            np.einsum("ij,ij->i", start, self.up), np.einsum("ij,ij->i", start, self.outward)
        )
        here, before = np.arange(m), np.roll(np.arange(m), 1)
        rows = np.repeat(3 * here[:, None] + np.arange(3), 2, axis=1).reshape(m, 3, 2)
        columns = np.broadcast_to(np.stack([before, here], axis=1)[:, None, :], (m, 3, 2))
        for _ in range(12):
            cosine, sine = np.cos(angle)[:, None], np.sin(angle)[:, None]
            n = self.fixed(cosine * self.outward + sine * self.up)
            slope = np.where(free[:, None], cosine * self.up - sine * self.outward, 0.0)
            c = np.cross(n[before], n)
            turn = np.maximum(np.abs(np.einsum("ij,ij->i", c, self.station_normals)), 1e-3)
            weighted = self.station_normals / turn[:, None]
            value = np.cross(c, weighted)
            jacobian = np.stack(
                [
                    np.cross(np.cross(slope[before], n), weighted),
                    np.cross(np.cross(n[before], slope), weighted),
                ],
                axis=2,
            )
            matrix = sp.csr_matrix(
                (jacobian.ravel(), (rows.ravel(), columns.ravel())), shape=(3 * m, m)
            )
            lean = np.where(free, UPRIGHT, 1.0)
            right = -(matrix.T @ value.ravel()) - np.where(free, UPRIGHT**2 * np.sin(angle), 0.0)
            try:
                step = factorise(matrix.T @ matrix + sp.diags(lean**2)).solve(right)
            except SolveError:
                break
            largest = float(np.abs(step).max(initial=0.0))
            angle = angle + step * min(1.0, 0.3 / max(largest, 1e-30))
            if largest < 1e-12:
                break
        return self.fixed(np.cos(angle)[:, None] * self.outward + np.sin(angle)[:, None] * self.up)

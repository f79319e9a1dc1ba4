"""Polyhedra as arrays, ready to be written as boundary representations.

Parts of one family mostly share the way their faces join, so everything that depends on it is
found once (``topology``) and the rest is done for all such solids at a time (``batches``). What a
kernel would only notice later, or never (an inside-out solid passes its check), is refused here.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import PartError
from phexfab.fabrication.parts import Solid
from phexfab.fabrication.polyhedra import cross

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

TOLERANCE = 1e-7
"""Model tolerance in mm; OpenCASCADE's own ``Precision::Confusion``."""


@dataclass(frozen=True, eq=False)
class Topology:
    """How the faces of a closed polyhedron join.

    Attributes
    ----------
    faces : tuple of index tuples
    used : tuple of int
        The vertices that faces refer to, ascending.
    edges : (E, 2) int array
        Every edge once, in the direction in which it is first met.
    loops : tuple of tuples of (int, bool)
        Per face and side: the edge, and whether the face runs along its direction.
    """

    faces: tuple[tuple[int, ...], ...]
    used: tuple[int, ...]
    edges: IntArray
    loops: tuple[tuple[tuple[int, bool], ...], ...]


@lru_cache(maxsize=1024)
def topology(faces: tuple[tuple[int, ...], ...]) -> Topology:
    """Return the edges of a closed polyhedron.

    Parameters
    ----------
    faces : tuple of index tuples, each counter-clockwise seen from outside

    Raises
    ------
    PartError
        If a face repeats a corner, or an edge does not have exactly two faces that run along it
        in opposite directions.
    """
    number: dict[tuple[int, int], int] = {}
    sides: set[tuple[int, int]] = set()
    loops = []
    for f, face in enumerate(faces):
        if len(face) < 3 or len(set(face)) < len(face):
            raise PartError(f"face {f} has corners {face}; three or more different ones are needed")
        loop = []
        for i, j in zip(face, (*face[1:], face[0]), strict=True):
            if (i, j) in sides:
                raise PartError(f"two faces run along edge {i}-{j} in one direction; flip face {f}")
            sides.add((i, j))
            forward = (j, i) not in number
            edge = number.setdefault((i, j), len(number)) if forward else number[j, i]
            loop.append((edge, forward))
        loops.append(tuple(loop))
    if 2 * len(number) != len(sides):
        i, j = next((i, j) for i, j in sides if (j, i) not in sides)
        raise PartError(f"edge {i}-{j} has one face only; a solid must be closed")
    edges = np.array(list(number), np.int64).reshape(-1, 2)
    return Topology(faces, tuple(np.unique(edges).tolist()), edges, tuple(loops))


@dataclass(frozen=True, eq=False)
class Batch:
    """``k`` polyhedra with the same topology.

    Attributes
    ----------
    topology : Topology
    index : (k,) int array
        Places in the sequence that was given to ``batches``.
    points : (k, n, 3) array, mm
    directions : (k, E, 3) array
        Unit vectors along the edges.
    lengths : (k, E) array, mm
    normals : (k, F, 3) array
        Outward unit normals of the faces.
    warp : (k,) array, mm
        Largest distance of a corner from its face's plane through the first corner.
    """

    topology: Topology
    index: IntArray
    points: FloatArray
    directions: FloatArray
    lengths: FloatArray
    normals: FloatArray
    warp: FloatArray


def _dot(a: FloatArray, b: FloatArray) -> FloatArray:
    # Written out: einsum may pick another order of summation on another machine.
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def _batch(shape: Topology, index: IntArray, points: FloatArray, marks: Sequence[str]) -> Batch:
    """Measure solids of one topology; refuse those that no kernel could hold."""

    def refuse(
        bad: NDArray[np.bool_] | np.bool_, reason: str, values: FloatArray | None = None
    ) -> None:
        if bad.any():
            worst = int(bad.argmax())
            value = "" if values is None else f"{values[worst]:.3g} "
            raise PartError(f"{marks[index[worst]]}: {value}{reason}")

    refuse(~np.isfinite(points).all(axis=(1, 2)), "has a coordinate that is not a finite number")
    spans = points[:, shape.edges[:, 1]] - points[:, shape.edges[:, 0]]
    lengths = np.sqrt(_dot(spans, spans))
    shortest: FloatArray = lengths.min(axis=1)
    refuse(
        shortest <= 10 * TOLERANCE,
        "mm is the length of its shortest edge; merge the two corners",
        shortest,
    )
    normals = np.empty((len(points), len(shape.faces), 3))
    warp = np.zeros(len(points))
    volume = np.zeros(len(points))
    for f, face in enumerate(shape.faces):
        # Relative to a corner, so that parts far from the origin lose no digits.
        corners = points[:, face] - points[:, None, face[0]]
        area = cross(corners[:, 1:-1], corners[:, 2:]).sum(axis=1)
        size = np.sqrt(_dot(area, area))
        refuse(size <= TOLERANCE**2, f"mm² is twice the area of face {f}; remove the face", size)
        normals[:, f] = area / size[:, None]
        warp = np.maximum(warp, np.abs(_dot(corners, normals[:, None, f])).max(axis=1))
        volume += _dot(area, points[:, face[0]] - points[:, shape.used[0]]) / 6
    refuse(
        warp > TOLERANCE,
        f"mm is how far a corner lies off its face; {TOLERANCE:g} mm is allowed, "
        "planarise the shell first",
        warp,
    )
    refuse(volume <= 0, "mm³ is its volume; its faces are inside out, reverse them", volume)
    return Batch(shape, index, points, spans / lengths[..., None], lengths, normals, warp)


def batches(
    solids: Sequence[Solid], marks: Sequence[str], decimals: int | None = None
) -> list[Batch]:
    """Group solids by topology and measure each group at once.

    Parameters
    ----------
    solids : sequence of Solid
    marks : sequence of str
        Their names, for messages.
    decimals : int, optional
        Round coordinates to so many digits after the point first.

    Returns
    -------
    list of Batch
        In the order in which the topologies are first met.

    Raises
    ------
    PartError
        If a solid is open, inside out, warped or has an edge without length; the message names
        its mark.
    """
    groups: dict[tuple[int, tuple[tuple[int, ...], ...]], list[int]] = {}
    for index, solid in enumerate(solids):
        groups.setdefault((len(solid.vertices), solid.faces), []).append(index)
    result = []
    for (_, faces), members in groups.items():
        try:
            shape = topology(faces)
        except PartError as error:
            raise PartError(f"{marks[members[0]]}: {error}") from error
        points = np.array([solids[m].vertices for m in members], float)
        if decimals is not None:
            points = np.round(points, decimals) + 0.0  # no negative zeros
        result.append(_batch(shape, np.array(members), points, marks))
    return result

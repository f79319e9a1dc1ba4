"""Several conjugate nets on one surface: where one cannot go round a singular point.

A net has no irregular vertex, so that it ends where a family turns about a point: of the sectors
about an umbilic it covers one. Further nets begin in the midst of what is bare; of their bricks
those stay that keep off the faces before. Pieces do not hang together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.errors import LatticeError, SolveError
from phexfab.mesh.measures import face_centroids
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.conjugate.fields import Family
from phexfab.remesh.conjugate.hexagons import (
    Bricks,
    ConjugateHexagons,
    chosen_bricks,
    planar_hexagons,
)
from phexfab.remesh.conjugate.net import joined
from phexfab.remesh.conjugate.sampling import Sampling
from phexfab.remesh.coverage import under
from phexfab.surface.freeform.surface import FreeformSurface, ImplicitSurface

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

NETS = 6
BARE = 1.5  # of a brick: how far from faces a place must be for a net to begin there
FEW = 4  # faces, below which a net is not worth while
CLEAR = 0.5  # of a brick: how near to faces curves of a further net may come
NEARLY = 0.9  # of the widest net's area
TRIES = 2  # places to begin at, for each net that there may be
_SEEDS = 4000
_EDGE = 100  # samples a side of the domain


@dataclass(frozen=True, eq=False)
class ConjugateSectors:
    """Planar hexagons of several nets.

    Attributes
    ----------
    mesh : PolyMesh
        The faces of all nets, one net after the other; nets have no vertex in common.
    nets : tuple of ConjugateHexagons
        The first as ``conjugate_hexagons`` has it.
    families : tuple of Family
        What each net follows.
    net_of_face : (F,) int
    refused : tuple of str
        Why no net could begin at bare places that were tried, or what was wrong with it.
    """

    mesh: PolyMesh
    nets: tuple[ConjugateHexagons, ...]
    families: tuple[Family, ...]
    net_of_face: NDArray[np.int64]
    refused: tuple[str, ...]


def conjugate_sectors(
    surface: FreeformSurface,
    family: Family | Sequence[Family],
    size: float,
    *,
    nets: int = NETS,
    closeness: float = 0.0,
    crossing: str = "raise",
    **options: Any,
) -> ConjugateSectors:
    """Return planar hexagons of several conjugate nets, each begun in the widest bare part.

    Parameters
    ----------
    surface, family, size, closeness, crossing
        See ``conjugate_hexagons``; of later nets those that it would refuse are left out. Of
        several families each net follows the one with which it covers most, the first of those
        that cover nearly the same.
    nets : int
        How many there may be. No net begins nearer to faces than one and a half bricks.
    options
        What else ``conjugate_hexagons`` takes; ``seed`` is that of the first net.

    Raises
    ------
    LatticeError, SolveError
        If there is no first net; see ``conjugate_hexagons``.
    """
    if nets < 1:
        raise LatticeError(f"{surface.name}: nets = {nets}; at least one is needed")
    asked: dict[str, Any] = {"closeness": closeness, "crossing": crossing}
    choice = [family] if isinstance(family, Family) else list(family)
    chosen, bricks, sampling = _widest(surface, choice, size, **options)
    families = [chosen]
    made = [replace(planar_hexagons(bricks, **asked), sampling=sampling)]
    options.pop("seed", None)
    seeds = surface.seeds(_SEEDS)
    places = surface.point(seeds)
    inward = _inward(surface, places)
    fresh = np.ones(len(seeds), bool)
    refused: list[str] = []
    for _ in range(TRIES * nets):
        mesh = _united([net.mesh for net in made])
        marks = cKDTree(_marks(mesh))
        away = np.minimum(marks.query(places)[0], inward)
        fresh &= (away >= BARE * size) & ~under(mesh, places)
        if len(made) == nets or not fresh.any():
            break
        at = int(np.where(fresh, away, 0.0).argmax())
        # Whether a net fits here or not, none begins beside this place again.
        fresh &= np.linalg.norm(places - places[at], axis=1) > max(0.8 * away[at], size)
        free = partial(_far, marks, CLEAR * size)
        try:
            chosen, bricks, sampling = _widest(
                surface, choice, size, seed=seeds[at], free=free, **options
            )
            apart = _apart(bricks, mesh)
            if apart is not None:
                made.append(replace(planar_hexagons(apart, **asked), sampling=sampling))
                families.append(chosen)
        except (LatticeError, SolveError) as error:
            refused.append(str(error))
    counts = [net.mesh.n_faces for net in made]
    return ConjugateSectors(
        _united([net.mesh for net in made]),
        tuple(made),
        tuple(families),
        np.repeat(np.arange(len(made)), counts),
        tuple(refused),
    )


def _widest(
    surface: FreeformSurface, families: Sequence[Family], size: float, **options: Any
) -> tuple[Family, Bricks, Sampling]:
    """Return the family whose bricks cover most, with them; the first error where none does."""
    found: list[tuple[Family, Bricks, Sampling]] = []
    refused: list[LatticeError] = []
    for family in families:
        try:
            found.append((family, *chosen_bricks(surface, family, size, **options)))
        except LatticeError as error:
            refused.append(error)
    if not found:
        raise refused[0]
    areas = [_area(bricks) for _, bricks, _ in found]
    return found[int(np.argmax(np.array(areas) > NEARLY * max(areas)))]


def _area(bricks: Bricks) -> float:
    """Return about the area of bricks, mm²."""
    ring = bricks.mesh.vertices[bricks.mesh.corners.reshape(-1, 6)]
    total = np.cross(ring, np.roll(ring, -1, axis=1)).sum(axis=1)
    return float(np.nansum(np.linalg.norm(total, axis=1))) / 2


def _marks(mesh: PolyMesh) -> FloatArray:
    """Return points all over the faces of a mesh: about a third of a face apart."""
    start = mesh.vertices[mesh.corners]
    rim = np.concatenate([start, (start + start[mesh.next_corner]) / 2])
    middle = face_centroids(mesh)
    inner = np.tile(middle[mesh.face_of_corner], (2, 1))
    rings = [inner + share * (rim - inner) for share in (1 / 3, 2 / 3, 1.0)]
    return np.concatenate([middle, *rings])


def _far(marks: cKDTree, radius: float, points: FloatArray) -> BoolArray:
    """Return (k,) whether points are farther than a radius from all marks."""
    return ~np.isfinite(marks.query(points, distance_upper_bound=radius)[0])


def _inward(surface: FreeformSurface, places: FloatArray) -> FloatArray:
    """Return how far places (n, 3) are from the border, mm; inf where there is none."""
    if isinstance(surface, ImplicitSurface):
        if surface.sites is None:
            walls = np.minimum(places - surface.low, surface.high - places)
            return np.asarray(walls.min(axis=1))
        edge = surface.sites[~surface.inside(surface.sites)]
        if not len(edge):
            return np.full(len(places), np.inf)
        return np.asarray(cKDTree(edge).query(places)[0])
    if surface.domain is None or all(surface.periodic):
        return np.full(len(places), np.inf)
    u0, u1, v0, v1 = surface.domain
    share = np.linspace(0.0, 1.0, _EDGE)
    u, v = u0 + (u1 - u0) * share, v0 + (v1 - v0) * share
    ends = []
    if not surface.periodic[0]:
        ends += [np.column_stack([np.full(_EDGE, end), v]) for end in (u0, u1)]
    if not surface.periodic[1]:
        ends += [np.column_stack([u, np.full(_EDGE, end)]) for end in (v0, v1)]
    border = surface.point(np.concatenate(ends))
    return np.asarray(cKDTree(border).query(places)[0])


def _apart(bricks: Bricks, mesh: PolyMesh) -> Bricks | None:
    """Return the largest piece of the bricks that keep off a mesh, by half their longest edge."""
    rings = bricks.mesh.corners.reshape(-1, 6)
    corner = bricks.mesh.vertices[rings]
    side = np.linalg.norm(np.roll(corner, -1, axis=1) - corner, axis=2)
    middle = (corner + np.roll(corner, -1, axis=1)) / 2
    probes = np.concatenate([corner, middle, corner.mean(axis=1, keepdims=True)], axis=1)
    # A vertex of a brick alone in its row or column may have no place.
    placed = np.isfinite(probes).all(axis=(1, 2))
    flat = np.where(placed[:, None, None], probes, 0.0).reshape(-1, 3)
    ends = mesh.vertices[mesh.corners]
    marks = np.concatenate([mesh.vertices, (ends + ends[mesh.next_corner]) / 2])
    away = cKDTree(marks).query(flat)[0].reshape(len(rings), -1).min(axis=1)
    free = placed & (away > side.max(axis=1) / 2)
    free &= ~under(mesh, flat).reshape(len(rings), -1).any(axis=1)
    if free.sum() < FEW:
        return None
    made, _, kept = joined(bricks.net.surface, bricks.mesh.vertices, rings[free])
    if made.n_faces < FEW:
        return None
    which = np.flatnonzero(free)[kept]
    return replace(
        bricks, mesh=made, rows=bricks.rows[which], columns=bricks.columns[which],
        crossing_numbers=bricks.crossing_numbers[which],
    )  # fmt: skip


def _united(meshes: list[PolyMesh]) -> PolyMesh:
    """Return meshes side by side as one."""
    first = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    corners = [mesh.corners + n for mesh, n in zip(meshes, first, strict=False)]
    sides = np.concatenate([mesh.sides for mesh in meshes])
    return PolyMesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate(corners),
        np.concatenate([[0], np.cumsum(sides)]).astype(np.int64),
    )

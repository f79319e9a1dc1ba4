"""Several conjugate nets on one surface: where one cannot go round a singular point.

A net has no irregular vertex, so that it ends where a family turns about a point: of the sectors
about an umbilic it covers one. Further nets begin in the midst of what is bare; of their bricks
those stay that keep off the faces before. Pieces do not hang together.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from phexfab.errors import LatticeError, SolveError
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.conjugate.fields import Family
from phexfab.remesh.conjugate.hexagons import (
    Bricks,
    ConjugateHexagons,
    chosen_bricks,
    planar_hexagons,
)
from phexfab.remesh.conjugate.net import joined
from phexfab.remesh.coverage import under
from phexfab.surface.freeform.surface import FreeformSurface

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

NETS = 6
BARE = 1.5  # of a brick: how far from faces a place must be for a net to begin there
FEW = 4  # faces, below which a net is not worth while
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
    net_of_face : (F,) int
    refused : tuple of str
        Why no net could begin at bare places that were tried, or what was wrong with it.
    """

    mesh: PolyMesh
    nets: tuple[ConjugateHexagons, ...]
    net_of_face: NDArray[np.int64]
    refused: tuple[str, ...]


def conjugate_sectors(
    surface: FreeformSurface,
    family: Family,
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
        See ``conjugate_hexagons``; of later nets those that it would refuse are left out.
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
    bricks, sampling = chosen_bricks(surface, family, size, **options)
    made = [replace(planar_hexagons(bricks, **asked), sampling=sampling)]
    options.pop("seed", None)
    seeds = surface.seeds(_SEEDS)
    places = surface.point(seeds)
    inward = _inward(surface, places)
    bare = np.ones(len(seeds), bool)
    refused: list[str] = []
    while len(made) < nets and len(made) + len(refused) < 2 * nets:
        mesh = _united([net.mesh for net in made])
        away = cKDTree(mesh.vertices).query(places)[0]
        bare &= (away >= BARE * size) & ~under(mesh, places)
        if not bare.any():
            break
        away = np.where(bare, np.minimum(away, inward), 0.0)
        at = int(away.argmax())
        # Whether a net fits here or not, none begins beside this place again.
        bare &= np.linalg.norm(places - places[at], axis=1) > max(0.8 * away[at], size)
        try:
            bricks, sampling = chosen_bricks(surface, family, size, seed=seeds[at], **options)
            apart = _apart(bricks, mesh)
            if apart is not None:
                made.append(replace(planar_hexagons(apart, **asked), sampling=sampling))
        except (LatticeError, SolveError) as error:
            refused.append(str(error))
    counts = [net.mesh.n_faces for net in made]
    return ConjugateSectors(
        _united([net.mesh for net in made]),
        tuple(made),
        np.repeat(np.arange(len(made)), counts),
        tuple(refused),
    )


def _inward(surface: FreeformSurface, places: FloatArray) -> FloatArray:
    """Return how far places (n, 3) are from the border of the domain, mm; inf without one."""
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

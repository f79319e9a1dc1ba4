"""Lattices on a film: the one that a design asks for, and that placed a little otherwise.

Where a rim meets a lattice badly, another place of the same lattice may do. A film without umbilics
and holes leaves its lattice free to move; others hold it, and it may only grow or shrink a little.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from phexfab.design import Design
from phexfab.errors import LatticeError, MeshError
from phexfab.films import Film, Meshed, Plane
from phexfab.remesh.lattice import Lattice
from phexfab.remesh.mesh_lattices.trace import mesh_lattice
from phexfab.remesh.seamless.coordinate import seamless
from phexfab.remesh.seamless.grow import lattice_of
from phexfab.surface import MinimalSurface

MOVES = 6
"""Places that are tried where a lattice is free to move."""

SIZES = (0.975, 1.025, 0.95, 1.05, 0.9625, 1.0375, 0.925, 1.075)
"""Sizes of panels, over what is asked, that are tried where that changes the lattice."""

BEND = 0.05
"""How much bent lattices stretch or turn at the rim, of their size or in radians, at most."""

BENDS = tuple(BEND * 1j**turn * np.eye(4)[order] for turn, order in enumerate((2, 3, 2, 3, 3, 2)))
"""Corrections with which lattices that several umbilics hold are bent, without turning there."""

SPREAD = 1.324717957244746
"""The plastic number: its powers spread points evenly over a square, however many there are."""


@dataclass(frozen=True)
class Placement:
    """How a lattice differs from the one that is asked for.

    Attributes
    ----------
    size : float
        Factor on the size of panels.
    along, across : float
        Shares of a panel and of a row by which it is moved.
    bend : tuple of complex
        Correction with which it is bent, see ``seamless``.
    """

    size: float = 1.0
    along: float = 0.0
    across: float = 0.0
    bend: tuple[complex, ...] = ()

    def __str__(self) -> str:
        """Return it in words; nothing for what is asked."""
        said = []
        if self.along or self.across:
            said.append(f"panels moved by {self.along:.2f} along and {self.across:.2f} across rows")
        if self.bend:
            most = sum(abs(one) for one in self.bend)
            said.append(f"rows bent by up to {np.degrees(most):.1f}° at the rim")
        if self.size != 1.0:
            change = f"{100 * abs(self.size - 1):.1f}".removesuffix(".0")
            said.append(f"panels made {change} % {'larger' if self.size > 1 else 'smaller'}")
        return ", ".join(said)


AS_ASKED = Placement()


def placements(film: Film) -> tuple[Placement, ...]:
    """Return what may be tried on a film, in this order; the first is as asked.

    References
    ----------
    Roberts, *The unreasonable effectiveness of quasirandom sequences* (2018), for the moves.
    """
    ground = film.ground
    others: tuple[Placement, ...] = ()
    if isinstance(ground, Plane):
        held = len(ground.umbilics.places)
        if not held and not ground.domain.holes:
            shares = np.arange(1, MOVES + 1)[:, None] / SPREAD ** np.array([1, 2]) % 1.0
            others = tuple(Placement(1.0, a, b) for a, b in shares.tolist())
        else:
            others = tuple(Placement(bend=tuple(bend.tolist())) for bend in BENDS)
    return (AS_ASKED, *others, *(Placement(size) for size in SIZES))


def lattice_at(design: Design, film: Film, placement: Placement = AS_ASKED) -> Lattice:
    """Return a lattice on all of a film.

    Parameters
    ----------
    design : Design
    film : Film
    placement : Placement

    Raises
    ------
    LatticeError
        If no lattice of about that size fits, or the film's mesh is too coarse for it.
    MeshError
        If the film is a mesh that is malformed or too coarse at an umbilic.
    """
    panel_size = placement.size * design.lattice.panel_size
    ground = film.ground
    if isinstance(ground, Meshed):
        return _traced(design, film.surface, ground, panel_size)
    asked = design.lattice
    on = seamless(
        film.surface,
        ground.domain,
        panel_size=panel_size,
        row_ratio=asked.row_ratio,
        rows_along=asked.rows_along,
        evenness=asked.evenness,
        kind=design.offset.type,
        core=ground.core,
        found=ground.umbilics,
        bend=placement.bend,
    )
    if placement.along or placement.across:
        panel, row = on.plane.basis
        on = replace(on, shift=placement.along * panel + placement.across * row)
    return lattice_of(on, trim=False)


def _traced(design: Design, smooth: MinimalSurface, ground: Meshed, panel_size: float) -> Lattice:
    asked, triangles = design.lattice, ground.triangles
    try:
        found = mesh_lattice(
            ground.points,
            triangles,
            *ground.bends,
            panel_size=panel_size,
            row_ratio=asked.row_ratio,
            rows_along=asked.rows_along,
            kind=design.offset.type,
            same_topology=False,  # the margin beyond the rims may have necks thinner than a panel
        )
    except MeshError as error:
        if ground.given:
            raise
        raise LatticeError(
            f"lattice.panel_size = {panel_size:.4g} mm: {error}; smaller panels rest on a finer "
            "film"
        ) from error
    corner = triangles[found.face, found.barycentric.argmax(axis=1)]
    spots = np.einsum("fk,fkj->fj", found.barycentric, ground.points[triangles[found.face]])
    near = smooth.closest_parameter(spots, ground.parameters[corner])
    return replace(found.lattice, points=near, parameters=near)

"""Fitting a lattice to a rim: other cuts, and other places of the lattice on the same film.

Whether panels and bars at a rim keep their limits depends on where the lattice happens to lie
against it. So when the first cut misses a limit, a fixed list of others is tried, those that keep
the lattice first; the first that misses nothing is taken, else the one that misses least.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from phexfab.design import Design
from phexfab.ending import FIRST, Ending, Knife, ended, limits_of
from phexfab.errors import LatticeError, MeshError, SolveError, SurfaceError
from phexfab.fabrication.rim_fit import lack_cost
from phexfab.films import Film
from phexfab.minimal.shell import solved_shell
from phexfab.parallel.shell import Shell
from phexfab.placing import Placement, lattice_at, placements

Figures = Mapping[str, tuple[float | int | str, str]]

CHANGED = "changed so that the rim fits"
"""Name of the figure that says what was done."""

ROOM = (1.5, 1.25, 1.75)
"""Factors on the shortest edge and the depth, with which a cut is made again."""

RECUTS = 2
"""Other cuts of each lattice but the first one, of which all are tried."""

CHORD, CLOSER, SLIVER = 0.3, 0.15, 0.8
"""Shares of the limit on the distance from the rim: how far off chords may be then, and how far
slivers may reach, which cuts step aside for."""

HOPELESS = float(np.log(2))
"""Logarithm of a rim's distance over its limit that no other place of the lattice mends."""

STEPS, FEWEST = 36, 4
"""Lattices with their shells, and cuts, that are made for a fit at most: few panels, and many."""

WORK = 8_000
"""Panels that all of these may have together, where that is between the two."""


@dataclass
class _Budget:
    """What may still be made."""

    left: int

    @classmethod
    def of(cls, shell: Shell) -> _Budget:
        return cls(int(np.clip(WORK // len(shell.panels), FEWEST, STEPS)))

    def take(self) -> bool:
        """Return whether there was one left."""
        self.left -= 1
        return self.left >= 0


@dataclass(frozen=True, eq=False)
class Fit:
    """How a lattice fits its rims best.

    Attributes
    ----------
    ending : Ending
    index : int or None
        Number of unstable directions of the film.
    figures : mapping of name to (value, unit)
        What was changed for it, if anything was.
    """

    ending: Ending
    index: int | None
    figures: Figures


def fitted(
    design: Design,
    film: Film,
    placement: Placement,
    whole: Shell,
    index: int | None,
    first: Ending,
) -> Fit:
    """Return the cut that misses least: the first one, if it misses nothing.

    Parameters
    ----------
    design : Design
    film : Film
    placement : Placement
        Of the lattice of ``whole``.
    whole : Shell
        On all of the film.
    index : int or None
        From ``solved_shell``.
    first : Ending
        The first cut of ``whole``.
    """
    best, best_index, changed = first, index, _in_words(placement, FIRST)
    if first.lacks:
        for cut, its_index, said in _others(design, film, placement, whole, index, first):
            if lack_cost(cut.lacks) < lack_cost(best.lacks):
                best, best_index, changed = cut, its_index, said
            if not cut.lacks:
                break
    figures: Figures = {CHANGED: (changed, "")} if changed else {}
    return Fit(best, best_index, figures)


def _others(
    design: Design,
    film: Film,
    placement: Placement,
    whole: Shell,
    index: int | None,
    first: Ending,
) -> Iterator[tuple[Ending, int | None, str]]:
    """Yield other cuts, the film's unstable directions, and in words what they change."""
    budget = _Budget.of(first.shell)
    nearest = first.lacks.get("rim_distance", 0.0)
    for knife, again in _recut(design, film, whole, first, None, budget):
        nearest = min(nearest, again.lacks.get("rim_distance", 0.0))
        yield again, index, _in_words(placement, knife)
    if nearest > HOPELESS:
        return
    seen = {_likeness(whole.step, whole.normals)}
    for other in placements(film):
        if other == placement:
            continue
        if not budget.take():
            return
        try:
            lattice = lattice_at(design, film, other)
            likeness = _likeness(lattice.step, lattice.points)
            if not (other.along or other.bend) and likeness in seen:
                continue  # several umbilics leave a lattice few sizes
            seen.add(likeness)
            shell, its_index = solved_shell(film.surface, lattice, design.offset.type)
            if not budget.take():
                return
            cut = ended(design, film, shell)
        except (LatticeError, MeshError, SolveError, SurfaceError):
            continue
        yield cut, its_index, _in_words(other, FIRST)
        for knife, again in _recut(design, film, shell, cut, RECUTS, budget):
            yield again, its_index, _in_words(other, knife)


def _recut(
    design: Design, film: Film, whole: Shell, first: Ending, most: int | None, budget: _Budget
) -> Iterator[tuple[Knife, Ending]]:
    """Yield other cuts of a shell, those first that mend what the first one misses."""
    limit, asked = limits_of(design).rim_distance, design.border
    near, nearer = (
        Knife(sagitta=None if asked.sagitta is not None else share * limit)
        for share in (CHORD, CLOSER)
    )
    sharp = replace(near, sliver=None if asked.sliver_width is not None else SLIVER * limit)
    roomier = [Knife(room) for room in ROOM]
    if set(first.lacks) == {"rim_distance"}:
        knives = [sharp, near, nearer]
    elif "rim_distance" in first.lacks:
        knives = [sharp, near, roomier[0]]
    else:
        knives = [*roomier, near]
    knives = [knife for knife in dict.fromkeys(knives) if knife != FIRST]
    for knife in knives[:most]:
        if not budget.take():
            return
        try:
            yield knife, ended(design, film, whole, knife)
        except MeshError:
            continue


def _likeness(step: float, points: NDArray[Any]) -> tuple[float, int]:
    """Return what lattices that are nearly the same have in common."""
    return float(f"{step:.3g}"), len(points)


def _in_words(placement: Placement, knife: Knife) -> str:
    """Return what differs from what was asked for; nothing where nothing does."""
    return ", ".join(said for said in (str(placement), str(knife)) if said)

"""What must be a lattice vector for one lattice to cover a domain without a seam.

The differences of the apices along a tree, and the translations of the ways around holes. A way
around a hole on which the root changes its sign is a half-turn; that keeps the lattice if its
centre is half a lattice vector away from an apex. Without apices the first such half-turn only says
where the lattice lies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse.csgraph import minimum_spanning_tree

from phexfab.remesh.seamless.root_paths import Arc, Quantity, straight, way
from phexfab.surface.domain import Disc
from phexfab.surface.holomorphic import ComplexArray, show

IntArray = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Condition:
    """An integral ``Σ weights e^h(nodes)`` that must be a lattice vector.

    Attributes
    ----------
    nodes, weights : (k,) complex
    pair : (int, int) or None
        The two apices between which it is taken; it must not be zero then.
    text : str
        What it is, for messages.
    panels : int
        Panels of Gauss' rule that it took.
    """

    nodes: ComplexArray
    weights: ComplexArray
    pair: tuple[int, int] | None
    text: str
    panels: int


@dataclass(frozen=True, eq=False)
class Conditions:
    """All conditions; ``half_turn``, if any, is the one that places the lattice at the anchor."""

    each: tuple[Condition, ...]
    anchor: complex
    half_turn: Condition | None = None


def seam_conditions(
    quantity: Quantity, domain: Disc, places: ComplexArray, like: Conditions | None = None
) -> Conditions:
    """Return the conditions for apices at ``places``.

    Parameters
    ----------
    quantity : callable
        (dw̃/dz)² for h = 0.
    domain : Disc
    places : (G,) complex
    like : Conditions, optional
        Those for apices nearby: then the same pairs are taken and cut as finely.
    """
    found = []
    before = {} if like is None else {c.text: c for c in like.each}
    if like is None:
        tree = minimum_spanning_tree(np.abs(places[:, None] - places)) if len(places) else None
        ends = np.zeros((2, 0), int) if tree is None else np.array(tree.nonzero())
        pairs = sorted((int(j), int(k)) for j, k in ends.T)
        named = [
            f"the umbilics at z = {show(places[j])} and z = {show(places[k])}" for j, k in pairs
        ]
    else:
        known = [c for c in like.each if c.pair is not None]
        pairs, named = [c.pair for c in known if c.pair is not None], [c.text for c in known]
    for (j, k), text in zip(pairs, named, strict=True):
        pieces = straight(complex(places[j]), complex(places[k]), domain, (True, True))
        made = way(quantity, pieces, panels=before[text].panels if text in before else 0)
        found.append(Condition(made.nodes, made.weights, (j, k), text, made.panels))

    anchor = _anchor(domain)
    root = complex(np.sqrt(quantity(np.array([anchor], complex))[0])) if not len(places) else None
    half_turn: Condition | None = None
    for c, r in domain.holes:
        start = anchor if not len(places) else complex(places[np.argmin(np.abs(places - c))])
        touch = c + r * (start - c) / abs(start - c)
        arm = straight(start, touch, domain, (bool(len(places)), False))
        loop = way(quantity, [*arm, Arc(touch, touch, c, 2 * np.pi)], root)
        around = loop.piece == len(arm)
        sign = way(quantity, [Arc(c + r, c + r, c, 2 * np.pi)]).sign
        text = f"the way around the hole at z = {show(c)}"
        if sign > 0:
            nodes, weights = loop.nodes[around], loop.weights[around]
        else:  # there, around, and back on the other root
            nodes, weights = loop.nodes, np.where(around, 1.0, 2.0) * loop.weights
        one = Condition(nodes, weights, None, text, loop.panels)
        if sign < 0 and not len(places):
            if half_turn is None:
                half_turn = one
                continue
            nodes = np.concatenate([nodes, half_turn.nodes])
            weights = np.concatenate([weights, -half_turn.weights])
            one = Condition(nodes, weights, None, text, loop.panels)
        found.append(one)
    return Conditions(tuple(found), anchor, half_turn)


def _anchor(domain: Disc) -> complex:
    """Return the centre, or where that lies in a hole the middle of the way out to the right."""
    for c, r in domain.holes:
        if abs(domain.centre - c) < r:
            return (c + r + domain.centre + domain.radius) / 2
    return domain.centre

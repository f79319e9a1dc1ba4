"""Sums along spanning trees, vectorised: how local steps become positions."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import breadth_first_order

from phexfab.errors import MeshError

IntArray = NDArray[np.int64]


def spanning_tree(graph: sp.csr_matrix, root: int) -> IntArray:
    """Return the parent of every node in a breadth-first tree; the root is its own.

    Raises
    ------
    MeshError
        If the graph is not connected.
    """
    order, parent = breadth_first_order(graph, root, directed=False)
    if len(order) < graph.shape[0]:
        raise MeshError("the lattice falls into several pieces; choose a larger rectangle")
    parent = parent.astype(np.int64)
    parent[root] = root
    return parent


def sum_to_root(values: NDArray[Any], parent: IntArray) -> NDArray[Any]:
    """Return the sum of values from every node up to the root (whose value must be zero)."""
    total, up = values.copy(), parent.copy()
    while np.any(up != up[up]):
        total = total + total[up]
        up = up[up]
    return total

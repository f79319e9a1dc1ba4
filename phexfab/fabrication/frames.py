"""The node plane of an edge: the plane of the edge of M, the edge of S and both node axes.

Because M and its Gauss image S are parallel meshes, the node axes at the two ends of an edge
(through ``m_v`` along ``s_v``) and the edge itself lie in one plane, exactly: beams stand in it and
mitred panels end parallel to it (thesis §4.2, torsion-free nodes).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import PartError
from phexfab.parallel.border import place
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

COLLAPSED = 1e-9
"""Length of an edge, over the mean of all, up to which it has no direction."""


@dataclass(frozen=True, eq=False)
class EdgeFrames:
    """Right-handed frames (along, left, up) of directed edges ``tail → head``.

    Attributes
    ----------
    along : (n, 3) unit
        Direction of the edge.
    left : (n, 3) unit
        Across the node plane, to the left seen from the tips of the normals: into the panel that
        has the edge in its counter-clockwise boundary.
    up : (n, 3) unit
        In the node plane, across the edge, on the side of the normals.
    distance : (n,)
        Distance of S's edge line from the origin: the edge of ``M + d·S`` lies ``d·distance``
        above M's edge.
    length : (n,) mm
        Of M's edge.
    """

    along: FloatArray
    left: FloatArray
    up: FloatArray
    distance: FloatArray
    length: FloatArray


def edge_frames(shell: Shell, tail: IntArray, head: IntArray) -> EdgeFrames:
    """Return the frames of the edges from vertices ``tail`` to ``head`` of ``shell.mesh``.

    The frame of a reversed edge has the same ``up`` and exactly the opposite ``along`` and
    ``left``, so two panels that share an edge end on exactly parallel planes.

    Raises
    ------
    PartError
        If an edge has no length, or the node axes at its ends lie along it, so that there is no
        node plane; the message names the place.

    References
    ----------
    Thesis §4.2; Pottmann et al. 2007, sec. 3.
    """
    m, s = shell.mesh.vertices, shell.gauss.vertices
    edge = m[head] - m[tail]
    length = np.linalg.norm(edge, axis=1)
    _require(length > COLLAPSED * length.mean(), m[tail], "has no length")
    along = edge / length[:, None]
    middle = (s[tail] + s[head]) / 2.0
    up = middle - np.einsum("ij,ij->i", middle, along)[:, None] * along
    distance = np.linalg.norm(up, axis=1)
    axis = np.linalg.norm(middle, axis=1)
    _require(distance > COLLAPSED * axis, m[tail], "runs along the node axes at its ends")
    up = up / distance[:, None]
    return EdgeFrames(along, np.cross(up, along), up, distance, length)


def _require(good: NDArray[np.bool_], places: FloatArray, fault: str) -> None:
    """Raise PartError for the first edge that is not good."""
    if len(good) and not good.all():
        raise PartError(
            f"an edge of the shell at {place(places[int(good.argmin())])} {fault}: no panel or bar "
            'ends there; choose another lattice.panel_size, or border.panels = "whole"'
        )

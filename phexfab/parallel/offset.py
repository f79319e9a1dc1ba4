"""Offsets M + d·S along the Gauss image, how far they may go, and the node axes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.errors import OffsetLimitError
from phexfab.parallel.pairs import flip_interval
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]


def edge_ratios(shell: Shell) -> FloatArray:
    """Return (E,) signed ratios c of M's edge to the parallel edge of S, mm.

    The edge of the offset M + d·S is (c + d) times that of S. Where S's edge has no length (in a
    shell that is cut by parallel planes) the ratio is infinite: the offset changes nothing there.
    """
    i, j = shell.edges[:, 0], shell.edges[:, 1]
    m = shell.mesh.vertices[j] - shell.mesh.vertices[i]
    s = shell.gauss.vertices[j] - shell.gauss.vertices[i]
    square = np.einsum("ij,ij->i", s, s)
    endless = np.full(len(s), np.inf)
    return np.divide(np.einsum("ij,ij->i", m, s), square, out=endless, where=square > 1e-24)


def admissible_interval(shell: Shell) -> tuple[float, float]:
    """Return the open interval (low, high) of offset distances in mm that flip no edge.

    An edge vanishes at d = −c, so the limits are −min{c > 0} and min{|c| : c < 0}; infinite
    where no such edge exists.

    Parameters
    ----------
    shell : Shell

    References
    ----------
    Thesis §4.2.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> low, high = px.admissible_interval(shell)
    >>> print(f"{low:.0f} mm < d < {high:.0f} mm")
    -746 mm < d < 1514 mm
    """
    return flip_interval(edge_ratios(shell))


def offset(shell: Shell, distance: float) -> Shell:
    """Return the parallel mesh M + d·S at a constant distance.

    Parameters
    ----------
    shell : Shell
    distance : float
        In mm, positive along the face normals. What is constant depends on the offset type: the
        distance of face planes, of edges, or of vertices.

    Raises
    ------
    OffsetLimitError
        If an edge would flip; the message names the edge and the admissible interval.

    References
    ----------
    Thesis §4.2; Pottmann et al. 2007, "Geometry of multi-layer freeform structures", sec. 3.

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> below = px.offset(shell, -90.0)  # mm
    >>> px.classify_pair(shell.mesh, below.mesh).kind  # faces keep their distance
    'face'
    >>> px.offset(shell, 5000.0)
    Traceback (most recent call last):
        ...
    phexfab.errors.OffsetLimitError: offset.distance = 5000 mm: edge ... of the shell would flip;
        keep the distance between -746.1 and 1514.2 mm, or make the panels larger
    """
    low, high = admissible_interval(shell)
    if not low < distance < high:
        ratios = edge_ratios(shell)
        flipped = int(
            np.argmin(np.where(ratios * (ratios + distance) <= 0, np.abs(ratios), np.inf))
        )
        raise OffsetLimitError(
            f"offset.distance = {distance:g} mm: edge {flipped} of the shell would flip; keep the "
            f"distance between {low:.1f} and {high:.1f} mm, or make the panels larger"
        )
    return shell.with_heights(shell.heights + distance * shell.gauss_heights)


def offset_defect(shell: Shell) -> FloatArray:
    """Return how far S misses its offset type: per face, edge or vertex, unit length.

    Face type: |height − 1|; edge type: | distance of the edge's line from the origin − 1 |;
    vertex type: | |s_v| − 1 |.
    """
    s = shell.gauss.vertices
    if shell.kind == "face":
        return np.abs(shell.gauss_heights[shell.panels] - 1)
    if shell.kind == "vertex":
        return np.abs(np.linalg.norm(s, axis=1) - 1)
    a, b = s[shell.edges[:, 0]], s[shell.edges[:, 1]]
    along = (b - a) / np.linalg.norm(b - a, axis=1, keepdims=True)
    foot = a - np.einsum("ij,ij->i", a, along)[:, None] * along
    return np.abs(np.linalg.norm(foot, axis=1) - 1)


def node_axes(shell: Shell) -> FloatArray:
    """Return (V, 3) unit node axes, the directions of S's vertices.

    All mid-planes of the beams at a vertex of ``shell.mesh`` contain its axis, so nodes are free
    of torsion (thesis §4.4).

    Parameters
    ----------
    shell : Shell

    Examples
    --------
    >>> import phexfab as px
    >>> surface = px.minimal_surface("enneper").scaled(3000.0)  # mm
    >>> shell = px.minimal_shell(surface, px.lattice_on(surface, panel_size=500.0))
    >>> axes = px.node_axes(shell)
    >>> below = shell.mesh.vertices - 90.0 * axes  # mm, along the axes
    >>> axes.shape == below.shape
    True
    """
    s = shell.gauss.vertices
    return s / np.linalg.norm(s, axis=1, keepdims=True)

"""Which panels of a shell lie within given borders, for shells that end in whole panels."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from phexfab.errors import MeshError
from phexfab.mesh.measures import signed_areas
from phexfab.parallel.border import Border, distance_to_segments, place, samples_of
from phexfab.parallel.shell import Shell
from phexfab.parallel.walk import Ground, refuse_crossed

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

FINE = 32
"""Samples of a border per panel along it."""


def panels_within(whole: Shell, borders: Sequence[Border]) -> BoolArray:
    """Return (P,) True for the panels of a shell whose middle lies within all borders.

    Parameters
    ----------
    whole : Shell
        Reaches beyond the borders.
    borders : sequence of Border
        All of them, each with the film to its left.

    Raises
    ------
    MeshError
        If the shell ends before a border, or the borders do not bound it.
    """
    if not borders:
        raise MeshError("there is no border to end at; give one at least")
    ground = Ground.of(whole)
    mesh, middle = ground.mesh, ground.finder.middle
    size = float(np.sqrt(signed_areas(mesh, ground.normals).mean()))
    spots, lefts, panel = [], [], []
    for border in borders:
        along = border.between(0.0, 0.0, size / FINE)[:-1]
        points, normals = border.at(along)
        panel.append(ground.finder.find(points, normals))
        spots.append(points)
        ahead = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
        lefts.append(np.cross(normals, ahead))
    spot, left, on = np.concatenate(spots), np.concatenate(lefts), np.concatenate(panel)
    if (on < 0).any():
        refuse_crossed(ground, borders, whole.kind)
        raise MeshError(
            f"the shell ends at {place(spot[np.argmax(on < 0)])}, before the border within which "
            "it is to end; make the shell reach further beyond the border"
        )

    def to_the_left(panels: IntArray, of: IntArray) -> BoolArray:
        """Say whether middles lie left of the samples nearest to them on the panels ``of``."""
        out = np.zeros(len(panels), bool)
        order = np.argsort(on, kind="stable")
        first = np.searchsorted(on[order], of)
        last = np.searchsorted(on[order], of, side="right")
        for k, (f, a, b) in enumerate(zip(panels.tolist(), first, last, strict=True)):
            rows = order[a:b]
            near = rows[np.linalg.norm(spot[rows] - middle[f], axis=1).argmin()]
            out[k] = (middle[f] - spot[near]) @ left[near] > 0
        return out

    crossed = np.unique(on)
    kept = np.zeros(mesh.n_faces, bool)
    kept[crossed] = to_the_left(crossed, crossed)
    # The others in parts that hang together; those beside a crossed panel say on which side.
    free = np.ones(mesh.n_faces, bool)
    free[crossed] = False
    face = mesh.face_of_corner
    inner = np.flatnonzero(ground.twin >= 0)
    one, two = face[inner], face[ground.twin[inner]]
    both = free[one] & free[two]
    links = coo_array(
        (np.ones(int(both.sum())), (one[both], two[both])), shape=(mesh.n_faces, mesh.n_faces)
    )
    part = connected_components(links, directed=False)[1]
    beside = free[one] & ~free[two]
    votes = np.zeros((int(part.max(initial=0)) + 1, 2), np.int64)
    np.add.at(votes, (part[one[beside]], to_the_left(one[beside], two[beside]).astype(np.int64)), 1)
    torn = np.flatnonzero(votes.min(axis=1) > 0.2 * votes.sum(axis=1))
    if len(torn):
        refuse_crossed(ground, borders, whole.kind)
        f = int(np.flatnonzero(free & (part == torn[0]))[0])
        raise MeshError(
            f"the borders do not bound the shell: the panel at {place(middle[f])} lies on both "
            "sides of them; give all borders, each with the film to its left"
        )
    kept[free] = (votes[:, 1] > votes[:, 0])[part[free]]
    if not kept.any():
        raise MeshError(
            f"no panel of {size:.0f} mm lies within the borders; make the panels smaller"
        )
    return kept


def border_distance(shell: Shell, borders: Sequence[Border], spacing: float) -> float:
    """Return the largest distance between given borders and that of a shell, either way, mm.

    Parameters
    ----------
    shell : Shell
    borders : sequence of Border
    spacing : float, mm
        Of the samples at which it is measured.
    """
    edges = shell.edges[shell.edges[:, 3] < 0]
    begin, end = shell.mesh.vertices[edges[:, 0]], shell.mesh.vertices[edges[:, 1]]
    given = np.concatenate([one.points for one in borders])
    onward = np.concatenate([np.roll(one.points, -1, axis=0) for one in borders])
    there = distance_to_segments(samples_of(begin, end, spacing), given, onward)
    back = distance_to_segments(samples_of(given, onward, spacing), begin, end)
    return float(max(there.max(), back.max()))

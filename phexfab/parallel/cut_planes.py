"""A cut shell from its patchwork: panels in the order of the whole shell, then rim planes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.parallel.fence import Fence
from phexfab.parallel.shell import Shell
from phexfab.parallel.slivers import Patchwork

IntArray = NDArray[np.int64]


def shell_of_pieces(whole: Shell, patch: Patchwork, old: IntArray, fences: list[Fence]) -> Shell:
    """Return the patchwork as a shell: panels in the order of the whole shell, then rim planes."""
    triangles = patch.triangles()
    rim = patch.rim
    plane_of = np.concatenate([np.arange(len(patch.heights) - len(patch.copies)), patch.copies])
    plane_of = plane_of.astype(np.int64)
    centres = [np.zeros((0, 3))]
    for fence in fences:
        ends = np.roll(fence.points, -1, axis=0)
        single = fence.border.points[:1]
        centres.append((fence.points + ends) / 2 if len(fence.points) else single)
    middle = np.concatenate(centres)

    normals, heights = patch.normals, patch.heights
    lids = [int(f) for f in _closed(patch)]
    for lid in lids:
        # A plane all around a hole has a closed ring, like a panel. A triangle of two further
        # planes that nothing is built from opens it.
        x = np.cross(normals[lid], np.eye(3)[np.abs(normals[lid]).argmin()])
        x /= np.linalg.norm(x)
        spare = np.stack([x, np.cross(normals[lid], x)])
        n = len(normals)
        triangles = np.vstack([triangles, [[lid, n, n + 1]]])
        normals = np.vstack([normals, spare])
        point = middle[plane_of[lid] - rim]
        heights = np.append(heights, spare @ point)
        plane_of = np.append(plane_of, [plane_of[lid]] * 2)

    used = np.unique(triangles)
    parent = np.full(len(normals), -1)
    parent[:rim] = old
    order = used[np.lexsort((used, np.where(parent[used] < 0, len(whole.normals), parent[used])))]
    number = np.full(len(normals), -1)
    number[order] = np.arange(len(order))
    mine = parent[order]
    own = mine >= 0
    plane = plane_of[order] - rim
    points = np.where(own[:, None], whole.points[mine], middle[np.maximum(plane, 0)])
    gauss = np.where(own, whole.gauss_heights[mine], 0.0)
    table = number[triangles]
    parameters = whole.parameters
    if len(parameters):
        parameters = np.where(own, parameters[mine], 0.0)
        # A rim plane has the parameter of a panel beside it.
        rows, columns = np.nonzero(~own[table])
        beside = table[rows, (columns + 1) % 3]
        beside = np.where(own[beside], beside, table[rows, (columns + 2) % 3])
        good = own[beside]
        parameters[table[rows, columns][good]] = parameters[beside[good]]
    first = np.lexsort((table.max(axis=1), table.min(axis=1)))
    return Shell(
        normals[order],
        heights[order],
        gauss,
        table[first],
        whole.kind,
        points,
        whole.step,
        parameters,
        whole,
        mine,
    )


def _closed(patch: Patchwork) -> list[int]:
    """Return the rim planes with a closed ring."""
    planes = list(range(patch.rim, len(patch.heights)))
    return [f for f, ring in patch.rings(planes).items() if ring]

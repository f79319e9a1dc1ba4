"""Vertices that are one made one, in a mesh and in another of the same faces alike."""

from __future__ import annotations

import numpy as np

from phexfab.errors import MeshError
from phexfab.mesh.io import same_place, weld
from phexfab.mesh.polymesh import PolyMesh


def welded(
    mesh: PolyMesh, other: PolyMesh | None = None, tolerance: float | None = None
) -> tuple[PolyMesh, PolyMesh | None]:
    """Return a mesh welded, and with it another one that has the same corners in every face.

    Parameters
    ----------
    mesh, other : PolyMesh
        Of ``other``, such as an offset, vertices become one where those of ``mesh`` do.
    tolerance : float, optional
        See ``phexfab.mesh.io.weld``; left out, ``same_place`` as for imported meshes.

    Raises
    ------
    MeshError
        If welding leaves a face with fewer than 3 corners, drops corners although there is an
        ``other``, or its vertices that would become one lie ten times the tolerance apart.
    """
    if not mesh.n_faces:
        return mesh, other
    within = same_place(mesh) if tolerance is None else tolerance
    joined = weld(mesh, within)
    if other is None:
        return joined, None
    if len(joined.corners) != len(mesh.corners):
        raise MeshError(
            f"welding within {within:.3g} drops corners of the mesh, so its offset no longer "
            "corresponds; lower the tolerance"
        )
    # Corner for corner the same faces: a vertex takes the offset of the first it stands for.
    _, first = np.unique(joined.corners, return_index=True)
    points = other.vertices[mesh.corners]
    apart = np.linalg.norm(points - points[first][joined.corners], axis=1)
    if apart.max() > 10 * (within if tolerance is not None else max(within, same_place(other))):
        raise MeshError(
            f"vertices that are one within {within:.3g} lie {apart.max():.3g} apart in the "
            "offset; lower the tolerance"
        )
    return joined, PolyMesh(points[first], joined.corners, joined.starts)


def unwelded(mesh: PolyMesh, other: PolyMesh | None = None) -> tuple[PolyMesh, PolyMesh | None]:
    """Return both meshes without the vertices that no face of ``mesh`` uses."""
    used, index = np.unique(mesh.corners, return_inverse=True)
    corners = index.reshape(-1).astype(np.int64)
    kept = PolyMesh(mesh.vertices[used], corners, mesh.starts)
    return kept, other and PolyMesh(other.vertices[used], corners, mesh.starts)

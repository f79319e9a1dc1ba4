"""Assertions on meshes, shells and solids, for tests of phexfab and of what is built on it.

Each raises ``AssertionError`` with the worst place, its value and the tolerance. All of them
measure corner points; a value that is not a number fails.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from phexfab.fabrication.parts import Solid
from phexfab.fabrication.polyhedra import is_closed, volumes
from phexfab.mesh.measures import face_normals, planarity, relative_planarity, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.curvature import minimality
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]

__all__ = [
    "assert_closed_solid",
    "assert_minimal",
    "assert_offset",
    "assert_parallel",
    "assert_planar",
    "assert_same_mesh",
    "assert_simple",
]


def assert_planar(mesh: PolyMesh, tolerance: float = 1e-12) -> None:
    """Assert that every face lies in a plane, to a tolerance relative to the mean edge.

    Raises
    ------
    AssertionError
        Naming the worst face.
    """
    _all_below(relative_planarity(mesh), tolerance, "face {} is off its plane, over the mean edge,")


def assert_parallel(mesh: PolyMesh, other: PolyMesh, tolerance: float = 1e-10) -> None:
    """Assert that two meshes of the same faces have parallel edges, by the sine of the angle.

    Raises
    ------
    AssertionError
        Naming the worst edge by its vertices, or saying that the faces differ.
    """
    _same_faces(mesh, other)
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    one, two = (m.vertices[head] - m.vertices[tail] for m in (mesh, other))
    lengths = np.linalg.norm(one, axis=1) * np.linalg.norm(two, axis=1)
    with np.errstate(invalid="ignore"):
        sine = np.linalg.norm(np.cross(one, two), axis=1) / lengths
    names = [f"{i}-{j}" for i, j in zip(tail.tolist(), head.tolist(), strict=True)]
    _all_below(sine, tolerance, "edge {} is not parallel: sine", names)


def assert_minimal(shell: Shell, tolerance: float = 1e-10) -> None:
    """Assert |H|/√|K| of every panel, from the mixed areas of M and S.

    Raises
    ------
    AssertionError
        Naming the worst panel.

    References
    ----------
    Thesis §7.1.2.
    """
    _all_below(minimality(shell), tolerance, "panel {} is not minimal: |H|/√|K|")


def assert_offset(gauss: PolyMesh, kind: str, tolerance: float = 1e-11) -> None:
    """Assert that a Gauss image gives offsets of one type: it touches the unit sphere so.

    Parameters
    ----------
    gauss : PolyMesh
    kind : ``"face"``, ``"edge"`` or ``"vertex"``
        What touches the sphere: face planes, edge lines or vertices.
    tolerance : float

    Raises
    ------
    AssertionError
        Naming the worst face, edge or vertex.
    ValueError
        If the kind is another.

    References
    ----------
    Thesis §4.4.
    """
    points = gauss.vertices
    if kind == "face":
        distance = np.einsum(
            "ij,ij->i", points[gauss.corners[gauss.starts[:-1]]], face_normals(gauss)
        )
        _all_below(np.abs(np.abs(distance) - 1), tolerance, "face {} misses the unit sphere by")
    elif kind == "edge":
        tail, head = gauss.corners, gauss.corners[gauss.next_corner]
        along = points[head] - points[tail]
        moment = np.linalg.norm(np.cross(points[tail], along), axis=1)
        with np.errstate(invalid="ignore"):
            miss = np.abs(moment / np.linalg.norm(along, axis=1) - 1)
        names = [f"{i}-{j}" for i, j in zip(tail.tolist(), head.tolist(), strict=True)]
        _all_below(miss, tolerance, "edge {} misses the unit sphere by", names)
    elif kind == "vertex":
        used = np.unique(gauss.corners)
        miss = np.abs(np.linalg.norm(points[used], axis=1) - 1)
        names = [str(v) for v in used.tolist()]
        _all_below(miss, tolerance, "vertex {} misses the unit sphere by", names)
    else:
        raise ValueError(f'kind = "{kind}"; use "face", "edge" or "vertex"')


def assert_simple(mesh: PolyMesh) -> None:
    """Assert that no face crosses or touches itself.

    Raises
    ------
    AssertionError
        Naming the first face that does, and how many do.
    """
    bad = np.flatnonzero(~simple_faces(mesh))
    if len(bad):
        raise AssertionError(f"face {bad[0]} is not a simple polygon; {len(bad)} faces in all")


def assert_closed_solid(solid: Solid, tolerance: float = 1e-9) -> None:
    """Assert that a solid is closed, not inside out, and has simple faces in their planes.

    Parameters
    ----------
    solid : Solid
    tolerance : float
        For planarity, over the size of the solid.

    Raises
    ------
    AssertionError
        Saying what is wrong, and with which face.
    """
    if not is_closed(solid):
        raise AssertionError("an edge of the solid does not belong to two opposite faces")
    volume = float(volumes([solid])[0])
    if not volume > 0:
        raise AssertionError(f"the solid is inside out or empty: its volume is {volume:g}")
    mesh = PolyMesh.from_faces(solid.vertices, solid.faces)
    size = float(np.ptp(solid.vertices, axis=0).max())
    _all_below(planarity(mesh) / size, tolerance, "face {} is off its plane, over the size,")
    assert_simple(mesh)


def assert_same_mesh(mesh: PolyMesh, other: PolyMesh) -> None:
    """Assert that two meshes are the same to the last bit: faces, order and coordinates.

    Raises
    ------
    AssertionError
        Naming the first vertex that differs.
    """
    _same_faces(mesh, other)
    if mesh.vertices.shape != other.vertices.shape:
        raise AssertionError(f"{len(mesh.vertices)} vertices against {len(other.vertices)}")
    differs = np.flatnonzero((mesh.vertices != other.vertices).any(axis=1))
    if len(differs):
        v = int(differs[0])
        raise AssertionError(f"vertex {v} is {mesh.vertices[v]} against {other.vertices[v]}")


def _same_faces(mesh: PolyMesh, other: PolyMesh) -> None:
    if not (
        np.array_equal(mesh.starts, other.starts) and np.array_equal(mesh.corners, other.corners)
    ):
        raise AssertionError("the meshes do not have the same faces")


def _all_below(
    values: FloatArray, tolerance: float, said: str, names: list[str] | None = None
) -> None:
    if not len(values):
        raise AssertionError("there is nothing to measure")
    worst = int(np.argmax(values))  # the first that is not a number, if there is one
    if not values[worst] <= tolerance:
        name = names[worst] if names is not None else worst
        raise AssertionError(f"{said.format(name)} {values[worst]:.3e} > {tolerance:.1e}")

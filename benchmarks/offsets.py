"""Offsets of one mesh by our Gauss images and along vertex normals: torsion, planarity, heights.

Run: python benchmarks/offsets.py [--faces 300] [--depth 0.5] [--turn 10]

The peer is what mesh libraries call an offset: every vertex moves along its area-weighted vertex
normal. It is written out here, and when COMPAS is installed its own mesh offset is measured too.
"""

from __future__ import annotations

import argparse

import numpy as np

from phexfab.mesh.measures import mean_edge, relative_planarity
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import minimal_shell
from phexfab.parallel.face_offset import face_offset
from phexfab.parallel.offset import admissible_interval
from phexfab.parallel.support import (
    node_torsion,
    pair_beam_heights,
    support_structure,
    vertex_normals,
)
from phexfab.remesh.lattice import lattice
from phexfab.surface import surface


def vertex_normal_offset(mesh: PolyMesh, distance: float) -> PolyMesh:
    """Return the mesh with every vertex moved along its area-weighted unit normal."""
    return PolyMesh(mesh.vertices + distance * vertex_normals(mesh), mesh.corners, mesh.starts)


def compas_offset(mesh: PolyMesh, distance: float) -> PolyMesh | None:
    """Return COMPAS' offset of the same mesh, or None where COMPAS is not installed."""
    try:
        from compas.datastructures import Mesh
    except ImportError:
        return None
    theirs = Mesh.from_vertices_and_faces(
        mesh.vertices.tolist(), [face.tolist() for face in mesh.faces]
    )
    moved = theirs.offset(distance)
    keys = {key: k for k, key in enumerate(theirs.vertices())}
    points = np.empty_like(mesh.vertices)
    for key in moved.vertices():
        points[keys[key]] = moved.vertex_coordinates(key)
    return PolyMesh(points, mesh.corners, mesh.starts)


def report(name: str, mesh: PolyMesh, moved: PolyMesh, distance: float) -> None:
    step = PolyMesh((moved.vertices - mesh.vertices) / distance, mesh.corners, mesh.starts)
    torsion = node_torsion(mesh, step).torsion
    quads = relative_planarity(support_structure(mesh, step, distance))
    spread = pair_beam_heights(mesh, step, distance).spread
    print(
        f"{name:34}{torsion.max():12.1e}{np.median(torsion):12.1e}"
        f"{relative_planarity(moved).max():12.1e}{quads.max():12.1e}{spread:12.1e}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--faces", type=int, default=300)
    parser.add_argument("--depth", type=float, default=0.5, help="share of the admissible depth")
    parser.add_argument(
        "--turn", type=float, default=0.0, help="degrees of the lattice off the curvature lines"
    )
    asked = parser.parse_args()
    smooth = surface("enneper").scaled(1000.0)
    u0, u1, v0, v1 = smooth.rectangle
    size = np.sqrt((u1 - u0) * (v1 - v0) / asked.faces / (np.sqrt(3) / 2))
    on = lattice(smooth.rectangle, size, turn=asked.turn)
    print(
        f"{'offset':34}{'torsion, °':>12}{'median, °':>12}{'faces':>12}{'beam quads':>12}"
        f"{'heights':>12}"
    )
    for kind in ("face", "edge", "vertex"):
        shell = minimal_shell(smooth, on, kind)
        mesh = shell.mesh
        d = asked.depth * admissible_interval(shell)[0]
        size = f"{len(shell.panels)} panels, mean edge {mean_edge(mesh):.0f} mm"
        print(f"{kind} type, {size}, offset by {d:.0f} mm:")
        ours = PolyMesh(mesh.vertices + d * shell.gauss.vertices, mesh.corners, mesh.starts)
        report("  ours: Gauss image", mesh, ours, d)
        report("  ours: face offset by angles", mesh, face_offset(mesh, d), d)
        report("  vertices along vertex normals", mesh, vertex_normal_offset(mesh, d), d)
        theirs = compas_offset(mesh, d)
        if theirs is None:
            print("  COMPAS: not installed")
        else:
            report("  COMPAS: Mesh.offset", mesh, theirs, d)


if __name__ == "__main__":
    main()

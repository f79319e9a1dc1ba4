"""Umbilics of a line field on a mesh: found by winding, gathered, and made vertices.

An umbilic of order m is a zero of order m of Q, so the lines turn by −m/2 around it. Zeros that a
mesh scatters over neighbouring triangles, and zeros nearer to each other than a share of the
lattice step, become one vertex of the summed order; Q around it follows a polynomial that is
fitted to the vertices near by.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components, dijkstra

from phexfab.errors import LatticeError, MeshError
from phexfab.remesh.mesh_lattices.line_field import LineField, chart_hopf, triangle_frames
from phexfab.remesh.mesh_lattices.local_hopf import local_hopf
from phexfab.remesh.mesh_lattices.patchwork import Patchwork
from phexfab.triangular import mean_distance

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

MERGE = 0.5
"""Umbilics nearer than this share of the lattice step, in w, become one."""


def lattice_step(field: LineField, panel_size: float, row_ratio: float) -> float:
    """Return the lattice step in w, √mm, at which panels have a median size in mm.

    Raises
    ------
    LatticeError
        If the size is not positive, or the surface is a plane.
    """
    if not (np.isfinite(panel_size) and panel_size > 0):
        raise LatticeError(f"the panel size is {panel_size} mm; it must be a positive number")
    kappa = field.curvatures[field.triangles].mean(axis=1)
    share = kappa * field.areas  # ∝ number of panels
    order = np.argsort(kappa)
    total = np.cumsum(share[order])
    if not total[-1] > 0:
        raise LatticeError("the surface is a plane: it has no curvature lines to follow")
    middle = float(kappa[order][np.searchsorted(total, total[-1] / 2)])
    return panel_size * float(np.sqrt(middle)) / mean_distance(row_ratio)


def edge_graph(field: LineField, lengths: FloatArray) -> sp.csr_matrix:
    """Return the graph of the mesh's edges with these lengths."""
    a, b = field.half.ends.T
    n = len(field.points)
    weight = np.maximum(lengths, 1e-12 * max(float(lengths.max(initial=0.0)), 1e-300))
    return sp.csr_matrix((np.tile(weight, 2), (np.r_[a, b], np.r_[b, a])), shape=(n, n))


def with_umbilics(field: LineField, step: float) -> LineField:
    """Return the field with every umbilic a vertex and Q's zeros gathered there.

    Parameters
    ----------
    field : LineField
        As `line_field` returns it.
    step : float
        Lattice step in w, √mm: umbilics nearer than `MERGE` of it become one.

    Raises
    ------
    MeshError
        If the field winds the wrong way somewhere (no minimal surface does), or the mesh is too
        coarse at an umbilic.
    LatticeError
        If a row of umbilics is too long to become one.
    """
    seeds = np.flatnonzero(field.indices)
    if not len(seeds):
        return field
    groups = _groups(field, seeds, step)
    lengths = edge_graph(field, field.lengths)
    work = Patchwork(field)
    for members in groups:
        order = int(field.indices[members].sum())
        places = _zeros(field, members)
        if order < 0:
            raise MeshError(
                f"the curvature lines wind by {-order / 2:+g} turns at "
                f"{_show(places.mean(axis=0))} mm, which no minimal surface does: the mesh is too "
                "coarse or its directions are wrong there"
            )
        local = local_hopf(field, lengths, members, places, order)
        work.replace(local)
        if order:
            work.insert(local)
    done = work.field()
    stray = np.flatnonzero((done.indices != 0) & ~done.is_cone[done.triangles].any(axis=1))
    held = np.zeros(len(done.points), np.int64)
    np.add.at(held, done.triangles.ravel(), np.repeat(done.indices, 3))
    wrong = np.flatnonzero(held[done.cones] != done.orders)
    if len(stray) or len(wrong):
        where = (
            done.points[done.triangles[stray[0]]].mean(axis=0)
            if len(stray)
            else done.points[done.cones[wrong[0]]]
        )
        near = int(np.linalg.norm(done.points[done.cones] - where, axis=1).argmin())
        if done.orders[near] > 1 and (field.indices[seeds] > 0).sum() > len(groups):
            raise LatticeError(
                f"umbilics of total order {done.orders[near]} lie within half a lattice step "
                f"around {_show(done.points[done.cones[near]])} mm: choose smaller panels, so that "
                "each has its own"
            )
        raise MeshError(
            f"the mesh is too coarse to tell the umbilics apart near {_show(where)} mm: refine "
            "it there"
        )
    return done


def _show(place: FloatArray) -> str:
    return "(" + ", ".join(f"{x:.1f}" for x in place) + ")"


def _groups(field: LineField, seeds: IntArray, step: float) -> list[IntArray]:
    """Return the triangles that hold zeros, in groups that are to be one umbilic."""
    graph = edge_graph(field, np.abs(field.edge_steps))
    apart = np.empty((len(seeds), len(seeds)))
    corners = field.triangles[seeds]
    for i, own in enumerate(corners):
        distance = dijkstra(graph, indices=own, limit=2 * MERGE * step, min_only=True)
        apart[i] = distance[corners].min(axis=1)
    _, label = connected_components(sp.csr_matrix(apart <= MERGE * step), directed=False)
    groups = [np.flatnonzero(label == k) for k in range(label.max() + 1)]
    for members in groups:
        if not np.isfinite(apart[np.ix_(members, members)]).all():
            places = _zeros(field, seeds[members])
            width = float(np.linalg.norm(places - places.mean(axis=0), axis=1).max())
            raise LatticeError(
                f"{len(members)} umbilics within {2 * width:.0f} mm around "
                f"{_show(places.mean(axis=0))} mm are too near to each other for panels of their "
                "own and too far apart for a common one: choose smaller panels"
            )
    return [seeds[members] for members in groups]


def _zeros(field: LineField, triangles: IntArray) -> FloatArray:
    """Return (k, 3) places where Q, linear in each triangle, vanishes."""
    tri = field.triangles[triangles]
    first, second = triangle_frames(field, triangles)
    q = np.stack([chart_hopf(field, tri[:, k], first, second) for k in range(3)], axis=1)
    found = np.empty((len(tri), 3))
    for k, row in enumerate(q):
        system = np.array([row.real, row.imag, np.full(3, np.abs(row).max(initial=1e-300))])
        weight = np.linalg.lstsq(system, np.array([0.0, 0.0, system[2, 0]]), rcond=None)[0]
        weight = np.maximum(weight, 0.0)
        found[k] = weight / weight.sum() @ field.points[tri[k]]
    return found

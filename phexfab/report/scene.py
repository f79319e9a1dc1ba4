"""Scenes: what a picture shows, as triangles with a family, a part and a face each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from phexfab.fabrication.parts import FAMILY_COLOURS, Node, Parts, Solid
from phexfab.mesh.polymesh import PolyMesh
from phexfab.report.triangulate import triangulate

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]

SPHERE_COLOUR = (0.88, 0.91, 0.95)


@dataclass(frozen=True, eq=False)
class Layer:
    """One family of parts, ready to be drawn.

    Attributes
    ----------
    family : str
    marks : tuple of str
        One per part.
    colours : (P, 3) array
        Colour of each part, 0 to 1.
    vertices : (n, 3) array
    triangles : (T, 3) int array
    face, part : (T,) int arrays
        Face and part of each triangle; an edge is drawn wherever two faces meet in the picture.
    lines : (L, 2) int array
        Vertex pairs, the same edges for a view that draws lines.
    vertex_part : (n,) int array
        Part of each vertex, ascending; parts share no vertices.
    closed : bool
        True for solids, whose far side can be left out.
    """

    family: str
    marks: tuple[str, ...]
    colours: FloatArray
    vertices: FloatArray
    triangles: IntArray
    face: IntArray
    part: IntArray
    lines: IntArray
    vertex_part: IntArray
    closed: bool = True


def solid_layer(
    family: str, marks: Sequence[str], solids: Sequence[Solid], colour: tuple[float, float, float]
) -> Layer:
    """Return a layer of polyhedra, one part each."""
    counts = np.array([len(s.vertices) for s in solids], np.int64)
    n_faces = np.array([len(s.faces) for s in solids], np.int64)
    sides = np.fromiter((len(f) for s in solids for f in s.faces), np.int64)
    offsets = np.repeat(np.cumsum(counts) - counts, n_faces)
    corners = np.fromiter(chain.from_iterable(f for s in solids for f in s.faces), np.int64)
    vertices = np.concatenate([np.zeros((0, 3)), *(np.asarray(s.vertices, float) for s in solids)])
    starts = np.concatenate([[0], np.cumsum(sides)]).astype(np.int64)
    mesh = PolyMesh(vertices, corners + np.repeat(offsets, sides), starts)
    triangles, face = triangulate(mesh)
    owner = np.repeat(np.arange(len(solids)), n_faces)
    heads = mesh.corners[mesh.next_corner]
    lines = np.column_stack([mesh.corners, heads])[mesh.corners < heads]
    return Layer(
        family=family,
        marks=tuple(marks),
        colours=np.tile(np.array(colour, float), (len(solids), 1)),
        vertices=vertices,
        triangles=triangles,
        face=face,
        part=owner[face],
        lines=lines,
        vertex_part=np.repeat(np.arange(len(solids)), counts),
    )


def hub_layer(nodes: Sequence[Node], facets: int = 14) -> Layer:
    """Return a layer of cylinders as prisms; their mantle is drawn as one face."""
    count = len(nodes)
    base = np.array([n.cylinder.base for n in nodes], float).reshape(-1, 3)
    axis = np.array([n.cylinder.axis for n in nodes], float).reshape(-1, 3)
    radius = np.array([n.cylinder.radius for n in nodes], float)
    length = np.array([n.cylinder.length for n in nodes], float)
    seed = np.eye(3)[np.abs(axis).argmin(1)]
    first = np.cross(seed, axis)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    second = np.cross(axis, first)
    turn = 2 * np.pi * np.arange(facets) / facets
    circle = np.cos(turn)[:, None] * first[:, None] + np.sin(turn)[:, None] * second[:, None]
    low = base[:, None] + radius[:, None, None] * circle
    high = low + (length[:, None] * axis)[:, None]
    vertices = np.concatenate([low, high], 1).reshape(-1, 3)

    here = np.arange(facets)
    there = (here + 1) % facets
    inner = np.arange(1, facets - 1)
    bottom = np.column_stack([0 * inner, inner + 1, inner])
    top = facets + np.column_stack([0 * inner, inner, inner + 1])
    side = np.column_stack([here, there, facets + there, here, facets + there, facets + here])
    one = np.concatenate([bottom, top, side.reshape(-1, 3)])
    label = np.repeat([0, 1, 2], [len(bottom), len(top), 2 * facets])
    rims = np.column_stack([here, there])
    rims = np.concatenate([rims, rims + facets])
    shift = 2 * facets * np.arange(count)[:, None, None]
    return Layer(
        family="nodes",
        marks=tuple(n.mark for n in nodes),
        colours=np.tile(np.array(FAMILY_COLOURS["nodes"]), (count, 1)),
        vertices=vertices,
        triangles=(one + shift).reshape(-1, 3),
        face=(label + 3 * np.arange(count)[:, None]).ravel(),
        part=np.repeat(np.arange(count), len(one)),
        lines=(rims + shift).reshape(-1, 2),
        vertex_part=np.repeat(np.arange(count), 2 * facets),
    )


def mesh_layer(family: str, mesh: PolyMesh, marks: Sequence[str], colours: FloatArray) -> Layer:
    """Return a layer with one part per face of a mesh; faces are seen from both sides."""
    # Faces get vertices of their own, so that each can have its own colour and mark.
    apart = PolyMesh(mesh.vertices[mesh.corners], np.arange(len(mesh.corners)), mesh.starts)
    triangles, face = triangulate(apart)
    return Layer(
        family=family,
        marks=tuple(marks),
        colours=np.asarray(colours, float),
        vertices=apart.vertices,
        triangles=triangles,
        face=face,
        part=face,
        lines=np.column_stack([apart.corners, apart.next_corner]),
        vertex_part=mesh.face_of_corner,
        closed=False,
    )


def gauss_layer(mesh: PolyMesh, marks: Sequence[str], colours: FloatArray) -> Layer:
    """Return the faces of a Gauss image, all turned outwards.

    Where K < 0 the Gauss map reverses the sense of a face; a picture tells near from far by it.
    """
    layer = mesh_layer("gauss image", mesh, marks, colours)
    a, b, c = np.moveaxis(layer.vertices[layer.triangles], 1, 0)
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), a + b + c) < 0
    triangles = np.where(inwards[:, None], layer.triangles[:, ::-1], layer.triangles)
    return replace(layer, triangles=triangles)


def sphere_layer(rings: int = 32) -> Layer:
    """Return the unit sphere as one part that is one face."""
    polar = np.pi * np.arange(rings + 1) / rings
    around = np.pi * np.arange(2 * rings) / rings
    vertices = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(around),
            np.sin(polar)[:, None] * np.sin(around),
            np.repeat(np.cos(polar)[:, None], 2 * rings, 1),
        ],
        axis=2,
    ).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(rings), np.arange(2 * rings), indexing="ij")
    a = 2 * rings * i + j
    b = 2 * rings * i + (j + 1) % (2 * rings)
    quads = np.stack([a, a + 2 * rings, b + 2 * rings, a, b + 2 * rings, b], axis=2)
    triangles = quads.reshape(-1, 3)
    none = np.zeros(len(triangles), np.int64)
    return Layer(
        family="sphere",
        marks=("unit sphere",),
        colours=np.array([SPHERE_COLOUR]),
        vertices=vertices,
        triangles=triangles,
        face=none,
        part=none,
        lines=np.zeros((0, 2), np.int64),
        vertex_part=np.zeros(len(vertices), np.int64),
    )


def assembly_layers(parts: Parts) -> tuple[Layer, ...]:
    """Return the layers of all families that have parts: panels, beams, nodes."""
    layers = []
    if parts.panels:
        marks, solids = [p.mark for p in parts.panels], [p.solid for p in parts.panels]
        layers.append(solid_layer("panels", marks, solids, FAMILY_COLOURS["panels"]))
    if parts.beams:
        marks, solids = [b.mark for b in parts.beams], [b.solid for b in parts.beams]
        layers.append(solid_layer("beams", marks, solids, FAMILY_COLOURS["beams"]))
    if parts.nodes:
        layers.append(hub_layer(parts.nodes))
    return tuple(layers)

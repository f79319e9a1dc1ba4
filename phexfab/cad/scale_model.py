"""A scale model for 3D printers: the shell in one piece, and its panels laid flat on plates.

At 1:50 a sheet of 8 mm is a foil that no printer lays down, so what is thinner than the printer's
wall is made as thick as that, on the side where it lies in the building: the skin between two
parallel meshes, ribs where there are beams. Everything is one closed solid; where the shell cannot
be that thick without running into itself it is refused.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from phexfab.cad.triangles import Body, require_closed
from phexfab.errors import PartError
from phexfab.fabrication.clash import as_prism, clashes, triangulations
from phexfab.fabrication.frames import edge_frames
from phexfab.fabrication.parts import Cylinder, Parts, Solid
from phexfab.fabrication.polyhedra import prism_faces, volumes
from phexfab.parallel.offset import admissible_interval
from phexfab.parallel.shell import Shell

if TYPE_CHECKING:
    from manifold3d import Manifold

FloatArray = NDArray[np.float64]

SCALES = (1, 2, 5, 10, 20, 25, 50, 100, 200, 250, 500, 1000, 2000, 5000)
"""What a model may be fitted to: one to so many."""
_GRID = 4  # decimals of a mm: what STL's single precision keeps on any bed
_ROOT = 0.25  # of the skin's thickness: how far ribs reach into it
_HUB = 0.6  # of a rib's width: radius that fills the notches between ribs


@dataclass(frozen=True)
class ScaleModel:
    """How a shell is printed.

    Attributes
    ----------
    scale : float or None
        20 is 1:20; None takes the largest of ``SCALES`` that fits the bed.
    bed : (float, float, float)
        Length, width and height that the printer can print, mm.
    wall : float
        Least thickness of anything printed, mm.

    Raises
    ------
    PartError
        If a number is not above zero.
    """

    scale: float | None = None
    bed: tuple[float, float, float] = (220.0, 220.0, 250.0)
    wall: float = 1.2

    def __post_init__(self) -> None:
        for name, value in (
            ("scale", 1.0 if self.scale is None else self.scale),
            ("bed", min(self.bed)),
            ("wall", self.wall),
        ):
            if not (np.isfinite(value) and value > 0):
                raise PartError(f"the model's {name} is {value:g}; give a number above 0")


def printed_shell(shell: Shell, parts: Parts, spec: ScaleModel) -> tuple[Body, float]:
    """Return the whole shell as one closed solid, and the scale it is printed at.

    Parameters
    ----------
    shell : Shell
    parts : Parts
        Panels tell where the skin lies and how thick it is, beams become ribs.
    spec : ScaleModel

    Returns
    -------
    body : Body
        In mm on the printer, standing in the middle of the bed.
    scale : float

    Raises
    ------
    PartError
        If it does not fit the bed, or cannot be as thick as the wall; the message names what does.
    """
    if spec.scale is not None:
        points = _printed(shell, parts, spec.scale, spec.wall)
        _refuse_larger(np.ptp(points[0], axis=0), spec)
        return _standing(*points, spec), spec.scale
    size = np.ptp(shell.mesh.vertices, axis=0)
    for scale in (s for s in SCALES if _fits(size / s, spec.bed)):
        points = _printed(shell, parts, scale, spec.wall)
        if _fits(np.ptp(points[0], axis=0), spec.bed):
            return _standing(*points, spec), scale
    raise PartError(f"the shell of {size.max():.0f} mm fits no printer's bed at a usual scale")


def _printed(
    shell: Shell, parts: Parts, scale: float, wall: float
) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return points (mm on the printer) and triangles of the printed shell, anywhere in space."""
    from manifold3d import Manifold, OpType

    low, high = _skin_levels(shell, parts, scale, wall)
    pieces = [_as_manifold(_skin(shell, low, high))]
    ribs = _ribs(shell, parts, low, high, scale * wall)
    marks = [f"rib {k}" for k in range(len(ribs))]
    pieces += [
        _as_manifold(Body(mark, solid.vertices, triangles))
        for mark, solid, triangles in zip(marks, ribs, triangulations(ribs), strict=True)
    ]
    whole = pieces[0] if len(pieces) == 1 else Manifold.batch_boolean(pieces, OpType.Add)
    return as_arrays(whole.scale((1 / scale,) * 3))


def _skin_levels(shell: Shell, parts: Parts, scale: float, wall: float) -> tuple[float, float]:
    """Return the two offset distances between which the skin lies, in mm of the building."""
    if not parts.panels:
        raise PartError("there is no panel to print; the shell has none")
    heights = np.concatenate(
        [
            (p.solid.vertices - shell.mesh.vertices[shell.mesh.face(p.face)[0]])
            @ shell.normals[shell.panels[p.face]]
            for p in parts.panels
        ]
    )
    low, high = float(heights.min()), float(heights.max())
    # Faces of M + d·S lie d·h apart, h the height of S's face: 1 for a face offset, else less.
    nearest = float(shell.gauss_heights[shell.panels].min())
    thick = max(high - low, scale * wall)
    middle = (low + high) / 2
    share = 0.5 + np.clip(middle / (high - low), -0.5, 0.5)  # 1 outside, 0 inside, ½ centred
    low, high = (1 - share) * -thick, share * thick
    least, most = admissible_interval(shell)
    if nearest > 0 and least < low / nearest and high / nearest < most:
        return low / nearest, high / nearest
    room = min(
        (limit * nearest / share_ for limit, share_ in ((-least, 1 - share), (most, share))
         if share_ > 1e-9),
    )  # fmt: skip
    if not room > 0:
        raise PartError("the shell cannot be thickened: the faces of its Gauss image turn over")
    raise PartError(
        f"at 1:{scale:g} a wall of {wall:g} mm is {thick:.0f} mm in the building, but edges of the "
        f"shell flip beyond {room:.0f} mm; print it larger than 1:{room / wall:.0f}, or take a "
        f"wall below {room / scale:.2g} mm"
    )


def _skin(shell: Shell, low: float, high: float) -> Body:
    """Return the layer between two parallel meshes as one closed mesh."""
    mesh, gauss = shell.mesh, shell.gauss
    below, above = (mesh.vertices + d * gauss.vertices for d in (low, high))
    points = np.concatenate([below, above])
    n, faces = len(below), [mesh.face(f) for f in range(mesh.n_faces)]
    slabs = [Solid(np.concatenate([below[f], above[f]]), prism_faces(len(f))) for f in faces]
    marks = [f"panel {k + 1}" for k in range(len(slabs))]
    run_in = clashes(slabs, marks, 1e-3)
    if run_in:
        first = run_in[0]
        raise PartError(
            f"{first.mark_a} and {first.mark_b} of the model run into each other at a thickness of "
            f"{high - low:.0f} mm in the building; print it larger, or take a thinner wall"
        )
    border = shell.edges[shell.edges[:, 3] < 0]
    open_sides = {(int(i), int(j)) for i, j in border[:, :2]}
    triangles = []
    for face, local in zip(faces, triangulations(slabs), strict=True):
        k = len(face)
        caps, sides = local[: 2 * (k - 2)], local[2 * (k - 2) :].reshape(k, 2, 3)
        keep = [(int(a), int(b)) in open_sides
                for a, b in zip(face, np.roll(face, -1), strict=True)]  # fmt: skip
        used = np.concatenate([caps, sides[keep].reshape(-1, 3)])
        triangles.append(np.concatenate([face, face + n])[used])
    return Body("shell", points, np.concatenate(triangles))


def _ribs(shell: Shell, parts: Parts, low: float, high: float, least: float) -> list[Solid]:
    """Return a bar for every beam and a stub of its axis at every node, ``least`` thick or more."""
    if not parts.beams:
        return []
    edges = shell.edges[[beam.edge for beam in parts.beams]]
    frames = edge_frames(shell, edges[:, 0], edges[:, 1])
    m, s = shell.mesh.vertices, shell.gauss.vertices
    solids: list[Solid] = []
    deepest: dict[int, tuple[float, float, float]] = {}  # per node: bottom, top, half width
    for k, beam in enumerate(parts.beams):
        from_edge = beam.solid.vertices - m[edges[k, 0]]
        heights = from_edge @ frames.up[k] / frames.distance[k]
        downward = abs(heights.min()) > abs(heights.max())
        top = low + _ROOT * (high - low) if downward else high - _ROOT * (high - low)
        bottom = min(heights.min(), low - least) if downward else max(heights.max(), high + least)
        half = max(2 * np.abs(from_edge @ frames.left[k]).max(), least) / 2
        ends = edges[k, :2]
        line = {d: m[ends] + d * s[ends] for d in (top, bottom)}
        quad = np.concatenate([line[bottom], line[top][::-1]])
        shift = half * frames.left[k]
        ring = np.concatenate([quad + shift, quad - shift])
        solids.append(_outward(Solid(ring, prism_faces(4))))
        for v in ends.tolist():
            old = deepest.get(v, (bottom, top, half))
            deepest[v] = (
                max(old[0], bottom, key=abs), max(old[1], top, key=abs), max(old[2], half)
            )  # fmt: skip
    radii = {node.vertex: node.cylinder.radius for node in parts.nodes}
    for v, (bottom, top, half) in sorted(deepest.items()):
        base, axis = m[v] + bottom * s[v], (top - bottom) * s[v]
        length = float(np.linalg.norm(axis))
        radius = max(2 * _HUB * half, radii.get(v, 0.0))
        solids.append(as_prism(Cylinder(base, axis / length, radius, length), 24))
    return solids


def _outward(solid: Solid) -> Solid:
    if volumes([solid])[0] > 0:
        return solid
    return replace(solid, faces=tuple(face[::-1] for face in solid.faces))


def _fits(size: FloatArray, bed: Sequence[float]) -> bool:
    """True when a box of this size stands on the bed, turned by a quarter if need be."""
    return bool(size[2] <= bed[2] and np.all(np.sort(size[:2]) <= np.sort(bed[:2])))


def _refuse_larger(size: FloatArray, spec: ScaleModel) -> None:
    if spec.scale is None or _fits(size, spec.bed):
        return
    room = np.append(np.sort(spec.bed[:2]), spec.bed[2])
    needed = spec.scale * float((np.append(np.sort(size[:2]), size[2]) / room).max())
    x, y, z = size
    raise PartError(
        f"at 1:{spec.scale:g} the model is {x:.0f} × {y:.0f} × {z:.0f} mm, larger than the bed of "
        f"{' × '.join(f'{b:g}' for b in spec.bed)} mm; take a scale of 1:{np.ceil(needed):.0f}, "
        "or a larger bed"
    )


def _standing(points: FloatArray, triangles: NDArray[np.int64], spec: ScaleModel) -> Body:
    """Put a printed shell in the middle of the bed, turned so that it fits."""
    size = np.ptp(points, axis=0)
    if (size[0] - size[1]) * (spec.bed[0] - spec.bed[1]) < 0 and not (
        size[0] <= spec.bed[0] and size[1] <= spec.bed[1]
    ):
        points = np.column_stack([-points[:, 1], points[:, 0], points[:, 2]])
    low, high = points.min(axis=0), points.max(axis=0)
    target = np.array([spec.bed[0] / 2, spec.bed[1] / 2, (high - low)[2] / 2])
    return snapped("shell", points - (low + high) / 2 + target, triangles)


def _as_manifold(body: Body) -> Manifold:
    from manifold3d import Error, Manifold, Mesh64

    solid = Manifold(Mesh64(np.ascontiguousarray(body.points), body.triangles.astype(np.uint64)))
    if solid.status() != Error.NoError:
        raise PartError(f"{body.mark} of the model is not closed ({solid.status().name})")
    return solid


def as_arrays(solid: Manifold) -> tuple[FloatArray, NDArray[np.int64]]:
    """Return points and triangles of a manifold3d body."""
    mesh = solid.to_mesh64()
    points = np.asarray(mesh.vert_properties, float)[:, :3]
    return points, np.asarray(mesh.tri_verts).astype(np.int64)


def snapped(mark: str, points: FloatArray, triangles: NDArray[np.int64]) -> Body:
    """Return a closed body whose points lie on a grid of 0.1 µm: files keep that exactly.

    Raises
    ------
    PartError
        If it does not stay closed.
    """
    grid = np.round(points, _GRID) + 0.0
    unique, place = np.unique(grid, axis=0, return_inverse=True)
    merged = place.reshape(-1)[triangles]
    flat = (merged == np.roll(merged, 1, axis=1)).any(axis=1)
    body = _filled(Body(mark, unique, merged[~flat]))
    require_closed(body)
    return body


def _filled(body: Body) -> Body:
    """Return a body without the closed pockets inside it: nothing can be printed in there."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    tail, head = body.triangles.ravel(), np.roll(body.triangles, -1, axis=1).ravel()
    n = len(body.points)
    links = coo_array((np.ones(len(tail)), (tail, head)), shape=(n, n))
    count, piece = connected_components(links, directed=False)
    if count == 1:
        return body
    owner = piece[body.triangles[:, 0]]
    a, b, c = np.moveaxis(body.points[body.triangles], 1, 0)
    volume = np.bincount(owner, np.einsum("ij,ij->i", a, np.cross(b, c)), count)
    triangles = body.triangles[volume[owner] > 0]
    used, renamed = np.unique(triangles, return_inverse=True)
    return Body(body.mark, body.points[used], renamed.reshape(-1, 3))

"""What a polygon mesh from elsewhere is: counts, planarity, offset types, curvature.

Files say nothing of units: lengths are in the unit of the file, here called 1.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from phexfab.errors import MeshError, SolveError
from phexfab.mesh.alike import unwelded, welded
from phexfab.mesh.io import read_mesh
from phexfab.mesh.measures import (
    corner_angles,
    edge_lengths,
    edges,
    libhedra_planarity,
    planarity,
    relative_planarity,
    signed_areas,
    simple_faces,
)
from phexfab.mesh.polymesh import PolyMesh
from phexfab.parallel.classify import (
    circularity,
    classify_mesh,
    conicality,
    koebe_residual,
    quasi_circularity,
)
from phexfab.parallel.curvature import pair_curvatures
from phexfab.parallel.pairs import (
    classify_pair,
    gauss_from_pair,
    pair_interval,
    require_same_faces,
    worst_edge,
)
from phexfab.parallel.simple import is_simple
from phexfab.parallel.space import parallel_space
from phexfab.parallel.sphere_fit import fit_to_sphere, sphere_miss
from phexfab.parallel.support import node_torsion, torsion_of_axes

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
Value = int | float | str | bool | None | list[int] | dict[str, int]

KINDS = ("vertex", "edge", "face")
MANY = 3000  # vertices up to which the offset types of a mesh that is not trivalent are sought
_REFLEX = 180 + 1e-6


@dataclass(frozen=True, eq=False)
class Inspection:
    """What was found, in sections.

    Attributes
    ----------
    name : str
    sections : mapping of section to mapping of name to value
        Lengths in the unit of the file, angles in degrees, curvatures in 1/unit.
    notes : tuple of str
        What could not be measured, and why.
    """

    name: str
    sections: Mapping[str, Mapping[str, Value]]
    notes: tuple[str, ...] = ()

    def to_json(self) -> str:
        """Return everything as JSON with all digits; numbers that are not finite become null."""
        clean = {
            title: {name: _finite(value) for name, value in lines.items()}
            for title, lines in self.sections.items()
        }
        data = {"name": self.name, **clean, "notes": list(self.notes)}
        return json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def inspect_files(
    path: str | PathLike[str],
    offset: str | PathLike[str] | None = None,
    *,
    gauss: bool = False,
    tolerance: float | None = None,
) -> Inspection:
    """Read an OBJ or OFF file, and its offset where there is one, and measure them.

    Vertices are welded as by ``phexfab.mesh.polygons.import_polygons``, and ``counts`` says how
    many became one with another.

    Parameters
    ----------
    path, offset : path
    gauss : bool
        The second file is the Gauss image S itself, not an offset.
    tolerance : float, optional
        Make vertices one that are closer than this, in the unit of the file; see ``weld``. Left
        out, those that are one as files write them (``same_place``), unless that takes a face's
        corners away or parts the offset: then all stay, and a note says so.

    Raises
    ------
    MeshError
        If a file cannot be read, naming file and line, or the two do not correspond.
    """
    mesh = read_mesh(path)
    other = None if offset is None else read_mesh(offset)
    if other is not None:
        require_same_faces(mesh, other)
    used, refused = len(np.unique(mesh.corners)), []
    try:
        mesh, other = welded(mesh, other, tolerance)
    except MeshError as error:
        if tolerance is not None:
            raise
        refused = [f"vertices are left unwelded: {error}"]
        mesh, other = unwelded(mesh, other)
    found = inspect_mesh(mesh, other, gauss=gauss, name=Path(path).name)
    counts = {**found.sections["counts"], "vertices welded": used - len(mesh.vertices)}
    sections = {**found.sections, "counts": counts}
    return replace(found, sections=sections, notes=(*refused, *found.notes))


def inspect_mesh(
    mesh: PolyMesh, offset: PolyMesh | None = None, *, gauss: bool = False, name: str = "mesh"
) -> Inspection:
    """Measure a mesh, and the pair with its offset where there is one.

    Parameters
    ----------
    mesh : PolyMesh
        Every vertex belongs to a face.
    offset : PolyMesh, optional
        Of the same faces: an offset, or with ``gauss`` the Gauss image S.
    gauss : bool
    name : str

    Returns
    -------
    Inspection
        Sections ``counts``, ``edges``, ``faces``, ``offset types``; with an offset ``pair``;
        ``curvature`` with respect to the Gauss image of that pair, or else to the one found.

    Raises
    ------
    MeshError
        If the mesh has no face, or the two do not correspond.

    References
    ----------
    Thesis ch. 3, 4, 7.1.
    """
    if not mesh.n_faces:
        raise MeshError(f"{name} has no face, so there is nothing to measure")
    notes: list[str] = []
    sections: dict[str, dict[str, Value]] = {
        "counts": _counts(mesh, notes),
        "edges": _spread(edge_lengths(mesh), ("shortest", "mean", "longest")),
        "faces": _faces(mesh),
    }
    image, kind = None, ""
    if mesh.n_faces == 1 or sections["counts"]["pieces"] != mesh.n_faces:
        sections["offset types"], found = _types(mesh, notes)
        image, kind = found or (None, "")
    if offset is not None:
        require_same_faces(mesh, offset)
        sections["pair"], image = _pair(mesh, offset, gauss, notes)
        kind = "of the pair"
    elif image is not None:
        notes.append(
            "curvature is that of the Gauss image found, in its family the one with the least H; "
            "give the offset for its own"
        )
    if image is not None:
        sections["curvature"] = {"Gauss image": kind, **_curvature(mesh, image)}
    return Inspection(name, sections, tuple(notes))


def _counts(mesh: PolyMesh, notes: list[str]) -> dict[str, Value]:
    n = len(mesh.vertices)
    pairs = edges(mesh)
    tail, head = mesh.corners, mesh.corners[mesh.next_corner]
    key = np.minimum(tail, head) * n + np.maximum(tail, head)
    edge = np.searchsorted(pairs[:, 0] * n + pairs[:, 1], key)
    uses = np.bincount(edge, minlength=len(pairs))
    forward = np.bincount(edge[tail < head], minlength=len(pairs))
    border = pairs[uses == 1]
    valence = np.bincount(pairs.ravel(), minlength=n)
    inner = np.ones(n, bool)
    inner[pairs[uses != 2].ravel()] = False
    several = int((uses > 2).sum())
    turned = int(((uses == 2) & (forward != 1)).sum())
    pieces = _components(pairs, n)
    if several:
        notes.append(f"{several} edges belong to more than two faces")
    if turned:
        notes.append(f"{turned} edges have faces of opposite orientation on their two sides")
    if pieces > 1 and pieces == mesh.n_faces:
        length = float(edge_lengths(mesh).mean()) / 100
        notes.append(f"no two faces share a vertex; join them with --weld {length:.1g} or so")
    return {
        "vertices": n,
        "edges": len(pairs),
        "faces": mesh.n_faces,
        "Euler characteristic": n - len(pairs) + mesh.n_faces,
        "pieces": pieces,
        "borders": _components(border, n) if len(border) else 0,
        "border edges": len(border),
        "manifold and oriented": not several and not turned,
        "sides of faces": _histogram(mesh.sides),
        "valence of inner vertices": _histogram(valence[inner]),
        "valence on the border": _histogram(valence[~inner]),
        "simple mesh": is_simple(mesh),
    }


def _components(pairs: IntArray, n: int) -> int:
    used, index = np.unique(pairs, return_inverse=True)
    ends = index.reshape(-1, 2)
    graph = coo_array((np.ones(len(ends)), ends.T), shape=(len(used), len(used)))
    return int(connected_components(graph, directed=False)[0])


def _histogram(values: IntArray) -> dict[str, int]:
    keys, counts = np.unique(values, return_counts=True)
    return {str(key): int(count) for key, count in zip(keys, counts, strict=True)}


def _faces(mesh: PolyMesh) -> dict[str, Value]:
    areas = signed_areas(mesh)
    reflex = np.add.reduceat((corner_angles(mesh) > _REFLEX).astype(np.int64), mesh.starts[:-1])
    simple = simple_faces(mesh)
    return {
        **_spread(areas, ("smallest area", "mean area", "largest area")),
        "total area": float(areas.sum()),
        "planarity": float(planarity(mesh).max()),
        "planarity / mean edge": float(relative_planarity(mesh).max()),
        "libhedra planarity, %": float(libhedra_planarity(mesh).max()),
        "simple faces": int(simple.sum()),
        "convex faces": int((simple & (reflex == 0)).sum()),
        "reflex corners": int(reflex.sum()),
        "reflex corners of a face": _histogram(reflex),
    }


def _types(
    mesh: PolyMesh, notes: list[str]
) -> tuple[dict[str, Value], tuple[PolyMesh, str] | None]:
    """Return the residuals of all properties, and the Gauss image that fits with its type."""
    koebe = koebe_residual(mesh)
    result: dict[str, Value] = {
        "corners off a circle / size": float(circularity(mesh).max()),
        "off parallel to circular, °": float(quasi_circularity(mesh).max()),
        "planes off a cone": float(conicality(mesh).max()),
        "edges off the unit sphere": float(koebe.edges.max()),
        "edges off an incircle / size": float(koebe.incircles.max()),
        "incircles apart / edge": float(koebe.touching.max()),
    }
    if (mesh.sides == 3).all():
        notes.append("parallel to a mesh of triangles are scaled copies only: it has no offset")
        return result, None
    if not is_simple(mesh) and len(mesh.vertices) > MANY:
        notes.append(
            f"offset types are sought on meshes with three edges at every vertex, or up to {MANY} "
            "vertices"
        )
        return result, None
    try:
        space = parallel_space(mesh, tolerance=max(1e-8, 10 * relative_planarity(mesh).max()))
        found = classify_mesh(mesh, space=space)
    except (MeshError, SolveError) as error:
        notes.append(f"offset types: {error}")
        return result, None
    result["dimension of P(M)"] = found.dimension
    result["tolerance"] = found.tolerance
    for kind, fit in found.fits.items():
        result[f"{kind} offset misses by"] = fit.worst
    # A parallel mesh that has shrunk to a point lies on the sphere too, but is no offset.
    usable = [
        kind
        for kind in found.kinds
        if edge_lengths(found.fits[kind].gauss).max() > 1e-6
        and torsion_of_axes(mesh, found.fits[kind].gauss.vertices).tilt.max() <= 45
    ]
    result["offset types"] = ", ".join(usable) or "none"
    best = found.kind if found.kind in usable else (usable[0] if usable else None)
    if best is None:
        return result, None
    fit = found.fits[best]
    # Gauss images of one type come in families: of those that touch the sphere as well as the
    # digits allow, the one to which the mesh is most nearly minimal.
    picked = fit_to_sphere(space, best, fit.gauss, 200, minimal=0.1)
    if picked.worst > max(found.tolerance, fit.worst):
        picked = fit
    result[f"Gauss image, {best} type, misses by"] = picked.worst
    return result, (picked.gauss, f"found, {best} type")


def _pair(
    mesh: PolyMesh, offset: PolyMesh, gauss: bool, notes: list[str]
) -> tuple[dict[str, Value], PolyMesh]:
    sine, (i, j) = worst_edge(mesh, offset)
    result: dict[str, Value] = {"largest sine between edges": sine, "at edge": f"{i}-{j}"}
    if gauss:
        misses = {kind: float(sphere_miss(offset, kind).max()) for kind in KINDS}
        best = min(KINDS, key=lambda kind: misses[kind])
        result["type"] = best if misses[best] <= 1e-3 else "none"
        for kind in KINDS:
            result[f"{kind} type misses the sphere by"] = misses[kind]
        return result, offset
    found = classify_pair(mesh, offset)
    best = min(KINDS, key=lambda kind: found.spreads[kind])
    result["type"] = found.kind or "none"
    result["nearest type"] = best
    result["distance"] = found.distance
    for kind in KINDS:
        result[f"{kind} distance"] = found.distances[kind]
        result[f"{kind} distance's spread"] = found.spreads[kind]
    if sine > 1e-3:
        notes.append(
            "the two are not parallel: curvature and torsion below are those of their difference"
        )
    if found.distance == 0:
        raise MeshError("the two meshes have no distance from each other on the mean")
    return result, gauss_from_pair(mesh, offset, found.distance)


def _curvature(mesh: PolyMesh, gauss: PolyMesh) -> dict[str, Value]:
    found = pair_curvatures(mesh, gauss)
    low, high = pair_interval(mesh, gauss)
    return {
        **_spread(found.mean, ("smallest H", "mean H", "largest H")),
        **_spread(found.gaussian, ("smallest K", "mean K", "largest K")),
        "sum of K": found.total_gaussian,
        "largest |H|/√|K|": float(found.minimality.max()),
        "offset without flips from": low,
        "offset without flips to": high,
        "largest node torsion, °": float(node_torsion(mesh, gauss).torsion.max()),
        "with vertex normals, °": float(node_torsion(mesh).torsion.max()),
    }


def _spread(values: FloatArray, names: tuple[str, str, str]) -> dict[str, Value]:
    numbers = (float(values.min()), float(values.mean()), float(values.max()))
    return dict(zip(names, numbers, strict=True))


def _finite(value: Value) -> Value:
    return None if isinstance(value, float) and not np.isfinite(value) else value


def lines(found: Inspection) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Yield every section with its lines as texts."""
    for title, values in found.sections.items():
        yield title, [(name, _text(value)) for name, value in values.items()]


def _text(value: Value) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, dict):
        return ", ".join(f"{count} × {key}" for key, count in value.items()) or "none"
    return f"{value:.6g}" if isinstance(value, float) else str(value)

"""The rules about free-form surfaces and the methods by which they are covered with hexagons."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

from phexfab.design.problem import Problem

if TYPE_CHECKING:
    from phexfab.design import model as m

METHODS: dict[str, tuple[str, ...]] = {  # keys that mean something with some methods only
    "mesh.conjugation": ("dupin", "tangent"),
    "mesh.toward": ("dupin", "tangent", "conjugate"),
    "mesh.crossing": ("dupin", "tangent", "conjugate"),
    "mesh.closeness": ("dupin", "conjugate", "planarise"),
    "mesh.reference": ("planarise",),
    "mesh.fixed": ("planarise",),
    "mesh.border": ("planarise", "dupin", "conjugate"),
    "mesh.weld": ("planarise",),
    "mesh.centre": ("duality",),
    "mesh.start": ("parallel",),
    "lattice.turn": ("duality", "support"),
    "lattice.row_ratio": ("duality", "support"),
    "lattice.rows_along": (),
    "lattice.evenness": (),
    "border.panels": (),
    "border.direction": (),
    "border.sagitta": (),
    "border.sliver": (),
    "border.sliver_width": (),
}

WITH_METHODS: dict[str, dict[str, object]] = {
    # The only offsets that there are; and along parabolic curves neighbouring planes nearly
    # coincide, so that rounding shows in the direction of their edge.
    "offset": {"type": "face"},
    "checks": {"parallelism": 1e-9},
}
"""What keys mean that are left out, in a design with a ``mesh.method``."""


def with_methods(data: Mapping[str, Any]) -> dict[str, Any]:
    """Return the tables of a design, with what a method of ``[mesh]`` makes of keys left out."""
    out, mesh = dict(data), data.get("mesh")
    if not isinstance(mesh, Mapping) or mesh.get("method") is None:
        return out
    for table, keys in WITH_METHODS.items():
        given = out.get(table, {})
        if isinstance(given, Mapping):
            out[table] = {**keys, **given}
    return out


def free_form(
    surface: m.Surface, mesh: m.Mesh, offset: m.Offset, lattice: m.Lattice, border: m.Border
) -> Iterator[Problem]:
    """A free-form surface needs a method, a method a free-form surface, and both face offsets."""
    method, source = mesh.method, surface.source
    if method is None:
        if source == "step":
            yield Problem(
                "mesh.method",
                "a face of a CAD file is no minimal surface; how its hexagons are found is missing",
                'add method = "dupin" below [mesh]',
            )
    elif source not in ("step", "mesh"):
        yield Problem(
            "mesh.method",
            "belongs to a free-form surface (surface.step or surface.mesh); others are minimal",
            "leave it out, or give a STEP file or a mesh",
        )
    elif method == "planarise" and source != "mesh":
        yield Problem(
            "mesh.method",
            "planarising begins with a polygon mesh",
            'give surface.mesh = "panels.obj", or take method = "dupin"',
        )
    elif method == "power" and source != "step":
        yield Problem(
            "mesh.method",
            "power diagrams reach ellipsoids only, which a mesh is not exactly",
            'give the ellipsoid as surface.step, or take method = "support"',
        )
    if method is not None and offset.type != "face":
        yield Problem(
            "offset.type",
            "a hexagon mesh on a free-form surface has face offsets only: offsets of constant edge "
            "or vertex distance ask for a Gauss image whose edges or vertices lie on the sphere",
            'write type = "face"',
        )
    if method == "parallel" and mesh.start is None:
        yield Problem(
            "mesh.start",
            "moving planes parallel to themselves begins with a planar hexagon mesh",
            'add start = "hexagons.obj"',
        )
    if method == "planarise" and mesh.closeness is not None and mesh.reference is None:
        yield Problem(
            "mesh.closeness",
            "says how close panels keep to mesh.reference, which is missing",
            'add reference = "roof.step", or leave it out',
        )
    tables = {"mesh": mesh, "lattice": lattice, "border": border}
    for key, methods in METHODS.items():
        table, name = key.split(".")
        if method is None and table != "mesh":
            continue
        default = type(tables[table]).model_fields[name].default
        if getattr(tables[table], name) != default and method not in methods:
            known = " or ".join(f'"{one}"' for one in methods)
            text = f"belongs to mesh.method = {known}" if known else "belongs to minimal surfaces"
            yield Problem(key, text, "leave it out, or change that")

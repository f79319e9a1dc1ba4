"""Polygon meshes: arrays, measures, reading and writing (thesis chapter 3)."""

from phexfab.mesh.io import read_mesh, read_obj, read_off, weld, write_mesh, write_obj, write_off
from phexfab.mesh.polymesh import PolyMesh

__all__ = [
    "PolyMesh",
    "read_mesh",
    "read_obj",
    "read_off",
    "weld",
    "write_mesh",
    "write_obj",
    "write_off",
]

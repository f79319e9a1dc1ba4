"""Solids and STEP against what a CadQuery or build123d user would write, in the same run.

Run: python benchmarks/cad.py [--panels 300]
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import phexfab
import phexfab.cad.cadquery
from phexfab.cad.brep import to_shapes
from phexfab.cad.step import write_step
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.surface.catalog import surface


def clock(verb: Callable[[], Any], times: int = 3) -> float:
    """Return the shortest of a few runs, in seconds."""
    shortest = np.inf
    for _ in range(times):
        begin = time.perf_counter()
        verb()
        shortest = min(shortest, time.perf_counter() - begin)
    return shortest


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--panels", type=int, default=300)
    count = parser.parse_args().panels
    import build123d as bd
    import cadquery as cq

    smooth = surface("enneper").scaled(4000.0)
    u0, u1, v0, v1 = smooth.rectangle
    size = 4000.0 * np.sqrt((u1 - u0) * (v1 - v0) / count / 0.866) / 2
    shell = minimal_shell(smooth, lattice_on(smooth, size), "edge")
    begin = time.perf_counter()
    panels = phexfab.panels(shell, phexfab.PanelSpec(gap=4.0, edges="mitred"))
    made = time.perf_counter() - begin
    parts = phexfab.Parts(panels)
    n = len(panels)
    solids = [panel.solid for panel in panels]
    ours = clock(lambda: to_shapes(solids))
    few = solids[: max(10, n // 10)]

    def caps(solid: phexfab.Solid) -> tuple[list[tuple[float, ...]], list[tuple[float, ...]]]:
        half = len(solid.vertices) // 2
        points = [tuple(map(float, p)) for p in solid.vertices]
        return points[:half], points[half:]

    def lofted_cadquery() -> None:
        for solid in few:
            wires = [
                cq.Wire.makePolygon([cq.Vector(*p) for p in cap], close=True) for cap in caps(solid)
            ]
            cq.Solid.makeLoft(wires, ruled=True)

    def lofted_build123d() -> None:
        for solid in few:
            bd.loft([bd.Face(bd.Wire.make_polygon(cap)) for cap in caps(solid)], ruled=True)

    scale = n / len(few)
    rows = [
        ("panels as arrays", made, 0.0),
        ("solids in the kernel", ours, 0.0),
        ("… lofted in CadQuery", clock(lofted_cadquery, 1) * scale, ours),
        ("… lofted in build123d", clock(lofted_build123d, 1) * scale, ours),
    ]
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "a.step"
        direct = clock(lambda: write_step(parts, path))
        assembly = phexfab.cad.cadquery.to_cadquery(parts)
        rows.append(("STEP", direct, 0.0))
        rows.append(
            ("… by CadQuery's export", clock(lambda: assembly.export(str(path)), 1), direct)
        )
    print(f"{n} mitred panels")
    for name, seconds, base in rows:
        ratio = f"{seconds / base:8.1f} ×" if base else ""
        print(f"{name:28}{seconds * 1000:10.1f} ms{1000 * seconds / n:9.3f} ms each{ratio}")


if __name__ == "__main__":
    main()

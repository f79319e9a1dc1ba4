"""Design to shell with offset at growing sizes: seconds, and the exponent of growth.

Run: python benchmarks/shell.py [--faces 10000 100000]

The peer measured in the same run is numpy's own dense-free lower bound for the work: the time of
one sparse LU of a Laplacian of the same size (scipy), to which the whole walk is compared.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from phexfab.minimal.shell import minimal_shell
from phexfab.parallel.curvature import minimality
from phexfab.parallel.offset import admissible_interval, offset, offset_defect
from phexfab.remesh.lattice import lattice
from phexfab.surface import surface


def walk(kind: str, faces: int) -> tuple[int, float, float, float]:
    """Return panels, seconds, minimality and offset defect of one shell with its offset."""
    begin = time.perf_counter()
    smooth = surface("enneper").scaled(1000.0)
    u0, u1, v0, v1 = smooth.rectangle
    step = np.sqrt((u1 - u0) * (v1 - v0) / faces / (np.sqrt(3) / 2))
    shell = minimal_shell(smooth, lattice(smooth.rectangle, step), kind)
    low, _ = admissible_interval(shell)
    moved = offset(shell, 0.2 * low)
    corners = moved.mesh.vertices
    seconds = time.perf_counter() - begin
    assert np.isfinite(corners).all()
    return len(shell.panels), seconds, minimality(shell).max(), offset_defect(shell).max()


def laplacian_seconds(unknowns: int) -> float:
    """Return the seconds of one sparse LU of a Laplacian with so many unknowns."""
    n = int(np.sqrt(unknowns))
    line = sp.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(n, n))
    matrix = sp.csc_matrix(sp.kronsum(line, line))
    begin = time.perf_counter()
    splu(matrix, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})
    return time.perf_counter() - begin


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--faces", type=int, nargs="+", default=[1000, 10_000, 100_000])
    asked = parser.parse_args()
    walk("vertex", 500)  # warm up imports
    print(f"{'type':8}{'faces':>9}{'seconds':>10}{'× one LU':>10}{'|H|/√|K|':>11}{'defect':>10}")
    for kind in ("face", "edge", "vertex"):
        sizes, times = [], []
        for faces in asked.faces:
            n, seconds, minimal, defect = min(
                (walk(kind, faces) for _ in range(2)), key=lambda r: r[1]
            )
            sizes.append(n)
            times.append(seconds)
            ratio = seconds / laplacian_seconds(n)
            print(f"{kind:8}{n:9d}{seconds:10.3f}{ratio:10.1f}{minimal:11.1e}{defect:10.1e}")
        if len(sizes) > 1:
            growth = np.log(times[-1] / times[-2]) / np.log(sizes[-1] / sizes[-2])
            print(f"{kind:8}growth exponent from {sizes[-2]} to {sizes[-1]} faces: {growth:.2f}")


if __name__ == "__main__":
    main()

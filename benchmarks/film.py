"""The film of one rim: seconds and error of area, against mesh codes in the same run.

Run: python benchmarks/film.py [--points 64 128 256]

Peers: a plain Pinkall–Polthier iteration (written here: solve the cotangent Laplacian with the rim
held, repeat on the new surface), and Surface Evolver where the command ``evolver`` is installed
(Debian: apt-get install evolver): gradient steps, then its Hessian mode. Both get the same disc
mesh with a vertex at each rim point. The true area is that of our film on 1024 samples of the exact
curve, which agrees with 512 to 1e-13.

The last column of the second table is the time that a peer would need for the error of ours, from
its own error ~ 1/faces and time ~ faces, both measured in the first.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu
from scipy.spatial import Delaunay

from phexfab.surface.disc_films.plateau import plateau
from phexfab.surface.rims.rim import Rim

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
SIZE = 1000.0
SETTLED = 1e-9  # relative change of the area at which the iteration stops


def curve(angle: FloatArray) -> FloatArray:
    """The rim: a saddle with a third wave, (n, 3)."""
    up = 0.35 * np.cos(2 * angle) + 0.1 * np.cos(3 * angle + 1)
    return SIZE * np.stack([1.2 * np.cos(angle), np.sin(angle), up], -1)


def exact_area() -> float:
    """Area from the curve in closed form."""

    def slope(angle: FloatArray) -> FloatArray:
        up = -0.7 * np.sin(2 * angle) - 0.3 * np.sin(3 * angle + 1)
        return SIZE * np.stack([-1.2 * np.sin(angle), np.cos(angle), up], -1)

    turn = 2 * np.pi
    rim = Rim.of(lambda t: curve(turn * t), lambda t: turn * slope(turn * t))
    return plateau(rim, samples=1024).area


def disc_mesh(points: int) -> tuple[FloatArray, IntArray, IntArray]:
    """Vertices in the disc (v, 2), triangles and rim vertices: rings of about equal spacing."""
    rings = round(points / (2 * np.pi))
    flat = [np.zeros((1, 2))]
    for k in range(1, rings + 1):
        count = points if k == rings else max(round(points * k / rings), 3)
        angle = 2 * np.pi * (np.arange(count) + 0.5 * (k % 2 == 0) * (k < rings)) / count
        flat.append(k / rings * np.stack([np.cos(angle), np.sin(angle)], -1))
    vertices = np.concatenate(flat)
    triangles = Delaunay(vertices).simplices.astype(np.int64)
    return vertices, triangles, np.arange(len(vertices) - points, len(vertices))


def cotangents(x: FloatArray, triangles: IntArray) -> tuple[sp.csc_matrix, float]:
    """The cotangent Laplacian of a triangle mesh and its area."""
    rows, columns, values = [], [], []
    corner = x[triangles]
    cross = np.linalg.norm(
        np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1
    )
    for k in range(3):
        a, b = triangles[:, (k + 1) % 3], triangles[:, (k + 2) % 3]
        one, two = x[a] - x[triangles[:, k]], x[b] - x[triangles[:, k]]
        weight = 0.5 * (one * two).sum(1) / cross
        rows += [a, b, a, b]
        columns += [b, a, a, b]
        values += [-weight, -weight, weight, weight]
    matrix = sp.coo_matrix(
        (np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))), (len(x),) * 2
    )
    return sp.csc_matrix(matrix), 0.5 * float(cross.sum())


def start(flat: FloatArray) -> FloatArray:
    """The mesh in space: the rim's points scaled towards the middle."""
    angle = np.arctan2(flat[:, 1], flat[:, 0])
    return np.linalg.norm(flat, axis=1)[:, None] * curve(angle)


def pinkall_polthier(points: int) -> tuple[float, float]:
    """Area and seconds."""
    flat, triangles, rim = disc_mesh(points)
    x = start(flat)
    inner = np.setdiff1d(np.arange(len(x)), rim)
    begin, last = time.perf_counter(), np.inf
    for _ in range(2000):
        matrix, area = cotangents(x, triangles)
        if abs(last - area) <= SETTLED * area:
            break
        last = area
        right = -matrix[inner][:, rim] @ x[rim]
        x = x.copy()
        x[inner] = splu(sp.csc_matrix(matrix[inner][:, inner])).solve(right)
    return area, time.perf_counter() - begin


def evolver(points: int) -> tuple[float, float] | None:
    """Area and seconds of Surface Evolver on the same mesh, or None without it."""
    command = shutil.which("evolver")
    if command is None:
        return None
    flat, triangles, rim = disc_mesh(points)
    x = start(flat)
    held = set(rim.tolist())
    pairs = np.sort(
        np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    )
    edges, number = np.unique(pairs, axis=0, return_inverse=True)
    number = number.reshape(3, -1).T + 1
    lines = ["vertices"]
    lines += [
        f"{k + 1} {p[0]:.12f} {p[1]:.12f} {p[2]:.12f}{' fixed' if k in held else ''}"
        for k, p in enumerate(x.tolist())
    ]
    lines.append("edges")
    lines += [
        f"{k + 1} {a + 1} {b + 1}{' fixed' if a in held and b in held else ''}"
        for k, (a, b) in enumerate(edges.tolist())
    ]
    lines.append("faces")
    ends = np.concatenate([triangles, triangles[:, :1]], axis=1)
    for k, face in enumerate(number.tolist()):
        signs = [1 if ends[k, j] < ends[k, j + 1] else -1 for j in range(3)]
        lines.append(f"{k + 1} " + " ".join(str(s * e) for s, e in zip(signs, face, strict=True)))
    # Steps, averaging of vertices, then Newton until nothing changes.
    script = "g 50; V; g 50; hessian_normal; hessian; hessian; hessian; hessian; hessian; hessian;"
    lines += ["read", script, 'printf "AREA %20.15g\\n", total_area;', "quit", "q"]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "film.fe"
        file.write_text("\n".join(lines) + "\n")
        begin = time.perf_counter()
        ran = subprocess.run(
            [command, str(file)], input="q\nq\n", capture_output=True, text=True, timeout=600
        )
        seconds = time.perf_counter() - begin
    found = re.search(r"AREA\s+([0-9.eE+-]+)", ran.stdout)
    return (float(found.group(1)), seconds) if found else None


def ours(points: int) -> tuple[float, float, float]:
    """Area, conformality and the least of three times, from so many points of the rim."""
    angle = 2 * np.pi * np.arange(points) / points
    times = []
    for _ in range(3):
        begin = time.perf_counter()
        film = plateau(Rim.through(curve(angle)))
        times.append(time.perf_counter() - begin)
    return film.area, film.conformality, min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--points", type=int, nargs="+", default=[64, 128, 256])
    asked = parser.parse_args()
    true = exact_area()
    ours(32)  # warm up imports
    print(f"true area {true:.6f} mm²")
    print(f"{'points':>7}{'code':>20}{'seconds':>10}{'area error':>12}{'conformality':>14}")
    ratios = []
    for points in asked.points:
        area, defect, seconds = ours(points)
        error = abs(area / true - 1)
        print(f"{points:7d}{'phexfab':>20}{seconds:10.3f}{error:12.1e}{defect:14.1e}")
        found = {
            "Pinkall-Polthier": pinkall_polthier(points),
            "Surface Evolver": evolver(points),
        }
        for name, peer in found.items():
            if peer is None:
                print(f"{points:7d}{name:>20}{'not installed':>22}")
                continue
            off = abs(peer[0] / true - 1)
            print(f"{points:7d}{name:>20}{peer[1]:10.3f}{off:12.1e}")
            ratios.append(
                (points, name, peer[1] / seconds, off / error, error, seconds, off, peer[1])
            )
    print(f"\n{'points':>7}{'against':>20}{'× time':>10}{'× error':>12}{'× time at our error':>22}")
    for points, name, slower, worse, error, seconds, off, spent in ratios:
        print(
            f"{points:7d}{name:>20}{slower:10.1f}{worse:12.1e}{spent * off / error / seconds:22.1e}"
        )


if __name__ == "__main__":
    main()

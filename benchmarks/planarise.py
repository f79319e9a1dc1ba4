"""Noisy hexagon meshes made planar: seconds, planarity, motion, shortest edge, beside the peers.

Seconds are those of the processor, so that other work on the machine counts less; with one thread
they are those of the clock on an idle one. Of runs below a second it is the least of three.

Run: OMP_NUM_THREADS=1 python benchmarks/planarise.py [--faces 400 2500] [--noise 0.01] [--slow]

Peers, on the same meshes in the same run:

* guided projection as published (Tang et al. 2014): vertices and face normals unknown, quadratic
  constraints linearised, a term that holds to the last iterate; its normal equations solved by
  pypardiso where that is installed, and by scipy's sparse solver;
* scipy's ``least_squares`` (trust region, sparse Jacobian, lsmr) on the volumes of four corners;
* mpfp from PyPI where it is installed: up to 400 faces, larger meshes with ``--slow`` only.
"""

from __future__ import annotations

import argparse
import importlib.util
import sys
import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.sparse.linalg import spsolve

from phexfab.errors import SolveError
from phexfab.mesh.measures import edge_lengths, mean_edge, relative_planarity, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import tangent_shell
from phexfab.remesh.lattice import lattice
from phexfab.remesh.planarity.planarise import planarise
from phexfab.surface import surface
from phexfab.triangular import EQUILATERAL

FloatArray = NDArray[np.float64]
Solver = Callable[[PolyMesh], FloatArray]
GOAL = 1e-12


def hourglass(name: str, faces: int) -> PolyMesh:
    """Return planar hourglass hexagons, tangent planes of a minimal surface."""
    smooth = surface(name).scaled(1000.0)
    u0, u1, v0, v1 = smooth.rectangle
    step = np.sqrt((u1 - u0) * (v1 - v0) / faces / EQUILATERAL)
    return tangent_shell(smooth, lattice(smooth.rectangle, step)).mesh


def bricks(name: str, faces: int) -> PolyMesh:
    """Return hexagons in brick layout, vertices on a minimal surface: nearly planar."""
    smooth = surface(name).scaled(1000.0)
    u0, u1, v0, v1 = smooth.rectangle
    n = round(np.sqrt(faces))
    w = np.linspace(u0, u1, 2 * n + 2) + 1j * np.linspace(v0, v1, n + 1)[:, None]
    index = np.arange(w.size).reshape(w.shape)
    rows = []
    for j in range(n):
        for a in range(j % 2, 2 * n, 2):
            rows.append([*index[j, a : a + 3], *index[j + 1, a : a + 3][::-1]])
    used, corners = np.unique(np.array(rows), return_inverse=True)
    points = smooth.point(smooth.parameter(w.ravel()[used]))
    return PolyMesh.from_faces(points, corners.reshape(-1, 6))


def noisy(mesh: PolyMesh, share: float) -> PolyMesh:
    """Return the mesh with normal noise of a share of the mean edge on every coordinate."""
    noise = np.random.default_rng(5).normal(size=mesh.vertices.shape)
    return replace(mesh, vertices=mesh.vertices + share * mean_edge(mesh) * noise)


def ours(mesh: PolyMesh) -> FloatArray:
    """Return the vertices that ``planarise`` finds; the border is free as it is for the peers."""
    return planarise(mesh, keep_border=False, strict=False).mesh.vertices


def guided_projection(solve: Callable[[sp.csr_matrix, FloatArray], FloatArray]) -> Solver:
    """Return guided projection with a sparse solver."""

    def run(mesh: PolyMesh) -> FloatArray:
        size, n_v, n_f, n_c = (
            mean_edge(mesh),
            len(mesh.vertices),
            mesh.n_faces,
            len(mesh.corners),
        )
        x = mesh.vertices / size
        tail, head, face = mesh.corners, mesh.corners[mesh.next_corner], mesh.face_of_corner
        points = x[tail] - x[tail][mesh.starts[:-1]][face]
        normal = np.add.reduceat(np.cross(points, points[mesh.next_corner]), mesh.starts[:-1])
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        row, axis = np.arange(n_c)[:, None], np.arange(3)
        rows = np.concatenate(
            [np.repeat(row, 9, axis=1).ravel(), np.repeat(n_c + np.arange(n_f), 3)]
        )
        columns = np.concatenate(
            [
                np.hstack(
                    [
                        3 * head[:, None] + axis,
                        3 * tail[:, None] + axis,
                        3 * (n_v + face)[:, None] + axis,
                    ]
                ).ravel(),
                3 * n_v + np.arange(3 * n_f),
            ]
        )
        hold = 1e-3
        for _ in range(100):
            edge = x[head] - x[tail]
            values = np.concatenate(
                [np.hstack([normal[face], -normal[face], edge]).ravel(), 2 * normal.ravel()]
            )
            jacobian = sp.csr_matrix((values, (rows, columns)), shape=(n_c + n_f, 3 * (n_v + n_f)))
            right = np.concatenate(
                [np.einsum("ij,ij->i", edge, normal[face]), (normal**2).sum(axis=1) + 1.0]
            )
            now = np.concatenate([x.ravel(), normal.ravel()])
            matrix = (jacobian.T @ jacobian + hold**2 * sp.identity(len(now))).tocsr()
            new = solve(matrix, jacobian.T @ right + hold**2 * now)
            x, normal = new[: 3 * n_v].reshape(-1, 3), new[3 * n_v :].reshape(-1, 3)
            if relative_planarity(replace(mesh, vertices=x)).max() <= GOAL:
                break
        return x * size

    return run


def trust_region(mesh: PolyMesh) -> FloatArray:
    """Return what scipy's least squares finds from the volumes of consecutive corners."""
    size = mean_edge(mesh)
    c = np.arange(len(mesh.corners))
    four = [mesh.corners[c]]
    for _ in range(3):
        c = mesh.next_corner[c]
        four.append(mesh.corners[c])
    quads = np.column_stack(four)
    rows = np.repeat(np.arange(len(quads)), 12)
    columns = (3 * quads[:, :, None] + np.arange(3)).ravel()

    def volumes(flat: FloatArray) -> FloatArray:
        a, b, c, d = np.moveaxis(flat.reshape(-1, 3)[quads], 1, 0)
        return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a)

    def jacobian(flat: FloatArray) -> sp.csr_matrix:
        a, b, c, d = np.moveaxis(flat.reshape(-1, 3)[quads], 1, 0)
        by_b, by_c, by_d = np.cross(c - a, d - a), np.cross(d - a, b - a), np.cross(b - a, c - a)
        values = np.stack([-by_b - by_c - by_d, by_b, by_c, by_d], 1)
        return sp.csr_matrix((values.ravel(), (rows, columns)), shape=(len(quads), flat.size))

    found = least_squares(
        volumes,
        (mesh.vertices / size).ravel(),
        jacobian,
        xtol=1e-15,
        ftol=1e-15,
        gtol=1e-15,
        tr_solver="lsmr",
        max_nfev=60,
    )
    return np.asarray(found.x).reshape(-1, 3) * size


def mpfp(mesh: PolyMesh) -> FloatArray:
    """Return what mpfp finds with its own settings, in units of the mean edge."""
    from mpfp import MakePlanarSettings, make_planar_faces

    settings = MakePlanarSettings()
    settings.verbose = False
    size = mean_edge(mesh)
    faces = [face.tolist() for face in mesh.faces]
    return np.array(make_planar_faces(mesh.vertices / size, faces, [], settings)) * size


def solvers(faces: int, slow: bool) -> dict[str, Solver]:
    """Return the runs that this size is for."""
    runs: dict[str, Solver] = {"phexfab": ours}
    if importlib.util.find_spec("pypardiso"):
        import pypardiso

        runs["guided proj. pardiso"] = guided_projection(pypardiso.spsolve)
    if faces <= 2500 or slow:
        runs["guided proj. scipy"] = guided_projection(spsolve)
        runs["scipy least_squares"] = trust_region
    if importlib.util.find_spec("mpfp") and (faces <= 400 or (slow and faces <= 2500)):
        runs["mpfp"] = mpfp
    return runs


def timed(run: Solver, mesh: PolyMesh) -> tuple[FloatArray, float]:
    """Return vertices and seconds of the processor: of a short run the least of three."""
    least = np.inf
    for _ in range(3):
        begin = time.process_time()
        x = run(mesh)
        least = min(least, time.process_time() - begin)
        if least > 1.0:
            break
    return x, least


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--faces", type=int, nargs="+", default=[400, 2500, 10_000])
    parser.add_argument("--noise", type=float, default=0.01)
    parser.add_argument("--slow", action="store_true")
    parser.add_argument("--meshes", nargs="+", default=["hourglass", "bricks"])
    parser.add_argument("--surfaces", nargs="+", default=["enneper", "catenoid"])
    asked = parser.parse_args()
    ours(noisy(hourglass("enneper", 100), 0.01))  # warm up imports
    print(f"noise {asked.noise:g} of the mean edge on each coordinate; motion, planarity over it")
    print(
        f"{'':22}{'s':>9}{'planarity':>11}{'rms':>9}{'max':>9}"
        f"{'edge/own':>10}{'shortest':>10}{'crossing':>9}"
    )
    make = {"hourglass": hourglass, "bricks": bricks}
    for layout in asked.meshes:
        for name in asked.surfaces:
            for faces in asked.faces:
                mesh = noisy(make[layout](name, faces), asked.noise)
                size, before = mean_edge(mesh), edge_lengths(mesh)
                simple = simple_faces(mesh)
                print(
                    f"{layout} on {name}, {mesh.n_faces} faces, "
                    f"{relative_planarity(mesh).max():.1e}"
                )
                for label, run in solvers(faces, asked.slow).items():
                    try:
                        x, seconds = timed(run, mesh)
                    except (SolveError, RuntimeError) as error:
                        print(f"  {label:20}  failed: {error}", file=sys.stderr)
                        continue
                    made = replace(mesh, vertices=x)
                    moved = np.linalg.norm(x - mesh.vertices, axis=1) / size
                    after = edge_lengths(made)
                    print(
                        f"  {label:20}{seconds:9.3f}{relative_planarity(made).max():11.1e}"
                        f"{np.sqrt((moved**2).mean()):9.4f}{moved.max():9.3f}"
                        f"{(after / before).min():10.3f}{after.min() / before.min():10.3f}"
                        f"{int((simple & ~simple_faces(made)).sum()):9d}",
                        flush=True,
                    )


if __name__ == "__main__":
    main()

"""Every method of the thesis' chapter 5 on every kind of surface: faces, coverage, planarity.

Run: OMP_NUM_THREADS=1 python benchmarks/methods.py [--methods dupin …] [--surfaces torus …]
[--picture FILE]. Prints the table of docs/methods.md; a method that does not reach a surface says
why, by its own error.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from phexfab.errors import PhexError
from phexfab.mesh.measures import mean_edge, relative_planarity, shortest_edge, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.remesh.conjugate.fields import Family, level_family, principal_family
from phexfab.remesh.conjugate.hexagons import conjugate_hexagons
from phexfab.remesh.conjugate.sectors import conjugate_sectors
from phexfab.remesh.coverage import coverage
from phexfab.remesh.dupin.hexagons import tangent_hexagons
from phexfab.remesh.dupin.planar import dupin_hexagons
from phexfab.remesh.quads.planar_quads import principal_quads
from phexfab.remesh.survey.by_parallel_meshes import parallel_mesh_on
from phexfab.remesh.survey.power_diagram import power_diagram_on
from phexfab.remesh.survey.projective_dual import projective_dual_mesh
from phexfab.remesh.survey.support_function import support_function_mesh
from phexfab.remesh.triangulations.valid import prespecified_conjugation, progressive_conjugation
from phexfab.surface.freeform.surface import FreeformSurface, mesh_surface, nurbs, parametric


@dataclass(frozen=True)
class Case:
    """A surface, the size of its faces (mm), its conjugate family, the triangles it was given by.

    ``principal``: what quads follow; on a sphere every orthogonal net is one of curvature.
    """

    surface: FreeformSurface
    size: float
    family: Family
    principal: Family
    mesh: PolyMesh | None = None


def graph(height: Callable, width: float, depth: float, name: str) -> FreeformSurface:
    """Return z = height(x, y) over a rectangle."""
    box = (-width, width, -depth, depth)
    return parametric(lambda x, y: (x, y, height(x, y)), box, name=name)


def ellipsoid() -> FreeformSurface:
    """Return a belt of an ellipsoid, 12 × 8 × 6 m, with four umbilics."""

    def point(u, v):
        return 6e3 * np.cos(v) * np.cos(u), 4e3 * np.cos(v) * np.sin(u), 3e3 * np.sin(v)

    box = (0.0, 2 * np.pi, -1.0, 1.0)
    return parametric(point, box, periodic=(True, False), name="ellipsoid")


def torus() -> FreeformSurface:
    """Return a torus 16 m across."""

    def point(u, v):
        reach = 6000.0 + 2000.0 * np.cos(v)
        return reach * np.cos(u), reach * np.sin(u), 2000.0 * np.sin(v)

    box = (0.0, 2 * np.pi, 0.0, 2 * np.pi)
    return parametric(point, box, periodic=(True, True), name="torus")


def roof() -> FreeformSurface:
    """Return a spline vault of 14 × 10 m with bumps: K of both signs, umbilics."""
    x, y = np.meshgrid(np.linspace(0, 14000, 12), np.linspace(0, 10000, 9), indexing="ij")
    wave = np.cos(3 * np.pi * x / 14000 + 0.4) * (1 + 0.3 * np.cos(np.pi * y / 10000))
    z = 1500 * np.sin(np.pi * y / 10000) + 400 * wave
    knots = [np.repeat(np.linspace(0, 1, n - 2), [4, *[1] * (n - 4), 4]) for n in (12, 9)]
    return nurbs(np.stack([x, y, z], -1), (knots[0], knots[1]), (3, 3), name="roof")


def triangles_of(surface: FreeformSurface, n: int = 60, m: int = 45) -> PolyMesh:
    """Return a triangle mesh of a parametric surface."""
    u0, u1, v0, v1 = surface.domain
    grid = np.stack(np.meshgrid(np.linspace(u0, u1, n), np.linspace(v0, v1, m), indexing="ij"), -1)
    i, j = (a.ravel() for a in np.meshgrid(np.arange(n - 1), np.arange(m - 1), indexing="ij"))
    at = i * m + j
    low = np.stack([at, at + m, at + m + 1], axis=1)
    high = np.stack([at, at + m + 1, at + 1], axis=1)
    return PolyMesh.from_faces(surface.point(grid).reshape(-1, 3), np.concatenate([low, high]))


def cases() -> dict[str, Callable[[], Case]]:
    """Return the surfaces, made when asked for."""
    level, lines = level_family(lambda p: p[:, 0]), principal_family()

    def meshed() -> Case:
        triangles = triangles_of(roof())
        return Case(mesh_surface(triangles, name="roof mesh"), 600.0, level, lines, triangles)

    cap = graph(lambda x, y: np.sqrt(2.5e7 - x * x - y * y), 3000.0, 2500.0, "sphere cap")
    hypar = graph(lambda x, y: x * y / 5000.0, 3000.0, 2500.0, "hypar")
    monkey = graph(lambda x, y: (x**3 - 3 * x * y * y) / 3e7, 3000.0, 3000.0, "monkey saddle")
    return {
        "sphere cap": lambda: Case(cap, 500.0, level, level),
        "ellipsoid": lambda: Case(ellipsoid(), 700.0, lines, lines),
        "torus": lambda: Case(torus(), 900.0, lines, lines),
        "hypar": lambda: Case(hypar, 400.0, lines, lines),
        "monkey saddle": lambda: Case(monkey, 400.0, lines, lines),
        "roof": lambda: Case(roof(), 500.0, level, lines),
        "roof mesh": meshed,
    }


def dupin(case: Case) -> PolyMesh:
    """Pre-specified conjugation, Dupin centres, made planar."""
    made = prespecified_conjugation(case.surface, case.size)
    return dupin_hexagons(made, crossing="drop").mesh


def progressive(case: Case) -> PolyMesh:
    """Progressive conjugation, Dupin centres, made planar."""
    made = progressive_conjugation(case.surface, case.size)
    return dupin_hexagons(made, crossing="drop").mesh


def tangent(case: Case) -> PolyMesh:
    """Tangent planes at the points of a valid triangulation."""
    return tangent_hexagons(prespecified_conjugation(case.surface, case.size))[0]


def conjugate(case: Case) -> PolyMesh:
    """Hexagons in brick layout along conjugate curves."""
    return conjugate_sectors(case.surface, case.family, case.size, crossing="drop").mesh


def quads(kind: str) -> Callable[[Case], PolyMesh]:
    """Quads along principal curves."""

    def make(case: Case) -> PolyMesh:
        made = principal_quads(case.surface, case.size, kind, family=case.principal, levels=0)
        return made.mesh

    return make


def duality(case: Case) -> PolyMesh:
    """Projective duality."""
    return projective_dual_mesh(case.surface, case.size, mesh=case.mesh).shell.mesh


def support(case: Case) -> PolyMesh:
    """The support function over the Gaussian sphere."""
    return support_function_mesh(case.surface, case.size, mesh=case.mesh).mesh


def power(case: Case) -> PolyMesh:
    """A power diagram by stereographic projection; a part of an ellipsoid only."""
    return power_diagram_on(case.surface, case.size).mesh


def parallel(case: Case) -> PolyMesh:
    """The parallel mesh nearest to the surface, of the hexagons along conjugate curves."""
    one = conjugate_hexagons(case.surface, case.family, case.size, crossing="drop").mesh
    return parallel_mesh_on(one, case.surface, drop=True, mesh=case.mesh).shell.mesh


METHODS: dict[str, Callable[[Case], PolyMesh]] = {
    "dupin": dupin,
    "progressive": progressive,
    "tangent": tangent,
    "conjugate": conjugate,
    "quads": quads("planar"),
    "circular": quads("circular"),
    "conical": quads("conical"),
    "duality": duality,
    "support": support,
    "power": power,
    "parallel": parallel,
}


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a method made of a surface, or why it did not."""

    mesh: PolyMesh | None
    covered: float
    planarity: float
    crossing: int
    shortest: float
    gap: str
    refused: str
    seconds: float


def outcome(method: str, case: Case) -> Outcome:
    """Run one method on one surface."""
    begin = time.process_time()
    try:
        mesh = METHODS[method](case)
    except PhexError as error:
        seconds = time.process_time() - begin
        return Outcome(None, 0.0, np.nan, 0, np.nan, "", str(error), seconds)
    seconds = time.process_time() - begin
    under = coverage(case.surface, mesh)
    return Outcome(
        mesh,
        under.share,
        float(relative_planarity(mesh).max()),
        int((~simple_faces(mesh)).sum()),
        shortest_edge(mesh) / mean_edge(mesh),
        str(under.gaps[0]) if under.gaps else "",
        "",
        seconds,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--methods", nargs="+", default=list(METHODS))
    parser.add_argument("--surfaces", nargs="+", default=list(cases()))
    parser.add_argument("--picture", help="draw all meshes in one picture")
    asked = parser.parse_args()
    print("| method | surface | faces | covered | planarity | crossing | shortest / mean | s |")
    print("|---|---|---|---|---|---|---|---|")
    made: dict[tuple[str, str], Outcome] = {}
    for method in asked.methods:
        for name in asked.surfaces:
            case = cases()[name]()
            one = made[method, name] = outcome(method, case)
            if one.mesh is None:
                said = one.refused.replace("|", "/")
                print(f"| {method} | {name} | refused: {said} |||||| {one.seconds:.1f} |")
            else:
                print(
                    f"| {method} | {name} | {one.mesh.n_faces} | {one.covered:.0%} | "
                    f"{one.planarity:.0e} | {one.crossing} | {one.shortest:.2f} | "
                    f"{one.seconds:.1f} |"
                )
            print(end="", flush=True)
    if asked.picture:
        picture(asked.methods, asked.surfaces, made, asked.picture)


def picture(
    methods: list[str], names: list[str], made: dict[tuple[str, str], Outcome], path: str
) -> None:
    """Draw a contact sheet: a row for each method, a column for each surface."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    figure = plt.figure(figsize=(1.7 * len(names), 1.45 * len(methods)))
    for r, method in enumerate(methods):
        for c, name in enumerate(names):
            axes = figure.add_subplot(
                len(methods), len(names), 1 + c + r * len(names), projection="3d"
            )
            axes.axis("off")
            if r == 0:
                axes.set_title(name, fontsize=8)
            if c == 0:
                axes.text2D(
                    -0.05,
                    0.5,
                    method,
                    transform=axes.transAxes,
                    fontsize=8,
                    rotation=90,
                    va="center",
                    ha="right",
                )
            one = made[method, name]
            if one.mesh is None:
                axes.text2D(
                    0.5,
                    0.5,
                    "refused",
                    transform=axes.transAxes,
                    fontsize=7,
                    ha="center",
                    color="0.5",
                )
                continue
            mesh = one.mesh
            points = cases()[name]().surface
            points = points.point(points.seeds(2000))
            low, high = points.min(axis=0), points.max(axis=0)
            # A face that is flung far out would hide the others.
            far = np.abs(mesh.vertices - (low + high) / 2).max(axis=1)
            seen = [f for f in range(mesh.n_faces) if far[mesh.face(f)].max() < max(high - low)]
            faces = [mesh.polygon(f) for f in seen]
            axes.add_collection3d(Poly3DCollection(faces, fc="#cfe3ee", ec="#23323b", lw=0.2))
            axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
            axes.set_box_aspect(np.maximum(high - low, 1.0), zoom=1.2)
            axes.view_init(48, -60)
            axes.text2D(
                0.5,
                -0.02,
                f"{mesh.n_faces} faces, {one.covered:.0%}",
                transform=axes.transAxes,
                fontsize=6,
                ha="center",
            )
    figure.subplots_adjust(0.03, 0.01, 1, 0.97, 0, 0.05)
    figure.savefig(path, dpi=110)


if __name__ == "__main__":
    main()

"""Make two pages' pictures: python docs/figures_constructions.py"""

from __future__ import annotations

from dataclasses import replace
from decimal import Decimal, localcontext
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.colors import to_rgb
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from phexfab.mesh.measures import face_normals, simple_faces
from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.edge_offset import Ellipsoid, edge_offset_mesh
from phexfab.parallel.face_offset import normals_by_angles, normals_by_planes
from phexfab.parallel.laguerre import boost, laguerre
from phexfab.parallel.repair import repair_crossings
from phexfab.parallel.support import beam_heights, node_torsion, support_structure
from phexfab.surface.catalog import surface

FOLDER = Path(__file__).parent / "img"
INK, ACCENT, SOFT, PAPER = "#1d2733", "#b3542e", "#8fa3b5", "#f0e6d2"


def panels(axes, mesh: PolyMesh, colours) -> None:
    """Draw the faces of a mesh with flat shading."""
    polygons = [mesh.polygon(f) for f in range(mesh.n_faces)]
    light = np.abs(face_normals(mesh) @ (np.array([0.45, -0.3, 0.84])))
    tones = [np.array(to_rgb(c)) * (0.62 + 0.38 * t) for c, t in zip(colours, light, strict=True)]
    axes.add_collection3d(
        Poly3DCollection(polygons, facecolors=tones, edgecolors=INK, linewidths=0.4)
    )
    frame(axes, mesh.vertices)


def frame(axes, points, zoom: float = 1.5) -> None:
    """Give all three axes one scale and show nothing of them."""
    low, high = points.min(axis=0), points.max(axis=0)
    middle, half = (low + high) / 2, (high - low).max() / 2
    axes.set(
        xlim=(middle[0] - half, middle[0] + half),
        ylim=(middle[1] - half, middle[1] + half),
        zlim=(middle[2] - half, middle[2] + half),
    )
    axes.set_box_aspect((1, 1, 1), zoom=zoom)
    axes.set_axis_off()


def constructions() -> None:
    """One Koebe polyhedron on a dome, on a saddle with repairs, and boosted; digits of 6.3."""
    smooth = surface("enneper").scaled(1000.0)
    koebe = minimal_shell(smooth, lattice_on(smooth, 110.0), "edge")
    figure = plt.figure(figsize=(10, 3.2))
    views = [figure.add_subplot(1, 4, k + 1, projection="3d") for k in range(3)]
    dome = edge_offset_mesh(koebe, Ellipsoid(1300.0, 1000.0, 800.0)).shell
    panels(views[0], dome.mesh, [PAPER] * dome.mesh.n_faces)
    views[0].view_init(-62, -90)
    views[0].set_title("planes of S touching\nan ellipsoid", fontsize=9)
    noise = np.random.default_rng(4).normal(scale=9.0, size=len(koebe.heights))
    broken = replace(koebe, heights=koebe.heights + noise)
    fixed = repair_crossings(broken)
    bad = ~simple_faces(broken.mesh)
    panels(views[1], fixed.shell.mesh, np.where(bad, ACCENT, PAPER))
    views[1].view_init(-62, -90)
    views[1].set_title(f"{int(bad.sum())} crossing panels,\nrepaired within P(M)", fontsize=9)
    pushed = laguerre(koebe, boost([1.0, 0.0, 0.0], 0.5))
    panels(views[2], pushed.mesh, [PAPER] * pushed.mesh.n_faces)
    views[2].view_init(-62, -90)
    views[2].set_title("boosted along x:\nstill edge offset", fontsize=9)
    last = figure.add_subplot(1, 4, 4)
    slopes = np.logspace(0, -9, 28)
    turn = np.radians([3.0, 51.0, 290.0])
    for name, colour in (("planes (method 1)", ACCENT), ("angles (method 2)", INK)):
        errors = []
        for slope in slopes:
            edges = np.column_stack([np.cos(turn), np.sin(turn), slope * np.array([1, -0.7, 0.4])])
            exact = exact_normal(edges)
            normals, angles = faces_of(edges)
            if name.startswith("planes"):
                w = normals_by_planes(normals[None])[0]
            else:
                w = normals_by_angles(normals[None], angles[None])[0]
            errors.append(float(max(np.abs(w - exact).max(), 1e-17)))
        last.loglog(slopes, errors, ".-", ms=4, lw=0.9, color=colour, label=name)
    last.set_xlabel("slope of the corner", fontsize=8)
    last.set_title("error of the vertex normal", fontsize=9)
    last.invert_xaxis()
    last.tick_params(labelsize=7)
    last.legend(frameon=False, fontsize=7)
    for side in ("top", "right"):
        last.spines[side].set_visible(False)
    save("offset-constructions")


def faces_of(edges) -> tuple[np.ndarray, np.ndarray]:
    """Normals and interior angles of the three faces between them."""
    following = np.roll(edges, -1, axis=0)
    normals = np.cross(edges, following)
    normals = normals * np.sign(normals[:, 2:])
    normals = normals / np.sqrt((normals**2).sum(axis=1, keepdims=True))
    sine = (np.cross(edges, following) * normals).sum(axis=1)
    return normals, np.degrees(np.arctan2(sine, (edges * following).sum(axis=1))) % 360


def exact_normal(edges) -> np.ndarray:
    """The vector w with N_i·w = 1, by Cramer's rule in 60 digits."""
    with localcontext() as context:
        context.prec = 60
        rows = np.array([[Decimal(x) for x in edge] for edge in edges.tolist()])
        following = np.roll(rows, -1, axis=0)
        normals = cross(rows, following)
        normals = np.array([n / (n @ n).sqrt() * (1 if n[2] > 0 else -1) for n in normals])
        pairs = cross(np.roll(normals, -1, axis=0), np.roll(normals, -2, axis=0))
        return (pairs.sum(axis=0) / (normals[0] @ pairs[0])).astype(float)


def cross(a, b) -> np.ndarray:
    """Cross products of rows of any kind of number."""
    x, y, z = (a[:, i] * b[:, j] - a[:, j] * b[:, i] for i, j in ((1, 2), (2, 0), (0, 1)))
    return np.column_stack([x, y, z])


def support() -> None:
    """Support quads coloured by torsion with vertex normals and with S; heights by type."""
    smooth = surface("enneper").scaled(1000.0)
    on = lattice_on(smooth, 170.0)
    shells = {kind: minimal_shell(smooth, on, kind) for kind in ("face", "edge", "vertex")}
    mesh = shells["face"].mesh
    figure = plt.figure(figsize=(10, 3.4))
    found = node_torsion(mesh)
    exact = node_torsion(mesh, shells["face"].gauss)
    ramp = plt.get_cmap("OrRd")
    normals = PolyMesh(found.axes, mesh.corners, mesh.starts)
    for k, (gauss, torsion, title) in enumerate(
        (
            (normals, found.torsion, f"vertex normals: torsion to {found.torsion.max():.0f}°"),
            (shells["face"].gauss, exact.torsion, f"S: torsion to {exact.torsion.max():.0e}°"),
        )
    ):
        view = figure.add_subplot(1, 3, k + 1, projection="3d")
        quads = support_structure(mesh, gauss, -70.0)
        share = torsion / found.torsion.max()
        panels(view, quads, [ramp(0.08 + 0.8 * s)[:3] for s in share])
        frame(view, quads.vertices, 1.25)
        view.view_init(-50, -70)
        view.set_title(title, fontsize=9)
    last = figure.add_subplot(1, 3, 3)
    for kind, colour in (("face", ACCENT), ("edge", INK), ("vertex", SOFT)):
        heights = np.sort(beam_heights(shells[kind], -70.0).heights)
        last.plot(np.linspace(0, 100, len(heights)), heights, color=colour, label=f"{kind} type")
    last.set_ylabel("height of the beam, mm", fontsize=8)
    last.set_xlabel("beams, per cent", fontsize=8)
    last.tick_params(labelsize=7)
    last.legend(frameon=False, fontsize=8)
    for side in ("top", "right"):
        last.spines[side].set_visible(False)
    save("support-structure")


def save(name: str) -> None:
    """Write the current figure."""
    plt.tight_layout()
    plt.savefig(FOLDER / f"{name}.png", dpi=160, metadata={"Software": None})
    plt.close()


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    constructions()
    support()

"""Make the pictures on parallel meshes and offset types: python docs/figures_parallel.py"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from make_figures import ACCENT, FOLDER, INK, SOFT, save

from phexfab.mesh.polymesh import PolyMesh
from phexfab.minimal.shell import lattice_on, minimal_shell
from phexfab.parallel.classify import classify_mesh
from phexfab.parallel.nearest import admissible_member, deform, nearest_member
from phexfab.parallel.pairs import KINDS, ratios
from phexfab.parallel.space import parallel_space
from phexfab.surface.catalog import surface

PAPER = "#f0e6d2"


def draw(axis: plt.Axes, mesh: PolyMesh, tilt: float = 55.0, flipped: bool = False) -> None:
    """Draw a mesh in parallel projection, faces from back to front."""
    t = np.radians(tilt)
    up = np.array([0.0, np.cos(t), np.sin(t)])
    towards = np.array([0.0, -np.sin(t), np.cos(t)])
    flat = np.column_stack([mesh.vertices[:, 0], mesh.vertices @ up])
    depth = mesh.vertices @ towards
    for f in sorted(range(mesh.n_faces), key=lambda f: depth[mesh.face(f)].mean()):
        ring = flat[np.append(mesh.face(f), mesh.face(f)[:1])]
        axis.fill(ring[:, 0], ring[:, 1], fc=ACCENT if flipped else PAPER, ec=INK, lw=0.6)
    axis.set_aspect("equal")
    axis.axis("off")


def parallel_meshes_figure() -> None:
    """One mesh and three others with the same edge directions."""
    smooth = surface("enneper").scaled(1000.0)
    mesh = minimal_shell(smooth, lattice_on(smooth, 110.0), "edge").mesh
    space = parallel_space(mesh)
    x, y, z = mesh.vertices.T
    target = np.column_stack([x, y, z + 220 * np.cos(x / 110) * np.cos(y / 110)])
    nearest = nearest_member(space, target)
    kept = admissible_member(space, target, 0.25)
    corner, low = int(np.argmax(x + y)), int(np.argmin(x - y))
    middle = int(np.argmin(x * x + y * y))
    held = np.array([int(np.argmin(x + y)), corner, low, middle])
    pulled = deform(
        space,
        held,
        mesh.vertices[held] + [[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 100.0]],
        lower=0.15,
    )
    axes = plt.subplots(1, 4, figsize=(11.5, 3.9))[1]
    for axis, made, title in (
        (axes[0], mesh, f"M: {space.dimension} dimensions"),
        (axes[1], nearest, "nearest to a wave"),
        (axes[2], kept, "the same, ratios ≥ 0.25"),
        (axes[3], pulled.mesh, "middle pulled up by 100 mm"),
    ):
        draw(axis, made, 25.0)
        axis.set_title(
            f"{title}\nratios {ratios(mesh, made).min():.2f} to {ratios(mesh, made).max():.2f}"
        )
    save("parallel-meshes")


def offset_types_figure() -> None:
    """How well each type fits shells made for each type, as panels get smaller."""
    smooth = surface("enneper").scaled(1000.0)
    axes = plt.subplots(1, 3, figsize=(9.5, 3.2), sharey=True)[1]
    colours = dict(zip(KINDS, (ACCENT, INK, SOFT), strict=True))
    marks = dict(zip(KINDS, "os^", strict=True))
    for axis, made in zip(axes, KINDS, strict=True):
        faces, miss = [], {kind: [] for kind in KINDS}
        for size in (160.0, 110.0, 75.0, 50.0):
            mesh = minimal_shell(smooth, lattice_on(smooth, size), made).mesh
            found = classify_mesh(mesh)
            faces.append(mesh.n_faces)
            for kind in KINDS:
                miss[kind].append(max(found.fits[kind].worst, 1e-17))
        for kind in KINDS:
            axis.loglog(faces, miss[kind], marks[kind] + "-", ms=4, color=colours[kind], label=kind)
        axis.axhline(1e-11, ls="--", lw=0.8, color=INK)
        axis.set(title=f"shell of the {made} type", xlabel="panels", ylim=(1e-17, 1e-1))
        axis.xaxis.set_minor_formatter(plt.NullFormatter())
        axis.set_xticks(faces, [str(n) for n in faces])
    axes[0].set_ylabel("largest miss of the unit sphere")
    axes[0].annotate("taken as exact", (30, 1.6e-11), fontsize=8)
    axes[2].legend(
        frameon=False, title="Gauss image sought", loc="upper right", fontsize=7, ncols=3
    )
    save("offset-types")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    parallel_meshes_figure()
    offset_types_figure()

"""Make the pictures of the pages: python docs/make_figures.py"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from phexfab.fabrication.parts import FAMILY_COLOURS, Cylinder, Material, Node
from phexfab.minimal.shell import minimal_shell, surface_distance
from phexfab.parallel.curvature import minimality
from phexfab.parallel.offset import node_axes
from phexfab.pipeline import build
from phexfab.remesh.lattice import lattice
from phexfab.report.camera import View
from phexfab.report.fields import face_marks
from phexfab.report.figures import assembly_figure
from phexfab.report.scene import (
    Layer,
    gauss_layer,
    hub_layer,
    solid_layer,
    sphere_layer,
)
from phexfab.report.shade import picture
from phexfab.surface.catalog import catalog, surface
from phexfab.triangular import EQUILATERAL

FOLDER = Path(__file__).parent / "img"
EXAMPLES = Path(__file__).parent.parent / "examples"
INK, ACCENT, SOFT = "#1d2733", "#b3542e", "#8fa3b5"
plt.rcParams.update(
    {
        "font.family": "DejaVu Sans",
        "font.size": 9,
        "axes.edgecolor": INK,
        "axes.labelcolor": INK,
        "axes.spines.top": False,
        "axes.spines.right": False,
        "svg.hashsalt": "phexfab",
        "savefig.dpi": 160,
    }
)


def lattice_figure() -> None:
    """The lattice in curvature-line coordinates beside the hexagons it makes on the surface."""
    smooth = surface("enneper").scaled(1000.0)
    on = lattice((-0.45, 0.45, -0.39, 0.39), 0.15)
    shell = minimal_shell(smooth, on, "face")
    left, right = plt.subplots(1, 2, figsize=(9, 4.1))[1]
    w = on.points
    left.triplot(w.real, w.imag, on.triangles, color=SOFT, lw=0.8)
    border = np.setdiff1d(np.arange(len(w)), shell.panels)
    left.plot(w[shell.panels].real, w[shell.panels].imag, "o", ms=5, color=ACCENT)
    left.plot(w[border].real, w[border].imag, "o", ms=5, mfc="white", mec=INK)
    for angle in (45, 135):
        t = np.radians(angle)
        left.plot(*np.array([[-0.5, 0.5]]) * [[np.cos(t)], [np.sin(t)]], "--", lw=0.8, color=INK)
    label = {"boxstyle": "square,pad=0.1", "fc": "white", "ec": "none"}
    left.text(
        0.2, -0.2, "asymptotic", rotation=-45, ha="center", va="center", fontsize=8, bbox=label
    )
    left.set(
        xlabel="u", ylabel="v", aspect="equal", title="lattice points: panels and border planes"
    )
    mesh = shell.mesh
    for f in range(mesh.n_faces):
        ring = np.vstack([mesh.polygon(f), mesh.polygon(f)[:1]])
        right.fill(ring[:, 0], ring[:, 1], fc="#f0e6d2", ec=INK, lw=0.9)
    chosen = mesh.polygon(mesh.n_faces // 2)
    right.fill(chosen[:, 0], chosen[:, 1], fc=ACCENT, ec=INK, lw=0.9)
    right.set(
        xlabel="x, mm", ylabel="y, mm", aspect="equal", title="planar hexagons, seen from above"
    )
    save("lattice")


def convergence_figure() -> None:
    """Distance to the smooth surface falls with rate 2; the mean curvature is zero throughout."""
    left, right = plt.subplots(1, 2, figsize=(9, 3.6))[1]
    for name, colour in (("enneper", ACCENT), ("helicoid", INK), ("scherk-1", SOFT)):
        smooth = surface(name).scaled(1000.0)
        faces, distance, curvature = [], [], []
        for columns in (8, 16, 32, 64):
            a = 1.2 / columns
            rise = a * EQUILATERAL
            rows = int(1.2 / (1.2 / 8 * EQUILATERAL)) // 2 * 2 * columns // 8
            box = (-0.6, 0.6, -rows * rise / 2, rows * rise / 2)
            shell = minimal_shell(smooth, lattice(box, a), "edge")
            faces.append(len(shell.panels))
            distance.append(surface_distance(smooth, shell).max())
            curvature.append(minimality(shell).max())
        left.loglog(faces, distance, "o-", ms=4, color=colour, label=name)
        right.loglog(faces, curvature, "o-", ms=4, color=colour, label=name)
    guide = np.array([60.0, 4000.0])
    left.loglog(guide, 60 / guide * distance[0] * 1.6, "--", lw=0.8, color=INK)
    left.annotate("∝ panel size²", (500, 60 / 500 * distance[0] * 1.9), fontsize=8)
    left.set(xlabel="panels", ylabel="mm from the smooth surface")
    right.axhline(1e-10, ls="--", lw=0.8, color=INK)
    right.annotate("limit of the check", (60, 1.4e-10), fontsize=8)
    right.set(xlabel="panels", ylabel="largest |H|/√|K|", ylim=(1e-16, 1e-9))
    left.legend(frameon=False)
    save("convergence")


def pavilion_figure() -> None:
    """The README's picture: all parts of the first example."""
    built = build(EXAMPLES / "catenoid-pavilion.toml")
    view = View(azimuth=-66.0, elevation=21.0, opening=34.0)
    target = FOLDER / "pavilion.png"
    assembly_figure(built.parts, target, size=(1600, 1000), view=view, colours=256)


def gauss_images_figure() -> None:
    """The three Gauss images of one patch, where the unit sphere cuts them."""
    smooth = surface("enneper").scaled(1000.0)
    on = lattice((-0.52, 0.52, -0.48, 0.48), 0.16)
    sphere = replace(sphere_layer(160), colours=np.array([[0.86, 0.90, 0.95]]))
    names = {
        "face": "face: the faces touch the sphere",
        "edge": "edge: the edges touch it",
        "vertex": "vertex: the vertices lie on it",
    }
    look = View(azimuth=-68.0, elevation=58.0, opening=22.0)
    figure, axes = plt.subplots(1, 3, figsize=(12, 4.0))
    for ax, (kind, name) in zip(axes, names.items(), strict=True):
        shell = minimal_shell(smooth, on, kind)
        # Enneper's normals point downwards here: half a turn about x brings them up to the light.
        turn = np.array([1.0, -1.0, -1.0])
        mesh = replace(shell.gauss, vertices=shell.gauss.vertices * turn)
        warm = np.tile([[0.86, 0.62, 0.42]], (mesh.n_faces, 1))
        image = gauss_layer(mesh, face_marks(shell, ()), warm)
        edge = mesh.vertices[shell.edges[:, :2]]
        along = edge[:, 1] - edge[:, 0]
        share = -(edge[:, 0] * along).sum(1) / (along**2).sum(1)
        touching = {
            "face": shell.normals[shell.panels] * turn,
            "edge": edge[:, 0] + share[:, None] * along,
            "vertex": mesh.vertices,
        }[kind]
        dots = _dots(touching, 0.0125)

        def draw(layers, side="both", frame=image.vertices):
            drawn = picture(
                layers, (760, 680), look, supersample=3, lights=0, side=side, framing=frame
            )
            return drawn[..., :3] + (1 - drawn[..., 3:])

        # The sphere as thin glass: where it covers a face, the face shines through.
        cut, bare = draw([sphere, image, dots]), draw([image, dots], "front")
        open_air = draw([replace(image, colours=0 * warm)], "front").max(-1, keepdims=True) > 0.99
        ball = draw([sphere, dots])
        ax.imshow(np.clip(0.5 * cut + 0.5 * np.where(open_air, ball, bare), 0, 1))
        ax.set_axis_off()
        ax.set_title(name, color=INK, fontsize=11)
    figure.subplots_adjust(0.005, 0.005, 0.995, 0.92, wspace=0.02)
    figure.savefig(FOLDER / "gauss-images.png", dpi=110, metadata={"Software": None})
    plt.close(figure)


def _dots(points: np.ndarray, radius: float) -> Layer:
    """Small balls at points, as one layer."""
    ball = sphere_layer(8)
    count, n = len(points), len(ball.vertices)
    shift = n * np.arange(count)[:, None, None]
    each = np.arange(count)
    return replace(
        ball,
        marks=tuple(f"dot {k}" for k in each),
        colours=np.tile([[0.42, 0.14, 0.06]], (count, 1)),
        vertices=(points[:, None] + radius * ball.vertices).reshape(-1, 3),
        triangles=(ball.triangles + shift).reshape(-1, 3),
        face=np.repeat(each, len(ball.triangles)),
        part=np.repeat(each, len(ball.triangles)),
        vertex_part=np.repeat(each, n),
    )


def node_figure() -> None:
    """One node of the pavilion: three mitred bars that meet in its axis, a panel taken off."""
    built = build(EXAMPLES / "catenoid-pavilion.toml")
    shell, parts = built.shell, built.parts
    mesh = shell.mesh
    size = mesh.vertices.max(0) - mesh.vertices.min(0)
    inner = np.flatnonzero(np.bincount(mesh.corners, minlength=len(mesh.vertices)) == 3)
    wanted = mesh.vertices.mean(0) + size * [0.0, -0.5, 0.3]
    node = inner[np.linalg.norm(mesh.vertices[inner] - wanted, axis=1).argmin()]
    at = mesh.vertices[node]
    around = np.flatnonzero((shell.edges[:, :2] == node).any(1))
    bars = [beam for beam in parts.beams if beam.edge in around]
    faces = mesh.face_of_corner[mesh.corners == node]
    kept = [panel for panel in parts.panels if panel.face in faces[:2]]
    direction = node_axes(shell)[node]
    line = Cylinder(at - 40 * direction, direction, 2.0, 220.0)
    axis = Node("axis", int(node), line, Material("line", 0.0), (), 0.0, 0.0)
    layers = [
        solid_layer(
            "beams", [b.mark for b in bars], [b.solid for b in bars], FAMILY_COLOURS["beams"]
        ),
        solid_layer(
            "panels", [p.mark for p in kept], [p.solid for p in kept], FAMILY_COLOURS["panels"]
        ),
        hub_layer([axis]),
    ]
    # Set down with its axis upright, as it would lie on a bench.
    side = np.cross(direction, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    frame = np.array([side, np.cross(direction, side), direction])
    layers = [replace(layer, vertices=(layer.vertices - at) @ frame.T) for layer in layers]
    box = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-0.6, 1)])
    view = View(azimuth=-48.0, elevation=36.0, opening=26.0)
    image = picture(layers, (1000, 720), view, supersample=3, framing=170 * box, lights=200)
    colours = np.clip(image[..., :3] + 1 - image[..., 3:], 0, 1)
    plt.imsave(FOLDER / "node.png", colours, metadata={"Software": None})


def surfaces_figure() -> None:
    """The catalog's default patches, each with its curvature lines."""
    plt.figure(figsize=(9, 7))
    for k, name in enumerate(catalog):
        axes = plt.subplot(3, 4, k + 1, projection="3d")
        smooth = surface(name)
        u0, u1, v0, v1 = smooth.rectangle
        step = max(u1 - u0, v1 - v0) / (36 if smooth.period else 20)
        nu, nv = (round(side / step) + 1 for side in (u1 - u0, v1 - v0))
        w = np.linspace(u0, u1, nu)[:, None] + 1j * np.linspace(v0, v1, nv)
        x = np.moveaxis(smooth.point(smooth.parameter(w)), -1, 0)
        axes.plot_surface(*x, rstride=1, cstride=1, color="#f6efe2", edgecolor=INK, linewidth=0.35)
        # Seen from the side of the normal that is up or at the front, halfway to the ground.
        middle = smooth.parameter(complex(u0 + u1, v0 + v1) / 2)
        normal, (along, across) = smooth.normal(middle), smooth.principal_directions(middle)
        eye = normal * np.sign(normal @ [0.1, -0.2, 1.0]) + 0.7 * along - 0.15 * across
        eye *= 1 if eye[2] > 0 else [1, 1, -1]
        eye = np.array([0.6, -0.6, 0.45]) if smooth.period else eye / np.linalg.norm(eye)
        axes.view_init(*np.degrees([np.arcsin(eye[2]), np.arctan2(eye[1], eye[0])]))
        axes.set_box_aspect(np.ptp(x, axis=(1, 2)), zoom=1.15)
        axes.set_axis_off()
        axes.set_title(name, y=0.97)
    plt.subplots_adjust(left=0, right=1, bottom=0, top=0.96, wspace=0, hspace=0.12)
    plt.savefig(FOLDER / "surfaces.png", dpi=120, metadata={"Software": None})
    plt.close()


def save(name: str) -> None:
    """Write the current figure."""
    plt.tight_layout()
    plt.savefig(FOLDER / f"{name}.png", metadata={"Software": None})
    plt.close()


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    surfaces_figure()
    lattice_figure()
    convergence_figure()
    pavilion_figure()
    gauss_images_figure()
    node_figure()

"""Make the picture on seamless lattices: python docs/figures_seamless.py"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from make_figures import FOLDER, INK, save
from matplotlib.colors import to_rgb
from scipy.spatial import Delaunay

from phexfab.minimal.laplacian import solve_minimal
from phexfab.parallel.shell import Shell
from phexfab.remesh.mesh_lattices.trace import MeshLattice, mesh_lattice
from phexfab.report.camera import View
from phexfab.report.scene import mesh_layer
from phexfab.report.shade import picture
from phexfab.surface.construct import from_weierstrass
from phexfab.surface.mesh_films.atlas import atlas
from phexfab.surface.periodic.mesh import periodic_film

COLOURS = {6: "#d3c5a8", 9: "#b3542e"}


def shell_at(points: np.ndarray, normals: np.ndarray, found: MeshLattice) -> Shell:
    """Return the exact shell of a lattice with points and normals of the smooth surface."""
    heights = np.einsum("ij,ij->i", points, normals)
    ones, on = np.ones(len(points)), found.lattice
    return solve_minimal(Shell(normals, heights, ones, on.triangles, "face", points, on.step))


def umbilics_shell() -> Shell:
    """A patch with three umbilics: f = 1 and g' a polynomial with these zeros."""
    slope = 0.3 * np.poly([0.5, -0.35 + 0.3j, -0.2 - 0.5j])
    g = np.polyint(slope)
    smooth = from_weierstrass(
        lambda z: np.polyval(g, z),
        np.ones_like,
        base=0.37 + 0.11j,
        gauss_map_derivative=lambda z: np.polyval(slope, z),
        scale=1000.0,
    )
    k = np.repeat(np.arange(1, 46), 6 * np.arange(1, 46))
    turn = np.concatenate([np.arange(6 * n) / (6 * n) for n in range(1, 46)])
    z = np.r_[0.0, k / 45 * np.exp(2j * np.pi * turn)]
    triangles = Delaunay(np.column_stack([z.real, z.imag])).simplices
    points, q = smooth.point(z), smooth.hopf(z)
    directions = (smooth.tangent(z) / np.sqrt(q)[:, None]).real
    kappa = np.abs(q) * smooth.scale / smooth.conformal_factor(z) ** 2
    found = mesh_lattice(points, triangles, smooth.normal(z), directions, kappa, panel_size=32.0)
    at = found.on_mesh(z, triangles)
    return shell_at(smooth.point(at), smooth.normal(at), found)


def periodic_shell(cells: tuple[int, int, int], size: float) -> Shell:
    """Cells of Schwarz' P surface: one has six holes, four in a ring a handle as well."""
    film = periodic_film("schwarz-p", cell=1000.0, cells=cells, edge_length=size / 3, margin=size)
    mesh = film.points, film.triangles
    found = mesh_lattice(*mesh, film.normals, film.directions, film.curvatures, panel_size=size)
    smooth = atlas(*mesh, normals=film.normals, name=film.name)
    start = smooth.parameter_of_vertex(film.triangles[found.face, found.barycentric.argmax(1)])
    at = smooth.surface.closest_parameter(found.on_mesh(*mesh), start)
    return shell_at(smooth.surface.point(at), smooth.surface.normal(at), found)


def seamless_figure() -> None:
    """Three umbilics on a disc, a cell of the P surface, a ring of four cells."""
    cases = (
        (umbilics_shell(), "a disc, three umbilics", View(azimuth=-90, elevation=52, opening=20)),
        (periodic_shell((1, 1, 1), 55.0), "six holes, eight umbilics", View(-58, 26, opening=22)),
        (periodic_shell((2, 2, 1), 80.0), "a ring of four cells", View(-58, 38, opening=20)),
    )
    axes = plt.subplots(1, 3, figsize=(11, 3.9))[1]
    for axis, (shell, title, view) in zip(axes, cases, strict=True):
        mesh = shell.mesh
        colours = np.array([to_rgb(COLOURS[int(n)]) for n in mesh.sides])
        layer = mesh_layer("panels", mesh, [""] * mesh.n_faces, colours)
        image = picture([layer], (760, 760), view, supersample=2, lights=80, side="both")
        axis.imshow(np.clip(image[..., :3] + 1 - image[..., 3:], 0, 1))
        axis.set_title(f"{title}: {mesh.n_faces:,} panels", color=INK, fontsize=9)
        axis.axis("off")
    plt.subplots_adjust(left=0, right=1, bottom=0, top=0.93, wspace=0.02)
    save("seamless")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    seamless_figure()

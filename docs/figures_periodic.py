"""Make the picture on periodic surfaces: python docs/figures_periodic.py"""

from __future__ import annotations

import matplotlib.pyplot as plt
import numpy as np
from make_figures import FOLDER, INK, save

from phexfab.report.camera import View
from phexfab.report.scene import Layer
from phexfab.report.shade import picture
from phexfab.surface.periodic.closed_forms import PERIODIC
from phexfab.surface.periodic.mesh import PeriodicFilm, periodic_film

VIEW = View(azimuth=-58.0, elevation=24.0, opening=22.0)


def tubes(lines: list[np.ndarray], radius: float) -> Layer:
    """Return closed lines as thin tubes of six sides."""
    vertices, triangles, start = [], [], 0
    for line in lines:
        n = len(line)
        along = np.roll(line, -1, axis=0) - np.roll(line, 1, axis=0)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        side = np.cross(along, [0.31, 0.53, 0.79])
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        up = np.cross(along, side)
        angle = np.arange(6) * np.pi / 3
        ring = np.cos(angle)[:, None] * side[:, None] + np.sin(angle)[:, None] * up[:, None]
        vertices.append((line[:, None] + radius * ring).reshape(-1, 3))
        i, j = np.divmod(np.arange(6 * n), 6)
        a, b = start + 6 * i + j, start + 6 * i + (j + 1) % 6
        c, d = start + 6 * ((i + 1) % n) + j, start + 6 * ((i + 1) % n) + (j + 1) % 6
        triangles += [np.column_stack([a, b, d]), np.column_stack([a, d, c])]
        start += 6 * n
    return layer("borders", np.concatenate(vertices), np.concatenate(triangles), (0.11, 0.15, 0.2))


def layer(family: str, vertices: np.ndarray, triangles: np.ndarray, colour: tuple) -> Layer:
    """Return one smooth part: a single face, without lines."""
    none = np.zeros(len(triangles), np.int64)
    return Layer(
        family,
        (family,),
        np.array([colour]),
        vertices,
        triangles,
        none,
        none,
        np.zeros((0, 2), np.int64),
        np.zeros(len(vertices), np.int64),
        closed=False,
    )


def dots(points: np.ndarray, radius: float) -> Layer:
    """Return points as small balls."""
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 13)[:-1], np.linspace(0, np.pi, 8), indexing="ij")
    ball = np.stack([np.sin(v) * np.cos(u), np.sin(v) * np.sin(u), np.cos(v)], -1)
    i, j = np.divmod(np.arange(12 * 7), 7)
    a, b = 8 * i + j, 8 * ((i + 1) % 12) + j
    one = np.concatenate([np.column_stack([a, a + 1, b + 1]), np.column_stack([a, b + 1, b])])
    count = len(ball.reshape(-1, 3))
    vertices = (points[:, None] + radius * ball.reshape(1, -1, 3)).reshape(-1, 3)
    triangles = (one[None] + count * np.arange(len(points))[:, None, None]).reshape(-1, 3)
    return layer("umbilics", vertices, triangles, (0.70, 0.33, 0.18))


def layers(film: PeriodicFilm) -> list[Layer]:
    """The cut film, its borders and the umbilics in the box."""
    at = film.points[film.umbilics]
    at = at[((at > -1e-6) & (at < film.box + 1e-6)).all(axis=1)]
    return [
        layer("film", film.cut.points, film.cut.triangles, (0.90, 0.85, 0.75)),
        tubes([border.points for border in film.cut.borders], 0.006 * film.cell),
        dots(at, 0.018 * film.cell),
    ]


def cells_figure() -> None:
    """One cell of each surface and eight of them, cut at the box, with borders and flat points."""
    axes = plt.subplots(2, 3, figsize=(9.6, 6.6))[1]
    for column, name in enumerate(PERIODIC):
        for row, count in enumerate((1, 2)):
            film = periodic_film(name, cell=1000.0, cells=(count,) * 3, edge_length=18.0 * count)
            image = picture(layers(film), (560, 560), VIEW, supersample=2, lights=80, side="both")
            axis = axes[row, column]
            axis.imshow(np.clip(image[..., :3] + 1 - image[..., 3:], 0, 1))
            axis.axis("off")
            if not row:
                axis.set_title(name, color=INK)
    plt.subplots_adjust(wspace=0.02, hspace=0.02)
    save("periodic")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    cells_figure()

"""Make the picture of the page on files: python docs/figures_files.py"""

from __future__ import annotations

from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from phexfab.cad.model_plates import panel_plates
from phexfab.cad.scale_model import ScaleModel, printed_shell
from phexfab.cad.triangles import Body
from phexfab.mesh.measures import face_normals
from phexfab.mesh.polymesh import PolyMesh
from phexfab.pipeline import build
from phexfab.report.camera import View
from phexfab.report.fields import panel_fields
from phexfab.report.scene import Layer, mesh_layer
from phexfab.report.shade import picture

FOLDER = Path(__file__).parent / "img"
DESIGN = Path(__file__).parent.parent / "examples" / "first-shell.toml"
FILAMENT = (0.71, 0.66, 0.57)
SIZE = (760, 560)


def layer_of(bodies: list[Body]) -> Layer:
    """Return printed bodies as a layer; triangles of one plane are one face."""
    counts = [len(body.points) for body in bodies]
    starts = np.concatenate([[0], np.cumsum(counts)])
    triangles = np.concatenate([b.triangles + s for b, s in zip(bodies, starts, strict=False)])
    points = np.concatenate([body.points for body in bodies])
    part = np.repeat(np.arange(len(bodies)), [len(body.triangles) for body in bodies])
    normals = face_normals(PolyMesh.from_faces(points, triangles))
    level = np.einsum("ij,ij->i", normals, points[triangles[:, 0]])
    planes = np.column_stack([part, np.round(normals, 2), np.round(level, 1)])
    return Layer(
        family="model",
        marks=tuple(body.mark for body in bodies),
        colours=np.tile(FILAMENT, (len(bodies), 1)),
        vertices=points,
        triangles=triangles,
        face=np.unique(planes, axis=0, return_inverse=True)[1].ravel(),
        part=part,
        lines=np.zeros((0, 2), np.int64),
        vertex_part=np.repeat(np.arange(len(bodies)), counts),
    )


def files_figure() -> None:
    """The scale model from above and below, its panels on a plate, the shell by curvature."""
    built = build(DESIGN)
    spec = ScaleModel()
    body, scale = printed_shell(built.shell, built.parts, spec)
    plate = panel_plates(built.parts.panels, spec, scale)[0]
    marks = [panel.mark for panel in built.parts.panels]
    coloured = mesh_layer("panels", built.shell.mesh, marks, panel_fields(built.shell)[0].colours)
    views = (
        (layer_of([body]), View(-60, 32), f"model-3mf/shell.3mf, 1:{scale:g}"),
        (layer_of([body]), View(-60, -32), "the same from below: beams are ribs"),
        (layer_of(list(plate.panels[:24])), View(-90, 68), "panels of model-3mf/plate-1.3mf"),
        (coloured, View(-60, 32), "curvature.ply"),
    )
    figure, axes = plt.subplots(2, 2, figsize=(9.5, 7.6))
    for ax, (layer, view, title) in zip(axes.ravel(), views, strict=True):
        image = picture([layer], SIZE, view)
        ax.imshow(np.clip(image[..., :3] + 1 - image[..., 3:], 0, 1))
        ax.set_title(title, fontsize=10, color="#1d2733")
        ax.axis("off")
    figure.tight_layout()
    figure.savefig(FOLDER / "files.png", dpi=110)


if __name__ == "__main__":
    files_figure()

"""Make the pictures of comparison.md and inspect.md: python docs/figures_comparison.py"""

from __future__ import annotations

import tempfile
from pathlib import Path

import numpy as np

from phexfab.compare import compare
from phexfab.minimal.shell import minimal_shell
from phexfab.parallel.offset import offset
from phexfab.remesh.lattice import lattice
from phexfab.report.camera import View
from phexfab.report.figures import render
from phexfab.report.scene import mesh_layer
from phexfab.surface.catalog import surface

FOLDER = Path(__file__).parent / "img"
CANOPY = Path(__file__).parent.parent / "examples" / "enneper-canopy.toml"


def comparison_figure() -> None:
    """The canopy panelled three ways, as ``phexfab compare`` writes it."""
    with tempfile.TemporaryDirectory() as made:
        compare(CANOPY).write(made)
        (FOLDER / "comparison.png").write_bytes((Path(made) / "comparison.png").read_bytes())


def inspect_figure() -> None:
    """A shell and its offset: the pair that ``phexfab inspect`` measures."""
    shell = minimal_shell(
        surface("enneper").scaled(1000.0), lattice((-0.5, 0.5, -0.5, 0.5), 0.14), "vertex"
    )
    other = offset(shell, -80.0)
    layers = [
        mesh_layer(
            name,
            mesh,
            [f"face {f}" for f in range(mesh.n_faces)],
            np.tile(colour, (mesh.n_faces, 1)),
        )
        for name, mesh, colour in (
            ("M", shell.mesh, (0.88, 0.83, 0.71)),
            ("offset", other.mesh, (0.52, 0.66, 0.74)),
        )
    ]
    view = View(elevation=14)
    render(layers, FOLDER / "inspect.png", size=(1200, 760), view=view, ground=False, colours=192)


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    comparison_figure()
    inspect_figure()

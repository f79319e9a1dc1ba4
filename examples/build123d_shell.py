"""Open a shell in build123d and export a mock-up: one panel, drilled, on the beams that carry it.

python examples/build123d_shell.py [folder]
"""

import sys
from pathlib import Path

import build123d as b3d

import phexfab
from phexfab.build123d import PhexPart, PhexShell

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
build = phexfab.build(Path(__file__).with_name("catenoid-pavilion.toml"))

panel = PhexPart(build, "P017")
drilled = panel.place * (panel - b3d.Cylinder(radius=6, height=100))
drilled.label, drilled.color = panel.label, panel.color

carrying = [beam.mark for beam in build.parts.beams if panel.label in beam.neighbours]
frame = PhexShell(build, carrying)
mock_up = b3d.Compound(label="mock-up", children=[drilled, frame])
b3d.export_step(mock_up, folder / "mock-up.step")

volume = sum(solid.volume for solid in mock_up.solids())
print(f"{panel.label} on {len(carrying)} beams: {volume:.1f} mm³")

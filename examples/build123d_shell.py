"""Open a shell in build123d and export a mock-up: one panel, drilled, with the beams under it.

python examples/build123d_shell.py [folder]
"""

import sys
from pathlib import Path

import build123d as b3d

import phexfab

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
build = phexfab.build(Path(__file__).with_name("catenoid-pavilion.toml"))
mark = "P017"

shell = build.to_build123d()
part = {solid.label: solid for solid in shell.descendants if isinstance(solid, b3d.Solid)}
cap = part[mark].faces().sort_by(b3d.SortBy.AREA)[-1]
drilled = part[mark] - b3d.Plane(cap) * b3d.Cylinder(radius=6, height=100)
drilled.label, drilled.color = mark, part[mark].color

beams = [part[beam.mark] for beam in build.parts.beams if mark in beam.neighbours]
mock_up = b3d.Compound(label=f"mock-up {mark}", children=[drilled, *beams])
b3d.export_step(mock_up, folder / "mock-up.step")

print(f"{mark} with {len(beams)} beams: {mock_up.volume:.1f} mm³")

"""Open a shell in CadQuery, drill a panel, set pins on its nodes, export the whole assembly.

python examples/cadquery_shell.py [folder]
"""

import sys
from pathlib import Path

import cadquery as cq

import phexfab.cadquery  # adds methods to Workplane and Assembly

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
build = phexfab.build(Path(__file__).with_name("catenoid-pavilion.toml"))
assembly = build.to_cadquery()

part = assembly.objects["panels/P017"]
drilled = part.obj.faces(tag="top").workplane(centerOption="CenterOfMass").hole(12)
part.obj = drilled.solids()

corners = [mark for beam in build.parts.beams if "P017" in beam.neighbours for mark in beam.nodes]
pins = cq.Workplane().phexLocations(build, corners).eachpoint(cq.Solid.makeCylinder(8, 60), True)
for number, pin in enumerate(pins.vals(), 1):
    assembly.add(pin, name=f"pin-{number}", color=cq.Color("firebrick"))
assembly.export(str(folder / "shell-drilled.step"))

before = part.metadata["volume"]
print(f"P017: {before:.1f} mm³ before drilling, {drilled.val().Volume():.1f} mm³ after")

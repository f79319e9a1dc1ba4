"""Open a shell in CadQuery, drill one panel for its fixing, and export the whole assembly.

python examples/cadquery_shell.py [folder]
"""

import sys
from pathlib import Path

import cadquery as cq

import phexfab
import phexfab.cad.cadquery_plugin  # adds Workplane.phexParts and Workplane.phexShell

folder = Path(sys.argv[1] if len(sys.argv) > 1 else ".")
build = phexfab.build(Path(__file__).with_name("catenoid-pavilion.toml"))
mark = "P017"

caps = cq.selectors.AreaNthSelector(-1)  # the largest faces: front and back
drilled = (
    cq.Workplane()
    .phexParts(build, mark)
    .faces(caps)
    .first()
    .workplane(centerOption="CenterOfMass")
    .hole(12)
)

assembly = build.to_cadquery()
assembly.objects[f"panels/{mark}"].obj = drilled.val()
assembly.export(str(folder / "shell-drilled.step"))

before = next(panel.volume for panel in build.parts.panels if panel.mark == mark)
print(f"{mark}: {before:.1f} mm³ before drilling, {drilled.val().Volume():.1f} mm³ after")

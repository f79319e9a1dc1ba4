"""Our STEP files in programs that other people use: gmsh, and FreeCAD where it is installed."""

import json
import shutil
import subprocess

import pytest
from cad_samples import exact_volume, geometries, sample_parts

from phexfab.cad.step import StepHeader, write_step
from phexfab.fabrication.parts import FAMILY_COLOURS

SCHEMAS = ["AP214", "AP242"]


def families_of(parts):
    return {p.mark: f for f in ("panels", "beams", "nodes") for p in getattr(parts, f)}


@pytest.mark.parametrize("schema", SCHEMAS)
def test_gmsh_finds_every_part(tmp_path, schema):
    try:
        import gmsh
    except (ImportError, OSError) as error:  # its wheel needs a few system libraries
        pytest.skip(f"gmsh does not load: {error}")
    parts = sample_parts(8, 7, 6, seed=11)
    path = write_step(parts, tmp_path / "a.step", StepHeader("Shell", schema=schema))
    gmsh.initialize()
    try:
        gmsh.option.setNumber("General.Terminal", 0)
        gmsh.option.setNumber("Geometry.OCCImportLabels", 1)
        gmsh.model.occ.importShapes(str(path))
        gmsh.model.occ.synchronize()
        found = {}
        for dimension, tag in gmsh.model.getEntities(3):
            # Shapes/Shell/panels/panels/P001/P001 & & panels: the tree, and the layer last
            name, *layers = gmsh.model.getEntityName(dimension, tag).split(" & ")
            way = name.split("/")
            colour = gmsh.model.getColor(dimension, tag)[:3]
            volume = gmsh.model.occ.getMass(dimension, tag)
            found[way[-1]] = (way[1], way[2], layers[-1].strip("& "), colour, volume)
    finally:
        gmsh.finalize()
    wanted, exact = families_of(parts), geometries(parts)
    assert set(found) == set(wanted)
    for mark, (root, family, layer, colour, volume) in found.items():
        assert (root, family, layer) == ("Shell", wanted[mark], wanted[mark])
        assert [c / 255 for c in colour] == pytest.approx(FAMILY_COLOURS[family], abs=3e-3)
        assert volume == pytest.approx(exact_volume(exact[mark]), rel=1e-6)


SCRIPT = """
import json, os, FreeCAD
FreeCAD.ParamGet("User parameter:BaseApp/Preferences/Mod/Import/hSTEP").SetBool(
    "ReadShapeCompoundMode", False)
FreeCAD.ParamGet("User parameter:BaseApp/Preferences/Mod/Import").SetBool("UseLinkGroup", False)
import ImportGui
document = FreeCAD.newDocument("x")
ImportGui.insert({path!r}, "x")
found = [
    (o.Label, [above.Label for above in o.InList], list(o.ViewObject.ShapeColor)[:3],
     o.Shape.Volume, o.Shape.isValid())
    for o in document.Objects if o.TypeId == "Part::Feature"
]
open({answer!r}, "w").write(json.dumps(found))
os._exit(0)
"""


@pytest.mark.skipif(
    not (shutil.which("freecad") and shutil.which("xvfb-run")), reason="FreeCAD is not installed"
)
@pytest.mark.parametrize("schema", SCHEMAS)
def test_freecad_shows_every_part(tmp_path, schema):
    parts = sample_parts(8, 7, 6, seed=11)
    path = write_step(parts, tmp_path / "a.step", StepHeader("Shell", schema=schema))
    script, answer = tmp_path / "script.py", tmp_path / "answer.json"
    script.write_text(SCRIPT.format(path=str(path), answer=str(answer)), encoding="utf-8")
    subprocess.run(
        ["xvfb-run", "-a", "freecad", str(script)],
        env={
            "HOME": str(tmp_path),
            "PATH": "/usr/local/bin:/usr/bin:/bin",
            "LIBGL_ALWAYS_SOFTWARE": "1",
            "QTWEBENGINE_DISABLE_SANDBOX": "1",
        },
        capture_output=True,
        timeout=120,
        check=False,
    )
    found = {mark: rest for mark, *rest in json.loads(answer.read_text("utf-8"))}
    wanted, exact = families_of(parts), geometries(parts)
    assert set(found) == set(wanted)
    for mark, (above, colour, volume, valid) in found.items():
        assert valid
        assert above == [wanted[mark]]
        assert colour == pytest.approx(FAMILY_COLOURS[wanted[mark]], abs=3e-3)
        assert volume == pytest.approx(exact_volume(exact[mark]), rel=1e-6)

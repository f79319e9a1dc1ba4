"""Does all of it work here? A small shell is built, its STEP read back, its drawings audited.

``python -m phexfab.selftest`` prints the figures as one line of JSON; ``phexfab doctor`` runs it in
a process of its own.
"""

from __future__ import annotations

import json
import tempfile
import time
from math import fsum
from pathlib import Path

from phexfab.cad.brep import is_valid, solids_in, volume
from phexfab.cad.rims_brep import read_shape
from phexfab.design import make_design
from phexfab.errors import PartError
from phexfab.fabrication.parts import Beam, Panel
from phexfab.pipeline import build

DESIGN = {
    "title": "Self-test",
    "surface": {"name": "enneper", "scale": 2000, "u": [-0.6, 0.6], "v": [-0.6, 0.6]},
    "lattice": {"panel_size": 400},
    "nesting": {"packer": "shelf"},
}
VOLUME = 1e-9
"""Largest error of a solid's volume, read back, over its exact one."""


def self_test() -> str:
    """Build a small shell, read its STEP file back and audit its drawings; return the figures.

    Raises
    ------
    PartError
        If a solid read back is invalid, missing or of another volume.
    MissingLibraryError, NestingError
        If the kernel is broken, or a drawing is not sound.
    """
    start = time.perf_counter()
    built = build(make_design(DESIGN))
    if not built.ok:
        failed = ", ".join(check.name for check in built.checks if not check.ok)
        raise PartError(f"the checks of the self-test's shell fail: {failed}")
    parts: tuple[Panel | Beam, ...] = (*built.parts.panels, *built.parts.beams)
    with tempfile.TemporaryDirectory() as folder:
        # Every drawing is audited and its contours measured as it is written.
        step, sheets = built.export(folder, ["step", "dxf"])
        drawings = len(list(Path(sheets).iterdir()))
        solids = solids_in(read_shape(Path(step))[0])
    exact = [part.volume for part in parts]
    found = [volume(solid) for solid in solids]
    if len(found) != len(exact) or not all(map(is_valid, solids)):
        raise PartError(f"{len(found)} of {len(exact)} solids came back from STEP, or invalid ones")
    off = max(abs(a - b) / b for a, b in zip(sorted(found), sorted(exact), strict=True))
    if off > VOLUME:
        raise PartError(f"a solid came back from STEP with a volume {off:.1e} off")
    return (
        f"{len(built.parts.panels)} panels and {len(built.parts.beams)} beams, "
        f"{fsum(part.mass for part in parts):.1f} kg; STEP read back: {len(found)} valid solids, "
        f"volumes to {off:.0e}; {drawings} DXF sheets audited; {len(built.checks)} checks passed; "
        f"{time.perf_counter() - start:.1f} s"
    )


if __name__ == "__main__":
    print(json.dumps(self_test()))

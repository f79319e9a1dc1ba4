"""The folder that a build leaves: every file of it, whole or not at all."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from phexfab.cad.brep import verify_solids
from phexfab.delivery.formats import FORMATS
from phexfab.delivery.job import LAYOUT, Job, Progress
from phexfab.delivery.swap import DESKTOP_FILES, swap, workshop
from phexfab.errors import DesignError, PartError
from phexfab.fabrication.bom import bom_rows, write_bom
from phexfab.fabrication.checks import measure
from phexfab.fabrication.layout import sheet_yield
from phexfab.fabrication.marking import Marking
from phexfab.fabrication.parts import FlatPart, Sheet
from phexfab.mesh import write_obj
from phexfab.report.data import ReportData
from phexfab.report.page import write_report

if TYPE_CHECKING:
    from phexfab.pipeline import Build

ALWAYS = ("shell.obj", "gauss.obj", "bom.csv", "report.json", "report.html", LAYOUT)
LIBRARIES = (
    "phexfab", "numpy", "scipy", "shapely", "manifold3d", "ezdxf", "spyrrow", "matplotlib",
    "cadquery", "cadquery-ocp", "build123d",
)  # fmt: skip


def deliver(built: Build, directory: Path, say: Progress) -> Path:
    """Write all files of a build into ``directory``; see ``Build.write``.

    Files are made in a new folder beside it, which takes its place when the last one is done.
    """
    target = directory.absolute()
    _refuse_foreign(target)
    with workshop(target.parent, f".{target.name}-") as made:
        fresh = made / target.name
        fresh.mkdir()
        _write_all(Job(built, target, say), fresh)
        swap(fresh, target, made / "old")
    return directory


def _refuse_foreign(target: Path) -> None:
    """Refuse to replace a folder that holds anything but a build."""
    if not target.exists():
        return
    if not target.is_dir():
        raise DesignError(f"{target} is a file; name a folder for the output")
    known = {*ALWAYS, *(name for kind in FORMATS.values() for name in kind.names), *DESKTOP_FILES}
    foreign = sorted(path.name for path in target.iterdir() if path.name not in known)
    if foreign:
        raise DesignError(
            f"{target} holds {foreign[0]}, which no build wrote, and a build replaces the whole "
            "folder; name another folder, or an empty one"
        )


def _write_all(job: Job, folder: Path) -> None:
    built, say = job.built, job.say
    design, parts, shell = built.design, built.parts, built.shell
    flats, sheets, layouts, notes = job.nested
    say("solids", 0, 0)
    invalid = verify_solids(parts)
    if invalid:
        raise PartError(f"the CAD kernel refuses the solids of {', '.join(invalid)}")
    for key in dict.fromkeys(("step", "dxf", *design.output.files)):
        say(key, 0, 0)
        FORMATS[key].write(job, folder / FORMATS[key].name)
    write_obj(shell.mesh, folder / "shell.obj")
    write_obj(shell.gauss, folder / "gauss.obj")
    lines = {mark: made.lines for mark, made in job.engraved.items()}
    write_bom(folder / "bom.csv", bom_rows(parts, sheets))
    (folder / LAYOUT).write_text(_json(layouts), encoding="utf-8")
    figures = {**built.figures, **_sheet_figures(sheets, flats), **_marking_figures(job.engraved)}
    say("report", 0, 0)
    versions = _versions()
    (folder / "report.json").write_text(_json(_report(built, figures, versions)), encoding="utf-8")
    write_report(
        ReportData(
            title=design.name,
            units="mm",
            shell=shell,
            parts=parts,
            sheets=tuple(sheets),
            engraving=lines,
            notes=tuple(notes),
            checks=built.checks,
            figures=figures,
            histograms=_histograms(built),
            versions=versions,
            design_text=design.text,
        ),
        folder / "report.html",
    )


def _sheet_figures(
    sheets: Sequence[Sheet], flats: Mapping[str, FlatPart]
) -> dict[str, tuple[float | int | str, str]]:
    figures: dict[str, tuple[float | int | str, str]] = {}
    for family in ("PANELS", "BEAMS"):
        own = [sheet for sheet in sheets if sheet.name.startswith(family)]
        if own:
            share = float(np.mean([sheet_yield(sheet, flats.values()) for sheet in own]))
            figures[f"sheets of {family.lower()}"] = (len(own), "")
            figures[f"yield of {family.lower()} sheets"] = (100 * share, "%")
    return figures


def _marking_figures(engraved: Mapping[str, Marking]) -> dict[str, tuple[float | int | str, str]]:
    """Say what the engraving had no room for; nothing where all of it fits."""
    unmarked = sum(made.height == 0 for made in engraved.values())
    bare = sum(len(made.bare) for made in engraved.values())
    figures: dict[str, tuple[float | int | str, str]] = {}
    if unmarked:
        figures["parts too small for their mark"] = (unmarked, "")
    if bare:
        figures["edges with a tick but no note"] = (bare, "")
    return figures


def _histograms(built: Build) -> dict[str, tuple[NDArray[np.float64], str]]:
    measured = measure(built.shell)
    histograms = {
        "edge length": (measured["edge_length"], "mm"),
        "panel area": (measured["panel_area"] / 1e6, "m²"),
        "angle between beams at a node": (measured["beam_angle"], "deg"),
        "angle between neighbouring panels": (measured["dihedral_angle"], "deg"),
    }
    if built.parts.beams:
        mitres = np.abs(
            [angle for beam in built.parts.beams for end in beam.mitres for angle in end]
        )
        histograms["mitre of beam ends"] = (mitres, "deg")
    bevels = np.array([e.bevel for panel in built.parts.panels for e in panel.flat.edges])
    if np.any(bevels):
        histograms["bevel of panel edges"] = (bevels, "deg")
    return histograms


def _report(
    built: Build, figures: Mapping[str, Any], versions: Mapping[str, str]
) -> dict[str, Any]:
    return {
        "title": built.design.name,
        "verdict": "pass" if built.ok else "fail",
        "figures": {name: {"value": _finite(v), "unit": u} for name, (v, u) in figures.items()},
        "checks": [
            {
                **asdict(check),
                "value": _finite(check.value),
                "verdict": "pass" if check.ok else "fail",
            }
            for check in built.checks
        ],
        "design": built.design.model_dump(mode="json"),
        "versions": dict(versions),
    }


def _finite(value: Any) -> Any:
    """Return None for a number that JSON does not know."""
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _versions() -> dict[str, str]:
    found = {}
    for name in LIBRARIES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            continue
    return found


def _json(value: Any) -> str:
    return json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False, default=_plain) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} does not go into JSON")

"""The formats that a build can be exported to, and the export itself."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

from phexfab.cad.coloured_mesh import Measured, write_coloured_obj, write_ply
from phexfab.cad.glb import write_glb
from phexfab.cad.ifc import write_ifc
from phexfab.cad.model_plates import write_listing
from phexfab.cad.scale_model import ScaleModel
from phexfab.cad.step import write_step
from phexfab.cad.stl import write_stl
from phexfab.cad.three_mf import write_3mf
from phexfab.cad.triangles import Body
from phexfab.delivery.job import Job, Progress
from phexfab.delivery.swap import DESKTOP_FILES, swap, workshop
from phexfab.errors import DesignError
from phexfab.fabrication.parts import FAMILY_COLOURS
from phexfab.mesh.measures import planarity
from phexfab.report.fields import face_marks, panel_fields
from phexfab.report.scene import Layer, mesh_layer

if TYPE_CHECKING:
    from phexfab.pipeline import Build


LISTING = "plates.csv"


@dataclass(frozen=True)
class Format:
    """A kind of file: what it is called in a folder, and how a job writes it.

    Attributes
    ----------
    name : str
        Of the file, or of the folder where there are several.
    write : callable
        Called with the job and the path.
    suffixes : tuple of str
    beside : tuple of str
        Files that come with it.
    inside : tuple of str
        Files of other kinds in its folder.
    """

    name: str
    write: Callable[[Job, Path], object]
    suffixes: tuple[str, ...]
    beside: tuple[str, ...] = ()
    inside: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """All it leaves in a folder."""
        return (self.name, *self.beside)


def _coloured(job: Job) -> tuple[Layer, list[Measured]]:
    """Return the shell's faces coloured by Gaussian curvature, and all that is known of them."""
    shell = job.built.shell
    fields = panel_fields(shell)
    marks = face_marks(shell, [(panel.face, panel.mark) for panel in job.built.parts.panels])
    measures = [Measured(field.name, field.unit, field.values) for field in fields]
    measures.append(Measured("Planarity", "mm", planarity(shell.mesh)))
    return mesh_layer("panels", shell.mesh, marks, fields[0].colours), measures


def _write_ply(job: Job, path: Path) -> None:
    layer, measures = _coloured(job)
    write_ply(layer, measures, path, job.built.design.name)


def _write_obj(job: Job, path: Path) -> None:
    layer, measures = _coloured(job)
    write_coloured_obj(layer, measures[0], path, job.built.design.name)


def _write_model(job: Job, path: Path, ending: str) -> None:
    """Write the whole shell; into a folder, its panels on plates beside it."""
    design = job.built.design
    body, scale = job.printed

    def write(bodies: Sequence[Body], target: Path, what: str) -> None:
        title = f"{design.name}, {what}, 1:{scale:g}"
        if ending == ".stl":
            write_stl(bodies, target, title)
            return
        date = design.project.date
        about = {
            "Title": title,
            "Designer": design.project.author,
            "CreationDate": date.isoformat() if date else "",
            "Application": "phexfab",
        }
        write_3mf(bodies, target, about, (design.panels.material, FAMILY_COLOURS["panels"]))

    if path.suffix.lower() == ending:
        write([body], path, "shell")
        return
    path.mkdir()
    write([body], path / f"shell{ending}", "shell")
    width = len(str(len(job.plates)))
    for plate in job.plates:
        what = f"plate {plate.number} of {len(job.plates)}"
        write(plate.panels, path / f"plate-{plate.number:0{width}d}{ending}", what)
    write_listing(job.plates, path / LISTING)


FORMATS = {
    "step": Format(
        "parts.step",
        lambda job, path: write_step(job.built.parts, path, job.header),
        (".step", ".stp"),
    ),
    "step242": Format(
        "parts-ap242.step",
        lambda job, path: write_step(job.built.parts, path, replace(job.header, schema="AP242")),
        (".step", ".stp"),
    ),
    "glb": Format(
        "parts.glb",
        lambda job, path: write_glb(job.built.parts, path, job.built.design.name),
        (".glb",),
    ),
    "ifc": Format(
        "parts.ifc",
        lambda job, path: write_ifc(job.built.parts, path, job.header),
        (".ifc",),
    ),
    "3mf": Format(
        "model-3mf",
        lambda job, path: _write_model(job, path, ".3mf"),
        (".3mf",),
        inside=(LISTING,),
    ),
    "stl": Format(
        "model-stl",
        lambda job, path: _write_model(job, path, ".stl"),
        (".stl",),
        inside=(LISTING,),
    ),
    "obj": Format("curvature.obj", _write_obj, (".obj",), ("curvature.mtl",)),
    "ply": Format("curvature.ply", _write_ply, (".ply",)),
    "dxf": Format(
        "sheets",
        lambda job, path: job.write_sheets(path, job.built.design.output.dxf_version),
        (".dxf",),
    ),
    "dxf12": Format("sheets-r12", lambda job, path: job.write_sheets(path, "R12"), (".dxf",)),
}
"""The formats that can be asked for, by key."""

SUFFIXES = {
    suffix: key
    for key, kind in FORMATS.items()
    if key != "step242" and ".dxf" not in kind.suffixes  # cut sheets are several files
    for suffix in kind.suffixes
}
"""The format that a single file's ending stands for."""


def export(
    built: Build,
    destination: str | PathLike[str],
    formats: Sequence[str] | None = None,
    progress: Progress | None = None,
    *,
    model: ScaleModel | None = None,
) -> tuple[Path, ...]:
    """Write chosen files of a build; see ``Build.export``."""
    target = Path(destination).absolute()
    single = SUFFIXES.get(target.suffix.lower())
    if formats is None:
        if single is None:
            raise DesignError(
                f"{destination}: name formats, some of {', '.join(FORMATS)}; or a file that ends "
                f"in one of {', '.join(SUFFIXES)}"
            )
        formats = (single,)
    wanted = tuple(dict.fromkeys((formats,) if isinstance(formats, str) else formats))
    for key in wanted:
        if key not in FORMATS:
            near = difflib.get_close_matches(key, FORMATS, 1)
            hint = f"did you mean {near[0]}? " if near else ""
            known = ", ".join(FORMATS)
            raise DesignError(f"there is no format {key!r}; {hint}take some of {known}")
    folder = target
    if single is not None:
        if len(wanted) != 1 or target.suffix.lower() not in FORMATS[wanted[0]].suffixes:
            raise DesignError(
                f"{target.name} is a file of the format {single}, but {', '.join(wanted)} is "
                "asked for; name a folder"
            )
        folder = target.parent
    job = Job(built, folder, progress or (lambda *_: None), model)
    written: list[Path] = []
    with workshop(folder, ".phexfab-") as made:
        fresh = made / "fresh"
        fresh.mkdir()
        for key in wanted:
            name = target.name if single else FORMATS[key].name
            if (folder / name).is_dir():
                _refuse_others(folder / name, FORMATS[key])
            job.say(key, 0, 0)
            FORMATS[key].write(job, fresh / name)
        for path in sorted(fresh.iterdir()):
            swap(path, folder / path.name, made / f"old-{path.name}")
            written.append(folder / path.name)
    return tuple(written)


def _refuse_others(folder: Path, kind: Format) -> None:
    """Refuse to replace a folder of files that are not of the format."""
    for path in sorted(folder.iterdir()):
        known = path.suffix in kind.suffixes or path.name in (*kind.inside, *DESKTOP_FILES)
        if not known:
            raise DesignError(
                f"{folder} holds {path.name}, and an export replaces the whole folder; move it, "
                "or export to another folder"
            )

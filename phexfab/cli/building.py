"""The verbs that walk from designs to parts: ``build``, ``check`` and ``export``."""

from __future__ import annotations

import traceback
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from phexfab.cli.failures import BROKEN, CHECK_FAILED, STOPPED, Failure, answered, failure
from phexfab.cli.options import DesignFiles, Json, Quiet, Verbose, format_names
from phexfab.cli.voice import Report, Voice

if TYPE_CHECKING:
    from phexfab.design import Design
    from phexfab.pipeline import Build

Folder = Annotated[
    Path | None,
    typer.Option(
        "-o",
        "--output",
        metavar="DIR",
        help="Where the files go; exports/<name of the design file> when left out. Several "
        "designs each get a folder of their name in it.",
        show_default=False,
    ),
]


@dataclass(frozen=True)
class Result:
    """What came of one design: ``failure`` where it could not be built, else the build."""

    design: str
    code: int
    built: Build | None = None
    directory: Path | None = None
    files: tuple[Path, ...] = ()
    failure: Failure | None = None

    @property
    def failed(self) -> list[str]:
        """Names of the checks that failed."""
        return [check.name for check in self.built.checks if not check.ok] if self.built else []

    @property
    def verdict(self) -> str:
        """``ok``, or a word for what went wrong."""
        return {0: "ok", CHECK_FAILED: "FAILED", BROKEN: "BROKEN"}.get(self.code, "WRONG")

    def data(self) -> dict[str, Any]:
        """Return it for a machine; the same names as in report.json."""
        figures = self.built.figures if self.built else {}
        checks = self.built.checks if self.built else ()
        return {
            "design": self.design,
            "exit_code": self.code,
            "directory": self.directory,
            "files": [{"path": path, "bytes": _size(path)} for path in self.files],
            "figures": {name: {"value": v, "unit": unit} for name, (v, unit) in figures.items()},
            "checks": [
                asdict(check) | {"verdict": "pass" if check.ok else "fail"} for check in checks
            ],
            "error": self.failure.data() if self.failure else None,
        }


Work = Callable[["Design", "Report | None", Path], tuple["Build", tuple[Path, ...]]]


def build(
    designs: DesignFiles,
    output: Folder = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Nest in a moment, on more sheets (packer = shelf).")
    ] = False,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Build designs: solids, cut sheets, parts list, checks and report.

    Of several designs one that fails does not stop the rest; the worst exit code counts.
    """

    def work(asked: Design, report: Report | None, folder: Path) -> tuple[Build, tuple[Path, ...]]:
        from phexfab import pipeline

        if quick:
            shelf = asked.nesting.model_copy(update={"packer": "shelf"})
            asked = asked.model_copy(update={"nesting": shelf})
        built = pipeline.build(asked, progress=report)
        built.write(folder, progress=report)
        return built, tuple(sorted(folder.iterdir()))

    voice = Voice(json, quiet, verbose)
    with answered(voice):
        _run(designs, _folders(designs, output), voice, work)


def check(
    designs: DesignFiles, json: Json = False, quiet: Quiet = False, verbose: Verbose = False
) -> None:
    """Run the checks of designs, without writing files; a CAD kernel is loaded only to read."""

    def work(asked: Design, report: Report | None, folder: Path) -> tuple[Build, tuple[Path, ...]]:
        from phexfab import pipeline

        return pipeline.build(asked, progress=report), ()

    voice = Voice(json, quiet, verbose)
    with answered(voice):
        _run(designs, [None] * len(designs), voice, work)


def export(
    designs: DesignFiles,
    formats: Annotated[
        str,
        typer.Option(
            "-f",
            "--format",
            metavar="FORMAT,...",
            help="Some of step, step242, glb, ifc, 3mf, stl, obj, ply, dxf, dxf12.",
            show_default=False,
            autocompletion=format_names,
        ),
    ],
    output: Folder = None,
    json: Json = False,
    quiet: Quiet = False,
    verbose: Verbose = False,
) -> None:
    """Write chosen files of designs and nothing else; a folder keeps what else it holds."""

    def work(asked: Design, report: Report | None, folder: Path) -> tuple[Build, tuple[Path, ...]]:
        from phexfab import pipeline

        built = pipeline.build(asked, progress=report)
        return built, built.export(folder, wanted, progress=report)

    voice = Voice(json, quiet, verbose)
    with answered(voice):
        wanted = _formats(formats)
        _run(designs, _folders(designs, output), voice, work)


def _formats(asked: str) -> list[str]:
    """Return the formats of ``glb,3mf``; unknown ones are refused before anything is built."""
    from phexfab.delivery import FORMATS

    words = [name.strip().lower() for name in asked.split(",")]
    names = list(dict.fromkeys(filter(None, words)))
    unknown = [name for name in names if name not in FORMATS]
    if unknown or not names:
        said = f"there is no format {unknown[0]}" if unknown else "no format is named"
        raise typer.BadParameter(
            f"{said}; take some of {', '.join(FORMATS)}", param_hint="--format"
        )
    return names


def folder_for(output: Path | None, name: str) -> Path:
    """Return the folder asked for, or ``exports/name``; refuse a file of that name."""
    directory = output or Path("exports") / name
    if directory.exists() and not directory.is_dir():
        raise typer.BadParameter(f"{directory} is a file; name a folder", param_hint="-o")
    return directory


def _folders(designs: Sequence[Path], output: Path | None) -> list[Path | None]:
    """Return each design's folder; two designs never share one."""
    if len(designs) == 1:
        return [folder_for(output, designs[0].stem)]
    names = [design.stem for design in designs]
    for index, name in enumerate(names):
        if name in names[:index]:
            raise typer.BadParameter(
                f"{designs[names.index(name)]} and {designs[index]} would write to one folder; "
                "give them different file names",
                param_hint="DESIGN",
            )
    return [folder_for(output and output / name, name) for name in names]


def _run(designs: Sequence[Path], folders: Sequence[Path | None], voice: Voice, work: Work) -> None:
    """Do the work on every design, say what came of each, and end with the worst exit code."""
    alone = len(designs) == 1
    results: list[Result] = []
    for design, folder in zip(designs, folders, strict=True):
        result = _one(design, folder, voice, work, alone)
        results.append(result)
        if alone:
            _tell(result, voice)
        else:
            _tell_briefly(result, voice)
        if result.code == STOPPED:
            break
    code = max(result.code for result in results)
    voice.answer({"exit_code": code, "designs": [result.data() for result in results]})
    if code:
        raise typer.Exit(code)


def _one(design: Path, folder: Path | None, voice: Voice, work: Work, alone: bool) -> Result:
    source = str(design)
    try:
        from phexfab.design import load_design

        asked = load_design(design)
        with voice.progress() as report:
            built, files = work(asked, report, folder or Path())
    except (Exception, KeyboardInterrupt) as error:
        found = failure(error, source)
        if found is None:
            if alone:
                raise
            # One bug must not cost a night's batch: it is shown whole, and the rest goes on.
            voice.complain(traceback.format_exc())
            found = Failure(BROKEN, type(error).__name__, f"{source}: {error!r}", source)
        return Result(source, found.code, failure=found)
    return Result(source, 0 if built.ok else CHECK_FAILED, built, folder, files)


def _tell(result: Result, voice: Voice) -> None:
    """Say all about one design."""
    if result.failure is not None:
        voice.complain(result.failure.message)
    if result.built is None:
        return
    if voice.speaks:
        from phexfab.cli.tables import show_checks, show_figures, show_folder

        show_checks(result.built.checks, notes=voice.verbose)
        if voice.verbose:
            show_figures(result.built.figures)
        if result.directory is not None:
            show_folder(result.directory, result.built.figures)
    if result.failed:
        voice.complain(_failed(result))


def _tell_briefly(result: Result, voice: Voice) -> None:
    """Say a line about a design among others."""
    from phexfab.cli.tables import counted, show_checks, show_line

    if result.failure is not None:
        voice.complain(result.failure.message)
        said = result.failure.message.splitlines()[0].removeprefix(f"{result.design}: ")
    else:
        assert result.built is not None
        if voice.verbose and voice.speaks:
            show_checks(result.built.checks, notes=True)
        where = f" → {result.directory}" if result.directory else ""
        said = counted(result.built.figures) + where
        if result.failed:
            said += f"; {_failed(result)}"
            if not voice.speaks:
                voice.complain(f"{result.design}: {_failed(result)}")
    if voice.speaks:
        show_line(result.verdict, result.design, said)


def _failed(result: Result) -> str:
    count = "1 check" if len(result.failed) == 1 else f"{len(result.failed)} checks"
    return f"{count} failed: {', '.join(result.failed)}"


def _size(path: Path) -> int:
    inside = path.rglob("*") if path.is_dir() else [path]
    return sum(file.stat().st_size for file in inside if file.is_file())

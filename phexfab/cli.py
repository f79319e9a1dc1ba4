"""The command line, thin: read the design, walk the pipeline, say what came of it.

Results go to standard output, messages and progress to standard error. Exit codes: 0 all is well,
1 a check failed, 2 the design or another input is wrong, 3 a library or the machine is.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from phexfab.errors import MissingLibraryError, PhexError

if TYPE_CHECKING:
    from phexfab.cad.doctor import Finding
    from phexfab.design import Design
    from phexfab.fabrication.parts import CheckResult

LIBRARIES = ("numpy", "scipy", "shapely", "manifold3d", "ezdxf", "spyrrow", "matplotlib")
CHECK_FAILED, WRONG_INPUT, BROKEN = 1, 2, 3

app = typer.Typer(
    name="phexfab",
    help="Minimal-surface shells of planar hexagons: design file in; STEP, DXF, parts list out.",
    epilog="Exit codes: 0 fine, 1 a check failed, 2 wrong design or input, 3 a library is broken.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
DesignFile = Annotated[
    Path, typer.Argument(metavar="DESIGN", help="Design file (TOML).", show_default=False)
]


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"phexfab {_version('phexfab') or '(not installed, run from its folder)'}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool,
        typer.Option(
            "--version", help="Show the version and exit.", callback=_show_version, is_eager=True
        ),
    ] = False,
) -> None:
    pass


@app.command()
def build(
    design: DesignFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="DIR",
            help="Where the files go; exports/<name of the design file> when left out.",
            show_default=False,
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Nest in a moment, on more sheets (packer = shelf).")
    ] = False,
) -> None:
    """Build a design: solids, cut sheets, parts list, checks and report."""
    from phexfab.cli_view import progress, show_build, show_checks

    with _exit_codes(design):
        asked = _read(design)
        if quick:
            shelf = asked.nesting.model_copy(update={"packer": "shelf"})
            asked = asked.model_copy(update={"nesting": shelf})
        directory = _folder(output, design.stem)
        from phexfab import pipeline

        with progress() as report:
            built = pipeline.build(asked, progress=report)
            built.write(directory, progress=report)
        show_checks(built.checks)
        show_build(directory, built.figures)
        _exit_for(built.checks)


@app.command()
def check(design: DesignFile) -> None:
    """Run a design's checks, without the CAD kernel and without writing files."""
    from phexfab.cli_view import progress, show_checks

    with _exit_codes(design):
        asked = _read(design)
        from phexfab import pipeline

        with progress() as report:
            results = pipeline.check(asked, progress=report)
        show_checks(results)
        _exit_for(results)


@app.command()
def compare(
    design: DesignFile,
    output: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            metavar="DIR",
            help="Where comparison.csv, .json and .png go; exports/<design file>-comparison when "
            "left out.",
            show_default=False,
        ),
    ] = None,
    equal: Annotated[
        str, typer.Option("--equal", metavar="size|deviation", help="What all three share.")
    ] = "size",
    packer: Annotated[
        str, typer.Option("--packer", metavar="shelf|spyrrow", help="How panels are nested.")
    ] = "shelf",
) -> None:
    """Panel a design's surface with triangles, planar quads and planar hexagons, and compare."""
    from phexfab.cli_view import show_build, show_comparison

    with _exit_codes(design):
        asked = _read(design)
        directory = _folder(output, f"{design.stem}-comparison")
        from phexfab.compare import compare as compare_panelings

        found = compare_panelings(asked, equal, packer=packer)
        show_comparison(found)
        found.write(directory)
        show_build(directory, {})


@app.command()
def inspect(
    mesh: Annotated[
        Path, typer.Argument(metavar="MESH", help="Mesh (OBJ or OFF).", show_default=False)
    ],
    offset: Annotated[
        Path | None,
        typer.Argument(metavar="[OFFSET]", help="Its offset, same faces.", show_default=False),
    ] = None,
    gauss: Annotated[
        bool, typer.Option("--gauss", help="OFFSET is the Gauss image itself.")
    ] = False,
    weld: Annotated[
        float | None,
        typer.Option(
            "--weld",
            metavar="LENGTH",
            help="Join vertices closer than this, such as 0.01, in the file's unit.",
            show_default=False,
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, for machines.")] = False,
) -> None:
    """Measure a mesh from elsewhere: planarity, offset types, curvature, torsion."""
    from phexfab.cli_view import show_inspection

    with _exit_codes():
        from phexfab.inspection import inspect_files

        if gauss and offset is None:
            raise typer.BadParameter("name the Gauss image after the mesh", param_hint="--gauss")
        found = inspect_files(mesh, offset, gauss=gauss, tolerance=weld)
        if as_json:
            typer.echo(found.to_json(), nl=False)
        else:
            show_inspection(found)


@app.command()
def surfaces() -> None:
    """List the catalog of surfaces that a design file may name."""
    from phexfab.cli_view import show_surfaces

    with _exit_codes():
        show_surfaces()


@app.command()
def doctor() -> None:
    """Look at the installed libraries and say how to repair what is broken."""
    from phexfab.cad import doctor as cad_doctor
    from phexfab.cli_view import progress, show_findings

    with _exit_codes():
        with progress() as report:
            if report:
                report("loading the CAD libraries", 0, 0)
            findings = [*_libraries(), *cad_doctor.doctor()]
        show_findings(findings)
        if not all(finding.ok for finding in findings):
            raise typer.Exit(BROKEN)


def main() -> None:
    """Run the command ``phexfab``."""
    app()


def _folder(output: Path | None, name: str) -> Path:
    """Return the folder asked for, or ``exports/name``; refuse a file of that name."""
    directory = output or Path("exports") / name
    if directory.exists() and not directory.is_dir():
        raise typer.BadParameter(f"{directory} is a file; name a folder", param_hint="-o")
    return directory


def _read(path: Path) -> Design:
    from phexfab.design import load_design

    return load_design(path)


def _version(distribution: str) -> str:
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return ""


def _libraries() -> list[Finding]:
    """Return whether the libraries without a kernel are installed."""
    from phexfab.cad.doctor import Finding

    found = {name: _version(name) for name in LIBRARIES}
    remedy = "python -m pip install --upgrade {}"
    return [
        Finding(name, bool(version), version or "absent", "" if version else remedy.format(name))
        for name, version in found.items()
    ]


def _exit_for(results: Sequence[CheckResult]) -> None:
    failed = [result.name for result in results if not result.ok]
    if failed:
        count = "1 check" if len(failed) == 1 else f"{len(failed)} checks"
        typer.echo(f"{count} failed: {', '.join(failed)}", err=True)
        raise typer.Exit(CHECK_FAILED)


@contextmanager
def _exit_codes(design: Path | None = None) -> Iterator[None]:
    """Turn what phexfab raises on purpose into one message and an exit code, without traceback."""
    source = "phexfab" if design is None else str(design)
    try:
        yield
    except MissingLibraryError as error:
        typer.echo(f"phexfab: {error}", err=True)
        raise typer.Exit(BROKEN) from None
    except PhexError as error:
        text = str(error)
        typer.echo(text if text.startswith(source) else f"{source}: {text}", err=True)
        raise typer.Exit(WRONG_INPUT) from None
    except BrokenPipeError:
        raise  # typer ends quietly when the reader of a pipe has gone
    except OSError as error:
        where = f" {error.filename}" if error.filename else ""
        typer.echo(f"phexfab: {error.strerror or error}:{where}", err=True)
        raise typer.Exit(BROKEN) from None
    except KeyboardInterrupt:
        typer.echo("phexfab: stopped", err=True)
        sys.exit(130)

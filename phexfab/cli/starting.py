"""The verbs around a design file: ``new``, ``schema`` and ``view``."""

from __future__ import annotations

import os
import sys
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from phexfab.cli.failures import CHECK_FAILED, answered
from phexfab.cli.options import (
    Json,
    Quiet,
    mesh_files,
    methods,
    periodic_names,
    reports,
    rim_files,
    step_files,
    surface_names,
)
from phexfab.cli.voice import Voice
from phexfab.errors import DesignError

REPORT = "report.html"


def new(
    name: Annotated[
        Path,
        typer.Argument(
            metavar="NAME", help="Name of the design; its file is NAME.toml.", show_default=False
        ),
    ],
    surface: Annotated[
        str | None,
        typer.Option(
            help="A surface of the catalog; catenoid when nothing is named.",
            metavar="SURFACE",
            show_default=False,
            autocompletion=surface_names,
        ),
    ] = None,
    rim: Annotated[
        list[Path] | None,
        typer.Option(
            help="The soap film of a rim: CSV, DXF, STEP or BREP; again for each further rim.",
            metavar="FILE",
            show_default=False,
            autocompletion=rim_files,
        ),
    ] = None,
    mesh: Annotated[
        Path | None,
        typer.Option(
            help="A soap film as a triangle mesh; with --method a surface or polygons as a mesh.",
            metavar="FILE",
            show_default=False,
            autocompletion=mesh_files,
        ),
    ] = None,
    step: Annotated[
        Path | None,
        typer.Option(
            help="A free-form surface: a face in a STEP or BREP file.",
            metavar="FILE",
            show_default=False,
            autocompletion=step_files,
        ),
    ] = None,
    periodic: Annotated[
        str | None,
        typer.Option(
            help="A cell of a periodic surface: schwarz-p, schwarz-d or gyroid.",
            metavar="NAME",
            show_default=False,
            autocompletion=periodic_names,
        ),
    ] = None,
    method: Annotated[
        str | None,
        typer.Option(
            help="With --mesh or --step: how planar hexagons are found; dupin for --step.",
            metavar="METHOD",
            show_default=False,
            autocompletion=methods,
        ),
    ] = None,
    panel_size: Annotated[
        str | None,
        typer.Option(
            help="Size of panels, such as 450 or 45cm; some hundred panels when left out.",
            metavar="LENGTH",
            show_default=False,
        ),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace a design of that name.")] = False,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Write a commented starter design that builds as it is.

    Beside it lies its schema, with which editors complete and check design files.
    """
    voice = Voice(json, quiet)
    target = name if name.suffix == ".toml" else name.with_name(f"{name.name}.toml")
    with answered(voice, str(target)):
        sources = {
            "--surface": surface,
            "--rim": rim,
            "--mesh": mesh,
            "--step": step,
            "--periodic": periodic,
        }
        given = [option for option, value in sources.items() if value]
        if len(given) > 1:
            raise typer.BadParameter(f"choose one of {' and '.join(given)}", param_hint=given[1])
        if method and not (mesh or step):
            raise typer.BadParameter("it belongs to --mesh or --step", param_hint="--method")
        if target.exists() and not force:
            raise DesignError("there is such a file; choose another name, or --force replaces it")
        if not target.parent.is_dir():
            raise DesignError(f"there is no folder {target.parent}; make it first")
        from phexfab.cli.starter import Origin, starter
        from phexfab.design import quantity
        from phexfab.schema import FILE, schema_text
        from phexfab.whole import whole

        origin = Origin(
            surface, tuple(rim or ()), mesh, step, periodic, method or ("dupin" if step else None)
        )
        size = None if panel_size is None else quantity(panel_size, "length")
        if size is not None and not size > 0:
            raise typer.BadParameter(
                f"{panel_size} is no size; write for example 450 or 45cm", param_hint="--panel-size"
            )
        with voice.progress() as report:
            text, built = starter(origin, target, size, report)
        files = {target: text, target.with_name(FILE): schema_text()}
        for path, content in files.items():
            with whole(path) as draft:
                draft.write_text(content, encoding="utf-8")
        failed = [check.name for check in built.checks if not check.ok]
        code = CHECK_FAILED if failed else 0
        if voice.speaks:
            from phexfab.cli.tables import counted

            typer.echo(f"{target}: {counted(built.figures)}\n\nNext: phexfab build {target}")
        if failed:
            said = f"{target}: checks fail: {', '.join(failed)}"
            voice.complain(f"{said}; phexfab check {target} says what helps")
        schema_file = target.with_name(FILE)
        voice.answer(
            {"exit_code": code, "design": target, "schema": schema_file, "failed_checks": failed}
        )
        if code:
            raise typer.Exit(code)


def schema(
    output: Annotated[
        Path | None,
        typer.Option(
            "-o", "--output", metavar="FILE", help="Write it to a file.", show_default=False
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Print the JSON Schema of design files, for completion in editors."""
    voice = Voice(json)
    with answered(voice):
        from phexfab.schema import schema_text
        from phexfab.whole import whole

        if output is None:  # which is JSON in any case
            typer.echo(schema_text(), nl=False)
            return
        with whole(output) as draft:
            draft.write_text(schema_text(), encoding="utf-8")
        voice.answer({"exit_code": 0, "schema": output})


def view(
    thing: Annotated[
        Path,
        typer.Argument(
            metavar="BUILD",
            help="A build's folder, its report, or the design file.",
            show_default=False,
            autocompletion=reports,
        ),
    ],
    opens: Annotated[
        bool, typer.Option("--open/--no-open", help="Open it, or only print where it is.")
    ] = True,
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Open the report of a build in the browser, and print where it is."""
    voice = Voice(json, quiet)
    with answered(voice, str(thing)):
        report = _report(thing)
        if thing.suffix == ".toml" and thing.stat().st_mtime > report.stat().st_mtime:
            voice.complain(f"{thing} is newer than its report; phexfab build {thing} renews it")
        opened = opens and _has_display() and webbrowser.open(report.resolve().as_uri())
        if voice.speaks:
            typer.echo(report)
        if opens and not opened:
            voice.complain("there is no browser to open it in; open the file above yourself")
        voice.answer({"exit_code": 0, "report": report, "opened": opened})


def _report(thing: Path) -> Path:
    """Return the report that is meant."""
    if not thing.exists():
        raise DesignError("there is no such file or folder; check the path")
    if thing.is_dir():
        report, remedy = thing / REPORT, f"phexfab build DESIGN -o {thing} makes one"
    elif thing.suffix == ".toml":
        report = Path("exports") / thing.stem / REPORT
        remedy = f"phexfab build {thing} makes one, or name the folder that you built into"
    elif thing.suffix.lower() in (".html", ".htm"):
        return thing
    else:
        raise DesignError("is no report; name a folder, a design file or an HTML file")
    if not report.is_file():
        raise DesignError(f"there is no report at {report}; {remedy}")
    return report


def _has_display() -> bool:
    """Return whether a window can open: without one, some systems start a browser in the text."""
    seen = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))
    return seen or sys.platform in ("win32", "darwin")

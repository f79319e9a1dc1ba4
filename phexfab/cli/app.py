"""The command ``phexfab``: its verbs, their examples, and what ends it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from phexfab.cli import building, looking, starting
from phexfab.cli.failures import CODES, misused
from phexfab.cli.voice import Voice

CODES_TOLD = "\n".join(f"{code:5}  {told}" for code, told in CODES.items())
FIRST_STEPS = """ First steps:
   phexfab new roof
   phexfab build roof.toml
   phexfab view roof.toml"""
START, WORK, LOOK = "Start", "From a design to files", "Look"


class _Ended:
    """A command whose help ends with its epilog as it is written, line by line."""

    epilog: str | None

    def format_help(self, ctx: Any, formatter: Any) -> None:
        ending, self.epilog = self.epilog, None
        super().format_help(ctx, formatter)  # type: ignore[misc]
        self.epilog = ending
        typer.echo(ending)


class _Verb(_Ended, TyperCommand):
    """A verb."""


class _Verbs(_Ended, TyperGroup):
    """The verbs; where JSON is asked for, a wrong command line is answered in JSON too."""

    def main(
        self,
        args: Sequence[str] | None = None,
        prog_name: str | None = None,
        complete_var: str | None = None,
        standalone_mode: bool = True,
        windows_expand_args: bool = True,
        **extra: Any,
    ) -> Any:
        asked = sys.argv[1:] if args is None else args
        alone = standalone_mode and "--json" not in asked
        try:
            code = super().main(args, prog_name, complete_var, alone, windows_expand_args, **extra)
        except Exception as error:
            if alone or not hasattr(error, "format_message"):  # all but errors of usage
                raise
            wrong = misused(error)
            voice = Voice(json=True)
            voice.complain(wrong.message)
            voice.answer({"exit_code": wrong.code, "error": wrong.data()})
            code = wrong.code
        if standalone_mode:
            sys.exit(code or 0)
        return code


app = typer.Typer(
    name="phexfab",
    cls=_Verbs,
    help="Shells of planar hexagons on minimal surfaces: a design file in; STEP, DXF, parts list "
    "and report out.",
    epilog=f"{FIRST_STEPS}\n\n Exit codes:\n{CODES_TOLD}\n\n"
    " phexfab VERB --help shows a verb's options with examples.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


def _verb(function: Callable[..., None], panel: str, *examples: str) -> None:
    """Give the command a verb with its examples."""
    shown = "\n".join(f"   phexfab {function.__name__} {word}".rstrip() for word in examples)
    app.command(cls=_Verb, epilog=f" Examples:\n{shown}", rich_help_panel=panel)(function)


_verb(
    starting.new,
    START,
    "roof",
    "canopy --surface enneper --panel-size 45cm",
    "court --rim outer.csv --rim inner.csv",
    "lattice --periodic schwarz-p",
    "vault --step roof.step --method dupin",
)
_verb(
    building.check,
    WORK,
    "roof.toml",
    "roof.toml --json",
)
_verb(
    building.build,
    WORK,
    "roof.toml",
    "roof.toml -o delivery/roof --quick",
    "designs/*.toml -o exports --quiet",
)
_verb(
    building.export,
    WORK,
    "roof.toml --format glb,3mf -o for-print",
    "designs/*.toml -f step242",
)
_verb(
    starting.view,
    LOOK,
    "roof.toml",
    "exports/roof --no-open",
)
_verb(
    looking.compare,
    LOOK,
    "roof.toml",
    "roof.toml --equal deviation -o study",
)
_verb(
    looking.inspect,
    LOOK,
    "mesh.obj",
    "mesh.obj offset.obj --weld 0.01 --json",
)
_verb(
    looking.surfaces,
    LOOK,
    "",
    "--json",
)
_verb(
    starting.schema,
    START,
    "-o phexfab-design.schema.json",
)
_verb(
    looking.doctor,
    START,
    "",
    "--json",
)


def _show_version(wanted: bool) -> None:
    if wanted:
        number = looking.version("phexfab") or "(not installed, run from its folder)"
        typer.echo(f"phexfab {number}")
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


def main() -> None:
    """Run the command ``phexfab``."""
    app()

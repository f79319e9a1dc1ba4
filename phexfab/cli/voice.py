"""How a verb speaks: tables for people, one JSON document for machines, or hardly at all."""

from __future__ import annotations

import json
import math
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import typer

Report = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Voice:
    """What is said where: results on standard output, everything else on standard error.

    Attributes
    ----------
    json : bool
        The answer is one JSON document, and nothing else is on standard output.
    quiet : bool
        No tables and no progress; what is wrong is said all the same.
    verbose : bool
        Stages with their times, all figures and every check's note.
    """

    json: bool = False
    quiet: bool = False
    verbose: bool = False

    def __post_init__(self) -> None:
        if self.quiet and self.verbose:
            raise typer.BadParameter("choose one of --quiet and --verbose", param_hint="--quiet")

    @property
    def speaks(self) -> bool:
        """True when tables are wanted."""
        return not (self.json or self.quiet)

    def answer(self, data: Mapping[str, Any]) -> None:
        """Print the answer for a machine, when one asked."""
        if self.json:
            text = json.dumps(plain(data), indent=1, ensure_ascii=False, allow_nan=False)
            typer.echo(text)

    def complain(self, message: str) -> None:
        """Say what is wrong."""
        typer.echo(message, err=True)

    @contextmanager
    def progress(self) -> Iterator[Report | None]:
        """Yield ``report(stage, done, total)``, or None where nobody watches.

        A total of 0 means that nobody knows how long the stage takes.
        """
        if self.quiet:
            yield None
        elif self.verbose:
            yield _stages()
        else:
            from phexfab.cli.tables import bar

            with bar() as report:
                yield report


def _stages() -> Report:
    """Return a report that prints a line for each stage, with the seconds since the start."""
    begin, stage_now = time.monotonic(), ""

    def report(stage: str, done: int, total: int) -> None:
        nonlocal stage_now
        if stage != stage_now:
            stage_now = stage
            typer.echo(f"{time.monotonic() - begin:7.1f} s  {stage}", err=True)
            sys.stderr.flush()

    return report


def plain(value: Any) -> Any:
    """Return a value as JSON knows it: no arrays, no paths, no numbers that are not finite."""
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [plain(item) for item in value]
    if hasattr(value, "item") and hasattr(value, "dtype"):  # a number of numpy
        value = value.item()
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, str | int | bool | None) else str(value)

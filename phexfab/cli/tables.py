"""What people see: tables on standard output, a bar of progress on standard error."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn
from rich.table import Table

if TYPE_CHECKING:
    from phexfab.cad.doctor import Finding
    from phexfab.cli.voice import Report
    from phexfab.comparison import Comparison
    from phexfab.fabrication.parts import CheckResult
    from phexfab.inspection import Inspection

Figures = Mapping[str, tuple[float | int | str, str]]
NARROW = 60
FAMILIES = ("panels", "beams", "nodes")


def _console() -> Console:
    # Made anew each time: standard output may have been redirected since the last.
    return Console(file=sys.stdout, highlight=False)


@contextmanager
def bar() -> Iterator[Report | None]:
    """Yield ``report(stage, done, total)`` that draws a bar, or None away from a terminal."""
    console = Console(file=sys.stderr)
    if not console.is_terminal or console.is_dumb_terminal:
        yield None
        return
    columns = (
        SpinnerColumn(),
        TextColumn("{task.description}"),
        BarColumn(bar_width=24),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as drawn:
        task = drawn.add_task("reading", total=None)
        stage_now = ""

        def report(stage: str, done: int, total: int) -> None:
            nonlocal stage_now
            if stage != stage_now:
                stage_now = stage
                drawn.reset(task, description=escape(stage), total=total or None, completed=done)
            else:
                drawn.update(task, total=total or None, completed=done)

        yield report


def figure(value: float, unit: str) -> str:
    """Return a value with its unit in a few characters; ratios (unit ``"1"``) have none."""
    number = f"{value:.0f}" if 1e3 <= abs(value) < 1e6 else f"{value:.3g}"
    return number if unit == "1" else f"{number} {unit}"


def show_checks(results: Sequence[CheckResult], notes: bool = False) -> None:
    """Print the checks as a table, or two lines to a check on a narrow terminal.

    What a check measured and what to change is said of those that fail, with ``notes`` of all.
    """
    console = _console()
    table = Table(box=None, pad_edge=False)
    table.add_column("check", overflow="fold")
    table.add_column("value", justify="right", no_wrap=True)
    table.add_column("limit", justify="right", no_wrap=True)
    table.add_column("worst", no_wrap=True)
    table.add_column("", no_wrap=True)
    for result in results:
        name, worst = escape(result.name), escape(result.worst)
        value = figure(result.value, result.unit)
        limit = f"{'≤' if result.sense == '<=' else '≥'} {figure(result.limit, result.unit)}"
        verdict = "[green]ok[/]" if result.ok else "[bold red]FAILED[/]"
        if console.width < NARROW:
            console.print(f"{verdict} {name}\n  {value} {limit} {worst}")
        table.add_row(name, value, limit, worst, verdict)
    if console.width >= NARROW:
        console.print(table)
    for result in results:
        if result.note and (notes or not result.ok):
            style = "bold" if result.ok else "bold red"
            console.print(f"[{style}]{escape(result.name)}[/]: {escape(result.note)}")


def show_figures(figures: Figures) -> None:
    """Print the key figures of a build."""
    table = _listing()
    for name, (value, unit) in figures.items():
        number = figure(value, unit or "1") if isinstance(value, float) else f"{value} {unit}"
        table.add_row(escape(name), escape(number.strip()))
    _console().print(table)


def counted(figures: Figures) -> str:
    """Return how many parts there are of each family, such as ``304 panels, 988 beams``."""
    own = [name for name in FAMILIES if name in figures and figures[name][0]]
    return ", ".join(f"{figures[name][0]} {name}" for name in own)


def show_folder(directory: Path, figures: Figures) -> None:
    """Print how many parts there are, and what lies in the output folder."""
    console = _console()
    table = _listing()
    for entry in sorted(directory.iterdir()):
        if entry.is_dir():
            files = [path for path in entry.rglob("*") if path.is_file()]
            size = sum(path.stat().st_size for path in files)
            table.add_row(escape(f"{entry.name}/ ({len(files)} files)"), _bytes(size))
        else:
            table.add_row(escape(entry.name), _bytes(entry.stat().st_size))
    counts = counted(figures)
    console.print()
    said = f": {counts}" if counts else ""
    console.print(f"[bold]{escape(str(directory))}[/]{said}", soft_wrap=True)
    console.print(table)


def show_line(verdict: str, name: str, said: str) -> None:
    """Print what came of one design among several."""
    style = "green" if verdict == "ok" else "bold red"
    console = _console()
    console.print(f"[{style}]{verdict:6}[/] {escape(name)}  {escape(said)}", soft_wrap=True)


def show_surfaces(named: Sequence[Mapping[str, Any]], periodic: Sequence[str]) -> None:
    """Print the catalog: names, options with their defaults, and which way a surface closes."""
    console = _console()
    table = Table(box=None, pad_edge=False)
    for column in ("name", "options", "closes", "what it is"):
        table.add_column(column, overflow="fold")
    for entry in named:
        options = ", ".join(f"{key} = {value:g}" for key, value in entry["options"].items())
        table.add_row(entry["name"], options, entry["closes"] or "", escape(entry["description"]))
    console.print(table)
    console.print("\nEvery one also takes bonnet_angle (degrees): 90 is the conjugate surface.")
    console.print(
        f"Periodic surfaces (surface.periodic, any number of cells): {', '.join(periodic)}"
    )


def show_comparison(found: Comparison) -> None:
    """Print a column for each way to panel a surface."""
    console = _console()
    names = [row.name for row in found.rows]
    console.print(f"[bold]{escape(found.title)}[/], equal {found.equal}")
    if console.width < NARROW:
        for label, *values in found.table():
            console.print(f"{escape(label)}\n  {' | '.join(values)}")
    else:
        table = Table(box=None, pad_edge=False)
        table.add_column("", overflow="fold")
        for name in names:
            table.add_column(name, justify="right", overflow="fold")
        for label, *values in found.table():
            table.add_row(escape(label), *(escape(value) for value in values))
        console.print(table)
    for row in found.rows:
        for note in row.notes:
            console.print(escape(note), soft_wrap=True)


def show_inspection(found: Inspection) -> None:
    """Print what was measured on a mesh, section by section."""
    from phexfab.inspection import lines

    console = _console()
    for title, rows in lines(found):
        console.print(f"[bold]{escape(title)}[/]")
        table = Table(box=None, pad_edge=False, show_header=False)
        table.add_column(overflow="fold", min_width=min(32, console.width // 2))
        table.add_column(overflow="fold")
        for name, value in rows:
            table.add_row(f"  {escape(name)}", escape(value))
        console.print(table)
    for note in found.notes:
        console.print(escape(note), soft_wrap=True)


def show_findings(findings: Sequence[Finding], repair: str) -> None:
    """Print what the doctor found, and last the one line that repairs it."""
    console = _console()
    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(no_wrap=True)
    table.add_column(no_wrap=True)
    table.add_column(overflow="fold")
    for finding in findings:
        verdict = "[green]ok[/]" if finding.ok else "[bold red]BROKEN[/]"
        table.add_row(escape(finding.name), verdict, escape(finding.detail))
    console.print(table)
    if repair:
        console.print(f"\nTo repair it: {escape(repair)}", soft_wrap=True)


def _listing() -> Table:
    """Return a table of names with numbers at the right."""
    table = Table(box=None, pad_edge=False, show_header=False)
    table.add_column(overflow="fold")
    table.add_column(justify="right", no_wrap=True)
    return table


def _bytes(size: int) -> str:
    amount = float(size)
    for unit in ("B", "kB", "MB"):
        if amount < 1000:
            return f"{amount:.0f} {unit}" if unit == "B" else f"{amount:.1f} {unit}"
        amount /= 1000
    return f"{amount:.1f} GB"

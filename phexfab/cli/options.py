"""Arguments and options that several verbs share, and what a shell completes them with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, get_args

import typer

Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON document, for machines; errors too.")
]
Quiet = Annotated[
    bool, typer.Option("--quiet", "-q", help="Print nothing but what is wrong.", show_default=False)
]
Verbose = Annotated[
    bool,
    typer.Option(
        "--verbose", "-v", help="Tell stages, times, figures and notes.", show_default=False
    ),
]


def paths_like(incomplete: str, *endings: str) -> list[str]:
    """Return the files with one of the endings, and the folders, that begin so."""
    head, _, name = incomplete.rpartition("/")
    folder = Path(head + "/" if head or incomplete.startswith("/") else ".").expanduser()
    prefix = head + "/" if "/" in incomplete else ""
    try:
        entries = sorted(folder.iterdir())
    except OSError:
        return []
    return [
        f"{prefix}{entry.name}{'/' if entry.is_dir() else ''}"
        for entry in entries
        if entry.name.startswith(name)
        and (name.startswith(".") or not entry.name.startswith("."))
        and (entry.is_dir() or entry.suffix.lower() in endings)
    ]


def design_files(incomplete: str) -> list[str]:
    """Return the design files that begin so."""
    return paths_like(incomplete, ".toml")


def reports(incomplete: str) -> list[str]:
    """Return design files and reports that begin so."""
    return paths_like(incomplete, ".toml", ".html")


def mesh_files(incomplete: str) -> list[str]:
    """Return the meshes that begin so."""
    return paths_like(incomplete, ".obj", ".off", ".ply", ".stl", ".json")


def rim_files(incomplete: str) -> list[str]:
    """Return the files that may hold a rim and begin so."""
    return paths_like(incomplete, ".csv", ".dxf", ".step", ".stp", ".brep")


def step_files(incomplete: str) -> list[str]:
    """Return the CAD files that begin so."""
    return paths_like(incomplete, ".step", ".stp", ".brep")


def surface_names(incomplete: str) -> list[tuple[str, str]]:
    """Return the catalog's names that begin so, with what they are."""
    from phexfab.surface.catalog import catalog

    return [(e.name, e.description) for e in catalog.values() if e.name.startswith(incomplete)]


def periodic_names(incomplete: str) -> list[str]:
    """Return the periodic surfaces that begin so."""
    from phexfab.surface.periodic.closed_forms import PERIODIC

    return [name for name in PERIODIC if name.startswith(incomplete)]


def methods(incomplete: str) -> list[str]:
    """Return the ways to planar hexagons on a free-form surface that begin so."""
    from phexfab.design.mesh_method import Method

    return [name for name in get_args(Method) if name.startswith(incomplete)]


def format_names(incomplete: str) -> list[str]:
    """Return lists of formats that continue what is there: ``glb,`` and one more."""
    from phexfab.design.output import FileFormat

    begun, comma, last = incomplete.rpartition(",")
    left = [name for name in get_args(FileFormat) if name not in begun.split(",")]
    return [begun + comma + name for name in left if name.startswith(last)]


DesignFiles = Annotated[
    list[Path],
    typer.Argument(
        metavar="DESIGN",
        help="Design files (TOML), one or several.",
        show_default=False,
        autocompletion=design_files,
    ),
]
DesignFile = Annotated[
    Path,
    typer.Argument(
        metavar="DESIGN",
        help="Design file (TOML).",
        show_default=False,
        autocompletion=design_files,
    ),
]

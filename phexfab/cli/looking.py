"""The verbs that only look: ``compare``, ``inspect``, ``surfaces`` and ``doctor``."""

from __future__ import annotations

import json as reader
from dataclasses import asdict
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from phexfab.cli.building import folder_for
from phexfab.cli.failures import BROKEN, answered
from phexfab.cli.options import DesignFile, Json, Quiet, Verbose, mesh_files
from phexfab.cli.voice import Voice

if TYPE_CHECKING:
    from phexfab.cad.doctor import Finding

LIBRARIES = ("numpy", "scipy", "shapely", "manifold3d", "ezdxf", "spyrrow", "matplotlib")


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
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Panel a design's surface with triangles, planar quads and planar hexagons, and compare."""
    voice = Voice(json, quiet)
    with answered(voice, str(design)):
        from phexfab.design import load_design

        asked = load_design(design)
        directory = folder_for(output, f"{design.stem}-comparison")
        from phexfab.compare import compare as compare_panelings

        found = compare_panelings(asked, equal, packer=packer)
        found.write(directory)
        if voice.speaks:
            from phexfab.cli.tables import show_comparison, show_folder

            show_comparison(found)
            show_folder(directory, {})
        voice.answer({"exit_code": 0, "directory": directory, **reader.loads(found.to_json())})


def inspect(
    mesh: Annotated[
        Path,
        typer.Argument(
            metavar="MESH",
            help="Mesh (OBJ or OFF).",
            show_default=False,
            autocompletion=mesh_files,
        ),
    ],
    offset: Annotated[
        Path | None,
        typer.Argument(
            metavar="[OFFSET]",
            help="Its offset, same faces.",
            show_default=False,
            autocompletion=mesh_files,
        ),
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
    json: Json = False,
    quiet: Quiet = False,
) -> None:
    """Measure a mesh from elsewhere: planarity, offset types, curvature, torsion."""
    voice = Voice(json, quiet)
    with answered(voice):
        if gauss and offset is None:
            raise typer.BadParameter("name the Gauss image after the mesh", param_hint="--gauss")
        from phexfab.inspection import inspect_files

        found = inspect_files(mesh, offset, gauss=gauss, tolerance=weld)
        if voice.speaks:
            from phexfab.cli.tables import show_inspection

            show_inspection(found)
        voice.answer({"exit_code": 0, **reader.loads(found.to_json())})


def surfaces(json: Json = False) -> None:
    """List the surfaces that a design file may name."""
    voice = Voice(json)
    with answered(voice):
        from phexfab.surface.catalog import catalog
        from phexfab.surface.periodic.closed_forms import PERIODIC

        named = []
        for name, entry in catalog.items():
            period = entry.make().period
            ways = None if period is None else ("v" if abs(period.imag) > abs(period.real) else "u")
            options = {key: v for key, v in entry.options.items() if key != "bonnet_angle"}
            named.append(
                {
                    "name": name,
                    "options": options,
                    "closes": ways,
                    "description": entry.description,
                    "source": entry.source,
                }
            )
        if voice.speaks:
            from phexfab.cli.tables import show_surfaces

            show_surfaces(named, PERIODIC)
        voice.answer({"exit_code": 0, "surfaces": named, "periodic": PERIODIC})


def doctor(json: Json = False, quiet: Quiet = False, verbose: Verbose = False) -> None:
    """Look at Python, CAD libraries and system, build a small shell, say what repairs them."""
    voice = Voice(json, quiet, verbose)
    with answered(voice):
        from phexfab.cad import doctor as cad_doctor

        with voice.progress() as report:
            if report:
                report("loading the CAD libraries", 0, 0)
            findings = [*_libraries(), *cad_doctor.doctor()]
        well = all(finding.ok for finding in findings)
        line = cad_doctor.repair(findings)
        if voice.speaks or (not well and not voice.json):
            from phexfab.cli.tables import show_findings

            shown = [finding for finding in findings if not (quiet and finding.ok)]
            show_findings(shown, line)
        code = 0 if well else BROKEN
        told = [asdict(finding) for finding in findings]
        voice.answer({"exit_code": code, "findings": told, "repair": line})
        if code:
            raise typer.Exit(code)


def version(distribution: str) -> str:
    """Return the installed version of a distribution, or ""."""
    try:
        return metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return ""


def _libraries() -> list[Finding]:
    """Return whether the libraries without a kernel are installed."""
    from phexfab.cad.doctor import Finding

    found = {name: version(name) for name in LIBRARIES}
    remedy = "python -m pip install --upgrade {}"
    return [
        Finding(name, bool(number), number or "absent", "" if number else remedy.format(name))
        for name, number in found.items()
    ]

"""STEP straight from the arrays: every part a product, named, coloured, layered and grouped.

The faces, edges and corners of the parts are known, so no kernel is needed to write them: the
file is the arrays spelled out, one text template per topology. The schema is AP214 (automotive
design) unless AP242 is asked for: solids, assemblies, names, colours and layers are the same in
both, and every reader of the last twenty-five years takes the older.

Coordinates are those of the shell: all placements are identities, so what touches in the arrays
touches in the file.

References
----------
ISO 10303-21 (the text), -214 and -242 (the schemas).
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from phexfab.cad.faceted import batches
from phexfab.cad.part21 import Run, quote, references
from phexfab.cad.step_runs import (
    FREE,
    SCHEMAS,
    SOLID,
    STYLED,
    assembly,
    cylinder,
    polyhedron,
    preamble,
)
from phexfab.cad.tree import Family, families
from phexfab.errors import DesignError, PartError
from phexfab.fabrication.parts import Cylinder, Parts, Solid
from phexfab.whole import whole

FloatArray = NDArray[np.float64]

DECIMALS = 10
"""Coordinates are rounded to 1e-10 mm: far below any tolerance, above most rounding noise."""

_DIRECTION_DECIMALS = 12
_CHUNK = 1000  # parts written at a time, so that memory does not grow with the shell


def default_timestamp() -> str:
    """Return SOURCE_DATE_EPOCH as ISO 8601 in UTC, or the epoch itself when it is not set.

    Raises
    ------
    DesignError
        If the variable is set but is no whole number of seconds.
    """
    seconds = os.environ.get("SOURCE_DATE_EPOCH", "0")
    try:
        return datetime.fromtimestamp(int(seconds), UTC).strftime("%Y-%m-%dT%H:%M:%S")
    except (ValueError, OverflowError, OSError) as error:
        raise DesignError(f"SOURCE_DATE_EPOCH is {seconds!r}; give whole seconds") from error


@dataclass(frozen=True)
class StepHeader:
    """What a STEP file says about itself.

    Attributes
    ----------
    name : str
        Name of the root assembly, and of the file.
    description, author, organisation : str
    system : str
        The originating system; name the version here if it should show.
    timestamp : str, optional
        ISO 8601. By default SOURCE_DATE_EPOCH, else 1970: the same parts give the same bytes.
    schema : {"AP214", "AP242"}
    """

    name: str = "shell"
    description: str = ""
    author: str = ""
    organisation: str = ""
    system: str = "phexfab"
    timestamp: str | None = None
    schema: str = "AP214"


def _cylinder_values(cylinders: Sequence[Cylinder], marks: Sequence[str]) -> FloatArray:
    """Return the (k, 22) columns that ``cylinder`` runs on."""
    sizes = np.round([[c.radius, c.length] for c in cylinders], DECIMALS)
    frames = np.array([[c.base, c.axis] for c in cylinders], float)
    norms = np.sqrt((frames[:, 1] ** 2).sum(axis=1))
    good = np.isfinite(frames).all(axis=(1, 2)) & (sizes > 0).all(axis=1) & (norms > 0)
    if not good.all():
        raise PartError(
            f"{marks[int(good.argmin())]}: a hub needs a finite base, an axis, and a radius and "
            "length above zero"
        )
    base = np.round(frames[:, 0], DECIMALS) + 0.0
    axis = frames[:, 1] / norms[:, None]
    # The seam lies towards the coordinate axis that the cylinder's axis is farthest from.
    helper = np.eye(3)[np.abs(np.round(axis, 6)).argmin(axis=1)]
    side = helper - axis * (helper * axis).sum(axis=1, keepdims=True)
    side /= np.sqrt((side**2).sum(axis=1, keepdims=True))
    axis, side = (np.round(v, _DIRECTION_DECIMALS) + 0.0 for v in (axis, side))
    radius, length = sizes[:, :1], sizes[:, 1:]
    top = base + length * axis
    points = [np.round(p, DECIMALS) + 0.0 for p in (base + radius * side, top + radius * side, top)]
    return np.hstack([base, axis, side, 0.0 - axis, *points, radius])


def _runs(
    members: Sequence[tuple[str, Solid | Cylinder]], parent: int, style: int
) -> Iterator[tuple[Run, NDArray[np.int64], FloatArray]]:
    """Yield for each topology its run, the places of its members, and their numbers."""
    solids = [(i, m, g) for i, (m, g) in enumerate(members) if isinstance(g, Solid)]
    places = np.array([i for i, _, _ in solids], np.int64)
    for batch in batches([g for _, _, g in solids], [m for _, m, _ in solids], DECIMALS):
        used = batch.points[:, batch.topology.used]
        directions = np.round(
            np.concatenate([batch.directions, batch.normals], axis=1), _DIRECTION_DECIMALS
        )
        values = np.concatenate([used, directions + 0.0], axis=1).reshape(len(used), -1)
        yield polyhedron(batch.topology, parent, style), places[batch.index], values
    hubs = [(i, m, g) for i, (m, g) in enumerate(members) if isinstance(g, Cylinder)]
    if hubs:
        values = _cylinder_values([g for _, _, g in hubs], [m for _, m, _ in hubs])
        yield cylinder(parent, style), np.array([i for i, _, _ in hubs]), values


def _write_members(
    family: Family, parent: int, style: int, first: int
) -> Iterator[tuple[str, int, list[int], list[int]]]:
    """Yield text, the next free number, and the first and last numbers of parts, by chunks."""
    for begin in range(0, len(family.members), _CHUNK):
        members = family.members[begin : begin + _CHUNK]
        runs = list(_runs(members, parent, style))
        counts = np.zeros(len(members), np.int64)
        for run, places, _ in runs:
            counts[places] = run.count
        ends = first + np.cumsum(counts)
        starts = ends - counts
        texts = [""] * len(members)
        for run, places, values in runs:
            marks = [members[i][0] for i in places.tolist()]
            for i, text in zip(
                places.tolist(), run.write(starts[places], marks, values), strict=True
            ):
                texts[i] = text
        first = int(ends[-1])
        yield "".join(texts), first, starts.tolist(), ends.tolist()


def _single(run: Run, first: int, name: str) -> str:
    return run.write(np.array([first]), [name], np.zeros((1, 0)))[0]


def step_text(parts: Parts, header: StepHeader | None = None) -> Iterator[str]:
    """Yield the text of a STEP file piece by piece; see ``write_step``."""
    header = header or StepHeader()
    if header.schema not in SCHEMAS:
        raise DesignError(f"STEP schema {header.schema!r}: choose one of {', '.join(SCHEMAS)}")
    schema = SCHEMAS[header.schema]
    tree = families(parts)
    stamp = default_timestamp() if header.timestamp is None else header.timestamp
    yield (
        "ISO-10303-21;\nHEADER;\n"
        f"FILE_DESCRIPTION(({quote(header.description)}),'2;1');\n"
        f"FILE_NAME({quote(header.name)},{quote(stamp)},({quote(header.author)}),\n"
        f"({quote(header.organisation)}),{quote(header.system)},{quote(header.system)},'');\n"
        f"FILE_SCHEMA(('{schema.header}'));\nENDSEC;\nDATA;\n"
    )
    yield preamble(schema)
    root = FREE
    run = assembly(None)
    products, styled = [root], []
    yield _single(run, root, header.name)
    free = root + run.count
    for family in tree:
        run = assembly(root)
        yield _single(run, free, family.name)
        products.append(free)
        parent, style = free, free + run.count
        colour = ",".join(f"{c:.4f}" for c in family.colour)
        yield (
            f"#{style}=PRESENTATION_STYLE_ASSIGNMENT((#{style + 1}));\n"
            f"#{style + 1}=SURFACE_STYLE_USAGE(.BOTH.,#{style + 2});\n"
            f"#{style + 2}=SURFACE_SIDE_STYLE('',(#{style + 3}));\n"
            f"#{style + 3}=SURFACE_STYLE_FILL_AREA(#{style + 4});\n"
            f"#{style + 4}=FILL_AREA_STYLE('',(#{style + 5}));\n"
            f"#{style + 5}=FILL_AREA_STYLE_COLOUR('',#{style + 6});\n"
            f"#{style + 6}=COLOUR_RGB({quote(family.name)},{colour});\n"
        )
        free = style + 7
        solids: list[int] = []
        for text, end, starts, ends in _write_members(family, parent, style, free):
            yield text
            free = end
            products += starts
            styled += [end + STYLED for end in ends]
            solids += [end + SOLID for end in ends]
        layer = f"{quote(family.name)},'',{references(solids)}"
        yield f"#{free}=PRESENTATION_LAYER_ASSIGNMENT({layer});\n"
        free += 1
    yield f"#{free}=PRODUCT_RELATED_PRODUCT_CATEGORY('part','',{references(products)});\n"
    yield (
        f"#{free + 1}=MECHANICAL_DESIGN_GEOMETRIC_PRESENTATION_REPRESENTATION('',"
        f"{references(styled)},#1);\nENDSEC;\nEND-ISO-10303-21;\n"
    )


def write_step(parts: Parts, path: str | Path, header: StepHeader | None = None) -> Path:
    """Write panels, beams and nodes as a STEP assembly, without a CAD kernel.

    The tree is ``header.name`` → ``panels``, ``beams``, ``nodes`` → the parts. A part's mark is the
    name of its product, of its instance and of its ``MANIFOLD_SOLID_BREP``; its family is its
    layer. Lengths are in mm.

    Parameters
    ----------
    parts : Parts
    path : str or Path
        Replaced as a whole when the file is complete; untouched when something fails.
    header : StepHeader, optional

    Returns
    -------
    Path
        Where it was written.

    Raises
    ------
    PartError
        If a solid is open, warped or inside out, or marks are not unique; nothing is written.
    DesignError
        If the schema is unknown.

    References
    ----------
    ISO 10303-214, -242; thesis ch. 1 (panels, beams and nodes of a shell).
    """
    with whole(path) as draft, open(draft, "w", encoding="ascii", newline="\n") as file:
        file.writelines(step_text(parts, header))
    return Path(path)

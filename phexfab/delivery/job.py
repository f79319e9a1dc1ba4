"""What goes into files: a build, and what is made of it only when a file needs it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from phexfab.cad.dxf import write_sheets
from phexfab.cad.model_plates import Plate, panel_plates
from phexfab.cad.scale_model import ScaleModel, printed_shell
from phexfab.cad.step import StepHeader
from phexfab.cad.triangles import Body
from phexfab.fabrication.layout import layout_to_json
from phexfab.fabrication.marking import Marking, marking
from phexfab.fabrication.nest import nest_all
from phexfab.fabrication.parts import FlatPart, Sheet

if TYPE_CHECKING:
    from phexfab.pipeline import Build

Progress = Callable[[str, int, int], None]
LAYOUT = "layout.json"


@dataclass(frozen=True, eq=False)
class Job:
    """What is written: a build, its nests and engraving once they are asked for."""

    built: Build
    before: Path  # the folder that an earlier build may have left
    say: Progress
    asked: ScaleModel | None = None

    @cached_property
    def nested(self) -> tuple[dict[str, FlatPart], list[Sheet], dict[str, Any], list[str]]:
        """Flat parts by mark, sheets, layouts for JSON, notes."""
        self.say("nesting", 0, 0)
        return _nest(self.built, self.before, self.say)

    @cached_property
    def engraved(self) -> dict[str, Marking]:
        return {mark: marking(flat) for mark, flat in self.nested[0].items()}

    @property
    def model(self) -> ScaleModel:
        """How the scale model is printed: as asked for, else as the design says."""
        output = self.built.design.output
        return self.asked or ScaleModel(output.scale, output.bed, output.wall)

    @cached_property
    def printed(self) -> tuple[Body, float]:
        """The scale model in one piece, and its scale."""
        return printed_shell(self.built.shell, self.built.parts, self.model)

    @cached_property
    def plates(self) -> tuple[Plate, ...]:
        """The scale model's panels on the printer's plates."""
        return panel_plates(self.built.parts.panels, self.model, self.printed[1])

    @property
    def header(self) -> StepHeader:
        project = self.built.design.project
        stamp = project.date.isoformat() + "T00:00:00" if project.date else None
        return StepHeader(
            name=self.built.design.name,
            author=project.author,
            organisation=project.organisation,
            timestamp=stamp,
        )

    def write_sheets(self, folder: Path, version: str) -> None:
        design = self.built.design
        flats, sheets, *_ = self.nested
        lines = {mark: made.lines for mark, made in self.engraved.items()}
        project = design.project
        meta = {"project": design.name, "revision": project.revision, "author": project.author}
        write_sheets(sheets, flats, folder, meta, version=version, marks=lines)


def _nest(
    built: Build, before: Path, say: Progress
) -> tuple[dict[str, FlatPart], list[Sheet], dict[str, Any], list[str]]:
    """Nest both families; layouts of the last build serve again where nothing has changed."""
    asked = built.design.nesting
    kept: Mapping[str, Any] = {}
    if (before / LAYOUT).is_file():
        try:
            kept = json.loads((before / LAYOUT).read_text(encoding="utf-8"))
        except (OSError, ValueError):
            kept = {}
    flats: dict[str, FlatPart] = {}
    sheets: list[Sheet] = []
    layouts: dict[str, Any] = {}
    notes: list[str] = []
    for family, made in (("panels", built.parts.panels), ("beams", built.parts.beams)):
        own = {part.mark: part.flat for part in made}
        if not own:
            continue
        previous = kept.get(family)
        nested = nest_all(
            list(own.values()),
            built.stocks[family],
            seed=asked.seed,
            seconds=asked.seconds,
            packer=asked.packer,
            previous=json.dumps(previous) if previous else None,
            progress=partial(say, f"nesting {family}"),
        )
        layouts[family] = json.loads(layout_to_json(nested))
        sheets += nested.sheets
        notes += nested.notes
        flats |= own
    return flats, sheets, layouts, notes

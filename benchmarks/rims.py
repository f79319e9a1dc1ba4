"""From a rim to a cut shell at two sizes: CPU seconds of every stage, and how they grow.

Run: python benchmarks/rims.py [--panels 1000 10000] [--only saddle canopy ...]

Panels keep their size and the rims grow, as they would. The stages are the film with its margin
beyond the rim, the lattice, the exact minimal shell, and the cut, again and again where the first
one misses a limit at the rim; the parts (panels, beams, nodes) are timed for themselves. What is
asked: 1000 panels in 5 s, 10 000 in 20 s. The last column is the exponent with which the total
grows from the size before.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from phexfab import ending, films, fitting, forming
from phexfab.design import Design, load_design
from phexfab.errors import PartError
from phexfab.fabrication.beams import beams
from phexfab.fabrication.nodes import nodes
from phexfab.fabrication.panels import panels
from phexfab.films import rims_asked
from phexfab.pipeline import specs
from phexfab.surface.rims.rim import Rim

EXAMPLES = Path(__file__).parent.parent / "examples"
STAGES = {
    "film": ((films, "plateau"), (films, "extended"), (films, "mesh_film"),
             (films, "mesh_film_with_margin"), (films, "periodic_film"), (films, "atlas")),
    "lattice": ((forming, "lattice_at"), (fitting, "lattice_at")),
    "shell": ((forming, "solved_shell"), (fitting, "solved_shell")),
    "cut": ((ending, "cut_shell"),),
}  # fmt: skip
ASKED = {1000: 5.0, 10_000: 20.0}


@dataclass(frozen=True)
class Case:
    """A design of the examples, offset types to try it with, and its rims where it has any."""

    example: str
    types: tuple[str, ...]
    rims: tuple[Rim, ...] = ()

    def sized(self, factor: float, kind: str) -> tuple[Design, tuple[Rim, ...]]:
        """Return the design with its rims enlarged."""
        design = load_design(EXAMPLES / f"{self.example}.toml")
        offset = design.offset.model_copy(update={"type": kind})
        design = design.model_copy(update={"offset": offset})
        if design.surface.periodic is None:
            rims = self.rims or rims_asked(design)
            return design, tuple(rim.scaled(factor) for rim in rims)
        cells = max(1, int((factor / 1.7) ** (2 / 3)))  # more cells, and larger ones
        scale = design.surface.scale * factor / cells**1.5
        surface = design.surface.model_copy(update={"cells": (cells,) * 3, "scale": scale})
        return design.model_copy(update={"surface": surface}), ()


def saddle(points: int = 256) -> Rim:
    """A roof of 12 m over two low and two high points."""
    angle = 2 * np.pi * np.arange(points) / points
    up = 0.3 * np.cos(2 * angle) + 0.02 * np.cos(3 * angle + 1)
    return Rim.through(6000 * np.stack([1.1 * np.cos(angle), 0.9 * np.sin(angle), up], -1))


CASES = {
    "saddle": Case("three-lobed-roof", ("face", "edge", "vertex"), (saddle(),)),
    "three-lobed": Case("three-lobed-roof", ("face", "edge", "vertex")),
    "five-lobed": Case("five-lobed-roof", ("face", "edge", "vertex")),
    "canopy": Case("four-corner-canopy", ("face", "edge", "vertex")),
    "ring-court": Case("ring-court", ("face", "edge", "vertex")),
    "schwarz-p": Case("schwarz-p-cell", ("face",)),  # circles cannot be laid out on its sphere
}


@contextmanager
def clock() -> Iterator[dict[str, float]]:
    """Give CPU seconds per stage, of everything that runs meanwhile."""
    spent = dict.fromkeys(STAGES, 0.0)
    before: list[tuple[Any, str, Callable[..., Any]]] = []

    def timed(stage: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def run(*args: Any, **options: Any) -> Any:
            begin = time.process_time()
            try:
                return function(*args, **options)
            finally:
                spent[stage] += time.process_time() - begin

        return run

    for stage, places in STAGES.items():
        for room, name in places:
            before.append((room, name, getattr(room, name)))
            setattr(room, name, timed(stage, getattr(room, name)))
    try:
        yield spent
    finally:
        for room, name, function in before:
            setattr(room, name, function)


def walk(case: Case, factor: float, kind: str) -> tuple[int, dict[str, float]]:
    """Return the number of panels, and CPU seconds per stage."""
    design, rims = case.sized(factor, kind)
    with clock() as spent:
        begin = time.process_time()
        shell = forming.form(design, lambda *_: None, rims).shell
        total = time.process_time() - begin
    panel_spec, beam_spec, node_spec = specs(design)
    begin = time.process_time()
    try:
        panels(shell, panel_spec)
        beams(shell, beam_spec, panel_spec)
        nodes(shell, node_spec, beam_spec, panel_spec)
        parts = time.process_time() - begin
    except PartError:  # a cut panel too small for the example's gaps
        parts = np.nan
    rest = total - sum(spent.values())
    return len(shell.panels), {**spent, "rest": rest, "total": total, "parts": parts}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--panels", type=int, nargs="+", default=[1000, 10_000])
    parser.add_argument("--only", nargs="+", choices=CASES, default=list(CASES))
    parser.add_argument("--types", nargs="+", choices=("face", "edge", "vertex"))
    asked = parser.parse_args()
    walk(CASES["saddle"], 0.5, "face")  # warm up imports
    names = (*STAGES, "rest", "total", "parts")
    print(f"{'rim':13}{'type':8}{'panels':>8}" + "".join(f"{n:>9}" for n in names) + "  growth")
    for name in asked.only:
        case = CASES[name]
        for kind in asked.types or case.types:
            count, seconds = walk(case, 1.0, kind)
            factor, before = 1.0, (count, seconds["total"])
            for wanted in asked.panels:
                factor *= np.sqrt(wanted / count)
                count, seconds = walk(case, factor, kind)
                growth = np.log(seconds["total"] / before[1]) / np.log(count / before[0])
                before = (count, seconds["total"])
                limit = ASKED.get(wanted, np.inf) * max(count / wanted, 1.0)
                line = "".join(f"{seconds[n]:9.2f}" for n in names)
                late = "" if seconds["total"] <= limit else f"  over {limit:.0f} s"
                print(f"{name:13}{kind:8}{count:8d}{line}{growth:8.2f}{late}", flush=True)


if __name__ == "__main__":
    main()

"""Strip packing by spyrrow (Sparrow): do these contours fit on one sheet?

Sparrow packs a strip of fixed height as short as it can. Asked for one sheet at a time it is
enough to know whether the strip gets as short as the sheet, and the first layout that does is
taken: with one worker and a fixed seed it is the same on every run and every machine.

References
----------
Gardeyn, Wauters, Vanden Berghe 2025, "An open-source heuristic to reboot 2D nesting research",
arXiv:2509.13329.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from phexfab.fabrication.shelf import Spot, turned

FloatArray = NDArray[np.float64]

_WORKER = Path(__file__).with_name("strip_worker.py")


@dataclass(frozen=True)
class StripRun:
    """What a run must do: contours, the strip's height and target length, angles, seed, patience.

    ``failures`` is how often the packer may get stuck before it gives up.
    """

    contours: tuple[FloatArray, ...]
    height: float
    target: float
    angles: tuple[float, ...] | None
    seed: int
    failures: int


@dataclass(frozen=True)
class StripLayout:
    """What came out: the strip's length, where each contour lies, and what went wrong, if so.

    ``late`` is true where the clock ended the run; only then may another run differ.
    """

    length: float
    spots: tuple[Spot, ...]
    error: str = ""
    late: bool = False


def pack_strips(runs: Sequence[StripRun], seconds: float) -> list[StripLayout]:
    """Run the packer on several strips at once, each in a process of its own.

    Parameters
    ----------
    runs : sequence of StripRun
    seconds : float
        The clock's limit for all of them; a guard against a packer that hangs.

    Returns
    -------
    list of StripLayout
        ``length`` is infinite where no layout was found.
    """
    processes: list[subprocess.Popen[str]] = []
    deadline = time.monotonic() + seconds
    try:
        for _ in runs:
            processes.append(
                subprocess.Popen(
                    [sys.executable, "-P", str(_WORKER)],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.PIPE,
                    stderr=subprocess.PIPE,
                    text=True,
                )
            )
        return [
            _finish(run, process, deadline) for run, process in zip(runs, processes, strict=True)
        ]
    finally:
        for process in processes:
            if process.poll() is None:
                process.kill()
                process.communicate()


def _finish(run: StripRun, process: subprocess.Popen[str], deadline: float) -> StripLayout:
    centres = [(c.min(axis=0) + c.max(axis=0)) / 2 for c in run.contours]
    job = {
        # Sparrow counts in single precision: keep the numbers small.
        "shapes": [(c - m).tolist() for c, m in zip(run.contours, centres, strict=True)],
        "height": run.height,
        "target": run.target,
        "angles": None if run.angles is None else list(run.angles),
        "seed": run.seed,
        "failures": run.failures,
        "seconds": 3600,
    }
    try:
        out, err = process.communicate(
            json.dumps(job), timeout=max(deadline - time.monotonic(), 0.01)
        )
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return StripLayout(np.inf, (), "", late=True)
    if process.returncode or not out:
        last = err.strip().splitlines()[-1:] or [f"exit code {process.returncode}"]
        return StripLayout(np.inf, (), last[0])
    answer = json.loads(out)
    if answer["length"] is None:
        return StripLayout(np.inf, (), answer["error"] or "no layout")
    spots = []
    for k, rotation, x, y in answer["spots"]:
        angle = _nearest(rotation, run.angles)
        dx, dy = turned(centres[k][None], angle)[0]
        spots.append((k, angle, x - float(dx), y - float(dy)))
    return StripLayout(answer["length"], tuple(spots), answer["error"])


def _nearest(rotation: float, angles: tuple[float, ...] | None) -> float:
    """Undo the packer's rounding of the angle to single precision."""
    if angles is None:
        return rotation % 360.0
    gaps = [abs((rotation - angle + 180.0) % 360.0 - 180.0) for angle in angles]
    return angles[int(np.argmin(gaps))] % 360.0

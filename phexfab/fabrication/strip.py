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

import contextlib
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
    """What a run must do: contours, the strip's height and target length, angles, seed.

    ``patience`` is the number of the packer's reports after which the run is given up; it ends
    earlier when the layout fits or when the packer gets stuck for the first time.
    """

    contours: tuple[FloatArray, ...]
    height: float
    target: float
    angles: tuple[float, ...]
    seed: int
    patience: int


@dataclass(frozen=True)
class StripLayout:
    """What came out: the strip's length, where each contour lies, and what went wrong, if so.

    ``reports`` tells how much work it was, in the packer's reports. ``late`` is true where the
    clock ended the run; only then may another run differ.
    """

    length: float
    spots: tuple[Spot, ...]
    reports: int = 0
    error: str = ""
    late: bool = False


def pack_strips(
    runs: Sequence[StripRun], seconds: float, *, until_one_fits: bool = False
) -> list[StripLayout]:
    """Run the packer on several strips at once, each in a process of its own.

    Parameters
    ----------
    runs : sequence of StripRun
    seconds : float
        The clock's limit for all of them; a guard against a packer that hangs.
    until_one_fits : bool
        Do not wait for the runs that follow one that reached its target.

    Returns
    -------
    list of StripLayout
        As many as were waited for; ``length`` is infinite where no layout was found.
    """
    processes: list[subprocess.Popen[str]] = []
    deadline = time.monotonic() + seconds
    layouts = []
    try:
        for run in runs:
            process = subprocess.Popen(
                [sys.executable, "-P", str(_WORKER)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
            )
            processes.append(process)
            _start(run, process)
        for run, process in zip(runs, processes, strict=True):
            layouts.append(_finish(run, process, deadline))
            if until_one_fits and layouts[-1].length <= run.target:
                break
        return layouts
    except OSError as error:  # no interpreter, no memory, no process to be had
        return [StripLayout(np.inf, (), error=str(error)) for _ in runs]
    finally:
        for process in processes:
            process.kill()
            process.wait()
            for stream in (process.stdin, process.stdout, process.stderr):
                if stream is not None and not stream.closed:
                    stream.close()


def _centres(run: StripRun) -> list[FloatArray]:
    """Sparrow counts in single precision: contours are handed over about their own middle."""
    return [(c.min(axis=0) + c.max(axis=0)) / 2 for c in run.contours]


def _start(run: StripRun, process: subprocess.Popen[str]) -> None:
    job = {
        "shapes": [(c - m).tolist() for c, m in zip(run.contours, _centres(run), strict=True)],
        "height": run.height,
        "target": run.target,
        "angles": list(run.angles),
        "seed": run.seed,
        "patience": run.patience,
        "seconds": 3600,
    }
    assert process.stdin is not None
    # A worker that died is found out by its exit code.
    with contextlib.suppress(BrokenPipeError):
        process.stdin.write(json.dumps(job))
        process.stdin.close()


def _finish(run: StripRun, process: subprocess.Popen[str], deadline: float) -> StripLayout:
    process.stdin = None  # closed already; keep communicate() from touching it
    try:
        out, err = process.communicate(timeout=max(deadline - time.monotonic(), 0.01))
    except subprocess.TimeoutExpired:
        return StripLayout(np.inf, (), late=True)
    if process.returncode or not out:
        last = err.strip().splitlines()[-1:] or [f"exit code {process.returncode}"]
        return StripLayout(np.inf, (), error=last[0])
    answer = json.loads(out)
    if answer["length"] is None:
        return StripLayout(np.inf, (), answer["reports"], answer["error"])
    centres = _centres(run)
    spots = []
    for k, rotation, x, y in sorted(answer["spots"]):
        angle = _nearest(rotation, run.angles)
        dx, dy = turned(centres[k][None], angle)[0]
        spots.append((k, angle, x - float(dx), y - float(dy)))
    return StripLayout(answer["length"], tuple(spots), answer["reports"], answer["error"])


def _nearest(rotation: float, angles: tuple[float, ...]) -> float:
    """Undo the packer's rounding of the angle to single precision."""
    gaps = [abs((rotation - angle + 180.0) % 360.0 - 180.0) for angle in angles]
    return angles[int(np.argmin(gaps))] % 360.0

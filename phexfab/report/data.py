"""What the report is made from: plain values, filled in by the pipeline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from phexfab.fabrication.parts import CheckResult, Parts, Sheet
from phexfab.parallel.shell import Shell

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ReportData:
    """All that ``report.html`` shows.

    Attributes
    ----------
    title : str
        Name of the project.
    units : str
        Length unit of the geometry, ``"mm"``.
    shell : Shell
    parts : Parts
    sheets : tuple of Sheet
    engraving : mapping of mark to polylines
        Each polyline is a (k, 2) array in the coordinates of the part's flat pattern, mm.
    notes : tuple of str
        What a reader of the sheets should know, such as a nest that was cut short.
    checks : tuple of CheckResult
    figures : mapping of name to (value, unit)
        Key figures, listed in the order given.
    histograms : mapping of name to (values, unit)
        One chart each, in the order given.
    versions : mapping of library name to version
    design_text : str
        The design file as it was read.
    """

    title: str
    units: str
    shell: Shell
    parts: Parts
    sheets: tuple[Sheet, ...] = ()
    engraving: Mapping[str, Sequence[FloatArray]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    checks: tuple[CheckResult, ...] = ()
    figures: Mapping[str, tuple[float | int | str, str]] = field(default_factory=dict)
    histograms: Mapping[str, tuple[FloatArray, str]] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    design_text: str = ""

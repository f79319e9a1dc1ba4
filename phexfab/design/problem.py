"""What a rule finds wrong with a design file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong: at which key, what, and what to do about it.

    Attributes
    ----------
    key : str
        Such as ``panels.thickness``; "" for a file that is no TOML.
    text, remedy : str
    value : optional
        What stands there; None where nothing does.
    line : int, optional
        Where it stands in the file.
    """

    key: str
    text: str
    remedy: str
    value: Any = None
    line: int | None = None

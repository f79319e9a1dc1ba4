"""What a rule finds wrong with a design file."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong: at which key, what, and what to do about it."""

    key: str
    text: str
    remedy: str

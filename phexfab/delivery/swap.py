"""Putting finished files in the place of older ones."""

from __future__ import annotations

import shutil
from pathlib import Path

DESKTOP_FILES = frozenset({".DS_Store", "Thumbs.db", "desktop.ini"})  # left by file managers


def swap(fresh: Path, target: Path, old: Path) -> None:
    """Put the fresh folder in the target's place, and the old one back if that fails."""
    if not target.exists():
        fresh.rename(target)
        return
    target.rename(old)
    try:
        fresh.rename(target)
    except OSError:
        old.rename(target)
        raise
    if old.is_dir():
        shutil.rmtree(old)

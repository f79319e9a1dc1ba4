"""Putting finished files in the place of older ones."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

DESKTOP_FILES = frozenset({".DS_Store", "Thumbs.db", "desktop.ini"})  # left by file managers


@contextmanager
def workshop(folder: Path, prefix: str) -> Iterator[Path]:
    """Yield an empty folder in a folder, which is made if need be; it is removed at the end.

    Raises
    ------
    OSError
        Naming the folder that cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        made = tempfile.TemporaryDirectory(prefix=prefix, dir=folder)
    except OSError as error:
        raise type(error)(error.errno, error.strerror, str(folder)) from error
    with made as name:
        yield Path(name)


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

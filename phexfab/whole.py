"""Files that appear whole or not at all."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def whole(path: str | os.PathLike[str]) -> Iterator[Path]:
    """Yield a draft beside ``path`` that takes its place when the block ends well.

    Whatever stood there stays untouched until then; the draft of a block that fails is removed.
    """
    target = Path(path)
    draft = target.with_name(f".{target.name}.{os.getpid()}.part")
    try:
        yield draft
        os.replace(draft, target)
    except OSError as error:
        if error.filename == str(draft):  # nobody asked for a draft
            error.filename, error.filename2 = str(target), None
        raise
    finally:
        draft.unlink(missing_ok=True)

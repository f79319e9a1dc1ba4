"""What went wrong, as an exit code, a message and data: the same for people and for machines."""

from __future__ import annotations

import errno
import re
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import typer

from phexfab.errors import DesignError, MissingLibraryError, PhexError

if TYPE_CHECKING:
    from phexfab.cli.voice import Voice

CHECK_FAILED, WRONG_INPUT, BROKEN, STOPPED = 1, 2, 3, 130
CODES = {
    0: "all is well",
    CHECK_FAILED: "a check failed; a build has written its files all the same",
    WRONG_INPUT: "the design, another input or the command line is wrong",
    BROKEN: "a library is missing or broken, or a file cannot be written",
    STOPPED: "stopped by Ctrl-C",
}
"""Exit codes, as help and manual say them."""

_ELSEWHERE = "; name another folder, or check its permissions"
_REMEDIES = {
    errno.EACCES: _ELSEWHERE,
    errno.EPERM: _ELSEWHERE,
    errno.EROFS: _ELSEWHERE,
    errno.ENOENT: "; check the path",
    errno.EEXIST: "; a part of the path is a file, name a folder",
    errno.ENOTDIR: "; a part of the path is a file, name a folder",
    errno.ENOSPC: "; make room, or name a folder elsewhere; what was there before is untouched",
}
_KEY = re.compile(r"(?P<key>[a-z_]+(?:\.[a-z_]+)+)(?: = (?P<value>.+?))?: (?P<text>.*)", re.DOTALL)
_MARK = re.compile(r"\b[PBN]\d{3,}\b")


@dataclass(frozen=True)
class Failure:
    """An error that phexfab raises on purpose.

    Attributes
    ----------
    code : int
        Exit code.
    kind : str
        Name of the error's class.
    message : str
        All of it, as a person reads it.
    file : str or None
        What could not be used.
    problems : tuple of mapping
        Each thing that is wrong: ``key``, ``part``, ``value``, ``line``, ``text``, ``remedy``;
        None where there is no such thing.
    """

    code: int
    kind: str
    message: str
    file: str | None
    problems: tuple[dict[str, Any], ...] = ()

    def data(self) -> dict[str, Any]:
        """Return it as JSON wants it."""
        return {key: value for key, value in asdict(self).items() if key != "code"}


def failure(error: BaseException, source: str = "") -> Failure | None:
    """Return what an error means, or None for a mistake of our own."""
    kind, text = type(error).__name__, str(error)
    if isinstance(error, KeyboardInterrupt):
        return Failure(STOPPED, kind, "phexfab: stopped", None)
    if isinstance(error, typer.BadParameter):
        return misused(error)
    if isinstance(error, MissingLibraryError):
        return Failure(BROKEN, kind, f"phexfab: {text}", None, (_problem(text),))
    if isinstance(error, PhexError):
        name = source or "phexfab"
        message = text if text.startswith(name) else f"{name}: {text}"
        return Failure(WRONG_INPUT, kind, message, source or None, _problems(error, name))
    if isinstance(error, OSError) and not isinstance(error, BrokenPipeError):
        file = None if error.filename is None else str(error.filename)
        text = (error.strerror or text) + _REMEDIES.get(error.errno or 0, "")
        return Failure(BROKEN, kind, f"phexfab: {file or source}: {text}", file, (_problem(text),))
    return None


def misused(error: Any) -> Failure:
    """Return what an error of typer's about the command line means."""
    said = error.format_message()
    problem = _problem(str(error.message).strip() or said)
    return Failure(WRONG_INPUT, type(error).__name__, f"phexfab: {said}", None, (problem,))


@contextmanager
def answered(voice: Voice, source: str = "") -> Iterator[None]:
    """Turn what is raised on purpose into one message and an exit code, without a traceback."""
    try:
        yield
    except (Exception, KeyboardInterrupt) as error:
        found = failure(error, source)
        if found is None:
            raise
        if isinstance(error, typer.BadParameter) and not voice.json:
            raise  # typer shows how the command is used
        voice.complain(found.message)
        voice.answer({"exit_code": found.code, "error": found.data()})
        raise typer.Exit(found.code) from None


def _problems(error: PhexError, name: str) -> tuple[dict[str, Any], ...]:
    """Return the problems of a design file one by one, or what a single message tells."""
    if isinstance(error, DesignError) and error.problems:
        return tuple({"part": None} | asdict(problem) for problem in error.problems)
    return (_problem(str(error).removeprefix(f"{name}: ")),)


def _problem(message: str) -> dict[str, Any]:
    """Take a message apart that says ``key = value: what is wrong; remedy``."""
    keyed = _KEY.match(message)
    mark = _MARK.search(message)
    text, _, remedy = (keyed["text"] if keyed else message).partition("; ")
    return {
        "part": mark[0] if mark else None,
        "key": keyed["key"] if keyed else None,
        "text": text,
        "remedy": remedy or None,
        "value": keyed["value"] if keyed else None,
        "line": None,
    }

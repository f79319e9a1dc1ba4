"""Reading a design file: TOML in, a validated ``Design`` out, or one message about all mistakes."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from phexfab.design.mesh_rules import with_methods
from phexfab.design.messages import located, message, problems
from phexfab.design.model import Design, Section
from phexfab.design.rules import Problem, broken_rules
from phexfab.errors import DesignError


def load_design(path: str | os.PathLike[str]) -> Design:
    """Read and validate a design file.

    Parameters
    ----------
    path : path to a TOML file, see ``docs/design-file.md``

    Raises
    ------
    DesignError
        If the file cannot be read or asks for something impossible; the message names the file
        and, for every mistake in it, the key, the value and the remedy.

    Examples
    --------
    >>> import phexfab as px
    >>> px.load_design("canopy.tml")
    Traceback (most recent call last):
        ...
    phexfab.errors.DesignError: canopy.tml: there is no such file; check the path
    """
    source = os.fspath(path)
    try:
        text = Path(path).read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise DesignError(f"{source}: there is no such file; check the path") from None
    except IsADirectoryError:
        raise DesignError(f"{source}: is a folder; name the design file in it") from None
    except OSError as error:
        raise DesignError(
            f"{source}: cannot be read ({error.strerror}); check its permissions"
        ) from error
    except UnicodeDecodeError as error:
        raise DesignError(
            f"{source}: is not text in UTF-8 (byte {error.start}); save it as UTF-8"
        ) from None
    return parse_design(text, source=source)


def parse_design(text: str, source: str = "design") -> Design:
    """Validate the text of a design file.

    Parameters
    ----------
    text : str
        TOML.
    source : str
        What messages call it.

    Raises
    ------
    DesignError
        See ``load_design``; a mistake in the TOML itself is reported with its line.

    Examples
    --------
    >>> import phexfab as px
    >>> text = '''
    ... [surface]
    ... name = "enneper"
    ... scale = "3 m"
    ... [lattice]
    ... panel_size = "50 cm"
    ... '''
    >>> px.parse_design(text).lattice.panel_size  # mm
    500.0
    >>> px.parse_design(text.replace("cm", "kg"), source="canopy.toml")
    Traceback (most recent call last):
        ...
    phexfab.errors.DesignError: canopy.toml: one thing is wrong
      lattice.panel_size = "50 kg" (line 6): "50 kg" is a mass, but a length is needed; write 600
      or "0.6 m"
    """
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _no_toml(source, text, str(error)) from None
    return make_design(data, source=source, text=text)


def make_design(data: Mapping[str, Any], source: str = "design", text: str = "") -> Design:
    """Validate a design given as nested dictionaries, the way ``tomllib`` reads a file.

    Parameters
    ----------
    data : mapping
    source, text : str
        Where it was read from and what stood there, kept for the report.

    Raises
    ------
    DesignError
        See ``load_design``.

    Examples
    --------
    >>> import phexfab as px
    >>> film = {"name": "enneper", "scale": "3 m"}
    >>> design = px.make_design({"surface": film, "lattice": {"panel_size": 500}})
    >>> design.surface.scale, design.offset.type  # mm; a default
    (3000.0, 'edge')
    """
    try:
        return Design.model_validate(dict(data)).read_from(source, text)
    except ValidationError as error:
        found = problems(error, Design)
        # Where whole tables are wrong pydantic never came to the rules: run those it can.
        found += [p for p in _rules_of_good_tables(data) if p not in found]
        wrong = located(_unique(found), data, text)
        raise DesignError(message(source, wrong), wrong) from None


def file_of(design: Design, key: str, path: str) -> Path:
    """Return the file that a key of a design names, seen from the design's folder.

    Raises
    ------
    DesignError
        If there is no such file.
    """
    found = Path(os.path.dirname(design.source)) / path
    if not found.is_file():
        raise DesignError(
            f'{key} = "{path}": there is no such file; paths start at the folder of the design file'
        )
    return found


def _rules_of_good_tables(data: Mapping[str, Any]) -> list[Problem]:
    good: dict[str, Any] = {}
    data = with_methods(data)
    for name, field in Design.model_fields.items():
        kind = field.annotation
        if not (isinstance(kind, type) and issubclass(kind, Section)):
            continue
        try:
            if name in data:
                good[name] = kind.model_validate(data[name])
            elif not field.is_required():
                good[name] = field.get_default(call_default_factory=True)
        except ValidationError:
            continue
    return broken_rules(good)


def _unique(found: list[Problem]) -> list[Problem]:
    """Keep the first problem of each key: a second one is most often its consequence."""
    by_key: dict[str, Problem] = {}
    for problem in found:
        by_key.setdefault(problem.key, problem)
    return list(by_key.values())


def _no_toml(source: str, text: str, detail: str) -> DesignError:
    at = re.search(r"\(at line (\d+), column (\d+)\)", detail)
    lines = text.splitlines()
    number = int(at[1]) if at else len(lines)
    shown = lines[number - 1].strip() if 0 < number <= len(lines) else ""
    reason = re.sub(r"\s*\(at [^)]*\)", "", detail)
    hint = _hint(reason, shown)
    return DesignError(
        f"{source}: line {number} is not TOML: {reason}\n  {shown}\n  {hint}",
        [Problem("", f"not TOML: {reason}", hint, shown, number)],
    )


def _hint(reason: str, shown: str) -> str:
    """Return what to write instead of a line that is not TOML."""
    if "twice" in reason or "overwrite" in reason:
        return "each table and each key stands in the file once: put this together with the other"
    if re.search("[“”„‘’]", shown):
        return "quotes are straight: \" or '"
    if "Expected '='" in reason:
        return "write key = value; keys have no spaces, and a comment begins with #"
    if shown.startswith("[") and not shown.endswith("]"):
        return "write a table as [name], on a line of its own"
    return 'text and numbers with a unit stand in quotes, for example thickness = "8 mm"'

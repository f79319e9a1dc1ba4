"""What is wrong with a design file, in the words of its author: key, value, remedy, line."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from phexfab.design.rules import Problem, RuleBreach
from phexfab.design.units import EXAMPLES
from phexfab.errors import DesignError

_ABSENT = object()
_LIMITS = {
    "greater_than": ("gt", "must be greater than {}"),
    "greater_than_equal": ("ge", "must be at least {}"),
    "less_than": ("lt", "must be less than {}"),
    "less_than_equal": ("le", "must be at most {}"),
}
_TYPES = {
    "string_type": ("text is needed", "put it in quotes"),
    "int_type": ("a whole number is needed", "write it without quotes and without a point"),
    "model_type": ("a table is needed", "write it as [{key}] with its keys below"),
    "date_type": ("a date is needed", "write it as 2026-05-01"),
}
_GENERAL = {f"write {example}" for example in EXAMPLES.values()}


def problems(error: ValidationError, model: type[BaseModel]) -> list[Problem]:
    """Return pydantic's findings as problems: in the order of the model."""
    found: list[Problem] = []
    for detail in error.errors(include_url=False):
        inner = detail.get("ctx", {}).get("error")
        if isinstance(inner, RuleBreach):
            found += inner.problems
        else:
            found.append(_problem(detail, model))
    return found


def _problem(detail: ErrorDetails, model: type[BaseModel]) -> Problem:
    path = [str(step) for step in detail["loc"]]
    key, kind, context = ".".join(path), detail["type"], detail.get("ctx", {})
    owner = _model_at(model, path[:-1])
    field = owner.model_fields.get(path[-1]) if owner else None
    example = (field.examples or [""])[0] if field else ""
    like = f"write for example {path[-1]} = {example}"
    if kind == "missing":
        table = owner is not None and _model_at(model, path) is not None
        remedy = f"add the table [{key}]" if table else f"add for example {path[-1]} = {example}"
        return Problem(key, "is missing", remedy)
    if kind == "extra_forbidden":
        return Problem(key, "unknown key", _suggestion(path, model))
    if kind in _LIMITS:
        name, words = _LIMITS[kind]
        return Problem(key, words.format(f"{context[name]:g}"), like)
    if kind == "literal_error":
        known = [c for c in re.findall(r"'([^']*)'", str(context["expected"]))]
        near = difflib.get_close_matches(str(detail["input"]), known, 1)
        hint = f'did you mean "{near[0]}"? ' if near else ""
        choices = ", ".join(f'"{choice}"' for choice in known)
        return Problem(key, "no such choice", f"{hint}take one of {choices}")
    if isinstance(context.get("error"), DesignError):
        text, _, remedy = str(context["error"]).partition("; ")
        if remedy in _GENERAL and field and field.examples:  # this key's own examples say more
            remedy = "write " + " or ".join(field.examples)
        return Problem(key, text, remedy or like)
    text, remedy = _TYPES.get(kind, (detail["msg"], like))
    return Problem(key, text, remedy.format(key=key))


def _model_at(model: type[BaseModel], path: Iterable[str]) -> type[BaseModel] | None:
    for step in path:
        field = model.model_fields.get(step)
        kind = field.annotation if field else None
        if not (isinstance(kind, type) and issubclass(kind, BaseModel)):
            return None
        model = kind
    return model


def _suggestion(path: list[str], model: type[BaseModel]) -> str:
    """Propose a key of the same table that is spelt alike, or the table that has the key."""
    owner = _model_at(model, path[:-1])
    known = list(owner.model_fields) if owner else []
    near = difflib.get_close_matches(path[-1].lower(), known, 1, 0.7)
    if near:
        return f'did you mean "{near[0]}"?'
    elsewhere = [
        f"[{name}]"
        for name, field in model.model_fields.items()
        if isinstance(field.annotation, type)
        and issubclass(field.annotation, BaseModel)
        and path[-1] in field.annotation.model_fields
    ]
    if elsewhere:
        return f"it belongs to {' or '.join(elsewhere)}"
    where = f"[{'.'.join(path[:-1])}] knows" if path[:-1] else "a design knows"
    return f"{where} {', '.join(known)}"


def located(found: Iterable[Problem], data: Mapping[str, Any], text: str) -> list[Problem]:
    """Return problems in the order of the file, with the value and the line of their key."""
    lines = key_lines(text)
    end = len(text.splitlines()) + 1
    placed = []
    for problem in sorted(found, key=lambda problem: _line(problem.key, lines) or end):
        key, _, item = problem.key.rpartition(".")
        if item.isdigit() and isinstance(inside := lookup(data, key.split(".")), list | tuple):
            if int(item) < len(inside):  # of several values the wrong one is named
                said = f"{toml_value(inside[int(item)])}: {problem.text}"
                problem = replace(problem, text=said)
            problem = replace(problem, key=key)
        value = lookup(data, problem.key.split("."))
        if value is not _ABSENT:
            problem = replace(problem, value=value, line=lines.get(problem.key))
        placed.append(problem)
    return placed


def message(source: str, found: list[Problem]) -> str:
    """Return all problems as one message, with value and remedy."""
    count = "one thing is" if len(found) == 1 else f"{len(found)} things are"
    rows = [f"{source}: {count} wrong"]
    for problem in found:
        shown = "" if problem.value is None else f" = {toml_value(problem.value)}"
        where = f" (line {problem.line})" if problem.line else ""
        rows.append(f"  {problem.key}{shown}{where}: {problem.text}; {problem.remedy}")
    return "\n".join(rows)


def lookup(data: Any, path: list[str]) -> Any:
    """Return what stands at a key path, or a marker that nothing does."""
    for step in path:
        if not isinstance(data, Mapping) or step not in data:
            return _ABSENT
        data = data[step]
    return data


def toml_value(value: object) -> str:
    """Return a value as it is written in TOML, cut where it is long."""
    if isinstance(value, Mapping):
        return "{…}"
    if isinstance(value, list | tuple):
        shown = "[" + ", ".join(toml_value(item) for item in value) + "]"
    elif isinstance(value, bool):
        shown = str(value).lower()
    elif isinstance(value, str):
        shown = f'"{value}"'
    else:
        shown = str(value)
    return shown if len(shown) <= 60 else shown[:57] + "…"


def _line(key: str, lines: Mapping[str, int]) -> int | None:
    """Return the line of a key, or of the table that it is missing from."""
    while key and key not in lines:
        key = key.rpartition(".")[0]
    return lines.get(key)


_HEADER = re.compile(r"\s*\[\s*([\w.\s-]+?)\s*\]\s*(?:#.*)?$")
_KEY = re.compile(r"\s*([\w.-]+)\s*=")


def key_lines(text: str) -> dict[str, int]:
    """Return the line on which each key or table begins, for files written the usual way."""
    found: dict[str, int] = {}
    table = ""
    for number, line in enumerate(text.splitlines(), 1):
        if header := _HEADER.match(line):
            table = header[1].replace(" ", "")
            found.setdefault(table, number)
        elif key := _KEY.match(line):
            found.setdefault(f"{table}.{key[1]}" if table else key[1], number)
    return found

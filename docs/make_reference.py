"""Write the tables of docs/design-file.md, one row a key, from the schema of design files.

    python docs/make_reference.py

Tables stand between ``<!-- keys: panels -->`` and ``<!-- end -->``; what is written around them
stays. A test asks for this to be run when a key has changed.
"""

import re
from pathlib import Path
from typing import Any

from phexfab.schema import bare_schema

PAGE = Path(__file__).parent / "design-file.md"
PLACE = re.compile(r"(<!-- keys: (.*?) -->\n).*?(<!-- end -->)", re.DOTALL)
MOST = 4
WORDS = {"number": "number", "integer": "whole number", "string": "text"}
HEAD = "| key | default | takes | meaning |\n|---|---|---|---|\n"


def table(schema: dict[str, Any], name: str) -> str:
    """Return the Markdown table of a table of the design file; "" is what stands above them."""
    for step in filter(None, name.split(".")):
        schema = schema["properties"][step]
    rows = [
        f"| `{key}` | {default(value, key in schema.get('required', ()))} | {takes(value)} "
        f"| {value['description'].replace('|', chr(92) + '|')} |\n"
        for key, value in schema["properties"].items()
        if value.get("type") != "object"
    ]
    return HEAD + "".join(rows)


def default(value: dict[str, Any], required: bool) -> str:
    """Say what holds where a key is left out."""
    if required:
        return "must be given"
    if "x-default" in value:
        return value["x-default"]
    if "default" not in value:
        return "none"
    found = value["default"]
    if isinstance(found, str):
        return f'`"{found}"`'
    if isinstance(found, list):
        return f"`[{', '.join(f'{item:g}' for item in found)}]`"
    return f"{found:.4g}".replace("e-0", "e-")


def takes(value: dict[str, Any]) -> str:
    """Say what may be written: a unit, the choices, or the kind of value."""
    if "enum" in value:
        choices = value["enum"]
        return " or ".join(f'`"{c}"`' for c in choices) if len(choices) <= MOST else "a name"
    if "const" in value:
        return f'`"{value["const"]}"`'
    if "x-unit" in value:
        return value["x-unit"] + bounds(value["anyOf"][0])
    if "anyOf" in value:
        return ", or ".join(takes(choice) for choice in value["anyOf"])
    kind = value["type"]
    if kind == "array":
        item = value["items"]
        if item.get("type") == "array":
            return "lists of points" if item["items"]["type"] == "array" else "points"
        inner = "name" if "enum" in item else WORDS[item.get("type", "number")]
        return f"{value.get('maxItems', '')} {inner}s".strip()
    return ("date" if value.get("format") == "date" else WORDS[kind]) + bounds(value)


def bounds(value: dict[str, Any]) -> str:
    """Say between what a number lies."""
    signs = {"exclusiveMinimum": ">", "minimum": "≥", "maximum": "≤"}
    return "".join(f", {sign} {value[key]:g}" for key, sign in signs.items() if key in value)


def page(text: str) -> str:
    """Return the page with fresh tables."""
    schema = bare_schema()
    return PLACE.sub(lambda m: m[1] + table(schema, m[2].strip("[]")) + m[3], text)


if __name__ == "__main__":
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")

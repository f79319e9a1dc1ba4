"""The JSON Schema of design files: editors complete and check a design with it.

Made from the design's own model, with the catalog's names and the checks' limits filled in. It
knows keys, kinds of values, units, choices and bounds; rules between keys are the reader's.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator, Mapping
from typing import Any

from pydantic.json_schema import GenerateJsonSchema, JsonSchemaValue
from pydantic_core import core_schema

from phexfab.design import Design
from phexfab.fabrication.limits import Limits
from phexfab.surface.catalog import catalog
from phexfab.surface.periodic.closed_forms import PERIODIC

DIALECT = "http://json-schema.org/draft-07/schema#"
"""What editors for TOML understand; newer drafts they do not."""
IDENTITY = "urn:phexfab:design"
FILE = "phexfab-design.schema.json"
SOURCES = ("name", "g", "rim", "mesh", "periodic", "step")
"""Keys of [surface] of which a design has just one."""


class _Writer(GenerateJsonSchema):
    """Pydantic's schema in the words of a TOML file, which has no null."""

    def nullable_schema(self, schema: core_schema.NullableSchema) -> JsonSchemaValue:
        return self.generate_inner(schema["schema"])

    def none_schema(self, schema: core_schema.NoneSchema) -> JsonSchemaValue:
        return {"not": {}}

    def default_schema(self, schema: core_schema.WithDefaultSchema) -> JsonSchemaValue:
        made = super().default_schema(schema)
        if made.get("default", 0) in (None, []):
            del made["default"]
        return made

    def tuple_schema(self, schema: core_schema.TupleSchema) -> JsonSchemaValue:
        made = super().tuple_schema(schema)
        kinds = made.pop("prefixItems", [])
        if kinds:  # all our tuples are of one kind of number
            made["items"] = kinds[0]
        return made

    def field_title_should_be_set(self, schema: Any) -> bool:
        return False


def design_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 7) of design files as plain dictionaries.

    Every key has its description, default, examples, choices and bounds; quantities are numbers or
    text with a unit of their kind, and ``x-unit`` is the unit of a bare number. ``x-default`` says
    in words what holds where a key is left out. Editors show descriptions only, so those name
    both.

    Examples
    --------
    >>> from phexfab.schema import design_schema
    >>> schema = design_schema()
    >>> schema["properties"]["panels"]["properties"]["thickness"]["description"]
    'of the sheet; mm where no unit is given'
    """
    schema = bare_schema()
    for place in _tables(schema):
        for value in place["properties"].values():
            told = value["description"]
            if "x-unit" in value:
                told += f"; {value['x-unit']} where no unit is given"
            if "x-default" in value:
                told += f"; default: {value['x-default']}"
            value["description"] = told
    return schema


def schema_text() -> str:
    """Return the schema as the text of a JSON file."""
    return json.dumps(design_schema(), indent=1, ensure_ascii=False) + "\n"


def _tables(schema: dict[str, Any]) -> Iterator[dict[str, Any]]:
    """Yield a table's schema and those of the tables in it."""
    yield schema
    for value in schema["properties"].values():
        if value.get("type") == "object":
            yield from _tables(value)


def bare_schema() -> dict[str, Any]:
    """Return the schema with descriptions that say nothing of units and defaults."""
    made = Design.model_json_schema(schema_generator=_Writer)
    definitions = made.pop("$defs")
    schema = _plain(made, definitions)
    surface = schema["properties"]["surface"]
    surface["oneOf"] = [{"required": [key]} for key in SOURCES]
    surface["dependencies"] = {"g": ["height_differential"], "height_differential": ["g"]}
    surface["properties"]["name"]["enum"] = list(catalog)
    surface["properties"]["periodic"]["enum"] = list(PERIODIC)
    for name, value in schema["properties"]["checks"]["properties"].items():
        value["default"] = getattr(Limits(), name)
    return {
        "$schema": DIALECT,
        "$id": IDENTITY,
        **schema,
        "title": "phexfab design file",
        "description": "A shell of planar hexagons: what phexfab builds from.",
    }


def _plain(schema: Mapping[str, Any], definitions: Mapping[str, Any]) -> dict[str, Any]:
    """Return a schema without references, without null, and with its examples as values."""
    found = dict(schema)
    reference = found.pop("$ref", "")
    if reference:
        # What stands beside a reference says more about this place than what it points to.
        found = {**definitions[reference.rpartition("/")[2]], **found}
        found.pop("default", None)
    for key in ("properties", "items"):
        if key in found:
            inner = found[key]
            found[key] = (
                {name: _plain(value, definitions) for name, value in inner.items()}
                if key == "properties"
                else _plain(inner, definitions)
            )
    if "anyOf" in found:
        choices = [_plain(c, definitions) for c in found["anyOf"] if c != {"not": {}}]
        flat = [inner for c in choices for inner in c.get("anyOf", [c])]
        found |= {k: v for c in choices for k, v in c.items() if k.startswith("x-")}
        if len(flat) == 1:
            found.pop("anyOf")
            found |= flat[0]
        else:
            found["anyOf"] = flat
    if "examples" in found:
        found["examples"] = [value for text in found["examples"] for value in _value(text)]
    return found


def _value(text: str) -> list[Any]:
    """Return an example as a value; nothing for one that is cut short with an ellipsis."""
    try:
        value = tomllib.loads(f"x = {text}")["x"]
    except tomllib.TOMLDecodeError:
        return []
    return [value if isinstance(value, str | int | float | list) else value.isoformat()]

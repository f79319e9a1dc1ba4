"""The schema of design files: what is right passes, common mistakes do not, the manual agrees."""

import datetime
import importlib.util
import json
import re
import tomllib
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from phexfab.cli import app
from phexfab.design import Design, parse_design, quantity
from phexfab.design.fields import Section
from phexfab.design.units import UNITS
from phexfab.errors import DesignError
from phexfab.fabrication.limits import Limits
from phexfab.schema import FILE, bare_schema, design_schema

ROOT = Path(__file__).parent.parent
EXAMPLES = sorted((ROOT / "examples").glob("*.toml"))
SCHEMA = design_schema()
VALIDATOR = jsonschema.Draft7Validator(SCHEMA)
MINIMAL = '[surface]\nname = "catenoid"\n[lattice]\npanel_size = 600\n'


def as_json(value):
    """Return what stands in a TOML file the way an editor hands it to a schema: dates as text."""
    if isinstance(value, dict):
        return {key: as_json(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [as_json(inner) for inner in value]
    return value.isoformat() if isinstance(value, datetime.date) else value


def mistakes(text):
    return [
        f"{'.'.join(map(str, error.absolute_path))}: {error.message}"
        for error in VALIDATOR.iter_errors(as_json(tomllib.loads(text)))
    ]


def tables(schema, path=""):
    yield path, schema
    for key, value in schema["properties"].items():
        if value.get("type") == "object":
            yield from tables(value, f"{path}.{key}".strip("."))


def test_it_is_a_schema_of_its_dialect():
    jsonschema.Draft7Validator.check_schema(SCHEMA)
    assert SCHEMA["$schema"] == jsonschema.Draft7Validator.META_SCHEMA["$schema"]
    assert SCHEMA["$id"] and SCHEMA["title"] and "$ref" not in json.dumps(SCHEMA)


def test_the_command_prints_it():
    result = CliRunner().invoke(app, ["schema"])
    assert (result.exit_code, json.loads(result.stdout)) == (0, SCHEMA)


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_examples_pass(path):
    assert mistakes(path.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize(
    "surface",
    [
        'name = "enneper"\norder = 2\nu = [-0.8, 0.8]\nv = "closed"\nbonnet_angle = "0.5 rad"',
        'g = "z**2"\nheight_differential = "z"\nbase = [1, 0]',
        'rim = "rim.csv"\nunit = "m"\nfree = [1, 3]',
        'rim = ["outer.dxf", "inner.dxf"]\nsmooth_corners = "30 cm"',
        "rim = [[0, 0, 0], [6000, 0, 900], [0, 5000, 0]]",
        "rim = [[[0, 0, 0], [6, 0, 9], [0, 5, 0]], [[1, 1, 0], [2, 1, 0], [1, 2, 1]]]",
        'periodic = "gyroid"\ncells = [2, 2, 1]\nscale = "6 m"',
        'mesh = "film.obj"',
    ],
)
def test_every_kind_of_surface_passes(surface):
    text = f"[surface]\n{surface}\n[lattice]\npanel_size = 600\n"
    parse_design(text)
    assert mistakes(text) == []


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ("[lattice]\npanel_size = 600\n", "'surface' is a required property"),
        ('[surface]\nname = "catenoid"\n[lattice]\n', "'panel_size' is a required property"),
        (MINIMAL.replace("600", "-600"), "lattice.panel_size"),
        (MINIMAL.replace("600", '"8 kg"'), "lattice.panel_size"),
        (MINIMAL.replace("600", '"1,5 m"'), "lattice.panel_size"),
        (MINIMAL.replace("600", '"-60 cm"'), "lattice.panel_size"),
        (MINIMAL.replace("600", "true"), "lattice.panel_size"),
        (MINIMAL.replace("catenoid", "catnoid"), "surface.name"),
        (MINIMAL.replace('"catenoid"', '"catenoid"\nrim = "rim.csv"'), "surface"),
        ('[surface]\ng = "z"\n[lattice]\npanel_size = 600\n', "surface"),
        (MINIMAL.replace('"catenoid"', '"catenoid"\nu = [0, 1, 2]'), "surface.u"),
        (MINIMAL.replace('"catenoid"', '"catenoid"\nu = "open"'), "surface.u"),
        (MINIMAL + "[panels]\ngapp = 3\n", "gapp"),
        (MINIMAL + "[panel]\ngap = 3\n", "panel"),
        (MINIMAL + '[panels]\nside = "out"\n', "panels.side"),
        (MINIMAL + "[panels]\nmaterial = 7\n", "panels.material"),
        (MINIMAL + '[nesting]\nseed = "1"\n', "nesting.seed"),
        (MINIMAL + "[nesting]\nseed = 1.5\n", "nesting.seed"),
        (MINIMAL + "[border]\nsliver = 2\n", "border.sliver"),
        (MINIMAL + '[checks]\npanel_mass = "25 mm"\n', "checks.panel_mass"),
        (MINIMAL + '[output]\nfiles = ["glb", "pdf"]\n', "output.files"),
        (MINIMAL + 'title = "late"\n', "lattice"),
    ],
)
def test_common_mistakes_fail_here_as_they_do_in_the_reader(text, where):
    with pytest.raises(DesignError):
        design = parse_design(text)
        if "catnoid" in text:  # names are the catalog's, which the reader does not know
            raise DesignError(design.surface.name)
    (said,) = mistakes(text)
    assert where in said


def keys_of(model, path=""):
    for name, field in model.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, Section):
            yield from keys_of(kind, f"{path}{name}.")
        else:
            yield path + name


def test_it_has_every_key_of_a_design_and_no_other():
    found = {
        f"{path}.{key}".strip(".")
        for path, table in tables(SCHEMA)
        for key, value in table["properties"].items()
        if value.get("type") != "object"
    }
    assert found == set(keys_of(Design))


@pytest.mark.parametrize(("path", "table"), tables(SCHEMA), ids=lambda value: str(value)[:20])
def test_tables_are_closed_and_every_key_is_described(path, table):
    assert table["additionalProperties"] is False and table["description"]
    for key, value in table["properties"].items():
        assert value["description"], f"{path}.{key}"
        if "x-unit" in value:
            assert value["x-unit"] in value["description"]
        for example in value.get("examples", []):
            jsonschema.Draft7Validator(value).validate(example)
        if "default" in value:
            jsonschema.Draft7Validator(value).validate(value["default"])


def test_limits_have_the_defaults_of_the_checks():
    for name, value in SCHEMA["properties"]["checks"]["properties"].items():
        assert value["default"] == getattr(Limits(), name)


KEY_OF_KIND = {
    "length": ("offset", "distance"),
    "angle": ("surface", "bonnet_angle"),
    "mass": ("checks", "panel_mass"),
    "density": ("panels", "density"),
    "time": ("nesting", "seconds"),
}


@given(
    kind=st.sampled_from(sorted(KEY_OF_KIND)),
    number=st.sampled_from(
        ["8", "0.5", ".5", "1_000", "1e3", "-2", "+2", "1,5", "x", "", "2.", "8 8"]
    ),
    space=st.sampled_from(["", " ", "  "]),
    unit=st.sampled_from(["", *(unit for table in UNITS.values() for unit in table), "yd", "MM"]),
)
def test_a_text_passes_where_the_reader_takes_it(kind, number, space, unit):
    table, key = KEY_OF_KIND[kind]
    text = number + space + unit
    try:
        value = quantity(text, kind)
    except DesignError:
        taken = False
    else:
        taken = value > 0 or kind in ("length", "angle")
    schema = SCHEMA["properties"][table]["properties"][key]
    assert jsonschema.Draft7Validator(schema).is_valid(text) == taken


# -- starters and the manual -----------------------------------------------------------------------


@pytest.mark.parametrize("options", [[], ["--surface", "scherk-1"]])
def test_a_starter_names_its_schema_and_passes_it(tmp_path, monkeypatch, options):
    monkeypatch.chdir(tmp_path)
    assert CliRunner().invoke(app, ["new", "roof", *options]).exit_code == 0
    text = (tmp_path / "roof.toml").read_text(encoding="utf-8")
    assert text.startswith(f"#:schema ./{FILE}\n")
    assert json.loads((tmp_path / FILE).read_text(encoding="utf-8")) == SCHEMA
    assert mistakes(text) == []


def test_what_a_starter_leaves_out_can_be_switched_on(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    CliRunner().invoke(app, ["new", "roof"])
    text = (tmp_path / "roof.toml").read_text(encoding="utf-8")
    on, switched = re.subn(r"^# (\w+ = )", r"\1", text, flags=re.MULTILINE)
    assert switched >= 4 and mistakes(on) == []
    assert parse_design(on).output.files == ("glb", "3mf")


def test_the_manual_s_tables_are_those_of_the_schema():
    spec = importlib.util.spec_from_file_location("make_reference", ROOT / "docs/make_reference.py")
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    text = made.PAGE.read_text(encoding="utf-8")
    assert made.page(text) == text, "run python docs/make_reference.py"
    named = [name for _, name, _ in made.PLACE.findall(text)]
    assert named == [f"[{path}]" for path, table in tables(bare_schema()) if holds_keys(table)]


def holds_keys(table):
    return any(value.get("type") != "object" for value in table["properties"].values())

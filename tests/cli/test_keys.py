"""What the program says of the keys of scenarios and summaries is what files hold, and what the documentation shows."""

import re
import tomllib
from pathlib import Path

import pytest
from conftest import DOUBLE, SPHERICAL, settings, summary_validator
from jsonschema import Draft202012Validator, ValidationError

ROOT = Path(__file__).parents[2]
DOCUMENT = (ROOT / "docs/reference/scenario.md").read_text()
EXAMPLES = sorted((ROOT / "examples").glob("*.toml"))


@pytest.fixture
def scenario_schema(pendula) -> dict:
    return pendula("help", "scenario", "--json").json


def tables_of(schema: dict, name: str = "") -> dict[str, dict]:
    """Schemas of all tables, by their dotted names."""
    tables = {name: schema}
    for key, value in schema["properties"].items():
        inner = value.get("items", value)
        if "properties" in inner:
            tables |= tables_of(inner, f"{name}.{key}".lstrip("."))
    return tables


def test_the_documentation_shows_every_table_of_scenarios(scenario_schema):
    """The tables there are made from the schema."""
    shown = re.findall(r"^```\{scenario-keys\} (\S+)$", DOCUMENT, re.MULTILINE)
    assert sorted(shown) == sorted(set(tables_of(scenario_schema)) - {""})


def test_the_schema_tells_type_and_default_of_every_key(scenario_schema):
    for name, table in tables_of(scenario_schema).items():
        for key, of in table["properties"].items():
            assert of["description"] and of["x-type"], f"{name}.{key}"
            required = key in table.get("required", [])
            assert (of["x-default"] == "") == required or name == "start", f"{name}.{key}"
            if "default" in of:
                assert tomllib.loads(f"x = {of['x-default']}")["x"] == of["default"], f"{name}.{key}"


def test_both_schemas_are_schemas(pendula, scenario_schema):
    Draft202012Validator.check_schema(scenario_schema)
    Draft202012Validator.check_schema(summary_validator().schema)


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_the_examples_are_scenarios(scenario_schema, file):
    Draft202012Validator(scenario_schema).validate(tomllib.loads(file.read_text()))


@pytest.mark.parametrize(
    ("there", "instead"),
    [
        ("masses  = [1.0, 1.0]", "mases = [1.0, 1.0]"),
        ("[1.0, 1.0]", "[1.0, 0.0]"),
        ("planar", "plane"),
        ("step     = 5e-3", "stages = 9"),
        ("step     = 5e-3", 'step = ["5 ms"]'),
        ("[chain]", "[system]"),
        ("[start]", "[begin]"),
    ],
)
def test_wrong_scenarios_are_none(scenario_schema, there, instead):
    assert there in DOUBLE
    validator = Draft202012Validator(scenario_schema)
    validator.validate(tomllib.loads(DOUBLE))
    with pytest.raises(ValidationError):
        validator.validate(tomllib.loads(DOUBLE.replace(there, instead)))


@pytest.mark.parametrize(
    "changed", [{"steps": "many"}, {"energy": 1.0}, {"final": {"t": 0}}, {"method": "euler"}]
)
def test_wrong_summaries_are_none(pendula, double, changed):
    summary = pendula("simulate", double, "--json").json
    with pytest.raises(ValidationError):
        summary_validator().validate(summary | changed)
    with pytest.raises(ValidationError):
        summary_validator().validate({key: value for key, value in summary.items() if key != "space"})


@pytest.mark.parametrize("text", [DOUBLE, SPHERICAL])
@pytest.mark.parametrize(
    "change", ["run.method=dopri5", "run.step=", "chain.units=natural", "run.duration=0"]
)
def test_summaries_are_what_their_schema_says(pendula, tmp_path, text, change):
    (tmp_path / "run.toml").write_text(text + '[[event]]\nname = "low"\nwhen = "theta_dot_1"\n')
    summary = pendula("simulate", "run.toml", "--json", *settings(change)).json
    assert list(summary) == [key for key in summary_validator().schema["properties"] if key in summary]

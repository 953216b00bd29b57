"""What the program says of the keys of scenarios and summaries is what the documentation says, and what files hold."""

import re
import tomllib
from pathlib import Path

import pytest
from conftest import DOUBLE, SPHERICAL, settings, summary_validator
from jsonschema import Draft202012Validator, ValidationError

ROOT = Path(__file__).parents[2]
DOCUMENT = (ROOT / "docs/scenario.md").read_text()
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


def documented() -> dict[str, dict[str, str]]:
    """Of each table in docs/scenario.md, keys and their rows: by the heading of the rows or of the section."""
    tables: dict[str, dict[str, str]] = {}
    section = table = ""
    for line in DOCUMENT.splitlines():
        if heading := re.match(r"##+ (?:`\[+([\w.]+)\]+`)?", line):
            section = heading[1] or line.lstrip("# ")
        if header := re.match(r"\| key(?: of `\[+([\w.]+)\]+`)? \|", line):
            table = header[1] or section
        elif re.match(r"\| \w", line):
            table = "of other things"
        elif line.startswith("| `"):
            first = line.split("|")[1]
            tables.setdefault(table, {}).update(dict.fromkeys(re.findall(r"`([\w.]+)`", first), line))
    return tables


def test_the_documentation_has_every_key_of_scenarios(scenario_schema):
    tables = tables_of(scenario_schema)
    del tables[""]
    found = documented()
    for name, table in tables.items():
        keys = {key for key in table["properties"] if f"{name}.{key}" not in tables}
        assert set(found[name]) == keys, name


def test_the_documentation_has_the_defaults(scenario_schema):
    found = documented()
    checked = 0
    for name, table in tables_of(scenario_schema).items():
        for key, value in table["properties"].items():
            if "default" not in value:
                continue
            [otherwise] = re.findall(r"\| `([^`|]*)` \|$", found[name][key])
            assert tomllib.loads(f"x = {otherwise}")["x"] == value["default"], f"{name}.{key}"
            checked += 1
    assert checked == 23


def test_the_documentation_says_what_must_be_given(scenario_schema):
    found = documented()
    told = {
        row: "must be given" in row
        for name, table in tables_of(scenario_schema).items()
        for key, row in found.get(name, {}).items()
        if key in table.get("required", []) and row.count("|") > 3  # with a column for it
    }
    assert len(told) == 14 and all(told.values()), told


def test_the_documentation_has_every_key_of_summaries():
    assert set(documented()["The summary"]) == set(summary_validator().schema["properties"])


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
        ("step     = 5e-3", 'step = "5 ms"'),
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

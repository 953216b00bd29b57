"""`pendula models` and `pendula describe`: what a model has, without compiling it."""

import json
import tomllib

import pytest
from conftest import EXAMPLES, ROOT

BUILT_IN = sorted(path.stem for path in (ROOT / "codegen/pendula_codegen/models").glob("[a-z]*.py"))
ARM = '''"""An arm.

More of it.
"""


def define(model, links):
    turn = model.coordinate("turn", "rad")  # about the axis
    mass = model.parameter("mass", "kg")
    model.lagrangian = mass * model.rate(turn) ** 2 / 2
    model.force(turn, model.input("torque", "N m"))
'''


def test_models_lists_all_of_them(pendula, tmp_path):
    ended = pendula("models", cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    head, *rows = ended.stdout.splitlines()
    assert head == "model            coordinates"
    assert [row.split()[0] for row in rows] == BUILT_IN
    assert (
        "furuta           alpha, theta                    A Furuta pendulum: a rod that swings at the end of"
        in ended.stdout
    )
    models = json.loads(pendula("models", "--json", cwd=tmp_path).stdout)
    assert [model["model"] for model in models] == BUILT_IN
    assert all(model["about"].endswith(".") for model in models)


def test_describe_tells_what_a_scenario_may_set(pendula, tmp_path):
    ended = pendula("describe", "cart_chain", "--links", "2", cwd=tmp_path)
    assert (ended.returncode, ended.stderr) == (0, "")
    lines = ended.stdout.splitlines()
    assert lines[0] == "cart_chain: A planar chain on a cart: the cart runs along x, a force pushes it."
    for line in [
        "theta_2     rad   theta_dot_2  p_theta_2  from hanging down",
        "masses         kg     1        > 0, one a link",
        "gravity        m/s^2  9.81",
        "push   N",
        "bob_2  bob_2_x, bob_2_y",
        "links 2; --links N tells it of N",
    ]:
        assert line in lines
    assert not (tmp_path / "pendula").exists()


def test_examples_set_nothing_else(pendula):
    """Each parameter, input and coordinate of an example is one that `models` tells."""
    models = {model["model"]: model for model in json.loads(pendula("models", "--json").stdout)}
    scenarios = [tomllib.loads(file.read_text()) for file in EXAMPLES.glob("*.toml")]
    scenarios = [scenario for scenario in scenarios if "system" in scenario]
    scenarios = [scenario for scenario in scenarios if not scenario["system"]["model"].endswith(".py")]
    assert {scenario["system"]["model"] for scenario in scenarios} == set(models)
    for scenario in scenarios:
        told = models[scenario["system"]["model"]]
        names = {kind: {each["name"] for each in told[kind]} for kind in ("parameters", "inputs")}
        assert set(scenario["system"].get("parameters", {})) <= names["parameters"]
        assert {drive["input"] for drive in scenario["system"].get("drive", [])} <= names["inputs"]
        keys = {each[key] for each in told["coordinates"] for key in ("name", "rate", "momentum")}
        families = {key.removesuffix("_1") for key in keys}
        assert set(scenario["start"]) <= keys | families | {"assemble"}


def test_a_file_of_ones_own(pendula, tmp_path):
    (tmp_path / "arm.py").write_text(ARM)
    told = json.loads(pendula("describe", "arm.py", "--json", cwd=tmp_path).stdout)
    assert (told["model"], told["about"], told["has_links"]) == ("arm", "An arm.", False)
    [turn] = told["coordinates"]
    assert turn == {
        "name": "turn",
        "unit": "rad",
        "rate": "turn_dot",
        "momentum": "p_turn",
        "remark": "about the axis",
    }
    assert told["parameters"][0]["default"] is None
    assert "mass       kg    must be given" in pendula("describe", "arm.py", cwd=tmp_path).stdout
    about, _, definition = ARM.partition("def define")
    said = "def define" + definition.replace("links):", f"links):\n    {about.strip()}", 1)
    (tmp_path / "said.py").write_text(said)
    assert pendula("describe", "said.py", cwd=tmp_path).stdout.startswith("said: An arm.\n")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["furrata"], "describe: expected a model file ending in .py, or a built-in model: "),
        (["furrata"], "; got furrata (did you mean furuta?)"),
        (
            ["none.py"],
            "describe: expected a model file that can be read, got none.py: No such file or directory",
        ),
        (["wrong.py"], "wrong.py:2: lagrangian: "),
        (["cart_chain", "--links", "100"], "links: expected 1 to 64, got 100"),
    ],
)
def test_what_is_wrong_is_told(pendula, tmp_path, arguments, expected):
    (tmp_path / "wrong.py").write_text('def define(model, links):\n    model.lagrangian = "x"\n')
    ended = pendula("describe", *arguments, cwd=tmp_path)
    assert (ended.returncode, ended.stdout) == (2, "")
    assert expected in ended.stderr


def test_a_linkage(pendula):
    lines = pendula("describe", "four_bar").stdout.splitlines()
    for line in [
        "constraint  unit  of",
        "loop_x      m     positions",
        "degrees of freedom: 1, if no constraint follows from others",
    ]:
        assert line in lines

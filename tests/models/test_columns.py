"""Columns of models: inputs and rates in files and expressions, also as they were called before."""

import csv
import json
from math import sin

import h5py
import numpy as np
import pytest
from conftest import EXAMPLES, ROOT

SCENARIO = """\
[system]
model = "cart_chain"
links = 2

[[system.drive]]
input = "push"
constant = 0.25
amplitude = 2.0
frequency = 3.0
phase = 0.5

[[system.drive]]
input = "push"
amplitude = 1.0
frequency = 7.0

[start]
theta = [1.0, 0.5]
theta_dot_2 = 0.3

[run]
duration = 2.0
tolerance = 1e-9

[output]
interval = 0.1

[[event]]
name = "turned"
when = "push"

[[event]]
name = "back"
when = "theta_1_dot - theta_dot_2"
"""


def push(t: float) -> float:
    return 0.25 + 2 * sin(3 * t + 0.5) + sin(7 * t)


@pytest.fixture
def driven(tmp_path):
    (tmp_path / "driven.toml").write_text(SCENARIO)
    return tmp_path


def read(file):
    with file.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_inputs_are_columns_and_stand_in_expressions(driven, pendula):
    files = ["-o", "run.csv", "--events", "events.csv"]
    ended = pendula("simulate", "driven.toml", "--json", *files, cwd=driven)
    assert ended.returncode == 0, ended.stderr
    rows, events = read(driven / "run.csv"), read(driven / "events.csv")
    assert list(rows[0]) == [
        *["t", "x", "theta_1", "theta_2", "x_dot", "theta_dot_1", "theta_dot_2", "push"],
        *["cart_x", "cart_y", "bob_1_x", "bob_1_y", "bob_2_x", "bob_2_y", "energy"],
    ]
    assert float(rows[0]["theta_dot_2"]) == 0.3
    for row in rows:
        assert float(row["push"]) == pytest.approx(push(float(row["t"])), abs=1e-14)  # measured 4e-16
    turned = [float(event["t"]) for event in events if event["name"] == "turned"]
    signs = np.sign([push(t) for t in np.linspace(0, 2, 20001)])
    assert len(turned) == np.count_nonzero(np.diff(signs)) > 1
    assert max(abs(push(t)) for t in turned) < 1e-13  # measured 9e-16
    back = [event for event in events if event["name"] == "back"]
    assert back and all(
        float(event["theta_dot_1"]) == pytest.approx(float(event["theta_dot_2"]), abs=1e-9)  # measured 2e-13
        for event in back
    )
    q = json.loads(ended.stdout)["final"]["q"]
    assert q == {name: float(rows[-1][name]) for name in ("x", "theta_1", "theta_2")}


def test_rates_may_have_the_names_that_they_had(driven, pendula):
    text = SCENARIO.replace("theta_dot_2 = 0.3", "theta_2_dot = 0.3")
    (driven / "old.toml").write_text(text)
    now, old = (
        pendula("simulate", f"{name}.toml", "-o", "-", "--quiet", cwd=driven) for name in ("driven", "old")
    )
    assert (old.returncode, old.stdout) == (0, now.stdout)
    (driven / "both.toml").write_text(text.replace("theta_2_dot", "theta_dot_2 = 0.3\ntheta_2_dot"))
    both = pendula("simulate", "both.toml", cwd=driven)
    assert both.returncode == 2
    assert "start.theta_2_dot: expected nothing beside start.theta_dot_2, which is the same" in both.stderr


def test_run_files_of_old_go_on_with_what_they_have(driven, pendula):
    """Rates had other names, and inputs were no columns."""

    def simulate(*arguments):
        ended = pendula("simulate", *arguments, "--quiet", cwd=driven)
        assert ended.returncode == 0, ended.stderr

    simulate("driven.toml", "-o", "whole.h5")
    simulate("driven.toml", "-o", "part.h5", "--set", "run.duration=0.77")
    with h5py.File(driven / "part.h5", "a") as run:
        del run["push"]
        for link in (1, 2):
            run.move(f"theta_dot_{link}", f"theta_{link}_dot")
    simulate("--resume", "part.h5", "--set", "run.duration=2")
    with h5py.File(driven / "whole.h5") as whole, h5py.File(driven / "part.h5") as part:
        assert "push" not in part
        for link in (1, 2):
            assert np.array_equal(whole[f"theta_dot_{link}"], part[f"theta_{link}_dot"])
        for name in ("t", "x", "x_dot", "theta_2", "bob_2_y", "energy"):
            assert np.array_equal(whole[name], part[name])


def test_angles_of_models_look_like_degrees_too(pendula, tmp_path):
    ended = pendula("simulate", EXAMPLES / "cart_chain.toml", "--set", "start.theta=[10, 5]", cwd=tmp_path)
    assert 'start.theta[1]: 10 rad is more than a turn; did you mean "10 deg"?' in ended.stderr
    ended = pendula("simulate", EXAMPLES / "furuta.toml", "--set", "start.theta=90°", "--json", cwd=tmp_path)
    assert json.loads(ended.stdout)["warnings"] == []


def test_a_run_goes_on_from_any_folder(pendula, tmp_path):
    """A run file names its model as the scenario does, and not by the folders that it lay in."""
    (tmp_path / "here").mkdir()
    model = (ROOT / "codegen/pendula_codegen/models/cart_chain.py").read_text()
    (tmp_path / "here" / "cart_chain.py").write_text(model)
    (tmp_path / "here" / "cart.toml").write_text(SCENARIO.replace('"cart_chain"', '"cart_chain.py"'))
    cut = ["--set", "run.duration=1"]
    ended = pendula("simulate", tmp_path / "here" / "cart.toml", *cut, "-o", "run.h5", cwd=tmp_path / "here")
    assert ended.returncode == 0, ended.stderr
    assert str(tmp_path).encode() not in (tmp_path / "here" / "run.h5").read_bytes()
    ended = pendula("simulate", "--resume", "here/run.h5", "--set", "run.duration=2", cwd=tmp_path)
    assert ended.returncode == 0, ended.stderr

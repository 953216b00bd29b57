"""Exported chains with drives and a controller that samples, against the program."""

from functools import cache
from pathlib import Path

import pytest
from conftest import consumer, numbers
from test_c import distance, same, settings, told

SAMPLE, DURATION = 0.05, 2.0

PLANAR = """
[chain]
space = "planar"
masses = [1.0, 0.5]
lengths = [0.8, 0.6]
damping = [0.05, 0.02]
torque = [0.1, -0.2]

[[chain.feedback]]
input = "torque_1"
value = "-3*sin(theta_1)*t - 2*theta_dot_1 + x_2/(2 + y_1)"
sample = 0.05
limit = 1.5

[[chain.feedback]]
input = "torque_2"
value = "-0.8*(theta_2 - theta_1) - 0.3*theta_dot_2^3 + 0.2*y_2"
sample = 0.05

[start]
theta = [1.0, -0.5]
theta_dot = [0.5, 1.0]

[run]
duration = 2.0
"""

SPACE = """
[chain]
space = "spatial"
masses = [1.0, 0.5]
lengths = [0.8, 0.6]
damping = [0.05, 0.02]
torque = [[0.1, 0.0, -0.2], [0.0, 0.1, 0.05]]

[[chain.drive]]
link = 2
amplitude = [0.4, -0.3, 0.6]
frequency = 3.0
phase = 0.4

[[chain.drive]]
link = 2
amplitude = [0.0, 0.2, 0.0]
frequency = 7.5

[[chain.feedback]]
input = "torque_z_1"
value = "-1.5*(phi_dot_1 - 2.5) - 0.5*sin(theta_1)^2*phi_dot_2"
sample = 0.05
limit = 0.9

[[chain.feedback]]
input = "torque_y_2"
value = "0.7*x_2 - 0.2*z_1*theta_dot_2 + 0.1*cos(3*t)"
sample = 0.05

[start]
theta = [1.0, 1.2]
phi = [0.3, -0.2]
phi_dot = [3.5, 4.0]

[run]
duration = 2.0
"""

SCENARIOS = {"planar": PLANAR, "space": SPACE}
OPEN = ("chain.feedback=",)


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    """scenario(name) -> its file."""

    @cache
    def made(name: str) -> Path:
        file = tmp_path_factory.mktemp(name) / "scenario.toml"
        file.write_text(SCENARIOS[name])
        return file

    return made


@pytest.fixture(scope="module")
def chain(export, scenario, tmp_path_factory):
    """chain(name, stages, held, *overrides) -> the consumer of a scenario, whose controller acts before every step
    number `held`; of 0 never."""

    @cache
    def made(name: str, stages: int, held: int, *overrides: str) -> Path:
        folder = tmp_path_factory.mktemp(name)
        export(folder, scenario(name), "--stages", stages, *settings(*overrides))
        return consumer(folder, "double", *([f"-DCONTROLLED={held}"] if held else []))

    return made


def final(summary: dict) -> list[float]:
    return [*summary["final"]["q"].values(), *summary["final"]["v"].values()]


@pytest.mark.parametrize("held", [5, 10])
@pytest.mark.parametrize("name", SCENARIOS)
def test_a_loop_is_the_programs(name, held, pendula, scenario, chain):
    """In the same steps, several from one sample to the next."""
    steps = round(DURATION / SAMPLE) * held
    run = same(2, DURATION / steps)
    theirs = told(pendula("simulate", scenario(name), "--json", *run, *settings("run.estimate=false")))
    assert (theirs["steps"], theirs["rejected_steps"]) == (steps, 0)
    ours = numbers(chain(name, 2, held), steps, DURATION / steps)
    assert distance(ours["state"], final(theirs)) < 1e-12  # measured 8.2e-15; without the limit 0.13


@pytest.mark.parametrize("name", SCENARIOS)
def test_a_loop_ends_where_rods_do(name, pendula, scenario, chain):
    """The program's own choice of steps, of rods in place of angles."""
    theirs = told(pendula("simulate", scenario(name), "--json", *settings("run.accuracy=1e-12")))
    held = 20
    steps = round(DURATION / SAMPLE) * held
    ours = numbers(chain(name, 4, held), steps, DURATION / steps)
    assert (
        distance(ours["state"], final(theirs)) < 1e-11
    )  # measured 1.2e-14; with laws of the wrong sign 0.26


def test_a_drive_alone_is_the_programs(pendula, scenario, chain):
    steps = 400
    run = settings("run.accuracy=1e-12", *OPEN)
    theirs = told(pendula("simulate", scenario("space"), "--json", *run))
    ours = numbers(chain("space", 4, 0, *OPEN), steps, DURATION / steps)
    assert distance(ours["state"], final(theirs)) < 1e-11  # measured 4.5e-14
    without = numbers(chain("space", 4, 0, *OPEN, "chain.drive="), steps, DURATION / steps)
    assert distance(without["state"], final(theirs)) > 0.1  # measured 0.15


def test_derivatives_of_a_driven_step_by_time_are_those_of_the_step(chain):
    """Against differences of the step itself, of fourth order."""
    program, h = chain("space", 3, 0, *OPEN), 0.02
    ours = numbers(program, 1, h)
    for what, column, size in [("t", 0, 1e-3), ("h", 1, h / 50)]:
        slope = [0.0] * len(ours["state"])
        for away, weight in ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12)):
            moved = numbers(program, 1, h, what, 0, away * size)["state"]
            slope = [x + weight / size * y for x, y in zip(slope, moved, strict=True)]
        found = ours["by_times"][column::2]
        assert distance(found, slope) < 1e-9  # measured 2.5e-11
        assert max(map(abs, slope)) > 0.1  # measured 0.31


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        (
            "chain.feedback[1].value=abs(theta_1)",
            "chain.feedback[1].value: expected smooth functions in exported feedback",
        ),
        ("chain.feedback[1].value=theta_1 > 0 ? 1 : 2", "expected smooth functions in exported feedback"),
        ("chain.feedback[2].value=-energy", "chain.feedback[2].value: expected an expression in t, theta_1"),
        ("chain.feedback[2].value=torque_1", 'got the unknown name "torque_1"'),
        ("chain.feedback[1].input=push", "chain.feedback[1].input: expected an input: torque_1, torque_2"),
        ("chain.feedback[2].sample=0.1", "expected one sample time of all feedback, 0.05, got 0.1"),
    ],
)
def test_feedback_that_cannot_be_exported_is_refused(setting, words, pendula, scenario, tmp_path):
    key, _, value = setting.partition("=")
    quoted = value if key.endswith("sample") else f'"{value}"'
    asked = ("--as", "c", "-o", tmp_path / "out", "--set", f"{key}={quoted}")
    ended = pendula("export", scenario("planar"), *asked)
    assert ended.returncode == 2
    assert words in ended.stderr, ended.stderr
    assert not (tmp_path / "out").exists()


def test_an_fmu_has_no_feedback_of_chains(pendula, scenario, tmp_path):
    ended = pendula("export", scenario("planar"), "--as", "fmu", "-o", tmp_path)
    assert ended.returncode == 2
    assert "take it out (--set system.feedback=, or chain.feedback=)" in ended.stderr

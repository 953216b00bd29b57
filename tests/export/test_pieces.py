"""Exported models with functions of several pieces: steps of C that end where these meet, against the program's."""

import json
import subprocess
from pathlib import Path

import pytest
from conftest import BUMPER, consumer

# A mass on a spring: with a force that begins at a time, drag by the square of the speed, a limit that holds an input,
# a piece within a piece, and walls that it comes to twice within long steps.
FORCES = {
    "timed": "Piecewise((3, model.time > 0.707), (-0.5, model.time > 0.333), (0, True))",
    "drag": "-0.5 * v * Abs(v)",
    "limited": "Min(Max(-4 * x - v, -push), push)",
    "nested": "-50 * Max(0, Abs(x) - 0.5) * sign(x)",
    "glances": "-40 * Max(0, x - 0.299)",
    "held_back": "-0.1 * sign(x - 0.5) * sign(v)",
}
MASS = """
from sympy import Abs, Heaviside, Max, Min, Piecewise, sign


def define(model, links):
    x = model.coordinate("x", "m")
    v, push = model.rate(x), model.input("push", "N")
    model.lagrangian = v**2 / 2 - 9 * x**2 / 2
    model.force(x, {force})
    model.point("mass", (x, 0))
"""
ROPE = """
from sympy import Max, sqrt


def define(model, links):
    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")
    pull = Max(0, sqrt(x**2 + y**2) - 1)
    model.lagrangian = (model.rate(x) ** 2 + model.rate(y) ** 2) / 2 - 9.81 * y - 500 * pull**2 / 2
    model.point("mass", (x, y))
"""
SCENARIO = """
[system]
model = "model.py"
drive = [{{ input = "push", constant = {push} }}]
[start]
{start}
[run]
duration = {duration}
tolerance = 1e-13
"""
STARTS = {
    "glances": "x_dot = 0.9",  # 0.3 m: one millimetre beyond the wall
    "held_back": "x = 0.5",  # where the switching function is zero, and so is its rate
}
STUCK = 3


def write(place: Path, model: str, push: float, start: str, duration: float) -> Path:
    (place / "model.py").write_text(model)
    scenario = place / "model.toml"
    scenario.write_text(SCENARIO.format(push=push, start=start, duration=duration))
    return scenario


def theirs(pendula, scenario: Path) -> tuple[dict, list[float]]:
    """What the program says of a run, and the state where it ends."""
    told = json.loads(pendula("simulate", scenario, "--json").stdout)
    return told, [*told["final"]["q"].values(), *told["final"]["v"].values()]


def ours(program: Path, h: float, duration: float) -> dict[str, list[float]]:
    ended = subprocess.run([program, repr(h), repr(duration)], capture_output=True, text=True, check=True)
    return {name: [*map(float, values)] for name, *values in map(str.split, ended.stdout.splitlines())}


def distance(found: list[float], wanted: list[float]) -> float:
    return max(abs(x - y) for x, y in zip(found, wanted, strict=True))


def test_a_cart_that_rubs_and_runs_against_a_bumper(pendula, export, tmp_path):
    scenario = write(tmp_path, BUMPER, 1.5, "x_dot = 1.0\ntheta = 0.4", 2.0)
    program = consumer(export(tmp_path, scenario, "--stages", 4), main="pieces.c")
    found = ours(program, 0.01, 2.0)
    told, wanted = theirs(pendula, scenario)
    assert told["outcome"]["status"] == "ok" and found["status"] == [0.0]
    assert distance(found["state"], wanted) < 1e-11  # measured 1.9e-13
    assert len(found["changes"]) == 6


@pytest.mark.parametrize("stages", [2, 4])
def test_steps_have_their_order_where_pieces_meet(stages, pendula, export, tmp_path):
    scenario = write(tmp_path, BUMPER, 1.5, "x_dot = 1.0\ntheta = 0.4", 2.0)
    program = consumer(export(tmp_path, scenario, "--stages", stages), main="pieces.c")
    _, wanted = theirs(pendula, scenario)
    coarse, fine = (distance(ours(program, h, 2.0)["state"], wanted) for h in (0.04, 0.02))
    assert coarse / fine > 0.6 * 4**stages  # measured 15.4 and 211


def test_friction_holds_it_where_the_program_says(pendula, export, tmp_path):
    scenario = write(tmp_path, BUMPER, 0.1, "x_dot = 1.0\ntheta = 0.4", 20.0)
    found = ours(consumer(export(tmp_path, scenario, "--stages", 4), main="pieces.c"), 0.01, 20.0)
    told, wanted = theirs(pendula, scenario)
    assert told["outcome"]["status"] == "stuck_at_switch" and found["status"] == [STUCK]
    assert abs(found["t"][0] - told["outcome"]["t"]) < 1e-11  # measured 5.7e-14
    assert distance(found["state"], wanted) < 1e-11  # measured 8.7e-13
    at_rest = write(tmp_path, BUMPER, 0.1, "x_dot = 0.0\ntheta = 0.0", 20.0)
    held = ours(consumer(export(tmp_path, at_rest), main="pieces.c"), 0.01, 20.0)
    assert held["status"] == [STUCK] and held["t"] == [0.0]


@pytest.mark.parametrize(
    ("force", "start", "time"),
    [
        ("9 * x - sign(x)", "x = 0.0", 0.0),
        ("9 * x + Heaviside(model.time - 0.5) * (1 - 2 * Heaviside(x))", "x = 0.0", 0.5),
    ],
    ids=["from the start", "from a time"],
)
def test_a_force_may_hold_it_where_it_rests(force, start, time, pendula, export, tmp_path):
    """Where the rate of the switching function is zero, too: its acceleration tells."""
    scenario = write(tmp_path, MASS.format(force=force), 1.2, start, 3.0)
    found = ours(consumer(export(tmp_path, scenario), main="pieces.c"), 0.01, 3.0)
    told, _ = theirs(pendula, scenario)
    assert told["outcome"]["status"] == "stuck_at_switch" and found["status"] == [STUCK]
    assert found["t"] == pytest.approx([time], abs=1e-9)  # measured 1.1e-16


def test_a_step_watches_what_it_begins_beyond_the_zero_of(pendula, export, tmp_path):
    """By rounding; the mass comes back over the zero within the step."""
    force = "9 * x + Piecewise((-20, x > 0.3), (140, True))"
    ends = []
    for start in (0.3, 0.3 + 5.6e-17, 0.3 - 5.6e-17):
        scenario = write(tmp_path, MASS.format(force=force), 1.2, f"x = {start!r}\nx_dot = -1.0", 0.1)
        program = consumer(export(tmp_path, scenario), main="pieces.c")
        ends.append(ours(program, 0.02, 0.1)["state"][0])
        _, wanted = theirs(pendula, scenario)
        assert abs(ends[-1] - wanted[0]) < 1e-12  # measured 1.7e-16


def test_a_slack_rope_has_no_direction(pendula, export, tmp_path):
    """Its length has no derivative at its anchor, where it does not pull."""
    (tmp_path / "model.py").write_text(ROPE)
    scenario = tmp_path / "model.toml"
    scenario.write_text(
        '[system]\nmodel = "model.py"\n[start]\nx_dot = 1.0\n[run]\nduration = 3.0\ntolerance = 1e-13\n'
    )
    found = ours(consumer(export(tmp_path, scenario, "--stages", 4), main="pieces.c"), 0.01, 3.0)
    told, wanted = theirs(pendula, scenario)
    assert told["outcome"]["status"] == "ok" and not told["warnings"]
    assert distance(found["state"], wanted) < 1e-10  # measured 2.2e-12


@pytest.mark.parametrize("name", FORCES)
def test_pieces_of_every_kind(name, pendula, export, tmp_path):
    start = STARTS.get(name, "x = 0.6\nx_dot = 0.5")
    scenario = write(tmp_path, MASS.format(force=FORCES[name]), 1.2, start, 3.0)
    found = ours(consumer(export(tmp_path, scenario, "--stages", 4), main="pieces.c"), 0.01, 3.0)
    told, wanted = theirs(pendula, scenario)
    assert told["outcome"]["status"] == "ok" and found["status"] == [0.0]
    assert len(found["changes"]) > 1
    assert distance(found["state"], wanted) < 1e-12  # measured 1.5e-13


def test_float_ends_its_steps_there_too(pendula, export, tmp_path):
    scenario = write(tmp_path, BUMPER, 1.5, "x_dot = 1.0\ntheta = 0.4", 1.0)
    program = consumer(export(tmp_path, scenario, "--stages", 2, "--float"), "float", main="pieces.c")
    found = ours(program, 0.01, 1.0)
    _, wanted = theirs(pendula, scenario)
    assert found["status"] == [0.0] and len(found["changes"]) == 4
    assert distance(found["state"], wanted) < 1e-4  # measured 2.6e-6

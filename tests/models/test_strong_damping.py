"""Motions that begin off the slow motion of a strong damping: every row is right, from the first microsecond on."""

import json
import math

import pytest

SPRING = """
def define(model, links):
    x = model.coordinate("x", "m")
    c = model.parameter("c", "kg/s", default=1e6)
    model.lagrangian = model.rate(x) ** 2 / 2 - x**2 / 2
    model.dissipation = c * model.rate(x) ** 2 / 2
"""
BESIDE = """
def define(model, links):
    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")
    model.lagrangian = (model.rate(x) ** 2 + model.rate(y) ** 2) / 2 - (x**2 + 10 * y**2 + 0.2 * x * y) / 2
    model.dissipation = 1e4 * model.rate(x) ** 2 / 2
"""
LATE = """
from sympy import Heaviside

def define(model, links):
    x = model.coordinate("x", "m")
    model.lagrangian = model.rate(x) ** 2 / 2 - 9.81 * x
    model.force(x, -1e6 * model.rate(x) * Heaviside(-x))
"""
FED = """
def define(model, links):
    x = model.coordinate("x", "m")
    push = model.input("push", "N")
    model.lagrangian = model.rate(x) ** 2 / 2 - x**2 / 2
    model.force(x, push)
"""
TIMES = [1e-7, 1e-6, 3e-6, 1e-5, 1e-4, 1e-3, 0.01, 0.2, 1.0, 5.0]


@pytest.fixture
def move(pendula, tmp_path):
    """move(model, tables, settings) -> the summary and the rows, each by the names of columns."""

    def run(
        model: str, tables: str, *settings: str, output: str = f"times = {TIMES}"
    ) -> tuple[dict, list[dict[str, float]]]:
        (tmp_path / "own.py").write_text(model)
        scenario, rows = tmp_path / "own.toml", tmp_path / "rows.csv"
        scenario.write_text(f'[system]\nmodel = "own.py"\n{tables}\n[output]\n{output}\n')
        keys = [f"--set={setting}" for setting in settings]
        ended = pendula("simulate", scenario, "--json", "-o", rows, *keys)
        assert ended.returncode == 0, ended.stderr
        header, *lines = rows.read_text().splitlines()
        names = header.split(",")
        found = [dict(zip(names, map(float, line.split(",")), strict=True)) for line in lines]
        return json.loads(ended.stdout), found

    return run


def damped(c: float, t: float, rate: float = 0.5) -> tuple[float, float]:
    """x'' = -x - c x' from x = 1, x' = rate."""
    fast = -c / 2 - math.sqrt(c * c / 4 - 1)
    slow = 1 / fast
    b = (rate - slow) / (fast - slow)
    a = 1 - b
    return (
        a * math.exp(slow * t) + b * math.exp(fast * t),
        a * slow * math.exp(slow * t) + b * fast * math.exp(fast * t),
    )


def off(c: float, rows: list[dict[str, float]]) -> float:
    """The largest error of a row, relative to the size of the motion."""
    errors = []
    for row in rows:
        x, v = damped(c, row["t"])
        errors += [abs(row["x"] - x), 2 * abs(row["x_dot"] - v), abs(row["energy"] - (x * x + v * v) / 2)]
    return max(errors)


# Measured, the largest of all: 1.6e-12, 5e-7, 9.6e-10, 1.1e-6, 2e-9
@pytest.mark.parametrize("c", [1e2, 1e4, 1e6])
@pytest.mark.parametrize(
    ("settings", "bound"),
    [
        ([], 2e-9),
        (["run.accuracy=1e-6"], 2e-6),
        (['run.method="radau"'], 2e-9),
        (['run.method="radau"', "run.accuracy=1e-6"], 2e-6),
        (["run.tolerance=1e-10", "run.stages=2"], 2e-8),
    ],
)
def test_a_rate_that_is_damped_at_once_is_right_in_every_row(settings, bound, c, move):
    tables = f"parameters = {{ c = {c} }}\n[start]\nx = 1.0\nx_dot = 0.5\n[run]\nduration = 5.0"
    summary, rows = move(SPRING, tables, *settings)
    assert off(c, rows) < bound, summary["warnings"]


def test_rows_at_the_ends_of_radau_steps(move):
    """What is damped is small beside the motion, and steps of three stages see it by one coefficient alone."""
    c, rate, accuracy = 755603.5291000814, -0.010000817319503155, 1e-9
    tables = f"parameters = {{ c = {c} }}\n[start]\nx = 1.0\nx_dot = {rate}\n[run]\nduration = 1.0"
    _, rows = move(SPRING, tables, 'run.method="radau"', f"run.accuracy={accuracy}", output="every = 1")
    for row in rows:
        x, v = damped(c, row["t"], rate)
        assert abs(row["x"] - x) < accuracy, row  # measured 1.2e-16
        assert abs(row["x_dot"] - v) < accuracy * 0.01, row  # of 1 cm/s, which counts; measured 7.5e-12


def test_constant_steps_that_miss_it_say_so(move):
    """A Gauss step of one millisecond keeps nearly all of a rate of one percent."""
    tables = "parameters = { c = 1e6 }\n[start]\nx = 1.0\nx_dot = 0.01\n[run]\nduration = 5.0\nstep = 1e-3"
    summary, rows = move(SPRING, tables)
    assert abs(rows[TIMES.index(0.01)]["x_dot"]) > 0.008  # measured 0.0089; it is -1e-6
    assert summary["trusted_until"] == 0 and summary["warnings"]


def test_one_coordinate_is_damped_and_another_swings(move):
    tables = "[start]\nx = 0.5\nx_dot = 0.01\ny = 1.0\n[run]\nduration = 5.0"
    _, coarse = move(BESIDE, tables, "run.accuracy=1e-6")
    _, fine = move(BESIDE, tables, 'run.method="dopri5"', "run.tolerance=1e-13")
    for one, other in zip(coarse, fine, strict=True):
        for name in ("x", "y", "x_dot", "y_dot"):
            assert abs(one[name] - other[name]) < 2e-6, (one["t"], name)  # measured 4.2e-8


@pytest.mark.parametrize("accuracy", [1e-6, 1e-9])
def test_damping_that_begins_late(accuracy, move):
    """It falls for 0.45 s, stops within microseconds, and creeps at 1e-5 m/s."""
    summary, rows = move(LATE, "[start]\nx = 1.0\n[run]\nduration = 5.0", f"run.accuracy={accuracy}")
    assert summary["method"] == "gauss" and summary["steps"] < 2000  # measured 41, 36; series took 315,678
    fall, g, c = math.sqrt(2 / 9.81), 9.81, 1e6
    for row in rows:
        late = row["t"] - fall
        x, v = 1 - g * row["t"] ** 2 / 2, -g * row["t"]
        if late > 0:
            v0, slow = -g * fall, -g / c
            x = slow * late + (v0 - slow) / c * (1 - math.exp(-c * late))
            v = slow + (v0 - slow) * math.exp(-c * late)
        assert abs(row["x"] - x) < 2 * accuracy and abs(row["x_dot"] - v) < 2 * accuracy * 4.43, (
            row
        )  # measured 4e-16, 1e-16


def test_feedback_that_damps_at_once(move):
    law = '[[system.feedback]]\ninput = "push"\nvalue = "-1e5*x_dot"'
    tables = f"{law}\n[start]\nx = 1.0\nx_dot = 0.5\n[run]\nduration = 5.0"
    for settings, bound in (([], 2e-9), (["run.accuracy=1e-6"], 2e-6)):
        _, rows = move(FED, tables, *settings)
        assert off(1e5, rows) < bound  # measured 6.8e-13, 3.9e-7


def test_members_are_damped_alike(pendula, tmp_path):
    h5py = pytest.importorskip("h5py")
    (tmp_path / "own.py").write_text(SPRING)
    scenario = tmp_path / "own.toml"
    values = [1e2, 1e3, 1e4, 1e5, 1e6, 1e7]
    scenario.write_text(
        '[system]\nmodel = "own.py"\n[start]\nx = 1.0\nx_dot = 0.5\n[run]\nduration = 0.1\n[ensemble]\n'
        f'[[ensemble.axis]]\nkey = "system.parameters.c"\nvalues = {values}\n'
    )
    ended = pendula("ensemble", scenario, "-o", tmp_path / "out.h5", "--json")
    assert ended.returncode == 0, ended.stderr
    with h5py.File(tmp_path / "out.h5") as file:
        rates = file["x_dot"][:]
    for c, rate in zip(values, rates, strict=True):
        assert abs(rate - damped(c, 0.1)[1]) < 1e-8, c  # measured 3e-10

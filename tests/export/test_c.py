"""Exported C against the program: the same Gauss step, to rounding, with the same derivatives."""

import json
import subprocess
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import pytest
from conftest import EXAMPLES, consumer, numbers

# Scenarios and what is set in them besides: chains and other models, with inputs, time and damping; stages, step.
SCENARIOS = {
    "double_pendulum": ("double_pendulum", (), 2, 0.01),
    "three_links_with_torques": ("driven_damped", ("chain.drive=", "chain.torque=[0.3, 0.1, -0.1]"), 3, 0.02),
    "three_links_with_a_drive": ("driven_damped", (), 3, 0.02),
    "in_space": ("spherical_pendulum", (), 2, 0.01),
    "cart_with_a_drive": ("cart_chain", ("run.accuracy=",), 4, 0.02),
    "kapitza": ("driven_chain", (), 2, 0.001),
    "furuta": ("furuta", (), 1, 0.005),
}
STEPS = 20


def settings(*pairs: str) -> list[str]:
    return [word for pair in pairs for word in ("--set", pair)]


def same(stages: int, h: float) -> list[str]:
    """Settings by which the program takes the steps that are exported."""
    method = ("run.method=gauss", "run.solver=dense", "run.iteration=newton", "run.form=momentum")
    return settings(*method, f"run.stages={stages}", f"run.step={h}")


@pytest.fixture(scope="module")
def system(export, tmp_path_factory):
    """system(name) -> the consumer of a scenario."""

    @cache
    def made(name: str) -> Path:
        file, overrides, stages, _ = SCENARIOS[name]
        folder = tmp_path_factory.mktemp(name)
        return consumer(export(folder, EXAMPLES / f"{file}.toml", *settings(*overrides), "--stages", stages))

    return made


def told(ended: subprocess.CompletedProcess) -> dict:
    assert ended.returncode == 0, ended.stderr
    return json.loads(ended.stdout)


def distance(ours: list[float], theirs: list[float]) -> float:
    """The largest difference, relative to the largest number, or 1."""
    size = max(1.0, *map(abs, theirs))
    return max(abs(x - y) for x, y in zip(ours, theirs, strict=True)) / size


def flat(rows: Iterable[Iterable[float]]) -> list[float]:
    return [x for row in rows for x in row]


@pytest.mark.parametrize("name", SCENARIOS)
def test_steps_are_the_programs(name, pendula, system):
    file, overrides, stages, h = SCENARIOS[name]
    run = settings(f"run.duration={STEPS * h}", "run.estimate=false")
    theirs = told(
        pendula(
            "simulate", EXAMPLES / f"{file}.toml", "--json", *settings(*overrides), *same(stages, h), *run
        )
    )
    assert (theirs["steps"], theirs["rejected_steps"]) == (STEPS, 0)
    ours, final = numbers(system(name), STEPS, h), theirs["final"]
    state = [*final["q"].values(), *final["v"].values()]
    assert distance(ours["state"], state) < 1e-13  # measured 2.9e-15
    assert distance(ours["energy"], [theirs["energy_final"]]) < 1e-13  # measured 6.5e-15
    assert distance(ours["points"], flat(final["points"].values())) < 1e-13  # measured 2.2e-16


@pytest.mark.parametrize(
    "name", ["double_pendulum", "three_links_with_a_drive", "cart_with_a_drive", "in_space"]
)
def test_derivatives_are_the_programs(name, pendula, system):
    """Of one step, by the state and by inputs that are held."""
    file, overrides, stages, h = SCENARIOS[name]
    theirs = told(
        pendula(
            "linearize",
            EXAMPLES / f"{file}.toml",
            "--step",
            h,
            "--json",
            *settings(*overrides),
            *same(stages, h),
        )
    )
    ours = numbers(system(name), 1, h)
    assert distance(ours["by_state"], flat(theirs["A"])) < 1e-12  # measured 3.8e-14
    assert distance(ours["by_inputs"], flat(theirs["B"])) < 1e-13  # measured 1.1e-16


@pytest.mark.parametrize("name", ["double_pendulum", "three_links_with_a_drive", "kapitza"])
def test_derivatives_by_parameters_and_time_are_those_of_the_step(name, system):
    """Against differences of the step itself, of fourth order."""
    _, _, _, h = SCENARIOS[name]
    program = system(name)
    ours = numbers(program, 1, h)
    states = len(ours["state"])
    for what, place, size in [
        *(("parameters", k, 1e-3) for k in range(len(ours["parameters"]))),
        ("t", 0, 1e-4),
        ("h", 0, h / 100),
    ]:
        slope = [0.0] * states
        for away, weight in ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12)):
            moved = numbers(program, 1, h, what, place, away * size)["state"]
            slope = [x + weight / size * y for x, y in zip(slope, moved, strict=True)]
        found, column = ("by_parameters", place) if what == "parameters" else ("by_times", int(what == "h"))
        columns = len(ours[found]) // states
        assert distance(ours[found][column::columns], slope) < 1e-8, (what, place)  # measured 6.9e-10


def test_float_is_the_same_to_its_rounding(export, tmp_path, system):
    file, overrides, stages, h = SCENARIOS["cart_with_a_drive"]
    folder = export(tmp_path, EXAMPLES / f"{file}.toml", *settings(*overrides), "--stages", stages, "--float")
    ours, theirs = (
        numbers(consumer(folder, "float"), STEPS, h),
        numbers(system("cart_with_a_drive"), STEPS, h),
    )
    assert distance(ours["state"], theirs["state"]) < 1e-5  # measured 1.0e-6
    assert distance(ours["by_state"], theirs["by_state"]) < 1e-5  # measured 8.2e-7


@pytest.mark.parametrize(
    ("what", "words"),
    [
        (("planar:2", "--as", "rust"), "--as: rust not in {c,casadi,fmu}"),
        (("planar", "--as", "c"), "export: expected a chain as planar:3, got planar"),
        (("planar:two", "--as", "c"), "export: expected a chain as planar:3, got planar:two"),
        (("planar:0", "--as", "c"), "a chain has at least one link: got --links 0"),
        (("planar:99", "--as", "c"), "export: expected at most 16 coordinates, got 99"),
        (
            ("planar:2", "--as", "c", "--links", 3),
            "export: --links: expected a model or the name of a space, got planar:2",
        ),
        (
            ("furuta", "--as", "c", "--set", "run.step=1"),
            "export: --set: expected a scenario (.toml), got furuta",
        ),
        (("nothing", "--as", "c"), "expected a model file ending in .py, or a built-in model"),
        (("furuta", "--as", "c", "--name", "1st"), "export: name: expected a name of letters"),
        (
            ("furuta", "--as", "casadi", "--float"),
            "export: number: expected double as casadi has it",
        ),
        (("pieces.py", "--as", "casadi"), "export: casadi: expected a smooth model"),
        (
            ("mine.py", "--as", "c"),
            "export: expected a new file, or one that was exported before, got out/mine.c",
        ),
        ((EXAMPLES / "balance.toml", "--as", "fmu"), "export: an FMU has no feedback that is sampled"),
        ((EXAMPLES / "natural_units.toml", "--as", "c"), 'export: chain.units: expected "SI", got "natural"'),
    ],
)
def test_what_is_wrong_is_told(what, words, pendula, tmp_path):
    model = "def define(model, links):\n    x = model.coordinate('x', 'm')\n"
    (tmp_path / "mine.py").write_text(f"{model}    model.lagrangian = model.rate(x) ** 2\n")
    (tmp_path / "pieces.py").write_text(
        f"from sympy import Abs\n{model}    model.lagrangian = model.rate(x) ** 2 - Abs(x)\n"
    )
    (tmp_path / "out").mkdir()
    (tmp_path / "out/mine.c").write_text("mine\n")
    ended = pendula("export", *what, "-o", "out", cwd=tmp_path)
    assert ended.returncode == 2
    assert words in ended.stderr, ended.stderr
    assert (tmp_path / "out/mine.c").read_text() == "mine\n"


def test_a_controller_that_samples_is_the_scenarios(pendula, export, tmp_path):
    """Three links that stand on a cart, by a law that reaches its limit."""
    overrides = settings("system.feedback[1].limit=3.0")
    folder = export(tmp_path, EXAMPLES / "balance.toml", *overrides, "--stages", 2)
    ours = numbers(consumer(folder, "double", "-DCONTROLLED"), STEPS, 0.01)
    run = settings(f"run.duration={STEPS * 0.01}", "run.estimate=false")
    theirs = told(pendula("simulate", EXAMPLES / "balance.toml", "--json", *overrides, *same(2, 0.01), *run))
    state = [*theirs["final"]["q"].values(), *theirs["final"]["v"].values()]
    assert distance(ours["state"], state) < 1e-13  # measured 2.0e-15; without the controller 0.26
    assert "system_step_size(void) {\n  return 0.01;" in (folder / "system.c").read_text()


def test_what_was_exported_is_exported_again(export, tmp_path):
    first = (export(tmp_path, "furuta") / "system.c").read_bytes()
    assert (export(tmp_path, "furuta") / "system.c").read_bytes() == first

"""Runs that once went wrong: each is right now, or says that it is not.

The scenarios are tests/trials/*.toml, and of models tests/trials/models/*.toml; trials/ends.json has where the
reference finds the chains at the end:

    python3 tests/campaign/reference.py tests/trials/[!c]*.toml > tests/trials/ends.json
"""

import itertools
import json
import math
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import Result, Trajectory, settings

TRIALS = Path(__file__).parents[1] / "trials"
ENDS = json.loads((TRIALS / "ends.json").read_text())


def said(run: Result) -> bool:
    """Exit status 1 with a message, or a warning in the summary; in neither case a number that is none."""
    summary = run.json  # rejects NaN
    if run.status == 1:
        return bool(run.err.strip()) and summary["outcome"]["status"] != "ok"
    assert run.status == 0, run.err
    return bool(summary["warnings"])


def error(run: Result, name: str) -> float:
    """How far bobs are from the reference, over the length, and velocities, over the largest speed."""
    end, final = ENDS[name], run.json["final"]
    ends = [[0.0] * len(end["bobs"][0]), *end["bobs"]]
    length = sum(math.dist(a, b) for a, b in itertools.pairwise(ends))
    away = max(math.dist(a, b) for a, b in zip(end["bobs"], final["bobs"], strict=True))
    faster = max(math.dist(a, b) for a, b in zip(end["velocities"], final["velocities"], strict=True))
    return away / length + faster / end["speed"]


@pytest.fixture
def trial(pendula) -> Callable[..., Result]:
    def run(name: str, *overrides: str) -> Result:
        return pendula("simulate", TRIALS / f"{name}.toml", "-o", "out.csv", "--json", *settings(*overrides))

    return run


def test_without_gravity_there_is_no_false_alarm(trial):
    run = trial("false_alarm_no_gravity")
    assert (run.status, run.json["outcome"]) == (0, {"status": "ok"}), run.err
    assert error(run, "false_alarm_no_gravity") < 1e-6


def test_newton_may_meet_a_pole_where_the_motion_does_not(trial):
    """sin θ_3 comes down to 6e-3, and an iterate below: smaller parts of the step go through."""
    run = trial("dense_silent_momentum_s2", "run.form=velocity", "run.stages=4")
    assert run.status == 0, run.err
    assert error(run, "dense_silent_momentum_s2") < 1e-6  # measured 1e-7


@pytest.mark.parametrize(
    "name", ["ok_with_nan", "dense_1326", "dense_silent_momentum_s2", "stiff", "same_parts"]
)
def test_right_or_said(trial, name):
    run = trial(name)
    assert said(run) or error(run, name) < 1e-6


def test_the_principal_root_or_said(trial):
    """So large a step of two stages is off by 7e-3 where it takes the root that continues the motion."""
    run = trial("wrongroot_1")
    assert said(run) or error(run, "wrongroot_1") < 2e-2


def test_damping_never_gives_energy_or_said(trial, tmp_path):
    run = trial("blowup_planar3")
    energies = Trajectory.read(tmp_path / "out.csv").column("energy")
    grown = max(after - before for before, after in itertools.pairwise(energies))
    assert said(run) or grown < 1e-9 * abs(energies[0])


def test_energy_does_not_drift_over_a_million_steps(trial, tmp_path):
    run = trial("chartdrift_n1")
    assert (run.status, run.json["steps"]) == (0, 1000000)
    energies = Trajectory.read(tmp_path / "out.csv").column("energy")
    errors = [abs(energy - energies[0]) for energy in energies]
    tenth = len(errors) // 10
    assert max(errors[-tenth:]) < 1.5 * max(errors[:tenth])


# --- models


def ended(run: Result, name: str) -> tuple[float, float]:
    return run.json["final"]["q"][name], run.json["final"]["v"][name]


def test_switchings_that_pile_up_end(trial):
    """A detent's n-th swing lasts 1/n as long: after a thousand of them the run ends, near where it switches."""
    run = trial("models/detent")
    assert (run.status, run.json["outcome"]["status"]) == (1, "stuck_at_switch"), run.err
    assert 5 < run.json["outcome"]["t"] < 12
    assert abs(ended(run, "x")[0]) < 1e-6
    assert run.json["steps"] < 20000


def test_a_kinetic_energy_may_be_negative(trial):
    """x'' = x. A warning said that energy was off by 0.13."""
    run = trial("models/negative_mass")
    assert (run.status, run.json["warnings"]) == (0, []), run.err
    assert ended(run, "x") == pytest.approx((math.cosh(2), math.sinh(2)), rel=1e-9)


def test_a_potential_that_switches_in_time_is_no_blow(trial):
    run = trial("models/switched_spring")
    assert (run.status, run.json["warnings"]) == (0, []), run.err
    x, v, w = math.cos(0.5), -math.sin(0.5), math.sqrt(2)
    c, s = math.cos(w * 1.5), math.sin(w * 1.5)
    assert ended(run, "x") == pytest.approx((x * c + v / w * s, v * c - w * x * s), rel=1e-9)


def test_a_start_that_is_driven_away_on_both_sides_is_told(trial):
    run = trial("models/repelled")
    assert run.status == 0, run.err
    assert (run.json["expected_error"], run.json["trusted_until"]) == (None, 0)
    (told,) = run.json["warnings"]
    assert told.startswith(
        "the run starts where x = 0, and is driven away on both sides: it goes one way of several"
    )

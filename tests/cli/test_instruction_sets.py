"""PENDULA_ARCH: the library on every instruction set that this processor has."""

import math
import re

import pytest
from conftest import DOUBLE, SPHERICAL, settings

FALLING = """\
[chain]
space   = "planar"
links   = 10
masses  = 1.0
lengths = 0.1

[start]
theta = 1.5707963267948966

[run]
stages   = 8
step     = 2e-3
duration = 0.4
"""

LOADED = """\
[chain]
space   = "spatial"
links   = 3
masses  = [1.0, 0.5, 2.0]
lengths = 1.0
damping = 0.1
torque  = [0.1, 0.2, 0.3]

[start]
theta   = 0.5
phi     = [0.0, 1.0, 2.0]
phi_dot = 1.0

[run]
step     = 2e-3
duration = 1.0
"""


def available(pendula) -> list[str]:
    """The instruction sets that this build and this processor have, as a complaint lists them."""
    complaint = pendula("--version", PENDULA_ARCH="another").err
    return re.fullmatch(r"pendula: PENDULA_ARCH: expected one of (.*), got another\n", complaint)[1].split(
        ", "
    )


def version(run) -> str:
    """The instruction set that the program names with its version."""
    assert run.status == 0, run.err
    return re.match(r"pendula \d+\.\d+\.\d+ \((\w+)", run.out)[1]


def test_version_says_where_some_processors_can_run_nothing(pendula):
    least = available(pendula)[0]
    limit = "" if least in ("sse2", "baseline") else f", on processors with {least} only"
    assert pendula("--version", PENDULA_ARCH=least).out.endswith(f" ({least}{limit})\n")


def test_version_names_the_best_one_or_the_one_asked_for(pendula):
    sets = available(pendula)
    assert version(pendula("--version", PENDULA_ARCH="")) == sets[-1]
    assert [version(pendula("--version", PENDULA_ARCH=one)) for one in sets] == sets


@pytest.mark.parametrize("wrong", ["AVX2", "native", "avx2,fma", " "])
@pytest.mark.parametrize("command", [["--version"], ["kernels"], ["simulate", "scenario.toml"]])
def test_a_wrong_one_is_the_users_error(pendula, command, wrong):
    run = pendula(*command, PENDULA_ARCH=wrong)
    assert (run.status, run.out) == (2, "")
    assert run.err == f"pendula: PENDULA_ARCH: expected one of {', '.join(available(pendula))}, got {wrong}\n"


def test_help_needs_none(pendula):
    assert pendula("--help", PENDULA_ARCH="wrong").status == 0


def distance(a: list[list[float]], b: list[list[float]]) -> float:
    """Largest distance of two bobs."""
    return max(math.dist(p, q) for p, q in zip(a, b, strict=True))


# What rounding makes of each: the double pendulum and the falling chain are chaotic.
@pytest.mark.parametrize(
    ("scenario", "overrides", "bound"),
    [
        (DOUBLE, ["run.stages=8"], 1e-14),  # measured 0
        (DOUBLE, ["run.solver=dense"], 1e-14),  # measured 0
        (DOUBLE, ["run.method=dopri5", "run.tolerance=1e-9"], 1e-14),  # measured 6e-16
        (SPHERICAL, ["run.stages=4"], 1e-14),  # measured 8e-16
        (FALLING, ["run.iteration=fixed-point"], 1e-14),  # measured 6e-17
        (FALLING, ["run.iteration=newton"], 1e-14),  # measured 1e-16
        (FALLING, ["run.method=rk4"], 1e-14),  # measured 1e-15
        (LOADED, ["run.stages=3", "run.iteration=newton"], 1e-14),  # measured 0
        (LOADED, ["run.stages=5", "run.iteration=fixed-point"], 1e-14),  # measured 6e-17
    ],
)
def test_all_give_the_same_to_rounding(pendula, tmp_path, scenario, overrides, bound):
    (tmp_path / "scenario.toml").write_text(scenario)
    words = ["simulate", "scenario.toml", "--json", *settings(*overrides)]
    runs = {one: pendula(*words, PENDULA_ARCH=one).json for one in available(pendula)}
    expected = runs["sse2"] if "sse2" in runs else next(iter(runs.values()))
    for one, run in runs.items():
        assert run["steps"] == expected["steps"], one
        assert distance(run["final"]["bobs"], expected["final"]["bobs"]) < bound, one


def test_the_self_test_passes_on_each(pendula):
    for one in available(pendula):
        run = pendula("check", PENDULA_ARCH=one)
        assert run.status == 0, f"{one}\n{run.out}"

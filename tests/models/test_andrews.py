"""Andrews' mechanism, whose published digits are compared with those of two methods."""

import runpy
import subprocess
from pathlib import Path

import index_one
import pytest

FILE = Path(__file__).with_name("andrews.py")
NAMES = ("beta", "theta", "gamma", "phi", "delta", "omega", "epsilon")
START = (
    "-0.0617138900142764496358948458001",
    "0.0",
    "0.455279819163070380255912382449",
    "0.222668390165885884674473185609",
    "0.487364979543842550225598953530",
    "-0.222668390165885884674473185609",
    "1.23054744454982119249735015568",
)
# The Test Set for IVP Solvers, at t = 0.03 s; and how far it is off, as measured.
PUBLISHED = {
    "beta": (15.81077119629904, 1.1e-9),
    "theta": (-15.75637105984298, 1.4e-9),
    "gamma": (0.04082224013073101, 1.1e-11),
    "delta": (0.5244099658805304, 5.8e-13),
}


@pytest.fixture
def mechanism(tmp_path, simulate):
    """mechanism(settings of [run]) -> the summary."""
    start = "\n".join(f"{name} = {value}" for name, value in zip(NAMES, START, strict=True))
    file = tmp_path / "andrews.toml"
    file.write_text(f'[system]\nmodel = "{FILE}"\n[start]\n{start}\n[run]\nduration = 0.03\n')
    return lambda **settings: simulate(file, **settings)


@pytest.fixture(scope="module")
def truth(tmp_path_factory) -> dict[str, float]:
    moved = index_one.program(runpy.run_path(str(FILE))["define"], tmp_path_factory.mktemp("second"))

    def end(steps: int) -> list[float]:
        ended = subprocess.run(
            [moved, "0.03", str(steps), *START, *["0"] * 7], capture_output=True, check=True
        )
        return [float(line) for line in ended.stdout.split()]

    found, coarser = end(400), end(200)
    assert max(abs(a - b) for a, b in zip(found[:7], coarser[:7], strict=True)) < 2e-13  # measured 9e-15
    return dict(zip(NAMES, found, strict=False))


def off(summary, truth) -> float:
    return max(abs(summary["final"]["q"][name] - truth[name]) for name in NAMES)


def test_two_methods_agree_in_digits_that_are_published_otherwise(mechanism, truth):
    for settings in ({"run__iteration": "newton"}, {"run__iteration": "fixed-point"}):
        run = mechanism(run__stages=6, run__step=1e-4, **settings)
        assert off(run, truth) < 2e-13  # measured 2e-15, of angles up to 16 rad
        assert max(run["constraint_error"].values()) < 1e-13
    for name, (value, by) in PUBLISHED.items():
        assert abs(truth[name] - value) == pytest.approx(by, rel=0.1), name


def test_an_accuracy_is_kept(mechanism, truth):
    run = mechanism(run__accuracy=1e-10)
    assert not run["warnings"]
    assert off(run, truth) / 16 < 1e-10  # measured 9e-13; of the largest angle
    assert run["steps"] < 100  # measured 36

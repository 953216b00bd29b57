"""Every chain in examples/ runs, and shows what its first lines promise; other systems: tests/models."""

import math
from pathlib import Path

import pytest
from conftest import Trajectory

FOLDER = Path(__file__).parents[2] / "examples"
CHAOS = {"poincare"}  # what cannot be trusted for as long as it goes on, as a warning says
EXAMPLES = sorted(file for file in FOLDER.glob("*.toml") if "[chain]" in file.read_text())


@pytest.fixture
def example(pendula, tmp_path):
    """Runs an example; gives its summary and its trajectory."""

    def run(name: str) -> tuple[dict, Trajectory]:
        file = next(file for file in EXAMPLES if file.stem == name)
        result = pendula("simulate", file, "-o", f"{name}.csv", "--json")
        assert result.status == 0
        assert len(result.json["warnings"]) == (name in CHAOS), result.err
        return result.json, Trajectory.read(tmp_path / f"{name}.csv")

    return run


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_examples_run_without_a_warning(example, file):
    summary, trajectory = example(file.stem)
    assert summary["outcome"] == {"status": "ok"}
    assert len(trajectory.rows) == summary["rows"] > 20
    assert (
        (summary["expected_error"] is None) == (summary["trusted_until"] is not None) == (file.stem in CHAOS)
    )


@pytest.mark.parametrize("file", EXAMPLES, ids=lambda file: file.stem)
def test_examples_run_without_naming_a_step(file, pendula, tmp_path):
    """Of chaos that outlives every tolerance a warning says so."""
    lines = [line for line in file.read_text().splitlines() if not line.startswith(("step ", "stages "))]
    (tmp_path / file.name).write_text("\n".join(lines))
    summary = pendula("simulate", tmp_path / file.name, "--json").json
    assert summary["outcome"] == {"status": "ok"}
    assert summary["step"] is None and summary["smallest_step"] > 0
    for warning in summary["warnings"]:
        assert warning.startswith("an accuracy of 1e-09 is not reached: ")
        assert 0 < summary["trusted_until"] < summary["duration"]


def test_double_pendulum_keeps_its_energy(example):
    summary, _ = example("double_pendulum")
    assert summary["energy_error_max"] < 1e-11  # measured 4.2e-12
    bob = summary["final"]["bobs"][1]
    assert math.dist(bob, (-1.0407657832461712, -1.7073476624693271)) < 1e-9  # measured 1.7e-12
    assert summary["method"] == "taylor" and summary["method_reason"]
    assert summary["step"] is None and summary["stages"] is None
    assert summary["accuracy"] == 1e-9 and 1e-12 < summary["expected_error"] < 1e-9  # told 9e-10
    assert 1e-14 < summary["tolerance"] <= 1e-10  # chosen 6.5e-13
    assert 0 < summary["smallest_step"] < summary["largest_step"]


def test_spherical_pendulum_keeps_energy_and_vertical_angular_momentum(example):
    summary, trajectory = example("spherical_pendulum")
    momenta = [
        math.sin(theta) ** 2 * phi_dot
        for theta, phi_dot in zip(trajectory.column("theta_1"), trajectory.column("phi_dot_1"), strict=True)
    ]
    assert max(abs(momentum - momenta[0]) for momentum in momenta) < 1e-13  # measured 5.6e-15
    assert summary["energy_error_max"] < 1e-10  # measured 1.3e-12


def test_small_oscillation_returns_after_one_period(example):
    summary, trajectory = example("small_oscillation")
    start = trajectory.rows[0]
    end = summary["final"]
    assert end["theta"] == pytest.approx([start[1], start[3], start[5]], abs=1e-8)  # measured 5.0e-10
    assert end["theta_dot"] == pytest.approx([0, 0, 0], abs=1e-7)  # measured 2.0e-9


def test_poincare_section_is_one(example):
    summary, _ = example("poincare")
    assert "cannot be trusted" in summary["warnings"][0] and 10 < summary["trusted_until"] < 30  # told 21.1
    section, flip = summary["events"]
    assert (section["name"], flip["name"]) == ("section", "flip")
    assert section["count"] > 40  # a swing of the inner rod takes about two seconds
    assert 0 < section["first"] < section["last"] < 100
    assert flip["count"] > 10


def test_adaptive_method_agrees_with_gauss(example):
    adaptive, _ = example("adaptive_method")
    gauss, _ = example("double_pendulum")
    assert math.dist(adaptive["final"]["bobs"][1], gauss["final"]["bobs"][1]) < 1e-7  # measured 1.0e-9


def test_natural_units_tell_their_scale(example):
    summary, _ = example("natural_units")
    units = {"length": 0.8, "mass": 2.0, "time": math.sqrt(0.8 / 9.81)}
    assert summary["natural_units"] == pytest.approx(units, rel=1e-15)  # measured 0


def test_loads_change_the_energy(example):
    for name in ("driven_damped", "spatial_chain"):
        summary, _ = example(name)
        assert summary["energy_error_max"] > 1e-3  # measured 0.23, 0.022

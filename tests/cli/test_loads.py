"""Damping, torque and drives through the scenario, against what is known without this program."""

import math

import pytest
from conftest import Trajectory, settings

PENDULUM = """\
[chain]
space   = "planar"
masses  = [2.0]
lengths = [0.5]
gravity = 9.81
{loads}
[start]
theta = [0.3]
[run]
stages = 6
step = 1e-2
duration = 2.0
[output]
every = 1
"""


def simpson(values: list[float], step: float) -> float:
    """Integral over an even number of equal intervals."""
    assert len(values) % 2 == 1
    return step / 3 * (values[0] + values[-1] + 4 * sum(values[1:-1:2]) + 2 * sum(values[2:-1:2]))


@pytest.mark.parametrize(
    ("loads", "power"),
    [
        ("damping = 0.2", lambda t, rate: -0.2 * rate**2),
        ("torque = 1.5", lambda t, rate: 1.5 * rate),
        (
            "[[chain.drive]]\nlink = 1\namplitude = 2.0\nfrequency = 3.0\nphase = 0.4",
            lambda t, rate: 2 * math.sin(3 * t + 0.4) * rate,
        ),
    ],
)
def test_energy_changes_by_the_work_of_the_load(pendula, tmp_path, loads, power):
    (tmp_path / "load.toml").write_text(PENDULUM.format(loads=loads))
    summary = pendula("simulate", "load.toml", "-o", "out.csv", "--json").json
    trajectory = Trajectory.read(tmp_path / "out.csv")
    times, rates = trajectory.column("t"), trajectory.column("theta_dot_1")
    powers = [power(t, rate) for t, rate in zip(times, rates, strict=True)]
    work = simpson(powers, 1e-2)
    change = summary["energy_final"] - summary["energy_initial"]
    assert abs(change) > 1e-2
    assert abs(change - work) < 1e-6  # measured 4.4e-8, of Simpson's rule


def test_torque_about_the_vertical_turns_a_spatial_link(pendula, spherical, tmp_path):
    """d/dt L_z = τ_z sin²θ: what of the torque points along the rod does nothing."""
    overrides = settings("chain.torque=[0, 0, 0.25]", "run.duration=2", "run.stages=6", "output.every=1")
    final = pendula("simulate", spherical, "-o", "out.csv", "--json", *overrides).json["final"]
    (x, y, _), (u, v, _) = final["bobs"][0], final["velocities"][0]
    theta = Trajectory.read(tmp_path / "out.csv").column("theta_1")
    gained = simpson([0.25 * math.sin(angle) ** 2 for angle in theta], 1e-2)
    at_start = math.sin(1.2) ** 2 * 0.9
    assert gained > 0.1
    assert abs((x * v - y * u) - (at_start + gained)) < 1e-8  # measured 5.3e-10, of Simpson's rule

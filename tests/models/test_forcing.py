"""Forces that depend on time and act between the nodes of a step, against impulses in closed form."""

import json
from math import cos, cosh, log, pi, sin, sqrt

import h5py
import numpy as np
import pytest

MODEL = """
from sympy import cos, exp, sin, tanh


def define(model, links):
    theta = model.coordinate("theta", "rad")
    gravity = model.parameter("gravity", "m/s^2", default=0.0)
    push = model.parameter("push", "N m", default=0.0)
    width = model.parameter("width", "s", default=0.01)
    center = model.parameter("center", "s", default=5.0)
    shaking = model.parameter("shaking", "N m", default=0.0)
    frequency = model.parameter("frequency", "rad/s", default=1.0)
    swell = model.parameter("swell", "N m", default=0.0)
    model.lagrangian = model.rate(theta) ** 2 / 2 + gravity * cos(theta)
    pulse = exp(-(((model.time - center) / width) ** 2) / 2)
    growing = 1 + tanh((model.time - center) / width)
    model.force(theta, push * pulse + shaking * sin(frequency * model.time) + swell * growing)
"""

METHODS = {
    "default": "",
    "2 stages": "stages = 2\ntolerance = 1e-6",
    "8 stages": "stages = 8\ntolerance = 1e-9",
    "velocity form": 'form = "velocity"\nstages = 4\ntolerance = 1e-6',
    "radau": 'method = "radau"\ntolerance = 1e-6',
    "dopri5": 'method = "dopri5"\ntolerance = 1e-8',
    "fehlberg78": 'method = "fehlberg78"\ntolerance = 1e-8',
    "bulirsch-stoer": 'method = "bulirsch-stoer"\ntolerance = 1e-8',
}


def scenario(parameters: dict[str, float], method: str, start="theta = 0.0", end=10.0) -> str:
    numbers = ", ".join(f"{name} = {value!r}" for name, value in parameters.items())
    return (
        f'[system]\nmodel = "forced.py"\nparameters = {{ {numbers} }}\n[start]\n{start}\n'
        f"[run]\nduration = {end!r}\n{method}\n"
    )


@pytest.fixture
def moved(pendula, tmp_path):
    """moved(text, command) -> the finished process, in a folder with the model."""
    (tmp_path / "forced.py").write_text(MODEL)

    def move(text: str, *command):
        (tmp_path / "forced.toml").write_text(text)
        ended = pendula(command[0], tmp_path / "forced.toml", *command[1:])
        assert ended.returncode == 0, ended.stderr
        return ended

    return move


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("width", (0.5, 0.05, 0.01, 0.003))
def test_a_pulse_after_rest_is_its_impulse(method, width, moved):
    text = scenario({"push": 10.0, "width": width}, METHODS[method])
    got = json.loads(moved(text, "simulate", "--json").stdout)["final"]
    speed = 10.0 * width * sqrt(2 * pi)
    # theta = speed (t - center) after it; worst measured 3e-4, of 2 stages
    assert (got["v"]["theta"] / speed, got["q"]["theta"] / (5 * speed)) == pytest.approx((1, 1), abs=1e-3)


@pytest.mark.parametrize("method", METHODS)
def test_a_weak_force_that_turns_often_in_a_step_is_followed(method, moved):
    strength, omega = 0.01, 1000.0
    text = scenario({"shaking": strength, "frequency": omega}, METHODS[method], "theta_dot = 3.0")
    got = json.loads(moved(text, "simulate", "--json").stdout)["final"]
    theta = 30 + strength / omega * (10 - sin(10 * omega) / omega)
    rate = 3 + strength / omega * (1 - cos(10 * omega))
    assert (got["q"]["theta"], got["v"]["theta"]) == pytest.approx((theta, rate), abs=3e-5)


@pytest.mark.parametrize("method", METHODS)
def test_what_begins_as_a_rounding_error_does_not_halt_a_run(method, moved):
    text = scenario({"swell": 1.0, "width": 1.0, "center": 19.0}, METHODS[method], end=25.0)
    got = json.loads(moved(text, "simulate", "--json").stdout)
    rate = 25 + log(cosh(6) / cosh(19))  # 1 + tanh(t) begins as an ulp of 1, and goes up by as much
    assert got["final"]["v"]["theta"] == pytest.approx(rate, rel=1e-8)  # measured 6e-10
    assert got["steps"] < 10000  # measured 3241


def test_pulses_in_lanes_are_their_impulses(moved, tmp_path):
    text = scenario({"push": 10.0, "width": 0.004}, 'method = "dopri5"\ntolerance = 1e-8')
    text += '[ensemble]\nkeep = ["final"]\n[[ensemble.axis]]\n'
    text += 'key = "system.parameters.center"\nfrom = 0.5\nto = 9.5\ncount = 50\n'
    moved(text, "ensemble", "-o", tmp_path / "out.h5")
    with h5py.File(tmp_path / "out.h5") as file:
        rates = file["theta_dot"][()].ravel()
    assert np.abs(rates / (10 * 0.004 * sqrt(2 * pi)) - 1).max() < 1e-4

"""What a run says of how far it can be trusted, of models: neither too little nor too much."""

import math

import pytest

# Ends near rest, where rates are nothing that errors could be compared with; whole periods; a pivot that is shaken
# while nothing else moves, or nothing but the last digit of an angle.
RIGHT = {
    "a damped rod at rest": {"model": "rods", "parameters": "{damping=0.3}", "theta_1": 1, "duration": 200},
    "a rod after ten swings": {"model": "rods", "theta_1": 1e-4, "duration": 16.379848, "accuracy": 1e-12},
    "a pivot that is shaken": {
        "model": "driven_chain",
        "parameters": "{y_amplitude=0.03, frequency=120}",
        "theta_1": 0,
        "duration": 1,
    },
    "a rod that all but rests": {
        "model": "rods",
        "parameters": "{damping=0.3}",
        "theta_1": 1e-14,
        "duration": 200,
    },
    "upright to the last digit": {
        "model": "driven_chain",
        "parameters": "{y_amplitude=0.1, frequency=50}",
        "theta_1": 3.141592653589793,
        "duration": 10,
    },
    "upright on a shaken pivot": {
        "model": "driven_chain",
        "parameters": "{y_amplitude=0.1, frequency=50, damping=0.1}",
        "theta_1": 3,
        "duration": 60,
    },
}


@pytest.mark.parametrize("case", RIGHT.values(), ids=RIGHT.keys())
@pytest.mark.parametrize("asked", ["", "tolerance = 1e-9", "stages = 8\nstep = 0.005"])
def test_right_answers_are_not_doubted(case, asked, tmp_path, simulate):
    scenario = tmp_path / "case.toml"
    scenario.write_text(
        f"""[system]
model = "{case["model"]}"
links = 1
parameters = {case.get("parameters", "{}")}
[start]
theta_1 = {case["theta_1"]}
[run]
duration = {case["duration"]}
{asked}
"""
    )
    summary = simulate(scenario)
    assert summary["warnings"] == [] and summary["trusted_until"] is None
    assert summary["expected_error"] < 1e-6


def test_the_ends_of_the_first_steps_err_no_more_than_is_told(tmp_path, simulate, rows):
    """x'' = -x - c x': most of the rate at the start is gone within the first step, however small the tolerance."""
    c, rate, duration = 11997.15998732126, 1.421264782479529e-06, 0.189990275357593
    (tmp_path / "damped.py").write_text(
        """def define(model, links):
    x = model.coordinate("x", "m")
    c = model.parameter("c", "N*s/m", default=1.0)
    model.lagrangian = model.rate(x) ** 2 / 2 - x**2 / 2
    model.dissipation = c * model.rate(x) ** 2 / 2
"""
    )
    scenario = tmp_path / "case.toml"
    scenario.write_text(
        f"""[system]
model = "damped.py"
parameters = {{c = {c}}}
[start]
x = 1.0
x_dot = {rate}
[run]
duration = {duration}
accuracy = 9.86e-6
method = "radau"
[output]
every = 1
"""
    )
    found, told = rows(scenario), simulate(scenario)["expected_error"]
    fast = -(c + math.sqrt(c * c - 4)) / 2
    slow = 1 / fast
    part = (rate - slow) / (fast - slow)
    error = max(
        abs(v - slow * (1 - part) * math.exp(slow * t) - fast * part * math.exp(fast * t))
        for t, v in zip(found["t"], found["x_dot"], strict=True)
    )
    slowest = 0.01 / duration  # what slower rates are compared with
    assert error / slowest < told  # measured 7.1e-5, 1.3e-4; once 1e-7 was told

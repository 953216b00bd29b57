"""What a run says of how far it can be trusted, of models: neither too little nor too much."""

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

"""A run in natural units is the run in SI, scaled."""

import math

import pytest

CHAIN = """\
[chain]
space   = "{space}"
masses  = [1.5, 0.5]
lengths = [0.8, 0.6]
gravity = 9.81
damping = [0.01, 0.02]
torque  = {torque}
units   = "{units}"

[[chain.drive]]
link = 2
amplitude = {amplitude}
frequency = {frequency}
phase = 0.2

[start]
theta     = [1.0, 0.5]
theta_dot = [{rate_1}, {rate_2}]
{phi}
[run]
stages   = 4
step     = {step}
duration = {duration}
"""

LENGTH, MASS, TIME = 0.8, 2.0, math.sqrt(0.8 / 9.81)
ENERGY = MASS * 9.81 * LENGTH


def scenario(space: str, units: str) -> str:
    """The same motion, written in either units."""
    time, energy = (TIME, ENERGY) if units == "natural" else (1.0, 1.0)
    spatial = space == "spatial"
    amplitude = 0.3 / energy
    return CHAIN.format(
        space=space,
        units=units,
        torque="[0.1, 0.0, 0.2]" if spatial else "[0.1, -0.2]",
        amplitude=f"[0.0, {amplitude!r}, 0.0]" if spatial else repr(amplitude),
        frequency=repr(2.5 * time),
        rate_1=repr(0.3 * time),
        rate_2=repr(-0.7 * time),
        phi=f"phi = [0.1, 0.4]\nphi_dot = {2.0 * time!r}\n" if spatial else "",
        step=repr(2e-3 / time),
        duration=repr(1.5 / time),
    )


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_natural_units_are_equal_after_scaling_back(pendula, tmp_path, space):
    runs = {}
    for units in ("SI", "natural"):
        (tmp_path / f"{units}.toml").write_text(scenario(space, units))
        runs[units] = pendula("simulate", f"{units}.toml", "--json").json
    si, natural = runs["SI"], runs["natural"]
    assert natural["units"] == "natural"
    units = {"length": LENGTH, "mass": MASS, "time": TIME}
    assert natural["natural_units"] == pytest.approx(units, rel=1e-15)  # measured 0
    assert natural["steps"] == si["steps"]
    assert natural["final"]["t"] * TIME == pytest.approx(si["final"]["t"], rel=1e-14)  # measured 0
    energy = natural["energy_final"] * ENERGY
    assert energy == pytest.approx(si["energy_final"], rel=1e-13)  # measured 8.9e-16
    for key, unit in (("theta", 1.0), ("theta_dot", 1 / TIME)):
        scaled = [value * unit for value in natural["final"][key]]
        assert scaled == pytest.approx(si["final"][key], abs=1e-13)  # measured 2.7e-15
    for key, unit in (("bobs", LENGTH), ("velocities", LENGTH / TIME)):
        for mine, other in zip(natural["final"][key], si["final"][key], strict=True):
            assert [value * unit for value in mine] == pytest.approx(other, abs=1e-13)  # measured 2.2e-15


def test_text_tells_the_units(pendula, tmp_path):
    (tmp_path / "natural.toml").write_text(scenario("planar", "natural"))
    run = pendula("simulate", "natural.toml")
    assert "l_1 = 0.8 m, M_1 = 2 kg, sqrt(l_1/g) = 0.285569 s" in run.out
    assert "M_1 g l_1" in run.out

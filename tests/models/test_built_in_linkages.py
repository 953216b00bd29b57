"""Built-in linkages against truths that are not this project's."""

from itertools import pairwise
from math import atan2, cos, hypot, pi, sin, sqrt

import pytest
from test_truths import G, frequency

JOINTS = ("crank", "top", "bottom", "back", "knee", "foot")
LINKAGES = ("four_bar", "slider_crank", "hanging_chain", "peaucellier", "walking_leg")
WITHOUT_FRICTION = {"system__parameters": "{}"}
FREE = {"slider_crank": {"system__drive": "[]", **WITHOUT_FRICTION}, "hanging_chain": WITHOUT_FRICTION}
AT_STEPS = {"output__interval": "", "output__every": 1}  # where constraints are kept to rounding


@pytest.mark.parametrize("name", LINKAGES)
def test_energy_and_constraints_are_kept(name, simulate):
    run = simulate(f"{name}.toml", **FREE.get(name, {}), run__duration=2.0, run__tolerance=1e-13)
    assert run["energy_error_max"] < 1e-12  # measured 3.2e-14
    assert max(run["constraint_error"].values()) < 1e-13  # measured 1e-14


def test_a_parallelogram_is_a_pendulum(rows):
    """Its coupler keeps its direction: T = (2 m/3 + c) l² w²/2, U = -(m + c) g l cos(theta)."""
    length, bar, coupler = 0.4, 0.5, 0.7
    lengths = f"crank = {length}, rocker = {length}, coupler = 1.0, ground = 1.0"
    masses = f"crank_mass = {bar}, rocker_mass = {bar}, coupler_mass = {coupler}"
    start = f"theta_1 = 1e-4, theta_2 = {pi / 2}, theta_3 = {pi + 1e-4}"
    run = rows(
        "four_bar.toml",
        system__parameters=f"{{ {lengths}, {masses} }}",
        start=f'{{ {start}, assemble = ["theta_2", "theta_3"] }}',
        run__duration=100.0,
        output__interval=2e-3,
    )
    omega = sqrt((bar + coupler) * G / ((2 * bar / 3 + coupler) * length))
    assert frequency(run["t"], run["theta_1"]) == pytest.approx(omega, rel=1e-7)  # measured 6.6e-10


def test_the_slider_follows_the_crank(rows):
    run = rows("slider_crank.toml", **AT_STEPS)
    assert max(run["crank"]) > 4 * pi  # it turns over
    for s, crank in zip(run["s"], run["crank"], strict=True):
        assert abs(s - 0.3 * cos(crank) - sqrt(0.9**2 - (0.3 * sin(crank)) ** 2)) < 1e-13  # measured 2.1e-15


def test_the_chain_comes_to_rest_as_statics_says(rows):
    """Each hook bears half of the weight; rods hang as a catenary does."""
    run = rows("hanging_chain.toml", system__parameters="{ damping = 0.05 }", run__duration=200.0)
    end = {name: column[-1] for name, column in run.items()}
    weight = 0.8 * G
    assert abs(end["force_end_y"]) == pytest.approx(weight / 2, rel=1e-9)  # measured 5e-14
    for k in range(1, 9):
        vertical = weight / 2 - weight * (k - 0.5) / 8  # in the middle of rod k
        angle = atan2(abs(end["force_end_x"]), vertical)
        assert angle == pytest.approx(end[f"theta_{k}"], abs=1e-9)  # measured 1.4e-12


@pytest.mark.parametrize("ratio", [1.0, 0.9])
def test_the_tracer_runs_along_a_line_if_crank_and_support_are_alike(ratio, rows):
    """OC·OP = arm² - side² turns the circle of the crank into a line; of another crank into a circle."""
    crank = 0.42 * ratio
    run = rows("peaucellier.toml", system__parameters=f"{{ crank = {crank} }}", **AT_STEPS)
    inverse, depth = 1.0**2 - 0.4**2, 0.42
    if ratio == 1:
        apart = [abs(y + inverse / (2 * depth)) for y in run["tracer_y"]]
    else:
        # The circle of which it is a part: the inverse of that about (0, -depth).
        factor = inverse / (depth**2 - crank**2)
        center, radius = -depth * factor, crank * factor
        apart = [
            abs(hypot(x, y - center) - radius) for x, y in zip(run["tracer_x"], run["tracer_y"], strict=True)
        ]
    assert max(run["tracer_x"]) > 0.6 and min(run["tracer_x"]) < -0.6
    assert max(apart) < 1e-13  # measured 4.2e-15 and 7.1e-15


def met(a, b, from_a, from_b, side) -> tuple[float, float]:
    """Where circles about a and b meet, to the left of the way from a to b (side 1) or to its right (-1)."""
    (ax, ay), (bx, by) = a, b
    distance = hypot(bx - ax, by - ay)
    along = (distance**2 + from_a**2 - from_b**2) / (2 * distance)
    across = side * sqrt(from_a**2 - along**2)
    ux, uy = (bx - ax) / distance, (by - ay) / distance
    return ax + along * ux - across * uy, ay + along * uy + across * ux


def test_the_leg_walks_as_compasses_say(rows):
    """All joints from the crank's angle, by circles; the lengths are those of Theo Jansen, in cm."""
    run = rows("walking_leg.toml", **AT_STEPS)
    support, furthest = (-0.38, -0.078), 0.0
    points = [
        {joint: (run[f"{joint}_x"][k], run[f"{joint}_y"][k]) for joint in JOINTS}
        for k in range(len(run["t"]))
    ]
    angles = [atan2(*reversed(point["crank"])) for point in points]
    turned = sum((b - a + pi) % (2 * pi) - pi for a, b in pairwise(angles))
    for angle, point in zip(angles, points, strict=True):
        crank = (0.15 * cos(angle), 0.15 * sin(angle))
        top = met(support, crank, 0.415, 0.50, 1)
        bottom = met(support, crank, 0.393, 0.619, -1)
        back = met(support, top, 0.401, 0.558, 1)
        knee = met(back, bottom, 0.394, 0.367, -1)
        foot = met(knee, bottom, 0.657, 0.49, -1)
        truth = zip(JOINTS, (crank, top, bottom, back, knee, foot), strict=True)
        furthest = max(furthest, *(hypot(x - point[j][0], y - point[j][1]) for j, (x, y) in truth))
    assert furthest < 1e-13  # measured 1e-14
    assert turned > 20 * pi  # measured 38 pi
    height = [point["foot"][1] for point in points]
    assert min(height) == pytest.approx(-0.92, abs=0.01)  # measured -0.918

"""Each built-in model against a truth that is not this project's."""

import json
from math import cos, hypot, pi, sin, sqrt

import numpy as np
import pytest
from conftest import EXAMPLES

G = 9.81


def crossings(times, values) -> list[float]:
    """Times at which a column crosses zero upwards, by straight lines between rows."""
    found = []
    for t, s, a, b in zip(times, times[1:], values, values[1:], strict=False):
        if a < 0 <= b:
            found.append(t + (s - t) * a / (a - b))
    return found


def frequency(times, values) -> float:
    up = crossings(times, values)
    return 2 * pi * (len(up) - 1) / (up[-1] - up[0])


SYSTEMS = sorted(file for file in EXAMPLES.glob("*.toml") if "[system]" in file.read_text())


@pytest.mark.parametrize("file", SYSTEMS, ids=lambda file: file.stem)
def test_examples_run_without_a_warning(file, pendula):
    ended = pendula("simulate", file, "--json")
    assert (ended.returncode, json.loads(ended.stdout)["warnings"]) == (0, [])


@pytest.mark.parametrize(
    ("model", "links"),
    [
        *[(name, None) for name in ("furuta", "spring_pendulum", "swinging_atwood")],
        *[(name, None) for name in ("four_bar", "slider_crank", "peaucellier", "walking_leg")],
        *[("hanging_chain", None), ("hanging_chain", 4)],
        *[("joint_springs", 3), ("rods", 2), ("cart_chain", 2), ("driven_chain", 2), ("driven_chain", 1)],
    ],
)
def test_models_pass_their_own_checks(model, links, pendula):
    ended = pendula("check", model, *([] if links is None else ["--links", links]))
    assert ended.returncode == 0, ended.stdout


def test_spring_pendulum_is_where_others_find_it(simulate):
    """A published run; the digits are those of an independent integration at 1e-13 (DOP853)."""
    summary = simulate("spring_pendulum.toml", run__duration=1000.0, run__stages=8, run__step=0.005)
    truth = (-0.0495486, 0.0990972, 0.0749817)
    assert summary["final"]["points"]["bob"] == pytest.approx(
        truth, abs=1e-7
    )  # measured 2.3e-8: they are seven digits


@pytest.mark.parametrize("stages", (4, 6, 8))
def test_spring_pendulum_errs_by_about_its_tolerance(stages, simulate):
    """By the pivot, motion is nearly singular beside the stages: without a look at the energy 8 to 240 tolerances."""

    def end(**options) -> np.ndarray:
        summary = simulate("spring_pendulum.toml", run__duration=20, **options)
        return np.array(summary["final"]["points"]["bob"])

    exact = end(run__stages=8, run__tolerance=1e-13)
    errors = [
        np.abs(end(run__stages=stages, run__tolerance=x) - exact).max() / x for x in (1e-6, 1e-8, 1e-10)
    ]
    assert max(errors) < 60  # measured 30


def test_spring_pendulum_starts_where_it_has_no_energy(simulate):
    """What little it gains in the first steps is rounding of what it comes to, not of what it has."""
    start = {"start__x": 1.0, "start__y": 0.0, "start__z": 0.0, "start__z_dot": 0.0}
    options = {"run__duration": 5, "run__stages": 4, "run__tolerance": 1e-14}
    summary = simulate("spring_pendulum.toml", system__parameters__rest_length=1.0, **start, **options)
    exact = (-1.084004236511821, 0, -0.17556007215172)  # with 8 stages, 1e-14 and 1e-15
    assert summary["final"]["points"]["bob"] == pytest.approx(exact, abs=1e-12)  # measured 4e-14


def test_swinging_atwood_keeps_its_second_invariant(rows):
    """At mu = 3 it is integrable: Tufillaro, Abbott, Griffiths, Am. J. Phys. 52, 895 (1984)."""
    run = rows("swinging_atwood.toml", run__tolerance=1e-14)
    invariant = [
        r**2 * w * (v * cos(q / 2) - r * w / 2 * sin(q / 2)) + G * r**2 * sin(q / 2) * cos(q / 2) ** 2
        for r, q, v, w in zip(run["r"], run["theta"], run["r_dot"], run["theta_dot"], strict=True)
    ]
    drift = max(abs(value - invariant[0]) for value in invariant) / abs(invariant[0])
    assert drift < 1e-13  # measured 1.2e-15


def test_swinging_atwood_of_another_ratio_has_no_such_invariant(rows):
    run = rows("swinging_atwood.toml", **{"system__parameters": "{ mu = 2.0 }"})
    invariant = [
        r**2 * w * (v * cos(q / 2) - r * w / 2 * sin(q / 2)) + G * r**2 * sin(q / 2) * cos(q / 2) ** 2
        for r, q, v, w in zip(run["r"], run["theta"], run["r_dot"], run["theta_dot"], strict=True)
    ]
    assert max(abs(value - invariant[0]) for value in invariant) > 0.1 * abs(invariant[0])


def test_furuta_swings_as_its_linearisation(rows):
    """Arm inertia J_a = I + m r², rod J = J_0 + m l²: omega² = m g l J_a / (J_a J − (m r l)²)."""
    inertia, r, m, length, own = 0.05, 0.3, 0.2, 0.2, 0.003
    arm, rod = inertia + m * r**2, own + m * length**2
    omega = sqrt(m * G * length * arm / (arm * rod - (m * r * length) ** 2))
    run = rows(
        "furuta.toml",
        start__theta=1e-4,
        system__drive="[]",
        system__parameters="{}",
        run__duration=100.0,
        output__interval=2e-3,
    )
    assert frequency(run["t"], run["theta"]) == pytest.approx(
        omega, rel=1e-7
    )  # measured 1.3e-9, straight lines between rows


def test_furuta_without_a_motor_keeps_its_angular_momentum(rows):
    inertia, r, m, length, own = 0.05, 0.3, 0.2, 0.2, 0.003
    run = rows(
        "furuta.toml",
        start__theta=2.0,
        start__alpha_dot=1.5,
        system__drive="[]",
        system__parameters="{}",
    )
    momentum = [
        (inertia + m * r**2 + (m * length**2 + own) * sin(q) ** 2) * v + m * r * length * cos(q) * w
        for q, v, w in zip(run["theta"], run["alpha_dot"], run["theta_dot"], strict=True)
    ]
    assert max(abs(p - momentum[0]) for p in momentum) < 1e-14  # measured 8.3e-17


def test_cart_chain_keeps_the_momentum_of_the_whole(rows):
    free = "{ masses = [0.5, 0.25], lengths = [0.5, 0.4], cart_mass = 2.0 }"
    run = rows("cart_chain.toml", system__drive="[]", system__parameters=free, start__x_dot=0.7)
    momentum = [
        2.75 * v + 0.75 * 0.5 * cos(a) * p + 0.25 * 0.4 * cos(b) * q
        for v, a, b, p, q in zip(
            *(run[k] for k in ("x_dot", "theta_1", "theta_2", "theta_dot_1", "theta_dot_2")), strict=True
        )
    ]
    assert max(abs(p - momentum[0]) for p in momentum) < 1e-13  # measured 6.7e-16


def test_cart_with_one_link_swings_as_its_linearisation(rows):
    """omega² = (1 + m/M) g/l."""
    parameters = "{ masses = 0.5, lengths = 0.8, cart_mass = 2.0 }"
    run = rows(
        "cart_chain.toml",
        system__links=1,
        system__drive="[]",
        system__parameters=parameters,
        start__theta=1e-4,
        run__duration=100.0,
        output__interval=2e-3,
    )
    omega = sqrt((1 + 0.5 / 2.0) * G / 0.8)
    assert frequency(run["t"], run["theta_1"]) == pytest.approx(omega, rel=1e-7)  # measured 1.3e-9


def test_a_push_on_the_cart_is_its_impulse(rows):
    """Of the whole: d(momentum)/dt is the push alone."""
    free = "{ masses = [0.5, 0.25], lengths = [0.5, 0.4], cart_mass = 2.0 }"
    run = rows("cart_chain.toml", system__parameters=free, run__stages=8)
    last = {name: column[-1] for name, column in run.items()}
    momentum = 2.75 * last["x_dot"] + 0.75 * 0.5 * cos(last["theta_1"]) * last["theta_dot_1"]
    momentum += 0.25 * 0.4 * cos(last["theta_2"]) * last["theta_dot_2"]
    assert momentum == pytest.approx(3.0 / 4.0 * (1 - cos(4.0 * last["t"])), abs=1e-13)  # measured 1.8e-15


@pytest.mark.parametrize(("ratio", "stands"), [(1.3, True), (0.8, False)])
def test_one_inverted_link_stands_where_it_is_shaken_fast_enough(rows, ratio, stands):
    """Stable where a omega > sqrt(2 g l), a much smaller than l (Stephenson, Kapitza)."""
    length, amplitude = 0.3, 0.006
    omega = ratio * sqrt(2 * G * length) / amplitude
    parameters = f"{{ lengths = {length}, y_amplitude = {amplitude}, frequency = {omega!r} }}"
    run = rows(
        "driven_chain.toml",
        system__parameters=parameters,
        start__theta_1=pi - 0.02,
        run__step=1e-4,
        run__duration=8.0,
        output__every=20,
    )
    away = max(abs(q - pi) for q in run["theta_1"])
    assert away < 0.1 if stands else away > 1  # measured 0.02 and 6.3


@pytest.mark.parametrize(("ratio", "stands"), [(1.25, True), (0.85, False)])
def test_two_inverted_links_stand_where_acheson_says(rows, ratio, stands):
    """Two equal links: a omega > 1.8478 sqrt(g l), a < 0.1318 l (Acheson, Proc. R. Soc. A 443, 239)."""
    length, amplitude = 0.3, 0.01
    omega = ratio * 1.8478 * sqrt(G * length) / amplitude
    parameters = f"{{ lengths = {length}, y_amplitude = {amplitude}, frequency = {omega!r} }}"
    run = rows(
        "driven_chain.toml",
        system__links=2,
        system__parameters=parameters,
        start="{ theta_1 = 3.13, theta_2 = 3.15 }",
        run__step=2e-4,
        run__duration=8.0,
        output__every=20,
    )
    away = max(abs(q - pi) for name in ("theta_1", "theta_2") for q in run[name])
    assert away < 0.1 if stands else away > 1  # measured 0.016 and 35


@pytest.mark.parametrize("start", [(57, 65), (40, 107), (-48, 88), (20, -140)])
def test_the_lower_of_two_rods_cannot_turn_over_inside_the_curve(rows, start):
    """Energy forbids it where 3 cos(theta_1) + cos(theta_2) > 2 at rest."""
    a, b = (angle * pi / 180 for angle in start)
    assert 2 < 3 * cos(a) + cos(b) < 2.2  # near the curve
    run = rows(
        "rods.toml", start=f"{{ theta_1 = {a!r}, theta_2 = {b!r} }}", run__duration=200.0, output__every=4
    )
    assert max(abs(q) for q in run["theta_2"]) < pi  # measured 1.3 to 2.5


def test_the_lower_of_two_rods_turns_over_outside(rows):
    run = rows("rods.toml", start="{ theta_1 = 2.0, theta_2 = 2.5 }")
    assert max(abs(q) for q in run["theta_2"]) > pi


def test_one_rod_is_the_compound_pendulum_of_the_textbook(rows):
    """A uniform rod swings as a mathematical pendulum of two thirds of its length."""
    run = rows(
        "rods.toml",
        system__links=1,
        start="{ theta_1 = 1e-4 }",
        run__duration=100.0,
        run__step=0.01,
        output__every=1,
    )
    assert frequency(run["t"], run["theta_1"]) == pytest.approx(sqrt(1.5 * G), rel=1e-7)  # measured 2.6e-9


@pytest.mark.parametrize(("factor", "stands"), [(1.1, True), (0.9, False)])
def test_a_link_on_a_torsion_spring_stands_where_the_spring_is_stiff_enough(rows, factor, stands):
    """Upright, rest at the top: stable where k > m g l."""
    m, length = 0.1, 0.2
    stiffness = factor * m * G * length
    parameters = f"{{ masses = {m}, lengths = {length}, stiffness = {stiffness!r}, rest_angles = {pi!r} }}"
    run = rows(
        "joint_springs.toml",
        system__links=1,
        system__parameters=parameters,
        start=f"{{ theta_1 = {pi - 1e-3!r} }}",
    )
    away = max(abs(q - pi) for q in run["theta_1"])
    assert away < 2e-3 if stands else away > 0.1  # measured 1e-3 and 1.1


def test_joint_springs_swing_in_their_modes(rows):
    """Two links: the slow mode of K x = omega² M x, K with springs between and gravity, solved by hand."""
    m, length, k1, k2 = 1.0, 1.0, 3.0, 2.0
    parameters = f"{{ masses = {m}, lengths = {length}, stiffness = [{k1}, {k2}] }}"
    mass = [[2 * m * length**2, m * length**2], [m * length**2, m * length**2]]
    stiff = [[k1 + k2 + 2 * m * G * length, -k2], [-k2, k2 + m * G * length]]
    a = mass[0][0] * mass[1][1] - mass[0][1] ** 2
    b = -(mass[0][0] * stiff[1][1] + mass[1][1] * stiff[0][0] - 2 * mass[0][1] * stiff[0][1])
    c = stiff[0][0] * stiff[1][1] - stiff[0][1] ** 2
    squared = (-b - sqrt(b * b - 4 * a * c)) / (2 * a)
    shape = (stiff[1][1] - squared * mass[1][1]) / -(stiff[0][1] - squared * mass[0][1])
    run = rows(
        "joint_springs.toml",
        system__links=2,
        system__parameters=parameters,
        start=f"{{ theta_1 = {1e-4 * shape!r}, theta_2 = 1e-4 }}",
        run__duration=100.0,
        run__step=0.01,
        output__every=1,
    )
    assert frequency(run["t"], run["theta_2"]) == pytest.approx(sqrt(squared), rel=1e-7)  # measured 2.4e-9


def test_points_are_where_the_coordinates_say(rows):
    run = rows("rods.toml")
    for x, y, a, b in zip(run["end_2_x"], run["end_2_y"], run["theta_1"], run["theta_2"], strict=True):
        assert hypot(x - sin(a) - sin(b), y + cos(a) + cos(b)) < 1e-15  # measured 1.6e-16

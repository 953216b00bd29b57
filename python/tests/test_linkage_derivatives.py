"""Derivatives of motions that keep constraints, against the same motions without them, and against differences."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pendula
import pytest
from numpy.typing import NDArray

Numbers = NDArray[np.float64]


@pendula.model
def rod(model, links):
    """A damped bob on a rod, which is pushed."""
    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")
    length, m = model.parameter("l", "m", default=0.8), model.parameter("m", "kg", default=2.0)
    c, push = model.parameter("c", "N*m*s", default=0.3), model.input("push", "N")
    squared = model.rate(x) ** 2 + model.rate(y) ** 2
    model.lagrangian = m * squared / 2 - m * 9.81 * y
    model.dissipation = c * squared / (2 * length**2)
    model.force(x, push)
    model.constraint("rod", (x**2 + y**2 - length**2) / 2, "m^2")


@pendula.model
def four_bar(model, links):
    """Three bars from the origin to (d, 0), which moves."""
    from sympy import cos, sin

    d, torque = model.parameter("d", "m", default=1.6), model.input("torque", "N*m")
    x = y = model.lagrangian = 0
    for k, (length, mass) in enumerate([(1.0, 1.0), (1.5, 2.0), (1.2, 0.3)], start=1):
        angle, m = model.coordinate(f"theta_{k}", "rad"), model.parameter(f"m_{k}", "kg", default=mass)
        x, y = x + length * sin(angle), y - length * cos(angle)
        model.lagrangian += m * (model.rate(x) ** 2 + model.rate(y) ** 2) / 2 - 9.81 * m * (y + x / 3)
    model.force(angle, torque)
    model.constraint("across", x - d - sin(3 * model.time) / 20, "m")
    model.constraint("along", y, "m")


def difference(moved: Callable[[float], Numbers], h: float = 2e-4) -> Numbers:
    """Its derivative at 0, with an error of order h^4."""
    return (8 * (moved(h) - moved(-h)) - (moved(2 * h) - moved(-2 * h))) / (12 * h)


def cartesian(theta: float, rate: float) -> dict[str, float]:
    s, c = 0.8 * np.sin(theta), 0.8 * np.cos(theta)
    return {"x": s, "y": -c, "x_dot": c * rate, "y_dot": s * rate}


@pytest.mark.parametrize("iteration", ["fixed-point", "newton"])
def test_a_rod_has_the_derivatives_of_a_pendulum(iteration: str) -> None:
    options: dict[str, Any] = {"step": 0.01, "stages": 4}
    pendulum = pendula.Chain(masses=[2.0], lengths=[0.8], damping=[0.3], space="planar")
    of_angle = pendula.differentiate(pendulum, 1.0, start={"theta": [1.0], "theta_dot": [0.5]}, **options)
    start = cartesian(1.0, 0.5)
    of_bob = pendula.differentiate(rod(), 1.0, start=start, iteration=iteration, **options)
    theta, rate = of_angle.y[:, -1]
    end = cartesian(theta, rate)
    assert np.allclose(of_bob.y[:, -1], list(end.values()), rtol=0, atol=1e-11)

    def slopes(theta: float, rate: float) -> Numbers:
        """Of (x, y, x_dot, y_dot) by the angle and its rate."""
        s, c = 0.8 * np.sin(theta), 0.8 * np.cos(theta)
        return np.array([[c, 0], [s, 0], [-s * rate, c], [c * rate, s]])

    to_bob = slopes(theta, rate)
    wanted = to_bob @ of_angle.by_start[0]
    # Measured up to 1.3e-13 by the start, 1.8e-14 by the mass, 2.4e-14 by damping, 4.1e-13 by the length.
    assert np.allclose(of_bob.by_start[0] @ slopes(1.0, 0.5), wanted, rtol=0, atol=1e-11)
    for name, of in (("m", "masses"), ("c", "damping")):
        assert np.allclose(
            of_bob.by_parameters[name][0, :, 0],
            to_bob @ of_angle.by_parameters[of][0, :, 0],
            rtol=0,
            atol=1e-11,
        )
    # The start is put on the longer rod without a turn, and keeps its speed; so its angle turns slower.
    by_length = of_angle.by_parameters["lengths"][0, :, 0] + of_angle.by_start[0] @ [0, -0.5 / 0.8]
    wanted = to_bob @ by_length + np.array(list(end.values())) / 0.8
    assert np.allclose(of_bob.by_parameters["l"][0, :, 0], wanted, rtol=0, atol=1e-11)


FOUND = ["theta_2", "theta_3", "theta_dot_2", "theta_dot_3"]
NAMES = [f"theta_{k}" for k in (1, 2, 3)] + [f"theta_dot_{k}" for k in (1, 2, 3)]
GUESSES = {"theta_1": 1.1, "theta_dot_1": 0.4, "theta_2": 1.9, "theta_3": 2.9}


@pytest.mark.parametrize("stages", [1, 3, 8])
def test_derivatives_of_a_four_bar_are_those_of_its_steps(stages: int) -> None:
    """Where constraints move, and hold a parameter; its start is put together anew for each difference."""
    options: dict[str, Any] = {"step": 0.05, "stages": stages}

    def begin(d: float = 1.6, **start: float) -> pendula.Simulation:
        return pendula.Simulation(four_bar(d=d), {**GUESSES, **start, "assemble": FOUND}, **options)

    def both(simulation: pendula.Simulation) -> Numbers:
        return np.array([simulation.state, simulation.advance_to(1.0).state])

    closed = dict(zip(NAMES, begin().state, strict=True))
    moved = pendula.differentiate(four_bar(), 1.0, start=closed, **options)
    for name, change in {
        "theta_1": lambda h: both(begin(theta_1=1.1 + h)),
        "theta_dot_1": lambda h: both(begin(theta_dot_1=0.4 + h)),
        "d": lambda h: both(begin(1.6 + h)),
    }.items():
        start, end = difference(change)  # measured off up to 1.8e-11 of numbers up to 6
        found = moved.by_start[0] @ start
        if name == "d":
            found = found + moved.by_parameters["d"][0, :, 0]
        assert np.allclose(found, end, rtol=0, atol=1e-9), name
    for name, change in {
        "m_2": lambda h: pendula.Simulation(four_bar(m_2=2.0 + h), closed, **options).advance_to(1.0).state,
        "torque": lambda h: (
            pendula.Simulation(four_bar(), closed, **options).hold(torque=h).advance_to(1.0).state
        ),
    }.items():
        found = {**moved.by_parameters, **moved.by_inputs}[name][0, :, 0]
        assert np.allclose(found, difference(change), rtol=0, atol=1e-9), name  # measured up to 8.6e-12


def test_backward_is_the_transpose_of_forward() -> None:
    options: dict[str, Any] = {"step": 0.02, "stages": 3}
    start = {**GUESSES, "assemble": FOUND}
    closed = dict(zip(NAMES, pendula.Simulation(four_bar(), start).state, strict=True))
    times = [0.3, 0.305, 1.0]
    forward = pendula.differentiate(four_bar(), t=times, start=closed, **options)
    run = four_bar().simulate(t=times, start=closed, **options, estimate=False)
    weights = np.random.default_rng(1).normal(size=forward.y.shape)
    back = run.gradient(weights)
    assert np.allclose(back.start, np.einsum("ik,kij->j", weights, forward.by_start), rtol=1e-12, atol=1e-12)
    for name, found in {**back.parameters, **back.inputs}.items():
        by = {**forward.by_parameters, **forward.by_inputs}[name]
        assert np.allclose(found, np.einsum("ik,kij->j", weights, by), rtol=1e-12, atol=1e-12), name


def test_exponents_are_those_of_the_freedoms() -> None:
    """Of a damped pendulum near rest: of a rod both are -c/(2 m l^2), and there are no others."""
    found = pendula.lyapunov(rod(), 60.0, start=cartesian(1e-6, 0.0), step=0.05)
    assert len(found.exponents) == 2
    assert np.allclose(found.exponents, -0.3 / (2 * 2 * 0.8**2), rtol=0, atol=2e-3)  # measured 5.2e-4
    # One freedom without damping is regular: MEGNO tends to 2, by steps that the program chooses.
    swings = pendula.lyapunov(rod(c=0.0), 2000.0, start=cartesian(1.0, 0.0), tolerance=1e-9)
    assert abs(swings.megno - 2) < 0.2  # measured 0.08
    assert abs(swings.sum) < 1e-3  # measured 3.4e-5
    with pytest.raises(ValueError, match="expected 1 to 2 exponents, got 3"):
        pendula.lyapunov(rod(), 1.0, start=cartesian(1.0, 0.0), step=0.05, count=3)


@pendula.model
def hung_bar(model, links):
    """A bar on two threads of rods in the plane, as wide as their hooks are apart, with a rod too many."""
    from sympy import cos, sin

    g, mass = 9.81, model.parameter("m", "kg", default=2.0)
    x, y, turn = model.coordinate("x", "m"), model.coordinate("y", "m"), model.coordinate("turn", "rad")
    push = model.input("push", "N")
    speed_squared = model.rate(x) ** 2 + model.rate(y) ** 2
    model.lagrangian = mass * (speed_squared + model.rate(turn) ** 2 / 12) / 2 - mass * g * y
    model.force(x, push)
    for k in (-1, 0, 1):
        across, up = x + k * (cos(turn) - 1) / 2, y + k * sin(turn) / 2
        model.constraint(f"thread_{k + 2}", (across**2 + up**2 - 1) / 2, "m^2")


def accelerations(simulation: pendula.Simulation) -> Numbers:
    field = pendula._core.field(simulation._made, simulation.time, simulation.state)
    return np.array(field[len(field) // 2 :])


@pytest.mark.parametrize("place", range(6))
def test_linear_systems_are_those_of_independent_coordinates(place: int) -> None:
    """Against differences of accelerations, where everything else is put together anew."""
    theta, rate = np.random.default_rng(place).uniform((0.2, -2), (1.3, 2))

    def begin(torque: float = 0.0, **start: float) -> pendula.Simulation:
        given = {**GUESSES, "theta_1": theta, "theta_dot_1": rate, **start}
        return pendula.Simulation(four_bar(inputs={"torque": torque}), {**given, "assemble": FOUND})

    linear = begin().linearize()
    assert linear.names == ["theta_1", "theta_dot_1"] and linear.inputs == ["torque"]
    for column, name in enumerate(linear.names):
        at = {"theta_1": theta, "theta_dot_1": rate}[name]
        moved = difference(lambda h, name=name, at=at: accelerations(begin(**{name: at + h}))[0])
        # Measured off by up to 3.9e-10 of numbers up to 79.
        assert np.allclose(linear.A[:, column], [name != "theta_1", moved], rtol=0, atol=1e-8)
        basis = difference(lambda h, name=name, at=at: begin(**{name: at + h}).state)
        assert np.allclose(linear.basis[:, column], basis, rtol=0, atol=1e-8)  # measured up to 7.5e-12
    pushed = difference(lambda h: accelerations(begin(torque=h))[0], 0.1)
    assert np.allclose(linear.B[:, 0], [0, pushed], rtol=0, atol=1e-12)  # measured up to 1.1e-14


def test_linear_systems_do_not_mind_constraints_too_many() -> None:
    """A bar on three threads of 1 m moves on a circle, as a pendulum does."""
    hung = pendula.Simulation(hung_bar(), {"y": -1.0}).linearize({"right": "x", "turn": "turn"})
    assert hung.names == ["x", "x_dot"]
    # Here and below measured off by up to 1.8e-15.
    assert np.allclose(hung.A, [[0, 1], [-9.81, 0]], rtol=0, atol=1e-13)
    assert np.allclose(hung.B[:, 0], [0, 0.5], rtol=0, atol=1e-14)
    assert np.allclose(hung.C, [[1, 0], [0, 0]], rtol=0, atol=1e-14)
    turned = pendula.Simulation(hung_bar(), {"x": 0.6, "y": -0.8, "x_dot": 0.8, "y_dot": 0.6}).linearize()
    theta = np.arcsin(0.6)  # x = sin(theta), so d(x_dot)/dt = -g sin cos - sin theta_dot^2, theta_dot = 1
    by_angle = [-9.81 * np.cos(2 * theta) - np.cos(theta), -2 * np.sin(theta)]  # theta, theta_dot
    by_x = np.array([[1 / 0.8, 0], [0.6 / 0.8**2, 1 / 0.8]])  # (theta, theta_dot) by (x, x_dot)
    assert np.allclose(turned.A[1], by_angle @ by_x, rtol=0, atol=1e-12)


def test_a_step_of_a_linear_system_is_its_exponential() -> None:
    from scipy.linalg import expm

    start = {"x": 0.0, "y": -1.0}
    continuous = pendula.linearize(hung_bar(), start)
    discrete = pendula.linearize(hung_bar(), start, step=0.1, tolerance=1e-12)
    assert np.allclose(discrete.A, expm(0.1 * continuous.A), rtol=0, atol=1e-12)  # measured 4.4e-16
    assert discrete.names == continuous.names

"""Derivatives and linear systems of motions that keep constraints of rates, against differences."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pendula
import pytest
from test_linkage_derivatives import Numbers, accelerations, difference


@pendula.model
def sleigh(model, links):
    """On a blade, on ice that moves: Chaplygin's, pushed at its mass."""
    from sympy import cos, sin

    x, y, phi = (model.coordinate(*each) for each in (("x", "m"), ("y", "m"), ("phi", "rad")))
    m, a = model.parameter("m", "kg", default=1.3), model.parameter("a", "m", default=0.4)
    fast = model.parameter("fast", "m/s", default=0.3)
    mass = x + a * cos(phi), y + a * sin(phi)
    model.lagrangian = (
        m * (model.rate(mass[0]) ** 2 + model.rate(mass[1]) ** 2) / 2 + model.rate(phi) ** 2 / 10
    )
    model.force(y, model.input("push", "N"))
    sideways = model.rate(y) * cos(phi) - model.rate(x) * sin(phi)
    model.constraint("blade", sideways + fast * sin(model.time + x), "m/s")


@pendula.model
def disc(model, links):
    """A thin disc that rolls and leans."""
    from sympy import cos, sin

    x, y = model.coordinate("x", "m"), model.coordinate("y", "m")
    phi, theta, psi = (model.coordinate(name, "rad") for name in ("phi", "theta", "psi"))
    r, push = model.parameter("r", "m", default=0.3, positive=True), model.input("push", "N*m")
    turn, lean, spin = model.rate(phi), model.rate(theta), model.rate(psi) + model.rate(phi) * cos(theta)
    squared = model.rate(x) ** 2 + model.rate(y) ** 2 + model.rate(r * sin(theta)) ** 2
    squared += r**2 / 4 * (lean**2 + turn**2 * sin(theta) ** 2) + r**2 / 2 * spin**2
    model.lagrangian = squared / 2 - 9.81 * r * sin(theta)
    model.force(phi, push)
    out = r * lean * sin(theta)
    model.constraint("rolls_x", model.rate(x) - out * sin(phi) + r * spin * cos(phi), "m/s")
    model.constraint("rolls_y", model.rate(y) + out * cos(phi) + r * spin * sin(phi), "m/s")


@pendula.model
def wagon(model, links):
    """A bob on a rod, by a constraint of positions, on a wagon whose wheel rolls."""
    x, theta = model.coordinate("x", "m"), model.coordinate("theta", "rad")
    bob = model.coordinate("bob_x", "m"), model.coordinate("bob_y", "m")
    length, r = model.parameter("l", "m", default=0.7), model.parameter("r", "m", default=0.3)
    kinetic = 2 * model.rate(x) ** 2 + 0.1 * model.rate(theta) ** 2
    kinetic += model.rate(bob[0]) ** 2 + model.rate(bob[1]) ** 2
    model.lagrangian = kinetic / 2 - 9.81 * bob[1] - x**2
    model.force(theta, model.input("push", "N*m"))
    model.constraint("rolls", model.rate(x) - r * model.rate(theta), "m/s")
    model.constraint("rod", ((bob[0] - x) ** 2 + bob[1] ** 2 - length**2) / 2, "m^2")


@dataclass
class Case:
    """A model and where it starts; numbers that are put together anew, for differences; parameters of constraints."""

    model: Any
    start: dict[str, Any]
    names: list[str]
    found: list[str]
    parameters: dict[str, float]

    def begin(
        self, start: dict[str, Any] | None = None, push: float = 0.0, **given: float
    ) -> pendula.Simulation:
        held = {**self.start, **(start or {}), "assemble": self.found}
        return pendula.Simulation(self.model(inputs={"push": push}, **given), held, step=0.02, stages=3)


CASES = {
    "sleigh": Case(
        sleigh,
        {"phi": 0.7, "phi_dot": 1.2, "y_dot": 0.4},
        ["x", "y", "phi", "y_dot", "phi_dot"],
        ["x_dot"],
        {"fast": 0.3, "a": 0.4, "m": 1.3},
    ),
    "disc": Case(
        disc,
        {"phi": 0.3, "theta": 1.2, "phi_dot": 1.1, "theta_dot": 0.3, "psi_dot": 8.0},
        ["x", "y", "phi", "theta", "psi", "phi_dot", "theta_dot", "psi_dot"],
        ["x_dot", "y_dot"],
        {"r": 0.3},
    ),
    "wagon": Case(
        wagon,
        {"x": 0.2, "bob_x": 0.6, "bob_y": -0.5, "x_dot": 0.5, "bob_x_dot": 0.3},
        ["x", "theta", "bob_x", "x_dot", "bob_x_dot"],
        ["bob_y", "theta_dot", "bob_y_dot"],
        {"r": 0.3, "l": 0.7},
    ),
}
every_case = pytest.mark.parametrize("case", CASES.values(), ids=CASES)


def begun_and_ended(simulation: pendula.Simulation) -> Numbers:
    return np.array([simulation.state, simulation.advance_to(0.5).state])


def slopes(case: Case, of: Callable[[pendula.Simulation], Numbers], names: Iterable[str]) -> list[Numbers]:
    """By independent coordinates and rates."""
    here = dict(zip(case.begin().names, case.begin().state, strict=True))
    return [difference(lambda h, name=name: of(case.begin({name: here[name] + h})), 3e-4) for name in names]


@every_case
def test_derivatives_are_those_of_the_steps(case: Case) -> None:
    first = case.begin()
    moved = pendula.differentiate(
        case.model(), 0.5, start=dict(zip(first.names, first.state, strict=True)), step=0.02, stages=3
    )
    for start, end in slopes(case, begun_and_ended, case.names):
        assert np.allclose(moved.by_start[0] @ start, end, rtol=0, atol=1e-9)  # measured up to 7.3e-12
    for name, value in case.parameters.items():
        start, end = difference(
            lambda h, name=name, value=value: begun_and_ended(case.begin(**{name: value + h})), 3e-4
        )
        found = moved.by_start[0] @ start + moved.by_parameters[name][0, :, 0]
        assert np.allclose(found, end, rtol=0, atol=1e-9), name  # measured up to 2.8e-11
    pushed = difference(lambda h: begun_and_ended(case.begin(push=h)), 1e-3)[1]
    assert np.allclose(moved.by_inputs["push"][0, :, 0], pushed, rtol=0, atol=1e-8)  # measured up to 1.2e-10


@every_case
def test_linear_systems_are_of_independent_coordinates_and_rates(case: Case) -> None:
    simulation = case.begin()
    linear = simulation.linearize()
    count = len(simulation.names) // 2
    rates = [name for name in linear.names if name in simulation.names[count:]]
    assert len(linear.names) == len(case.names) and linear.inputs == ["push"]
    # From the coordinates of the case to those that linearize took.
    places = [simulation.names.index(name) for name in linear.names]
    bases = np.array(slopes(case, lambda made: made.state, case.names)).T
    by_names = np.linalg.inv(bases[places])
    assert np.allclose(linear.basis, bases @ by_names, rtol=0, atol=1e-9)  # measured up to 2.3e-11
    moved = np.array(slopes(case, accelerations, case.names)).T @ by_names
    wanted = [moved[simulation.names.index(name) - count] for name in rates]
    assert np.allclose(linear.A[-len(rates) :], wanted, rtol=0, atol=1e-8)  # measured up to 3.1e-10
    assert np.allclose(
        linear.A[: -len(rates)],
        linear.basis[[place + count for place in places[: -len(rates)]]],
        rtol=0,
        atol=0,
    )
    pushed = difference(lambda h: accelerations(case.begin(push=h)), 0.1)
    wanted = [pushed[simulation.names.index(name) - count] for name in rates]
    assert np.allclose(linear.B[-len(rates) :, 0], wanted, rtol=0, atol=1e-11)  # measured up to 7.2e-15


def test_a_step_of_a_linear_system_is_its_exponential() -> None:
    from scipy.linalg import expm

    start = {"theta": np.pi / 2, "psi_dot": -6.0}  # it rolls straight on
    continuous = pendula.linearize(disc(), start)
    discrete = pendula.linearize(disc(), start, step=0.1, tolerance=1e-12)
    assert np.allclose(discrete.A, expm(0.1 * continuous.A), rtol=0, atol=1e-10)  # measured 2.5e-15
    assert discrete.names == continuous.names


def test_exponents_are_those_of_the_motions_that_keep_constraints() -> None:
    """Five coordinates and three rates of a disc that rolls around bends, regularly."""
    found = pendula.lyapunov(disc(), 200.0, start={"theta": 1.2, "phi_dot": 1.1, "psi_dot": 8.0}, step=0.02)
    assert len(found.exponents) == 8
    assert np.all(np.abs(found.exponents) < 3 * found.errors)  # measured up to 0.014, errors from 0.017 on
    assert abs(sum(found.exponents)) < 1e-3  # measured 8.4e-5

"""Derivatives of motions, against differences of motions whose steps have the same sizes."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pendula
import pytest
from numpy.typing import NDArray

Numbers = NDArray[np.float64]
OPTIONS: dict[str, Any] = {"step": 0.01, "stages": 3}
CASES: dict[str, tuple[Callable[..., pendula.Chain], dict[str, Any], dict[str, Any]]] = {
    f"{space}, {solver}": (
        lambda space=space, **more: pendula.Chain(
            **{"masses": [1.0, 2.0], "damping": 0.1, **more}, space=space
        ),
        start,
        {"solver": solver},
    )
    for space, start in (
        ("planar", {"theta": [1.0, 0.5], "theta_dot": [0.1, 0.2]}),
        ("spatial", {"theta": [1.0, 0.5], "phi": [0.1, 0.2], "theta_dot": [0.1, 0.2], "phi_dot": [2, 2.5]}),
    )
    for solver in ("dense", "chain")
}


def difference(moved: Callable[[float], Numbers], h: float = 1e-3) -> Numbers:
    """Its derivative at 0, with an error of order h^4."""
    return (8 * (moved(h) - moved(-h)) - (moved(2 * h) - moved(-2 * h))) / (12 * h)


def end(system: pendula.Chain | pendula.Model, start: dict[str, Any], **options: Any) -> Numbers:
    return pendula.Simulation(system, start, **OPTIONS, **options).advance_to(1.0).state


@pytest.mark.parametrize("case", CASES)
def test_derivatives_are_those_of_the_steps(case: str) -> None:
    chain, start, options = CASES[case]
    moved = pendula.differentiate(chain(), 1.0, start=start, **OPTIONS, **options)
    assert np.array_equal(moved.y[:, -1], end(chain(), start, **options))

    def of_theta(change: float) -> Numbers:
        return end(chain(), {**start, "theta": [1.0 + change, 0.5]}, **options)

    def of_rate(change: float) -> Numbers:
        return end(chain(), {**start, "theta_dot": [0.1, 0.2 + change]}, **options)

    half = len(moved.names) // 2
    # Differences of the fourth order: measured up to 7.2e-10 in space, 1.8e-11 in the plane.
    assert np.allclose(moved.by_start[0, :, 0], difference(of_theta), rtol=0, atol=5e-9)
    assert np.allclose(moved.by_start[0, :, half + 1], difference(of_rate), rtol=0, atol=5e-9)
    for name, first, place in (
        ("masses", [1.0, 2.0], 0),
        ("lengths", [1.0, 1.0], 1),
        ("damping", [0.1, 0.1], 1),
    ):

        def of_parameter(
            change: float, name: str = name, first: list[float] = first, place: int = place
        ) -> Numbers:
            values = list(first)
            values[place] += change
            return end(chain(**{name: values}), start, **options)

        # Measured up to 3.7e-10 (lengths in space).
        assert np.allclose(
            moved.by_parameters[name][0, :, place], difference(of_parameter), rtol=0, atol=5e-9
        )
    torques = moved.by_inputs["torque"].shape[-1]

    def of_torque(change: float) -> Numbers:
        torque: Any = [change, 0.0] if torques == 2 else [[change, 0.0, 0.0], [0.0, 0.0, 0.0]]
        return end(chain(torque=torque), start, **options)

    # Measured up to 4.7e-12.
    assert np.allclose(moved.by_inputs["torque"][0, :, 0], difference(of_torque), rtol=0, atol=5e-9)


def test_a_model_has_its_own_parameters_and_inputs() -> None:
    start = {"theta": 0.4, "x_dot": 0.3}

    def moved(**more: Any) -> Numbers:
        return end(pendula.Model("cart_chain", links=1, **more), start)

    found = pendula.differentiate(pendula.Model("cart_chain", links=1), 1.0, start=start, **OPTIONS)
    by_mass = difference(lambda change: moved(cart_mass=1.0 + change))
    by_push = difference(lambda change: moved(inputs={"push": change}))
    # Measured 8.8e-12 and 2.1e-13.
    assert np.allclose(found.by_parameters["cart_mass"][0, :, 0], by_mass, rtol=0, atol=1e-10)
    assert np.allclose(found.by_inputs["push"][0, :, 0], by_push, rtol=0, atol=1e-10)


@pytest.mark.parametrize("case", CASES)
def test_backward_is_the_transpose_of_forward(case: str) -> None:
    chain, start, options = CASES[case]
    times = [0.3, 0.305, 1.0]
    forward = pendula.differentiate(chain(), t=times, start=start, **OPTIONS, **options)
    run = chain().simulate(t=times, **start, **OPTIONS, **options, estimate=False)
    weights = np.random.default_rng(1).normal(size=forward.y.shape)
    back = run.gradient(weights[:, 1:] if run.t.size == 2 else weights)
    ahead = np.einsum("ik,kij->j", weights, forward.by_start)
    # Rounding: measured up to 4.4e-14 of numbers up to 9.
    assert np.allclose(back.start, ahead, rtol=1e-12, atol=1e-12)
    for name, found in {**back.parameters, **back.inputs}.items():
        by = {**forward.by_parameters, **forward.by_inputs}[name]
        assert np.allclose(found, np.einsum("ik,kij->j", weights, by), rtol=1e-12, atol=1e-12)


def test_the_derivative_of_a_step_of_a_chosen_size_holds_its_size() -> None:
    chain = pendula.Chain(masses=[1, 1])
    start = {"theta": [2.0, 1.0]}
    found = pendula.differentiate(chain, 3.0, start=start, tolerance=1e-10)
    alike = pendula.differentiate(chain, 3.0, start=start, step=1e-3, stages=4)
    # Two ways to the derivative of the motion itself: measured 1.7e-9 of numbers up to 23.
    assert np.allclose(found.by_start, alike.by_start, rtol=0, atol=1e-7)


def bounced(height: float, restitution: float) -> tuple[float, Numbers]:
    """A ball above a floor: where it is after a second, and the derivative by its height, by hand."""
    g, duration = 9.81, 1.0
    hit = np.sqrt(2 * height / g)
    hit_by = 1 / np.sqrt(2 * height * g)
    up, up_by = restitution * g * hit, restitution * g * hit_by
    rest = duration - hit
    return up * rest - g * rest**2 / 2, np.array([up_by * rest - up * hit_by + g * rest * hit_by])


def test_a_gradient_through_a_bounce_has_the_time_of_the_bounce() -> None:
    """Differentiated as if the bounce came at the same time, the gradient is 1, not 0.22."""

    @pendula.model
    def ball(model: Any, links: int) -> None:
        y = model.coordinate("y", "m")
        model.lagrangian = model.rate(y) ** 2 / 2 - 9.81 * y

    system, height, restitution = ball(), 2.0, 0.8
    down = pendula.differentiate(system, 5.0, start={"y": height}, until="y", direction="down")
    after = np.diag([1.0, -restitution])  # what the bounce makes of (y, y_dot)
    state = after @ down.y[:, -1]
    rest = 1.0 - down.t[-1]
    up = pendula.differentiate(system, rest, start={"y": 0.0, "y_dot": state[1]})
    field = np.array([up.y[1, -1], -9.81])  # the end comes later where the bounce comes earlier
    total = up.by_start[0] @ after @ down.by_start[-1] - np.outer(field, down.time_by_start)
    place, by_height = bounced(height, restitution)
    # Measured 1.6e-15 and 4.1e-15.
    assert up.y[0, -1] == pytest.approx(place, abs=1e-12)
    assert total[0, 0] == pytest.approx(by_height[0], abs=1e-12)
    plain = pendula.differentiate(system, float(down.t[-1]), start={"y": height})
    frozen = (up.by_start[0] @ after @ plain.by_start[-1])[0, 0]
    assert frozen == pytest.approx(1.0, abs=1e-12)


def test_until_has_the_derivative_of_the_crossing() -> None:
    chain = pendula.Chain(masses=[1, 1])

    def crossing(change: float) -> Numbers:
        run = chain.simulate(
            2.0,
            theta=[1.0 + change, 0.5],
            events={"low": {"when": "theta_1 + 0.1*sin(theta_2)", "stop": True}},
            step=0.005,
            stages=4,
            estimate=False,
        )
        return np.array([run.t[-1], *run.y[:, -1]])

    found = pendula.differentiate(
        chain, 2.0, start={"theta": [1.0, 0.5]}, until="theta_1 + 0.1*sin(theta_2)", step=0.005, stages=4
    )
    by_first = np.array([found.time_by_start[0], *found.by_start[-1, :, 0]])
    # Measured 1.5e-11: the crossing's row is taken by a shorter step.
    assert np.allclose(by_first, difference(crossing), rtol=0, atol=1e-8)


@pytest.mark.parametrize(
    "until", ["(1.5 + theta_2)^theta_1 - 1.2", "2^theta_1 - 1.5", "theta_2 + max(theta_1, t)^2 - 1"]
)
def test_powers_of_what_moves_have_their_slopes(until: str) -> None:
    chain = pendula.Chain(masses=[1, 1])

    def crossing(change: float) -> Numbers:
        event = {"when": until, "stop": True}
        run = chain.simulate(
            2.0, theta=[1.0 + change, 0.5], events={"it": event}, step=0.005, stages=4, estimate=False
        )
        return run.t[-1:]

    found = pendula.differentiate(chain, 2.0, start={"theta": [1.0, 0.5]}, until=until, step=0.005, stages=4)
    # Measured up to 1.9e-11.
    assert np.allclose(found.time_by_start[0], difference(crossing), rtol=0, atol=1e-8)


def test_linearize_by_steps_is_the_exponential_of_the_continuous_one() -> None:
    cart = pendula.Model("cart_chain", links=2)
    a, b = pendula.linearize(cart)
    discrete_a, discrete_b = pendula.linearize(cart, step=0.05, tolerance=1e-12)
    size, inputs = b.shape
    both = np.zeros((size + inputs, size + inputs))
    both[:size] = np.hstack([a, b])
    power, total = np.eye(size + inputs), np.eye(size + inputs)
    for k in range(1, 30):
        power = power @ (0.05 * both) / k
        total += power
    # Measured 1e-15.
    assert np.allclose(discrete_a, total[:size, :size], rtol=0, atol=1e-11)
    assert np.allclose(discrete_b, total[:size, size:], rtol=0, atol=1e-11)


@pytest.mark.parametrize(
    ("system", "start"),
    [
        (pendula.Chain(masses=[1.0, 2.0], damping=0.1), {"theta": [1.0, 0.5], "theta_dot": [0.1, 0.2]}),
        (pendula.Model("cart_chain", links=2), {"theta": [1.0, 0.5]}),
        (pendula.Model("cart_chain", links=4), {"theta": [1.0, 0.5, 0.2, -0.1]}),
    ],
    ids=["chain", "model", "more directions than lanes"],
)
def test_taylor_series_have_the_derivatives_of_gauss_steps(system: Any, start: dict[str, Any]) -> None:
    series, gauss = (
        pendula.differentiate(system, 2.0, start=start, method=method, tolerance=1e-13)
        for method in ("taylor", "gauss")
    )
    for found, expected in (
        (series.by_start, gauss.by_start),
        *((series.by_parameters[name], gauss.by_parameters[name]) for name in gauss.by_parameters),
    ):
        assert np.abs(expected).max() > 0
        assert np.allclose(found, expected, rtol=1e-10, atol=1e-10)  # measured 2.8e-12


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"duration": 1.0, "method": "dopri5", "tolerance": 1e-9}, "expected method = gauss or radau"),
        ({"t": [1.0, 0.5]}, "t: expected a vector of times from 0 on, ascending"),
        ({"t": [[1.0]]}, "t: expected a vector of times, got an array of shape (1, 1)"),
        ({"duration": float("nan")}, "duration: expected a finite number"),
        ({"duration": 1.0, "t": [1.0]}, "duration: expected none beside t"),
        (
            {"duration": 1.0, "until": "energy + 1"},
            "until: expected an expression in t, coordinates, rates, points and inputs without feedback, got energy",
        ),
        ({"duration": 1.0, "until": "theta_3"}, "until: "),
        ({"duration": 1.0, "until": "sign(theta_1)"}, "until: expected an expression that does not jump"),
        (
            {"duration": 1.0, "until": "theta_1 > 0 ? theta_1 : 1"},
            "until: expected an expression that does not jump",
        ),
        ({"duration": 1.0, "until": abs}, "until: expected an expression, got builtin_function_or_method"),
        ({"duration": 1.0, "direction": "left"}, 'direction: expected "both", "up" or "down", got \'left\''),
        ({"duration": -1.0}, "duration: expected a number, not negative, got -1.0"),
        ({"duration": 1.0, "estimate": False}, "differentiate: unknown keyword estimate"),
        ({"duration": 0.1, "until": "theta_1"}, "expected theta_1 to cross zero within 0.1 s"),
        ({"duration": 1.0, "start": [1.0]}, "start: expected a mapping"),
    ],
)
def test_what_cannot_be_differentiated_is_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(pendula.InputError) as refused:
        pendula.differentiate(pendula.Chain(links=2), **{"start": {"theta": [1.0, 0.5]}, **arguments})
    assert message in str(refused.value)
    with pytest.raises(pendula.InputError, match='units: expected "SI" for derivatives, got "natural"'):
        pendula.differentiate(pendula.Chain(links=1, units="natural"), 1.0, start={"theta": 0.5})
    at_pole = {"theta": [np.pi], "phi": [0.0]}
    for step in (None, 0.1):
        with pytest.raises(pendula.InputError, match="regular, got one at a pole"):
            pendula.linearize(pendula.Chain(links=1, space="spatial"), at_pole, step=step)
    with pytest.raises(pendula.InputError, match="tolerance: expected none without step"):
        pendula.linearize(pendula.Chain(links=1), tolerance=1e-9)
    with pytest.raises(pendula.InputError, match="by_end: expected shape"):
        pendula.Chain(links=1).simulate(0.1, theta=0.5).gradient([1, 2, 3])

"""Feedback of systems in Python, against inputs that a program computes and holds."""

from typing import Any

import numpy as np
import pendula
import pytest

LAW = "x - 65*(theta_1 - pi) + 3*x_dot - 19*theta_dot_1"


def law(state: Any) -> float:
    x, theta, speed, rate = state
    return float(x - 65 * (theta - np.pi) + 3 * speed - 19 * rate)


def cart(**feedback: object) -> pendula.Model:
    return pendula.Model("cart_chain", links=1, feedback=[{"input": "push", "value": LAW, **feedback}])


START: dict[str, object] = {"x": 0.1, "theta_1": 3.0}


def test_sampled_feedback_is_what_a_program_would_hold() -> None:
    run = cart(sample=0.1).simulate(2.0, start=START, interval=0.1, tolerance=1e-10)
    simulation = pendula.Simulation(pendula.Model("cart_chain", links=1), START, tolerance=1e-10)
    states, pushes = [simulation.state], []
    for _ in range(20):
        pushes.append(law(states[-1]))
        simulation.step(0.1, push=pushes[-1])
        states.append(simulation.state)
    assert np.abs(run.y - np.array(states).T).max() < 1e-9  # measured 2e-16
    assert np.abs(run["push"][:-1] - pushes).max() < 1e-9  # measured 2e-15


def test_a_function_gives_inputs_of_a_simulation() -> None:
    def control(t: float, state: Any) -> dict[str, float]:
        return {"push": law(state)}

    plant = pendula.Model("cart_chain", links=1)
    once, often = (pendula.Simulation(plant, START, tolerance=1e-10) for _ in range(2))
    once.step(2.05, control, 0.1)
    for duration in [0.1] * 20 + [0.05]:
        often.step(duration, push=law(often.state))
    assert once.time == 2.05
    assert np.abs(once.state - often.state).max() < 1e-12  # measured 3e-16
    once.step(0.5, control)  # asked once
    often.step(0.5, push=law(often.state))
    assert np.abs(once.state - often.state).max() < 1e-12
    with pytest.raises(pendula.InputError, match=r"sample: expected a time > 0, got 0\.0"):
        once.step(0.5, control, 0.0)
    with pytest.raises(pendula.InputError, match="sample: expected none where inputs are no function"):
        once.step(0.5, {"push": 1.0}, 0.1)
    with pytest.raises(pendula.InputError, match="inputs: expected a mapping"):
        once.step(0.5, lambda t, y: 3.0, 0.1)  # type: ignore[arg-type, return-value]
    with pytest.raises(ZeroDivisionError):
        once.step(0.5, lambda t, y: {"push": 1 / 0}, 0.1)
    assert once.time == 2.55


def test_continuous_feedback_is_differentiated() -> None:
    moved = pendula.differentiate(cart(), 1.0, start=START, tolerance=1e-12)
    step = 1e-5
    for k, name in enumerate(("x", "theta_1")):
        ends = [
            cart()
            .simulate(1.0, start={**START, name: float(START[name]) + side * step}, tolerance=1e-12)
            .y[:, -1]  # type: ignore[arg-type]
            for side in (1, -1)
        ]
        slope = (ends[0] - ends[1]) / (2 * step)
        assert np.abs(moved.by_start[0][:, k] - slope).max() < 1e-6  # measured 3e-10


def test_a_simulation_takes_continuous_feedback_alone() -> None:
    simulation = pendula.Simulation(cart(), START)
    run = cart().simulate(1.0, start=START, tolerance=1e-9, estimate=False)
    simulation.step(1.0)
    assert np.abs(simulation.state - run.y[:, -1]).max() < 1e-7  # measured 0
    simulation.hold(push=1.0)
    assert simulation["push"] == pytest.approx(1 + law(simulation.state), abs=1e-12)  # measured 0
    with pytest.raises(pendula.InputError, match="feedback: expected a continuous one, got one with sample"):
        pendula.Simulation(cart(sample=0.1), START)
    with pytest.raises(pendula.InputError, match="feedback: expected a continuous one, got one with sample"):
        pendula.differentiate(cart(sample=0.1), 1.0, start=START)


def test_chains_have_it() -> None:
    chain = pendula.Chain(
        masses=[1, 1], feedback=[{"input": "torque_2", "value": "-3*theta_dot_2", "sample": 0.01}]
    )
    run = chain.simulate(5.0, theta=1.0)
    assert run["torque_2"].shape == run.t.shape
    assert run["energy"][-1] < run["energy"][0] - 1


@pytest.mark.parametrize(
    ("feedback", "message"),
    [
        ("push", "feedback: expected a sequence of mappings, got str"),
        ([{"input": "pull", "value": "x"}], r"^feedback\[0\].input: expected an input: push; got \"pull\""),
        ([{"input": "push", "value": "abs(x)"}], r"^feedback\[0\].value: expected smooth functions"),
        ([{"input": "push", "value": "x", "limit": 1.0}], r"^feedback\[0\].limit: expected sample beside it"),
    ],
)
def test_wrong_feedback_is_refused(feedback: Any, message: str) -> None:
    with pytest.raises(pendula.InputError, match=message):
        pendula.Model("cart_chain", links=1, feedback=feedback).simulate(1.0)


def test_members_of_an_ensemble_have_sampled_feedback() -> None:
    fed = cart(sample=0.1)
    angles = np.array([3.0, 3.1])
    ends = pendula.ensemble(fed, 1.0, {"x": 0.1, "theta_1": angles}, tolerance=1e-10)
    alone = [
        fed.simulate(1.0, start={"x": 0.1, "theta_1": angle}, tolerance=1e-10).y[0, -1] for angle in angles
    ]
    assert np.abs(ends["x"].to_numpy() - alone).max() < 1e-9  # measured 0

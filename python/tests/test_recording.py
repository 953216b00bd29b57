"""Simulations as runs."""

import pickle

import numpy as np
import pendula
import pytest


def balanced(**options):
    """A cart that a loop holds upright, from a little off."""
    cart = pendula.Model("cart_chain", links=1, inputs={"push": 0.5})
    simulation = pendula.Simulation(cart, theta=np.pi + 0.05, **options)
    for _ in range(100):
        x, theta, x_dot, theta_dot = simulation.state
        simulation.step(0.02, push=x - 65 * (theta - np.pi) + 3 * x_dot - 19 * theta_dot)
    return simulation


def test_a_control_loop_is_a_run(tmp_path):
    simulation = balanced()
    run = simulation.record(interval=0.02, events={"upright": "theta_1 - pi"})
    assert run.success and run.t.size == 101 and run.columns[1:5] == simulation.names
    assert np.abs(run.y[:, -1] - simulation.state).max() == 0
    states = np.array([simulation.at(t) for t in run.t]).T
    assert np.abs(run.y - states).max() < 1e-13  # measured 2.5e-16, of rows between steps
    assert run["push"][0] == simulation._holds[0.0][0] and np.ptp(run["push"]) > 1
    assert run["push"][-1] == simulation.inputs["push"]
    assert run.t_events["upright"].size > 0
    run.to_html(tmp_path / "loop.html")
    assert (tmp_path / "loop.html").stat().st_size > 10_000
    run.save(tmp_path / "loop.h5")
    assert np.array_equal(pendula.open(tmp_path / "loop.h5").y, run.y)
    assert np.abs(run.sol(1.011) - simulation.at(1.011)).max() < 1e-13


def test_copies_and_pickles_have_what_was_held():
    simulation = balanced()
    for other in (simulation.copy(), pickle.loads(pickle.dumps(simulation))):
        other.step(0.5, push=1.0)
        run = other.record()
        assert np.abs(run.y[:, -1] - other.state).max() == 0
        assert run["push"][-1] == 1.0
    assert simulation.record().t[-1] == simulation.time < 2.1


def test_a_chain_is_recorded_and_what_was_not_held_is_none():
    chain = pendula.Simulation(pendula.Chain(masses=[1, 1]), theta=0.5, step=0.01)
    chain.step(1.0)
    run = chain.record()
    assert np.abs(run.y[:, -1] - chain.state).max() == 0
    chain.step(1.0, torque_2=0.3)
    run = chain.record()
    assert np.abs(run.y[:, -1] - chain.state).max() == 0
    assert run["torque_2"][-1] == 0.3 and run["torque_2"][0] == 0.0
    with pytest.raises(pendula.InputError, match="record: expected a simulation with remember=True"):
        pendula.Simulation(pendula.Chain(links=1), remember=False, theta=0.1).record()

"""Step by step, and many at once."""

import copy
import pickle
import signal
import threading
import time

import numpy as np
import pendula
import pytest

DOUBLE = pendula.Chain(masses=[1, 1])


def test_a_simulation_is_a_run():
    simulation = pendula.Simulation(DOUBLE, {"theta": [1.5, 1.0]}, step=0.01, stages=4)
    run = DOUBLE.simulate(1.0, theta=[1.5, 1.0], step=0.01, stages=4, estimate=False)
    for _ in range(100):
        simulation.step(0.01)
    assert simulation.steps == 100
    assert np.abs(simulation.state - run.y[:, -1]).max() < 1e-12  # measured 0
    assert abs(simulation["energy"] - run.energy[-1]) < 1e-12
    assert np.abs(simulation.at(0.505) - DOUBLE.simulate(0.505, theta=[1.5, 1.0]).y[:, -1]).max() < 1e-8


def test_copies_and_pickles_go_on_to_the_bit():
    first = pendula.Simulation(DOUBLE, theta="100 deg", tolerance=1e-10).hold(torque_1=0.3).advance_to(1.0)
    others = [first.copy(), copy.deepcopy(first), pickle.loads(pickle.dumps(first))]
    first.step(2.0, torque_2=-0.1)
    for other in others:
        assert other.time == 1.0 and other.inputs["torque_1"] == 0.3
        other.step(2.0, torque_2=-0.1)
        assert other.time == 3.0
        assert np.array_equal(other.state, first.state)


def test_inputs_are_held():
    cart = pendula.Simulation(pendula.Model("cart_chain"), tolerance=1e-10)
    assert cart.inputs == {"push": 0.0}
    cart.step(0.5, push=3.0)
    assert cart.inputs == {"push": 3.0} and cart.time == 0.5
    assert cart["x"] > 0
    with pytest.raises(ValueError, match="input: expected one of push, got pull"):
        cart.step(0.1, pull=1.0)
    with pytest.raises(ValueError, match="expected"):
        cart.hold(push=float("nan"))
    with pytest.raises(ValueError, match=r"time: expected at least 0\.5 s"):
        cart.advance_to(0.25)
    with pytest.raises(ValueError, match="column: expected one of t, x"):
        cart["y"]


def test_linearization_is_exact():
    A, B = pendula.linearize(DOUBLE)
    g = 9.81
    expected = np.array([[0, 0, 1, 0], [0, 0, 0, 1], [-2 * g, g, 0, 0], [2 * g, -2 * g, 0, 0]])
    assert np.abs(A - expected).max() < 1e-12  # measured 7e-15
    assert np.abs(B[2:] - [[1, -1], [-1, 2]]).max() < 1e-12
    A, _ = pendula.linearize(pendula.Chain(links=1), {"theta": "180 deg"})
    assert abs(A[1, 0] - g) < 1e-12


def test_exponents_add_up_to_nothing():
    found = pendula.lyapunov(DOUBLE, 100.0, theta="90 deg", step=0.01, stages=4)
    assert found.exponents.shape == (4,) and found.duration == 100.0
    assert abs(found.sum) < 1e-10  # measured 1e-12
    assert 0.5 < found.exponents[0] < 1.5  # measured 0.79
    assert pendula.lyapunov(DOUBLE, 10.0, theta="90 deg", count=1).exponents.shape == (1,)
    with pytest.raises(ValueError, match="count: expected 1 to 4 exponents, got 7"):
        pendula.lyapunov(DOUBLE, 10.0, theta="90 deg", count=7)


def test_members_are_simulations():
    starts = np.random.default_rng(3).uniform(-1, 1, (20, 2))
    ends = pendula.ensemble(DOUBLE, 2.0, {"theta": starts, "theta_dot_1": 0.5}, tolerance=1e-11)
    assert ends.sizes == {"member": 20} and not ends["status"].values.any()
    for k in (0, 7, 19):
        alone = pendula.Simulation(DOUBLE, {"theta": starts[k], "theta_dot": [0.5, 0]}, tolerance=1e-11)
        alone.advance_to(2.0)
        found = np.array(
            [ends[name].values[k] for name in ("theta_1", "theta_2", "theta_dot_1", "theta_dot_2")]
        )
        assert np.abs(found - alone.state).max() < 1e-8  # measured 3e-10
    one, two = (pendula.ensemble(DOUBLE, 2.0, {"theta": starts}, threads=n) for n in (1, 2))
    assert one.equals(two)


def test_members_of_space_and_of_models():
    spatial = pendula.Chain(links=2, space="spatial")
    ends = pendula.ensemble(
        spatial, 0.5, {"theta": np.full((4, 2), 0.4), "phi": np.arange(8.0).reshape(4, 2)}
    )
    alone = pendula.Simulation(spatial, {"theta": 0.4, "phi": [2, 3]}).advance_to(0.5)
    names = ["theta_1", "theta_2", "phi_1", "phi_2", "theta_dot_1", "theta_dot_2", "phi_dot_1", "phi_dot_2"]
    assert np.abs([ends[name].values[1] for name in names] - alone.state).max() < 1e-7  # measured 3e-10
    ends = pendula.ensemble(pendula.Model("cart_chain"), 0.5, {"theta": [0.1, 0.2, 0.3]})
    assert ends["x"].shape == (3,)


@pytest.mark.parametrize(
    ("start", "message"),
    [
        ({"theta": np.zeros((3, 3))}, r"start: expected \(members, 2\) for theta, got shape \(3, 3\)"),
        ({"theta": np.zeros(3)}, r"start: expected \(members, 2\) for theta, got shape \(3,\)"),
        ({"theta_1": np.zeros((3, 2))}, r"start: expected a number or \(members,\) for theta_1"),
        (
            {"theta": np.zeros((3, 2)), "theta_dot_1": np.zeros(4)},
            "start: expected as many members of each, got 3, 4",
        ),
        ({"theta": np.zeros((3, 2)), "theta_1": 1.0}, "start: theta_1 is given twice"),
        ({"theta": [[0, float("nan")]]}, "start: expected finite numbers for theta_2, got nan"),
        ({"alpha": 1.0}, "start: expected one of theta_1, .*, got alpha"),
        ({"theta": "ninety"}, "could not convert string to float"),
    ],
)
def test_wrong_starts_are_named(start, message):
    with pytest.raises(ValueError, match=message):
        pendula.ensemble(DOUBLE, 1.0, start)
    with pytest.raises(TypeError, match="ensemble: expected the options of a run, got steps"):
        pendula.ensemble(DOUBLE, 1.0, {}, steps=3)


# Ctrl-C within a tenth of a second: seen 0.05 s; with room for a machine that does other things, too.
@pytest.mark.parametrize(
    "work",
    [
        lambda: DOUBLE.simulate(1e7, theta=1.5, step=1e-3, every=10**9),
        lambda: pendula.Simulation(DOUBLE, {"theta": 1.5}, step=1e-3).advance_to(1e7),
        lambda: pendula.ensemble(DOUBLE, 1e6, {"theta": np.ones((64, 2))}),
        lambda: pendula.lyapunov(DOUBLE, 1e7, theta=1.5),
    ],
    ids=["simulate", "simulation", "ensemble", "lyapunov"],
)
def test_an_interrupt_ends_work(work):
    pressed = []

    def press() -> None:
        pressed.append(time.monotonic())
        signal.raise_signal(signal.SIGINT)

    timer = threading.Timer(0.3, press)
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        work()
    assert time.monotonic() - pressed[0] < 1.0
    timer.join()


def test_other_threads_go_on_meanwhile():
    ticks = []
    stop = threading.Event()

    def tick() -> None:
        while not stop.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    began = time.monotonic()
    DOUBLE.simulate(500.0, theta=1.5, step=1e-3, every=10**9, estimate=False)
    ended = time.monotonic()
    stop.set()
    thread.join()
    assert sum(began < at < ended for at in ticks) > 5  # of 0.1 s and more

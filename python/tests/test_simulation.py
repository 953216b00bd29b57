"""Step by step."""

import copy
import pickle
import resource
import subprocess
import sys
import threading

import numpy as np
import pendula
import pytest
from conftest import interrupted, ticks_during

DOUBLE = pendula.Chain(masses=[1, 1])


def test_a_simulation_is_a_run():
    simulation = pendula.Simulation(DOUBLE, {"theta": [1.5, 1.0]}, step=0.01, stages=4)
    run = DOUBLE.simulate(1.0, theta=[1.5, 1.0], step=0.01, stages=4, estimate=False)
    for _ in range(100):
        simulation.step(0.01)
    assert simulation.steps == 100
    assert np.abs(simulation.state - run.y[:, -1]).max() < 1e-12  # measured 1.0e-14
    assert abs(simulation["energy"] - run.energy[-1]) < 1e-12  # measured 1.8e-15
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
    with pytest.raises(ValueError, match="inputs: expected some of push, got pull"):
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
    assert np.abs(A - expected).max() < 1e-12  # measured 0
    assert np.abs(B[2:] - [[1, -1], [-1, 2]]).max() < 1e-12
    A, _ = pendula.linearize(pendula.Chain(links=1), {"theta": "180 deg"})
    assert abs(A[1, 0] - g) < 1e-12


# Of a motion that is regular: one chaotic run's exponent is no truth.
def test_exponents_are_those_of_a_regular_motion():
    found = pendula.lyapunov(DOUBLE, 100.0, theta=0.1, step=0.01, stages=4)
    assert found.exponents.shape == (4,) and found.duration == 100.0
    assert abs(found.sum) < 1e-10  # measured 7e-18
    assert abs(found.exponents[0]) < 0.2  # measured 0.0019
    assert pendula.lyapunov(DOUBLE, 10.0, theta="90 deg", count=1).exponents.shape == (1,)
    with pytest.raises(ValueError, match="count: expected 1 to 4 exponents, got 7"):
        pendula.lyapunov(DOUBLE, 10.0, theta="90 deg", count=7)


# Of chains in space.
def test_every_order_is_that_of_names():
    spatial = pendula.Chain(masses=[1, 2], space="spatial")
    start = {"theta": [0.4, 0.5], "phi": [1.0, 2.0]}
    run = spatial.simulate(1.0, **start)
    simulation = pendula.Simulation(spatial, start).advance_to(1.0)
    assert (
        run.names
        == simulation.names
        == [*(f"{a}_{k}" for a in ("theta", "phi", "theta_dot", "phi_dot") for k in (1, 2))]
    )
    assert np.abs(run.y[:, -1] - simulation.state).max() < 1e-7  # measured 2.1e-9
    assert all(np.array_equal(run[name], run.y[k]) for k, name in enumerate(run.names))


def test_a_pole_has_no_linearization():
    with pytest.raises(pendula.InputError, match="expected a state where the equations are regular"):
        pendula.linearize(pendula.Chain(links=1, space="spatial"))


def test_a_pickle_knows_its_model(tmp_path):
    file = tmp_path / "osc.py"
    text = "def define(model, links):\n    x = model.coordinate('x', 'm')\n"
    text += "    model.lagrangian = model.rate(x)**2/2 - {}*x**2/2\n"
    file.write_text(text.format(4))
    pickled = pickle.dumps(pendula.Simulation(pendula.Model(file), x=1.0))
    assert pickle.loads(pickled).advance_to(0.1).time == 0.1
    file.write_text(text.format(9))
    with pytest.raises(pendula.InputError, match="expected the model that was pickled, got another one"):
        pickle.loads(pickled)


def test_one_thread_at_a_time():
    simulation = pendula.Simulation(DOUBLE, theta=1.5, step=1e-3)
    refused, done = [], threading.Event()

    def read() -> None:
        while not done.is_set():
            try:
                simulation.at(simulation.time / 2)
                simulation.copy()
            except RuntimeError as error:
                refused.append(str(error))

    thread = threading.Thread(target=read)
    thread.start()
    ended = 0.0
    while ended < 50:
        try:
            simulation.step(5.0)
            ended += 5
        except RuntimeError as error:
            refused.append(str(error))
    done.set()
    thread.join()
    assert set(refused) <= {"simulation: expected one thread at a time, got a second one"}


def test_python_ends_while_threads_run():
    program = (
        "import pendula, threading, time\n"
        "double = pendula.Chain(masses=[1, 1])\n"
        "simulation = pendula.Simulation(double, theta=1.5, step=1e-3)\n"
        "run = lambda: double.simulate(1e7, theta=1.5, step=1e-3, every=10**9)\n"
        "for work in (run, lambda: simulation.advance_to(1e7)):\n"
        "    threading.Thread(target=work, daemon=True).start()\n"
        "time.sleep(0.2)\n"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr) == (0, "")


def test_copies_do_not_keep_what_they_are_copies_of():
    simulation = pendula.Simulation(DOUBLE, theta=1.5)
    for k in range(3000):
        simulation = simulation.copy()
        simulation.step(0.01)
        if k == 1000:
            before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert (
        resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 20_000
    )  # kB; measured 128; with all of them 370,000


def test_inputs_are_held_all_or_none():
    simulation = pendula.Simulation(DOUBLE, theta=0.1)
    with pytest.raises(pendula.InputError, match="got bogus"):
        simulation.hold(torque_2=7.0, bogus=3.0)
    with pytest.raises(
        pendula.InputError, match=r"torque_1: expected a finite number or a string in N m, got '3'"
    ):
        simulation.hold({"torque_2": 7.0, "torque_1": "3"})
    assert simulation.inputs == {"torque_1": 0.0, "torque_2": 0.0}
    assert simulation.hold({"torque_1": 1}, torque_2=2.0).inputs == {"torque_1": 1.0, "torque_2": 2.0}


def test_numbers_may_have_units():
    plain = pendula.Simulation(DOUBLE, theta=0.1).step(0.01, torque_1=0.1, torque_2=0.1).advance_to(0.02)
    units = pendula.Simulation(DOUBLE, theta=0.1).step("10 ms", torque="10 N cm").advance_to("20 ms")
    assert units.inputs == plain.inputs and np.array_equal(units.state, plain.state)
    assert np.array_equal(units.at("5 ms"), plain.at(0.005))
    for call in (pendula.lyapunov, lambda *given, **more: pendula.differentiate(*given, **more).y):
        assert np.array_equal(call(DOUBLE, "1 s", theta=0.1)[0], call(DOUBLE, 1.0, theta=0.1)[0])
    assert np.array_equal(pendula.linearize(DOUBLE, step="100 ms").A, pendula.linearize(DOUBLE, step=0.1).A)
    with pytest.raises(
        pendula.InputError, match="duration: expected a finite number or a string in s, got '1 m'"
    ):
        plain.step("1 m")


def test_units_of_a_natural_system_are_converted():
    natural = pendula.Chain(
        links=1, gravity=10.0, lengths=0.4, units="natural"
    )  # a time of 0.2 s, an energy of 4 J
    simulation = pendula.Simulation(natural, theta=0.1).step("400 ms", torque_1="8 N m")
    assert abs(simulation.time - 2) < 1e-15 and abs(simulation.inputs["torque_1"] - 2) < 1e-15  # measured 0


# Each takes hours. Seen 0.05 s; with room for a machine that does other things, too.
@pytest.mark.parametrize(
    "work",
    [
        lambda: DOUBLE.simulate(1e7, theta=1.5, step=1e-3, every=10**9),
        lambda: pendula.Simulation(DOUBLE, {"theta": 1.5}, step=1e-3).advance_to(1e7),
        lambda: pendula.lyapunov(DOUBLE, 1e7, theta=1.5),
    ],
    ids=["simulate", "simulation", "lyapunov"],
)
def test_an_interrupt_ends_work(work):
    assert interrupted(work) < 60


def test_other_threads_go_on_meanwhile():
    def work():
        DOUBLE.simulate(500.0, theta=1.5, step=1e-3, every=10**9, estimate=False)

    assert ticks_during(work) > 5  # seen 257


def test_a_driven_model_goes_as_its_run_and_has_exponents():
    drives = [{"input": "push", "amplitude": 3.0, "frequency": 2.0, "phase": 0.3}]
    cart = pendula.Model("cart_chain", links=1, drives=drives, inputs={"push": 0.5})
    run = cart.simulate(2.0, theta=0.3, tolerance=1e-11, method="gauss")
    alone = pendula.Simulation(cart, {"theta": 0.3}, tolerance=1e-11).advance_to(2.0)
    assert np.abs(alone.state - run.y[:, -1]).max() < 1e-13  # measured 0
    assert alone.inputs == {"push": 0.5}
    found = pendula.lyapunov(cart, 20.0, start={"theta": 0.3}, count=1, step=0.01)
    assert found.exponents.shape == (1,) and np.isfinite(found.exponents).all()

"""Models with functions of several pieces."""

import math
import pickle

import pendula
import pytest


@pendula.model
def bouncing(model, links):
    """A ball on a contact spring."""
    from sympy import Max

    x = model.coordinate("x", "m")
    k = model.parameter("k", "N/m", default=1000.0)
    lift = model.input("lift", "N")
    model.lagrangian = model.rate(x) ** 2 / 2 - 9.81 * x - k * Max(0, -x) ** 2 / 2
    model.force(x, lift)


@pendula.model
def rubbing(model, links):
    """A mass on a spring, with dry friction."""
    from sympy import sign

    x = model.coordinate("x", "m")
    v = model.rate(x)
    model.lagrangian = v**2 / 2 - x**2 / 2
    model.force(x, -0.3 * sign(v))


PERIOD = 2 * math.sqrt(2 / 9.81) + 2 * (
    math.pi - math.atan(math.sqrt(2 * 9.81) * math.sqrt(1000) / 9.81)
) / math.sqrt(1000)


def test_a_ball_comes_back():
    ball = bouncing()
    assert list(ball.parameters) == ["k"]
    run = ball.simulate(5 * PERIOD, start={"x": 1.0}, tolerance=1e-11)
    assert run["x"][-1] == pytest.approx(1, abs=1e-10)  # measured 2e-15
    assert abs(run.energy - 9.81).max() < 1e-9


def test_a_simulation_ends_its_steps_where_pieces_do():
    ball = pendula.Simulation(bouncing(), start={"x": 1.0}, tolerance=1e-11)
    for _ in range(10):
        ball.step(PERIOD / 4)
    copy = pickle.loads(pickle.dumps(ball))
    for one in (ball, copy):
        for _ in range(10):
            one.step(PERIOD / 4, lift=0.0)
        assert one["x"] == pytest.approx(1, abs=1e-9)


def test_what_holds_it_is_told():
    with pytest.raises(pendula.RunFailed, match="the motion is held where x_dot = 0") as failed:
        rubbing().simulate(40.0, start={"x": 5.0}, tolerance=1e-10)
    assert failed.value.partial["x"][-1] == pytest.approx(0.2, abs=1e-7)


def test_derivatives_are_refused():
    run = bouncing().simulate(1.0, start={"x": 1.0}, tolerance=1e-10)
    with pytest.raises(pendula.InputError, match="switches between pieces"):
        run.gradient([1, 0])
    a, _ = pendula.linearize(bouncing(), {"x": -0.1})
    assert a.tolist() == [[0, 1], [-1000, 0]]

"""Events that are functions of Python."""

import numpy as np
import pendula
import pytest

DOUBLE = pendula.Chain(masses=[1, 1])


def test_a_function_finds_what_an_expression_does():
    def low(t, y):
        return y[0] - 0.1 * t

    events = {"low": low, "same": "theta_1 - 0.1*t", "fast": lambda t, y: y[3]}
    run = DOUBLE.simulate(5.0, theta=1.0, step=0.02, events=events)
    assert run.t_events["low"].size == run.t_events["same"].size == 3
    assert np.abs(run.t_events["low"] - run.t_events["same"]).max() < 1e-14  # measured 0
    assert np.abs(run.y_events["fast"][:, 3]).max() < 1e-12  # measured 3e-16


def test_scipys_attributes_count():
    def up(t, y):
        return y[0]

    up.direction = 1
    down = {"when": up, "direction": "down"}
    run = DOUBLE.simulate(
        5.0, theta=1.0, step=0.02, events={"up": up, "down": down, "both": {"when": up, "direction": 0}}
    )
    assert run.t_events["up"].size + run.t_events["down"].size == run.t_events["both"].size > 2
    assert (run.y_events["up"][:, 2] > 0).all() and (run.y_events["down"][:, 2] < 0).all()
    up.terminal = True
    run = DOUBLE.simulate(5.0, theta=1.0, step=0.02, events={"up": up})
    assert run.status == 1 and run.t[-1] == run.t_events["up"][0] and "up" in run.message
    assert np.array_equal(run.sol(run.t), run.y)


def test_an_exception_comes_out_as_itself():
    class MineError(Exception):
        pass

    def fail(t, y):
        if t > 1:
            raise MineError("at last")
        return 1.0

    for more in ({"step": 0.01}, {"accuracy": 1e-9}):
        with pytest.raises(MineError, match="at last"):
            DOUBLE.simulate(5.0, theta=1.0, events={"fail": fail}, **more)
    for error in (ValueError("of the user"), pendula.InputError("of the user"), KeyError("y")):

        def wrong(t, y, error=error):
            raise error

        with pytest.raises(type(error)) as raised:
            DOUBLE.simulate(1.0, theta=1.0, events={"wrong": wrong})
        assert raised.value is error
    with pytest.raises(TypeError):
        DOUBLE.simulate(5.0, theta=1.0, events={"text": lambda t, y: "no number"})
    assert DOUBLE.simulate(0.5, theta=1.0, events={"fail": fail}).success


def test_a_run_with_functions_goes_on_in_its_process_only(tmp_path):
    run = DOUBLE.simulate(1.0, theta=1.0, step=0.01, events={"low": lambda t, y: y[0]})
    on = run.go_on(3.0)
    whole = DOUBLE.simulate(3.0, theta=1.0, step=0.01, events={"low": "theta_1"})
    assert np.array_equal(on.y, whole.y) and np.array_equal(on.t_events["low"], whole.t_events["low"])
    on.save(tmp_path / "run.h5")
    opened = pendula.open(tmp_path / "run.h5")
    assert np.array_equal(opened.t_events["low"], on.t_events["low"])
    for again in (
        lambda: opened.sol(0.5),
        lambda: opened.go_on(4.0),
        lambda: opened.to_html(tmp_path / "page.html"),
    ):
        with pytest.raises(
            pendula.InputError, match=r"run.h5: expected a run whose events are expressions, got one"
        ):
            again()


def test_inputs_are_held():
    cart = pendula.Model("cart_chain", inputs={"push": 1.0})
    run = cart.simulate(1.0, theta=0.1, inputs={"push": 2.0}, step=0.01)
    assert (run["push"] == 2.0).all() and (cart.simulate(0.1)["push"] == 1.0).all()
    sine = {"input": "push", "amplitude": 1.0, "frequency": 2.0}
    driven = pendula.Model("cart_chain", drives=[sine]).simulate(1.0, inputs={"push": 0.5})
    assert np.abs(driven["push"] - 0.5 - np.sin(2 * driven.t)).max() < 1e-14  # measured 2e-16

"""Linear systems: what is measured, frequencies and damping."""

import copy
import pickle

import numpy as np
import pendula
import pytest

DOUBLE = pendula.Chain(masses=[1, 2], lengths=[1.0, 0.5])
STATE = {"theta": [0.3, -0.4], "theta_dot": [0.5, 0.6]}


def outputs_at(system, state, wanted):
    return np.array([pendula.Simulation(system, state)[name] for name in wanted])


# Against exact slopes of a chain, and differences of a model with a point that its cart moves.
def test_points_are_measured():
    linear = pendula.linearize(DOUBLE, STATE)
    assert (
        linear.outputs == ["x_1", "y_1", "x_2", "y_2"] and linear.names == DOUBLE.coordinates + DOUBLE.rates
    )
    t1, t2 = STATE["theta"]
    truth = [[np.cos(t1), 0], [np.sin(t1), 0], [np.cos(t1), 0.5 * np.cos(t2)], [np.sin(t1), 0.5 * np.sin(t2)]]
    assert np.abs(linear.C[:, :2] - truth).max() < 1e-15 and not linear.C[:, 2:].any()  # measured 0
    assert linear.D.shape == (4, 2) and not linear.D.any()
    cart = pendula.Model("cart_chain", links=2)
    linear = pendula.linearize(cart, theta=[0.3, 2.0], x=1.0)
    for k, name in enumerate(cart.coordinates):
        ends = []
        for change in (-1e-5, 1e-5):
            there = {"x": 1.0, "theta_1": 0.3, "theta_2": 2.0}
            there[name] += change
            ends.append(outputs_at(cart, there, linear.outputs))
        slopes = (ends[1] - ends[0]) / 2e-5
        assert np.abs(linear.C[:, k] - slopes).max() < 1e-9  # measured 1.2e-11, of the differences


def test_own_outputs_are_expressions_of_columns():
    cart = pendula.Model("cart_chain", links=1)
    outputs = {"bend": "theta_1^2 - x", "power": "push * x_dot", "speed": "x_dot"}
    start = {"theta": 0.3, "x_dot": 2.0}
    linear = pendula.linearize(cart, start, outputs=outputs)
    assert linear.outputs == ["bend", "power", "speed"] and linear.inputs == ["push"]
    assert np.abs(linear.C - [[-1, 0.6, 0, 0], [0, 0, 0, 0], [0, 0, 1, 0]]).max() < 1e-15  # measured 0
    assert np.array_equal(linear.D, [[0], [2], [0]])
    held = pendula.Simulation(cart, start).hold(push=5.0).linearize(["push * x_dot"])
    assert held.outputs == ["push * x_dot"] and np.array_equal(held.C, [[0, 0, 5, 0]])
    discrete = pendula.linearize(cart, start, step=0.01, outputs=outputs)
    assert np.array_equal(discrete.C, linear.C) and discrete.step == 0.01
    for wrong, told in (
        (["energy"], "outputs: expected .* got energy"),
        (["thet_1"], "outputs: expected .*did you mean theta_1"),
        (["sign(x)"], "does not jump"),
        ("x", "outputs: expected columns"),
        ([1], "outputs: expected columns"),
    ):
        with pytest.raises(pendula.InputError, match=told):
            pendula.linearize(cart, start, outputs=wrong)


# A bob on a rod, damped by a known ratio; hanging, and upside down.
def test_frequencies_and_damping_are_told():
    w = np.sqrt(9.81 / 2.0)
    hanging = pendula.Chain(links=1, masses=3.0, lengths=2.0, damping=2 * 0.1 * w * 3.0 * 4.0)
    linear = pendula.linearize(hanging, theta=0.0)
    assert np.allclose(linear.frequencies, w / (2 * np.pi), rtol=1e-14)  # measured 1e-15
    assert np.allclose(linear.damping, 0.1, rtol=1e-13)  # measured 3e-15
    assert np.allclose(sorted(linear.eigenvalues.imag), [-w * np.sqrt(0.99), w * np.sqrt(0.99)], rtol=1e-13)
    discrete = pendula.linearize(hanging, theta=0.0, step=0.05, tolerance=1e-13)
    assert np.allclose(discrete.frequencies, linear.frequencies, rtol=1e-9)  # measured 2e-13
    assert np.allclose(discrete.damping, 0.1, rtol=1e-8)  # measured 6e-13
    upright = pendula.linearize(pendula.Chain(lengths=2.0, links=1), theta="180 deg")
    assert np.allclose(sorted(upright.damping), [-1, 1], rtol=1e-14)


def test_a_linear_system_is_a_and_b():
    linear = pendula.linearize(DOUBLE)
    a, b = linear
    assert a is linear.A and b is linear.B and linear[0] is a
    for other in (pickle.loads(pickle.dumps(linear)), copy.deepcopy(linear)):
        assert (
            np.array_equal(other.A, a) and np.array_equal(other.C, linear.C) and other.names == linear.names
        )
    assert "x_1" in repr(linear)


# The until of a motion may be a point's, too.
def test_a_motion_is_differentiated_to_where_a_point_is():
    def time(change):
        event = {"it": {"when": "x_2 + 0.1", "stop": True}}
        start = {"theta": [0.3 + change, -0.4]}
        return DOUBLE.simulate(2.0, start=start, events=event, step=0.005, stages=4, estimate=False).t[-1]

    found = pendula.differentiate(DOUBLE, 2.0, theta=[0.3, -0.4], until="x_2 + 0.1", step=0.005, stages=4)
    slope = (time(1e-4) - time(-1e-4)) / 2e-4
    assert abs(found.time_by_start[0] - slope) < 1e-6  # measured 2.5e-8, of the differences

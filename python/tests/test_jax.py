"""Motions in JAX, against their derivatives without it."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pendula
import pendula.jax
import pytest

jax.config.update("jax_enable_x64", True)

CHAIN = pendula.Chain(masses=[1, 1], torque=[0.1, 0.2])
STATE = np.array([1.0, 0.5, 0.0, 0.0])
TIMES = [0.5, 1.0]
PARAMETERS = {"lengths": np.array([1.0, 1.2]), "torque": np.array([0.3, -0.2])}


def moved(state: Any, parameters: Any = None) -> Any:
    return pendula.jax.simulate(CHAIN, TIMES, state, parameters, step=0.01)


def plainly() -> pendula.Derivatives:
    chain = pendula.Chain(masses=[1, 1], lengths=[1.0, 1.2], torque=[0.3, -0.2])
    return pendula.differentiate(chain, t=TIMES, start={"theta": [1.0, 0.5]}, step=0.01)


def test_states_and_derivatives_are_the_same() -> None:
    plain = plainly()
    assert np.array_equal(moved(STATE, PARAMETERS), plain.y)
    by_state, by_values = jax.jacrev(moved, argnums=(0, 1))(STATE, PARAMETERS)
    assert np.allclose(by_state.swapaxes(0, 1), plain.by_start, rtol=0, atol=1e-14)  # measured 0
    of_lengths = plain.by_parameters["lengths"]
    assert np.allclose(by_values["lengths"].swapaxes(0, 1), of_lengths, rtol=0, atol=1e-14)  # measured 0
    assert np.allclose(by_values["torque"].swapaxes(0, 1), plain.by_inputs["torque"], rtol=0, atol=1e-14)
    ahead = jax.jacfwd(moved, argnums=(0, 1))(STATE, PARAMETERS)
    assert np.array_equal(ahead[0], by_state)


def test_calls_are_mapped_and_compiled() -> None:
    starts = np.stack([STATE, 1.1 * STATE, -STATE])
    one_by_one = np.stack([jax.grad(lambda state: moved(state)[0].sum())(start) for start in starts])
    gradients = jax.jit(jax.vmap(jax.grad(lambda state: moved(state)[0].sum())))(starts)
    assert np.array_equal(gradients, one_by_one)


def test_a_length_is_found_from_where_a_pendulum_was() -> None:
    pendulum = pendula.Chain(links=1)
    times = np.linspace(0.1, 2.0, 20)

    def seen(length: Any) -> Any:
        start = jnp.array([1.0, 0.0])
        return pendula.jax.simulate(pendulum, times, start, {"lengths": length[None]}, step=0.02)[0]

    truth = seen(jnp.array(1.3))
    length = jnp.array(1.1)
    for _ in range(8):  # Gauss-Newton
        missing, slope = seen(length) - truth, jax.jacfwd(seen)(length)
        length = length - missing @ slope / (slope @ slope)
    assert float(length) == pytest.approx(1.3, abs=1e-12)  # measured 2e-16


def test_a_model_has_parameters_and_inputs() -> None:
    def place(values: Any) -> Any:
        cart = pendula.Model("cart_chain", links=1, inputs={"push": 0.5})
        return pendula.jax.simulate(cart, [1.0], np.array([0.0, 0.1, 0.0, 0.0]), values, step=0.01)[0, 0]

    found = jax.grad(place)({"push": jnp.array(1.0), "cart_mass": jnp.array(2.0)})
    cart = pendula.Model("cart_chain", links=1, inputs={"push": 1.0}, cart_mass=2.0)
    plain = pendula.differentiate(cart, 1.0, start={"theta": 0.1}, step=0.01)
    assert float(found["push"]) == plain.by_inputs["push"][0, 0, 0]
    assert float(found["cart_mass"]) == plain.by_parameters["cart_mass"][0, 0, 0]


def test_derivatives_are_of_first_order() -> None:
    with pytest.raises(NotImplementedError, match="expected derivatives of first order"):
        jax.hessian(lambda state: moved(state).sum())(STATE)
    with pytest.raises(pendula.InputError, match="t: expected times that are known"):
        jax.jit(lambda t: pendula.jax.simulate(CHAIN, t, STATE))(jnp.array(TIMES))


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"t": [1.0, 0.5]}, "t: expected a vector of times from 0 on, ascending"),
        ({"state": np.zeros(3)}, r"state: expected shape \(4,\), got \(3,\)"),
        ({"parameters": {"length": 1.0}}, "parameters: expected some of masses, lengths, .*, got length"),
        ({"t": [np.inf]}, "t: expected a vector of times from 0 on, ascending"),
        ({"state": 1j * STATE}, "state: expected real numbers, got complex128"),
        ({"method": "rk4", "step": 0.01}, "expected method = gauss or radau in momentum form"),
        ({"duration": 1.0}, "simulate: unknown keyword duration"),
        ({"parameters": {"lengths": np.ones(3)}}, "parameters.lengths: expected 2 numbers, got 3"),
    ],
)
def test_wrong_arguments_are_refused(arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(pendula.InputError, match=message):
        pendula.jax.simulate(CHAIN, **{"t": TIMES, "state": STATE, **arguments})

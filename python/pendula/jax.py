"""Motions in JAX: differentiable forward and backward, and mapped (`pip install pendula[jax]`).

>>> import jax, numpy, pendula.jax
>>> jax.config.update("jax_enable_x64", True)
>>> chain = pendula.Chain(masses=[1, 1])
>>> def place(state):
...     return pendula.jax.simulate(chain, [1.0], state, step=0.01)[0, -1]
>>> jax.grad(place)(numpy.array([1.0, 0.5, 0.0, 0.0])).shape
(4,)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING, Any

import numpy as np

from ._core import InputError
from ._moved import Moved
from ._runs import mapping
from ._systems import System

try:
    import jax
    import jax.core
    import jax.numpy as jnp
except ImportError as _error:
    raise ImportError("pendula.jax: expected JAX, got none; pip install 'pendula[jax]'") from _error

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

Tree = dict[str, Any]


def simulate(
    system: System,
    t: ArrayLike,
    state: Any,
    parameters: Mapping[str, Any] | None = None,
    **options: Any,
) -> jax.Array:
    """The states of a motion at times, as a function that JAX differentiates and maps.

    First derivatives are those of the discrete motion, with step sizes held fixed: forward (``jax.jvp``) and backward
    (``jax.grad``) by the same matrices. Motions of a mapped call run on all processors.

    Parameters
    ----------
    system : Chain or Model
    t : (times,) array_like
        In s, ascending from 0 on; not differentiated.
    state : (coordinates + rates,) array
        At the start, in the order of :attr:`pendula.Simulation.names`.
    parameters : mapping of arrays, optional
        Parameters and inputs that vary, by name; the others are those of the system.
    tolerance, step, method, stages, solver, iteration
        As for :func:`pendula.differentiate`.

    Returns
    -------
    (coordinates + rates, times) array

    Raises
    ------
    InputError
        An argument is wrong, or JAX computes with 32 bits.
    jax.errors.JaxRuntimeError
        An error while JAX runs the motion, such as RunFailed or wrong values of parameters; its text has the message.
    """
    if jnp.zeros(0).dtype != jnp.float64:
        raise InputError(
            'simulate: expected JAX with 64 bits, jax.config.update("jax_enable_x64", True), got 32'
        )
    if isinstance(t, jax.core.Tracer):
        raise InputError("t: expected times that are known, got traced ones: they are not differentiated")
    moved = Moved(system, t, options)
    given = jnp.asarray(state)
    if jnp.iscomplexobj(given):
        raise InputError(f"state: expected real numbers, got {given.dtype}")
    start = given.astype(float)
    values = {name: jnp.asarray(one, float) for name, one in mapping("parameters", parameters).items()}
    moved.require(start, values)
    states: jax.Array = _function(moved)(start, values)
    return states


def _of_each(function: Callable[[Any, Tree], Any], states: NDArray[np.float64], values: Tree) -> Any:
    """Calls a function for each state of a mapped call, on as many threads as there are processors."""
    batch = states.shape[:-1]
    if not batch:
        return function(states, values)

    def of_one(place: tuple[int, ...]) -> Any:
        return function(states[place], {name: np.asarray(one)[place] for name, one in values.items()})

    with ThreadPoolExecutor() as threads:
        found = list(threads.map(of_one, np.ndindex(batch)))
    return jax.tree.map(lambda *parts: np.stack(parts).reshape(*batch, *parts[0].shape), *found)


def _array(shape: tuple[int, ...]) -> Any:
    return jax.ShapeDtypeStruct(shape, jnp.float64)  # type: ignore[no-untyped-call]


def _function(moved: Moved) -> Any:
    shape = (moved.size, moved.times.size)

    def called(function: Any, result: Any, *arguments: Any) -> Any:
        def of_each(state: Any, values: Tree) -> Any:
            return _of_each(function, np.asarray(state), values)

        return jax.pure_callback(of_each, result, *arguments, vmap_method="broadcast_all")

    @jax.custom_jvp
    def derivatives(state: Any, values: Tree) -> Any:
        matrices = jax.tree.map(lambda one: _array((*shape, one.size)), (state, values))
        return called(moved.derivatives, matrices, state, values)

    @derivatives.defjvp
    def _(primals: Any, tangents: Any) -> Any:
        raise NotImplementedError(
            "pendula.jax.simulate: expected derivatives of first order, got one of second"
        )

    @jax.custom_jvp
    def states(state: Any, values: Tree) -> Any:
        return called(moved.states, _array(shape), state, values)

    @states.defjvp
    def _(primals: Any, tangents: Any) -> Any:
        found = derivatives(*primals)
        parts = jax.tree.map(lambda matrix, dot: matrix @ jnp.ravel(dot), found, tangents)
        return states(*primals), sum(jax.tree.leaves(parts))

    return states

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

from . import _core
from ._core import InputError
from ._derivatives import Varied
from ._runs import mapping, numbers, plainly
from ._simulation import RUN_OPTIONS, Beginning
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


class _Moved:
    """A system at times, whose start, parameters and inputs vary."""

    def __init__(self, system: System, times: NDArray[np.float64], options: Mapping[str, object]) -> None:
        for name in options:
            if name not in ("tolerance", "step", *RUN_OPTIONS):
                known = ", ".join(("tolerance", "step", *RUN_OPTIONS))
                raise InputError(f"simulate: expected options among {known}, got {name}")
        self.system, self.times, self.options = system, times, options
        self.made = self._prepared(system)
        self.varied = Varied(self.made)
        self.size = int(self.made.start.size)
        # What has no derivatives is told now, and not while JAX runs it.
        none = np.zeros((self.size, 0)), np.zeros((self.varied.count, 0))
        with plainly():
            _core.forward(self.made, self.made.time, self.made.start, np.zeros(0), *none)

    def _prepared(self, system: System) -> _core.Prepared:
        rest = dict(self.options)
        tolerance, step = rest.pop("tolerance", None), rest.pop("step", None)
        return Beginning.of(
            system,
            system.at_zero(),
            tolerance=tolerance,  # type: ignore[arg-type]
            step=step,  # type: ignore[arg-type]
            options=rest,
            remember=False,
        ).prepare()

    def places(self, names: Mapping[str, object]) -> dict[str, slice]:
        known = {**self.varied.parameters, **self.varied.inputs}
        for name in names:
            if name not in known:
                raise InputError(f"parameters: expected some of {', '.join(known)}, got {name}")
        return {name: known[name] for name in names}

    def _start(self, state: Any, values: Tree) -> tuple[_core.Prepared, NDArray[np.float64]]:
        made = self.made
        if values:
            plain = {name: np.ravel(np.asarray(one, float)) for name, one in values.items()}
            inputs = {name: plain.pop(name) for name in self.varied.inputs if name in plain}
            made = self._prepared(self.system.replaced(plain, inputs))
        return made, np.ascontiguousarray(state, dtype=float)

    def states(self, state: Any, values: Tree) -> NDArray[np.float64]:
        """(coordinates + rates, times)"""
        return self._forward(state, values, np.zeros((self.size + self.varied.count, 0)))[0]

    def derivatives(self, state: Any, values: Tree) -> tuple[NDArray[np.float64], Tree]:
        """By the state and by each value: (coordinates + rates, times, numbers of it)."""
        places = self.places(values)
        seeds = np.eye(self.size + self.varied.count)
        columns = [slice(0, self.size)] + [
            slice(self.size + place.start, self.size + place.stop) for place in places.values()
        ]
        flat = self._forward(state, values, np.hstack([seeds[:, column] for column in columns]))[1]
        ends = np.cumsum([column.stop - column.start for column in columns])
        by_state, *by_values = np.split(flat, ends[:-1], axis=2)
        return by_state, dict(zip(places, by_values, strict=True))

    def _forward(
        self, state: Any, values: Tree, seeds: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        made, start = self._start(state, values)
        of_start, of_varied = (np.ascontiguousarray(part) for part in np.split(seeds, [self.size]))
        with plainly():
            states, flat = _core.forward(made, made.time, start, made.time + self.times, of_start, of_varied)
        return states.T, flat.reshape(self.times.size, self.size, -1).swapaxes(0, 1)


def simulate(
    system: System,
    t: ArrayLike,
    state: Any,
    parameters: Mapping[str, Any] | None = None,
    **options: Any,
) -> jax.Array:
    """The states of a motion at times, as a function that JAX differentiates and maps.

    Derivatives are those of the discrete motion, whose step sizes are held: forward (``jax.jvp``) and backward
    (``jax.grad``) by the same matrices, of first order. Motions of a mapped call run on all processors.

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
        What goes wrong while JAX runs the motion, as RunFailed and values of parameters: its text has the message.
    """
    if jnp.zeros(0).dtype != jnp.float64:
        raise InputError(
            'simulate: expected JAX with 64 bits, jax.config.update("jax_enable_x64", True), got 32'
        )
    if isinstance(t, jax.core.Tracer):
        raise InputError("t: expected times that are known, got traced ones: they are not differentiated")
    times = numbers("t", t)
    if (
        times.ndim != 1
        or times.size == 0
        or not np.all(times >= 0)
        or not np.all(np.isfinite(times))
        or np.any(np.diff(times) < 0)
    ):
        raise InputError(f"t: expected a vector of times from 0 on, ascending, got {t!r}")
    moved = _Moved(system, times, options)
    given = jnp.asarray(state)
    if jnp.iscomplexobj(given):
        raise InputError(f"state: expected real numbers, got {given.dtype}")
    start = given.astype(float)
    if start.shape != (moved.size,):
        raise InputError(f"state: expected shape ({moved.size},), got {start.shape}")
    values = {name: jnp.asarray(one, float) for name, one in mapping("parameters", parameters).items()}
    for name, place in moved.places(values).items():
        if values[name].size != place.stop - place.start:
            raise InputError(
                f"parameters.{name}: expected {place.stop - place.start} numbers, got {values[name].size}"
            )
    states: jax.Array = _function(moved)(start, values)
    return states


def _of_each(function: Callable[[Any, Tree], Any], states: NDArray[np.float64], values: Tree) -> Any:
    """What a function gives of each state of a mapped call, by as many threads as there are processors."""
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


def _function(moved: _Moved) -> Any:
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

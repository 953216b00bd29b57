"""Motions as functions of their start, parameters and inputs: what JAX and PyTorch differentiate."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _core
from ._core import InputError
from ._gradient import Gradient, Varied, gradient
from ._runs import plainly, require_known, unknown
from ._simulation import RUN_OPTIONS, Beginning
from ._systems import System, ascending_times

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray


class Moved:
    """A system at times, whose start, parameters and inputs vary."""

    def __init__(self, system: System, t: ArrayLike, options: Mapping[str, object]) -> None:
        for name in options:
            if name not in ("tolerance", "step", *RUN_OPTIONS):
                raise unknown("simulate", name, ("tolerance", "step", *RUN_OPTIONS))
        self.system, self.times, self.options = system, ascending_times(t), options
        self.made = self._prepared(system)
        self.varied = Varied(self.made)
        self.size = int(self.made.start.size)
        # Run once with no directions: a system without derivatives raises its error here, not later, inside JAX or
        # PyTorch.
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
        require_known("parameters", names, known)
        return {name: known[name] for name in names}

    def require(self, state: Any, values: Mapping[str, Any]) -> None:
        """Raises InputError unless arrays have the sizes of the system."""
        if tuple(state.shape) != (self.size,):
            raise InputError(f"state: expected shape ({self.size},), got {tuple(state.shape)}")
        for name, place in self.places(values).items():
            wanted, got = place.stop - place.start, int(np.prod(values[name].shape))
            if got != wanted:
                raise InputError(f"parameters.{name}: expected {wanted} numbers, got {got}")

    def _start(self, state: Any, values: Mapping[str, Any]) -> tuple[_core.Prepared, NDArray[np.float64]]:
        made = self.made
        if values:
            plain = {name: np.ravel(np.asarray(one, float)) for name, one in values.items()}
            inputs = {name: plain.pop(name) for name in self.varied.inputs if name in plain}
            made = self._prepared(self.system.replaced(plain, inputs))
        return made, np.ascontiguousarray(state, dtype=float)

    def states(self, state: Any, values: Mapping[str, Any]) -> NDArray[np.float64]:
        """(coordinates + rates, times)"""
        return self._forward(state, values, np.zeros((self.size + self.varied.count, 0)))[0]

    def derivatives(
        self, state: Any, values: Mapping[str, Any]
    ) -> tuple[NDArray[np.float64], dict[str, NDArray[np.float64]]]:
        """Derivatives with respect to the state and to each value: (coordinates + rates, times, numbers of it)."""
        places = self.places(values)
        seeds = np.eye(self.size + self.varied.count)
        columns = [slice(0, self.size)] + [
            slice(self.size + place.start, self.size + place.stop) for place in places.values()
        ]
        flat = self._forward(state, values, np.hstack([seeds[:, column] for column in columns]))[1]
        ends = np.cumsum([column.stop - column.start for column in columns])
        by_state, *by_values = np.split(flat, ends[:-1], axis=2)
        return by_state, dict(zip(places, by_values, strict=True))

    def gradient(self, state: Any, values: Mapping[str, Any], by_states: Any) -> Gradient:
        """The gradient of a number, from its gradient by the states, (coordinates + rates, times)."""
        made, start = self._start(state, values)
        return gradient(made, start, made.time + self.times, np.asarray(by_states, dtype=float))

    def _forward(
        self, state: Any, values: Mapping[str, Any], seeds: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        made, start = self._start(state, values)
        of_start, of_varied = (np.ascontiguousarray(part) for part in np.split(seeds, [self.size]))
        with plainly():
            states, flat = _core.forward(made, made.time, start, made.time + self.times, of_start, of_varied)
        return states.T, flat.reshape(self.times.size, self.size, -1).swapaxes(0, 1)

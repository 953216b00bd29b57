"""Gradients of a number that depends on a motion: with respect to the start, parameters and inputs."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from . import _core
from ._core import InputError
from ._runs import plainly

if TYPE_CHECKING:
    from numpy.typing import NDArray

    ByName = dict[str, NDArray[np.float64]]


class Gradient(NamedTuple):
    """The gradient of a number that depends on a motion."""

    start: NDArray[np.float64]  #: (coordinates + rates,)
    parameters: dict[str, NDArray[np.float64]]  #: by name: (numbers of it,)
    inputs: dict[str, NDArray[np.float64]]  #: the same


class Varied:
    """Names of parameters and inputs, and their places among all numbers. Raises InputError for natural units."""

    def __init__(self, made: _core.Prepared) -> None:
        if made.is_natural:
            raise InputError('units: expected "SI" for derivatives, got "natural"')
        self.parameters: dict[str, slice] = {}
        self.inputs: dict[str, slice] = {}
        self.count = 0
        for name, size, is_input in _core.varied_by(made):
            group = self.inputs if is_input else self.parameters
            group[name] = slice(self.count, self.count + size)
            self.count += size

    def by_name(self, numbers: NDArray[np.float64]) -> tuple[ByName, ByName]:
        """Splits the last axis into parameters and inputs by name."""
        return (
            {name: numbers[..., place] for name, place in self.parameters.items()},
            {name: numbers[..., place] for name, place in self.inputs.items()},
        )


def gradient(
    made: _core.Prepared,
    start: NDArray[np.float64],
    times: NDArray[np.float64],
    by_states: NDArray[np.float64],
) -> Gradient:
    """The gradient of a number, from its gradient by the states at the times, (coordinates + rates, times)."""
    varied = Varied(made)
    with plainly():
        _, by_start, by_varied = _core.backward(
            made, made.time, start, np.ascontiguousarray(times), np.ascontiguousarray(by_states)
        )
    return Gradient(by_start, *varied.by_name(by_varied))

"""Linearisations at a state."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _core
from ._core import InputError
from ._runs import mapping, plainly, state_names

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Outputs = Sequence[str] | Mapping[str, str]


class LinearSystem(tuple["NDArray[np.float64]", "NDArray[np.float64]"]):
    """The linearisation of a system at a state: dx/dt = A x + B u, y = C x + D u; unpack it by ``A, B = linear``.

    With a ``step`` it is discrete: x(t + step) = A x(t) + B u.

    Attributes
    ----------
    C, D : numpy.ndarray
        Derivatives of outputs with respect to the state and to inputs: a row for each output.
    basis : numpy.ndarray
        (2n, d): deviations of all n coordinates and their rates from those of x, which are d coordinates and rates from
        which the others follow by constraints. The identity without constraints.
    names, inputs, outputs : list of str
        Names of the numbers in x, u and y.
    step : float or None
        In s.
    """

    basis: NDArray[np.float64]
    C: NDArray[np.float64]
    D: NDArray[np.float64]
    names: list[str]
    inputs: list[str]
    outputs: list[str]
    step: float | None

    def __new__(cls, a: NDArray[np.float64], b: NDArray[np.float64], **told: Any) -> LinearSystem:
        made = super().__new__(cls, (a, b))
        vars(made).update(told)
        return made

    @property
    def A(self) -> NDArray[np.float64]:
        """(d, d)"""
        return self[0]

    @property
    def B(self) -> NDArray[np.float64]:
        """(d, inputs)"""
        return self[1]

    @property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Eigenvalues of A, the slowest first; in 1/s, for a discrete system without unit."""
        found: Any = np.linalg.eigvals(self.A).astype(complex)
        order = np.lexsort((-found.imag, np.abs(self._exponents(found)).round(12)))
        ordered: NDArray[np.complex128] = found[order]
        return ordered

    @property
    def frequencies(self) -> NDArray[np.float64]:
        """The undamped natural frequency of each eigenvalue, in Hz."""
        return np.abs(self._exponents(self.eigenvalues)) / (2 * np.pi)

    @property
    def damping(self) -> NDArray[np.float64]:
        """The damping ratio of each eigenvalue: 0 is undamped, from 1 on nothing swings, below 0 the motion grows; NaN
        for the eigenvalue 0."""
        found = self._exponents(self.eigenvalues)
        with np.errstate(invalid="ignore"):
            return (0.0 - found.real) / np.abs(found)

    def _exponents(self, eigenvalues: NDArray[np.complex128]) -> NDArray[np.complex128]:
        if self.step is None:
            return eigenvalues
        return np.asarray(np.log(eigenvalues) / self.step, dtype=complex)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (*self, vars(self))

    def __repr__(self) -> str:
        step = "" if self.step is None else f", step={self.step!r}"
        return f"<LinearSystem: {self.names} by {self.inputs}, seen as {self.outputs}{step}>"


def _again(a: NDArray[np.float64], b: NDArray[np.float64], told: Mapping[str, Any]) -> LinearSystem:
    return LinearSystem(a, b, **told)


def seen(
    made: _core.Prepared,
    outputs: Outputs | None,
    time: float,
    state: NDArray[np.float64],
    held: Sequence[float],
    independent: tuple[Sequence[int], NDArray[np.float64]],
) -> dict[str, Any]:
    """C and D of the measured quantities, the basis, and the names of all numbers. Raises InputError."""
    if isinstance(outputs, str) or not isinstance(outputs, (Mapping, Sequence, type(None))):
        raise InputError(f"outputs: expected columns or expressions, got {outputs!r}")
    if outputs is None:
        outputs = _core.point_columns(made)
    texts = mapping("outputs", outputs) if isinstance(outputs, Mapping) else {one: one for one in outputs}
    for text in texts.values():
        if not isinstance(text, str):
            raise InputError(f"outputs: expected columns or expressions, got {text!r}")
    with plainly():
        c, d = _core.output_slopes(made, list(texts.values()), time, state, list(held))
    places, basis = independent
    names = state_names(made)
    return {
        "C": c @ basis,
        "D": d,
        "basis": basis,
        "names": [names[place] for place in places],
        "inputs": made.inputs,
        "outputs": list(texts),
    }

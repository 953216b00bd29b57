"""Runs and what comes of them."""

from __future__ import annotations

import json
import math
import os
import re
import sys
import tomllib
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from . import _core

if TYPE_CHECKING:
    import xarray
    from matplotlib.axes import Axes
    from numpy.typing import ArrayLike, NDArray

    from ._derivatives import Gradient


class TrustWarning(UserWarning):
    """The rows of a run can be trusted less far than was asked for; the sentence says how far, and what helps."""


class RunFailed(RuntimeError):  # noqa: N818  (the name is fixed)
    """The computation failed. ``partial`` is the solution up to there, or the dataset of an ensemble none of whose
    members came to its end; None of a :class:`Simulation`."""

    def __init__(self, message: str, partial: Any = None) -> None:
        super().__init__(message)
        self.partial = partial

    def __reduce__(self) -> tuple[type[RunFailed], tuple[str, Any]]:
        return RunFailed, (str(self), self.partial)


class Solution:
    """Rows of a run, with SciPy's names.

    Attributes
    ----------
    t : (rows,) array
        Times, in s.
    y : (coordinates + rates, rows) array
        Coordinates, then their rates, in the order of ``names``: of a chain all theta, then all phi.
    names : list of str
        What the rows of ``y`` are; the order of :attr:`Simulation.state` and of :func:`linearize`, too.
    t_events, y_events : dict of arrays
        Times (events,) and states (events, coordinates + rates) of each event, by its name.
    status : int
        0: came to its end; 1: an event ended it; -1: it failed.
    message : str
    success : bool
    summary : dict
        As ``pendula simulate --json``: method, steps, energy error, warnings and more.
    columns, units : list of str
        Of all numbers that a row has: ``run["theta_1"]``; ``run["theta"]`` of all links is (links, rows).

    Notes
    -----
    Arrays are read-only. An event at the very start or end of the run is none.
    """

    def __init__(self, result: _core.Result, scenario: tuple[str, str, list[str]] | None = None) -> None:
        self._scenario = scenario
        self.columns: list[str] = result.columns
        self.units: list[str] = result.units
        self.summary: dict[str, Any] = json.loads(result.summary)
        self._rows: NDArray[np.float64] = result.take_rows()
        self._rows.flags.writeable = False
        self._state = np.array(result.state)
        self.names = [self.columns[k] for k in self._state]
        self.t: NDArray[np.float64] = self._rows[:, 0]
        self.y: NDArray[np.float64] = self._rows[:, self._state].T
        self.y.flags.writeable = False
        events = result.take_event_rows()
        happened = np.array(result.events, dtype=object)
        names = [event["name"] for event in self.summary.get("events", [])]
        self.t_events = {name: events[happened == name, 0] for name in names}
        self.y_events = {name: events[happened == name][:, self._state] for name in names}
        outcome = self.summary["outcome"]
        status = outcome["status"]
        self.status = 0 if status == "ok" else 1 if status == "stopped_by_event" else -1
        by_event = f"Event {outcome.get('event')} ended the run."
        usual = by_event if self.status == 1 else "The run came to its end."
        self.message: str = outcome.get("message") or usual
        self.success = self.status >= 0

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        """A column by its name; without an index, of all links, (links, rows)."""
        found = self._columns(name)
        return self._rows[:, found[0]] if name in self.columns else self._rows[:, found].T

    def _columns(self, name: str) -> list[int]:
        if name in self.columns:
            return [self.columns.index(name)]
        links = [
            k for k, column in enumerate(self.columns) if re.fullmatch(re.escape(name) + r"_\d+", column)
        ]
        if not links:
            raise KeyError(f"{name}: expected one of {', '.join(self.columns)}")
        return links

    def sol(self, t: ArrayLike) -> NDArray[np.float64]:
        """The motion at any times of the run, in any order, at the full order of the method.

        The run is made again for it, by the same steps.

        Parameters
        ----------
        t : float or (m,) array_like
            In s.

        Returns
        -------
        (coordinates + rates,) or (coordinates + rates, m) array
            In the order of ``names``.
        """
        when = numbers("t", t)
        if when.ndim > 1 or not np.all((when >= self.t[0]) & (when <= self.t[-1])):
            raise _core.InputError(f"t: expected times from {self.t[0]} to {self.t[-1]} s, got {t!r}")
        if self._scenario is None:
            raise RuntimeError("sol: expected a solution of this process, got one that was not made here")
        times, order = np.unique(when, return_inverse=True)
        text, name, overrides = self._scenario
        others = {*tomllib.loads(text).get("output", {}), *(one.split("=")[0][7:] for one in overrides)}
        rows = [f"output.{key}=" for key in ("every", "interval") if key in others]
        rows.append(f"output.times={(times - self.t[0]).tolist()}")
        with plainly():
            again = _core.simulate(text, name, [*overrides, *rows, "run.estimate=false"], *places(), tell)
        states = again.take_rows()[:, self._state].T
        return states[:, order.reshape(when.shape)]

    def gradient(self, by_end: ArrayLike) -> Gradient:
        """What a number that depends on where the run ends changes by.

        The run is made again for it, forth and back, by steps of the same sizes.

        Parameters
        ----------
        by_end : (coordinates + rates,) or (coordinates + rates, rows) array_like
            The number's gradient by the last state, or by those of all rows, in the order of ``names``.

        Returns
        -------
        Gradient
            By the start, by parameters and by inputs.

        Raises
        ------
        InputError
            An argument is wrong, or the method's steps have no derivative.

        Examples
        --------
        >>> import pendula
        >>> run = pendula.Chain(links=1).simulate(1.0, theta=0.5, step=0.01)
        >>> by_length = run.gradient([1, 0]).parameters["lengths"]  # of theta at the end
        """
        from ._derivatives import gradient

        given = numbers("by_end", by_end)
        if given.shape not in ((len(self.names),), self.y.shape):
            raise _core.InputError(
                f"by_end: expected shape ({len(self.names)},) or {self.y.shape}, got {given.shape}"
            )
        if not np.isfinite(given).all():
            raise _core.InputError("by_end: expected finite numbers, got others")
        if self._scenario is None:
            raise RuntimeError(
                "gradient: expected a solution of this process, got one that was not made here"
            )
        text, name, overrides = self._scenario
        with plainly():
            made = _core.prepare(text, name, overrides, *places(), tell, False)
        last = given.ndim == 1
        return gradient(made, self.t[-1:] if last else self.t, given[:, None] if last else given)

    @property
    def nfev(self) -> int:
        """Iterations on the stages of implicit steps, which evaluate the equations at all of them."""
        return int(self.summary.get("newton_iterations") or 0)

    @property
    def energy(self) -> NDArray[np.float64]:
        """T + U of each row, in J."""
        return self["energy"]

    @property
    def nsteps(self) -> int:
        """Steps that were taken."""
        return int(self.summary["steps"])

    def __repr__(self) -> str:
        s = self.summary
        return (
            f"<Solution: {self.t.size} rows to t = {self.t[-1]:.6g} s, {s['steps']} steps of {s['method']}, "
            f"energy error {s['energy_error_max']:.2g}: {self.message}>"
            if self.t.size
            else f"<Solution: no rows: {self.message}>"
        )

    def plot(self, *names: str, axes: Axes | None = None) -> Axes:
        """Draws columns over time with matplotlib; without names, the coordinates.

        >>> import pendula
        >>> axes = pendula.Chain(links=2).simulate(1.0, theta=1.0).plot("theta", "x_2")
        >>> [line.get_label() for line in axes.lines]
        ['theta_1 [rad]', 'theta_2 [rad]', 'x_2 [m]']
        """
        if axes is None:
            import matplotlib.pyplot as plt

            axes = plt.figure().add_subplot()
        if not names:
            names = tuple(self.columns[k] for k in self._state[: len(self._state) // 2])
        for name in names:
            for column in self._columns(name):
                unit = self.units[column]
                axes.plot(self.t, self._rows[:, column], label=f"{self.columns[column]} [{unit}]")
        axes.set_xlabel(f"t [{self.units[0]}]")
        axes.legend()
        return axes

    def to_xarray(self) -> xarray.Dataset:
        """All columns by name over ``t``, with their units."""
        import xarray

        data = {
            name: ("t", self._rows[:, k], {"units": self.units[k]})
            for k, name in enumerate(self.columns)
            if name != "t"
        }
        return xarray.Dataset(data, coords={"t": ("t", self.t, {"units": self.units[0]})})


@contextmanager
def plainly() -> Iterator[None]:
    """Errors about arguments name those, not lines of a text that nobody wrote."""
    try:
        yield
    except _core.StepFailed as error:
        raise RunFailed(str(error)) from None
    except ValueError as error:
        raise _core.InputError(_plain(str(error))) from None


def _plain(sentence: str) -> str:
    return re.sub(r"^pendula(:\d+)?: ", "", sentence).replace("--resume", "resume=True")


def places() -> tuple[str, str]:
    """Where the program of this package is, and the Python that derives kernels."""
    return str(Path(__file__).parent / "bin"), os.environ.get("PENDULA_PYTHON") or sys.executable


def warn(sentences: list[str], stacklevel: int) -> None:
    """Each is a TrustWarning at who called pendula."""
    for sentence in sentences:
        warnings.warn(_plain(sentence), TrustWarning, stacklevel=stacklevel)


def mapping(name: str, given: object) -> dict[str, Any]:
    """What was given by names. Raises InputError."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise _core.InputError(f"{name}: expected a mapping by names, got {type(given).__name__}")
    return {str(key): one for key, one in given.items()}


def merged(name: str, given: object, more: Mapping[str, object]) -> dict[str, Any]:
    """The same with keyword arguments, none of which may be there already."""
    found = mapping(name, given)
    for key in more:
        if key in found:
            raise _core.InputError(f"{name}: {key} is given twice")
    return {**found, **more}


def number(name: str, given: object) -> float:
    """A finite number that is one. Raises InputError."""
    if isinstance(given, (int, float, np.integer, np.floating)) and not isinstance(given, bool):
        found = float(given)
        if math.isfinite(found):
            return found
    raise _core.InputError(f"{name}: expected a finite number, got {given!r}")


def numbers(name: str, given: object) -> NDArray[np.float64]:
    """An array of numbers; NaN may be among them. Raises InputError."""
    if isinstance(given, np.ma.MaskedArray):
        raise _core.InputError(f"{name}: expected an array without a mask, got one with a mask")
    try:
        array = np.asarray(given)
    except ValueError as error:
        raise _core.InputError(f"{name}: expected an array of numbers, got {error}") from None
    if array.dtype.kind not in "iuf" and array.size > 0:
        raise _core.InputError(f"{name}: expected an array of numbers, got one of {array.dtype}")
    return array.astype(float)


def tell(what: str) -> None:
    print(f"pendula: {what}", file=sys.stderr)


def run_text(text: str, name: str = "pendula", overrides: list[str] | None = None) -> Solution:
    """Runs a scenario's text; ``name`` stands for its file in messages."""
    with plainly():
        result = _core.simulate(text, name, overrides or [], *places(), tell)
    solution = Solution(result, (text, name, overrides or []))
    warn(solution.summary["warnings"], stacklevel=4)
    if solution.status < 0:
        raise RunFailed(solution.message, solution)
    return solution

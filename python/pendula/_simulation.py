"""Step by step: simulations, linearizations and Lyapunov exponents."""

from __future__ import annotations

import hashlib
import math
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from . import _core, _toml
from ._core import InputError
from ._events import events_of
from ._inputs import MOTIONS
from ._linear import LinearSystem, seen
from ._runs import (
    columns_of,
    duration_of,
    in_order,
    mapping,
    merged,
    places,
    plainly,
    quantity,
    require_known,
    state_names,
    tell,
    warn,
    whole,
)
from ._solution import Solution, concluded
from ._systems import System, starts_of, system_of, times_of

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ._events import Event
    from ._linear import Outputs

    Inputs = Mapping[str, float | str]
    Controller = Callable[[float, NDArray[np.float64]], Inputs]

RUN_OPTIONS = ("method", "stages", "form", "solver", "iteration")


class Beginning(NamedTuple):
    """The beginning of a simulation, as it is pickled."""

    scenario: str
    unforced: str  # the same without constant parts of inputs
    remember: bool
    model_file: str | None
    model_hash: str | None

    @property
    def system(self) -> str:
        """The name of the table of the system."""
        return "chain" if self.scenario.startswith("[chain]") else "system"

    @property
    def has_method(self) -> bool:
        return "\nmethod = " in self.scenario

    @classmethod
    def of(
        cls,
        system: System,
        start: Mapping[str, object],
        *,
        tolerance: float | None,
        step: float | None,
        options: Mapping[str, object],
        remember: bool = True,
    ) -> Beginning:
        system = system_of(system)
        if step is None and tolerance is None:
            tolerance = 1e-9
        run = {"duration": 1.0, "step": step, "tolerance": tolerance, **options}

        def text_of(one: System) -> str:
            return _toml.document({**one.tables(), "start": start, "run": run})

        file = system.model_file()
        return cls(
            text_of(system),
            text_of(system.unforced()),
            remember,
            None if file is None else str(file),
            _hash(file),
        )

    def prepare(self) -> _core.Prepared:
        """The prepared run. Raises InputError, also if the model file has changed."""
        if self.model_file is not None and _hash(self.model_file) != self.model_hash:
            raise InputError(f"{self.model_file}: expected the model that was pickled, got another one")
        with plainly():
            return _core.prepare(self.scenario, "pendula", [], *places(), tell)


def _hash(file: object) -> str | None:
    if file is None:
        return None
    try:
        with open(str(file), "rb") as text:
            return hashlib.sha256(text.read()).hexdigest()
    except OSError:
        return None  # the reader of scenarios reports the error


def split(
    where: Callable[..., object], system: System, start: object, given: Mapping[str, object]
) -> tuple[dict[str, object], dict[str, object]]:
    """Splits keywords of ``where`` into a start and options of a run. Raises InputError for any other."""
    runs = {name: one for name, one in given.items() if name in RUN_OPTIONS}
    more = {name: one for name, one in given.items() if name not in runs}
    options = [*RUN_OPTIONS, *(where.__kwdefaults__ or ())]
    name = where.__qualname__.removesuffix(".__init__")
    return starts_of(name, system, start, more, options), runs


class Simulation:
    """A motion that is advanced call by call.

    Parameters
    ----------
    system : Chain or Model
        Held inputs replace the constant parts of its inputs; drives are added.
    start : mapping, optional
        As for :meth:`Chain.simulate`.
    tolerance, step : float, optional
        Adaptive steps, by default with a tolerance of 1e-9; or constant steps, in s.
    remember : bool
        Whether earlier steps are kept, for :meth:`at`. Each takes the memory of a state.
    method, stages, form, solver, iteration
        As ``[run]`` of a scenario.

    Raises
    ------
    InputError
        An argument is wrong.
    RunFailed
        The motion cannot begin.

    Notes
    -----
    Copies and pickles go on as the original does, to the last bit; pickles forget earlier steps. The accuracy of the
    motion is not checked by a second run, as :meth:`Chain.simulate` does. One thread at a time may use a simulation.

    Examples
    --------
    >>> import pendula
    >>> cart = pendula.Simulation(pendula.Model("cart_chain"), {"theta": 0.1}, tolerance=1e-9)
    >>> cart.step(0.5, push=2.0).time
    0.5
    """

    def __init__(
        self,
        system: System,
        start: Mapping[str, object] | None = None,
        *,
        tolerance: float | None = None,
        step: float | None = None,
        remember: bool = True,
        **options: object,
    ) -> None:
        starts, runs = split(Simulation.__init__, system, start, options)
        self._text = Beginning.of(
            system, starts, tolerance=tolerance, step=step, options=runs, remember=bool(remember)
        )
        self._begin()
        warn(self._made.warnings, stacklevel=3)

    def _begin(self) -> None:
        self._lock = threading.Lock()
        self._made = self._text.prepare()
        with plainly():
            self._core = _core.Simulation(self._made, self._text.remember)
            self._inputs = self._made.inputs
        self._places = {column: k for k, column in enumerate(self._made.columns)}
        self._holds = {self._core.time: self._core.held}  # inputs by the time since which they are held

    @contextmanager
    def _alone(self) -> Iterator[None]:
        if not self._lock.acquire(blocking=False):
            raise RuntimeError("simulation: expected one thread at a time, got a second one")
        try:
            with plainly():
                yield
        finally:
            self._lock.release()

    @property
    def time(self) -> float:
        """The present time, in s."""
        with self._alone():
            return self._core.time

    @property
    def steps(self) -> int:
        """Number of steps so far; for an unpickled simulation, those since then."""
        with self._alone():
            return self._core.steps

    @property
    def names(self) -> list[str]:
        """Names of the numbers of the state: coordinates, then their rates; for a chain all theta, then all phi."""
        return state_names(self._made)

    @property
    def state(self) -> NDArray[np.float64]:
        """Coordinates, then their rates, in the order of ``names``."""
        with self._alone():
            return self._core.state

    @property
    def inputs(self) -> dict[str, float]:
        """The held inputs by name; drives are added to them."""
        with self._alone():
            return dict(zip(self._inputs, self._core.held, strict=True))

    @property
    def columns(self) -> list[str]:
        """Names that ``simulation[name]`` knows, in the order of :attr:`Solution.columns`."""
        columns = self._made.columns
        return [columns[k] for k in in_order(columns, self._made.state)]

    def __getitem__(self, column: str) -> float:
        """A number of the row at the present time: ``simulation["x_2"]``, ``simulation["energy"]``."""
        if not isinstance(column, str):
            raise InputError(f"column: expected a name, got {column!r}")
        if column not in self._places:
            raise InputError(f"column: expected one of {', '.join(self._places)}, got {column}")
        with self._alone():
            return float(self._core.row()[self._places[column]])

    def hold(self, inputs: Inputs | None = None, **more: float | str) -> Simulation:
        """Holds inputs from now on, until others are held; ``torque`` is that of all links. Raises InputError, and
        changes nothing then."""
        given = {
            column: one
            for name, one in merged("inputs", inputs, more).items()
            for column in columns_of(name, self._inputs) or [name]
        }
        require_known("inputs", given, self._inputs, MOTIONS if self._text.model_file else "")
        values = {name: quantity(name, one, self._made, name) for name, one in given.items()}
        with self._alone():
            before = dict(zip(self._inputs, self._core.held, strict=True))
            if values:
                self._core.hold([{**before, **values}[name] for name in self._inputs])
                if self._text.remember and self._core.held != [*self._holds.values()][-1]:
                    self._holds[self._core.time] = self._core.held
        return self

    def advance_to(self, time: float | str) -> Simulation:
        """Advances to ``time``, in s, where a step ends. Raises RunFailed if the computation fails."""
        end = quantity("time", time, self._made)
        with self._alone():
            self._core.advance_to(end)
        return self

    def step(
        self,
        duration: float | str,
        inputs: Inputs | Controller | None = None,
        sample: float | str | None = None,
        /,
        **more: float | str,
    ) -> Simulation:
        """Holds inputs, and advances by ``duration``, in s: a zero-order hold, with the method's own steps inside.
        Numbers may have units: ``step("10 ms", push="100 mN")``.

        ``inputs`` may be a function of the time and the state that returns inputs by name: it is called every
        ``sample`` seconds, or once. For a law that is an expression of the columns, see ``feedback`` of the system.

        >>> import pendula
        >>> cart = pendula.Simulation(pendula.Model("cart_chain"), {"theta": 0.1})
        >>> cart.step(1.0, lambda t, y: {"push": -2 * y[2]}, 0.01).inputs["push"] != 0
        True
        """
        begin, left = self.time, quantity("duration", duration, self._made)
        if not callable(inputs):
            if sample is not None:
                raise InputError("sample: expected none where inputs are no function, got one")
            return self.hold(inputs, **more).advance_to(begin + left)
        every = left if sample is None else quantity("sample", sample, self._made)
        if not every > 0 and left > 0:
            raise InputError(f"sample: expected a time > 0, got {sample!r}")
        for k in range(max(1, math.ceil(left / every * (1 - 1e-12))) if left > 0 else 0):
            self.hold(mapping("inputs", inputs(self.time, self.state)), **more)
            self.advance_to(begin + min(left, (k + 1) * every))
        return self

    def at(self, time: float | str) -> NDArray[np.float64]:
        """The state at any time since the start, at the full order of the method."""
        when = quantity("time", time, self._made)
        with self._alone():
            return self._core.at(when)

    def record(
        self,
        *,
        t: ArrayLike | None = None,
        interval: float | None = None,
        events: Mapping[str, Event] | None = None,
    ) -> Solution:
        """The whole motion up to now as a run: rows, page, plots and events, with the inputs that were held.

        The run is repeated for it, with these inputs as signals: by steps of the same size or tolerance, which end
        where inputs changed, not at the end of every call. The run has an estimate of its error.

        Parameters
        ----------
        t, interval, events
            As for :meth:`Chain.simulate`.

        Raises
        ------
        InputError
            An argument is wrong, or the simulation has ``remember=False``.

        Examples
        --------
        >>> import pendula
        >>> cart = pendula.Simulation(pendula.Model("cart_chain"), theta=0.1)
        >>> for _ in range(50):
        ...     moved = cart.step(0.01, push=-20 * cart["theta_1"])
        >>> run = cart.record(interval=0.01)
        >>> run["push"].shape, run.success
        ((51,), True)
        """
        if not self._text.remember:
            raise InputError("record: expected a simulation with remember=True, got one with False")
        expressions, functions = events_of(events)
        times = None if t is None else times_of(t).tolist()
        every = 1 if times is None and interval is None else None
        more: dict[str, Any] = {
            f"{self._text.system}.signal": self._signals(),
            "output": {"times": times, "interval": interval, "every": every},
            "event": expressions,
        }
        text = self._text.unforced + _toml.document(more)
        keys = [f"run.duration={self.time - self._made.time!r}"]
        if not self._text.has_method:
            keys.append("run.method=gauss")
        names = {f"event[{k + 1}]": f"events.{one['name']}" for k, one in enumerate(expressions)}
        with plainly(names):
            result = _core.simulate(text, "pendula", keys, functions, None, *places(), tell)
        return concluded(result, names)

    def _signals(self) -> list[dict[str, object]]:
        """Tables of signals for the inputs that were held."""
        times, values = [*self._holds], np.array([*self._holds.values()])
        return [
            {"input": name, "times": times, "values": held.tolist(), "hold": True}
            for name, held in zip(self._inputs, values.T, strict=True)
            if held.any()
        ]

    def linearize(self, outputs: Outputs | None = None) -> LinearSystem:
        """The exact linearisation dx/dt = A x + B inputs at the present state, x = (q, v); with constraints of those
        coordinates from which the others follow. ``outputs`` are those of :func:`linearize`.

        Raises InputError if the equations are singular, as in space at a pole, where phi is undefined; and
        RuntimeError for a chain of more links than this build has kernels for.
        """
        with self._alone():
            found = self._core.linearize()
        if not all(np.isfinite(matrix).all() for matrix in found):
            raise InputError(
                "linearize: expected a state where the equations are regular, got one where they are not "
                "(in space phi has no meaning where sin(theta) is 0)"
            )
        return LinearSystem(*found, step=None, **self._seen(outputs))

    def _seen(self, outputs: Outputs | None) -> dict[str, Any]:
        """C and D at the present state, and the names of all numbers of a linear system."""
        with self._alone():
            independent = self._core.independent()
        held = list(self.inputs.values())
        return seen(self._made, outputs, self.time, self.state, held, independent)

    def copy(self) -> Simulation:
        """A simulation that goes on as this one does, to the last bit."""
        other = Simulation.__new__(Simulation)
        other._lock = threading.Lock()
        other._text, other._made = self._text, self._made
        other._inputs, other._places = self._inputs, self._places
        with self._alone():
            other._core = self._core.copy()
            other._holds = dict(self._holds)
        return other

    __copy__ = copy

    def __deepcopy__(self, memo: object) -> Simulation:
        return self.copy()

    def __getstate__(self) -> dict[str, object]:
        with self._alone():
            return {"text": tuple(self._text), "saved": self._core.save(), "holds": self._holds}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self._text = Beginning(*state["text"])
        self._begin()
        with self._alone():
            self._core.resume(np.ascontiguousarray(state["saved"], dtype=float))
            self._holds = state["holds"]

    def __repr__(self) -> str:
        return f"<Simulation: t = {self.time:.6g} s after {self.steps} steps>"


class Lyapunov(NamedTuple):
    """Lyapunov exponents of a motion, in 1/s."""

    exponents: NDArray[np.float64]  #: descending
    errors: NDArray[np.float64]  #: infinite if the run was too short
    sum: float  #: of the exponents; for a whole spectrum the mean divergence
    duration: float  #: of the run, in s
    ftle: float  #: finite-time exponent of one tangent
    megno: float  #: 2 for regular motion


def lyapunov(
    system: System,
    duration: float | str = 1000.0,
    *,
    count: int = 0,
    start: Mapping[str, object] | None = None,
    tolerance: float | None = None,
    step: float | None = None,
    **starts: object,
) -> Lyapunov:
    """The leading Lyapunov exponents, by the exact derivatives of the steps; ``count`` of them, 0: all.

    A motion has two for each coordinate, and two fewer for each independent constraint.

    >>> import pendula
    >>> pendula.lyapunov(pendula.Chain(links=1), 20.0, theta=0.5, step=0.02).exponents.shape
    (2,)
    """
    how_many = whole("count", count, 0)
    given, runs = split(lyapunov, system, start, starts)
    made = Beginning.of(system, given, tolerance=tolerance, step=step, options=runs).prepare()
    how_long = duration_of(duration, made)
    warn(made.warnings, stacklevel=3)
    with plainly():
        return Lyapunov(*_core.lyapunov(made, how_long, how_many))
